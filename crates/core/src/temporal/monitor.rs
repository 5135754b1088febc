//! The change detector of one relative pose: of a camera and a target, or of two cameras that observe the same target.
//!
//! A sequential test with a stated rate of false alarms compares the stream with its reference; correlated errors and the diurnal variation are
//! part of the model. Without readings it never reports "steady". `attribute` finds which of several cameras and targets moved.
//! Time enters as data. Derivation: docs/math/monitor.md.
//!
//! ```text
//!   y = Log(a_from_b of the reference · (a_from_b now)⁻¹)    small motion of frame a: where it is now, in its own old frame
//! ```

mod log_sum;
mod axis;
mod priors;
mod transients;
mod regimes;
mod models;
mod bank;
mod promise;
mod measured;
mod onsets;
mod test;
mod gate;
mod contradictions;
mod drift;
mod milestones;
mod scatter;
mod trace;
mod again;
mod aftermath;
mod place;
mod unsettled;
mod wander;
mod whereabouts;
pub mod learn;
pub mod attribute;
pub mod rig;

pub use drift::{Again, Alone, Drift, Rate, along, rotation_alone};
pub use place::{PointErrors, covariance_by_image};
pub use priors::MotionKind;
pub use promise::{CorrelatedError, Detectable, MeasuredNoise, Recurrence, Unpromised};
pub use test::DriftNoise;
pub use unsettled::{FALSE_ALARM_PROBABILITY, Unrest, Unsettled};
pub use whereabouts::{Deviation, Size};

use crate::covariance::is_covariance;
use crate::temporal::snapshot::{Snapshot, numbers};
use crate::{Error, Matrix6, Pose, Vector6};
use aftermath::Aftermath;
use again::Motions;
use contradictions::Contradictions;
use gate::Gate;
use log_sum::{LogSum, Scaled};
use milestones::Milestone;
use place::Places;
use priors::CONFIRM;
use promise::Promise;
use regimes::Regimes;
use test::DriftTest;
use transients::Transients;
use wander::Wander;
use whereabouts::Whereabouts;

/// Settings: the rate of false alarms, the decision period, the tolerances.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MonitorConfig {
    /// Largest mean number of alarms a day while nothing moves.
    pub false_alarms_per_day: f64,
    /// Readings within this time are joined to one decision, seconds.
    pub decision_period_s: f64,
    /// Time without a usable reading after which the state is stale, seconds.
    pub stale_after_s: f64,
    /// Rotations up to this raise no alarm, radians.
    pub tolerance_rotation_rad: f64,
    /// Translations up to this raise no alarm, metres; one that chance explains counts as none.
    pub tolerance_translation_m: f64,
}

impl Default for MonitorConfig {
    fn default() -> Self {
        MonitorConfig {
            false_alarms_per_day: 1.0 / 30.0,
            decision_period_s: 0.2,
            stale_after_s: 5.0,
            tolerance_rotation_rad: 0.0,
            tolerance_translation_m: 0.0,
        }
    }
}

impl MonitorConfig {
    /// # Errors
    /// `InvalidSetting` for a rate, period or time that is not positive, or a tolerance below zero.
    pub fn check(&self) -> Result<(), Error> {
        check(self)
    }
}

/// The reference that readings are compared with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reference {
    /// x_in_a = a_from_b · x_in_b at the time of the reference.
    pub a_from_b: Pose,
    /// The errors that are no drift; `noise.reference` is this pose's own covariance.
    pub noise: DriftNoise,
}

/// One estimate of the pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// When the image was taken, seconds.
    pub t_s: f64,
    /// The pose.
    pub a_from_b: Pose,
    /// Its 6×6 covariance, left motion in frame a.
    pub covariance: Matrix6,
    /// Whether residuals agree with the stated noise; a reading that contradicts itself is not used.
    pub is_consistent: bool,
}

