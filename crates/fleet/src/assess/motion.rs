//! A motion in numbers.

use resight::core::temporal::monitor::{Drift, MotionKind};
use resight::core::{Matrix6, Vector6};
use serde::Serialize;

/// The size and the time of a camera's motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Motion {
    /// `step`, `ramp`, `excursion` (away for a single period), or `pending` (a step that the last period alone shows).
    pub kind: &'static str,
    /// When it began, seconds.
    pub since_s: f64,
    /// The uncertainty of that time, seconds.
    pub since_sigma_s: f64,
    /// When a ramp ended and the uncertainty of that time, seconds; `None` where it continues, and of other motions.
    pub until_s: Option<[f64; 2]>,
    /// Whether it may be larger: a single period holds an unknown share of it.
    pub is_at_least: bool,
    /// χ² of the motion with six degrees of freedom.
    pub chi2: f64,
    /// The later pose of the camera in its own old frame; of a ramp rate times duration; about x right, y down, z forward, degrees.
    pub rotation_deg: [f64; 3],
    /// Their standard deviations.
    pub rotation_sigma_deg: [f64; 3],
    /// Along the same axes, metres.
    pub translation_m: [f64; 3],
    /// Their standard deviations.
    pub translation_sigma_m: [f64; 3],
    /// The rotation, if the camera only rotated about its own centre, as in most motions; `None` where it shifted too.
    pub rotation_alone_deg: Option<[f64; 3]>,
    /// The angle of that rotation, or of the whole one, and its standard deviation, degrees.
    pub angle_deg: [f64; 2],
    /// The length of the shift and its standard deviation, metres.
    pub shift_m: [f64; 2],
}

impl Motion {
    /// Whether more than one period confirms the new pose.
    pub fn is_confirmed(&self) -> bool {
        matches!(self.kind, "step" | "ramp")
    }

    /// Whether it is later than what is known.
    pub(super) fn is_new(&self, known_until_s: Option<f64>) -> bool {
        let last_s = self.until_s.map_or(self.since_s, |[until_s, _]| until_s);
        // A ramp that continues is new whenever it began.
        let is_going_on = self.kind == "ramp" && self.until_s.is_none();
        is_going_on || known_until_s.is_none_or(|known| known < last_s + 2.0 * self.since_sigma_s)
    }

    pub(super) fn new(
        kind: &'static str,
        (since_s, since_sigma_s): (f64, f64),
        y: Vector6,
        covariance: Matrix6,
    ) -> Self {
        let drift = Drift {
            old_from_new: y,
            covariance,
            began_s: since_s,
            began_sigma_s: since_sigma_s,
            again: None,
            course: MotionKind::Step,
            course_probability: 1.0,
            rate: None,
        };
        let chi2 = covariance.cholesky().map_or(0.0, |factor| y.dot(&factor.solve(&y)));
        let sigma = |i: usize| covariance[(i, i)].max(0.0).sqrt();
        let alone = drift.pure_rotation();
        let angle = match &alone {
            Some((rotation, of)) => length(rotation, of),
            None => length(&y.fixed_rows::<3>(0).into(), &covariance.fixed_view::<3, 3>(0, 0).into()),
        };
        let shift = length(&y.fixed_rows::<3>(3).into(), &covariance.fixed_view::<3, 3>(3, 3).into());
        Motion {
            kind,
            since_s,
            since_sigma_s,
            until_s: None,
            is_at_least: false,
            chi2,
            rotation_deg: [0, 1, 2].map(|i| y[i].to_degrees()),
            rotation_sigma_deg: [0, 1, 2].map(|i| sigma(i).to_degrees()),
            translation_m: [3, 4, 5].map(|i| y[i]),
            translation_sigma_m: [3, 4, 5].map(sigma),
            rotation_alone_deg: alone.map(|(rotation, _)| rotation.map(f64::to_degrees).into()),
            angle_deg: angle.map(f64::to_degrees),
            shift_m: shift,
        }
    }
}

/// Returns the length of a vector, with its standard deviation along the vector.
pub(super) fn length(v: &nalgebra::Vector3<f64>, covariance: &nalgebra::Matrix3<f64>) -> [f64; 2] {
    let norm = v.norm();
    let along = v / norm.max(f64::MIN_POSITIVE);
    [norm, along.dot(&(covariance * along)).max(0.0).sqrt()]
}
