//! ROS `sensor_msgs/CameraInfo`: the YAML of `camera_calibration` and the printout of `ros2 topic echo`.
//!
//! R is a rectification, not a pose. The baseline of a stereo pair hides in P: P[0][3] = −fx′ · B.

use super::document::{Document, Fault};
use super::emit::{file_stem, list, quoted};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{
    CameraFormat, Contents, Format, NamedCamera, OutFile, Reads, WriteError, Writer, Written, checks, opencv,
};
use crate::core::camera::ImageSize;
use nalgebra::DMatrix;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::RosCameraInfo,
    words: &["ros", "camera_info"],
    reads: Some(Reads {
        recognises: |document| {
            let root = document.entry();
            let saved = root.has("camera_matrix")
                && (root.has("rectification_matrix") || root.has("projection_matrix"));
            let echoed = (root.has("k") || root.has("K"))
                && (root.has("p") || root.has("P"))
                && root.has("distortion_model");
            saved
                || echoed
                || (root.has("camera_matrix") && root.has("distortion_model") && root.has("camera_name"))
                    && !document.text.contains("opencv-matrix")
        },
        read,
        together: None,
    }),
    write: Some(Writer::Cameras(write)),
    traps: &[
        "R (rectification_matrix) turns this camera for rectified stereo; it is not where the camera is. \
            A camera_info file holds no pose.",
        "The camera frame is the optical one (x right, y down, z forward), not the body frame (x forward, \
            z up) of most ROS links.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let mut contents = Contents::default();
    let name = root.get("camera_name").map(|n| n.text().map(str::to_owned)).transpose()?;
    camera(&root, name.unwrap_or_else(|| document.stem()), &mut contents)?;
    Ok(contents)
}

/// Adds the camera of a message, a saved or a recorded one.
pub(super) fn camera(root: &Entry<'_>, name: String, contents: &mut Contents) -> Result<(), Fault> {
    refuse_crops(root)?;
    let k = root
        .first_of(&["camera_matrix", "k", "K"])
        .ok_or_else(|| root.fault("the key `camera_matrix` is missing"))?;
    // Before the size: a driver without a calibration sends zeros for both.
    let matrix = checks::camera_matrix(&k)?;
    let width = root
        .first_of(&["image_width", "width"])
        .ok_or_else(|| root.fault("the key `image_width` is missing"))?;
    let height = root
        .first_of(&["image_height", "height"])
        .ok_or_else(|| root.fault("the key `image_height` is missing"))?;
    let size = ImageSize { width_px: width.count(1)?, height_px: height.count(1)? };
    let lens = lens_numbers(root, &mut contents.warnings)?;
    let camera = lens::camera(&k, &lens, matrix, Some(size), &mut contents.warnings)?;
    contents.cameras.push(NamedCamera::new(name, camera, None));
    let (notes, warnings) = rectified(root)?;
    contents.notes.extend(notes);
    contents.warnings.extend(warnings);
    Ok(())
}

