//! The joint adjustment of every pose, the intrinsics and, on request, the shape of a flat target: docs/math/intrinsics.md section 2.

use super::prior;
use crate::least_squares::PivotedPose;
use crate::least_squares::shared::{
    Reduced, SharedEquations, SharedState, minimize_settled, minimize_shared,
};
use crate::locate::choose::Ambiguity;
use crate::locate::refine::{centroid, information};
use crate::locate::{Config, PoseEstimate, locate};
use crate::multiview::flat_target::Shape;
use crate::multiview::intrinsics_check::{Direction, PointModel};
use crate::{Camera, Correspondence, Error, Matrix6, Point, Pose};
use nalgebra::{DMatrix, DVector, Vector2};

/// A view in the adjustment.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    /// Its index in the input.
    pub(super) view: usize,
    pub(super) points: Vec<Correspondence>,
    /// Weight of each point; points with 0 take no part.
    pub(super) weights: Vec<f64>,
    pub(super) pivot: Point,
    pub(super) cam_from_target: Pose,
    /// Whether another pose was nearly as good when the view was located.
    pub(super) has_rival: bool,
}

/// Largest ratio of the residual sums of squares for which another pose counts as nearly as good.
const RIVAL: f64 = 25.0;

impl Seen {
    /// Locates a view under a camera, from those of its points that take part.
    pub(super) fn located(
        view: usize,
        points: &[Correspondence],
        weights: Vec<f64>,
        camera: &Camera,
    ) -> Result<Self, Error> {
        let found = located(points, &weights, camera)?;
        let has_rival = match found.ambiguity {
            Ambiguity::Unique { ratio } => ratio.is_some_and(|ratio| ratio < RIVAL),
            Ambiguity::Ambiguous { .. } => true,
        };
        let (cam_from_target, pivot) = (found.cam_from_target, centroid(points));
        Ok(Seen { view, points: points.to_vec(), weights, pivot, cam_from_target, has_rival })
    }

    pub(super) fn n_used(&self) -> usize {
        self.weights.iter().filter(|w| 0.0 < **w).count()
    }
}

/// Locates a view's points under a camera; bearings are recomputed, points outside the camera's field are left out.
pub(super) fn located(
    points: &[Correspondence],
    weights: &[f64],
    camera: &Camera,
) -> Result<PoseEstimate, Error> {
    let used = points.iter().zip(weights).filter(|(_, weight)| 0.0 < **weight);
    let rebased =
        used.filter_map(|(c, _)| Some(Correspondence { bearing: camera.bearing(&c.pixel).ok()?, ..*c }));
    let seen: Vec<Correspondence> = rebased.collect();
    locate(&seen, camera, &Config { shared_errors: false, ..Config::default() })
}

/// The unknowns that all views share.
#[derive(Debug, Clone)]
pub(super) struct Shared {
    pub(super) camera: Camera,
    /// The shape, if it is estimated.
    pub(super) shape: Option<Shape>,
    pub(super) directions: Vec<Direction>,
    /// Variance of the noise in units of the stated one, against which the prior of the lens is weighted; 0 disables the prior.
    pub(super) noise: f64,
}

impl Shared {
    pub(super) fn n(&self) -> usize {
        self.directions.len() + self.shape.map_or(0, |shape| shape.n())
    }

    /// Returns the state after a change along the directions, then of the shape.
    fn changed(&self, change: &DVector<f64>) -> Result<Shared, Error> {
        let mut values: Vec<f64> = self.camera.parameters().iter().map(|(_, value)| *value).collect();
        for (direction, change) in self.directions.iter().zip(change.iter()) {
            for (i, by) in direction {
                values[*i] += by * change;
            }
        }
        let mut shape = self.shape;
        if let Some(shape) = &mut shape {
            let of_shape = change.iter().skip(self.directions.len());
            shape.values.iter_mut().zip(of_shape).for_each(|(value, change)| *value += change);
        }
        Ok(Shared {
            camera: self.camera.with_parameters(&values)?,
            shape,
            directions: self.directions.clone(),
            noise: self.noise,
        })
    }
}

/// Returns the normal equations of all views; `None` where a point that takes part leaves the camera's field.
pub(super) fn equations(seen: &[Seen], places: &[PivotedPose], shared: &Shared) -> Option<SharedEquations> {
    let mut sums = SharedEquations::new(shared.n());
    for (view, place) in seen.iter().zip(places) {
        sums.next_view();
        let model = PointModel {
            camera: &shared.camera,
            directions: &shared.directions,
            shape: shared.shape.as_ref(),
            pivot: &view.pivot,
            place,
        };
        for (c, weight) in view.points.iter().zip(&view.weights).filter(|(_, weight)| 0.0 < **weight) {
            model.add(&mut sums, c, *weight)?;
        }
    }
    sums.chi2.is_finite().then_some(sums)
}

/// A joint minimum.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub(super) shared: Shared,
    /// The views with their poses.
    pub(super) seen: Vec<Seen>,
    pub(super) equations: SharedEquations,
    /// Whether it is a minimum: a loop that ended early moved along an undetermined direction.
    pub(super) converged: bool,
}

impl Fit {
    /// Returns χ² of the corners alone.
    pub(super) fn chi2(&self) -> f64 {
        self.equations.chi2 - self.equations.prior_chi2
    }

    /// Returns the number of observations: two for each point that takes part.
    pub(super) fn n_numbers(&self) -> usize {
        2 * self.seen.iter().map(Seen::n_used).sum::<usize>()
    }

    pub(super) fn degrees_of_freedom(&self) -> usize {
        self.n_numbers().saturating_sub(6 * self.seen.len() + self.shared.n())
    }

