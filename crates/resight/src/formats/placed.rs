//! Cameras in one common frame, whichever way their poses were stated: what most foreign files want.

use super::frames::Frames;
use super::{CameraFile, NamedCamera, OutFile, WriteError};
use crate::core::Pose;
use crate::core::camera::ImageSize;
use nalgebra::{Matrix3, Vector3};

/// One camera and where the common frame is for it.
pub(super) struct Placed<'a> {
    pub camera: &'a NamedCamera,
    pub cam_from_root: Pose,
}

/// Cameras that all stand in one frame.
pub(super) struct PlacedRig<'a> {
    /// Name of the common frame.
    pub root: String,
    /// The common frame is that of one of the cameras.
    pub root_is_camera: bool,
    pub cameras: Vec<Placed<'a>>,
}

/// Every camera in one frame: the first frame among their poses that is not a camera, else the first camera.
///
/// Errors, naming them, when cameras are not joined to the first by any chain of poses; `format` is who asks.
pub(super) fn placed<'a>(file: &'a CameraFile, format: &str) -> Result<PlacedRig<'a>, WriteError> {
    let cameras = &file.cameras;
    let root = root_of(cameras);
    let reached = Frames::of(cameras, &file.relations).reached_from(&root);
    let pose_of = |name: &str| reached.iter().find(|(frame, _)| frame == name).map(|(_, pose)| *pose);
    let mut found = Vec::with_capacity(cameras.len());
    let mut lost = Vec::new();
    for camera in cameras {
        match pose_of(&camera.name) {
            Some(cam_from_root) => found.push(Placed { camera, cam_from_root }),
            None => lost.push(format!("`{}`", camera.name)),
        }
    }
    if !lost.is_empty() {
        return Err(WriteError(format!(
            "{format} holds cameras in one frame, but no pose joins {} to `{root}`; give the file with the \
                missing poses too, or write these cameras apart",
            lost.join(", ")
        )));
    }
    let root_is_camera = cameras.iter().any(|c| c.name == root);
    Ok(PlacedRig { root, root_is_camera, cameras: found })
}

fn root_of(cameras: &[NamedCamera]) -> String {
    let frames = cameras.iter().filter_map(|c| c.placement.as_ref()).flat_map(|p| [&p.a, &p.b]);
    let other = |frame: &&String| cameras.iter().all(|c| c.name != **frame);
    frames.into_iter().find(other).or(cameras.first().map(|c| &c.name)).cloned().unwrap_or_default()
}

impl Placed<'_> {
    /// The camera's pose in the common frame.
    pub fn root_from_cam(&self) -> Pose {
        self.cam_from_root.inverse()
    }

    /// The same with OpenGL's camera axes: x right, y up, looking along −z.
    pub fn root_from_gl_cam(&self) -> Pose {
        self.root_from_cam() * cam_from_gl_cam()
    }
}

/// Ours: x right, y down, z forward; OpenGL's, Blender's, glTF's and fSpy's: x right, y up, z backward.
pub(super) fn cam_from_gl_cam() -> Pose {
    Pose::new(Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)), Vector3::zeros())
}

/// The image size, which `format` needs.
pub(super) fn size_of(camera: &NamedCamera, format: &str) -> Result<ImageSize, WriteError> {
    camera.camera.size.ok_or_else(|| {
        WriteError(format!("{}: {format} needs the image size, which this camera has not", camera.name))
    })
}

/// The only camera, for formats that hold one.
pub(super) fn the_only<'a>(cameras: &'a [NamedCamera], format: &str) -> Result<&'a NamedCamera, WriteError> {
    match cameras {
        [camera] => Ok(camera),
        many => Err(WriteError(format!(
            "a file of {format} holds one camera, not {}; pick one with FILE#NAME",
            many.len()
        ))),
    }
}

/// One file a camera, named after it; refuses names that are no file names.
pub(super) fn file_per_camera(
    cameras: &[NamedCamera],
    extension: &str,
    text: impl Fn(&NamedCamera) -> Result<String, WriteError>,
) -> Result<Vec<OutFile>, WriteError> {
    let file = |camera: &NamedCamera| {
        let name = format!("{}.{extension}", file_stem(&camera.name)?);
        Ok(OutFile { name, text: text(camera)? })
    };
    cameras.iter().map(file).collect()
}

/// A camera's name as a file name on any system.
pub(super) fn file_stem(name: &str) -> Result<&str, WriteError> {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    if !name.is_empty() && name.chars().all(plain) && !name.starts_with('.') {
        return Ok(name);
    }
    Err(WriteError(format!(
        "camera name `{name}` is no file name; letters, digits, _, - and . can be written"
    )))
}
