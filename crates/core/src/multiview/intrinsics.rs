//! Estimates the intrinsics of a camera from many views of known points, without a start: focal length, principal point, and as many lens
//! coefficients as the views support, with their covariance. Bad corners and views are named, and parameters that the views do not determine.
//!
//! ```text
//! start      a focal length and poses, from homographies and a grid of focal lengths
//! robust     gross errors weighed down, then rejected
//! select     every lens model that is asked for, coefficient by coefficient; the evidence picks one
//! scatter    the covariance: noise as the residuals show it, contradictions between views
//! findings   faults and weaknesses: too few tilts, two cameras, a stretched print
//! ```
//! Derivation: docs/math/intrinsics.md.

mod model;
mod prior;
mod adjust;
mod start;
mod robust;
mod select;
mod blocks;
mod scatter;
mod projection;
mod budget;
mod geometry;
mod groups;
mod findings;
mod next_view;
mod held_out;
mod judge;
mod faults;

pub use findings::{Finding, Severity};
pub use geometry::{COVERAGE_GRID, Copies, Coverage, Tilts};
pub use groups::{LEAST_TIMES, TwoGroups};
pub use held_out::HeldOut;
pub use judge::GOOD_COVERAGE;
pub use model::{CHOICES, LensChoice, Models, model_names};
pub use next_view::{Forecast, NextView, Placement};
pub(in crate::multiview) use prior::rows as prior_rows;
pub use projection::{
    Projection, ProjectionDifference, ProjectionSigma, ProjectionUncertainty, grid, projection_difference,
};
pub use robust::{BAD_VIEW_TIMES, BadView, GROSS_SIGMAS, LEAST_POINTS};
pub use scatter::Noise;
pub use select::{Evidence, FAMILY_MARGIN};

use crate::budget::{Budget, BudgetPart, ErrorSource};
use crate::camera::{BrownConrady, ImageSize, Pinhole};
use crate::multiview::flat_target::Shape;
use crate::multiview::intrinsics_check::SkippedFrame;
use crate::{Camera, Correspondence, Error, Matrix6, Pixel, Pose};
use adjust::{Fit, Seen, Shared};
use nalgebra::{DMatrix, Vector2};
use robust::{Clean, clean};
use select::{Local, Tried, best, ladder, rms_px, undetermined};

/// The request for intrinsics.
#[derive(Debug, Clone, Copy, Default)]
pub struct IntrinsicsConfig {
    /// Lens models.
    pub models: Models,
    /// The source of the noise.
    pub noise: Noise,
    /// Whether the stretch and the bend of a flat target are estimated with the camera.
    pub target_shape: TargetShape,
    /// Whether views show different targets, whose shapes are then neither estimated nor tested.
    pub several_targets: bool,
    /// Relative standard deviations of a printed target's lengths along x and y, from its rulers; zeros where they were not measured. The
    /// stretch of the print is then estimated within them.
    pub scale_sigma: [f64; 2],
}

/// Whether the stretch and the bend of a flat target are estimated with the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TargetShape {
    /// Estimated where they are certain; a finding reports it.
    #[default]
    ByEvidence,
    /// Always.
    Free,
    /// Never estimated; where they are certain the answer is inconsistent.
    Exact,
}

/// Least number of different views.
pub const LEAST_VIEWS: usize = 3;
/// Largest number of points in all views; more are refused.
pub const MOST_POINTS: usize = 2_000_000;

/// The result of the estimation.
#[derive(Debug, Clone)]
pub enum IntrinsicsOutcome {
    /// A camera.
    Solved(Box<SolvedIntrinsics>),
    /// The views determine no camera.
    Refused(Refusal),
}

/// Why there is no camera.
#[derive(Debug, Clone)]
pub struct Refusal {
    /// The findings; the first is the reason.
    pub findings: Vec<Finding>,
    /// Views that could not be used.
    pub skipped: Vec<SkippedFrame>,
}

/// A corner that took no part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BadCorner {
    /// Its view.
    pub view: usize,
    /// Its index in the view.
    pub point: usize,
    /// Observed − predicted, px; `None` where the camera cannot see the point.
    pub residual_px: Option<Vector2<f64>>,
}

