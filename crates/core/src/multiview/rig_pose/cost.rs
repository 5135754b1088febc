//! The reprojection error of a rig: the residuals of all its cameras for one pose. Derivation: docs/math/rig_pose.md eqs. (1)–(6), (8)–(10).
//!
//! ```text
//!   r = W (observed − π(x_c)),   x_c = R_c x + t_c,   x = R (X − X̄) + c,   y = x − c
//!   each row j of Π R_c, Π = ∂π/∂x_c, gives the row [ y × j ; j ] of the derivative by the rig's motion
//! ```

use super::RigView;
use super::uncertain_lens::UncertainLens;
use crate::least_squares::{NormalEquations, PivotedPose, minimize_pose};
use crate::locate::choose::Minimum;
use crate::locate::curvature::Cost;
use crate::locate::problem::Problem;
use crate::locate::refine::{UNDETERMINED, held_jacobian, log_determinant, weighed_residual, whitening};
use crate::locate::reweight::minimize_reweighted;
use crate::{Correspondence, Error, Matrix6, Point, Pose};
use nalgebra::Matrix3;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// All views of one rig.
#[derive(Clone, Copy)]
pub(crate) struct RigCost<'a> {
    pub views: &'a [RigView<'a>],
    /// The pose at which uncertain points are weighed, as `Problem::weights_at`.
    weights_at: Option<Pose>,
}

impl<'a> RigCost<'a> {
    pub fn new(views: &'a [RigView<'a>]) -> Self {
        RigCost { views, weights_at: None }
    }

    /// Returns the same cost with the weights of uncertain points, if there are any, held at those of a pose.
    pub fn held_at(&self, rig_from_target: &Pose) -> Self {
        RigCost { weights_at: self.has_uncertain_points().then_some(*rig_from_target), ..*self }
    }

    fn has_uncertain_points(&self) -> bool {
        self.points().any(|(_, c)| c.sigma_m != 0.0)
    }

    /// Returns whether every camera's intrinsics are exact.
    pub fn has_exact_lenses(&self) -> bool {
        self.views.iter().all(|view| view.intrinsics_covariance.is_none())
    }

    /// Returns the pose of one camera at which its uncertain points are weighted.
    fn weights_of(&self, view: &RigView) -> Option<Pose> {
        self.weights_at.map(|pose| view.cam_from_rig * pose)
    }

    pub fn n_points(&self) -> usize {
        self.views.iter().map(|view| view.seen.len()).sum()
    }

    /// Returns every point with the view that observes it.
    pub fn points(&self) -> impl Iterator<Item = (&'a RigView<'a>, &'a Correspondence)> + Clone + use<'a> {
        self.views.iter().flat_map(|view| view.seen.iter().map(move |c| (view, c)))
    }

    /// Returns χ² and the root mean square distance, px, with poses and intrinsics of the cameras as stated; infinite where a point leaves a
    /// field.
    pub fn residual_sums(&self, rig_from_target: &Pose) -> (f64, f64) {
        let (mut chi2, mut sum) = (0.0, 0.0);
        for view in self.views {
            let cam_from_target = view.cam_from_rig * *rig_from_target;
            let weights_at = self.weights_of(view);
            let problem = Problem { weights_at: weights_at.as_ref(), ..Problem::new(view.seen, view.camera) };
            for c in view.seen {
                let Some((_, e, whitened)) = weighed_residual(&cam_from_target, c, &problem) else {
                    return (f64::INFINITY, f64::INFINITY);
                };
                chi2 += whitened;
                sum += e.norm_squared();
            }
        }
        (chi2, (sum / self.n_points().max(1) as f64).sqrt())
    }

    /// Returns the same as `refine::log_determinant`, over all cameras.
    fn log_determinant(&self, rig_from_target: &Pose) -> f64 {
        let of_view = |view: &RigView| {
            let cam_from_target = view.cam_from_rig * *rig_from_target;
            log_determinant(&cam_from_target, &Problem::new(view.seen, view.camera))
        };
        self.views.iter().map(of_view).sum::<f64>() + self.log_determinant_of_lenses(rig_from_target)
    }

    /// Returns the share of uncertain intrinsics in it, eq. (10).
    fn log_determinant_of_lenses(&self, rig_from_target: &Pose) -> f64 {
        let pivot = self.pivot();
        let place = PivotedPose::new(rig_from_target, &pivot);
        let of_view = |view: &RigView| {
            let weights_at = Some(view.cam_from_rig * *rig_from_target);
            let lens = UncertainLens::at(view, weights_at, &place, &pivot)??;
            let Some(covariance) = &view.cam_from_rig_covariance else { return lens.log_determinant() };
            let mut own = NormalEquations::zero();
            add_view(&mut own, view, weights_at, &place, &pivot)?;
            let motion = as_pivoted_motion(view, covariance, &place.pivot_in_cam);
            lens.with_uncertain_motion(&own, &motion)?.log_determinant()
        };
        self.views.iter().filter_map(of_view).sum()
    }

    /// Refines `start` to the nearest minimum, with its covariance. In a flat valley the result is where the iteration stopped:
    /// docs/math/rig_pose.md, section 3.
    ///
    /// `NoSolution` when the start has points outside a camera's field, `DegenerateView` when a direction of the pose stays free.
    pub fn refine(&self, start: &Pose, alternative_chi2: Option<f64>) -> Result<Minimum, Error> {
        let pivot = self.pivot();
        let start = PivotedPose::new(start, &pivot);
        let found = if self.has_uncertain_points() {
            minimize_reweighted(start, &pivot, |place, at| self.held_at(at).normal_equations(place, &pivot))
        } else {
            minimize_pose(start, alternative_chi2, |place| self.normal_equations(place, &pivot))
        };
        let solution = found.ok_or(Error::NoSolution { n_points: self.n_points() })?;
        let covariance =
            solution.equations.covariance_at_camera(&solution.state.pivot_in_cam).ok_or(UNDETERMINED)?;
        let rig_from_target = solution.state.pose(&pivot);
        let rms_px = self.residual_sums(&rig_from_target).1;
        Ok(Minimum {
            cam_from_target: rig_from_target,
            covariance,
            chi2: self.chi2(&rig_from_target),
            rms_px,
            log_determinant: self.log_determinant(&rig_from_target),
        })
    }
}

