//! The minimal solvers of a rig: exact rays give the exact pose, nothing behind a camera, nothing twice, no NaN. Exact data only; what
//! noise does is tested in `rig_pose.rs`.

use crate::common::Rng;
use nalgebra::{Matrix3, Matrix6, Unit, Vector3};
use resight_core::solve::gp3p::{Ray, gp3p};
use resight_core::solve::p3p::p3p;
use resight_core::solve::upright_gp2p::upright_gp2p;
use resight_core::{Point, Pose};

/// Rays of a rig, the points they see, and the pose.
struct Scene<const N: usize> {
    rays: [Ray; N],
    places: [Point; N],
    rig_from_target: Pose,
}

impl<const N: usize> Scene<N> {
    /// Rays from the origins to the places.
    fn new(origins: [Point; N], places: [Point; N], rig_from_target: Pose) -> Self {
        let ray = |i: usize| Ray {
            origin_in_rig: origins[i],
            bearing_in_rig: Unit::new_normalize(rig_from_target * places[i] - origins[i]),
        };
        Scene { rays: core::array::from_fn(ray), places, rig_from_target }
    }

    /// Rotation error (chordal) plus translation error relative to the farthest point, at least 1 m.
    fn error(&self, rig_from_target: &Pose) -> f64 {
        let truth = &self.rig_from_target;
        (rig_from_target.rotation - truth.rotation).norm()
            + (rig_from_target.translation - truth.translation).norm() / truth.translation.norm().max(1.0)
    }

    /// Largest angle (chord) between a point and its ray: also counts points behind their camera.
    fn reprojection(&self, rig_from_target: &Pose) -> f64 {
        let miss = |i: usize| {
            let seen = rig_from_target * &self.places[i] - self.rays[i].origin_in_rig;
            (seen.normalize() - self.rays[i].bearing_in_rig.into_inner()).norm()
        };
        (0..N).map(miss).fold(0.0, |most, miss| if miss <= most { most } else { miss })
    }
}

fn in_box(rng: &mut Rng, half: f64) -> Point {
    Point::new(rng.uniform(-half, half), rng.uniform(-half, half), rng.uniform(-half, half))
}

/// As PoseLib's generator: rays in a field of 75°, depths 0.1 to 10, origins in a box of 2 m.
fn random_scene<const N: usize>(rng: &mut Rng) -> Scene<N> {
    scattered(rng, 1.0)
}

/// The same with origins in a box of the given half-width.
fn scattered<const N: usize>(rng: &mut Rng, half: f64) -> Scene<N> {
    let rig_from_target = Pose::new(rng.rotation(), Vector3::new(rng.normal(), rng.normal(), rng.normal()));
    let edge = 37.5f64.to_radians().tan();
    let origins = core::array::from_fn(|_| in_box(rng, half));
    let target_from_rig = rig_from_target.inverse();
    let places = origins.map(|origin| {
        let ray = Vector3::new(rng.uniform(-edge, edge), rng.uniform(-edge, edge), 1.0).normalize();
        target_from_rig * (origin + ray * rng.uniform(0.1, 10.0))
    });
    Scene::new(origins, places, rig_from_target)
}

/// Cameras that look anywhere, as on a vehicle.
fn all_around<const N: usize>(rng: &mut Rng) -> Scene<N> {
    let rig_from_target = Pose::new(rng.rotation(), Vector3::new(rng.normal(), rng.normal(), rng.normal()));
    let origins = core::array::from_fn(|_| in_box(rng, 1.0));
    let target_from_rig = rig_from_target.inverse();
    let places =
        origins.map(|origin| target_from_rig * (origin + rng.unit_vector() * rng.uniform(0.5, 10.0)));
    Scene::new(origins, places, rig_from_target)
}

/// A 1 m target 5 to 20 m away from a rig of 1 m.
fn far_scene<const N: usize>(rng: &mut Rng) -> Scene<N> {
    let rig_from_target = Pose::new(rng.rotation(), rng.unit_vector() * rng.uniform(5.0, 20.0));
    let (origins, places) =
        (core::array::from_fn(|_| in_box(rng, 0.5)), core::array::from_fn(|_| in_box(rng, 0.5)));
    Scene::new(origins, places, rig_from_target)
}

