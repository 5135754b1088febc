//! Error budgets of rigs and hand–eye calibrations: they add up to the covariances, and errors of one source alone scatter as their part says.

use crate::budget::{assert_adds_up, part};
use crate::common::hands::{self, Stated, World};
use crate::common::rooms::{self, Room};
use crate::common::sessions::{Robot, Session};
use crate::common::{Rng, views};
use nalgebra::{DMatrix, Vector2, Vector3};
use resight_core::budget::ErrorSource;
use resight_core::locate::loss::Loss;
use resight_core::multiview::hand_eye::{HandEyeConfig, HandEyeView, Height, Mounting, solve_hand_eye};
use resight_core::multiview::rig::{KnownDistance, Observation, RigConfig, UncertainTags};
use resight_core::{Correspondence, Matrix6, Point, Pose, Vector6};

const SIGMA_PX: f64 = 0.3;
const SIGMA_POINT_M: f64 = 5e-4;
const SIGMA_DISTANCE_M: f64 = 1e-3;

/// The scatter of errors beside a part, both in standard deviations of the whole.
fn assert_scatters(errors: &[Vector6], expected: &Matrix6, whole: &Matrix6, what: &str) {
    let whitening = whole.cholesky().expect("positive").l().try_inverse().expect("regular");
    let n = errors.len() as f64;
    let scatter: Matrix6 = errors.iter().map(|e| whitening * e * (whitening * e).transpose() / n).sum();
    let expected = whitening * expected * whitening.transpose();
    let (apart, ratio) = ((scatter - expected).norm() / expected.norm(), scatter.trace() / expected.trace());
    println!("{what}: {apart:.3} apart, ratio {ratio:.3}, share {:.4}", expected.trace() / 6.0);
    assert!(apart < 0.25 && (ratio - 1.0).abs() < 0.2, "{what}: {apart} {ratio}");
}

/// Two cameras and a board whose points are uncertain, 12 times.
fn room() -> Room {
    let mut room = rooms::pair_with(&mut Rng::new(3), rooms::board(5, 4, 0.08), 12, SIGMA_PX);
    for c in room.observations.iter_mut().flat_map(|s| &mut s.seen) {
        c.sigma_m = SIGMA_POINT_M;
    }
    room
}

/// fx and fy share an error of 2 px, the principal point has one of 1 px.
fn intrinsics() -> Vec<Option<DMatrix<f64>>> {
    let mut one = DMatrix::zeros(4, 4);
    one.view_mut((0, 0), (2, 2)).fill(4.0);
    (one[(2, 2)], one[(3, 3)]) = (1.0, 1.0);
    vec![Some(one.clone()), Some(one)]
}

fn distance(room: &Room, error_m: f64) -> [KnownDistance; 1] {
    let apart = room.cam_from_rig[0].origin() - room.cam_from_rig[1].origin();
    [KnownDistance { a: 0, b: 1, distance_m: apart.norm() + error_m, sigma_m: SIGMA_DISTANCE_M }]
}

/// Every point is elsewhere on the board.
fn with_other_points(room: &Room, rng: &mut Rng) -> Vec<Observation> {
    let mut observations = room.observations.clone();
    for s in &mut observations {
        let place = room.bodies.iter().find(|body| body.0 == s.view).expect("a body").2;
        let lens = &room.cameras[s.camera];
        for c in &mut s.seen {
            let by = Vector3::new(rng.normal(), rng.normal(), rng.normal()) * SIGMA_POINT_M;
            let x = room.cam_from_rig[s.camera] * place * (c.x_in_target + by);
            let pixel = lens.project(&x).expect("in the field");
            let moved = Correspondence::new(lens, c.x_in_target, pixel, SIGMA_PX).expect("in the field");
            *c = Correspondence { sigma_m: SIGMA_POINT_M, ..moved };
        }
    }
    observations
}

/// The cameras are believed to be other ones.
fn with_other_lenses(room: &Room, rng: &mut Rng) -> Room {
    let mut other = room.clone();
    for lens in &mut other.cameras {
        let f = 2.0 * rng.normal();
        let by = [f, f, rng.normal(), rng.normal()];
        let values: Vec<f64> = lens.parameters().iter().zip(by).map(|((_, x), by)| x + by).collect();
        *lens = lens.with_parameters(&values).expect("a camera");
    }
    other
}

