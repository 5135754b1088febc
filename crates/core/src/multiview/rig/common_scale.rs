//! The effect of an uncertain size of the targets on a rig: all lengths change together. docs/math/printed_scale.md section 3.

use super::RigSolution;
use crate::budget::ErrorSource;
use crate::{Matrix6, Pose, Vector6};
use nalgebra::{DMatrix, DVector};

/// Returns the left motion of a pose for one unit of relative scale, eq. (8): its translation grows, its rotation is constant.
fn grows(b_from_a: &Pose) -> Vector6 {
    let t = b_from_a.translation;
    Vector6::new(0.0, 0.0, 0.0, t.x, t.y, t.z)
}

/// Adds the same to the covariance of several poses together.
fn add_joint<'a>(joint: &mut DMatrix<f64>, poses: impl Iterator<Item = &'a Pose>, sigma: f64) {
    let all = poses.flat_map(|pose| (grows(pose) * sigma).data.0[0]);
    let all = DVector::from_iterator(joint.nrows(), all);
    *joint += &all * all.transpose();
}

impl RigSolution {
    /// Adds a common relative standard deviation of all lengths to every covariance.
    pub(super) fn add_scale(&mut self, sigma: f64) {
        let add = |covariance: &mut Matrix6, pose: &Pose| {
            let by = grows(pose) * sigma;
            *covariance += by * by.transpose();
        };
        self.cameras.iter_mut().for_each(|c| add(&mut c.covariance, &c.cam_from_rig));
        for (budget, camera) in self.budgets.iter_mut().zip(&self.cameras) {
            let mut part = Matrix6::zeros();
            add(&mut part, &camera.cam_from_rig);
            budget.add(ErrorSource::Target, &part);
        }
        self.targets.iter_mut().for_each(|t| add(&mut t.covariance, &t.body_from_target));
        self.bodies.iter_mut().for_each(|b| add(&mut b.covariance, &b.rig_from_body));
        if let Some(joint) = &mut self.joint_covariance {
            add_joint(joint, self.cameras.iter().map(|c| &c.cam_from_rig), sigma);
        }
        if let Some(joint) = &mut self.joint_targets {
            add_joint(joint, self.targets.iter().map(|t| &t.body_from_target), sigma);
        }
    }
}
