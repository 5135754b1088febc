//! The live session: it reads sources, searches images, tracks poses and detects drift; everything is reported as an `Event`.
//!
//! One thread reads each source and another searches its images; between them is a queue of few frames, of which the oldest is dropped and
//! counted when it is full. Events arrive through one channel, in the order in which they occurred for each camera.

mod clock;
mod known;
mod guard;
mod look;
mod memory;
mod outlet;
mod pace;
mod queue;
mod reader;
mod relearn;
pub mod reference;
pub mod rig;
mod session;
mod sparingly;
mod state;
mod turns;
mod watcher;

pub use known::references;
pub use look::{CameraWatcher, CameraWatcherError, FrameResult};
pub use relearn::Relearn;
pub use session::{run, run_from};
pub use state::StateFile;

use crate::source::Source;
use resight::GrayImage;
use resight::landmarks::LandmarkObservation;
use resight::locate::IntrinsicsCovariance;
use resight_core::locate::PoseEstimate;
use resight_core::temporal::monitor::attribute::MovedNode;
use resight_core::temporal::monitor::learn::LearnConfig;
use resight_core::temporal::monitor::{
    Detectable, Deviation, Drift, MeasuredNoise, MonitorConfig, Reading, Recurrence, Reference, Unpromised,
    Unsettled, Watch,
};
use resight_core::temporal::track::{Motion, TrackConfig, Tracked};
use resight_core::{Camera, Correspondence, Matrix6, Pixel, Target};
use std::sync::Arc;

/// One camera of a session.
pub struct LiveCamera {
    /// Its name.
    pub name: String,
    /// Its lens.
    pub camera: Camera,
    /// The uncertainty of its intrinsics; `None` where they are exact. Rotations from landmarks include it in their covariance; the readings of
    /// a target are judged with it, but their covariance is that of the pixels, because all readings share the lens.
    pub intrinsics: Option<IntrinsicsCovariance>,
    /// The targets in view; with several, a target that was removed is distinguished from a camera that moved.
    pub targets: Vec<Watched>,
    /// The landmarks used while no target is visible; without targets they count as target 0.
    pub landmarks: Option<WatchedLandmarks>,
    /// The source of its frames.
    pub source: Box<dyn Source>,
}

impl LiveCamera {
    /// Creates a camera with exact intrinsics, and without targets.
    pub fn new(name: impl Into<String>, camera: Camera, source: Box<dyn Source>) -> Self {
        LiveCamera {
            name: name.into(),
            camera,
            intrinsics: None,
            targets: Vec::new(),
            landmarks: None,
            source,
        }
    }
}

/// A target that a camera watches.
pub struct Watched {
    /// Its name.
    pub name: String,
    /// Its geometry.
    pub target: Arc<Target>,
    /// The reference pose of the camera; by default learned from the first `learn_readings`.
    pub reference: Option<Reference>,
}

/// Natural landmarks that a camera goes by while it sees no target.
pub struct WatchedLandmarks {
    /// The reference image; by default the first image with enough landmarks.
    pub reference_image: Option<GrayImage>,
}

/// The settings of a session.
#[derive(Debug, Clone)]
pub struct LiveConfig {
    /// The settings of the change detector.
    pub monitor: MonitorConfig,
    /// The motion model of cameras between readings.
    pub track: TrackConfig,
    /// Readings from which a missing reference is learned.
    pub learn_readings: usize,
    /// The prior of correlated errors.
    pub correlated: LearnConfig,
    /// Frames waiting for each camera; further ones push out the oldest.
    pub queue_frames: usize,
    /// The cameras are a rig and look at targets that are hand-held: only their relations are watched. None: targets stand still.
    pub rig: Option<rig::RigConfig>,
    /// A lost source is tried again after this time, seconds, doubled up to 32 times after each failure.
    pub retry_s: f64,
    /// Asks the session, while it runs, to learn references anew.
    pub relearn: Relearn,
}

impl LiveConfig {
    /// Returns why no camera has a reference of its own that could be learned again, where that is so.
    pub fn without_references(&self) -> Option<&'static str> {
        match self.track.motion {
            _ if self.rig.is_some() => Some(
                "These cameras are watched as a rig, which has one reference for all: make a new one with `resight rig -o`, or start again without the session's `state`.",
            ),
            Motion::ConstantVelocity { .. } => Some(
                "These cameras move by themselves (`motion = \"moving\"`): there is no reference to set.",
            ),
            _ => None,
        }
    }
}