/// The state that the monitor reports.
#[allow(clippy::large_enum_variant)] // handed out one at a time, never stored in numbers
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Watch {
    /// Observed where it was.
    Steady,
    /// No usable reading.
    Stale {
        /// Since when, seconds.
        for_s: f64,
    },
    /// Something is different, but not yet often enough to be more than a wrong reading; or nothing was read yet.
    Checking,
    /// It is not where it was, by more than the session promises to find, though errors that are not excluded would explain it.
    Away(Deviation),
    /// Errors are correlated for longer, or are larger, than was learned, and explain what was found.
    CorrelatedErrors,
    /// It moved.
    Drifted(Drift),
    /// Observed, but the readings contradict themselves: intrinsics or target are wrong.
    Inconsistent,
}

/// The change detector of one relative pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Monitor {
    reference: Reference,
    config: MonitorConfig,
    /// The pose of frame a since the last change, in its frame of the reference.
    old_from_level: Pose,
    test: DriftTest,
    gate: Gate,
    drift: Option<Drift>,
    /// Time until which a drift is not reported, because it may come back as others did.
    held_until_s: Option<f64>,
    transients: Transients,
    regimes: Regimes,
    wander: Wander,
    aftermath: Aftermath,
    motions: Motions,
    places: Places,
    whereabouts: Whereabouts,
    last_s: f64,
    last_usable_s: f64,
    contradictions: Contradictions,
    /// Readings left out: outliers that nothing confirmed.
    pub outliers: u64,
    /// Readings left out because their time is before that of the last one.
    pub out_of_order: u64,
}

/// Of `snapshot`: raised when a field, or the meaning of one, changes.
const SNAPSHOT_VERSION: u32 = 8;

impl Monitor {
    /// Starts at `t_s`, seconds, of the same clock as the readings.
    ///
    /// # Errors
    /// `InvalidSetting` for a rate, period or time that is not positive, a tolerance below zero, or noise that is none.
    pub fn new(reference: &Reference, config: &MonitorConfig, t_s: f64) -> Result<Self, Error> {
        check(config)?;
        reference.check()?;
        let test = DriftTest::new(&reference.noise).ok_or(NOT_POSITIVE)?;
        let covariance = reference.noise.reference;
        let start = Milestone { t_s, motion: Vector6::zeros(), covariance, over_s: 0.0 };
        Ok(Monitor {
            reference: *reference,
            config: *config,
            old_from_level: Pose::identity(),
            gate: Gate::new(config.decision_period_s),
            test,
            drift: None,
            held_until_s: None,
            transients: Transients::default(),
            regimes: Regimes::default(),
            wander: Wander::default(),
            aftermath: Aftermath::new(start),
            motions: Motions::none(start),
            places: Places::default(),
            whereabouts: Whereabouts::default(),
            last_s: t_s,
            last_usable_s: t_s,
            contradictions: Contradictions::none(),
            outliers: 0,
            out_of_order: 0,
        })
    }

    /// Processes a reading and returns the new state.
    pub fn push(&mut self, reading: &Reading) -> Watch {
        if !self.accepts(reading) {
            return self.watch(self.last_s);
        }
        self.last_s = reading.t_s;
        self.contradictions.push(!reading.is_consistent, self.log_threshold());
        if reading.is_consistent {
            self.last_usable_s = reading.t_s;
            self.scatters(reading);
            let whitened = self.test.whitened(&self.motion(reading), &reading.covariance);
            let (passed, dropped) = self.gate.push(&self.test, reading.t_s, &whitened);
            self.outliers += dropped;
            self.decide(&passed);
            if self.drift.is_none() {
                self.test.note_change();
            }
        }
        self.watch(reading.t_s)
    }

