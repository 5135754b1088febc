//! Positions of control points of which only mutual distances are known: docs/math/survey.md eqs. (9)–(10).
//!
//! A triangle comes first; each further control point is where circles (in a common plane) or spheres meet. Where two positions fit equally
//! well, both are followed, and the photographs decide.

use super::{Constraint, NetworkProblem};
use crate::Point;
use nalgebra::Vector3;

/// A measured distance between two points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Length {
    pub(super) ends: [usize; 2],
    pub(super) length_m: f64,
    pub(super) sigma_m: f64,
}

/// Positions of some of the points.
pub(super) type Places = Vec<Option<Point>>;

/// Returns the given distances in order, with the constraint of each.
pub(super) fn lengths(problem: &NetworkProblem) -> Vec<(usize, Length)> {
    let length = |(index, constraint): (usize, &Constraint)| match constraint {
        Constraint::Distance { a, b, distance_m, sigma_m } => {
            Some((index, Length { ends: [*a, *b], length_m: *distance_m, sigma_m: *sigma_m }))
        }
        _ => None,
    };
    problem.constraints.iter().enumerate().filter_map(length).collect()
}

/// Returns the plane on which each point lies.
pub(super) fn plane_of(problem: &NetworkProblem) -> Vec<Option<usize>> {
    let mut planes = vec![None; problem.n_points];
    for constraint in problem.constraints {
        if let Constraint::OnPlane { plane, point, .. } = constraint {
            planes[*point] = Some(*plane);
        }
    }
    planes
}

/// Largest number of arrangements followed at once; each further control point with two possible positions doubles them.
const MOST_ARRANGEMENTS: usize = 8;
/// A position whose χ² over its distances exceeds the best by more than this is not followed.
const FOLLOWED_CHI2: f64 = 25.0;
/// Smallest height over longest side of a triangle that can be used.
pub(super) const LEAST_HEIGHT: f64 = 0.02;

/// Smallest distance of control points from their line, in standard deviations: the mirror image is then ten away.
pub(super) const LINE_SIGMAS: f64 = 5.0;
/// A height is known from distances where its square exceeds this many of the square's standard deviations.
const UNSURE_SIGMAS: f64 = 3.0;

/// Distances between points, and the planes of the points.
pub(super) struct Network<'a> {
    pub(super) lengths: &'a [Length],
    /// The plane on which each point lies.
    pub(super) plane_of: &'a [Option<usize>],
}

