//! Targets of every configuration, seen from known places.

use super::Rng;
use nalgebra::{Matrix3, Vector2, Vector3};
use resight_core::camera::Pinhole;
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Pixel, Point, Pose};

/// f = 800 px, 640×480.
pub fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 319.5, cy_px: 239.5 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

/// Three on a line and one off it, 1 m.
pub fn line_plus_one() -> Vec<Point> {
    places(&[[0.0, 0.0, 0.0], [0.6, 0.0, 0.0], [1.0, 0.0, 0.0], [0.1, 0.7, 0.0]])
}

/// A triangle.
pub fn three() -> Vec<Point> {
    places(&[[0.0, 0.0, 0.0], [0.9, 0.1, 0.0], [0.2, 0.7, 0.3]])
}

/// Eight points in a plane, no three on a line.
pub fn planar() -> Vec<Point> {
    let xy =
        [[0.0, 0.0], [1.0, 0.05], [1.1, 0.9], [0.1, 0.8], [0.5, 0.3], [0.35, 0.62], [0.8, 0.45], [0.62, 1.0]];
    xy.iter().map(|[x, y]| Point::new(*x, *y, 0.0)).collect()
}

/// Eight points in space.
pub fn general() -> Vec<Point> {
    let depth = [0.0, 0.3, -0.2, 0.5, 0.4, -0.4, 0.1, -0.3];
    planar().iter().zip(depth).map(|(p, z)| Point::new(p.x, p.y, z)).collect()
}

/// Every configuration with its name.
pub fn all() -> [(&'static str, Vec<Point>); 4] {
    [("three", three()), ("line_plus_one", line_plus_one()), ("planar", planar()), ("general", general())]
}

fn places(xyz: &[[f64; 3]]) -> Vec<Point> {
    xyz.iter().map(|x| Point::from(*x)).collect()
}

/// The camera at `centre`, looking at `at`; its x axis perpendicular to a fixed slanted direction.
pub fn looking_at(centre: Point, at: Point) -> Pose {
    let z = (at - centre).normalize();
    let x = Vector3::new(0.3, 0.9, 0.2).cross(&z).normalize();
    let rotation = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    Pose::new(rotation, -(rotation * centre))
}

/// The camera at `centre`, looking at `at`, its rows level where z is up.
pub fn looking_at_upright(centre: Point, at: Point) -> Pose {
    let z = (at - centre).normalize();
    let x = z.cross(&Vector3::z()).normalize();
    let rotation = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    Pose::new(rotation, -(rotation * centre))
}

/// An oblique view of the targets above from 3.4 m.
pub fn oblique() -> Pose {
    looking_at(Point::new(2.2, -1.1, 2.4), Point::new(0.4, 0.4, 0.0))
}

/// Exact pixels, by plain division: also of points behind the camera, mirrored as the formula has it.
pub fn pixel_of(x_in_cam: &Point) -> Pixel {
    Pixel::new(800.0 * x_in_cam.x / x_in_cam.z + 319.5, 800.0 * x_in_cam.y / x_in_cam.z + 239.5)
}

/// The correspondences of a pose, exact, labelled with a sigma.
pub fn seen_from(cam_from_target: &Pose, points: &[Point], sigma_px: f64) -> Vec<Correspondence> {
    let point = |x: &Point| {
        Correspondence::new(&camera(), *x, pixel_of(&(cam_from_target * x)), sigma_px).expect("in the field")
    };
    points.iter().map(point).collect()
}

/// The same correspondence with its pixel moved.
pub fn moved_pixel(c: &Correspondence, by_px: Vector2<f64>) -> Correspondence {
    let moved = Correspondence::new(&camera(), c.x_in_target, c.pixel + by_px, c.sigma_px);
    Correspondence { sigma_m: c.sigma_m, ..moved.expect("in the field") }
}

/// Pixels disturbed by their own sigma.
pub fn disturbed(rng: &mut Rng, seen: &[Correspondence]) -> Vec<Correspondence> {
    seen.iter().map(|c| moved_pixel(c, Vector2::new(rng.normal(), rng.normal()) * c.sigma_px)).collect()
}

/// From before the stop line, 1.2 to 3 m above the road, looking along it.
pub fn on_the_road(rng: &mut Rng) -> Pose {
    let centre = Point::new(rng.uniform(-1.5, 1.5), rng.uniform(-4.0, -1.0), rng.uniform(1.2, 3.0));
    let at = Point::new(rng.uniform(-0.5, 0.5), rng.uniform(6.0, 9.0), 0.0);
    let z = (at - centre).normalize();
    let x = z.cross(&Vector3::new(rng.uniform(-0.1, 0.1), 0.0, 1.0)).normalize();
    let rotation = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    Pose::new(rotation, -(rotation * centre))
}
