//! The usual faults of points and intrinsics, where points contradict each other: each is corrected, alone and together with another one, and the
//! view is solved again. Derivation: docs/math/suspects.md.
//!
//! ```text
//!   χ²  of the corrected view  ·  ν  its degrees of freedom  ·  p  parameters that the correction estimates  ·  N  residuals
//!   D = −2 ln L at the noise that fits best, at least the stated one  ·  B = D + p ln N − 2 ln w, w the odds of the fault beforehand
//! ```

mod fault;
mod free_lens;

use crate::explanation::probabilities;
use crate::locate::consistency::{Consistency, is_inconsistent, is_unlikely};
use crate::locate::refine::whitened_residual;
use crate::locate::{Config, PoseEstimate};
use crate::{Camera, Correspondence, Error, Vector6};
pub use fault::Fault;
use fault::{Free, Trial};
use free_lens::{Fit, located};

/// What makes contradicting points agree.
#[derive(Debug, Clone, PartialEq)]
pub struct Explanation {
    /// One fault, or two that explain the points only together.
    pub faults: Vec<Fault>,
    /// χ² once they are corrected.
    pub chi2: f64,
    /// Degrees of freedom that then remain: those of the points less the estimated parameters.
    pub degrees_of_freedom: usize,
    /// Its probability among all that were tried, the points as stated included.
    pub probability: f64,
    /// By how much the pose moves from that of the points as stated; none where these have no pose.
    pub motion: Option<Vector6>,
}

/// Where the points of a view come from, which decides what faults they can have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// A table of points and pixels: all of them.
    Table,
    /// An image of a target, in which a detector finds pixels and labels itself: those of the lens, and that the image is mirrored.
    Image,
}

/// Two faults, or a correction that estimates parameters, need so many degrees of freedom that remain: four redundant points.
const HANDFUL: usize = 8;
/// An explanation must be so many times more probable than a fault that is not in the list: 2 ln 100.
const NEEDED_GAIN: f64 = 9.2;
/// An explanation that is a thousand times less probable than the best is not named: 2 ln 1000.
const TIED_GAIN: f64 = 13.8;
/// So many points show whether a correction is worth solving all of them.
const SCREENED: usize = 12;
/// Number of points of which pairs of labels are tried: the worst ones.
const MOST_LABELS: usize = 12;
/// With more points, labels are not tried.
const MOST_POINTS_WITH_LABELS: usize = 200;

/// Returns the explanations of a contradiction, the most probable first; none where the points agree, or where the priors contradict them.
pub fn explanations(
    solved: Result<&PoseEstimate, &Error>,
    seen: &[Correspondence],
    camera: &Camera,
    config: &Config,
    origin: Origin,
) -> Vec<Explanation> {
    let pose = match solved {
        Ok(e) if matches!(e.consistency, Consistency::Inconsistent { worst_prior: None, .. }) => Some(e),
        Err(Error::NoSolution { .. } | Error::NotConverged { .. } | Error::OutsideField { .. }) => None,
        _ => return Vec::new(),
    };
    let contradiction = Contradiction { seen, camera, config, origin, pose };
    let mut found = contradiction.singles();
    // An explanation that noise as stated would hardly leave excludes no other one.
    let is_good = |e: &&Explanation| !is_unlikely(e.chi2, e.degrees_of_freedom);
    let alone: Vec<Fault> =
        found.iter().map(|(_, e)| e).filter(is_good).flat_map(|e| e.faults.clone()).collect();
    if alone.iter().all(|fault| 0 < fault.n_parameters()) {
        found.extend(contradiction.pairs(&alone));
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let least = found.first().map_or(0.0, |(cost, _)| *cost);
    let costs = found.iter().map(|(cost, _)| *cost).chain([contradiction.as_stated()]);
    let log_odds: Vec<f64> = costs.map(|cost| -0.5 * cost).collect();
    let weighed = found.into_iter().zip(probabilities(&log_odds));
    let named = weighed.take_while(|((cost, _), _)| *cost < least + TIED_GAIN);
    named.map(|((_, e), probability)| Explanation { probability, ..e }).collect()
}

/// A view whose points contradict each other.
struct Contradiction<'a> {
    seen: &'a [Correspondence],
    camera: &'a Camera,
    config: &'a Config<'a>,
    origin: Origin,
    /// The pose that fits best; `None` where no pose was found.
    pose: Option<&'a PoseEstimate>,
}

