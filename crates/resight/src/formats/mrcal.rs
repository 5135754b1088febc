//! mrcal `.cameramodel`: a Python dictionary. `extrinsics` = rt_cam_ref: Rodrigues vector and translation (metres),
//! x_cam = R x_ref + t. Pixel origin as ours.

use super::document::{Document, Fault};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks};
use crate::core::Pose;
use crate::core::camera::CameraMatrix;
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Mrcal,
    words: &[],
    reads: Some(Reads {
        recognises: |document| {
            document.root.get("lensmodel").is_some() && document.root.get("intrinsics").is_some()
        },
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "extrinsics is rt_cam_ref: it maps the reference frame into the camera; the camera's place is −Rᵀ t.",
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
    contents.cameras.push(NamedCamera { name, camera, placement });
    if root.get("valid_intrinsics_region").is_some_and(|r| r.items().is_ok_and(|r| !r.is_empty())) {
        contents.notes.push(
            "The file states a valid_intrinsics_region; points outside it are less \
            certain than the model says."
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
