//! The image of a circle's centre, from the centroid of the circle's image.
//!
//! Notation: F the map from the grid to the image, ρ the radius of the circles in units of the spacing, M the second moments of an image;
//! docs/math/circle_grid.md eqs. (2)–(5).

use super::place::Numbered;
use crate::detect::dots::{Dot, rim_centroid};
use crate::detect::homography::{Homography, PlanePoint};
use crate::detect::sigma;
use nalgebra::{Matrix6, Matrix6x2, RowVector2, Vector2, Vector6};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::{CircleGrid, Feature};

/// Number of nearest circles from which the bend of the map is estimated.
const NEAREST: usize = 12;
/// Error of a centroid that is not noise (pixel response, print), px, as of other dots.
const FLOOR_PX: f64 = 0.01;
/// Largest number of circles that are removed as partly covered.
const MOST_COVERED: usize = 20;
/// A circle is this many standard deviations from its prediction, and this share of the spacing, if it is not covered.
const MOST_SIGMAS: f64 = 6.0;
const MOST_BEND: f64 = 0.01;
/// What is left of the shift after the correction, as a share of it.
const LEFT_OF_SHIFT: f64 = 0.05;

/// Returns the centre of each circle, by ascending ids.
pub(super) fn centres(grid: &CircleGrid, dots: &[Dot], numbered: &Numbered) -> Vec<Detection> {
    let mut circles: Vec<Circle> =
        numbered.iter().map(|(id, dot)| Circle::new(grid, *id, &dots[*dot])).collect();
    circles.sort_by_key(|circle| circle.id);
    remove_covered(&mut circles);
    // The map is first fitted to the shifted centres; the second time it is that of the centres.
    for _ in 0..2 {
        let Some(map) = Map::fit(&circles) else { break };
        let Some(radius) = radius(&map, &circles) else { break };
        let shifts: Vec<Pixel> = circles.iter().map(|c| map.shift(c, radius).unwrap_or_default()).collect();
        circles.iter_mut().zip(shifts).for_each(|(circle, shift)| circle.shift = shift);
    }
    circles.iter().map(Circle::detection).collect()
}

/// Removes circles that are not where their neighbours predict them: part of each is covered, or something else was found. The worst is removed
/// first, because it disturbs the predictions of its neighbours.
fn remove_covered(circles: &mut Vec<Circle>) {
    for _ in 0..MOST_COVERED {
        let Some(map) = Map::fit(circles) else { return };
        let worst =
            (0..circles.len()).map(|i| (map.oddity(&circles[i]), i)).max_by(|a, b| a.0.total_cmp(&b.0));
        match worst {
            Some((oddity, i)) if 1.0 < oddity => circles.remove(i),
            _ => return,
        };
    }
}

/// A circle of the grid, and its image.
struct Circle<'a> {
    id: u32,
    /// Its centre, in units of the spacing.
    place: PlanePoint,
    dot: &'a Dot,
    /// Centroid of its image minus image of its centre.
    shift: Pixel,
}

impl<'a> Circle<'a> {
    fn new(grid: &CircleGrid, id: u32, dot: &'a Dot) -> Self {
        let (x, y) = grid.node(id);
        Circle { id, place: PlanePoint::new(f64::from(x), f64::from(y)), dot, shift: Pixel::zeros() }
    }

    fn centre(&self) -> Pixel {
        self.dot.centroid - self.shift
    }

    fn detection(&self) -> Detection {
        let variance =
            self.dot.sigma_px.powi(2) + FLOOR_PX.powi(2) + (LEFT_OF_SHIFT * self.shift.norm()).powi(2);
        Detection {
            feature: Feature { id: self.id, corner: 0 },
            pixel: self.centre(),
            sigma_px: variance.sqrt(),
            lens_sigma_px: sigma::LENS_PX,
            covariance_px2: None,
        }
    }
}

/// The map from the grid to the image: a homography, and what lens and bends add to it near each circle.
struct Map<'a> {
    plane: Homography,
    /// Median standard deviation of the centroids.
    noise_px: f64,
    circles: &'a [Circle<'a>],
}

