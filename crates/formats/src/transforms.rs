//! The `transforms.json` of nerfstudio and instant-ngp.
//!
//! `transform_matrix` is world_from_cam with OpenGL's camera axes: x right, y up, z back (nerfstudio, `data_conventions`). `cx` and `cy` count
//! from the corner of the first pixel: both programs shoot the ray of pixel i through i + 0.5 (nerfstudio `Cameras.get_image_coords`,
//! instant-ngp divides them by `w` and `h`). The unit is the scene's own. Angles are `camera_angle_x` in radians, `x_fov` in degrees
//! (instant-ngp, `nerf_loader.cu`).
//!
//! Of perspective lenses nerfstudio computes 1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸ (`camera_utils.py`), tangential terms as OpenCV: k1 k2 p1 p2 k3
//! are OpenCV's, k4 is not. OPENCV_FISHEYE is OpenCV's fisheye.

use super::document::{Document, Fault};
use super::emit::{list, number, quoted};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::placed::{cam_from_gl_cam, placed, size_of};
use super::scalar_keys::{brown_conrady, fisheye, has_number, number_of};
use super::{
    CameraFile, CameraFormat, Contents, Format, NamedCamera, OutFile, Placement, Reads, WriteError, Writer,
    Written, checks,
};
use crate::core::Camera;
use crate::core::camera::{CameraMatrix, ImageSize};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::NerfTransforms,
    words: &["transforms", "nerfstudio"],
    reads: Some(Reads { recognises, read, together: None }),
    write: Some(Writer::Rig(write)),
    traps: &[
        "transform_matrix maps camera points into the world, with camera axes x right, y up, z back (OpenGL); here they are x right, y down, \
            z forward.",
        "The unit of its translation is whatever the reconstruction had: COLMAP's is no metre, and nerfstudio scales and centres the scene.",
        "Pixel (0, 0) is the corner of the first pixel there; 0.5 px are taken off cx and cy.",
        "k4 is the coefficient of r⁸ in nerfstudio, not OpenCV's k4; instant-ngp ignores k3 beside p1.",
    ],
};

/// Where a focal length may stand, axis by axis.
const FOCALS: [[&str; 3]; 2] = [["fl_x", "camera_angle_x", "x_fov"], ["fl_y", "camera_angle_y", "y_fov"]];

fn recognises(document: &Document) -> bool {
    let root = document.entry();
    let frames = root.get("frames").and_then(|frames| frames.items().ok()).unwrap_or_default();
    has_focal(&root) || frames.first().is_some_and(has_focal)
}

fn has_focal(entry: &Entry<'_>) -> bool {
    FOCALS.iter().flatten().any(|key| has_number(entry, key))
}

/// One camera of the frames that have no lens of their own, whose poses are then of other frames; and one a frame that has.
fn read(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (document.entry(), Contents::default());
    let frames = root.get("frames").map_or(Ok(Vec::new()), |frames| frames.items())?;
    if frames.is_empty() || !frames.iter().all(has_focal) {
        let camera = camera(&root, &root, &mut contents)?;
        contents.cameras.push(named(document.stem(), camera, None));
    }
    for frame in &frames {
        let name = frame.need("file_path")?.text()?.to_owned();
        let placement = match frame.get("transform_matrix") {
            Some(matrix) => {
                let b_from_a = checks::pose3x4_or_4x4(&matrix)? * cam_from_gl_cam();
                Some(Placement { b: "world".into(), a: name.clone(), b_from_a, covariance: None })
            }
            None if frame.has("transform_matrix_start") => {
                return Err(frame.fault(
                    "moves while it is exposed (transform_matrix_start and _end); one transform_matrix a frame is read",
                ));
            }
            None => None,
        };
        if has_focal(frame) {
            let own = camera(frame, &root, &mut contents)?;
            contents.cameras.push(named(name, own, placement));
        } else {
            contents.relations.extend(placement);
        }
    }
    if root.has("applied_transform") || root.has("applied_scale") {
        contents.notes.push(
            "nerfstudio rotated and scaled the world of the reconstruction (applied_transform, applied_scale); poses are those of the file."
                .into(),
        );
    }
    Ok(contents)
}

fn named(name: String, camera: Camera, placement: Option<Placement>) -> NamedCamera {
    NamedCamera::new(name, camera, placement)
}

/// Keys of the frame, or else of the file.
fn camera(frame: &Entry<'_>, root: &Entry<'_>, contents: &mut Contents) -> Result<Camera, Fault> {
    let find = |key: &str| frame.get(key).or_else(|| root.get(key));
    let get = |key: &str| find(key).map(|found| found.number()).transpose();
    let side = |key: &str| {
        match find(key) {
        Some(found) => found.count(1),
        None => Err(frame.fault(format!(
            "the key `{key}` is missing: `w` and `h`, the size of the images in pixels, are needed; add them to the file"
        ))),
    }
    };
    let size = ImageSize { width_px: side("w")?, height_px: side("h")? };
    let [width, height] = [size.width_px, size.height_px].map(f64::from);
    let focal = |[focal, radians, degrees]: [&str; 3], side_px: f64| {
        let of_angle = |angle_rad: f64| side_px / 2.0 / (angle_rad / 2.0).tan();
        Ok(match (get(focal)?, get(radians)?, get(degrees)?) {
            (Some(focal_px), ..) => Some(focal_px),
            (None, Some(angle_rad), _) => Some(of_angle(angle_rad)),
            (None, None, Some(angle_deg)) => Some(of_angle(angle_deg.to_radians())),
            (None, None, None) => None,
        })
    };
    let (fx_px, fy_px) = match (focal(FOCALS[0], width)?, focal(FOCALS[1], height)?) {
        (Some(fx_px), fy_px) => (fx_px, fy_px.unwrap_or(fx_px)),
        (None, Some(fy_px)) => (fy_px, fy_px),
        (None, None) => return Err(frame.fault("the key `fl_x` is missing")),
    };
    let matrix = CameraMatrix {
        fx_px,
        fy_px,
        cx_px: get("cx")?.unwrap_or(width / 2.0) - 0.5,
        cy_px: get("cy")?.unwrap_or(height / 2.0) - 0.5,
    };
    let lens = lens_numbers(if frame.has("k1") { frame } else { root }, frame, root)?;
    lens::camera(frame, &lens, matrix, Some(size), &mut contents.warnings)
}

