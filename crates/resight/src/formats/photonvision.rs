//! PhotonVision and Limelight calibration JSON, the older shape and the current class.

use super::document::{Document, Fault};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Reads, checks, opencv};
use crate::core::camera::ImageSize;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::PhotonVision,
    words: &[],
    reads: Some(Reads {
        recognises: |document| document.root.get("cameraIntrinsics").is_some(),
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "Older files call the distortion coefficients `cameraExtrinsics`; they hold no pose.",
        "The intrinsics belong to the stated resolution; another stream resolution of the same camera \
            needs them scaled.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let mut contents = Contents::default();
    let k = root.need("cameraIntrinsics")?;
    let matrix = checks::camera_matrix(&k)?;
    let distortion = root
        .first_of(&["distCoeffs", "cameraExtrinsics"])
        .ok_or_else(|| root.fault("the key `distCoeffs` is missing"))?;
    let resolution = root.need("resolution")?;
    let size = ImageSize {
        width_px: resolution.need("width")?.count(1)?,
        height_px: resolution.need("height")?.count(1)?,
    };
    let lens = lens_numbers(&root, &distortion)?;
    let camera = lens::camera(&k, &lens, matrix, Some(size), &mut contents.warnings)?;
    contents.cameras.push(NamedCamera { name: document.stem(), camera, placement: None });
    Ok(contents)
}

fn lens_numbers(root: &Entry<'_>, distortion: &Entry<'_>) -> Result<LensNumbers, Fault> {
    if let Some(model) = root.get("lensmodel") {
        let word = model.text()?;
        if word != "LENSMODEL_OPENCV" && word != "LENSMODEL_OPENCV5" && word != "LENSMODEL_OPENCV8" {
            return Err(
                model.fault(format!("model {word} is not supported; calibrate with LENSMODEL_OPENCV"))
            );
        }
    }
    let d = distortion.numbers()?;
    match root.get("isFisheye").map(|f| f.flag()).transpose()? {
        Some(true) => match <[f64; 4]>::try_from(d) {
            Ok(k) => Ok(LensNumbers::KannalaBrandt(k)),
            Err(d) => Err(distortion.fault(format!("holds {} coefficients; a fisheye takes 4", d.len()))),
        },
        _ => opencv::brown_conrady(distortion, d),
    }
}
