//! The share of uncertain parameters that are not adjusted in a rig's covariances, intrinsics as stated and sizes that are off: docs/math/rig.md
//! eq. (21).
//!
//! The derivative of every pose by a camera's parameters is D = H⁻¹K, with K = JᵀWP and P the derivative of the pixels by the parameters, which
//! adds D C Dᵀ. The intrinsics are not adjusted: the minimum is that of the problem stated.

use super::adjust::Adjusted;
use super::layout::Layout;
use super::scale::by_size;
use super::{TargetScale, UncertainTags};
use crate::covariance::is_covariance;
use crate::least_squares::rig::{Common, Eliminated, RigLink};
use crate::locate::common::check_intrinsics_covariance;
use crate::locate::refine::whitening;
use crate::{Camera, Correspondence, Error, Matrix6, Point, Vector6};
use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix3, Matrix6xX, Vector2, Vector3};

/// What the adjusted lenses add to the answer.
pub(super) struct Free {
    /// The cameras, and the covariance of all of their parameters.
    pub(super) cameras: Vec<usize>,
    pub(super) covariance: DMatrix<f64>,
    /// The number of parameters that the pixels determine, instead of what was known before.
    pub(super) n_determined: usize,
}

/// Uncertain parameters of one camera or target, or of all lenses that were adjusted together.
struct Uncertain {
    covariance: DMatrix<f64>,
    /// One entry for each parameter.
    following: Vec<Common>,
}

/// All parameters that are not exact.
pub(super) struct UncertainParameters {
    each: Vec<Uncertain>,
}

impl UncertainParameters {
    /// Returns the intrinsics; `covariances` has one entry for each camera, with an empty list all are exact. `free` ones have one covariance
    /// together instead.
    pub(super) fn of_lenses(
        covariances: &[Option<DMatrix<f64>>],
        free: Option<&Free>,
        (layout, adjusted, eliminated): (&Layout, &Adjusted, &Eliminated),
    ) -> Self {
        let following = |camera: usize| {
            let common = by_parameters(camera, layout, adjusted).common;
            common.into_iter().map(|c| adjusted.equations.following(eliminated, &c, true))
        };
        let is_free = |camera: &usize| free.is_some_and(|free| free.cameras.contains(camera));
        let uncertain = |(camera, covariance): (usize, &Option<DMatrix<f64>>)| {
            let covariance = covariance.clone().filter(|_| !is_free(&camera))?;
            Some(Uncertain { covariance, following: following(camera).collect() })
        };
        let together = |free: &Free| Uncertain {
            covariance: free.covariance.clone(),
            following: free.cameras.iter().flat_map(|camera| following(*camera)).collect(),
        };
        let apart = covariances.iter().enumerate().filter_map(uncertain);
        let free = free.filter(|free| !free.cameras.is_empty());
        UncertainParameters { each: apart.chain(free.map(together)).collect() }
    }

    /// Returns the sizes of targets that are clearly off, each as uncertain as it is off: docs/math/budget.md eq. (12).
    pub(super) fn of_sizes(
        scales: &[TargetScale],
        layout: &Layout,
        adjusted: &Adjusted,
        eliminated: &Eliminated,
    ) -> Self {
        let off = scales.iter().enumerate().filter(|(_, scale)| scale.is_clearly_off());
        let uncertain = |(target, scale): (usize, &TargetScale)| {
            let squared = (scale.ratio - 1.0).powi(2) + scale.sigma * scale.sigma;
            let common = by_size(target, layout, adjusted).common;
            Uncertain {
                covariance: DMatrix::from_element(1, 1, squared),
                following: vec![adjusted.equations.following(eliminated, &common, true)],
            }
        };
        UncertainParameters { each: off.map(uncertain).collect() }
    }

    /// Adds the poses of tags on their targets.
    pub(super) fn with_tags(
        mut self,
        groups: &[UncertainTags],
        layout: &Layout,
        adjusted: &Adjusted,
        eliminated: &Eliminated,
    ) -> Self {
        for group in groups {
            let of_tag = |corners: &[Point; 4]| by_tag((group.target, corners), layout, adjusted).common;
            let common = group.corners_in_target.iter().flat_map(of_tag);
            let following = common.map(|c| adjusted.equations.following(eliminated, &c, true)).collect();
            self.each.push(Uncertain { covariance: group.covariance.clone(), following });
        }
        self
    }

