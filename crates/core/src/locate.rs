//! The single-camera pipeline: correspondences in, one pose with covariance and ambiguity out.
//!
//! classify → closed form → refine each candidate → choose → consistency. Each line of `locate` is one file.

use crate::choose::{Ambiguity, Minima, Minimum, choose};
use crate::consistency::{Consistency, consistency, noise_scale};
use crate::curvature::{self, with_curvature};
use crate::held::{hold, may_hold, start_from_priors};
use crate::intrinsics::intrinsics_share;
use crate::literal::literal;
use crate::loss::Loss;
pub use crate::method::Method;
use crate::method::resolve;
use crate::prior::Prior;
use crate::problem::Problem;
use crate::sandwich::evidence;
use crate::search::{Findings, search, weakness_of_rivals};
use crate::solve::configuration::{Configuration, classify};
use crate::solve::line_plus_one::Weakness;
use crate::upright::upright;
use crate::{Camera, Correspondence, Error, Matrix6, Pose};

/// What to do beyond the defaults.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
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
}

/// A pose, how sure, and whether another one fits as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseEstimate {
    /// The pose: x_in_cam = cam_from_target · x_in_target.
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// Root mean square reprojection error over points, px.
    pub rms_px: f64,
    /// Sum of squared residuals over their variances, those of priors included; of what they cost under a robust loss.
    pub chi2: f64,
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
    /// What makes the view weak: found by the closed form, before refinement, or by the two poses that fit alike.
    pub weakness: Option<Weakness>,
}

/// The pose of a camera from known points.
///
/// No heap is touched. Fails with a named error where the points do not determine a pose; a pose that another one rivals is
/// `Ambiguous`, one whose residual contradicts the sigmas `Inconsistent`.
pub fn locate(seen: &[Correspondence], camera: &Camera, config: &Config) -> Result<PoseEstimate, Error> {
    let problem = &Problem { seen, camera, priors: config.priors, loss: config.loss };
    problem.check()?;
    let (configuration, method) = layout(problem, config.method)?;
    let mut minima = Minima::new();
    let Findings { weakness, is_bent } = match method {
        Method::Wang2004 => literal(&configuration, problem, &mut minima)?,
        Method::Priors => hold(problem, &mut minima)?,
        Method::Upright => upright(problem, &mut minima)?,
        _ => {
            start_from_priors(problem, &mut minima);
            search(method, &configuration, problem, &mut minima)
        }
    };
    let degrees_of_freedom = problem.degrees_of_freedom();
    let noise_scale = minima.first().map_or(1.0, |m| {
        let (chi2, degrees_of_freedom) = evidence(m, problem);
        noise_scale(chi2, degrees_of_freedom)
    });
    let choice = choose(&minima, seen.len(), noise_scale)?;
    let weakness = weakness.or_else(|| weakness_of_rivals(&configuration, &choice, problem));
    let whole = |m: &Minimum, is_bent: bool| {
        let covariance = if is_bent { with_curvature(m, problem) } else { m.covariance };
        let doubt = match config.intrinsics_covariance {
            Some(_) if method == Method::Wang2004 => return Err(LITERAL_INTRINSICS),
            Some(given) => intrinsics_share(&Minimum { covariance, ..*m }, problem, given)?,
            None => Matrix6::zeros(),
        };
        Ok((covariance + doubt) * noise_scale)
    };
    let ambiguity = match (choice.rival, choice.ratio) {
        (Some(rival), Some(ratio)) => {
            let covariance = whole(rival, curvature::is_bent(rival, problem))?;
            Ambiguity::Ambiguous { ratio, other: Minimum { covariance, ..*rival } }
        }
        (_, ratio) => Ambiguity::Unique { ratio },
    };
    let best = choice.best;
    let estimate = PoseEstimate {
        cam_from_target: best.cam_from_target,
        covariance: whole(best, is_bent)?,
        rms_px: best.rms_px,
        chi2: best.chi2,
        degrees_of_freedom,
        n_points: seen.len(),
        method,
        ambiguity,
        consistency: consistency(best, problem),
        weakness,
    };
    if estimate.is_finite() { Ok(estimate) } else { Err(OVERFLOW) }
}

/// What the points allow, and the method for it. Too few points, or points on a line, are left to the priors, if there are any.
fn layout(problem: &Problem, method: Method) -> Result<(Configuration, Method), Error> {
    match classify(problem.seen) {
        Ok(configuration) => Ok((configuration, resolve(method, &configuration)?)),
        Err(Error::TooFewPoints { .. } | Error::Collinear { .. }) if method == Method::Upright => {
            Ok((Configuration::General, Method::Upright))
        }
        Err(Error::TooFewPoints { .. } | Error::Collinear { .. })
            if method == Method::Auto && may_hold(problem) =>
        {
            Ok((Configuration::General, Method::Priors))
        }
        Err(refused) => Err(refused),
    }
}

const LITERAL_INTRINSICS: Error = Error::WrongLayout {
    method: "wang2004",
    reason: "the printed procedure does not propagate uncertain intrinsics",
};

/// Sigmas, coordinates or intrinsics so far apart that their squares leave the range of numbers.
pub(crate) const OVERFLOW: Error = Error::DegenerateView {
    reason: "coordinates, sigmas and camera differ by so many orders of magnitude that the answer overflows; check their units",
    metric: f64::INFINITY,
    needed: f64::MAX,
};

impl PoseEstimate {
    /// Every number in it is one, and no variance is negative.
    fn is_finite(&self) -> bool {
        let other = match &self.ambiguity {
            Ambiguity::Ambiguous { ratio, other } => ratio.is_finite() && other.is_finite(),
            Ambiguity::Unique { ratio } => ratio.is_none_or(f64::is_finite),
        };
        let residual = match self.consistency {
            Consistency::Inconsistent { chi2_per_dof, worst_px, .. } => {
                chi2_per_dof.is_finite() && worst_px.is_finite()
            }
            Consistency::Consistent => true,
        };
        let (cam_from_target, covariance) = (self.cam_from_target, self.covariance);
        let first = Minimum { cam_from_target, covariance, chi2: self.chi2, rms_px: self.rms_px };
        first.is_finite() && other && residual
    }
}
