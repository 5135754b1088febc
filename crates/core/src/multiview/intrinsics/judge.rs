//! Builds the answer from a fit, with its faults and weaknesses.

use super::adjust::{Fit, Seen, Shared, fit};
use super::budget::{by_names, of_families, over_choices};
use super::findings::Finding;
use super::geometry::{Copies, Coverage, Tilts, tilts};
use super::groups::{TwoGroups, two_groups};
use super::held_out::held_out;
use super::next_view::{Forecast, Known, next_view};
use super::projection::Projection;
use super::robust::{BadView, Clean};
use super::scatter::{Noise, Spread, spread};
use super::select::{rms_px, undetermined};
use super::{Alternative, BadCorner, Chosen, IntrinsicsConfig, IntrinsicsView, SolvedIntrinsics};
use crate::budget::{Budget, ErrorSource};
use crate::camera::ImageSize;
use crate::locate::consistency::{is_inconsistent, loses_too_many};
use crate::multiview::flat_target::Shape;
use crate::multiview::intrinsics_check::{MAX_RELATIVE_SIGMA, SkippedFrame};
use crate::{Correspondence, Matrix6, Pixel, Point};
use nalgebra::DMatrix;

/// With smaller tilts and differences of orientation, only noise separates focal length and distance.
const LEAST_TILT_RAD: f64 = 0.26;
const LEAST_SPREAD_RAD: f64 = 0.17;
/// A larger relative uncertainty of the focal length is reported.
const GOOD_FOCAL: f64 = 0.01;
/// A smaller share of the image's cells with corners is reported.
pub const GOOD_COVERAGE: f64 = 0.6;
/// A stretch is real beyond this many standard deviations, and if it exceeds that of paper in damp air.
const REAL_SIGMAS: f64 = 5.0;
const LEAST_STRETCH: f64 = 1.5e-3;
/// A stretch beyond this many standard deviations of the rulers contradicts them.
const RULER_SIGMAS: f64 = 3.0;
/// A larger bend, relative to the target's half width, is reported.
const LEAST_BEND: f64 = 2e-3;
/// A larger contradiction between views is reported: variances twice those of the noise.
const LEAST_CONTRADICTION: f64 = 2.0;

/// The data of the answer in addition to the fit.
pub(super) struct Context<'a> {
    pub(super) size: ImageSize,
    pub(super) config: &'a IntrinsicsConfig,
    pub(super) chosen: &'a Chosen,
    pub(super) shape: Option<Shape>,
    pub(super) copies: &'a Copies,
    pub(super) skipped: &'a [SkippedFrame],
}

/// Returns the answer; `None` where the covariance does not exist.
pub(super) fn answer(clean: &Clean, context: &Context) -> Option<SolvedIntrinsics> {
    let found = &clean.fit;
    let spread = spread(found, context.config.noise)?;
    let camera = found.shared.camera.clone();
    let names: Vec<&str> = camera.parameters().iter().map(|(name, _)| *name).collect();
    let corners = || found.seen.iter().flat_map(used_pixels);
    let mut budget = over_choices(found, &spread, context.chosen, &names)?;
    let alternatives = &context.chosen.families;
    let families = of_families(found, &corners().collect::<Vec<_>>(), (context.size, alternatives), &spread);
    budget.add(ErrorSource::LensModel, &families);
    let covariance = sum(&budget, names.len());
    let projection = Projection::new(&camera, &covariance, corners()).over_image(context.size, 17, 13);
    let views = views(found, &spread)?;
    let widening = spread.noise * spread.contradiction;
    let forecast = projection.rms_px().and_then(|px| forecast(found, &spread, context, (&families, px)));
    let coverage = Coverage::of(corners(), context.size);
    let tilts = tilts(&found.seen);
    let findings = findings(clean, &spread, &covariance, &coverage, context);
    Some(SolvedIntrinsics {
        choice: context.chosen.choice,
        views,
        bad_corners: bad_corners(found),
        bad_views: clean
            .bad
            .iter()
            .map(|(view, reason)| (view.view, *reason))
            .collect::<Vec<(usize, BadView)>>(),
        skipped: context.skipped.to_vec(),
        rms_px: rms_px(found),
        degrees_of_freedom: found.degrees_of_freedom(),
        chi2: found.chi2(),
        noise_scale: spread.noise,
        contradiction: spread.contradiction,
        tried: context.chosen.tried.clone(),
        target_shape: target_shape(found, &spread.covariance)
            .zip(found.shared.shape)
            .map(|(values, shape)| (values, shape.half_m)),
        tilts,
        coverage,
        projection,
        held_out: held_out(found, widening),
        next_view: forecast.as_ref().and_then(|forecast| next_view(found, context.size, forecast)),
        forecast,
        findings,
        covariance,
        budget,
        camera,
    })
}

