//! Selects the number of coefficients that the data support: every choice of a family is fitted to the same corners, and the evidence (AIC)
//! selects the one expected to predict further views best. docs/math/intrinsics.md section 5.

use super::adjust::{Fit, Seen, Shared, fit};
use super::model::LensChoice;
use crate::multiview::intrinsics_check::{Group, MAX_RELATIVE_SIGMA, focal_length, weakest};
use nalgebra::{DMatrix, DVector};

/// A choice of another family must be better by this much (odds of 20 to 1): of two that fit about equally well the first is kept.
pub const FAMILY_MARGIN: f64 = 6.0;
/// A choice with less than this weight does not enter the covariance.
pub(super) const LEAST_WEIGHT: f64 = 1e-3;

/// The evidence for a choice.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// The choice.
    pub choice: LensChoice,
    /// Root mean square of the residuals, px of one coordinate; `None` without a fit.
    pub rms_px: Option<f64>,
    /// Akaike's information criterion, less that of the selected choice; `None` without a fit, or where it is undetermined.
    pub aic: Option<f64>,
    /// A parameter that the views do not determine, and its relative standard deviation.
    pub undetermined: Option<(&'static str, f64)>,
}

/// A choice with its evidence.
#[derive(Debug, Clone)]
pub(super) struct Tried {
    pub(super) evidence: Evidence,
    /// Its minimum, where it was computed.
    pub(super) fit: Option<Fit>,
    /// Its parameters; `None` where it has no answer.
    pub(super) local: Option<Local>,
}

/// Parameters of a choice and their covariance for the stated noise.
#[derive(Debug, Clone)]
pub(super) struct Local {
    pub(super) names: Vec<&'static str>,
    pub(super) values: Vec<f64>,
    pub(super) covariance: DMatrix<f64>,
    /// Their prior: inverse covariance and mean.
    pub(super) known: DMatrix<f64>,
    means: Vec<f64>,
}

impl Local {
    /// Takes the parameters of a minimum; `None` where a direction is undetermined.
    fn of(fit: &Fit) -> Option<Self> {
        let inverse = fit.reduced()?.information.cholesky()?.inverse();
        let n = fit.shared.directions.len();
        let parameters = fit.shared.camera.parameters();
        let (names, values) = fit.shared.directions.iter().map(|d| parameters[d[0].0]).unzip();
        let known = fit.equations.prior_information.view((0, 0), (n, n)).into_owned();
        let centre = fit.shared.camera.size.map(|size| super::model::central_matrix(size, 1.0));
        let mean = |name: &&str| match (*name, centre) {
            ("cx_px", Some(centre)) => centre.cx_px,
            ("cy_px", Some(centre)) => centre.cy_px,
            _ => 0.0,
        };
        let names: Vec<&'static str> = names;
        let means = names.iter().map(mean).collect();
        Some(Local { names, values, covariance: inverse.view((0, 0), (n, n)).into_owned(), known, means })
    }

    /// Returns the number of parameters that the views, rather than the prior, determine: docs/math/intrinsics.md eq. (14).
    fn n_effective(&self) -> f64 {
        self.names.len() as f64 - self.known.component_mul(&self.covariance).sum()
    }

    /// Returns χ² of the parameters' distance from the prior.
    fn prior_chi2(&self) -> f64 {
        let off = DVector::from_iterator(
            self.values.len(),
            self.values.iter().zip(&self.means).map(|(a, b)| a - b),
        );
        off.dot(&(&self.known * &off))
    }

    /// Returns the parameters with the coefficients that a smaller choice lacks fixed at zero, to second order, and the increase of the cost:
    /// docs/math/intrinsics.md eq. (12).
    fn without(&self, choice: &LensChoice) -> Option<(Self, f64)> {
        let (keep, drop): (Vec<usize>, Vec<usize>) =
            (0..self.names.len()).partition(|i| choice.is_free(self.names[*i]));
        let part = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| self.covariance[(rows[i], columns[j])])
        };
        let dropped = DVector::from_fn(drop.len(), |i, _| self.values[drop[i]]);
        let factor = part(&drop, &drop).cholesky()?;
        let (pull, gain) = (factor.solve(&dropped), part(&keep, &drop));
        let moved = &gain * &pull;
        let local = Local {
            names: keep.iter().map(|i| self.names[*i]).collect(),
            values: keep.iter().zip(moved.iter()).map(|(i, by)| self.values[*i] - by).collect(),
            covariance: part(&keep, &keep) - &gain * factor.solve(&gain.transpose()),
            known: DMatrix::from_fn(keep.len(), keep.len(), |i, j| self.known[(keep[i], keep[j])]),
            means: keep.iter().map(|i| self.means[*i]).collect(),
        };
        Some((local, dropped.dot(&pull)))
    }
}

