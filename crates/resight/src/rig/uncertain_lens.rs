//! The contribution of one camera's uncertain intrinsics to an answer, which is solved again with other ones: docs/math/hand_eye.md section 9.

use crate::core::Camera;
use crate::formats::NamedCamera;
use nalgebra::{DMatrix, DVector};

/// Size of the steps, standard deviations: within the linear range, and far above the tolerance of an iteration.
const STEP: f64 = 0.3;

/// Returns the contribution of the intrinsics to the covariance of an answer, D C Dᵀ by central differences along the principal directions of C.
/// `with` returns the change of the answer with another lens; `None` where there is no answer.
pub(crate) fn share(
    camera: &NamedCamera,
    with: impl Fn(&Camera) -> Option<DVector<f64>>,
) -> Option<DMatrix<f64>> {
    let covariance = camera.intrinsics_covariance.as_ref()?;
    let values: Vec<f64> = camera.camera.parameters().iter().map(|(_, value)| *value).collect();
    // In units of the parameters' own standard deviations, because some are pixels and others dimensionless.
    let sigma = covariance.diagonal().map(|x| x.max(0.0).sqrt());
    let unit = |i: usize| if sigma[i] == 0.0 { 1.0 } else { sigma[i] };
    let n = values.len();
    let correlation = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] / (unit(i) * unit(j)));
    let eigen = correlation.symmetric_eigen();
    let mut share: Option<DMatrix<f64>> = None;
    for (lambda, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *lambda <= 1e-9 {
            continue;
        }
        let moved = |by: f64| {
            let step = |(i, value): (usize, &f64)| value + by * lambda.sqrt() * unit(i) * direction[i];
            let moved: Vec<f64> = values.iter().enumerate().map(step).collect();
            with(&camera.camera.with_parameters(&moved).ok()?)
        };
        let change = (moved(STEP)? - moved(-STEP)?) / (2.0 * STEP);
        let added = &change * change.transpose();
        share = Some(share.map_or_else(|| added.clone(), |sum| sum + &added));
    }
    share
}
