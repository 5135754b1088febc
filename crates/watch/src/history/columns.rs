//! The table of frames: its columns, and a row written into them and read from them. What a later version adds to the table is a column
//! here with that version; files of earlier versions lack it, and it reads as nothing there.

use super::bytes::{of_matrix, of_vector, to_matrix, to_vector};
use super::rows::{FrameRow, Measured, RotationSummary, Span, StoredRotation, StoredRow, Summary};
use nalgebra::{SMatrix, SVector};
use resight_core::Pose;
use rusqlite::types::FromSql;
use rusqlite::{Row, Statement, ToSql};

struct Column {
    name: &'static str,
    kind: &'static str,
    /// The version of the tables that brought it.
    since: i64,
}

const fn first(name: &'static str, kind: &'static str) -> Column {
    Column { name, kind, since: 1 }
}

const fn second(name: &'static str, kind: &'static str) -> Column {
    Column { name, kind, since: 2 }
}

/// In the order in which `Written` is written and `row` reads. A covariance is 21 doubles, the upper triangle row by row, of the left motion
/// `[rotation_rad; translation_m]` in the camera frame; least and most are six doubles. A rotation is its rotation vector and the six doubles of
/// its covariance; of turns, scatter is six doubles, least and most are three.
const COLUMNS: [Column; 29] = [
    first("pair", "INTEGER NOT NULL REFERENCES pair"),
    first("session", "INTEGER NOT NULL REFERENCES session"),
    first("t_s", "REAL NOT NULL"),
    first("span_s", "REAL NOT NULL"),
    first("number", "INTEGER"),
    first("frames", "INTEGER NOT NULL"),
    first("readings", "INTEGER NOT NULL"),
    first("state", "TEXT NOT NULL"),
    first("n_points", "REAL NOT NULL"),
    first("rms_px", "REAL"),
    first("qw", "REAL"),
    first("qx", "REAL"),
    first("qy", "REAL"),
    first("qz", "REAL"),
    first("x_m", "REAL"),
    first("y_m", "REAL"),
    first("z_m", "REAL"),
    first("covariance", "BLOB"),
    first("reason", "TEXT"),
    first("scatter", "BLOB"),
    first("least", "BLOB"),
    first("most", "BLOB"),
    first("most_rms_px", "REAL"),
    second("turns", "INTEGER NOT NULL DEFAULT 0"),
    second("turn", "BLOB"),
    second("n_landmarks", "REAL"),
    second("turn_scatter", "BLOB"),
    second("turn_least", "BLOB"),
    second("turn_most", "BLOB"),
];

fn list(of: impl Fn(&Column) -> String) -> String {
    COLUMNS.iter().map(of).collect::<Vec<_>>().join(", ")
}

/// Makes the table.
pub(super) fn table() -> String {
    let columns = list(|column| format!("{} {}", column.name, column.kind));
    format!(
        "CREATE TABLE frame (id INTEGER PRIMARY KEY, {columns});
        CREATE INDEX frame_of_pair ON frame (pair, span_s, t_s);"
    )
}

/// Adds to the table of an earlier version what it lacks.
pub(super) fn additions(version: i64) -> String {
    let lacking = COLUMNS.iter().filter(|column| version < column.since);
    lacking.map(|column| format!("ALTER TABLE frame ADD COLUMN {} {};", column.name, column.kind)).collect()
}

/// The state in `column` by its name of today: programs of version 1 wrote others.
pub(super) fn state(column: &str) -> String {
    let earlier =
        "WHEN 'unseen' THEN 'stale' WHEN 'settling' THEN 'checking' WHEN 'followed' THEN 'tracking'";
    format!("CASE {column} {earlier} ELSE {column} END")
}

/// A column as a file of this version has it.
pub(super) fn selected(name: &str, version: i64) -> String {
    if name == "state" {
        return state("frame.state");
    }
    let is_lacking = COLUMNS.iter().any(|column| column.name == name && version < column.since);
    if is_lacking { "NULL".to_string() } else { format!("frame.{name}") }
}

/// What `row` reads, of a file of this version: `FROM frame JOIN pair …`.
pub(super) fn select(version: i64) -> String {
    format!("SELECT camera, target, {}", list(|column| selected(column.name, version)))
}

