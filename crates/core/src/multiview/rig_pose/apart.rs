//! Whether the cameras of a rig agree on the pose: docs/math/rig_pose.md section 7.
//!
//! ```text
//!   N, g  information and pull of one camera at the common minimum   ·   N_r  the sum of the others' N   ·   T = gᵀ (N⁻¹ + N_r⁻¹) g
//! ```

use super::cost::{RigCost, equations_of};
use super::{RigConsistency, RigView};
use crate::least_squares::PivotedPose;
use crate::locate::consistency::{NOISY_FOCAL, is_inconsistent, noise_scale};
use crate::locate::curvature::Cost;
use crate::{Matrix6, Point, Pose, Vector6};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Fewer points give a camera no pose of its own that another could contradict.
const LEAST_POINTS: usize = 4;

/// How far the cameras' own poses are apart.
pub(super) struct Apart {
    /// The camera whose pose differs most from that of all others by more than fair lenses explain, and the square of the difference in units of
    /// its covariance, eq. (11).
    largest: Option<(usize, f64)>,
    /// The sum of squares of eq. (12), and its degrees of freedom.
    sum: (f64, usize),
}

impl Apart {
    pub fn none() -> Self {
        Apart { largest: None, sum: (0.0, 0) }
    }

    /// Compares the cameras at the minimum, whose residuals enlarge the variances by `noise_scale`.
    pub fn new(cost: &RigCost, rig_from_target: &Pose, noise_scale: f64) -> Self {
        let of_view = |view: &RigView| -> Option<(Matrix6, Vector6)> {
            let equations = equations_of(&cost.held_at(rig_from_target), view, rig_from_target)?;
            Some((equations.information(), equations.gradient()))
        };
        let whole: Matrix6 = cost.views.iter().filter_map(of_view).map(|(information, _)| information).sum();
        let mut apart = Apart::none();
        let mut n_cameras = 0;
        for (camera, view) in
            cost.views.iter().enumerate().filter(|(_, view)| LEAST_POINTS <= view.seen.len())
        {
            let Some((own, pull)) = of_view(view) else { continue };
            let (Some(alone), Some(others)) = (own.cholesky(), (whole - own).cholesky()) else { continue };
            let (by_itself, by_others) = (alone.solve(&pull), others.solve(&pull));
            let chi2 = pull.dot(&(by_itself + by_others)) / noise_scale;
            if !chi2.is_finite() {
                continue;
            }
            n_cameras += 1;
            apart.sum.0 += pull.dot(&by_itself) / noise_scale;
            let is_far =
                NOISY_FOCAL < displacement(view, rig_from_target, &cost.pivot(), &(by_itself + by_others));
            if is_far && apart.largest.is_none_or(|(_, largest)| largest < chi2) {
                apart.largest = Some((camera, chi2));
            }
        }
        apart.sum.1 = 6 * usize::saturating_sub(n_cameras, 1);
        apart
    }

    /// Returns the factor by which the cameras' disagreement enlarges the variances of the pose: 1 where chance explains it, eq. (12).
    pub fn scale(&self) -> f64 {
        noise_scale(self.sum.0, self.sum.1)
    }

    pub fn consistency(&self) -> RigConsistency {
        match self.largest {
            Some((camera, chi2)) if is_inconsistent(chi2, 6) => RigConsistency::CameraApart { camera, chi2 },
            _ => RigConsistency::Consistent,
        }
    }
}

/// Returns by how much a motion about the pivot displaces a camera's points, root mean square, in focal lengths.
fn displacement(view: &RigView, rig_from_target: &Pose, pivot: &Point, motion: &Vector6) -> f64 {
    let place = PivotedPose::new(rig_from_target, pivot);
    let (turn, shift) = (motion.fixed_rows::<3>(0), motion.fixed_rows::<3>(3));
    let squared = |x_in_target: &Point| {
        let y = place.rotation * (x_in_target - pivot);
        let x_in_cam = view.cam_from_rig * (y + place.pivot_in_cam);
        let moved = view.cam_from_rig.rotation * (turn.cross(&y) + shift);
        x_in_cam.cross(&moved).norm_squared() / x_in_cam.norm_squared().powi(2)
    };
    let sum: f64 = view.seen.iter().map(|c| squared(&c.x_in_target)).sum();
    (sum / view.seen.len().max(1) as f64).sqrt()
}
