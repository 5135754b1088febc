//! OpenSfM's `camera_models.json` and `reconstruction.json`.
//!
//! `focal`, `c_x` and `c_y` are in parts of the longer side of the image, from its middle, where pixel (0, 0) is the centre of the first
//! pixel (`features.normalized_image_coordinates`: (u + 0.5 − width / 2) / side). Coefficients are those of OpenCV; of `fisheye` k1 and k2
//! are the first two of its fisheye. A shot's `rotation` (axis times angle) and `translation` are cam_from_world (`pygeometry.Pose`), camera
//! axes x right, y down, z forward. Lengths are metres only where the images had GPS positions or control points.

use super::document::{Document, Fault, Node, Value};
use super::entry::Entry;
use super::scalar_keys::{brown_conrady, fisheye, number_of};
use super::shots::{self, Shot};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks, lens};
use crate::core::camera::{CameraMatrix, ImageSize};
use crate::core::{Camera, Pose};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::OpenSfm,
    words: &[],
    reads: Some(Reads {
        recognises: |document| are_models(&document.root) || !reconstructions(document).is_empty(),
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "focal, c_x and c_y are in parts of the longer side of the image, from its middle.",
        "rotation and translation of a shot map the world into the camera (x_cam = R x_world + t); its position is -Rᵀ t.",
        "Lengths are metres only where positions of the images or control points were given.",
    ],
};

fn are_models(node: &Node) -> bool {
    match &node.value {
        Value::Map(entries) => {
            !entries.is_empty() && entries.iter().all(|(_, node)| node.get("projection_type").is_some())
        }
        _ => false,
    }
}

/// The reconstructions of the file: parts of a scene that nothing joins.
fn reconstructions(document: &Document) -> Vec<Entry<'_>> {
    let is_one = |e: &Entry<'_>| e.get("cameras").is_some_and(|c| are_models(c.node)) && e.has("shots");
    let parts = document.entry().items().unwrap_or_else(|_| vec![document.entry()]);
    if parts.iter().all(is_one) { parts } else { Vec::new() }
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    let parts = reconstructions(document);
    if parts.is_empty() {
        for entry in document.entry().entries()? {
            let camera = camera(&entry, &mut contents.warnings)?;
            contents.cameras.push(camera);
        }
    }
    for (i, part) in parts.iter().enumerate() {
        let world = if parts.len() == 1 { "world".to_owned() } else { format!("world_{i}") };
        let mut lenses = Vec::new();
        for entry in part.need("cameras")?.entries()? {
            lenses.push((entry.name().to_owned(), camera(&entry, &mut contents.warnings)?));
        }
        let all = part.need("shots")?.entries()?;
        let shots = all.iter().map(|entry| shot(entry, &world)).collect::<Result<Vec<_>, Fault>>()?;
        shots::add(&mut contents, lenses, shots);
    }
    Ok(contents)
}

fn shot(entry: &Entry<'_>, world: &str) -> Result<Shot, Fault> {
    let rotation = entry.need("rotation")?;
    let b_from_a = Pose::new(
        checks::rodrigues(&rotation, checks::vector3(&rotation)?)?,
        checks::vector3(&entry.need("translation")?)?,
    );
    let name = entry.name().to_owned();
    let placement = Placement { b: name.clone(), a: world.to_owned(), b_from_a, covariance: None };
    Ok(Shot { lens: entry.need("camera")?.text()?.to_owned(), name, placement })
}

fn camera(entry: &Entry<'_>, warnings: &mut Vec<String>) -> Result<NamedCamera, Fault> {
    let model = entry.need("projection_type")?;
    let lens = match model.text()? {
        "perspective" | "brown" | "simple_radial" | "radial" => brown_conrady(entry, "")?,
        "fisheye" | "fisheye_opencv" => fisheye(entry, ["k1", "k2", "k3", "k4"])?,
        other => {
            return Err(model.fault(format!(
                "model `{other}` is not supported; perspective, brown, radial, simple_radial, fisheye or fisheye_opencv are read"
            )));
        }
    };
    let (width, height) = (entry.need("width")?.count(1)?, entry.need("height")?.count(1)?);
    let side = f64::from(width.max(height));
    let focal = |axis: &str| match entry.first_of(&["focal", axis]) {
        Some(found) => found.number(),
        None => Err(entry.fault(format!("the key `{axis}` is missing"))),
    };
    let middle = |key: &str, side_px: u32| -> Result<f64, Fault> {
        Ok(number_of(entry, key)?.unwrap_or(0.0) * side + (f64::from(side_px) - 1.0) / 2.0)
    };
    let k = CameraMatrix {
        fx_px: focal("focal_x")? * side,
        fy_px: focal("focal_y")? * side,
        cx_px: middle("c_x", width)?,
        cy_px: middle("c_y", height)?,
    };
    let size = ImageSize { width_px: width, height_px: height };
    let camera: Camera = lens::camera(entry, &lens, k, Some(size), warnings)?;
    Ok(NamedCamera::new(entry.name(), camera, None))
}
