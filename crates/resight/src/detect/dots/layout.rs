//! The geometry of three dots on a line and one off it: the relations between their positions and shapes.
//!
//! Notation (docs/math/dots.md): the target is scaled so that the line runs from (0, 0) through (r, 0) to (1, 0) and the
//! fourth dot is (e, g). H = [h₁ h₂ h₃] maps (x, y, 1) to the plane z = 1; p₀, p₁, p₂, d are the dots' images there.
//!   k depth of the line's end over that of its start, eq. (8)   ·   λ depth of the fourth dot, eq. (9)
//!   J derivative of the image by the target, eq. (10)   ·   M second moments of a dot's image, eq. (11)
//!   q = ρ²/4 of the disc, s² second moment of the blur

use super::centroid::Dot;
use super::view::View;
use crate::minimum::golden_section;
use nalgebra::{Matrix2, Matrix3, Vector2};
use resight_core::target::LinePlusOne;
use resight_core::{Pixel, Point};

/// Error of an image moment that the model does not explain (printing, defocus, overexposure), as a part of the moment.
const SHAPE_TOLERANCE: f64 = 0.04;
/// The same error in px², for dots of a pixel or two.
const SHAPE_TOLERANCE_PX2: f64 = 0.2;
/// Range of the search for ln λ, to either side of the depth of the line below the fourth dot.
pub(super) const LN_DEPTH_RANGE: f64 = 0.7;
/// Standard deviation of ln k and ln λ expected a priori: dots at depths differing by a factor 1.5 are common.
const LN_DEPTH_SIGMA: f64 = 0.4;

/// The target, scaled to a line of length 1.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// Ids of the dots: start of the line, middle, end, fourth.
    pub ids: [u32; 4],
    /// Abscissa of the middle dot.
    pub r: f64,
    /// The fourth dot.
    pub off: [f64; 2],
    /// Diameter of the dots over the length of the line, if known.
    pub diameter: Option<f64>,
}

impl Layout {
    pub fn new(target: &LinePlusOne, diameter_m: Option<f64>) -> Layout {
        let mut ids = [0usize, 1, 2];
        ids.sort_by(|a, b| target.line_m[*a].total_cmp(&target.line_m[*b]));
        let [a, b, c] = ids.map(|i| target.line_m[i]);
        let length = c - a;
        Layout {
            ids: [ids[0] as u32, ids[1] as u32, ids[2] as u32, 3],
            r: (b - a) / length,
            off: [(target.off_m[0] - a) / length, target.off_m[1] / length],
            diameter: diameter_m.map(|d| d / length),
        }
    }

    /// Returns the positions of the four dots.
    pub fn points(&self) -> [[f64; 2]; 4] {
        [[0.0, 0.0], [self.r, 0.0], [1.0, 0.0], self.off]
    }
}

/// A dot with the quantities that the geometry needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct ViewDot {
    pub dot: Dot,
    /// Its position on the plane z = 1.
    pub y: Vector2<f64>,
    /// ∂pixel/∂y.
    pub pixel_by_view: Matrix2<f64>,
    /// √|det ∂pixel/∂y|.
    pub scale_px: f64,
    /// Geometric mean of its semi-axes.
    pub radius_px: f64,
}

impl ViewDot {
    pub fn new(dot: Dot, view: &View) -> Option<ViewDot> {
        let y = view.ray(&dot.centroid)?;
        let pixel_by_view = view.pixel_by_view(&y)?;
        let scale_px = pixel_by_view.determinant().abs().sqrt();
        let radius_px = 2.0 * dot.moments_px2.determinant().max(0.0).powf(0.25);
        (0.0 < scale_px && scale_px.is_finite()).then_some(ViewDot {
            dot,
            y,
            pixel_by_view,
            scale_px,
            radius_px,
        })
    }