/// A view that took part.
#[derive(Debug, Clone, PartialEq)]
pub struct IntrinsicsView {
    /// Its index in the input.
    pub view: usize,
    /// Its pose.
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion, including the uncertainty of the intrinsics.
    pub covariance: Matrix6,
    /// Root mean square of its residuals, px of one coordinate.
    pub rms_px: f64,
    /// Corners that took part: pixel and residual (observed − predicted), px.
    pub residuals: Vec<(Pixel, Vector2<f64>)>,
}

/// A camera with its covariance and the findings.
#[derive(Debug, Clone)]
pub struct SolvedIntrinsics {
    /// The camera.
    pub camera: Camera,
    /// The lens model, and the coefficients that were estimated.
    pub choice: LensChoice,
    /// Covariance of the parameters, in the order of `Camera::parameters`; zero for coefficients that are not estimated.
    pub covariance: DMatrix<f64>,
    /// The parts of `covariance` by their sources, which add up to it.
    pub budget: Budget<DMatrix<f64>>,
    /// Views that take part.
    pub views: Vec<IntrinsicsView>,
    /// Bad corners of those views.
    pub bad_corners: Vec<BadCorner>,
    /// Bad views, and why.
    pub bad_views: Vec<(usize, BadView)>,
    /// Views that could not be used.
    pub skipped: Vec<SkippedFrame>,
    /// Root mean square of all residuals, px of one coordinate.
    pub rms_px: f64,
    /// Two for each corner, less six for each view, less the number of shared unknowns.
    pub degrees_of_freedom: usize,
    /// χ² with the stated sigmas.
    pub chi2: f64,
    /// Factor on the stated variances.
    pub noise_scale: f64,
    /// Further factor on the variances, because views contradict each other.
    pub contradiction: f64,
    /// Every choice that was tried.
    pub tried: Vec<Evidence>,
    /// Stretch (ratio) and bends along x and y (metres) of the target with their standard deviations, where they were estimated; and its half
    /// width and height, metres.
    pub target_shape: Option<([[f64; 2]; 3], [f64; 2])>,
    /// The tilts of the target; `None` for targets that are not flat.
    pub tilts: Option<Tilts>,
    /// The distribution of the corners over the image.
    pub coverage: Coverage,
    /// The uncertainty of the projection over the image.
    pub projection: ProjectionUncertainty,
    /// The prediction of views that took no part.
    pub held_out: Option<HeldOut>,
    /// The view to take next.
    pub next_view: Option<NextView>,
    /// What a further view would add; `None` where the covariance has no inverse.
    pub forecast: Option<Forecast>,
    /// Faults and weaknesses, the worst first.
    pub findings: Vec<Finding>,
}

impl SolvedIntrinsics {
    /// Returns standard deviations, in the order of `Camera::parameters`.
    pub fn sigmas(&self) -> Vec<f64> {
        self.covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect()
    }

    /// Returns the sources of the errors with their fractions of the variance of the projection, the mean over the image.
    pub fn projection_shares(&self) -> Vec<(ErrorSource, f64)> {
        let Some(size) = self.camera.size else { return Vec::new() };
        let corners = self.views.iter().flat_map(|view| view.residuals.iter().map(|(pixel, _)| *pixel));
        let projection = Projection::new(&self.camera, &self.covariance, corners);
        let by: Vec<_> = grid(size, 17, 13).filter_map(|pixel| projection.by_parameters(&pixel)).collect();
        let variance = |c: &DMatrix<f64>| by.iter().map(|d| (d * c * d.transpose()).trace()).sum::<f64>();
        let share = |part: &BudgetPart<DMatrix<f64>>| (part.source, self.budget.share_of(part, variance));
        self.budget.parts().iter().map(share).collect()
    }

    /// Names of the estimated parameters.
    pub fn estimated(&self) -> Vec<&'static str> {
        let names = self.camera.parameters();
        names.iter().map(|(name, _)| *name).filter(|name| self.choice.is_free(name)).collect()
    }

    /// Returns the severity of the most severe finding.
    pub fn severity(&self) -> Severity {
        self.findings.iter().map(Finding::severity).max().unwrap_or(Severity::Remark)
    }
}

