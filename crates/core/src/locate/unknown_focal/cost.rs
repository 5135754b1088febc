//! Pose and lens together: residuals, derivatives and the descent, docs/math/focal.md eqs. (22)–(25).
//!
//!   ξ  motion about the points' centroid  ·  θ = [log f, a, c_u, c_v, κ]  ·  H  information of [ξ; θ]

use super::lens::{LENS, LensPrior, LensState};
use crate::least_squares::PivotedPose;
use crate::least_squares::dense::{DenseEquations, minimize_dense};
use crate::locate::refine::{centroid, whitening};
use crate::{Camera, Correspondence, Pixel, Point, Pose, Vector6};
use core::ops::RangeInclusive;
use nalgebra::{DMatrix, DVector, Matrix2x3, Matrix3, SMatrix, SVector};

/// Pose and lens.
pub(super) const UNKNOWNS: usize = 6 + LENS;
/// Covariance of [rotation; translation; θ], the motion about the camera.
pub(super) type JointCovariance = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// What is seen, and what is known of the lens.
pub(super) struct FocalProblem<'a> {
    pub(super) seen: &'a [Correspondence],
    pub(super) lens: &'a LensPrior,
    pivot: Point,
}

/// Where the unknowns are.
#[derive(Debug, Clone, Copy)]
pub(super) struct FocalState {
    place: PivotedPose,
    pub(super) lens: LensState,
}

/// One point: what is predicted, whitened residuals and derivatives.
pub(super) struct Rows {
    pub(super) pixel: Pixel,
    residuals: [f64; 2],
    pub(super) by_unknown: [[f64; UNKNOWNS]; 2],
    /// 1/σ² where noise is the same in u and v.
    pub(super) weight: f64,
}

/// Weights that a descent holds.
struct Held {
    cam_from_target: Pose,
    camera: Camera,
    bend_sigma: f64,
}

/// A minimum, or the lowest place of a descent that found none.
#[derive(Debug, Clone)]
pub(super) struct Descent {
    pub(super) state: FocalState,
    pub(super) chi2: f64,
    /// H.
    pub(super) information: DMatrix<f64>,
    pub(super) is_minimum: bool,
}

/// Focal lengths are sought within these horizontal fields of view, radians: a degree to 150.
const FIELD_OF_VIEW_RAD: RangeInclusive<f64> = 0.017..=2.6;
/// Descents, each with the weights where the one before ended.
const PASSES: usize = 4;
/// A descent that lowers χ² by less than this with new weights is the last.
const SETTLED_CHI2: f64 = 1e-3;

impl<'a> FocalProblem<'a> {
    pub(super) fn new(seen: &'a [Correspondence], lens: &'a LensPrior) -> Self {
        FocalProblem { seen, lens, pivot: centroid(seen) }
    }

    pub(super) fn state(&self, cam_from_target: &Pose, focal_px: f64) -> FocalState {
        let place = PivotedPose::new(cam_from_target, &self.pivot);
        FocalState { place, lens: self.lens.state(focal_px) }
    }

    pub(super) fn pose(&self, state: &FocalState) -> Pose {
        state.place.pose(&self.pivot)
    }

    /// The state with the target rotated about its centroid, or moved along the line of sight by a factor.
    pub(super) fn displaced(&self, state: &FocalState, turn: &Matrix3<f64>, factor: f64) -> FocalState {
        let PivotedPose { rotation, pivot_in_cam } = state.place;
        let place = PivotedPose { rotation: turn * rotation, pivot_in_cam: pivot_in_cam * factor };
        FocalState { place, ..*state }
    }

    /// The state with focal length and distance changed together until the horizontal field of view lies within these limits.
    pub(super) fn within_fields(&self, state: &FocalState, limits_rad: &RangeInclusive<f64>) -> FocalState {
        let focal_px = state.lens.focal_px();
        let field_rad = self.lens.field_of_view_rad(focal_px).clamp(*limits_rad.start(), *limits_rad.end());
        let usual_px = self.lens.focal_of_field_px(field_rad);
        let moved = self.displaced(state, &Matrix3::identity(), usual_px / focal_px);
        FocalState { lens: LensState { log_focal: usual_px.ln(), ..state.lens }, ..moved }
    }

    /// How far the target's middle is from the camera.
    pub(super) fn distance_m(&self, state: &FocalState) -> f64 {
        state.place.pivot_in_cam.norm()
    }

    fn held_at(&self, state: &FocalState) -> Option<Held> {
        Some(Held {
            cam_from_target: self.pose(state),
            camera: self.lens.camera(&state.lens)?,
            bend_sigma: self.lens.bend_sigma(state.lens.focal_px()),
        })
    }

