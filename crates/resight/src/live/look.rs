//! What is done with each frame of one camera: target, pose, pose through time, decision.

use super::{LiveConfig, Observation, StageTimes, State};
use crate::detect::{DetectError, Detector};
use crate::source::{Content, Frame};
use resight_core::consistency::Consistency;
use resight_core::correspondence::{Detection, correspond};
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::monitor::learn::{LEAST_READINGS, learn};
use resight_core::monitor::{Monitor, Reading, Reference, Watch};
use resight_core::track::{Candidate, Tracked, Tracker};
use resight_core::{Camera, Correspondence, Error, Target};
use std::sync::Arc;
use std::time::Instant;

/// Looks at the frames of one camera, in order.
pub struct Look {
    camera: Camera,
    target: Arc<Target>,
    detector: Detector,
    tracker: Tracker,
    stage: Stage,
    config: LiveConfig,
    /// Hash of the last picture: a camera that froze sends it again and again.
    last_picture: Option<u64>,
}

/// Before and after the reference is known.
enum Stage {
    /// The reference is known, the clock of the frames is not.
    Starting(Box<Reference>),
    Learning(Vec<Reading>),
    Watching(Box<Monitor>),
}

/// What a frame changed.
pub struct Looked {
    /// What it said.
    pub observation: Observation,
    /// How things stand now.
    pub state: State,
    /// The reference, where this frame completed it.
    pub learned: Option<Box<Reference>>,
}

impl Look {
    /// # Errors
    /// A target that no detector knows, or a setting that cannot be.
    pub fn new(
        camera: &Camera,
        target: &Arc<Target>,
        reference: Option<&Reference>,
        config: &LiveConfig,
    ) -> Result<Self, LookError> {
        let stage = match reference {
            Some(reference) => {
                Monitor::new(reference, &config.monitor, 0.0)?; // Says now what is wrong with it.
                Stage::Starting(Box::new(*reference))
            }
            None => Stage::Learning(Vec::new()),
        };
        Ok(Look {
            camera: camera.clone(),
            detector: Detector::new(target)?,
            target: Arc::clone(target),
            tracker: Tracker::new(&config.track)?,
            stage,
            config: config.clone(),
            last_picture: None,
        })
    }

    /// The next frame. `waited_us` is how long it lay in the queue.
    pub fn take(&mut self, frame: &Frame, waited_us: f64) -> Looked {
        self.start(frame.capture_s);
        let mut observation = Observation {
            number: frame.number,
            capture_s: frame.capture_s,
            name: frame.name.clone(),
            n_points: 0,
            estimate: None,
            reason: None,
            tracked: None,
            reading: None,
            times: StageTimes { waited_us, ..StageTimes::default() },
        };
        if let Err(reason) = self.observe(frame, &mut observation) {
            observation.reason = Some(reason);
        }
        let started = Instant::now();
        let learned = observation.reading.and_then(|reading| self.decide(&reading));
        observation.times.decide_us += micros(started);
        Looked { observation, state: self.state(frame.capture_s), learned }
    }

    /// How things stand at a time, also when no frame has come.
    pub fn state(&self, t_s: f64) -> State {
        match &self.stage {
            Stage::Starting(_) => State::Unseen { for_s: 0.0 },
            Stage::Learning(readings) => {
                State::Learning { readings: readings.len(), needed: self.config.learn_readings }
            }
            Stage::Watching(monitor) => monitor.watch(t_s).into(),
        }
    }

    /// The first frame sets the clock: what is not seen from then on is unseen.
    fn start(&mut self, t_s: f64) {
        if let Stage::Starting(reference) = &self.stage
            && let Ok(monitor) = Monitor::new(reference, &self.config.monitor, t_s)
        {
            self.stage = Stage::Watching(Box::new(monitor));
        }
    }

    fn observe(&mut self, frame: &Frame, observation: &mut Observation) -> Result<(), String> {
        let started = Instant::now();
        let detections = self.detections(frame)?;
        observation.times.detect_us = micros(started);
        let started = Instant::now();
        let (seen, _) = correspond(&detections, &self.target, &self.camera);
        let points: Vec<Correspondence> = seen.into_iter().map(|(_, c)| c).collect();
        observation.n_points = points.len();
        let estimate = locate(&points, &self.camera, &Config::default()).map_err(|e| e.to_string())?;
        observation.times.solve_us = micros(started);
        let started = Instant::now();
        observation.estimate = Some(estimate);
        observation.tracked = self.tracker.push(frame.capture_s, &candidates(&estimate));
        observation.reading = observation.tracked.as_ref().map(|tracked| reading(frame, &estimate, tracked));
        observation.times.decide_us = micros(started);
        Ok(())
    }

