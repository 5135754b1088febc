//! Coordinates of points on a plane from a few distances between them, typed by a person: docs/math/layout.md.
//!
//! The first point is the origin, x runs towards the second, and z points to the camera's side of the plane: distances alone leave a
//! mirror image open, and the photograph tells which of the two it is. Each further point needs its distances to two points that have a
//! place, or one if it stands on their line. A distance that is not needed checks the others.

use crate::core::{Pixel, Point};
use nalgebra::Vector2;

/// A length between two points.
#[derive(Debug, Clone, PartialEq)]
pub struct TypedDistance {
    /// Number of one end, in the order of the points.
    pub a: usize,
    /// Number of the other.
    pub b: usize,
    /// As measured.
    pub distance_m: f64,
    /// Its standard deviation.
    pub sigma_m: f64,
}

/// What is known of the points besides the distances.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// They lie on one plane.
    Plane,
    /// The first three stand on a line.
    LineOfThree,
    /// Four corners of a rectangle, in order around it: two sides are enough.
    Rectangle,
}

/// A point with its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaidPoint {
    /// Place, z = 0.
    pub position_m: Point,
    /// Standard deviation of x and y, root mean square of the two; 0 for the origin.
    pub sigma_m: f64,
}

/// What the distances say.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// One a point; none where distances are missing.
    pub points: Vec<Option<LaidPoint>>,
    /// What each distance is by these places, metres; none where an end has no place.
    pub computed_m: Vec<Option<f64>>,
    /// Which distances contradict the others, and by how many standard deviations.
    pub contradiction: Option<Contradiction>,
}

/// A distance that the others do not allow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contradiction {
    /// Number of the distance.
    pub distance: usize,
    /// What the others make of it, metres: the nearest length where no triangle closes.
    pub computed_m: f64,
    /// How far off it is, in standard deviations of the difference.
    pub sigmas: f64,
}

/// Beyond this a distance contradicts the others: once in two thousand for right ones.
const CONTRADICTS_SIGMAS: f64 = 3.5;
/// Step of the differences that carry the standard deviations, in parts of a distance.
const STEP: f64 = 1e-6;

/// Places of points from their distances; `pixels` are where the photograph shows them, in the same order.
///
/// Distances that are no positive finite numbers, or name no points, take no part.
pub fn lay_out(pixels: &[Pixel], shape: Shape, distances: &[TypedDistance]) -> Layout {
    let used: Vec<TypedDistance> = distances.iter().filter(|d| is_usable(d, pixels.len())).cloned().collect();
    let lengths: Vec<f64> = used.iter().map(|d| d.distance_m).collect();
    let plan = Plan { pixels, shape, distances: &used };
    let placed = plan.places(&lengths);
    let by_length: Vec<Vec<Option<Vector2<f64>>>> =
        (0..used.len()).map(|k| plan.slopes(&lengths, k)).collect();
    let variance = |i: usize| -> f64 {
        let by = |(k, slopes): (usize, &Vec<Option<Vector2<f64>>>)| {
            slopes[i].map_or(0.0, |slope| 0.5 * slope.norm_squared() * used[k].sigma_m.powi(2))
        };
        by_length.iter().enumerate().map(by).sum()
    };
    let laid = |(i, at): (usize, &Option<Vector2<f64>>)| {
        at.map(|at| LaidPoint { position_m: Point::new(at.x, at.y, 0.0), sigma_m: variance(i).sqrt() })
    };
    let between = |d: &TypedDistance| Some((placed.get(d.a)?.as_ref()? - placed.get(d.b)?.as_ref()?).norm());
    Layout {
        points: placed.iter().enumerate().map(laid).collect(),
        computed_m: distances.iter().map(between).collect(),
        contradiction: plan.contradiction(&lengths, &placed, &by_length).map(|c| Contradiction {
            distance: distances.iter().position(|d| *d == used[c.distance]).unwrap_or(c.distance),
            ..c
        }),
    }
}

fn is_usable(d: &TypedDistance, n: usize) -> bool {
    let is_positive = |x: f64| 0.0 < x && x.is_finite();
    d.a < n && d.b < n && d.a != d.b && is_positive(d.distance_m) && is_positive(d.sigma_m)
}

struct Plan<'a> {
    pixels: &'a [Pixel],
    shape: Shape,
    distances: &'a [TypedDistance],
}

type Places = Vec<Option<Vector2<f64>>>;