    /// Returns the state at `t_s` without a new reading.
    pub fn watch(&self, t_s: f64) -> Watch {
        let for_s = t_s - self.last_usable_s;
        match self.drift {
            // Contradictions of long ago say nothing of now.
            _ if self.config.stale_after_s < t_s - self.last_s => Watch::Stale { for_s },
            _ if self.contradictions.are_reported() => Watch::Inconsistent,
            // They come, and none could be used of late. A single one of a slow source says nothing.
            _ if self.config.stale_after_s < for_s && CONFIRM as f64 <= self.contradictions.run() => {
                Watch::Checking
            }
            Some(_) if self.is_held(t_s) => Watch::Checking,
            Some(drift) => Watch::Drifted(self.refined(&drift)),
            None if self.gate.is_waiting() => Watch::Checking,
            None if self.aftermath.is_doubted(t_s) => Watch::CorrelatedErrors,
            None if self.whereabouts.is_away() => self.deviation().map_or(Watch::Checking, Watch::Away),
            None if self.measures_noise() && !self.whereabouts.is_known() => Watch::Checking,
            None => Watch::Steady,
        }
    }

    /// Returns the drift decided last, also without readings.
    pub fn drift(&self) -> Option<Drift> {
        self.drift.filter(|_| !self.is_held(self.last_s)).map(|drift| self.refined(&drift))
    }

    /// Longer where what it has come to cannot be distinguished from nothing.
    fn is_held(&self, t_s: f64) -> bool {
        let is_nothing = |drift: &Drift| {
            let now = self.by_models(drift);
            is_likely(&now.old_from_new, &now.covariance)
        };
        self.held_until_s.is_some_and(|until_s| t_s < until_s || self.drift.as_ref().is_some_and(is_nothing))
    }

    /// Returns the time of the last usable reading, seconds.
    pub fn last_usable_s(&self) -> f64 {
        self.last_usable_s
    }

    /// Accepts the drift: the present pose becomes the reference.
    pub fn accept(&mut self) -> Result<(), Error> {
        let (motion, covariance) = self.test.level();
        let now = (self.old_from_level * Pose::exp(&motion)).inverse() * self.reference.a_from_b;
        let reference =
            Reference { a_from_b: now, noise: DriftNoise { reference: covariance, ..self.reference.noise } };
        let test = self.test.accepted(&reference.noise).ok_or(NOT_POSITIVE)?;
        self.wander.accept();
        *self = Monitor {
            last_usable_s: self.last_usable_s,
            transients: self.transients,
            regimes: self.regimes.clone(),
            wander: self.wander.clone(),
            places: self.places,
            test,
            ..Monitor::new(&reference, &self.config, self.last_s)?
        };
        self.is_at_reference(1);
        Ok(())
    }

    /// Returns the predicted pose of a reading at `t_s` and its covariance, correlated errors included; a reading's own noise is
    /// added to it.
    pub fn expected(&self, t_s: f64) -> (Pose, Matrix6) {
        let (motion, covariance) = self.test.expected(t_s);
        let old_from_new = self.old_from_level * Pose::exp(&motion);
        (old_from_new.inverse() * self.reference.a_from_b, covariance)
    }

    /// Switches to measured noise: its scale and correlation are estimated from these readings of a camera that stayed (those that the
    /// reference was learned from, in order of time) and from all that follow. The estimate begins with the noise of the reference, and an
    /// error stated there stays possible, as every error does until the readings exclude it: docs/math/monitor.md section 9.
    pub fn measure_noise(&mut self, readings: &[Reading]) {
        let usable = readings.iter().filter(|reading| reading.is_consistent && is_numbers(reading));
        let whitened =
            |reading: &Reading| (reading.t_s, self.test.whitened(&self.motion(reading), &reading.covariance));
        let learned: Vec<_> = usable.map(whitened).collect();
        self.test.measure(&learned);
        readings.iter().for_each(|reading| self.scatters(reading));
        self.is_at_reference(learned.len());
    }

    /// Returns whether noise is measured.
    pub fn measures_noise(&self) -> bool {
        self.test.measured().is_some()
    }

