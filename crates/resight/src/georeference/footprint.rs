//! The part of a ground plane that an image shows: its border, limited towards the horizon.
//!
//! A ray that points less far down than the limit allows does not reach the ground near enough; there the border follows the circle of that
//! radius around the camera, georeference.md eqs. (10) to (12). Rays are those of the lens, so that edges are curves where the lens bends them.

use crate::core::{Camera, Pixel, Point, Pose};
use crate::report::words::length;
use nalgebra::{Vector2, Vector3};
use std::f64::consts::TAU;

/// Points on each side of the image.
const POINTS_A_SIDE: usize = 32;
/// Points on a whole circle of the limit.
const POINTS_A_CIRCLE: f64 = 120.0;
/// Halvings that find where the border of the image meets the limit: to 1e-9 of a step.
const HALVINGS: usize = 30;
/// Step from a crossing that decides in which direction the circle is in the image, rad.
const STEP_RAD: f64 = 1e-4;

/// The ground that an image shows.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    /// Polygons on the ground, counter-clockwise seen from above, not closed; nearly always one.
    pub rings: Vec<Vec<Point>>,
    /// Whether the limit cuts it, because the image shows the horizon or ground farther away.
    pub is_limited: bool,
    /// The limit, m from the point of the ground below the camera.
    pub limit_m: f64,
}

/// The border of an image, and what of its rays reaches the ground.
struct View<'a> {
    camera: &'a Camera,
    cam_from_local: &'a Pose,
    eye: Point,
    /// Of the camera over the ground, m.
    height_m: f64,
    ground_z_m: f64,
    limit_m: f64,
    size_px: Vector2<f64>,
    middle: Pixel,
}

/// Returns the ground at the height `ground_z_m` that an image shows, at most `limit_m` from the point below the camera.
///
/// # Errors
/// A camera below the ground, without an image size, or whose image shows no ground within the limit, in a sentence.
pub fn footprint(
    camera: &Camera,
    cam_from_local: &Pose,
    ground_z_m: f64,
    limit_m: f64,
) -> Result<Footprint, String> {
    let size = camera.size.ok_or("the camera's file states no image size, so the footprint is unknown")?;
    let eye = cam_from_local.origin();
    let height_m = eye.z - ground_z_m;
    if !(0.0 < height_m && height_m.is_finite()) {
        return Err(format!(
            "the camera is {} below the ground; state the height of the ground",
            length(height_m.abs())
        ));
    }
    let size_px = Vector2::new(f64::from(size.width_px), f64::from(size.height_px));
    let middle = size_px * 0.5 - Vector2::repeat(0.5);
    let view = View { camera, cam_from_local, eye, height_m, ground_z_m, limit_m, size_px, middle };
    let border: Vec<Pixel> = (0..4 * POINTS_A_SIDE).map(|i| view.border(i as f64)).collect();
    let on_ground: Vec<Option<Point>> = border.iter().map(|pixel| view.ground(pixel)).collect();
    let (rings, is_limited) = match on_ground.iter().filter(|x| x.is_some()).count() {
        n if n == border.len() => (vec![on_ground.into_iter().flatten().collect()], false),
        0 => (vec![view.whole_circle().ok_or_else(|| view.no_ground())?], true),
        _ => (view.rings(&on_ground), true),
    };
    let rings: Vec<Vec<Point>> =
        rings.into_iter().filter(|ring| 2 < ring.len()).map(counter_clockwise).collect();
    match rings.is_empty() {
        true => Err(view.no_ground()),
        false => Ok(Footprint { rings, is_limited, limit_m }),
    }
}

