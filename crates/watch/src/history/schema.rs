//! The tables, their version, and what a file is that one is asked to open.

use super::{HistoryError, columns};
use rusqlite::Connection;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Version of the tables: 2 keeps turns beside the poses.
pub(super) const VERSION: i64 = 2;
/// "RSGT", which distinguishes a history from databases of other programs.
const APPLICATION: i64 = 0x5253_4754;
/// Another program may hold the file for a moment.
const PATIENCE: Duration = Duration::from_secs(2);
/// A file up to this size is checked completely when it is opened.
const CHECKED_BYTES: u64 = 64 << 20;
/// The write-ahead log is cut back to this after it was longer.
const LOG_BYTES: i64 = 16 << 20;

/// All tables except that of frames, which `columns` defines.
const TABLES: &str = "
CREATE TABLE session (
    id INTEGER PRIMARY KEY, began_unix_s REAL NOT NULL, ended_unix_s REAL, program TEXT NOT NULL);
CREATE TABLE pair (
    id INTEGER PRIMARY KEY, camera TEXT NOT NULL, target TEXT NOT NULL, UNIQUE (camera, target));
CREATE TABLE event (
    id INTEGER PRIMARY KEY, session INTEGER NOT NULL REFERENCES session, unix_s REAL NOT NULL, t_s REAL,
    camera TEXT, target TEXT, kind TEXT NOT NULL, state TEXT, detail TEXT NOT NULL);
";

/// Opens a file for writing, brings one of an earlier version up to date, and makes the tables where there are none.
pub(super) fn open(path: &Path) -> Result<Connection, HistoryError> {
    let reported = |e: rusqlite::Error| HistoryError::of(path, &e);
    let mut connection = Connection::open(path).map_err(reported)?;
    connection.busy_timeout(PATIENCE).map_err(reported)?;
    check(&connection, path)?;
    prepare(&mut connection).map_err(reported)?;
    Ok(connection)
}

/// Committed rows are on the disk, not in its cache, as `stored` guarantees.
fn prepare(connection: &mut Connection) -> rusqlite::Result<()> {
    connection.pragma_update(None, "auto_vacuum", "INCREMENTAL")?;
    connection.pragma_update_and_check(None, "journal_mode", "WAL", |_| Ok(()))?;
    connection.pragma_update(None, "synchronous", "FULL")?;
    connection.pragma_update_and_check(None, "journal_size_limit", LOG_BYTES, |_| Ok(()))?;
    let transaction = connection.transaction_with_behavior(rusqlite::TransactionBehavior::Immediate)?;
    let seen = number(&transaction, "user_version")?;
    if seen == 0 {
        transaction.execute_batch(TABLES)?;
        transaction.execute_batch(&columns::table())?;
        transaction.pragma_update(None, "application_id", APPLICATION)?;
    } else {
        transaction.execute_batch(&columns::additions(seen))?;
    }
    if seen < VERSION {
        transaction.pragma_update(None, "user_version", VERSION)?;
    }
    transaction.commit()
}

/// Checks that a file is empty, or a history that this program can read.
pub(super) fn check(connection: &Connection, path: &Path) -> Result<(), HistoryError> {
    let reported = |e: rusqlite::Error| HistoryError::of(path, &e);
    let tables: i64 =
        connection.query_row("SELECT count(*) FROM sqlite_schema", [], |row| row.get(0)).map_err(reported)?;
    let (application, seen) = (number(connection, "application_id"), number(connection, "user_version"));
    let (application, seen) = (application.map_err(reported)?, seen.map_err(reported)?);
    let path_buf = || path.to_path_buf();
    if application != APPLICATION {
        return if tables == 0 { Ok(()) } else { Err(HistoryError::Foreign { path: path_buf() }) };
    }
    if VERSION < seen {
        return Err(HistoryError::Newer { path: path_buf(), seen, known: VERSION });
    }
    if std::fs::metadata(path).is_ok_and(|file| file.len() <= CHECKED_BYTES) {
        let verdict: String =
            connection.query_row("PRAGMA quick_check(1)", [], |row| row.get(0)).map_err(reported)?;
        if verdict != "ok" {
            return Err(HistoryError::Corrupt { path: path_buf(), reason: verdict });
        }
    }
    Ok(())
}

pub(super) fn number(connection: &Connection, pragma: &str) -> rusqlite::Result<i64> {
    connection.pragma_query_value(None, pragma, |row| row.get(0))
}

/// Renames a damaged file and those that belong to it, and returns its new path.
pub(super) fn quarantine(path: &Path, unix_s: f64) -> Result<PathBuf, HistoryError> {
    let with = |suffix: &str| {
        let mut name = path.as_os_str().to_os_string();
        name.push(suffix);
        PathBuf::from(name)
    };
    let aside = (0..100)
        .map(|i| {
            format!(".corrupt-{}{}", unix_s as u64, if i == 0 { String::new() } else { format!("-{i}") })
        })
        .find(|suffix| !with(suffix).exists())
        .unwrap_or_else(|| ".corrupt".to_string());
    for part in ["", "-wal", "-shm"] {
        match std::fs::rename(with(part), with(&format!("{aside}{part}"))) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                let reason = format!("it is damaged and cannot be put aside: {e}");
                return Err(HistoryError::NoAccess { path: path.to_path_buf(), reason });
            }
            _ => {}
        }
    }
    Ok(with(&aside))
}
