//! The single-camera pipeline: correspondences in, one pose with covariance and ambiguity out.
//!
//! classify → closed form → refine each candidate → choose → consistency. Each line of `locate` is one file.

pub mod choose;
pub mod prior;
pub(crate) mod factor;
pub mod loss;
pub mod group;
pub mod problem;
pub(crate) mod accumulate;
pub(crate) mod reweight;
pub(crate) mod sandwich;
pub mod refine;
pub(crate) mod curvature;
pub(crate) mod posterior;
pub mod consistency;
pub mod known_rotation;
pub mod lines;
pub(crate) mod method;
pub(crate) mod multi_start;
mod prior_start;
mod upright;
mod wang_covariance;
mod intrinsics;
mod shared_error;
pub(crate) mod uncertainty;
pub mod observability;

use crate::locate::choose::{Ambiguity, Choice, Hypothesis, Minima, Minimum, Others, choose};
use crate::locate::consistency::{Consistency, consistency, noise_scale};
use crate::locate::curvature::Bends;
use crate::locate::group::RigidGroup;
use crate::locate::loss::Loss;
pub use crate::locate::method::Method;
use crate::locate::method::resolve;
use crate::locate::multi_start::{search, weakness_of_rivals};
use crate::locate::posterior::{lead_with_the_most_probable, weights};
use crate::locate::prior::Prior;
use crate::locate::prior_start::{hold, may_hold, start_from_priors};
use crate::locate::problem::Problem;
use crate::locate::refine::OVERFLOW;
use crate::locate::sandwich::evidence;
use crate::locate::uncertainty::{Doubts, Whole, allow_for_intrinsics, check_known};
use crate::locate::upright::upright;
use crate::locate::wang_covariance::literal;
use crate::solve::configuration::{Configuration, Geometry, survey};
use crate::solve::line_plus_one::Weakness;
use crate::{Camera, Correspondence, Error, Matrix6, Pose};

/// What to do beyond the defaults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Config<'a> {
    /// The method; `Auto` decides from the points.
    pub method: Method,
    /// Covariance of the camera's intrinsic parameters, row by row, in the order of `Camera::parameters`; adds their share
    /// to the pose covariance.
    pub intrinsics_covariance: Option<&'a [f64]>,
    /// What is known about the pose besides the points: each joins the cost as a factor, and a start of the search.
    pub priors: &'a [Prior],
    /// What a point's residual costs; `Squared` is maximum likelihood for Gaussian noise.
    pub loss: Loss,
    /// Runs of points whose known positions share one unknown motion, such as the corners of a tag of a map; under the squared loss.
    pub groups: &'a [RigidGroup],
    /// Whether the covariance holds errors that all points of the view share, where the residuals show them: docs/math/shared_error.md.
    pub shared_errors: bool,
}

impl Default for Config<'_> {
    fn default() -> Self {
        Config {
            method: Method::default(),
            intrinsics_covariance: None,
            priors: &[],
            loss: Loss::default(),
            groups: &[],
            shared_errors: true,
        }
    }
}