impl Cost for RigCost<'_> {
    /// Returns the centroid of all points.
    fn pivot(&self) -> Point {
        self.points().map(|(_, c)| c.x_in_target).sum::<Point>() / self.n_points().max(1) as f64
    }

    fn normal_equations(&self, place: &PivotedPose, pivot: &Point) -> Option<NormalEquations> {
        let mut normal = NormalEquations::zero();
        for view in self.views {
            match view.is_exact() {
                true => add_view(&mut normal, view, self.weights_of(view), place, pivot)?,
                false => normal.merge(&view_equations(view, self.weights_of(view), place, pivot)?),
            }
        }
        normal.chi2.is_finite().then_some(normal)
    }

    fn chi2(&self, rig_from_target: &Pose) -> f64 {
        if self.views.iter().all(RigView::is_exact) {
            return self.residual_sums(rig_from_target).0;
        }
        let pivot = self.pivot();
        let normal = self.normal_equations(&PivotedPose::new(rig_from_target, &pivot), &pivot);
        normal.map_or(f64::INFINITY, |normal| normal.chi2)
    }
}

/// Returns the equations of one camera alone at a pose of the rig.
pub(super) fn equations_of(
    cost: &RigCost,
    view: &RigView,
    rig_from_target: &Pose,
) -> Option<NormalEquations> {
    let pivot = cost.pivot();
    let place = PivotedPose::new(rig_from_target, &pivot);
    view_equations(view, cost.weights_of(view), &place, &pivot)
}

/// Returns the equations of one camera alone, with its unknown motion and its unknown intrinsics eliminated where its pose or its lens is
/// uncertain.
fn view_equations(
    view: &RigView,
    weights_at: Option<Pose>,
    place: &PivotedPose,
    pivot: &Point,
) -> Option<NormalEquations> {
    let mut own = NormalEquations::zero();
    add_view(&mut own, view, weights_at, place, pivot)?;
    let motion = view.cam_from_rig_covariance.map(|c| as_pivoted_motion(view, &c, &place.pivot_in_cam));
    let lens = UncertainLens::at(view, weights_at, place, pivot)?;
    let (own, lens) = match (motion, lens) {
        (Some(motion), lens) => {
            let lens = match lens {
                Some(lens) => Some(lens.with_uncertain_motion(&own, &motion)?),
                None => None,
            };
            (own.with_uncertain_motion(&motion)?, lens)
        }
        (None, lens) => (own, lens),
    };
    match lens {
        Some(lens) => lens.eliminated_from(&own),
        None => Some(own),
    }
}

/// Adds the residuals of one camera, eqs. (2)–(3).
fn add_view(
    normal: &mut NormalEquations,
    view: &RigView,
    weights_at: Option<Pose>,
    place: &PivotedPose,
    pivot: &Point,
) -> Option<()> {
    let problem = Problem { weights_at: weights_at.as_ref(), ..Problem::new(view.seen, view.camera) };
    for c in view.seen {
        let y = place.rotation * (c.x_in_target - pivot);
        let x_in_cam = view.cam_from_rig * (y + place.pivot_in_cam);
        let (pixel, jacobian) = view.camera.project_with_jacobian(&x_in_cam)?;
        let (a, b, d) = whitening(c, &held_jacobian(c, &problem)?.unwrap_or(jacobian));
        let by_rig = jacobian * view.cam_from_rig.rotation;
        let (ju, jv) = (by_rig.row(0).transpose(), by_rig.row(1).transpose());
        let (e, ju, jv) = (c.pixel - pixel, ju * a + jv * b, jv * d);
        normal.add(a * e.x + b * e.y, &y.cross(&ju), &ju);
        normal.add(d * e.y, &y.cross(&jv), &jv);
    }
    Some(())
}

/// Returns the covariance of the motion of the rig, about the pivot at c, that has the same effect on this camera's pixels as the camera's own,
/// eq. (4).
pub(super) fn as_pivoted_motion(view: &RigView, covariance: &Matrix6, pivot_in_rig: &Point) -> Matrix6 {
    let in_rig = view.cam_from_rig.inverse_covariance(covariance);
    let mut about_pivot = Matrix6::identity();
    let cross: Matrix3<f64> = -pivot_in_rig.cross_matrix();
    about_pivot.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross);
    about_pivot * in_rig * about_pivot.transpose()
}