/// Returns the whole of a budget over `n` parameters.
fn sum(budget: &Budget<DMatrix<f64>>, n: usize) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(n, n);
    budget.parts().iter().for_each(|part| sum += &part.covariance);
    sum
}

/// Returns the reason why views determine no camera: the first that applies, from the fit nearest to an answer.
pub(super) fn why_undetermined(views: &[(usize, &[Correspondence])], fit: Option<&Fit>) -> Vec<Finding> {
    let n_views = views.len();
    let Some(fit) = fit else { return vec![Finding::NoCamera { n_views, n_posed: 0 }] };
    let n_posed = fit.seen.len();
    if 2 * n_posed < n_views || n_posed < super::LEAST_VIEWS {
        return vec![Finding::NoCamera { n_views, n_posed }];
    }
    let open = undetermined(fit).unwrap_or((fit.shared.camera.parameters()[0].0, f64::INFINITY));
    let undetermined =
        Finding::Undetermined { parameter: open.0, relative: open.1, needed: MAX_RELATIVE_SIGMA };
    match tilts(&fit.seen) {
        Some(Tilts { largest_rad, .. }) if largest_rad < LEAST_TILT_RAD => {
            vec![Finding::NotTilted { largest_rad, needed_rad: LEAST_TILT_RAD }, undetermined]
        }
        Some(Tilts { spread_rad, .. }) if spread_rad < LEAST_SPREAD_RAD => {
            vec![Finding::OneOrientation { spread_rad, needed_rad: LEAST_SPREAD_RAD }, undetermined]
        }
        _ => vec![undetermined],
    }
}

fn used_pixels(view: &Seen) -> impl Iterator<Item = Pixel> + '_ {
    view.points.iter().zip(&view.weights).filter(|(_, weight)| 0.0 < **weight).map(|(c, _)| c.pixel)
}

/// Prepares the forecast of further views, in the parameters of every choice that is possibly right: a coefficient that the chosen lens lacks may
/// be what is uncertain, and lenses of other families. docs/math/intrinsics.md section 9.
fn forecast(
    fit: &Fit,
    spread: &Spread,
    context: &Context,
    (families, now_px): (&DMatrix<f64>, f64),
) -> Option<Forecast> {
    let widest = context.chosen.widest();
    let camera = widest.camera(&fit.shared.camera).ok()?;
    let directions = widest.directions(&camera);
    let names: Vec<&str> = directions.iter().map(|d| camera.parameters()[d[0].0].0).collect();
    let own_names: Vec<&str> = fit.shared.camera.parameters().iter().map(|(name, _)| *name).collect();
    let of_lens = sum(&over_choices(fit, spread, context.chosen, &names)?, names.len())
        + by_names(families, &own_names, &names);
    let (n_own, n) = (fit.shared.directions.len(), names.len());
    // The shape of the target does not depend on the choice.
    let n_shape = spread.covariance.nrows() - n_own;
    let mut covariance = DMatrix::zeros(n + n_shape, n + n_shape);
    covariance.view_mut((0, 0), (n, n)).copy_from(&of_lens);
    let shape = spread.covariance.view((n_own, n_own), (n_shape, n_shape));
    covariance.view_mut((n, n), (n_shape, n_shape)).copy_from(&shape);
    let shared = Shared { camera, directions, ..fit.shared.clone() };
    let noise = spread.noise * spread.contradiction;
    Some(Forecast::new(fit, context.size, Known { shared, covariance, noise, now_px }))
}

