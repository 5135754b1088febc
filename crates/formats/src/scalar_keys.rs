//! Camera files with a key for each number: plain `fx`, ORB-SLAM's `Camera.fx`, camodocal's (VINS) `projection_parameters`, OpenSfM's
//! `camera_models.json`, the `transforms.json` of nerfstudio and instant-ngp. All are read only.
//!
//! Pixel (0, 0) is the centre of the first pixel in ORB-SLAM and camodocal (they take OpenCV's numbers), as here. OpenSfM divides pixels from
//! the middle of the image by its longer side (`normalized_image_coordinates`). transforms.json holds COLMAP's numbers, whose pixel (0, 0) is
//! the corner of the first one, and camera axes of OpenGL (x right, y up, z back).

use super::document::{Document, Fault, Value};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks, opencv};
use crate::core::camera::{CameraMatrix, ImageSize};
use crate::core::{Camera, Pose};
use nalgebra::{Matrix3, Vector3};

const fn read_only(
    format: Format,
    recognises: fn(&Document) -> bool,
    read: fn(&Document) -> Result<Contents, Fault>,
    traps: &'static [&'static str],
) -> CameraFormat {
    CameraFormat {
        format,
        words: &[],
        reads: Some(Reads { recognises, read, together: None }),
        write: None,
        traps,
    }
}

/// `fx`, `fy`, `cx`, `cy` and the coefficients, each under its own key.
pub(super) const PLAIN: CameraFormat = read_only(
    Format::PlainKeys,
    |document| ["fx", "fy", "cx", "cy"].iter().all(|key| is_number(&document.entry(), key)),
    |document| {
        let (root, mut contents) = (document.entry(), Contents::default());
        let size = opencv::image_size(&root)?;
        let camera = one(&root, &root, "", opencv::is_fisheye(&root)?, size, &mut contents)?;
        contents.cameras.push(named(document.stem(), camera, None));
        Ok(contents)
    },
    &[
        "The file does not say whether pixel (0, 0) is the centre of the first pixel (as OpenCV has it, taken here) or its corner; that moves \
        cx and cy by 0.5 px.",
    ],
);

/// ORB-SLAM2 and 3.
pub(super) const ORB_SLAM: CameraFormat = read_only(
    Format::OrbSlam,
    |document| ["Camera.fx", "Camera1.fx"].iter().any(|key| is_number(&document.entry(), key)),
    read_orb_slam,
    &[
        "Stereo.T_c1_c2 maps points of the second camera into the first; its translation is the place of the second camera.",
        "Camera.newWidth and newHeight scale images after reading; the intrinsics belong to Camera.width × height.",
    ],
);

/// camodocal, as VINS-Mono and VINS-Fusion write it.
pub(super) const CAMODOCAL: CameraFormat = read_only(
    Format::Camodocal,
    |document| {
        document.root.get("model_type").is_some() && document.root.get("projection_parameters").is_some()
    },
    read_camodocal,
    &[
        "KANNALA_BRANDT's coefficients k2 to k5 are what OpenCV's fisheye calls k1 to k4; mu and mv are its fx and fy.",
    ],
);

/// nerfstudio and instant-ngp.
pub(super) const TRANSFORMS: CameraFormat = read_only(
    Format::NerfTransforms,
    |document| {
        let frames =
            document.entry().get("frames").and_then(|frames| frames.items().ok()).unwrap_or_default();
        has_focal(&document.entry()) || frames.first().is_some_and(has_focal)
    },
    read_transforms,
    &[
        "transform_matrix maps camera points into the world, with camera axes x right, y up, z back (OpenGL); here they are x right, y down, \
            z forward.",
        "The unit of its translation is whatever the reconstruction had: COLMAP's is no metre, and nerfstudio scales and centres the scene.",
        "Pixel (0, 0) is the corner of the first pixel there; 0.5 px are taken off cx and cy.",
    ],
);

