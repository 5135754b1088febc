//! One suite for all closed forms: exact points give the exact pose, never more solutions than stated, and the answer does not depend on
//! frame, unit or order. Exact data only; what noise does is tested where poses are refined.

use crate::common::Rng;
use nalgebra::{Matrix3, Unit, Vector3};
use resight_core::solve::{Candidates, p3p::p3p, planar::planar, sqpnp::sqpnp};
use resight_core::{Bearing, Camera, Correspondence, Point, Pose};

/// Points, and the pose they are seen from.
struct Scene {
    places: Vec<Point>,
    cam_from_target: Pose,
}

impl Scene {
    fn correspondences(&self) -> Vec<Correspondence> {
        let camera = Camera::normalized();
        let seen = |x: &Point| {
            let y = self.cam_from_target * *x;
            let pixel = camera.project(&y).unwrap_or_default();
            let bearing = Unit::new_normalize(y);
            Correspondence {
                x_in_target: *x,
                pixel,
                bearing,
                sigma_px: 1.0,
                covariance_px2: None,
                sigma_m: 0.0,
            }
        };
        self.places.iter().map(seen).collect()
    }

    fn triple(&self) -> ([Bearing; 3], [Point; 3]) {
        let seen = self.correspondences();
        ([0, 1, 2].map(|i| seen[i].bearing), [0, 1, 2].map(|i| self.places[i]))
    }

    /// Rotation error (chordal) plus relative translation error, as PoseLib's benchmark scores.
    fn error(&self, pose: &Pose) -> f64 {
        let truth = &self.cam_from_target;
        (pose.rotation - truth.rotation).norm()
            + (pose.translation - truth.translation).norm() / truth.translation.norm()
    }

    fn least_error(&self, candidates: &Candidates) -> f64 {
        candidates.iter().map(|pose| self.error(pose)).fold(f64::INFINITY, f64::min)
    }
}

/// Largest angle (chord) between a point and its ray: also counts points behind the camera.
fn reprojection(pose: &Pose, bearings: &[Bearing; 3], places: &[Point; 3]) -> f64 {
    let miss = |i: usize| ((pose * &places[i]).normalize() - bearings[i].into_inner()).norm();
    miss(0).max(miss(1)).max(miss(2))
}

fn in_box(rng: &mut Rng, half: [f64; 3]) -> Point {
    Point::from(half.map(|h| rng.uniform(-h, h)))
}

/// A 1 m target 5 to 20 m away, anywhere in a field of 44° by 33°.
fn far_view(rng: &mut Rng) -> Pose {
    let z = rng.uniform(5.0, 20.0);
    Pose::new(rng.rotation(), Vector3::new(rng.uniform(-0.4, 0.4) * z, rng.uniform(-0.3, 0.3) * z, z))
}

// ---------------------------------------------------------------------------------------------- families of three points

/// PoseLib's generator: rays in a field of 75°, depths 0.1 to 10.
fn random_triple(rng: &mut Rng) -> Scene {
    let cam_from_target = Pose::new(rng.rotation(), Vector3::new(rng.normal(), rng.normal(), rng.normal()));
    let edge = 37.5f64.to_radians().tan();
    let target_from_cam = cam_from_target.inverse();
    let mut place = || {
        let ray = Vector3::new(rng.uniform(-edge, edge), rng.uniform(-edge, edge), 1.0).normalize();
        target_from_cam * (ray * rng.uniform(0.1, 10.0))
    };
    Scene { places: vec![place(), place(), place()], cam_from_target }
}

fn far_triple(rng: &mut Rng) -> Scene {
    let places = (0..3).map(|_| in_box(rng, [0.5; 3])).collect();
    Scene { places, cam_from_target: far_view(rng) }
}

