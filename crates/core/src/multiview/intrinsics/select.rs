//! How many coefficients the data carry: every choice of a family is fitted to the same corners, and the evidence (AIC) picks the one that is
//! expected to predict further views best. docs/math/intrinsics.md section 5.

use super::adjust::{Fit, Seen, Shape, Shared, fit};
use super::model::LensChoice;
use crate::Camera;
use crate::multiview::intrinsics_check::{Group, MAX_RELATIVE_SIGMA, focal_length, weakest};

/// A choice of another family must be better by this much (odds of 20 to 1): of two that fit about equally well the first stays.
pub const FAMILY_MARGIN: f64 = 6.0;
/// A choice with less than this weight says nothing about the covariance.
const LEAST_WEIGHT: f64 = 1e-3;

/// How well a choice fits.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// Which.
    pub choice: LensChoice,
    /// Root mean square of the residuals, px of one coordinate; none where there is no fit.
    pub rms_px: Option<f64>,
    /// Akaike's information criterion, less that of the choice taken; none where there is no fit, or it is undetermined.
    pub aic: Option<f64>,
    /// A parameter that the views leave open, and its relative standard deviation.
    pub undetermined: Option<(&'static str, f64)>,
}

/// A fit of a choice with its evidence.
#[derive(Debug, Clone)]
pub(super) struct Tried {
    pub(super) evidence: Evidence,
    pub(super) fit: Option<Fit>,
}

/// Every choice of a family, the next from where the one before ended, until one is undetermined.
pub(super) fn ladder(family: &[LensChoice], seen: &[Seen], camera: &Camera, shape: Option<Shape>) -> Vec<Tried> {
    let (mut tried, mut views, mut from): (Vec<Tried>, Vec<Seen>, Camera) =
        (Vec::new(), seen.to_vec(), camera.clone());
    for choice in family {
        let found = fitted(choice, views.clone(), &from, shape);
        let (evidence, is_usable) = judged(choice, found.as_ref());
        if let Some(fit) = found.as_ref().filter(|_| is_usable) {
            (views, from) = (fit.seen.clone(), fit.shared.camera.clone());
        }
        tried.push(Tried { evidence, fit: found.filter(|_| is_usable) });
        if !is_usable && tried.iter().any(|one| one.fit.is_some()) {
            break;
        }
    }
    tried
}

fn fitted(choice: &LensChoice, seen: Vec<Seen>, from: &Camera, shape: Option<Shape>) -> Option<Fit> {
    let camera = choice.camera(from).ok()?;
    let directions = choice.directions(&camera);
    fit(seen, Shared { camera, shape, directions })
}

/// Akaike's weights of a family's choices, of those that have a fit: docs/math/intrinsics.md eq. (9).
pub(super) fn weights(tried: &[Tried]) -> Vec<f64> {
    let lowest = tried.iter().filter_map(|one| one.evidence.aic).fold(f64::INFINITY, f64::min);
    let raw = |one: &Tried| one.evidence.aic.map_or(0.0, |aic| (-0.5 * (aic - lowest)).exp());
    let sum: f64 = tried.iter().map(raw).sum();
    let shares = tried.iter().map(|one| raw(one) / sum.max(f64::MIN_POSITIVE));
    shares.map(|share| if share < LEAST_WEIGHT { 0.0 } else { share }).collect()
}

fn judged(choice: &LensChoice, fit: Option<&Fit>) -> (Evidence, bool) {
    let mut evidence = Evidence { choice: *choice, rms_px: None, aic: None, undetermined: None };
    let Some(fit) = fit else { return (evidence, false) };
    evidence.rms_px = Some(rms_px(fit));
    evidence.undetermined = undetermined(fit);
    let is_usable = fit.converged && evidence.undetermined.is_none();
    if is_usable {
        evidence.aic = Some(aic(fit));
    }
    (evidence, is_usable)
}

/// The parameter that the views leave open, if any: docs/math/frames.md eq. (9).
pub(super) fn undetermined(fit: &Fit) -> Option<(&'static str, f64)> {
    let parameters = fit.shared.camera.parameters();
    let Some(reduced) = fit.reduced() else { return Some((parameters[0].0, f64::INFINITY)) };
    let degrees = fit.degrees_of_freedom().max(1) as f64;
    let information = reduced.information / (fit.chi2() / degrees).max(f64::MIN_POSITIVE);
    let mut scales: Vec<f64> = scales(fit);
    // What the target's shape is known to: a tenth of its size is undetermined too.
    if let Some(shape) = &fit.shared.shape {
        scales.extend([1.0, shape.half_m[0], shape.half_m[1]]);
    }
    let (at, relative) = weakest(&information, &scales)?;
    let name = fit.shared.directions.get(at).map_or("the target's shape", |d| parameters[d[0].0].0);
    (!(relative <= MAX_RELATIVE_SIGMA)).then_some((name, relative))
}

/// The scale of each direction, as docs/math/frames.md eq. (9).
fn scales(fit: &Fit) -> Vec<f64> {
    let parameters = fit.shared.camera.parameters();
    let mut reach = vec![0.0f64; parameters.len()];
    for view in &fit.seen {
        for c in &view.points {
            let x = view.cam_from_target * c.x_in_target;
            let columns = fit.shared.camera.intrinsics_jacobian(&x).unwrap_or_default();
            for (reach, column) in reach.iter_mut().zip(&columns) {
                *reach = reach.max(column.norm());
            }
        }
    }
    let focal = focal_length(&parameters);
    let scale = |i: usize| match Group::of(parameters[i].0) {
        Group::FocalLength => parameters[i].1,
        _ => focal / reach[i],
    };
    fit.shared.directions.iter().map(|d| scale(d[0].0)).collect()
}

/// Root mean square of the residuals that take part, px of one coordinate.
pub(super) fn rms_px(fit: &Fit) -> f64 {
    let (mut sum, mut n) = (0.0, 0usize);
    for view in &fit.seen {
        for (residual, weight) in fit.residuals(view).iter().zip(&view.weights) {
            if let (Some((e, _)), true) = (residual, 0.0 < *weight) {
                sum += e.norm_squared();
                n += 2;
            }
        }
    }
    (sum / n.max(1) as f64).sqrt()
}

/// Akaike's information criterion with the noise estimated, docs/math/intrinsics.md eq. (8).
fn aic(fit: &Fit) -> f64 {
    let n = fit.n_numbers() as f64;
    n * (fit.chi2() / n).max(f64::MIN_POSITIVE).ln() + 2.0 * fit.shared.n() as f64
}

/// The best of the families: index into them all. Evidence is counted from it.
pub(super) fn best(families: &mut [Vec<Tried>]) -> Option<(usize, usize)> {
    let lowest = |tried: &[Tried]| -> Option<(usize, f64)> {
        let known = tried.iter().enumerate().filter_map(|(i, one)| Some((i, one.evidence.aic?)));
        known.min_by(|a, b| a.1.total_cmp(&b.1))
    };
    let mut best: Option<(usize, usize, f64)> = None;
    for (family, tried) in families.iter().enumerate() {
        let Some((at, aic)) = lowest(tried) else { continue };
        if best.is_none_or(|(.., other)| aic < other - FAMILY_MARGIN) {
            best = Some((family, at, aic));
        }
    }
    let (family, at, aic) = best?;
    for one in families.iter_mut().flatten() {
        one.evidence.aic = one.evidence.aic.map(|other| other - aic);
    }
    Some((family, at))
}