/// OpenSfM's camera models.
pub(super) const OPEN_SFM: CameraFormat = read_only(
    Format::OpenSfm,
    |document| match &document.root.value {
        Value::Map(entries) => {
            !entries.is_empty() && entries.iter().all(|(_, node)| node.get("projection_type").is_some())
        }
        _ => false,
    },
    read_open_sfm,
    &["focal, c_x and c_y are in parts of the longer side of the image, from its middle."],
);

/// Of `transforms.json`, where it may be an angle in radians.
fn has_focal(entry: &Entry<'_>) -> bool {
    is_number(entry, "fl_x") || is_number(entry, "camera_angle_x")
}

fn is_number(entry: &Entry<'_>, key: &str) -> bool {
    entry.get(key).is_some_and(|found| matches!(found.node.value, Value::Number(_)))
}

fn named(name: String, camera: Camera, placement: Option<Placement>) -> NamedCamera {
    NamedCamera { name, camera, placement, intrinsics_covariance: None }
}

/// The number of a key that may be missing.
fn number(entry: &Entry<'_>, key: &str) -> Result<Option<f64>, Fault> {
    entry.get(key).map(|found| found.number()).transpose()
}

/// OpenCV's coefficients k1 k2 p1 p2 [k3 [k4 k5 k6]] behind a prefix; those that are not there are zero.
fn brown_conrady(at: &Entry<'_>, prefix: &str) -> Result<LensNumbers, Fault> {
    const KEYS: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
    let mut d = Vec::new();
    for key in KEYS {
        d.push(number(at, &format!("{prefix}{key}"))?.unwrap_or(0.0));
    }
    let used = d.iter().rposition(|x| *x != 0.0).map_or(0, |last| last + 1);
    d.truncate([0, 4, 5, 8].into_iter().find(|n| used <= *n).unwrap_or(8));
    opencv::brown_conrady(at, d)
}

/// Kannala–Brandt's four coefficients under these keys.
fn fisheye(at: &Entry<'_>, keys: [&str; 4]) -> Result<LensNumbers, Fault> {
    let mut k = [0.0; 4];
    for (value, key) in k.iter_mut().zip(keys) {
        *value = number(at, key)?.unwrap_or(0.0);
    }
    Ok(LensNumbers::KannalaBrandt(k))
}

fn matrix(at: &Entry<'_>, keys: [&str; 4]) -> Result<CameraMatrix, Fault> {
    let [fx_px, fy_px, cx_px, cy_px] = keys.map(|key| at.need(key)?.number());
    Ok(CameraMatrix { fx_px: fx_px?, fy_px: fy_px?, cx_px: cx_px?, cy_px: cy_px? })
}

/// A camera whose keys `fx` … `k1` … stand behind a prefix.
fn one(
    blamed: &Entry<'_>,
    at: &Entry<'_>,
    prefix: &str,
    is_fisheye: bool,
    size: Option<ImageSize>,
    contents: &mut Contents,
) -> Result<Camera, Fault> {
    let key = |name: &str| format!("{prefix}{name}");
    let k = ["fx", "fy", "cx", "cy"].map(key);
    let lens = match is_fisheye {
        true => {
            let k = ["k1", "k2", "k3", "k4"].map(key);
            fisheye(at, [&k[0], &k[1], &k[2], &k[3]])?
        }
        false => brown_conrady(at, prefix)?,
    };
    lens::camera(blamed, &lens, matrix(at, [&k[0], &k[1], &k[2], &k[3]])?, size, &mut contents.warnings)
}