/// Third point 1e-6 to 1e-1 m off a 1 m line, in any order.
fn thin_triple(rng: &mut Rng) -> Scene {
    let start = in_box(rng, [0.5; 3]);
    let along = rng.unit_vector();
    let across = along.cross(&rng.unit_vector()).normalize();
    let height = 10f64.powf(rng.uniform(-6.0, -1.0));
    let mut places = vec![start, start + along, start + along * rng.uniform(0.0, 1.0) + across * height];
    places.swap(rng.index(3), 0);
    places.swap(1 + rng.index(2), 1);
    Scene { places, cam_from_target: far_view(rng) }
}

/// Camera on the right cylinder over the circumcircle: a double root.
fn on_the_danger_cylinder(rng: &mut Rng) -> Scene {
    let mut on_circle = || rng.uniform(0.0, std::f64::consts::TAU).sin_cos();
    let places = (0..3).map(|_| on_circle()).map(|(y, x)| Point::new(x, y, 0.0)).collect();
    let (y, x) = on_circle();
    let rotation = rng.rotation();
    let origin = Point::new(x, y, rng.uniform(0.3, 5.0));
    Scene { places, cam_from_target: Pose::new(rotation, -(rotation * origin)) }
}

/// The view that Lambda Twist missed: a right angle along the axes, the camera not turned, often above a corner.
fn axis_aligned_right_angle(rng: &mut Rng) -> Scene {
    let (x, y) = (0.5 * rng.uniform(-2.0, 2.0).round(), 0.5 * rng.uniform(-2.0, 2.0).round());
    let (width, height) = (rng.uniform(0.1, 2.0), rng.uniform(0.1, 2.0));
    let places = vec![Point::new(x, y, 0.0), Point::new(x + width, y, 0.0), Point::new(x, y + height, 0.0)];
    Scene {
        places,
        cam_from_target: Pose::new(Matrix3::identity(), Vector3::new(0.0, 0.0, rng.uniform(1.0, 10.0))),
    }
}

/// What became of a family of problems.
#[derive(Debug, Default)]
struct Tally {
    missed_1e_6: usize,
    missed_reprojection_1e_9: usize,
    bad_poses: usize,
    duplicates: usize,
    solutions: usize,
}

const PROBLEMS: usize = 100_000;

fn tally(seed: u64, problem: fn(&mut Rng) -> Scene) -> Tally {
    let mut rng = Rng::new(seed);
    let mut tally = Tally::default();
    for _ in 0..PROBLEMS {
        let scene = problem(&mut rng);
        let (bearings, places) = scene.triple();
        let poses = p3p(&bearings, &places);
        let misses = poses.iter().map(|pose| reprojection(pose, &bearings, &places));
        tally.missed_1e_6 += usize::from(!(scene.least_error(&poses) < 1e-6));
        tally.missed_reprojection_1e_9 += usize::from(!(misses.clone().fold(f64::INFINITY, f64::min) < 1e-9));
        // Also counts NaN, points behind the camera and matrices that are no rotations.
        tally.bad_poses += misses.filter(|miss| !(*miss < 1e-8)).count();
        tally.bad_poses += poses.iter().filter(|pose| !is_rotation(&pose.rotation)).count();
        tally.solutions += poses.len();
        for (i, pose) in poses.iter().enumerate() {
            tally.duplicates +=
                poses[..i].iter().filter(|other| (other.rotation - pose.rotation).norm() < 1e-9).count();
        }
    }
    println!("{tally:?}");
    tally
}

fn is_rotation(r: &Matrix3<f64>) -> bool {
    (r.transpose() * r - Matrix3::identity()).norm() < 1e-14 && 0.0 < r.determinant()
}

#[test]
fn p3p_finds_every_random_pose() {
    let tally = tally(1, random_triple);
    assert_eq!(
        (tally.missed_1e_6, tally.missed_reprojection_1e_9, tally.bad_poses, tally.duplicates),
        (0, 0, 0, 0)
    );
    let mean = tally.solutions as f64 / PROBLEMS as f64;
    assert!((1.70..1.75).contains(&mean), "PoseLib finds 1.728 on its own problems: {mean}");
}

