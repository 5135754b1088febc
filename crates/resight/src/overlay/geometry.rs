//! The elements of an overlay, as curves in the target frame and in the image: outlines, grid, axes, ellipses.

use super::canvas::Path;
use crate::core::target::Feature;
use crate::core::{Camera, Matrix6, Pixel, Point, Pose, Target};
use nalgebra::{Matrix2, Matrix2x3, Vector2};

/// Number of steps along a curve in space, so that it is drawn with the lens's distortion.
const STEPS: usize = 48;
/// Number of bisections for the point where a curve leaves the lens's valid field.
const HALVINGS: usize = 14;

/// Projects the straight segment from `a` to `b` (target frame): returns the parts in the lens's valid field, pixels.
pub fn project_segment(camera: &Camera, cam_from_target: &Pose, a: &Point, b: &Point) -> Vec<Path> {
    let at = |t: f64| camera.project(&(cam_from_target * &(a + (b - a) * t)));
    let mut parts: Vec<Path> = Vec::new();
    let mut part = Path::new();
    let mut before: Option<(f64, Option<Pixel>)> = None;
    for i in 0..=STEPS {
        let t = i as f64 / STEPS as f64;
        let now = at(t);
        match (before, now) {
            (Some((t0, None)), Some(_)) => part.extend(last_visible(&at, t, t0)),
            (Some((t0, Some(_))), None) => part.extend(last_visible(&at, t0, t)),
            _ => {}
        }
        part.extend(now);
        if now.is_none() && !part.is_empty() {
            parts.push(std::mem::take(&mut part));
        }
        before = Some((t, now));
    }
    if 1 < part.len() {
        parts.push(part);
    }
    parts
}

/// Finds the image of the last visible point between a visible parameter and a hidden one.
fn last_visible(at: &impl Fn(f64) -> Option<Pixel>, mut visible: f64, mut hidden: f64) -> Option<Pixel> {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (visible + hidden);
        if at(middle).is_some() { visible = middle } else { hidden = middle }
    }
    at(visible)
}

/// Returns the smallest box in x and y around the target's points, metres: (least corner, greatest corner).
pub fn bounds(target: &Target) -> (Point, Point) {
    let points: Vec<Point> =
        target.features().iter().filter_map(|f| target.point(*f)).map(|p| p.position).collect();
    let least = points.iter().fold(Point::repeat(f64::INFINITY), |m, p| m.inf(p));
    let greatest = points.iter().fold(Point::repeat(f64::NEG_INFINITY), |m, p| m.sup(p));
    if points.is_empty() { (Point::zeros(), Point::zeros()) } else { (least, greatest) }
}

/// Returns the largest of 1, 2, 5 × 10ⁿ that is not above `x`.
pub fn round_down_125(x: f64) -> f64 {
    let decade = 10f64.powf(x.log10().floor());
    [5.0, 2.0].iter().map(|m| m * decade).find(|v| *v <= x * (1.0 + 1e-9)).unwrap_or(decade)
}

/// Returns the edges of the target, target frame.
pub fn outline(target: &Target) -> Vec<(Point, Point)> {
    if let Some(scale) = target.printed_scale() {
        let as_printed = |(a, b): (Point, Point)| (scale.apply(&a), scale.apply(&b));
        return outline(target.design()).into_iter().map(as_printed).collect();
    }
    match target {
        Target::LinePlusOne(t) => {
            let least = t.line_m.iter().copied().fold(f64::INFINITY, f64::min);
            let greatest = t.line_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let off = Point::new(t.off_m[0], t.off_m[1], 0.0);
            let foot = Point::new(t.off_m[0].clamp(least, greatest), 0.0, 0.0);
            vec![(Point::new(least, 0.0, 0.0), Point::new(greatest, 0.0, 0.0)), (foot, off)]
        }
        Target::Tag(_) | Target::AprilGrid(_) | Target::TagMap(_) => tag_edges(target),
        Target::Chessboard(t) => board_lines(t.columns - 1, t.rows - 1, t.square_m, (0.0, 0.0)),
        Target::Charuco(t) => board_lines(t.columns, t.rows, t.square_m, (0.0, 0.0)),
        Target::CircleGrid(_) => {
            let at = |f: &Feature| target.point(*f).map(|p| p.position);
            target.features().windows(2).filter_map(|pair| Some((at(&pair[0])?, at(&pair[1])?))).collect()
        }
        _ => Vec::new(),
    }
}

fn tag_edges(target: &Target) -> Vec<(Point, Point)> {
    let corners: Vec<Point> =
        target.features().iter().filter_map(|f| target.point(*f)).map(|p| p.position).collect();
    corners.chunks_exact(4).flat_map(|c| (0..4).map(move |i| (c[i], c[(i + 1) % 4]))).collect()
}

fn board_lines(columns: u32, rows: u32, pitch_m: f64, (x0, y0): (f64, f64)) -> Vec<(Point, Point)> {
    let at = |i: u32, j: u32| Point::new(x0 + i as f64 * pitch_m, y0 + j as f64 * pitch_m, 0.0);
    let down = (0..=columns).map(|i| (at(i, 0), at(i, rows)));
    let across = (0..=rows).map(|j| (at(0, j), at(columns, j)));
    down.chain(across).collect()
}