/// A row to be written.
pub(super) struct Written<'a> {
    pair: i64,
    session: i64,
    t_s: f64,
    span: Span,
    number: Option<i64>,
    /// Frames in it, those with a pose, those with a rotation.
    counts: [u64; 3],
    state: &'a str,
    n_points: f64,
    measured: Option<&'a Measured>,
    summary: Option<&'a Summary>,
    rotated: Option<&'a StoredRotation>,
    rotation_summary: Option<&'a RotationSummary>,
    reason: Option<&'a str>,
}

impl<'a> Written<'a> {
    pub fn frame(pair: i64, session: i64, row: &'a FrameRow) -> Self {
        Written {
            pair,
            session,
            t_s: row.t_s,
            span: Span::Frame,
            number: Some(row.number as i64),
            counts: [1, u64::from(row.measured.is_some()), u64::from(row.rotated.is_some())],
            state: row.state,
            n_points: row.n_points as f64,
            measured: row.measured.as_ref(),
            summary: None,
            rotated: row.rotated.as_ref(),
            rotation_summary: None,
            reason: row.reason.as_deref(),
        }
    }

    /// A minute or an hour: it has no number.
    pub fn stored(pair: i64, row: &'a StoredRow) -> Self {
        Written {
            pair,
            session: row.session,
            t_s: row.t_s,
            span: row.span,
            number: None,
            counts: [row.frames, row.readings, row.rotations],
            state: &row.state,
            n_points: row.n_points,
            measured: row.measured.as_ref(),
            summary: row.summary.as_ref(),
            rotated: row.rotated.as_ref(),
            rotation_summary: row.rotation_summary.as_ref(),
            reason: row.reason.as_deref(),
        }
    }

    /// The statement that `insert` runs.
    pub fn statement() -> String {
        let places: Vec<&str> = COLUMNS.iter().map(|_| "?").collect();
        format!("INSERT INTO frame ({}) VALUES ({})", list(|c| c.name.to_string()), places.join(", "))
    }

    pub fn insert(&self, statement: &mut Statement) -> rusqlite::Result<()> {
        let (measured, summary, rotated, rotations) =
            (self.measured, self.summary, self.rotated, self.rotation_summary);
        let q = measured.map(|m| m.cam_from_target.quaternion_wxyz());
        let x_m = measured.map(|m| m.cam_from_target.translation);
        let [frames, readings, with_turn] = self.counts.map(|count| count as i64);
        let values: [&dyn ToSql; COLUMNS.len()] = [
            &self.pair,
            &self.session,
            &self.t_s,
            &self.span.seconds(),
            &self.number,
            &frames,
            &readings,
            &self.state,
            &self.n_points,
            &measured.map(|m| m.rms_px),
            &q.map(|q| q[0]),
            &q.map(|q| q[1]),
            &q.map(|q| q[2]),
            &q.map(|q| q[3]),
            &x_m.map(|x_m| x_m.x),
            &x_m.map(|x_m| x_m.y),
            &x_m.map(|x_m| x_m.z),
            &measured.map(|m| of_matrix(&m.covariance)),
            &self.reason,
            &summary.map(|s| of_matrix(&s.scatter)),
            &summary.map(|s| of_vector(&s.least)),
            &summary.map(|s| of_vector(&s.most)),
            &summary.map(|s| s.most_rms_px),
            &with_turn,
            &rotated.map(turn_to_bytes),
            &rotated.map(|t| t.n_landmarks),
            &rotations.map(|s| of_matrix(&s.scatter_rad2)),
            &rotations.map(|s| of_vector(&s.least_rad)),
            &rotations.map(|s| of_vector(&s.most_rad)),
        ];
        statement.execute(values.as_slice()).map(|_| ())
    }
}

/// The row that `select` found.
pub(super) fn row(row: &Row) -> rusqlite::Result<StoredRow> {
    let cells = &mut Cells { row, next: 0 };
    let (camera, target) = (cells.take()?, cells.take()?);
    cells.next += 1; // the pair, by now by name
    let (session, t_s, span) = (cells.take()?, cells.take()?, Span::from_seconds(cells.take()?));
    cells.next += 1; // the number, for readers of the file itself
    let (frames, readings) = (cells.count()?, cells.count()?);
    let (state, n_points) = (cells.take()?, cells.take()?);
    let (measured, reason, summary) = (measured(cells)?, cells.take()?, summary(cells)?);
    let (rotations, rotated, rotation_summary) = (cells.count()?, rotated(cells)?, rotation_summary(cells)?);
    Ok(StoredRow {
        camera,
        target,
        session,
        t_s,
        span,
        frames,
        readings,
        rotations,
        state,
        n_points,
        measured,
        summary,
        rotated,
        rotation_summary,
        reason,
    })
}