/// Compares every choice of a family. Where a large choice has been fitted, the evidence of smaller ones follows from its fit, and only the best
/// of them is fitted; larger ones are fitted.
pub(super) fn compared(family: &[LensChoice], large: &LensChoice, fit: &Fit) -> Option<Vec<Tried>> {
    let own = Local::of(fit)?;
    let is_within = |choice: &LensChoice| choice.coefficients.iter().all(|c| large.coefficients.contains(c));
    let mut tried = Vec::with_capacity(family.len());
    for choice in family {
        if !is_within(choice) {
            // More coefficients are tried only where all of the large choice's are needed.
            let lowest =
                tried.iter().filter_map(|one: &Tried| one.evidence.aic).fold(f64::INFINITY, f64::min);
            if tried.iter().any(|one| one.evidence.choice == *large && one.evidence.aic == Some(lowest)) {
                let found = fitted(choice, fit.seen.clone(), &fit.shared);
                tried.push(with_fit(choice, found));
            }
            continue;
        }
        let n_dropped = large.coefficients.len() - choice.coefficients.len();
        let (local, grown) = if n_dropped == 0 { (own.clone(), 0.0) } else { own.without(choice)? };
        // χ² of the corners alone: the distance of the omitted coefficients from the prior was not a misfit of the corners.
        let chi2 = (fit.equations.chi2 + grown - local.prior_chi2()).max(fit.chi2());
        let times = (chi2 / fit.chi2().max(f64::MIN_POSITIVE)).sqrt();
        let aic = aic_of(fit.n_numbers(), chi2, local.n_effective());
        let rms_px = Some(rms_px(fit) * times);
        let evidence = Evidence { choice: *choice, rms_px, aic: Some(aic), undetermined: None };
        tried.push(Tried { evidence, fit: (n_dropped == 0).then(|| fit.clone()), local: Some(local) });
    }
    Some(tried)
}

/// Returns the minimum of a choice that was only compared, starting from that of a larger one.
pub(super) fn fit_of(one: &Tried, fit: &Fit) -> Option<Fit> {
    if let Some(known) = &one.fit {
        return Some(known.clone());
    }
    fitted(&one.evidence.choice, fit.seen.clone(), &fit.shared)
        .filter(|found| found.converged && undetermined(found).is_none())
}

fn with_fit(choice: &LensChoice, found: Option<Fit>) -> Tried {
    let (mut evidence, is_usable) = judged(choice, found.as_ref());
    let fit = found.filter(|_| is_usable);
    let local = fit.as_ref().and_then(Local::of);
    let known = fit.as_ref().zip(local.as_ref());
    evidence.aic = known.map(|(fit, local)| aic_of(fit.n_numbers(), fit.chi2(), local.n_effective()));
    Tried { evidence, fit, local }
}

/// Fits every choice of a family, each starting where the previous one ended, until one is undetermined.
pub(super) fn ladder(family: &[LensChoice], seen: &[Seen], shared: &Shared) -> Vec<Tried> {
    let (mut tried, mut views, mut from): (Vec<Tried>, Vec<Seen>, Shared) =
        (Vec::new(), seen.to_vec(), shared.clone());
    for choice in family {
        let one = with_fit(choice, fitted(choice, views.clone(), &from));
        if let Some(fit) = &one.fit {
            (views, from) = (fit.seen.clone(), fit.shared.clone());
        }
        let is_usable = one.fit.is_some();
        tried.push(one);
        if !is_usable && tried.iter().any(|one| one.fit.is_some()) {
            break;
        }
    }
    tried
}

fn fitted(choice: &LensChoice, seen: Vec<Seen>, from: &Shared) -> Option<Fit> {
    let camera = choice.camera(&from.camera).ok()?;
    let directions = choice.directions(&camera);
    fit(seen, Shared { camera, directions, ..from.clone() })
}

/// Returns Akaike's weights of those of a family's choices that have a fit: docs/math/intrinsics.md eq. (7).
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
    (evidence, is_usable)
}

/// Returns the parameter that the views do not determine, if any: docs/math/frames.md eq. (9).
pub(super) fn undetermined(fit: &Fit) -> Option<(&'static str, f64)> {
    let parameters = fit.shared.camera.parameters();
    let Some(reduced) = fit.reduced() else { return Some((parameters[0].0, f64::INFINITY)) };
    let degrees = fit.degrees_of_freedom().max(1) as f64;
    let information = reduced.information / (fit.chi2() / degrees).max(f64::MIN_POSITIVE);
    let mut scales: Vec<f64> = scales(fit);
    // A target's shape with an uncertainty above a tenth of its size is undetermined too.
    if let Some(shape) = &fit.shared.shape {
        scales.extend(&[1.0, shape.half_m[0], shape.half_m[1]][..shape.n()]);
    }
    let (at, relative) = weakest(&information, &scales)?;
    let name = fit.shared.directions.get(at).map_or("the target's shape", |d| parameters[d[0].0].0);
    (!(relative <= MAX_RELATIVE_SIGMA)).then_some((name, relative))
}

/// Returns the scale of each direction, as in docs/math/frames.md eq. (9).
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

/// Returns the root mean square of the residuals that take part, px of one coordinate.
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

/// Returns Akaike's information criterion for estimated noise, docs/math/intrinsics.md eq. (6).
fn aic_of(n_numbers: usize, chi2: f64, n_parameters: f64) -> f64 {
    let n = n_numbers.max(1) as f64;
    n * (chi2 / n).max(f64::MIN_POSITIVE).ln() + 2.0 * n_parameters
}

/// Residuals of less than a thousandth of the stated noise are those of rounding, and no evidence.
const LEAST_VARIANCE: f64 = 1e-6;

/// Returns Akaike's criterion of a fit with all of its parameters counted.
pub(super) fn criterion(fit: &Fit) -> f64 {
    let chi2 = fit.chi2().max(LEAST_VARIANCE * fit.n_numbers() as f64);
    aic_of(fit.n_numbers(), chi2, fit.shared.directions.len() as f64)
}

/// Returns the index of the best of all families, from which the evidence is counted.
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
