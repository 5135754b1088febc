//! The error budget of one view: which part of a pose's covariance comes from which source. docs/math/budget.md.

use super::classify::{View, classify};
use super::consistency::noise_of;
use super::lines::{LinesEstimate, information, pivot};
use super::method::Method;
use super::parts::of_observations_and;
use super::problem::Problem;
use super::refine::{OVERFLOW, minimum_at};
use super::uncertainty::Doubts;
use super::{Config, PoseEstimate};
use crate::budget::{Budget, ErrorSource};
use crate::least_squares::PivotedPose;
use crate::line::LineCorrespondence;
use crate::{Camera, Correspondence, Error};

/// A covariance that is larger than its parts by more than this was widened after the pose was found.
const WIDENED: f64 = 1.001;

impl PoseEstimate {
    /// The parts of its covariance by their sources, which add up to it. `seen`, `camera` and `config` are those of the pose; after a
    /// consensus, the points that agree.
    ///
    /// # Errors
    /// Those of [`locate`](super::locate) about its input; `DegenerateView` where numbers overflow.
    pub fn budget(&self, seen: &[Correspondence], camera: &Camera, config: &Config) -> Result<Budget, Error> {
        let view = classify(seen, camera, config)?;
        let mut budget = self.parts(&view)?;
        let sum = budget.covariance();
        let ratio = self.covariance.diagonal().component_div(&sum.diagonal()).mean();
        if WIDENED < ratio {
            budget.add(ErrorSource::Residuals, &(sum * (ratio - 1.0)));
        }
        budget.adding_up_to(&self.covariance).ok_or(OVERFLOW)
    }

    /// The parts, as large as the pose alone makes them.
    fn parts(&self, view: &View) -> Result<Budget, Error> {
        let problem = &view.problem;
        let found = self.minima().map(|h| h.minimum).min_by(|a, b| a.cost().total_cmp(&b.cost()));
        let lowest = found.ok_or(Error::NoSolution { n_points: problem.seen.len() })?;
        let noise_scale = noise_of(&lowest, problem);
        if self.method == Method::Wang2004 {
            let mut budget = Budget::default();
            let stated = self.covariance / noise_scale;
            budget.add(ErrorSource::Pixels, &stated);
            budget.add(ErrorSource::Residuals, &(stated * (noise_scale - 1.0)));
            return Ok(budget);
        }
        let m = minimum_at(&self.cam_from_target, problem)?;
        let gate = view.gate_chi2();
        let (common, shared_errors) = (view.allowed.common, view.allowed.shared_errors);
        Doubts { problem, common, noise_scale, lowest, shared_errors, gate }.budget(&m)
    }
}

impl LinesEstimate {
    /// The parts of its covariance by their sources, which add up to it; `lines` and `problem` are those of the pose.
    ///
    /// # Errors
    /// `DegenerateView` where numbers overflow.
    pub fn budget(&self, lines: &[LineCorrespondence], problem: &Problem) -> Result<Budget, Error> {
        let pivot = pivot(lines, problem);
        let place = PivotedPose::new(&self.cam_from_target, &pivot);
        let of_lines = information(&place, &pivot, lines);
        let parts = of_observations_and(&of_lines, &place, &pivot, problem)?;
        parts.adding_up_to(&self.covariance).ok_or(OVERFLOW)
    }
}
