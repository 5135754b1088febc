//! Camera and target files, read: the format by its content, then cameras by name.

use super::document::{Document, Fault};
use super::entry::COEFFICIENTS;
use super::nearest_format::nearest;
use super::table::{CAMERA_FORMATS, camera_format, target_format};
use super::{
    CameraFile, Contents, NamedCamera, Reads, TagOptions, TargetFile, checks, open, plausible, tag_options,
};
use crate::FileError;
use crate::core::Pose;
use std::path::Path;

/// Reads every camera of a file, recognising the format by its content.
///
/// Errors name file, line and key: unknown models, wrong counts, values that cannot be right, other kinds of files.
pub fn read_cameras(path: impl AsRef<Path>) -> Result<CameraFile, FileError> {
    let path = path.as_ref();
    let document = open::read(path)?;
    cameras_of(&document).map_err(|fault| fault.in_file(path))
}

/// As `read_cameras`, from bytes in memory; `path` serves names and messages only.
pub fn read_cameras_from_bytes(path: impl AsRef<Path>, bytes: Vec<u8>) -> Result<CameraFile, FileError> {
    let path = path.as_ref();
    let document = open::parse(path, bytes).map_err(|fault| fault.in_file(path))?;
    cameras_of(&document).map_err(|fault| fault.in_file(path))
}

/// Reads where frames are, with lenses or without: as `read_cameras`, but a file of poses only is no error.
pub fn read_places(path: impl AsRef<Path>) -> Result<CameraFile, FileError> {
    let path = path.as_ref();
    let document = open::read(path)?;
    match camera_format(&document) {
        Some((format, reads)) => {
            contents_of(&document, reads).map(|contents| contents.into_file(format.format))
        }
        None => Err(not_a_camera(&document)),
    }
    .map_err(|fault| fault.in_file(path))
}

pub(super) fn cameras_of(document: &Document) -> Result<CameraFile, Fault> {
    let (format, reads) = camera_format(document).ok_or_else(|| not_a_camera(document))?;
    let contents = contents_of(document, reads)?;
    if contents.cameras.is_empty() {
        let only = if contents.relations.is_empty() { "no camera" } else { "poses only, no intrinsics" };
        let name = format.format.name();
        return Err(Fault::new(format!("{name} with {only}; give the file that holds the camera matrices")));
    }
    Ok(contents.into_file(format.format))
}

pub(super) fn contents_of(document: &Document, reads: &Reads) -> Result<Contents, Fault> {
    let contents = (reads.read)(document)?;
    for (i, camera) in contents.cameras.iter().enumerate() {
        if contents.cameras[..i].iter().any(|earlier| earlier.name == camera.name) {
            return Err(Fault::new(format!("two cameras are called `{}`; names must differ", camera.name)));
        }
        if let Some(number) = camera.placement.as_ref().and_then(|p| absurd(&p.b_from_a)) {
            return Err(too_large(&format!("camera {}: its pose", camera.name), number));
        }
    }
    for relation in &contents.relations {
        if let Some(number) = absurd(&relation.b_from_a) {
            return Err(too_large(&format!("the pose {}_from_{}", relation.b, relation.a), number));
        }
    }
    Ok(contents)
}

/// Squares of larger numbers, and their products, overflow.
const LARGEST: f64 = 1e60;

/// Returns a number of a pose that is none, or too large: those of a file are numbers, their products need not be.
fn absurd(pose: &Pose) -> Option<f64> {
    pose.rotation.iter().chain(&pose.translation).copied().find(|x| !(x.abs() <= LARGEST))
}

fn too_large(what: &str, number: f64) -> Fault {
    Fault::new(format!(
        "{what}, put together from the numbers given, holds {number:.1e}; at most {LARGEST:e} can be calculated with, check the numbers and their unit"
    ))
}

pub(super) fn not_a_camera(document: &Document) -> Fault {
    match target_format(document) {
        Some(target) => Fault::new(format!(
            "this is a target ({}), not a camera; give it with --target",
            target.format.name()
        )),
        None if is_table(&document.text) => Fault::new(
            "a table, not a camera; `resight solve TABLE --camera CAMERA` reads points, `resight hand-eye --motions TABLE` poses of a robot, and CAMERA is the file that `resight intrinsics` writes",
        ),
        None if are_bare_numbers(&document.text) => {
            Fault::new(format!("bare numbers, of which nothing says what they are; {WRITE_KEYS}"))
        }
        None if are_coefficients(document) => Fault::new(format!(
            "not a camera file: coefficients of a lens without its focal length and image size; {WRITE_KEYS}"
        )),
        None => Fault::new(match nearest(document) {
            Some(near) => format!(
                "not a camera file that Resight knows ({:?} syntax, {}); the nearest: {near}; docs/files.md lists all formats",
                document.syntax,
                keys_seen(document)
            ),
            None => format!(
                "not a camera file that Resight knows ({:?} syntax, {}); the formats are {}",
                document.syntax,
                keys_seen(document),
                camera_format_names()
            ),
        }),
    }
}

