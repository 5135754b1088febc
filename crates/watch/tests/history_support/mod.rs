//! What tests of histories share: a file, frames whose poses scatter, rows read back, thinning to its end.

use nalgebra::{Matrix3, Matrix6, SMatrix, SVector, Vector3, Vector6};
use resight::core::Pose;
use resight_core::statistics::SplitMix64;
use resight_watch::history::{
    FrameRow, History, Measured, Retention, Selection, Store, StoredRotation, StoredRow,
};
use std::path::{Path, PathBuf};

pub const SIGMA: [f64; 6] = [1e-3, 2e-3, 5e-4, 1e-3, 1e-3, 4e-3];

/// SplitMix64, and Box–Muller on it.
pub struct Chance(pub SplitMix64);

impl Chance {
    pub fn uniform(&mut self) -> f64 {
        self.0.uniform()
    }

    pub fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

pub fn file(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("history-{name}"));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder.join("history.sqlite")
}

pub fn pairs() -> Vec<(String, String)> {
    ["gate", "yard"].map(|camera| (camera.to_string(), "door".to_string())).to_vec()
}

pub fn open(path: &Path) -> Store {
    Store::open(path, &pairs()).expect("a history").store
}

/// Frames of `gate` at these times, the pose scattered by SIGMA; every tenth sees nothing.
pub fn frames(times_s: impl Iterator<Item = f64>, state: &'static str, seed: u64) -> Vec<FrameRow> {
    let mut chance = Chance(SplitMix64::new(seed));
    let start = Pose::exp(&Vector6::new(0.2, -0.7, 0.1, 0.3, -0.2, 2.5));
    let frame = |(i, t_s): (usize, f64)| {
        let motion = Vector6::from_fn(|axis, _| SIGMA[axis] * chance.normal());
        let scale = 1.0 + chance.uniform();
        let measured = Measured {
            cam_from_target: Pose::exp(&motion) * start,
            covariance: Matrix6::from_diagonal(&Vector6::from(SIGMA.map(|s| scale * s * s))),
            rms_px: 0.2 + 0.1 * chance.uniform(),
        };
        let is_seen = i % 10 != 9;
        FrameRow {
            pair: 0,
            t_s,
            number: i as u64,
            state,
            n_points: 4 * usize::from(is_seen),
            measured: is_seen.then_some(measured),
            rotated: None,
            reason: (!is_seen).then(|| "no tag in this frame".to_string()),
        }
    };
    times_s.enumerate().map(frame).collect()
}

/// Scatter of turns, rad.
pub const TURN_SIGMA: [f64; 3] = [3e-4, 1e-3, 5e-4];

/// Frames of `gate` without a target at these times, turned far from the reference image and scattered by TURN_SIGMA; every tenth sees
/// nothing.
pub fn rotations(times_s: impl Iterator<Item = f64>, state: &'static str, seed: u64) -> Vec<FrameRow> {
    let mut chance = Chance(SplitMix64::new(seed));
    let start = turn(Vector3::new(0.1, -0.6, 0.2));
    let frame = |(i, t_s): (usize, f64)| {
        let motion = Vector3::from_fn(|axis, _| TURN_SIGMA[axis] * chance.normal());
        let scale = 1.0 + chance.uniform();
        let rotated = StoredRotation {
            rotation_rad: (turn(motion) * start).log().fixed_rows::<3>(0).into_owned(),
            covariance_rad2: Matrix3::from_fn(|row, column| {
                let share = if row == column { scale } else { 0.1 * scale };
                share * (TURN_SIGMA[row] * TURN_SIGMA[column])
            }),
            n_landmarks: 100.0 + (50.0 * chance.uniform()).floor(),
        };
        let is_seen = i % 10 != 9;
        FrameRow {
            pair: 0,
            t_s,
            number: i as u64,
            state,
            n_points: if is_seen { rotated.n_landmarks as usize } else { 0 },
            measured: None,
            rotated: is_seen.then_some(rotated),
            reason: (!is_seen).then(|| "0 corners in this image".to_string()),
        }
    };
    times_s.enumerate().map(frame).collect()
}

/// A rotation by its vector.
pub fn turn(rotation_rad: Vector3<f64>) -> Pose {
    Pose::exp(&Vector6::from_fn(|i, _| if i < 3 { rotation_rad[i] } else { 0.0 }))
}

pub fn every(period_s: f64, from_s: f64, to_s: f64) -> impl Iterator<Item = f64> {
    let n = ((to_s - from_s) / period_s).round() as usize;
    (0..n).map(move |i| from_s + i as f64 * period_s)
}

pub fn rows(path: &Path) -> Vec<StoredRow> {
    let mut rows = Vec::new();
    let take = |row| {
        rows.push(row);
        true
    };
    History::open(path).expect("a history").rows(&Selection::default(), take).expect("rows");
    rows
}

