//! Rigs that cannot be solved, and what is said: which cameras, which observation, what would help. Sizes, known distances, weak links.

use crate::common::rooms::{self, Room};
use crate::common::{Rng, views};
use nalgebra::Vector2;
use resight_core::multiview::rig::{
    KnownDistance, Observation, RejectedObservation, RigConfig, RigProblem, shared_views, solve_rig,
};
use resight_core::{Camera, Correspondence, Error, Point, Pose};

/// Four cameras in a row, 40 views.
fn row() -> (Room, Vec<Observation>) {
    let mut rng = Rng::new(21);
    let room = rooms::row(&mut rng, 4, 40, 0.2);
    let observations = room.disturbed(&mut rng);
    (room, observations)
}

fn failure(room: &Room, observations: &[Observation]) -> Error {
    room.solve(observations, &RigConfig::default()).expect_err("no rig")
}

#[test]
fn shared_views_count_views_and_name_groups() {
    let observation = |camera, view, target| {
        let c = Correspondence::new(&views::camera(), Point::zeros(), Vector2::new(1.0, 2.0), 1.0)
            .expect("in the field");
        Observation { camera, view, target, seen: vec![c] }
    };
    let cameras: Vec<Camera> = (0..5).map(|_| views::camera()).collect();
    let mut observations = vec![
        observation(0, 0, 0),
        observation(1, 0, 1),
        observation(1, 0, 2),
        observation(0, 0, 2),
        observation(2, 0, 2),
    ];
    observations.extend([
        observation(3, 1, 0),
        observation(4, 1, 0),
        observation(2, 1, 2),
        observation(0, 2, 0),
        observation(2, 2, 2),
    ]);
    observations.push(Observation { seen: Vec::new(), ..observation(0, 1, 0) });
    let problem =
        RigProblem { cameras: &cameras, body_of_target: &[3, 3, 9], n_views: 3, observations: &observations };
    let found = shared_views(&problem);
    // Cameras 0 and 1 share both bodies in view 0: one view. In view 2 cameras 0 and 2 see different bodies.
    assert_eq!(found.counts[0], [2, 1, 1, 0, 0]);
    assert_eq!(found.counts[2], [1, 1, 3, 0, 0]);
    assert_eq!(found.groups, [vec![0, 1, 2], vec![3, 4]]);
}

#[test]
fn unconnected_cameras_are_named_on_both_sides() {
    let (room, mut observations) = row();
    observations.retain(|s| (s.view % 2 == 0) == (s.camera < 2));
    let error = failure(&room, &observations);
    let Error::CamerasUnconnected { first, second, .. } = &error else { panic!("{error}") };
    assert_eq!((&first[..], &second[..]), (&[0, 1][..], &[2, 3][..]));
    assert!(error.to_string().contains("cameras 0, 1 and 2, 3 are not connected; add a view"), "{error}");
}

#[test]
fn a_camera_without_a_pose_is_named() {
    let (room, observations) = row();
    let without: Vec<Observation> = observations.iter().filter(|s| s.camera != 2).cloned().collect();
    assert_eq!(failure(&room, &without), Error::CameraNotObserved { camera: 2, n_observations: 0 });
    let two_points = |s: &Observation| Observation { seen: s.seen[..2].to_vec(), ..s.clone() };
    let few: Vec<Observation> =
        observations.iter().map(|s| if s.camera == 2 { two_points(s) } else { s.clone() }).collect();
    assert!(matches!(failure(&room, &few), Error::CameraNotObserved { camera: 2, n_observations: 1.. }));
    assert_eq!(failure(&room, &[]), Error::EmptyRig);
    let none = RigProblem { cameras: &[], body_of_target: &[], n_views: 0, observations: &[] };
    assert_eq!(solve_rig(&none, &RigConfig::default()), Err(Error::EmptyRig));
}

