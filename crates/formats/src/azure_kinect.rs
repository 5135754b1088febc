//! The factory calibration of an Azure Kinect as JSON (`k4a_device_get_raw_calibration`, or the attachment of a recording); read only.
//!
//! `ModelParameters` are cx cy fx fy k1 k2 k3 k4 k5 k6 codx cody p2 p1 (`k4atypes.h`), the first four in parts of the sensor's width (cx, fx)
//! and height (cy, fy), counted from the corner of the first pixel: the SDK takes off 0.5 px (`mode_specific_calibration.c`), and so does this.
//! Brown–Conrady is OpenCV's rational model (`intrinsic_transformation.c`). `Rt` is cam_from_depth, row by row, metres
//! (`extrinsic_transformation.c`: world_to_camera, the world being the depth camera).

use super::document::{Document, Fault};
use super::entry::Entry;
use super::lens;
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks, opencv};
use crate::core::camera::{CameraMatrix, ImageSize};
use crate::core::{Camera, Pose};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::AzureKinect,
    words: &[],
    reads: Some(Reads {
        recognises: |document| {
            document.root.get("CalibrationInformation").is_some_and(|c| c.get("Cameras").is_some())
        },
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "The intrinsics belong to the whole sensor (SensorWidth × SensorHeight). Colour images of 16:9 are scaled to their width and cut by an \
            eighth of the 4:3 height above and below; NFOV depth is cut too. Images of those modes need their own intrinsics.",
        "The last two parameters are p2, then p1.",
        "Rt maps points of the depth camera into this one (x_cam = R x_depth + t).",
    ],
};

const BROWN_CONRADY: &str = "CALIBRATION_LensDistortionModelBrownConrady";

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    let root = document.entry().need("CalibrationInformation")?;
    for entry in root.need("Cameras")?.items()? {
        let name = name(&entry)?;
        let camera = camera(&entry, &mut contents.warnings)?;
        let placement = match entry.get("Rt").filter(|_| name != DEPTH) {
            None => None,
            Some(rt) => {
                let r = checks::rotation_matrix(&rt.need("Rotation")?)?;
                let b_from_a = Pose::new(r, checks::vector3(&rt.need("Translation")?)?);
                Some(Placement { b: name.clone(), a: DEPTH.into(), b_from_a, covariance: None })
            }
        };
        contents.cameras.push(NamedCamera::new(name, camera, placement));
    }
    Ok(contents)
}

const DEPTH: &str = "depth";

/// By its place in the device: D0 is the depth camera, PV0 the colour camera.
fn name(entry: &Entry<'_>) -> Result<String, Fault> {
    let location = entry.need("Location")?.text()?;
    Ok(match location.strip_prefix("CALIBRATION_CameraLocation") {
        Some("D0") => DEPTH.to_owned(),
        Some("PV0") => "color".to_owned(),
        Some(other) => other.to_owned(),
        None => location.to_owned(),
    })
}

fn camera(entry: &Entry<'_>, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
    let intrinsics = entry.need("Intrinsics")?;
    let model = intrinsics.need("ModelType")?;
    if model.text()? != BROWN_CONRADY {
        return Err(model.fault(format!("`{}` is not supported; {BROWN_CONRADY} is read", model.text()?)));
    }
    let parameters = intrinsics.need("ModelParameters")?;
    let p = parameters.exactly(14, "cx cy fx fy k1 k2 k3 k4 k5 k6 codx cody p2 p1")?;
    if p[10] != 0.0 || p[11] != 0.0 {
        return Err(parameters
            .fault(format!("has a centre of distortion ({}, {}); only (0, 0) is read", p[10], p[11])));
    }
    let size = ImageSize {
        width_px: entry.need("SensorWidth")?.count(1)?,
        height_px: entry.need("SensorHeight")?.count(1)?,
    };
    let [width, height] = [size.width_px, size.height_px].map(f64::from);
    let matrix = CameraMatrix {
        fx_px: p[2] * width,
        fy_px: p[3] * height,
        cx_px: p[0] * width - 0.5,
        cy_px: p[1] * height - 0.5,
    };
    let lens = opencv::brown_conrady(&parameters, vec![p[4], p[5], p[13], p[12], p[6], p[7], p[8], p[9]])?;
    lens::camera(&parameters, &lens, matrix, Some(size), warnings)
}
