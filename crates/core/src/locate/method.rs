//! Which method fits which configuration.

use crate::Error;
use crate::solve::configuration::Configuration;

/// How a pose is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Method {
    /// Decide from the configuration.
    #[default]
    Auto,
    /// The paper of Wang (2004), literally: no refinement, the solution of least residual in its eq. (3).
    Wang2004,
    /// Three collinear points and one off the line.
    LinePlusOne,
    /// Three points; with more, three of them and the rest to choose.
    P3p,
    /// Coplanar points.
    Planar,
    /// Any n ≥ 3 points.
    Sqpnp,
    /// Two points or more, and a direction known in both frames (`Prior::Gravity`).
    Upright,
    /// Too few points for a pose of their own, or points on one line: priors give the rest. Chosen by `Auto` alone.
    Priors,
    /// Pose and focal length together: what `unknown_focal::estimate_focal` answers with, and nothing that can be asked of `locate`.
    UnknownFocal,
    /// Lines, with points where there are any: what `lines::locate_lines` answers with.
    Lines,
}

/// `Auto` becomes the method for the configuration; a method that does not fit it is refused.
pub(crate) fn resolve(method: Method, configuration: &Configuration) -> Result<Method, Error> {
    let wrong = |method, reason| Err(Error::WrongLayout { method, reason });
    let four = "it takes three points on a line and one off it";
    match (method, configuration) {
        (Method::Auto, Configuration::LinePlusOne { .. }) => Ok(Method::LinePlusOne),
        (Method::Auto, Configuration::Three) => Ok(Method::P3p),
        (Method::Auto, Configuration::Planar) => Ok(Method::Planar),
        (Method::Auto, Configuration::General) => Ok(Method::Sqpnp),
        (Method::LinePlusOne | Method::Wang2004, Configuration::LinePlusOne { .. }) => Ok(method),
        (Method::LinePlusOne, _) => wrong("line_plus_one", four),
        (Method::Wang2004, _) => wrong("wang2004", four),
        (Method::Planar, Configuration::Three) => wrong("planar", "it takes at least four points"),
        (Method::Planar, Configuration::General) => wrong("planar", "the points do not lie in one plane"),
        (Method::Planar, Configuration::LinePlusOne { .. }) => {
            wrong("planar", "three collinear points and one off the line leave a homography open")
        }
        (Method::Priors, _) => {
            wrong("priors", "these points have a pose of their own; priors join it in any method")
        }
        (Method::Lines, _) => wrong("lines", "they are points, not lines"),
        (Method::UnknownFocal, _) => {
            wrong("unknown_focal", "it estimates the focal length too, for which it needs no camera")
        }
        (method, _) => Ok(method),
    }
}