fn target_shape(fit: &Fit, covariance: &DMatrix<f64>) -> Option<[[f64; 2]; 3]> {
    let shape = fit.shared.shape?;
    let first = fit.shared.directions.len();
    let sigma =
        |i: usize| if i < shape.n() { covariance[(first + i, first + i)].max(0.0).sqrt() } else { 0.0 };
    Some([0, 1, 2].map(|i| [shape.values[i], sigma(i)]))
}

fn views(fit: &Fit, spread: &Spread) -> Option<Vec<IntrinsicsView>> {
    let poses = fit.pose_covariances(&(&spread.covariance / spread.noise))?;
    let of_view = |(view, pose): (&Seen, &Matrix6)| {
        let used = fit.residuals(view).into_iter().zip(view.points.iter().zip(&view.weights));
        let residuals: Vec<_> = used
            .filter(|(_, (_, weight))| 0.0 < **weight)
            .filter_map(|(residual, (c, _))| Some((c.pixel, residual?.0)))
            .collect();
        let sum: f64 = residuals.iter().map(|(_, e)| e.norm_squared()).sum();
        IntrinsicsView {
            view: view.view,
            cam_from_target: view.cam_from_target,
            covariance: about_camera(pose, &(view.cam_from_target * view.pivot)) * spread.noise,
            rms_px: (sum / (2 * residuals.len()).max(1) as f64).sqrt(),
            residuals,
        }
    };
    Some(fit.seen.iter().zip(&poses).map(of_view).collect())
}

/// Returns the covariance of the left motion from that about the pivot: ν_left = ν + c × ω, docs/math/refine.md eq. (7).
fn about_camera(about_pivot: &Matrix6, pivot_in_cam: &Point) -> Matrix6 {
    let mut to_camera = Matrix6::identity();
    to_camera.fixed_view_mut::<3, 3>(3, 0).copy_from(&pivot_in_cam.cross_matrix());
    crate::pose::symmetric(&(to_camera * about_pivot * to_camera.transpose()))
}

fn bad_corners(fit: &Fit) -> Vec<BadCorner> {
    let of_view = |view: &Seen| {
        let residuals = fit.residuals(view).into_iter().zip(view.weights.clone()).enumerate();
        let number = view.view;
        residuals.filter(|(_, (_, weight))| *weight == 0.0).map(move |(point, (residual, _))| BadCorner {
            view: number,
            point,
            residual_px: residual.map(|(e, _)| e),
        })
    };
    fit.seen.iter().flat_map(of_view).collect()
}

fn findings(
    clean: &Clean,
    spread: &Spread,
    covariance: &DMatrix<f64>,
    coverage: &Coverage,
    context: &Context,
) -> Vec<Finding> {
    let fit = &clean.fit;
    let mut found = Vec::new();
    found.extend(two_cameras(clean));
    found.extend(many_bad(clean).filter(|_| found.is_empty()));
    found.extend(shape_findings(fit, context.shape, context.config.noise));
    found.extend(noisy(fit, spread));
    found.extend(other_lens(fit, spread, context));
    let focal = fit.shared.camera.parameters()[0].1;
    let relative = covariance[(0, 0)].max(0.0).sqrt() / focal;
    if GOOD_FOCAL < relative {
        found.push(Finding::RoughFocal { relative, needed: GOOD_FOCAL });
        // The prior of the lens dominates such an answer, which may not be relied on.
        let one_orientation = tilts(&fit.seen).filter(|tilts| tilts.spread_rad < LEAST_SPREAD_RAD);
        found.extend(one_orientation.map(|tilts| Finding::OneOrientation {
            spread_rad: tilts.spread_rad,
            needed_rad: LEAST_SPREAD_RAD,
        }));
    }
    if !context.copies.copies.is_empty() {
        let n = context.copies.copies.len();
        found.push(Finding::Copies { n, n_distinct: context.copies.n_distinct });
    }
    if coverage.share() < GOOD_COVERAGE {
        found.push(Finding::SmallCoverage { share: coverage.share(), needed: GOOD_COVERAGE });
    }
    if LEAST_CONTRADICTION < spread.contradiction {
        found.push(Finding::ViewsContradict { times: spread.contradiction });
    }
    found.sort_by_key(|finding| std::cmp::Reverse(finding.severity()));
    found
}

