//! What the points allow, decided before anything is solved: docs/math/configuration.md.
//!
//! All measures are ratios of lengths in the target, computed from differences and cross products (nothing is squared that is small),
//! so they hold at 1e-9 m and 1e9 m alike and a straight line comes out straight to rounding.

mod geometry;

pub use geometry::{Configuration, Geometry, Measure};

use crate::{Correspondence, Error, Point};
use arrayvec::ArrayVec;
use nalgebra::Vector3;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Width over length at which the points are one line: survey coordinates given to 1e-9 of their extent are no straighter,
/// and the rotation about such a line would need 1e-9 of the image's width to be seen.
pub(crate) const MIN_WIDTH: f64 = 1e-9;
/// Height over base up to which three of four points are three points on a line. Up to here four points fix a homography so badly
/// that noise of a thousandth of the image's width spoils it; the start from the line is off by no more than this angle, and
/// refinement uses the true coordinates. Evidence: docs/math/configuration.md, table 1.
pub(crate) const MAX_LINE_HEIGHT: f64 = 0.03;
/// Thickness over width up to which the points are one plane: up to here the planar solver misses no pose and the mirrored minimum, which it
/// returns by construction, exists in nearly every view. Evidence: docs/math/configuration.md, table 2.
pub(crate) const MAX_PLANE_THICKNESS: f64 = 0.05;
/// Points closer than this part of the extent are one place.
const MIN_DISTANCE: f64 = 1e-12;
/// Coordinates carry a relative rounding: below this multiple of their size a length is noise.
const ROUNDING: f64 = 8.0 * f64::EPSILON;
/// From so many places on, it matters no more how many there are.
const MANY_PLACES: usize = 5;
/// Fewer different pixels than this determine no pose, whatever the target.
const MIN_PIXELS: usize = 3;

/// Which configuration the points are in, from their places in the target.
///
/// # Errors
/// As `describe_geometry`.
pub fn classify(points: &[Correspondence]) -> Result<Configuration, Error> {
    Ok(describe_geometry(points)?.configuration)
}

/// Which configuration the points are in, from their places in the target, and the measures that decided it.
///
/// A place may be seen several times: each pixel is an observation of its own, and the layout is that of the different places.
///
/// # Errors
/// `TooFewPoints` (different places), `NotFinite`, `NotPositive` (sigma), `Coincident` (all pixels, to the last bit, at two places of the
/// image or one), `Collinear`.
pub fn describe_geometry(points: &[Correspondence]) -> Result<Geometry, Error> {
    check_numbers(points)?;
    if points.len() < 3 {
        return Err(Error::TooFewPoints { seen: points.len(), needed: 3 });
    }
    let places = Places::new(points);
    let different = places.different();
    if different.len() < 3 {
        return Err(Error::TooFewPoints { seen: different.len(), needed: 3 });
    }
    check_pixels(points)?;
    if different.len() == points.len() || different.is_full() {
        return places.layout();
    }
    let once: ArrayVec<Correspondence, MANY_PLACES> = different.iter().map(|i| points[*i]).collect();
    let geometry = Places::new(&once).layout()?;
    let configuration = match geometry.configuration {
        Configuration::LinePlusOne { order } => {
            Configuration::LinePlusOne { order: order.map(|i| different[i]) }
        }
        other => other,
    };
    Ok(Geometry { configuration, ..geometry })
}

/// Whether four places were seen, some of them perhaps more than once.
pub(crate) fn are_four_places(points: &[Correspondence]) -> bool {
    points.len() == 4 || 4 < points.len() && Places::new(points).different().len() == 4
}

/// `Coincident` where there are only one or two different pixels, with the first two points at one. Otherwise two points may well lie on
/// one line of sight; if a label slipped, the residual says so.
fn check_pixels(points: &[Correspondence]) -> Result<(), Error> {
    let mut different = ArrayVec::<usize, MIN_PIXELS>::new();
    let mut duplicates = None;
    for (second, point) in points.iter().enumerate() {
        match different.iter().find(|first| points[**first].pixel == point.pixel) {
            Some(first) => duplicates = duplicates.or(Some((*first, second))),
            None => different.push(second),
        }
        if different.is_full() {
            return Ok(());
        }
    }
    let (first, second) = duplicates.unwrap_or((0, 0));
    Err(Error::Coincident { first, second, where_: "in the image" })
}

