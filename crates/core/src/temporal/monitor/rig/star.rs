//! One frame set: every camera that sees a target says where it stands; together they say where the target is, and each then how
//! far it is from there.
//!
//! ```text
//!   y_c = Log(cam_from_rig · rig_from_target · (cam_from_target seen)⁻¹)      P_c its covariance from the pixels alone
//! ```
//! The target's place is a nuisance that the filter takes out; here it only has to be near, so that (18) of docs/math/monitor.md
//! is linear, and on the branch of each planar view that agrees with the other cameras.

use crate::locate::PoseEstimate;
use crate::locate::refine::information;
use crate::temporal::snapshot::numbers;
use crate::{Camera, Correspondence, Matrix6, Pose, Vector6};
use nalgebra::Matrix2x6;

/// The observation of one target by one camera in a frame set.
#[derive(Debug, Clone, Copy)]
pub struct TargetObservation<'a> {
    /// Which camera.
    pub camera: usize,
    /// Which target.
    pub target: usize,
    /// Its lens.
    pub lens: &'a Camera,
    /// Known points and where they were seen.
    pub seen: &'a [Correspondence],
    /// All poses that they allow.
    pub estimate: &'a PoseEstimate,
}

/// Where a camera stands against the target of a frame set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct CameraReading {
    pub camera: usize,
    /// y: as if the camera had moved, old_from_new of its own frame.
    pub motion: Vector6,
    /// P, of pixels with the stated sigmas.
    pub covariance: Matrix6,
}

/// A camera that seems to have moved farther than this may be on another branch of its view: radians, and share of the target's
/// distance.
const SMALL: f64 = 0.3;
/// Steps of one camera alone, and the χ² of a step that is the last.
const STEPS_ALONE: usize = 12;
const CONVERGED: f64 = 1e-3;
/// Starts that are refined.
const STARTS: usize = 3;
/// Steps of the refinement; it only has to come near.
const STEPS: usize = 6;
/// Squared discrepancy of a camera, in units of its stated noise, beyond which the others count for more: stated noise is often
/// five times too small, so that those that agree within that are all heard.
const ROBUST: f64 = 6.0 * 25.0;

/// Pixels of one camera about a pose: information H and score of a left motion of cam_from_target.
struct Linear {
    information: Matrix6,
    score: Vector6,
}

/// The observations of a target in a frame set; fewer than two cameras determine no relative pose.
pub(super) fn star(target_observations: &[TargetObservation], cam_from_rig: &[Pose]) -> Vec<CameraReading> {
    if target_observations.len() < 2 {
        return Vec::new();
    }
    let Some(rig_from_target) = consensus(target_observations, cam_from_rig) else { return Vec::new() };
    let reading = |target_observation: &TargetObservation| {
        reading(target_observation, &(cam_from_rig[target_observation.camera] * rig_from_target))
    };
    target_observations.iter().filter_map(reading).collect()
}

fn reading(target_observation: &TargetObservation, predicted_from_target: &Pose) -> Option<CameraReading> {
    let near = linear(target_observation, predicted_from_target).and_then(|linear| {
        let covariance = inverse(&linear.information)?;
        let step = covariance * linear.score;
        let is_near = linear.score.dot(&step) < ROBUST;
        is_near.then(|| CameraReading { camera: target_observation.camera, motion: -step, covariance })
    });
    near.or_else(|| reached(target_observation, predicted_from_target))
        .or_else(|| own(target_observation, predicted_from_target))
}

/// The minimum that the camera's own pixels lead to. Far from it one step would err by more than the pixels do, and most where a rotation and a
/// shift look alike.
fn reached(target_observation: &TargetObservation, predicted_from_target: &Pose) -> Option<CameraReading> {
    let mut cam_from_target = *predicted_from_target;
    for _ in 0..STEPS_ALONE {
        let linear = linear(target_observation, &cam_from_target)?;
        let covariance = inverse(&linear.information)?;
        let step = covariance * linear.score;
        cam_from_target = Pose::exp(&step) * cam_from_target;
        if linear.score.dot(&step) < CONVERGED {
            let motion = (*predicted_from_target * cam_from_target.inverse()).log();
            let is_small = motion.fixed_rows::<3>(0).norm() < SMALL
                && motion.fixed_rows::<3>(3).norm() < SMALL * predicted_from_target.translation.norm();
            return is_small.then_some(CameraReading {
                camera: target_observation.camera,
                motion,
                covariance,
            });
        }
    }
    None
}

