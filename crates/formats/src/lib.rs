//! Camera and target files: read by content, refused with line and reason, written without loss.
//!
//! A format is one file and one row of the tables in `table.rs`. Each turns its own
//! pixel origin, units, names and direction of transforms into ours (metres, pixel (0, 0) the centre of the top-left
//! pixel, poses `b_from_a`); nothing of a foreign convention leaves these modules.
//!
//! A camera of a file that another program wrote, and the same camera for ROS:
//!
//! ```
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/formats"))?;
//! use resight_formats::{Format, read_camera, write_cameras};
//!
//! let left = read_camera("kalibr_camchain.yaml#cam0")?;
//! let files = write_cameras(&[left], Format::RosCameraInfo)?;
//! assert_eq!(files.len(), 1);
//! assert!(files[0].text.contains("distortion_model:"));
//! # Ok(())
//! # }
//! ```
//!
//! | format | file | cameras | poses as stated there | written |
//! | --- | --- | --- | --- | --- |
//! | own TOML | `own_camera.rs` | all models | any `b_from_a`, clocks | yes |
//! | OpenCV YAML, XML, JSON | `opencv.rs`, `opencv_write.rs` | pinhole, Brown–Conrady, fisheye | second_from_first (R, T) | YAML, XML |
//! | ROS camera_info | `ros.rs` | plumb_bob, rational_polynomial, equidistant | none | yes |
//! | MCAP recording | `mcap.rs` | as ROS camera_info | none | no |
//! | Kalibr camera chain | `kalibr.rs` | pinhole × radtan, equidistant, fov, none; omni × radtan, none; eucm, ds | cam_from_previous, cam_from_imu | yes |
//! | EuRoC sensor.yaml | `euroc.rs` | as Kalibr | body_from_cam | yes |
//! | ROS static transforms | `tf.rs`, `tf_launch.rs`, `tf_echo.rs` | none | parent_from_child | yes |
//! | URDF | `urdf.rs` | none | parent_from_child | yes |
//! | KITTI | `kitti.rs` | pinhole | cam_from_rect (P), rect_from_velo, … | yes |
//! | nuScenes | `nuscenes.rs` | pinhole | ego_from_sensor | yes |
//! | COLMAP text model | `colmap.rs` | 13 models | cam_from_world, cam_from_rig | yes |
//! | mrcal .cameramodel | `mrcal.rs` | PINHOLE, OPENCV4, 5, 8, 12 | cam_from_reference | yes |
//! | PhotonVision, Limelight | `photonvision.rs` | OpenCV 4, 5, 8, 12; fisheye | none | both shapes |
//! | Basalt | `basalt.rs` | pinhole, pinhole-radtan8, kb4, ds, eucm, ucm, fov | imu_from_cam | yes |
//! | Caliscope, aniposelib | `caliscope.rs` | Brown–Conrady, fisheye | cam_from_world | both dialects |
//! | nerfstudio, instant-ngp | `transforms.rs` | Brown–Conrady of 5, fisheye | world_from_cam | yes |
//! | ORB-SLAM, camodocal (VINS), single keys | `orb_slam.rs`, `camodocal.rs`, `scalar_keys.rs` | Brown–Conrady, fisheye, omni | first_from_second, imu_from_cam | no |
//! | OpenSfM, Metashape | `open_sfm.rs`, `metashape.rs`, `shots.rs` | Brown–Conrady, fisheye | cam_from_world, chunk_from_cam | no |
//! | DepthAI, Azure Kinect, RealSense, ZED | `depthai.rs`, `azure_kinect.rs`, `realsense.rs`, `zed.rs` | Brown–Conrady, fisheye, fov | to_from_this, cam_from_depth, right_from_left | no |
//! | KWIVER, Autoware, named matrices | `krtd.rs`, `autoware.rs`, `pose_matrix.rs` | Brown–Conrady | cam_from_world, parent_from_child, b_from_a | no |
//! | MATLAB, Argoverse, RobotCar | `matlab.rs`, `argoverse.rs`, `robotcar.rs` | Brown–Conrady of 5; pinhole | second_from_first, ego_from_sensor, mount_from_vehicle | no |
//! | Gyroflow, lensfun | `lens_profile.rs` | Brown–Conrady of 5, fisheye | none | no |
//! | multical | `multical.rs` | Brown–Conrady | cam_from_rig, cam_from_master | yes |
//! | MC-Calib | `mccalib.rs` | Brown–Conrady of 5, fisheye | group_from_cam | yes |
//! | lists of robot poses | `pose_list.rs` | none | base_from_gripper, cam_from_target | no |
//! | easy_handeye | `handeye.rs` | none | robot_from_cam | yes |
//! | fSpy, Blender, glTF | `fspy.rs`, `blender.rs`, `gltf.rs` | pinhole; Brown–Conrady; all models in pixels | world_from_cam | only |
//! | targets: own, Kalibr and Basalt, WPILib, Caliscope | `own_target.rs`, `kalibr_target.rs`, `wpilib.rs`, `caliscope_target.rs` | | | |
//!
//! Recordings are read with the feature `recordings` only, because they are unpacked by C libraries; `resight` asks for it.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub use resight_core as core;

