//! From one format to another, with a list of what the other cannot hold.
//!
//! What was written is read back with our own reader of that format and compared with what was meant: lenses by the pixels
//! they give, poses between all cameras. So the list is not a table of promises, and a wrong direction cannot go out.

use super::frames::Frames;
use super::rig_files::{self, is_frame_of};
use super::table::camera_format;
use super::write::write_rig;
use super::{CameraFile, Contents, Format, NamedCamera, OutFile, Placement, WriteError, open};
use crate::core::{Camera, Pixel, Pose};
use nalgebra::DMatrix;
use std::path::Path;

/// What a conversion gives.
#[derive(Debug, Clone, PartialEq)]
pub struct Conversion {
    /// The files.
    pub files: Vec<OutFile>,
    /// What they do not hold, or hold under another name, in sentences.
    pub lost: Vec<String>,
    /// Whether the files were read back and compared; formats that are only written cannot be.
    pub checked: bool,
}

/// Writes a rig in a format; with `reference`, cameras are placed in that frame as far as poses join them to it.
///
/// Errors as `write_rig`; besides, when there is no such frame, or when what was written does not read back as the same
/// cameras in the same places.
pub fn convert(rig: &CameraFile, to: Format, reference: Option<&str>) -> Result<Conversion, WriteError> {
    let mut lost = Vec::new();
    let rig = &match reference {
        Some(name) => placed_in(rig, name, &mut lost)?,
        None => rig.clone(),
    };
    let files = write_rig(rig, to)?;
    let back =
        read_back(&files).map_err(|e| WriteError(format!("what was written cannot be read again: {e}")))?;
    if rig.joint.is_some() && back.as_ref().is_none_or(|back| back.joint != rig.joint) {
        lost.push(
            "the covariance of all cameras together (joint_covariance); only resight files hold it".into(),
        );
    }
    lost.extend(intrinsics(&rig.cameras, back.as_ref().map_or(&[], |back| &back.cameras)));
    match &back {
        Some(back) => compare(rig, back, &mut lost)?,
        None => lost.extend(covariances(certain(&rig.cameras, &rig.relations))),
    }
    Ok(Conversion { files, lost, checked: back.is_some() })
}

/// Every camera placed against `reference`. A pose through several others has no covariance here: theirs come from one
/// adjustment and are not independent.
fn placed_in(rig: &CameraFile, reference: &str, lost: &mut Vec<String>) -> Result<CameraFile, WriteError> {
    let scene = super::scene(rig, Some(reference))?;
    let mut out = rig.clone();
    let joint = out.joint.take();
    for (camera, station) in out.cameras.iter_mut().zip(scene.scene_cameras) {
        if camera.name == reference {
            // The root of the tree: its old parent stays as a frame.
            out.relations.extend(camera.placement.take());
            continue;
        }
        let Some(reference_from_cam) = station.reference_from_cam else {
            lost.push(format!("no pose joins camera `{}` to `{reference}`", camera.name));
            continue;
        };
        let direct = camera.placement.as_ref().is_some_and(|p| p.a == reference || p.b == reference);
        if direct {
            continue;
        }
        let (b, a) = (camera.name.clone(), reference.to_owned());
        let placement = Placement { b, a, b_from_a: reference_from_cam.inverse(), covariance: None };
        if let Some(old) = camera.placement.replace(placement)
            && old.covariance.is_some()
        {
            lost.push(format!(
                "covariance of `{}` against `{}`: through other frames to `{reference}` it is not known",
                old.b, old.a
            ));
        }
    }
    match joint {
        Some(joint) if rig_files::fits(&joint, &out.cameras) => out.joint = Some(joint),
        Some(_) => lost.push(format!(
            "the covariance of all cameras together: it belongs to the frame that the file has, not to `{reference}`"
        )),
        None => {}
    }
    Ok(out)
}

