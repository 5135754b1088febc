//! The geometry of a rig's drawing, from which scene files and report pages take their shapes.
//!
//! Every curve is the image border or the target itself, projected through lens and pose; sizes chosen for visibility are documented as such.

use crate::core::{Camera, Matrix6, Pixel, Point, Pose};
use crate::rig::{NamedRig, RigRun};
use nalgebra::{Matrix2, Matrix3, SymmetricEigen};
use std::collections::BTreeMap;

/// χ² with two degrees of freedom stays below this in 95 % of cases: −2 ln 0.05.
pub(crate) const CHI2_2_95: f64 = 5.991_464_547_107_98;
/// χ² with three degrees of freedom stays below this in 95 % of cases.
pub(crate) const CHI2_3_95: f64 = 7.814_727_903_251_18;
/// Number of points along each side of the image border: enough for a strongly bent one to look smooth.
const BORDER_STEPS: usize = 8;
/// Beyond 70° from the axis the border is drawn on a cone instead of the plane z = 1, on which it would extend to infinity.
const LEAST_DEPTH: f64 = 0.34;

/// The part of the image plane that a camera's drawings cover: least and greatest u and v, px or the camera's own unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Area {
    pub least: Pixel,
    pub greatest: Pixel,
}

impl Area {
    pub fn width(&self) -> f64 {
        self.greatest.x - self.least.x
    }

    pub fn height(&self) -> f64 {
        self.greatest.y - self.least.y
    }
}

/// Returns the image; for a camera without an image size, the part of the plane with observations.
pub(crate) fn image_area(rig: &NamedRig, camera: usize) -> Area {
    if let Some(size) = rig.lenses[camera].size {
        let greatest = Pixel::new(size.width_px as f64 - 0.5, size.height_px as f64 - 0.5);
        return Area { least: Pixel::new(-0.5, -0.5), greatest };
    }
    let pixels =
        rig.observations.iter().filter(|s| s.camera == camera).flat_map(|s| &s.seen).map(|c| c.pixel);
    let (mut least, mut greatest) = (Pixel::repeat(f64::INFINITY), Pixel::repeat(f64::NEG_INFINITY));
    for pixel in pixels {
        least = least.inf(&pixel);
        greatest = greatest.sup(&pixel);
    }
    if least.x < greatest.x && least.y < greatest.y {
        Area { least, greatest }
    } else {
        Area { least: Pixel::new(-0.5, -0.5), greatest: Pixel::new(0.5, 0.5) }
    }
}

/// Returns the image border in the camera frame, on the plane z = 1 m or, for wide fields, on a cone: a closed line, empty where nothing is
/// valid.
pub(crate) fn border_in_cam(camera: &Camera, area: &Area) -> Vec<Point> {
    let centre = (area.least + area.greatest) * 0.5;
    border_pixels(area)
        .into_iter()
        .filter_map(|pixel| {
            let bearing = camera.bearing(&outermost_valid(camera, centre, pixel)?).ok()?;
            Some(*bearing / bearing.z.max(LEAST_DEPTH))
        })
        .collect()
}

fn border_pixels(area: &Area) -> Vec<Pixel> {
    let (a, c) = (area.least, area.greatest);
    let corners = [a, Pixel::new(c.x, a.y), c, Pixel::new(a.x, c.y)];
    let side = |i: usize| {
        let (from, to) = (corners[i], corners[(i + 1) % 4]);
        (0..BORDER_STEPS).map(move |k| from + (to - from) * (k as f64 / BORDER_STEPS as f64))
    };
    (0..4).flat_map(side).collect()
}

/// Returns the pixel itself, or the last one between the centre and it for which the lens model has a ray.
fn outermost_valid(camera: &Camera, centre: Pixel, pixel: Pixel) -> Option<Pixel> {
    if camera.bearing(&pixel).is_ok() {
        return Some(pixel);
    }
    camera.bearing(&centre).ok()?;
    let (mut valid, mut invalid) = (0.0, 1.0);
    for _ in 0..24 {
        let middle = 0.5 * (valid + invalid);
        match camera.bearing(&(centre + (pixel - centre) * middle)) {
            Ok(_) => valid = middle,
            Err(_) => invalid = middle,
        }
    }
    Some(centre + (pixel - centre) * valid)
}

/// Returns the points of each target that were observed in any view, each once, sorted by coordinates.
pub(crate) fn target_points(rig: &NamedRig) -> Vec<Vec<Point>> {
    let mut points: Vec<BTreeMap<[u64; 3], Point>> = vec![BTreeMap::new(); rig.targets.len()];
    for observation in &rig.observations {
        for c in &observation.seen {
            let x = c.x_in_target;
            points[observation.target].insert([ordered(x.z), ordered(x.y), ordered(x.x)], x);
        }
    }
    points.into_iter().map(|of_target| of_target.into_values().collect()).collect()
}

