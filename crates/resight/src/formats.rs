//! Camera and target files: read by content, refused with line and reason, written without loss.
//!
//! A format is one file below `formats/` and one row of `CAMERA_FORMATS` or `TARGET_FORMATS`. Each turns its own
//! pixel origin, units, names and direction of transforms into ours (metres, pixel (0, 0) the centre of the top-left
//! pixel, poses `b_from_a`); nothing of a foreign convention leaves these modules.
//!
//! | format | file | cameras | poses as stated there | written |
//! | --- | --- | --- | --- | --- |
//! | own TOML | `own_camera.rs` | all models | any `b_from_a` | yes |
//! | OpenCV YAML, XML, JSON | `opencv.rs` | pinhole, Brown–Conrady, fisheye | second_from_first (R, T) | YAML |
//! | ROS camera_info | `ros.rs` | plumb_bob, rational_polynomial, equidistant | none | yes |
//! | Kalibr camera chain | `kalibr.rs` | pinhole × radtan, equidistant, fov, none; omni × radtan, none; eucm, ds | cam_from_previous, cam_from_imu | yes |
//! | EuRoC sensor.yaml | `euroc.rs` | as Kalibr | body_from_cam | |
//! | COLMAP cameras.txt | `colmap.rs` | 13 models | none (images.txt) | |
//! | mrcal .cameramodel | `mrcal.rs` | PINHOLE, OPENCV4, 5, 8, 12 | cam_from_reference | |
//! | PhotonVision, Limelight | `photonvision.rs` | OpenCV 5, 8; fisheye | none | |
//! | Basalt | `basalt.rs` | pinhole, pinhole-radtan8, kb4, ds, eucm, ucm, fov | imu_from_cam | |
//! | Caliscope, aniposelib | `caliscope.rs` | Brown–Conrady, fisheye | cam_from_world | |
//! | targets: own, Kalibr and Basalt, WPILib, Caliscope | `own_target.rs`, `kalibr_target.rs`, `wpilib.rs`, `caliscope_target.rs` | | | |

mod syntax;
mod document;
mod entry;
mod checks;
mod lens;
mod frames;
mod emit;
mod own_camera;
mod own_target;
mod opencv;
mod ros;
mod kalibr;
mod kalibr_target;
mod euroc;
mod colmap;
mod mrcal;
mod photonvision;
mod basalt;
mod caliscope;
mod caliscope_target;
mod wpilib;
mod explain;
mod atomic;

pub use atomic::write_atomically;
pub use explain::{explain, explain_from_bytes};

use crate::FileError;
use crate::core::camera::ImageSize;
use crate::core::{Camera, Matrix6, Pose, Target};
use document::{Document, Fault};
use std::path::Path;

/// The file formats Resight knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Format {
    /// Our own camera file (TOML), one camera or several with poses.
    Own,
    /// OpenCV FileStorage, YAML, XML or JSON.
    OpenCv,
    /// ROS `sensor_msgs/CameraInfo`, as `camera_calibration` saves it or `ros2 topic echo` prints it.
    RosCameraInfo,
    /// Kalibr camera chain.
    Kalibr,
    /// EuRoC / ASL `sensor.yaml`.
    Euroc,
    /// COLMAP `cameras.txt`.
    Colmap,
    /// mrcal `.cameramodel`.
    Mrcal,
    /// PhotonVision or Limelight calibration JSON.
    PhotonVision,
    /// Basalt calibration JSON.
    Basalt,
    /// Caliscope `camera_array.toml` and aniposelib's TOML.
    Caliscope,
    /// Our own target file (TOML).
    OwnTarget,
    /// Kalibr target YAML, or Basalt's JSON twin.
    KalibrTarget,
    /// WPILib field layout JSON.
    WpilibLayout,
    /// Caliscope `charuco.toml`.
    CaliscopeCharuco,
}

impl Format {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Format::Own => "Resight camera file (TOML)",
            Format::OpenCv => "OpenCV FileStorage",
            Format::RosCameraInfo => "ROS camera_info",
            Format::Kalibr => "Kalibr camera chain",
            Format::Euroc => "EuRoC sensor.yaml",
            Format::Colmap => "COLMAP cameras.txt",
            Format::Mrcal => "mrcal .cameramodel",
            Format::PhotonVision => "PhotonVision / Limelight calibration",
            Format::Basalt => "Basalt calibration",
            Format::Caliscope => "Caliscope / aniposelib camera array",
            Format::OwnTarget => "Resight target file (TOML)",
            Format::KalibrTarget => "Kalibr target",
            Format::WpilibLayout => "WPILib field layout",
            Format::CaliscopeCharuco => "Caliscope charuco board",
        }
    }

    /// The format that `--to WORD` means; none for formats that are only read.
    pub fn to_write(word: &str) -> Option<Self> {
        match word {
            "resight" | "toml" | "own" => Some(Format::Own),
            "opencv" => Some(Format::OpenCv),
            "ros" | "camera_info" => Some(Format::RosCameraInfo),
            "kalibr" => Some(Format::Kalibr),
            _ => None,
        }
    }
}

