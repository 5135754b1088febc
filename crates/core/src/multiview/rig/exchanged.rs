//! Camera files of two cameras exchanged: tried where the offsets of both lenses suggest it, and named where the views then agree much better.
//!
//! A focal length 1 % off moves a camera by 1 % of its distance from the target, which residuals of a few views hardly show: each of two
//! exchanged files passes the test alone. Together they are one hypothesis with nothing to estimate. docs/math/rig.md eqs. (22), (23).

use super::lens_doubt::EXPECTED_DEGREES;
use super::{Cause, LensOffset, Losses, Observation, RigConfig, RigExplanation, RigProblem, RigSolution};
use crate::explanation::Weighed;
use crate::locate::loss::Loss;
use crate::{Camera, Correspondence, Error, Point, Vector6};

/// The number of pairs that are solved again.
const MOST_PAIRS: usize = 3;
/// Odds of an exchange before the observations are seen, as one of the explanations.
const ODDS: f64 = 0.02;
/// Smallest gain of χ² by an exchange or another fault, in units of the variance that the views show: 2 ln 10⁴, because files are right far more often than
/// exchanged.
pub(super) const NEEDED_GAIN: f64 = 18.4;

/// Returns the solution as stated; inconsistent where the files of two cameras appear to be exchanged.
pub(super) fn examined(
    problem: &RigProblem,
    config: &RigConfig,
    stated: RigSolution,
    solve: impl Fn(&RigProblem, &RigConfig) -> Result<RigSolution, Error>,
) -> RigSolution {
    let fits_better = |pair: &(usize, usize)| {
        let (mut cameras, mut intrinsics) = (problem.cameras.to_vec(), config.intrinsics.to_vec());
        cameras.swap(pair.0, pair.1);
        let observations = problem.observations.iter().map(|s| seen_through(s, &cameras[s.camera]));
        let observations = observations.collect::<Option<Vec<Observation>>>()?;
        if !intrinsics.is_empty() {
            intrinsics.swap(pair.0, pair.1);
        }
        let problem = RigProblem { cameras: &cameras, observations: &observations, ..*problem };
        let exchanged = solve(&problem, &RigConfig { intrinsics: &intrinsics, ..*config }).ok()?;
        let scale = exchanged.noise_scale * exchanged.view_scale;
        let gain = (misfit(&stated, config) - misfit(&exchanged, config)) / scale;
        let motions = stated.motions_to(&exchanged);
        (!exchanged.verdict.is_inconsistent && NEEDED_GAIN < gain).then_some((gain, *pair, motions))
    };
    let found = suspected(problem, config, &stated);
    let best = found.iter().filter_map(fits_better).max_by(|a, b| a.0.total_cmp(&b.0));
    match best {
        Some((gain, (a, b), motions)) => {
            let nu = EXPECTED_DEGREES + problem.n_views as f64;
            let log_odds = ODDS.ln() + 0.5 * nu * (gain / nu).ln_1p();
            let matters = matters(&stated, &motions, config);
            let mut stated = if matters { blaming(stated, (a, b)) } else { stated };
            stated.explain(Some(Weighed::new(RigExplanation::Exchanged { a, b }, log_odds, motions)));
            stated
        }
        None => stated,
    }
}

/// Returns whether the exchange explains a contradiction or moves a camera by more than its covariance; with a stated tolerance, by more than that.
fn matters(stated: &RigSolution, motions: &[Vector6], config: &RigConfig) -> bool {
    let tolerance = &config.tolerance;
    let mut moved = stated.cameras.iter().zip(motions);
    (stated.verdict.is_inconsistent && !tolerance.is_stated())
        || moved.any(|(camera, motion)| tolerance.is_exceeded(motion, &camera.covariance))
}

/// Returns the observation with the bearings of another lens; none where a pixel has no bearing there.
pub(super) fn seen_through(observation: &Observation, camera: &Camera) -> Option<Observation> {
    let through = |c: &Correspondence| Some(Correspondence { bearing: camera.bearing(&c.pixel).ok()?, ..*c });
    let seen = observation.seen.iter().map(through).collect::<Option<Vec<_>>>()?;
    Some(Observation { seen, ..observation.clone() })
}

/// Returns χ², with points left out counted at the gate.
pub(super) fn misfit(solution: &RigSolution, config: &RigConfig) -> f64 {
    let gate = match config.loss {
        Loss::Truncated { sigmas } => sigmas,
        _ => 0.0,
    };
    solution.chi2 + gate * gate * (solution.n_seen - solution.n_used) as f64
}

/// Returns the pairs of cameras with images of one size and different lenses, where the other's lens compensates the offset of each; the best
/// first.
fn suspected(problem: &RigProblem, config: &RigConfig, stated: &RigSolution) -> Vec<(usize, usize)> {
    if !matches!(config.loss, Loss::Squared | Loss::Truncated { .. }) {
        return Vec::new();
    }
    let (cameras, offsets) = (problem.cameras, &stated.verdict.lens_offsets);
    let gain = |a: usize, b: usize| {
        let of = |from: usize, to: usize| made_up_for(&offsets[from]?, &cameras[from], &cameras[to]);
        Some(of(a, b)? + of(b, a)?)
    };
    let mut pairs: Vec<(f64, (usize, usize))> = (0..cameras.len())
        .flat_map(|b| (0..b).map(move |a| (a, b)))
        .filter(|(a, b)| cameras[*a].size == cameras[*b].size && cameras[*a].lens != cameras[*b].lens)
        .filter_map(|(a, b)| Some((gain(a, b)?, (a, b))))
        .filter(|(gain, _)| 0.0 < *gain)
        .collect();
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0));
    pairs.into_iter().take(MOST_PAIRS).map(|(_, pair)| pair).collect()
}

/// Returns the decrease of the squared offset over its variance when another lens is used.
fn made_up_for(offset: &LensOffset, from: &Camera, to: &Camera) -> Option<f64> {
    let axis =
        |camera: &Camera| camera.project_with_jacobian(&Point::z()).map(|(c, by)| (c, by[(0, 0)].abs()));
    let ((centre, focal_px), (other, other_px)) = (axis(from)?, axis(to)?);
    let moved = (other - centre) / focal_px;
    let terms = [
        (offset.focal, other_px / focal_px - 1.0, offset.sigma_focal),
        (offset.centre[0], moved.x, offset.sigma_centre[0]),
        (offset.centre[1], moved.y, offset.sigma_centre[1]),
    ];
    Some(terms.iter().map(|(off, by, sigma)| (off * off - (off - by) * (off - by)) / (sigma * sigma)).sum())
}

/// Attributes the contradiction to the exchange, which explains every other fault.
fn blaming(stated: RigSolution, (a, b): (usize, usize)) -> RigSolution {
    let mut verdict = stated.verdict.clone();
    let of = |camera: usize| match camera {
        _ if camera == a => Some(Cause::ExchangedIntrinsics { with: b }),
        _ if camera == b => Some(Cause::ExchangedIntrinsics { with: a }),
        _ => None,
    };
    let set = |(camera, losses): (usize, &mut Losses)| losses.cause = of(camera);
    verdict.cameras.iter_mut().enumerate().for_each(set);
    verdict.targets.iter_mut().for_each(|target| target.cause = None);
    (verdict.is_inconsistent, verdict.worst_camera) = (true, Some(a));
    RigSolution { verdict, ..stated }
}