/// What our own reader makes of the files; none for formats that are only written.
fn read_back(files: &[OutFile]) -> Result<Option<Contents>, String> {
    let mut documents = Vec::new();
    for file in files {
        let path = Path::new(&file.name);
        match open::parse(path, file.text.clone().into_bytes()) {
            Ok(document) if camera_format(&document).is_some() => documents.push(document),
            _ => return Ok(None),
        }
    }
    let read = rig_files::contents(Path::new(""), &documents).map_err(|e| e.to_string())?;
    let mut all = Contents::default();
    for (_, _, contents) in read {
        rig_files::add(&mut all, contents)?;
    }
    Ok(Some(all))
}

fn compare(rig: &CameraFile, back: &Contents, lost: &mut Vec<String>) -> Result<(), WriteError> {
    let mut names: Vec<&str> = rig.cameras.iter().map(|c| c.name.as_str()).collect();
    if back.cameras.is_empty() {
        lost.push("the intrinsics: this format holds poses only; write them too, e.g. with --to ros".into());
    } else {
        names = same_cameras(&rig.cameras, &back.cameras, lost)?;
    }
    let frames = Frames::of(&back.cameras, &back.relations);
    same_poses(rig, &Back { frames, names: &names }, lost)?;
    let kept = certain(&back.cameras, &back.relations);
    lost.extend(covariances(certain(&rig.cameras, &rig.relations).saturating_sub(kept)));
    for clock in &rig.clocks {
        let i = rig.cameras.iter().position(|c| c.name == clock.camera);
        let kept = i.is_some_and(|i| back.clocks.iter().any(|c| names.get(i) == Some(&c.camera.as_str())));
        if !kept && clock.offset_s != 0.0 {
            lost.push(format!("the clock offset of `{}` ({:.3} ms)", clock.camera, 1e3 * clock.offset_s));
        }
    }
    Ok(())
}

/// How well the intrinsics are known, where what was written does not say so too; cameras keep their order.
fn intrinsics(meant: &[NamedCamera], back: &[NamedCamera]) -> Option<String> {
    let is_kept = |i: usize, c: &DMatrix<f64>| {
        let kept = back.get(i).and_then(|camera| camera.intrinsics_covariance.as_ref());
        kept.is_some_and(|kept| kept.shape() == c.shape() && (kept - c).amax() <= 1e-9 * c.amax())
    };
    let lost = meant.iter().enumerate().filter(|(i, camera)| {
        camera.intrinsics_covariance.as_ref().is_some_and(|covariance| !is_kept(*i, covariance))
    });
    let names: Vec<String> = lost.map(|(_, camera)| format!("`{}`", camera.name)).collect();
    (!names.is_empty()).then(|| {
        format!("the covariance of the intrinsics of {}; only resight files hold it", names.join(", "))
    })
}

/// How many poses have a covariance.
fn certain(cameras: &[NamedCamera], relations: &[Placement]) -> usize {
    let placements = cameras.iter().filter_map(|c| c.placement.as_ref()).chain(relations);
    placements.filter(|p| p.covariance.is_some()).count()
}

fn covariances(n: usize) -> Option<String> {
    let poses = if n == 1 { "one pose".to_owned() } else { format!("{n} poses") };
    (0 < n).then(|| format!("the covariance of {poses}; only resight files hold it"))
}

/// Names in the written files, in the order of the rig.
fn same_cameras<'b>(
    meant: &[NamedCamera],
    back: &'b [NamedCamera],
    lost: &mut Vec<String>,
) -> Result<Vec<&'b str>, WriteError> {
    if meant.len() != back.len() {
        return Err(WriteError(format!("{} cameras were written, {} read again", meant.len(), back.len())));
    }
    for (a, b) in meant.iter().zip(back) {
        if a.name != b.name {
            lost.push(format!("the name of camera `{}`, which is `{}` there", a.name, b.name));
        }
        if a.camera.size.is_some() && b.camera.size.is_none() {
            lost.push(format!("the image size of camera `{}`", a.name));
        }
        let off_px = largest_difference_px(&a.camera, &b.camera);
        // Both are the same numbers; a pixel origin moved there and back costs a rounding or two.
        if !(..1e-6).contains(&off_px) {
            return Err(WriteError(format!("{}: the lens read again differs by {off_px:.3} px", a.name)));
        }
    }
    Ok(back.iter().map(|c| c.name.as_str()).collect())
}

