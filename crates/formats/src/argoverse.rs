//! Argoverse: `vehicle_calibration_info.json` of version 1; of version 2 the tables `intrinsics` and `egovehicle_SE3_sensor`, exported from
//! Feather as CSV or JSON records. Read only.
//!
//! Poses are egovehicle_from_sensor (x_ego = R x_sensor + t), metres, quaternions w first; the vehicle has x forward, y left, z up, a camera x
//! right, y down, z forward. Images were undistorted before they were published and the APIs project without distortion: the coefficients k1 k2
//! k3 belong to the raw images and are not read. Pixels are OpenCV's. Version 1 states no image size; its API has 1920 × 1200 px for the ring and
//! 2464 × 2056 px for the stereo cameras.

use super::document::{Document, Fault, Node, Value};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::scalar_keys::{has_number, matrix, number_of};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks};
use crate::core::Camera;
use crate::core::camera::{CameraMatrix, ImageSize};
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Argoverse,
    words: &[],
    reads: Some(Reads { recognises, read, together: None }),
    write: None,
    traps: &[
        "Poses are the sensor's in the vehicle (x_ego = R x_sensor + t), w first: the inverse of an extrinsic matrix.",
        "The published images are undistorted: k1, k2, k3 belong to the raw ones and are left out.",
    ],
};

const EGO: &str = "egovehicle";
const V1: [&str; 4] =
    ["focal_length_x_px_", "focal_length_y_px_", "focal_center_x_px_", "focal_center_y_px_"];
const V2: [&str; 4] = ["fx_px", "fy_px", "cx_px", "cy_px"];
const POSE: [&str; 7] = ["qw", "qx", "qy", "qz", "tx_m", "ty_m", "tz_m"];

fn recognises(document: &Document) -> bool {
    document.root.get("camera_data_").is_some() || rows(document).is_some()
}

/// The records of a table of version 2: each names its sensor.
fn rows(document: &Document) -> Option<Vec<Entry<'_>>> {
    let rows = document.entry().items().ok()?;
    let is_row = |row: &Entry<'_>| {
        let has_all = |keys: &[&str]| keys.iter().all(|key| has_number(row, key));
        row.has("sensor_name") && (has_all(&V2) || has_all(&POSE))
    };
    (!rows.is_empty() && rows.iter().all(is_row)).then_some(rows)
}

/// The header of a table of version 2 as CSV.
pub(super) fn is_table(text: &str) -> bool {
    let header = text.lines().next().unwrap_or_default();
    let has_all = |keys: &[&str]| keys.iter().all(|key| header.split(',').any(|name| name.trim() == *key));
    has_all(&["sensor_name"]) && (has_all(&V2) || has_all(&POSE))
}

/// Rows at most: a vehicle has a dozen sensors.
const MOST_ROWS: usize = 1000;

/// A table as records, as pandas exports it.
pub(super) fn parse_table(text: &str) -> Result<Node, Fault> {
    let mut lines =
        text.lines().enumerate().map(|(i, line)| (i + 1, line)).filter(|(_, l)| !l.trim().is_empty());
    let header: Vec<&str> = lines.next().map_or(Vec::new(), |(_, l)| l.split(',').map(str::trim).collect());
    let mut rows = Vec::new();
    for (line, row) in lines {
        let cells: Vec<&str> = row.split(',').map(str::trim).collect();
        if cells.len() != header.len() {
            return Err(Fault::at(line, format!("{} cells under {} columns", cells.len(), header.len())));
        }
        if rows.len() == MOST_ROWS {
            return Err(Fault::at(
                line,
                format!("more than {MOST_ROWS} rows, which no vehicle has sensors for"),
            ));
        }
        let value = |cell: &str| match cell.parse() {
            Ok(x) => Value::Number(x),
            Err(_) => Value::Text(cell.to_owned()),
        };
        // pandas numbers the rows in a column without a name.
        let named = header.iter().zip(&cells).filter(|(name, _)| !name.is_empty());
        let entries =
            named.map(|(name, cell)| ((*name).to_owned(), Node { line, value: value(cell) })).collect();
        rows.push(super::tree::map_of(line, entries)?);
    }
    Ok(Node { line: 1, value: Value::List(rows) })
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    match rows(document) {
        Some(rows) => rows.iter().try_for_each(|row| of_row(row, &mut contents))?,
        None => of_version_1(&document.entry(), &mut contents)?,
    }
    Ok(contents)
}

fn of_row(row: &Entry<'_>, contents: &mut Contents) -> Result<(), Fault> {
    let name = row.need("sensor_name")?.text()?;
    if has_number(row, V2[0]) {
        let size = ImageSize {
            width_px: row.need("width_px")?.count(1)?,
            height_px: row.need("height_px")?.count(1)?,
        };
        let camera = pinhole(row, matrix(row, V2)?, Some(size), &mut contents.warnings)?;
        contents.cameras.push(NamedCamera::new(name, camera, None));
    }
    if has_number(row, POSE[0]) {
        let n = POSE.map(|key| row.need(key)?.number());
        let [w, x, y, z, tx, ty, tz] = n;
        let b_from_a = checks::quaternion_pose(row, [w?, x?, y?, z?], Vector3::new(tx?, ty?, tz?))?;
        contents.relations.push(Placement { b: EGO.into(), a: name.into(), b_from_a, covariance: None });
    }
    Ok(())
}

fn of_version_1(root: &Entry<'_>, contents: &mut Contents) -> Result<(), Fault> {
    for entry in root.need("camera_data_")?.items()? {
        let key = entry.need("key")?.text()?;
        let name = key.strip_prefix("image_raw_").unwrap_or(key);
        let value = entry.need("value")?;
        let skew = number_of(&value, "skew_")?.unwrap_or(0.0);
        if skew != 0.0 {
            return Err(value
                .need("skew_")?
                .fault(format!("is {skew}; only cameras without skew are supported")));
        }
        let size = match name.starts_with("stereo_") {
            true => ImageSize { width_px: 2464, height_px: 2056 },
            false => ImageSize { width_px: 1920, height_px: 1200 },
        };
        let camera = pinhole(&value, matrix(&value, V1)?, Some(size), &mut contents.warnings)?;
        let placement = pose_of_version_1(&value.need("vehicle_SE3_camera_")?, name)?;
        contents.cameras.push(NamedCamera::new(name, camera, Some(placement)));
    }
    for lidar in ["up_lidar", "down_lidar"] {
        if let Some(pose) = root.get(&format!("vehicle_SE3_{lidar}_")) {
            contents.relations.push(pose_of_version_1(&pose, lidar)?);
        }
    }
    contents.notes.push("The image sizes are those of the API (ring 1920 × 1200, stereo 2464 × 2056 px); the file states none.".into());
    Ok(())
}

fn pinhole(
    at: &Entry<'_>,
    matrix: CameraMatrix,
    size: Option<ImageSize>,
    warnings: &mut Vec<String>,
) -> Result<Camera, Fault> {
    lens::camera(at, &LensNumbers::Pinhole, matrix, size, warnings)
}

fn pose_of_version_1(at: &Entry<'_>, name: &str) -> Result<Placement, Fault> {
    let rotation = at.need("rotation")?.need("coefficients")?;
    let q = rotation.exactly(4, "w, x, y, z")?;
    let t = checks::vector3(&at.need("translation")?)?;
    let b_from_a = checks::quaternion_pose(&rotation, [q[0], q[1], q[2], q[3]], t)?;
    Ok(Placement { b: EGO.into(), a: name.to_owned(), b_from_a, covariance: None })
}
