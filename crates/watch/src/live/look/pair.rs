//! One camera and one target: detection, pose, tracking, decision.

use super::expect::Expectation;
use super::learning::Learning;
use super::promises::Promises;
use super::staying::{Staying, View};
use super::unseen::Unseen;
use super::view::{candidates, reading, residuals};
use super::{CameraWatcherError, FrameResult, micros, nothing};
use crate::live::state::{PairRecord, ReadingRecord, StageRecord, changed, settings};
use crate::live::{LiveConfig, Observation, Promise, State, Watched};
use crate::source::{Content, Frame};
use resight::GrayImage;
use resight::detect::follow::Follower;
use resight::locate::IntrinsicsCovariance;
use resight_core::correspondence::Detection;
use resight_core::locate::consistency::{Consistency, is_inconsistent};
use resight_core::locate::{Config, PoseEstimate};
use resight_core::multiview::tag_map::locate_target;
use resight_core::temporal::disagreement::{Disagreement, Expected};
use resight_core::temporal::monitor::learn::{LEAST_READINGS, learn, unsettled};
use resight_core::temporal::monitor::{Deviation, Monitor, Reading, Reference, Unsettled, Watch};
use resight_core::temporal::track::{Motion, Tracker};
use resight_core::{Camera, Correspondence, Target};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// The tracker and monitor of one camera and one target.
pub(super) struct Pair {
    camera: Camera,
    intrinsics: Option<IntrinsicsCovariance>,
    target: Arc<Target>,
    follower: Follower,
    expectation: Expectation,
    tracker: Tracker,
    stage: Stage,
    /// Number of readings until the deviation from the initial reference is reported.
    compares_in: Option<u32>,
    /// Number of key frames so far, and what the source counts of them; none where frames do not depend on each other.
    key_frames: Option<(u64, u64)>,
    /// How many there were after the first reading of the reference, where they are too few.
    missed_key_frames: Option<u64>,
    /// Capture time of the first frame, and whether it could be read.
    began: Option<(f64, bool)>,
    /// Capture time of the last frame, and the reason why it gave no reading.
    last: Option<(f64, Option<String>)>,
    /// Contradictions between points of the last views.
    disagreement: Disagreement,
    staying: Staying,
    unseen: Unseen,
    promises: Promises,
    config: LiveConfig,
    /// The target's name, and the settings with which a saved state must agree.
    name: String,
    settings: BTreeMap<String, String>,
}

/// The stages before and after the reference is known.
enum Stage {
    /// The reference is known, but not the clock of the frames.
    Starting(Box<Reference>),
    Learning(Learning),
    Watching(Box<Monitor>),
    /// The camera moves, or the target is hand-held: the pose is tracked, but drift of this pair alone is not monitored.
    Following {
        last_s: Option<f64>,
        is_seen: bool,
    },
}

/// The content of a frame.
pub(super) enum FrameContent<'a> {
    /// An image, and the lens at its size.
    Image(&'a GrayImage, &'a Camera),
    /// Features found by another program.
    Detections(&'a [Detection]),
}

impl<'a> FrameContent<'a> {
    /// The lens at the size of the image; features found by another program are those of the calibration's own size.
    fn lens(&self) -> Option<&'a Camera> {
        match self {
            FrameContent::Image(_, lens) => Some(lens),
            FrameContent::Detections(_) => None,
        }
    }
}

