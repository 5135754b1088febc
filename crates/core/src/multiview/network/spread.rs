//! The test whether the control points are on one line. A rotation of everything about that line is then hardly visible, and the mirror image
//! fits as well: docs/math/survey.md eq. (24).

use super::trilaterate::{LEAST_HEIGHT, LINE_SIGMAS, Network, Places, lengths, plane_of};
use super::{Adjusted, Constraint, NetworkProblem, Query};
use crate::{Error, Point};

/// Control points on one line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OnLine {
    /// The two control points farthest from each other.
    pub ends: [usize; 2],
    /// Their distance, m.
    pub length_m: f64,
    /// The distance of the control point farthest from their line, m.
    pub width_m: f64,
    /// The distance that is needed, m.
    pub needed_m: f64,
}

impl OnLine {
    /// Returns the corresponding error.
    pub(super) fn refusal(&self) -> Error {
        let [a, b] = self.ends;
        Error::ControlPointsOnLine {
            a,
            b,
            length_m: self.length_m,
            width_m: self.width_m,
            needed_m: self.needed_m,
        }
    }
}

/// Returns the two positions farthest from each other, and the one farthest from their line, with its distance from it.
fn widest(places: &[(usize, Point)]) -> Option<([usize; 3], f64, f64)> {
    let mut ends: Option<(f64, [usize; 2])> = None;
    for i in 0..places.len() {
        for j in 0..i {
            let length = (places[i].1 - places[j].1).norm();
            if ends.is_none_or(|(most, _)| most < length) {
                ends = Some((length, [j, i]));
            }
        }
    }
    let (length, [a, b]) = ends.filter(|(length, _)| 0.0 < *length)?;
    let along = (places[b].1 - places[a].1) / length;
    let off = |x: &Point| (x - places[a].1).cross(&along).norm();
    let others = places.iter().enumerate().filter(|(i, _)| *i != a && *i != b);
    let (c, width) = others.map(|(i, p)| (i, off(&p.1))).max_by(|x, y| x.1.total_cmp(&y.1))?;
    Some(([places[a].0, places[b].0, places[c].0], length, width))
}

/// Returns whether a point is a control point: known by coordinates or distances.
fn is_control_point(network: &NetworkProblem, point: usize) -> bool {
    let speaks = |f: &&Constraint| matches!(f, Constraint::Place { .. } | Constraint::Distance { .. });
    network.constraints.iter().filter(speaks).any(|f| f.points().contains(&Some(point)))
}

/// Returns whether the pose of any photograph comes from control points.
fn by_control_points(network: &NetworkProblem) -> bool {
    let is_given = |photo| {
        network.constraints.iter().any(|f| matches!(f, Constraint::Pose { photo: p, .. } if *p == photo))
    };
    !(0..network.camera_of_photo.len()).all(is_given)
}

/// Returns the line through adjusted control points.
pub(super) fn of_adjusted(network: &NetworkProblem, adjusted: &Adjusted) -> Option<OnLine> {
    let control_points: Vec<(usize, Point)> = (0..network.n_points)
        .filter(|p| is_control_point(network, *p))
        .filter_map(|p| Some((p, adjusted.point(p)?)))
        .collect();
    let ([a, b, c], length_m, width_m) = widest(&control_points).filter(|_| by_control_points(network))?;
    let (_, gradient) = Query::Area { points: vec![a, b, c] }.value(&adjusted.state, &adjusted.layout);
    let area_sigma = gradient.dot(&adjusted.covariance.times(&gradient)).max(0.0).sqrt();
    let needed_m = (LEAST_HEIGHT * length_m).max(LINE_SIGMAS * 2.0 * area_sigma / length_m);
    // Where the area vanishes its gradient does too; the first bound then applies.
    (width_m < needed_m).then_some(OnLine { ends: [a, b], length_m, width_m, needed_m })
}

/// Returns the line through coordinates, where only coordinates are known of the control points.
pub(super) fn of_coordinates(network: &NetworkProblem) -> Option<Error> {
    let place = |f: &Constraint| match f {
        Constraint::Place { point, x_in_world, sigma_m } => Some(((*point, *x_in_world), sigma_m.max())),
        _ => None,
    };
    let (control_points, sigmas): (Vec<(usize, Point)>, Vec<f64>) =
        network.constraints.iter().filter_map(place).unzip();
    let has_lengths = network.constraints.iter().any(|f| matches!(f, Constraint::Distance { .. }));
    let sigma_m = sigmas.into_iter().fold(0.0, f64::max);
    line(&control_points, sigma_m).filter(|_| !has_lengths && by_control_points(network))
}

/// Returns the line of positions found from separate lengths.
pub(super) fn of_laid(network: &NetworkProblem, laid: &Places) -> Option<Error> {
    let control_points: Vec<(usize, Point)> = (0..laid.len())
        .filter(|p| is_control_point(network, *p))
        .filter_map(|p| Some((p, laid[p]?)))
        .collect();
    line(&control_points, 0.0)
}

fn line(control_points: &[(usize, Point)], sigma_m: f64) -> Option<Error> {
    let ([a, b, _], length_m, width_m) = widest(control_points)?;
    let needed_m = (LEAST_HEIGHT * length_m).max(LINE_SIGMAS * sigma_m);
    (width_m < needed_m).then(|| OnLine { ends: [a, b], length_m, width_m, needed_m }.refusal())
}

/// Returns the line of control points whose measured triangles are all slim.
pub(super) fn of_lengths(network: &NetworkProblem) -> Option<Error> {
    let lengths: Vec<_> = lengths(network).into_iter().map(|l| l.1).collect();
    let planes = plane_of(network);
    let (width_m, needed_m, longest) = Network { lengths: &lengths, plane_of: &planes }.tallest()?;
    let line = OnLine { ends: longest.ends, length_m: longest.length_m, width_m, needed_m };
    (width_m < needed_m).then(|| line.refusal())
}
