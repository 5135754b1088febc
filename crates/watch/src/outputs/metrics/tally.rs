//! Counts and last values, for each camera and for each of its targets.

use super::histogram::Histogram;
use super::rate::Rate;
use crate::live::{CheckingReason, Event, Observation, State};
use crate::outputs::Session;
use crate::outputs::measured::measured;
use crate::outputs::outbox::Counted;
use resight::core::Matrix6;
use resight::core::locate::choose::Ambiguity;
use resight::core::locate::consistency::Consistency;
use resight::core::temporal::monitor::Reference;
use resight::core::temporal::track::Tracked;
use std::sync::Arc;
use std::time::Instant;

/// Degrees of freedom of the innovation of a pose.
const DEGREES_OF_FREEDOM: f64 = 6.0;

/// The counts of a whole session.
#[derive(Clone)]
pub struct Tally {
    /// One entry for each camera.
    pub cameras: Vec<CameraTally>,
    /// One entry for each camera and target, camera by camera.
    pub pairs: Vec<PairTally>,
    /// Cameras and targets that moved relative to the others, according to the last report.
    pub moved: Vec<String>,
    /// Number of false alarms allowed per day.
    pub false_alarms_per_day: f64,
    /// Outputs that count their deliveries.
    pub counted: Vec<(&'static str, Arc<dyn Counted>)>,
    started: Instant,
    n_targets: usize,
}

/// The counts of a camera.
#[derive(Debug, Clone, Default)]
pub struct CameraTally {
    /// Its name.
    pub name: String,
    /// Frames dropped because its queue was full.
    pub dropped: u64,
    /// Frames that its source could not use.
    pub left_out: u64,
    /// Number of times that its clock was set.
    pub clock_steps: u64,
    /// Whether its source provides frames.
    pub connected: bool,
    /// Number of times that its source was lost.
    pub losses: u64,
}

/// The counts of a camera and a target.
#[derive(Debug, Clone, Default)]
pub struct PairTally {
    /// The camera's name.
    pub camera: String,
    /// The target's name.
    pub target: String,
    /// Number of frames processed, of those with a pose, and of those that could not be read.
    pub frames: u64,
    pub with_pose: u64,
    pub unreadable: u64,
    /// The present state; none before the first frame.
    pub state: Option<State>,
    /// Number of alarms.
    pub alarms: u64,
    /// Number of motions while its reference was learned.
    pub moved_while_learning: u64,
    /// Values of the last frame.
    pub last: Last,
    /// Durations of waiting, detecting, solving and deciding.
    pub stages: [Histogram; 4],
    /// The reference with which it is compared.
    reference: Option<Reference>,
    last_usable: Option<Instant>,
    rate: Rate,
}

/// Values of the last frame.
#[derive(Debug, Clone, Default)]
pub struct Last {
    /// Number of points found.
    pub n_points: usize,
    /// Root mean square reprojection error, px, of the pose that tracking selected.
    pub rms_px: Option<f64>,
    /// χ² of its pose against the tracked one, over its degrees of freedom.
    pub innovation_ratio: Option<f64>,
    /// Deviation of the tracked pose from the reference.
    pub deviation: Option<Deviation>,
    /// The faults of the frame.
    pub troubles: Troubles,
}

/// Rotation and translation against the reference, each with its standard deviation along its own direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    pub rotation_rad: f64,
    pub rotation_sigma_rad: f64,
    pub translation_m: f64,
    pub translation_sigma_m: f64,
}

