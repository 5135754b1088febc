//! Writing: batches of rows in one transaction each, and a new file where the old one is damaged.

use super::columns::Written;
use super::rows::{EventRow, FrameRow};
use super::{HistoryError, schema};
use rusqlite::{Connection, Transaction, TransactionBehavior, params};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// A history open for writing, by one run of the program.
pub struct Store {
    pub(super) connection: Connection,
    pub(super) path: PathBuf,
    session: i64,
    /// Rows of the table of pairs, by the session's indices.
    pub(super) pairs: Vec<i64>,
    /// Device and number of the file that is open: another one may take its place.
    file: Option<(u64, u64)>,
}

/// A history and what was in its way.
pub struct Opened {
    /// The history.
    pub store: Store,
    /// The new path of a damaged file with this name, and its fault.
    pub put_aside: Option<(PathBuf, String)>,
}

/// Opening is tried again for this long while another program holds the file.
const OPENING: Duration = Duration::from_secs(5);

impl Store {
    /// Opens or begins a history and starts a session in it, with its pairs of camera and target. A damaged file is put aside as
    /// `FILE.corrupt-…` and a new one begun.
    ///
    /// # Errors
    /// A folder that cannot be written, a database of another program or a later version; `NotNow` on a full or failing disk.
    pub fn open(path: impl AsRef<Path>, pairs: &[(String, String)]) -> Result<Opened, HistoryError> {
        let path = path.as_ref();
        let began = Instant::now();
        loop {
            match Store::start(path, pairs) {
                Err(HistoryError::Corrupt { reason, .. }) => {
                    let aside = Store::put_aside(path)?;
                    let store = Store::start(path, pairs)?;
                    return Ok(Opened { store, put_aside: Some((aside, reason)) });
                }
                Err(error) if error.may_pass() && began.elapsed() < OPENING && is_held(&error) => {
                    std::thread::sleep(Duration::from_millis(20));
                }
                started => return Ok(Opened { store: started?, put_aside: None }),
            }
        }
    }

    fn start(path: &Path, pairs: &[(String, String)]) -> Result<Self, HistoryError> {
        let mut connection = schema::open(path)?;
        let (session, pairs) = begin(&mut connection, pairs).map_err(|e| HistoryError::of(path, &e))?;
        Ok(Store { connection, path: path.to_path_buf(), session, pairs, file: identity(path) })
    }

    /// Renames a damaged history, and returns its new path.
    ///
    /// # Errors
    /// A folder that cannot be written.
    pub fn put_aside(path: &Path) -> Result<PathBuf, HistoryError> {
        schema::quarantine(path, unix_s())
    }

    /// The number of this run in the history.
    pub fn session(&self) -> i64 {
        self.session
    }

    /// Stores rows, all or none; when it returns they are on the disk. A change of state is also written into the row of its frame, which
    /// came before it.
    ///
    /// # Errors
    /// `NotNow` on a full, failing or locked disk; `NoAccess` where another file has taken this one's place; `Corrupt`.
    pub fn append(&mut self, frames: &[FrameRow], events: &[EventRow]) -> Result<(), HistoryError> {
        if self.file != identity(&self.path) {
            let reason = "the file was moved or replaced while it was open".to_string();
            return Err(HistoryError::NoAccess { path: self.path.clone(), reason });
        }
        let (session, pairs) = (self.session, &self.pairs);
        let stored = write(&mut self.connection, |transaction| {
            let mut insert = transaction.prepare(&Written::statement())?;
            for frame in frames {
                // A pair that the session did not name has no row; the recorder's caller numbers both.
                let Some(pair) = pairs.get(frame.pair) else { continue };
                Written::frame(*pair, session, frame).insert(&mut insert)?;
            }
            events.iter().try_for_each(|event| insert_event(transaction, session, pairs, event))
        });
        stored.map_err(|e| HistoryError::of(&self.path, &e))
    }

    /// Records in the history that this run ended in good order.
    ///
    /// # Errors
    /// The errors of `append`.
    pub fn end(&mut self) -> Result<(), HistoryError> {
        let ended = "UPDATE session SET ended_unix_s = ?2 WHERE id = ?1";
        let done = self.connection.execute(ended, params![self.session, unix_s()]);
        done.map(|_| ()).map_err(|e| HistoryError::of(&self.path, &e))
    }
}

/// Starts a transaction that locks the file from the start: one that begins by reading could be refused when it writes.
pub(super) fn write<T>(
    connection: &mut Connection,
    work: impl FnOnce(&Transaction) -> rusqlite::Result<T>,
) -> rusqlite::Result<T> {
    let transaction = connection.transaction_with_behavior(TransactionBehavior::Immediate)?;
    let done = work(&transaction)?;
    transaction.commit()?;
    Ok(done)
}

/// Seconds since 1970.
pub(super) fn unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

fn is_held(error: &HistoryError) -> bool {
    matches!(error, HistoryError::NotNow { reason, .. } if reason.contains("locked"))
}

fn begin(connection: &mut Connection, pairs: &[(String, String)]) -> rusqlite::Result<(i64, Vec<i64>)> {
    write(connection, |transaction| {
        let program = concat!("resight ", env!("CARGO_PKG_VERSION"));
        let insert = "INSERT INTO session (began_unix_s, program) VALUES (?1, ?2)";
        transaction.execute(insert, params![unix_s(), program])?;
        let session = transaction.last_insert_rowid();
        let mut ids = Vec::new();
        for (camera, target) in pairs {
            let insert = "INSERT OR IGNORE INTO pair (camera, target) VALUES (?1, ?2)";
            transaction.execute(insert, params![camera, target])?;
            let select = "SELECT id FROM pair WHERE camera = ?1 AND target = ?2";
            ids.push(transaction.query_row(select, params![camera, target], |row| row.get(0))?);
        }
        Ok((session, ids))
    })
}

fn insert_event(
    transaction: &Transaction,
    session: i64,
    pairs: &[i64],
    event: &EventRow,
) -> rusqlite::Result<()> {
    let insert = "INSERT INTO event (session, unix_s, t_s, camera, target, kind, state, detail)
        VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)";
    transaction.execute(
        insert,
        params![
            session,
            unix_s(),
            event.t_s,
            event.camera,
            event.target,
            event.kind,
            event.state,
            event.detail
        ],
    )?;
    if let (Some(state), Some(pair)) = (event.state, event.pair.and_then(|pair| pairs.get(pair))) {
        let update =
            "UPDATE frame SET state = ?1 WHERE pair = ?2 AND span_s = 0 AND t_s = ?3 AND session = ?4";
        transaction.execute(update, params![state, pair, event.t_s, session])?;
    }
    Ok(())
}

#[cfg(unix)]
fn identity(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata(path).ok().map(|file| (file.dev(), file.ino()))
}

/// Elsewhere an open file cannot be moved.
#[cfg(not(unix))]
fn identity(_path: &Path) -> Option<(u64, u64)> {
    None
}