/// Errors: `NotFinite`, `NotPositive` (sigma), with the index of the point.
pub(crate) fn check_numbers(points: &[Correspondence]) -> Result<(), Error> {
    for (index, c) in points.iter().enumerate() {
        let finite = |what, ok: bool| if ok { Ok(()) } else { Err(Error::NotFinite { what, index }) };
        finite("the position", c.x_in_target.iter().all(|x| x.is_finite()))?;
        finite("the pixel", c.pixel.iter().all(|x| x.is_finite()))?;
        finite("the bearing", c.bearing.iter().all(|x| x.is_finite()))?;
        finite("sigma_px", c.sigma_px.is_finite())?;
        finite("sigma_m", c.sigma_m.is_finite())?;
        if !(0.0 < c.sigma_px) {
            return Err(Error::NotPositive { index, seen: c.sigma_px });
        }
        if let Some(covariance) = c.covariance_px2 {
            let [uu, uv, vv] = c.pixel_covariance();
            finite("the pixel covariance", (uu + uv + vv).is_finite())?;
            let least = covariance.least_variance_px2();
            if !(0.0 < least && 0.0 < uu) {
                return Err(Error::CovarianceNotPositive { index, seen: least });
            }
        }
        if c.sigma_m < 0.0 {
            return Err(Error::NotPositive { index, seen: c.sigma_m });
        }
    }
    Ok(())
}

/// The two ends of a line, by index.
type Ends = (usize, usize);

/// The target points, and what is measured on them.
struct Places<'a> {
    points: &'a [Correspondence],
    /// Largest coordinate times the rounding of a coordinate.
    rounding: f64,
    /// Two points far apart, at least half of the largest distance there is.
    ends: Ends,
    /// Their distance.
    length: f64,
}

impl<'a> Places<'a> {
    fn new(points: &'a [Correspondence]) -> Self {
        let rounding = ROUNDING * points.iter().map(|c| c.x_in_target.amax()).fold(0.0, f64::max);
        let places = Places { points, rounding, ends: (0, 0), length: 0.0 };
        let (first, last, length) = places.longest();
        Places { ends: (first, last), length, ..places }
    }

    /// The first point at each place, until there are many.
    fn different(&self) -> ArrayVec<usize, MANY_PLACES> {
        let mut different = ArrayVec::new();
        for point in 0..self.points.len() {
            if different.iter().all(|known| !self.are_one(*known, point)) {
                different.push(point);
            }
            if different.is_full() {
                break;
            }
        }
        different
    }

    /// Whether two points are one place.
    fn are_one(&self, a: usize, b: usize) -> bool {
        let least = (MIN_DISTANCE * self.length).max(self.rounding);
        !(least * least < (self.at(a) - self.at(b)).norm_squared())
    }

    /// What three or more different places are.
    fn layout(&self) -> Result<Geometry, Error> {
        let ((first, last), length) = (self.ends, self.length);
        let (widest, width) = self.farthest_from_line(first, last);
        let needed = MIN_WIDTH.max(self.rounding / length);
        if !(needed * length < width) {
            return Err(Error::Collinear { ratio: width / length, needed });
        }
        let geometry = Geometry {
            configuration: Configuration::Three,
            length_m: length,
            width: Measure { ratio: width / length, threshold: needed },
            line_height: None,
            thickness: None,
        };
        let is_three = self.points.len() == 3;
        Ok(if is_three { geometry } else { self.beyond_three([first, last, widest], width, geometry) })
    }

    fn at(&self, index: usize) -> Point {
        self.points[index].x_in_target
    }

    /// Index and value of the largest measure.
    fn largest(&self, measure: impl Fn(&Point) -> f64) -> (usize, f64) {
        let values = self.points.iter().map(|c| measure(&c.x_in_target)).enumerate();
        values.fold((0, -1.0), |best, next| if best.1 < next.1 { next } else { best })
    }

    /// Two points far apart, at least half of the largest distance there is, and their distance.
    fn longest(&self) -> (usize, usize, f64) {
        let origin = self.at(0);
        let (first, _) = self.largest(|x| (x - origin).norm_squared());
        let origin = self.at(first);
        let (last, squared) = self.largest(|x| (x - origin).norm_squared());
        (first, last, squared.sqrt())
    }