impl Default for LiveConfig {
    /// A mounted camera, one false alarm a month, a reference learned from 50 readings.
    fn default() -> Self {
        let none = Matrix6::zeros();
        LiveConfig {
            monitor: MonitorConfig::default(),
            track: TrackConfig::default(),
            learn_readings: 50,
            correlated: LearnConfig { bias: none, bias_time_s: 60.0, diurnal: none },
            queue_frames: 2,
            retry_s: 1.0,
            rig: None,
            relearn: Relearn::default(),
        }
    }
}

/// Microseconds spent on a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StageTimes {
    /// Time from capture (live) or arrival (recorded) to the start of the search.
    pub waited_us: f64,
    /// Looking for the target.
    pub detect_us: f64,
    /// Pose, covariance and all minima.
    pub solve_us: f64,
    /// Filter and decision.
    pub decide_us: f64,
}

/// The result of one frame.
#[derive(Debug, Clone, Default)]
pub struct Observation {
    /// The frame's number, capture time (s) and name.
    pub number: u64,
    /// When it was taken, seconds.
    pub capture_s: f64,
    /// Its name.
    pub name: String,
    /// Whether the frame could be read; a truncated image, an invalid line and a frozen stream could not.
    pub is_readable: bool,
    /// Points found.
    pub n_points: usize,
    /// The pose of this frame alone.
    pub estimate: Option<PoseEstimate>,
    /// The points it rests on; kept only where the cameras are watched as a rig.
    pub seen: Vec<Correspondence>,
    /// The lens that saw them, at the size of the image; kept with them.
    pub lens: Option<Box<Camera>>,
    /// The differences of its points from that pose.
    pub residuals: Vec<PointResidual>,
    /// The reason why there is no pose.
    pub reason: Option<String>,
    /// The pose through time.
    pub tracked: Option<Tracked>,
    /// The reading that was passed to the monitor.
    pub reading: Option<Reading>,
    /// The rotation since the reference image, where no target was seen.
    pub landmarks: Option<Arc<LandmarkObservation>>,
    /// The image that has just become the reference of the landmarks.
    pub reference_image: Option<Arc<GrayImage>>,
    /// The durations of its stages.
    pub times: StageTimes,
}

/// A point of a frame, and how it differs from the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointResidual {
    /// Its position in the image.
    pub pixel: Pixel,
    /// Observed less predicted, px.
    pub residual_px: [f64; 2],
    /// Whether a residual as large occurs by chance in more than one of a hundred cases.
    pub agrees: bool,
}

/// State of a camera against a target.
#[derive(Debug, Clone, PartialEq)]
pub enum State {
    /// Learning its reference: readings so far, readings needed.
    Learning {
        /// Number of readings so far.
        readings: usize,
        /// Needed.
        needed: usize,
    },
    /// Seen, and where it was.
    Steady,
    /// Not seen.
    Stale {
        /// Since, seconds.
        for_s: f64,
        /// What is wrong with the frames, or that there are none; `None` where that is not known.
        reason: Option<String>,
    },
    /// Something differs, and the reason why it is not (yet) reported as a motion.
    Checking(CheckingReason),
    /// It moved.
    Drifted(Box<Drift>),
    /// Seen, but the readings contradict the noise that is stated of them.
    Inconsistent,
    /// The target is visible and the camera moves as expected, which is not drift.
    Tracking,
}

impl From<Watch> for State {
    fn from(watch: Watch) -> Self {
        match watch {
            Watch::Steady => State::Steady,
            Watch::Stale { for_s } => State::Stale { for_s, reason: None },
            Watch::Checking => State::Checking(CheckingReason::Different),
            Watch::CorrelatedErrors => State::Checking(CheckingReason::CorrelatedErrors),
            Watch::Away(deviation) => State::Checking(CheckingReason::Away(Box::new(deviation))),
            Watch::Drifted(drift) => State::Drifted(Box::new(drift)),
            Watch::Inconsistent => State::Inconsistent,
        }
    }
}

/// Why a camera is neither steady nor moved.
#[derive(Debug, Clone, PartialEq)]
pub enum CheckingReason {
    /// Something is different; not yet decided.
    Different,
    /// Errors of the pose are correlated for longer, or are larger, than was learned: the difference is within them.
    CorrelatedErrors,
    /// It is not where it was, by more than the session promises to find, though errors that are not excluded would explain it.
    Away(Box<Deviation>),
}

