//! Which part of a pose's covariance, as the points and priors alone give it, comes from which source. docs/math/budget.md section 2.
//!
//! ```text
//!   A = JᵀC⁻¹J + prior information  ·  C = C_px + σ_m² Π Πᵀ  ·  S motion of a group, N its JᵀC⁻¹J, F = (1 + N S)⁻¹
//!   pixels A⁻¹ (Σ F JᵀC⁻¹ C_px C⁻¹J Fᵀ) A⁻¹  ·  target A⁻¹ (Σ F JᵀC⁻¹ σ_m² Π Πᵀ C⁻¹J Fᵀ + Σ F N S N Fᵀ) A⁻¹  ·  priors A⁻¹ Pr A⁻¹
//! ```

use crate::budget::{Budget, ErrorSource};
use crate::least_squares::PivotedPose;
use crate::locate::choose::Minimum;
use crate::locate::group::RigidGroup;
use crate::locate::problem::Problem;
use crate::locate::refine::{UNDETERMINED, centroid, information, normal_equations};
use crate::locate::sandwich::Pull;
use crate::pose::symmetric;
use crate::{Correspondence, Error, Matrix6, Point};
use nalgebra::{Matrix2, SMatrix};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Σ of the rows by source, about the pivot: their sum is the information where the loss is the square.
#[derive(Default)]
pub(crate) struct Pulls {
    pub(crate) pixels: Matrix6,
    pub(crate) target: Matrix6,
}

/// The parts of the covariance that the points and priors alone give.
pub(crate) fn of_observations(m: &Minimum, problem: &Problem) -> Result<Budget, Error> {
    let pivot = centroid(problem.seen);
    let place = PivotedPose::new(&m.cam_from_target, &pivot);
    of_observations_and(&Matrix6::zeros(), &place, &pivot, problem)
}

/// Returns the parts with further pixels, whose information about the pivot is known.
pub(crate) fn of_observations_and(
    pixels: &Matrix6,
    place: &PivotedPose,
    pivot: &Point,
    problem: &Problem,
) -> Result<Budget, Error> {
    pulls(pixels, place, pivot, &problem.held_at(&place.pose(pivot))).ok_or(UNDETERMINED)
}

fn pulls(further: &Matrix6, place: &PivotedPose, pivot: &Point, problem: &Problem) -> Option<Budget> {
    let (mut sums, mut next) = (Pulls::default(), 0);
    for group in problem.groups {
        sums.add_all(place, pivot, &problem.of(problem.seen.get(next..group.first)?))?;
        sums.add_group(place, pivot, group, problem)?;
        next = group.end();
    }
    sums.add_all(place, pivot, &problem.of(problem.seen.get(next..)?))?;
    let of_points = normal_equations(place, pivot, &Problem { priors: &[], ..*problem })?.information();
    let of_priors = normal_equations(place, pivot, &Problem { seen: &[], groups: &[], ..*problem })?;
    let Pull { stiffness, pull } = Pull::of(problem, &place.pose(pivot))?;
    let of_priors = of_priors.information();
    let inverse = (of_points * stiffness + further + of_priors).cholesky()?.inverse();
    let mut transport = Matrix6::identity();
    transport.fixed_view_mut::<3, 3>(3, 0).copy_from(&place.pivot_in_cam.cross_matrix());
    let mut budget = Budget::default();
    budget.add(ErrorSource::Pixels, &(sums.pixels * pull + further));
    budget.add(ErrorSource::Target, &(sums.target * pull));
    budget.add(ErrorSource::Priors, &of_priors);
    Some(budget.transformed(&(transport * inverse)))
}

impl Pulls {
    /// Of points without groups; `None` where one leaves the field.
    #[cfg(feature = "std")]
    pub(crate) fn of(place: &PivotedPose, pivot: &Point, problem: &Problem) -> Option<Self> {
        let mut sums = Pulls::default();
        sums.add_all(place, pivot, problem)?;
        Some(sums)
    }

    fn add_all(&mut self, place: &PivotedPose, pivot: &Point, problem: &Problem) -> Option<()> {
        problem.seen.iter().try_for_each(|c| self.add(place, pivot, c, problem))
    }

    fn add(
        &mut self,
        place: &PivotedPose,
        pivot: &Point,
        c: &Correspondence,
        problem: &Problem,
    ) -> Option<()> {
        let y = place.rotation * (c.x_in_target - pivot);
        let (pixel, by_point) = problem.camera.project_with_jacobian(&(y + place.pivot_in_cam))?;
        let mut by_motion = SMatrix::<f64, 2, 6>::zeros();
        by_motion.fixed_view_mut::<2, 3>(0, 0).copy_from(&(-by_point * y.cross_matrix()));
        by_motion.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_point);
        let weight = information(c, &by_point);
        let e = c.pixel - pixel;
        let gain = by_motion.tr_mul(&weight) * problem.loss.at(e.dot(&(weight * e))).1.sqrt();
        let [uu, uv, vv] = c.pixel_covariance();
        let of_point = by_point * by_point.transpose() * (c.sigma_m * c.sigma_m);
        self.pixels += gain * Matrix2::new(uu, uv, uv, vv) * gain.transpose();
        self.target += gain * of_point * gain.transpose();
        Some(())
    }

    /// Points displaced together, docs/math/budget.md eq. (4).
    fn add_group(
        &mut self,
        place: &PivotedPose,
        pivot: &Point,
        group: &RigidGroup,
        problem: &Problem,
    ) -> Option<()> {
        let own = &problem.of(problem.seen.get(group.first..group.end())?);
        let mut sums = Pulls::default();
        sums.add_all(place, pivot, own)?;
        let information = sums.pixels + sums.target;
        let motion = group.motion_covariance(&(place.rotation * (group.centre_in_target - pivot)));
        let kept = (Matrix6::identity() + information * motion).try_inverse()?;
        let left = kept * information;
        self.pixels += symmetric(&(kept * sums.pixels * kept.transpose()));
        self.target += symmetric(&(kept * sums.target * kept.transpose() + left * motion * left.transpose()));
        Some(())
    }
}

impl<'a> Problem<'a> {
    /// Some of its points, and nothing else.
    fn of<'b>(&self, seen: &'b [Correspondence]) -> Problem<'b>
    where
        'a: 'b,
    {
        Problem { seen, priors: &[], groups: &[], ..*self }
    }
}
