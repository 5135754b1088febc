//! Rigs whose cameras expose at different times while the target moves: the offsets are found, and the poses hold them.

use crate::budget::part;
use crate::common::recordings::{self, webcams};
use crate::common::rooms::{self, Room, pinhole};
use crate::common::{Rng, views};
use crate::recorded::recorded;
use nalgebra::{Vector2, Vector3, Vector6};
use resight_core::budget::ErrorSource;
use resight_core::multiview::rig::{
    FrameStamps, Observation, RigConfig, RigExplanation, RigProblem, RigSolution, TimeOffsets, solve_rig,
    time_offsets,
};
use resight_core::{Correspondence, Error, Point, Pose};

/// A hand carries a board: 0.2 m to and fro at half a hertz, turning by 25°, 1.6 m away.
#[derive(Clone, Copy)]
struct Hand {
    phases: [f64; 6],
    /// 1, or 0 for a board at rest.
    moves: f64,
}

impl Hand {
    fn new(rng: &mut Rng) -> Self {
        Hand { phases: [0.0; 6].map(|_| rng.uniform(0.0, std::f64::consts::TAU)), moves: 1.0 }
    }

    fn world_from_board(&self, t_s: f64) -> Pose {
        let wave =
            |k: usize, hertz: f64| (std::f64::consts::TAU * hertz * self.moves * t_s + self.phases[k]).sin();
        let turn = Vector3::new(wave(0, 0.31), wave(1, 0.37), 1.5 * wave(2, 0.23)) * 0.45;
        let shift = Vector3::new(wave(3, 0.5), 0.8 * wave(4, 0.41), 0.8 * wave(5, 0.29)) * 0.2;
        Pose::exp(&Vector6::new(turn.x, turn.y, turn.z, 0.0, 0.0, 0.0)).translated(shift)
    }
}

trait Translated {
    fn translated(self, shift: Vector3<f64>) -> Self;
}

impl Translated for Pose {
    fn translated(self, shift: Vector3<f64>) -> Self {
        Pose::new(self.rotation, self.translation + shift)
    }
}

const SIGMA_PX: f64 = 0.3;
/// True time of exposure less stamp, s.
const OFFSETS_S: [f64; 3] = [0.0, 0.0237, -0.0152];
const VIEWS: usize = 50;
const INTERVAL_S: f64 = 0.1;

/// A recording of three cameras.
struct Recording {
    room: Room,
    observations: Vec<Observation>,
    stamps_s: Vec<f64>,
}

/// `jitter_s` is that of the exposures, which stamps follow, `arrival_s` that of the stamps alone; rows are exposed `line_s` apart.
struct Clocks {
    offsets_s: [f64; 3],
    jitter_s: f64,
    arrival_s: f64,
    line_s: f64,
}

const CONSTANT: Clocks = Clocks { offsets_s: OFFSETS_S, jitter_s: 0.0, arrival_s: 0.0, line_s: 0.0 };

fn cameras_in_world() -> Vec<Pose> {
    let at = |angle: f64, y: f64| {
        views::looking_at(Point::new(1.6 * angle.sin(), y, -1.6 * angle.cos()), Point::new(0.02, 0.0, 0.03))
    };
    vec![at(-0.45, 0.2), at(0.05, -0.3), at(0.5, 0.1)]
}

impl Recording {
    fn new(rng: &mut Rng, hand: &Hand, clocks: &Clocks) -> Self {
        let world = cameras_in_world();
        let cam_from_rig: Vec<Pose> = world.iter().map(|pose| *pose * world[0].inverse()).collect();
        let cameras = vec![pinhole(900.0), pinhole(1000.0), pinhole(1100.0)];
        let points = rooms::board(7, 5, 0.06);
        let mut room = Room::new(cameras, cam_from_rig).with_target(points, 0, Pose::identity());
        room.n_views = VIEWS;
        let (mut observations, mut stamps_s) = (Vec::new(), Vec::new());
        for view in 0..VIEWS {
            for camera in 0..3 {
                let stamp_s = 1000.0 + view as f64 * INTERVAL_S + clocks.jitter_s * rng.normal();
                let exposed_s = stamp_s + clocks.offsets_s[camera] - 1000.0;
                let lens = &room.cameras[camera];
                let at = |t_s: f64, x: &Point| {
                    lens.project(&(world[camera] * hand.world_from_board(t_s) * *x)).unwrap()
                };
                let seen = |x: &Point| {
                    let v_px = at(exposed_s, x).y;
                    // A rolling shutter: a row's time is that of where the point is then, to first order in the time it takes.
                    let v_px = at(exposed_s + clocks.line_s * (v_px - 479.5), x).y;
                    let exact = at(exposed_s + clocks.line_s * (v_px - 479.5), x);
                    let pixel = exact + Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
                    Correspondence::new(lens, *x, pixel, SIGMA_PX).unwrap()
                };
                let seen = room.points[0].clone().iter().map(seen).collect();
                observations.push(Observation { camera, view, target: 0, seen });
                stamps_s.push(stamp_s + clocks.arrival_s * rng.normal());
            }
        }
        Recording { room, observations, stamps_s }
    }