/// Two targets of a body that no camera sees at once, each by its own camera.
#[test]
fn targets_never_seen_together_are_said() {
    let mut rng = Rng::new(22);
    let cameras = vec![rooms::pinhole(900.0), rooms::pinhole(900.0)];
    let behind = Pose::exp(&resight_core::Vector6::new(0.0, 3.1, 0.0, 0.0, 0.0, 0.1));
    let mut room = Room::new(cameras, rooms::ring(2, 3.0))
        .with_target(rooms::board(5, 4, 0.1), 0, Pose::identity())
        .with_target(rooms::board(4, 4, 0.1), 0, behind);
    for view in 0..20 {
        room.see(
            view,
            0,
            rooms::somewhere(&mut rng, Point::new(0.0, 0.0, 3.0), 0.3, nalgebra::Vector3::z(), 0.5),
            0.2,
        );
    }
    assert!(room.observations.iter().all(|s| s.camera == s.target) && 20 < room.observations.len());
    let error = failure(&room, &room.observations);
    assert!(
        matches!(&error, Error::CamerasUnconnected { needed, .. } if needed.contains("two of these targets")),
        "{error}"
    );
}

#[test]
fn indices_and_numbers_that_cannot_be_are_named() {
    let (room, observations) = row();
    let with = |change: &dyn Fn(&mut Observation)| {
        let mut changed = observations.clone();
        change(&mut changed[5]);
        failure(&room, &changed)
    };
    assert_eq!(with(&|s| s.camera = 9), Error::NoSuchIndex { observation: 5, what: "camera", seen: 9, n: 4 });
    assert_eq!(with(&|s| s.view = 40), Error::NoSuchIndex { observation: 5, what: "view", seen: 40, n: 40 });
    assert_eq!(with(&|s| s.target = 1), Error::NoSuchIndex { observation: 5, what: "target", seen: 1, n: 1 });
    for change in [
        (&|s: &mut Observation| s.seen[3].pixel.x = f64::NAN) as &dyn Fn(&mut Observation),
        &|s| s.seen[3].x_in_target.z = f64::INFINITY,
        &|s| s.seen[3].sigma_px = 0.0,
        &|s| s.seen[3].sigma_m = f64::NAN,
    ] {
        let error = with(change);
        assert!(matches!(&error, Error::InvalidObservation { target: 0, .. }), "{error}");
        assert!(error.to_string().contains("point 3"), "{error}");
    }
    let refused = |config: &RigConfig| room.solve(&observations, config).expect_err("refused").to_string();
    assert!(refused(&RigConfig { reference: 4, ..RigConfig::default() }).starts_with("reference is 4"));
    for (a, b, distance_m, sigma_m) in
        [(0, 9, 1.0, 0.1), (1, 1, 1.0, 0.1), (0, 1, -1.0, 0.1), (0, 1, 1.0, 0.0)]
    {
        let known = [KnownDistance { a, b, distance_m, sigma_m }];
        assert!(
            refused(&RigConfig { known_distances: &known, ..RigConfig::default() })
                .starts_with("known_distances is")
        );
    }
    let loss = resight_core::locate::loss::Loss::Huber { sigmas: f64::NAN };
    assert!(refused(&RigConfig { loss, ..RigConfig::default() }).contains("threshold"));
}

/// Any numbers whatever end in an answer without NaN, or in a named error.
#[test]
fn hostile_observations_never_panic() {
    let (room, observations) = row();
    let mut n_answers = 0;
    for seed in 0..150 {
        let mut rng = Rng::new(2_000 + seed);
        let mut changed = observations.clone();
        for _ in 0..rng.index(12) {
            let i = rng.index(changed.len());
            let k = rng.index(changed[i].seen.len().max(1));
            match rng.index(8) {
                0 => drop(changed.remove(i)),
                1 => changed[i].seen.truncate(k),
                2 => changed[i].view = rng.index(40),
                3 => changed[i].camera = rng.index(4),
                4 => changed[i].seen.iter_mut().for_each(|c| c.x_in_target *= 1e9),
                5 => changed[i].seen.iter_mut().for_each(|c| c.x_in_target = Point::zeros()),
                6 => changed[i].seen.iter_mut().for_each(|c| c.sigma_px = 1e-9),
                _ => changed[i].seen.iter_mut().for_each(|c| c.pixel = Vector2::new(5.0, 7.0)),
            }
        }
        let config = RigConfig { joint_covariance: true, ..RigConfig::default() };
        if let Ok(solution) = room.solve(&changed, &config) {
            let text = format!("{solution:?}");
            assert!(!text.contains("NaN"), "seed {seed}");
            n_answers += 1;
        }
    }
    assert!(100 < n_answers, "{n_answers}");
}