/// Counts are never negative; one that is shows a damaged file, not a count.
pub(super) fn count(row: &Row, column: usize) -> rusqlite::Result<u64> {
    Ok(row.get::<_, Option<i64>>(column)?.and_then(|n| u64::try_from(n).ok()).unwrap_or(0))
}

/// Cells of a row, one after the other.
struct Cells<'r, 's> {
    row: &'r Row<'s>,
    next: usize,
}

impl Cells<'_, '_> {
    fn take<T: FromSql>(&mut self) -> rusqlite::Result<T> {
        self.next += 1;
        self.row.get(self.next - 1)
    }

    fn count(&mut self) -> rusqlite::Result<u64> {
        self.next += 1;
        count(self.row, self.next - 1)
    }

    fn matrix<const N: usize>(&mut self) -> rusqlite::Result<Option<SMatrix<f64, N, N>>> {
        Ok(self.take::<Option<Vec<u8>>>()?.and_then(|bytes| to_matrix(&bytes)))
    }

    fn vector<const N: usize>(&mut self) -> rusqlite::Result<Option<SVector<f64, N>>> {
        Ok(self.take::<Option<Vec<u8>>>()?.and_then(|bytes| to_vector(&bytes)))
    }
}

fn measured(cells: &mut Cells) -> rusqlite::Result<Option<Measured>> {
    let numbers: Vec<Option<f64>> = (0..8).map(|_| cells.take()).collect::<rusqlite::Result<_>>()?;
    let covariance = cells.matrix()?;
    let (
        [Some(rms_px), Some(w), Some(x), Some(y), Some(z), Some(x_m), Some(y_m), Some(z_m)],
        Some(covariance),
    ) = (numbers.as_slice(), covariance)
    else {
        return Ok(None);
    };
    let cam_from_target = Pose::from_quaternion_wxyz([*w, *x, *y, *z], [*x_m, *y_m, *z_m].into());
    Ok(Some(Measured { cam_from_target, covariance, rms_px: *rms_px }))
}

fn summary(cells: &mut Cells) -> rusqlite::Result<Option<Summary>> {
    let (scatter, least, most) = (cells.matrix()?, cells.vector()?, cells.vector()?);
    let most_rms_px: Option<f64> = cells.take()?;
    Ok(match (scatter, least, most, most_rms_px) {
        (Some(scatter), Some(least), Some(most), Some(most_rms_px)) => {
            Some(Summary { scatter, least, most, most_rms_px })
        }
        _ => None,
    })
}

/// Doubles of the rotation vector; those of its covariance follow.
const VECTOR_BYTES: usize = 3 * 8;

fn turn_to_bytes(rotated: &StoredRotation) -> Vec<u8> {
    [of_vector(&rotated.rotation_rad), of_matrix(&rotated.covariance_rad2)].concat()
}

fn rotated(cells: &mut Cells) -> rusqlite::Result<Option<StoredRotation>> {
    let (bytes, n_landmarks): (Option<Vec<u8>>, Option<f64>) = (cells.take()?, cells.take()?);
    let parts = bytes.as_ref().and_then(|bytes| bytes.split_at_checked(VECTOR_BYTES));
    let read = |(vector, matrix)| Some((to_vector(vector)?, to_matrix(matrix)?));
    Ok(parts.and_then(read).zip(n_landmarks).map(|((rotation_rad, covariance_rad2), n_landmarks)| {
        StoredRotation { rotation_rad, covariance_rad2, n_landmarks }
    }))
}

fn rotation_summary(cells: &mut Cells) -> rusqlite::Result<Option<RotationSummary>> {
    Ok(match (cells.matrix()?, cells.vector()?, cells.vector()?) {
        (Some(scatter_rad2), Some(least_rad), Some(most_rad)) => {
            Some(RotationSummary { scatter_rad2, least_rad, most_rad })
        }
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rusqlite::Connection;

    /// Programs of version 1 wrote other words for the same states.
    #[test]
    fn states_of_version_1_are_read() {
        let connection = Connection::open_in_memory().expect("a database");
        let select = format!("SELECT {}", state("?1"));
        for (was, is) in
            [("unseen", "stale"), ("settling", "checking"), ("followed", "tracking"), ("drifted", "drifted")]
        {
            let read: String = connection.query_row(&select, [was], |row| row.get(0)).expect("a state");
            assert_eq!(read, is);
        }
    }
}
