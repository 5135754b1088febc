//! Explanations of an inconsistent rig that take another solution: a camera that exposes later than the others.
//!
//! Without stamps the views are taken to follow each other at equal intervals, as the frames of a video do. docs/math/explanations.md section 1.

use super::lens_doubt::EXPECTED_DEGREES;
use super::{FrameStamps, RigConfig, RigExplanation, RigProblem, RigSolution, time_offsets};
use crate::explanation::Weighed;
use crate::locate::loss::Loss;
use crate::{Error, Vector6};
use nalgebra::DMatrix;

/// The interval between views, s: offsets are read in views, so that its only meaning is that it is within the longest gap of a path.
const VIEW_S: f64 = 0.1;
/// Standard deviation of the offset of a camera that is late, in views.
const LATE_VIEWS: f64 = 1.0;
/// Odds of cameras that do not expose together, before the observations are seen.
const ODDS: f64 = 0.1;

/// Adds the explanation that cameras expose at different times, where with their offsets an inconsistent rig is consistent.
pub(super) fn examined(
    problem: &RigProblem,
    config: &RigConfig,
    mut stated: RigSolution,
    solve: impl Fn(&RigProblem, &RigConfig) -> Result<RigSolution, Error>,
) -> RigSolution {
    if stated.verdict.is_inconsistent && config.time_offsets.is_none() {
        let late = late(problem, config, &stated, solve);
        stated.explain(late);
    }
    stated
}

fn late(
    problem: &RigProblem,
    config: &RigConfig,
    stated: &RigSolution,
    solve: impl Fn(&RigProblem, &RigConfig) -> Result<RigSolution, Error>,
) -> Option<Weighed<RigExplanation>> {
    let stamps_s: Vec<f64> = problem.observations.iter().map(|s| VIEW_S * s.view as f64).collect();
    let stamps = FrameStamps { stamps_s: &stamps_s, line_time: false };
    // A camera that is far from the others in time contradicts them in every view: no point may be left out before its time is known.
    let every_point = RigConfig { loss: Loss::Squared, ..*config };
    let times = time_offsets(problem, &every_point, &stamps).ok()??;
    let moved = RigProblem { observations: &times.observations, ..*problem };
    let found = solve(&moved, &RigConfig { time_offsets: Some(&times), ..*config }).ok()?;
    if found.verdict.is_inconsistent {
        return None;
    }
    let estimate = times.estimate(EXPECTED_DEGREES + problem.n_views as f64)?;
    let n = estimate.value.len();
    let prior = DMatrix::from_diagonal_element(n, n, (LATE_VIEWS * VIEW_S).powi(2));
    let (gain, _) = estimate.with_prior(&prior)?;
    let latest =
        times.offset_s.iter().enumerate().filter_map(|(camera, offset)| Some((camera, (*offset)?.0)));
    let (camera, offset_s) = latest.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    let what = RigExplanation::Late { camera, views: offset_s / VIEW_S };
    Some(Weighed::new(what, ODDS.ln() + gain, stated.motions_to(&found)))
}

impl RigSolution {
    /// Returns by how much every camera moves from this solution to another one.
    pub(super) fn motions_to(&self, other: &RigSolution) -> Vec<Vector6> {
        let moved = self.cameras.iter().zip(&other.cameras);
        moved.map(|(from, to)| (to.cam_from_rig * from.cam_from_rig.inverse()).log()).collect()
    }

    /// Weighs one more explanation against the others.
    pub(super) fn explain(&mut self, explanation: Option<Weighed<RigExplanation>>) {
        if let Some(explanation) = explanation {
            self.explanations.push(explanation);
            Weighed::weigh(&mut self.explanations);
        }
    }
}
