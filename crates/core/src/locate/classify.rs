//! The first line of `locate`: what the points allow, and the method for it.

use super::Config;
use super::choose::gate_of_layout;
use super::common::Common;
use super::method::{Method, resolve};
use super::prior_start::may_hold;
use super::problem::Problem;
use crate::solve::configuration::{Configuration, Geometry, describe_geometry};
use crate::{Camera, Correspondence, Error};

/// A view and how its pose is found.
pub(crate) struct View<'a> {
    pub(crate) problem: Problem<'a>,
    /// What was measured on the points; none where priors stand in for points that determine no pose.
    pub(crate) geometry: Option<Geometry>,
    /// Never `Auto`.
    pub(crate) method: Method,
    pub(crate) allowed: Allowed<'a>,
}

impl View<'_> {
    /// Any layout where the points have none.
    pub(crate) fn configuration(&self) -> Configuration {
        self.geometry.map_or(Configuration::General, |g| g.configuration)
    }

    /// The gate of exact points and intrinsics.
    pub(crate) fn gate_chi2(&self) -> f64 {
        gate_of_layout(self.geometry.as_ref())
    }
}

/// What widens the covariance besides the pixels' sigmas.
#[derive(Clone, Copy, Default)]
pub(crate) struct Allowed<'a> {
    pub(crate) common: Common<'a>,
    pub(crate) shared_errors: bool,
}

/// What is sought and by which method.
///
/// # Errors
/// Those of [`Problem::check`] and of the configuration; a method that does not fit the points.
pub(crate) fn classify<'a>(
    seen: &'a [Correspondence],
    camera: &'a Camera,
    config: &Config<'a>,
) -> Result<View<'a>, Error> {
    let Config { priors, loss, groups, .. } = *config;
    let problem = Problem { priors, loss, groups, ..Problem::new(seen, camera) };
    problem.check()?;
    let (geometry, method) = layout(&problem, config.method)?;
    let common = allowed_common(config, method)?;
    let allowed = Allowed { common, shared_errors: config.shared_errors };
    Ok(View { problem, geometry, method, allowed })
}

/// What the points allow, and the method for it. Too few points, or points on a line, are left to the priors, if there are any.
fn layout(problem: &Problem, method: Method) -> Result<(Option<Geometry>, Method), Error> {
    match describe_geometry(problem.seen) {
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

const LITERAL_SCALE: Error = Error::WrongLayout {
    method: "wang2004",
    reason: "the procedure of the paper does not propagate the uncertain scale of a printed target",
};

/// The procedure of Wang (2004) has no derivative to propagate them by.
fn allowed_common<'a>(config: &Config<'a>, method: Method) -> Result<Common<'a>, Error> {
    let common = Common { intrinsics: config.intrinsics_covariance, scale_sigma: config.target_scale_sigma };
    common.check()?;
    match method {
        Method::Wang2004 if common.intrinsics.is_some() => Err(LITERAL_INTRINSICS),
        Method::Wang2004 if !common.is_exact() => Err(LITERAL_SCALE),
        _ => Ok(common),
    }
}