/// Over a grid of pixels of the first camera that its model covers, px.
fn largest_difference_px(a: &Camera, b: &Camera) -> f64 {
    let (w, h, u0, v0) = match (a.size, a.matrix()) {
        (Some(size), _) => (f64::from(size.width_px), f64::from(size.height_px), 0.0, 0.0),
        (None, Some(k)) => (k.fx_px, k.fy_px, k.cx_px - 0.5 * k.fx_px, k.cy_px - 0.5 * k.fy_px),
        (None, None) => return if a == b { 0.0 } else { f64::INFINITY },
    };
    let mut largest: f64 = 0.0;
    for (i, j) in (0..=8).flat_map(|i| (0..=8).map(move |j| (i, j))) {
        let pixel = Pixel::new(u0 + w * f64::from(i) / 8.0, v0 + h * f64::from(j) / 8.0);
        let Ok(bearing) = a.bearing(&pixel) else { continue };
        let seen = |camera: &Camera| camera.project(&bearing.into_inner());
        match (seen(a), seen(b)) {
            (Some(p), Some(q)) => largest = largest.max((p - q).norm()),
            (None, _) => {}
            (Some(_), None) => return f64::INFINITY,
        }
    }
    largest
}

/// What was read back, with the cameras' names there in the order of the rig.
struct Back<'b> {
    frames: Frames<'b>,
    names: &'b [&'b str],
}

impl Back<'_> {
    /// What frame `name` of the rig is called there.
    fn name_of(&self, rig: &CameraFile, name: &str) -> Option<String> {
        let there = self.frames.names();
        match rig.cameras.iter().position(|c| c.name == name) {
            Some(i) => there.iter().find(|f| is_frame_of(f, self.names[i])).map(|f| (*f).to_owned()),
            None => there.contains(&name).then(|| name.to_owned()),
        }
    }
}

/// Two poses between the same frames agree to what 15 digits keep of numbers this large.
fn agree(a: &Pose, b: &Pose) -> bool {
    let scale = 1.0 + a.translation.norm();
    a.angle_to_rad(b) < 1e-9 && (a.translation - b.translation).norm() < 1e-9 * scale
}

/// Poses of all frames against the first camera that the written files place at all.
fn same_poses(rig: &CameraFile, back: &Back<'_>, lost: &mut Vec<String>) -> Result<(), WriteError> {
    let meant = Frames::of_rig(rig);
    let names = meant.names();
    let found = rig.cameras.iter().find_map(|c| Some((c.name.as_str(), back.name_of(rig, &c.name)?)));
    let Some((root, root_there)) = found else {
        if !names.is_empty() {
            lost.push(
                "all poses: this format holds intrinsics only; write them too, e.g. with --to tf".into(),
            );
        }
        return Ok(());
    };
    for name in names.into_iter().filter(|n| *n != root) {
        let Some(root_from_frame) = meant.between(root, name) else { continue };
        let there = back.name_of(rig, name).and_then(|f| back.frames.between(&root_there, &f));
        match there {
            Some(pose) if agree(&root_from_frame, &pose) => {}
            Some(_) => {
                let reason = "reads back in another place; please report this with the file";
                return Err(WriteError(format!("frame `{name}` against `{root}` {reason}")));
            }
            None => lost.push(match same_place(rig, back, &root_there, &root_from_frame) {
                Some(other) => format!("the name of frame `{name}`, which is `{other}` there"),
                None => format!("frame `{name}`"),
            }),
        }
    }
    Ok(())
}

/// A frame there that the rig does not know by this name, in the same place.
fn same_place(rig: &CameraFile, back: &Back<'_>, root: &str, root_from_frame: &Pose) -> Option<String> {
    let known: Vec<String> =
        Frames::of_rig(rig).names().iter().filter_map(|n| back.name_of(rig, n)).collect();
    let new = back.frames.names().into_iter().filter(|f| !known.iter().any(|k| k == f));
    let mut same = new.filter(|f| back.frames.between(root, f).is_some_and(|p| agree(root_from_frame, &p)));
    same.next().map(str::to_owned)
}