/// Returns whether a text is a table of points or detections: a header line with their columns.
fn is_table(text: &str) -> bool {
    let header =
        text.lines().find(|line| !line.starts_with('#') && !line.trim().is_empty()).unwrap_or_default();
    let mut columns = header.split([',', ';', '\t', '|']).map(str::trim);
    columns.any(|column| matches!(column, "u_px" | "x_m" | "xn"))
}

/// What a camera file needs.
const WRITE_KEYS: &str = "write `model = \"pinhole\"`, `width_px`, `height_px`, `fx_px`, `fy_px`, `cx_px`, `cy_px` and, of a lens with distortion, \
    `model = \"brown_conrady\"` and `distortion = [k1, k2, p1, p2]`, each on a line of its own";

/// Whether a file holds coefficients of a lens, each under its own name or together, and nothing else.
fn are_coefficients(document: &Document) -> bool {
    let entries = document.entry().entries().unwrap_or_default();
    let is_one = |key: &str| COEFFICIENTS.contains(&key) || key == "distortion";
    !entries.is_empty() && entries.iter().all(|entry| is_one(entry.name()))
}

/// Whether a text holds numbers and nothing else.
fn are_bare_numbers(text: &str) -> bool {
    let mut words =
        text.split(|c: char| c.is_whitespace() || ",;[]()".contains(c)).filter(|word| !word.is_empty());
    words.next().is_some_and(|first| first.parse::<f64>().is_ok())
        && words.all(|word| word.parse::<f64>().is_ok())
}

fn camera_format_names() -> String {
    let readable = CAMERA_FORMATS.iter().filter(|f| f.reads.is_some());
    readable.map(|f| f.format.name()).collect::<Vec<_>>().join(", ")
}

/// Keys listed at most, and of one key at most so many characters: a message is read by people.
const MOST_KEYS: usize = 12;
const LONGEST_KEY: usize = 100;

fn keys_seen(document: &Document) -> String {
    let entries = document.entry().entries().unwrap_or_default();
    let mut keys: Vec<String> =
        entries.iter().take(MOST_KEYS).map(|e| e.name().chars().take(LONGEST_KEY).collect()).collect();
    if MOST_KEYS < entries.len() {
        keys.push(format!("… {} in all", entries.len()));
    }
    if keys.is_empty() { "no keys".into() } else { format!("keys {}", keys.join(", ")) }
}

/// Reads one camera: `FILE`, or `FILE#NAME` where the file holds several.
///
/// Besides the errors of `read_cameras`: a name that is not in the file (its names are listed), or several cameras
/// and no name.
pub fn read_camera(spec: impl AsRef<Path>) -> Result<NamedCamera, FileError> {
    read_camera_with_remarks(spec).map(|(camera, _)| camera)
}

/// As `read_camera`, with what is unusual about the file, in sentences that name it.
pub fn read_camera_with_remarks(spec: impl AsRef<Path>) -> Result<(NamedCamera, Vec<String>), FileError> {
    let (path, name) = split_spec(spec.as_ref());
    let document = open::read(path)?;
    #[cfg(feature = "recordings")]
    // A recording says why a topic that is there holds no camera, and knows the camera of rectified images.
    if let Some(found) = name
        .filter(|_| document.syntax == super::document::Syntax::Mcap)
        .and_then(|n| super::mcap::camera(&document, n))
    {
        return found.map(|camera| (camera, Vec::new())).map_err(|fault| fault.in_file(path));
    }
    picked(&document, path, name)
}

/// As `read_camera_with_remarks`, from bytes in memory; `name` picks one of several cameras, `path` serves names and messages only.
pub fn read_camera_from_bytes(
    path: impl AsRef<Path>,
    bytes: Vec<u8>,
    name: Option<&str>,
) -> Result<(NamedCamera, Vec<String>), FileError> {
    let path = path.as_ref();
    let document = open::parse(path, bytes).map_err(|fault| fault.in_file(path))?;
    picked(&document, path, name)
}

