//! How far it moved, whether that is a turn alone, and whether anybody should care.

use super::{Course, MonitorConfig};
use crate::frames::chi_square::tail;
use crate::snapshot::numbers;
use crate::{Matrix6, Vector6};
use nalgebra::{Matrix3, Vector3};

/// How far it moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drift {
    /// Where frame a now is in its own old frame, `[rotation_rad; translation_m]`; about camera axes x right, y down, z forward.
    pub old_from_new: Vector6,
    /// Its covariance.
    pub covariance: Matrix6,
    /// When it began, seconds.
    pub began_s: f64,
    /// How sure that is, seconds.
    pub began_sigma_s: f64,
    /// At once or slowly.
    pub course: Course,
    /// Probability of that course.
    pub course_probability: f64,
}

impl Drift {
    /// The turn alone, radians about x, y, z, and its covariance, if the camera only turned about its own centre; none where its
    /// translation is larger than that allows (one in twenty). A turn and a shift look much alike from a small target: where a
    /// mounted camera turned, this is known far better than the six coordinates, docs/math/monitor.md eq. (17).
    pub fn pure_rotation(&self) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let is_likely = PURE_ROTATION_PROBABILITY < self.chance_of(3)?;
        if is_likely { turn_alone(&self.old_from_new, &self.covariance) } else { None }
    }

    /// Whether it goes beyond what the configuration tolerates. A turn and a shift look much alike, and neither estimate is ever zero:
    /// a shift that chance explains counts for none, and the turn is then judged alone; as is a shift beside a turn that chance explains.
    pub(super) fn matters(&self, config: &MonitorConfig) -> bool {
        let (turn, shift) = (self.part(0), self.part(3));
        let is_chance = |at| self.chance_of(at).is_some_and(|chance| CHANCE < chance);
        let turns = |turn: &Vector3<f64>| config.tolerance_rotation_rad < turn.norm();
        let shifts = |shift: &Vector3<f64>| config.tolerance_translation_m < shift.norm();
        if is_chance(3) {
            let turn = turn_alone(&self.old_from_new, &self.covariance).map_or(turn, |(turn, _)| turn);
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

    /// Chance of three coordinates as large as these where they are zero.
    fn chance_of(&self, at: usize) -> Option<f64> {
        let covariance: Matrix3<f64> = self.covariance.fixed_view::<3, 3>(at, at).into();
        Some(tail(3, self.part(at).dot(&covariance.cholesky()?.solve(&self.part(at)))))
    }
}

/// A translation that chance makes larger this often speaks against a pure rotation.
const PURE_ROTATION_PROBABILITY: f64 = 0.05;
/// What chance makes larger this seldom is no chance when a tolerance is applied: a tolerated turn is looked at for days, and the alarm
/// chose its moment.
const CHANCE: f64 = 1e-6;

/// The turn of a small motion `[rotation_rad; translation_m]`, radians about x, y, z, and its covariance, were its shift zero:
/// docs/math/monitor.md eq. (17). None where the covariance of the shift is not positive definite.
pub fn turn_alone(motion: &Vector6, covariance: &Matrix6) -> Option<(Vector3<f64>, Matrix3<f64>)> {
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

numbers!(Drift { old_from_new, covariance, began_s, began_sigma_s, course, course_probability });
