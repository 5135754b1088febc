//! Where the camera is now, as its last readings alone say, and whether that is where it was.
//!
//! An error that the readings have not excluded may explain that a camera is not where it was; then nobody may say that it moved, and nobody
//! that it did not. It is steady only where it is nearer to its reference than the smallest motion that so many readings are promised to find.
//!
//! ```text
//!   ȳ_n  mean of the last n readings since the start, a gap or a motion, from the pose of the reference
//!   C    its covariance: of n readings, of the reference, of errors that last as far as they were known before
//! ```
//! Derivation: docs/math/monitor.md section 13, eqs. (92)–(94).

use super::axis::AXES;
use super::drift::{along, rotation_alone};
use super::gate::Passed;
use super::priors::{MotionKind, OUTLIER};
use super::{Drift, Monitor, MonitorConfig};
use crate::statistics::chi_square::tail;
use crate::temporal::snapshot::numbers;
use crate::{Matrix6, Vector6};
use nalgebra::{Matrix3, Vector3};

/// Where a camera is beside its reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deviation {
    /// Where frame a now is in its frame of the reference, `[rotation_rad; translation_m]`.
    pub old_from_new: Vector6,
    /// Its covariance: of the readings, of the reference, and of errors that are known to last.
    pub covariance: Matrix6,
    /// Readings that it is the mean of.
    pub readings: usize,
}

/// A length and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Radians or metres.
    pub value: f64,
    /// The same unit.
    pub sigma: f64,
}

impl Deviation {
    /// How far it is rotated (radians) and shifted (metres). Where chance explains the shift it is zero, and the rotation that of
    /// docs/math/monitor.md eq. (17): of a small target the two look alike, and the rotation is then known far better.
    pub fn sizes(&self) -> (Size, Option<Size>) {
        let part = |at: usize| -> Vector3<f64> { self.old_from_new.fixed_rows::<3>(at).into() };
        let block = |at: usize| -> Matrix3<f64> { self.covariance.fixed_view::<3, 3>(at, at).into() };
        let chi2 = block(3).cholesky().map(|factor| part(3).dot(&factor.solve(&part(3))));
        let alone = rotation_alone(&self.old_from_new, &self.covariance);
        match (chi2, alone) {
            (Some(chi2), Some((turn, covariance))) if SHIFTED < tail(3, chi2) => {
                (size(&turn, &covariance), None)
            }
            _ => (size(&part(0), &block(0)), Some(size(&part(3), &block(3)))),
        }
    }
}

/// The length of a vector, and its standard deviation along it.
fn size(of: &Vector3<f64>, covariance: &Matrix3<f64>) -> Size {
    let value = of.norm();
    let direction = if 0.0 < value { of / value } else { Vector3::x() };
    Size { value, sigma: direction.dot(&(covariance * direction)).max(0.0).sqrt() }
}

/// A shift that chance makes larger this seldom is one. It is looked at at every start: one in twenty would often be reported for a pan.
const SHIFTED: f64 = 1e-3;
/// Readings that the mean is of; older ones are forgotten.
const OVER: f64 = 60.0;
/// No reading is worth less, or more, typical ones than these: numbers stay numbers.
const LEAST_WORTH: f64 = 1e-6;
const MOST_WORTH: f64 = 1e6;
/// What so many readings show is promised beforehand: a motion that they show would seem to be noise, and make the promise larger.
const LOOKS: [f64; 9] = [1.0, 2.0, 3.0, 5.0, 8.0, 13.0, 21.0, 36.0, OVER];
/// While the camera is where it was that is computed again when there are so many times the readings.
const AGAIN: f64 = 1.5;

#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Whereabouts {
    /// Readings of the mean and how many typical ones they are worth, and readings since it began.
    readings: f64,
    worth: f64,
    since: f64,
    mean: Vector6,
    last_s: f64,
    /// Variances of a reading and of errors that last, whitened, as they were known when it was last sure to be where it was.
    white: Vector6,
    correlated: Vector6,
    /// The smallest motions that so many readings are promised to find, as that was then.
    promised: [Vector6; LOOKS.len()],
    sure_at: f64,
    is_away: bool,
}

impl Whereabouts {
    pub fn is_away(&self) -> bool {
        self.is_away
    }

    /// Whether anything was read.
    pub fn is_known(&self) -> bool {
        0.0 < self.readings
    }

    pub fn is_sound(&self) -> bool {
        (0.0..=OVER).contains(&self.readings) && (self.readings == 0.0 || 0.0 < self.worth)
    }

    /// Before the next reading, `between_s` after the one before it as a rule: whether what was read says nothing of where it is now.
    fn is_over(&self, t_s: f64, between_s: f64) -> bool {
        OVER * between_s < t_s - self.last_s || !self.is_known()
    }

    /// What was read says nothing of where it is.
    pub fn forget(&mut self) {
        (self.readings, self.since, self.worth, self.mean) = (0.0, 0.0, 0.0, Vector6::zeros());
        (self.sure_at, self.is_away) = (0.0, false);
    }

    fn push(&mut self, t_s: f64, motion: &Vector6, worth: f64) {
        self.last_s = t_s;
        let forgotten = if self.readings < OVER { 0.0 } else { self.worth / OVER };
        (self.readings, self.since) = ((self.readings + 1.0).min(OVER), self.since + 1.0);
        self.worth += worth - forgotten;
        self.mean += (motion - self.mean) * (worth / self.worth);
    }

