//! Camera and target files as they are read and written: cameras with names, poses between frames, clocks, remarks.

use super::format::Format;
use crate::core::{Camera, Matrix6, Pose, Target};
use nalgebra::DMatrix;

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
    pub(super) fn only(name: &str, text: String) -> Vec<Self> {
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
    /// Covariance of its intrinsics, rows and columns in the order of `Camera::parameters` and in their units, when the file states it.
    pub intrinsics_covariance: Option<DMatrix<f64>>,
}

impl NamedCamera {
    /// Creates a camera whose file states no covariance of its intrinsics.
    pub(crate) fn new(name: impl Into<String>, camera: Camera, placement: Option<Placement>) -> Self {
        NamedCamera { name: name.into(), camera, placement, intrinsics_covariance: None }
    }

    /// `intrinsics_covariance` row by row, as the mathematics takes it.
    pub fn intrinsics_rows(&self) -> Option<Vec<f64>> {
        Some(self.intrinsics_covariance.as_ref()?.transpose().iter().copied().collect())
    }
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
    /// The cameras in the order of the file; none where `read_places` found poses only.
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
    pub(super) fn among(&self, cameras: &[NamedCamera]) -> Self {
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
pub(super) struct Contents {
    pub cameras: Vec<NamedCamera>,
    /// Read by their names only: what most people do not mean, such as the lenses before rectification.
    pub spare: Vec<NamedCamera>,
    pub relations: Vec<Placement>,
    pub clocks: Vec<ClockOffset>,
    pub joint: Option<JointCovariance>,
    pub contradiction: Option<String>,
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
}

impl Contents {
    pub fn into_file(self, format: Format) -> CameraFile {
        let Contents { cameras, relations, clocks, joint, contradiction, mut warnings, .. } = self;
        warnings.extend(contradiction.as_ref().map(|reason| {
            format!("the rig in this file is inconsistent: {reason}; no result that rests on its places is reliable")
        }));
        warnings.extend(of_copies(format, &cameras));
        CameraFile { format, cameras, relations, clocks, joint, contradiction, warnings }
    }
}

/// Poses that agree to this were copied: two calibrations never do.
const SAME_POSE: f64 = 1e-9;
/// Cameras of a file that are compared with each other.
const MOST_COMPARED: usize = 100;

/// Cameras of one file that two calibrations would not give: in one place, or with one lens. One remark of either kind.
fn of_copies(format: Format, cameras: &[NamedCamera]) -> Vec<String> {
    let compared = &cameras[..cameras.len().min(MOST_COMPARED)];
    let first = |is_same: fn(&NamedCamera, &NamedCamera) -> bool| {
        let mut pairs =
            compared.iter().enumerate().flat_map(|(i, b)| compared[..i].iter().map(move |a| (a, b)));
        pairs.find(|(a, b)| is_same(a, b))
    };
    let placed = first(are_one_pose).map(|(a, b)| {
        format!("cameras {} and {} stand in one place and look one way, to the last digit: was one calibration copied?", a.name, b.name)
    });
    // Many images of one camera share its lens there.
    let lens = first(are_one_lens).filter(|_| format != Format::Colmap).map(|(a, b)| {
        format!("cameras {} and {} have one lens, to the last digit: was one camera's calibration given for both?", a.name, b.name)
    });
    placed.into_iter().chain(lens).collect()
}

fn are_one_pose(a: &NamedCamera, b: &NamedCamera) -> bool {
    let (Some(p), Some(q)) = (&a.placement, &b.placement) else { return false };
    let are_frames_alike = match p.a == a.name {
        true => q.a == b.name && p.b == q.b,
        false => p.b == a.name && q.b == b.name && p.a == q.a,
    };
    let (p, q) = (&p.b_from_a, &q.b_from_a);
    let apart = (p.rotation - q.rotation).amax().max((p.translation - q.translation).amax());
    are_frames_alike && apart <= SAME_POSE
}

/// Calibrated ones: a nominal lens, without distortion, may be that of several.
fn are_one_lens(a: &NamedCamera, b: &NamedCamera) -> bool {
    let (p, q) = (a.camera.parameters(), b.camera.parameters());
    a.camera.size == b.camera.size
        && p.len() == q.len()
        && p.iter().zip(q.iter()).all(|(a, b)| a == b)
        && p.iter().skip(4).any(|(_, value)| *value != 0.0)
}