#[test]
fn p3p_finds_every_far_pose() {
    let tally = tally(2, far_triple);
    assert_eq!(
        (tally.missed_1e_6, tally.missed_reprojection_1e_9, tally.bad_poses, tally.duplicates),
        (0, 0, 0, 0)
    );
}

/// The few that miss 1e-6 reproject to rounding: their two poses are so close that the rounding of the bearings themselves moves
/// them by more (docs/math/p3p.md, section 6).
#[test]
fn p3p_loses_nothing_when_the_triple_is_nearly_straight() {
    let tally = tally(3, thin_triple);
    assert_eq!((tally.missed_reprojection_1e_9, tally.bad_poses, tally.duplicates), (0, 0, 0));
    assert!(tally.missed_1e_6 <= PROBLEMS / 10_000, "{tally:?}");
}

/// A double root is determined to √ε only, so the pose is scored by its reprojection.
#[test]
fn p3p_finds_the_double_root_on_the_danger_cylinder() {
    let tally = tally(4, on_the_danger_cylinder);
    assert_eq!((tally.missed_reprojection_1e_9, tally.bad_poses, tally.duplicates), (0, 0, 0));
}

#[test]
fn p3p_finds_the_axis_aligned_right_angle() {
    let tally = tally(5, axis_aligned_right_angle);
    assert_eq!(
        (tally.missed_1e_6, tally.missed_reprojection_1e_9, tally.bad_poses, tally.duplicates),
        (0, 0, 0, 0)
    );
}

#[test]
fn p3p_refuses_a_straight_triple() {
    let mut rng = Rng::new(6);
    for _ in 0..PROBLEMS {
        let (start, along) = (in_box(&mut rng, [0.5; 3]), rng.unit_vector());
        let places =
            vec![start, start + along * rng.uniform(-2.0, 2.0), start + along * rng.uniform(-2.0, 2.0)];
        let scene = Scene { places, cam_from_target: far_view(&mut rng) };
        let (bearings, places) = scene.triple();
        assert!(p3p(&bearings, &places).is_empty(), "{places:?}");
    }
}

#[test]
fn p3p_returns_nothing_for_hostile_input() {
    let mut rng = Rng::new(7);
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 0.0];
    for _ in 0..2_000 {
        let (bearings, places) = random_triple(&mut rng).triple();
        let value = bad[rng.index(bad.len())];
        let (mut broken_places, mut broken_bearings) = (places, bearings);
        broken_places[rng.index(3)][rng.index(3)] = value;
        let mut vector = bearings[0].into_inner();
        vector[rng.index(3)] = value;
        broken_bearings[rng.index(3)] = Unit::new_unchecked(vector);
        let twice = [bearings[0], bearings[0], bearings[1]];
        let same_place = [places[0], places[1], places[0]];
        for pose in p3p(&bearings, &broken_places)
            .into_iter()
            .chain(p3p(&broken_bearings, &places))
            .chain(p3p(&twice, &places))
            .chain(p3p(&bearings, &same_place))
        {
            assert!(pose.rotation.iter().chain(pose.translation.iter()).all(|x| x.is_finite()), "{pose:?}");
        }
        assert!(p3p(&bearings, &same_place).is_empty());
    }
}

// ---------------------------------------------------------------------------------------------- all solvers

/// A solver and the scenes it is for. `tolerance` for exact points.
struct Contract {
    name: &'static str,
    solve: fn(&[Correspondence]) -> Candidates,
    scene: fn(&mut Rng) -> Scene,
    most: usize,
    tolerance: f64,
}

fn p3p_of_correspondences(points: &[Correspondence]) -> Candidates {
    p3p(&[0, 1, 2].map(|i| points[i].bearing), &[0, 1, 2].map(|i| points[i].x_in_target))
}