/// Calibrates a camera from views, each the correspondences of one target in one image; bearings are not used.
///
/// # Errors
/// Numbers that are not finite or sigmas that are not positive; more points than can be held.
pub fn solve_intrinsics<V: AsRef<[Correspondence]>>(
    views: &[V],
    size: ImageSize,
    config: &IntrinsicsConfig,
) -> Result<IntrinsicsOutcome, Error> {
    check(views, size)?;
    if let Some(seen) = config.scale_sigma.into_iter().find(|sigma| !(0.0..1.0).contains(sigma)) {
        let needed = "a relative standard deviation is at least 0 and less than 1";
        return Err(Error::InvalidSetting { setting: "scale_sigma", seen, needed });
    }
    let outcome = solve_as_stated(views, size, config)?;
    Ok(faults::examined(views, size, config, outcome, solve_as_stated))
}

fn solve_as_stated<V: AsRef<[Correspondence]>>(
    views: &[V],
    size: ImageSize,
    config: &IntrinsicsConfig,
) -> Result<IntrinsicsOutcome, Error> {
    let free = TargetShape::Free;
    let first = attempt(views, size, config)?;
    let IntrinsicsOutcome::Solved(mut solved) = first else { return Ok(first) };
    if config.target_shape != TargetShape::ByEvidence {
        return Ok(IntrinsicsOutcome::Solved(solved));
    }
    let is_deformed = |f: &Finding| matches!(f, Finding::Stretched { .. } | Finding::Bent { .. });
    if solved.findings.iter().any(is_deformed) {
        // The target's shape is then estimated together with the camera.
        match attempt(views, size, &IntrinsicsConfig { target_shape: free, ..*config })? {
            IntrinsicsOutcome::Solved(better) => solved = better,
            IntrinsicsOutcome::Refused(_) => return Ok(IntrinsicsOutcome::Solved(solved)),
        }
    }
    let found = judge::deformations(&solved, config.stretch_sigma());
    solved.findings.extend(found);
    Ok(IntrinsicsOutcome::Solved(solved))
}

impl IntrinsicsConfig {
    /// Returns the standard deviation of height over width from the rulers; `None` where they were not measured.
    fn stretch_sigma(&self) -> Option<f64> {
        Some(self.scale_sigma[0].hypot(self.scale_sigma[1])).filter(|sigma| 0.0 < *sigma)
    }
}

fn attempt<V: AsRef<[Correspondence]>>(
    views: &[V],
    size: ImageSize,
    config: &IntrinsicsConfig,
) -> Result<IntrinsicsOutcome, Error> {
    let Prepared { views: usable, skipped, copies } = prepared(views);
    let refused = |findings| Ok(IntrinsicsOutcome::Refused(Refusal { findings, skipped: skipped.clone() }));
    if copies.n_distinct < LEAST_VIEWS {
        let n_views = usable.len() + copies.copies.len();
        return refused(vec![Finding::FewViews {
            n_views,
            n_distinct: copies.n_distinct,
            needed: LEAST_VIEWS,
        }]);
    }
    let shape =
        Shape::of(usable.iter().flat_map(|(_, points)| points.iter())).filter(|_| !config.several_targets);
    let stretch_sigma = config.stretch_sigma();
    let shape = shape.map(|shape| Shape { stretch_sigma, ..shape });
    let free_shape = match config.target_shape {
        TargetShape::Free => shape,
        TargetShape::ByEvidence if stretch_sigma.is_some() => {
            shape.map(|shape| Shape { is_bent: false, ..shape })
        }
        TargetShape::ByEvidence | TargetShape::Exact => None,
    };
    let families = cleaned_families(&usable, size, config.models, free_shape);
    let Some(mut chosen) = choose(&families) else {
        return refused(judge::why_undetermined(&usable, families.first().map(|first| &first.clean.fit)));
    };
    chosen.families.extend(not_asked_for(&chosen, config.models));
    let start: Vec<Seen> = everything(&usable, &chosen.fit);
    let Some(clean) = robust::cleaned_from(start, chosen.fit.shared.clone()) else {
        return refused(judge::why_undetermined(&usable, Some(&chosen.fit)));
    };
    if undetermined(&clean.fit).is_some() || clean.fit.seen.len() < LEAST_VIEWS {
        return refused(judge::why_undetermined(&usable, Some(&clean.fit)));
    }
    let context = judge::Context { size, config, chosen: &chosen, shape, copies: &copies, skipped: &skipped };
    match judge::answer(&clean, &context) {
        Some(solved) => Ok(IntrinsicsOutcome::Solved(Box::new(solved))),
        None => refused(judge::why_undetermined(&usable, Some(&clean.fit))),
    }
}

