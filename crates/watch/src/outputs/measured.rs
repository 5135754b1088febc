//! The pose of a frame alone, with its residual and covariance.

use crate::history::Measured;
use crate::live::Observation;

/// Returns the minimum that tracking selected, with its residual: the minimum that fits best may be the flipped pose. Without tracking (cameras
/// of a rig against a hand-held target) it is the one that fits best.
pub fn measured(observation: &Observation) -> Option<Measured> {
    let estimate = observation.estimate.as_ref()?;
    let (cam_from_target, covariance, rms_px) =
        (estimate.cam_from_target, estimate.covariance, estimate.rms_px);
    let Some(reading) = &observation.reading else {
        return Some(Measured { cam_from_target, covariance, rms_px });
    };
    let mut others = estimate.others.iter().flatten().map(|other| &other.minimum);
    let chosen = others.find(|minimum| minimum.cam_from_target == reading.a_from_b);
    Some(Measured {
        cam_from_target: reading.a_from_b,
        covariance: reading.covariance,
        rms_px: chosen.map_or(rms_px, |minimum| minimum.rms_px),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use resight::core::camera::Pinhole;
    use resight::core::locate::{Config, PoseEstimate, locate};
    use resight::core::temporal::monitor::Reading;
    use resight::core::{Camera, CameraMatrix, Correspondence, Lens, Point, Pose};

    /// Returns an estimate for a small, distant, tilted square: its flipped pose is a second minimum.
    fn estimate() -> PoseEstimate {
        let matrix = CameraMatrix { fx_px: 900.0, fy_px: 900.0, cx_px: 640.0, cy_px: 480.0 };
        let camera = Camera { lens: Lens::Pinhole(Pinhole::new(matrix).expect("a lens")), size: None };
        let cam_from_target = Pose::exp(&[0.4, 0.2, 0.1, 0.0, 0.0, 2.0].into());
        let corners = [[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]];
        let seen = corners.map(|[x, y]| {
            let x_in_target = Point::new(x, y, 0.0);
            let pixel = camera.project(&(cam_from_target * x_in_target)).expect("in the image");
            Correspondence::new(&camera, x_in_target, pixel, 0.3).expect("a point")
        });
        locate(&seen, &camera, &Config::default()).expect("a pose")
    }

    #[test]
    fn pose_and_residual_are_of_one_minimum() {
        let estimate = estimate();
        let other = estimate.others.iter().flatten().next().expect("the flipped pose").minimum;
        assert!(estimate.rms_px < 0.5 * other.rms_px, "{} {}", estimate.rms_px, other.rms_px);
        let reading = |cam_from_target, covariance| Reading {
            t_s: 0.0,
            a_from_b: cam_from_target,
            covariance,
            is_consistent: true,
        };
        let of = |reading| {
            let seen = Observation { estimate: Some(estimate), reading, ..Observation::default() };
            measured(&seen).expect("a pose")
        };
        let first = Measured {
            cam_from_target: estimate.cam_from_target,
            covariance: estimate.covariance,
            rms_px: estimate.rms_px,
        };
        assert_eq!(of(None), first);
        assert_eq!(of(Some(reading(estimate.cam_from_target, estimate.covariance))), first);
        let flipped = of(Some(reading(other.cam_from_target, other.covariance)));
        assert_eq!((flipped.cam_from_target, flipped.rms_px), (other.cam_from_target, other.rms_px));
        assert_eq!(measured(&Observation::default()), None);
    }
}