/// Four to 30 points of a board in any plane of the target frame, seen from either face, not from the edge.
fn board(rng: &mut Rng) -> Scene {
    loop {
        let n = 4 + rng.index(27);
        let mut places: Vec<Point> = (0..n).map(|_| in_box(rng, [0.5, 0.5, 0.0])).collect();
        places[..4].copy_from_slice(
            &[(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)].map(|(x, y)| Point::new(x, y, 0.0)),
        );
        let cam_from_board = far_view(rng);
        let normal = cam_from_board.rotation.column(2);
        if normal.dot(&cam_from_board.translation).abs() < 0.2 * cam_from_board.translation.norm() {
            continue;
        }
        let target_from_board = Pose::new(rng.rotation(), in_box(rng, [3.0; 3]));
        let places = places.into_iter().map(|x| target_from_board * x).collect();
        return Scene { places, cam_from_target: cam_from_board * target_from_board.inverse() };
    }
}

/// Six to 30 points of a 1 m cloud.
fn cloud(rng: &mut Rng) -> Scene {
    let n = 6 + rng.index(25);
    let places = (0..n).map(|_| in_box(rng, [0.5; 3])).collect();
    Scene { places, cam_from_target: far_view(rng) }
}

const CONTRACTS: [Contract; 4] = [
    Contract { name: "p3p", solve: p3p_of_correspondences, scene: far_triple, most: 4, tolerance: 1e-7 },
    Contract { name: "planar", solve: planar, scene: board, most: 2, tolerance: 1e-6 },
    Contract { name: "sqpnp", solve: sqpnp, scene: cloud, most: 4, tolerance: 1e-3 },
    Contract { name: "sqpnp on boards", solve: sqpnp, scene: board, most: 4, tolerance: 1e-3 },
];

#[test]
fn exact_points_give_the_exact_pose() {
    for contract in &CONTRACTS {
        let mut rng = Rng::new(11);
        let (mut misses, mut worst) = (0, 0.0f64);
        for _ in 0..10_000 {
            let scene = (contract.scene)(&mut rng);
            let error = scene.least_error(&(contract.solve)(&scene.correspondences()));
            if error < contract.tolerance { worst = worst.max(error) } else { misses += 1 }
        }
        println!("{}: {misses} misses, worst of the others {worst:.1e}", contract.name);
        assert_eq!(misses, 0, "{}", contract.name);
    }
}

#[test]
fn at_most_n_solutions_and_all_of_them_rotations() {
    for contract in &CONTRACTS {
        let mut rng = Rng::new(12);
        for _ in 0..3_000 {
            let poses = (contract.solve)(&(contract.scene)(&mut rng).correspondences());
            assert!(poses.len() <= contract.most, "{}", contract.name);
            assert!(poses.iter().all(|pose| is_rotation(&pose.rotation)), "{}", contract.name);
        }
    }
}

/// Another target frame, unit or order changes the poses as it must and nothing else.
#[test]
fn frame_unit_and_order_do_not_matter() {
    for contract in &CONTRACTS {
        let mut rng = Rng::new(13);
        let mut misses = 0;
        for trial in 0..3_000 {
            let scene = (contract.scene)(&mut rng);
            let scale = [1e-9, 1.0, 1e9][trial % 3];
            let new_from_old = Pose::new(rng.rotation(), in_box(&mut rng, [5.0; 3]));
            let mut places: Vec<Point> = scene.places.iter().map(|x| (new_from_old * *x) * scale).collect();
            places.rotate_left(rng.index(scene.places.len()));
            places.swap(0, 1);
            let moved = scene.cam_from_target * new_from_old.inverse();
            let scene =
                Scene { places, cam_from_target: Pose::new(moved.rotation, moved.translation * scale) };
            let error = scene.least_error(&(contract.solve)(&scene.correspondences()));
            misses += usize::from(!(error < contract.tolerance));
        }
        assert_eq!(misses, 0, "{}", contract.name);
    }
}

// ---------------------------------------------------------------------------------------------- boards