fn many_bad(clean: &Clean) -> Option<Finding> {
    let (n, of) = (clean.bad.len(), clean.bad.len() + clean.fit.seen.len());
    let of_corners: usize = clean.fit.seen.iter().map(|view| view.points.len()).sum();
    let n_corners = of_corners - clean.fit.n_numbers() / 2;
    let too_many = loses_too_many(n, of) || loses_too_many(n_corners, of_corners);
    too_many.then_some(Finding::ManyBadViews { n, of, n_corners, of_corners })
}

/// Reports residuals far above the stated noise, by the rule of `consistency`.
fn noisy(fit: &Fit, spread: &Spread) -> Option<Finding> {
    let stated: f64 = fit.seen.iter().flat_map(|view| &view.points).map(|c| c.sigma_px * c.sigma_px).sum();
    let n: usize = fit.seen.iter().map(|view| view.points.len()).sum();
    let stated_px = (stated / n.max(1) as f64).sqrt();
    is_inconsistent(fit.chi2(), fit.degrees_of_freedom())
        .then(|| Finding::Noisy { seen_px: stated_px * spread.noise.sqrt(), stated_px })
}

/// Reports a model that was not asked for and that the corners prefer, beyond what contradicting views are worth, with a much smaller residual.
fn other_lens(fit: &Fit, spread: &Spread, context: &Context) -> Option<Finding> {
    let own_rms_px = rms_px(fit);
    let is_better = |one: &&Alternative| {
        one.aic / spread.contradiction.max(1.0) < -super::FAMILY_MARGIN
            && super::LEAST_TIMES * one.rms_px.powi(2) < own_rms_px.powi(2)
    };
    let best =
        context.chosen.families.iter().filter(is_better).min_by(|a, b| a.rms_px.total_cmp(&b.rms_px))?;
    Some(Finding::OtherLens { model: best.camera.model_name(), rms_px: best.rms_px, own_rms_px })
}

/// Reports views of two cameras: either both are in the fit, or one of them is among the bad views.
fn two_cameras(clean: &Clean) -> Option<Finding> {
    let groups = two_groups(&clean.fit).or_else(|| second_camera(clean))?;
    let focal = |views: &[usize]| {
        let all = clean.fit.seen.iter().chain(clean.bad.iter().map(|(view, _)| view));
        let seen: Vec<Seen> = all.filter(|view| views.contains(&view.view)).cloned().collect();
        let alone = fit(seen, clean.fit.shared.clone()).filter(|fit| undetermined(fit).is_none())?;
        let variance = alone.reduced()?.information.cholesky()?.inverse()[(0, 0)];
        let noise = alone.chi2() / alone.degrees_of_freedom().max(1) as f64;
        Some([alone.shared.camera.parameters()[0].1, (variance * noise).sqrt()])
    };
    let focal_px = [focal(&groups.first), focal(&groups.second)];
    // Where two answers hardly fit better, and their focal lengths agree, a zoom explains nothing: the views contradict each other otherwise.
    // Two views alone know a lens worse than they say.
    let is_small = groups.first.len().min(groups.second.len()) < 3;
    let is_same_lens = match focal_px {
        [Some([a, _]), Some([b, _])] => is_small || (a - b).abs() < NO_ZOOM * a.max(b),
        _ => false,
    };
    (super::LEAST_TIMES <= groups.times || !is_same_lens).then_some(Finding::TwoCameras { groups, focal_px })
}

/// Relative difference of focal lengths below which there was no zoom.
const NO_ZOOM: f64 = 0.001;

