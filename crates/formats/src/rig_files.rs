//! A rig from several files or folders: intrinsics of one, poses of another, joined by the names of their frames.

use super::document::Document;
use super::frames::Frames;
use super::read::{contents_of, not_a_camera, split_spec};
use super::table::camera_format;
use super::{
    CameraFile, CameraFormat, Contents, Format, JointCovariance, NamedCamera, Placement, Reads, open,
};
use crate::FileError;
use crate::core::Matrix6;
use std::path::{Path, PathBuf};

/// Files looked at below one folder; a calibration has a few dozen.
const MAX_FILES: usize = 2000;
/// Folders below a folder: `mav0/cam0/sensor.yaml` needs two.
const MAX_DEPTH: usize = 4;
/// Endings of files that a folder is searched for.
const ENDINGS: [&str; 12] =
    ["csv", "toml", "yaml", "yml", "json", "xml", "txt", "urdf", "cameramodel", "launch", "py", "sh"];
/// Two statements of one pose that agree this well are one: files are printed with six decimals or so.
const SAME_ANGLE_RAD: f64 = 1e-3;
/// As `SAME_ANGLE_RAD`, share of the distance, and metres.
const SAME_DISTANCE: f64 = 1e-3;

/// Reads the cameras of several files and folders into one, with the poses that any of them states.
///
/// A folder stands for the camera files in it, `FILE#NAME` for one camera of a file. A camera without a pose gets the one that another file states for the
/// frame of its name, or of its name with `_optical_frame` or `_optical` behind it; poses between other frames become
/// `relations`. Errors as `read_cameras`, besides: a camera in two files, no camera in any.
pub fn read_rig(paths: &[PathBuf]) -> Result<CameraFile, FileError> {
    let first = paths.first().ok_or_else(|| FileError::new("", "no file given"))?;
    let mut read: Vec<(PathBuf, Format, Contents)> = Vec::new();
    for path in paths {
        let (path, picked) = split_spec(path);
        let documents = if path.is_dir() { folder(path)? } else { vec![open::read(path)?] };
        let mut found = contents(path, &documents)?;
        if let Some(name) = picked {
            keep(&mut found, name).map_err(|reason| FileError::new(path, reason))?;
        }
        read.extend(found);
    }
    let format = read.iter().find(|(_, _, c)| !c.cameras.is_empty()).map(|(_, format, _)| *format);
    let Some(format) = format else {
        let reason = "poses only, no intrinsics; give the file that holds the camera matrices too";
        return Err(FileError::new(first, reason));
    };
    let mut rig = Contents::default();
    for (path, _, contents) in read {
        add(&mut rig, contents).map_err(|reason| FileError::new(path, reason))?;
    }
    join(&mut rig);
    rig.joint = rig.joint.take().map(|joint| joint.among(&rig.cameras));
    let unfit = rig.joint.as_ref().is_some_and(|joint| !fits(joint, &rig.cameras));
    if unfit {
        rig.joint = None;
        let reason = "the covariance of all cameras together is left out: their poses are not those that it belongs to";
        rig.warnings.push(reason.into());
    }
    Ok(rig.into_file(format))
}

fn keep(read: &mut [(PathBuf, Format, Contents)], name: &str) -> Result<(), String> {
    for (_, _, contents) in &mut *read {
        contents.cameras.extend(contents.spare.extract_if(.., |camera| camera.name == name));
    }
    let names: Vec<String> = read.iter().flat_map(|(_, _, c)| &c.cameras).map(|c| c.name.clone()).collect();
    if !names.iter().any(|n| n == name) {
        return Err(format!("no camera `{name}`; there are {}", names.join(", ")));
    }
    for (_, _, contents) in read {
        let left_out = contents.cameras.extract_if(.., |c| c.name != name);
        contents.relations.extend(left_out.filter_map(|c| c.placement));
        contents.clocks.retain(|c| c.camera == name);
        contents.joint = None; // Of one camera there is nothing in common.
    }
    Ok(())
}

/// Every file below a folder that a camera format recognises, in the order of their paths.
fn folder(path: &Path) -> Result<Vec<Document>, FileError> {
    let mut files = Vec::new();
    collect(path, MAX_DEPTH, &mut files)?;
    files.sort();
    let mut documents = Vec::new();
    for file in files {
        // What does not parse may be anything: a folder is full of other files.
        let Ok(document) = open::read(&file) else { continue };
        if camera_format(&document).is_some() {
            documents.push(document);
        }
    }
    if documents.is_empty() {
        return Err(FileError::new(path, "a folder without any camera file that Resight knows"));
    }
    Ok(documents)
}

