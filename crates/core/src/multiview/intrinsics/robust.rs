//! Selects the corners and views that take part: gross errors are found from the residuals of a fit that they hardly affect, and named.
//! docs/math/intrinsics.md section 4.

use super::adjust::{Fit, Seen, Shared, fit, fit_with_second_solutions};
use nalgebra::Vector2;

/// A corner beyond this many standard deviations (of the residuals' noise) is a gross error; three in ten million good ones are.
pub const GROSS_SIGMAS: f64 = 5.5;
/// A view whose corners scatter by this factor more than the others is bad as a whole …
pub const BAD_VIEW_TIMES: f64 = 3.0;
/// … as is one that keeps less than this part of its corners …
const LEAST_SHARE: f64 = 0.6;
/// … or fewer corners than this: a pose absorbs most of their information.
pub const LEAST_POINTS: usize = 6;
/// No print and no lens model is truer than this, pixels: what is nearer to the answer is no gross error, however small the noise (of rendered
/// images, say).
const LEAST_FAULT_PX: f64 = 0.1;
/// Largest number of rounds of weighting and of rejection.
const MAX_ROUNDS: usize = 6;
/// Median of χ² with two degrees of freedom.
const MEDIAN_CHI2: f64 = 1.386_294_361_119_890_6;
/// While weights are sought, corners half as far as a gross error lose weight already: (1 + d²/c²)⁻² with c in standard deviations.
const SOFT: f64 = 3.0;
/// Weights that change by less than this have converged.
const SETTLED: f64 = 0.02;

/// Why a view takes no part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BadView {
    /// Its corners scatter far more than those of the others.
    Scatters {
        /// Root mean square of its residuals, px.
        rms_px: f64,
        /// The largest accepted, px.
        needed_px: f64,
    },
    /// Too many of its corners are gross errors.
    GrossErrors {
        /// Number of gross errors.
        n: usize,
        /// Number of corners.
        of: usize,
    },
}

/// A fit without gross errors.
#[derive(Debug, Clone)]
pub(super) struct Clean {
    pub(super) fit: Fit,
    /// Bad views in their last state.
    pub(super) bad: Vec<(Seen, BadView)>,
}

/// Fits the views: first reduces the weight of corners that are far off, if any, then rejects gross errors until the selection is stable.
pub(super) fn clean(seen: Vec<Seen>, shared: Shared) -> Option<Clean> {
    let found = weighed(fit_with_second_solutions(seen, shared)?)?;
    let sigma = noise(&found);
    let any = found.seen.iter().any(|view| found.residuals(view).iter().any(|r| is_gross(r, sigma)));
    without_gross_errors(if any { softly(found)? } else { found })
}

/// Starts from an answer that gross errors hardly affect: rejects these, and restores corners that are good.
pub(super) fn cleaned_from(seen: Vec<Seen>, shared: Shared) -> Option<Clean> {
    without_gross_errors(fit(seen, shared)?)
}

fn without_gross_errors(mut found: Fit) -> Option<Clean> {
    let mut bad: Vec<(Seen, BadView)> = Vec::new();
    for _ in 0..MAX_ROUNDS {
        let sigma = noise(&found);
        let (mut kept, mut changed) = (Vec::new(), false);
        // Bad views may be good under a better camera.
        let back: Vec<Seen> = std::mem::take(&mut bad).into_iter().map(|(view, _)| view).collect();
        let n_in = found.seen.len();
        for (number, view) in found.seen.iter().chain(&back).enumerate() {
            let (weighed, reason) = judged(&found, view, sigma);
            let was_in = number < n_in;
            match reason {
                Some(reason) => {
                    changed |= was_in;
                    bad.push((weighed, reason));
                }
                None => {
                    changed |= !was_in || weighed.weights != view.weights;
                    kept.push(weighed);
                }
            }
        }
        if !changed {
            break;
        }
        kept.sort_by_key(|view| view.view);
        found = weighed(fit(kept, found.shared)?)?;
    }
    bad.sort_by_key(|(view, _)| view.view);
    Some(Clean { fit: found, bad })
}

/// Repeats a fit with the prior of the lens weighted by the noise of the residuals.
fn weighed(found: Fit) -> Option<Fit> {
    let variance = noise(&found).powi(2);
    let times = variance / found.shared.noise;
    if !(0.0 < found.shared.noise) || (1.0 / SAME_NOISE..SAME_NOISE).contains(&times) {
        return Some(found);
    }
    fit(found.seen, Shared { noise: variance, ..found.shared })
}

