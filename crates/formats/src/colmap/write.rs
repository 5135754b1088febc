//! Writes a COLMAP text model: one rig whose reference sensor is the first camera, one frame, one image a camera.
//!
//! Each camera has a CAMERA_ID of its own, counted from 1, because a rig's sensors must differ even when their lenses
//! agree. An image is called as its camera is.

use crate::core::Pose;
use crate::core::camera::CameraMatrix;
use crate::emit::number;
use crate::lens::{self, LensNumbers};
use crate::placed::{PlacedRig, placed, size_of};
use crate::{CameraFile, Format, NamedCamera, OutFile, WriteError};

/// `cameras.txt` alone where no camera has a pose; the whole model otherwise.
pub(crate) fn write(file: &CameraFile) -> Result<Vec<OutFile>, WriteError> {
    let cameras = &file.cameras;
    let mut files = vec![table("cameras.txt", cameras_text(cameras)?)];
    if 1 < cameras.len() && cameras.iter().all(|c| c.placement.is_none()) && file.relations.is_empty() {
        return Ok(files);
    }
    if let Some(odd) = cameras.iter().find(|c| c.name.is_empty() || c.name.contains(char::is_whitespace)) {
        return Err(WriteError(format!(
            "camera name `{}`: COLMAP's text files separate words by blanks; rename the camera",
            odd.name
        )));
    }
    let rig = placed(file, Format::Colmap)?;
    files.push(table("rigs.txt", rigs_text(&rig)));
    files.push(table("frames.txt", frames_text(&rig)));
    files.push(table("images.txt", images_text(&rig)));
    let points = "# 3D point list with one line of data per point: none\n".to_owned();
    files.push(table("points3D.txt", points));
    Ok(files)
}

fn table(name: &str, text: String) -> OutFile {
    OutFile { name: name.into(), text }
}

fn cameras_text(cameras: &[NamedCamera]) -> Result<String, WriteError> {
    let mut out = String::from("# Camera list with one line of data per camera:\n");
    out += "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n";
    for (i, camera) in cameras.iter().enumerate() {
        let size = size_of(camera, "COLMAP")?;
        let (matrix, numbers) = lens::numbers_of(&camera.camera)?;
        let (model, values) =
            model_of(&matrix, &numbers).map_err(|reason| WriteError(format!("{}: {reason}", camera.name)))?;
        let (id, w, h) = (i + 1, size.width_px, size.height_px);
        out += &format!("{id} {model} {w} {h} {}\n", spaced(&values));
    }
    Ok(out)
}

/// The model's name and its parameters; the principal point counts from the image's corner, half a pixel more.
fn model_of(k: &CameraMatrix, numbers: &LensNumbers) -> Result<(&'static str, Vec<f64>), String> {
    let (model, rest) = match numbers {
        LensNumbers::Pinhole => ("PINHOLE", vec![]),
        LensNumbers::BrownConrady(d) => match lens::in_counts(d, &[4, 8]) {
            Some(d) if d.len() == 4 => ("OPENCV", d),
            Some(d) => ("FULL_OPENCV", d),
            None => return Err("COLMAP has no thin-prism or tilt terms; write opencv or resight".into()),
        },
        LensNumbers::KannalaBrandt(d) => ("OPENCV_FISHEYE", d.to_vec()),
        LensNumbers::Fov { w_rad } => ("FOV", vec![*w_rad]),
        LensNumbers::Eucm { alpha, beta } => ("EUCM", vec![*alpha, *beta]),
        other => return Err(format!("COLMAP has no {} model; write resight or kalibr", other.model())),
    };
    let mut values = vec![k.fx_px, k.fy_px, k.cx_px + 0.5, k.cy_px + 0.5];
    values.extend(rest);
    Ok((model, values))
}

fn rigs_text(rig: &PlacedRig<'_>) -> String {
    let mut out = String::from("# Rig calib list with one line of data per calib:\n");
    out += "#   RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, SENSORS[] as (SENSOR_TYPE, SENSOR_ID, \
        HAS_POSE, [QW, QX, QY, QZ, TX, TY, TZ])\n";
    let rig_from_root = rig.cameras[0].cam_from_root;
    let others: String = rig.cameras[1..]
        .iter()
        .zip(2..)
        .map(|(c, id)| format!(" CAMERA {id} 1 {}", pose(&(c.cam_from_root * rig_from_root.inverse()))))
        .collect();
    out + &format!("1 {} CAMERA 1{others}\n", rig.cameras.len())
}

fn frames_text(rig: &PlacedRig<'_>) -> String {
    let mut out = String::from("# Frame list with one line of data per frame:\n");
    out += "#   FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ], NUM_DATA_IDS, DATA_IDS[] as \
        (SENSOR_TYPE, SENSOR_ID, DATA_ID)\n";
    let data: String = (1..=rig.cameras.len()).map(|id| format!(" CAMERA {id} {id}")).collect();
    out + &format!("1 1 {} {}{data}\n", pose(&rig.cameras[0].cam_from_root), rig.cameras.len())
}

fn images_text(rig: &PlacedRig<'_>) -> String {
    let mut out = String::from("# Image list with two lines of data per image:\n");
    out +=
        "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n#   POINTS2D[] as (X, Y, POINT3D_ID)\n";
    for (c, id) in rig.cameras.iter().zip(1..) {
        out += &format!("{id} {} {id} {}\n\n", pose(&c.cam_from_root), c.camera.name);
    }
    out
}

fn pose(b_from_a: &Pose) -> String {
    let values = [&b_from_a.quaternion_wxyz()[..], b_from_a.translation.as_slice()].concat();
    spaced(&values)
}

fn spaced(values: &[f64]) -> String {
    values.iter().map(|x| number(*x)).collect::<Vec<_>>().join(" ")
}