/// The camera's own pose, the minimum that is nearest: where it turned far, a step from the predicted pose leads nowhere.
fn own(target_observation: &TargetObservation, predicted_from_target: &Pose) -> Option<CameraReading> {
    let away = |pose: &Pose| (*predicted_from_target * pose.inverse()).log();
    let readings = target_observation.estimate.minima().map(|hypothesis| CameraReading {
        camera: target_observation.camera,
        motion: away(&hypothesis.minimum.cam_from_target),
        covariance: hypothesis.minimum.covariance,
    });
    let turn = |reading: &CameraReading| reading.motion.fixed_rows::<3>(0).norm();
    readings.min_by(|a, b| turn(a).total_cmp(&turn(b)))
}

/// The target's place that most cameras agree with.
fn consensus(target_observations: &[TargetObservation], cam_from_rig: &[Pose]) -> Option<Pose> {
    let mut starts: Vec<(f64, Pose)> = Vec::new();
    for target_observation in target_observations {
        for hypothesis in target_observation.estimate.minima() {
            let start =
                cam_from_rig[target_observation.camera].inverse() * hypothesis.minimum.cam_from_target;
            starts.push((disagreement(target_observations, cam_from_rig, &start), start));
        }
    }
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let refined = starts.iter().take(STARTS).map(|(_, start)| {
        let refined = refined(target_observations, cam_from_rig, start);
        (disagreement(target_observations, cam_from_rig, &refined), refined)
    });
    refined.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(cost, _)| cost.is_finite()).map(|(_, pose)| pose)
}

/// Σ ln(1 + χ² a point): a camera that is far off counts little more than one that is somewhat off.
fn disagreement(
    target_observations: &[TargetObservation],
    cam_from_rig: &[Pose],
    rig_from_target: &Pose,
) -> f64 {
    /// Points behind a camera or outside its field.
    const HOPELESS: f64 = 1e8;
    let of = |target_observation: &TargetObservation| {
        let cam_from_target = cam_from_rig[target_observation.camera] * *rig_from_target;
        let chi2 = target_observation.seen.iter().map(|c| {
            let seen = crate::locate::refine::whitened_residual(&cam_from_target, c, target_observation.lens);
            seen.map_or(HOPELESS, |(_, _, whitened)| whitened)
        });
        (1.0 + chi2.sum::<f64>() / target_observation.seen.len().max(1) as f64).ln()
    };
    target_observations.iter().map(of).sum()
}

/// Gauss–Newton steps, cameras weighted down as they disagree.
fn refined(target_observations: &[TargetObservation], cam_from_rig: &[Pose], start: &Pose) -> Pose {
    let mut rig_from_target = *start;
    for _ in 0..STEPS {
        let (mut normal, mut score) = (Matrix6::zeros(), Vector6::zeros());
        for target_observation in target_observations {
            let place = cam_from_rig[target_observation.camera];
            let Some(linear) = linear(target_observation, &(place * rig_from_target)) else { continue };
            let Some(covariance) = inverse(&linear.information) else { continue };
            let weight = 1.0 / (1.0 + linear.score.dot(&(covariance * linear.score)) / ROBUST);
            let ad = place.adjoint();
            normal += ad.transpose() * linear.information * ad * weight;
            score += ad.transpose() * linear.score * weight;
        }
        let Some(step) = inverse(&normal).map(|covariance| covariance * score) else { break };
        rig_from_target = Pose::exp(&step) * rig_from_target;
        if step.norm() < 1e-6 {
            break;
        }
    }
    rig_from_target
}

/// None where a point leaves the camera's field.
fn linear(target_observation: &TargetObservation, cam_from_target: &Pose) -> Option<Linear> {
    let mut sums = Linear { information: Matrix6::zeros(), score: Vector6::zeros() };
    for c in target_observation.seen {
        let x = cam_from_target * &c.x_in_target;
        let (pixel, by_point) = target_observation.lens.project_with_jacobian(&x)?;
        let weight = information(c, &by_point);
        // x moves by ω × x + v: the derivative is [−Π [x]× , Π].
        let mut by_motion = Matrix2x6::zeros();
        by_motion.fixed_view_mut::<2, 3>(0, 0).copy_from(&(-by_point * x.cross_matrix()));
        by_motion.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_point);
        sums.information += by_motion.transpose() * weight * by_motion;
        sums.score += by_motion.transpose() * weight * (c.pixel - pixel);
    }
    Some(sums)
}

/// Radians and metres scaled alike first; none where it is singular.
pub(super) fn inverse(matrix: &Matrix6) -> Option<Matrix6> {
    let scale = matrix.diagonal().map(|v| 1.0 / v.sqrt());
    if !scale.iter().all(|s| s.is_finite()) {
        return None;
    }
    let inverse = Matrix6::from_fn(|i, j| matrix[(i, j)] * scale[i] * scale[j]).cholesky()?.inverse();
    let back = Matrix6::from_fn(|i, j| inverse[(i, j)] * scale[i] * scale[j]);
    back.iter().all(|v| v.is_finite()).then_some(back)
}

numbers!(CameraReading { camera, motion, covariance });
