//! The table of formats: how each is recognised, read, written and misread.
//!
//! A new camera format is a file beside this one with a `FORMAT` of its own, an arm of `Format`, and its line below.

use super::document::{Document, Fault};
use super::{
    CameraFile, Contents, Format, NamedCamera, OutFile, WriteError, basalt, blender, caliscope,
    caliscope_target, colmap, euroc, fspy, gltf, handeye, kalibr, kalibr_target, kitti, mcap, mccalib, mrcal,
    multical, nuscenes, opencv, opencv_write, own_camera, own_target, photonvision, ros, tf, urdf, wpilib,
};
use crate::FileError;
use crate::core::Target;

/// One camera format: reads, writes, or both.
pub(super) struct CameraFormat {
    pub format: Format,
    /// What `--to` calls it, the shortest first; empty where it is only read.
    pub words: &'static [&'static str],
    pub reads: Option<Reads>,
    pub write: Option<Writer>,
    /// How files of this shape are commonly misread; printed by `explain`.
    pub traps: &'static [&'static str],
}

pub(super) type ReadTogether = Result<Contents, FileError>;

/// How a format is read.
pub(super) struct Reads {
    pub recognises: fn(&Document) -> bool,
    pub read: fn(&Document) -> Result<Contents, Fault>,
    /// For models of several files of this format that mean something only together (an index in one points into
    /// another): takes over from `read` when a folder or a list of files holds more than one of them.
    pub together: Option<fn(&[&Document]) -> ReadTogether>,
}

pub(super) type Written = Result<Vec<OutFile>, WriteError>;

/// How a format is written; at least one camera is given.
#[derive(Clone, Copy)]
pub(super) enum Writer {
    /// Takes the cameras and their placements only.
    Cameras(fn(&[NamedCamera]) -> Written),
    /// Also looks at the poses between other frames, or the clocks.
    Rig(fn(&CameraFile) -> Written),
}

impl Writer {
    pub fn run(self, rig: &CameraFile) -> Written {
        match self {
            Writer::Cameras(write) => write(&rig.cameras),
            Writer::Rig(write) => write(rig),
        }
    }
}

pub(super) type TargetAndWarnings = (Target, Vec<String>);

/// One target format.
pub(super) struct TargetFormat {
    pub format: Format,
    pub recognises: fn(&Document) -> bool,
    pub read: fn(&Document) -> Result<TargetAndWarnings, Fault>,
    pub traps: &'static [&'static str],
}

/// In the order they are tried: the most particular keys first, OpenCV's many spellings last.
pub(super) const CAMERA_FORMATS: &[CameraFormat] = &[
    own_camera::FORMAT,
    colmap::FORMAT,
    mrcal::FORMAT,
    basalt::FORMAT,
    caliscope::FORMAT,
    caliscope::ANIPOSELIB,
    multical::FORMAT,
    mccalib::FORMAT,
    euroc::FORMAT,
    kalibr::FORMAT,
    photonvision::FORMAT,
    tf::FORMAT,
    tf::YAML,
    urdf::FORMAT,
    kitti::FORMAT,
    kitti::ODOMETRY,
    nuscenes::FORMAT,
    ros::FORMAT,
    mcap::FORMAT,
    opencv::FORMAT,
    opencv_write::XML,
    photonvision::OLD_FORMAT,
    handeye::ON_BASE,
    handeye::ON_HAND,
    fspy::FORMAT,
    blender::FORMAT,
    gltf::FORMAT,
];

pub(super) const TARGET_FORMATS: &[TargetFormat] =
    &[own_target::FORMAT, kalibr_target::FORMAT, wpilib::FORMAT, caliscope_target::FORMAT];

/// The row that recognises a file, and how it reads it.
pub(super) fn camera_format(document: &Document) -> Option<(&'static CameraFormat, &'static Reads)> {
    let readable = CAMERA_FORMATS.iter().filter_map(|f| f.reads.as_ref().map(|reads| (f, reads)));
    readable.into_iter().find(|(_, reads)| (reads.recognises)(document))
}

pub(super) fn target_format(document: &Document) -> Option<&'static TargetFormat> {
    TARGET_FORMATS.iter().find(|f| (f.recognises)(document))
}

/// The row of a format that can be written.
pub(super) fn writer_of(format: Format) -> Option<Writer> {
    CAMERA_FORMATS.iter().find(|f| f.format == format).and_then(|f| f.write)
}
