//! Points that are displaced together: the corners of a tag that is not quite where the map says.
//!
//! ```text
//!   x ← x + φ × (x − c_t) + τ,   φ ~ N(0, σ_φ² I),   τ ~ N(0, σ_τ² I)     one unknown motion of all points of the group
//!   about the pivot c of the refinement:  [φ; τ + d × φ],  d = c_t − c,   S = P diag(σ_φ² I, σ_τ² I) Pᵀ,  P = [ I 0 ; [d]× I ]
//! ```
//! The best such motion is eliminated from the group's normal equations as a camera's uncertain place is from a rig's:
//! docs/math/tag_map.md eqs. (1)–(5).

use crate::least_squares::NormalEquations;
use crate::{Error, Matrix6, Point};
use nalgebra::{Matrix3, Vector3};

/// Consecutive points of a view whose known positions share one unknown small motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigidGroup {
    /// Index of the first of its points.
    pub first: usize,
    /// How many points it has.
    pub n_points: usize,
    /// The point about which it may be rotated, target frame, metres: the centre of a tag.
    pub centre_in_target: Point,
    /// Standard deviation of its displacement along each axis, metres; 0 when exact.
    pub sigma_m: f64,
    /// Standard deviation of its rotation about each axis, radians; 0 when exact.
    pub sigma_rad: f64,
}

impl RigidGroup {
    /// One past its last point.
    pub fn end(&self) -> usize {
        self.first.saturating_add(self.n_points)
    }

    /// S of the motion about a pivot that lies `-offset` from the centre, in the axes of `offset`: both sigmas are the same along every
    /// axis, so the rotation between frames drops out.
    pub(crate) fn motion_covariance(&self, offset: &Vector3<f64>) -> Matrix6 {
        let (turn, shift) = (self.sigma_rad * self.sigma_rad, self.sigma_m * self.sigma_m);
        let cross = offset.cross_matrix();
        let mut covariance = Matrix6::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&(Matrix3::identity() * turn));
        covariance.fixed_view_mut::<3, 3>(3, 0).copy_from(&(cross * turn));
        covariance.fixed_view_mut::<3, 3>(0, 3).copy_from(&(cross.transpose() * turn));
        let place = Matrix3::identity() * shift + cross * cross.transpose() * turn;
        covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&place);
        covariance
    }

    /// The group's own normal equations about a pivot with its motion eliminated; none where the numbers leave their range.
    pub(crate) fn eliminated(&self, own: &NormalEquations, offset: &Vector3<f64>) -> Option<NormalEquations> {
        if self.sigma_m == 0.0 && self.sigma_rad == 0.0 {
            return Some(*own);
        }
        own.with_uncertain_motion(&self.motion_covariance(offset))
    }
}

/// Refuses groups out of order, overlapping or beyond the points, and sigmas that cannot be.
///
/// # Errors
/// `InvalidSetting`, with the number seen.
pub(crate) fn check_groups(groups: &[RigidGroup], n_points: usize) -> Result<(), Error> {
    let refused = |seen, needed| Err(Error::InvalidSetting { setting: "groups", seen, needed });
    let mut next = 0;
    for group in groups {
        if group.first < next || n_points < group.end() || group.n_points == 0 {
            return refused(group.first as f64, "groups are runs of points, in order, none shared or empty");
        }
        next = group.end();
        for sigma in [group.sigma_m, group.sigma_rad] {
            let usable = 0.0 <= sigma && (sigma * sigma).is_finite();
            if !usable {
                return refused(sigma, "the standard deviations of a group are zero or positive");
            }
        }
        if !group.centre_in_target.sum().is_finite() {
            return refused(group.centre_in_target.sum(), "the centre of a group must be finite");
        }
    }
    Ok(())
}