/// Returns bits whose unsigned order is that of the numbers; −0 counts as 0.
fn ordered(x: f64) -> u64 {
    let bits = (x + 0.0).to_bits();
    if bits >> 63 == 1 { !bits } else { bits | 1 << 63 }
}

/// Returns the corners of the convex hull of a flat target in order, as indices into `points`; empty where the points are not in one plane z.
pub(crate) fn outline(points: &[Point]) -> Vec<usize> {
    let flat = points.windows(2).all(|w| (w[0].z - w[1].z).abs() < 1e-9);
    if !flat || points.len() < 2 {
        return Vec::new();
    }
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&i, &j| {
        points[i].x.total_cmp(&points[j].x).then(points[i].y.total_cmp(&points[j].y)).then(i.cmp(&j))
    });
    let mut hull = half_hull(points, order.iter().copied());
    let upper = half_hull(points, order.iter().rev().copied());
    hull.pop();
    hull.extend(&upper[..upper.len() - 1]);
    hull
}

/// Returns one chain of Andrew's convex hull.
fn half_hull(points: &[Point], order: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut chain: Vec<usize> = Vec::new();
    for i in order {
        while let [.., a, b] = chain[..] {
            let (ab, ai) = (points[b] - points[a], points[i] - points[a]);
            if 0.0 < ab.x * ai.y - ab.y * ai.x {
                break;
            }
            chain.pop();
        }
        chain.push(i);
    }
    chain
}

/// The pose of a target in a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TargetInView {
    pub view: usize,
    pub target: usize,
    pub rig_from_target: Pose,
}

/// Returns every target that a camera observed in a view and whose body was placed there, sorted by view, then target.
pub(crate) fn targets_in_views(run: &RigRun) -> Vec<TargetInView> {
    let bodies: BTreeMap<(usize, usize), Pose> =
        run.solution.bodies.iter().map(|b| ((b.view, b.body), b.rig_from_body)).collect();
    let mut seen: Vec<(usize, usize)> = run.rig.observations.iter().map(|s| (s.view, s.target)).collect();
    seen.sort_unstable();
    seen.dedup();
    seen.into_iter()
        .filter_map(|(view, target)| {
            let rig_from_body = bodies.get(&(view, *run.rig.body_of_target.get(target)?))?;
            let rig_from_target = *rig_from_body * run.solution.targets.get(target)?.body_from_target;
            Some(TargetInView { view, target, rig_from_target })
        })
        .collect()
}

/// Returns the cameras whose observation of a target in a view took part, with their positions in the rig. Observations are sorted by view.
pub(crate) fn cameras_that_saw(run: &RigRun, view: usize, target: usize) -> Vec<(usize, Point)> {
    let observations = &run.rig.observations;
    let first = observations.partition_point(|s| s.view < view);
    let of_view = (first..observations.len()).take_while(|&i| observations[i].view == view);
    of_view
        .filter(|&i| observations[i].target == target && run.solution.observations[i].rejected.is_none())
        .map(|i| (observations[i].camera, run.solution.cameras[observations[i].camera].cam_from_rig.origin()))
        .collect()
}

/// Returns the covariance of a camera's position along the axes of the rig, m²: Rᵀ Σ_νν R, since a small motion ν moves it by −Rᵀν.
pub(crate) fn position_covariance(cam_from_rig: &Pose, covariance: &Matrix6) -> Matrix3<f64> {
    let r = &cam_from_rig.rotation;
    r.transpose() * covariance.fixed_view::<3, 3>(3, 3) * r
}

/// Returns the half axes of an ellipsoid as columns, each `scale` standard deviations long, the longest first.
pub(crate) fn half_axes(covariance: &Matrix3<f64>, scale: f64) -> Matrix3<f64> {
    let eigen = SymmetricEigen::new((covariance + covariance.transpose()) * 0.5);
    let mut order = [0, 1, 2];
    order.sort_by(|&i, &j| eigen.eigenvalues[j].total_cmp(&eigen.eigenvalues[i]));
    let column = |i: usize| {
        let axis = eigen.eigenvectors.column(i);
        let sign = if axis[axis.iamax()] < 0.0 { -1.0 } else { 1.0 };
        axis * (sign * scale * eigen.eigenvalues[i].max(0.0).sqrt())
    };
    Matrix3::from_columns(&order.map(column))
}