fn lens_numbers(root: &Entry<'_>, warnings: &mut Vec<String>) -> Result<LensNumbers, Fault> {
    let model = root
        .first_of(&["distortion_model", "camera_model"])
        .ok_or_else(|| root.fault("the key `distortion_model` is missing"))?;
    let d = root
        .first_of(&["distortion_coefficients", "d", "D"])
        .ok_or_else(|| root.fault("the key `distortion_coefficients` is missing"))?;
    // Drivers write five columns whatever the model; a row's numbers say themselves how many there are.
    let mut numbers =
        match d.get("data").filter(|_| d.get("rows").is_some_and(|rows| rows.number() == Ok(1.0))) {
            Some(data) => data.numbers()?,
            None => d.numbers()?,
        };
    let mut word = model.text()?;
    // Drivers do not always mean the name: nodes hand the numbers to OpenCV, which goes by their count.
    if word == "plumb_bob" && 8 <= numbers.len() {
        warnings.push(format!(
            "{}: {} coefficients under plumb_bob are read as rational_polynomial, as image_geometry and OpenCV read them",
            d.path,
            numbers.len()
        ));
        word = "rational_polynomial";
    }
    // What librealsense calls its models stands in recordings of its own recorder.
    let realsense = word.to_ascii_lowercase().replace(' ', "_");
    if matches!(realsense.as_str(), "brown_conrady" | "inverse_brown_conrady" | "modified_brown_conrady") {
        if realsense != "brown_conrady" && (2..4).any(|i| numbers.get(i).is_some_and(|p| *p != 0.0)) {
            warnings.push(format!(
                "{}: `{word}` is read as plumb_bob, from which its tangential terms differ by some 0.01 px",
                model.path
            ));
        }
        word = "plumb_bob";
    }
    // realsense2_camera writes five whatever the model.
    if matches!(word, "equidistant" | "fisheye") && numbers.len() == 5 && numbers[4] == 0.0 {
        numbers.truncate(4);
    }
    let (lens, counts): (_, &[usize]) =
        match word {
            "plumb_bob" => (opencv::brown_conrady(&d, numbers.clone()), &[0, 4, 5]),
            "rational_polynomial" => (opencv::brown_conrady(&d, numbers.clone()), &[8, 12, 14]),
            "equidistant" | "fisheye" => {
                let four = <[f64; 4]>::try_from(numbers.clone()).unwrap_or_default();
                (Ok(LensNumbers::KannalaBrandt(four)), &[4])
            }
            "none" | "" => (opencv::brown_conrady(&d, numbers.clone()), &[0, 4, 5]),
            other => return Err(model.fault(format!(
                "unknown distortion model `{other}`; plumb_bob, rational_polynomial or equidistant are read"
            ))),
        };
    if !counts.contains(&numbers.len()) {
        let needed = counts.iter().filter(|n| 0 < **n).map(usize::to_string).collect::<Vec<_>>().join(" or ");
        return Err(d.fault(format!("holds {} coefficients; {word} takes {needed}", numbers.len())));
    }
    if matches!(word, "none" | "") && numbers.iter().any(|x| *x != 0.0) {
        return Err(d.fault("has coefficients although distortion_model is none"));
    }
    lens
}

/// Binned or cropped images need other intrinsics than the file's, rectified or not.
pub(super) fn refuse_crops(root: &Entry<'_>) -> Result<(), Fault> {
    for key in ["binning_x", "binning_y"] {
        if let Some(binning) = root.get(key).filter(|b| b.number().is_ok_and(|n| 1.0 < n)) {
            let seen = binning.number()?;
            return Err(binning.fault(format!(
                "is {seen}: K and P belong to unbinned images; give the camera_info of the images themselves"
            )));
        }
    }
    let Some(roi) = root.get("roi") else { return Ok(()) };
    let zero = |key: &str| roi.get(key).is_none_or(|x| x.number().is_ok_and(|x| x == 0.0));
    let full = root.first_of(&["image_width", "width"]).and_then(|w| w.number().ok());
    let whole = zero("width") || roi.get("width").and_then(|w| w.number().ok()) == full;
    if zero("x_offset") && zero("y_offset") && whole {
        return Ok(());
    }
    Err(roi.fault(
        "is a part of the image; K and P belong to the whole. Subtract x_offset, y_offset from cx, \
        cy and remove roi",
    ))
}

