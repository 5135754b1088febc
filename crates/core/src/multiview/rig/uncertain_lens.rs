//! The share of stated uncertainties of the intrinsics in a rig's covariances: docs/math/rig.md eq. (21).
//!
//! The derivative of every pose by a camera's parameters is D = H⁻¹K, with K = JᵀWP and P the derivative of the pixels by the parameters, which
//! adds D C Dᵀ. The intrinsics are not adjusted: the minimum is that of the problem stated.

use super::adjust::Adjusted;
use super::free_lenses::Free;
use super::layout::Layout;
use crate::covariance::is_covariance;
use crate::least_squares::rig::{Common, Eliminated};
use crate::locate::common::check_intrinsics_covariance;
use crate::locate::refine::whitening;
use crate::{Camera, Error, Matrix6, Vector6};
use nalgebra::{DMatrix, DVector, Matrix6xX};

/// Uncertain intrinsics of one camera, or of all that were adjusted together.
struct Uncertain<'a> {
    covariance: &'a DMatrix<f64>,
    /// One entry for each parameter.
    following: Vec<Common>,
}

/// The uncertain intrinsics of all cameras that are not exact.
pub(super) struct UncertainLenses<'a> {
    each: Vec<Uncertain<'a>>,
}

impl<'a> UncertainLenses<'a> {
    /// `covariances` has one entry for each camera; with an empty list all are exact. `free` ones have one covariance together instead.
    pub(super) fn new(
        covariances: &'a [Option<DMatrix<f64>>],
        free: Option<&'a Free>,
        (layout, adjusted, eliminated): (&Layout, &Adjusted, &Eliminated),
    ) -> Self {
        let following = |camera: usize| {
            let common = by_parameters(camera, layout, adjusted).common;
            common.into_iter().map(|c| adjusted.equations.following(eliminated, &c, true))
        };
        let is_free = |camera: &usize| free.is_some_and(|free| free.cameras.contains(camera));
        let uncertain = |(camera, covariance): (usize, &'a Option<DMatrix<f64>>)| {
            let covariance = covariance.as_ref().filter(|_| !is_free(&camera))?;
            Some(Uncertain { covariance, following: following(camera).collect() })
        };
        let together = |free: &'a Free| Uncertain {
            covariance: &free.covariance,
            following: free.cameras.iter().flat_map(|camera| following(*camera)).collect(),
        };
        let apart = covariances.iter().enumerate().filter_map(uncertain);
        let free = free.filter(|free| !free.cameras.is_empty());
        UncertainLenses { each: apart.chain(free.map(together)).collect() }
    }

    /// Adds the share to the covariance of the shared blocks.
    pub(super) fn add_to_shared(&self, covariance: &mut DMatrix<f64>) {
        for lens in &self.each {
            let moved = DMatrix::from_fn(covariance.nrows(), lens.following.len(), |i, k| {
                lens.following[k].shared[i]
            });
            *covariance += &moved * lens.covariance * moved.transpose();
        }
    }

    /// Adds the share to the covariance of a body in a view.
    pub(super) fn add_to_body(&self, covariance: &mut Matrix6, body: usize) {
        for lens in &self.each {
            let columns: Vec<Vector6> = lens.following.iter().map(|f| f.bodies[body]).collect();
            let moved = Matrix6xX::from_columns(&columns);
            let added = &moved * lens.covariance * moved.transpose();
            *covariance += added;
        }
    }
}

/// The sums of one camera over its points that take part, P the derivatives of the pixels by its parameters.
pub(super) struct ByParameters {
    /// K = JᵀWP, one entry for each parameter.
    pub(super) common: Vec<Common>,
    /// PᵀWP.
    pub(super) own: DMatrix<f64>,
    /// PᵀWr, r the residuals.
    pub(super) pull: DVector<f64>,
}

/// Sums over the points of one camera.
pub(super) fn by_parameters(camera: usize, layout: &Layout, adjusted: &Adjusted) -> ByParameters {
    let (places, graph) = (&adjusted.places, &adjusted.graph);
    let lens = &layout.problem.cameras[camera];
    let n = lens.parameters().len();
    let mut common: Vec<Common> = (0..n).map(|_| Common::new(graph)).collect();
    let (mut own, mut pull) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for (i, link) in graph.links.iter().enumerate() {
        if link.camera != camera || !graph.is_active[link.body] {
            continue;
        }
        let place = places.of_link(link, graph);
        let pivot = &layout.pivot_in_target[link.target];
        let mut by_motion = vec![Vector6::zeros(); n];
        let points = layout.observations[i].seen.iter().zip(&adjusted.residuals[i].points);
        let points = points.zip(&adjusted.parts.is_used[i]).filter(|(_, used)| **used);
        for ((c, residual), _) in points {
            let arm = place.rotation * (c.x_in_target - pivot);
            let x_in_cam = arm + place.pivot_in_cam;
            let Some((_, jacobian)) = lens.project_with_jacobian(&x_in_cam) else { continue };
            let Some(columns) = lens.intrinsics_jacobian(&x_in_cam) else { continue };
            let (a, b, d) = whitening(c, &jacobian);
            let (ju, jv) = (jacobian.row(0).transpose(), jacobian.row(1).transpose());
            for (j, p) in [(ju * a + jv * b, [a, b]), (jv * d, [0.0, d])] {
                let turn = arm.cross(&j);
                let by = Vector6::new(turn.x, turn.y, turn.z, j.x, j.y, j.z);
                let row = DVector::from_fn(n, |k, _| p[0] * columns[k].x + p[1] * columns[k].y);
                for (sum, value) in by_motion.iter_mut().zip(row.iter()) {
                    *sum += by * *value;
                }
                let off = residual.as_ref().map_or(0.0, |(e, _)| p[0] * e.x + p[1] * e.y);
                pull.axpy(off, &row, 1.0);
                own.ger(1.0, &row, &row, 1.0);
            }
        }
        for (common, by) in common.iter_mut().zip(&by_motion) {
            common.add(places, graph, link, by);
        }
    }
    ByParameters { common, own, pull }
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