/// The faults of a frame, by name.
pub type Troubles = [(&'static str, bool); 6];

const NO_TROUBLES: Troubles = [
    ("unreadable", false),
    ("not_found", false),
    ("no_pose", false),
    ("ambiguous", false),
    ("inconsistent", false),
    ("outlier", false),
];

impl Tally {
    pub fn new(session: &Session<'_>, counted: Vec<(&'static str, Arc<dyn Counted>)>) -> Self {
        let names = session.names;
        let camera = |name: &String| CameraTally { name: name.clone(), ..CameraTally::default() };
        let n_targets = names.targets.len();
        let pair = |i: usize| PairTally {
            camera: names.camera(i / n_targets).to_string(),
            target: names.target(i % n_targets).to_string(),
            reference: session.references.get(i).copied().flatten(),
            last: Last { troubles: NO_TROUBLES, ..Last::default() },
            ..PairTally::default()
        };
        Tally {
            cameras: names.cameras.iter().map(camera).collect(),
            pairs: (0..names.cameras.len() * n_targets).map(pair).collect(),
            moved: Vec::new(),
            false_alarms_per_day: session.false_alarms_per_day,
            counted,
            started: Instant::now(),
            n_targets,
        }
    }

    /// Processes the next event.
    pub fn take(&mut self, event: &Event) {
        match event {
            Event::Observed { camera, target, observation } => {
                let second = self.started.elapsed().as_secs();
                // Frames that waited in a queue come after the loss of their source; only its return is reported.
                self.camera(*camera, |camera| camera.connected |= camera.losses == 0);
                self.pair(*camera, *target, |pair| pair.observe(observation, second));
            }
            Event::StateChanged { camera, target, state, .. } => {
                self.pair(*camera, *target, |pair| pair.change(state));
            }
            Event::Compared { .. } | Event::Promised { .. } | Event::Oriented { .. } => {}
            Event::Learned { camera, target, reference, .. } => {
                self.pair(*camera, *target, |pair| pair.reference = Some(**reference));
            }
            Event::MovedWhileLearning { camera, target, .. } => {
                self.pair(*camera, *target, |pair| pair.moved_while_learning += 1);
            }
            Event::Dropped { camera, frames } => self.camera(*camera, |camera| camera.dropped += frames),
            Event::LeftOut { camera, frames, .. } => self.camera(*camera, |camera| camera.left_out += frames),
            Event::Clock { camera, .. } => self.camera(*camera, |camera| camera.clock_steps += 1),
            Event::Source { camera, connected, .. } => self.camera(*camera, |camera| {
                camera.connected = *connected;
                camera.losses += u64::from(!connected);
            }),
            Event::Ended { camera } => self.camera(*camera, |camera| camera.connected = false),
            Event::Attributed { moved, .. } => {
                self.moved = moved.iter().map(|(name, _)| name.clone()).collect();
            }
        }
    }

    /// Returns whether every source provides frames and every camera is at its reference pose, or still to be compared with it.
    pub fn is_well(&self) -> bool {
        let is_well = |pair: &PairTally| match &pair.state {
            Some(State::Checking(reason)) => !matches!(reason, CheckingReason::Away(_)),
            state => matches!(state, Some(State::Steady | State::Learning { .. } | State::Tracking)),
        };
        self.cameras.iter().all(|camera| camera.connected) && self.pairs.iter().all(is_well)
    }

    /// Returns the time since the last usable reading of a pair, or since the start, seconds.
    pub fn unobserved_s(&self, pair: &PairTally) -> f64 {
        pair.last_usable.unwrap_or(self.started).elapsed().as_secs_f64()
    }

    /// Returns the frame rate of a pair, over the last ten whole seconds.
    pub fn rate_hz(&self, pair: &PairTally) -> f64 {
        pair.rate.hz(self.started.elapsed().as_secs())
    }

    fn camera(&mut self, camera: usize, change: impl FnOnce(&mut CameraTally)) {
        if let Some(camera) = self.cameras.get_mut(camera) {
            change(camera);
        }
    }

    fn pair(&mut self, camera: usize, target: usize, change: impl FnOnce(&mut PairTally)) {
        if let Some(pair) = self.pairs.get_mut(camera * self.n_targets + target) {
            change(pair);
        }
    }
}

impl PairTally {
    fn observe(&mut self, observation: &Observation, second: u64) {
        self.frames += 1;
        self.with_pose += u64::from(observation.estimate.is_some());
        self.unreadable += u64::from(!observation.is_readable);
        self.rate.count(second);
        if observation.reading.is_some_and(|reading| reading.is_consistent) {
            self.last_usable = Some(Instant::now());
        }
        let times = &observation.times;
        // A stage that a frame did not reach took no time and does not count.
        let came = [true, observation.is_readable, 0 < observation.n_points, observation.estimate.is_some()];
        let took_us = [times.waited_us, times.detect_us, times.solve_us, times.decide_us];
        for ((stage, took_us), came) in self.stages.iter_mut().zip(took_us).zip(came) {
            if came {
                stage.add(1e-6 * took_us);
            }
        }
        self.last = last(observation, self.reference.as_ref());
    }

    fn change(&mut self, state: &State) {
        let is_new = match (&self.state, state) {
            (Some(State::Drifted(before)), State::Drifted(now)) => before.began_s != now.began_s,
            (_, state) => matches!(state, State::Drifted(_)),
        };
        self.alarms += u64::from(is_new);
        self.state = Some(state.clone());
    }
}

fn last(observation: &Observation, reference: Option<&Reference>) -> Last {
    let estimate = observation.estimate.as_ref();
    // A tracked pose to which this frame did not contribute shows nothing of this frame.
    let tracked = estimate.and(observation.tracked.as_ref());
    let is = |test: fn(&resight::core::locate::PoseEstimate) -> bool| estimate.is_some_and(test);
    let troubles = [
        !observation.is_readable,
        observation.is_readable && observation.n_points == 0,
        0 < observation.n_points && estimate.is_none(),
        is(|estimate| matches!(estimate.ambiguity, Ambiguity::Ambiguous { .. })),
        is(|estimate| matches!(estimate.consistency, Consistency::Inconsistent { .. })),
        tracked.is_some_and(|tracked| tracked.candidate.is_none()),
    ];
    let mut named = NO_TROUBLES;
    named.iter_mut().zip(troubles).for_each(|(named, is)| named.1 = is);
    Last {
        n_points: observation.n_points,
        rms_px: measured(observation).map(|measured| measured.rms_px),
        innovation_ratio: tracked.and_then(|t| t.innovation_chi2).map(|chi2| chi2 / DEGREES_OF_FREEDOM),
        deviation: tracked.zip(reference).map(|(tracked, reference)| deviation(tracked, reference)),
        troubles: named,
    }
}

/// Returns the deviation; correlated errors and the diurnal variation are no drift but part of the standard deviations.
fn deviation(tracked: &Tracked, reference: &Reference) -> Deviation {
    let motion = (reference.a_from_b * tracked.cam_from_target.inverse()).log();
    let noise = &reference.noise;
    let covariance: Matrix6 = tracked.covariance + noise.reference + noise.bias + noise.diurnal;
    let part = |at: usize| {
        let part = motion.fixed_rows::<3>(at);
        let block = covariance.fixed_view::<3, 3>(at, at);
        let length = part.norm();
        // Without a direction: that of the largest error.
        let variance = match 0.0 < length {
            true => part.dot(&(block * part)) / (length * length),
            false => block.diagonal().max(),
        };
        (length, variance.max(0.0).sqrt())
    };
    let ((rotation_rad, rotation_sigma_rad), (translation_m, translation_sigma_m)) = (part(0), part(3));
    Deviation { rotation_rad, rotation_sigma_rad, translation_m, translation_sigma_m }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Log;
    use crate::names::Names;
    use resight::core::temporal::monitor::DriftNoise;
    use resight::core::{Pose, Vector6};

    /// Returns a session of one camera and one target.
    fn tally() -> Tally {
        let names = Names::new(&["gate=a".to_string()], &["door=b".to_string()]);
        let (log, stop) = (Log::default(), Arc::default());
        let session = Session {
            names: &names,
            references: vec![None],
            false_alarms_per_day: 1.0,
            log: &log,
            stop: &stop,
            is_once: true,
        };
        Tally::new(&session, Vec::new())
    }

    /// Frames that waited when their source was lost are processed later; they do not mark the source as back.
    #[test]
    fn a_lost_source_is_down_until_it_is_back() {
        let mut tally = tally();
        let up = |tally: &Tally| {
            let page = super::super::exposition::page(tally);
            let sample = "resight_source_up{camera=\"gate\"} ";
            page.lines().find_map(|line| line.strip_prefix(sample)).map(str::to_string).expect("a sample")
        };
        let frame = Event::Observed { camera: 0, target: 0, observation: Box::default() };
        let source = |connected| Event::Source { camera: 0, connected, reason: None };
        for (event, wanted) in [
            (&source(false), "0"),
            (&frame, "0"),
            (&source(true), "1"),
            (&frame, "1"),
            (&source(false), "0"),
            (&frame, "0"),
        ] {
            tally.take(event);
            assert_eq!(up(&tally), wanted, "after {event:?}");
        }
        let mut fresh = self::tally();
        assert_eq!(up(&fresh), "0");
        fresh.take(&frame);
        assert_eq!(up(&fresh), "1");
    }

    #[test]
    fn a_deviation_has_its_length_and_its_error_along_itself() {
        let spread = Matrix6::from_diagonal(&Vector6::new(4e-6, 1e-6, 1e-6, 1e-4, 4e-4, 1e-4));
        let none = Matrix6::zeros();
        let noise =
            DriftNoise { reference: none, reading: none, bias: none, bias_time_s: 60.0, diurnal: none };
        let reference = Reference { a_from_b: Pose::exp(&Vector6::new(0.1, 0.2, 0.3, 1.0, 2.0, 3.0)), noise };
        // The present pose of the camera in its own old frame: rotated about x, translated along y.
        let old_from_new = Pose {
            translation: [0.0, 0.04, 0.0].into(),
            ..Pose::exp(&Vector6::new(0.02, 0.0, 0.0, 0.0, 0.0, 0.0))
        };
        let tracked = Tracked {
            t_s: 0.0,
            cam_from_target: old_from_new.inverse() * reference.a_from_b,
            covariance: spread,
            velocity: Vector6::zeros(),
            probability: 1.0,
            innovation_chi2: None,
            candidate: None,
        };
        let reported = deviation(&tracked, &reference);
        assert!(
            (reported.rotation_rad - 0.02).abs() < 1e-12
                && (reported.rotation_sigma_rad - 2e-3).abs() < 1e-12,
            "{reported:?}"
        );
        assert!(
            (reported.translation_m - 0.04).abs() < 1e-5
                && (reported.translation_sigma_m - 0.02).abs() < 1e-4,
            "{reported:?}"
        );
    }
}