/// Returns the half axes, m, and the direction of the longer, rad, of the ellipse of `scale` standard deviations.
pub(crate) fn ellipse(covariance: &Matrix2<f64>, scale: f64) -> (f64, f64, f64) {
    let (a, b, c) = (covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]);
    let (mean, spread) = (0.5 * (a + c), (0.5 * (a - c)).hypot(b));
    let direction_rad = 0.5 * (2.0 * b).atan2(a - c);
    (scale * (mean + spread).max(0.0).sqrt(), scale * (mean - spread).max(0.0).sqrt(), direction_rad)
}

/// Centre and radius of the scene: all cameras, and the nearest 95 % of the targets, m, rig frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub centre: Point,
    pub radius_m: f64,
}

/// Computes the extent; the 95 % prevent one distant target from shrinking the rest to a dot.
pub(crate) fn extent(run: &RigRun, targets: &[TargetInView]) -> Extent {
    let cameras: Vec<Point> = run.solution.cameras.iter().map(|c| c.cam_from_rig.origin()).collect();
    extent_of(&cameras, targets.iter().map(|t| t.rig_from_target.translation).collect())
}

/// Computes the extent from positions of cameras and targets, rig frame.
pub(crate) fn extent_of(cameras: &[Point], mut targets: Vec<Point>) -> Extent {
    let middle = mean(cameras);
    targets.sort_by(|a, b| (a - middle).norm().total_cmp(&(b - middle).norm()));
    targets.truncate((targets.len() * 95).div_ceil(100));
    targets.extend(cameras);
    // The centre of the box is used, not the mean, so that frequent target positions do not move the cameras out of the image.
    let centre = middle_of_box(&targets);
    let radius_m = targets.iter().map(|x| (x - centre).norm()).fold(0.0, f64::max);
    Extent { centre, radius_m: if 1e-6 < radius_m && radius_m.is_finite() { radius_m } else { 1.0 } }
}

fn middle_of_box(points: &[Point]) -> Point {
    let [first, rest @ ..] = points else { return Point::zeros() };
    let (least, greatest) =
        rest.iter().fold((*first, *first), |(least, greatest), x| (least.inf(x), greatest.sup(x)));
    (least + greatest) * 0.5
}

/// Returns the mean of positions; the origin for none.
pub(crate) fn mean(points: &[Point]) -> Point {
    points.iter().sum::<Point>() / points.len().max(1) as f64
}

/// Returns the depth at which a camera's pyramid is drawn, m: an eighth of the radius, chosen for visibility.
pub(crate) fn pyramid_depth_m(extent: &Extent) -> f64 {
    extent.radius_m / 8.0
}

/// Returns the magnification 1, 2 or 5 times a power of ten that brings `largest` near `wanted` without exceeding it; 1 where nothing is
/// magnified.
pub(crate) fn magnification(largest: f64, wanted: f64) -> f64 {
    let ratio = wanted / largest;
    if !(ratio.is_finite() && 0.0 < ratio) {
        return 1.0;
    }
    let power = 10f64.powi(ratio.log10().floor() as i32);
    let lead = ratio / power;
    power
        * if lead < 2.0 {
            1.0
        } else if lead < 5.0 {
            2.0
        } else {
            5.0
        }
}

