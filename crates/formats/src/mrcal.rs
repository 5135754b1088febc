//! mrcal `.cameramodel`: a Python dictionary, one file a camera. `extrinsics` = rt_cam_ref: Rodrigues vector and
//! translation (metres), x_cam = R x_ref + t. Pixel origin as ours.

use super::document::{Document, Fault};
use super::emit::list;
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::placed::{file_per_camera, placed, size_of};
use super::{
    CameraFile, CameraFormat, Contents, Format, NamedCamera, OutFile, Placement, Reads, WriteError, Writer,
    checks,
};
use crate::core::Pose;
use crate::core::camera::CameraMatrix;
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Mrcal,
    words: &["mrcal", "cameramodel"],
    reads: Some(Reads {
        recognises: |document| {
            document.root.get("lensmodel").is_some() && document.root.get("intrinsics").is_some()
        },
        read,
        together: None,
    }),
    write: Some(Writer::Rig(write)),
    traps: &[
        "extrinsics is rt_cam_ref: it maps the reference frame into the camera; the camera's position is −Rᵀ t.",
        "The reference frame is whatever the calibration chose (often the first camera); only files of one \
            calibration share it.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let mut contents = Contents::default();
    let model = root.need("lensmodel")?;
    let intrinsics = root.need("intrinsics")?;
    let extra = coefficient_count(&model)?;
    let word = model.text()?.trim_start_matches("LENSMODEL_");
    let n = intrinsics.exactly(4 + extra, &format!("{word}: fx, fy, cx, cy and {extra} coefficients"))?;
    let matrix = CameraMatrix { fx_px: n[0], fy_px: n[1], cx_px: n[2], cy_px: n[3] };
    let lens = if extra == 0 { LensNumbers::Pinhole } else { LensNumbers::BrownConrady(n[4..].to_vec()) };
    let size = checks::size_pair(&root.need("imagersize")?)?;
    let camera = lens::camera(&intrinsics, &lens, matrix, Some(size), &mut contents.warnings)?;
    let name = document.stem();
    let placement = placement(&root, &name)?;
    contents.cameras.push(NamedCamera::new(name, camera, placement));
    if root.get("valid_intrinsics_region").is_some_and(|r| r.items().is_ok_and(|r| !r.is_empty())) {
        contents.notes.push(
            "The file states a valid_intrinsics_region; points outside it are less \
            certain than the model says."
                .into(),
        );
    }
    if ["optimization_inputs", "optimization_inputs_base64"].iter().any(|key| root.has(key)) {
        contents.notes.push(
            "The file holds its calibration's inputs, from which mrcal computes how uncertain the intrinsics are; they are not read here. The \
            intrinsics count as exact unless you state intrinsics_sigma or calibrate with `resight intrinsics`."
                .into(),
        );
    }
    Ok(contents)
}

fn coefficient_count(model: &Entry<'_>) -> Result<usize, Fault> {
    match model.text()? {
        "LENSMODEL_PINHOLE" => Ok(0),
        "LENSMODEL_OPENCV4" => Ok(4),
        "LENSMODEL_OPENCV5" => Ok(5),
        "LENSMODEL_OPENCV8" => Ok(8),
        "LENSMODEL_OPENCV12" => Ok(12),
        other => {
            let short: String = other.chars().take(60).collect();
            Err(model.fault(format!(
                "model {short} is not supported; convert with `mrcal-convert-lensmodel LENSMODEL_OPENCV8`"
            )))
        }
    }
}

fn placement(root: &Entry<'_>, name: &str) -> Result<Option<Placement>, Fault> {
    let Some(rt) = root.first_of(&["extrinsics", "rt_cam_ref"]) else { return Ok(None) };
    let n = rt.exactly(6, "rotation vector, translation")?;
    let rotation = checks::rodrigues(&rt, Vector3::new(n[0], n[1], n[2]))?;
    let b_from_a = Pose::new(rotation, Vector3::new(n[3], n[4], n[5]));
    Ok(Some(Placement { b: name.to_owned(), a: "reference".into(), b_from_a, covariance: None }))
}

/// One file a camera, all with the same reference frame; without a pose the camera is its own reference.
fn write(file: &CameraFile) -> Result<Vec<OutFile>, WriteError> {
    let rig = placed(file, Format::Mrcal)?;
    let pose_of = |camera: &NamedCamera| {
        let found = rig.cameras.iter().find(|c| c.camera.name == camera.name);
        found.map_or_else(Pose::identity, |c| c.cam_from_root)
    };
    let reference = rig.root.replace(char::is_control, " ");
    file_per_camera(&file.cameras, "cameramodel", |camera| {
        let size = size_of(camera, "mrcal")?;
        let (k, numbers) = lens::numbers_of(&camera.camera)?;
        let (model, d) = model_of(numbers).map_err(|e| WriteError(format!("{}: {e}", camera.name)))?;
        let intrinsics = [&[k.fx_px, k.fy_px, k.cx_px, k.cy_px], &d[..]].concat();
        let (w, h) = (size.width_px, size.height_px);
        Ok([
            format!("# The reference frame of the extrinsics (rt_cam_ref) is {reference}\n{{\n"),
            format!("    'lensmodel':  '{model}',\n    'intrinsics': {},\n", list(&intrinsics)),
            format!(
                "    'valid_intrinsics_region': [],\n    'extrinsics': {},\n",
                list(&rt(&pose_of(camera)))
            ),
            format!("    'imagersize': [{w}, {h}],\n}}\n"),
        ]
        .concat())
    })
}

fn model_of(numbers: LensNumbers) -> Result<(&'static str, Vec<f64>), String> {
    match numbers {
        LensNumbers::Pinhole => Ok(("LENSMODEL_PINHOLE", vec![])),
        LensNumbers::BrownConrady(d) => {
            let d = lens::in_counts(&d, &[4, 5, 8, 12])
                .ok_or("mrcal has no tilt terms; write opencv or resight")?;
            let model = match d.len() {
                4 => "LENSMODEL_OPENCV4",
                5 => "LENSMODEL_OPENCV5",
                8 => "LENSMODEL_OPENCV8",
                _ => "LENSMODEL_OPENCV12",
            };
            Ok((model, d))
        }
        other => Err(format!("mrcal has no {} model; write resight or kalibr", other.model())),
    }
}

/// Rodrigues vector and translation; not the logarithm of the pose, whose translation part is another.
pub(super) fn rt(b_from_a: &Pose) -> [f64; 6] {
    let w = Pose::new(b_from_a.rotation, Vector3::zeros()).log();
    let t = b_from_a.translation;
    [w[0], w[1], w[2], t.x, t.y, t.z]
}
