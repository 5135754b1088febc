//! The unknowns of a rig, and how an observation hangs on them: docs/math/rig.md eqs. (1), (3)–(7).

use crate::least_squares::PivotedPose;
use crate::{Matrix6, Point, Pose, Vector6};
use nalgebra::{DVector, Matrix3, Vector3};

/// Where everything is.
#[derive(Debug, Clone)]
pub struct RigPoses {
    /// One a camera.
    pub cam_from_rig: Vec<Pose>,
    /// One a target, held by the target's pivot.
    pub body_from_target: Vec<PivotedPose>,
    /// One a body in a view, held by the body's pivot.
    pub rig_from_body: Vec<PivotedPose>,
}

/// Which observation touches what.
#[derive(Debug, Clone)]
pub struct RigGraph {
    /// The observations, those of one body in one view side by side and in the order of `RigPoses::rig_from_body`.
    pub links: Vec<RigLink>,
    /// Block of unknowns of each camera; none for the reference.
    pub block_of_camera: Vec<Option<usize>>,
    /// Block of unknowns of each target; none where it carries its body's frame.
    pub block_of_target: Vec<Option<usize>>,
    /// How many blocks of six unknowns are shared by all views.
    pub n_blocks: usize,
    /// Pivot of each body in a view, body frame.
    pub pivot_in_body: Vec<Point>,
    /// Bodies in views that take part.
    pub is_active: Vec<bool>,
}

/// One observation.
#[derive(Debug, Clone, Copy)]
pub struct RigLink {
    /// Which camera.
    pub camera: usize,
    /// Which target.
    pub target: usize,
    /// Which body in which view.
    pub body: usize,
}

/// A pose held by a pivot and the pose itself, unrolled: how an observation's points hang on all three places.
pub(super) struct Chain {
    pub(super) place: PivotedPose,
    /// Body to camera.
    body_rotation: Matrix3<f64>,
    /// From the body's pivot to the target's, rig frame.
    arm: Vector3<f64>,
}

impl RigPoses {
    /// cam_from_target of an observation, held by the target's pivot.
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

    /// A motion for each body in a view, and six numbers of `change` for each shared block.
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

/// R and an arm d: the motion [ω; ν] about one point, seen in another frame and about a point d farther, docs/math/rig.md eqs. (3)–(4).
fn carried(rotation: &Matrix3<f64>, arm: &Vector3<f64>) -> Matrix6 {
    let mut m = Matrix6::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation);
    m.fixed_view_mut::<3, 3>(3, 0).copy_from(&(rotation * -arm.cross_matrix()));
    m
}

impl Chain {
    /// The observation's motion by that of each of its places, docs/math/rig.md eqs. (5)–(7).
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
