//! `rs2_intrinsics` of librealsense as JSON, as programs write it out field by field: `width`, `height`, `ppx`, `ppy`, `fx`, `fy`, `model`,
//! `coeffs`; alone, or a table of streams (`color`, `depth` …); read only.
//!
//! `rsutil.h`: BROWN_CONRADY is OpenCV's (k1 k2 p1 p2 k3), KANNALA_BRANDT4 its fisheye. MODIFIED and INVERSE_BROWN_CONRADY put the radially
//! distorted point into the tangential terms: OpenCV's formula up to some 0.01 px, which are computed, reported, and bounded here. is
//! the field-of-view model. Pixel (0, 0) is the centre of the first pixel (`rs2_fov` adds 0.5).

use super::document::{Document, Fault, Value};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::scalar_keys::{has_number, matrix};
use super::{CameraFormat, Contents, Format, NamedCamera, Reads, opencv};
use crate::core::camera::{CameraMatrix, ImageSize};
use crate::core::{Camera, Pixel};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::RealSense,
    words: &[],
    reads: Some(Reads { recognises: |document| !streams(document).is_empty(), read, together: None }),
    write: None,
    traps: &[
        "A RealSense camera has other intrinsics for every resolution; these belong to width × height.",
        "Inverse Brown–Conrady names the direction in which the coefficients are used, not their inverse: rs2_project_point_to_pixel applies \
            them as OpenCV does, but for p1 and p2.",
    ],
};

fn is_stream(entry: &Entry<'_>) -> bool {
    ["ppx", "ppy", "fx", "fy"].iter().all(|key| has_number(entry, key))
}

/// The file itself, or its tables that are streams.
fn streams(document: &Document) -> Vec<Entry<'_>> {
    let root = document.entry();
    if is_stream(&root) {
        return vec![root];
    }
    root.entries().unwrap_or_default().into_iter().filter_map(stream_of).collect()
}

/// A table itself, or its `intrinsics` under its name.
fn stream_of(entry: Entry<'_>) -> Option<Entry<'_>> {
    match entry.get("intrinsics") {
        Some(inner) if is_stream(&inner) => Some(Entry::called(entry.name(), inner.node)),
        _ => is_stream(&entry).then_some(entry),
    }
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    for entry in streams(document) {
        let camera = camera(&entry, &mut contents.warnings)?;
        let name = if entry.path.is_empty() { document.stem() } else { entry.name().to_owned() };
        contents.cameras.push(NamedCamera::new(name, camera, None));
    }
    Ok(contents)
}

fn camera(entry: &Entry<'_>, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
    let size =
        ImageSize { width_px: entry.need("width")?.count(1)?, height_px: entry.need("height")?.count(1)? };
    let (lens, is_own) = lens_numbers(entry, warnings)?;
    let k = matrix(entry, ["fx", "fy", "ppx", "ppy"])?;
    let camera = lens::camera(entry, &lens, k, Some(size), warnings)?;
    if let (true, LensNumbers::BrownConrady(d)) = (is_own, &lens) {
        let most_px = largest_difference_px(&camera, size, d, k);
        if !(most_px <= MOST_PX) {
            return Err(entry.fault(format!(
                "{OWN} differs by {most_px:.2} px from OpenCV's formula (at most {MOST_PX} px is read); calibrate the camera (resight \
                    intrinsics)"
            )));
        }
        if REMARKED_PX < most_px {
            warnings.push(format!(
                "{OWN} is read as OpenCV's formula, from which it differs by at most {most_px:.3} px"
            ));
        }
    }
    Ok(camera)
}

/// What is remarked on, and what is refused.
const REMARKED_PX: f64 = 0.01;
const MOST_PX: f64 = 0.5;
const OWN: &str = "RealSense's own tangential distortion (modified or inverse Brown–Conrady)";

/// Between OpenCV's formula and `rs2_project_point_to_pixel`, over a grid of the image.
fn largest_difference_px(camera: &Camera, size: ImageSize, d: &[f64], k: CameraMatrix) -> f64 {
    let &[k1, k2, p1, p2, k3] = d else { return 0.0 };
    let (w, h) = (f64::from(size.width_px), f64::from(size.height_px));
    let mut most: f64 = 0.0;
    for (i, j) in (0..=8).flat_map(|i| (0..=8).map(move |j| (i, j))) {
        let pixel = Pixel::new(w * f64::from(i) / 8.0 - 0.5, h * f64::from(j) / 8.0 - 0.5);
        let Ok(bearing) = camera.bearing(&pixel) else { continue };
        let (x, y) = (bearing.x / bearing.z, bearing.y / bearing.z);
        let r2 = x * x + y * y;
        let f = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let (x, y) = (x * f, y * f);
        let dx = x + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
        let dy = y + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y);
        most = most.max((pixel - Pixel::new(k.fx_px * dx + k.cx_px, k.fy_px * dy + k.cy_px)).norm());
    }
    most
}

/// Whether the formula is RealSense's own.
fn lens_numbers(entry: &Entry<'_>, warnings: &mut Vec<String>) -> Result<(LensNumbers, bool), Fault> {
    let Some(coefficients) = entry.first_of(&["coeffs", "coefficients", "distortion_coeffs"]) else {
        warnings.push("no coefficients (coeffs); read as a camera without distortion".into());
        return Ok((LensNumbers::Pinhole, false));
    };
    let d = <[f64; 5]>::try_from(coefficients.exactly(5, "k1 k2 p1 p2 k3")?).unwrap_or_default();
    if d.iter().all(|x| *x == 0.0) {
        return Ok((LensNumbers::Pinhole, false));
    }
    let Some(model) = entry.first_of(&["model", "distortion_model"]) else {
        return Err(entry.fault("has coefficients but no `model`; librealsense has five with other formulas"));
    };
    let word = match &model.node.value {
        Value::Number(n) => NUMBERS.get(*n as usize).copied().unwrap_or("unknown").to_owned(),
        _ => model.text()?.rsplit('.').next().unwrap_or_default().to_lowercase().replace([' ', '-'], "_"),
    };
    match word.trim_start_matches("rs2_").trim_start_matches("distortion_") {
        "none" => Err(coefficients.fault("has coefficients although model is none")),
        "brown_conrady" => Ok((opencv::brown_conrady(&coefficients, d.to_vec())?, false)),
        "modified_brown_conrady" | "inverse_brown_conrady" => {
            Ok((opencv::brown_conrady(&coefficients, d.to_vec())?, true))
        }
        "kannala_brandt4" => Ok((LensNumbers::KannalaBrandt([d[0], d[1], d[2], d[3]]), false)),
        "ftheta" | "f_theta" => Ok((LensNumbers::Fov { w_rad: d[0] }, false)),
        _ => Err(model.fault(format!(
            "unknown model `{word}`; none, brown_conrady, modified_brown_conrady, inverse_brown_conrady, kannala_brandt4 or ftheta are read"
        ))),
    }
}

/// Of `rs2_distortion`.
const NUMBERS: [&str; 6] =
    ["none", "modified_brown_conrady", "inverse_brown_conrady", "ftheta", "brown_conrady", "kannala_brandt4"];