/// Finds bad views with a camera of their own, which explains them about as well as the good ones are explained.
fn second_camera(clean: &Clean) -> Option<TwoGroups> {
    if clean.bad.len() < super::LEAST_VIEWS {
        return None;
    }
    let bad: Vec<Seen> = clean.bad.iter().map(|(view, _)| view.clone()).collect();
    let shared: Shared = clean.fit.shared.clone();
    let second: Clean = super::robust::clean(bad, shared)?;
    let variance = |fit: &Fit| fit.chi2() / fit.degrees_of_freedom().max(1) as f64;
    let is_good = 2 * clean.bad.len() <= 3 * second.fit.seen.len()
        && super::LEAST_VIEWS <= second.fit.seen.len()
        && variance(&second.fit) < SAME_QUALITY * variance(&clean.fit);
    if !is_good {
        return None;
    }
    let first: Vec<usize> = clean.fit.seen.iter().map(|view| view.view).collect();
    let own: Vec<usize> = second.fit.seen.iter().map(|view| view.view).collect();
    let (last, next) = (first.iter().max()?, own.iter().min()?);
    let in_sequence = last < next || own.iter().max()? < first.iter().min()?;
    let times = common_variance(clean, &own) / variance(&clean.fit);
    (super::LEAST_TIMES < times).then_some(TwoGroups { first, second: own, in_sequence, times })
}

/// Largest ratio of a second camera's residual variance to the first's.
const SAME_QUALITY: f64 = 4.0;

/// Returns the residual variance of views under the first camera, with only their poses free.
fn common_variance(clean: &Clean, views: &[usize]) -> f64 {
    let seen: Vec<Seen> =
        clean.bad.iter().map(|(view, _)| view).filter(|view| views.contains(&view.view)).cloned().collect();
    let shared = Shared { directions: Vec::new(), shape: None, ..clean.fit.shared.clone() };
    fit(seen, shared).map_or(f64::INFINITY, |fit| fit.chi2() / fit.degrees_of_freedom().max(1) as f64)
}

/// Tests with one more adjustment, with a free target shape, whether the target is stretched or bent.
fn shape_findings(found: &Fit, shape: Option<Shape>, noise: Noise) -> Vec<Finding> {
    let is_free = found.shared.shape.is_some_and(|shape| shape.is_bent);
    let Some(shape) = shape.filter(|_| !is_free) else { return Vec::new() };
    let shared = Shared { shape: Some(shape), ..found.shared.clone() };
    let Some(free) = fit(found.seen.clone(), shared) else {
        return Vec::new();
    };
    let Some(values) = spread(&free, noise).and_then(|spread| target_shape(&free, &spread.covariance)) else {
        return Vec::new();
    };
    let mut found_out = deformed(values, shape.half_m, LEAST_STRETCH, false);
    // A stretch that is already estimated needs no further adjustment.
    found_out.retain(|finding| found.shared.shape.is_none() || matches!(finding, Finding::Bent { .. }));
    found_out
}

/// Reports estimated deformations of a target, unless its rulers explain them.
pub(super) fn deformations(solved: &SolvedIntrinsics, stretch_sigma: Option<f64>) -> Vec<Finding> {
    let least = LEAST_STRETCH.max(RULER_SIGMAS * stretch_sigma.unwrap_or(0.0));
    solved.target_shape.map_or_else(Vec::new, |(values, half_m)| deformed(values, half_m, least, true))
}

fn deformed(values: [[f64; 2]; 3], half_m: [f64; 2], least_stretch: f64, taken_in: bool) -> Vec<Finding> {
    let [[stretch, sigma], [x, sigma_x], [y, sigma_y]] = values;
    let mut findings = Vec::new();
    if least_stretch < stretch.abs() && REAL_SIGMAS * sigma < stretch.abs() {
        findings.push(Finding::Stretched { stretch, sigma, taken_in });
    }
    let is_bent =
        |bend: f64, sigma: f64, half: f64| LEAST_BEND * half < bend.abs() && REAL_SIGMAS * sigma < bend.abs();
    if is_bent(x, sigma_x, half_m[0]) || is_bent(y, sigma_y, half_m[1]) {
        findings.push(Finding::Bent { bend_m: [x, y], sigma_m: [sigma_x, sigma_y], taken_in });
    }
    findings
}
