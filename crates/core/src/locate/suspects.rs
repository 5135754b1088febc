//! The usual faults of points and intrinsics, where points contradict each other: each is corrected, alone and together with another one, and the
//! views of the camera, one or several, are solved again. Derivation: docs/math/suspects.md.
//!
//! ```text
//!   χ²  of the corrected views  ·  ν  their degrees of freedom  ·  p  parameters that the correction estimates  ·  N  residuals
//!   D = −2 ln L at the noise that fits best, at least the stated one  ·  B = D + p ln N − 2 ln w, w the odds of the fault beforehand
//! ```

mod fault;
mod free_lens;
mod words;

use crate::explanation::probabilities;
use crate::locate::consistency::{Consistency, is_inconsistent, is_unlikely};
use crate::locate::refine::whitened_residual;
use crate::locate::{Config, PoseEstimate};
use crate::{Camera, Correspondence, Error, Vector6};
pub use fault::Fault;
pub(crate) use fault::Free;
use fault::{Trial, View};
use free_lens::{Fit, located};
pub use words::correction;

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
    /// By how much the pose moves from that of the points as stated; none where these have no pose, or of several views.
    pub motion: Option<Vector6>,
    /// The camera with its intrinsics corrected.
    pub camera: Camera,
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
/// So many points of a view show whether a correction is worth solving all of them …
const SCREENED: usize = 12;
/// … and so many views of a camera show what its fault is.
const MOST_VIEWS: usize = 12;
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
    let stated = pose.map_or(f64::INFINITY, |e| deviance(e.chi2, e.degrees_of_freedom));
    Contradiction { views: &[seen], camera, config, origin, free: Free::default(), pose, stated }
        .explanations()
}

/// Returns what explains views of one camera together, of which at most a dozen are examined, the most probable first; `free` is what is not
/// known of its lens. The views need not contradict each other as stated: whoever asks decides with what else is known.
pub(crate) fn explanations_of_views(
    views: &[&[Correspondence]],
    camera: &Camera,
    free: Free,
) -> Vec<Explanation> {
    let (config, origin, views) = (&Config::default(), Origin::Table, &spread(views, MOST_VIEWS));
    let stated = f64::INFINITY;
    let contradiction = Contradiction { views, camera, config, origin, free, pose: None, stated };
    // Where the lens is free, points that agree as stated have no fault.
    let agrees = free != Free::default() && contradiction.explained(&[]).is_some();
    if agrees { Vec::new() } else { contradiction.explanations() }
}

/// Returns the points of views of a camera with faults corrected, seen through the corrected camera; none where a fault cannot be corrected.
pub(crate) fn corrected(
    views: &[&[Correspondence]],
    camera: &Camera,
    by: &Explanation,
) -> Option<Vec<Vec<Correspondence>>> {
    let trial = Trial::new(views, camera, Free::default(), &by.faults)?;
    // A wrong point may have no bearing through the corrected camera: it is left out later.
    let through =
        |c: Correspondence| Correspondence { bearing: by.camera.bearing(&c.pixel).unwrap_or(c.bearing), ..c };
    Some(trial.views.into_iter().map(|seen| seen.into_iter().map(through).collect()).collect())
}

impl Explanation {
    /// Returns the number of parameters that the corrections estimate.
    pub(crate) fn n_parameters(&self) -> usize {
        self.faults.iter().map(Fault::n_parameters).sum()
    }

    /// Returns the explanation with another estimate of focal length (relative) and principal point (over the focal length), as far as it has them.
    pub(crate) fn moved(&self, focal: f64, centre: [f64; 2]) -> Option<Explanation> {
        let mut values: Vec<f64> = self.camera.parameters().iter().map(|(_, value)| *value).collect();
        for fault in &self.faults {
            match fault {
                Fault::OtherFocalLength { .. } => values[..2].iter_mut().for_each(|f| *f *= 1.0 + focal),
                Fault::OtherCrop { .. } => (0..2).for_each(|i| values[2 + i] += centre[i] * values[i]),
                _ => {}
            }
        }
        let camera = self.camera.with_parameters(&values).ok()?;
        let faults = self.faults.iter().map(|fault| fault.estimated(&camera)).collect();
        Some(Explanation { faults, camera, ..self.clone() })
    }

    /// Returns the logarithm of the odds of the faults beforehand.
    pub(crate) fn log_odds(&self) -> f64 {
        self.faults.iter().map(|fault| fault.odds().ln()).sum()
    }
}