    /// Returns the equations of the shared unknowns, with every pose eliminated.
    pub(super) fn reduced(&self) -> Option<Reduced> {
        self.equations.reduced()
    }

    /// Returns the information of each view about the shared unknowns, at the common minimum.
    pub(super) fn reduced_by_view(&self) -> Vec<Option<Reduced>> {
        let alone = |view: &Seen| {
            let place = PivotedPose::new(&view.cam_from_target, &view.pivot);
            equations(std::slice::from_ref(view), &[place], &self.shared)?.reduced()
        };
        self.seen.iter().map(alone).collect()
    }

    /// Returns the covariances of the poses' motions about the pivots.
    pub(super) fn pose_covariances(&self, covariance: &DMatrix<f64>) -> Option<Vec<Matrix6>> {
        self.equations.pose_covariances(covariance)
    }

    /// Returns the residuals of every point, used or not: observed − predicted, and squared in units of its covariance; `None` outside the
    /// field.
    pub(super) fn residuals(&self, view: &Seen) -> Vec<Option<(Vector2<f64>, f64)>> {
        let of_point = |c: &Correspondence| {
            let x = self.shared.shape.map_or(c.x_in_target, |shape| shape.at(&c.x_in_target));
            let (pixel, jacobian) = self.shared.camera.project_with_jacobian(&(view.cam_from_target * x))?;
            // `information` takes the derivative with respect to the target's point, whose noise is isotropic.
            let e = c.pixel - pixel;
            Some((e, e.dot(&(information(c, &jacobian) * e))))
        };
        view.points.iter().map(of_point).collect()
    }
}

/// Finds the joint minimum near the views' poses and shared unknowns; `None` where the start has no cost.
pub(super) fn fit(mut seen: Vec<Seen>, shared: Shared) -> Option<Fit> {
    let place = |view: &Seen| PivotedPose::new(&view.cam_from_target, &view.pivot);
    let start = seen.iter().map(place).collect();
    let known = prior::known(&shared.camera);
    let evaluate = |state: &SharedState| {
        let shared = shared.changed(&state.change).ok()?;
        let mut sums = equations(&seen, &state.places, &shared)?;
        prior::add(&mut sums, &known, &shared.camera, &shared.directions, shared.noise);
        add_rulers(&mut sums, &shared);
        Some(sums)
    };
    let mut found = minimize_shared(start, shared.n(), evaluate)?;
    if !found.is_minimum() {
        let settle = |state: SharedState| settled(&seen, state, &shared);
        found = minimize_settled(found.state, evaluate, settle)?;
    }
    let converged = found.is_minimum();
    let shared = shared.changed(&found.state.change).ok()?;
    for (view, place) in seen.iter_mut().zip(&found.state.places) {
        view.cam_from_target = place.pose(&view.pivot);
    }
    Some(Fit { shared, seen, equations: found.equations, converged })
}

/// Adds the measured rulers, which determine the stretch of the print: docs/math/intrinsics.md section 2.
fn add_rulers(sums: &mut SharedEquations, shared: &Shared) {
    let Some((shape, sigma)) = shared.shape.and_then(|shape| Some((shape, shape.stretch_sigma?))) else {
        return;
    };
    let by_shared = DVector::from_fn(sums.n_shared(), |k, _| f64::from(k == shared.directions.len()));
    sums.add_known(-shape.values[0], shared.noise / (sigma * sigma), &by_shared);
}

/// Moves each pose to its own minimum, with the shared unknowns fixed.
fn settled(seen: &[Seen], mut state: SharedState, shared: &Shared) -> SharedState {
    let Ok(changed) = shared.changed(&state.change) else { return state };
    let shape = changed.shape;
    let fixed = Shared { directions: Vec::new(), shape: None, ..changed };
    for (view, place) in seen.iter().zip(&mut state.places) {
        let mut own = view.clone();
        if let Some(shape) = shape {
            own.points.iter_mut().for_each(|c| c.x_in_target = shape.at(&c.x_in_target));
        }
        let own = [own];
        let evaluate = |state: &SharedState| equations(&own, &state.places, &fixed);
        if let Some(found) = minimize_shared(vec![*place], 0, evaluate) {
            *place = found.state.places[0];
        }
    }
    state
}

/// Repeats the adjustment with views located again under its camera where that fits them better: wrong intrinsics can move a view of a plane to
/// its second solution, if that was nearly as good.
pub(super) fn fit_with_second_solutions(seen: Vec<Seen>, shared: Shared) -> Option<Fit> {
    let mut found = fit(seen, shared)?;
    for _ in 0..MAX_ROUNDS {
        let mut any = false;
        let chi2: Vec<f64> = found.equations.chi2_of_views().collect();
        for (view, chi2) in found.seen.iter_mut().zip(chi2).filter(|(view, _)| view.has_rival) {
            let Ok(other) = located(&view.points, &view.weights, &found.shared.camera) else { continue };
            let changed = Seen { cam_from_target: other.cam_from_target, ..view.clone() };
            let place = PivotedPose::new(&changed.cam_from_target, &view.pivot);
            let Some(alone) = equations(std::slice::from_ref(&changed), &[place], &found.shared) else {
                continue;
            };
            // A pose of a single view may only be better by as much as the shared unknowns gain.
            if alone.chi2 < MUCH_BETTER * chi2 && MUCH < chi2 {
                *view = changed;
                any = true;
            }
        }
        if !any {
            return Some(found);
        }
        found = fit(found.seen, found.shared)?;
    }
    Some(found)
}

/// Largest number of rounds of the search for second solutions.
const MAX_ROUNDS: usize = 3;
/// A single view justifies a new start if its χ² falls below this share, and if it is …
const MUCH_BETTER: f64 = 0.7;
/// … larger than this.
const MUCH: f64 = 10.0;