impl Plan<'_> {
    /// Places for these lengths, one point after the other until no further one can be placed.
    fn places(&self, lengths: &[f64]) -> Places {
        let mut placed: Places = vec![None; self.pixels.len()];
        let Some(first) = placed.first_mut() else { return placed };
        *first = Some(Vector2::zeros());
        if self.shape == Shape::Rectangle {
            self.rectangle(lengths, &mut placed);
        } else if let Some(d) = self.between(0, 1, lengths).filter(|_| 1 < self.pixels.len()) {
            placed[1] = Some(Vector2::new(d, 0.0));
        } else {
            self.second_by_the_third(lengths, &mut placed);
        }
        while let Some((i, at)) = self.next(lengths, &placed) {
            placed[i] = Some(at);
        }
        placed
    }

    fn between(&self, a: usize, b: usize, lengths: &[f64]) -> Option<f64> {
        let joins = |d: &TypedDistance| (d.a, d.b) == (a, b) || (d.a, d.b) == (b, a);
        self.distances.iter().position(joins).map(|k| lengths[k])
    }

    /// Two sides of a rectangle: eq. (4).
    fn rectangle(&self, lengths: &[f64], placed: &mut Places) {
        let side = |a, b, c, d| self.between(a, b, lengths).or_else(|| self.between(c, d, lengths));
        if placed.len() < 4 {
            return;
        }
        let (Some(width), Some(height)) = (side(0, 1, 2, 3), side(1, 2, 3, 0)) else { return };
        let height = height * self.side_of_line(0, 1, 2);
        placed[1] = Some(Vector2::new(width, 0.0));
        placed[2] = Some(Vector2::new(width, height));
        placed[3] = Some(Vector2::new(0.0, height));
    }

    /// The first two of a line of three by their distances to the third.
    fn second_by_the_third(&self, lengths: &[f64], placed: &mut Places) {
        if self.shape != Shape::LineOfThree || placed.len() < 3 {
            return;
        }
        let (Some(ac), Some(bc)) = (self.between(0, 2, lengths), self.between(1, 2, lengths)) else { return };
        let b = match self.along(0, 1, 2) {
            t if 1.0 < t => ac - bc, // C beyond B.
            t if 0.0 < t => ac + bc,
            _ => bc - ac,
        };
        placed[1] = (0.0 < b).then(|| Vector2::new(b, 0.0));
    }

    /// The next point that two distances, or a line and one, determine.
    fn next(&self, lengths: &[f64], placed: &Places) -> Option<(usize, Vector2<f64>)> {
        placed[1.min(placed.len() - 1)]?;
        (2..placed.len())
            .filter(|i| placed[*i].is_none())
            .find_map(|i| Some((i, self.place(i, lengths, placed)?)))
    }

    fn place(&self, i: usize, lengths: &[f64], placed: &Places) -> Option<Vector2<f64>> {
        let known: Vec<(usize, Vector2<f64>, f64)> =
            (0..placed.len()).filter_map(|j| Some((j, placed[j]?, self.between(i, j, lengths)?))).collect();
        if self.shape == Shape::LineOfThree && i == 2 {
            let (j, at, r) = known.first()?;
            let t = self.along(0, 1, 2);
            let ahead = if *j == 0 { 0.0 < t } else { 1.0 < t };
            return Some(Vector2::new(if ahead { at.x + r } else { at.x - r }, 0.0));
        }
        // The longest base: its triangle is the best.
        let pairs = (0..known.len()).flat_map(|a| (a + 1..known.len()).map(move |b| (a, b)));
        let (a, b) = pairs.max_by(|x, y| {
            let base = |(a, b): &(usize, usize)| (known[*a].1 - known[*b].1).norm();
            base(x).total_cmp(&base(y))
        })?;
        let ((p, at_p, from_p), (q, at_q, from_q)) = (known[a], known[b]);
        Some(triangle([at_p, at_q], [from_p, from_q], self.side_of_line(p, q, i)))
    }

    /// On which side of the line from a to b the photograph shows c: 1 to its left as seen from the camera. Pixel v runs down.
    fn side_of_line(&self, a: usize, b: usize, c: usize) -> f64 {
        let (ab, ac) = (self.pixels[b] - self.pixels[a], self.pixels[c] - self.pixels[a]);
        if ab.x * ac.y - ab.y * ac.x < 0.0 { 1.0 } else { -1.0 }
    }

    /// Where c is along the image of the line from a (0) to b (1).
    fn along(&self, a: usize, b: usize, c: usize) -> f64 {
        let ab = self.pixels[b] - self.pixels[a];
        (self.pixels[c] - self.pixels[a]).dot(&ab) / ab.norm_squared().max(f64::MIN_POSITIVE)
    }

    /// How each place moves with a length, m/m, by central differences.
    fn slopes(&self, lengths: &[f64], k: usize) -> Places {
        let step = STEP * lengths[k];
        let at = |by: f64| {
            let moved: Vec<f64> =
                lengths.iter().enumerate().map(|(i, l)| if i == k { l + by } else { *l }).collect();
            self.places(&moved)
        };
        at(step).iter().zip(at(-step)).map(|(up, down)| Some((up.as_ref()? - down?) / (2.0 * step))).collect()
    }

    /// The distance that contradicts the places most, if one does: eqs. (5), (6).
    fn contradiction(&self, lengths: &[f64], placed: &Places, by_length: &[Places]) -> Option<Contradiction> {
        let off = |(k, d): (usize, &TypedDistance)| {
            let apart = placed[d.a]? - placed[d.b]?;
            let computed_m = apart.norm();
            let along = apart / computed_m.max(f64::MIN_POSITIVE);
            let variance = |(j, slopes): (usize, &Places)| {
                let slope = Some(along.dot(&(slopes[d.a]? - slopes[d.b]?)))?;
                let slope = slope - if j == k { 1.0 } else { 0.0 };
                Some((slope * self.distances[j].sigma_m).powi(2))
            };
            let variance: f64 = by_length.iter().enumerate().filter_map(variance).sum();
            // A distance that a place rests on has no difference but rounding; where its triangle does not close, it has.
            let sigma = variance.sqrt().max(1e-3 * d.sigma_m);
            let difference = (computed_m - lengths[k]).abs();
            let is_rounding = difference < 1e-7 * lengths[k];
            let sigmas = if is_rounding { 0.0 } else { difference / sigma };
            (CONTRADICTS_SIGMAS < sigmas).then_some(Contradiction { distance: k, computed_m, sigmas })
        };
        let all = self.distances.iter().enumerate().filter_map(off);
        all.max_by(|a, b| a.sigmas.total_cmp(&b.sigmas))
    }
}