    /// The point farthest from the line through two, and its distance.
    fn farthest_from_line(&self, first: usize, last: usize) -> (usize, f64) {
        let line = Line::new(self.at(first), self.at(last));
        let (index, squared) = self.largest(|x| line.scaled_distance_squared(x));
        (index, (squared / line.along.norm_squared()).sqrt())
    }

    /// What four or more points are: a line and one point off it, a plane, or neither.
    fn beyond_three(&self, corners: [usize; 3], width: f64, three: Geometry) -> Geometry {
        let (height, single) = self.single_point_off_a_side(corners, three.length_m);
        let line_height = Some(Measure { ratio: height, threshold: MAX_LINE_HEIGHT });
        if let Some((ends, off)) = single {
            let configuration = match self.points.len() {
                4 => Configuration::LinePlusOne { order: along_line(ends, off) },
                _ => Configuration::General,
            };
            return Geometry { configuration, line_height, ..three };
        }
        let thickness = Measure { ratio: self.thickness(corners) / width, threshold: MAX_PLANE_THICKNESS };
        let flat = thickness.ratio <= thickness.threshold;
        let configuration = if flat { Configuration::Planar } else { Configuration::General };
        Geometry { configuration, line_height, thickness: Some(thickness), ..three }
    }

    /// How straight the straightest side of the widest triangle is with all points but one on it, and the only point off it,
    /// if the others count as on its line, after the ends of that line.
    ///
    /// Of any three points two are on such a line, so it is a side of every triangle; the most nearly straight side counts.
    fn single_point_off_a_side(&self, [a, b, c]: [usize; 3], length: f64) -> (f64, Option<(Ends, usize)>) {
        let off_side = |first: usize, last: usize, off: usize| {
            let line = Line::new(self.at(first), self.at(last));
            let (mut height, mut low, mut high) = (0.0f64, 0.0f64, 0.0f64);
            for i in (0..self.points.len()).filter(|i| !self.are_one(*i, off)) {
                let from_origin = self.at(i) - line.origin;
                let along = from_origin.dot(&line.along);
                (low, high) = (low.min(along), high.max(along));
                height = height.max(line.scaled_distance_squared(&self.at(i)));
            }
            (height.sqrt() / (high - low), off)
        };
        let sides = [off_side(a, b, c), off_side(b, c, a), off_side(a, c, b)];
        let (height, off) =
            sides.into_iter().fold((f64::INFINITY, 0), |best, s| if s.0 < best.0 { s } else { best });
        if MAX_LINE_HEIGHT < height {
            return (height, None);
        }
        // A point closer to the line than its own straightness is not "off" it.
        let (p, q) = self.ends_without(off);
        let line = Line::new(self.at(p), self.at(q));
        let distance =
            (line.scaled_distance_squared(&self.at(off)) / line.along.norm_squared()).sqrt() / length;
        (height, (3.0 * height <= distance).then_some(((p, q), off)))
    }

    /// Two distant points of the others.
    fn ends_without(&self, off: usize) -> (usize, usize) {
        let others = || (0..self.points.len()).filter(|i| !self.are_one(*i, off));
        let origin = self.at(others().next().unwrap_or(0));
        let apart = |origin: Point| {
            let values = others().map(|i| (i, (self.at(i) - origin).norm_squared()));
            values.fold((0, -1.0), |best, next| if best.1 < next.1 { next } else { best }).0
        };
        let first = apart(origin);
        (first, apart(self.at(first)))
    }

    /// Largest distance from the plane of three points.
    fn thickness(&self, [a, b, c]: [usize; 3]) -> f64 {
        let origin = self.at(a);
        let normal = (self.at(b) - origin).normalize().cross(&(self.at(c) - origin)).normalize();
        self.largest(|x| normal.dot(&(x - origin)).abs()).1
    }
}

/// The three points on the line in order, starting from the lower-numbered end, then the one off it. Four points.
fn along_line((p, q): Ends, off: usize) -> [usize; 4] {
    [p.min(q), 6 - off - p - q, p.max(q), off]
}

/// A line through two points; `along` has their distance for length, so that no division is needed to compare.
struct Line {
    origin: Point,
    along: Vector3<f64>,
}