fn check<V: AsRef<[Correspondence]>>(views: &[V], size: ImageSize) -> Result<(), Error> {
    if size.width_px < 1 || size.height_px < 1 {
        let needed = "an image has at least one row and one column";
        let seen = f64::from(size.width_px.min(size.height_px));
        return Err(Error::InvalidSetting { setting: "image size", seen, needed });
    }
    let n: usize = views.iter().map(|view| view.as_ref().len()).sum();
    if MOST_POINTS < n {
        let needed = "two million corners at most; leave out views";
        return Err(Error::InvalidSetting { setting: "number of corners", seen: n as f64, needed });
    }
    for (index, c) in views.iter().flat_map(|view| view.as_ref()).enumerate() {
        let numbers = [c.x_in_target.x, c.x_in_target.y, c.x_in_target.z, c.pixel.x, c.pixel.y, c.sigma_m];
        if !numbers.iter().all(|x| x.abs() < 1e60) {
            return Err(Error::NotFinite { what: "position or pixel", index });
        }
        if !(0.0 < c.sigma_px && c.sigma_px < 1e60 && 0.0 <= c.sigma_m) {
            return Err(Error::NotPositive { index, seen: c.sigma_px });
        }
    }
    Ok(())
}

/// The views that can be used, and the reasons why others cannot.
struct Prepared<'a> {
    views: Vec<(usize, &'a [Correspondence])>,
    skipped: Vec<SkippedFrame>,
    copies: Copies,
}

fn prepared<V: AsRef<[Correspondence]>>(views: &[V]) -> Prepared<'_> {
    let (mut usable, mut skipped) = (Vec::new(), Vec::new());
    for (frame, view) in views.iter().enumerate() {
        let points = view.as_ref();
        match points.len() < LEAST_POINTS {
            true => {
                let reason = Error::TooFewPoints { seen: points.len(), needed: LEAST_POINTS };
                skipped.push(SkippedFrame { frame, reason });
            }
            false => usable.push((frame, points)),
        }
    }
    let copies = geometry::copies(&usable);
    usable.retain(|(view, _)| copies.copies.iter().all(|(copy, _)| copy != view));
    Prepared { views: usable, skipped, copies }
}

/// A family of models with its fit without gross errors.
struct Cleaned {
    family: Vec<LensChoice>,
    clean: Clean,
    /// The choice that was fitted, where the views determine it.
    choice: Option<LensChoice>,
}

/// Fits every family without gross errors. Families after the first start at the first one's answer if it keeps nearly all corners and the
/// family fits them no better: a search without a start costs more than everything else.
fn cleaned_families(
    views: &[(usize, &[Correspondence])],
    size: ImageSize,
    models: Models,
    shape: Option<Shape>,
) -> Vec<Cleaned> {
    let n_numbers = 2 * views.iter().map(|(_, points)| points.len()).sum::<usize>();
    let mut families: Vec<Cleaned> = Vec::new();
    for family in models.families() {
        let first = families.first().map(|first| &first.clean).filter(|clean| {
            NEARLY_ALL * n_numbers <= 100 * clean.fit.n_numbers() && undetermined(&clean.fit).is_none()
        });
        let near = first.and_then(|first| {
            let choice = *family.last()?;
            let found = from_another(&first.fit, &choice, shape)?;
            let is_near = first.fit.chi2() * MUCH_LOWER < found.chi2();
            let choice = undetermined(&found).is_none().then_some(choice);
            is_near.then(|| (Clean { fit: found, bad: first.bad.clone() }, choice))
        });
        let found = near.or_else(|| cleaned(views, size, &family, shape));
        families.extend(found.map(|(clean, choice)| Cleaned { family, clean, choice }));
    }
    families
}