    /// χ² and its derivatives at a state, with its own weights.
    pub(super) fn equations(&self, state: &FocalState) -> Option<DenseEquations> {
        self.evaluate(state, &self.held_at(state)?)
    }

    fn evaluate(&self, state: &FocalState, held: &Held) -> Option<DenseEquations> {
        let camera = self.lens.camera(&state.lens)?;
        let mut equations = DenseEquations::new(UNKNOWNS);
        for c in self.seen {
            let rows = self.rows(c, state, &camera, held)?;
            for (residual, by) in rows.residuals.into_iter().zip(&rows.by_unknown) {
                let entries: [(usize, f64); UNKNOWNS] = core::array::from_fn(|i| (i, by[i]));
                equations.add(residual, &entries);
            }
        }
        for (i, residual, by) in self.lens.residuals(&state.lens, held.bend_sigma) {
            equations.add(residual, &[(6 + i, by)]);
        }
        equations.chi2.is_finite().then_some(equations)
    }

    /// Eq. (23).
    fn rows(&self, c: &Correspondence, state: &FocalState, camera: &Camera, held: &Held) -> Option<Rows> {
        let y = state.place.rotation * (c.x_in_target - self.pivot);
        let x = y + state.place.pivot_in_cam;
        let (pixel, jacobian) = camera.project_with_jacobian(&x)?;
        let by_lens = self.lens.pixel_by_state(&state.lens, &camera.intrinsics_jacobian(&x)?);
        let held_jacobian = match c.sigma_m == 0.0 {
            true => Matrix2x3::zeros(),
            false => held.camera.project_with_jacobian(&(held.cam_from_target * c.x_in_target))?.1,
        };
        let (a, b, d) = whitening(c, &held_jacobian);
        let e = c.pixel - pixel;
        let derivative = |[wu, wv]: [f64; 2]| {
            let j = (jacobian.row(0) * wu + jacobian.row(1) * wv).transpose();
            let by_rotation = y.cross(&j);
            core::array::from_fn(|i| match i {
                0..3 => by_rotation[i],
                3..6 => j[i - 3],
                _ => by_lens[i - 6].x * wu + by_lens[i - 6].y * wv,
            })
        };
        Some(Rows {
            pixel,
            residuals: [a * e.x + b * e.y, d * e.y],
            by_unknown: [[a, b], [0.0, d]].map(derivative),
            weight: a * d,
        })
    }

    /// Of all points, each with its own weights.
    pub(super) fn all_rows(&self, state: &FocalState) -> Option<Vec<Rows>> {
        let held = self.held_at(state)?;
        self.seen.iter().map(|c| self.rows(c, state, &held.camera, &held)).collect()
    }

    fn moved(&self, state: &FocalState, step: &DVector<f64>) -> Option<FocalState> {
        let step = step.as_slice();
        let place = state.place.moved(&Vector6::from_column_slice(step.get(..6)?));
        let lens = state.lens.moved(step.get(6..)?)?;
        let field = self.lens.field_of_view_rad(lens.focal_px());
        FIELD_OF_VIEW_RAD.contains(&field).then_some(FocalState { place, lens })
    }

    /// Down from a start. Weights that depend on the state, those of uncertain points and of the distortion, are taken anew where a descent
    /// ends, until that changes nothing.
    pub(super) fn descend(&self, start: FocalState) -> Option<Descent> {
        let mut state = start;
        let mut found = None;
        for _ in 0..PASSES {
            let held = self.held_at(&state)?;
            let minimum = minimize_dense(
                state,
                |state| self.evaluate(state, &held),
                |state, step| self.moved(state, step),
            )?;
            let is_minimum = minimum.is_minimum();
            state = minimum.state;
            let equations = self.equations(&state).or(Some(minimum.equations.clone()))?;
            let promised = equations.step(0.0).map_or(f64::INFINITY, |(_, promised)| promised);
            let (chi2, information) = (equations.chi2, equations.information);
            found = Some(Descent { state, chi2, information, is_minimum });
            if promised < SETTLED_CHI2 || !is_minimum {
                break;
            }
        }
        found
    }