/// A pose, how sure, and whether another one fits as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseEstimate {
    /// The pose: x_in_cam = cam_from_target · x_in_target. Where several fit, the most probable of them.
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// Root mean square reprojection error over points, px.
    pub rms_px: f64,
    /// Sum of squared residuals over their variances, those of priors and of uncertain intrinsics included; of what they cost under
    /// a robust loss.
    pub chi2: f64,
    /// Root mean square of the smooth displacement that all points share, along one axis of the image, px: a bent board, a lens not quite
    /// known. `covariance` holds it. 0 where none shows, and where fewer than twelve points could not show it.
    pub shared_error_px: f64,
    /// What uncertain points and intrinsics add to minus twice the log-likelihood: `Minimum::log_determinant`.
    pub log_determinant: f64,
    /// As in `Hypothesis`: above 0 where a pose that fits a little worse is the more probable one.
    pub delta_chi2: f64,
    /// 2 n − 6, and one more for each residual of a prior.
    pub degrees_of_freedom: usize,
    /// How many correspondences took part.
    pub n_points: usize,
    /// The method that answered (never `Auto`).
    pub method: Method,
    /// Does another pose fit as well?
    pub ambiguity: Ambiguity,
    /// Does the residual fit the sigmas?
    pub consistency: Consistency,
    /// Probability of this pose among all minima found, no pose expected beforehand: docs/math/posterior.md. With more points
    /// than unknowns it says which of them, not whether any is right: that is `consistency`.
    pub weight: f64,
    /// The other minima: those within the gate rival this one and come first, the more probable before the less; then lowest χ² first.
    pub others: Others,
    /// What makes the view weak: found by the closed form, before refinement, or by the two poses that fit alike.
    pub weakness: Option<Weakness>,
    /// What was measured on the points before anything was solved, and what it was compared with; none where priors stood in for
    /// points that determine no pose.
    pub geometry: Option<Geometry>,
}

/// The pose of a camera from known points.
///
/// No heap is touched. Fails with a named error where the points do not determine a pose; a pose that another one rivals is
/// `Ambiguous`, one whose residual contradicts the sigmas `Inconsistent`.
pub fn locate(seen: &[Correspondence], camera: &Camera, config: &Config) -> Result<PoseEstimate, Error> {
    let Config { priors, loss, groups, .. } = *config;
    let problem = &Problem { priors, loss, groups, ..Problem::new(seen, camera) };
    problem.check()?;
    let (geometry, method) = layout(problem, config.method)?;
    let configuration = geometry.map_or(Configuration::General, |g| g.configuration);
    let mut minima = Minima::new();
    let findings = match (method, &geometry) {
        (Method::Wang2004, _) => literal(&configuration, problem, &mut minima)?,
        (Method::Upright, _) => upright(problem, &mut minima)?,
        (Method::Priors, _) | (_, None) => hold(problem, &mut minima)?,
        (_, Some(geometry)) => {
            start_from_priors(problem, &mut minima);
            search(method, geometry, problem, &mut minima)
        }
    };
    let intrinsics = allowed_intrinsics(config, method)?;
    let bends = [intrinsics.is_none().then_some(findings.is_bent), None, None, None];
    let allowed = Allowed { intrinsics, shared_errors: config.shared_errors };
    conclude(problem, geometry, method, allowed, findings.weakness, bends, &mut minima)
}

/// What widens the covariance besides the pixels' sigmas.
#[derive(Clone, Copy, Default)]
pub(crate) struct Allowed<'a> {
    pub(crate) intrinsics: Option<&'a [f64]>,
    pub(crate) shared_errors: bool,
}

