//! A stretch of a camera's history in few parts, by a few rows of each: a day of frames is not read for it.

use super::columns;
use super::read::History;
use super::{HistoryError, StoredRow};
use crate::board::strip::{Stretch, StripBin};
use resight_core::temporal::monitor::rotation_alone;
use resight_core::{Matrix6, Pose, Vector6};
use rusqlite::{Connection, params};

/// Rows that stand for a part: its last ones.
const ROWS: i64 = 8;
/// A camera that gave nothing for so long before a part, and for longer than a part, was not watched then; seconds.
const GAP_S: f64 = 90.0;
/// Lengths of rows, finest first, seconds.
const SPANS_S: [f64; 3] = [0.0, 60.0, 3600.0];

impl History {
    /// The parts of a stretch; rotations are against these poses of the camera, by target.
    ///
    /// # Errors
    /// A damaged file.
    pub fn strip(
        &self,
        camera: &str,
        stretch: &Stretch,
        references: &[(String, Pose)],
    ) -> Result<Vec<StripBin>, HistoryError> {
        self.reported(strip(self.connection(), camera, stretch, references))
    }
}

fn strip(
    connection: &Connection,
    camera: &str,
    stretch: &Stretch,
    references: &[(String, Pose)],
) -> rusqlite::Result<Vec<StripBin>> {
    let reading = connection.unchecked_transaction()?;
    let version = super::schema::number(connection, "user_version")?;
    let changes = changes(connection, camera, stretch)?;
    let words = changes.iter().map(|(t_s, target, word)| (*t_s, target.as_str(), word.as_str()));
    let states = stretch.gravest(words);
    let pairs: Vec<(i64, Option<Pose>)> = {
        let mut all = connection.prepare("SELECT id, target FROM pair WHERE camera = ?1 ORDER BY target")?;
        let of = |target: String| references.iter().find(|(name, _)| *name == target).map(|(_, pose)| *pose);
        all.query_map([camera], |row| Ok((row.get(0)?, of(row.get(1)?))))?.collect::<rusqlite::Result<_>>()?
    };
    let mut rows = Rows::new(connection, version)?;
    let mut bins = Vec::with_capacity(stretch.bins);
    for (bin, state) in states.into_iter().enumerate() {
        let (from_s, to_s) = stretch.bin_s(bin);
        let (mut rotation_rad, mut is_watched) = (None, false);
        for (pair, reference) in &pairs {
            let found = rows.before(*pair, to_s)?;
            let reach_s = from_s - GAP_S.max(to_s - from_s);
            is_watched |= found.iter().any(|row| reach_s <= row.t_s + row.span.seconds());
            let own = found.iter().filter(|row| from_s <= row.t_s + row.span.seconds());
            rotation_rad = rotation_rad.or_else(|| rotation(own, reference.as_ref()));
        }
        bins.push(StripBin { from_s, state: state.filter(|_| is_watched), rotation_rad });
    }
    reading.finish()?;
    Ok(bins)
}

/// Changes of state: the last of each target before the stretch, and all in it.
fn changes(
    connection: &Connection,
    camera: &str,
    stretch: &Stretch,
) -> rusqlite::Result<Vec<(f64, String, String)>> {
    let state = columns::state("state");
    let of = "FROM event WHERE kind = 'state' AND camera = ?1";
    let target = "coalesce(target, '')";
    let before = format!("SELECT t_s, {target}, {state}, max(id) {of} AND t_s < ?2 GROUP BY target");
    let within = format!("SELECT t_s, {target}, {state} {of} AND ?2 <= t_s AND t_s < ?3 ORDER BY id");
    let row = |row: &rusqlite::Row<'_>| Ok((row.get(0)?, row.get(1)?, row.get(2)?));
    let mut all: Vec<(f64, String, String)> = connection
        .prepare(&before)?
        .query_map(params![camera, stretch.from_s], row)?
        .collect::<rusqlite::Result<_>>()?;
    let mut within = connection.prepare(&within)?;
    for found in within.query_map(params![camera, stretch.from_s, stretch.to_s], row)? {
        all.push(found?);
    }
    Ok(all)
}

/// The last rows before a time, by the index.
struct Rows<'a> {
    statement: rusqlite::Statement<'a>,
}

impl<'a> Rows<'a> {
    fn new(connection: &'a Connection, version: i64) -> rusqlite::Result<Self> {
        let select = format!(
            "{} FROM pair JOIN frame ON pair.id = frame.pair
            WHERE frame.pair = ?1 AND span_s = ?2 AND t_s < ?3 ORDER BY t_s DESC LIMIT {ROWS}",
            columns::select(version)
        );
        Ok(Rows { statement: connection.prepare(&select)? })
    }

    /// Of the finest length that reaches nearest.
    fn before(&mut self, pair: i64, to_s: f64) -> rusqlite::Result<Vec<StoredRow>> {
        let mut best: Vec<StoredRow> = Vec::new();
        for span_s in SPANS_S {
            let mut rows = self.statement.query(params![pair, span_s, to_s])?;
            let mut found = Vec::new();
            while let Some(row) = rows.next()? {
                found.push(columns::row(row)?);
            }
            let newest_s = |rows: &[StoredRow]| rows.first().map_or(f64::NEG_INFINITY, |row| row.t_s);
            if newest_s(&best) < newest_s(&found) {
                best = found;
            }
        }
        Ok(best)
    }
}

/// Mean rotation of some rows from the reference, as if the camera only rotated; or since the image of its landmarks.
fn rotation<'a>(rows: impl Iterator<Item = &'a StoredRow>, reference: Option<&Pose>) -> Option<f64> {
    let of_row = |row: &StoredRow| {
        let of_pose = row.measured.zip(reference).map(|(measured, reference)| {
            let motion: Vector6 = (*reference * measured.cam_from_target.inverse()).log();
            let covariance: Matrix6 = measured.covariance;
            let turn = motion.fixed_rows::<3>(0).into_owned();
            rotation_alone(&motion, &covariance).map_or(turn, |(turn, _)| turn)
        });
        of_pose.or_else(|| row.rotated.map(|rotated| rotated.rotation_rad))
    };
    let turns: Vec<_> = rows.filter_map(of_row).collect();
    let n = turns.len() as f64;
    (0.0 < n).then(|| (turns.iter().sum::<nalgebra::Vector3<f64>>() / n).norm())
}