/// Where a frame is: x_in_b = b_from_a · x_in_a.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// The frame the pose maps into.
    pub b: String,
    /// The frame it maps from.
    pub a: String,
    /// Rotation and translation (metres).
    pub b_from_a: Pose,
    /// Covariance of its small left motion `[rotation_rad; translation_m]`, frame b, where the file states one.
    pub covariance: Option<Matrix6>,
}

/// A file to be written: some formats take several (one a camera, or one a table).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OutFile {
    /// File name, without a folder.
    pub name: String,
    /// Contents.
    pub text: String,
}

/// One camera of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedCamera {
    /// The name it has in the file (`cam0`, `left`, `M1`), or the file's own name when it has none there.
    pub name: String,
    /// Lens and image size.
    pub camera: Camera,
    /// Where it is, when the file says so.
    pub placement: Option<Placement>,
}

/// A camera file, read.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraFile {
    /// What kind of file it was.
    pub format: Format,
    /// At least one camera, in the order of the file.
    pub cameras: Vec<NamedCamera>,
    /// What is unusual but not wrong, in sentences.
    pub warnings: Vec<String>,
}

/// A target file, read.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetFile {
    /// What kind of file it was.
    pub format: Format,
    /// The target, dimensions checked.
    pub target: Target,
    /// What is unusual but not wrong, in sentences.
    pub warnings: Vec<String>,
}

/// Why cameras cannot be written in a format.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct WriteError(pub String);

/// What a camera format found: cameras, poses between other frames, remarks.
#[derive(Debug, Default)]
struct Contents {
    cameras: Vec<NamedCamera>,
    relations: Vec<Placement>,
    notes: Vec<String>,
    warnings: Vec<String>,
}

struct CameraFormat {
    format: Format,
    recognises: fn(&Document) -> bool,
    read: fn(&Document) -> Result<Contents, Fault>,
    /// How files of this shape are commonly misread; printed by `explain`.
    traps: &'static [&'static str],
}

type TargetAndWarnings = (Target, Vec<String>);

struct TargetFormat {
    format: Format,
    recognises: fn(&Document) -> bool,
    read: fn(&Document) -> Result<TargetAndWarnings, Fault>,
    traps: &'static [&'static str],
}

/// In the order they are tried: the most particular keys first, OpenCV's many spellings last.
const CAMERA_FORMATS: [CameraFormat; 10] = [
    own_camera::FORMAT,
    colmap::FORMAT,
    mrcal::FORMAT,
    basalt::FORMAT,
    caliscope::FORMAT,
    euroc::FORMAT,
    kalibr::FORMAT,
    photonvision::FORMAT,
    ros::FORMAT,
    opencv::FORMAT,
];

const TARGET_FORMATS: [TargetFormat; 4] =
    [own_target::FORMAT, kalibr_target::FORMAT, wpilib::FORMAT, caliscope_target::FORMAT];

fn camera_format(document: &Document) -> Option<&'static CameraFormat> {
    CAMERA_FORMATS.iter().find(|f| (f.recognises)(document))
}

fn target_format(document: &Document) -> Option<&'static TargetFormat> {
    TARGET_FORMATS.iter().find(|f| (f.recognises)(document))
}

/// Reads every camera of a file, recognising the format by its content.
///
/// Errors name file, line and key: unknown models, wrong counts, values that cannot be right, other kinds of files.
pub fn read_cameras(path: &Path) -> Result<CameraFile, FileError> {
    let document = Document::read(path)?;
    cameras_of(&document).map_err(|fault| fault.in_file(path))
}

/// As `read_cameras`, from bytes in memory; `path` serves names and messages only.
pub fn read_cameras_from_bytes(path: &Path, bytes: Vec<u8>) -> Result<CameraFile, FileError> {
    let document = Document::parse(path, bytes).map_err(|fault| fault.in_file(path))?;
    cameras_of(&document).map_err(|fault| fault.in_file(path))
}

fn cameras_of(document: &Document) -> Result<CameraFile, Fault> {
    let format = camera_format(document).ok_or_else(|| not_a_camera(document))?;
    let contents = contents_of(document, format)?;
    if contents.cameras.is_empty() {
        let only = if contents.relations.is_empty() { "no camera" } else { "poses only, no intrinsics" };
        let name = format.format.name();
        return Err(Fault::new(format!("{name} with {only}; give the file that holds the camera matrices")));
    }
    Ok(CameraFile { format: format.format, cameras: contents.cameras, warnings: contents.warnings })
}

