//! Cameras in one common frame, whichever way their poses were stated: what most foreign files want.

use super::frames::Frames;
use super::{CameraFile, Format, NamedCamera, OutFile, WriteError};
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

/// Every camera in the rig's natural frame (`Frames::natural`); errors when no pose joins one to it.
pub(super) fn placed(file: &CameraFile, format: Format) -> Result<PlacedRig<'_>, WriteError> {
    let cameras = &file.cameras;
    let frames = Frames::of_rig(file);
    let root = frames.common(cameras, &[], format)?;
    let reached = frames.reached_from(&root);
    let pose_of = |camera: &NamedCamera| reached.iter().find(|(frame, _)| *frame == camera.name);
    let place =
        |camera| pose_of(camera).map(|(_, cam_from_root)| Placed { camera, cam_from_root: *cam_from_root });
    let placed = cameras.iter().filter_map(place).collect();
    let root_is_camera = cameras.iter().any(|c| c.name == root);
    Ok(PlacedRig { root, root_is_camera, cameras: placed })
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