/// Views of a camera whose points contradict each other.
struct Contradiction<'a> {
    views: &'a [&'a [Correspondence]],
    camera: &'a Camera,
    config: &'a Config<'a>,
    origin: Origin,
    /// What is not known of the lens, whatever the fault.
    free: Free,
    /// The pose of a single view that fits best; `None` where no pose was found.
    pose: Option<&'a PoseEstimate>,
    /// D of the points as stated.
    stated: f64,
}

impl Contradiction<'_> {
    fn explanations(&self) -> Vec<Explanation> {
        let mut found = self.singles();
        // An explanation that noise as stated would hardly leave excludes no other one.
        let is_good = |e: &&Explanation| !is_unlikely(e.chi2, e.degrees_of_freedom);
        let alone: Vec<Fault> =
            found.iter().map(|(_, e)| e).filter(is_good).flat_map(|e| e.faults.clone()).collect();
        if alone.iter().all(|fault| 0 < fault.n_parameters()) {
            found.extend(self.pairs(&alone));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        let least = found.first().map_or(0.0, |(cost, _)| *cost);
        let costs = found.iter().map(|(cost, _)| *cost).chain([self.stated]);
        let log_odds: Vec<f64> = costs.map(|cost| -0.5 * cost).collect();
        let weighed = found.into_iter().zip(probabilities(&log_odds));
        let named = weighed.take_while(|((cost, _), _)| *cost < least + TIED_GAIN);
        named.map(|((_, e), probability)| Explanation { probability, ..e }).collect()
    }

    /// Returns the faults that concern all points, and those of the lens.
    fn possible(&self) -> impl Iterator<Item = Fault> {
        let origin = self.origin;
        Fault::POINTS.into_iter().filter(move |fault| fault.is_possible(origin)).chain(
            Some(self.camera).filter(|_| self.free == Free::default()).into_iter().flat_map(Fault::of_lens),
        )
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
        let [seen] = self.views else { return Vec::new() };
        if MOST_POINTS_WITH_LABELS < seen.len() || self.origin != Origin::Table {
            return Vec::new();
        }
        let residual = |c: &Correspondence| {
            let found = self.pose.and_then(|e| whitened_residual(&e.cam_from_target, c, self.camera));
            found.map_or(f64::INFINITY, |(_, _, squared)| squared)
        };
        let mut worst: Vec<(usize, f64)> = seen.iter().map(residual).enumerate().collect();
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
        let trial = Trial::new(self.views, self.camera, self.free, faults)?;
        let Fit { camera, poses, chi2, degrees_of_freedom } = self.solved(&trial)?;
        let n_residuals = 2.0 * self.views.iter().map(|seen| seen.len()).sum::<usize>() as f64;
        let paid = trial.free.n_parameters() as f64 * n_residuals.ln();
        let faults = faults.iter().map(|fault| fault.estimated(&camera)).collect();
        let motion = self.pose.zip(poses.first());
        let motion = motion.map(|(e, pose)| (*pose * e.cam_from_target.inverse()).log());
        let explanation = Explanation { faults, chi2, degrees_of_freedom, probability: 0.0, motion, camera };
        let cost = deviance(chi2, degrees_of_freedom) + paid - 2.0 * explanation.log_odds();
        (cost + NEEDED_GAIN < self.stated).then_some((cost, explanation))
    }

    /// Solves corrected views: at first few points, then all of them where noise explains those.
    fn solved(&self, trial: &Trial) -> Option<Fit> {
        let is_plain = trial.n_faults == 1 && trial.free == Free::default();
        let needed = if is_plain { 1 } else { HANDFUL };
        let is_explained = |fit: &Fit| {
            needed <= fit.degrees_of_freedom && !is_inconsistent(fit.chi2, fit.degrees_of_freedom)
        };
        let few: Vec<View> = trial.views.iter().map(|seen| spread(seen, SCREENED)).collect();
        let lens = free_lens::fit(&few, trial, self.config).filter(is_explained)?;
        let lens = free_lens::refined(&trial.views, trial, lens)?;
        located(&trial.views, &lens.camera, trial, self.config).filter(is_explained)
    }
}

/// Returns at most so many, from all over the list.
fn spread<T: Copy>(all: &[T], most: usize) -> Vec<T> {
    let few = all.len().min(most);
    (0..few).map(|i| all[i * all.len() / few]).collect()
}

/// Returns −2 ln L of a residual at the noise that fits best, at least the stated one, docs/math/suspects.md eq. (1).
fn deviance(chi2: f64, degrees_of_freedom: usize) -> f64 {
    let n = degrees_of_freedom as f64;
    if chi2 <= n { chi2 } else { n * (1.0 + (chi2 / n).ln()) }
}