/// The corner of a triangle on its base, to the left of it (side 1) or right (−1): eqs. (1)–(3). Where the sides do not reach, the nearest
/// point of the base's line.
fn triangle([p, q]: [Vector2<f64>; 2], [from_p, from_q]: [f64; 2], side: f64) -> Vector2<f64> {
    let base = (q - p).norm();
    let along = (q - p) / base.max(f64::MIN_POSITIVE);
    let foot = (from_p * from_p - from_q * from_q + base * base) / (2.0 * base.max(f64::MIN_POSITIVE));
    let height_squared = from_p * from_p - foot * foot;
    let left = Vector2::new(-along.y, along.x);
    p + along * foot + left * (side * height_squared.max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::{Camera, Pose, Vector6};

    /// A camera above a plane, 4 m from its points, that sees z from its positive side.
    fn seen(places: &[[f64; 2]]) -> Vec<Pixel> {
        let camera = Camera::normalized();
        let look_down = Pose::exp(&Vector6::new(2.2, 0.3, -0.2, 0.0, 0.0, 0.0));
        let cam_from_plane = Pose::new(look_down.rotation, nalgebra::Vector3::new(-0.5, 0.2, 6.0));
        assert!(0.0 < cam_from_plane.origin().z);
        places
            .iter()
            .map(|[x, y]| camera.project(&(cam_from_plane * Point::new(*x, *y, 0.0))).expect("in front"))
            .collect()
    }

    fn typed(places: &[[f64; 2]], pairs: &[(usize, usize)]) -> Vec<TypedDistance> {
        let one = |&(a, b): &(usize, usize)| {
            let [p, q] = [places[a], places[b]].map(|[x, y]| Vector2::new(x, y));
            TypedDistance { a, b, distance_m: (p - q).norm(), sigma_m: 0.01 }
        };
        pairs.iter().map(one).collect()
    }

    fn assert_places(layout: &Layout, truth: &[[f64; 2]]) {
        for (found, [x, y]) in layout.points.iter().zip(truth) {
            let off = found.expect("a place").position_m - Point::new(*x, *y, 0.0);
            assert!(off.norm() < 1e-6, "{off:?}");
        }
        assert_eq!(layout.contradiction, None);
    }

    /// Three on a line and one off it, on either side, by each of the pairs of distances that determine them.
    #[test]
    fn three_on_a_line_and_one_off_it() {
        for y in [1.7, -1.7] {
            for c in [5.0, 1.2, -2.0] {
                let truth = [[0.0, 0.0], [3.0, 0.0], [c, 0.0], [1.1, y]];
                for pairs in [
                    [(0, 1), (1, 2), (0, 3), (1, 3)],
                    [(0, 1), (0, 2), (2, 3), (1, 3)],
                    [(2, 0), (2, 1), (3, 2), (3, 0)],
                ] {
                    let layout = lay_out(&seen(&truth), Shape::LineOfThree, &typed(&truth, &pairs));
                    assert_places(&layout, &truth);
                }
            }
        }
    }

    #[test]
    fn any_four_and_a_rectangle() {
        let truth = [[0.0, 0.0], [2.0, 0.0], [2.3, 1.9], [-0.4, 1.1]];
        let pairs = [(0, 1), (0, 2), (1, 2), (0, 3), (1, 3)];
        assert_places(&lay_out(&seen(&truth), Shape::Plane, &typed(&truth, &pairs)), &truth);
        for height in [2.1, -2.1] {
            let truth = [[0.0, 0.0], [0.9, 0.0], [0.9, height], [0.0, height]];
            let sides = typed(&truth, &[(1, 0), (3, 0)]);
            assert_places(&lay_out(&seen(&truth), Shape::Rectangle, &sides), &truth);
        }
    }

    /// Two standard deviations: 10 mm in AB is 10 mm in x of B, or 7.1 mm root mean square of x and y.
    #[test]
    fn sigmas_are_those_of_the_lengths() {
        let truth = [[0.0, 0.0], [3.0, 0.0], [5.0, 0.0], [0.0, 2.0]];
        let distances = typed(&truth, &[(0, 1), (1, 2), (0, 3), (1, 3)]);
        let layout = lay_out(&seen(&truth), Shape::LineOfThree, &distances);
        let sigma = |i: usize| layout.points[i].expect("a place").sigma_m;
        assert_eq!(sigma(0), 0.0);
        assert!((sigma(1) - 0.01 / 2f64.sqrt()).abs() < 1e-8, "{}", sigma(1));
        assert!((sigma(2) - 0.01).abs() < 1e-8, "{}", sigma(2));
    }

    #[test]
    fn what_is_too_much_checks_and_what_is_missing_is_left_open() {
        let truth = [[0.0, 0.0], [3.0, 0.0], [5.0, 0.0], [1.1, 1.7]];
        let pairs = [(0, 1), (1, 2), (0, 3), (1, 3), (0, 2)];
        let mut distances = typed(&truth, &pairs);
        assert_places(&lay_out(&seen(&truth), Shape::LineOfThree, &distances), &truth);
        distances[4].distance_m = 5.3;
        let layout = lay_out(&seen(&truth), Shape::LineOfThree, &distances);
        let found = layout.contradiction.expect("5.3 m is not 3 m + 2 m");
        assert!(10.0 < found.sigmas, "{found:?}");
        let layout = lay_out(&seen(&truth), Shape::LineOfThree, &distances[..3]);
        assert!(layout.points[2].is_some() && layout.points[3].is_none());
        // No triangle has sides of 3, 1 and 1 m.
        let mut open = typed(&truth, &[(0, 1), (1, 2), (0, 3), (1, 3)]);
        (open[2].distance_m, open[3].distance_m) = (1.0, 1.0);
        assert!(lay_out(&seen(&truth), Shape::LineOfThree, &open).contradiction.is_some());
    }

    #[test]
    fn what_is_no_length_takes_no_part() {
        let truth = [[0.0, 0.0], [3.0, 0.0], [5.0, 0.0], [1.1, 1.7]];
        for bad in [f64::NAN, -1.0, 0.0, f64::INFINITY] {
            let mut distances = typed(&truth, &[(0, 1), (1, 2), (0, 3), (1, 3)]);
            distances[0].distance_m = bad;
            let layout = lay_out(&seen(&truth), Shape::LineOfThree, &distances);
            assert!(layout.points[1..].iter().all(Option::is_none), "{bad}");
        }
        assert!(lay_out(&[], Shape::Rectangle, &[]).points.is_empty());
    }
}