fn read_orb_slam(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (document.entry(), Contents::default());
    let is_fisheye = match root.get("Camera.type") {
        None => false,
        Some(model) => match model.text()?.to_ascii_lowercase().as_str() {
            "pinhole" | "rectified" => false,
            "kannalabrandt8" => true,
            other => {
                return Err(model.fault(format!(
                    "unknown model `{other}`; PinHole, Rectified or KannalaBrandt8 are read"
                )));
            }
        },
    };
    let size = match (root.get("Camera.width"), root.get("Camera.height")) {
        (Some(width), Some(height)) => {
            Some(ImageSize { width_px: width.count(1)?, height_px: height.count(1)? })
        }
        _ => None,
    };
    for name in ["Camera", "Camera1", "Camera2"] {
        let Some(fx) = root.get(&format!("{name}.fx")) else { continue };
        let camera = one(&fx, &root, &format!("{name}."), is_fisheye, size, &mut contents)?;
        contents.cameras.push(named(name.to_owned(), camera, None));
    }
    if let ([_, second], Some(pose)) = (contents.cameras.as_mut_slice(), root.get("Stereo.T_c1_c2")) {
        let b_from_a = checks::pose4x4(&pose)?;
        second.placement =
            Some(Placement { b: "Camera1".into(), a: "Camera2".into(), b_from_a, covariance: None });
    }
    Ok(contents)
}

fn read_camodocal(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (document.entry(), Contents::default());
    let (model, projection) = (root.need("model_type")?, root.need("projection_parameters")?);
    let distortion = || root.need("distortion_parameters");
    let (lens, k) = match model.text()? {
        "PINHOLE" | "PINHOLE_FULL" => (brown_conrady(&distortion()?, "")?, ["fx", "fy", "cx", "cy"]),
        "KANNALA_BRANDT" => (fisheye(&projection, ["k2", "k3", "k4", "k5"])?, ["mu", "mv", "u0", "v0"]),
        "MEI" => {
            let at = distortion()?;
            let [k1, k2, p1, p2] = ["k1", "k2", "p1", "p2"].map(|key| at.need(key)?.number());
            let xi = root.need("mirror_parameters")?.need("xi")?.number()?;
            (LensNumbers::Omni { xi, k1k2p1p2: [k1?, k2?, p1?, p2?] }, ["gamma1", "gamma2", "u0", "v0"])
        }
        other => {
            return Err(model.fault(format!(
                "model `{other}` is not supported; PINHOLE, KANNALA_BRANDT or MEI are read"
            )));
        }
    };
    let size = ImageSize {
        width_px: root.need("image_width")?.count(1)?,
        height_px: root.need("image_height")?.count(1)?,
    };
    let camera =
        lens::camera(&projection, &lens, matrix(&projection, k)?, Some(size), &mut contents.warnings)?;
    let stated = root.get("camera_name").map(|name| name.text()).transpose()?.filter(|name| !name.is_empty());
    contents.cameras.push(named(stated.map_or_else(|| document.stem(), str::to_owned), camera, None));
    Ok(contents)
}

fn read_open_sfm(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    for entry in document.entry().entries()? {
        let (width, height) = (entry.need("width")?.count(1)?, entry.need("height")?.count(1)?);
        let side = f64::from(width.max(height));
        let model = entry.need("projection_type")?;
        let lens = match model.text()? {
            "perspective" | "brown" | "simple_radial" | "radial" => brown_conrady(&entry, "")?,
            "fisheye" | "fisheye_opencv" => fisheye(&entry, ["k1", "k2", "k3", "k4"])?,
            other => {
                return Err(model.fault(format!(
                    "model `{other}` is not supported; perspective, brown, radial, simple_radial, fisheye or fisheye_opencv are read"
                )));
            }
        };
        let focal = |axis: &str| match entry.first_of(&["focal", axis]) {
            Some(found) => found.number(),
            None => Err(entry.fault(format!("the key `{axis}` is missing"))),
        };
        let middle = |key: &str, side_px: u32| -> Result<f64, Fault> {
            Ok(number(&entry, key)?.unwrap_or(0.0) * side + (f64::from(side_px) - 1.0) / 2.0)
        };
        let k = CameraMatrix {
            fx_px: focal("focal_x")? * side,
            fy_px: focal("focal_y")? * side,
            cx_px: middle("c_x", width)?,
            cy_px: middle("c_y", height)?,
        };
        let size = ImageSize { width_px: width, height_px: height };
        let camera = lens::camera(&entry, &lens, k, Some(size), &mut contents.warnings)?;
        contents.cameras.push(named(entry.name().to_owned(), camera, None));
    }
    Ok(contents)
}