    fn detections(&mut self, frame: &Frame) -> Result<Vec<Detection>, String> {
        let image = match &frame.content {
            Content::Unreadable(reason) => return Err(reason.clone()),
            Content::Detections(detections) if detections.is_empty() => return Err(nothing(&self.target)),
            Content::Detections(detections) => return Ok(detections.clone()),
            Content::Image(image) => image,
        };
        let hash = fingerprint(&image.data);
        if self.last_picture.replace(hash) == Some(hash) {
            return Err("the same picture as before: the camera or its stream is frozen".to_string());
        }
        let camera = crate::formats::check_image_size(&self.camera, image.width_px, image.height_px)?;
        let found = self.detector.detect_with_camera(image, &camera).map_err(|e| e.to_string())?;
        if found.is_empty() { Err(nothing(&self.target)) } else { Ok(found) }
    }

    /// The reference where this reading completed it.
    fn decide(&mut self, reading: &Reading) -> Option<Box<Reference>> {
        let readings = match &mut self.stage {
            Stage::Starting(_) => return None,
            Stage::Watching(monitor) => {
                monitor.push(reading);
                return None;
            }
            Stage::Learning(readings) => readings,
        };
        readings.push(*reading);
        if readings.len() < self.config.learn_readings.max(LEAST_READINGS) {
            return None;
        }
        let reference = learn(readings, &self.config.lasting).ok().and_then(|reference| {
            let monitor = Monitor::new(&reference, &self.config.monitor, reading.t_s).ok()?;
            Some((reference, monitor))
        });
        let Some((reference, monitor)) = reference else {
            // They do not agree (yet): the older half is forgotten, and learning goes on.
            readings.drain(..readings.len() / 2);
            return None;
        };
        self.stage = Stage::Watching(Box::new(monitor));
        Some(Box::new(reference))
    }
}

/// All minima of a frame: time chooses among them.
fn candidates(estimate: &PoseEstimate) -> Vec<Candidate> {
    let first = Candidate {
        cam_from_target: estimate.cam_from_target,
        covariance: estimate.covariance,
        weight: estimate.weight,
    };
    let others = estimate.others.iter().flatten().map(|other| Candidate {
        cam_from_target: other.minimum.cam_from_target,
        covariance: other.minimum.covariance,
        weight: other.weight,
    });
    std::iter::once(first).chain(others).collect()
}

/// The frame's own pose, the one of its minima that time chose: what is filtered already must not be tested for white noise.
fn reading(frame: &Frame, estimate: &PoseEstimate, tracked: &Tracked) -> Reading {
    let all = candidates(estimate);
    let chosen = tracked.candidate.and_then(|i| all.get(i)).unwrap_or(&all[0]);
    Reading {
        t_s: frame.capture_s,
        a_from_b: chosen.cam_from_target,
        covariance: chosen.covariance,
        is_consistent: matches!(estimate.consistency, Consistency::Consistent),
    }
}

impl From<Watch> for State {
    fn from(watch: Watch) -> Self {
        match watch {
            Watch::Steady => State::Steady,
            Watch::Unseen { for_s } => State::Unseen { for_s },
            Watch::Settling => State::Settling,
            Watch::Drifted(drift) => State::Drifted(Box::new(drift)),
            Watch::Inconsistent => State::Inconsistent,
        }
    }
}

/// Why a camera cannot be watched.
#[derive(Debug, thiserror::Error)]
pub enum LookError {
    /// A target that no detector knows.
    #[error(transparent)]
    Detect(#[from] DetectError),
    /// A setting that cannot be.
    #[error(transparent)]
    Setting(#[from] Error),
}

fn nothing(target: &Target) -> String {
    format!("no {} target in this frame", target.kind())
}

fn micros(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e6
}

/// FNV-1a over eight bytes at a time.
fn fingerprint(data: &[u8]) -> u64 {
    let words = data.chunks(8).map(|chunk| {
        let mut word = [0; 8];
        word[..chunk.len()].copy_from_slice(chunk);
        u64::from_le_bytes(word)
    });
    words.fold(0xcbf2_9ce4_8422_2325, |hash, word| (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3))
}