impl Network<'_> {
    fn between(&self, a: usize, b: usize) -> Option<Length> {
        self.lengths.iter().find(|l| l.ends == [a, b] || l.ends == [b, a]).copied()
    }

    /// Returns the distances from a point to others.
    fn from(&self, a: usize) -> impl Iterator<Item = (usize, Length)> + '_ {
        self.lengths.iter().filter_map(move |l| match l.ends {
            [x, y] if x == a => Some((y, *l)),
            [x, y] if y == a => Some((x, *l)),
            _ => None,
        })
    }

    /// Returns the triangle of measured sides with the largest area, with its first corner at the origin, its second on the x axis and its third
    /// in the xy-plane.
    pub(super) fn triangle(&self) -> Option<Places> {
        let n = self.plane_of.len();
        let mut best: Option<(f64, [usize; 3], Point)> = None;
        for (i, ab) in self.lengths.iter().enumerate() {
            let [a, b] = [ab.ends[0].min(ab.ends[1]), ab.ends[0].max(ab.ends[1])];
            let is_first = !self.lengths[..i].iter().any(|l| l.ends == ab.ends);
            for c in (b + 1..n).filter(|_| is_first) {
                let (Some(ac), Some(bc)) = (self.between(a, c), self.between(b, c)) else { continue };
                let (p, q, r) = (ab.length_m, ac.length_m, bc.length_m);
                let along = (q * q - r * r + p * p) / (2.0 * p);
                let height = (q * q - along * along).max(0.0).sqrt();
                let slim = height < LEAST_HEIGHT * p.max(q).max(r);
                if !slim && best.is_none_or(|(area, ..)| area < p * height) {
                    best = Some((p * height, [a, b, c], Point::new(along, height, 0.0)));
                }
            }
        }
        let (_, [a, b, c], third) = best?;
        let mut places = vec![None; n];
        places[a] = Some(Point::zeros());
        places[b] = Some(Point::new(self.between(a, b)?.length_m, 0.0, 0.0));
        places[c] = Some(third);
        Some(places)
    }

    /// Returns the height of the least slim triangle of measured sides, the height it needs to be distinguished from a line, and its longest
    /// side; none without any triangle.
    pub(super) fn tallest(&self) -> Option<(f64, f64, Length)> {
        let mut best: Option<(f64, f64, Length)> = None;
        for ab in self.lengths {
            for c in 0..self.plane_of.len() {
                let (Some(ac), Some(bc)) = (self.between(ab.ends[0], c), self.between(ab.ends[1], c)) else {
                    continue;
                };
                let (p, q, r) = (ab.length_m, ac.length_m, bc.length_m);
                let along = (q * q - r * r + p * p) / (2.0 * p);
                let height = (q * q - along * along).max(0.0).sqrt();
                // Half the derivative of the squared height by each side.
                let by = [q * (1.0 - along / p), along * r / p, along * (1.0 - along / p)];
                let sigmas = [ac.sigma_m, bc.sigma_m, ab.sigma_m];
                let square = by.iter().zip(sigmas).map(|(b, s)| (2.0 * b * s).powi(2)).sum::<f64>().sqrt();
                let needed = (LEAST_HEIGHT * p).max((0.5 * LINE_SIGMAS * square).sqrt());
                let is_longest = q.max(r) <= p;
                if is_longest && best.is_none_or(|(h, n, _)| h * needed < height * n) {
                    best = Some((height, needed, *ab));
                }
            }
        }
        best
    }

    /// Adds every point that its distances to placed ones determine; returns several arrangements where the distances leave a choice. `normals`
    /// are those of the planes known so far.
    pub(super) fn grow(&self, start: Places, normals: &[Option<Vector3<f64>>]) -> Vec<Places> {
        let (mut open, mut done) = (vec![start], Vec::new());
        while let Some(places) = open.pop() {
            let Some((point, candidates)) = self.next(&places, normals) else {
                done.push(places);
                continue;
            };
            let room = MOST_ARRANGEMENTS.saturating_sub(open.len() + done.len()).max(1);
            for candidate in candidates.into_iter().take(room) {
                let mut with = places.clone();
                with[point] = Some(candidate);
                open.push(with);
            }
        }
        done
    }

    /// Returns the unplaced point with the most distances to placed ones, and its possible positions, best first.
    fn next(&self, places: &Places, normals: &[Option<Vector3<f64>>]) -> Option<(usize, Vec<Point>)> {
        let known = |p: usize| self.from(p).filter(|(q, _)| places[*q].is_some()).count();
        let mut order: Vec<usize> =
            (0..places.len()).filter(|p| places[*p].is_none() && 2 <= known(*p)).collect();
        order.sort_by_key(|p| core::cmp::Reverse(known(*p)));
        order.into_iter().find_map(|p| {
            let found = self.candidates(p, places, normals);
            (!found.is_empty()).then_some((p, found))
        })
    }

    fn candidates(&self, point: usize, places: &Places, normals: &[Option<Vector3<f64>>]) -> Vec<Point> {
        let ends: Vec<(Point, Length, usize)> =
            self.from(point).filter_map(|(q, l)| Some((places[q]?, l, q))).collect();
        let flat = self.plane_of[point]
            .filter(|plane| ends.iter().filter(|(_, _, q)| self.plane_of[*q] == Some(*plane)).count() >= 2);
        let normal = flat.and_then(|plane| normals[plane]);
        let mut found = match normal {
            Some(normal) => {
                let on_it: Vec<_> = ends
                    .iter()
                    .filter(|(_, _, q)| self.plane_of[*q] == flat)
                    .map(|(x, l, _)| (*x, *l))
                    .collect();
                circles(&on_it, &normal)
            }
            None => spheres(&ends.iter().map(|(x, l, _)| (*x, *l)).collect::<Vec<_>>()),
        };
        let chi2 = |x: &Point| -> f64 {
            ends.iter().map(|(at, l, _)| (((x - at).norm() - l.length_m) / l.sigma_m).powi(2)).sum()
        };
        found.sort_by(|a, b| chi2(a).total_cmp(&chi2(b)));
        let least = found.first().map_or(0.0, chi2);
        found.retain(|x| chi2(x) <= least + FOLLOWED_CHI2);
        found.dedup_by(|a, b| (*a - *b).norm() < 1e-9 * (1.0 + a.norm()));
        found
    }
}

/// Returns the points where two circles about points of a plane meet, for the pair that crosses most squarely.
fn circles(known: &[(Point, Length)], normal: &Vector3<f64>) -> Vec<Point> {
    let mut best: Option<(f64, [Point; 2])> = None;
    for (i, (a, da)) in known.iter().enumerate() {
        for (b, db) in &known[..i] {
            let between = (b - a) - normal * normal.dot(&(b - a));
            let length = between.norm();
            let along = (da.length_m.powi(2) - db.length_m.powi(2) + length * length) / (2.0 * length);
            let height = (da.length_m.powi(2) - along * along).max(0.0).sqrt();
            let (u, v) = (between / length, normal.cross(&between) / length);
            let squareness = length * height / (da.length_m * db.length_m);
            if squareness.is_finite() && best.is_none_or(|(most, _)| most < squareness) {
                best = Some((squareness, [a + u * along + v * height, a + u * along - v * height]));
            }
        }
    }
    best.map_or(Vec::new(), |(_, both)| both.to_vec())
}

