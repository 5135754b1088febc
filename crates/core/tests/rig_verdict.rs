//! A rig made of something wrong is never called right, and one with honest errors never wrong.
//!
//! What it leaves out: distortion (real recordings have it), two cameras with the same lens and exchanged names (nothing seen tells), the size of the only target.

use crate::common::rooms::{self, Room};
use crate::common::{Rng, views};
use resight_core::explanation::Tolerance;
use resight_core::multiview::rig::{Cause, Observation, RigConfig, RigExplanation, RigSolution};
use resight_core::{Camera, Correspondence, Error, Point, Pose, Vector6};

const N_VIEWS: usize = 30;
const SIGMA_PX: f64 = 0.3;

/// Four cameras 1.8 m around a board of 54 corners that is hand-held, lenses of their own, 30 views.
fn room(rng: &mut Rng) -> Room {
    room_of(rng, N_VIEWS)
}

fn room_of(rng: &mut Rng, n_views: usize) -> Room {
    let cameras = [800.0, 880.0, 820.0, 900.0].map(rooms::pinhole).to_vec();
    let centres = [[0.0, 0.0], [0.8, -0.2], [-0.8, 0.3], [0.2, 0.9]];
    let looks = |[x, y]: [f64; 2]| views::looking_at(Point::new(x, y, -1.6), Point::new(0.05, 0.0, 0.0));
    let world_from_rig = looks(centres[0]).inverse();
    let cam_from_rig = centres.map(|centre| looks(centre) * world_from_rig).to_vec();
    let mut room =
        Room::new(cameras, cam_from_rig).with_target(rooms::board(9, 6, 0.04), 0, Pose::identity());
    let facing = room.cam_from_rig[0].rotation.row(2).transpose();
    for view in 0..n_views {
        let place = rooms::somewhere(rng, Point::new(0.0, 0.0, 1.65), 0.35, facing, 0.5);
        room.see(view, 0, place, SIGMA_PX);
    }
    room
}

/// Solved with the lenses given, whatever the pixels were made with.
fn solved(room: &Room, cameras: &[Camera], observations: Vec<Observation>) -> Result<RigSolution, Error> {
    solved_as(room, cameras, observations, &RigConfig::default())
}

fn solved_as(
    room: &Room,
    cameras: &[Camera],
    observations: Vec<Observation>,
    config: &RigConfig,
) -> Result<RigSolution, Error> {
    let rebased = |s: Observation| {
        let seen = |c: &Correspondence| {
            let seen = Correspondence::new(&cameras[s.camera], c.x_in_target, c.pixel, c.sigma_px);
            seen.expect("in the field")
        };
        Observation { seen: s.seen.iter().map(seen).collect(), ..s }
    };
    let observations: Vec<Observation> = observations.into_iter().map(rebased).collect();
    Room { cameras: cameras.to_vec(), ..room.clone() }.solve(&observations, config)
}

/// Labels of camera 2 off by one view.
fn off_by_one(observations: &mut Vec<Observation>) {
    observations.retain(|s| s.camera != 2 || s.view + 1 < N_VIEWS);
    observations.iter_mut().filter(|s| s.camera == 2).for_each(|s| s.view += 1);
}

fn swapped(observations: &mut [Observation]) {
    for s in observations {
        s.camera = match s.camera {
            1 => 3,
            3 => 1,
            other => other,
        };
    }
}

/// A tenth of the images of camera 2 put under other views.
fn mixed(observations: &mut [Observation], n: usize) {
    let of: Vec<usize> = (0..observations.len()).filter(|i| observations[*i].camera == 2).take(n).collect();
    for pair in of.chunks_exact(2) {
        let (a, b) = (observations[pair[0]].view, observations[pair[1]].view);
        (observations[pair[0]].view, observations[pair[1]].view) = (b, a);
    }
}

/// Rows of the board one short: a wrong kind. Numbers run on, so that most points are not where the target says.
fn wrong_kind(observations: &mut [Observation]) {
    for s in observations {
        let places: Vec<Point> =
            (0..54).map(|i| Point::new((i % 6) as f64 * 0.04, (i / 6) as f64 * 0.04, 0.0)).collect();
        s.seen.iter_mut().zip(places).for_each(|(c, x)| c.x_in_target = x);
    }
}