/// One target alone cannot be compared with anything; a second one, or a measured distance, determines its size.
#[test]
fn a_wrong_size_is_found_where_something_compares() {
    let mut rng = Rng::new(31);
    let mut room = rooms::row(&mut rng, 3, 40, 0.2);
    let alone = room.solve(&room.disturbed(&mut rng), &RigConfig::default()).expect("a rig");
    assert_eq!((alone.scales[0].ratio, alone.scales[0].sigma), (1.0, f64::INFINITY));
    // 3 × 2 fields of 0.15 m.
    assert!((alone.scales[0].extent_m - 0.15 * 13f64.sqrt()).abs() < 1e-12);

    let smaller = |s: &Observation, by: f64| {
        let mut s = s.clone();
        s.seen.iter_mut().for_each(|c| c.x_in_target *= by);
        s
    };
    // Stated 0.4 % too small: true over stated is 1.004.
    let noisy: Vec<Observation> = room.disturbed(&mut rng).iter().map(|s| smaller(s, 1.0 / 1.004)).collect();
    let known = [KnownDistance { a: 0, b: 2, distance_m: 1.6, sigma_m: 0.5e-3 }];
    let config = RigConfig { known_distances: &known, ..RigConfig::default() };
    let measured = room.solve(&noisy, &config).expect("a rig").scales[0].clone();
    assert!((measured.ratio - 1.004).abs() < 4.0 * measured.sigma && measured.sigma < 1e-3, "{measured:?}");

    room = room.with_target(rooms::board(4, 3, 0.12), 5, Pose::identity());
    for view in 0..40 {
        let around = Point::new(0.04 * view as f64, 0.0, 2.2);
        room.see(view, 5, rooms::somewhere(&mut rng, around, 0.3, nalgebra::Vector3::z(), 0.8), 0.2);
    }
    let noisy = room.disturbed(&mut rng);
    let wrong: Vec<Observation> =
        noisy.iter().map(|s| if s.target == 1 { smaller(s, 1.01) } else { s.clone() }).collect();
    let scales = room.solve(&wrong, &RigConfig::default()).expect("a rig").scales;
    assert!(
        (scales[1].ratio - 1.0 / 1.01).abs() < 4.0 * scales[1].sigma && scales[1].sigma < 2e-3,
        "{scales:?}"
    );
    // Against each other only: either may be wrong.
    assert!((scales[0].ratio - 1.01).abs() < 4.0 * scales[0].sigma, "{scales:?}");
}

/// The stated standard deviation of a size ratio is that of its scatter.
#[test]
fn scale_scatters_as_stated() {
    let (mut squared, mut n) = (0.0, 0.0);
    for seed in 0..60 {
        let mut rng = Rng::new(3_000 + seed);
        let mut room =
            rooms::row(&mut rng, 3, 12, 0.2).with_target(rooms::board(4, 3, 0.12), 5, Pose::identity());
        for view in 0..12 {
            let around = Point::new(0.13 * view as f64, 0.0, 2.2);
            room.see(view, 5, rooms::somewhere(&mut rng, around, 0.3, nalgebra::Vector3::z(), 0.8), 0.2);
        }
        let scale = &room.solve(&room.disturbed(&mut rng), &RigConfig::default()).expect("a rig").scales[1];
        squared += ((scale.ratio - 1.0) / scale.sigma).powi(2);
        n += 1.0;
    }
    // χ² of 60 over 60: a standard deviation of 0.18.
    assert!((0.5..1.6).contains(&(squared / n)), "{}", squared / n);
}

