//! A line of `cameras.txt`: CAMERA_ID MODEL WIDTH HEIGHT PARAMS[].

use crate::NamedCamera;
use crate::core::camera::{CameraMatrix, ImageSize};
use crate::document::{Fault, Node, Value};
use crate::entry::Entry;
use crate::lens::{self, LensNumbers};

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

pub(super) fn camera_line(
    line: usize,
    words: &[&str],
    warnings: &mut Vec<String>,
) -> Result<NamedCamera, Fault> {
    let [id, model, width, height, parameters @ ..] = words else {
        let seen = words.len();
        return Err(Fault::at(line, format!("{seen} words; CAMERA_ID MODEL WIDTH HEIGHT PARAMS are needed")));
    };
    let node = Node { line, value: Value::Null };
    let at = Entry::called(format!("camera {id}"), &node);
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
    Ok(NamedCamera::new(id.to_string(), camera, None))
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

pub(super) fn finite(at: &Entry<'_>, word: &str) -> Result<f64, Fault> {
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