/// Returns one magnification for all cameras, with which the longest half axis is a sixth of the radius.
pub(crate) fn ellipse_magnification(run: &RigRun, extent: &Extent) -> f64 {
    let longest = |c: &crate::core::multiview::rig::CameraInRig| {
        half_axes(&position_covariance(&c.cam_from_rig, &c.covariance), CHI2_3_95.sqrt()).column(0).norm()
    };
    let largest = run.solution.cameras.iter().map(longest).fold(0.0, f64::max);
    magnification(largest, extent.radius_m / 6.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Vector6;
    use crate::core::camera::{CameraMatrix, ImageSize, KannalaBrandt, Pinhole};

    #[test]
    fn hull_of_a_grid_is_its_four_corners_and_a_line_its_two_ends() {
        let grid: Vec<Point> = (0..12).map(|i| Point::new((i % 4) as f64, (i / 4) as f64, 0.0)).collect();
        let mut hull = outline(&grid);
        hull.sort_unstable();
        assert_eq!(hull, [0, 3, 8, 11]);
        let line: Vec<Point> = (0..5).map(|i| Point::new(i as f64, 0.0, 0.0)).collect();
        assert_eq!(outline(&line), [0, 4]);
        assert!(outline(&[Point::zeros(), Point::new(0.0, 0.0, 1.0), Point::x()]).is_empty());
    }

    #[test]
    fn bits_are_in_the_order_of_numbers() {
        let numbers = [-2.0, -1e-300, -0.0, 1e-300, 0.5, 7.0];
        assert!(numbers.windows(2).all(|w| ordered(w[0]) < ordered(w[1])));
        assert_eq!(ordered(-0.0), ordered(0.0));
    }

    /// The corner of a 90° pinhole is at (1, 0.75, 1); the corner of a fisheye beyond its field is at the limit of the field.
    #[test]
    fn borders_are_the_image_through_the_lens() {
        let matrix = CameraMatrix { fx_px: 320.0, fy_px: 320.0, cx_px: 319.5, cy_px: 239.5 };
        let size = ImageSize { width_px: 640, height_px: 480 };
        let area = Area { least: Pixel::new(-0.5, -0.5), greatest: Pixel::new(639.5, 479.5) };
        let pinhole = Camera::new(Pinhole::new(matrix).unwrap(), Some(size)).unwrap();
        let border = border_in_cam(&pinhole, &area);
        assert_eq!(border.len(), 4 * BORDER_STEPS);
        assert!((border[0] - Point::new(-1.0, -0.75, 1.0)).norm() < 1e-12);
        let matrix = CameraMatrix { fx_px: 110.0, fy_px: 110.0, ..matrix };
        let fisheye =
            Camera { lens: KannalaBrandt::new(matrix, &[0.0; 4]).unwrap().into(), size: Some(size) };
        let border = border_in_cam(&fisheye, &area);
        assert_eq!(border.len(), 4 * BORDER_STEPS);
        assert!(border.iter().all(|x| x.norm().is_finite() && x.norm() < 1.0 / LEAST_DEPTH + 1e-9));
    }

    /// A hundred thousand small motions drawn from Σ move the camera as `position_covariance` states; the ellipse contains 95 % of a plane
    /// section.
    #[test]
    fn places_scatter_as_their_covariance_says() {
        let pose = Pose::exp(&Vector6::new(0.4, -1.1, 0.3, 0.2, -0.5, 1.4));
        let sigma = [1e-3, 2e-3, 3e-3, 2e-3, 1e-3, 4e-3];
        let covariance = Matrix6::from_diagonal(&Vector6::from_iterator(sigma.map(|s| s * s)));
        let expected = position_covariance(&pose, &covariance);
        let plane = expected.fixed_view::<2, 2>(0, 0).into_owned();
        let (long, short, direction) = ellipse(&plane, CHI2_2_95.sqrt());
        let mut chance = resight_core::statistics::SplitMix64::new(7);
        let (mut sum, mut inside, n) = (Matrix3::zeros(), 0, 100_000);
        for _ in 0..n {
            let xi = Vector6::from_fn(|i, _| sigma[i] * chance.normal());
            let moved = (Pose::exp(&xi) * pose).origin() - pose.origin();
            sum += moved * moved.transpose();
            let (along, across) = (
                moved.x * direction.cos() + moved.y * direction.sin(),
                moved.y * direction.cos() - moved.x * direction.sin(),
            );
            inside += ((along / long).powi(2) + (across / short).powi(2) < 1.0) as usize;
        }
        // The variance of n draws has a relative standard deviation of √(2/n) = 0.45 %; the limit is five of them.
        assert!((sum / n as f64 - expected).norm() < 0.0225 * expected.norm());
        // A share of 0.95 over n draws has σ = 0.07 %; the limit is five of them.
        assert!((inside as f64 / n as f64 - 0.95).abs() < 0.0035, "{inside}");
    }

    /// A Aᵀ is the scaled covariance, and the columns are orthogonal, the longest first.
    #[test]
    fn half_axes_make_up_the_covariance() {
        let root = Matrix3::new(1.0, 0.2, -0.4, 0.0, 0.3, 0.7, 0.5, 0.0, 0.1);
        let axes = half_axes(&(root * root.transpose()), 2.0);
        assert!((axes * axes.transpose() - root * root.transpose() * 4.0).norm() < 1e-12);
        let lengths = [0, 1, 2].map(|i| axes.column(i).norm());
        assert!(lengths[1] <= lengths[0] && lengths[2] <= lengths[1]);
        assert!(
            (axes.tr_mul(&axes) - Matrix3::from_diagonal(&(axes.tr_mul(&axes)).diagonal())).norm() < 1e-12
        );
    }

    #[test]
    fn magnifications_are_1_2_5() {
        for (largest, wanted, factor) in [
            (0.001, 0.15, 100.0),
            (0.001, 0.25, 200.0),
            (3.0, 1.7, 0.5),
            (0.0, 1.0, 1.0),
            (f64::NAN, 1.0, 1.0),
        ] {
            assert!((magnification(largest, wanted) / factor - 1.0).abs() < 1e-12, "{largest} {wanted}");
        }
    }
}
