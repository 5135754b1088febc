//! Compares an answer with the truth, in units of its own uncertainty.

use crate::core::{Matrix6, Point, Pose, Vector6};
use nalgebra::{Matrix3, Matrix3x6};

/// χ² with 6 degrees of freedom stays below this in 99 % of cases.
pub const CHI2_6_99: f64 = 16.81;

/// The error of an answer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TruthCheck {
    /// Angle between the two rotations, radians.
    pub angle_rad: f64,
    /// Distance between the two positions of frame b's origin in frame a (for `cam_from_target`: of the camera), metres.
    pub distance_m: f64,
    /// ξᵀ Σ⁻¹ ξ with Exp(ξ) = found · truth⁻¹: 6 on average when the covariance Σ is correct.
    pub normalized_squared: f64,
}

/// Compares `b_from_a` with the truth; `None` where the covariance cannot be inverted.
pub fn check(b_from_a: &Pose, covariance: &Matrix6, truth: &Pose) -> Option<TruthCheck> {
    let xi: Vector6 = (*b_from_a * truth.inverse()).log();
    let inverse = covariance.cholesky()?.inverse();
    Some(TruthCheck {
        angle_rad: b_from_a.angle_to_rad(truth),
        distance_m: (b_from_a.origin() - truth.origin()).norm(),
        normalized_squared: (xi.transpose() * inverse * xi)[(0, 0)],
    })
}

/// Returns the covariance of the position in frame b of a point known in frame a: `J Σ Jᵀ` with `J = [−[x]ₓ I]`, metres².
pub fn point_covariance(x_in_b: &Point, covariance: &Matrix6) -> Matrix3<f64> {
    let mut by_motion = Matrix3x6::zeros();
    by_motion.fixed_view_mut::<3, 3>(0, 0).copy_from(&-x_in_b.cross_matrix());
    by_motion.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
    by_motion * covariance * by_motion.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sigma_off_in_one_direction_counts_one() {
        let truth = Pose::exp(&Vector6::new(0.1, -0.2, 0.3, 1.0, 2.0, 3.0));
        let covariance = Matrix6::from_diagonal(&Vector6::new(1e-4, 4e-4, 1e-4, 1e-2, 1e-2, 1e-2));
        let mut xi = Vector6::zeros();
        xi[1] = 0.02;
        let check = check(&(Pose::exp(&xi) * truth), &covariance, &truth).unwrap();
        assert!((check.normalized_squared - 1.0).abs() < 1e-9 && (check.angle_rad - 0.02).abs() < 1e-12);
    }

    #[test]
    fn a_turn_moves_a_far_point_sideways() {
        let covariance = Matrix6::from_diagonal(&Vector6::new(0.0, 1e-4, 0.0, 0.0, 0.0, 0.0));
        let moved = point_covariance(&Point::new(0.0, 0.0, 5.0), &covariance);
        assert!((moved[(0, 0)] - 25e-4).abs() < 1e-15 && moved[(1, 1)] == 0.0 && moved[(2, 2)] == 0.0);
    }
}