/// The answer that the minima found amount to.
pub(crate) fn conclude(
    problem: &Problem,
    geometry: Option<Geometry>,
    method: Method,
    Allowed { intrinsics, shared_errors }: Allowed,
    weakness: Option<Weakness>,
    mut bends: Bends,
    minima: &mut Minima,
) -> Result<PoseEstimate, Error> {
    allow_for_intrinsics(minima, problem, intrinsics)?;
    let configuration = geometry.map_or(Configuration::General, |g| g.configuration);
    let degrees_of_freedom = problem.degrees_of_freedom();
    let noise_scale = minima.first().map_or(1.0, |m| noise_of(m, problem));
    let lowest = *minima.first().ok_or(Error::NoSolution { n_points: problem.seen.len() })?;
    let mut weights = weights(minima, noise_scale);
    lead_with_the_most_probable(minima, &mut weights, &mut bends, noise_scale);
    let choice = choose(minima, problem.seen.len(), noise_scale)?;
    let doubts = Doubts { problem, intrinsics, noise_scale, lowest, shared_errors };
    let others = doubts.others(minima, &weights, &bends)?;
    let best = choice.best;
    let Whole { covariance, shared_error_px } = doubts.covariance(best, bends[0])?;
    let ambiguity = ambiguity(&choice, &others);
    let consistency = consistency(&lowest, problem); // Where the best fit contradicts the sigmas, every pose does.
    let is_finite = best.is_finite_with(&covariance) && ambiguity.is_finite() && consistency.is_finite();
    if !is_finite {
        return Err(OVERFLOW);
    }
    let is_ok = matches!(ambiguity, Ambiguity::Unique { .. }) && consistency == Consistency::Consistent;
    if is_ok && method != Method::Wang2004 {
        check_known(&best.cam_from_target, &covariance, problem)?;
    }
    // Made where it is returned: it is 2 kB.
    Ok(PoseEstimate {
        cam_from_target: best.cam_from_target,
        covariance,
        rms_px: best.rms_px,
        chi2: best.chi2,
        shared_error_px,
        log_determinant: best.log_determinant,
        delta_chi2: best.cost_above(&lowest, noise_scale),
        degrees_of_freedom,
        n_points: problem.seen.len(),
        method,
        ambiguity,
        weight: weights.first().copied().unwrap_or(1.0),
        others,
        consistency,
        weakness: weakness.or_else(|| weakness_of_rivals(&configuration, &choice, problem)),
        geometry,
    })
}

/// The printed procedure has no derivative to propagate them by.
fn allowed_intrinsics<'a>(config: &Config<'a>, method: Method) -> Result<Option<&'a [f64]>, Error> {
    match config.intrinsics_covariance {
        Some(_) if method == Method::Wang2004 => Err(LITERAL_INTRINSICS),
        given => Ok(given),
    }
}

/// The variance by which the residuals of a minimum exceed the stated sigmas.
fn noise_of(m: &Minimum, problem: &Problem) -> f64 {
    let (chi2, degrees_of_freedom) = evidence(m, problem);
    noise_scale(chi2, degrees_of_freedom)
}

fn ambiguity(choice: &Choice, others: &Others) -> Ambiguity {
    match (choice.rival, choice.ratio, &others[0]) {
        (Some(_), Some(ratio), Some(other)) => Ambiguity::Ambiguous { ratio, other: other.minimum },
        (_, ratio, _) => Ambiguity::Unique { ratio },
    }
}

/// What the points allow, and the method for it. Too few points, or points on a line, are left to the priors, if there are any.
fn layout(problem: &Problem, method: Method) -> Result<(Option<Geometry>, Method), Error> {
    match survey(problem.seen) {
        Ok(geometry) => Ok((Some(geometry), resolve(method, &geometry.configuration)?)),
        Err(Error::TooFewPoints { .. } | Error::Collinear { .. }) if method == Method::Upright => {
            Ok((None, Method::Upright))
        }
        Err(Error::TooFewPoints { .. } | Error::Collinear { .. })
            if method == Method::Auto && may_hold(problem) =>
        {
            Ok((None, Method::Priors))
        }
        Err(refused) => Err(refused),
    }
}

const LITERAL_INTRINSICS: Error = Error::WrongLayout {
    method: "wang2004",
    reason: "the printed procedure does not propagate uncertain intrinsics",
};

impl PoseEstimate {
    /// Every minimum found, at most four: this pose, then the others.
    pub fn minima(&self) -> impl Iterator<Item = Hypothesis> + '_ {
        let Self { cam_from_target, covariance, chi2, rms_px, log_determinant, .. } = *self;
        let minimum = Minimum { cam_from_target, covariance, chi2, rms_px, log_determinant };
        let Self { delta_chi2, weight, .. } = *self;
        let first = Hypothesis { minimum, delta_chi2, weight, is_rival: true };
        core::iter::once(first).chain(self.others.iter().flatten().copied())
    }

    /// How many minima lie within the gate, this pose included: 1 where it is unique.
    pub fn n_rivals(&self) -> usize {
        self.minima().filter(|h| h.is_rival).count()
    }
}