/// Two pairs of cameras that share one view in thirty.
#[test]
fn the_weakest_link_is_the_one_between_the_groups() {
    let (room, mut observations) = row();
    let joins = (0..40)
        .find(|v| (0..4).all(|c| observations.iter().any(|s| (s.view, s.camera) == (*v, c))))
        .expect("a view");
    observations.retain(|s| s.view == joins || (s.view % 2 == 0) == (s.camera < 2));
    let config = RigConfig { joint_covariance: true, ..RigConfig::default() };
    let solution = room.solve(&observations, &config).expect("a rig");
    let link = solution.weakest_link.clone().expect("a link");
    assert!(2 <= link.camera && link.with < 2 && link.n_shared_views == 1, "{link:?}");
    let across = solution.cam_b_from_cam_a(link.camera, link.with).expect("joint").1;
    assert!(
        (across.fixed_view::<3, 3>(3, 3).symmetric_eigenvalues().max().sqrt() - link.sigma_m).abs() < 1e-12
    );
}

/// An observation of three points or fewer takes part where others know the place of the body; alone it is set aside, with its reason.
#[test]
fn weak_observations_join_where_others_hold_the_body() {
    let (room, mut observations) = row();
    let in_view = |s: &[Observation], v: usize| s.iter().filter(|s| s.view == v).count();
    let shared =
        (0..observations.len()).find(|i| in_view(&observations, observations[*i].view) > 2).expect("shared");
    observations[shared].seen.truncate(2);
    let mut lonely = observations[shared].clone();
    let empty = room.n_views;
    (lonely.view, lonely.camera) = (empty, 1);
    observations.push(lonely);
    let room = Room { n_views: room.n_views + 1, ..room };
    let solution = room.solve(&observations, &RigConfig::default()).expect("a rig");
    assert!(solution.observations[shared].rejected.is_none());
    assert!(solution.observations[shared].residuals_px.iter().all(|r| r.is_some_and(|r| r.1)));
    let last = solution.observations.last().expect("an observation");
    assert_eq!(
        last.rejected,
        Some(RejectedObservation::Undetermined(Error::TooFewPoints { seen: 2, needed: 3 }))
    );
    assert_eq!(last.residuals_px, [None, None]);
    assert!(solution.bodies.iter().all(|b| b.view != empty));
}

/// Sigmas stated a third of what they are: everything is kept, and every covariance widened ninefold.
#[test]
fn understated_sigmas_widen_the_answer() {
    let (room, mut observations) = row();
    let plain = room.solve(&observations, &RigConfig::default()).expect("a rig");
    observations.iter_mut().flat_map(|s| &mut s.seen).for_each(|c| c.sigma_px /= 3.0);
    let widened = room.solve(&observations, &RigConfig::default()).expect("a rig");
    assert_eq!(plain.noise_scale, 1.0);
    assert!((8.0..10.0).contains(&widened.noise_scale), "{}", widened.noise_scale);
    assert!(0.998 < widened.n_used as f64 / widened.n_seen as f64);
    for (a, b) in plain.cameras.iter().zip(&widened.cameras).skip(1) {
        assert!((0.85..1.15).contains(&(b.covariance.trace() / a.covariance.trace())));
    }
}

/// A distance known better than the pixels tell it is met, whichever camera is named first, and the covariance knows it.
#[test]
fn a_known_distance_is_met() {
    let mut rng = Rng::new(41);
    let room = rooms::row(&mut rng, 3, 8, 0.5);
    let observations = room.disturbed(&mut rng);
    let truth_m = (room.cam_from_rig[1].origin() - room.cam_from_rig[2].origin()).norm();
    let apart = |config: &RigConfig| {
        let solution = room.solve(&observations, config).expect("a rig");
        let (relative, covariance) = solution.cam_b_from_cam_a(2, 1).expect("joint");
        let along = relative.translation.normalize();
        let variance = (covariance.fixed_view::<3, 3>(3, 3) * along).dot(&along);
        (relative.translation.norm() - truth_m, variance.sqrt())
    };
    let config = RigConfig { joint_covariance: true, ..RigConfig::default() };
    let (_, free_sigma_m) = apart(&config);
    assert!(1e-4 < free_sigma_m, "{free_sigma_m}");
    for (a, b) in [(1, 2), (2, 1)] {
        let known = [KnownDistance { a, b, distance_m: truth_m, sigma_m: 1e-6 }];
        let (error_m, sigma_m) = apart(&RigConfig { known_distances: &known, ..config });
        assert!(error_m.abs() < 4e-6 && sigma_m < 1.1e-6, "{error_m} {sigma_m}");
    }
}
