//! The chosen hypothesis for the user: shape, parameters and their covariance, coverage, what to do next.

use super::candidates::{Candidate, Evidence};
use super::fit::{covariance, verdicts};
use super::outline::Place;
use super::row::OUTLIER_COST;
use super::start::{arc, lines};
use super::state::State;
use super::{Config, Coverage, Parameter, Reason};
use crate::Shape;
use nalgebra::{DMatrix, Vector2};
use std::f64::consts::{FRAC_PI_2, PI};

/// The hypothesis by the parameters a user reads: the larger axis or side first, angles in [0, 180°), of a square in [0, 90°).
pub(super) fn natural(state: &State) -> State {
    let (centre, sizes, angle) = state.frame();
    let swapped = sizes[0] < sizes[1];
    let sizes = if swapped { [sizes[1], sizes[0]] } else { sizes };
    let angle = (if swapped { angle + FRAC_PI_2 } else { angle }).rem_euclid(PI);
    match state {
        State::Root { .. } | State::Axes { .. } | State::AxesOfRatio { .. } => {
            State::Axes { centre, axes: sizes, angle }
        }
        State::Rectangle { .. } => State::Rectangle { centre, sides: sizes, angle },
        State::RectangleOfRatio { mean, ratio, .. } => {
            State::RectangleOfRatio { centre, mean: *mean, angle: angle.rem_euclid(FRAC_PI_2), ratio: *ratio }
        }
        State::Circle { .. } | State::Chain(_) => state.clone(),
    }
}

/// The object; none of fewer than three corners.
pub(super) fn shape(state: &State) -> Option<Shape> {
    let (centre_m, sizes, angle_rad) = state.frame();
    Some(match state {
        State::Circle { radius, .. } => Shape::Circle { centre_m, radius_m: *radius },
        State::Root { .. } | State::Axes { .. } | State::AxesOfRatio { .. } => {
            Shape::Ellipse { centre_m, semi_axes_m: sizes, angle_rad }
        }
        State::Rectangle { .. } | State::RectangleOfRatio { .. } => {
            Shape::Rectangle { centre_m, sides_m: sizes, angle_rad }
        }
        State::Chain(corners) if 3 <= corners.len() => Shape::Polygon { corners_m: corners.clone() },
        State::Chain(_) => return None,
    })
}

/// Names, values and standard deviations, and the covariance; an undetermined one has infinite standard deviations and no
/// covariance (0 × 0).
pub(super) fn parameters(evidence: &Evidence, state: &State, excess: f64) -> (Vec<Parameter>, DMatrix<f64>) {
    let covariance = covariance(evidence.rows, state).map(|c| c * excess);
    let sigma = |i: usize| covariance.as_ref().map_or(f64::INFINITY, |c| c[(i, i)].max(0.0).sqrt());
    let named = named_values(state).into_iter().enumerate();
    let parameters = named
        .map(|(i, (name, value))| {
            let unit = if name.ends_with("_rad") { "rad" } else { "m" };
            Parameter { name, value, sigma: sigma(i), unit }
        })
        .collect();
    (parameters, covariance.unwrap_or_else(|| DMatrix::zeros(0, 0)))
}

fn named_values(state: &State) -> Vec<(String, f64)> {
    let (centre, sizes, angle) = state.frame();
    let name = |text: &str, value: f64| (text.to_string(), value);
    let mut list = vec![name("centre_x_m", centre.x), name("centre_y_m", centre.y)];
    match state {
        State::Circle { radius, .. } => list.push(name("radius_m", *radius)),
        State::RectangleOfRatio { mean, .. } => {
            list.extend([name("side_m", *mean), name("angle_rad", angle)])
        }
        State::Rectangle { .. } => {
            list.extend([name("side_a_m", sizes[0]), name("side_b_m", sizes[1]), name("angle_rad", angle)]);
        }
        State::Chain(corners) => {
            list = Vec::new();
            for (k, corner) in corners.iter().enumerate() {
                list.push((format!("corner_{k}_x_m"), corner.x));
                list.push((format!("corner_{k}_y_m"), corner.y));
            }
        }
        State::Root { .. } | State::Axes { .. } | State::AxesOfRatio { .. } => list.extend([
            name("semi_axis_a_m", sizes[0]),
            name("semi_axis_b_m", sizes[1]),
            name("angle_rad", angle),
        ]),
    }
    list
}

