//! Caliscope `camera_array.toml` and aniposelib's TOML: world → camera (they feed it to OpenCV's projectPoints).

use super::document::{Document, Fault, Syntax, Value};
use super::emit::{list, quoted};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::placed::{placed, size_of};
use super::{
    CameraFile, CameraFormat, Contents, Format, NamedCamera, OutFile, Placement, Reads, WriteError, Writer,
    checks, mrcal, opencv,
};
use crate::core::{Camera, Pose};

const TRAPS: &[&str] = &[
    "rotation and translation map world points into the camera (x_cam = R x_world + t), although \
        Caliscope's source calls them the camera's pose; the camera's position is −Rᵀ t.",
    "aniposelib loads the tables in the order of their sorted names: cam_10 comes before cam_2. Go by \
        name, not by position.",
];

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Caliscope,
    words: &["caliscope"],
    reads: Some(Reads {
        recognises: |document| is_array(document) && document.root.get("cameras").is_some(),
        read,
        together: None,
    }),
    write: Some(Writer::Rig(write_caliscope)),
    traps: TRAPS,
};

/// aniposelib's tables stand at the top of the file.
pub(super) const ANIPOSELIB: CameraFormat = CameraFormat {
    format: Format::Aniposelib,
    words: &["aniposelib", "anipose"],
    reads: Some(Reads { recognises: is_array, read, together: None }),
    write: Some(Writer::Rig(write_aniposelib)),
    traps: TRAPS,
};

fn is_array(document: &Document) -> bool {
    document.syntax == Syntax::Toml && !tables(&document.entry()).is_empty()
}

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
        contents.cameras.push(NamedCamera::new(name, camera, placement));
    }
    contents.warnings.extend(another_order(&document.entry()));
    contents.notes.push(
        "translation is in the unit of the calibration board, which the file does not \
        state; metres are assumed."
            .into(),
    );
    Ok(contents)
}

/// aniposelib goes by sorted names, a file or a program that counts may not.
fn another_order(root: &Entry<'_>) -> Option<String> {
    let names: Vec<String> = tables(root).iter().map(|e| e.name().to_owned()).collect();
    let mut sorted = names.clone();
    sorted.sort();
    (!root.has("cameras") && sorted != names).then(|| {
        format!(
            "aniposelib loads these cameras as {}, which is not the order of the file: go by name, not by position",
            sorted.join(", ")
        )
    })
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

/// `[cameras.N]`, N a whole number as Caliscope wants it: the camera's name where it is one, else its place, the name
/// beside it.
fn write_caliscope(file: &CameraFile) -> Result<Vec<OutFile>, WriteError> {
    let cameras = &file.cameras;
    let numbered = cameras.iter().all(|c| c.name.parse::<u32>().is_ok_and(|n| n.to_string() == c.name));
    let poses = poses_of(file, Format::Caliscope)?;
    let mut text =
        String::from("# rotation (Rodrigues, rad) and translation map world points into the camera.\n");
    for (i, (camera, cam_from_root)) in cameras.iter().zip(poses).enumerate() {
        let id = if numbered { camera.name.clone() } else { i.to_string() };
        text += &format!("\n[cameras.{id}]\ncam_id = {id}\n");
        if !numbered {
            text += &format!("name = {}\n", quoted(&camera.name));
        }
        text += &table_text(camera, cam_from_root)?;
    }
    Ok(OutFile::only("camera_array.toml", text))
}

/// `[cam_N]` as aniposelib loads it, which takes the tables in the order of their sorted names: the numbers are padded
/// with zeros so that this is our order too.
fn write_aniposelib(file: &CameraFile) -> Result<Vec<OutFile>, WriteError> {
    let cameras = &file.cameras;
    let digits = cameras.len().saturating_sub(1).to_string().len();
    let poses = poses_of(file, Format::Aniposelib)?;
    let mut text =
        String::from("# rotation (Rodrigues, rad) and translation map world points into the camera.\n");
    for (i, (camera, cam_from_root)) in cameras.iter().zip(poses).enumerate() {
        let Some(pose) = cam_from_root else {
            return Err(WriteError(format!("{}: aniposelib needs every camera's pose", camera.name)));
        };
        text += &format!("\n[cam_{i:0digits$}]\nname = {}\n", quoted(&camera.name));
        text += &table_text(camera, Some(pose))?;
    }
    Ok(OutFile::only("calibration.toml", text + "\n[metadata]\n"))
}

/// Poses in one frame; a camera alone stands in its own, and cameras that have none stay without.
fn poses_of(file: &CameraFile, format: Format) -> Result<Vec<Option<Pose>>, WriteError> {
    let cameras = &file.cameras;
    if 1 < cameras.len() && cameras.iter().all(|c| c.placement.is_none()) && file.relations.is_empty() {
        return Ok(vec![None; cameras.len()]);
    }
    let rig = placed(file, format)?;
    Ok(rig.cameras.iter().map(|c| Some(c.cam_from_root)).collect())
}

fn table_text(camera: &NamedCamera, cam_from_root: Option<Pose>) -> Result<String, WriteError> {
    let size = size_of(camera, "a camera array")?;
    let (k, numbers) = lens::numbers_of(&camera.camera)?;
    let name = &camera.name;
    let (d, fisheye) = match numbers {
        LensNumbers::Pinhole => (vec![0.0; 5], false),
        LensNumbers::BrownConrady(d) => (d, false),
        LensNumbers::KannalaBrandt(d) => (d.to_vec(), true),
        other => {
            let model = other.model();
            return Err(WriteError(format!(
                "{name}: Caliscope and aniposelib have no {model} model; write resight or kalibr"
            )));
        }
    };
    let rows = opencv::matrix_rows(&k);
    let matrix = [list(&rows[..3]), list(&rows[3..6]), list(&rows[6..])].join(", ");
    let pose = cam_from_root.map_or_else(String::new, |pose| {
        let rt = mrcal::rt(&pose);
        format!("rotation = {}\ntranslation = {}\n", list(&rt[..3]), list(&rt[3..]))
    });
    let (w, h) = (size.width_px, size.height_px);
    let lens = format!("size = [{w}, {h}]\nmatrix = [{matrix}]\ndistortions = {}\n", list(&d));
    Ok(lens + &format!("fisheye = {fisheye}\n") + &pose)
}
