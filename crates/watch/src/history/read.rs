//! Reads histories: summaries, and rows one after the other.

use super::columns::{self, count};
use super::rows::{EventRow, StoredEvent, StoredRow};
use super::{HistoryError, schema};
use rusqlite::{Connection, OpenFlags, Row, ToSql, params};
use std::path::{Path, PathBuf};

/// A history opened for reading, even while a session writes it.
pub struct History {
    connection: Connection,
    path: PathBuf,
}

/// A selection of rows.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Selection {
    /// Names of the cameras; empty for all.
    pub cameras: Vec<String>,
    /// First time, seconds.
    pub from_s: Option<f64>,
    /// Before this time, seconds.
    pub to_s: Option<f64>,
}

/// The contents of a history for a camera and a target.
#[derive(Debug, Clone, PartialEq)]
pub struct PairSummary {
    /// The camera.
    pub camera: String,
    /// The target.
    pub target: String,
    /// Time of the first row and end of the last, seconds.
    pub span_s: (f64, f64),
    /// Rows of frames, minutes and hours.
    pub rows: [u64; 3],
    /// Root mean square of the reprojection error, pixels.
    pub rms_px: Option<f64>,
    /// The time in each state.
    pub states: Vec<StateShare>,
}

/// Frames in one state.
#[derive(Debug, Clone, PartialEq)]
pub struct StateShare {
    /// The state.
    pub state: String,
    /// Frames in it.
    pub frames: u64,
    /// Number of frames with a pose.
    pub readings: u64,
    /// Number of frames with a rotation.
    pub rotations: u64,
}

impl History {
    /// # Errors
    /// No such file, no history, a later version.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, HistoryError> {
        let path = path.as_ref();
        if !path.is_file() {
            let reason = "there is no such file".to_string();
            return Err(HistoryError::NoAccess { path: path.to_path_buf(), reason });
        }
        let connection = connect(path)?;
        let history = History { connection, path: path.to_path_buf() };
        match history.number("application_id")? {
            0 => Err(HistoryError::Foreign { path: path.to_path_buf() }),
            _ => Ok(history),
        }
    }

    /// Bytes of the file.
    pub fn bytes(&self) -> u64 {
        std::fs::metadata(&self.path).map_or(0, |file| file.len())
    }

    /// Runs of the program that wrote it, and those that ended in good order.
    ///
    /// # Errors
    /// A damaged file.
    pub fn sessions(&self) -> Result<(u64, u64), HistoryError> {
        let select = "SELECT count(*), count(ended_unix_s) FROM session";
        self.reported(self.connection.query_row(select, [], |row| Ok((count(row, 0)?, count(row, 1)?))))
    }

    /// Returns a summary for each camera and target, by name.
    ///
    /// # Errors
    /// A damaged file.
    pub fn pairs(&self) -> Result<Vec<PairSummary>, HistoryError> {
        self.reported(self.try_pairs())
    }

    /// Passes the selected rows to `take`, pair by pair, in order of time; memory does not grow with their number. Rows stored meanwhile are not
    /// included. If `take` returns false, the reading ends.
    ///
    /// # Errors
    /// A damaged file.
    pub fn rows(
        &self,
        selection: &Selection,
        mut take: impl FnMut(StoredRow) -> bool,
    ) -> Result<(), HistoryError> {
        self.reported(self.try_rows(selection, &mut take))
    }

    /// The selected events, in the order in which they were reported; `kinds` empty means all.
    ///
    /// # Errors
    /// A damaged file.
    pub fn events(
        &self,
        selection: &Selection,
        kinds: &[&str],
        mut take: impl FnMut(StoredEvent) -> bool,
    ) -> Result<(), HistoryError> {
        self.reported(self.try_events(selection, kinds, &mut take))
    }

    pub(super) fn connection(&self) -> &Connection {
        &self.connection
    }

    pub(super) fn reported<T>(&self, result: rusqlite::Result<T>) -> Result<T, HistoryError> {
        result.map_err(|e| HistoryError::of(&self.path, &e))
    }

    fn number(&self, pragma: &str) -> Result<i64, HistoryError> {
        self.reported(schema::number(&self.connection, pragma))
    }

    /// Returns the current version of the tables: a session that begins meanwhile may migrate them.
    fn version(&self) -> rusqlite::Result<i64> {
        schema::number(&self.connection, "user_version")
    }

    fn try_pairs(&self) -> rusqlite::Result<Vec<PairSummary>> {
        let select =
            "SELECT pair.id, camera, target, min(t_s), max(t_s + span_s), sum(span_s = 0), sum(span_s = 60),
            sum(span_s = 3600), sum(readings * rms_px * rms_px) / nullif(sum(readings), 0)
            FROM pair JOIN frame ON frame.pair = pair.id GROUP BY pair.id ORDER BY camera, target";
        let mut select = self.connection.prepare(select)?;
        let mut found = select.query([])?;
        let mut pairs = Vec::new();
        while let Some(row) = found.next()? {
            pairs.push(PairSummary {
                camera: row.get(1)?,
                target: row.get(2)?,
                span_s: (row.get(3)?, row.get(4)?),
                rows: [count(row, 5)?, count(row, 6)?, count(row, 7)?],
                rms_px: row.get::<_, Option<f64>>(8)?.map(f64::sqrt),
                states: self.states(row.get(0)?)?,
            });
        }
        Ok(pairs)
    }

    fn states(&self, pair: i64) -> rusqlite::Result<Vec<StateShare>> {
        let rotations = columns::selected("turns", self.version()?);
        let select = format!(
            "SELECT {}, sum(frames), sum(readings), sum({rotations}) FROM frame WHERE pair = ?1 GROUP BY 1 ORDER BY 2 DESC",
            columns::state("state")
        );
        let mut select = self.connection.prepare(&select)?;
        let share = |row: &Row| {
            let (frames, readings, rotations) = (count(row, 1)?, count(row, 2)?, count(row, 3)?);
            Ok(StateShare { state: row.get(0)?, frames, readings, rotations })
        };
        select.query_map(params![pair], share)?.collect()
    }

    fn try_rows(
        &self,
        selection: &Selection,
        take: &mut impl FnMut(StoredRow) -> bool,
    ) -> rusqlite::Result<()> {
        let (condition, values) = condition(selection, &[]);
        // The order is by pair, then by the index on time, so that nothing is sorted in memory.
        let select = format!(
            "{} FROM pair JOIN frame ON pair.id = frame.pair WHERE pair.id = ?1 AND {condition} ORDER BY t_s",
            columns::select(self.version()?)
        );
        let reading = self.connection.unchecked_transaction()?;
        let mut statement = self.connection.prepare(&select)?;
        let pairs: Vec<i64> = {
            let mut all = self.connection.prepare("SELECT id FROM pair ORDER BY camera, target")?;
            all.query_map([], |row| row.get(0))?.collect::<rusqlite::Result<_>>()?
        };
        for pair in pairs {
            let own: Vec<&dyn ToSql> =
                std::iter::once(&pair as &dyn ToSql).chain(values.iter().map(AsRef::as_ref)).collect();
            let mut rows = statement.query(own.as_slice())?;
            while let Some(found) = rows.next()? {
                if !take(columns::row(found)?) {
                    return Ok(());
                }
            }
        }
        reading.finish()
    }

    fn try_events(
        &self,
        selection: &Selection,
        kinds: &[&str],
        take: &mut impl FnMut(StoredEvent) -> bool,
    ) -> rusqlite::Result<()> {
        let (condition, values) = condition(selection, kinds);
        let select = format!(
            "SELECT session, unix_s, t_s, camera, target, kind, {}, detail FROM event WHERE ?1 AND {condition} ORDER BY id",
            columns::state("state")
        );
        let mut statement = self.connection.prepare(&select)?;
        let all: Vec<&dyn ToSql> =
            std::iter::once(&true as &dyn ToSql).chain(values.iter().map(AsRef::as_ref)).collect();
        let mut rows = statement.query(all.as_slice())?;
        while let Some(found) = rows.next()? {
            if !take(event(found)?) {
                break;
            }
        }
        Ok(())
    }
}