/// Where OpenCV's planar solver fails (rosys pull request 479): the normal towards the camera or away, the view face on.
#[test]
fn planar_works_face_on_from_either_side() {
    let camera = Camera::normalized();
    let corners = [(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)];
    let flip = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0));
    for rotation in [Matrix3::identity(), flip] {
        for axis in 0..3 {
            let mut target_from_board = Matrix3::zeros();
            for i in 0..3 {
                target_from_board[((i + axis) % 3, i)] = 1.0;
            }
            let truth = Pose::new(rotation * target_from_board.transpose(), Vector3::new(0.0, 0.0, 4.0));
            let points: Vec<Correspondence> = corners
                .iter()
                .map(|(x, y)| target_from_board * Point::new(*x, *y, 0.0))
                .filter_map(|x| Correspondence::new(&camera, x, camera.project(&(truth * x))?, 1.0).ok())
                .collect();
            let poses = planar(&points);
            let least =
                poses.iter().map(|p| (p.rotation - truth.rotation).norm()).fold(f64::INFINITY, f64::min);
            assert!(least < 1e-6, "{least:e} {poses:?}");
        }
    }
}

#[test]
fn planar_refuses_what_determines_no_homography() {
    let mut rng = Rng::new(21);
    for _ in 0..1_000 {
        let mut scene = board(&mut rng);
        let [a, b] = [scene.places[0], scene.places[1]];
        scene.places.truncate(4);
        scene.places[2] = a + (b - a) * 0.3;
        assert!(planar(&scene.correspondences()).is_empty());
        assert!(planar(&scene.correspondences()[..3]).is_empty());
    }
}

/// Both minima: a small distant board has two poses, mirrored about the line of sight, that project alike.
#[test]
fn planar_returns_the_mirrored_pose_too() {
    let mut rng = Rng::new(22);
    for _ in 0..1_000 {
        let scene = board(&mut rng);
        let poses = planar(&scene.correspondences());
        let centroid = scene.places.iter().sum::<Point>() / scene.places.len() as f64;
        let sight = (scene.cam_from_target * centroid).normalize();
        let normals: Vec<Vector3<f64>> =
            poses.iter().map(|pose| board_normal(pose, &scene.places, &sight)).collect();
        let tilt = normals[0].cross(&sight).norm();
        if !(0.3..0.9).contains(&tilt) {
            continue; // face on the two may be one; near the edge the other minimum may show the other face
        }
        assert_eq!(poses.len(), 2);
        let mirrored = sight * (2.0 * normals[0].dot(&sight)) - normals[0];
        assert!((normals[1] - mirrored).norm() < 0.35, "{} {}", normals[0], normals[1]);
    }
}

/// Normal of the first three places in the camera frame, towards the camera's far side.
fn board_normal(pose: &Pose, places: &[Point], sight: &Vector3<f64>) -> Vector3<f64> {
    let normal = pose.rotation * (places[1] - places[0]).cross(&(places[2] - places[0])).normalize();
    if normal.dot(sight) < 0.0 { -normal } else { normal }
}

#[test]
fn n_point_solvers_return_nothing_for_hostile_input() {
    let mut rng = Rng::new(23);
    let bad = [f64::NAN, f64::INFINITY, f64::MAX, -f64::MAX];
    for solve in [planar, sqpnp] {
        assert!(solve(&[]).is_empty());
        for _ in 0..500 {
            let mut points = board(&mut rng).correspondences();
            assert!(solve(&points[..2]).is_empty());
            let value = bad[rng.index(bad.len())];
            let which = rng.index(points.len());
            if rng.index(2) == 0 {
                points[which].x_in_target[rng.index(3)] = value;
            } else {
                let mut vector = points[which].bearing.into_inner();
                vector[rng.index(3)] = value;
                points[which].bearing = Unit::new_unchecked(vector);
            }
            for pose in solve(&points) {
                assert!(
                    pose.rotation.iter().chain(pose.translation.iter()).all(|x| x.is_finite()),
                    "{pose:?}"
                );
            }
        }
        let same = vec![board(&mut rng).correspondences()[0]; 6];
        assert!(solve(&same).is_empty());
    }
}
