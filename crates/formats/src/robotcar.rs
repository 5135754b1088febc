//! Oxford RobotCar: a camera's model (`models/mono_left.txt`) and a sensor's place on the vehicle (`extrinsics/mono_left.txt`); read only.
//!
//! A model is fx fy cx cy and a 4×4 matrix that maps points of the image's frame (x right, y down, z forward) into those of the camera's (x forward, y
//! right, z down), called `mono_left_mount` here; the stereo cameras share one. Images are undistorted by the look-up table beside the model, so
//! that no distortion is left; the table counts pixels from 0. Extrinsics are x y z roll pitch yaw, metres and radians, R = R_z(yaw) R_y(pitch)
//! R_x(roll): of a camera mount_from_vehicle (`project_laser_into_camera.py`), of the other sensors vehicle_from_sensor
//! (`build_pointcloud.py`). Files state neither names nor image sizes: the names are those of the files.

use super::document::{Document, Fault, Node, Syntax, Value};
use super::entry::Entry;
use super::euler::rotation_of_rpy;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks};
use crate::core::Pose;
use crate::core::camera::CameraMatrix;
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::RobotCar,
    words: &[],
    reads: Some(Reads {
        recognises: |document| {
            document.syntax == Syntax::Lines
                && (is_model(&document.text) || is_extrinsics(document).is_some())
        },
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "Extrinsics of a camera map the vehicle into the camera; those of the other sensors map the sensor into the vehicle.",
        "Images must be undistorted by the look-up table of the SDK first; the model has no distortion.",
    ],
};

const VEHICLE: &str = "vehicle";
/// The sensors of the vehicle, by the names of their files; `true` of cameras.
const SENSORS: [(&str, bool); 11] = [
    ("stereo", true),
    ("mono_left", true),
    ("mono_rear", true),
    ("mono_right", true),
    ("ins", false),
    ("ldmrs", false),
    ("lms_front", false),
    ("lms_rear", false),
    ("radar", false),
    ("velodyne_left", false),
    ("velodyne_right", false),
];

/// Rows of numbers with their lines; none as soon as anything else is there, or more rows than a model has.
fn rows(text: &str) -> Option<Vec<(usize, Vec<f64>)>> {
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        if rows.len() == 5 {
            return None;
        }
        rows.push((i + 1, line.split_whitespace().map(|w| w.parse().ok()).collect::<Option<Vec<f64>>>()?));
    }
    Some(rows)
}

/// Five rows of four: focal lengths and principal point, and a homogeneous matrix.
pub(super) fn is_model(text: &str) -> bool {
    let Some(rows) = rows(text) else { return false };
    rows.len() == 5
        && rows.iter().all(|(_, row)| row.len() == 4)
        && rows[4].1 == [0.0, 0.0, 0.0, 1.0]
        && rows[0].1.iter().all(|x| 1.0 < *x)
}

/// One row of six numbers in a file of a sensor's name, in the folder that the SDK has: the name and whether it is a camera.
fn is_extrinsics(document: &Document) -> Option<(&'static str, bool)> {
    let stem = document.stem();
    if document.path.parent()?.file_name()? != "extrinsics" {
        return None;
    }
    let sensor = SENSORS.into_iter().find(|(name, _)| *name == stem)?;
    let rows = rows(&document.text)?;
    (rows.len() == 1 && rows[0].1.len() == 6).then_some(sensor)
}

/// One row of six numbers.
pub(super) fn is_six_numbers(text: &str) -> bool {
    rows(text).is_some_and(|rows| rows.len() == 1 && rows[0].1.len() == 6)
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    let rows = rows(&document.text).unwrap_or_default();
    let bad = rows.iter().find(|(_, row)| row.iter().any(|x| !x.is_finite()));
    if let Some((line, _)) = bad {
        return Err(Fault::at(*line, "holds a number that is not finite (a failed calibration?)"));
    }
    if let Some((name, is_camera)) = is_extrinsics(document) {
        let n = &rows[0].1;
        let b_from_a = Pose::new(rotation_of_rpy([n[3], n[4], n[5]]), Vector3::new(n[0], n[1], n[2]));
        let (b, a) = match is_camera {
            true => (mount(name), VEHICLE.to_owned()),
            false => (VEHICLE.to_owned(), name.to_owned()),
        };
        contents.relations.push(Placement { b, a, b_from_a, covariance: None });
        return Ok(contents);
    }
    let list = |(line, row): &(usize, Vec<f64>)| {
        let number = |x: &f64| Node { line: *line, value: Value::Number(*x) };
        Node { line: *line, value: Value::List(row.iter().map(number).collect()) }
    };
    let matrix = Node { line: rows[1].0, value: Value::List(rows[1..].iter().map(list).collect()) };
    let b_from_a = checks::pose4x4(&Entry::called("the matrix", &matrix))?;
    let [fx_px, fy_px, cx_px, cy_px] = [0, 1, 2, 3].map(|i| rows[0].1[i]);
    let k = CameraMatrix { fx_px, fy_px, cx_px, cy_px };
    let first = list(&rows[0]);
    let at = Entry::called("fx fy cx cy", &first);
    let camera = lens::camera(&at, &LensNumbers::Pinhole, k, None, &mut contents.warnings)?;
    let name = document.stem();
    let sensor = if name.starts_with("stereo") { "stereo" } else { name.as_str() };
    let placement = Placement { b: mount(sensor), a: name.clone(), b_from_a, covariance: None };
    contents.cameras.push(NamedCamera::new(name, camera, Some(placement)));
    contents.warnings.push("the file states no image size".into());
    Ok(contents)
}

/// The frame that the SDK calls the camera's.
fn mount(sensor: &str) -> String {
    format!("{sensor}_mount")
}