mod error;
pub mod input;
pub mod cells;
mod format;
mod file;
mod tree;
mod entry;
mod document;
mod syntax;
mod row;
mod checks;
mod lens;
mod frames;
mod placed;
mod emit;
mod atomic;
mod scene;
mod euler;
mod tf_launch;
mod tf_echo;
mod colmap;
mod own_camera;
mod own_target;
mod own_target_write;
mod opencv_write;
mod opencv;
mod ros;
mod scalar_keys;
mod shots;
mod orb_slam;
mod camodocal;
mod transforms;
mod open_sfm;
mod metashape;
mod depthai;
mod azure_kinect;
mod realsense;
mod zed;
mod krtd;
mod autoware;
mod argoverse;
mod robotcar;
mod matlab;
mod lens_profile;
mod pose_matrix;
mod kalibr;
mod kalibr_report;
mod kalibr_target;
mod euroc;
mod mrcal;
mod photonvision;
mod basalt;
mod caliscope;
mod multical;
mod mccalib;
mod handeye;
mod fspy;
mod blender;
mod gltf;
mod caliscope_target;
mod tf;
mod urdf;
mod kitti;
mod nuscenes;
pub mod plausible;
#[cfg(feature = "recordings")]
mod mcap;
mod open;
mod wpilib;
mod tag_options;
pub mod pose_list;
mod table;
mod nearest_format;
mod read;
mod write;
mod rig_files;
mod convert;
mod explain;

pub use atomic::{stream_atomically, write_atomically};
pub use checks::{check_image_size, symmetry_warning, unambiguous_instead};
pub use convert::{Conversion, convert};
pub use error::{FileError, without_number};
pub use explain::{explain, explain_from_bytes, remarks};
pub use file::{
    CameraFile, ClockOffset, JointCovariance, NamedCamera, OutFile, Placement, TargetFile, WriteError,
};
pub use format::Format;
pub use frames::pose_between;
pub use own_camera::status_keys;
pub use own_target_write::own_target_file;
pub use read::{
    read_camera, read_camera_from_bytes, read_camera_with_remarks, read_cameras, read_cameras_from_bytes,
    read_places, read_target, read_target_from_bytes, read_target_with, split_spec,
};
pub use rig_files::read_rig;
pub use scene::{Scene, SceneCamera, scene};
pub use tag_options::TagOptions;
pub use wpilib::{Field, read_field, write_field_layout};
pub use write::{own_file, own_rig_file, write_cameras, write_rig};

use file::Contents;
use row::{CameraFormat, Reads, TargetFormat, Writer, Written};