impl Contradiction<'_> {
    /// Returns the faults that concern all points, and those of the lens.
    fn possible(&self) -> impl Iterator<Item = Fault> {
        let origin = self.origin;
        Fault::POINTS
            .into_iter()
            .filter(move |fault| fault.is_possible(origin))
            .chain(Fault::of_lens(self.camera))
    }

    fn singles(&self) -> Vec<(f64, Explanation)> {
        let faults =
            self.possible().chain(Fault::SHIFTS.into_iter().filter(|_| self.origin == Origin::Table));
        let mut found: Vec<_> = faults.filter_map(|fault| self.explained(&[fault])).collect();
        if found.is_empty() {
            found = self.label_pairs().into_iter().filter_map(|fault| self.explained(&[fault])).collect();
        }
        found
    }

    /// Tries two faults at once, neither of which is in `alone`.
    fn pairs(&self, alone: &[Fault]) -> Vec<(f64, Explanation)> {
        let is_open = |fault: &Fault| !alone.iter().any(|explains| explains.kind() == fault.kind());
        let faults: Vec<Fault> = self.possible().filter(is_open).collect();
        let others = |(i, first): (usize, &Fault)| {
            let pair = |second: &Fault| Some((*first, *second)).filter(|_| first.goes_with(second));
            faults[i + 1..].iter().filter_map(pair).collect::<Vec<_>>()
        };
        let pairs = faults.iter().enumerate().flat_map(others);
        pairs.filter_map(|(first, second)| self.explained(&[first, second])).collect()
    }

    /// Returns the pairs of the points with the largest residuals.
    fn label_pairs(&self) -> Vec<Fault> {
        if MOST_POINTS_WITH_LABELS < self.seen.len() || self.origin != Origin::Table {
            return Vec::new();
        }
        let residual = |c: &Correspondence| {
            let found = self.pose.and_then(|e| whitened_residual(&e.cam_from_target, c, self.camera));
            found.map_or(f64::INFINITY, |(_, _, squared)| squared)
        };
        let mut worst: Vec<(usize, f64)> = self.seen.iter().map(residual).enumerate().collect();
        worst.sort_by(|a, b| b.1.total_cmp(&a.1));
        worst.truncate(MOST_LABELS);
        let pair = |(a, b): (usize, usize)| Fault::LabelsExchanged { a: a.min(b), b: a.max(b) };
        let others = |n: usize| worst[n + 1..].iter().map(move |(b, _)| *b).collect::<Vec<_>>();
        (0..worst.len())
            .flat_map(|n| others(n).into_iter().map(move |b| (n, b)))
            .map(|(n, b)| pair((worst[n].0, b)))
            .collect()
    }

    /// Returns the explanation by one or two faults, with B of it, where noise explains what remains.
    fn explained(&self, faults: &[Fault]) -> Option<(f64, Explanation)> {
        let trial = Trial::new(self.seen, self.camera, faults)?;
        let Fit { camera, cam_from_target, chi2, degrees_of_freedom } = self.solved(&trial)?;
        let odds: f64 = faults.iter().map(|fault| fault.odds().ln()).sum();
        let n_residuals = 2.0 * self.seen.len() as f64;
        let paid = trial.free.n_parameters() as f64 * n_residuals.ln();
        let cost = deviance(chi2, degrees_of_freedom) + paid - 2.0 * odds;
        let faults = faults.iter().map(|fault| fault.estimated(&camera)).collect();
        let motion = self.pose.map(|e| (cam_from_target * e.cam_from_target.inverse()).log());
        let explanation = Explanation { faults, chi2, degrees_of_freedom, probability: 0.0, motion };
        (cost + NEEDED_GAIN < self.as_stated()).then_some((cost, explanation))
    }

    /// Returns D of the points as stated.
    fn as_stated(&self) -> f64 {
        self.pose.map_or(f64::INFINITY, |e| deviance(e.chi2, e.degrees_of_freedom))
    }

    /// Solves a corrected view: at first few points, then all of them where noise explains those.
    fn solved(&self, trial: &Trial) -> Option<Fit> {
        let is_plain = trial.n_faults == 1 && trial.free == Free::default();
        let needed = if is_plain { 1 } else { HANDFUL };
        let is_explained = |fit: &Fit| {
            needed <= fit.degrees_of_freedom && !is_inconsistent(fit.chi2, fit.degrees_of_freedom)
        };
        let few = spread(&trial.seen);
        let lens = free_lens::fit(&few, trial, self.config).filter(is_explained)?;
        let lens = free_lens::refined(&trial.seen, trial, lens)?;
        located(&trial.seen, &lens.camera, trial, self.config).filter(is_explained)
    }
}

/// Returns a few points, from all over the list.
fn spread(seen: &[Correspondence]) -> Vec<Correspondence> {
    let n = seen.len();
    let few = n.min(SCREENED);
    (0..few).map(|i| seen[i * n / few]).collect()
}

/// Returns −2 ln L of a residual at the noise that fits best, at least the stated one, docs/math/suspects.md eq. (1).
fn deviance(chi2: f64, degrees_of_freedom: usize) -> f64 {
    let n = degrees_of_freedom as f64;
    if chi2 <= n { chi2 } else { n * (1.0 + (chi2 / n).ln()) }
}
