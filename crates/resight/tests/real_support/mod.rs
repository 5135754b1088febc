//! What the tests of poses on real data share: the folder, the tables, the cameras that were published with the images.

use nalgebra::Vector3;
use resight::core::camera::{BrownConrady, KannalaBrandt, Pinhole};
use resight::core::correspondence::{Correspondence, Detection, correspond};
use resight::core::locate::choose::Ambiguity;
use resight::core::locate::consistency::Consistency;
use resight::core::locate::{Config, PoseEstimate, locate};
use resight::core::{Camera, CameraMatrix, Lens, Pixel, Point, Pose, Target, Vector6};
use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;

pub type Row = HashMap<String, String>;

/// Rows of a CSV file as maps from column name to text.
pub fn table(path: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(path).unwrap();
    reader.deserialize().map(|row| row.unwrap()).collect()
}

pub fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// A number; some tables were written with their type's name around it.
pub fn number(row: &Row, column: &str) -> f64 {
    let text = row[column].trim_start_matches("np.float64(").trim_end_matches(')');
    text.parse().unwrap_or_else(|_| panic!("{column}: {text:?}"))
}

/// A 3-vector from three columns `{prefix}{suffix}`.
fn vector(row: &Row, columns: [String; 3]) -> Vector3<f64> {
    Vector3::from_iterator(columns.iter().map(|c| number(row, c)))
}

/// From rotation vector and translation.
pub fn pose(r: Vector3<f64>, t: Vector3<f64>) -> Pose {
    Pose { translation: t, ..Pose::exp(&Vector6::new(r.x, r.y, r.z, 0.0, 0.0, 0.0)) }
}

/// `{prefix}rx … {prefix}tz`; none where the cells are empty.
pub fn pose_of(row: &Row, prefix: &str) -> Option<Pose> {
    let name = |kind: char| ['x', 'y', 'z'].map(|axis| format!("{prefix}{kind}{axis}"));
    let written = !row[&format!("{prefix}rx")].is_empty();
    written.then(|| pose(vector(row, name('r')), vector(row, name('t'))))
}

/// `X_m, Y_m, Z_m`.
pub fn point_of(row: &Row) -> Point {
    vector(row, ["X_m", "Y_m", "Z_m"].map(String::from))
}

/// `u_px, v_px`.
pub fn pixel_of(row: &Row) -> Pixel {
    Pixel::new(number(row, "u_px"), number(row, "v_px"))
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// From the 3×3 matrix K as JSON.
pub fn matrix_of(k: &Value) -> CameraMatrix {
    let at = |i: usize, j: usize| k[i][j].as_f64().unwrap();
    CameraMatrix { fx_px: at(0, 0), fy_px: at(1, 1), cx_px: at(0, 2), cy_px: at(1, 2) }
}

/// From `[fx, fy, cx, cy]` as JSON.
pub fn matrix_of_four(values: &Value) -> CameraMatrix {
    let v = numbers(values);
    CameraMatrix { fx_px: v[0], fy_px: v[1], cx_px: v[2], cy_px: v[3] }
}

pub fn pinhole(matrix: CameraMatrix) -> Camera {
    Camera { lens: Lens::Pinhole(Pinhole::new(matrix).unwrap()), size: None }
}

pub fn brown_conrady(matrix: CameraMatrix, coefficients: &Value) -> Camera {
    let lens = BrownConrady::new(matrix, &numbers(coefficients)).unwrap();
    Camera { lens: Lens::BrownConrady(lens), size: None }
}

pub fn kannala_brandt(matrix: CameraMatrix, coefficients: &Value) -> Camera {
    let lens = KannalaBrandt::new(matrix, &numbers(coefficients)).unwrap();
    Camera { lens: Lens::KannalaBrandt(lens), size: None }
}

/// The pose from what a detector found; a detection that cannot be used fails the test.
pub fn located(detections: &[Detection], target: &Target, camera: &Camera) -> PoseEstimate {
    let (seen, skipped) = correspond(detections, target, camera);
    assert!(skipped.is_empty(), "{skipped:?}");
    let seen: Vec<Correspondence> = seen.into_iter().map(|(_, c)| c).collect();
    locate(&seen, camera, &Config::default()).unwrap()
}

/// Angle in degrees and distance in millimetres between two poses.
pub fn apart(a: &Pose, b: &Pose) -> (f64, f64) {
    (a.angle_to_rad(b).to_degrees(), 1e3 * (a.translation - b.translation).norm())
}

pub fn chi2_per_degree_of_freedom(estimate: &PoseEstimate) -> f64 {
    estimate.chi2 / estimate.degrees_of_freedom as f64
}

pub fn is_inconsistent(estimate: &PoseEstimate) -> bool {
    matches!(estimate.consistency, Consistency::Inconsistent { .. })
}

/// The pose and, where another fits as well, that one.
pub fn answers(estimate: &PoseEstimate) -> Vec<Pose> {
    match estimate.ambiguity {
        Ambiguity::Ambiguous { other, .. } => vec![estimate.cam_from_target, other.cam_from_target],
        Ambiguity::Unique { .. } => vec![estimate.cam_from_target],
    }
}

/// Standard deviation of the pose: degrees (largest direction is at most this, root of the trace) and millimetres.
pub fn sigmas(estimate: &PoseEstimate) -> (f64, f64) {
    let root = |from: usize| (from..from + 3).map(|i| estimate.covariance[(i, i)]).sum::<f64>().sqrt();
    (root(0).to_degrees(), 1e3 * root(3))
}

pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

pub fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, f64::max)
}
