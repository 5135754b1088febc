//! P3P on a million problems of each family that is known to break solvers: nothing missed, nothing wrong, nothing twice.
//! Exact data only. The truth is known to the rounding of the bearings, and a pose is determined only as well as its roots stand apart:
//! what that leaves is counted as such, not forgiven (docs/math/p3p.md, section 6).

use crate::common::Rng;
use nalgebra::{Matrix3, Matrix6, Unit, Vector3};
use resight_core::solve::p3p::p3p;
use resight_core::{Bearing, Point, Pose};
use std::f64::consts::{PI, TAU};

const PROBLEMS: usize = 1_000_000;

/// Three points, their bearings, and the pose they are seen from.
struct Scene {
    places: [Point; 3],
    bearings: [Bearing; 3],
    cam_from_target: Pose,
}

impl Scene {
    fn new(places: [Point; 3], cam_from_target: Pose) -> Self {
        Scene { places, bearings: places.map(|x| Unit::new_normalize(cam_from_target * x)), cam_from_target }
    }

    /// Rotation error (chordal) plus relative translation error, as PoseLib's benchmark scores.
    fn error(&self, pose: &Pose) -> f64 {
        let truth = &self.cam_from_target;
        (pose.rotation - truth.rotation).norm()
            + (pose.translation - truth.translation).norm() / truth.translation.norm()
    }

    /// Largest chord between a point and its ray: large for points behind the camera, NaN for NaN.
    fn reprojection(&self, pose: &Pose) -> f64 {
        let miss = |i: usize| ((pose * &self.places[i]).normalize() - self.bearings[i].into_inner()).norm();
        let misses = [miss(0), miss(1), miss(2)];
        if misses.iter().any(|m| m.is_nan()) { f64::NAN } else { misses.into_iter().fold(0.0, f64::max) }
    }

    /// How far the rounding of the bearings alone moves the pose, in the measure of `error`: ε over the smallest singular value of the
    /// derivative of the bearings by the pose.
    fn rounding_floor(&self) -> f64 {
        let distance = self.cam_from_target.translation.norm();
        let mut jacobian = Matrix6::zeros();
        for (i, place) in self.places.iter().enumerate() {
            let x = self.cam_from_target * *place;
            let (range, b) = (x.norm(), self.bearings[i].into_inner());
            let side = b.cross(&Vector3::ith(b.iamin(), 1.0)).normalize();
            for (row, axis) in [side, b.cross(&side)].into_iter().enumerate() {
                // d(axis · x / |x|) by a rotation about the target's origin and by a shift of one distance.
                let turn = (x - self.cam_from_target.translation).cross(&axis) / range;
                let shift = axis * (distance / range);
                for k in 0..3 {
                    jacobian[(2 * i + row, k)] = turn[k];
                    jacobian[(2 * i + row, 3 + k)] = shift[k];
                }
            }
        }
        f64::EPSILON / jacobian.singular_values().min()
    }
}

fn in_box(rng: &mut Rng, half: f64) -> Point {
    Point::new(rng.uniform(-half, half), rng.uniform(-half, half), rng.uniform(-half, half))
}

/// A 1 m target 5 to 20 m away, anywhere in a field of 44° by 33°.
fn far_view(rng: &mut Rng) -> Pose {
    let z = rng.uniform(5.0, 20.0);
    Pose::new(rng.rotation(), Vector3::new(rng.uniform(-0.4, 0.4) * z, rng.uniform(-0.3, 0.3) * z, z))
}

/// PoseLib's generator: rays in a field of 75°, depths 0.1 to 10.
fn random(rng: &mut Rng) -> Scene {
    let cam_from_target = Pose::new(rng.rotation(), Vector3::new(rng.normal(), rng.normal(), rng.normal()));
    let edge = 37.5f64.to_radians().tan();
    let target_from_cam = cam_from_target.inverse();
    let places = [(); 3].map(|()| {
        let ray = Vector3::new(rng.uniform(-edge, edge), rng.uniform(-edge, edge), 1.0).normalize();
        target_from_cam * (ray * rng.uniform(0.1, 10.0))
    });
    Scene::new(places, cam_from_target)
}

fn far(rng: &mut Rng) -> Scene {
    Scene::new([(); 3].map(|()| in_box(rng, 0.5)), far_view(rng))
}

/// Third point 1e-6 to 1e-1 m off a 1 m line, in any order.
fn thin(rng: &mut Rng) -> Scene {
    let start = in_box(rng, 0.5);
    let along = rng.unit_vector();
    let across = along.cross(&rng.unit_vector()).normalize();
    let height = 10f64.powf(rng.uniform(-6.0, -1.0));
    let mut places = [start, start + along, start + along * rng.uniform(0.0, 1.0) + across * height];
    places.swap(rng.index(3), 0);
    places.swap(1 + rng.index(2), 1);
    Scene::new(places, far_view(rng))
}