    /// Returns the whole state, from which `restore` continues to the same bits.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot::of(self, SNAPSHOT_VERSION)
    }

    /// Continues from a snapshot of this version. The time in between counts: the state may be stale, and errors have had time to change.
    ///
    /// # Errors
    /// `SnapshotVersion`, `SnapshotNumbers` for numbers that are no monitor's, `InvalidSetting` as `new`.
    pub fn restore(snapshot: &Snapshot) -> Result<Self, Error> {
        let monitor = snapshot.state::<Monitor>(SNAPSHOT_VERSION)?;
        check(&monitor.config)?;
        monitor.reference.check()?;
        if !(monitor.test.is_sound()
            && monitor.aftermath.is_sound()
            && monitor.motions.is_sound()
            && monitor.whereabouts.is_sound()
            && monitor.wander.is_sound()
            && monitor.contradictions.is_sound())
        {
            return Err(Error::SnapshotNumbers { seen: snapshot.numbers.len(), unread: 0 });
        }
        Ok(monitor)
    }

    /// Returns the reference.
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// Time of the last reading, or of the start, seconds.
    pub fn last_s(&self) -> f64 {
        self.last_s
    }

    /// Threshold of ln R; R is the number of decisions between two false alarms.
    fn log_threshold(&self) -> f64 {
        (axis::DAY_S / (self.config.decision_period_s * self.config.false_alarms_per_day)).ln()
    }

    fn accepts(&mut self, reading: &Reading) -> bool {
        let is_late = reading.t_s < self.last_s;
        self.out_of_order += u64::from(is_late);
        is_numbers(reading) && !is_late
    }

    /// y, from where it has been since the last change.
    fn motion(&self, reading: &Reading) -> Vector6 {
        let old_from_new = self.reference.a_from_b * reading.a_from_b.inverse();
        (self.old_from_level.inverse() * old_from_new).log()
    }
}

impl Monitor {
    /// The noise as the readings show it; none where it is taken as stated.
    pub fn measured_noise(&self) -> Option<MeasuredNoise> {
        self.test.measured().map(|measured| measured.noise())
    }

    /// The smallest sudden motions that are found within a time, at least three readings long, nine times in ten: while correlated errors are
    /// not excluded by what has been read, only motions that stand out from them can be promised. None where noise is not measured.
    pub fn detectable(&self, within_s: f64) -> Option<Detectable> {
        let promised = self.promise(within_s, true)?;
        let Some(held) = self.recurrence().filter(|held| within_s < held.held_s) else {
            return Some(promised);
        };
        let larger = |a: [f64; 3], b: [f64; 3]| std::array::from_fn(|i| f64::max(a[i], b[i]));
        Some(Detectable {
            within_s,
            rotation_rad: larger(promised.rotation_rad, held.rotation_rad),
            translation_m: larger(promised.translation_m, held.translation_m),
        })
    }

    /// Where motions came back by themselves more often than the promised rate of false alarms explains: no rate can be promised for those that are
    /// no larger, and they are held.
    pub fn recurrence(&self) -> Option<Recurrence> {
        let known = self.transients.known(self.last_s)?;
        let information = self.reference.noise.reading.cholesky()?.inverse();
        let size = |axis: usize| (known.largest / information[(axis, axis)]).sqrt();
        Some(Recurrence {
            count: known.count,
            held_s: known.held_s,
            rotation_rad: std::array::from_fn(size),
            translation_m: std::array::from_fn(|i| size(3 + i)),
        })
    }

    /// The errors for which no rate of false alarms is promised: what the readings have not shown yet, and disturbances that they show. Empty where
    /// noise is not measured.
    pub fn unpromised(&self) -> Vec<Unpromised> {
        let Some(measured) = self.test.measured() else { return Vec::new() };
        let (watched_s, share) = (measured.watched_s(), self.contradictions.share());
        let count = self.transients.count(self.last_s);
        let all = [
            (watched_s < axis::DAY_S, Unpromised::UnwatchedHours { watched_s }),
            (0 < count, Unpromised::Returning { count }),
            (promise::MANY < share, Unpromised::Contradictions { share }),
            (measured.has_changed(), Unpromised::ChangedErrors),
        ];
        all.into_iter().filter_map(|(is_so, what)| is_so.then_some(what)).collect()
    }

