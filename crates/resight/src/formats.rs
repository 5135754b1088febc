//! Camera and target files: read by content, refused with line and reason, written without loss.
//!
//! A format is one file below `formats/` and one row of the tables in `formats/table.rs`. Each turns its own
//! pixel origin, units, names and direction of transforms into ours (metres, pixel (0, 0) the centre of the top-left
//! pixel, poses `b_from_a`); nothing of a foreign convention leaves these modules.
//!
//! | format | file | cameras | poses as stated there | written |
//! | --- | --- | --- | --- | --- |
//! | own TOML | `own_camera.rs` | all models | any `b_from_a`, clocks | yes |
//! | OpenCV YAML, XML, JSON | `opencv.rs`, `opencv_write.rs` | pinhole, Brown–Conrady, fisheye | second_from_first (R, T) | YAML, XML |
//! | ROS camera_info | `ros.rs` | plumb_bob, rational_polynomial, equidistant | none | yes |
//! | MCAP recording | `mcap.rs` | as ROS camera_info | none | no |
//! | Kalibr camera chain | `kalibr.rs` | pinhole × radtan, equidistant, fov, none; omni × radtan, none; eucm, ds | cam_from_previous, cam_from_imu | yes |
//! | EuRoC sensor.yaml | `euroc.rs` | as Kalibr | body_from_cam | yes |
//! | ROS static transforms | `tf.rs`, `tf_launch.rs` | none | parent_from_child | yes |
//! | URDF | `urdf.rs` | none | parent_from_child | yes |
//! | KITTI | `kitti.rs` | pinhole | cam_from_rect (P), rect_from_velo, … | yes |
//! | nuScenes | `nuscenes.rs` | pinhole | ego_from_sensor | yes |
//! | COLMAP text model | `colmap.rs` | 13 models | cam_from_world, cam_from_rig | yes |
//! | mrcal .cameramodel | `mrcal.rs` | PINHOLE, OPENCV4, 5, 8, 12 | cam_from_reference | yes |
//! | PhotonVision, Limelight | `photonvision.rs` | OpenCV 4, 5, 8, 12; fisheye | none | both shapes |
//! | Basalt | `basalt.rs` | pinhole, pinhole-radtan8, kb4, ds, eucm, ucm, fov | imu_from_cam | yes |
//! | Caliscope, aniposelib | `caliscope.rs` | Brown–Conrady, fisheye | cam_from_world | both dialects |
//! | multical | `multical.rs` | Brown–Conrady | cam_from_rig, cam_from_master | yes |
//! | MC-Calib | `mccalib.rs` | Brown–Conrady of 5, fisheye | group_from_cam | yes |
//! | easy_handeye | `handeye.rs` | none | robot_from_cam | yes |
//! | fSpy, Blender, glTF | `fspy.rs`, `blender.rs`, `gltf.rs` | pinhole; Brown–Conrady; all models in pixels | world_from_cam | only |
//! | targets: own, Kalibr and Basalt, WPILib, Caliscope | `own_target.rs`, `kalibr_target.rs`, `wpilib.rs`, `caliscope_target.rs` | | | |

mod format;
mod syntax;
mod document;
mod entry;
mod checks;
mod lens;
mod frames;
mod placed;
mod emit;
mod own_camera;
mod own_target;
mod opencv;
mod opencv_write;
mod ros;
mod mcap;
mod kalibr;
mod kalibr_target;
mod euroc;
mod colmap;
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
mod euler;
mod tf_launch;
mod tf;
mod urdf;
mod kitti;
mod nuscenes;
mod wpilib;
mod tag_options;
pub mod plausible;
mod explain;
mod atomic;
mod table;
mod rig_files;
mod scene;
mod convert;

pub use atomic::{stream_atomically, write_atomically};
pub use convert::{Conversion, convert};
pub use explain::{explain, explain_from_bytes, remarks};
pub use format::Format;
pub use own_camera::status_keys;
pub use rig_files::read_rig;
pub use scene::{Scene, Station, scene};
pub use tag_options::TagOptions;
pub use wpilib::{Field, read_field, write_field_layout};

use crate::FileError;
use crate::core::camera::ImageSize;
use crate::core::{Camera, Matrix6, Pose, Target};
use document::{Document, Fault, Syntax};
use nalgebra::DMatrix;
use std::path::Path;
use table::{
    CAMERA_FORMATS, CameraFormat, Reads, TargetFormat, Writer, Written, camera_format, target_format,
    writer_of,
};

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
    /// Path below the folder they are written to, `/` between names; plain names only, never `..`.
    pub name: String,
    /// Contents.
    pub text: String,
}