/// Per cent of the corners.
const NEARLY_ALL: usize = 97;
/// A family with less than this share of χ² fits other corners too, and is searched without a start.
const MUCH_LOWER: f64 = 0.8;

/// Fits a choice to the corners of another's fit, starting with its focal length and poses.
fn from_another(other: &Fit, choice: &LensChoice, shape: Option<Shape>) -> Option<Fit> {
    let camera = choice.camera(&other.shared.camera).ok()?;
    let directions = choice.directions(&camera);
    adjust::fit(other.seen.clone(), Shared { camera, shape, directions, noise: other.shared.noise })
        .filter(|found| found.converged)
}

/// Fits a family without gross errors: with most of its coefficients where the views determine them, else with fewer.
fn cleaned(
    views: &[(usize, &[Correspondence])],
    size: ImageSize,
    family: &[LensChoice],
    shape: Option<Shape>,
) -> Option<(Clean, Option<LensChoice>)> {
    let points: Vec<&[Correspondence]> = views.iter().map(|(_, points)| *points).collect();
    let smallest = family.iter().find(|choice| !choice.coefficients.is_empty()).or(family.first())?;
    let camera = start::start(&points, size, smallest)?;
    let located = |(view, points): &(usize, &[Correspondence])| {
        Seen::located(*view, points, vec![1.0; points.len()], &camera).ok()
    };
    let seen: Vec<Seen> = views.iter().filter_map(located).collect();
    let most = family.iter().rev().find(|choice| choice.coefficients.len() <= MOST_AT_FIRST);
    let mut last = None;
    for choice in [most, Some(smallest), family.first()].into_iter().flatten() {
        let Ok(camera) = choice.camera(&camera) else { continue };
        let directions = choice.directions(&camera);
        let Some(found) = clean(seen.clone(), Shared { camera, shape, directions, noise: LEAST_NOISE })
        else {
            continue;
        };
        if found.fit.converged && undetermined(&found.fit).is_none() {
            return Some((found, Some(*choice)));
        }
        last = Some((found, None));
    }
    last
}

/// Variance of the noise, in units of the stated one, before it is estimated: the prior of every lens then has hardly any effect.
const LEAST_NOISE: f64 = 0.01;
/// Largest number of coefficients during the search for gross errors: more are rarely determined then.
const MOST_AT_FIRST: usize = 5;

/// The choice selected by the evidence.
struct Chosen {
    choice: LensChoice,
    fit: Fit,
    /// Every choice that was tried.
    tried: Vec<Evidence>,
    /// Other choices of its family that are possibly right: their weights and parameters. All weights add up to one.
    others: Vec<(f64, Local)>,
    /// Its own parameters, computed in the same way as those of the others.
    own: Local,
    /// The best choices of the other families.
    families: Vec<Alternative>,
}

/// The camera of another family, and its criterion of Akaike less that of the choice.
struct Alternative {
    aic: f64,
    /// Root mean square of its residuals, px of one coordinate.
    rms_px: f64,
    camera: Camera,
}

impl Chosen {
    /// Returns the probability of the other choices of the family together.
    fn weight_of_others(&self) -> f64 {
        self.others.iter().map(|(weight, _)| weight).sum::<f64>().min(1.0)
    }

    /// Returns the smallest choice of the family that has the coefficients of all that are possibly right.
    fn widest(&self) -> LensChoice {
        let all = || std::iter::once(&self.own).chain(self.others.iter().map(|(_, other)| other));
        let has_all =
            |choice: &LensChoice| all().all(|local| local.names.iter().all(|name| choice.is_free(name)));
        let model = if self.choice.model == Pinhole::NAME { BrownConrady::NAME } else { self.choice.model };
        let wider = || CHOICES.into_iter().find(|choice| choice.model == model && has_all(choice));
        if has_all(&self.choice) { self.choice } else { wider().unwrap_or(self.choice) }
    }
}

