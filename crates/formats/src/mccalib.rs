//! MC-Calib's `calibrated_cameras_data.yml`, an OpenCV FileStorage: `camera_0`, `camera_1`, …
//!
//! `camera_pose_matrix` is group_from_cam: it maps the camera's points into its group's reference camera, and its last
//! column is the camera's position. Lengths are in the unit of the board's `square_size`, which the file does not state.
//! Pixel origin as ours. `distortion_type` 0 is Brown with five coefficients, 1 is OpenCV's fisheye.

use super::document::{Document, Fault};
use super::emit::list;
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::placed::{placed, size_of};
use super::{
    CameraFile, CameraFormat, Contents, Format, NamedCamera, OutFile, Placement, Reads, WriteError, Writer,
    checks, opencv,
};
use crate::core::Camera;
use crate::core::camera::ImageSize;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::McCalib,
    words: &["mccalib"],
    reads: Some(Reads {
        recognises: |document| cameras(&document.entry()).next().is_some(),
        read,
        together: None,
    }),
    write: Some(Writer::Rig(write)),
    traps: &[
        "camera_pose_matrix maps the camera's points into its group's reference camera (x_group = R x_cam + t), \
            the inverse of what OpenCV's R and T are; t is the camera's position itself.",
        "Lengths are in the unit of the board's square_size, which the file does not state (often cm); metres \
            are assumed.",
        "Cameras of different camera_group are not joined to each other, although their numbers look alike.",
    ],
};

fn cameras<'a>(root: &Entry<'a>) -> impl Iterator<Item = Entry<'a>> {
    let has = |e: &Entry<'_>| e.has("camera_matrix") && e.has("distortion_vector");
    root.entries().unwrap_or_default().into_iter().filter(move |e| e.path.starts_with("camera_") && has(e))
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    for entry in cameras(&document.entry()) {
        let camera = one_camera(&entry, &mut contents.warnings)?;
        let name = entry.name().to_owned();
        let group = entry.get("camera_group").map_or(Ok(0), |g| g.count(0))?;
        let placement = match entry.get("camera_pose_matrix") {
            None => None,
            Some(matrix) => {
                let b_from_a = checks::pose4x4(&matrix)?;
                contents.warnings.extend(checks::unit_warning(&matrix.path, b_from_a.translation.norm()));
                let (b, a) = (format!("group_{group}"), name.clone());
                Some(Placement { b, a, b_from_a, covariance: None })
            }
        };
        contents.cameras.push(NamedCamera::new(name, camera, placement));
    }
    Ok(contents)
}

fn one_camera(entry: &Entry<'_>, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
    let k = entry.need("camera_matrix")?;
    let matrix = checks::camera_matrix(&k)?;
    let distortion = entry.need("distortion_vector")?;
    let kind = entry.get("distortion_type").map_or(Ok(0), |kind| kind.count(0))?;
    let lens = match kind {
        0 => opencv::brown_conrady(&distortion, distortion.numbers()?)?,
        1 => {
            let d = distortion.exactly(4, "fisheye: k1, k2, k3, k4")?;
            LensNumbers::KannalaBrandt([d[0], d[1], d[2], d[3]])
        }
        other => {
            let at = entry.get("distortion_type").unwrap_or_else(|| entry.clone());
            return Err(at.fault(format!("is {other}; 0 (Brown) and 1 (fisheye) are read")));
        }
    };
    let side = |key: &str| entry.get(key).map(|x| x.count(1)).transpose();
    let size = match (side("img_width")?, side("img_height")?) {
        (Some(width_px), Some(height_px)) => Some(ImageSize { width_px, height_px }),
        _ => None,
    };
    lens::camera(&k, &lens, matrix, size, warnings)
}

/// All cameras in one group; MC-Calib calls them by number, so that other names are kept in a comment.
fn write(file: &CameraFile) -> Result<Vec<OutFile>, WriteError> {
    let rig = placed(file, Format::McCalib)?;
    let mut out = format!("%YAML:1.0\n---\nnb_camera: {}\n", file.cameras.len());
    for (i, c) in rig.cameras.iter().enumerate() {
        let name = &c.camera.name;
        if *name != format!("camera_{i}") {
            out += &format!("# {}\n", name.replace(char::is_control, " "));
        }
        let size = size_of(c.camera, "MC-Calib")?;
        let (k, numbers) = lens::numbers_of(&c.camera.camera)?;
        let (d, kind) = distortion_of(numbers).map_err(|e| WriteError(format!("{name}: {e}")))?;
        out += &format!("camera_{i}:\n");
        out += &matrix("camera_matrix", 3, 3, &opencv::matrix_rows(&k));
        out += &matrix("distortion_vector", 1, d.len(), &d);
        out += &format!("   distortion_type: {kind}\n   camera_group: 0\n");
        out += &format!("   img_width: {}\n   img_height: {}\n", size.width_px, size.height_px);
        out += &matrix("camera_pose_matrix", 4, 4, &c.root_from_cam().matrix().concat());
    }
    Ok(OutFile::only("calibrated_cameras_data.yml", out))
}

fn distortion_of(numbers: LensNumbers) -> Result<(Vec<f64>, u8), String> {
    match numbers {
        LensNumbers::Pinhole => Ok((vec![0.0; 5], 0)),
        LensNumbers::BrownConrady(d) => lens::in_counts(&d, &[5])
            .map(|d| (d, 0))
            .ok_or_else(|| "MC-Calib has k1, k2, p1, p2, k3 only, this camera has more; write opencv".into()),
        LensNumbers::KannalaBrandt(d) => Ok((d.to_vec(), 1)),
        other => Err(format!("MC-Calib has no {} model; write resight or kalibr", other.model())),
    }
}

/// As OpenCV's FileStorage lays it out below a key.
fn matrix(key: &str, rows: usize, columns: usize, data: &[f64]) -> String {
    let head = format!("   {key}: !!opencv-matrix\n      rows: {rows}\n      cols: {columns}\n      dt: d\n");
    head + &format!("      data: {}\n", list(data))
}