/// Two rays from one camera, the third from another.
fn stereo_scene(rng: &mut Rng) -> Scene<3> {
    let Scene { rays, places, rig_from_target } = random_scene::<3>(rng);
    let mut origins = rays.map(|ray| ray.origin_in_rig);
    let [from, to] = [[0, 1], [1, 2], [2, 0]][rng.index(3)];
    origins[to] = origins[from];
    Scene::new(origins, places, rig_from_target)
}

/// What became of a family of problems.
#[derive(Debug, Default)]
struct Tally {
    missed_1e_6: usize,
    missed_reprojection_1e_9: usize,
    bad_poses: usize,
    duplicates: usize,
    solutions: usize,
    most: usize,
}

impl Tally {
    fn add<const N: usize>(&mut self, scene: &Scene<N>, poses: &[Pose]) {
        let least = |errors: &mut dyn Iterator<Item = f64>| errors.fold(f64::INFINITY, f64::min);
        let misses = || poses.iter().map(|pose| scene.reprojection(pose));
        self.missed_1e_6 += usize::from(!(least(&mut poses.iter().map(|pose| scene.error(pose))) < 1e-6));
        self.missed_reprojection_1e_9 += usize::from(!(least(&mut misses()) < 1e-9));
        // Also counts NaN, points behind the camera and matrices that are no rotations.
        self.bad_poses += misses().filter(|miss| !(*miss < 1e-8)).count();
        self.bad_poses += poses.iter().filter(|pose| !is_rotation(&pose.rotation)).count();
        self.solutions += poses.len();
        self.most = self.most.max(poses.len());
        for (i, pose) in poses.iter().enumerate() {
            let is_duplicate = |other: &&Pose| {
                (other.rotation - pose.rotation).norm() + (other.translation - pose.translation).norm() < 1e-9
            };
            self.duplicates += poses[..i].iter().filter(is_duplicate).count();
        }
    }
}

fn is_rotation(r: &Matrix3<f64>) -> bool {
    (r.transpose() * r - Matrix3::identity()).norm() < 1e-14 && 0.0 < r.determinant()
}

const PROBLEMS: usize = 200_000;
/// Upright problems cost a sixth.
const UPRIGHT_PROBLEMS: usize = 1_000_000;

fn gp3p_tally(seed: u64, problem: impl Fn(&mut Rng) -> Scene<3>) -> Tally {
    let (mut rng, mut tally) = (Rng::new(seed), Tally::default());
    for _ in 0..PROBLEMS {
        let scene = problem(&mut rng);
        tally.add(&scene, &gp3p(&scene.rays, &scene.places));
    }
    println!("{tally:?}");
    tally
}

fn nothing_wrong(tally: &Tally) {
    let Tally { missed_1e_6, missed_reprojection_1e_9, bad_poses, duplicates, .. } = *tally;
    assert_eq!((missed_1e_6, missed_reprojection_1e_9, bad_poses, duplicates), (0, 0, 0, 0), "{tally:?}");
    assert!(tally.most <= 8);
}

#[test]
fn gp3p_finds_every_random_pose() {
    nothing_wrong(&gp3p_tally(1, random_scene));
}

#[test]
fn gp3p_finds_every_pose_of_cameras_that_look_anywhere() {
    nothing_wrong(&gp3p_tally(2, all_around));
}

#[test]
fn gp3p_finds_every_far_pose() {
    nothing_wrong(&gp3p_tally(3, far_scene));
}

#[test]
fn gp3p_finds_every_pose_when_two_rays_share_a_camera() {
    nothing_wrong(&gp3p_tally(4, stereo_scene));
}