impl Pair {
    /// # Errors
    /// Fails for a target without a detector or an invalid setting.
    pub fn new(
        camera: &Camera,
        intrinsics: Option<&IntrinsicsCovariance>,
        watched: &Watched,
        config: &LiveConfig,
    ) -> Result<Self, CameraWatcherError> {
        // Checked now: an invalid monitor would otherwise appear only as learning without end.
        config.monitor.check()?;
        config.correlated.check()?;
        let moves = matches!(config.track.motion, Motion::ConstantVelocity { .. });
        let stage = match &watched.reference {
            _ if moves || config.rig.is_some() => Stage::Following { last_s: None, is_seen: false },
            Some(reference) => {
                Monitor::new(reference, &config.monitor, 0.0)?; // Says now what is wrong with it.
                Stage::Starting(Box::new(*reference))
            }
            None => Stage::Learning(Learning::default()),
        };
        Ok(Pair {
            camera: camera.clone(),
            intrinsics: intrinsics.cloned(),
            follower: Follower::new(&watched.target)?,
            expectation: Expectation::new(&watched.target),
            // The error of a printed scale is the same in every frame: it is neither noise of a reading nor motion.
            target: match watched.target.printed_scale() {
                Some(_) => Arc::new(watched.target.with_exact_scale()),
                None => Arc::clone(&watched.target),
            },
            tracker: Tracker::new(&config.track)?,
            stage,
            compares_in: None,
            key_frames: None,
            missed_key_frames: None,
            began: None,
            last: None,
            config: config.clone(),
            name: watched.name.clone(),
            disagreement: Disagreement::default(),
            unseen: Unseen::default(),
            promises: Promises::default(),
            staying: Staying::of(&watched.target),
            settings: settings(camera, watched, config),
        })
    }

    /// Returns the reference with which the pose is compared, where it is known.
    pub fn reference(&self) -> Option<Reference> {
        match &self.stage {
            Stage::Starting(reference) => Some(**reference),
            Stage::Watching(monitor) => Some(*monitor.reference()),
            Stage::Learning(_) | Stage::Following { .. } => None,
        }
    }

    /// Returns the monitor, where it has started.
    pub fn monitor(&self) -> Option<&Monitor> {
        match &self.stage {
            Stage::Watching(monitor) => Some(monitor),
            _ => None,
        }
    }

    /// Returns whether the target has moved or may have moved, observed or not. The monitor decides nothing in the first decision period.
    pub fn may_have_moved(&self, t_s: f64) -> bool {
        let is_undecided = |(began_s, _)| t_s <= began_s + self.config.monitor.decision_period_s;
        let is_suspect = |monitor: &Monitor| {
            let now = monitor.watch(monitor.last_usable_s());
            monitor.drift().is_some()
                || matches!(now, Watch::Checking | Watch::Away(_) | Watch::CorrelatedErrors)
        };
        self.monitor().is_some_and(|monitor| self.began.is_some_and(is_undecided) || is_suspect(monitor))
    }

    /// Returns all that a restart needs.
    pub fn record(&self) -> PairRecord {
        let stage = match &self.stage {
            Stage::Starting(_) => StageRecord::Starting,
            Stage::Learning(learning) => {
                StageRecord::Learning(learning.all().map(ReadingRecord::from).collect())
            }
            Stage::Watching(monitor) => StageRecord::Watching(monitor.snapshot().into()),
            Stage::Following { last_s, .. } => StageRecord::Following(*last_s),
        };
        let tracker = self.tracker.snapshot().into();
        PairRecord { target: self.name.clone(), settings: self.settings.clone(), tracker, stage }
    }

    /// Returns the deviation from the initial reference: once, when there are enough readings, or from the available ones at the end.
    pub fn compared(&mut self, is_end: bool) -> Option<Deviation> {
        let is_due = |readings: u32| readings == 0 || (is_end && readings < COMPARED_AFTER);
        let deviation = self.monitor()?.deviation().filter(|_| self.compares_in.is_some_and(is_due))?;
        self.compares_in = None;
        self.promises.begin();
        Some(deviation)
    }

    /// Returns the promise of what the monitor detects, after the deviation from the initial reference and where it has changed.
    pub fn promised(&mut self, t_s: f64) -> Option<Promise> {
        let Stage::Watching(_) = &self.stage else { return None };
        if !self.promises.is_due(t_s) {
            return None;
        }
        let promise = self.promise(Vec::new())?;
        self.promises.is_news(&promise, t_s).then_some(promise)
    }

