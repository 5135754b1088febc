//! A prior as residuals of the cost, with their derivatives by the motion of the camera frame.
//!
//! ```text
//!   ξ = [ω; ν]  small left motion: x_in_cam ← x_in_cam + ω × x_in_cam + ν
//!   e = Log(cam_from_target · priorⁱⁿᵛ)   ∂e/∂ξ = J⁻¹(e)                          docs/math/priors.md eqs. (2)–(5)
//!   p = R d  direction predicted, m measured, θ between them, b₁, b₂ ⟂ m          eqs. (6)–(8)
//!   h = n · C − d₀,  C = −Rᵀt  the camera centre's distance, ∂h/∂ν = −R n         eq. (9)
//! ```

use crate::locate::prior::Prior;
use crate::{Matrix6, Point, Pose, Vector6};
use arrayvec::ArrayVec;
use nalgebra::Vector3;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// One residual in standard deviations, observed − predicted, and the derivative of what was predicted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Factor {
    pub(crate) residual: f64,
    pub(crate) by_rotation: Vector3<f64>,
    pub(crate) by_translation: Vector3<f64>,
}

impl Factor {
    /// The derivative by a rotation about a pivot instead of the camera centre: ν_left = ν + c × ω, docs/math/refine.md eq. (7).
    pub(crate) fn by_rotation_about(&self, pivot_in_cam: &Point) -> Vector3<f64> {
        self.by_rotation + self.by_translation.cross(pivot_in_cam)
    }
}

/// The residuals of one prior.
pub(crate) type Factors = ArrayVec<Factor, 6>;

/// The residuals of a prior at a pose.
pub(crate) fn factors(prior: &Prior, cam_from_target: &Pose) -> Factors {
    match prior {
        Prior::Pose { cam_from_target: expected, covariance } => {
            of_pose(cam_from_target, expected, covariance)
        }
        Prior::Gravity { down_in_target, down_in_cam, sigma_rad } => {
            let predicted = cam_from_target.rotation * down_in_target;
            of_direction(&predicted, down_in_cam, *sigma_rad).into_iter().collect()
        }
        Prior::Height { normal_in_target, offset_m, height_m, sigma_m } => {
            let factor = of_height(cam_from_target, normal_in_target, height_m + offset_m, *sigma_m);
            core::iter::once(factor).collect()
        }
        Prior::Plane { normal_in_target, offset_m, normal_in_cam, height_m, sigma_rad, sigma_m } => {
            let predicted = cam_from_target.rotation * normal_in_target;
            let factor = of_height(cam_from_target, normal_in_target, height_m + offset_m, *sigma_m);
            let [first, second] = of_direction(&predicted, normal_in_cam, *sigma_rad);
            [first, second, factor].into_iter().collect()
        }
    }
}

/// The squared residuals of a prior, summed.
pub(crate) fn chi2(prior: &Prior, cam_from_target: &Pose) -> f64 {
    factors(prior, cam_from_target).iter().map(|f| f.residual * f.residual).sum()
}

/// r = −L⁻¹ e with L Lᵀ the covariance, docs/math/priors.md eqs. (2), (5).
fn of_pose(cam_from_target: &Pose, expected: &Pose, covariance: &Matrix6) -> Factors {
    let Some(factor) = covariance.cholesky() else { return Factors::new() };
    let error = (*cam_from_target * expected.inverse()).log();
    let (mut whitened, mut by_motion) = (error, inverse_left_jacobian(&error));
    factor.l_dirty().solve_lower_triangular_mut(&mut whitened);
    factor.l_dirty().solve_lower_triangular_mut(&mut by_motion);
    let row = |i: usize| Factor {
        residual: -whitened[i],
        by_rotation: by_motion.fixed_view::<1, 3>(i, 0).transpose(),
        by_translation: by_motion.fixed_view::<1, 3>(i, 3).transpose(),
    };
    (0..6).map(row).collect()
}

/// Below this angle the series of α and β are exact to 1e-10 of them: their next terms are θ⁶/47 900 160 and the like.
const SMALL_ANGLE_RAD: f64 = 0.05;