/// The learned noise of one camera and one target, and the motions that can be detected with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Promise {
    /// The noise of the readings beside the stated one.
    pub noise: MeasuredNoise,
    /// The smallest sudden motions that are found within a time, nine times in ten.
    pub detectable: Detectable,
    /// Where small motions came back by themselves: which motions are held until they have lasted.
    pub held: Option<Recurrence>,
    /// Errors for which no rate of false alarms is promised.
    pub unpromised: Vec<Unpromised>,
    /// The number of key frames that the readings of the reference saw, where they are too few to know the errors of a still scene in a video.
    pub missed_key_frames: Option<u64>,
    /// The readings from which this and the reference were learned; empty for a promise that changed later.
    pub learned_from: Vec<Reading>,
}

/// An event of a session.
#[derive(Debug, Clone)]
pub enum Event {
    /// A frame was searched for one target.
    Observed {
        /// Index of the camera.
        camera: usize,
        /// Index of the target among those of the camera.
        target: usize,
        /// Its result.
        observation: Box<Observation>,
    },
    /// The state of a camera against a target changed (and once at the start).
    StateChanged {
        /// Index of the camera.
        camera: usize,
        /// Index of the target among those of the camera.
        target: usize,
        /// Since when, seconds of capture.
        t_s: f64,
        /// The new state.
        state: State,
    },
    /// Which cameras or targets moved relative to the others.
    Attributed {
        /// Since when, seconds.
        t_s: f64,
        /// Nodes by name, with their motions.
        moved: Vec<(String, MovedNode)>,
        /// Other sets that would explain it as well, by name.
        alternatives: Vec<Vec<String>>,
    },
    /// The pose of the camera relative to the reference of the session's start: reported once, after a few readings, or at the end.
    Compared {
        /// Index of the camera.
        camera: usize,
        /// Index of the target among those of the camera.
        target: usize,
        /// When, seconds of capture.
        t_s: f64,
        /// The deviation.
        deviation: Box<Deviation>,
    },
    /// The noise of the readings has changed so much that the detectable motion is another one: reported once an hour at most.
    Promised {
        /// Index of the camera.
        camera: usize,
        /// Index of the target among those of the camera.
        target: usize,
        /// When, seconds of capture.
        t_s: f64,
        /// The current noise of the readings, and the motions that can be detected.
        promise: Box<Promise>,
    },
    /// A reference was learned.
    Learned {
        /// Index of the camera.
        camera: usize,
        /// Index of the target among those of the camera.
        target: usize,
        /// The reference.
        reference: Box<Reference>,
        /// The noise of the readings, and the motions that can be detected; `None` where the noise is stated, not learned.
        promise: Option<Box<Promise>>,
    },
    /// The camera moved while its reference was being learned: learning continues with the readings after the motion.
    MovedWhileLearning {
        /// Index of the camera.
        camera: usize,
        /// Index of the target among those of the camera.
        target: usize,
        /// Other cameras of a rig, one of which may have moved instead.
        alternatives: Vec<usize>,
        /// The motion.
        unsettled: Box<Unsettled>,
    },
    /// Frames dropped since the last such event, because the camera's queue was full. Told at once, then together every minute, and at
    /// the end.
    Dropped {
        /// Index of the camera.
        camera: usize,
        /// Number of frames.
        frames: u64,
    },
    /// Frames left out since the last such event, reported like dropped ones: they could not be read, or were out of order.
    LeftOut {
        /// Index of the camera.
        camera: usize,
        /// Number of frames.
        frames: u64,
        /// The reason for the last of them.
        reason: String,
    },
    /// The clock that stamps the frames was set. Times continue without the step.
    Clock {
        /// Index of the camera.
        camera: usize,
        /// The time that is gone on from, seconds.
        t_s: f64,
        /// The step of the clock, seconds; negative is back.
        step_s: f64,
    },
    /// EXIF asks viewers to show images of this camera otherwise than they are stored: reported once. Pixels are taken as stored.
    Oriented {
        /// Index of the camera.
        camera: usize,
        /// How viewers show them.
        how: &'static str,
    },
    /// A source was lost or returned; each is reported once.
    Source {
        /// Index of the camera.
        camera: usize,
        /// Whether it gives frames.
        connected: bool,
        /// The reason for a loss.
        reason: Option<String>,
    },
    /// A source has ended.
    Ended {
        /// Index of the camera.
        camera: usize,
    },
}