pub fn thin(store: &mut Store, keep: &Retention) {
    let mut rotations = 0;
    while store.thin(keep).expect("thinned") {
        rotations += 1;
        assert!(rotations < 10_000, "it never ends");
    }
}

pub const FOR_EVER: f64 = 1e12;

pub fn keep(full_s: f64, minutes_s: f64, keep_s: f64) -> Retention {
    Retention { full_s, minutes_s, keep_s, largest_bytes: None }
}

/// A CSV table, its header first; empty cells are none.
pub fn cells(path: &Path) -> Vec<Vec<Option<String>>> {
    let mut reader = csv::ReaderBuilder::new().has_headers(false).from_path(path).expect("a table");
    let cell = |text: &str| (!text.is_empty()).then(|| text.to_string());
    reader.records().map(|record| record.expect("a row").iter().map(cell).collect()).collect()
}

/// Motions from a mean leave nothing over, and scatter, least and most are theirs; `size` is that of the largest coordinate.
fn lie_about<const N: usize>(
    motions: &[SVector<f64, N>],
    [least, most]: [SVector<f64, N>; 2],
    scatter: &SMatrix<f64, N, N>,
    tolerance: f64,
    size: f64,
) {
    let n = motions.len() as f64;
    let left_over = motions.iter().sum::<SVector<f64, N>>() / n;
    assert!(left_over.norm() < tolerance * size, "{left_over}");
    let wanted = motions.iter().map(|m| m * m.transpose()).sum::<SMatrix<f64, N, N>>() / n;
    assert!((scatter - wanted).norm() < tolerance * wanted.norm(), "{scatter} {wanted}");
    let extreme =
        |of: fn(f64, f64) -> f64| motions.iter().copied().reduce(|a, b| a.zip_map(&b, of)).expect("some");
    for (seen, wanted) in [(least, extreme(f64::min)), (most, extreme(f64::max))] {
        assert!((seen - wanted).norm() < tolerance * size, "{seen} {wanted}");
    }
}

/// The mean leaves no motion over, the scatter is that of the frames, the covariance that of one frame: nothing gets better by averaging.
pub fn is_mean_of(row: &StoredRow, frames: &[&FrameRow], tolerance: f64) {
    let seen: Vec<&Measured> = frames.iter().filter_map(|frame| frame.measured.as_ref()).collect();
    let n = seen.len() as f64;
    assert_eq!(row.readings, seen.len() as u64);
    let (mean, summary) = (row.measured.expect("a mean"), row.summary.expect("a summary"));
    let motions: Vec<Vector6<f64>> =
        seen.iter().map(|m| (m.cam_from_target * mean.cam_from_target.inverse()).log()).collect();
    lie_about(&motions, [summary.least, summary.most], &summary.scatter, tolerance, SIGMA[5]);
    let covariance = seen.iter().map(|m| m.covariance).sum::<Matrix6<f64>>() / n;
    assert!((mean.covariance - covariance).norm() < 1e-12 * covariance.norm());
    let mean_square = seen.iter().map(|m| m.rms_px * m.rms_px).sum::<f64>() / n;
    assert!((mean.rms_px - mean_square.sqrt()).abs() < 1e-12);
    assert_eq!(summary.most_rms_px, seen.iter().map(|m| m.rms_px).fold(0.0, f64::max));
}

/// The same of turns, which are counted for themselves.
pub fn is_mean_turn_of(row: &StoredRow, frames: &[&FrameRow], tolerance: f64) {
    let seen: Vec<&StoredRotation> = frames.iter().filter_map(|frame| frame.rotated.as_ref()).collect();
    let n = seen.len() as f64;
    assert_eq!(row.rotations, seen.len() as u64);
    let (mean, summary) = (row.rotated.expect("a mean"), row.rotation_summary.expect("a summary"));
    let motion = |t: &&StoredRotation| (turn(t.rotation_rad) * turn(mean.rotation_rad).inverse()).log();
    let motions: Vec<Vector3<f64>> = seen.iter().map(|t| motion(t).fixed_rows::<3>(0).into_owned()).collect();
    lie_about(
        &motions,
        [summary.least_rad, summary.most_rad],
        &summary.scatter_rad2,
        tolerance,
        TURN_SIGMA[1],
    );
    let covariance = seen.iter().map(|t| t.covariance_rad2).sum::<Matrix3<f64>>() / n;
    assert!((mean.covariance_rad2 - covariance).norm() < 1e-12 * covariance.norm());
    let landmarks = seen.iter().map(|t| t.n_landmarks).sum::<f64>() / n;
    assert!((mean.n_landmarks - landmarks).abs() < 1e-9, "{landmarks}");
}