    /// What so many readings as there are show.
    fn promise(&self) -> &Vector6 {
        let n = self.readings.min(self.worth);
        let look = LOOKS.iter().rposition(|look| *look <= n).unwrap_or(0);
        &self.promised[look]
    }
}

impl Monitor {
    /// Where the camera is now beside its reference, as its last readings alone say; none before the first, and where noise is not measured.
    pub fn deviation(&self) -> Option<Deviation> {
        let here = &self.whereabouts;
        if !(self.measures_noise() && here.is_known()) {
            return None;
        }
        let own = &self.reference.noise;
        let of_mean = self.test.spread(&(here.white / here.worth + here.correlated));
        let covariance = of_mean + own.reference + own.bias + own.diurnal;
        Some(Deviation { old_from_new: here.mean, covariance, readings: here.readings as usize })
    }

    /// It was at its reference for so many readings.
    pub(super) fn is_at_reference(&mut self, readings: usize) {
        self.whereabouts = Whereabouts {
            readings: OVER.min(readings as f64),
            worth: OVER.min(readings as f64),
            last_s: self.last_s,
            ..Whereabouts::default()
        };
        self.promise_anew();
    }

    /// What is known of errors, and promised, while the camera is where it was, and before readings come that may be of one elsewhere.
    fn promise_anew(&mut self) {
        let Some(measured) = self.test.measured() else { return };
        let scales = measured.scales().map(|scale| scale.max(1.0));
        let (white, correlated) =
            (scales.component_mul(self.test.typical()), measured.correlated_variances());
        let here = &mut self.whereabouts;
        (here.white, here.correlated, here.sure_at) = (white, correlated, here.since);
        for (look, n) in LOOKS.iter().enumerate() {
            self.whereabouts.promised[look] = self.shown_by(*n);
        }
    }

    /// The smallest motions that so many readings show, whatever errors are not excluded.
    fn shown_by(&self, readings: f64) -> Vector6 {
        let between_s = self.test.measured().map_or(1.0, |measured| measured.between_s());
        let promise = self.promise(readings * between_s, false);
        promise.map_or(Vector6::repeat(f64::MAX), |promise| {
            Vector6::from_iterator(promise.rotation_rad.into_iter().chain(promise.translation_m))
        })
    }

    /// Before the test reads what came at `t_s`: after a gap the camera may be elsewhere.
    pub(super) fn await_reading(&mut self, t_s: f64) {
        let Some(between_s) = self.test.measured().map(|measured| measured.between_s()) else { return };
        if self.whereabouts.is_over(t_s, between_s) {
            // What it knows from a time of doubt is of the motion too.
            if self.drift.is_none() && !self.whereabouts.is_away {
                self.promise_anew();
            }
            self.whereabouts.forget();
        }
    }

    /// A reading, from the pose of the reference.
    pub(super) fn locate(&mut self, joined: &Passed, motion: &Vector6) {
        if self.measures_noise() {
            // The upper median: of natural landmarks three coordinates are known, and three are not.
            let mut worth = self.test.typical().component_div(&joined.reading.variance);
            worth.as_mut_slice().sort_by(f64::total_cmp);
            self.whereabouts.push(joined.t_s, motion, worth[AXES / 2].clamp(LEAST_WORTH, MOST_WORTH));
        }
    }

    /// Whether it is where it was, as far as so many readings are promised to show it.
    pub(super) fn compare(&mut self) {
        if !self.measures_noise() {
            return;
        }
        self.whereabouts.is_away = self.drift.is_none() && self.is_beyond_promise();
        let here = &self.whereabouts;
        let is_sure = here.readings == OVER && self.drift.is_none() && !here.is_away;
        if is_sure && AGAIN * here.sure_at <= here.since {
            self.promise_anew();
        }
    }

    fn is_beyond_promise(&self) -> bool {
        let Some(Deviation { old_from_new, covariance, .. }) = self.deviation() else { return false };
        let Some(factor) = covariance.cholesky() else { return false };
        if old_from_new.dot(&factor.solve(&old_from_new)) < OUTLIER {
            return false;
        }
        let promised = self.whereabouts.promise();
        let is_beyond = |axis: usize| {
            along(&old_from_new, &covariance, axis)
                .is_some_and(|alone| promised[axis] < alone.size.abs() + alone.sigma)
        };
        (0..AXES).any(is_beyond) && matters(&old_from_new, &covariance, &self.config)
    }
}

/// Whether a deviation is beyond what is tolerated.
fn matters(old_from_new: &Vector6, covariance: &Matrix6, config: &MonitorConfig) -> bool {
    let (old_from_new, covariance, course) = (*old_from_new, *covariance, MotionKind::Step);
    let (began_s, began_sigma_s, course_probability, rate, again) = (0.0, 0.0, 1.0, None, None);
    let drift =
        Drift { old_from_new, covariance, began_s, began_sigma_s, course, course_probability, rate, again };
    drift.matters(config)
}

numbers!(Whereabouts { readings, worth, since, mean, last_s, white, correlated, promised, sure_at, is_away });