#[test]
fn each_source_of_a_rig_scatters_as_its_part() {
    const N: usize = 600;
    let (room, intrinsics) = (room(), intrinsics());
    let with = |known_distances: &[KnownDistance], room: &Room, observations: &[Observation]| {
        let intrinsics = &intrinsics[..];
        let config = RigConfig { shared_errors: false, known_distances, intrinsics, ..RigConfig::default() };
        room.solve(observations, &config).expect("a rig")
    };
    let exact = with(&distance(&room, 0.0), &room, &room.observations);
    let (budget, whole) = (&exact.budgets[1], &exact.cameras[1].covariance);
    assert_adds_up(budget, whole, "rig");
    assert!(exact.budgets[0].parts().is_empty());
    let mut rng = Rng::new(21);
    for source in [ErrorSource::Pixels, ErrorSource::Target, ErrorSource::Lens, ErrorSource::Priors] {
        let errors: Vec<Vector6> = (0..N)
            .map(|_| {
                let exact = distance(&room, 0.0);
                let found = match source {
                    ErrorSource::Pixels => with(&exact, &room, &room.disturbed(&mut rng)),
                    ErrorSource::Target => with(&exact, &room, &with_other_points(&room, &mut rng)),
                    ErrorSource::Lens => {
                        with(&exact, &with_other_lenses(&room, &mut rng), &room.observations)
                    }
                    _ => with(&distance(&room, SIGMA_DISTANCE_M * rng.normal()), &room, &room.observations),
                };
                room.error(&found, 1).0
            })
            .collect();
        assert_scatters(&errors, &part(budget, source), whole, &format!("{source:?}"));
    }
}

/// A board that is off to one side in every view by more than its points explain, residuals larger than stated, and an uncertain print.
#[test]
fn the_parts_of_a_rig_add_up() {
    let mut rng = Rng::new(22);
    let room = rooms::pair_with(&mut rng, rooms::board(5, 4, 0.08), 25, 0.1);
    let shared = |observations: &mut Vec<Observation>, rng: &mut Rng| {
        for s in observations {
            let by = Vector2::new(rng.normal(), rng.normal()) * 0.6;
            for c in &mut s.seen {
                let pixel = c.pixel + by + Vector2::new(rng.normal(), rng.normal()) * 0.2;
                *c = Correspondence::new(&room.cameras[s.camera], c.x_in_target, pixel, 0.1).expect("seen");
            }
        }
    };
    let mut observations = room.observations.clone();
    shared(&mut observations, &mut rng);
    let intrinsics = intrinsics();
    let config =
        RigConfig { lens_errors: true, intrinsics: &intrinsics, scale_sigma: 0.001, ..RigConfig::default() };
    let found = room.solve(&observations, &config).expect("a rig");
    assert!(1.0 < found.noise_scale && 1.0 < found.view_scale, "{} {}", found.noise_scale, found.view_scale);
    let budget = &found.budgets[1];
    assert_adds_up(budget, &found.cameras[1].covariance, "rig");
    for source in [
        ErrorSource::Pixels,
        ErrorSource::SharedInView,
        ErrorSource::Lens,
        ErrorSource::Target,
        ErrorSource::Residuals,
    ] {
        assert!(0.0 < part(budget, source).trace(), "{source:?}");
    }
    let excess = part(budget, ErrorSource::Residuals).component_div(&part(budget, ErrorSource::Pixels));
    assert!(excess.iter().all(|x| (x / (found.noise_scale - 1.0) - 1.0).abs() < 1e-9), "{excess}");
}

/// What the views show of a lens is in its part only where it is in the covariance.
#[test]
fn lens_errors_have_their_part() {
    let mut rng = Rng::new(23);
    let room = rooms::pair_with(&mut rng, rooms::board(7, 5, 0.08), 20, 0.1);
    let observations = room.disturbed(&mut rng);
    let mut other = room.clone();
    let values: Vec<f64> =
        other.cameras[1].parameters().iter().zip([12.0, 12.0, 0.0, 0.0]).map(|(p, by)| p.1 + by).collect();
    other.cameras[1] = other.cameras[1].with_parameters(&values).expect("a camera");
    for lens_errors in [false, true] {
        let config = RigConfig { lens_errors, ..RigConfig::default() };
        let found = other.solve(&observations, &config).expect("a rig");
        assert!(found.lens_sigma_m.is_some());
        assert_adds_up(&found.budgets[1], &found.cameras[1].covariance, "lens errors");
        assert_eq!(lens_errors, 0.0 < part(&found.budgets[1], ErrorSource::Lens).trace());
    }
}

