//! The residual of a measured pose and its derivative; is this a pose, is this a covariance?
//!
//! ```text
//!   r = Log(measured · predicted⁻¹)   ·   predicted ← Exp(δ) predicted:  r ← r − J δ + …,  J = Jᵣ⁻¹(r)
//! ```
//! Derivation: docs/math/pose_graph.md eqs. (1)–(4).

use crate::{Error, Matrix6, Pose, Vector6};
use nalgebra::{Matrix3, Vector3};

/// Bernoulli numbers over factorials, Bₙ/n! for n = 2, 4, 6, 8: the next term is below 2e-3 even at an angle of π, where the residual is
/// hopeless anyway, and below rounding at 0.03 rad.
const SERIES: [f64; 4] = [1.0 / 12.0, -1.0 / 720.0, 1.0 / 30_240.0, -1.0 / 1_209_600.0];
/// |ξ|² below which the third term is below rounding, and two suffice.
const SMALL: f64 = 1e-5;

/// Largest entry of RᵀR − 1 accepted: a matrix written with six digits.
const MAX_ROTATION_DEFECT: f64 = 1e-5;

/// r and J: the left motion that takes the predicted pose to the measured one, and how it falls with a left motion of the predicted.
pub(crate) fn residual(measured: &Pose, predicted: &Pose) -> (Vector6, Matrix6) {
    let r = (*measured * predicted.inverse()).log();
    (r, inverse_right_jacobian(&r))
}

/// Jᵣ⁻¹(ξ): Log(Exp(ξ) Exp(δ)) = ξ + Jᵣ⁻¹ δ + …, docs/math/pose_graph.md eq. (3). Powers of ad = [ [ω]× 0 ; [ν]× [ω]× ] are
/// [ A 0 ; B A ] too, so that A and B are all there is to multiply.
fn inverse_right_jacobian(xi: &Vector6) -> Matrix6 {
    let turn = Vector3::new(xi[0], xi[1], xi[2]).cross_matrix();
    let shift = Vector3::new(xi[3], xi[4], xi[5]).cross_matrix();
    let times =
        |(a, b): (Matrix3<f64>, Matrix3<f64>), (c, d): (Matrix3<f64>, Matrix3<f64>)| (a * c, b * c + a * d);
    let square = times((turn, shift), (turn, shift));
    let mut power = (Matrix3::identity(), Matrix3::zeros());
    let mut sum = (Matrix3::identity() + turn * 0.5, shift * 0.5);
    let terms = if xi.norm_squared() < SMALL { &SERIES[..2] } else { &SERIES[..] };
    for &coefficient in terms {
        power = times(power, square);
        sum = (sum.0 + power.0 * coefficient, sum.1 + power.1 * coefficient);
    }
    let mut jacobian = Matrix6::zeros();
    jacobian.fixed_view_mut::<3, 3>(0, 0).copy_from(&sum.0);
    jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&sum.0);
    jacobian.fixed_view_mut::<3, 3>(3, 0).copy_from(&sum.1);
    jacobian
}

/// One standard deviation for every turn and one for every shift, squared.
pub(crate) fn isotropic(sigma_rad: f64, sigma_m: f64) -> Matrix6 {
    let (r, t) = (sigma_rad * sigma_rad, sigma_m * sigma_m);
    Matrix6::from_diagonal(&Vector6::new(r, r, r, t, t, t))
}

/// Refuses what is no rigid transform.
pub(crate) fn check_pose(item: &'static str, index: usize, b_from_a: &Pose) -> Result<(), Error> {
    let invalid = |what, seen, needed| Err(Error::InvalidPose { item, index, what, seen, needed });
    let entries = b_from_a.rotation.iter().chain(&b_from_a.translation);
    if let Some(&seen) = entries.into_iter().find(|x| !x.is_finite()) {
        return invalid("an entry of the pose", seen, "it must be a finite number");
    }
    let r = &b_from_a.rotation;
    let defect = (r.transpose() * r - Matrix3::identity()).amax();
    if MAX_ROTATION_DEFECT < defect {
        let what = "the largest entry of RᵀR − 1";
        return invalid(what, defect, "it must be below 1e-5: give a rotation matrix or a unit quaternion");
    }
    if r.determinant() < 0.0 {
        let needed = "it must be 1: a mirrored frame is no rotation; check the order and signs of the axes";
        return invalid("the determinant of the rotation", r.determinant(), needed);
    }
    Ok(())
}

