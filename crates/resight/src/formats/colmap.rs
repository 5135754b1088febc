//! COLMAP's text tables. `cameras.txt`: CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]; the others are `colmap/model.rs`'s.
//!
//! COLMAP's pixel (0, 0) is the top-left corner of the image, ours the centre of its first pixel: ours = theirs − 0.5.

mod model;
mod write;

use super::document::{Document, Fault, Node, Syntax, Value};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Reads, Writer};
use crate::core::camera::{CameraMatrix, ImageSize};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Colmap,
    words: &["colmap"],
    reads: Some(Reads {
        recognises: |document| document.syntax == Syntax::Lines && table_of(&document.text).is_some(),
        read,
        together: Some(model::read),
    }),
    write: Some(Writer::Rig(write::write)),
    traps: &[
        "COLMAP counts pixels from the image's top-left corner; 0.5 px was subtracted from cx and cy.",
        "The poses in images.txt are world → camera (x_cam = R x_world + t, quaternion w x y z); the \
            camera's place is −Rᵀ t. Lengths are arbitrary unless the model was scaled.",
        "rigs.txt holds sensor_from_rig, frames.txt rig_from_world; the rig's frame is its reference sensor's.",
        "Several images may share a CAMERA_ID: one lens, not one place.",
    ],
};

/// Model name and its parameters, in COLMAP's order.
const MODELS: [(&str, &str); 13] = [
    ("SIMPLE_PINHOLE", "f cx cy"),
    ("PINHOLE", "fx fy cx cy"),
    ("SIMPLE_RADIAL", "f cx cy k1"),
    ("RADIAL", "f cx cy k1 k2"),
    ("OPENCV", "fx fy cx cy k1 k2 p1 p2"),
    ("FULL_OPENCV", "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"),
    ("OPENCV_FISHEYE", "fx fy cx cy k1 k2 k3 k4"),
    ("SIMPLE_RADIAL_FISHEYE", "f cx cy k1"),
    ("RADIAL_FISHEYE", "f cx cy k1 k2"),
    ("SIMPLE_FISHEYE", "f cx cy"),
    ("FISHEYE", "fx fy cx cy"),
    ("FOV", "fx fy cx cy omega"),
    ("EUCM", "fx fy cx cy alpha beta"),
];
const REFUSED: [&str; 5] =
    ["THIN_PRISM_FISHEYE", "RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION", "DIVISION", "EQUIRECTANGULAR"];

/// The tables of a text model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Table {
    Cameras,
    Images,
    Rigs,
    Frames,
    Points,
}

/// By the first line that is no comment; points by the comment above them, because their lines are numbers only.
fn table_of(text: &str) -> Option<Table> {
    if is_points_table(text) {
        return Some(Table::Points);
    }
    lines(text).next().and_then(|(_, words)| table_of_line(&words))
}

/// `points3D.txt`: no part of a calibration.
pub(super) fn is_points_table(text: &str) -> bool {
    text.starts_with("# 3D point list")
}

fn table_of_line(words: &[&str]) -> Option<Table> {
    let whole =
        |i: usize| words.get(i).is_some_and(|w| !w.is_empty() && w.bytes().all(|b| b.is_ascii_digit()));
    let numbers = |from: usize, to: usize| {
        words.get(from..to).is_some_and(|all| all.iter().all(|w| w.parse::<f64>().is_ok()))
    };
    let sensor = |i: usize| words.get(i).is_some_and(|w| matches!(*w, "CAMERA" | "IMU"));
    let capital = |w: &&str| {
        w.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit() || b == b'_')
            && w.bytes().any(|b| b.is_ascii_uppercase())
    };
    if !whole(0) {
        None
    } else if words.get(1).is_some_and(capital) && whole(2) {
        Some(Table::Cameras)
    } else if whole(1) && sensor(2) && whole(3) {
        Some(Table::Rigs)
    } else if whole(1) && numbers(2, 9) && whole(9) && sensor(10) {
        Some(Table::Frames)
    } else if numbers(1, 8) && whole(8) && 10 <= words.len() && words[9].parse::<f64>().is_err() {
        Some(Table::Images)
    } else {
        None
    }
}

/// Does this line open one of the tables?
pub(super) fn is_table_line(line: &str) -> bool {
    table_of_line(&line.split_whitespace().collect::<Vec<_>>()).is_some()
}

