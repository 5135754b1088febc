//! The poses of a solved rig in other frames: between two cameras, and in the frame of a target at rest.

use crate::core::multiview::rig::{RigConfig, RigProblem, RigSolution, solve_rig};
use crate::core::{Error, Matrix6, Pose};

/// A pose with the 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, frame b.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UncertainPose {
    /// x_in_b = b_from_a · x_in_a.
    pub b_from_a: Pose,
    /// Covariance of a small motion on the left, frame b.
    pub covariance: Matrix6,
}

impl UncertainPose {
    /// Returns `a_from_b`.
    pub fn inverse(&self) -> Self {
        UncertainPose {
            b_from_a: self.b_from_a.inverse(),
            covariance: self.b_from_a.inverse_covariance(&self.covariance),
        }
    }
}

/// Returns camera b's frame from camera a's: b_from_a = b_from_rig · rig_from_a. The common part of their errors cancels, so that this needs the
/// joint covariance of all cameras; `None` without it.
///
/// The left motions are combined as ξ = ξ_b − Ad ξ_a with Ad of b_from_a, so that Σ = Σ_bb + Ad Σ_aa Adᵀ − Σ_ba Adᵀ − Ad Σ_ab.
pub fn between(solution: &RigSolution, a: usize, b: usize) -> Option<UncertainPose> {
    let joint = solution.joint_covariance.as_ref()?;
    let block = |i: usize, j: usize| -> Matrix6 { joint.fixed_view::<6, 6>(6 * i, 6 * j).into() };
    let b_from_a = solution.cameras[b].cam_from_rig * solution.cameras[a].cam_from_rig.inverse();
    let ad = b_from_a.adjoint();
    let mixed = block(b, a) * ad.transpose();
    let covariance = block(b, b) + ad * block(a, a) * ad.transpose() - mixed - mixed.transpose();
    Some(UncertainPose { b_from_a, covariance: (covariance + covariance.transpose()) * 0.5 })
}

/// The pose of a rig in the frame of a target at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct InWorld {
    /// World from rig.
    pub world_from_rig: UncertainPose,
    /// World from each camera, in their order.
    pub world_from_cam: Vec<UncertainPose>,
}

/// Computes the poses of the rig and of each camera in the frame of the target that alone is observed in `view`.
///
/// The covariance of a camera in the world is not the sum of its covariance in the rig and the rig's in the world, because both depend on the
/// same points. The rig is solved again with that camera as the reference: then its frame is the frame of the rig, with its full covariance.
///
/// # Errors
/// The errors of `solve_rig`; `NoSolution` when no observation of the view took part.
pub fn in_world(
    problem: &RigProblem,
    config: &RigConfig,
    solution: &RigSolution,
    view: usize,
) -> Result<InWorld, Error> {
    let world_from_rig = rig_in_world(solution, view)?;
    let in_world = |camera: usize| {
        if camera == config.reference {
            return Ok(world_from_rig);
        }
        rig_in_world(&solve_rig(problem, &RigConfig { reference: camera, ..*config })?, view)
    };
    let world_from_cam = (0..problem.cameras.len()).map(in_world).collect::<Result<_, Error>>()?;
    Ok(InWorld { world_from_rig, world_from_cam })
}

fn rig_in_world(solution: &RigSolution, view: usize) -> Result<UncertainPose, Error> {
    let body =
        solution.bodies.iter().find(|body| body.view == view).ok_or(Error::NoSolution { n_points: 0 })?;
    Ok(UncertainPose { b_from_a: body.rig_from_body, covariance: body.covariance }.inverse())
}
