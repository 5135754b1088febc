//! The answer of the paper of Wang (2004), not refined, with its own covariance.

use crate::locate::choose::Minimum;
use crate::locate::loss::Loss;
use crate::locate::multi_start::four_of;
use crate::locate::problem::Problem;
use crate::locate::refine::residual_sums;
use crate::solve::configuration::Configuration;
use crate::solve::wang2004;
use crate::{Bearing, Correspondence, Error, Matrix6, Point};
use nalgebra::Vector2;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Returns the pose of `solve::wang2004`, its covariance propagated from the pixels by central differences.
pub(crate) fn literal(configuration: &Configuration, problem: &Problem) -> Result<Minimum, Error> {
    let (Configuration::LinePlusOne { order }, 4) = (configuration, problem.seen.len()) else {
        return Err(Error::WrongLayout {
            method: "wang2004",
            reason: "it takes three points on a line and one off it, each once",
        });
    };
    if !problem.priors.is_empty() || problem.loss != Loss::Squared {
        return Err(Error::WrongLayout {
            method: "wang2004",
            reason: "the printed procedure has neither priors nor losses",
        });
    }
    let solve = |bearings: &[Bearing; 4], points: &[Point; 4]| {
        let solutions = wang2004::wang2004(bearings, points)?;
        wang2004::least_residual(&solutions)
            .map(|s| s.cam_from_target)
            .ok_or(Error::NoSolution { n_points: problem.seen.len() })
    };
    let (bearings, points) = four_of(problem.seen, order);
    let cam_from_target = solve(&bearings, &points)?;
    let mut covariance = Matrix6::zeros();
    for (slot, index) in order.iter().enumerate() {
        let c = &problem.seen[*index];
        let spread = spread(c);
        for axis in 0..2 {
            let moved = |step: f64| {
                let pixel = c.pixel + spread[axis] * step;
                let mut bearings = bearings;
                bearings[slot] = problem.camera.bearing(&pixel)?;
                Ok((solve(&bearings, &points)? * cam_from_target.inverse()).log())
            };
            let column = (moved(LITERAL_STEP)? - moved(-LITERAL_STEP)?) / (2.0 * LITERAL_STEP);
            covariance += column * column.transpose();
        }
    }
    let (chi2, rms_px) = residual_sums(&cam_from_target, problem);
    Ok(Minimum { cam_from_target, covariance, chi2, rms_px, log_determinant: 0.0 })
}

/// Columns of a triangular root of the pixel's covariance: two independent errors of one standard deviation each, px.
fn spread(c: &Correspondence) -> [Vector2<f64>; 2] {
    let [uu, uv, vv] = c.pixel_covariance();
    let u = uu.sqrt();
    [Vector2::new(u, uv / u), Vector2::new(0.0, (vv - uv * uv / uu).sqrt())]
}

/// Step of the central differences, in standard deviations of a pixel: small beside the noise, large beside rounding.
const LITERAL_STEP: f64 = 1e-2;