/// Returns the points where three spheres meet, for the three centres that span the largest triangle.
fn spheres(known: &[(Point, Length)]) -> Vec<Point> {
    let mut best: Option<(f64, [usize; 3])> = None;
    for k in 2..known.len() {
        for j in 1..k {
            for i in 0..j {
                let area = (known[j].0 - known[i].0).cross(&(known[k].0 - known[i].0)).norm();
                if best.is_none_or(|(most, _)| most < area) {
                    best = Some((area, [i, j, k]));
                }
            }
        }
    }
    let Some((area, [i, j, k])) = best else { return Vec::new() };
    let [(a, da), (b, db), (c, dc)] = [known[i], known[j], known[k]];
    let longest = (b - a).norm_squared().max((c - a).norm_squared()).max((c - b).norm_squared());
    if !(LEAST_HEIGHT * longest < area) {
        return Vec::new();
    }
    let u = (b - a).normalize();
    let w = u.cross(&(c - a)).normalize();
    let v = w.cross(&u);
    let p = (b - a).norm();
    let (s, t) = (u.dot(&(c - a)), v.dot(&(c - a)));
    let sigma_m = (da.sigma_m.powi(2) + db.sigma_m.powi(2) + dc.sigma_m.powi(2)).sqrt();
    let slack = UNSURE_SIGMAS * 2.0 * da.length_m * sigma_m;
    let [da, db, dc] = [da, db, dc].map(|l| l.length_m);
    let x = (da * da - db * db + p * p) / (2.0 * p);
    let y = (da * da - dc * dc + s * s + t * t - 2.0 * s * x) / (2.0 * t);
    let z = (da * da - x * x - y * y).max(0.0).sqrt();
    let foot = a + u * x + v * y;
    // The sign of the height is not known: the photographs determine it better from zero than from two wrong guesses.
    if z * z <= slack { vec![foot] } else { vec![foot + w * z, foot - w * z] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(centres: &[Point], target: &Point) -> Vec<(Point, Length)> {
        let length = |(i, c): (usize, &Point)| {
            (*c, Length { ends: [i, 9], length_m: (c - target).norm(), sigma_m: 1e-3 })
        };
        centres.iter().enumerate().map(length).collect()
    }

    const CENTRES: [[f64; 3]; 4] = [[0.3, -0.2, 0.1], [4.0, 0.5, 0.3], [1.2, 3.0, -0.4], [2.5, 2.0, 1.0]];

    /// Before any refinement one of the two positions is the true one, to rounding.
    #[test]
    fn spheres_meet_at_the_point() {
        let centres = CENTRES.map(Point::from);
        for target in [Point::new(1.0, 1.0, 2.0), Point::new(-2.0, 0.5, -1.0), Point::new(3.0, -4.0, 0.7)] {
            let found = spheres(&known(&centres, &target));
            assert!(
                found.len() == 2 && found.iter().any(|x| (x - target).norm() < 1e-9),
                "{found:?} {target}"
            );
        }
    }

    #[test]
    fn circles_meet_at_the_point() {
        let centres = CENTRES.map(|[x, y, _]| Point::new(x, y, 0.0));
        for target in [Point::new(1.0, 1.0, 0.0), Point::new(-2.0, 0.5, 0.0), Point::new(3.0, -4.0, 0.0)] {
            let found = circles(&known(&centres, &target), &Vector3::z());
            assert!(
                found.len() == 2 && found.iter().any(|x| (x - target).norm() < 1e-9),
                "{found:?} {target}"
            );
        }
    }

    /// Four sides and both diagonals give one arrangement, the square; without a diagonal there is also one with a mirrored fourth corner.
    #[test]
    fn arrangements_are_as_many_as_the_distances_allow() {
        let corners = [[0.0, 0.0], [5.0, 0.0], [5.5, 4.0], [-0.5, 4.5]].map(|[x, y]| Point::new(x, y, 0.0));
        let pairs = [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]];
        let lengths = pairs.map(|ends| {
            let length_m = (corners[ends[0]] - corners[ends[1]]).norm();
            Length { ends, length_m, sigma_m: 0.01 }
        });
        for (n, expected) in [(6, 1), (5, 2)] {
            let network = Network { lengths: &lengths[..n], plane_of: &[Some(0); 4] };
            let laid = network.triangle().unwrap();
            let found = network.grow(laid, &[Some(Vector3::z())]);
            assert_eq!(found.len(), expected, "{n} distances: {found:?}");
            assert!(found.iter().all(|places| places.iter().all(Option::is_some)));
        }
    }
}
