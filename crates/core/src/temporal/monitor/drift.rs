//! The size of a motion, whether it is a rotation alone, and whether it exceeds the tolerances.

use super::{MonitorConfig, MotionKind};
use crate::statistics::chi_square::tail;
use crate::temporal::snapshot::{Numbers, Rest, numbers};
use crate::{Matrix6, Vector6};
use nalgebra::{Matrix3, Vector3};

/// A motion from the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// The pose of frame a in its own old frame, `[rotation_rad; translation_m]`; about camera axes x right, y down, z forward. All motions
    /// together.
    pub old_from_new: Vector6,
    /// Its covariance.
    pub covariance: Matrix6,
    /// When the last motion began, seconds.
    pub began_s: f64,
    /// Its standard deviation, seconds: at least the interval between the readings before and after, docs/math/monitor.md eq. (80).
    pub began_sigma_s: f64,
    /// A step or a ramp.
    pub course: MotionKind,
    /// Probability of that course.
    pub course_probability: f64,
    /// The rate of a slow drift, when it is known well enough.
    pub rate: Option<Rate>,
    /// The last motion, where it is not the first.
    pub again: Option<Again>,
}

/// A motion of a camera that had moved before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Again {
    /// Its number; the second motion is 2.
    pub number: u32,
    /// When the first one began, seconds.
    pub first_began_s: f64,
    /// This motion alone: where frame a is in its frame after the motion before, `[rotation_rad; translation_m]`.
    pub old_from_new: Vector6,
    /// Its covariance.
    pub covariance: Matrix6,
}

/// A motion about or along one axis of the camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alone {
    /// Of `[rotation_rad; translation_m]`.
    pub axis: usize,
    /// Radians or metres.
    pub size: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// The rate of a drift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rate {
    /// `[rotation_rad; translation_m]` a second, in its own old frame.
    pub per_s: Vector6,
    /// Its covariance.
    pub covariance: Matrix6,
}

impl Drift {
    /// The last motion alone: what has been reported before it is left out.
    pub fn last(&self) -> Drift {
        match self.again {
            Some(Again { old_from_new, covariance, .. }) => {
                Drift { old_from_new, covariance, again: None, ..*self }
            }
            None => *self,
        }
    }

    /// When the first of its motions began, seconds.
    pub fn first_began_s(&self) -> f64 {
        self.again.map_or(self.began_s, |again| again.first_began_s)
    }

    /// The rotation alone, radians about x, y, z, and its covariance, if the camera only rotated about its own centre; none where its
    /// translation is larger than that allows (one in a hundred). A rotation and a shift look much alike from a small target: where a
    /// mounted camera rotated, this is known far better than the six coordinates, docs/math/monitor.md eq. (17).
    pub fn pure_rotation(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let is_likely = PURE_ROTATION_PROBABILITY < self.chance_of(3)?;
        if is_likely { rotation_alone(&self.old_from_new, &self.covariance) } else { None }
    }

    /// Returns the one axis whose motion alone explains all of it; none where the rest is larger than chance makes it, where another axis
    /// explains it about as well, or where the motion does not exceed its own error. Given that the other five are zero this one is known
    /// far better than among six: docs/math/monitor.md eq. (49).
    pub fn alone(&self) -> Option<Alone> {
        let weight = self.covariance.cholesky()?.inverse();
        let score = weight * self.old_from_new;
        let explained = |axis: usize| score[axis] * score[axis] / weight[(axis, axis)];
        let all = self.old_from_new.dot(&score);
        let axis = (0..6).max_by(|a, b| explained(*a).total_cmp(&explained(*b)))?;
        let is_rivalled = (0..6).any(|other| other != axis && explained(axis) < explained(other) + RIVALLED);
        let is_left = tail(5, all - explained(axis)) < PURE_ROTATION_PROBABILITY;
        if is_rivalled || is_left || explained(axis) < RIVALLED {
            return None;
        }
        along(&self.old_from_new, &self.covariance, axis)
    }

    /// Returns whether it exceeds the tolerances of the configuration. A rotation and a shift look much alike, and neither estimate is ever zero:
    /// a shift that chance explains counts for none, and the rotation is then judged alone; as is a shift beside a rotation that chance explains.
    pub(super) fn matters(&self, config: &MonitorConfig) -> bool {
        let (turn, shift) = (self.part(0), self.part(3));
        let is_chance = |at| self.chance_of(at).is_some_and(|chance| CHANCE < chance);
        let turns = |turn: &Vector3<f64>| config.tolerance_rotation_rad < turn.norm();
        let shifts = |shift: &Vector3<f64>| config.tolerance_translation_m < shift.norm();
        if is_chance(3) {
            let turn = rotation_alone(&self.old_from_new, &self.covariance).map_or(turn, |(turn, _)| turn);
            return turns(&turn);
        }
        if is_chance(0) {
            let shift = alone(&self.old_from_new, &self.covariance, 3).map_or(shift, |(shift, _)| shift);
            return shifts(&shift);
        }
        turns(&turn) || shifts(&shift)
    }