/// `at` holds the coefficients.
fn lens_numbers(at: &Entry<'_>, frame: &Entry<'_>, root: &Entry<'_>) -> Result<LensNumbers, Fault> {
    let find = |key: &str| frame.get(key).or_else(|| root.get(key));
    if let Some(other) = ["ftheta_p0", "latlong", "equirectangular"].into_iter().find_map(find) {
        return Err(
            other.fault("belongs to a lens that is not read; perspective lenses and OPENCV_FISHEYE are")
        );
    }
    let model = find("camera_model");
    let flagged = find("is_fisheye").map(|flag| flag.flag()).transpose()?.unwrap_or(false);
    match model.as_ref().map(|model| model.text()).transpose()? {
        Some("OPENCV_FISHEYE") => fisheye(at, ["k1", "k2", "k3", "k4"]),
        None if flagged => fisheye(at, ["k1", "k2", "k3", "k4"]),
        None | Some("OPENCV" | "PINHOLE" | "SIMPLE_PINHOLE" | "SIMPLE_RADIAL" | "RADIAL") => {
            if let Some(k4) = number_of(at, "k4")?.filter(|k4| *k4 != 0.0) {
                return Err(at.fault(format!(
                    "k4 is {k4}, the coefficient of r⁸, which no model here has; k1 to k3, p1 and p2 are read"
                )));
            }
            brown_conrady(at, "")
        }
        Some(other) => Err(root.fault(format!(
            "camera_model `{other}` is not supported; PINHOLE, OPENCV or OPENCV_FISHEYE are read"
        ))),
    }
}

/// A frame a camera, with its name for a path.
fn write(file: &CameraFile) -> Written {
    let rig = placed(file, Format::NerfTransforms)?;
    let lenses = file.cameras.iter().map(lens_keys).collect::<Result<Vec<_>, WriteError>>()?;
    if let Some(other) = lenses.iter().position(|(model, _)| *model != lenses[0].0) {
        return Err(WriteError(format!(
            "{} is {}, {} is {}: a transforms.json has one camera_model; write a file for each",
            file.cameras[0].name, lenses[0].0, file.cameras[other].name, lenses[other].0
        )));
    }
    let frame = |(camera, (_, keys)): (&super::placed::Placed<'_>, &(&str, String))| {
        let rows = camera.root_from_gl_cam().matrix().map(|row| list(&row)).join(", ");
        format!(
            "    {{ \"file_path\": {}, {keys},\n      \"transform_matrix\": [{rows}] }}",
            quoted(&camera.camera.name)
        )
    };
    let frames: Vec<String> = rig.cameras.iter().zip(&lenses).map(frame).collect();
    let text = format!(
        "{{\n  \"camera_model\": \"{}\",\n  \"frames\": [\n{}\n  ]\n}}\n",
        lenses[0].0,
        frames.join(",\n")
    );
    Ok(OutFile::only("transforms.json", text))
}

/// Model and the keys of one camera.
fn lens_keys(camera: &NamedCamera) -> Result<(&'static str, String), WriteError> {
    let size = size_of(camera, "transforms.json")?;
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    let refused = |what: String| Err(WriteError(format!("{}: transforms.json has no {what}", camera.name)));
    let (model, coefficients): (_, Vec<(&str, f64)>) = match &numbers {
        LensNumbers::Pinhole => ("OPENCV", Vec::new()),
        LensNumbers::BrownConrady(d) => match lens::in_counts(d, &[4, 5]) {
            Some(d) => ("OPENCV", ["k1", "k2", "p1", "p2", "k3"].into_iter().zip(d).collect()),
            None => return refused("coefficients beyond k1 k2 p1 p2 k3; write resight".into()),
        },
        LensNumbers::KannalaBrandt(d) => {
            ("OPENCV_FISHEYE", ["k1", "k2", "k3", "k4"].into_iter().zip(*d).collect())
        }
        other => return refused(format!("{} model; write resight", other.model())),
    };
    let matrix = [("fl_x", k.fx_px), ("fl_y", k.fy_px), ("cx", k.cx_px + 0.5), ("cy", k.cy_px + 0.5)];
    let keys: Vec<String> =
        matrix.iter().chain(&coefficients).map(|(key, x)| format!("\"{key}\": {}", number(*x))).collect();
    Ok((model, format!("\"w\": {}, \"h\": {}, {}", size.width_px, size.height_px, keys.join(", "))))
}