/// One camera of all frames, whose poses are then of other frames; or one a frame where these have lenses of their own.
fn read_transforms(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (document.entry(), Contents::default());
    let frames = root.get("frames").map_or(Ok(Vec::new()), |frames| frames.items())?;
    if !frames.iter().any(has_focal) {
        let camera = lens_of_transforms(&root, &root, &mut contents)?;
        contents.cameras.push(named(document.stem(), camera, None));
    }
    for frame in &frames {
        let Some(pose) = frame.get("transform_matrix") else { continue };
        let name = frame.need("file_path")?.text()?.to_owned();
        let flip = Pose::new(Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)), Vector3::zeros());
        let b_from_a = checks::pose4x4(&pose)? * flip;
        let placement = Placement { b: "world".into(), a: name.clone(), b_from_a, covariance: None };
        match has_focal(frame) {
            true => {
                let own = lens_of_transforms(frame, &root, &mut contents)?;
                contents.cameras.push(named(name, own, Some(placement)));
            }
            false => contents.relations.push(placement),
        }
    }
    Ok(contents)
}

/// Keys of the frame, or else of the file.
fn lens_of_transforms(frame: &Entry<'_>, root: &Entry<'_>, contents: &mut Contents) -> Result<Camera, Fault> {
    let get =
        |key: &str| number(frame, key).and_then(|own| own.map_or_else(|| number(root, key), |x| Ok(Some(x))));
    let need = |key: &str| get(key)?.ok_or_else(|| frame.fault(format!("the key `{key}` is missing")));
    let side = |key: &str| frame.get(key).map_or_else(|| root.need(key), Ok)?.count(1);
    let size = ImageSize { width_px: side("w")?, height_px: side("h")? };
    let [width, height] = [size.width_px, size.height_px].map(f64::from);
    let by_angle =
        |key: &str, side_px: f64| Ok(get(key)?.map(|angle_rad| side_px / 2.0 / (angle_rad / 2.0).tan()));
    let focal = |key: &str, angle: &str, side_px: f64| match get(key)? {
        Some(f) => Ok(Some(f)),
        None => by_angle(angle, side_px),
    };
    let fx_px = match focal("fl_x", "camera_angle_x", width)? {
        Some(f) => f,
        None => need("fl_x")?,
    };
    let fy_px = focal("fl_y", "camera_angle_y", height)?.unwrap_or(fx_px);
    let k = CameraMatrix {
        fx_px,
        fy_px,
        cx_px: get("cx")?.unwrap_or(width / 2.0) - 0.5,
        cy_px: get("cy")?.unwrap_or(height / 2.0) - 0.5,
    };
    let at = if frame.has("k1") { frame } else { root };
    let model = frame.first_of(&["camera_model"]).or_else(|| root.get("camera_model"));
    let flagged = root.get("is_fisheye").map(|flag| flag.flag()).transpose()?.unwrap_or(false);
    let lens = match model.as_ref().map(|model| model.text()).transpose()? {
        Some("OPENCV_FISHEYE") => fisheye(at, ["k1", "k2", "k3", "k4"])?,
        None if flagged => fisheye(at, ["k1", "k2", "k3", "k4"])?,
        None | Some("OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL") => {
            brown_conrady(at, "")?
        }
        Some(other) => {
            return Err(root.fault(format!(
                "camera_model `{other}` is not supported; PINHOLE, OPENCV or OPENCV_FISHEYE are read"
            )));
        }
    };
    lens::camera(frame, &lens, k, Some(size), &mut contents.warnings)
}