/// J⁻¹(e): Log(Exp(δ) Exp(e)) = e + J⁻¹(e) δ to first order; I − ½ ad + α ad² + β ad⁴, docs/math/priors.md eqs. (3), (4).
fn inverse_left_jacobian(e: &Vector6) -> Matrix6 {
    let (w, v) = (Vector3::new(e[0], e[1], e[2]), Vector3::new(e[3], e[4], e[5]));
    let (k, kv) = (w.cross_matrix(), v.cross_matrix());
    let mut ad = Matrix6::zeros();
    ad.fixed_view_mut::<3, 3>(0, 0).copy_from(&k);
    ad.fixed_view_mut::<3, 3>(3, 3).copy_from(&k);
    ad.fixed_view_mut::<3, 3>(3, 0).copy_from(&kv);
    let t2 = w.norm_squared();
    let (alpha, beta) = if t2 < SMALL_ANGLE_RAD * SMALL_ANGLE_RAD {
        (1.0 / 12.0 - t2 * t2 / 30_240.0, -1.0 / 720.0 - t2 / 15_120.0)
    } else {
        let half = 0.5 * t2.sqrt();
        let (h, sin) = (half / half.tan(), half.sin());
        let th = h - half * half / (sin * sin); // θ h', h = (θ/2) cot(θ/2)
        ((2.0 - 2.0 * h + 0.5 * th) / t2, (th + 2.0 - 2.0 * h) / (2.0 * t2 * t2))
    };
    let ad2 = ad * ad;
    Matrix6::identity() - ad * 0.5 + ad2 * alpha + ad2 * ad2 * beta
}

/// Below this sine the angle between two directions is series, or π.
const SMALL_SINE: f64 = 1e-4;

/// Two residuals: the angle from the measured to the predicted direction, as a vector across the measured one.
fn of_direction(predicted: &Vector3<f64>, measured: &Vector3<f64>, sigma_rad: f64) -> [Factor; 2] {
    let (cos, across) = (measured.dot(predicted), predicted.cross(measured));
    let sin = across.norm();
    // f = θ/sin θ and its derivative by cos θ.
    let (f, slope) = if SMALL_SINE < sin {
        let angle = sin.atan2(cos);
        (angle / sin, (angle * cos - sin) / (sin * sin * sin))
    } else if 0.0 < cos {
        (1.0 + sin * sin / 6.0, -1.0 / 3.0)
    } else {
        return opposite(sigma_rad);
    };
    tangents(measured).map(|b| Factor {
        residual: -f * b.dot(predicted) / sigma_rad,
        by_rotation: (predicted.cross(&b) * f + across * (slope * b.dot(predicted))) / sigma_rad,
        by_translation: Vector3::zeros(),
    })
}

/// A direction opposite to the measured one: half a turn off, no matter which way.
fn opposite(sigma_rad: f64) -> [Factor; 2] {
    [core::f64::consts::PI / sigma_rad, 0.0].map(|residual| Factor {
        residual,
        by_rotation: Vector3::zeros(),
        by_translation: Vector3::zeros(),
    })
}

/// Two unit vectors across a direction and each other.
fn tangents(direction: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let first = direction.cross(&Vector3::ith(direction.iamin(), 1.0)).normalize();
    [first, direction.cross(&first).normalize()]
}

