//! The columns of the tables, and the cells of a row.

use super::super::bytes::triangle;
use super::super::rows::{StoredEvent, StoredRow};
use nalgebra::{SMatrix, SVector};

/// The table to export.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Table {
    /// Frames, minutes and hours.
    Frames,
    /// Events.
    Events,
}

/// The type of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Text,
    Whole,
    Real,
}

/// One value of a row.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell {
    Text(String),
    Whole(i64),
    Real(f64),
    Empty,
}

impl From<Option<f64>> for Cell {
    fn from(value: Option<f64>) -> Self {
        value.filter(|x| x.is_finite()).map_or(Cell::Empty, Cell::Real)
    }
}

impl From<Option<&str>> for Cell {
    fn from(value: Option<&str>) -> Self {
        value.map_or(Cell::Empty, |text| Cell::Text(text.to_string()))
    }
}

impl From<u64> for Cell {
    fn from(value: u64) -> Self {
        i64::try_from(value).map_or(Cell::Empty, Cell::Whole)
    }
}

/// Coordinates of a small motion, with their units.
const COORDINATES: [(&str, &str); 6] =
    [("rx", "rad"), ("ry", "rad"), ("rz", "rad"), ("tx", "m"), ("ty", "m"), ("tz", "m")];

impl Table {
    /// Names and kinds, in order.
    pub(super) fn columns(self) -> Vec<(String, Kind)> {
        let of = |names: &[&str], kind| names.iter().map(|name| (name.to_string(), kind)).collect::<Vec<_>>();
        match self {
            Table::Events => [
                of(&["session"], Kind::Whole),
                of(&["told_unix_s", "t_s"], Kind::Real),
                of(&["camera", "target", "event", "state", "detail"], Kind::Text),
            ]
            .concat(),
            Table::Frames => [
                of(&["camera", "target"], Kind::Text),
                of(&["session"], Kind::Whole),
                of(&["t_s", "span_s"], Kind::Real),
                of(&["frames", "readings"], Kind::Whole),
                of(&["state", "reason"], Kind::Text),
                of(
                    &["n_points", "rms_px", "max_rms_px", "qw", "qx", "qy", "qz", "x_m", "y_m", "z_m"],
                    Kind::Real,
                ),
                matrix_columns("cov", 6),
                matrix_columns("scatter", 6),
                vector_columns("min", 6),
                vector_columns("max", 6),
                of(&["turns"], Kind::Whole),
                of(&["n_landmarks"], Kind::Real),
                vector_columns("turn", 3),
                matrix_columns("cov_turn", 3),
                matrix_columns("scatter_turn", 3),
                vector_columns("min_turn", 3),
                vector_columns("max_turn", 3),
            ]
            .concat(),
        }
    }
}

/// A rotation has the first three coordinates.
fn matrix_columns(name: &str, n: usize) -> Vec<(String, Kind)> {
    let column = |(i, j): (usize, usize)| {
        let ((a, of_a), (b, of_b)) = (COORDINATES[i], COORDINATES[j]);
        let unit = if of_a == of_b { format!("{of_a}2") } else { format!("{of_a}_{of_b}") };
        (format!("{name}_{a}_{b}_{unit}"), Kind::Real)
    };
    triangle(n).map(column).collect()
}

fn vector_columns(name: &str, n: usize) -> Vec<(String, Kind)> {
    COORDINATES[..n].iter().map(|(a, unit)| (format!("{name}_{a}_{unit}"), Kind::Real)).collect()
}

pub(super) fn of_row(row: &StoredRow) -> Vec<Cell> {
    let (measured, summary) = (row.measured.as_ref(), row.summary.as_ref());
    let pose = measured.map(|m| (m.cam_from_target.quaternion_wxyz(), m.cam_from_target.translation));
    let mut cells = vec![
        Some(row.camera.as_str()).into(),
        Some(row.target.as_str()).into(),
        Cell::Whole(row.session),
        Some(row.t_s).into(),
        Some(row.span.seconds()).into(),
        row.frames.into(),
        row.readings.into(),
        Some(row.state.as_str()).into(),
        row.reason.as_deref().into(),
        Some(row.n_points).into(),
        measured.map(|m| m.rms_px).into(),
        summary.map_or(measured.map(|m| m.rms_px), |s| Some(s.most_rms_px)).into(),
    ];
    cells.extend((0..4).map(|i| pose.map(|(q, _)| q[i]).into()));
    cells.extend((0..3).map(|i| pose.map(|(_, t)| t[i]).into()));
    cells.extend(matrix_cells(measured.map(|m| &m.covariance)));
    cells.extend(matrix_cells(summary.map(|s| &s.scatter)));
    cells.extend(vector_cells(summary.map(|s| &s.least)));
    cells.extend(vector_cells(summary.map(|s| &s.most)));
    let (rotated, rotations) = (row.rotated.as_ref(), row.rotation_summary.as_ref());
    cells.extend([row.rotations.into(), rotated.map(|t| t.n_landmarks).into()]);
    cells.extend(vector_cells(rotated.map(|t| &t.rotation_rad)));
    cells.extend(matrix_cells(rotated.map(|t| &t.covariance_rad2)));
    cells.extend(matrix_cells(rotations.map(|s| &s.scatter_rad2)));
    cells.extend(vector_cells(rotations.map(|s| &s.least_rad)));
    cells.extend(vector_cells(rotations.map(|s| &s.most_rad)));
    cells
}

fn matrix_cells<const N: usize>(matrix: Option<&SMatrix<f64, N, N>>) -> impl Iterator<Item = Cell> {
    triangle(N).map(move |place| matrix.map(|m| m[place]).into())
}

fn vector_cells<const N: usize>(vector: Option<&SVector<f64, N>>) -> impl Iterator<Item = Cell> {
    (0..N).map(move |i| vector.map(|v| v[i]).into())
}

pub(super) fn of_event(event: &StoredEvent) -> Vec<Cell> {
    vec![
        Cell::Whole(event.session),
        Some(event.unix_s).into(),
        event.row.t_s.into(),
        event.row.camera.as_deref().into(),
        event.row.target.as_deref().into(),
        Some(event.row.kind.as_str()).into(),
        event.state.as_deref().into(),
        Some(event.row.detail.as_str()).into(),
    ]
}