/// Returns lines of the plane z = 0 every `step_m`, over the target's box and around it by its size.
pub fn grid(least: &Point, greatest: &Point, step_m: f64) -> Vec<(Point, Point)> {
    let reach = (greatest - least).xy().max();
    let lines = |lo: f64, hi: f64| {
        let first = ((lo - reach) / step_m).floor() as i64;
        let last = ((hi + reach) / step_m).ceil() as i64;
        (first..=last).map(move |i| i as f64 * step_m).collect::<Vec<_>>()
    };
    let (xs, ys) = (lines(least.x, greatest.x), lines(least.y, greatest.y));
    let (Some((x0, x1)), Some((y0, y1))) = (ends(&xs), ends(&ys)) else { return Vec::new() };
    let upright = xs.iter().map(|&x| (Point::new(x, y0, 0.0), Point::new(x, y1, 0.0)));
    let level = ys.iter().map(|&y| (Point::new(x0, y, 0.0), Point::new(x1, y, 0.0)));
    upright.chain(level).collect()
}

fn ends(sorted: &[f64]) -> Option<(f64, f64)> {
    Some((*sorted.first()?, *sorted.last()?))
}

/// Returns the covariance of the image of a point (px²) due to that of the pose: `A Σ Aᵀ` with `A = J [−[x]ₓ I]`.
pub fn pixel_covariance(
    camera: &Camera,
    x_in_cam: &Point,
    covariance: &Matrix6,
) -> Option<(Pixel, Matrix2<f64>)> {
    let (pixel, by_point): (Pixel, Matrix2x3<f64>) = camera.project_with_jacobian(x_in_cam)?;
    let mut by_motion = nalgebra::Matrix2x6::zeros();
    by_motion.fixed_view_mut::<2, 3>(0, 0).copy_from(&(by_point * -x_in_cam.cross_matrix()));
    by_motion.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_point);
    Some((pixel, by_motion * covariance * by_motion.transpose()))
}

/// Returns the ellipse at Mahalanobis distance `sigmas` of a 2×2 covariance, as its two semi-axes.
pub fn semi_axes(covariance: &Matrix2<f64>, sigmas: f64) -> [Vector2<f64>; 2] {
    let eigen = nalgebra::SymmetricEigen::new(*covariance);
    [0, 1].map(|i| eigen.eigenvectors.column(i) * (sigmas * eigen.eigenvalues[i].max(0.0).sqrt()))
}

/// Returns a closed ellipse with this centre and these semi-axes.
pub fn ellipse(centre: Vector2<f64>, axes: &[Vector2<f64>; 2]) -> Path {
    let at = |i: usize| {
        let (sin, cos) = (i as f64 * std::f64::consts::TAU / 40.0).sin_cos();
        centre + axes[0] * cos + axes[1] * sin
    };
    (0..=40).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Vector6;

    #[test]
    fn a_line_that_passes_behind_the_camera_ends_where_it_leaves_the_view() {
        let camera = Camera::normalized();
        let (a, b) = (Point::new(0.0, 1.0, -1.0), Point::new(0.0, 1.0, 3.0));
        let parts = project_segment(&camera, &Pose::identity(), &a, &b);
        assert_eq!(parts.len(), 1);
        assert!(parts[0].iter().all(|p| p.y.is_finite() && 0.0 < p.y));
        assert!(1000.0 < parts[0][0].y, "drawn up to the plane of the lens: {}", parts[0][0].y);
    }

    #[test]
    fn rounding_keeps_one_two_five() {
        for (x, y) in [(1.0, 1.0), (0.19, 0.1), (0.2, 0.2), (4.99, 2.0), (5.0, 5.0), (99.0, 50.0)] {
            assert!((round_down_125(x) - y).abs() < 1e-12, "{x}");
        }
    }

    /// The derivative with respect to the pose equals central differences of the projected point under small left motions.
    #[test]
    fn pixel_covariance_is_that_of_small_motions() {
        let camera = Camera::normalized();
        let x = Point::new(0.3, -0.2, 2.0);
        for i in 0..6 {
            let mut covariance = Matrix6::zeros();
            covariance[(i, i)] = 1.0;
            let (_, got) = pixel_covariance(&camera, &x, &covariance).unwrap();
            let mut xi = Vector6::zeros();
            xi[i] = 1e-6;
            let d = (camera.project(&(Pose::exp(&xi) * x)).unwrap()
                - camera.project(&(Pose::exp(&-xi) * x)).unwrap())
                / 2e-6;
            assert!((got - d * d.transpose()).norm() < 1e-8, "{i}");
        }
    }

    #[test]
    fn semi_axes_of_a_diagonal_covariance_are_its_sigmas() {
        let axes = semi_axes(&Matrix2::new(9.0, 0.0, 0.0, 4.0), 2.0);
        let mut lengths = axes.map(|a| a.norm());
        lengths.sort_by(f64::total_cmp);
        assert!((lengths[0] - 4.0).abs() + (lengths[1] - 6.0).abs() < 1e-12);
    }
}