    /// Discards the reference, if there is one, and learns a new one from the next reading on.
    pub fn learn_anew(&mut self) {
        if matches!(self.stage, Stage::Starting(_) | Stage::Learning(_) | Stage::Watching(_)) {
            self.stage = Stage::Learning(Learning::default());
            self.compares_in = None;
            self.disagreement.end();
        }
    }

    /// Continues from the state of another session; returns false where that has no record of this target.
    ///
    /// # Errors
    /// The reason why the record does not belong to this pair; nothing has changed then.
    pub fn restore(&mut self, records: &[PairRecord]) -> Result<bool, String> {
        let Some(record) = records.iter().find(|record| record.target == self.name) else { return Ok(false) };
        if let Some(words) = changed(&record.settings, &self.settings) {
            return Err(words);
        }
        let tracker = Tracker::restore(&record.tracker.snapshot()).map_err(|e| e.to_string())?;
        let stage = match &record.stage {
            StageRecord::Starting => return Ok(false),
            StageRecord::Learning(readings) => {
                let readings = readings.iter().map(ReadingRecord::reading).collect::<Option<_>>();
                let readings: Vec<_> = readings.ok_or("a reading learned so far is damaged")?;
                // The source counts from its start.
                self.key_frames = readings.last().and_then(|(_, key_frames)| Some(((*key_frames)?, 0)));
                Stage::Learning(Learning::of(readings))
            }
            StageRecord::Watching(monitor) => {
                let mut monitor = Monitor::restore(&monitor.snapshot()).map_err(|e| e.to_string())?;
                // A state of a version that did not estimate the noise.
                if !monitor.measures_noise() {
                    monitor.measure_noise(&[]);
                }
                Stage::Watching(Box::new(monitor))
            }
            StageRecord::Following(last_s) => Stage::Following { last_s: *last_s, is_seen: last_s.is_some() },
        };
        (self.tracker, self.stage) = (tracker, stage);
        self.compares_in = self.monitor().map(|_| COMPARED_AFTER);
        Ok(true)
    }

    /// Takes note of how many key frames the source has given, the next frame included.
    pub fn count_key_frames(&mut self, of_source: Option<u64>) {
        self.key_frames = of_source.map(|now| {
            let (count, before) = self.key_frames.unwrap_or((0, 0));
            (count + now.saturating_sub(before), now)
        });
    }

    /// Processes the next frame, or the reason why it shows nothing.
    pub fn take(
        &mut self,
        frame: &Frame,
        sight: Result<FrameContent<'_>, String>,
        mut observation: Observation,
    ) -> FrameResult {
        self.start(frame.capture_s, !matches!(frame.content, Content::Unreadable(_)));
        if let Err(reason) = sight.and_then(|sight| self.observe(frame, &sight, &mut observation)) {
            observation.reason = Some(reason);
        }
        self.last = Some((frame.capture_s, observation.reason.clone()));
        let started = Instant::now();
        let decided = observation.reading.and_then(|reading| self.decide(&reading));
        observation.times.decide_us += micros(started);
        let (learned, promise, unsettled) = match decided {
            Some(Learned::Reference(reference, from)) => (Some(reference), self.promise(from), None),
            Some(Learned::Motion(unsettled)) => (None, None, Some(unsettled)),
            None => (None, None, None),
        };
        let promise = promise.map(Box::new);
        FrameResult { observation, state: self.state(frame.capture_s), learned, promise, unsettled }
    }

    /// Returns the promise that the estimated noise allows, where it has been estimated.
    fn promise(&self, learned_from: Vec<Reading>) -> Option<Promise> {
        let monitor = self.monitor()?;
        let (noise, detectable) = (monitor.measured_noise()?, monitor.detectable(PROMISED_WITHIN_S)?);
        let (held, unpromised) = (monitor.recurrence(), monitor.unpromised());
        let missed_key_frames = self.missed_key_frames;
        Some(Promise { noise, detectable, held, unpromised, missed_key_frames, learned_from })
    }