impl View<'_> {
    fn no_ground(&self) -> String {
        format!("the image shows no ground within {} of the camera", length(self.limit_m))
    }

    /// Returns the pixel so many steps along the border, clockwise from the top left corner.
    fn border(&self, step: f64) -> Pixel {
        let n = POINTS_A_SIDE as f64;
        let (side, part) = ((step / n).floor() as usize % 4, (step / n).fract());
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vector2::from);
        let relative = corners[side].lerp(&corners[(side + 1) % 4], part);
        relative.component_mul(&self.size_px) - Vector2::repeat(0.5)
    }

    /// Returns the direction in the local frame at a pixel; where the lens model ends before it, that of the last pixel on the way from the
    /// middle of the image.
    fn ray(&self, pixel: &Pixel) -> Option<Vector3<f64>> {
        let at = |part: f64| self.camera.bearing(&self.middle.lerp(pixel, part)).ok();
        let bearing = at(1.0).or_else(|| {
            let (mut inside, mut outside) = (0.0, 1.0);
            for _ in 0..HALVINGS {
                let half = 0.5 * (inside + outside);
                if at(half).is_some() { inside = half } else { outside = half }
            }
            at(inside)
        })?;
        Some(self.cam_from_local.rotation.tr_mul(&bearing.into_inner()))
    }

    /// Returns where the ray of a pixel meets the ground within the limit.
    fn ground(&self, pixel: &Pixel) -> Option<Point> {
        let ray = self.ray(pixel)?;
        let down = -ray.z;
        let is_near = 0.0 < down && self.height_m * ray.x.hypot(ray.y) <= self.limit_m * down;
        is_near.then(|| self.eye + ray * (self.height_m / down))
    }

    fn on_circle(&self, azimuth_rad: f64) -> Point {
        let (sin, cos) = azimuth_rad.sin_cos();
        Point::new(self.eye.x + self.limit_m * cos, self.eye.y + self.limit_m * sin, self.ground_z_m)
    }

    fn azimuth_rad(&self, x: &Point) -> f64 {
        (x.y - self.eye.y).atan2(x.x - self.eye.x)
    }

    fn is_in_image(&self, x: &Point) -> bool {
        self.camera.project(&(*self.cam_from_local * *x)).is_some_and(|pixel| self.camera.contains(&pixel))
    }

    /// Returns the whole circle, where the image shows all of it.
    fn whole_circle(&self) -> Option<Vec<Point>> {
        let n = POINTS_A_CIRCLE as usize;
        let circle: Vec<Point> = (0..n).map(|i| self.on_circle(TAU * i as f64 / n as f64)).collect();
        circle.iter().all(|x| self.is_in_image(x)).then_some(circle)
    }

    /// Returns the last point on the ground between a border step that has one and its neighbour that has none.
    fn crossing(&self, inside: f64, outside: f64) -> Option<Point> {
        let (mut inside, mut outside) = (inside, outside);
        for _ in 0..HALVINGS {
            let half = 0.5 * (inside + outside);
            if self.ground(&self.border(half.rem_euclid(4.0 * POINTS_A_SIDE as f64))).is_some() {
                inside = half;
            } else {
                outside = half;
            }
        }
        self.ground(&self.border(inside.rem_euclid(4.0 * POINTS_A_SIDE as f64)))
    }

    /// Returns the parts of the border that are on the ground, each from where it comes within the limit to where it leaves it.
    fn runs(&self, on_ground: &[Option<Point>]) -> Vec<Vec<Point>> {
        let n = on_ground.len();
        let begins = (0..n).filter(|i| on_ground[*i].is_some() && on_ground[(*i + n - 1) % n].is_none());
        let run = |begin: usize| {
            let length = (0..n).take_while(|k| on_ground[(begin + k) % n].is_some()).count();
            let middle = (0..length).filter_map(|k| on_ground[(begin + k) % n]);
            let (first, last) = (begin as f64, (begin + length - 1) as f64);
            let entry = self.crossing(first, first - 1.0);
            let exit = self.crossing(last, last + 1.0);
            entry.into_iter().chain(middle).chain(exit).collect()
        };
        begins.map(run).collect()
    }

    /// Joins the runs by arcs of the limit's circle.
    fn rings(&self, on_ground: &[Option<Point>]) -> Vec<Vec<Point>> {
        let mut runs = self.runs(on_ground);
        let mut rings = Vec::new();
        while let Some(mut ring) = runs.pop() {
            let Some(first) = ring.first().copied() else { continue };
            // Every run is joined at most once.
            for _ in 0..=on_ground.len() {
                let Some(last) = ring.last().copied() else { break };
                let from = self.azimuth_rad(&last);
                let sense = if self.is_in_image(&self.on_circle(from + STEP_RAD)) { 1.0 } else { -1.0 };
                let turn = |x: &Point| (sense * (self.azimuth_rad(x) - from)).rem_euclid(TAU);
                let next = (0..runs.len())
                    .filter_map(|i| Some((i, turn(runs[i].first()?))))
                    .min_by(|a, b| a.1.total_cmp(&b.1))
                    .filter(|(_, angle)| *angle < turn(&first));
                let angle = next.map_or_else(|| turn(&first), |(_, angle)| angle);
                let n = (angle / TAU * POINTS_A_CIRCLE).ceil() as usize;
                ring.extend((1..n).map(|k| self.on_circle(from + sense * angle * k as f64 / n as f64)));
                match next {
                    Some((i, _)) => ring.extend(runs.swap_remove(i)),
                    None => break,
                }
            }
            rings.push(ring);
        }
        rings
    }
}

