//! The ground of a pose in the photograph: a metric grid on the plane z = 0, the axes and the horizon, as curves through the lens.

use super::geometry::{ellipse, grid, outline, pixel_covariance, project_segment, round_down_125, semi_axes};
use crate::core::{Camera, Matrix6, Pixel, Point, Pose, Target};

/// Curves of the image, pixels; each is within the image or just beyond its edge.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GroundLines {
    /// Lines of the plane z = 0.
    pub grid: Vec<Vec<Pixel>>,
    /// Distance between adjacent lines, metres.
    pub spacing_m: f64,
    /// x, y and z of the frame, from its origin.
    pub axes: Vec<(&'static str, Vec<Pixel>)>,
    /// The horizon of the plane z = 0; empty where it is not in the image.
    pub horizon: Vec<Vec<Pixel>>,
}

/// Curves continue beyond the image's edge by this part of its width.
const RIM: f64 = 0.05;
/// The grid extends beyond the points by this multiple of their extent.
const REACH: f64 = 1.5;
/// Approximate number of lines across the extent of the points.
const LINES: f64 = 5.0;
/// Number of steps along the full horizon.
const HORIZON_STEPS: usize = 240;
/// √χ² of two degrees of freedom at 95 %.
const SIGMAS_95: f64 = 2.447_746_830_680_816;

/// Returns grid, axes and horizon for a pose whose points are between `least` and `greatest`, target frame.
pub fn ground_lines(
    camera: &Camera,
    cam_from_target: &Pose,
    (least, greatest): (&Point, &Point),
) -> GroundLines {
    let extent_m = (greatest - least).xy().max();
    if !(0.0 < extent_m && extent_m.is_finite()) {
        return GroundLines::default();
    }
    let spacing_m = round_down_125(extent_m / LINES * 1.5);
    let rim = Point::new(1.0, 1.0, 0.0) * (REACH - 1.0) * extent_m;
    let shown = |(a, b): (Point, Point)| within(camera, project_segment(camera, cam_from_target, &a, &b));
    let axis_m = 2.0 * spacing_m;
    let axis = |(name, i): (&'static str, usize)| {
        let mut end = Point::zeros();
        end[i] = axis_m;
        let parts = shown((Point::zeros(), end));
        (name, parts.into_iter().next().unwrap_or_default())
    };
    GroundLines {
        grid: grid(&(least - rim), &(greatest + rim), spacing_m).into_iter().flat_map(shown).collect(),
        spacing_m,
        axes: [("x", 0), ("y", 1), ("z", 2)].map(axis).to_vec(),
        horizon: horizon(camera, cam_from_target),
    }
}

/// Returns the image of the directions in the plane z = 0.
fn horizon(camera: &Camera, cam_from_target: &Pose) -> Vec<Vec<Pixel>> {
    let at = |i: usize| {
        let (sin, cos) = (i as f64 * std::f64::consts::TAU / HORIZON_STEPS as f64).sin_cos();
        camera.project(&(cam_from_target.rotation * Point::new(cos, sin, 0.0)))
    };
    let mut parts: Vec<Vec<Pixel>> = vec![Vec::new()];
    for pixel in (0..=HORIZON_STEPS).map(at) {
        match (pixel, parts.last_mut()) {
            (Some(pixel), Some(part)) => part.push(pixel),
            _ => parts.push(Vec::new()),
        }
    }
    within(camera, parts)
}

/// Returns the closed 95 % ellipse of the predicted image of a point; `None` where it is outside the lens's field.
pub fn prediction_ellipse(
    camera: &Camera,
    cam_from_target: &Pose,
    x_in_target: &Point,
    covariance: &Matrix6,
) -> Option<Vec<Pixel>> {
    let (pixel, spread) = pixel_covariance(camera, &(cam_from_target * x_in_target), covariance)?;
    Some(ellipse(pixel, &semi_axes(&spread, SIGMAS_95)))
}

/// Returns the edges of a target through the lens, in the image or just beyond its edge.
pub fn target_lines(camera: &Camera, cam_from_target: &Pose, target: &Target) -> Vec<Vec<Pixel>> {
    let shown = |(a, b): (Point, Point)| within(camera, project_segment(camera, cam_from_target, &a, &b));
    outline(target).into_iter().flat_map(shown).collect()
}