    /// Returns the state at a time, also when no frame has arrived.
    pub fn state(&self, t_s: f64) -> State {
        match &self.stage {
            Stage::Starting(_) => self.stale(t_s, self.began.map_or(0.0, |(began_s, _)| t_s - began_s)),
            Stage::Learning(learning) if learning.mostly_contradicts() => State::Inconsistent,
            Stage::Learning(learning) => self.learning(learning, t_s),
            Stage::Watching(monitor) => match monitor.watch(t_s) {
                Watch::Stale { for_s } => self.stale(t_s, for_s),
                watch => watch.into(),
            },
            Stage::Following { last_s, is_seen } => {
                let for_s = t_s - last_s.unwrap_or(t_s);
                let is_seen = *is_seen && for_s <= self.config.monitor.stale_after_s;
                if is_seen { State::Tracking } else { self.stale(t_s, for_s) }
            }
        }
    }

    /// Returns the state after the last frame: a target that was never found is stale, with what the first image shows instead.
    pub fn state_at_the_end(&mut self, t_s: f64) -> State {
        let state = self.state(t_s);
        if !matches!(state, State::Learning { readings: 0, .. } | State::Stale { .. }) {
            return state;
        }
        self.unseen.explain(&self.target);
        if let (Some(text), Some((_, reason))) = (self.unseen.explanation(), &mut self.last) {
            *reason = Some(text.to_owned());
        }
        match state {
            State::Stale { for_s, .. } => self.stale(t_s, for_s),
            _ => self.stale(t_s, self.began.map_or(0.0, |(began_s, _)| t_s - began_s)),
        }
    }

    /// Returns the stale state at `t_s`, with its reason, after `for_s` without a usable reading.
    fn stale(&self, t_s: f64, for_s: f64) -> State {
        let reason = match &self.last {
            Some((last_s, reason)) if t_s - last_s <= self.config.monitor.stale_after_s => reason.clone(),
            Some(_) => Some(NO_FRAME.to_string()),
            None => None,
        };
        State::Stale { for_s, reason }
    }

    /// Returns the state while learning, which is `stale` without readings.
    fn learning(&self, learning: &Learning, t_s: f64) -> State {
        let readings = learning.readings();
        let seen_s =
            readings.last().map(|reading| reading.t_s).or(self.began.map(|began| began.0)).unwrap_or(t_s);
        if self.config.monitor.stale_after_s < t_s - seen_s {
            return self.stale(t_s, t_s - seen_s);
        }
        State::Learning { readings: readings.len(), needed: learning.needed(self.config.learn_readings) }
    }

    /// Sets the clock by the first frame: what is not observed from then on is stale. A frame that cannot be read may have the time of another
    /// clock, so the first readable one sets the clock for good.
    fn start(&mut self, t_s: f64, is_readable: bool) {
        if self.began.is_some_and(|(_, is_certain)| is_certain || !is_readable) {
            return;
        }
        self.began = Some((t_s, is_readable));
        match &mut self.stage {
            Stage::Starting(reference) if is_readable => {
                if let Ok(mut monitor) = Monitor::new(reference, &self.config.monitor, t_s) {
                    monitor.measure_noise(&[]);
                    self.stage = Stage::Watching(Box::new(monitor));
                    self.compares_in = Some(COMPARED_AFTER);
                }
            }
            Stage::Following { last_s, is_seen: false } => *last_s = Some(t_s),
            _ => {}
        }
    }