/// Four points each are displaced together, in all views alike: the rig scatters as the part of the target says, and the parts add up.
#[test]
fn displaced_tags_scatter_a_rig_as_their_part() {
    const N: usize = 300;
    let room = rooms::pair_with(&mut Rng::new(3), rooms::board(4, 6, 0.08), 8, 0.02);
    let (sigma_m, sigma_rad) = (1e-3, 2e-3);
    let corners: Vec<[Point; 4]> =
        room.points[0].chunks(4).map(|four| [four[0], four[1], four[2], four[3]]).collect();
    let independent = |corners: &[Point; 4]| {
        let mut about_origin = Matrix6::identity();
        let centre = corners.iter().sum::<Point>() / 4.0;
        about_origin.fixed_view_mut::<3, 3>(3, 0).copy_from(&centre.cross_matrix());
        let mut own = Matrix6::identity() * (sigma_rad * sigma_rad);
        own.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(sigma_m * sigma_m);
        let own = about_origin * own * about_origin.transpose();
        let covariance = DMatrix::from_column_slice(6, 6, own.as_slice());
        UncertainTags { target: 0, corners_in_target: vec![*corners], covariance }
    };
    let tags: Vec<UncertainTags> = corners.iter().map(independent).collect();
    let loss = Loss::Squared;
    let config = RigConfig { displaced_tags: &tags, loss, shared_errors: false, ..RigConfig::default() };
    let exact = room.solve(&room.observations, &config).expect("a rig");
    let (budget, whole) = (&exact.budgets[1], &exact.cameras[1].covariance);
    assert_adds_up(budget, whole, "tags");
    let mut rng = Rng::new(41);
    let mut errors = Vec::new();
    for _ in 0..N {
        let motions: Vec<Pose> = tags
            .iter()
            .map(|_| {
                let sigma = |i: usize| if i < 3 { sigma_rad } else { sigma_m };
                Pose::exp(&Vector6::from_fn(|i, _| sigma(i) * rng.normal()))
            })
            .collect();
        let mut observations = room.observations.clone();
        for s in &mut observations {
            let place = room.bodies.iter().find(|body| body.0 == s.view).expect("a body").2;
            let lens = &room.cameras[s.camera];
            for c in &mut s.seen {
                let tag = corners.iter().position(|four| four.contains(&c.x_in_target)).expect("its tag");
                let centre = corners[tag].iter().sum::<Point>() / 4.0;
                let real = centre + motions[tag] * (c.x_in_target - centre);
                let pixel =
                    lens.project(&(room.cam_from_rig[s.camera] * place * real)).expect("in the field");
                *c = Correspondence::new(lens, c.x_in_target, pixel, c.sigma_px).expect("in the field");
            }
        }
        let found = room.solve(&observations, &config).expect("a rig");
        errors.push((found.cameras[1].cam_from_rig * exact.cameras[1].cam_from_rig.inverse()).log());
    }
    assert_scatters(&errors, &part(budget, ErrorSource::Target), whole, "displaced tags");
}

/// A motion that all tags of a map share moves every body with it and no camera; the same motions by themselves move the cameras.
#[test]
fn tags_displaced_together_move_no_camera() {
    let room = rooms::pair_with(&mut Rng::new(3), rooms::board(4, 6, 0.08), 8, 0.02);
    let corners: Vec<[Point; 4]> =
        room.points[0].chunks(4).map(|four| [four[0], four[1], four[2], four[3]]).collect();
    let variance = |i: usize| if i < 3 { 4e-6 } else { 1e-6 };
    let group = |corners: &[[Point; 4]]| {
        let n = 6 * corners.len();
        let covariance = DMatrix::from_fn(n, n, |i, j| if i % 6 == j % 6 { variance(i % 6) } else { 0.0 });
        UncertainTags { target: 0, corners_in_target: corners.to_vec(), covariance }
    };
    let of_target = |tags: &[UncertainTags]| {
        let config = RigConfig { displaced_tags: tags, ..RigConfig::default() };
        let found = room.solve(&room.observations, &config).expect("a rig");
        part(&found.budgets[1], ErrorSource::Target).trace()
    };
    let apart: Vec<UncertainTags> = corners.chunks(1).map(group).collect();
    let (together, apart) = (of_target(&[group(&corners)]), of_target(&apart));
    assert!(0.0 < apart && together < 1e-6 * apart, "{together:e} {apart:e}");
}

/// Every view with the covariances of `stated`, its errors drawn from those of `drawn`.
fn hand_eye_views(
    rng: &mut Rng,
    world: &World,
    drawn: &[Stated],
    stated: &[Stated],
) -> Vec<HandEyeView<'static>> {
    let mut views = hands::measured(rng, world, drawn);
    for (view, stated) in views.iter_mut().zip(stated) {
        view.gripper_covariance = stated.hand;
        view.candidates[0].covariance = stated.seen;
    }
    views
}