/// Returns the parts of curves inside the image.
fn within(camera: &Camera, curves: Vec<Vec<Pixel>>) -> Vec<Vec<Pixel>> {
    let Some(size) = camera.size else { return curves };
    let (width, height) = (f64::from(size.width_px), f64::from(size.height_px));
    let rim = RIM * width;
    let is_in = |p: &Pixel| (-rim..=width + rim).contains(&p.x) && (-rim..=height + rim).contains(&p.y);
    let mut parts = Vec::new();
    for curve in curves {
        let mut part: Vec<Pixel> = Vec::new();
        for pair in curve.windows(2) {
            if let Some([a, b]) = clipped(pair[0], pair[1], [-rim, -rim], [width + rim, height + rim]) {
                if part.is_empty() {
                    part.push(a);
                }
                part.push(b);
                if !is_in(&pair[1]) {
                    parts.push(std::mem::take(&mut part));
                }
            } else if !part.is_empty() {
                parts.push(std::mem::take(&mut part));
            }
        }
        if 1 < part.len() {
            parts.push(part);
        }
    }
    parts
}

/// Returns the part of a segment inside a box (Liang and Barsky); `None` where they do not meet.
fn clipped(a: Pixel, b: Pixel, least: [f64; 2], most: [f64; 2]) -> Option<[Pixel; 2]> {
    let d = b - a;
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for i in 0..2 {
        for (slope, room) in [(-d[i], a[i] - least[i]), (d[i], most[i] - a[i])] {
            if slope == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if slope < 0.0 {
                from = from.max(room / slope);
            } else {
                to = to.min(room / slope);
            }
        }
    }
    (from < to).then(|| [a + d * from, a + d * to])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::camera::{CameraMatrix, ImageSize};
    use crate::core::{Lens, Vector6};

    fn camera() -> Camera {
        let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 319.5, cy_px: 239.5 };
        let lens = Lens::from(crate::core::camera::Pinhole { matrix });
        Camera::new(lens, Some(ImageSize { width_px: 640, height_px: 480 })).expect("a camera")
    }

    /// Every drawn point is the image of a point on the plane, and is inside the image or on its margin.
    #[test]
    fn grid_lines_lie_on_the_plane() {
        let camera = camera();
        let tilted = Pose::exp(&Vector6::new(2.0, 0.1, -0.3, 0.0, 0.0, 0.0));
        let cam_from_target = Pose::new(tilted.rotation, nalgebra::Vector3::new(-0.4, 0.3, 5.0));
        let lines = ground_lines(&camera, &cam_from_target, (&Point::zeros(), &Point::new(3.0, 2.0, 0.0)));
        assert!(8 < lines.grid.len() && lines.spacing_m == 0.5, "{}", lines.spacing_m);
        let plane = crate::core::advise::ground::Plane::level(0.0);
        for line in &lines.grid {
            assert!(line.iter().all(|p| (-33.0..=673.0).contains(&p.x) && (-33.0..=513.0).contains(&p.y)));
            let on: Vec<Point> =
                line.iter().filter_map(|p| plane.seen_at(&camera, &cam_from_target, p)).collect();
            assert_eq!(on.len(), line.len());
            let is_line = |i: usize| on.iter().all(|x| (x[i] / 0.5 - (x[i] / 0.5).round()).abs() < 1e-2);
            assert!(is_line(0) || is_line(1), "{on:?}");
        }
        assert_eq!(lines.axes.len(), 3);
    }

    /// For a level camera the horizon is horizontal, in the middle of its image.
    #[test]
    fn a_level_camera_sees_the_horizon_in_the_middle() {
        let camera = camera();
        let quarter = Pose::exp(&Vector6::new(std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0, 0.0, 0.0));
        let cam_from_target = Pose::new(quarter.rotation, nalgebra::Vector3::new(0.0, 2.0, 4.0));
        let all = horizon(&camera, &cam_from_target).concat();
        assert!(10 < all.len() && all.iter().all(|p| (p.y - 239.5).abs() < 1e-6), "{all:?}");
    }
}
