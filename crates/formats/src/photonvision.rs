//! PhotonVision and Limelight calibration JSON, the older shape and the current class.

use super::document::{Document, Fault};
use super::emit::{list, number};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::placed::{file_per_camera, size_of};
use super::{
    CameraFormat, Contents, Format, NamedCamera, OutFile, Reads, WriteError, Writer, checks, opencv,
};
use crate::core::camera::ImageSize;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::PhotonVision,
    words: &["photonvision"],
    reads: Some(Reads {
        recognises: |document| document.root.get("cameraIntrinsics").is_some(),
        read,
        together: None,
    }),
    write: Some(Writer::Cameras(write)),
    traps: &[
        "Older files call the distortion coefficients `cameraExtrinsics`; they hold no pose.",
        "The intrinsics belong to the stated resolution; another stream resolution of the same camera \
            needs them scaled.",
    ],
};

/// The shape before 2024; `FORMAT` reads both.
pub(super) const OLD_FORMAT: CameraFormat = CameraFormat {
    format: Format::PhotonVisionOld,
    words: &["photonvision-old", "limelight"],
    reads: None,
    write: Some(Writer::Cameras(write_old)),
    traps: &[],
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
    contents.cameras.push(NamedCamera::new(document.stem(), camera, None));
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

/// The current class, one file a camera; PhotonVision holds no pose of a camera in it.
fn write(cameras: &[NamedCamera]) -> Result<Vec<OutFile>, WriteError> {
    file_per_camera(cameras, "json", |camera| {
        let (head, d) = head_and_distortion(camera)?;
        let tail = "  \"calobjectWarp\": [0.0, 0.0],\n  \"observations\": [],\n  \"calobjectSize\": { \"width\": 0.0, \
            \"height\": 0.0 },\n  \"calobjectSpacing\": 0.0,\n  \"lensmodel\": \"LENSMODEL_OPENCV\"\n}\n";
        Ok(format!("{head}  \"distCoeffs\": {},\n{tail}", matrix(1, d.len(), &d)))
    })
}

/// The shape before 2024, where the distortion coefficients are called `cameraExtrinsics`.
fn write_old(cameras: &[NamedCamera]) -> Result<Vec<OutFile>, WriteError> {
    file_per_camera(cameras, "json", |camera| {
        let (head, d) = head_and_distortion(camera)?;
        let tail = "  \"perViewErrors\": [],\n  \"standardDeviation\": 0.0\n}\n";
        Ok(format!("{head}  \"cameraExtrinsics\": {},\n{tail}", matrix(1, d.len(), &d)))
    })
}

fn head_and_distortion(camera: &NamedCamera) -> Result<(String, Vec<f64>), WriteError> {
    let size = size_of(camera, "PhotonVision")?;
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    let refused =
        |what: &str| WriteError(format!("{}: PhotonVision has no {what}; write opencv", camera.name));
    let d = match numbers {
        LensNumbers::Pinhole => vec![0.0; 5],
        LensNumbers::BrownConrady(d) => {
            lens::in_counts(&d, &[4, 5, 8, 12]).ok_or_else(|| refused("tilt terms"))?
        }
        other => return Err(refused(&format!("{} model", other.model()))),
    };
    let (w, h) = (f64::from(size.width_px), f64::from(size.height_px));
    let size = format!("  \"resolution\": {{ \"width\": {}, \"height\": {} }},\n", number(w), number(h));
    let k = matrix(3, 3, &opencv::matrix_rows(&k));
    Ok((format!("{{\n{size}  \"cameraIntrinsics\": {k},\n"), d))
}

/// 6 is OpenCV's number for doubles of one channel.
fn matrix(rows: usize, columns: usize, data: &[f64]) -> String {
    format!("{{ \"rows\": {rows}, \"cols\": {columns}, \"type\": 6, \"data\": {} }}", list(data))
}
