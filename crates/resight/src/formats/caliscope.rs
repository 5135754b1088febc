//! Caliscope `camera_array.toml` and aniposelib's TOML: world → camera (they feed it to OpenCV's projectPoints).

use super::document::{Document, Fault, Syntax, Value};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks, opencv};
use crate::core::{Camera, Pose};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Caliscope,
    words: &[],
    reads: Some(Reads {
        recognises: |document| document.syntax == Syntax::Toml && !tables(&document.entry()).is_empty(),
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "rotation and translation map world points into the camera (x_cam = R x_world + t), although \
            Caliscope's source calls them the camera's pose; the camera's place is −Rᵀ t.",
        "aniposelib loads the tables in the order of their sorted names: cam_10 comes before cam_2. Go by \
            name, not by position.",
    ],
};

/// `[cameras.N]`, or `[cam_N]` with a matrix.
fn tables<'a>(root: &Entry<'a>) -> Vec<Entry<'a>> {
    let below = root.get("cameras").unwrap_or_else(|| root.clone());
    let is_camera = |e: &Entry<'_>| matches!(e.node.value, Value::Map(_)) && e.has("matrix") && e.has("size");
    below.entries().unwrap_or_default().into_iter().filter(is_camera).collect()
}

/// Caliscope lists cameras before they are calibrated.
fn uncalibrated(root: &Entry<'_>) -> Vec<String> {
    let listed = root.get("cameras").and_then(|c| c.entries().ok()).unwrap_or_default();
    let without = listed.into_iter().filter(|e| !(e.has("matrix") && e.has("size")));
    without.map(|e| format!("{}: no matrix or no size yet; this camera is left out", e.path)).collect()
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    contents.warnings.extend(uncalibrated(&document.entry()));
    for entry in tables(&document.entry()) {
        let stated = entry.get("name").map(|n| n.text().map(str::to_owned)).transpose()?;
        let name = stated.unwrap_or_else(|| entry.name().to_owned());
        let camera = one_camera(&entry, &mut contents.warnings)?;
        let placement = placement(&entry, &name)?;
        if let Some(p) = &placement {
            let what = format!("{}.translation", entry.path);
            contents.warnings.extend(checks::unit_warning(&what, p.b_from_a.translation.norm()));
        }
        contents.cameras.push(NamedCamera { name, camera, placement });
    }
    contents.notes.push(
        "translation is in the unit of the calibration board, which the file does not \
        state; metres are assumed."
            .into(),
    );
    Ok(contents)
}

fn one_camera(entry: &Entry<'_>, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
    let k = entry.need("matrix")?;
    let matrix = checks::camera_matrix(&k)?;
    let size = checks::size_pair(&entry.need("size")?)?;
    let distortion = entry
        .first_of(&["distortions", "distortion"])
        .ok_or_else(|| entry.fault("the key `distortions` is missing"))?;
    let d = distortion.numbers()?;
    let fisheye = entry.get("fisheye").map(|f| f.flag()).transpose()?.unwrap_or(false);
    let lens = match (fisheye, <[f64; 4]>::try_from(d.clone())) {
        (true, Ok(k)) => LensNumbers::KannalaBrandt(k),
        (true, Err(d)) => {
            return Err(distortion.fault(format!("holds {} coefficients; a fisheye takes 4", d.len())));
        }
        (false, _) => opencv::brown_conrady(&distortion, d)?,
    };
    lens::camera(&k, &lens, matrix, Some(size), warnings)
}

fn placement(entry: &Entry<'_>, name: &str) -> Result<Option<Placement>, Fault> {
    match (entry.get("rotation"), entry.get("translation")) {
        (Some(r), Some(t)) => {
            let b_from_a = Pose::new(checks::rotation_matrix_or_vector(&r)?, checks::vector3(&t)?);
            Ok(Some(Placement { b: name.to_owned(), a: "world".into(), b_from_a, covariance: None }))
        }
        (None, None) => Ok(None),
        _ => Err(entry.fault("rotation and translation belong together; one is missing")),
    }
}