/// `position_m` = where the camera centre is expected along the normal.
fn of_height(cam_from_target: &Pose, normal: &Vector3<f64>, position_m: f64, sigma_m: f64) -> Factor {
    let predicted_m = normal.dot(&cam_from_target.origin());
    Factor {
        residual: (position_m - predicted_m) / sigma_m,
        by_rotation: Vector3::zeros(),
        by_translation: -(cam_from_target.rotation * normal) / sigma_m,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(w: [f64; 3], t: [f64; 3]) -> Pose {
        Pose::exp(&Vector6::new(w[0], w[1], w[2], t[0], t[1], t[2]))
    }

    /// One of each kind, none of them met exactly.
    fn priors(turn: &Vector3<f64>) -> [Prior; 4] {
        let covariance = Matrix6::from_fn(|i, j| if i == j { 0.04 + 0.01 * i as f64 } else { 0.003 });
        let expected = pose([0.3 + turn.x, -0.2 + turn.y, 0.5 + turn.z], [0.4, -0.1, 3.2]);
        let slanted = Vector3::new(0.2, -0.9, 0.3).normalize();
        let seen =
            pose((*turn).into(), [0.0; 3]).rotation * pose([0.3, -0.2, 0.5], [0.0; 3]).rotation * slanted;
        let (sigma_rad, sigma_m, offset_m, height_m) = (0.02, 0.05, 0.7, 1.4);
        [
            Prior::Pose { cam_from_target: expected, covariance },
            Prior::Gravity { down_in_target: slanted, down_in_cam: seen, sigma_rad },
            Prior::Height { normal_in_target: slanted, offset_m, height_m, sigma_m },
            Prior::Plane {
                normal_in_target: slanted,
                offset_m,
                normal_in_cam: seen,
                height_m,
                sigma_rad,
                sigma_m,
            },
        ]
    }

    /// From nearly met (series) to nearly half a turn off. Truncation h² and rounding ε/h balance at h = 1e-5.
    #[test]
    fn derivatives_match_central_difference() {
        let at = pose([0.3, -0.2, 0.5], [0.3, 0.1, 3.0]);
        for angle in [0.0, 1e-6, 1e-3, 0.049, 0.051, 0.5, 2.0, 3.0] {
            for prior in priors(&(Vector3::new(0.6, 0.0, 0.8) * angle)) {
                let found = factors(&prior, &at);
                assert_eq!(found.len(), prior.rows());
                for (row, factor) in found.iter().enumerate() {
                    for k in 0..6 {
                        let h = 1e-5;
                        let moved = |by: f64| {
                            let to = Pose::exp(&(Vector6::ith(k, by))) * at;
                            factors(&prior, &to)[row].residual
                        };
                        // Residuals are observed − predicted, derivatives those of the prediction.
                        let numeric = -(moved(h) - moved(-h)) / (2.0 * h);
                        let exact = if k < 3 { factor.by_rotation[k] } else { factor.by_translation[k - 3] };
                        assert!(
                            (numeric - exact).abs() < 1e-6 * (1.0 + exact.abs()) * 50.0,
                            "{prior:?} {row} {k} at {angle}: {numeric} {exact}"
                        );
                    }
                }
            }
        }
    }

    /// The motion about a pivot moves the residual as the same motion of the camera frame does.
    #[test]
    fn pivot_transport_is_the_chain_rule() {
        let at = pose([0.3, -0.2, 0.5], [0.3, 0.1, 3.0]);
        let (pivot, turn) = (Point::new(0.4, -0.3, 2.5), Vector3::new(0.1, 0.2, -0.3));
        for prior in priors(&Vector3::new(0.1, 0.0, 0.2)) {
            for factor in factors(&prior, &at) {
                let shift = pivot.cross(&turn); // ν_left of a rotation about the pivot
                let left = factor.by_rotation.dot(&turn) + factor.by_translation.dot(&shift);
                assert!(
                    (factor.by_rotation_about(&pivot).dot(&turn) - left).abs() < 1e-12 * (1.0 + left.abs())
                );
            }
        }
    }

    /// A prior met exactly costs nothing; half a turn off costs π² over its variance, without NaN.
    #[test]
    fn residuals_are_angles_in_standard_deviations() {
        let (down, sigma_rad) = (Vector3::new(0.0, 0.6, 0.8), 0.1);
        for (seen, angle) in
            [(down, 0.0), (-down, core::f64::consts::PI), (Vector3::x(), core::f64::consts::FRAC_PI_2)]
        {
            let prior = Prior::Gravity { down_in_target: down, down_in_cam: seen, sigma_rad };
            let expected = (angle / sigma_rad).powi(2);
            assert!((chi2(&prior, &Pose::identity()) - expected).abs() < 1e-9 * (1.0 + expected));
        }
    }
}
