//! The usual faults of camera files, pixels and labels, where a rig contradicts itself or has no solution: what explains all views of a camera
//! together is corrected, and the rig is solved again. docs/math/suspects.md section 5.

use super::exchanged::{NEEDED_GAIN, misfit};
use super::lens_doubt::EXPECTED_DEGREES;
use super::{Cause, Observation, RigConfig, RigExplanation, RigProblem, RigSolution};
use crate::explanation::Weighed;
use crate::locate::suspects::{Explanation, Free, corrected, explanations_of_views};
use crate::{Correspondence, Error};

/// So many corrections are tried by solving the rig again.
const MOST_TRIED: usize = 6;
/// With fewer points an observation shows nothing of a fault.
const LEAST_POINTS: usize = 4;

/// Adds the faults with which an inconsistent rig is consistent: those of one camera, else those that all cameras have.
pub(super) fn examined(
    problem: &RigProblem,
    config: &RigConfig,
    mut stated: RigSolution,
    solve: impl Fn(&RigProblem, &RigConfig) -> Result<RigSolution, Error>,
) -> RigSolution {
    let is_solved = |what| matches!(what, RigExplanation::Late { .. } | RigExplanation::Exchanged { .. });
    if !stated.verdict.is_inconsistent || stated.explanations.iter().any(|one| is_solved(one.what)) {
        return stated;
    }
    let found = Contradiction { problem, config, stated: Some(&stated), solve }.explanations();
    for explanation in found {
        // Another lens of a camera is what its fault makes of it.
        if let RigExplanation::Fault { camera: Some(camera), .. } = explanation.what {
            stated.explanations.retain(|one| one.what != RigExplanation::Lens { camera });
        }
        stated.explain(Some(explanation));
    }
    stated
}

/// Returns the faults with which a rig that has no solution as stated is solved and consistent, the most probable first.
pub(super) fn of_unsolved(
    problem: &RigProblem,
    config: &RigConfig,
    solve: impl Fn(&RigProblem, &RigConfig) -> Result<RigSolution, Error>,
) -> Vec<RigExplanation> {
    let mut found = Contradiction { problem, config, stated: None, solve }.explanations();
    found.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
    found.into_iter().map(|one| one.what).collect()
}

/// A rig that is inconsistent as stated, or has no solution.
struct Contradiction<'a, S> {
    problem: &'a RigProblem<'a>,
    config: &'a RigConfig<'a>,
    stated: Option<&'a RigSolution>,
    solve: S,
}