#[test]
fn each_source_of_a_hand_eye_calibration_scatters_as_its_part() {
    const N: usize = 600;
    let tiny = 1e-12;
    for mounting in [Mounting::CameraOnGripper, Mounting::TargetOnGripper] {
        let mut rng = Rng::new(31);
        let world = World::cell(&mut rng, mounting, 12);
        let stated = hands::all_stated(&mut rng, 12, true);
        let only = |camera: f64, robot: f64| -> Vec<Stated> {
            let of = |s: &Stated| Stated { seen: s.seen * camera, hand: s.hand.map(|hand| hand * robot) };
            stated.iter().map(of).collect()
        };
        let exact = hand_eye_views(&mut rng, &world, &only(tiny, tiny), &stated);
        let exact = solve_hand_eye(&exact, &world.config()).expect("a hand");
        let budgets = [&exact.carrier_budget, &exact.holder_budget];
        let wholes = [&exact.carrier_covariance, &exact.holder_covariance];
        for (budget, whole) in budgets.iter().zip(wholes) {
            assert_adds_up(budget, whole, "hand-eye");
        }
        for (source, drawn) in
            [(ErrorSource::CameraPoses, only(1.0, tiny)), (ErrorSource::RobotAtGripper, only(tiny, 1.0))]
        {
            let errors: Vec<_> = (0..N)
                .map(|_| {
                    let views = hand_eye_views(&mut rng, &world, &drawn, &stated);
                    world.motion_error(&solve_hand_eye(&views, &world.config()).expect("a hand"))
                })
                .collect();
            for (at, (budget, whole)) in budgets.iter().zip(wholes).enumerate() {
                let errors: Vec<Vector6> = errors.iter().map(|e| hands::part(e, 6 * at)).collect();
                let what = format!("{mounting:?} {source:?} {at}");
                assert_scatters(&errors, &part(budget, source), whole, &what);
            }
        }
    }
}

/// On pixels, the robot's noise estimated from the views: its uncertainty is the robot's too. A bent board makes residuals larger.
#[test]
fn the_parts_of_a_hand_eye_calibration_on_pixels_add_up() {
    let mut rng = Rng::new(33);
    for (mounting, bent_m) in [(Mounting::CameraOnGripper, 0.0), (Mounting::TargetOnGripper, 0.001)] {
        let robot = Robot::AtHand(5e-4, 3e-4);
        let session = Session::new(&mut rng, mounting, 15, robot, &views::camera(), 0.2, bent_m);
        let found = session.solved();
        assert_adds_up(&found.carrier_budget, &found.carrier_covariance, "carrier");
        assert_adds_up(&found.holder_budget, &found.holder_covariance, "holder");
        for source in [ErrorSource::Pixels, ErrorSource::RobotAtGripper] {
            assert!(0.0 < part(&found.carrier_budget, source).trace(), "{source:?}");
        }
        let residuals = part(&found.carrier_budget, ErrorSource::Residuals).trace();
        assert_eq!(0.0 < bent_m, 0.0 < residuals, "{residuals}");
    }
}

/// A known height of the camera is a source of its own, and poses whose stated noise is too small leave a part to the residuals.
#[test]
fn heights_and_residuals_have_their_part() {
    let mut rng = Rng::new(34);
    let world = World::cell(&mut rng, Mounting::CameraOnGripper, 12);
    let stated = hands::all_stated(&mut rng, 12, true);
    let of = |s: &Stated| Stated { seen: s.seen / 4.0, hand: s.hand.map(|hand| hand / 4.0) };
    let small: Vec<Stated> = stated.iter().map(of).collect();
    let views = hand_eye_views(&mut rng, &world, &stated, &small);
    let direction_in_carrier = Vector3::z();
    let height_m = direction_in_carrier.dot(&world.cam_from_carrier.origin());
    let height = Height { direction_in_carrier, height_m, sigma_m: 5e-4 };
    let config = HandEyeConfig { mounting: world.mounting, height: Some(height), ..HandEyeConfig::default() };
    let found = solve_hand_eye(&views, &config).expect("a hand");
    assert!(2.0 < found.noise_scale, "{}", found.noise_scale);
    assert_adds_up(&found.carrier_budget, &found.carrier_covariance, "carrier");
    use ErrorSource::{CameraPoses, Priors, Residuals, RobotAtGripper};
    for source in [Priors, Residuals, CameraPoses, RobotAtGripper] {
        assert!(0.0 < part(&found.carrier_budget, source).trace(), "{source:?}");
    }
}