    /// Returns parameters with this covariance and K for each, where there are any.
    pub(super) fn of_common(
        known: Option<(&DMatrix<f64>, Vec<Common>)>,
        adjusted: &Adjusted,
        eliminated: &Eliminated,
    ) -> Self {
        let uncertain = |(covariance, common): (&DMatrix<f64>, Vec<Common>)| {
            let following = common.iter().map(|c| adjusted.equations.following(eliminated, c, true));
            Uncertain { covariance: covariance.clone(), following: following.collect() }
        };
        UncertainParameters { each: known.map(uncertain).into_iter().collect() }
    }

    /// Adds the share to the covariance of the shared blocks.
    pub(super) fn add_to_shared(&self, covariance: &mut DMatrix<f64>) {
        for lens in &self.each {
            let moved = DMatrix::from_fn(covariance.nrows(), lens.following.len(), |i, k| {
                lens.following[k].shared[i]
            });
            *covariance += &moved * &lens.covariance * moved.transpose();
        }
    }

    /// Adds the share to the covariance of a body in a view.
    pub(super) fn add_to_body(&self, covariance: &mut Matrix6, body: usize) {
        for lens in &self.each {
            let columns: Vec<Vector6> = lens.following.iter().map(|f| f.bodies[body]).collect();
            let moved = Matrix6xX::from_columns(&columns);
            let added = &moved * &lens.covariance * moved.transpose();
            *covariance += added;
        }
    }
}

/// Sums over points that take part, P the derivatives of their pixels by some parameters.
pub(super) struct ByParameters {
    /// K = JᵀWP, one entry for each parameter.
    pub(super) common: Vec<Common>,
    /// PᵀWP.
    pub(super) own: DMatrix<f64>,
    /// PᵀWr, r the residuals.
    pub(super) pull: DVector<f64>,
}

/// Sums over the points of one camera, for the parameters of its lens.
pub(super) fn by_parameters(camera: usize, layout: &Layout, adjusted: &Adjusted) -> ByParameters {
    let lens = &layout.problem.cameras[camera];
    let columns = |at: &PointAt| Some(lens.intrinsics_jacobian(&at.x_in_cam)?.to_vec());
    sums(lens.parameters().len(), layout, adjusted, |link| link.camera == camera, columns)
}

/// Sums over the corners of a tag, for its left motion in the frame of its target.
fn by_tag((target, corners): (usize, &[Point; 4]), layout: &Layout, adjusted: &Adjusted) -> ByParameters {
    let columns = |at: &PointAt| {
        let is_own = |corner: &Point| (corner - at.x_in_target).norm() <= SAME_CORNER * at.x_in_target.norm();
        if !corners.iter().any(is_own) {
            return None;
        }
        let by_point = at.jacobian * at.cam_from_target;
        let unit = |k: usize| Vector3::ith(k % 3, 1.0);
        let moved = |k: usize| if k < 3 { unit(k).cross(&at.x_in_target) } else { unit(k) };
        Some((0..6).map(|k| by_point * moved(k)).collect())
    };
    sums(6, layout, adjusted, |link| link.target == target, columns)
}

/// Corners nearer to each other than this part of their distance from the origin are one.
const SAME_CORNER: f64 = 1e-9;

/// A point that takes part, and its projection.
pub(super) struct PointAt<'a> {
    pub(super) seen: &'a Correspondence,
    pub(super) x_in_target: Point,
    pub(super) x_in_cam: Point,
    pub(super) cam_from_target: Matrix3<f64>,
    pub(super) jacobian: Matrix2x3<f64>,
}

/// Sums over the points of some links, `columns` the derivatives of a pixel by each of `n` parameters; points without any are left out.
fn sums(
    n: usize,
    layout: &Layout,
    adjusted: &Adjusted,
    takes: impl Fn(&RigLink) -> bool,
    columns: impl Fn(&PointAt) -> Option<Vec<Vector2<f64>>>,
) -> ByParameters {
    let (places, graph) = (&adjusted.places, &adjusted.graph);
    let mut common: Vec<Common> = (0..n).map(|_| Common::new(graph)).collect();
    let (mut own, mut pull) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for (i, link) in
        graph.links.iter().enumerate().filter(|(_, link)| takes(link) && graph.is_active[link.body])
    {
        let of_link = sums_of(i, n, layout, adjusted, &columns);
        own += of_link.own;
        pull += of_link.pull;
        for (common, by) in common.iter_mut().zip(&of_link.by_motion) {
            common.add(places, graph, link, by);
        }
    }
    ByParameters { common, own, pull }
}

