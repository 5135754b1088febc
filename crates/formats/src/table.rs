//! The table of formats: how each is recognised, read, written and misread.
//!
//! A new camera format is a file beside this one with a `FORMAT` of its own, an arm of `Format`, and its line below.

use super::document::Document;
use super::{
    CameraFormat, Format, Reads, TargetFormat, Writer, argoverse, autoware, azure_kinect, basalt, blender,
    caliscope, caliscope_target, camodocal, colmap, depthai, euroc, fspy, gltf, handeye, kalibr,
    kalibr_report, kalibr_target, kitti, krtd, lens_profile, matlab, mccalib, metashape, mrcal, multical,
    nuscenes, open_sfm, opencv, orb_slam, own_camera, own_target, photonvision, pose_matrix, realsense,
    robotcar, ros, scalar_keys, tf, transforms, urdf, wpilib, zed,
};

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
    kalibr_report::FORMAT,
    photonvision::FORMAT,
    tf::FORMAT,
    tf::YAML,
    urdf::FORMAT,
    kitti::FORMAT,
    kitti::ODOMETRY,
    nuscenes::FORMAT,
    ros::FORMAT,
    orb_slam::FORMAT,
    camodocal::FORMAT,
    open_sfm::FORMAT,
    metashape::FORMAT,
    matlab::FORMAT,
    argoverse::FORMAT,
    lens_profile::GYROFLOW,
    lens_profile::LENSFUN,
    robotcar::FORMAT,
    depthai::FORMAT,
    azure_kinect::FORMAT,
    zed::FORMAT,
    krtd::FORMAT,
    realsense::FORMAT,
    autoware::FORMAT,
    transforms::FORMAT,
    scalar_keys::FORMAT,
    #[cfg(feature = "recordings")]
    super::mcap::FORMAT,
    opencv::FORMAT,
    pose_matrix::FORMAT,
    opencv::XML,
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

impl Format {
    /// The format that `--to WORD` means; none for formats that are only read.
    pub fn to_write(word: &str) -> Option<Self> {
        let row = CAMERA_FORMATS.iter().find(|f| f.write.is_some() && f.words.contains(&word));
        row.map(|f| f.format)
    }

    /// Every format that can be written, with the words that mean it, the shortest first.
    pub fn writable() -> impl Iterator<Item = (Format, &'static [&'static str])> {
        CAMERA_FORMATS.iter().filter(|f| f.write.is_some()).map(|f| (f.format, f.words))
    }
}
