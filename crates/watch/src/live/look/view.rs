//! The results of one view: its residuals, all minima of its pose, and the reading for the monitor.

use crate::live::PointResidual;
use crate::source::Frame;
use resight_core::locate::PoseEstimate;
use resight_core::locate::refine::residual_px;
use resight_core::temporal::monitor::Reading;
use resight_core::temporal::track::{Candidate, Tracked};
use resight_core::{Camera, Correspondence};

/// χ² of two numbers that one point in a hundred exceeds.
const ODD: f64 = 9.21;

/// Returns the residual of each point at the pose; points outside the range of the lens model are left out.
pub(super) fn residuals(
    estimate: &PoseEstimate,
    points: &[Correspondence],
    lens: &Camera,
) -> Vec<PointResidual> {
    let residual = |c: &Correspondence| {
        let px = residual_px(&estimate.cam_from_target, c, lens)?;
        let agrees = px.norm_squared() <= ODD * c.sigma_px * c.sigma_px;
        Some(PointResidual { pixel: c.pixel, residual_px: px.into(), agrees })
    };
    points.iter().filter_map(residual).collect()
}

/// Returns all minima of a frame; tracking selects one of them.
pub(super) fn candidates(estimate: &PoseEstimate) -> Vec<Candidate> {
    let first = Candidate {
        cam_from_target: estimate.cam_from_target,
        covariance: estimate.covariance,
        probability: estimate.probability,
    };
    let others = estimate.others.iter().flatten().map(|other| Candidate {
        cam_from_target: other.minimum.cam_from_target,
        covariance: other.minimum.covariance,
        probability: other.probability,
    });
    std::iter::once(first).chain(others).collect()
}

/// Returns the frame's own pose, at the minimum that tracking selected: a filtered pose must not be tested for white noise.
pub(super) fn reading(frame: &Frame, is_consistent: bool, all: &[Candidate], tracked: &Tracked) -> Reading {
    let chosen = tracked.candidate.and_then(|i| all.get(i)).unwrap_or(&all[0]);
    Reading {
        t_s: frame.capture_s,
        a_from_b: chosen.cam_from_target,
        covariance: chosen.covariance,
        is_consistent,
    }
}
