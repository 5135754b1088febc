//! The camera YAML of camodocal, as VINS-Mono and VINS-Fusion have it, and their own configuration with the poses; read only.
//!
//! Pixel (0, 0) is the centre of the first pixel. PINHOLE and PINHOLE_FULL have OpenCV's coefficients, MEI k1 k2 p1 p2 behind its mirror ξ;
//! KANNALA_BRANDT's k2 to k5 are what OpenCV's fisheye calls k1 to k4, mu and mv its fx and fy (`camera_models/*.cc`). `body_T_cam0` and
//! VINS-Mono's `extrinsicRotation`, `extrinsicTranslation` are imu_from_cam; `td` is added to the time stamps of images. Metres, seconds.

use super::document::{Document, Fault, Value};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::scalar_keys::{brown_conrady, fisheye, matrix, number_of};
use super::{CameraFormat, ClockOffset, Contents, Format, NamedCamera, Placement, Reads, checks};
use crate::FileError;
use crate::core::Pose;
use crate::core::camera::ImageSize;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Camodocal,
    words: &[],
    reads: Some(Reads {
        recognises: |document| is_camera(document) || is_configuration(document),
        read,
        together: Some(together),
    }),
    write: None,
    traps: &[
        "KANNALA_BRANDT's coefficients k2 to k5 are what OpenCV's fisheye calls k1 to k4; mu and mv are its fx and fy.",
        "body_T_cam0 and extrinsicRotation, extrinsicTranslation map camera points into the IMU: the inverse of Kalibr's T_cam_imu. VINS \
            refines them while it runs (estimate_extrinsic: 1), so a file may hold a rough guess.",
    ],
};

const IMU: &str = "imu";

fn is_camera(document: &Document) -> bool {
    let root = &document.root;
    let of_camodocal = ["model_type", "distortion_parameters", "mirror_parameters"];
    let is_table = |node: &super::document::Node| matches!(node.value, Value::Map(_));
    root.get("projection_parameters").is_some_and(is_table)
        && of_camodocal.iter().any(|key| root.get(key).is_some())
}

fn is_configuration(document: &Document) -> bool {
    document.root.get("body_T_cam0").is_some()
}

/// Poses of a configuration go to the cameras whose files it names.
fn together(documents: &[&Document]) -> Result<Contents, FileError> {
    let configurations: Vec<&&Document> = documents.iter().filter(|d| is_configuration(d)).collect();
    if let [first, second, ..] = configurations.as_slice() {
        return Err(FileError::new(
            &second.path,
            format!(
                "a second configuration beside {}; give one, with the files of its cameras",
                first.path.display()
            ),
        ));
    }
    let mut all = Contents::default();
    for document in documents {
        let mut contents = read(document).map_err(|fault| fault.in_file(&document.path))?;
        if let (Some(configuration), [camera]) = (configurations.first(), contents.cameras.as_mut_slice())
            && let Some(name) = name_in(configuration, document)
        {
            camera.name = name;
        }
        all.cameras.extend(contents.cameras);
        all.relations.extend(contents.relations);
        all.clocks.extend(contents.clocks);
        all.warnings.extend(contents.warnings);
    }
    Ok(all)
}

/// `cam0` of the file that `cam0_calib` names.
fn name_in(configuration: &Document, camera: &Document) -> Option<String> {
    let file = camera.path.file_name()?.to_str()?;
    let named = |i: &usize| {
        let calibration = configuration.entry().get(&format!("cam{i}_calib"));
        calibration.is_some_and(|c| c.text().is_ok_and(|path| path.rsplit('/').next() == Some(file)))
    };
    (0..MOST_CAMERAS).find(named).map(|i| format!("cam{i}"))
}

/// VINS reads two; its descendants more.
const MOST_CAMERAS: usize = 16;

fn read(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (document.entry(), Contents::default());
    if is_camera(document) {
        let camera = camera(&root, document, &mut contents.warnings)?;
        contents.cameras.push(camera);
    }
    let pose = |a: String, b_from_a: Pose| Placement { b: IMU.into(), a, b_from_a, covariance: None };
    for i in 0..MOST_CAMERAS {
        if let Some(at) = root.get(&format!("body_T_cam{i}")) {
            contents.relations.push(pose(format!("cam{i}"), checks::pose4x4(&at)?));
        }
    }
    let Some(camera) = contents.cameras.first_mut() else { return Ok(contents) };
    if let (Some(r), Some(t)) = (root.get("extrinsicRotation"), root.get("extrinsicTranslation")) {
        let b_from_a = Pose::new(checks::rotation_matrix(&r)?, checks::vector3(&t)?);
        camera.placement = Some(pose(camera.name.clone(), b_from_a));
    }
    if let Some(offset_s) = number_of(&root, "td")? {
        let (camera, reference) = (camera.name.clone(), IMU.to_owned());
        contents.clocks.push(ClockOffset { camera, reference, offset_s });
    }
    Ok(contents)
}

fn camera(root: &Entry<'_>, document: &Document, warnings: &mut Vec<String>) -> Result<NamedCamera, Fault> {
    let (model, projection) = (root.need("model_type")?, root.need("projection_parameters")?);
    let distortion = || root.need("distortion_parameters");
    let (lens, k) = match model.text()?.to_ascii_uppercase().as_str() {
        "PINHOLE" | "PINHOLE_FULL" => (brown_conrady(&distortion()?, "")?, ["fx", "fy", "cx", "cy"]),
        "KANNALA_BRANDT" => (fisheye(&projection, ["k2", "k3", "k4", "k5"])?, ["mu", "mv", "u0", "v0"]),
        "MEI" => {
            let at = distortion()?;
            let [k1, k2, p1, p2] = ["k1", "k2", "p1", "p2"].map(|key| at.need(key)?.number());
            let xi = root.need("mirror_parameters")?.need("xi")?.number()?;
            (LensNumbers::Omni { xi, k1k2p1p2: [k1?, k2?, p1?, p2?] }, ["gamma1", "gamma2", "u0", "v0"])
        }
        "SCARAMUZZA" => {
            return Err(model.fault(
                "SCARAMUZZA (the polynomial of OCamCalib) is no model here; calibrate the same images as MEI or KANNALA_BRANDT",
            ));
        }
        other => {
            return Err(model.fault(format!(
                "model `{other}` is not supported; PINHOLE, PINHOLE_FULL, KANNALA_BRANDT or MEI are read"
            )));
        }
    };
    let size = ImageSize {
        width_px: root.need("image_width")?.count(1)?,
        height_px: root.need("image_height")?.count(1)?,
    };
    let camera = lens::camera(&projection, &lens, matrix(&projection, k)?, Some(size), warnings)?;
    let stated = root.get("camera_name").map(|name| name.text()).transpose()?.filter(|name| !name.is_empty());
    let name = stated.map_or_else(|| document.stem(), str::to_owned);
    Ok(NamedCamera::new(name, camera, None))
}