    /// The same as `detectable`; errors that are excluded, or presumed to be none, count only where they `are_counted`.
    fn promise(&self, within_s: f64, are_counted: bool) -> Option<Detectable> {
        let (threshold, period_s) =
            (self.log_threshold() + onsets::log_cost(), self.config.decision_period_s);
        self.test.detectable(&Promise { within_s, log_threshold: threshold, period_s, are_counted })
    }
}

/// Whether a reading has a time, a pose and a covariance that is one.
fn is_numbers(reading: &Reading) -> bool {
    let pose = &reading.a_from_b;
    let numbers = pose.rotation.iter().chain(pose.translation.iter()).chain(reading.covariance.iter());
    let is_finite = reading.t_s.is_finite() && numbers.into_iter().all(|x| x.is_finite());
    is_finite && reading.covariance.amax() <= test::MOST_VARIANCE && is_covariance(&reading.covariance)
}

/// Whether a motion can be an error of this covariance.
fn is_likely(motion: &Vector6, covariance: &Matrix6) -> bool {
    let chi2 = covariance.cholesky().map(|factor| motion.dot(&factor.solve(motion)));
    chi2.is_some_and(|chi2| RETURN_PROBABILITY < crate::statistics::chi_square::tail(6, chi2))
}

/// From one small motion to another.
fn between(from: &Vector6, to: &Vector6) -> Vector6 {
    (Pose::exp(from).inverse() * Pose::exp(to)).log()
}

/// Probability of χ² below which a level counts as different from the reference.
const RETURN_PROBABILITY: f64 = 0.01;

const NOT_POSITIVE: Error = Error::InvalidSetting {
    setting: "covariance of a reading and its bias",
    seen: 0.0,
    needed: "it must be positive definite; state how well a single reading is known",
};

impl Reference {
    /// # Errors
    /// `InvalidSetting` for numbers that are none, a variance below zero, or a bias that is forgotten in no time.
    pub fn check(&self) -> Result<(), Error> {
        let pose = self.a_from_b.rotation.iter().chain(self.a_from_b.translation.iter());
        if let Some(seen) = pose.copied().find(|x| !x.is_finite()) {
            let (setting, needed) = ("pose of a reference", "it must hold finite numbers");
            return Err(Error::InvalidSetting { setting, seen, needed });
        }
        self.noise.check()
    }
}

fn check(config: &MonitorConfig) -> Result<(), Error> {
    let positive = [
        ("false_alarms_per_day", config.false_alarms_per_day),
        ("decision_period_s", config.decision_period_s),
        ("stale_after_s", config.stale_after_s),
    ];
    for (setting, seen) in positive {
        if !(seen.is_finite() && 0.0 < seen) {
            return Err(Error::InvalidSetting { setting, seen, needed: "it must be a positive number" });
        }
    }
    let tolerances = [
        ("tolerance_rotation_rad", config.tolerance_rotation_rad),
        ("tolerance_translation_m", config.tolerance_translation_m),
    ];
    for (setting, seen) in tolerances {
        if !(seen.is_finite() && 0.0 <= seen) {
            let needed = "it must be a number, and not below zero";
            return Err(Error::InvalidSetting { setting, seen, needed });
        }
    }
    Ok(())
}

numbers!(Monitor {
    reference,
    config,
    old_from_level,
    test,
    gate,
    drift,
    held_until_s,
    transients,
    regimes,
    wander,
    aftermath,
    last_s,
    last_usable_s,
    contradictions,
    outliers,
    out_of_order,
    motions,
    places,
    whereabouts,
});
numbers!(MonitorConfig {
    false_alarms_per_day,
    decision_period_s,
    stale_after_s,
    tolerance_rotation_rad,
    tolerance_translation_m,
});
numbers!(Reference { a_from_b, noise });