    fn observe(
        &mut self,
        frame: &Frame,
        sight: &FrameContent<'_>,
        observation: &mut Observation,
    ) -> Result<(), String> {
        let started = Instant::now();
        let detections = self.detections(frame.capture_s, sight);
        observation.times.detect_us = micros(started);
        let detections = detections?;
        let started = Instant::now();
        let lens = sight.lens().unwrap_or(&self.camera);
        let found = locate_target(&detections, &self.target, lens, &Config::default());
        let (features, points) = (found.features, found.seen);
        observation.n_points = points.len();
        let estimate = found.estimate.map_err(|e| e.to_string())?;
        observation.times.solve_us = micros(started);
        let started = Instant::now();
        observation.estimate = Some(estimate);
        observation.residuals = residuals(&estimate, &points, lens);
        if let (Some(_), Stage::Following { last_s, is_seen }) = (&self.config.rig, &mut self.stage) {
            (*last_s, *is_seen) = (Some(frame.capture_s), true);
            (observation.seen, observation.lens) = (points, Some(Box::new(lens.clone())));
            return Ok(());
        }
        let candidates = candidates(&estimate);
        observation.tracked = self.tracker.push(frame.capture_s, &candidates);
        let is_consistent = self.is_consistent(&estimate, points.len(), &detections, lens);
        let reading = |tracked| reading(frame, is_consistent, &candidates, tracked);
        observation.reading = observation.tracked.as_ref().map(reading);
        if let (Some(reading), Stage::Watching(monitor)) = (&mut observation.reading, &self.stage) {
            reading.is_consistent &= !is_fault(&mut self.disagreement, monitor, reading, &points, lens);
        }
        if let (Some(reading), FrameContent::Image(..)) = (&observation.reading, sight) {
            let view = View { detections: &detections, features: &features, points: &points, lens };
            self.staying.take(&view, reading, monitor_of(&mut self.stage));
        }
        observation.times.decide_us = micros(started);
        Ok(())
    }

    /// Applies the verdict that uncertain intrinsics allow. The covariance of a reading remains that of the pixels: all readings share the lens.
    fn is_consistent(
        &self,
        estimate: &PoseEstimate,
        n_points: usize,
        detections: &[Detection],
        lens: &Camera,
    ) -> bool {
        let noise = self.monitor().map_or(1.0, measured_variance);
        let is_consistent = |e: &PoseEstimate| match e.consistency {
            Consistency::Consistent => true,
            Consistency::Inconsistent { chi2_per_degree_of_freedom, .. } => {
                let degrees_of_freedom = (2 * n_points).saturating_sub(6);
                !is_inconsistent(
                    chi2_per_degree_of_freedom * degrees_of_freedom as f64 / noise,
                    degrees_of_freedom,
                )
            }
        };
        let uncertain = || {
            let covariance = self.intrinsics.as_ref()?.covariance(lens);
            let config = Config { intrinsics_covariance: Some(&covariance), ..Config::default() };
            locate_target(detections, &self.target, lens, &config).estimate.ok()
        };
        is_consistent(estimate) || uncertain().is_some_and(|e| is_consistent(&e))
    }