/// Third point 1e-6 to 1e-1 m off a line of 1 m, in any order, 5 to 20 m away. The few that miss 1e-6 reproject: rounding of
/// the bearings moves their poses by more.
#[test]
fn gp3p_loses_nothing_when_the_triple_is_nearly_straight() {
    let tally = gp3p_tally(10, |rng| {
        let (start, along) = (in_box(rng, 0.5), rng.unit_vector());
        let across = along.cross(&rng.unit_vector()).normalize();
        let height = 10f64.powf(rng.uniform(-6.0, -1.0));
        let third = start + along * rng.uniform(0.0, 1.0) + across * height;
        let mut places = [start, start + along, third];
        places.swap(rng.index(3), 0);
        places.swap(1 + rng.index(2), 1);
        let rig_from_target = Pose::new(rng.rotation(), rng.unit_vector() * rng.uniform(5.0, 20.0));
        Scene::new([(); 3].map(|()| in_box(rng, 0.5)), places, rig_from_target)
    });
    assert_eq!((tally.missed_reprojection_1e_9, tally.bad_poses, tally.duplicates), (0, 0, 0), "{tally:?}");
    assert!(tally.missed_1e_6 <= PROBLEMS / 10_000, "{tally:?}");
}

/// Baselines from 0.1 m down to a millionth of it: the rays of a rig become those of one camera without a seam.
#[test]
fn gp3p_finds_every_pose_at_small_baselines() {
    nothing_wrong(&gp3p_tally(5, |rng| {
        let half = 10f64.powf(rng.uniform(-6.0, -1.0));
        scattered(rng, half)
    }));
}

/// With one centre the answer is that of `p3p`, and a baseline of 1e-12 m, which takes the other way through the code,
/// changes none of the
/// poses. (Roots closer than 1e-3 are left out: there 1e-12 m moves them by more.)
#[test]
fn gp3p_of_one_centre_is_p3p() {
    let (mut rng, mut compared) = (Rng::new(6), 0);
    for _ in 0..20_000 {
        let scene: Scene<3> = scattered(&mut rng, 0.0);
        let one = gp3p(&scene.rays, &scene.places);
        let central = p3p(&scene.rays.map(|ray| ray.bearing_in_rig), &scene.places);
        assert_eq!(one.as_slice(), central.as_slice());
        let near = |i: usize, j: usize| (one[i].rotation - one[j].rotation).norm() < 1e-3;
        if (0..one.len()).any(|i| (0..i).any(|j| near(i, j))) {
            continue;
        }
        let mut rays = scene.rays;
        rays[1].origin_in_rig.x += 1e-12;
        let other = gp3p(&rays, &scene.places);
        let distance =
            |a: &Pose, b: &Pose| (a.rotation - b.rotation).norm() + (a.translation - b.translation).norm();
        let matched = one.iter().filter(|a| other.iter().any(|b| distance(a, b) < 1e-6)).count();
        compared += 1;
        assert_eq!((matched, other.len()), (one.len(), one.len()), "{:?} {:?}", scene.rays, scene.places);
    }
    assert!(15_000 < compared, "{compared}");
}

/// Views along the axes, where coefficients vanish and roots meet in φ: everything on a grid of 0.5 m, the rig not turned.
/// Triples on a line
/// are left out. Where the three rays leave a motion free (2 %), or the true pose is a double root, another pose may stand
/// for it; what is
/// returned must reproject, and a miss must be rarer than one in 10,000 of the determined ones.
#[test]
fn gp3p_survives_views_along_the_axes() {
    let (mut rng, mut tally, mut determined) = (Rng::new(7), Tally::default(), 0);
    while determined < PROBLEMS / 2 {
        let mut half = || 0.5 * rng.uniform(-2.0, 2.0).round();
        let origins = [(); 3].map(|()| Point::new(half(), half(), 0.0));
        let places = [(); 3].map(|()| Point::new(half(), half(), 4.0 + half()));
        let shift = Vector3::new(half(), half(), half());
        let scene = Scene::new(origins, places, Pose::new(Matrix3::identity(), shift));
        if least_singular_value(&scene) < 1e-6 {
            continue;
        }
        determined += 1;
        tally.add(&scene, &gp3p(&scene.rays, &places));
    }
    println!("{tally:?}");
    assert_eq!((tally.bad_poses, tally.duplicates), (0, 0), "{tally:?}");
    assert!(tally.missed_1e_6 <= determined / 10_000, "{tally:?}");
}

