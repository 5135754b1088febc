//! multical's `calibration.json`: cameras as OpenCV has them, and their poses.
//!
//! `camera_poses` holds either `NAME` alone, cam_from_rig, or `NAME_to_MASTER`. The latter's name reads as if it mapped
//! points of NAME to MASTER; the numbers are the other way: x_NAME = R x_MASTER + T. Pixel origin as ours.

use super::document::{Document, Fault, Value};
use super::emit::{list, quoted};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::opencv::{brown_conrady, matrix_rows};
use super::placed::{PlacedRig, placed, size_of};
use super::{
    CameraFile, CameraFormat, Contents, Format, NamedCamera, OutFile, Placement, Reads, WriteError, Writer,
    checks,
};
use crate::core::Pose;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Multical,
    words: &["multical"],
    reads: Some(Reads {
        recognises: |document| {
            document.root.get("cameras").is_some_and(|cameras| match &cameras.value {
                Value::Map(entries) => {
                    entries.iter().any(|(_, c)| c.get("K").is_some() && c.get("image_size").is_some())
                }
                _ => false,
            })
        },
        read,
        together: None,
    }),
    write: Some(Writer::Rig(write)),
    traps: &[
        "`cam2_to_cam1` maps points of cam1 into cam2 (x_cam2 = R x_cam1 + T), against the reading of its \
            name; T is not the place of cam2, that is −Rᵀ T.",
        "T is in the unit of the calibration board, which the file does not state; metres are assumed.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let root = document.entry();
    let mut contents = Contents::default();
    for entry in root.need("cameras")?.entries()? {
        let k = entry.need("K")?;
        let size = checks::size_pair(&entry.need("image_size")?)?;
        let dist = entry.need("dist")?;
        let lens = brown_conrady(&dist, dist.numbers()?)?;
        let matrix = checks::camera_matrix(&k)?;
        let camera = lens::camera(&k, &lens, matrix, Some(size), &mut contents.warnings)?;
        contents.cameras.push(NamedCamera::new(entry.name(), camera, None));
    }
    let poses = root.get("camera_poses").map_or(Ok(Vec::new()), |poses| poses.entries())?;
    let mut placements = Vec::new();
    for entry in &poses {
        placements.push(placement(&mut contents, entry)?);
    }
    // The master's own pose, the identity, is how the file says that there is no other frame.
    let is_master = |p: &Placement| p.b_from_a == Pose::identity() && placements.iter().any(|q| q.a == p.b);
    for camera in &mut contents.cameras {
        camera.placement = placements.iter().find(|p| p.b == camera.name && !is_master(p)).cloned();
    }
    Ok(contents)
}

fn placement(contents: &mut Contents, entry: &Entry<'_>) -> Result<Placement, Fault> {
    let (b, a) = frames_of(&contents.cameras, entry.name()).ok_or_else(|| {
        let names: Vec<&str> = contents.cameras.iter().map(|c| c.name.as_str()).collect();
        let names = names.join(", ");
        entry.fault(format!("names no camera of this file; NAME or NAME_to_NAME is needed, of {names}"))
    })?;
    let rotation = checks::rotation_matrix(&entry.need("R")?)?;
    let t = entry.need("T")?;
    let b_from_a = Pose::new(rotation, checks::vector3(&t)?);
    contents.warnings.extend(checks::unit_warning(&t.path, b_from_a.translation.norm()));
    Ok(Placement { b, a, b_from_a, covariance: None })
}

/// `cam2` is (cam2, rig); `cam2_to_cam1` is (cam2, cam1), wherever the names themselves contain `_to_`.
fn frames_of(cameras: &[NamedCamera], key: &str) -> Option<(String, String)> {
    let known = |name: &str| cameras.iter().any(|c| c.name == name);
    if known(key) {
        return Some((key.to_owned(), "rig".to_owned()));
    }
    let split = |(at, word): (usize, &str)| (key[..at].to_owned(), key[at + word.len()..].to_owned());
    key.match_indices("_to_").map(split).find(|(b, a)| known(b) && known(a))
}

/// Poses by name alone in the rig's frame, or `NAME_to_MASTER` where that frame is a camera's.
fn write(file: &CameraFile) -> Result<Vec<OutFile>, WriteError> {
    let cameras = &file.cameras;
    let entries = cameras.iter().map(camera_text).collect::<Result<Vec<String>, WriteError>>()?;
    let posed = cameras.iter().any(|c| c.placement.is_some()) || !file.relations.is_empty();
    let poses = if posed { poses_text(&placed(file, Format::Multical)?) } else { String::new() };
    let text = format!("{{\n  \"cameras\": {{\n{}\n  }}{poses}\n}}\n", entries.join(",\n"));
    Ok(OutFile::only("calibration.json", text))
}

fn camera_text(camera: &NamedCamera) -> Result<String, WriteError> {
    let size = size_of(camera, "multical")?;
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    let name = &camera.name;
    let d = match numbers {
        LensNumbers::Pinhole => vec![0.0; 5],
        LensNumbers::BrownConrady(d) => d,
        other => {
            let model = other.model();
            return Err(WriteError(format!(
                "{name}: multical has no {model} model; write resight or kalibr"
            )));
        }
    };
    let model = match d.len() {
        0..=5 => "standard",
        6..=8 => "rational",
        9..=12 => "thin_prism",
        _ => "tilted",
    };
    let k = matrix_rows(&k);
    let rows = [list(&k[..3]), list(&k[3..6]), list(&k[6..])].join(", ");
    Ok([
        format!("    {}: {{\n      \"model\": \"{model}\",\n", quoted(name)),
        format!("      \"image_size\": [{}, {}],\n", size.width_px, size.height_px),
        format!("      \"K\": [{rows}],\n      \"dist\": [{}]\n    }}", list(&d)),
    ]
    .concat())
}

fn poses_text(rig: &PlacedRig<'_>) -> String {
    let poses: Vec<String> = rig
        .cameras
        .iter()
        .map(|c| {
            let name = &c.camera.name;
            let master = rig.root_is_camera && *name != rig.root;
            let key = if master { format!("{name}_to_{}", rig.root) } else { name.clone() };
            let m = c.cam_from_root.matrix();
            let rows: Vec<String> = m[..3].iter().map(|row| list(&row[..3])).collect();
            let t = list(c.cam_from_root.translation.as_slice());
            format!("    {}: {{ \"R\": [{}], \"T\": {t} }}", quoted(&key), rows.join(", "))
        })
        .collect();
    format!(",\n  \"camera_poses\": {{\n{}\n  }}", poses.join(",\n"))
}