    fn detections<'a>(&mut self, t_s: f64, sight: &FrameContent<'a>) -> Result<Cow<'a, [Detection]>, String> {
        let found = match sight {
            FrameContent::Detections(detections) => Cow::Borrowed(*detections),
            FrameContent::Image(image, camera) => {
                let predicted = self.tracker.predicted(t_s);
                let expected = self.expectation.of(predicted.as_ref(), camera);
                let found = self.follower.detect(image, camera, t_s, expected);
                Cow::Owned(found.map_err(|e| e.to_string())?)
            }
        };
        if found.is_empty() {
            return Err(self.missed(t_s, sight));
        }
        self.unseen.find();
        Ok(found)
    }

    /// Returns the reason why a frame without the target gives no reading.
    fn missed(&mut self, t_s: f64, sight: &FrameContent<'_>) -> String {
        if let FrameContent::Image(image, _) = sight {
            self.unseen.miss(image);
        }
        if self.began.is_some_and(|(began_s, _)| self.config.monitor.stale_after_s < t_s - began_s) {
            self.unseen.explain(&self.target);
        }
        self.unseen.explanation().map_or_else(|| nothing(&self.target), str::to_owned)
    }

    /// Returns the result of learning that this reading completes.
    fn decide(&mut self, reading: &Reading) -> Option<Learned> {
        let learning = match &mut self.stage {
            Stage::Starting(_) => return None,
            Stage::Following { last_s, is_seen } => {
                (*last_s, *is_seen) = (Some(reading.t_s), true);
                return None;
            }
            Stage::Watching(monitor) => {
                monitor.push(reading);
                self.compares_in = self.compares_in.map(|readings| readings.saturating_sub(1));
                return None;
            }
            Stage::Learning(learning) => learning,
        };
        learning.push(reading, self.key_frames.map(|(count, _)| count));
        let needed = self.config.learn_readings.max(LEAST_READINGS);
        if !learning.is_due(needed) {
            return None;
        }
        let readings = learning.readings();
        if let Some(unsettled) = unsettled(readings, &self.config.correlated) {
            learning.forget(&unsettled, needed);
            return Some(Learned::Motion(Box::new(unsettled)));
        }
        let reference = learn(readings, &self.config.correlated).ok().and_then(|reference| {
            let mut monitor = Monitor::new(&reference, &self.config.monitor, reading.t_s).ok()?;
            monitor.measure_noise(readings);
            Some((reference, monitor))
        });
        let Some((reference, monitor)) = reference else {
            // The readings do not agree yet: learning continues with the newer half.
            learning.forget_half();
            return None;
        };
        self.missed_key_frames = learning.missed_key_frames();
        let from = learning.take();
        self.stage = Stage::Watching(Box::new(monitor));
        Some(Learned::Reference(Box::new(reference), from))
    }
}

/// Reason why nothing is observed without frames.
const NO_FRAME: &str = "no frame comes";

/// The time within which a motion of the promised size is detected, seconds; at least three readings.
const PROMISED_WITHIN_S: f64 = 60.0;

/// Number of readings for the deviation at the start of a session.
const COMPARED_AFTER: u32 = 10;

/// The result of learning.
enum Learned {
    /// A reference, with the readings from which it was learned.
    Reference(Box<Reference>, Vec<Reading>),
    /// The camera moved, and learning continues.
    Motion(Box<Unsettled>),
}

fn monitor_of(stage: &mut Stage) -> Option<&mut Monitor> {
    if let Stage::Watching(monitor) = stage { Some(monitor) } else { None }
}

/// Returns the variance of the pixels over the stated one, where readings show a larger one.
fn measured_variance(monitor: &Monitor) -> f64 {
    monitor.measured_noise().map_or(1.0, |noise| noise.sigma_ratio.powi(2).max(1.0))
}

/// Returns whether the points contradict each other about the motion since the last steady state.
fn is_fault(
    disagreement: &mut Disagreement,
    monitor: &Monitor,
    reading: &Reading,
    points: &[Correspondence],
    lens: &Camera,
) -> bool {
    let (pose, covariance) = monitor.expected(reading.t_s);
    let weigh = || {
        let motion = (pose * reading.a_from_b.inverse()).log();
        let factor = (covariance + reading.covariance).cholesky()?;
        let noise = measured_variance(monitor);
        let expected =
            Expected { lens, cam_from_target: pose, information: covariance.cholesky()?.inverse(), noise };
        Some((motion.dot(&factor.solve(&motion)), expected))
    };
    match weigh() {
        Some((chi2, expected)) if disagreement.is_persistent() || UNLIKELY < chi2 => {
            disagreement.is_in(points, &expected, &reading.a_from_b)
        }
        _ => {
            disagreement.end();
            false
        }
    }
}

/// χ² of six numbers that one reading in a hundred exceeds: only then are its points tested.
const UNLIKELY: f64 = 16.8;