    fn problem<'a>(&'a self, observations: &'a [Observation]) -> RigProblem<'a> {
        RigProblem {
            cameras: &self.room.cameras,
            body_of_target: &self.room.body_of_target,
            n_views: VIEWS,
            observations,
        }
    }

    fn offsets(&self, line_time: bool) -> Result<Option<TimeOffsets>, Error> {
        let times = FrameStamps { stamps_s: &self.stamps_s, line_time };
        time_offsets(&self.problem(&self.observations), &RigConfig::default(), &times)
    }

    fn solved(&self, offsets: &TimeOffsets) -> RigSolution {
        let config = RigConfig { time_offsets: Some(offsets), ..RigConfig::default() };
        solve_rig(&self.problem(&offsets.observations), &config).unwrap()
    }
}

/// Offsets of 24 and −15 ms are found to 1 ms and within their standard deviations, whether exposures are regular or not, and where stamps scatter
/// that have nothing to do with the exposures. The poses are as good as their covariance says; with all frames taken at once they are not.
#[test]
fn offsets_are_found_and_poses_are_honest() {
    const TRIALS: u64 = 12;
    let kinds = [
        ("regular", CONSTANT),
        ("jitter", Clocks { jitter_s: 0.008, ..CONSTANT }),
        ("arrival", Clocks { arrival_s: 0.008, ..CONSTANT }),
    ];
    for (name, clocks) in kinds {
        let (mut of_offsets, mut of_poses, mut at_once, mut largest_s) = (0.0, 0.0, 0.0, 0.0_f64);
        for seed in 0..TRIALS {
            let mut rng = Rng::new(8100 + seed);
            let hand = Hand::new(&mut rng);
            let recording = Recording::new(&mut rng, &hand, &clocks);
            let offsets = recording.offsets(false).unwrap().expect("it moves");
            if clocks.jitter_s != 0.0 || clocks.arrival_s != 0.0 {
                assert_eq!(offsets.stamps_count, clocks.arrival_s == 0.0, "{name} {seed}");
            }
            for camera in 1..3 {
                let (found_s, sigma_s) = offsets.offset_s[camera].expect("it sees the motion");
                largest_s = largest_s.max((found_s - OFFSETS_S[camera]).abs());
                of_offsets += ((found_s - OFFSETS_S[camera]) / sigma_s).powi(2) / 24.0;
            }
            let solution = recording.solved(&offsets);
            assert!(!solution.verdict.is_inconsistent, "{name} {seed}: {:?}", solution.verdict);
            assert!(solution.budgets[1].has(ErrorSource::TimeOffsets));
            let held = recording.room.solve(&recording.observations, &RigConfig::default()).unwrap();
            for camera in 1..3 {
                of_poses += recording.room.error(&solution, camera).1 / (2 * TRIALS) as f64;
                at_once += recording.room.error(&held, camera).0.norm()
                    / recording.room.error(&solution, camera).0.norm()
                    / 24.0;
            }
        }
        println!(
            "{name}: largest {:.3} ms, offsets {of_offsets:.2}, poses {of_poses:.2}, at once {at_once:.1} times",
            1e3 * largest_s
        );
        // Beside stamps that scatter by 8 ms an offset is known to 1.6 ms only.
        let most_s = if name == "arrival" { 5e-3 } else { 1e-3 };
        assert!(largest_s < most_s, "{name}: {largest_s}");
        assert!((0.5..1.8).contains(&of_offsets), "{name}: {of_offsets}");
        // What stamps scatter without the exposures moves the path of every view, and the scatter between views is in the covariance.
        let least = if name == "arrival" { 1.5 } else { 4.5 };
        assert!((least..7.5).contains(&of_poses), "{name}: {of_poses}");
        assert!(1.5 < at_once, "{name}: {at_once}");
    }
}