/// Lines that are neither blank nor comments, with their numbers, as words.
fn lines<'a>(text: &'a str) -> impl Iterator<Item = (usize, Vec<&'a str>)> {
    let words = |(i, line): (usize, &'a str)| (i + 1, line.split_whitespace().collect::<Vec<_>>());
    text.lines()
        .enumerate()
        .map(words)
        .filter(|(_, words)| words.first().is_some_and(|w| !w.starts_with('#')))
}

fn read(document: &Document) -> Result<Contents, Fault> {
    if table_of(&document.text) != Some(Table::Cameras) {
        return model::read_alone(document);
    }
    let mut contents = Contents::default();
    for (line, words) in lines(&document.text) {
        contents.cameras.push(camera_line(line, &words, &mut contents.warnings)?);
    }
    Ok(contents)
}

fn camera_line(line: usize, words: &[&str], warnings: &mut Vec<String>) -> Result<NamedCamera, Fault> {
    let [id, model, width, height, parameters @ ..] = words else {
        let seen = words.len();
        return Err(Fault::at(
            line,
            format!("{seen} words; CAMERA_ID MODEL WIDTH HEIGHT PARAMS are needed (a truncated file?)"),
        ));
    };
    let node = Node { line, value: Value::Null };
    let at = Entry { path: format!("camera {id}"), node: &node };
    let names = parameter_names(&at, model)?;
    let values = parameters.iter().map(|word| finite(&at, word)).collect::<Result<Vec<f64>, Fault>>()?;
    if values.len() != names.len() {
        return Err(at.fault(format!(
            "{} parameters; {model} takes {} ({})",
            values.len(),
            names.len(),
            names.join(", ")
        )));
    }
    let size = ImageSize { width_px: pixels(&at, width)?, height_px: pixels(&at, height)? };
    let get = |name: &str| names.iter().position(|n| *n == name).map(|i| values[i]);
    let f = get("f");
    let need = |name: &str| get(name).unwrap_or_default();
    let matrix = CameraMatrix {
        fx_px: f.unwrap_or(need("fx")),
        fy_px: f.unwrap_or(need("fy")),
        cx_px: need("cx") - 0.5,
        cy_px: need("cy") - 0.5,
    };
    let camera = lens::camera(&at, &lens_numbers(model, &need), matrix, Some(size), warnings)?;
    Ok(NamedCamera { name: id.to_string(), camera, placement: None })
}

fn parameter_names(at: &Entry<'_>, model: &str) -> Result<Vec<&'static str>, Fault> {
    if REFUSED.contains(&model) {
        return Err(at.fault(format!(
            "model {model} is not supported; undistort the images with COLMAP, or \
            refit as OPENCV or OPENCV_FISHEYE"
        )));
    }
    match MODELS.iter().find(|(name, _)| *name == model) {
        Some((_, parameters)) => Ok(parameters.split(' ').collect()),
        None => Err(at
            .fault(format!("unknown model `{model}`; read are {}", MODELS.map(|(name, _)| name).join(", ")))),
    }
}

fn lens_numbers(model: &str, get: &dyn Fn(&str) -> f64) -> LensNumbers {
    match model {
        "SIMPLE_RADIAL" | "RADIAL" | "OPENCV" => {
            LensNumbers::BrownConrady(["k1", "k2", "p1", "p2"].map(get).to_vec())
        }
        "FULL_OPENCV" => {
            LensNumbers::BrownConrady(["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"].map(get).to_vec())
        }
        "OPENCV_FISHEYE" | "SIMPLE_RADIAL_FISHEYE" | "RADIAL_FISHEYE" | "SIMPLE_FISHEYE" | "FISHEYE" => {
            LensNumbers::KannalaBrandt(["k1", "k2", "k3", "k4"].map(get))
        }
        "FOV" => LensNumbers::Fov { w_rad: get("omega") },
        "EUCM" => LensNumbers::Eucm { alpha: get("alpha"), beta: get("beta") },
        _ => LensNumbers::Pinhole,
    }
}

fn finite(at: &Entry<'_>, word: &str) -> Result<f64, Fault> {
    match word.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        Ok(x) => Err(at.fault(format!("a parameter is {x}; a finite number is needed"))),
        Err(_) if word.contains(',') => Err(at.fault(format!(
            "`{word}` has a comma; parameters are separated by blanks and decimals by points"
        ))),
        Err(_) => Err(at.fault(format!("`{word}` is not a number"))),
    }
}

fn pixels(at: &Entry<'_>, word: &str) -> Result<u32, Fault> {
    match word.parse::<u32>() {
        Ok(n) if 0 < n => Ok(n),
        _ => Err(at.fault(format!("image size `{word}`; a positive whole number is needed"))),
    }
}