impl OutFile {
    /// The only file of its format.
    fn only(name: &str, text: String) -> Vec<Self> {
        vec![OutFile { name: name.to_owned(), text }]
    }
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

/// How a camera's clock runs against another sensor's: time there = the camera's time stamp + `offset_s`.
#[derive(Debug, Clone, PartialEq)]
pub struct ClockOffset {
    /// The camera.
    pub camera: String,
    /// The sensor whose clock is the reference (`imu`).
    pub reference: String,
    /// Seconds to add to the camera's time stamps.
    pub offset_s: f64,
}

/// A camera file, read; or what is to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraFile {
    /// What kind of file it was.
    pub format: Format,
    /// At least one camera, in the order of the file.
    pub cameras: Vec<NamedCamera>,
    /// Poses between other frames (an IMU, a laser scanner, links of a robot).
    pub relations: Vec<Placement>,
    /// Time shifts, for the cameras that have one.
    pub clocks: Vec<ClockOffset>,
    /// What the cameras' errors have in common, where the file states it.
    pub joint: Option<JointCovariance>,
    /// What contradicts in the rig that the file holds, where it states that its rig is inconsistent; `warnings` say so too.
    pub contradiction: Option<String>,
    /// What is unusual but not wrong, in sentences.
    pub warnings: Vec<String>,
}

/// The covariance of several cameras' places together.
#[derive(Debug, Clone, PartialEq)]
pub struct JointCovariance {
    /// The uncertain cameras; another of the file is the one whose frame is the rig's.
    pub cameras: Vec<String>,
    /// 6 rows and columns a camera, small left motions `[rotation_rad; translation_m]`, camera frames.
    pub covariance: DMatrix<f64>,
    /// Where the noise was estimated along: from how many redundant numbers.
    pub noise_degrees_of_freedom: Option<f64>,
}

impl JointCovariance {
    /// Of these cameras, 6 rows each; those that are exact are left out.
    pub fn of(names: &[String], covariance: &DMatrix<f64>) -> Self {
        let is_uncertain = |i: &usize| covariance.view((6 * i, 6 * i), (6, 6)).amax() != 0.0;
        let kept: Vec<usize> = (0..names.len()).filter(is_uncertain).collect();
        let at = |i: usize| 6 * kept[i / 6] + i % 6;
        JointCovariance {
            cameras: kept.iter().map(|i| names[*i].clone()).collect(),
            covariance: DMatrix::from_fn(6 * kept.len(), 6 * kept.len(), |i, j| covariance[(at(i), at(j))]),
            noise_degrees_of_freedom: None,
        }
    }

    /// Of those of its cameras that are among these.
    fn among(&self, cameras: &[NamedCamera]) -> Self {
        let is_kept = |i: &usize| cameras.iter().any(|camera| camera.name == self.cameras[*i]);
        let kept: Vec<usize> = (0..self.cameras.len()).filter(is_kept).collect();
        let at = |i: usize| 6 * kept[i / 6] + i % 6;
        JointCovariance {
            cameras: kept.iter().map(|i| self.cameras[*i].clone()).collect(),
            covariance: DMatrix::from_fn(6 * kept.len(), 6 * kept.len(), |i, j| {
                self.covariance[(at(i), at(j))]
            }),
            noise_degrees_of_freedom: self.noise_degrees_of_freedom,
        }
    }

    /// Row by row.
    pub fn rows(&self) -> Vec<Vec<f64>> {
        self.covariance.row_iter().map(|row| row.iter().copied().collect()).collect()
    }
}

/// A target file, read.
#[derive(Debug, Clone, PartialEq)]
pub struct TargetFile {
    /// What kind of file it was.
    pub format: Format,
    /// The target, dimensions checked.
    pub target: Target,
    /// What is unusual but not wrong, in sentences: what was assumed, and dimensions that look like another unit.
    pub warnings: Vec<String>,
}

/// Why cameras cannot be written in a format.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct WriteError(pub String);

/// What a camera format found: cameras, poses between other frames, remarks.
#[derive(Debug, Default, Clone)]
struct Contents {
    cameras: Vec<NamedCamera>,
    relations: Vec<Placement>,
    clocks: Vec<ClockOffset>,
    joint: Option<JointCovariance>,
    contradiction: Option<String>,
    notes: Vec<String>,
    warnings: Vec<String>,
}

impl Contents {
    fn into_file(self, format: Format) -> CameraFile {
        let Contents { cameras, relations, clocks, joint, contradiction, mut warnings, .. } = self;
        warnings.extend(contradiction.as_ref().map(|reason| {
            format!("the rig in this file is inconsistent: {reason}; no result that rests on its places is reliable")
        }));
        CameraFile { format, cameras, relations, clocks, joint, contradiction, warnings }
    }
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
    let (format, reads) = camera_format(document).ok_or_else(|| not_a_camera(document))?;
    let contents = contents_of(document, reads)?;
    if contents.cameras.is_empty() {
        let only = if contents.relations.is_empty() { "no camera" } else { "poses only, no intrinsics" };
        let name = format.format.name();
        return Err(Fault::new(format!("{name} with {only}; give the file that holds the camera matrices")));
    }
    Ok(contents.into_file(format.format))
}

