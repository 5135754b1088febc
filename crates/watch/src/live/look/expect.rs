//! Predicts the positions of a target's features in the next image from the expected pose.

use resight_core::target::Feature;
use resight_core::temporal::track::Tracked;
use resight_core::{Camera, Matrix6, Pixel, Point, Target};

/// The points of a target by name, looked up once.
pub(super) struct Expectation {
    points: Vec<(Feature, Point)>,
    expected: Vec<(Feature, Pixel)>,
}

/// Standard deviations to each side of the predicted place.
const SIGMAS: f64 = 3.0;
/// Predictions with a larger uncertainty are not used, pixels.
const MOST_SPREAD_PX: f64 = 64.0;

impl Expectation {
    pub fn new(target: &Target) -> Self {
        let known = |feature| Some((feature, target.point(feature)?.position));
        Expectation {
            points: target.features().into_iter().filter_map(known).collect(),
            expected: Vec::new(),
        }
    }

    /// For each feature two opposite corners of the box that holds it; nothing while no pose is known.
    pub fn of(&mut self, predicted: Option<&Tracked>, camera: &Camera) -> &[(Feature, Pixel)] {
        self.expected.clear();
        if let Some(predicted) = predicted {
            for (feature, x_in_target) in &self.points {
                let x_in_cam = predicted.cam_from_target * *x_in_target;
                if let Some((pixel, spread)) = seen(camera, &x_in_cam, &predicted.covariance) {
                    self.expected.extend([(*feature, pixel - spread), (*feature, pixel + spread)]);
                }
            }
        }
        &self.expected
    }
}

/// Returns the position of a point in the image, and its uncertainty to each side; `None` where it is not visible.
fn seen(camera: &Camera, x_in_cam: &Point, covariance: &Matrix6) -> Option<(Pixel, Pixel)> {
    let (pixel, by_point) = camera.project_with_jacobian(x_in_cam)?;
    // A left motion [ω; ν] moves the point by ω × x + ν.
    let mut by_motion = nalgebra::Matrix2x6::zeros();
    by_motion.fixed_columns_mut::<3>(0).copy_from(&(-by_point * x_in_cam.cross_matrix()));
    by_motion.fixed_columns_mut::<3>(3).copy_from(&by_point);
    let variance_px2 = by_motion * covariance * by_motion.transpose();
    let spread = |i: usize| (SIGMAS * variance_px2[(i, i)].max(0.0).sqrt()).min(MOST_SPREAD_PX);
    Some((pixel, Pixel::new(spread(0), spread(1))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;
    use resight_core::camera::Pinhole;
    use resight_core::target::Tag;
    use resight_core::{Lens, Pose};

    fn camera() -> Camera {
        let matrix = resight_core::CameraMatrix { fx_px: 900.0, fy_px: 900.0, cx_px: 640.0, cy_px: 480.0 };
        Camera { lens: Lens::Pinhole(Pinhole::new(matrix).unwrap()), size: None }
    }

    fn tracked(motion: Vector6<f64>) -> Tracked {
        let cam_from_target = Pose::exp(&motion) * Pose::exp(&Vector6::new(0.2, -0.4, 0.1, 0.05, -0.1, 1.5));
        let covariance = Matrix6::from_diagonal(&Vector6::repeat(1e-6));
        Tracked {
            t_s: 0.0,
            cam_from_target,
            covariance,
            velocity: Vector6::zeros(),
            probability: 1.0,
            innovation_chi2: None,
            candidate: None,
        }
    }

    /// A pose drawn from the covariance shows each corner in its box: nearly always at three sigmas, and not at a third of one.
    #[test]
    fn the_box_holds_the_corner_as_often_as_its_sigmas_say() {
        let target = Target::Tag(Tag { family: "tag36h11".to_string(), id: 0, size_m: 0.16 });
        let mut expectation = Expectation::new(&target);
        let boxes = expectation.of(Some(&tracked(Vector6::zeros())), &camera()).to_vec();
        assert_eq!(boxes.len(), 8);
        let (mut within, mut close, mut n) = (0, 0, 0);
        let mut chance = resight::render::Pcg::new(3);
        let mut normal = || (0..12).map(|_| chance.uniform()).sum::<f64>() - 6.0;
        for _ in 0..5000 {
            let moved = tracked(Vector6::from_fn(|_, _| 1e-3 * normal()));
            for pair in boxes.chunks(2) {
                let x = moved.cam_from_target * target.point(pair[0].0).unwrap().position;
                let (middle, half) = ((pair[0].1 + pair[1].1) / 2.0, (pair[1].1 - pair[0].1) / 2.0);
                let off = camera().project(&x).unwrap() - middle;
                let share = (off.x / half.x).abs().max((off.y / half.y).abs());
                (within, close, n) =
                    (within + usize::from(share < 1.0), close + usize::from(share < 1.0 / 9.0), n + 1);
            }
        }
        assert!(
            0.99 * n as f64 <= within as f64 && (close as f64) < 0.2 * n as f64,
            "{within} {close} of {n}"
        );
    }

    #[test]
    fn nothing_known_nothing_expected() {
        let target = Target::Tag(Tag { family: "tag36h11".to_string(), id: 0, size_m: 0.16 });
        assert!(Expectation::new(&target).of(None, &camera()).is_empty());
    }
}
