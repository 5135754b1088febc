//! Real-time, repetitive extrinsic camera calibration: where each camera is, from a few known points, with its uncertainty.
//!
//! A photograph of a target, the files of camera and target, and the answer:
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/demo");
//! # std::env::set_current_dir(folder)?;
//! let camera = resight::read_camera("left.toml")?;
//! let target = resight::read_target("grid.toml")?;
//! let image = resight::GrayImage::read("left.png")?;
//! let answer = resight::locate_image(&image, &camera, &target, &Default::default())?;
//! assert_eq!(answer.status(), resight::Status::Ok);
//! if let Some(pose) = &answer.estimate {
//!     let camera_m = pose.cam_from_target.origin(); // In the target's frame.
//!     let sigma_m = resight::report::words::position_sigma_m(&pose.cam_from_target, &pose.covariance);
//!     println!("camera {:.3} ± {:.4} m in front of the target", camera_m.z, sigma_m.z);
//! }
//! println!("{}", answer.verdict.message);
//! # Ok(())
//! # }
//! ```
//!
//! | job | function |
//! | --- | --- |
//! | an image to a pose | [`locate_image`]; many images of one camera: [`locate::ImageLocator`] |
//! | known points to a pose | [`locate_points`]; a CSV file of them: [`locate_table`] |
//! | images of several cameras to a rig | [`rig_from_images`]; points found already: [`rig_from_detections`] |
//! | images of one camera carried past many tags to the map of the tags | [`map_from_images`]; corners found already: [`map_from_rows`] |
//! | relative poses of pairs of cameras to a rig | [`pose_graph()`] |
//! | a robot's poses and its camera's images to where the camera is mounted | [`hand_eye()`] |
//! | images or detections of a target to a camera's intrinsics | [`intrinsics()`]; existing ones on new images: [`check_intrinsics`] |
//! | a camera while its target is moved, until its intrinsics are good enough | [`capture::Capture`] |
//! | lengths, positions and areas in photographs | [`measure()`] |
//! | what moved between two calibrations | [`compare()`] |
//! | zones of a reference image after the camera has rotated | [`zones::move_zones`] |
//! | a video of driving to the rotation of the camera against its vehicle | [`vehicle::vehicle_from_video`] |
//! | where to put the next point, target or board | [`advise_points`], [`advise_target`], [`advise_boards`] |
//! | points in latitude and longitude, poses on a map, pixels of an orthophoto | [`georeference`] |
//! | cameras and targets in other formats, and in sentences | [`convert()`], [`explain`] |
//! | targets on paper at exact scale, and the printer's error | [`print_target`] |
//! | cameras watched for motion | `run` of the crate `resight-watch` |
//!
//! Answers ([`answer`]) have a status and serialise to the JSON of the command line, whose schema is [`answer::json_schema`]. Errors of all jobs
//! are one [`enum@Error`]. The mathematics is in [`core`].
#![deny(unsafe_code)]
#![warn(missing_docs)]

pub use resight_core as core;
pub use resight_formats::{self as formats, input};
pub use resight_recording as recording;

pub mod error;
mod minimum;
pub mod parallel;
pub mod image;
pub mod detect;
pub mod answer;
pub mod locate;
pub mod nominal;
pub mod georeference;
pub mod points;
pub mod layout;
pub mod marked_lines;
pub mod overlay;
pub mod drawing;
pub mod render;
pub mod video;
pub mod rig;
pub mod rig_pose;
pub mod intrinsics;
pub mod capture;
pub mod scene;
pub mod report;
pub mod advise;
pub mod measure;
pub mod compare;
pub mod convert;
pub mod print;
pub mod landmarks;
pub mod zones;
pub mod vehicle;
pub mod map;

pub use self::image::GrayImage;
pub use advise::{advise_boards, advise_points, advise_target};
pub use answer::{
    CaptureAnswer, CompareAnswer, HandEyeAnswer, IntrinsicsAnswer, MapAnswer, MeasureAnswer, PoseAnswer,
    PoseGraphAnswer, RigAnswer, Status,
};
pub use compare::compare;
pub use convert::{convert, explain};
pub use error::{Error, FileError};
pub use intrinsics::{check_intrinsics, intrinsics};
pub use locate::{locate_image, locate_points};
pub use map::{map_from_images, map_from_rows};
pub use marked_lines::scene_views;
pub use measure::measure;
pub use points::locate_table;
pub use print::print_target;
pub use rig::{hand_eye, pose_graph, rig_from_detections, rig_from_images};

/// Reads the camera of a file in any supported format; `FILE#NAME` selects one of several.
///
/// # Errors
/// What is wrong with the file, and where.
pub fn read_camera(file: impl AsRef<std::path::Path>) -> Result<core::Camera, Error> {
    Ok(formats::read_camera(file)?.camera)
}

/// Reads the target of a file: own TOML, Kalibr YAML or WPILib JSON.
///
/// # Errors
/// What is wrong with the file, and where.
pub fn read_target(file: impl AsRef<std::path::Path>) -> Result<core::Target, Error> {
    Ok(formats::read_target(file)?.target)
}