/// A camera that is 25 ms late makes a rig without stamps inconsistent, which that explains best: the motion leads to the true pose.
#[test]
fn a_late_camera_explains_a_rig_without_stamps() {
    for seed in 0..3 {
        let mut rng = Rng::new(8200 + seed);
        let hand = Hand::new(&mut rng);
        let clocks = Clocks { offsets_s: [0.0, 0.025, 0.0], ..CONSTANT };
        let recording = Recording::new(&mut rng, &hand, &clocks);
        let found = recording.room.solve(&recording.observations, &RigConfig::default()).unwrap();
        assert!(found.verdict.is_inconsistent, "{seed}: {:?}", found.verdict);
        let best = &found.explanations[0];
        let RigExplanation::Late { camera: 1, views } = best.what else { panic!("{seed}: {best:?}") };
        assert!((views - 0.25).abs() < 0.02 && 0.9 < best.probability, "{seed}: {best:?}");
        let truth = recording.room.cam_from_rig[1];
        let off = |pose: &Pose| (*pose * truth.inverse()).log().norm();
        let stated = found.cameras[1].cam_from_rig;
        let (before, after) = (off(&stated), off(&(Pose::exp(&best.motions[1]) * stated)));
        assert!(after < 0.3 * before, "{seed}: {before} before, {after} after");
    }
}

/// Cameras that are late by a millisecond or two, without stamps: neighbouring views share the error. Synchronised ones show none.
#[test]
fn neighbouring_views_share_the_error_of_late_cameras() {
    const TRIALS: u64 = 40;
    for (late_s, bar) in [(0.0, 4.5..7.5), (1e-3, 4.5..11.0), (2e-3, 4.5..11.0)] {
        let (mut stated, mut of_independent_views, mut n_shared) = (0.0, 0.0, 0);
        for seed in 0..TRIALS {
            let mut rng = Rng::new(9200 + seed);
            let hand = Hand::new(&mut rng);
            let clocks = Clocks { offsets_s: [0.0, late_s, -0.7 * late_s], ..CONSTANT };
            let recording = Recording::new(&mut rng, &hand, &clocks);
            let config = RigConfig { lens_errors: true, ..RigConfig::default() };
            let found = recording.room.solve(&recording.observations, &config).unwrap();
            assert!(!found.verdict.is_inconsistent, "{late_s} {seed}: {:?}", found.verdict);
            for camera in 1..3 {
                let (error, squared) = recording.room.error(&found, camera);
                stated += squared / (2 * TRIALS) as f64;
                let shared = part(&found.budgets[camera], ErrorSource::SharedInBlock);
                n_shared += usize::from(0.0 < shared.trace());
                let independent = found.cameras[camera].covariance - shared;
                of_independent_views += rooms::nees(&error, &independent) / (2 * TRIALS) as f64;
            }
        }
        println!(
            "{late_s} s: NEES {stated:.1}, of independent views {of_independent_views:.1}, {n_shared} shared"
        );
        assert!(bar.contains(&stated), "{late_s}: {stated}");
        match late_s {
            0.0 => assert!(n_shared <= 8, "{n_shared} of {} by chance", 2 * TRIALS),
            _ => assert!(1.5 * stated < of_independent_views, "{late_s}: {stated} {of_independent_views}"),
        }
    }
}