/// Camera on the right cylinder over the circumcircle: a double root.
fn on_the_danger_cylinder(rng: &mut Rng) -> Scene {
    let mut on_circle = || rng.uniform(0.0, TAU).sin_cos();
    let places = [(); 3].map(|()| on_circle()).map(|(y, x)| Point::new(x, y, 0.0));
    let (y, x) = on_circle();
    let rotation = rng.rotation();
    let origin = Point::new(x, y, rng.uniform(0.3, 5.0));
    Scene::new(places, Pose::new(rotation, -(rotation * origin)))
}

/// The view that Lambda Twist missed: a right angle along the axes, the camera not turned, often above a corner.
fn right_angle(rng: &mut Rng) -> Scene {
    let (x, y) = (0.5 * rng.uniform(-2.0, 2.0).round(), 0.5 * rng.uniform(-2.0, 2.0).round());
    let (width, height) = (rng.uniform(0.1, 2.0), rng.uniform(0.1, 2.0));
    let places = [Point::new(x, y, 0.0), Point::new(x + width, y, 0.0), Point::new(x, y + height, 0.0)];
    Scene::new(places, Pose::new(Matrix3::identity(), Vector3::new(0.0, 0.0, rng.uniform(1.0, 10.0))))
}

/// The foot of C on the plane of the rays to A and B lies on the circle through the camera, A and B: one root of the quartic for two poses.
fn trammel(rng: &mut Rng) -> Scene {
    let radius = rng.uniform(1.0, 5.0);
    // Seen from a point of the circle at the origin; C lies between A and B as seen, so that these two are the widest pair.
    let on_circle = |turn: f64| Vector3::new(radius * turn.sin(), 0.0, radius * (1.0 + turn.cos()));
    let (left, right) = (rng.uniform(-1.4, -0.5), rng.uniform(0.5, 1.4));
    let lift = Vector3::y() * (rng.uniform(0.02, 0.3) * radius);
    let third = on_circle(rng.uniform(-0.4, 0.4)) + lift;
    let (cam_from_circle, cam_from_target) =
        (rng.rotation(), Pose::new(rng.rotation(), rng.unit_vector() * radius));
    let target_from_cam = cam_from_target.inverse();
    let mut places = [on_circle(left), on_circle(right), third]
        .map(|x| target_from_cam * Point::from(cam_from_circle * x));
    places.swap(rng.index(3), 0);
    Scene::new(places, cam_from_target)
}

/// What became of a family.
#[derive(Debug, Default)]
struct Tally {
    /// No pose within 1e-6 of the truth; and of those, where rounding alone does not move the pose by 1e-6.
    missed: usize,
    missed_though_determined: usize,
    missed_1e_3: usize,
    /// No pose reprojects to 1e-9.
    none_reprojects: usize,
    /// Poses that do not reproject to 1e-8 (NaN and behind the camera included) or are no rotations.
    bad: usize,
    duplicates: usize,
    solutions: usize,
}

fn is_rotation(r: &Matrix3<f64>) -> bool {
    (r.transpose() * r - Matrix3::identity()).norm() < 1e-14 && 0.0 < r.determinant()
}

fn tally(seed: u64, problem: fn(&mut Rng) -> Scene) -> Tally {
    let mut rng = Rng::new(seed);
    let mut tally = Tally::default();
    for _ in 0..PROBLEMS {
        let scene = problem(&mut rng);
        let poses = p3p(&scene.bearings, &scene.places);
        let mut reprojects = false;
        for (i, pose) in poses.iter().enumerate() {
            let miss = scene.reprojection(pose);
            reprojects |= miss < 1e-9;
            tally.bad += usize::from(!(miss < 1e-8 && is_rotation(&pose.rotation)));
            tally.duplicates +=
                poses[..i].iter().filter(|o| (o.rotation - pose.rotation).norm() < 1e-9).count();
        }
        tally.none_reprojects += usize::from(!reprojects);
        let error = poses.iter().map(|pose| scene.error(pose)).fold(f64::INFINITY, f64::min);
        tally.missed_1e_3 += usize::from(!(error < 1e-3));
        if !(error < 1e-6) {
            tally.missed += 1;
            tally.missed_though_determined += usize::from(scene.rounding_floor() < 1e-6);
        }
        tally.solutions += poses.len();
    }
    println!("{tally:?}");
    assert_eq!((tally.bad, tally.duplicates), (0, 0), "{tally:?}");
    tally
}

#[test]
fn every_random_pose_is_found() {
    let tally = tally(1, random);
    assert_eq!((tally.missed, tally.none_reprojects), (0, 0));
    let mean = tally.solutions as f64 / PROBLEMS as f64;
    assert!((1.72..1.735).contains(&mean), "PoseLib finds 1.728 on its own problems: {mean}");
}

#[test]
fn every_far_pose_is_found() {
    let tally = tally(2, far);
    assert_eq!((tally.missed, tally.none_reprojects), (0, 0));
}

/// 99.99 % at 1e-6; in every view missed, rounding of the bearings alone moves the pose by more than 1e-6, and where it removes
/// the two roots altogether their middle still reprojects.
#[test]
fn nearly_straight_triples_keep_their_digits() {
    let tally = tally(3, thin);
    assert!(tally.missed <= PROBLEMS / 10_000 && tally.none_reprojects == 0, "{tally:?}");
    assert_eq!(tally.missed_though_determined, 0);
}