/// Of the derivative of the rays' misses by the motion of the rig, over the largest.
fn least_singular_value(scene: &Scene<3>) -> f64 {
    let mut rows = Matrix6::zeros();
    for i in 0..3 {
        let x = scene.rig_from_target * scene.places[i];
        let bearing = scene.rays[i].bearing_in_rig.into_inner();
        let across = bearing.cross(&Vector3::new(0.3, 0.5, 0.77)).normalize();
        for (row, w) in [(2 * i, across), (2 * i + 1, bearing.cross(&across))] {
            rows.fixed_view_mut::<1, 3>(row, 0).copy_from(&x.cross(&w).transpose());
            rows.fixed_view_mut::<1, 3>(row, 3).copy_from(&w.transpose());
        }
    }
    let values = rows.singular_values();
    values.min() / values.max()
}

#[test]
fn gp3p_refuses_a_straight_triple() {
    let mut rng = Rng::new(8);
    for _ in 0..20_000 {
        let Scene { rays, mut places, .. } = random_scene::<3>(&mut rng);
        places[2] = places[0] + (places[1] - places[0]) * rng.uniform(-2.0, 2.0);
        assert!(gp3p(&rays, &places).is_empty(), "{places:?}");
    }
}

/// A number that is none, in any place.
fn spoil(rng: &mut Rng, v: &mut Vector3<f64>) {
    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, 0.0];
    v[rng.index(3)] = bad[rng.index(bad.len())];
}

fn all_finite(poses: &[Pose]) -> bool {
    poses.iter().all(|p| p.rotation.iter().chain(p.translation.iter()).all(|x| x.is_finite()))
}

#[test]
fn gp3p_returns_no_nan_for_hostile_input() {
    let mut rng = Rng::new(9);
    for _ in 0..20_000 {
        let Scene { mut rays, mut places, .. } = random_scene::<3>(&mut rng);
        let which = rng.index(3);
        match rng.index(5) {
            0 => spoil(&mut rng, &mut places[which]),
            1 => spoil(&mut rng, &mut rays[which].origin_in_rig),
            2 => {
                let mut bearing = rays[which].bearing_in_rig.into_inner();
                spoil(&mut rng, &mut bearing);
                rays[which].bearing_in_rig = Unit::new_unchecked(bearing);
            }
            3 => rays = rays.map(|ray| Ray { bearing_in_rig: rays[0].bearing_in_rig, ..ray }),
            _ => rays[which] = rays[(which + 1) % 3],
        }
        assert!(all_finite(&gp3p(&rays, &places)), "{rays:?} {places:?}");
    }
}

// ---------------------------------------------------------------------------------------------- two rays and the vertical

/// The vertical, any direction, in the target and, by the true pose, in the rig.
fn verticals(rng: &mut Rng, scene: &Scene<2>) -> [Unit<Vector3<f64>>; 2] {
    let up_in_target = rng.unit_vector();
    [Unit::new_normalize(scene.rig_from_target.rotation * up_in_target), Unit::new_normalize(up_in_target)]
}

/// As for `gp3p`; besides, every pose must map the one vertical onto the other.
fn upright_tally(seed: u64, problem: impl Fn(&mut Rng) -> Scene<2>) -> Tally {
    let (mut rng, mut tally) = (Rng::new(seed), Tally::default());
    for _ in 0..UPRIGHT_PROBLEMS {
        let scene = problem(&mut rng);
        let [up_in_rig, up_in_target] = verticals(&mut rng, &scene);
        let poses = upright_gp2p(&scene.rays, &scene.places, &up_in_target, &up_in_rig);
        tally.add(&scene, &poses);
        let upright =
            |p: &Pose| (p.rotation * up_in_target.into_inner() - up_in_rig.into_inner()).norm() < 1e-14;
        tally.bad_poses += poses.iter().filter(|p| !upright(p)).count();
    }
    println!("{tally:?}");
    tally
}

#[test]
fn upright_gp2p_finds_every_random_pose() {
    nothing_wrong(&upright_tally(21, random_scene));
}

#[test]
fn upright_gp2p_finds_every_pose_of_cameras_that_look_anywhere() {
    nothing_wrong(&upright_tally(22, all_around));
}

#[test]
fn upright_gp2p_finds_every_far_pose() {
    nothing_wrong(&upright_tally(23, far_scene));
}

/// One camera is a rig too.
#[test]
fn upright_gp2p_finds_every_pose_of_one_centre() {
    nothing_wrong(&upright_tally(24, |rng| scattered(rng, 0.0)));
}
