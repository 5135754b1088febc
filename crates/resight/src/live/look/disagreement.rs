//! Do the points of a target disagree with each other about a motion? Half of them hidden, in a shadow or behind a drop of water are off to
//! one side while the others stay where they were: that is a fault of the observation, no motion of the camera.
//!
//! A single view of a few points cannot show it, because a pose of six numbers takes up nearly all that four corners can do. Against the place where
//! all is well it shows: hardly any motion leaves half of the points where they were. docs/watch.md, "States".

use nalgebra::{Matrix2, SMatrix, Vector2};
use resight_core::{Camera, Correspondence, Matrix6, Pose};

/// What a number that is fitted must explain, as χ²: 2 ln of how many times smaller its error is than what it might have been. Six for a motion,
/// two for each point that is off.
const PER_NUMBER: f64 = 6.4;
/// By how much the fault must be the better story, as χ²: than a motion, and than that nothing happened. Where the view before had one
/// it must only be better: what hides corners does so for a while.
const THAN_MOTION: f64 = 6.0;
const THAN_NOTHING: f64 = 10.0;

/// Whether some of the points, half at most, are off while the others are where the reference `cam_from_target` puts them, and that is the
/// likelier story than a motion to `now`. `covariance` is that of the place where all is well.
pub(super) fn disagree(
    seen: &[Correspondence],
    lens: &Camera,
    (cam_from_target, covariance): (&Pose, &Matrix6),
    now: &Pose,
    was_fault: bool,
) -> bool {
    let [than_motion, than_nothing] = if was_fault { [0.0; 2] } else { [THAN_MOTION, THAN_NOTHING] };
    let (mut away, mut nothing, mut fault) = (0, 0.0, 0.0);
    for point in seen {
        let Some(chi2) = off(point, lens, cam_from_target, Some(covariance)) else { return false };
        away += usize::from(2.0 * PER_NUMBER < chi2);
        nothing += chi2;
        fault += chi2.min(2.0 * PER_NUMBER);
    }
    if away == 0 || seen.len() < 2 * away || nothing < fault + than_nothing {
        return false;
    }
    let by_motion: Option<f64> = seen.iter().map(|point| off(point, lens, now, None)).sum();
    by_motion.is_some_and(|chi2| fault + than_motion < chi2 + 6.0 * PER_NUMBER)
}

/// χ² of a point against where a pose puts it.
fn off(point: &Correspondence, lens: &Camera, pose: &Pose, doubt: Option<&Matrix6>) -> Option<f64> {
    let x = *pose * point.x_in_target;
    let (pixel, by_x) = lens.project_with_jacobian(&x)?;
    let own = point.sigma_px * point.sigma_px + (by_x * point.sigma_m).norm_squared() / 2.0;
    let mut covariance = Matrix2::identity() * own;
    if let Some(doubt) = doubt {
        // Left motion: dx = ω × x + ν.
        let mut by_motion = SMatrix::<f64, 3, 6>::zeros();
        by_motion.fixed_view_mut::<3, 3>(0, 0).copy_from(&-x.cross_matrix());
        by_motion.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
        let by_motion = by_x * by_motion;
        covariance += by_motion * doubt * by_motion.transpose();
    }
    let residual: Vector2<f64> = point.pixel - pixel;
    Some(residual.dot(&covariance.cholesky()?.solve(&residual)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Pcg;
    use nalgebra::Vector6;
    use resight_core::camera::{CameraMatrix, Pinhole};
    use resight_core::{Lens, Point};

    const SIGMA_PX: f64 = 0.2;

    fn camera() -> Camera {
        let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 320.0, cy_px: 240.0 };
        Camera { lens: Lens::Pinhole(Pinhole::new(matrix).expect("a lens")), size: None }
    }

    fn home() -> Pose {
        Pose::exp(&Vector6::new(0.25, -0.45, 0.1, 0.12, -0.08, 1.2))
    }

    /// Corners of a tag of 120 mm from a pose, each off by what `fault` says.
    fn corners(pose: &Pose, seed: u64, fault: impl Fn(usize) -> Vector2<f64>) -> Vec<Correspondence> {
        let mut chance = Pcg::new(seed);
        let corner = |(i, (x, y)): (usize, (f64, f64))| {
            let point = Point::new(0.06 * x, 0.06 * y, 0.0);
            let noise = Vector2::from_fn(|_, _| SIGMA_PX * chance.normal());
            let pixel = camera().project(&(*pose * point)).expect("in front") + noise + fault(i);
            Correspondence::new(&camera(), point, pixel, SIGMA_PX).expect("a point")
        };
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].into_iter().enumerate().map(corner).collect()
    }

    fn says(seen: &[Correspondence]) -> bool {
        let estimate = resight_core::locate::locate(seen, &camera(), &Default::default()).expect("a pose");
        let known = Matrix6::from_diagonal(&Vector6::new(1e-8, 1e-8, 1e-8, 1e-9, 1e-9, 1e-9));
        disagree(seen, &camera(), (&home(), &known), &estimate.cam_from_target, false)
    }

    /// One or two corners off by a pixel and a third, in any direction and any pair: found in nearly all views, and in none where nothing is.
    #[test]
    fn corners_that_are_off_alone_are_found() {
        let (mut found, mut all, mut false_ones) = (0, 0, 0);
        for seed in 0..40 {
            false_ones += u32::from(says(&corners(&home(), seed, |_| Vector2::zeros())));
            for pair in [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 1]] {
                let angle = 0.7 * f64::from(all);
                let off = 1.3 * Vector2::new(angle.cos(), angle.sin());
                let fault = |i: usize| if pair.contains(&i) { off } else { Vector2::zeros() };
                found += u32::from(says(&corners(&home(), 1000 + seed, fault)));
                all += 1;
            }
        }
        println!("{found} of {all} found, {false_ones} of 40 falsely");
        assert!(90 * all < 100 * found && false_ones == 0, "{found} of {all}, {false_ones} falsely");
    }

    /// Turns about and shifts along each axis: a motion that one view shows is never taken for a fault; one that is just seen may be, in one of
    /// its views, seldom enough not to be late by more than a view.
    #[test]
    fn a_motion_is_no_disagreement() {
        let (mut false_ones, mut all) = (0, 0);
        for seed in 0..20 {
            for (axis, least) in [(0, 5e-4), (1, 5e-4), (2, 5e-3), (3, 5e-4), (4, 5e-4), (5, 3e-3)] {
                for size in [1.0, 2.0, 5.0, 20.0, -1.5, -6.0] {
                    let now = Pose::exp(&Vector6::ith(axis, size * least)).inverse() * home();
                    let seen = corners(&now, 7000 + seed, |_| Vector2::zeros());
                    let is_large = 5.0 < f64::abs(size);
                    assert!(!(is_large && says(&seen)), "{seed}: {size} × {least} of {axis}");
                    false_ones += u32::from(says(&seen));
                    all += 1;
                }
            }
        }
        assert!(20 * false_ones < all, "{false_ones} of {all}");
    }
}