/// The map near a circle, eq. (3).
struct LocalMap<'a> {
    plane: &'a Homography,
    place: PlanePoint,
    /// Coefficients of 1, x, y, x², x y, y² from the circle's centre.
    bend: Matrix6x2<f64>,
    /// Variance of its value at the circle's centre over that of a circle: less than 1 amid circles, several at a corner.
    leverage: f64,
}

impl<'a> Map<'a> {
    fn fit(circles: &'a [Circle<'a>]) -> Option<Self> {
        let pairs: Vec<(PlanePoint, Pixel)> = circles.iter().map(|c| (c.place, c.centre())).collect();
        let noise_px = median(circles.iter().map(|c| c.dot.sigma_px).collect())?;
        Some(Map { plane: Homography::fit(&pairs)?, noise_px, circles })
    }

    /// Returns the map near a circle by its nearest neighbours, with or without itself.
    fn near(&self, circle: &Circle, with_itself: bool) -> LocalMap<'_> {
        let others = self.circles.iter().filter(|c| with_itself || c.id != circle.id);
        let off = |c: &Circle| (c.place - circle.place).norm_squared();
        let mut near: Vec<&Circle> = others.collect();
        if NEAREST < near.len() {
            near.select_nth_unstable_by(NEAREST, |a, b| off(a).total_cmp(&off(b)).then(a.id.cmp(&b.id)));
            near.truncate(NEAREST);
        }
        let (mut normal, mut right) = (Matrix6::zeros(), Matrix6x2::zeros());
        for c in near {
            let row = powers(&(c.place - circle.place));
            let off = c.centre() - self.plane.at(&c.place);
            normal += row * row.transpose();
            right += row * RowVector2::new(off.x, off.y);
        }
        let (bend, leverage) = match normal.cholesky() {
            Some(factor) => (factor.solve(&right), factor.inverse()[(0, 0)]),
            None => (Matrix6x2::zeros(), 1.0),
        };
        LocalMap { plane: &self.plane, place: circle.place, bend, leverage }
    }

    /// Returns how far a circle is from where its neighbours predict it, over what noise and the bend of the map explain.
    fn oddity(&self, circle: &Circle) -> f64 {
        let map = self.near(circle, false);
        let off_px = (circle.centre() - map.at(&Vector2::zeros())).norm();
        let bend_px = MOST_BEND * map.scale_px2().abs().sqrt();
        off_px / ((MOST_SIGMAS * self.noise_px.hypot(FLOOR_PX) + bend_px) * (1.0 + map.leverage).sqrt())
    }

    /// Returns eq. (5).
    fn shift(&self, circle: &Circle, radius: f64) -> Option<Pixel> {
        let map = self.near(circle, true);
        let place = |x: f64, y: f64| Some(map.at(&Vector2::new(x, y)));
        rim_centroid(radius, &place, map.at(&Vector2::zeros()))
    }
}

fn powers(x: &Vector2<f64>) -> Vector6<f64> {
    Vector6::new(1.0, x.x, x.y, x.x * x.x, x.x * x.y, x.y * x.y)
}

impl LocalMap<'_> {
    /// Returns the image of a point given from the circle's centre.
    fn at(&self, x: &Vector2<f64>) -> Pixel {
        self.plane.at(&(self.place + x)) + self.bend.transpose() * powers(x)
    }

    /// Returns the determinant of its derivative at the circle's centre, px² for a square of the spacing.
    fn scale_px2(&self) -> f64 {
        /// Differences over so little of the spacing that the map is straight there.
        const STEP: f64 = 1e-3;
        let derivative = |x: Vector2<f64>| (self.at(&x) - self.at(&-x)) / (2.0 * STEP);
        derivative(Vector2::new(STEP, 0.0)).perp(&derivative(Vector2::new(0.0, STEP)))
    }
}

/// Returns the radius of the circles in units of the spacing, the median of eq. (4).
fn radius(map: &Map, circles: &[Circle]) -> Option<f64> {
    let of = |c: &Circle| {
        let square =
            4.0 * c.dot.moments_px2.determinant().max(0.0).sqrt() / map.near(c, true).scale_px2().abs();
        square.is_finite().then(|| square.sqrt())
    };
    median(circles.iter().filter_map(of).collect())
}

fn median(mut all: Vec<f64>) -> Option<f64> {
    let half = all.len() / 2;
    (!all.is_empty()).then(|| *all.select_nth_unstable_by(half, f64::total_cmp).1)
}