/// Camera 2 is told that the board is larger than the others are told.
fn reported_size(observations: &mut [Observation], factor: f64) {
    let own = observations.iter_mut().filter(|s| s.camera == 2).flat_map(|s| &mut s.seen);
    own.for_each(|c| c.x_in_target *= factor);
}

/// Camera 2 fires late while the board moves at `speed_m_per_s` and turns at one tenth of a radian a second for each 0.1 m/s.
fn late(rng: &mut Rng, room: &Room, delay_s: f64, speed_m_per_s: f64) -> Vec<Observation> {
    let mut late = room.clone();
    late.observations.clear();
    for (view, body, rig_from_body) in &room.bodies {
        let (push, turn) =
            (rng.unit_vector() * speed_m_per_s * delay_s, rng.unit_vector() * speed_m_per_s * delay_s);
        let moved = Pose::exp(&Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0));
        let about = Pose { translation: rig_from_body.translation, ..Pose::identity() };
        let moved =
            Pose { translation: push, ..Pose::identity() } * about * moved * about.inverse() * *rig_from_body;
        let mut then = room.clone();
        then.observations.clear();
        then.see(*view, *body, moved, SIGMA_PX);
        late.observations.extend(then.observations.into_iter().filter(|s| s.camera == 2));
    }
    late.observations.extend(room.observations.iter().filter(|s| s.camera != 2).cloned());
    late.observations
}

fn noisy(rng: &mut Rng, room: &Room, observations: &[Observation]) -> Vec<Observation> {
    Room { observations: observations.to_vec(), ..room.clone() }.disturbed(rng)
}