/// Scored by reprojection, because a double root is determined to √ε only. None, one or two in a million (four seeds) come out more than
/// 1e-3 from the pose the scene was made from: roots that are nearly triple (docs/math/p3p.md, section 6).
#[test]
fn on_the_danger_cylinder_a_pose_always_reprojects() {
    let tally = tally(4, on_the_danger_cylinder);
    assert_eq!(tally.none_reprojects, 0);
    assert!(tally.missed_1e_3 <= 2, "{tally:?}");
}

#[test]
fn every_axis_aligned_right_angle_is_found() {
    let tally = tally(5, right_angle);
    assert_eq!((tally.missed, tally.none_reprojects), (0, 0));
}

/// φ comes from the height of C, not from the root. Not all: 0.08 % of the true poses have their companion so near in φ that both
/// starts end at it (docs/math/p3p.md, section 6).
#[test]
fn both_poses_of_a_trammel_are_found() {
    let tally = tally(9, trammel);
    assert_eq!(tally.none_reprojects, 0);
    assert!(tally.missed <= PROBLEMS / 1_000, "{tally:?}");
}

/// A view along the axes of a half-metre grid: (−1, 0, 5), (½, ½, 4½), (1, 0, 4) from (−1, 0, 0), two of whose four poses share a root.
#[test]
fn trammel_on_a_grid_regression() {
    let places = [Point::new(-1.0, 0.0, 5.0), Point::new(0.5, 0.5, 4.5), Point::new(1.0, 0.0, 4.0)];
    for order in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
        let scene = Scene::new(order.map(|i| places[i]), Pose::new(Matrix3::identity(), Vector3::x()));
        let poses = p3p(&scene.bearings, &scene.places);
        assert_eq!(poses.len(), 4, "{order:?}");
        assert!(poses.iter().any(|pose| scene.error(pose) < 1e-12), "{order:?}");
        assert!(poses.iter().all(|pose| scene.reprojection(pose) < 1e-14), "{order:?}");
    }
}

#[test]
fn a_straight_triple_is_refused() {
    let mut rng = Rng::new(6);
    for _ in 0..PROBLEMS {
        let (start, along) = (in_box(&mut rng, 0.5), rng.unit_vector());
        let places = [0.0, rng.uniform(-2.0, 2.0), rng.uniform(-2.0, 2.0)].map(|at| start + along * at);
        let scene = Scene::new(places, far_view(&mut rng));
        assert!(p3p(&scene.bearings, &scene.places).is_empty(), "{places:?}");
    }
}

/// Sign changes of |C − B|² − |CB|² along the one-parameter family that has A and B at their distance, C at its distance from A: by the
/// law of sines, without the quartic. A lower bound on the number of poses: pairs closer than a step escape it.
fn poses_seen_by_scanning(scene: &Scene) -> usize {
    const STEPS: usize = 2_000;
    let [a, b, c] = scene.bearings.map(|y| y.into_inner());
    let [ab, ac, bc] = [(0, 1), (0, 2), (1, 2)].map(|(i, j)| (scene.places[i] - scene.places[j]).norm());
    let gamma = a.cross(&b).norm().atan2(a.dot(&b));
    let excess = |step: usize, side: f64| {
        let at_b = (PI - gamma) * (step as f64 + 0.5) / STEPS as f64;
        let (depth_a, depth_b) = (ab * at_b.sin() / gamma.sin(), ab * (at_b + gamma).sin() / gamma.sin());
        let along = depth_a * a.dot(&c);
        let square = ac * ac - (depth_a * depth_a - along * along);
        let depth_c = along + side * square.max(0.0).sqrt();
        (0.0 <= square && 0.0 < depth_c).then(|| (c * depth_c - b * depth_b).norm_squared() - bc * bc)
    };
    let crossings = |side: f64| {
        let values = (0..STEPS).map(move |step| excess(step, side));
        let next = (1..STEPS).map(move |step| excess(step, side));
        values.zip(next).filter(|pair| matches!(pair, (Some(x), Some(y)) if (*x < 0.0) != (*y < 0.0))).count()
    };
    crossings(1.0) + crossings(-1.0)
}

/// The other poses are found too. What the scan cannot see (pairs within a step) is not checked here.
#[test]
fn no_companion_is_missed() {
    for (seed, problem) in [(7, random as fn(&mut Rng) -> Scene), (8, far)] {
        let mut rng = Rng::new(seed);
        let (mut scanned, mut found) = (0, 0);
        for _ in 0..2_500 {
            let scene = problem(&mut rng);
            let (seen, poses) = (poses_seen_by_scanning(&scene), p3p(&scene.bearings, &scene.places));
            assert!(seen <= poses.len(), "{seen} seen, {} found: {:?}", poses.len(), scene.places);
            (scanned, found) = (scanned + seen, found + poses.len());
        }
        println!("{scanned} seen by scanning, {found} found");
        // It saw 97 and 98 % when this was written.
        assert!(0.95 * (found as f64) < scanned as f64, "the scan sees too little to prove anything");
    }
}