    /// The lowest place with log f moved by so much from a minimum: how it differs from the minimum, the motion about the camera, and its χ².
    pub(super) fn along_ridge(
        &self,
        from: &Descent,
        by_log_focal: f64,
    ) -> Option<(SVector<f64, UNKNOWNS>, f64)> {
        let held = self.held_at(&from.state)?;
        let inverse = scaled_inverse(&from.information)?;
        let column = inverse.column(6) * (by_log_focal / inverse[(6, 6)]);
        let start = self.moved(&from.state, &DVector::from_column_slice(column.as_slice()))?;
        let evaluate = |state: &FocalState| {
            let mut equations = self.evaluate(state, &held)?;
            // An unknown that nothing depends on stays where it is.
            equations.gradient[6] = 0.0;
            equations.information.row_mut(6).fill(0.0);
            equations.information.column_mut(6).fill(0.0);
            Some(equations)
        };
        let found = minimize_dense(start, evaluate, |state, step| self.moved(state, step))?;
        let motion = (self.pose(&found.state) * self.pose(&from.state).inverse()).log();
        let (to, at) = (found.state.lens.values(), from.state.lens.values());
        let difference = SVector::from_fn(|i, _| if i < 6 { motion[i] } else { to[i - 6] - at[i - 6] });
        Some((difference, found.equations.chi2))
    }

    /// H⁻¹ of motions about the camera, eq. (25); none where a direction is open to rounding.
    pub(super) fn covariance(&self, descent: &Descent) -> Option<JointCovariance> {
        Self::at_camera(descent, &scaled_inverse(&descent.information)?)
    }

    /// H⁻¹ S H⁻¹: what errors do to the answer whose scores Jᵀr have the covariance S, eq. (29).
    pub(super) fn of_scores(&self, descent: &Descent, scores: &JointCovariance) -> Option<JointCovariance> {
        let inverse = scaled_inverse(&descent.information)?;
        Self::at_camera(descent, &(inverse * scores * inverse))
    }

    /// From motions about the centroid to those about the camera.
    fn at_camera(descent: &Descent, about_pivot: &JointCovariance) -> Option<JointCovariance> {
        let mut to_camera = JointCovariance::identity();
        let at = descent.state.place.pivot_in_cam.cross_matrix();
        to_camera.fixed_view_mut::<3, 3>(3, 0).copy_from(&at);
        let covariance = to_camera * about_pivot * to_camera.transpose();
        let whole = (covariance + covariance.transpose()) * 0.5;
        whole.sum().is_finite().then_some(whole)
    }
}

/// The inverse of an information matrix whose unknowns have units far apart.
fn scaled_inverse(information: &DMatrix<f64>) -> Option<JointCovariance> {
    let h = JointCovariance::from_fn(|i, j| information[(i, j)]);
    let scale = h.diagonal().map(|d| d.sqrt().recip());
    let diagonal = JointCovariance::from_diagonal(&scale);
    let scaled: JointCovariance = diagonal * h * diagonal;
    Some(diagonal * scaled.cholesky()?.inverse() * diagonal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::ImageSize;

    /// χ² and its gradient: the sixth digit of central differences, for every unknown, at a state that fits badly.
    #[test]
    fn the_gradient_is_that_of_chi2() {
        let lens = LensPrior {
            size: ImageSize { width_px: 640, height_px: 480 },
            principal_point_sigma_px: 12.0,
            aspect_sigma: 0.004,
            bend_sigma_per_rad: 0.12,
        };
        let seen: Vec<Correspondence> = (0..9)
            .map(|i| {
                let (u, v) = (f64::from(i % 3), f64::from(i / 3));
                let pixel = Pixel::new(180.0 + 130.0 * u + 7.0 * v * v, 120.0 + 110.0 * v - 9.0 * u * v);
                let camera = Camera::normalized();
                Correspondence::new(&camera, Point::new(u, v, 0.3 * u * v) * 0.2, pixel, 0.7)
                    .expect("a point")
            })
            .collect();
        let problem = FocalProblem::new(&seen, &lens);
        let pose = Pose::exp(&Vector6::new(0.2, -0.3, 0.1, -0.15, -0.2, 1.1));
        let mut state = problem.state(&pose, 600.0);
        state.lens = state.lens.moved(&[0.0, 0.01, 5.0, -3.0, -0.1]).expect("a lens");
        let held = problem.held_at(&state).expect("weights");
        let at = |state: &FocalState| problem.evaluate(state, &held).expect("a cost");
        let gradient = at(&state).gradient;
        for i in 0..UNKNOWNS {
            let h = if (8..10).contains(&i) { 1e-3 } else { 1e-6 };
            let moved = |by: f64| {
                let mut step = DVector::zeros(UNKNOWNS);
                step[i] = by;
                at(&problem.moved(&state, &step).expect("a state")).chi2
            };
            let difference = -0.25 * (moved(h) - moved(-h)) / h;
            assert!((difference / gradient[i] - 1.0).abs() < 1e-5, "{i}: {difference} {}", gradient[i]);
        }
    }
}