struct Case {
    name: &'static str,
    /// Which camera is to be named, and as what; none where it is to be called right.
    wrong: Option<(Option<usize>, &'static [Cause])>,
}

const LENS: &[Cause] = &[Cause::Intrinsics];
const LABELS: &[Cause] = &[Cause::Contradiction];
const TARGET: &[Cause] = &[Cause::Target];

const CASES: [Case; 14] = [
    Case { name: "right", wrong: None },
    Case { name: "two mixed images", wrong: None },
    Case { name: "focal length 1.03", wrong: Some((Some(2), LENS)) },
    Case { name: "focal length 1.1", wrong: Some((Some(2), LENS)) },
    Case { name: "focal length 0.9", wrong: Some((Some(2), LENS)) },
    Case { name: "principal point 40 px", wrong: Some((Some(2), LENS)) },
    Case { name: "image size doubled", wrong: Some((Some(2), LENS)) },
    Case { name: "labels off by one view", wrong: Some((Some(2), LABELS)) },
    Case { name: "detections swapped", wrong: Some((Some(1), &[Cause::ExchangedIntrinsics { with: 3 }])) },
    Case { name: "ten mixed images", wrong: Some((Some(2), LABELS)) },
    Case { name: "20 ms late", wrong: Some((Some(2), LABELS)) },
    Case { name: "300 ms late", wrong: Some((Some(2), LABELS)) },
    Case { name: "told another size", wrong: Some((Some(2), &[Cause::Intrinsics, Cause::Contradiction])) },
    Case { name: "wrong kind of target", wrong: Some((None, TARGET)) },
];

fn lens(f_px: f64, off_px: f64) -> Camera {
    let matrix = resight_core::CameraMatrix { fx_px: f_px, fy_px: f_px, cx_px: 639.5 + off_px, cy_px: 479.5 };
    Camera { lens: resight_core::Lens::Pinhole(resight_core::camera::Pinhole { matrix }), size: None }
}

fn run(case: &Case, rng: &mut Rng) -> Result<RigSolution, Error> {
    let room = room(rng);
    let exact = match case.name {
        "20 ms late" => late(rng, &room, 0.02, 0.5),
        "300 ms late" => late(rng, &room, 0.3, 0.5),
        _ => room.observations.clone(),
    };
    let mut observations = noisy(rng, &room, &exact);
    let mut cameras = room.cameras.clone();
    match case.name {
        "two mixed images" => mixed(&mut observations, 2),
        "ten mixed images" => mixed(&mut observations, 10),
        "focal length 1.03" => cameras[2] = lens(1.03 * 820.0, 0.0),
        "focal length 1.1" => cameras[2] = lens(1.1 * 820.0, 0.0),
        "focal length 0.9" => cameras[2] = lens(0.9 * 820.0, 0.0),
        "principal point 40 px" => cameras[2] = lens(820.0, 40.0),
        "image size doubled" => cameras[2] = rooms::pinhole(1640.0),
        "labels off by one view" => off_by_one(&mut observations),
        "detections swapped" => swapped(&mut observations),
        "told another size" => reported_size(&mut observations, 1.03),
        "wrong kind of target" => wrong_kind(&mut observations),
        _ => {}
    }
    solved(&room, &cameras, observations)
}

/// A line of the matrix.
fn reported(case: &Case, found: &Result<RigSolution, Error>) -> String {
    let Ok(s) = found else { return format!("{:24} refused: {}", case.name, found.as_ref().unwrap_err()) };
    let v = &s.verdict;
    let lost: Vec<String> = v.cameras.iter().map(|c| format!("{}/{}", c.n_lost, c.n_observations)).collect();
    let worst = v.worst_camera.map(|c| (c, v.cameras[c].cause, v.lens_offsets[c]));
    format!(
        "{:24} {} χ²/dof {:.2} lost {} points {:.1?} target {:?} worst {:?}",
        case.name,
        if v.is_inconsistent { "INCONSISTENT" } else { "ok          " },
        s.chi2 / s.degrees_of_freedom as f64,
        lost.join(" "),
        v.cameras.iter().map(|c| 100.0 * c.share_lost()).collect::<Vec<_>>(),
        v.targets[0].cause,
        worst,
    )
}

#[test]
fn what_is_wrong_is_never_called_right() {
    let mut wrong: Vec<String> = Vec::new();
    for case in &CASES {
        for trial in 0..3 {
            let found = run(case, &mut Rng::new(900 + trial));
            let line = reported(case, &found);
            println!("{line}");
            let Ok(s) = &found else { continue };
            let is_as_expected = match &case.wrong {
                None => !s.verdict.is_inconsistent,
                Some((camera, causes)) => {
                    let blamed = s.verdict.cameras.iter().chain(&s.verdict.targets).filter_map(|l| l.cause);
                    s.verdict.is_inconsistent
                        && (camera.is_none() || s.verdict.worst_camera == *camera)
                        && blamed.into_iter().any(|cause| causes.contains(&cause))
                }
            };
            if !is_as_expected {
                wrong.push(line);
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}", wrong.join("\n"));
}

/// Many rigs as good as stated, from many cameras and few, none of which may be blamed; and with cameras 5 ms apart before a slow board.
#[test]
fn what_is_right_is_never_called_wrong() {
    for trial in 0..20 {
        let mut rng = Rng::new(1900 + trial);
        let room = room(&mut rng);
        let observations = room.disturbed(&mut rng);
        let found = room.solve(&observations, &RigConfig::default()).expect("a rig");
        assert!(!found.verdict.is_inconsistent, "trial {trial}: {:?}", found.verdict);
        let few: Vec<Observation> = observations.into_iter().filter(|s| s.view < 4).collect();
        let found = room.solve(&few, &RigConfig::default()).expect("a rig");
        assert!(!found.verdict.is_inconsistent, "trial {trial}, four views: {:?}", found.verdict);
        let late = late(&mut rng, &room, 0.005, 0.1);
        let late = noisy(&mut rng, &room, &late);
        let found = room.solve(&late, &RigConfig::default()).expect("a rig");
        assert!(!found.verdict.is_inconsistent, "trial {trial}, late: {:?}", found.verdict);
    }
}

/// Score of the lens against the whole solution with another lens: the step that is promised is the step that helps.
#[test]
fn a_lens_offset_is_what_the_lens_is_off_by() {
    let mut rng = Rng::new(77);
    let room = room(&mut rng);
    let observations = room.disturbed(&mut rng);
    let mut cameras = room.cameras.clone();
    cameras[1] = lens(880.0 * 1.002, 2.0);
    let found = solved(&room, &cameras, observations).expect("a rig");
    let offset = found.verdict.lens_offsets[1].expect("determined");
    let expected = [
        (1.0 / 1.002 - 1.0, offset.focal, offset.sigma_focal),
        (-2.0 / 881.76, offset.centre[0], offset.sigma_centre[0]),
        (0.0, offset.centre[1], offset.sigma_centre[1]),
    ];
    for (truth, found, sigma) in expected {
        assert!((found - truth).abs() < 4.0 * sigma && sigma < 2e-3, "{found} ± {sigma}, truth {truth}");
    }
    assert!(!found.verdict.is_inconsistent && !offset.is_off());
}

/// A focal length 3 % off is named whatever the sigmas state, and right lenses pass.
#[test]
fn overstated_sigmas_hide_no_lens() {
    for (trial, factor) in [1.0, 2.0, 5.0, 10.0].into_iter().enumerate() {
        let mut rng = Rng::new(300 + trial as u64);
        let room = room(&mut rng);
        let mut observations = room.disturbed(&mut rng);
        observations.iter_mut().flat_map(|s| &mut s.seen).for_each(|c| c.sigma_px *= factor);
        let right = solved(&room, &room.cameras, observations.clone()).expect("a rig");
        assert!(!right.verdict.is_inconsistent && right.lens_sigma_m.is_none(), "sigma × {factor}");
        let mut cameras = room.cameras.clone();
        cameras[2] = lens(820.0 * 1.03, 0.0);
        let wrong = solved(&room, &cameras, observations).expect("a rig").verdict;
        assert_eq!(wrong.cameras[2].cause, Some(Cause::Intrinsics), "sigma × {factor}");
    }
}

/// A focal length 3 % off is no fault of an answer of which more is tolerated than it moves any camera by, and one 1 % off is of an answer of which less
/// is; nothing else changes.
#[test]
fn a_tolerance_replaces_the_covariance() {
    let mut rng = Rng::new(320);
    let room = room(&mut rng);
    let observations = room.disturbed(&mut rng);
    for (of_focal, is_ok) in [(1.03, false), (1.01, true)] {
        let mut cameras = room.cameras.clone();
        cameras[2] = lens(820.0 * of_focal, 0.0);
        let ask = |tolerance| {
            let config = RigConfig { lens_errors: true, tolerance, ..RigConfig::default() };
            solved_as(&room, &cameras, observations.clone(), &config).expect("a rig")
        };
        let stated = ask(Tolerance::default());
        assert_eq!(stated.verdict.is_inconsistent, !is_ok, "f × {of_focal}: {:?}", stated.verdict);
        let best = &stated.explanations[0];
        assert_eq!(best.what, RigExplanation::Lens { camera: 2 }, "{:?}", stated.explanations);
        let largest =
            |at: usize| best.motions.iter().map(|m| m.fixed_rows::<3>(at).norm()).fold(0.0, f64::max);
        let (rotation_rad, translation_m) = (largest(0), largest(3));
        for (times, is_tolerated) in [(1.1, true), (0.9, false)] {
            let of_rotation =
                Tolerance { rotation_rad: Some(times * rotation_rad), translation_m: Some(1.0) };
            let of_translation =
                Tolerance { rotation_rad: Some(1.0), translation_m: Some(times * translation_m) };
            for tolerance in [of_rotation, of_translation] {
                let found = ask(tolerance);
                assert_eq!(found.verdict.is_inconsistent, !is_tolerated, "f × {of_focal}, {tolerance:?}");
                assert_eq!(found.verdict.cameras[2].is_ok(), is_tolerated, "f × {of_focal}, {tolerance:?}");
                let verdict = stated.verdict.clone();
                assert_eq!(RigSolution { verdict, ..found }, stated, "f × {of_focal}, {tolerance:?}");
            }
        }
    }
}

/// What is no tolerance is refused.
#[test]
fn a_tolerance_is_a_number_from_0_on() {
    let room = room(&mut Rng::new(320));
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        for tolerance in [
            Tolerance { rotation_rad: Some(bad), translation_m: None },
            Tolerance { rotation_rad: None, translation_m: Some(bad) },
        ] {
            let config = RigConfig { tolerance, ..RigConfig::default() };
            let refused = room.solve(&room.observations, &config).unwrap_err();
            assert!(matches!(refused, Error::InvalidSetting { .. }), "{refused}");
        }
    }
}

/// The lens of any one camera wrong by what points show: the answer is not called right, or its covariance holds what the lens moves it by, from
/// ten views on and whether the sigmas are those of the noise or not.
#[test]
fn few_views_hide_no_lens() {
    let config = RigConfig { lens_errors: true, ..RigConfig::default() };
    let (mut n, mut n_ok) = (0, 0);
    for (n_views, faults) in
        [(10, [(1.05, 0.0), (0.95, 0.0), (1.0, 40.0)]), (20, [(1.03, 0.0), (0.97, 0.0), (1.0, 25.0)])]
    {
        for draw in 0..4 {
            let mut rng = Rng::new(7000 + draw);
            let room = room_of(&mut rng, n_views);
            let mut observations = room.disturbed(&mut rng);
            let factor = [0.7, 1.0, 2.0, 6.0][draw as usize];
            observations.iter_mut().flat_map(|s| &mut s.seen).for_each(|c| c.sigma_px *= factor);
            for camera in 0..4 {
                for (of_focal, off_px) in faults {
                    let mut cameras = room.cameras.clone();
                    let f_px = cameras[camera].matrix().expect("a matrix").fx_px;
                    cameras[camera] = lens(f_px * of_focal, off_px);
                    n += 1;
                    let Ok(found) = solved_as(&room, &cameras, observations.clone(), &config) else {
                        continue;
                    };
                    if found.verdict.is_inconsistent {
                        continue;
                    }
                    n_ok += 1;
                    let beyond = |c: usize| {
                        let error = room.error(&found, c).0;
                        (0..6)
                            .map(|i| error[i].abs() / found.cameras[c].covariance[(i, i)].sqrt())
                            .fold(0.0, f64::max)
                    };
                    let worst = (1..4).map(beyond).fold(0.0, f64::max);
                    assert!(
                        worst < 4.0,
                        "{n_views} views, draw {draw}, camera {camera}: f × {of_focal}, {off_px} px: {worst}"
                    );
                }
            }
        }
    }
    println!("of {n} wrong lenses {n_ok} are ok, none beyond its covariance");
}

/// Ten views, and focal lengths about one per cent apart, as cameras of one model have: each of two exchanged files passes for right by itself.
#[test]
fn exchanged_files_of_like_cameras_are_named() {
    let focal_px = [1120.0, 1148.0, 1133.0, 1105.0];
    let (mut rng, mut n_named, mut n_best) = (Rng::new(5), 0, 0);
    for draw in 0..12 {
        let mut room = room(&mut rng);
        room.cameras = focal_px.map(rooms::pinhole).to_vec();
        room.observations.clear();
        room.bodies.clear();
        room.n_views = 10;
        let facing = room.cam_from_rig[0].rotation.row(2).transpose();
        for view in 0..10 {
            let place = rooms::somewhere(&mut rng, Point::new(0.0, 0.0, 1.65), 0.35, facing, 0.5);
            room.see(view, 0, place, SIGMA_PX);
        }
        let observations = room.disturbed(&mut rng);
        let right = solved(&room, &room.cameras, observations.clone()).expect("a rig");
        assert!(!right.verdict.is_inconsistent, "draw {draw}: {:?}", right.verdict);
        let mut files = room.cameras.clone();
        files.swap(1, 2);
        let wrong = solved(&room, &files, observations).expect("a rig");
        assert!(wrong.verdict.is_inconsistent, "draw {draw}: {:?}", wrong.verdict);
        n_named +=
            usize::from(wrong.verdict.cameras[1].cause == Some(Cause::ExchangedIntrinsics { with: 2 }));
        n_best += usize::from(wrong.explanations[0].what == RigExplanation::Exchanged { a: 1, b: 2 });
    }
    println!("exchanged files named in {n_named} of 12, and the best explanation of {n_best}");
    assert!(11 <= n_named && 11 <= n_best);
}