fn contents_of(document: &Document, reads: &Reads) -> Result<Contents, Fault> {
    let contents = (reads.read)(document)?;
    for (i, camera) in contents.cameras.iter().enumerate() {
        if contents.cameras[..i].iter().any(|earlier| earlier.name == camera.name) {
            return Err(Fault::new(format!("two cameras are called `{}`; names must differ", camera.name)));
        }
        if camera.placement.as_ref().is_some_and(|p| !is_finite(&p.b_from_a)) {
            let name = &camera.name;
            return Err(Fault::new(format!(
                "camera {name}: its pose, put together from the numbers given, is too large for a number; check them and their unit"
            )));
        }
    }
    Ok(contents)
}

/// A pose of numbers only: those of a file are, their products need not be.
fn is_finite(pose: &Pose) -> bool {
    pose.rotation.iter().chain(&pose.translation).all(|x| x.is_finite())
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
    let readable = CAMERA_FORMATS.iter().filter(|f| f.reads.is_some());
    readable.map(|f| f.format.name()).collect::<Vec<_>>().join(", ")
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
    let document = Document::read(path)?;
    // A recording says why a topic that is there holds no camera, and knows the camera of rectified pictures.
    if let Some(found) =
        name.filter(|_| document.syntax == Syntax::Mcap).and_then(|n| mcap::camera(&document, n))
    {
        return found.map_err(|fault| fault.in_file(path));
    }
    let file = cameras_of(&document).map_err(|fault| fault.in_file(path))?;
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
    frames::Frames::of(cameras, &[]).between(b, a)
}

/// Reads a target file, recognising the format by its content.
///
/// A `line_plus_one` target whose fourth point stands over the middle of the line comes with a warning.
pub fn read_target(path: &Path) -> Result<TargetFile, FileError> {
    read_target_with(path, &TagOptions::default())
}

/// As `read_target`, with what the caller knows of the tags of a map and the file does not state.
///
/// Besides the errors of `read_target`: options for a target that is no tag map, or for what the file states itself.
pub fn read_target_with(path: &Path, options: &TagOptions) -> Result<TargetFile, FileError> {
    let document = Document::read(path)?;
    target_of(&document, options).map_err(|fault| fault.in_file(path))
}

/// As `read_target`, from bytes in memory; `path` serves messages only.
pub fn read_target_from_bytes(path: &Path, bytes: Vec<u8>) -> Result<TargetFile, FileError> {
    let document = Document::parse(path, bytes).map_err(|fault| fault.in_file(path))?;
    target_of(&document, &TagOptions::default()).map_err(|fault| fault.in_file(path))
}

fn target_of(document: &Document, options: &TagOptions) -> Result<TargetFile, Fault> {
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
    Ok(TargetFile { format: format.format, target, warnings })
}

/// Writes cameras, with the poses between them where the format has a place for them: one file or several.
///
/// Errors when the format cannot hold a model or the number of cameras: no camera is dropped silently.
pub fn write_cameras(cameras: &[NamedCamera], format: Format) -> Result<Vec<OutFile>, WriteError> {
    let rig = Contents { cameras: cameras.to_vec(), ..Contents::default() };
    write_rig(&rig.into_file(format), format)
}

/// Our own camera file, which is always one text.
pub fn own_file(cameras: &[NamedCamera]) -> Result<String, WriteError> {
    own_rig_file(cameras, None)
}

/// Our own camera file with what the cameras' errors have in common, which a comparison with a later rig needs.
pub fn own_rig_file(cameras: &[NamedCamera], joint: Option<JointCovariance>) -> Result<String, WriteError> {
    let rig = Contents { cameras: cameras.to_vec(), joint, ..Contents::default() };
    Ok(write_rig(&rig.into_file(Format::Own), Format::Own)?.into_iter().map(|file| file.text).collect())
}

/// As `write_cameras`, with poses between other frames and clocks for the formats that have a place for them; the
/// `format` and `warnings` of `rig` play no part.
pub fn write_rig(rig: &CameraFile, format: Format) -> Result<Vec<OutFile>, WriteError> {
    if rig.cameras.is_empty() {
        return Err(WriteError("no camera to write".into()));
    }
    match writer_of(format) {
        Some(writer) => differently_named(writer.run(rig)?),
        None => {
            let words: Vec<&str> =
                Format::writable().filter_map(|(_, words)| words.first().copied()).collect();
            let (name, words) = (format.name(), words.join(", "));
            Err(WriteError(format!("{name} is read, not written; write {words}")))
        }
    }
}

fn differently_named(files: Vec<OutFile>) -> Result<Vec<OutFile>, WriteError> {
    for (i, file) in files.iter().enumerate() {
        if files[..i].iter().any(|earlier| earlier.name.eq_ignore_ascii_case(&file.name)) {
            return Err(WriteError(format!("two cameras would share the file {}; rename one", file.name)));
        }
    }
    Ok(files)
}

/// The camera for images of this size: itself when the size agrees, scaled when the images are a uniform enlargement
/// or reduction of the calibrated size (pixel centres kept), refused when the aspect differs.
pub fn check_image_size(camera: &Camera, width_px: u32, height_px: u32) -> Result<Camera, String> {
    checks::image_size(camera, ImageSize { width_px, height_px })
}