    /// Returns the largest expected distance between its centroid and the image of its centre: noise, lens, and a part of the shift by
    /// perspective.
    pub fn position_sigma_px(&self) -> f64 {
        (self.dot.sigma_px.powi(2) + 0.1f64.powi(2) + (0.01 * self.radius_px).powi(2)).sqrt()
    }

    /// Returns the standard deviation of each entry of its moments, model error included.
    fn shape_sigma_px2(&self) -> f64 {
        let model = SHAPE_TOLERANCE * 0.5 * self.dot.moments_px2.trace();
        (model.powi(2) + SHAPE_TOLERANCE_PX2.powi(2) + self.dot.moments_sigma_px2.powi(2)).sqrt()
    }
}

/// Computes k from the position t of the middle dot between the ends (0…1), eq. (8).
pub(super) fn end_depth(r: f64, t: f64) -> f64 {
    (1.0 - r) / r * t / (1.0 - t)
}

/// Returns the columns of the homography that belong to the line, h₁ and h₃.
pub(super) fn line_columns(start: &Vector2<f64>, end: &Vector2<f64>, k: f64) -> (Point, Point) {
    let (p0, p2) = (start.push(1.0), end.push(1.0));
    (p2 * k - p0, p0)
}

/// The homography that explains positions and shapes best.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    pub view_from_target: Matrix3<f64>,
    /// ρ²/4, layout units.
    pub q: f64,
    /// χ² of the shapes: 12 moments less 3 unknowns.
    pub chi2: f64,
    /// Relative uncertainty of the shape of a dot's image: small when the dot is resolved, above 1 when only the blur is visible.
    pub resolution: f64,
    /// Moments of each dot's image according to the fit, px².
    pub moments_px2: [Matrix2<f64>; 4],
}

/// Largest ratio of the axes of J: for a disc rotated by 83°,
const MAX_ELONGATION: f64 = 8.0;
/// and by 78°. Beyond this ratio, a row of letters could pass for a target seen edge-on, unless its images are measured to be so elongated,
const CERTAIN_ELONGATION: f64 = 5.0;
/// with their shape known to this relative accuracy.
const ELONGATED_RESOLUTION: f64 = 0.3;