/// Variances within this factor give equal weights.
const SAME_NOISE: f64 = 1.5;

/// Repeats a fit with weights that depend on the residuals.
fn softly(mut found: Fit) -> Option<Fit> {
    for _ in 0..MAX_ROUNDS {
        let scale = (SOFT * noise(&found)).powi(2);
        let mut largest = 0.0f64;
        let residuals: Vec<_> = found.seen.iter().map(|view| found.residuals(view)).collect();
        for (view, residuals) in found.seen.iter_mut().zip(residuals) {
            for (weight, residual) in view.weights.iter_mut().zip(residuals) {
                let new =
                    residual.map_or(LEAST_WEIGHT, |(_, d2)| (1.0 + d2 / scale).powi(-2).max(LEAST_WEIGHT));
                largest = largest.max((new - *weight).abs());
                *weight = new;
            }
        }
        if largest < SETTLED {
            break;
        }
        found = fit(found.seen, found.shared)?;
    }
    Some(found)
}

/// Keeps a far corner from losing all weight.
const LEAST_WEIGHT: f64 = 1e-6;

/// Returns the residuals' standard deviation in units of the stated ones, from their median: half of them may be gross errors.
fn noise(fit: &Fit) -> f64 {
    let mut squared: Vec<f64> = fit
        .seen
        .iter()
        .flat_map(|view| fit.residuals(view))
        .map(|r| r.map_or(f64::INFINITY, |(_, d2)| d2))
        .collect();
    squared.sort_by(f64::total_cmp);
    let median = squared.get(squared.len() / 2).copied().unwrap_or(0.0);
    // Corrects for the unknowns, which absorbed a part of the residuals.
    let n = fit.n_numbers().max(1) as f64;
    let left = (fit.degrees_of_freedom().max(1) as f64 / n).min(1.0);
    (median / MEDIAN_CHI2 / left).sqrt().clamp(f64::MIN_POSITIVE.sqrt(), 1e150)
}

/// Returns whether a residual is beyond the noise and beyond what prints and lens models leave; `None` is a corner without a prediction.
fn is_gross(residual: &Option<(Vector2<f64>, f64)>, sigma: f64) -> bool {
    let is_good =
        |(e, d2): &(Vector2<f64>, f64)| *d2 <= (GROSS_SIGMAS * sigma).powi(2) || e.norm() <= LEAST_FAULT_PX;
    !residual.as_ref().is_some_and(is_good)
}

/// Returns a view with weight 0 for gross errors and 1 for the others, and the fault of the whole view.
fn judged(fit: &Fit, view: &Seen, sigma: f64) -> (Seen, Option<BadView>) {
    let residuals = fit.residuals(view);
    let weights: Vec<f64> = residuals.iter().map(|r| if is_gross(r, sigma) { 0.0 } else { 1.0 }).collect();
    let (of, n) = (weights.len(), weights.iter().filter(|w| **w == 0.0).count());
    let mut squared: Vec<(f64, f64)> =
        residuals.iter().flatten().map(|(e, d2)| (*d2, e.norm_squared())).collect();
    squared.sort_by(|a, b| a.0.total_cmp(&b.0));
    let middle = squared.get(squared.len() / 2).copied().unwrap_or((0.0, 0.0));
    let times = (middle.0 / MEDIAN_CHI2).sqrt() / sigma;
    let rms_px = (squared.iter().map(|(_, px2)| px2).sum::<f64>() / (2 * squared.len()).max(1) as f64).sqrt();
    let reason = if BAD_VIEW_TIMES < times && LEAST_FAULT_PX < rms_px {
        Some(BadView::Scatters { rms_px, needed_px: rms_px * BAD_VIEW_TIMES / times })
    } else if (of - n) < LEAST_POINTS || ((of - n) as f64) < LEAST_SHARE * of as f64 {
        Some(BadView::GrossErrors { n, of })
    } else {
        None
    };
    // A bad view gets full weights: all of its corners may be accepted later.
    let weights = if reason.is_some() { vec![1.0; of] } else { weights };
    (Seen { weights, ..view.clone() }, reason)
}