/// The inverse of a covariance.
///
/// # Errors
/// `InvalidPose` for one that is not finite, symmetric and positive definite.
pub(crate) fn information_of(
    item: &'static str,
    index: usize,
    covariance: &Matrix6,
) -> Result<Matrix6, Error> {
    let invalid = |what, seen, needed| Error::InvalidPose { item, index, what, seen, needed };
    if let Some(&seen) = covariance.iter().find(|x| !x.is_finite()) {
        return Err(invalid("an entry of the covariance", seen, "it must be a finite number"));
    }
    let skew = (covariance - covariance.transpose()).amax();
    if 1e-9 * covariance.amax() < skew {
        return Err(invalid("the covariance's asymmetry", skew, "it must be symmetric"));
    }
    let singular = || {
        let least = covariance.symmetric_eigenvalues().min();
        let needed = "it must be positive: no direction of a measured pose is exact";
        invalid("the least eigenvalue of the covariance", least, needed)
    };
    // Scaled to a unit diagonal, so that radians and metres of very different size do not pass for a singular matrix.
    let scale = covariance.diagonal().map(|x| if 0.0 < x { x.sqrt().recip() } else { f64::NAN });
    let scaled = Matrix6::from_fn(|i, j| covariance[(i, j)] * scale[i] * scale[j]);
    let inverse = scaled.cholesky().ok_or_else(singular)?.inverse();
    let information = Matrix6::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]);
    if information.sum().is_finite() { Ok(information) } else { Err(singular()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Central differences err by h² and ε/h.
    const STEP: f64 = 6e-6;

    /// At residuals of all sizes below half a turn. The first term dropped is 2.1e-8 ad¹⁰, whose entries are at most θ¹⁰ + 10 θ⁹|ν|: with
    /// |ν| = 0.86 θ together 2.0e-7 θ¹⁰, and the next terms a tenth of that.
    #[test]
    fn jacobian_matches_central_difference() {
        let axis = Vector6::new(0.6, -0.64, 0.48, 0.7, -0.3, 0.4);
        let predicted = Pose::exp(&Vector6::new(0.4, -1.1, 0.3, 2.0, 0.5, -1.0));
        for angle_rad in [0.0, 1e-4, 0.03, 0.3, 1.0, 2.0] {
            let measured = Pose::exp(&(axis * angle_rad)) * predicted;
            let (_, jacobian) = residual(&measured, &predicted);
            for i in 0..6 {
                let at = |h: f64| residual(&measured, &(Pose::exp(&Vector6::ith(i, h)) * predicted)).0;
                let numeric = (at(-STEP) - at(STEP)) / (2.0 * STEP);
                let tolerance = 1e-8 + 2.5e-7 * angle_rad.powi(10);
                assert!((numeric - jacobian.column(i)).amax() < tolerance, "{angle_rad} {i}");
            }
        }
    }

    #[test]
    fn a_covariance_that_is_none_is_refused() {
        let good = isotropic(1e-6, 1e3);
        assert!((information_of("pair", 0, &good).unwrap() * good - Matrix6::identity()).amax() < 1e-9);
        for (i, j, x) in [(0, 0, 0.0), (1, 1, -1.0), (0, 1, 1.0), (2, 2, f64::NAN)] {
            let mut bad = good;
            bad[(i, j)] = x;
            assert!(information_of("pair", 0, &bad).is_err(), "{i} {j} {x}");
        }
    }
}
