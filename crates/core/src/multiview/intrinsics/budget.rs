//! The error budget of the intrinsics: docs/math/budget.md section 5.
//!
//!   P covariance of the free directions θ and of the target's shape s for the stated noise  ·  T = P_θs P_ss⁻¹ P_sθ what the shape contributes
//!   K information of the prior of the lens  ·  n noise, as a factor on the stated variances

use super::adjust::Fit;
use super::projection::{Projection, difference_over, grid};
use super::scatter::Spread;
use super::select::{LEAST_WEIGHT, Local};
use super::{Alternative, Chosen};
use crate::budget::{Budget, ErrorSource};
use crate::camera::ImageSize;
use crate::{Camera, Pixel};
use nalgebra::{DMatrix, DVector};

/// Relative singular values below this are directions of a lens that move no pixel of the grid.
const LEAST_SINGULAR: f64 = 1e-6;
/// Larger odds are no different.
const MOST_LN_ODDS: f64 = 100.0;
/// Positions along each side of the image where two lenses are compared.
const GRID: [usize; 2] = [17, 13];

/// Returns the parts of the covariance of the named parameters, the choice among the lens models of one family included:
/// docs/math/intrinsics.md eq. (8).
pub(super) fn over_choices(
    fit: &Fit,
    spread: &Spread,
    chosen: &Chosen,
    names: &[&str],
) -> Option<Budget<DMatrix<f64>>> {
    let own_names: Vec<&str> = fit.shared.camera.parameters().iter().map(|(name, _)| *name).collect();
    let own = of_fit(fit, spread)?.transformed(&by_directions(fit));
    let mut budget = Budget::default();
    let own_weight = 1.0 - chosen.weight_of_others();
    for part in own.parts() {
        budget.add(part.source, &(by_names(&part.covariance, &own_names, names) * own_weight));
    }
    let reference = in_terms_of(names, &chosen.own);
    for (weight, other) in &chosen.others {
        for part in of_local(other, spread).parts() {
            budget.add(part.source, &(by_names(&part.covariance, &other.names, names) * *weight));
        }
        let off = DVector::from_iterator(
            names.len(),
            in_terms_of(names, other).iter().zip(&reference).map(|(a, b)| a - b),
        );
        budget.add(ErrorSource::LensModel, &(&off * off.transpose() * *weight));
    }
    Some(budget)
}

/// Returns the parts of the covariance of the free directions, without the choice of a model.
fn of_fit(fit: &Fit, spread: &Spread) -> Option<Budget<DMatrix<f64>>> {
    let inverse = fit.reduced()?.information.cholesky()?.inverse();
    let n = fit.shared.directions.len();
    let block = |matrix: &DMatrix<f64>| matrix.view((0, 0), (n, n)).into_owned();
    let n_shape = inverse.nrows() - n;
    let mut of_shape = DMatrix::zeros(n, n);
    if 0 < n_shape {
        let cross = inverse.view((0, n), (n, n_shape)).into_owned();
        let shape = inverse.view((n, n), (n_shape, n_shape)).into_owned().cholesky()?;
        of_shape = &cross * shape.solve(&cross.transpose());
    }
    let exact_shape = block(&inverse) - &of_shape;
    let known = block(&fit.equations.prior_information);
    let mut budget = of_noise(&exact_shape, &known, spread.noise);
    budget.add(ErrorSource::Target, &(of_shape * spread.noise));
    let whole = block(&spread.covariance);
    let of_views = &whole / spread.blocks;
    if spread.contradiction != 1.0 {
        budget.add(ErrorSource::SharedInView, &(&of_views - block(&inverse) * spread.noise));
    }
    budget.add(ErrorSource::SharedInBlock, &(whole - of_views));
    Some(budget)
}

/// Returns the parts of another choice's covariance, whose views contradict each other as much.
fn of_local(local: &Local, spread: &Spread) -> Budget<DMatrix<f64>> {
    let mut budget = of_noise(&local.covariance, &local.known, spread.noise);
    let of_views = &local.covariance * (spread.noise * spread.contradiction);
    budget.add(ErrorSource::SharedInView, &(&of_views - &local.covariance * spread.noise));
    budget.add(ErrorSource::SharedInBlock, &(of_views * (spread.blocks - 1.0)));
    budget
}

