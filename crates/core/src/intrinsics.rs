//! What uncertain intrinsics add to the covariance of a pose.

use crate::camera::MAX_PARAMETERS;
use crate::choose::Minimum;
use crate::problem::Problem;
use crate::refine::information;
use crate::{Error, Matrix6, Vector6};

/// What uncertain intrinsics add to the covariance: δξ = Σ Jᵀ W (−∂π/∂θ) δθ, docs/math/refine.md eq. (9).
pub(crate) fn intrinsics_share(
    best: &Minimum,
    problem: &Problem,
    covariance: &[f64],
) -> Result<Matrix6, Error> {
    let mut by_parameter = [Vector6::zeros(); MAX_PARAMETERS];
    let mut n_parameters = 0;
    let Problem { seen, camera, .. } = *problem;
    for c in seen {
        let x = best.cam_from_target * c.x_in_target;
        let no_solution = Error::NoSolution { n_points: seen.len() };
        let (_, jacobian) = camera.project_with_jacobian(&x).ok_or(no_solution.clone())?;
        let columns = camera.intrinsics_jacobian(&x).ok_or(no_solution)?;
        n_parameters = columns.len();
        for (sum, column) in by_parameter.iter_mut().zip(&columns) {
            let force = jacobian.tr_mul(&(information(c, &jacobian) * column));
            let torque = x.cross(&force);
            *sum -= Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z);
        }
    }
    check_intrinsics_covariance(covariance, n_parameters)?;
    let mut share = Matrix6::zeros();
    for i in 0..n_parameters {
        for j in 0..n_parameters {
            share += by_parameter[i] * by_parameter[j].transpose() * covariance[i * n_parameters + j];
        }
    }
    Ok(best.covariance * share * best.covariance)
}

/// Refuses a matrix that is no covariance: another size, not finite, a negative variance.
fn check_intrinsics_covariance(covariance: &[f64], n_parameters: usize) -> Result<(), Error> {
    let invalid = |parameter, seen, needed| Err(Error::InvalidCamera { parameter, seen, needed });
    if covariance.len() != n_parameters * n_parameters {
        let needed = "give its n × n covariance, n the number of parameters";
        return invalid("intrinsics covariance size", covariance.len() as f64, needed);
    }
    if let Some(&seen) = covariance.iter().find(|x| !x.is_finite()) {
        return invalid("intrinsics covariance", seen, "every entry must be finite");
    }
    let variances = (0..n_parameters).map(|i| covariance[i * n_parameters + i]);
    match variances.into_iter().find(|x| *x < 0.0) {
        Some(seen) => invalid("intrinsics covariance", seen, "no variance can be negative"),
        None => Ok(()),
    }
}
