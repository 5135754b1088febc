//! The unknowns of a rig, and the dependence of an observation on them: docs/math/rig.md eqs. (1), (3)–(7).

use crate::least_squares::PivotedPose;
use crate::{Matrix6, Point, Pose, Vector6};
use nalgebra::{DVector, Matrix3, Vector3};

/// The poses of all cameras, targets and bodies.
#[derive(Debug, Clone)]
pub struct RigPoses {
    /// One for each camera.
    pub cam_from_rig: Vec<Pose>,
    /// One for each target, stored with the target's pivot.
    pub body_from_target: Vec<PivotedPose>,
    /// One for each body in a view, stored with the body's pivot.
    pub rig_from_body: Vec<PivotedPose>,
}

/// The unknowns on which each observation depends.
#[derive(Debug, Clone)]
pub struct RigGraph {
    /// The observations, those of one body in one view adjacent and in the order of `RigPoses::rig_from_body`.
    pub links: Vec<RigLink>,
    /// Block of unknowns of each camera; `None` for the reference.
    pub block_of_camera: Vec<Option<usize>>,
    /// Block of unknowns of each target; `None` where its frame is that of its body.
    pub block_of_target: Vec<Option<usize>>,
    /// Number of blocks of six unknowns that all views share.
    pub n_blocks: usize,
    /// Pivot of each body in a view, body frame.
    pub pivot_in_body: Vec<Point>,
    /// Whether each body in a view takes part.
    pub is_active: Vec<bool>,
}

/// One observation.
#[derive(Debug, Clone, Copy)]
pub struct RigLink {
    /// Index of the camera.
    pub camera: usize,
    /// Index of the target.
    pub target: usize,
    /// Index of the body in a view.
    pub body: usize,
}

/// A pose stored with a pivot, and the chain of poses behind it: the dependence of an observation's points on all three poses.
pub(super) struct Chain {
    pub(super) place: PivotedPose,
    /// Body to camera.
    body_rotation: Matrix3<f64>,
    /// Vector from the body's pivot to the target's, rig frame.
    arm: Vector3<f64>,
}

impl RigPoses {
    /// Returns cam_from_target of an observation, stored with the target's pivot.
    pub fn of_link(&self, link: &RigLink, graph: &RigGraph) -> PivotedPose {
        self.chain(link, graph).place
    }

    pub(super) fn chain(&self, link: &RigLink, graph: &RigGraph) -> Chain {
        let (camera, body) = (&self.cam_from_rig[link.camera], &self.rig_from_body[link.body]);
        let target = &self.body_from_target[link.target];
        let arm = body.rotation * (target.pivot_in_cam - graph.pivot_in_body[link.body]);
        let pivot_in_cam = *camera * (body.pivot_in_cam + arm);
        let body_rotation = camera.rotation * body.rotation;
        Chain {
            place: PivotedPose { rotation: body_rotation * target.rotation, pivot_in_cam },
            body_rotation,
            arm,
        }
    }

    /// Applies a motion of each body in a view, and six numbers of `change` for each shared block.
    pub(super) fn moved(&self, motions: &[Vector6], change: &DVector<f64>, graph: &RigGraph) -> Self {
        let change = |block: usize| -> Vector6 { change.fixed_rows::<6>(6 * block).into() };
        let camera = |(pose, block): (&Pose, &Option<usize>)| block.map_or(*pose, |b| pose.moved(&change(b)));
        let target = |(place, block): (&PivotedPose, &Option<usize>)| {
            block.map_or(*place, |b| place.moved(&change(b)))
        };
        RigPoses {
            cam_from_rig: self.cam_from_rig.iter().zip(&graph.block_of_camera).map(camera).collect(),
            body_from_target: self.body_from_target.iter().zip(&graph.block_of_target).map(target).collect(),
            rig_from_body: self.rig_from_body.iter().zip(motions).map(|(p, m)| p.moved(m)).collect(),
        }
    }
}

/// Returns the matrix for R and an arm d: the motion [ω; ν] about one point, in another frame and about a point d away, docs/math/rig.md eqs.
/// (3)–(4).
fn carried(rotation: &Matrix3<f64>, arm: &Vector3<f64>) -> Matrix6 {
    let mut m = Matrix6::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation);
    m.fixed_view_mut::<3, 3>(3, 0).copy_from(&(rotation * -arm.cross_matrix()));
    m
}

impl Chain {
    /// Returns the observation's motion with that of each of its poses, docs/math/rig.md eqs. (5)–(7).
    pub(super) fn by_camera(&self) -> Matrix6 {
        carried(&Matrix3::identity(), &self.place.pivot_in_cam)
    }

    pub(super) fn by_body(&self, cam_rotation: &Matrix3<f64>) -> Matrix6 {
        carried(cam_rotation, &self.arm)
    }

    pub(super) fn by_target(&self) -> Matrix6 {
        carried(&self.body_rotation, &Vector3::zeros())
    }
}