/// Returns the best choice of all families on the corners that the best family keeps.
fn choose(families: &[Cleaned]) -> Option<Chosen> {
    let kept = |clean: &Clean| clean.fit.n_numbers();
    let cleans = || families.iter().map(|one| &one.clean);
    let widest = cleans().map(kept).max()?;
    let quality = |clean: &&Clean| rms_px(&clean.fit);
    // Families that keep about equally many corners are compared by their residuals.
    let among = cleans().filter(|clean| 95 * widest <= 100 * kept(clean));
    let common = among.min_by(|a, b| quality(a).total_cmp(&quality(b)))?;
    let mut tried: Vec<Vec<Tried>> = Vec::new();
    for Cleaned { family, clean, choice } in families {
        // For this family's own corners nothing has to be fitted again.
        let is_own = std::ptr::eq(clean, common) || same_corners(&clean.fit, &common.fit);
        let known = choice.as_ref().filter(|_| is_own);
        let quick = known.and_then(|choice| select::compared(family, choice, &clean.fit));
        tried.push(quick.unwrap_or_else(|| {
            let poses = |view: &Seen| {
                let own = clean.fit.seen.iter().find(|other| other.view == view.view);
                Seen {
                    cam_from_target: own.map_or(view.cam_from_target, |own| own.cam_from_target),
                    ..view.clone()
                }
            };
            let seen: Vec<Seen> = common.fit.seen.iter().map(poses).collect();
            ladder(family, &seen, &clean.fit.shared)
        }));
    }
    let (family, at) = best(&mut tried)?;
    let weights = select::weights(&tried[family]);
    let taken = &tried[family][at];
    let choice = taken.evidence.choice;
    let fit = select::fit_of(taken, &families[family].clean.fit)?;
    let own = taken.local.clone()?;
    let others = weights.into_iter().zip(&tried[family]).enumerate();
    let others = others.filter(|(i, (weight, _))| *i != at && 0.0 < *weight);
    let others = others.filter_map(|(_, (weight, one))| Some((weight, one.local.clone()?))).collect();
    let alternative = |tried: &Vec<Tried>| {
        let known = tried.iter().filter_map(|one| Some((one.evidence.aic?, one.fit.as_ref()?)));
        let (aic, fit) = known.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Alternative { aic, rms_px: rms_px(fit), camera: fit.shared.camera.clone() })
    };
    let others_than = tried.iter().enumerate().filter(|(i, _)| *i != family);
    let families = others_than.filter_map(|(_, tried)| alternative(tried)).collect();
    Some(Chosen {
        families,
        choice,
        fit,
        tried: tried.into_iter().flatten().map(|one| one.evidence).collect(),
        others,
        own,
    })
}

/// Returns the models that are tried by evidence where others were asked for, on the same corners.
fn not_asked_for(chosen: &Chosen, models: Models) -> Vec<Alternative> {
    let own = select::criterion(&chosen.fit);
    let of = |choice: LensChoice| {
        let found = from_another(&chosen.fit, &choice, chosen.fit.shared.shape)?;
        undetermined(&found).is_none().then(|| Alternative {
            aic: select::criterion(&found) - own,
            rms_px: rms_px(&found),
            camera: found.shared.camera.clone(),
        })
    };
    models.not_asked_for().into_iter().filter_map(of).collect()
}

/// Returns whether two fits use the same corners of the same views.
fn same_corners(a: &Fit, b: &Fit) -> bool {
    let used = |fit: &Fit| -> Vec<(usize, Vec<bool>)> {
        fit.seen.iter().map(|view| (view.view, view.weights.iter().map(|w| 0.0 < *w).collect())).collect()
    };
    used(a) == used(b)
}

/// Returns all views under a fit's camera, at its poses where it has them: rejected corners may be accepted again.
fn everything(views: &[(usize, &[Correspondence])], fit: &Fit) -> Vec<Seen> {
    let of_view = |(view, points): &(usize, &[Correspondence])| {
        if let Some(known) = fit.seen.iter().find(|seen| seen.view == *view) {
            return Some(known.clone());
        }
        Seen::located(*view, points, vec![1.0; points.len()], &fit.shared.camera).ok()
    };
    views.iter().filter_map(of_view).collect()
}