    /// The three coordinates from `at` on.
    fn part(&self, at: usize) -> Vector3<f64> {
        self.old_from_new.fixed_rows::<3>(at).into()
    }

    /// Returns the probability of three coordinates as large as these where they are zero.
    fn chance_of(&self, at: usize) -> Option<f64> {
        let covariance: Matrix3<f64> = self.covariance.fixed_view::<3, 3>(at, at).into();
        Some(tail(3, self.part(at).dot(&covariance.cholesky()?.solve(&self.part(at)))))
    }
}

/// Probability below which a translation excludes a pure rotation; tested at every reading.
const PURE_ROTATION_PROBABILITY: f64 = 0.01;
/// Another axis explains a motion about as well within this Δχ²: odds of 90 to 1, three standard deviations.
const RIVALLED: f64 = 9.0;
/// Probability below which a motion counts when a tolerance is applied: a tolerated motion is tested for days, and the alarm chose its
/// onset.
const CHANCE: f64 = 1e-6;

impl Rate {
    /// The rotation alone, radians a second about x, y, z, and its covariance, if it only rotates; none where it shifts more than chance allows.
    pub fn rotation_alone(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let shift: Vector3<f64> = self.per_s.fixed_rows::<3>(3).into();
        let own: Matrix3<f64> = self.covariance.fixed_view::<3, 3>(3, 3).into();
        let chance = tail(3, shift.dot(&own.cholesky()?.solve(&shift)));
        let is_likely = PURE_ROTATION_PROBABILITY < chance;
        if is_likely { rotation_alone(&self.per_s, &self.covariance) } else { None }
    }
}

/// What a small motion `[rotation_rad; translation_m]` is about or along one of its six axes, were the other five zero: docs/math/monitor.md
/// eq. (49). None where the covariance is not positive definite.
pub fn along(motion: &Vector6, covariance: &Matrix6, axis: usize) -> Option<Alone> {
    let weight = covariance.cholesky()?.inverse();
    let of_axis = weight[(axis, axis)];
    Some(Alone { axis, size: (weight.row(axis) * motion)[0] / of_axis, sigma: of_axis.sqrt().recip() })
}

/// The rotation of a small motion `[rotation_rad; translation_m]`, radians about x, y, z, and its covariance, were its shift zero:
/// docs/math/monitor.md eq. (17). None where the covariance of the shift is not positive definite.
pub fn rotation_alone(motion: &Vector6, covariance: &Matrix6) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    alone(motion, covariance, 0)
}

/// The three coordinates from `at` on, were the other three zero.
fn alone(motion: &Vector6, covariance: &Matrix6, at: usize) -> Option<(Vector3<f64>, Matrix3<f64>)> {
    let other = 3 - at;
    let part = |i: usize| -> Vector3<f64> { motion.fixed_rows::<3>(i).into() };
    let block = |i, j| -> Matrix3<f64> { covariance.fixed_view::<3, 3>(i, j).into() };
    let gain = block(other, other).cholesky()?.solve(&block(other, at)).transpose();
    Some((part(at) - gain * part(other), block(at, at) - gain * block(other, at)))
}

numbers!(Rate { per_s, covariance });

/// Without the rate and what is said of the last motion: the monitor knows that from the readings.
impl Numbers for Drift {
    fn put(&self, numbers: &mut Vec<f64>) {
        let Drift { old_from_new, covariance, began_s, began_sigma_s, course, course_probability, .. } = self;
        old_from_new.put(numbers);
        covariance.put(numbers);
        began_s.put(numbers);
        began_sigma_s.put(numbers);
        course.put(numbers);
        course_probability.put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        Some(Drift {
            old_from_new: Numbers::take(rest)?,
            covariance: Numbers::take(rest)?,
            began_s: Numbers::take(rest)?,
            began_sigma_s: Numbers::take(rest)?,
            course: Numbers::take(rest)?,
            course_probability: Numbers::take(rest)?,
            rate: None,
            again: None,
        })
    }
}