impl<S: Fn(&RigProblem, &RigConfig) -> Result<RigSolution, Error>> Contradiction<'_, S> {
    fn explanations(&self) -> Vec<Weighed<RigExplanation>> {
        let suspected = self.suspected();
        let of_each: Vec<Vec<Explanation>> = suspected.iter().map(|camera| self.of_camera(*camera)).collect();
        let of = |(camera, all): (&usize, &Vec<Explanation>)| {
            all.iter().cloned().enumerate().map(|(rank, one)| (rank, *camera, one)).collect::<Vec<_>>()
        };
        let mut ranked: Vec<_> = suspected.iter().zip(&of_each).flat_map(of).collect();
        ranked.sort_by_key(|(rank, ..)| *rank);
        let alone =
            |(_, camera, one): (usize, usize, Explanation)| self.explained(Some(camera), &[(camera, one)]);
        let found: Vec<_> = ranked.into_iter().take(MOST_TRIED).filter_map(alone).collect();
        if found.is_empty() { self.of_all() } else { found }
    }

    /// Returns the cameras that are at fault by the verdict, the worst one first; all of them where none is, and of two, which blame each other.
    fn suspected(&self) -> Vec<usize> {
        let Some(RigSolution { verdict, .. }) = self.stated else {
            return (0..self.problem.cameras.len()).collect();
        };
        let is_own = |camera: &usize| {
            !matches!(verdict.cameras[*camera].cause, None | Some(Cause::Reference | Cause::Target))
        };
        let all = 0..self.problem.cameras.len();
        let mut suspected: Vec<usize> = all.clone().filter(is_own).collect();
        if suspected.is_empty() || all.len() == 2 {
            suspected = all.collect();
        }
        suspected.sort_by_key(|camera| Some(*camera) != verdict.worst_camera);
        suspected
    }

    /// Returns the explanations by one fault that all cameras have.
    fn of_all(&self) -> Vec<Weighed<RigExplanation>> {
        let of_each: Vec<Vec<Explanation>> =
            (0..self.problem.cameras.len()).map(|camera| self.of_camera(camera)).collect();
        let Some((first, others)) = of_each.split_first() else { return Vec::new() };
        let same = |one: &Explanation, all: &Vec<Explanation>| {
            all.iter().find(|other| other.faults == one.faults).cloned()
        };
        let common = |one: &Explanation| {
            let others = others.iter().map(|all| same(one, all)).collect::<Option<Vec<_>>>()?;
            let corrections: Vec<_> = core::iter::once(one.clone()).chain(others).enumerate().collect();
            self.explained(None, &corrections)
        };
        first.iter().take(MOST_TRIED).filter_map(common).collect()
    }

    /// Returns what explains the views of a camera by themselves.
    fn of_camera(&self, camera: usize) -> Vec<Explanation> {
        let own = self.problem.observations.iter().filter(|s| s.camera == camera);
        let views: Vec<&[Correspondence]> =
            own.map(|s| &s.seen[..]).filter(|seen| LEAST_POINTS <= seen.len()).collect();
        explanations_of_views(&views, &self.problem.cameras[camera], Free::default())
    }

    /// Returns the explanation by faults of one camera, or of all, where the rig is consistent without them.
    fn explained(
        &self,
        camera: Option<usize>,
        corrections: &[(usize, Explanation)],
    ) -> Option<Weighed<RigExplanation>> {
        let (at, mut first) = corrections.first().cloned()?;
        let mut found = self.solved(corrections)?;
        if found.verdict.is_inconsistent && 0 < first.n_parameters() {
            // The rig determines a lens better than the views of one camera do.
            let offset = found.verdict.lens_offsets[at]?;
            first = first.moved(offset.focal, offset.centre)?;
            found = self.solved(&[(at, first.clone())])?;
        }
        if found.verdict.is_inconsistent {
            return None;
        }
        let n_seen: usize = corrections.iter().map(|(camera, _)| found.cameras[*camera].n_seen).sum();
        let paid = 0.5 * first.n_parameters() as f64 * (2.0 * n_seen as f64).ln();
        let odds = first.log_odds() - (self.problem.cameras.len() as f64).ln() - paid;
        let what = RigExplanation::Fault {
            camera,
            fault: *first.faults.first()?,
            second: first.faults.get(1).copied(),
        };
        let Some(stated) = self.stated else {
            return Some(Weighed::new(what, odds, Vec::new()));
        };
        let gain = (misfit(stated, self.config) - misfit(&found, self.config))
            / (found.noise_scale * found.view_scale);
        let nu = EXPECTED_DEGREES + self.problem.n_views as f64;
        let log_odds = odds + 0.5 * nu * (gain / nu).ln_1p();
        (NEEDED_GAIN < gain).then(|| Weighed::new(what, log_odds, stated.motions_to(&found)))
    }

    /// Solves the rig with cameras corrected.
    fn solved(&self, corrections: &[(usize, Explanation)]) -> Option<RigSolution> {
        let (mut cameras, mut intrinsics) = (self.problem.cameras.to_vec(), self.config.intrinsics.to_vec());
        let mut observations = self.problem.observations.to_vec();
        for (camera, by) in corrections {
            let mut own: Vec<&mut Observation> =
                observations.iter_mut().filter(|s| s.camera == *camera).collect();
            let views: Vec<&[Correspondence]> = own.iter().map(|s| &s.seen[..]).collect();
            let views = corrected(&views, &cameras[*camera], by)?;
            own.iter_mut().zip(views).for_each(|(s, seen)| s.seen = seen);
            cameras[*camera] = by.camera.clone();
            // What was stated is the uncertainty of the intrinsics as stated.
            intrinsics.iter_mut().skip(*camera).take(1).for_each(|own| *own = None);
        }
        let problem = RigProblem { cameras: &cameras, observations: &observations, ..*self.problem };
        (self.solve)(&problem, &RigConfig { intrinsics: &intrinsics, ..*self.config }).ok()
    }
}