/// Splits a covariance for the stated noise into what the prior contributes and what the pixels do, as stated and beyond.
fn of_noise(covariance: &DMatrix<f64>, known: &DMatrix<f64>, noise: f64) -> Budget<DMatrix<f64>> {
    let of_prior = covariance * known * covariance;
    let of_pixels = covariance - &of_prior;
    let mut budget = Budget::default();
    budget.add(ErrorSource::Pixels, &(&of_pixels * noise.min(1.0)));
    budget.add(ErrorSource::Residuals, &(of_pixels * (noise - 1.0).max(0.0)));
    budget.add(ErrorSource::Priors, &(of_prior * noise));
    budget
}

/// Returns what lens models of other families contribute that explain the corners about as well: docs/math/budget.md eqs. (14)–(15). Their
/// evidence counts for as many corners as views that contradict each other are worth.
pub(super) fn of_families(
    fit: &Fit,
    corners: &[Pixel],
    (size, alternatives): (ImageSize, &[Alternative]),
    spread: &Spread,
) -> DMatrix<f64> {
    let n = fit.shared.camera.parameters().len();
    let mut covariance = DMatrix::zeros(n, n);
    let odds = |one: &Alternative| (-0.5 * one.aic / spread.contradiction.max(1.0)).min(MOST_LN_ODDS).exp();
    let sum: f64 = 1.0 + alternatives.iter().map(odds).sum::<f64>();
    for one in alternatives {
        let weight = odds(one) / sum;
        let shift = (LEAST_WEIGHT < weight).then(|| as_shift(fit, &one.camera, corners, size)).flatten();
        if let Some(shift) = shift {
            covariance += &shift * shift.transpose() * weight;
        }
    }
    covariance
}

/// Returns the change of the estimated parameters that comes nearest to another camera over the image.
fn as_shift(fit: &Fit, other: &Camera, corners: &[Pixel], size: ImageSize) -> Option<DVector<f64>> {
    let camera = &fit.shared.camera;
    let [columns, rows] = GRID;
    let places: Vec<Pixel> = grid(size, columns, rows).collect();
    let off = difference_over(camera, other, corners, &places)?;
    let (directions, none) = (by_directions(fit), DMatrix::zeros(0, 0));
    let projection = Projection::new(camera, &none, corners.iter().copied());
    let known = places
        .iter()
        .zip(off)
        .filter_map(|(place, off)| Some((projection.by_parameters(place)? * &directions, off?)));
    let known: Vec<_> = known.collect();
    let n = directions.ncols();
    let mut by = DMatrix::from_fn(2 * known.len(), n, |i, j| known[i / 2].0[(i % 2, j)]);
    let off = DVector::from_fn(2 * known.len(), |i, _| known[i / 2].1[i % 2]);
    // Parameters differ in unit by many orders of magnitude.
    let unit =
        DVector::from_iterator(n, by.column_iter().map(|column| 1.0 / column.norm().max(f64::MIN_POSITIVE)));
    by.column_iter_mut().zip(unit.iter()).for_each(|(mut column, unit)| column *= *unit);
    if !by.iter().chain(off.iter()).all(|x| x.is_finite()) {
        return None;
    }
    let svd = by.svd(true, true);
    let shift = svd.solve(&off, LEAST_SINGULAR * svd.singular_values.max()).ok()?;
    let shift = directions * shift.component_mul(&unit);
    shift.iter().all(|x| x.is_finite()).then_some(shift)
}

/// Returns D, what the free directions change of the parameters.
fn by_directions(fit: &Fit) -> DMatrix<f64> {
    let n = fit.shared.camera.parameters().len();
    let mut map = DMatrix::zeros(n, fit.shared.directions.len());
    for (column, direction) in fit.shared.directions.iter().enumerate() {
        for (row, by) in direction {
            map[(*row, column)] = *by;
        }
    }
    map
}

/// Returns a covariance for other names; a missing one has no variance.
pub(super) fn by_names(covariance: &DMatrix<f64>, names: &[&str], wanted: &[&str]) -> DMatrix<f64> {
    let places: Vec<Option<usize>> =
        wanted.iter().map(|name| names.iter().position(|known| known == name)).collect();
    DMatrix::from_fn(wanted.len(), wanted.len(), |i, j| {
        places[i].zip(places[j]).map_or(0.0, |(i, j)| covariance[(i, j)])
    })
}

/// Returns the parameters of another choice of the family, by the names of this one; a missing coefficient is zero.
fn in_terms_of(names: &[&str], local: &Local) -> Vec<f64> {
    let value =
        |name: &&str| local.names.iter().position(|known| known == name).map_or(0.0, |i| local.values[i]);
    names.iter().map(value).collect()
}
