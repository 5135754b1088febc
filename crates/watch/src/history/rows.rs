//! Rows of a history.

use nalgebra::{Matrix3, Vector3};
use resight_core::{Matrix6, Pose, Vector6};

/// The result of one frame for a camera and one of its targets.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameRow {
    /// Index of the pair in the session.
    pub pair: usize,
    /// When the frame was taken, seconds.
    pub t_s: f64,
    /// Number of the frame in the source.
    pub number: u64,
    /// The state of the pair, as last known.
    pub state: &'static str,
    /// Points found.
    pub n_points: usize,
    /// The pose of this frame alone.
    pub measured: Option<Measured>,
    /// The rotation since the reference image, where natural landmarks were used.
    pub rotated: Option<StoredRotation>,
    /// The reason why there is neither a pose nor a rotation.
    pub reason: Option<String>,
}

/// A pose, how well it is known, and how well it fits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measured {
    /// x_in_cam = cam_from_target · x_in_target.
    pub cam_from_target: Pose,
    /// Its 6×6 covariance, left motion `[rotation_rad; translation_m]` in the camera frame.
    pub covariance: Matrix6,
    /// Root mean square of the reprojection error, pixels.
    pub rms_px: f64,
}

/// The rotation of a camera since the reference image of its natural landmarks, as in `watch --json --frames`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StoredRotation {
    /// Rotation vector of old_from_new, where the camera is now in its own frame of the reference image: radians about x right, y down,
    /// z forward. Positive is up, right, clockwise.
    pub rotation_rad: Vector3<f64>,
    /// Its 3×3 covariance, rad²: of the small rotation ω in Exp(ω) · old_from_new, about the same axes.
    pub covariance_rad2: Matrix3<f64>,
    /// Number of landmarks that agree with it; the mean if it represents several frames.
    pub n_landmarks: f64,
}

/// Something that happened.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct EventRow {
    /// When, seconds of capture, if it has such a time.
    pub t_s: Option<f64>,
    /// The camera concerned.
    pub camera: Option<String>,
    /// The target concerned.
    pub target: Option<String>,
    /// `state`, `learned`, `moved`, `source`, `dropped`, `ended`, `not_stored`.
    pub kind: String,
    /// The new state, of a change of state.
    pub state: Option<&'static str>,
    /// Index of the pair that changed its state.
    pub pair: Option<usize>,
    /// All details, as a JSON object.
    pub detail: String,
}

/// The period that a stored row represents.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Span {
    /// One frame.
    Frame,
    /// The frames of a minute in one state.
    Minute,
    /// The frames of an hour in one state.
    Hour,
}

impl Span {
    /// Length, seconds; zero for a single frame.
    pub fn seconds(self) -> f64 {
        match self {
            Span::Frame => 0.0,
            Span::Minute => 60.0,
            Span::Hour => 3600.0,
        }
    }

    pub(super) fn from_seconds(seconds: f64) -> Self {
        match seconds {
            s if s < 1.0 => Span::Frame,
            s if s < 3600.0 => Span::Minute,
            _ => Span::Hour,
        }
    }
}

/// Statistics of the readings of a minute or an hour. Motions are relative to the mean, `[rotation_rad; translation_m]`, left, in the camera
/// frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Covariance of the readings about their mean, as they were seen.
    pub scatter: Matrix6,
    /// Smallest motion from the mean, each coordinate for itself.
    pub least: Vector6,
    /// Largest.
    pub most: Vector6,
    /// Largest rms of a frame, pixels.
    pub most_rms_px: f64,
}

/// Statistics of rotations: small rotations from the mean rotation, about the axes of the camera in the reference image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationSummary {
    /// Covariance of the turns about their mean, as they were seen, rad².
    pub scatter_rad2: Matrix3<f64>,
    /// Smallest turn from the mean, each coordinate for itself, rad.
    pub least_rad: Vector3<f64>,
    /// Largest.
    pub most_rad: Vector3<f64>,
}

/// A row as it is stored: a frame, or several in one.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredRow {
    /// The camera.
    pub camera: String,
    /// The target.
    pub target: String,
    /// The run of the program that saw it.
    pub session: i64,
    /// When the frame was taken, or the minute or hour began, seconds.
    pub t_s: f64,
    /// The period that it represents.
    pub span: Span,
    /// Frames in it.
    pub frames: u64,
    /// Number of frames with a pose.
    pub readings: u64,
    /// Number of frames with a rotation.
    pub rotations: u64,
    /// The state in which the frame left the pair; a minute in two states has two rows.
    pub state: String,
    /// Points found, on average.
    pub n_points: f64,
    /// The pose, or the mean of those; `covariance` is that of a single frame, on average, and rms_px the root of the mean square.
    pub measured: Option<Measured>,
    /// Scatter of several readings about their mean.
    pub summary: Option<Summary>,
    /// The rotation, or the mean of those; its covariance is that of a single frame, on average.
    pub rotated: Option<StoredRotation>,
    /// Scatter of several rotations about their mean.
    pub rotation_summary: Option<RotationSummary>,
    /// The reason why there is neither a pose nor a rotation.
    pub reason: Option<String>,
}

/// An event as it is stored.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredEvent {
    /// The run of the program that reported it.
    pub session: i64,
    /// When it was reported, seconds since 1970.
    pub unix_s: f64,
    /// The event; its `pair` is `None`.
    pub row: EventRow,
    /// The new state, of a change of state.
    pub state: Option<String>,
}