fn collect(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<(), FileError> {
    let reported = |e: std::io::Error| FileError::of_system(folder, &e);
    for entry in std::fs::read_dir(folder).map_err(reported)? {
        let path = entry.map_err(reported)?.path();
        if path.is_dir() && 0 < depth {
            collect(&path, depth - 1, files)?;
        } else if path.extension().is_some_and(|e| ENDINGS.iter().any(|known| e.eq_ignore_ascii_case(known)))
        {
            files.push(path);
        }
        if MAX_FILES < files.len() {
            let reason =
                format!("more than {MAX_FILES} files below it; give the calibration files themselves");
            return Err(FileError::new(folder, reason));
        }
    }
    Ok(())
}

/// Each document by its format; those of a format that reads several together, together.
pub(super) fn contents(
    path: &Path,
    documents: &[Document],
) -> Result<Vec<(PathBuf, Format, Contents)>, FileError> {
    let mut out: Vec<(PathBuf, Format, Contents)> = Vec::new();
    for document in documents {
        let (row, reads) =
            camera_format(document).ok_or_else(|| not_a_camera(document).in_file(&document.path))?;
        if let Some(together) = reads.together.filter(|_| 1 < documents.len()) {
            if out.iter().all(|(_, format, _)| *format != row.format) {
                let group = documents.iter().filter(|d| is_of(d, row)).collect::<Vec<_>>();
                out.push((path.to_path_buf(), row.format, together(&group)?));
            }
            continue;
        }
        out.push((document.path.clone(), row.format, one(document, reads)?));
    }
    Ok(out)
}

fn is_of(document: &Document, row: &CameraFormat) -> bool {
    camera_format(document).is_some_and(|(found, _)| found.format == row.format)
}

fn one(document: &Document, reads: &Reads) -> Result<Contents, FileError> {
    contents_of(document, reads).map_err(|fault| fault.in_file(&document.path))
}

/// Names of cameras must differ.
pub(super) fn add(rig: &mut Contents, more: Contents) -> Result<(), String> {
    for camera in more.cameras {
        if rig.cameras.iter().any(|c| c.name == camera.name) {
            return Err(format!("camera `{}` is in an earlier file too; names must differ", camera.name));
        }
        rig.cameras.push(camera);
    }
    rig.relations.extend(more.relations);
    rig.clocks.extend(more.clocks);
    if let Some(joint) = more.joint
        && rig.joint.replace(joint).is_some()
    {
        rig.warnings
            .push("two files state a covariance of all cameras together; the later one is used".into());
    }
    rig.notes.extend(more.notes);
    rig.warnings.extend(more.warnings);
    rig.contradiction = rig.contradiction.take().or(more.contradiction);
    Ok(())
}

/// Gives each pose to the camera whose frame it places; what contradicts an earlier pose is remarked and left out.
fn join(rig: &mut Contents) {
    let Contents { cameras, relations, warnings, .. } = rig;
    for mut relation in std::mem::take(relations) {
        for camera in cameras.iter() {
            for frame in [&mut relation.b, &mut relation.a] {
                if is_frame_of(frame, &camera.name) {
                    frame.clone_from(&camera.name);
                }
            }
        }
        match Frames::of(cameras, relations).between(&relation.b, &relation.a) {
            Some(known) => warnings.extend(contradiction(&relation, &known)),
            None => match unplaced(cameras, &relation) {
                Some(camera) => camera.placement = Some(relation),
                None => relations.push(relation),
            },
        }
    }
}

/// Returns whether every camera of a joint covariance still has the pose that it belongs to, by its own covariance, and no other is uncertain.
pub(super) fn fits(joint: &JointCovariance, cameras: &[NamedCamera]) -> bool {
    let own = |camera: &NamedCamera| camera.placement.as_ref().and_then(|p| p.covariance);
    let is_of = |(i, name): (usize, &String)| {
        let stated = cameras.iter().find(|c| c.name == *name).and_then(own);
        let block: Matrix6 = joint.covariance.fixed_view::<6, 6>(6 * i, 6 * i).into();
        stated.is_some_and(|stated| (block - stated).amax() <= 1e-6 * stated.amax())
    };
    let is_held = |camera: &NamedCamera| {
        joint.cameras.contains(&camera.name) || own(camera).is_none_or(|own| own.amax() == 0.0)
    };
    joint.cameras.iter().enumerate().all(is_of) && cameras.iter().all(is_held)
}

pub(super) fn is_frame_of(frame: &str, camera: &str) -> bool {
    frame.strip_prefix(camera).is_some_and(|rest| matches!(rest, "" | "_optical_frame" | "_optical"))
}

fn unplaced<'c>(cameras: &'c mut [NamedCamera], p: &Placement) -> Option<&'c mut NamedCamera> {
    cameras.iter_mut().find(|c| c.placement.is_none() && (c.name == p.a || c.name == p.b))
}

fn contradiction(stated: &Placement, known: &crate::core::Pose) -> Option<String> {
    let angle = stated.b_from_a.angle_to_rad(known);
    let distance = (stated.b_from_a.translation - known.translation).norm();
    let scale = 1.0_f64.max(known.translation.norm());
    (SAME_ANGLE_RAD < angle || SAME_DISTANCE * scale < distance).then(|| {
        format!(
            "two files place `{}` against `{}`, {:.1} mm and {:.2}° apart; the first is used",
            stated.a,
            stated.b,
            1e3 * distance,
            angle.to_degrees()
        )
    })
}