fn contents_of(document: &Document, format: &CameraFormat) -> Result<Contents, Fault> {
    let contents = (format.read)(document)?;
    for (i, camera) in contents.cameras.iter().enumerate() {
        if contents.cameras[..i].iter().any(|earlier| earlier.name == camera.name) {
            return Err(Fault::new(format!("two cameras are called `{}`; names must differ", camera.name)));
        }
    }
    Ok(contents)
}

fn not_a_camera(document: &Document) -> Fault {
    match target_format(document) {
        Some(target) => Fault::new(format!(
            "this is a target ({}), not a camera; give it with --target",
            target.format.name()
        )),
        None => Fault::new(format!(
            "not a camera file that Resight knows ({:?} syntax, {}); the formats are {}",
            document.syntax,
            keys_seen(document),
            camera_format_names()
        )),
    }
}

fn camera_format_names() -> String {
    CAMERA_FORMATS.map(|f| f.format.name()).join(", ")
}

fn keys_seen(document: &Document) -> String {
    let keys: Vec<String> = document
        .entry()
        .entries()
        .unwrap_or_default()
        .iter()
        .take(6)
        .map(|e| e.name().chars().take(30).collect())
        .collect();
    if keys.is_empty() { "no keys".into() } else { format!("keys {}", keys.join(", ")) }
}

/// Reads one camera: `FILE`, or `FILE#NAME` where the file holds several.
///
/// Besides the errors of `read_cameras`: a name that is not in the file (its names are listed), or several cameras
/// and no name.
pub fn read_camera(spec: &str) -> Result<NamedCamera, FileError> {
    let (path, name) = split_spec(spec);
    let path = Path::new(path);
    let file = read_cameras(path)?;
    pick(file.cameras, name).map_err(|reason| FileError::new(path, reason))
}

/// A `#` belongs to the file name when a file of that whole name exists.
fn split_spec(spec: &str) -> (&str, Option<&str>) {
    match spec.rsplit_once('#') {
        Some((path, name)) if !Path::new(spec).exists() => (path, Some(name)),
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

/// `b_from_a` between two frames of a file (cameras, or what they are placed in), through any chain of its placements; none where
/// nothing joins them.
pub fn pose_between(cameras: &[NamedCamera], b: &str, a: &str) -> Option<Pose> {
    frames::between(cameras, b, a)
}

/// Reads a target file, recognising the format by its content.
///
/// A `line_plus_one` target whose fourth point stands over the middle of the line comes with a warning.
pub fn read_target(path: &Path) -> Result<TargetFile, FileError> {
    let document = Document::read(path)?;
    target_of(&document).map_err(|fault| fault.in_file(path))
}

/// As `read_target`, from bytes in memory; `path` serves messages only.
pub fn read_target_from_bytes(path: &Path, bytes: Vec<u8>) -> Result<TargetFile, FileError> {
    let document = Document::parse(path, bytes).map_err(|fault| fault.in_file(path))?;
    target_of(&document).map_err(|fault| fault.in_file(path))
}

fn target_of(document: &Document) -> Result<TargetFile, Fault> {
    let Some(format) = target_format(document) else {
        return Err(match camera_format(document) {
            Some(camera) => Fault::new(format!(
                "this is a camera ({}), not a target; give it with --camera",
                camera.format.name()
            )),
            None => Fault::new(format!(
                "not a target file that Resight knows ({}); our own begins with `kind = \"…\"`",
                keys_seen(document)
            )),
        });
    };
    let (target, mut warnings) = (format.read)(document)?;
    target.check().map_err(|e| Fault::new(e.to_string()))?;
    warnings.extend(checks::critical_plane_warning(&target));
    Ok(TargetFile { format: format.format, target, warnings })
}

/// Writes cameras, with the poses between them where the format has a place for them.
///
/// Formats: `Own` (everything), `OpenCv` (one camera, or two with R and T), `RosCameraInfo` (one), `Kalibr` (a chain).
/// Errors when the format cannot hold a model or the number of cameras: nothing is dropped silently.
pub fn write_cameras(cameras: &[NamedCamera], format: Format) -> Result<String, WriteError> {
    if cameras.is_empty() {
        return Err(WriteError("no camera to write".into()));
    }
    match format {
        Format::Own => own_camera::write(cameras),
        Format::OpenCv => opencv::write(cameras),
        Format::RosCameraInfo => ros::write(cameras),
        Format::Kalibr => kalibr::write(cameras),
        other => Err(WriteError(format!(
            "{} is read, not written; write resight, opencv, ros or kalibr",
            other.name()
        ))),
    }
}

/// The camera for images of this size: itself when the size agrees, scaled when the images are a uniform enlargement
/// or reduction of the calibrated size (pixel centres kept), refused when the aspect differs.
pub fn check_image_size(camera: &Camera, width_px: u32, height_px: u32) -> Result<Camera, String> {
    checks::image_size(camera, ImageSize { width_px, height_px })
}