/// A folder that cannot be written has no room for the shared index of the write-ahead log; then only what the file itself holds is read.
fn connect(path: &Path) -> Result<Connection, HistoryError> {
    let reported = |e: rusqlite::Error| HistoryError::of(path, &e);
    let open = |name: &str, flags| -> Result<Connection, HistoryError> {
        let connection = Connection::open_with_flags(name, flags).map_err(reported)?;
        connection.busy_timeout(std::time::Duration::from_secs(5)).map_err(reported)?;
        schema::check(&connection, path)?;
        Ok(connection)
    };
    let name = path.to_string_lossy();
    match open(&name, OpenFlags::SQLITE_OPEN_READ_ONLY) {
        Err(HistoryError::NoAccess { .. }) => {
            let escaped = name.replace('%', "%25").replace('?', "%3f").replace('#', "%23");
            let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI;
            open(&format!("file:{escaped}?immutable=1"), flags)
        }
        opened => opened,
    }
}

/// Returns a condition whose parameters are numbered from 2.
fn condition(selection: &Selection, kinds: &[&str]) -> (String, Vec<Box<dyn ToSql>>) {
    let (mut parts, mut values) = (vec!["1".to_string()], Vec::<Box<dyn ToSql>>::new());
    let mut is_one_of = |column: &str, names: Vec<String>, values: &mut Vec<Box<dyn ToSql>>| {
        if names.is_empty() {
            return;
        }
        let places: Vec<String> = (0..names.len()).map(|i| format!("?{}", values.len() + 2 + i)).collect();
        parts.push(format!("{column} IN ({})", places.join(", ")));
        values.extend(names.into_iter().map(|name| Box::new(name) as Box<dyn ToSql>));
    };
    is_one_of("camera", selection.cameras.clone(), &mut values);
    is_one_of("kind", kinds.iter().map(|kind| kind.to_string()).collect(), &mut values);
    for (limit, compared) in [(selection.from_s, ">="), (selection.to_s, "<")] {
        if let Some(limit_s) = limit {
            parts.push(format!("t_s {compared} ?{}", values.len() + 2));
            values.push(Box::new(limit_s));
        }
    }
    (parts.join(" AND "), values)
}

fn event(row: &Row) -> rusqlite::Result<StoredEvent> {
    Ok(StoredEvent {
        session: row.get(0)?,
        unix_s: row.get(1)?,
        row: EventRow {
            t_s: row.get(2)?,
            camera: row.get(3)?,
            target: row.get(4)?,
            kind: row.get(5)?,
            state: None,
            pair: None,
            detail: row.get(7)?,
        },
        state: row.get(6)?,
    })
}