/// Finds λ (and ρ, blur) from the shapes; dots in the order of `Layout::ids`. `None` when no λ puts all four in front of the camera.
pub(super) fn fit_shapes(layout: &Layout, dots: &[ViewDot; 4], k: f64) -> Option<Fit> {
    let line = line_columns(&dots[0].y, &dots[2].y, k);
    let below = line.0.z * layout.off[0] + line.1.z;
    if !(0.05 < below) {
        return None;
    }
    let cost = |ln: f64| {
        let fit = shapes_at(layout, dots, &line, below * ln.exp());
        fit.map_or(f64::INFINITY, |f| f.chi2 + (ln / LN_DEPTH_SIGMA).powi(2))
    };
    const STEPS: i32 = 4;
    let h = LN_DEPTH_RANGE / STEPS as f64;
    let round = (-STEPS..=STEPS).map(|i| i as f64 * h);
    let nearest = round.map(|ln| (cost(ln), ln)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    // 0.618¹⁰ h: this determines λ to a thousandth, hundreds of times better than the shapes do.
    let dip = golden_section(nearest.1, h, 10, cost);
    let ln = if dip.0 < nearest.0 { dip.1 } else { nearest.1 };
    shapes_at(layout, dots, &line, below * ln.exp())
}

/// Tests quickly, before `fit_shapes`, whether the misfit can be below a limit, at the depth that follows from the areas (the area of a dot's
/// image is proportional to depth⁻³) or at the depth of the line.
pub(super) fn shapes_may_fit(layout: &Layout, dots: &[ViewDot; 4], k: f64, max_chi2: f64) -> bool {
    let line = line_columns(&dots[0].y, &dots[2].y, k);
    let below = line.0.z * layout.off[0] + line.1.z;
    let area = |i: usize| (dots[i].radius_px / dots[i].scale_px).powi(2);
    let by_area = (area(0) / area(3)).cbrt().clamp(0.5 * below, 2.0 * below);
    let fits = |lambda: f64| shapes_at(layout, dots, &line, lambda).is_some_and(|f| f.chi2 < max_chi2);
    0.05 < below && (fits(by_area) || fits(below))
}

/// Returns J of eq. (10) at a point of the target.
fn derivative(h: &Matrix3<f64>, x: &[f64; 2]) -> Option<Matrix2<f64>> {
    let p = h * Point::new(x[0], x[1], 1.0);
    if !(1e-6 < p.z) {
        return None;
    }
    let (u, v) = (p.x / p.z, p.y / p.z);
    let row = |i: usize, c: f64, j: usize| (h[(i, j)] - c * h[(2, j)]) / p.z;
    Some(Matrix2::new(row(0, u, 0), row(0, u, 1), row(1, v, 0), row(1, v, 1)))
}

fn shapes_at(layout: &Layout, dots: &[ViewDot; 4], line: &(Point, Point), lambda: f64) -> Option<Fit> {
    let d = dots[3].y.push(1.0);
    let h2 = (d * lambda - line.0 * layout.off[0] - line.1) / layout.off[1];
    let h = Matrix3::from_columns(&[line.0, h2, line.1]);
    let mut shapes = [Matrix2::zeros(); 4];
    // (a + 1/a) with a the ratio of the axes: trace over √det.
    let limit = |ratio: f64| ratio + 1.0 / ratio;
    let mut longest = 0.0f64;
    for (i, (shape, x)) in shapes.iter_mut().zip(layout.points()).enumerate() {
        let jacobian = dots[i].pixel_by_view * derivative(&h, &x)?;
        *shape = jacobian * jacobian.transpose();
        let elongation = shape.trace() / jacobian.determinant().abs();
        if !(elongation < limit(MAX_ELONGATION)) {
            return None;
        }
        longest = longest.max(elongation);
    }
    let (q, s2) = disc_and_blur(layout, dots, &shapes);
    let moments_px2 = shapes.map(|shape| shape * q + Matrix2::identity() * s2);
    let (mut chi2, mut resolution) = (0.0, f64::INFINITY);
    for (dot, (moment, shape)) in dots.iter().zip(moments_px2.iter().zip(&shapes)) {
        let sigma = dot.shape_sigma_px2();
        let off = dot.dot.moments_px2 - moment;
        chi2 += (off[(0, 0)].powi(2) + off[(0, 1)].powi(2) + off[(1, 1)].powi(2)) / (sigma * sigma);
        resolution = resolution.min(sigma / (0.5 * q * shape.trace()).max(1e-9));
    }
    let is_certain = longest < limit(CERTAIN_ELONGATION) || resolution < ELONGATED_RESOLUTION;
    is_certain.then_some(Fit { view_from_target: h, q, chi2, resolution, moments_px2 })
}

/// Solves M ≈ q J Jᵀ + s² 1, eq. (11), by least squares, with 0 ≤ q and 0 ≤ s².
fn disc_and_blur(layout: &Layout, dots: &[ViewDot; 4], shapes: &[Matrix2<f64>; 4]) -> (f64, f64) {
    let (mut aa, mut ab, mut bb, mut am, mut bm) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (dot, shape) in dots.iter().zip(shapes) {
        let w = dot.shape_sigma_px2().powi(-2);
        let m = &dot.dot.moments_px2;
        for (i, j) in [(0, 0), (0, 1), (1, 1)] {
            let (a, b) = (shape[(i, j)], if i == j { 1.0 } else { 0.0 });
            (aa, ab, bb) = (aa + w * a * a, ab + w * a * b, bb + w * b * b);
            (am, bm) = (am + w * a * m[(i, j)], bm + w * b * m[(i, j)]);
        }
    }
    if let Some(diameter) = layout.diameter {
        let q = diameter * diameter / 16.0;
        return (q, ((bm - q * ab) / bb).max(0.0));
    }
    let det = aa * bb - ab * ab;
    // For lamps seen frontally, disc and blur have the same effect; then everything is attributed to the disc, which changes nothing else.
    let (q, s2) = if 1e-9 * aa * bb < det {
        ((am * bb - bm * ab) / det, (bm * aa - am * ab) / det)
    } else {
        (am / aa, 0.0)
    };
    match (q < 0.0, s2 < 0.0) {
        (true, _) => (0.0, (bm / bb).max(0.0)),
        (_, true) => ((am / aa).max(0.0), 0.0),
        _ => (q, s2),
    }
}

/// Returns the shift of the centroid of each dot's image from the image of its centre, px: dots.md eqs. (12)–(14).
///
/// Uses the area centroid of the projected rim, so that it is valid for every lens.
pub(super) fn centroid_shifts(layout: &Layout, fit: &Fit, view: &View) -> Option<[Pixel; 4]> {
    let radius = 2.0 * fit.q.max(0.0).sqrt();
    let mut shifts = [Pixel::zeros(); 4];
    for (shift, x) in shifts.iter_mut().zip(layout.points()) {
        let place =
            |dx: f64, dy: f64| view.pixel(&(fit.view_from_target * Point::new(x[0] + dx, x[1] + dy, 1.0)));
        *shift = rim_centroid(radius, &place, place(0.0, 0.0)?)?;
    }
    Some(shifts)
}

/// Returns the area centroid, relative to `origin`, of the polygon through 48 points of the rim (its area is 0.3 % too small, its shift 0.6 %).
pub(in crate::detect) fn rim_centroid(
    radius: f64,
    place: &dyn Fn(f64, f64) -> Option<Pixel>,
    origin: Pixel,
) -> Option<Pixel> {
    const POINTS: usize = 48;
    let point = |i: usize| {
        let (sin, cos) = (i as f64 * std::f64::consts::TAU / POINTS as f64).sin_cos();
        place(radius * cos, radius * sin).map(|p| p - origin)
    };
    let (mut area, mut sum) = (0.0, Pixel::zeros());
    let mut from = point(0)?;
    for i in 1..=POINTS {
        let to = point(i % POINTS)?;
        let cross = from.perp(&to);
        area += cross;
        sum += (from + to) * cross;
        from = to;
    }
    // A point has no area and no shift.
    Some(if area.abs() < 1e-9 { Pixel::zeros() } else { sum / (3.0 * area) })
}

/// The distance of the fourth dot from the positions that are possible for a rigid target, dots.md eqs. (15)–(17).
pub(super) struct RigidCheck {
    /// Distance in the image, px.
    pub distance_px: f64,
    /// Squared distance over its variance.
    pub chi2: f64,
}

/// Checks rigidity: the line determines the target except for a rotation about it, so that the fourth dot must be on the image of a circle.
pub(super) fn rigid_check(layout: &Layout, dots: &[ViewDot; 4], view: &View) -> Option<RigidCheck> {
    let places = [dots[0].y, dots[1].y, dots[2].y];
    let circle = Circle::of(layout, &places)?;
    let seen = dots[3].dot.centroid;
    let angle = circle.nearest_angle(&seen, view)?;
    let at = circle.at(angle, view)?;
    let mut covariance = Matrix2::identity() * dots[3].position_sigma_px().powi(2);
    for (i, dot) in dots[..3].iter().enumerate() {
        let step = dot.position_sigma_px() / dot.scale_px;
        for axis in 0..2 {
            let mut moved = places;
            moved[i][axis] += step;
            let change = Circle::of(layout, &moved)?.at(angle, view)? - at;
            covariance += change * change.transpose();
        }
    }
    let off = seen - at;
    let chi2 = off.dot(&(covariance.try_inverse()? * off));
    Some(RigidCheck { distance_px: off.norm(), chi2 })
}

/// The possible positions of the fourth dot, camera frame up to scale.
struct Circle {
    centre: Point,
    first: Point,
    second: Point,
}

impl Circle {
    fn of(layout: &Layout, [start, middle, end]: &[Vector2<f64>; 3]) -> Option<Circle> {
        let along = end - start;
        let t = (middle - start).dot(&along) / along.norm_squared();
        if !(0.0 < t && t < 1.0) {
            return None;
        }
        let (h1, h3) = line_columns(start, end, end_depth(layout.r, t));
        let radius = layout.off[1].abs() * h1.norm();
        // The coordinate axis along which the line has its smallest component, which is stable for small changes of the line.
        let least = h1.iamin();
        let across = h1.cross(&Point::ith(least, 1.0)).try_normalize(1e-12)?;
        let second = h1.cross(&across).try_normalize(1e-12)?;
        Some(Circle { centre: h1 * layout.off[0] + h3, first: across * radius, second: second * radius })
    }

    /// Returns the angle whose image is nearest to a pixel. A ray can pass near two positions of the circle, so that every minimum of a coarse
    /// search is refined.
    fn nearest_angle(&self, seen: &Pixel, view: &View) -> Option<f64> {
        const STEPS: usize = 24;
        let step = std::f64::consts::TAU / STEPS as f64;
        let distance = |angle: f64| self.at(angle, view).map_or(f64::INFINITY, |p| (p - seen).norm_squared());
        let round: [f64; STEPS] = std::array::from_fn(|i| distance(i as f64 * step));
        let mut best = (f64::INFINITY, 0.0);
        for i in 0..STEPS {
            let beside = round[(i + 1) % STEPS].min(round[(i + STEPS - 1) % STEPS]);
            if round[i] <= beside && round[i].is_finite() {
                // 0.618²⁰ of a twelfth of a rotation is a hundred-thousandth of the radius.
                let dip = golden_section(i as f64 * step, step, 20, distance);
                best = if dip.0 < best.0 { dip } else { best };
            }
        }
        best.0.is_finite().then_some(best.1)
    }

    fn at(&self, angle: f64, view: &View) -> Option<Pixel> {
        let (sin, cos) = angle.sin_cos();
        view.pixel(&(self.centre + self.first * cos + self.second * sin))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::Pcg;

    /// The area centroid of the rim is the ellipse's centre, dots.md eq. (13), to within the 0.6 % by which 48 points are too few.
    #[test]
    fn shift_is_that_of_the_closed_form() {
        let layout = Layout { ids: [0, 1, 2, 3], r: 0.5, off: [0.1, 0.6], diameter: None };
        let view = View::Nominal { centre: Pixel::zeros(), scale_px: 1.0 };
        let mut pcg = Pcg::new(6);
        for _ in 0..50 {
            let mut h = Matrix3::from_fn(|_, _| pcg.between(-0.3, 0.3));
            (h[(0, 0)], h[(1, 1)], h[(2, 2)]) = (900.0, 800.0, 1.5);
            let rho = 0.2;
            let fit = Fit {
                view_from_target: h,
                q: rho * rho / 4.0,
                chi2: 0.0,
                resolution: 0.1,
                moments_px2: [Matrix2::zeros(); 4],
            };
            let shift = centroid_shifts(&layout, &fit, &view).unwrap()[0];
            let j = derivative(&h, &[0.0, 0.0]).unwrap() * h[(2, 2)];
            let (a, b) = (j.column(0), j.column(1));
            let slope2 = h[(2, 0)].powi(2) + h[(2, 1)].powi(2);
            let denominator = h[(2, 2)].powi(2) - rho * rho * slope2;
            let closed: Pixel = (a * h[(2, 0)] + b * h[(2, 1)]) * (-rho * rho / denominator);
            assert!((shift - closed).norm() < 0.01 * closed.norm() + 1e-9, "{shift} {closed}");
        }
    }
}