/// Cameras that are synchronised have offsets of zero within their standard deviations, and poses lose nothing.
#[test]
fn synchronised_cameras_have_no_offset() {
    let mut squares = 0.0;
    for seed in 0..12 {
        let mut rng = Rng::new(8300 + seed);
        let hand = Hand::new(&mut rng);
        let recording = Recording::new(&mut rng, &hand, &Clocks { offsets_s: [0.0; 3], ..CONSTANT });
        let offsets = recording.offsets(false).unwrap().expect("it moves");
        assert!(offsets.gain_chi2 < 20.0, "{}", offsets.gain_chi2);
        let (held, timed) = (
            recording.room.solve(&recording.observations, &RigConfig::default()).unwrap(),
            recording.solved(&offsets),
        );
        for camera in 1..3 {
            let (found_s, sigma_s) = offsets.offset_s[camera].unwrap();
            squares += (found_s / sigma_s).powi(2) / 24.0;
            let wider = timed.cameras[camera].covariance.trace() / held.cameras[camera].covariance.trace();
            assert!((0.8..1.5).contains(&wider), "{wider}");
        }
    }
    assert!((0.4..1.8).contains(&squares), "{squares}");
}

/// A board at rest, or one that is put down somewhere else every second, says nothing of time.
#[test]
fn without_motion_there_is_no_offset() {
    let mut rng = Rng::new(8400);
    let hand = Hand { moves: 0.0, ..Hand::new(&mut rng) };
    let at_rest = Recording::new(&mut rng, &hand, &CONSTANT);
    let hand = Hand::new(&mut rng);
    let moving = Recording::new(&mut rng, &hand, &CONSTANT);
    let seldom = Recording { stamps_s: moving.stamps_s.iter().map(|t_s| 20.0 * t_s).collect(), ..moving };
    assert_eq!(seldom.offsets(false).unwrap(), None);
    // Noise moves the estimated poses of a board at rest: the offset is as uncertain as this says.
    if let Some(offsets) = at_rest.offsets(false).unwrap() {
        for (found_s, sigma_s) in offsets.offset_s.iter().skip(1).flatten() {
            assert!(found_s.abs() < 4.0 * sigma_s, "{found_s} {sigma_s}");
        }
        let (held, timed) = (
            at_rest.room.solve(&at_rest.observations, &RigConfig::default()).unwrap(),
            at_rest.solved(&offsets),
        );
        for camera in 1..3 {
            let moved = timed.cameras[camera].cam_from_rig.angle_to_rad(&held.cameras[camera].cam_from_rig);
            assert!(moved < 1e-4, "{moved}");
        }
    }
}

/// The time from row to row of a rolling shutter, 30 µs, is found with the offsets where it is asked for.
#[test]
fn the_line_time_is_found() {
    let (mut squares, mut largest_s) = (0.0, 0.0_f64);
    for seed in 0..12 {
        let mut rng = Rng::new(8500 + seed);
        let hand = Hand::new(&mut rng);
        let recording = Recording::new(&mut rng, &hand, &Clocks { line_s: 30e-6, ..CONSTANT });
        let offsets = recording.offsets(true).unwrap().unwrap();
        let (line_s, sigma_s) = offsets.line_time_s.unwrap();
        squares += ((line_s - 30e-6) / sigma_s).powi(2) / 12.0;
        for camera in 1..3 {
            largest_s = largest_s.max((offsets.offset_s[camera].unwrap().0 - OFFSETS_S[camera]).abs());
        }
        assert!(!recording.solved(&offsets).verdict.is_inconsistent);
        assert_eq!(recording.offsets(false).unwrap().unwrap().line_time_s, None);
    }
    println!("{squares} {largest_s}");
    assert!(squares < 2.5, "{squares}");
    assert!(largest_s < 1e-3, "{largest_s}");
}