fn counter_clockwise(mut ring: Vec<Point>) -> Vec<Point> {
    let twice_area: f64 = (0..ring.len())
        .map(|i| (ring[i], ring[(i + 1) % ring.len()]))
        .map(|(a, b)| (a.x - ring[0].x) * (b.y - ring[0].y) - (b.x - ring[0].x) * (a.y - ring[0].y))
        .sum();
    if twice_area < 0.0 {
        ring.reverse();
    }
    ring
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::camera::{ImageSize, KannalaBrandt, Pinhole};
    use crate::core::{CameraMatrix, Lens};
    use nalgebra::Matrix3;

    const MATRIX: CameraMatrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 639.5, cy_px: 479.5 };

    fn pinhole() -> Camera {
        let size = Some(ImageSize { width_px: 1280, height_px: 960 });
        Camera { lens: Lens::Pinhole(Pinhole { matrix: MATRIX }), size }
    }

    /// At a height, looking north and `tilt_deg` below the horizon.
    fn pose(height_m: f64, tilt_deg: f64) -> Pose {
        let (sin, cos) = tilt_deg.to_radians().sin_cos();
        let (right, axis) = (Vector3::x(), Vector3::new(0.0, cos, -sin));
        let down = axis.cross(&right);
        let rotation = Matrix3::from_rows(&[right.transpose(), down.transpose(), axis.transpose()]);
        Pose::new(rotation, -(rotation * Vector3::new(0.0, 0.0, height_m)))
    }

    fn area_m2(ring: &[Point]) -> f64 {
        let next = |i: usize| ring[(i + 1) % ring.len()];
        (0..ring.len()).map(|i| 0.5 * (ring[i].x * next(i).y - next(i).x * ring[i].y)).sum()
    }

    #[test]
    fn straight_down_it_is_a_rectangle() {
        let found = footprint(&pinhole(), &pose(50.0, 90.0), 0.0, 1000.0).expect("a footprint");
        assert!(!found.is_limited);
        let expected = (1280.0 / 800.0 * 50.0) * (960.0 / 800.0 * 50.0);
        assert!((area_m2(&found.rings[0]) - expected).abs() < 1e-6 * expected);
    }

    /// With the horizon in the image, it is the sector of the circle within the sides of the image, without what is below its lower edge.
    #[test]
    fn the_horizon_limits_it_to_a_circle() {
        let (height, limit) = (10.0, 300.0);
        let found = footprint(&pinhole(), &pose(height, 10.0), 2.0, limit).expect("a footprint");
        assert!(found.is_limited && found.rings.len() == 1);
        let ring = &found.rings[0];
        assert!(0.0 < area_m2(ring));
        let most = ring.iter().map(|x| x.x.hypot(x.y)).fold(0.0, f64::max);
        assert!((most - limit).abs() < 1e-3, "{most}");
        assert!(ring.iter().all(|x| (x.z - 2.0).abs() < 1e-9 && 0.0 < x.y));
        // Monte Carlo: the share of a grid of ground points that are in the image.
        let camera = pinhole();
        let cell = 2.0;
        let seen = (-150..150).flat_map(|i| (0..150).map(move |j| (i, j))).filter(|(i, j)| {
            let x = Point::new((f64::from(*i) + 0.5) * cell, (f64::from(*j) + 0.5) * cell, 2.0);
            let is_near = x.x.hypot(x.y) <= limit;
            is_near && camera.project(&(pose(height, 10.0) * x)).is_some_and(|p| camera.contains(&p))
        });
        let expected = seen.count() as f64 * cell * cell;
        assert!((area_m2(ring) / expected - 1.0).abs() < 0.01, "{} {expected}", area_m2(ring));
    }

    /// A fisheye that looks down shows the whole circle, and its corners have no rays.
    #[test]
    fn a_fisheye_that_looks_down_shows_the_whole_circle() {
        let matrix = CameraMatrix { fx_px: 300.0, fy_px: 300.0, ..MATRIX };
        let lens = Lens::KannalaBrandt(KannalaBrandt::new(matrix, &[0.0; 4]).expect("a lens"));
        let camera = Camera { lens, size: pinhole().size };
        let found = footprint(&camera, &pose(10.0, 90.0), 0.0, 20.0).expect("a footprint");
        assert!(found.is_limited);
        let circle = std::f64::consts::PI * 400.0;
        assert!((area_m2(&found.rings[0]) / circle - 1.0).abs() < 0.01);
    }

    #[test]
    fn what_has_none_is_named() {
        let up = footprint(&pinhole(), &pose(10.0, -60.0), 0.0, 300.0).expect_err("no ground");
        assert!(up.contains("no ground"), "{up}");
        let below = footprint(&pinhole(), &pose(-3.0, 60.0), 0.0, 300.0).expect_err("below");
        assert!(below.contains("3 m below the ground"), "{below}");
        let unknown = Camera { size: None, ..pinhole() };
        assert!(footprint(&unknown, &pose(10.0, 60.0), 0.0, 300.0).is_err());
    }
}