/// What P and R say, in a note, and that they say nothing, in warnings; neither is read otherwise.
fn rectified(root: &Entry<'_>) -> Result<(Option<String>, Vec<String>), Fault> {
    let mut warnings = Vec::new();
    let r = root.first_of(&["rectification_matrix", "r", "R"]).map(|r| r.matrix(3, 3)).transpose()?;
    if r.is_some_and(|r| !((&r * r.transpose() - DMatrix::identity(3, 3)).amax() <= 0.01)) {
        warnings.push(
            "rectification_matrix is no rotation (zeros: the camera was never calibrated as one of a pair); it is not used here".into(),
        );
    }
    let Some(p) = root.first_of(&["projection_matrix", "p", "P"]) else { return Ok((None, warnings)) };
    let p = p.matrix(3, 4)?;
    let (f, tx) = (p[(0, 0)], p[(0, 3)]);
    let rest = [p[(1, 0)], p[(2, 0)], p[(2, 1)], p[(2, 2)] - 1.0, p[(2, 3)]];
    if !(0.0 < f && 0.0 < p[(1, 1)] && rest.iter().all(|x| x.abs() <= 1e-6)) {
        warnings.push(
            "projection_matrix is not that of a rectified image ([fx 0 cx Tx; 0 fy cy Ty; 0 0 1 0]): zeros, K times a pose, or spoilt? It is not \
            used here, but image_proc and rviz use it"
                .into(),
        );
        return Ok((None, warnings));
    }
    let note = (tx != 0.0).then(|| {
        format!(
            "P holds the stereo baseline: {:.6} m along x from the first rectified camera (−P[0][3] / \
            P[0][0]).",
            -tx / f
        )
    });
    Ok((note, warnings))
}

/// One file a camera, as `camera_calibration` saves it; a pose has no place in it.
fn write(cameras: &[NamedCamera]) -> Written {
    let file = |camera: &NamedCamera| {
        let name = format!("{}.yaml", file_stem(&camera.name));
        let text = text(camera).map_err(|e| WriteError(format!("{}: {e}", camera.name)))?;
        Ok(OutFile { name, text })
    };
    cameras.iter().map(file).collect()
}

fn text(camera: &NamedCamera) -> Result<String, WriteError> {
    let size = camera
        .camera
        .size
        .ok_or_else(|| WriteError("camera_info needs the image size, which this camera has not".into()))?;
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    let (model, d) = model_of(numbers)?;
    let rows = opencv::matrix_rows(&k);
    let p = [rows[0], 0.0, rows[2], 0.0, 0.0, rows[4], rows[5], 0.0, 0.0, 0.0, 1.0, 0.0];
    let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    let matrix = |key: &str, rows: usize, cols: usize, data: &[f64]| {
        format!("{key}:\n  rows: {rows}\n  cols: {cols}\n  data: {}\n", list(data))
    };
    Ok([
        pose_comment(camera),
        format!("image_width: {}\nimage_height: {}\n", size.width_px, size.height_px),
        format!("camera_name: {}\n", quoted(&camera.name)),
        matrix("camera_matrix", 3, 3, &rows),
        format!("distortion_model: {model}\n"),
        matrix("distortion_coefficients", 1, d.len(), &d),
        matrix("rectification_matrix", 3, 3, &identity),
        matrix("projection_matrix", 3, 4, &p),
    ]
    .concat())
}

fn pose_comment(camera: &NamedCamera) -> String {
    let Some(p) = &camera.placement else { return String::new() };
    let frames = format!("{} from {}", p.b, p.a).replace(char::is_control, " ");
    format!("# The pose {frames} is not part of camera_info; publish it as a transform.\n")
}

fn model_of(numbers: LensNumbers) -> Result<(&'static str, Vec<f64>), WriteError> {
    match numbers {
        LensNumbers::Pinhole => Ok(("plumb_bob", vec![0.0; 5])),
        LensNumbers::BrownConrady(mut d) if d.len() <= 5 => {
            d.resize(5, 0.0);
            Ok(("plumb_bob", d))
        }
        LensNumbers::BrownConrady(d) if d[8..].iter().all(|x| *x == 0.0) => {
            Ok(("rational_polynomial", d[..8].to_vec()))
        }
        LensNumbers::BrownConrady(_) => {
            Err(WriteError("camera_info has no thin-prism or tilt terms; write opencv or resight".into()))
        }
        LensNumbers::KannalaBrandt(d) => Ok(("equidistant", d.to_vec())),
        other => {
            Err(WriteError(format!("camera_info has no {} model; write resight or kalibr", other.model())))
        }
    }
}