/// So many contacts make a corner or a face seen: two lines meet anywhere, the third confirms.
const SEEN: usize = 3;

/// What was touched; corners and faces are those of `cornered`.
pub(super) fn coverage(
    evidence: &Evidence,
    is_used: &[bool],
    cornered: Option<&Candidate>,
    config: &Config,
) -> Coverage {
    let mut coverage = Coverage::default();
    let used = || evidence.rows.iter().zip(is_used).filter(|(_, used)| **used).map(|(row, _)| row);
    let lines = lines(&used().copied().collect::<Vec<_>>(), evidence.lines.origin);
    if let Some((range, gaps)) = arc(&lines, config.gap_rad) {
        coverage.normals_range_rad = Some(range);
        coverage.gaps_rad = gaps;
    }
    coverage.used = used().count();
    coverage.tip_contacts = used().filter(|row| row.tip).count();
    if let Some(candidate) = cornered {
        (coverage.corners_seen, coverage.faces_seen) = corners_and_faces(evidence, &candidate.fit.state);
    }
    coverage
}

/// Corners that were rotated about, and the number of faces lain on.
fn corners_and_faces(evidence: &Evidence, state: &State) -> (Vec<Vector2<f64>>, usize) {
    let corners = match state.outline() {
        Some(super::outline::Outline::Corners(corners)) => corners.corners,
        _ => return (Vec::new(), 0),
    };
    let (mut turns, mut slides) = (vec![0; corners.len()], vec![0; corners.len()]);
    let seen = verdicts(evidence.rows, state);
    for ((row, place), squared) in evidence.rows.iter().zip(&seen.places).zip(&seen.squared) {
        match place {
            _ if row.tip || OUTLIER_COST <= *squared => {}
            Place::Corner(k, _) => turns[*k] += 1,
            Place::Face(k, u) if 0.0 < *u => slides[*k] += 1,
            Place::Face(..) | Place::Tangent(_) => {}
        }
    }
    let touched = corners.iter().zip(&turns).filter(|(_, n)| SEEN <= **n).map(|(corner, _)| *corner);
    (touched.collect(), slides.iter().filter(|n| SEEN <= **n).count())
}

/// A sweep that would decide.
pub(super) fn advice(reason: &Reason, coverage: &Coverage) -> String {
    let unseen = coverage.normals_range_rad.map_or(String::from("any side"), |[from, to]| {
        let degrees = |angle: f64| angle.to_degrees().round();
        format!(
            "sides whose outward normal is below {}° or above {}° (world, counter-clockwise from x)",
            degrees(from),
            degrees(to)
        )
    });
    match reason {
        Reason::TooFewContacts { seen, needed } => {
            format!(
                "{seen} usable contacts, {needed} needed: sweep on, or bend the whisker further for firmer contacts"
            )
        }
        Reason::OneCorner { radius_bound_m, .. } => format!(
            "all contacts pass one point (radius of curvature below {:.2} mm): sweep so that the whisker leans on {unseen}",
            1e3 * radius_bound_m
        ),
        Reason::TwoHypotheses { .. } | Reason::RatioOpen { .. } | Reason::SidesUnseen { .. } => {
            format!("sweep so that the whisker touches {unseen}")
        }
        Reason::NothingFits { .. } => String::from(
            "no hypothesis explains the contacts: check the whisker's calibration, or whether there are several objects or a hollow one",
        ),
    }
}
