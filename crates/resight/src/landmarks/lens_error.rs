//! The effect of uncertain intrinsics on a rotation measured from landmarks: docs/math/turn.md eqs. (13) and (14).

use super::Found;
use crate::locate::IntrinsicsCovariance;
use nalgebra::{DMatrix, Matrix3, Vector3};
use resight_core::Camera;

/// Returns its contribution to the covariance of a small left rotation, rad².
pub(super) fn covariance(
    used: &[&Found],
    now_from_reference: &Matrix3<f64>,
    camera: &Camera,
    intrinsics: &IntrinsicsCovariance,
) -> Matrix3<f64> {
    let values: Vec<f64> = camera.parameters().iter().map(|(_, value)| *value).collect();
    let n = values.len();
    let covariance = DMatrix::from_row_slice(n, n, &intrinsics.covariance(camera));
    let mut derivative = DMatrix::zeros(3, n);
    for i in 0..n {
        // The step is small compared with the uncertainty itself, whose square root would exceed the linear range of a wide lens.
        let step = 1e-2 * covariance[(i, i)].max(0.0).sqrt();
        if step == 0.0 {
            continue;
        }
        let rotated = |by: f64| {
            let mut moved = values.clone();
            moved[i] += by;
            rotation(used, now_from_reference, &camera.with_parameters(&moved).ok()?)
        };
        if let (Some(plus), Some(minus)) = (rotated(step), rotated(-step)) {
            derivative.set_column(i, &((plus - minus) / (2.0 * step)));
        }
    }
    let added = &derivative * covariance * derivative.transpose();
    Matrix3::from_fn(|i, j| 0.5 * (added[(i, j)] + added[(j, i)]))
}

/// Returns the small left rotation by which the landmarks, seen through another lens, would correct the estimate, eq. (13).
fn rotation(used: &[&Found], now_from_reference: &Matrix3<f64>, camera: &Camera) -> Option<Vector3<f64>> {
    let (mut information, mut pull) = (Matrix3::zeros(), Vector3::zeros());
    for found in used {
        let (Ok(reference), Ok(now)) = (camera.bearing(&found.reference_px), camera.bearing(&found.now_px))
        else {
            continue; // Beyond the field of that lens.
        };
        let expected = now_from_reference * reference.into_inner();
        information += Matrix3::identity() - expected * expected.transpose();
        pull += expected.cross(&now.into_inner());
    }
    Some(information.cholesky()?.solve(&pull))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nominal::NominalLens;
    use nalgebra::{DVector, Rotation3, Vector2};
    use resight_core::camera::ImageSize;
    use resight_core::statistics::SplitMix64;

    /// Cameras drawn from the covariance of a nominal lens observe a rotation of 2°, which is measured with the nominal lens.
    #[test]
    fn the_covariance_of_a_nominal_lens_is_honest() {
        let size = ImageSize { width_px: 1280, height_px: 720 };
        let mut nominal = NominalLens::HorizontalFieldOfView(60.0).camera(size).expect("a camera");
        // Half of the distortion is used: with all of it, one lens in ten would fold within the image, which no real lens does.
        for c in nominal.intrinsics_covariance.iter_mut() {
            c[(4, 4)] *= 0.25;
        }
        let known = IntrinsicsCovariance::of(&nominal).expect("a covariance");
        let values: Vec<f64> = nominal.camera.parameters().iter().map(|(_, value)| *value).collect();
        // k2, p1 and p2 are exact: the factor is that of the others.
        let c =
            nominal.intrinsics_covariance.as_ref().expect("a covariance").view((0, 0), (5, 5)).into_owned();
        let factor = c.cholesky().expect("positive").l();
        let mut chance = SplitMix64::new(7);
        let truth = Rotation3::from_scaled_axis(Vector3::new(0.015, 0.03, 0.01)).into_inner();
        let draws = 300;
        let mut sum = Vector3::zeros();
        for _ in 0..draws {
            let z = DVector::from_fn(5, |_, _| chance.normal());
            let moved: Vec<f64> =
                values.iter().zip((&factor * z).iter().chain(&[0.0; 3])).map(|(a, b)| a + b).collect();
            let lens = nominal.camera.with_parameters(&moved).expect("a lens");
            let found: Vec<Found> = (0..60)
                .filter_map(|_| {
                    let at = Vector2::new(chance.uniform() * 1279.0, chance.uniform() * 719.0);
                    let now_px = lens.project(&(truth * lens.bearing(&at).ok()?.into_inner()))?;
                    Some(Found { reference_px: at, now_px })
                })
                .collect();
            let used: Vec<&Found> = found.iter().collect();
            let mut measured = truth;
            for _ in 0..3 {
                let correction = rotation(&used, &measured, &nominal.camera).expect("a rotation");
                measured = Rotation3::from_scaled_axis(correction).into_inner() * measured;
            }
            let error = Rotation3::from_matrix_unchecked(truth * measured.transpose()).scaled_axis();
            let share = covariance(&used, &measured, &nominal.camera, &known);
            // Each axis is tested separately: with five errors the three angles are nearly of rank two.
            sum += error.component_mul(&error).component_div(&share.diagonal());
        }
        let mean = sum / f64::from(draws);
        // The mean of 300 squares of normal numbers is accurate to 0.08; the limits allow four times that, and the curvature of such large
        // errors.
        assert!(mean.iter().all(|x| (0.7..1.4).contains(x)), "{mean}");
        let still = covariance(
            &[&Found { reference_px: Vector2::new(100.0, 50.0), now_px: Vector2::new(100.0, 50.0) }; 4],
            &Matrix3::identity(),
            &nominal.camera,
            &known,
        );
        assert!(still.amax() < 1e-20, "{still}");
    }
}