fn picked(
    document: &Document,
    path: &Path,
    name: Option<&str>,
) -> Result<(NamedCamera, Vec<String>), FileError> {
    if let Some(name) = name
        && let Some((_, reads)) = camera_format(document)
        && let mut contents = contents_of(document, reads).map_err(|fault| fault.in_file(path))?
        && let Some(at) = contents.spare.iter().position(|camera| camera.name == name)
    {
        return Ok((contents.spare.swap_remove(at), Vec::new()));
    }
    let file = cameras_of(document).map_err(|fault| fault.in_file(path))?;
    let camera = pick(file.cameras, name).map_err(|reason| FileError::new(path, reason))?;
    Ok((camera, file.warnings.iter().map(|warning| format!("{}: {warning}", path.display())).collect()))
}

/// The file and the camera's name of `FILE#NAME`. A `#` belongs to the file's name when a file of that whole name exists.
pub fn split_spec(spec: &Path) -> (&Path, Option<&str>) {
    match spec.to_str().and_then(|text| text.rsplit_once('#')) {
        Some((path, name)) if !spec.exists() => (Path::new(path), Some(name)),
        _ => (spec, None),
    }
}

fn pick(mut cameras: Vec<NamedCamera>, name: Option<&str>) -> Result<NamedCamera, String> {
    let names: Vec<String> = cameras.iter().map(|c| c.name.clone()).collect();
    let found = match name {
        Some(name) => cameras.iter().position(|c| c.name == name),
        None if cameras.len() == 1 => Some(0),
        None => {
            let (n, first) = (names.len(), &names[0]);
            return Err(format!("holds {n} cameras ({}); pick one, e.g. FILE#{first}", names.join(", ")));
        }
    };
    match found {
        Some(at) => Ok(cameras.swap_remove(at)),
        None => Err(format!("no camera `{}`; the file has {}", name.unwrap_or_default(), names.join(", "))),
    }
}

/// Reads a target file, recognising the format by its content.
///
/// A `line_plus_one` target whose fourth point stands over the middle of the line comes with a warning.
pub fn read_target(path: impl AsRef<Path>) -> Result<TargetFile, FileError> {
    let path = path.as_ref();
    read_target_with(path, &TagOptions::default())
}

/// As `read_target`, with what the caller knows of the tags of a map and the file does not state.
///
/// Besides the errors of `read_target`: options for a target that is no tag map, or for what the file states itself.
pub fn read_target_with(path: impl AsRef<Path>, options: &TagOptions) -> Result<TargetFile, FileError> {
    let path = path.as_ref();
    let document = open::read(path)?;
    target_of(&document, options).map_err(|fault| fault.in_file(path))
}

/// As `read_target`, from bytes in memory; `path` serves messages only.
pub fn read_target_from_bytes(path: impl AsRef<Path>, bytes: Vec<u8>) -> Result<TargetFile, FileError> {
    let path = path.as_ref();
    let document = open::parse(path, bytes).map_err(|fault| fault.in_file(path))?;
    target_of(&document, &TagOptions::default()).map_err(|fault| fault.in_file(path))
}

pub(super) fn target_of(document: &Document, options: &TagOptions) -> Result<TargetFile, Fault> {
    let Some(format) = target_format(document) else {
        return Err(match camera_format(document) {
            Some((camera, _)) => Fault::new(format!(
                "this is a camera ({}), not a target; give it with --camera",
                camera.format.name()
            )),
            None => Fault::new(format!(
                "not a target file that Resight knows ({}); our own begins with `kind = \"…\"`",
                keys_seen(document)
            )),
        });
    };
    let (mut target, mut warnings) = (format.read)(document)?;
    warnings.extend(tag_options::apply(document, format.format, &mut target, options)?);
    target.check().map_err(|e| Fault::new(e.to_string()))?;
    if let Some(extent_m) = plausible::absurd_extent_m(&target) {
        return Err(Fault::new(format!(
            "a target of {extent_m:.1e} m; at most 1e9 m are a size, check number and unit"
        )));
    }
    warnings.extend(plausible::of_target(&target));
    warnings.extend(checks::critical_plane_warning(&target));
    warnings.extend(checks::symmetry_warning(&target));
    Ok(TargetFile { format: format.format, target, warnings })
}