/// Four webcams that nothing triggers, their lenses as published: stamps of any camera that are late or early are found to 1 ms, and offsets of
/// blocks of time agree within their standard deviations, and poses of blocks agree within smaller covariances than with all frames taken at once.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn webcams_have_time_offsets() {
    let root = recorded("");
    let webcams = webcams(&root, 0.5);
    let config = RigConfig { lens_errors: true, ..RigConfig::default() };
    let (_, as_recorded) = webcams.solve_in_time(&config).unwrap();
    println!("{:.4?} {:.0}", as_recorded.offset_s, as_recorded.gain_chi2);
    for (late_camera, late_s) in [(0, 0.02), (1, 0.02), (2, 0.08), (2, -0.02), (3, 0.02)] {
        let mut late = webcams.clone();
        let of_camera = late.stamps_s.iter_mut().filter(|((_, camera), _)| *camera == late_camera);
        of_camera.for_each(|(_, t_s)| *t_s += late_s);
        let (_, later) = late.solve_in_time(&config).unwrap();
        for camera in 1..4 {
            // The first camera's clock is that of the rig.
            let expected_s = match late_camera {
                0 => late_s,
                _ if camera == late_camera => -late_s,
                _ => 0.0,
            };
            let moved_s = later.offset_s[camera].unwrap().0 - as_recorded.offset_s[camera].unwrap().0;
            println!("{late_camera} late by {late_s} s: {camera} by {:.6} s", moved_s - expected_s);
            assert!((moved_s - expected_s).abs() < 1e-3, "{late_camera} late, {camera}: {moved_s}");
        }
    }
    let (mut in_time, mut at_once) = (Vec::new(), Vec::new());
    let (mut sigma_in_time_m, mut sigma_at_once_m) = (Vec::new(), Vec::new());
    for n_parts in [2, 3, 4] {
        let part = |k: usize| webcams.part(|view| view * n_parts / webcams.n_views == k);
        // A block of time may lack a camera: it gives no rig.
        let solved = |part: recordings::Recording| {
            Some((part.solve(&config).ok()?, part.solve_in_time(&config).ok()?))
        };
        let blocks: Vec<_> = (0..n_parts).map(part).filter_map(solved).collect();
        for (i, (held_a, (timed_a, offsets_a))) in blocks.iter().enumerate() {
            for (held_b, (timed_b, offsets_b)) in &blocks[..i] {
                for camera in 1..4 {
                    at_once.push(apart(held_a, held_b, camera));
                    in_time.push(apart(timed_a, timed_b, camera));
                    sigma_at_once_m.push(sigma_m(held_a, held_b, camera));
                    sigma_in_time_m.push(sigma_m(timed_a, timed_b, camera));
                    let both = (offsets_a.offset_s[camera].unwrap(), offsets_b.offset_s[camera].unwrap());
                    let ((x, s), (y, t)) = both;
                    let square = (x - y).powi(2) / (s * s + t * t);
                    assert!(square < 9.0, "{n_parts} blocks, camera {camera}: {x} ± {s}, {y} ± {t}");
                }
            }
        }
    }
    println!("blocks of time: in time {in_time:.1?}, at once {at_once:.1?}");
    // Blocks that contradict the lenses hold this in their covariances, in time and at once.
    let mean = |all: &[f64]| all.iter().sum::<f64>() / all.len() as f64;
    println!("± in time {sigma_in_time_m:.4?} m, at once {sigma_at_once_m:.4?} m");
    assert!(!in_time.is_empty() && mean(&sigma_in_time_m) < mean(&sigma_at_once_m));
    assert!(mean(&in_time) < 6.0, "{in_time:?}");
    assert!(in_time.iter().all(|square| *square < 16.8), "{in_time:?}");
}

/// Standard deviation of the difference of a camera's positions.
fn sigma_m(a: &RigSolution, b: &RigSolution, camera: usize) -> f64 {
    let covariance = a.cameras[camera].covariance + b.cameras[camera].covariance;
    covariance.fixed_view::<3, 3>(3, 3).trace().sqrt()
}

/// Squared difference of a camera's poses in units of their covariances.
fn apart(a: &RigSolution, b: &RigSolution, camera: usize) -> f64 {
    let (a, b) = (&a.cameras[camera], &b.cameras[camera]);
    rooms::nees(&(a.cam_from_rig * b.cam_from_rig.inverse()).log(), &(a.covariance + b.covariance))
}

#[test]
fn times_that_cannot_be_are_refused() {
    let mut rng = Rng::new(8600);
    let hand = Hand::new(&mut rng);
    let recording = Recording::new(&mut rng, &hand, &CONSTANT);
    let short = Recording { stamps_s: vec![0.0; 3], ..recording };
    assert!(matches!(
        short.offsets(false),
        Err(Error::InvalidSetting { setting: "stamps_s", seen: 3.0, .. })
    ));
    let endless = Recording { stamps_s: vec![f64::NAN; short.observations.len()], ..short };
    assert!(matches!(endless.offsets(false), Err(Error::InvalidSetting { setting: "stamps_s", .. })));
}