/// Sums over the points of one observation.
pub(super) struct OfObservation {
    /// JᵀWP by the motion of its pose about the target's pivot, one entry for each parameter.
    pub(super) by_motion: Vec<Vector6>,
    /// PᵀWP.
    pub(super) own: DMatrix<f64>,
    /// PᵀWr.
    pub(super) pull: DVector<f64>,
}

/// Sums over the points of one observation that take part.
pub(super) fn sums_of(
    observation: usize,
    n: usize,
    layout: &Layout,
    adjusted: &Adjusted,
    columns: impl Fn(&PointAt) -> Option<Vec<Vector2<f64>>>,
) -> OfObservation {
    let link = &adjusted.graph.links[observation];
    let lens = layout.camera(observation);
    let place = adjusted.places.of_link(link, &adjusted.graph);
    let pivot = &layout.pivot_in_target[link.target];
    let mut sums = OfObservation {
        by_motion: vec![Vector6::zeros(); n],
        own: DMatrix::zeros(n, n),
        pull: DVector::zeros(n),
    };
    let points = layout.observations[observation].seen.iter().zip(&adjusted.residuals[observation].points);
    let points = points.zip(&adjusted.parts.is_used[observation]).filter(|(_, used)| **used);
    for ((seen, residual), _) in points {
        let arm = place.rotation * (seen.x_in_target - pivot);
        let x_in_cam = arm + place.pivot_in_cam;
        let Some((_, jacobian)) = lens.project_with_jacobian(&x_in_cam) else { continue };
        let (x_in_target, cam_from_target) = (seen.x_in_target, place.rotation);
        let at = PointAt { seen, x_in_target, x_in_cam, cam_from_target, jacobian };
        let Some(columns) = columns(&at) else { continue };
        let (a, b, d) = whitening(seen, &jacobian);
        let (ju, jv) = (jacobian.row(0).transpose(), jacobian.row(1).transpose());
        for (j, p) in [(ju * a + jv * b, [a, b]), (jv * d, [0.0, d])] {
            let turn = arm.cross(&j);
            let by = Vector6::new(turn.x, turn.y, turn.z, j.x, j.y, j.z);
            let row = DVector::from_fn(n, |k, _| p[0] * columns[k].x + p[1] * columns[k].y);
            for (sum, value) in sums.by_motion.iter_mut().zip(row.iter()) {
                *sum += by * *value;
            }
            let off = residual.as_ref().map_or(0.0, |(e, _)| p[0] * e.x + p[1] * e.y);
            sums.pull.axpy(off, &row, 1.0);
            sums.own.ger(1.0, &row, &row, 1.0);
        }
    }
    sums
}

/// Refuses a matrix that is no covariance of a camera's intrinsics.
pub(super) fn check(covariances: &[Option<DMatrix<f64>>], cameras: &[Camera]) -> Result<(), Error> {
    if !covariances.is_empty() && covariances.len() != cameras.len() {
        let needed = "one entry a camera, or none at all";
        let seen = covariances.len() as f64;
        return Err(Error::InvalidCamera { parameter: "number of intrinsics covariances", seen, needed });
    }
    for (covariance, camera) in covariances.iter().zip(cameras) {
        let Some(covariance) = covariance else { continue };
        let rows: Vec<f64> = covariance.transpose().iter().copied().collect();
        check_intrinsics_covariance(&rows, camera.parameters().len())?;
        if !is_covariance(covariance) {
            let seen = covariance.symmetric_eigenvalues().min();
            let needed = "it must be symmetric, and its least eigenvalue not negative";
            return Err(Error::InvalidCamera { parameter: "intrinsics covariance", seen, needed });
        }
    }
    Ok(())
}

/// Returns the standard deviations of focal length (relative), principal point (over the focal length) and distortion (the displacement it
/// causes at `reach`, root mean square over the focal length) according to a camera's covariance.
pub(super) fn stated(camera: &Camera, covariance: &DMatrix<f64>, reach: f64) -> [f64; 3] {
    let parameters = camera.parameters();
    let focal_px = camera.matrix().map_or(1.0, |k| k.fx_px);
    let sigma = |name: &str| {
        let i = parameters.iter().position(|(known, _)| *known == name);
        i.map_or(0.0, |i| covariance[(i, i)].max(0.0).sqrt())
    };
    // The first of the other parameters is the coefficient of the third power of the distance from the axis, where the model has one.
    let distortion = parameters.get(4).map_or(0.0, |(name, _)| sigma(name));
    let focal = sigma("fx_px").max(sigma("fy_px")) / focal_px;
    [focal, sigma("cx_px").max(sigma("cy_px")) / focal_px, reach * distortion]
}