impl Line {
    fn new(origin: Point, other: Point) -> Self {
        Line { origin, along: other - origin }
    }

    /// Distance from the line times the length of `along`, squared.
    fn scaled_distance_squared(&self, x: &Point) -> f64 {
        self.along.cross(&(x - self.origin)).norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;

    fn seen(places: &[[f64; 3]]) -> Vec<Correspondence> {
        let camera = Camera::normalized();
        let point = |(i, x): (usize, &[f64; 3])| {
            let pixel = crate::Pixel::new(0.1 * i as f64, 0.05 * (i * i) as f64);
            Correspondence::new(&camera, Point::from(*x), pixel, 1.0).ok()
        };
        places.iter().enumerate().filter_map(point).collect()
    }

    fn moved(places: &[[f64; 3]], scale: f64, offset: f64) -> Vec<Correspondence> {
        let r = *nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0).matrix();
        let places: Vec<[f64; 3]> = places
            .iter()
            .map(|x| (r * Point::from(*x) * scale + Point::new(offset, -offset, 0.3 * offset)).into())
            .collect();
        seen(&places)
    }

    const LINE_PLUS_ONE: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.1, 0.7, 0.0], [0.0, 0.0, 0.0], [0.4, 0.0, 0.0]];
    const SQUARE: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    const TETRAHEDRON: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

    #[test]
    fn layouts_are_recognised_at_every_scale_and_place() {
        for (scale, offset) in [(1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, 5e6), (1e9, 1e12), (1e-9, 1e-3)] {
            let line_plus_one = classify(&moved(&LINE_PLUS_ONE, scale, offset));
            assert_eq!(
                line_plus_one,
                Ok(Configuration::LinePlusOne { order: [0, 3, 2, 1] }),
                "{scale} {offset}"
            );
            assert_eq!(classify(&moved(&SQUARE, scale, offset)), Ok(Configuration::Planar));
            assert_eq!(classify(&moved(&TETRAHEDRON, scale, offset)), Ok(Configuration::General));
            assert_eq!(classify(&moved(&SQUARE[..3], scale, offset)), Ok(Configuration::Three));
        }
    }

    #[test]
    fn points_on_a_line_are_refused_at_every_scale_and_place() {
        for (scale, offset) in [(1.0, 0.0), (1e-9, 0.0), (1e9, 0.0), (1.0, 5e6), (1.0, 1.0)] {
            for n in [3, 4, 8] {
                let places: Vec<[f64; 3]> = (0..n).map(|i| [0.1 * (i * i + 1) as f64, 0.0, 0.0]).collect();
                let answer = classify(&moved(&places, scale, offset));
                assert!(matches!(answer, Err(Error::Collinear { .. })), "{answer:?} {scale} {offset} {n}");
            }
        }
    }

    /// The layout is that of the different places, however often and in whatever order each is seen.
    #[test]
    fn places_seen_again_do_not_change_the_layout() {
        let again = |places: &[[f64; 3]], order: &[usize]| {
            let places: Vec<[f64; 3]> = order.iter().map(|i| places[*i]).collect();
            classify(&moved(&places, 1.0, 0.0))
        };
        let square = Ok(Configuration::Planar);
        assert_eq!(again(&SQUARE, &[0, 1, 2, 3, 1]), square);
        assert_eq!(again(&SQUARE, &[0, 0, 1, 1, 2, 2, 3, 3]), square);
        assert_eq!(again(&SQUARE, &[0, 1, 2, 0, 1, 2, 2]), Ok(Configuration::Three));
        assert_eq!(again(&TETRAHEDRON, &[3, 3, 2, 1, 0]), Ok(Configuration::General));
        let order = |order| Ok(Configuration::LinePlusOne { order });
        assert_eq!(again(&LINE_PLUS_ONE, &[1, 1, 0, 2, 3, 3, 1]), order([2, 4, 3, 0]));
        assert_eq!(again(&LINE_PLUS_ONE, &[0, 1, 2, 3, 0, 0]), order([0, 3, 2, 1]));
        // Four on a line and one off it, seen twice, leave a homography open.
        let mut five = LINE_PLUS_ONE.to_vec();
        five.push([0.7, 0.0, 0.0]);
        assert_eq!(again(&five, &[0, 1, 2, 3, 4, 1]), Ok(Configuration::General));
    }

    #[test]
    fn too_few_places_or_pixels_are_named() {
        let two = [[0.3, 0.2, 0.1], [0.3, 0.2, 0.1], [0.5, 0.2, 0.1], [0.5, 0.2, 0.1]];
        assert_eq!(classify(&seen(&two)), Err(Error::TooFewPoints { seen: 2, needed: 3 }));
        assert_eq!(classify(&seen(&[two[0]; 40])), Err(Error::TooFewPoints { seen: 1, needed: 3 }));
        let mut points = moved(&SQUARE, 1.0, 0.0);
        points[3].pixel = points[1].pixel;
        assert_eq!(classify(&points), Ok(Configuration::Planar));
        points[2].pixel = points[0].pixel;
        let expected = Err(Error::Coincident { first: 0, second: 2, where_: "in the image" });
        assert_eq!(classify(&points), expected);
    }

    #[test]
    fn numbers_that_are_none_are_named() {
        let bad = |change: fn(&mut Correspondence)| {
            let mut points = moved(&SQUARE, 1.0, 0.0);
            change(&mut points[2]);
            classify(&points)
        };
        let not_finite = |what| Err(Error::NotFinite { what, index: 2 });
        assert_eq!(bad(|c| c.x_in_target.y = f64::NAN), not_finite("the position"));
        assert_eq!(bad(|c| c.pixel.x = f64::INFINITY), not_finite("the pixel"));
        assert_eq!(bad(|c| c.sigma_px = f64::NAN), not_finite("sigma_px"));
        assert_eq!(bad(|c| c.sigma_m = f64::NAN), not_finite("sigma_m"));
        assert_eq!(bad(|c| c.sigma_px = 0.0), Err(Error::NotPositive { index: 2, seen: 0.0 }));
        assert_eq!(bad(|c| c.sigma_m = -1.0), Err(Error::NotPositive { index: 2, seen: -1.0 }));
        assert_eq!(classify(&seen(&SQUARE[..2])), Err(Error::TooFewPoints { seen: 2, needed: 3 }));
        assert_eq!(classify(&[]), Err(Error::TooFewPoints { seen: 0, needed: 3 }));
    }

    /// A surveyed line is never exactly straight; a quadrilateral is never quite a line.
    #[test]
    fn a_nearly_straight_triple_counts_as_a_line_until_it_bends() {
        let bent = |height: f64| {
            let mut places = LINE_PLUS_ONE;
            places[3][1] = height;
            classify(&moved(&places, 1.0, 0.0))
        };
        let line = Ok(Configuration::LinePlusOne { order: [0, 3, 2, 1] });
        for height in [1e-15, -1e-6, 1e-3, 0.029] {
            assert_eq!(bent(height), line, "{height}");
        }
        assert_eq!(bent(0.031), Ok(Configuration::Planar));
        assert_eq!(bent(-0.2), Ok(Configuration::Planar));
    }

    #[test]
    fn all_but_one_on_a_line_do_not_pass_for_a_plane() {
        let mut places = LINE_PLUS_ONE.to_vec();
        places.push([0.7, 0.0, 0.0]);
        assert_eq!(classify(&moved(&places, 1.0, 0.0)), Ok(Configuration::General));
        places.push([0.7, 0.5, 0.0]);
        assert_eq!(classify(&moved(&places, 1.0, 0.0)), Ok(Configuration::Planar));
    }

    #[test]
    fn every_order_of_a_line_plus_one_is_recognised() {
        for code in 0..256usize {
            let p = [code & 3, (code >> 2) & 3, (code >> 4) & 3, (code >> 6) & 3];
            if (0..4).any(|i| !p.contains(&i)) {
                continue;
            }
            let places = p.map(|i| LINE_PLUS_ONE[i]);
            let Ok(Configuration::LinePlusOne { order }) = classify(&moved(&places, 1.0, 0.0)) else {
                panic!("{p:?}")
            };
            let named = order.map(|i| p[i]);
            assert!(named == [0, 3, 2, 1] || named == [2, 3, 0, 1], "{named:?}");
            assert!(order[0] < order[2]);
        }
    }
}
