//! One camera at a time: motions that come and go, several of them, near an end, slow, amid diurnal variation, with rows lost.

use crate::support::day;
use rayon::prelude::*;
use resight::Status;
use resight::core::Vector6;
use resight_fleet::assess::{AssessConfig, CameraVerdict, Found, Motion, assess, assess_since};
use resight_fleet::batch::SolvedRows;
use resight_fleet::simulate::SimulatedFleet;
use resight_fleet::solve::{Numbers, ViewColumns};
use resight_fleet::{FleetState, Solver};
use std::sync::Arc;

const HOUR_S: f64 = 3600.0;

/// Each camera's verdict, whose motion in its own frame is a function of its number and the time, seconds from the first image.
fn verdicts(fleet: &SimulatedFleet, motion: impl Fn(usize, f64) -> Vector6 + Sync) -> Vec<CameraVerdict> {
    let solver = solver(fleet);
    let state = state(fleet, &solver, (0.0, f64::INFINITY), motion);
    let mut judged =
        assess(state, Some(&solver.cameras), &AssessConfig::default()).expect("verdicts").cameras;
    judged.sort_by(|a, b| a.camera.cmp(&b.camera));
    judged
}

/// The state of a stretch of the record, hours from the first image.
fn state(
    fleet: &SimulatedFleet,
    solver: &Solver,
    (from_h, to_h): (f64, f64),
    motion: impl Fn(usize, f64) -> Vector6 + Sync,
) -> FleetState {
    let day = &fleet.simulation;
    let state = FleetState::new(900.0);
    let is_within = |tick: &usize| (from_h..to_h).contains(&(*tick as f64 * day.every_s / HOUR_S));
    fleet.cameras.par_iter().enumerate().for_each(|(number, camera)| {
        let of = |tick: usize| camera.row_moved(day, tick, &motion(number, tick as f64 * day.every_s));
        let rows: Vec<_> = (0..day.ticks()).filter(is_within).filter_map(of).collect();
        let pixels: Vec<f64> = rows.iter().flat_map(|(_, p)| p.iter().flat_map(|p| [p.x, p.y])).collect();
        let numbers = vec![number as u32; rows.len()];
        let pixels = Numbers::Rows { values: &pixels, width: 8 };
        let views = ViewColumns { camera: &numbers, pixels, points_m: None, sigma_px: None };
        state.add(&SolvedRows {
            names: vec![camera.name.clone()],
            camera: vec![0; rows.len()],
            time_s: rows.iter().map(|(t_s, _)| *t_s).collect(),
            view: None,
            answers: solver.solve(&views),
        });
    });
    state
}

fn solver(fleet: &SimulatedFleet) -> Solver {
    Solver { cameras: Arc::new(fleet.known().expect("cameras")), sigma_px: fleet.simulation.sigma_px }
}

/// Cameras that stay but for what a test does to them.
fn still(cameras: usize, hours: f64, every_s: f64, seed: u64) -> SimulatedFleet {
    let mut day = day(1, hours, every_s, seed).simulation;
    (day.cameras, day.shares, day.thermal_deg, day.poison) = (cameras, [0.0; 5], 1e-6, 0.0);
    day.fleet().expect("a fleet")
}

fn rotation(axis: usize, degrees: f64) -> Vector6 {
    let mut motion = Vector6::zeros();
    motion[axis] = degrees.to_radians();
    motion
}

/// The events of a camera that moved, as kinds, hours from the first image, and angles with their standard deviations, degrees.
fn events(verdict: &CameraVerdict, begin_s: f64) -> Vec<(&str, f64, [f64; 2])> {
    let of = |e: &Motion| (e.kind, (e.since_s - begin_s) / HOUR_S, e.angle_deg);
    verdict.events.iter().map(of).collect()
}

/// Away for some hours and back, from 12° for 8 h of 24 to 0.3° for 2 h: both steps are reported, with their sizes and times.
#[test]
fn cases_excursions_are_two_steps() {
    let mut squares = Vec::new();
    for (hours, from_h, to_h, degrees, every_s) in [
        (24.0, 7.13, 15.4, 12.0, 60.0),
        (24.0, 20.3, 22.4, 0.5, 60.0),
        (8.0, 3.0, 5.0, 3.0, 100.0),
        (8.0, 2.55, 5.5, 3.0, 100.0),
    ] {
        let fleet = still(12, hours, every_s, 5);
        let is_away = |t_s: f64| (from_h * HOUR_S..to_h * HOUR_S).contains(&t_s);
        let all =
            verdicts(&fleet, |n, t_s| if is_away(t_s) { rotation(n % 3, degrees) } else { Vector6::zeros() });
        for verdict in &all {
            let reported = events(verdict, fleet.simulation.begin_s);
            let near = |(kind, at, [angle, sigma]): &(&str, f64, [f64; 2]), h: f64| {
                *kind == "step"
                    && (at - h).abs() < 0.15
                    && (angle - degrees).abs() < 5.0 * sigma + 1e-3 * degrees
                    && *sigma < 0.3
            };
            let is_right = reported.len() == 2 && near(&reported[0], from_h) && near(&reported[1], to_h);
            assert!(
                verdict.found == Found::Moved && is_right,
                "{degrees}° {from_h}-{to_h} h of {hours}: {}",
                verdict.message
            );
            let (now, covariance) = verdict.now.expect("where it is at the end");
            let chi2 = now.dot(&covariance.cholesky().expect("a covariance").solve(&now));
            squares.push(chi2);
        }
    }
    // Back where they were: six degrees of freedom each, of which the errors of both steps are added, so that less than six is expected; the
    // noise is learned from 32 readings.
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    println!(
        "χ² of where it is at the end: {mean:.1} in the mean, {:.1} at most",
        squares.iter().copied().fold(0.0, f64::max)
    );
    assert!((1.0..9.0).contains(&mean) && squares.iter().all(|chi2| *chi2 < 60.0), "{squares:?}");
}

/// Two steps about one axis or two, are two; one an hour before the end is sudden and has its size.
#[test]
fn cases_two_steps_and_one_near_the_end() {
    let fleet = still(12, 8.0, 100.0, 6);
    for second in [1, 0] {
        let all = verdicts(&fleet, |_, t_s| {
            let first = if 2.0 * HOUR_S <= t_s { rotation(1, 0.5) } else { Vector6::zeros() };
            first + if 5.0 * HOUR_S <= t_s { rotation(second, 0.5) } else { Vector6::zeros() }
        });
        for verdict in &all {
            let reported = events(verdict, fleet.simulation.begin_s);
            let is_right = reported.len() == 2
                && reported
                    .iter()
                    .zip([2.0, 5.0])
                    .all(|(e, h)| (e.1 - h).abs() < 0.4 && (e.2[0] - 0.5).abs() < 5.0 * e.2[1]);
            assert!(is_right, "{reported:?} {}", verdict.message);
        }
    }
    let fleet = still(12, 24.0, 90.0, 7);
    let all =
        verdicts(&fleet, |_, t_s| if 23.0 * HOUR_S <= t_s { rotation(1, 1.0) } else { Vector6::zeros() });
    for verdict in &all {
        let reported = events(verdict, fleet.simulation.begin_s);
        let is_right = reported.len() == 1
            && (reported[0].1 - 23.0).abs() < 0.3
            && (reported[0].2[0] - 1.0).abs() < 5.0 * reported[0].2[1];
        assert!(is_right && reported[0].0 == "step", "{reported:?} {}", verdict.message);
    }
}

/// A drift through the day is a ramp, not a staircase, and as large as it is by the end.
#[test]
fn cases_a_slow_drift_is_a_ramp() {
    let fleet = still(12, 24.0, 60.0, 8);
    let all = verdicts(&fleet, |_, t_s| rotation(0, 0.5 * (t_s / (24.0 * HOUR_S) - 0.1).max(0.0)));
    for verdict in &all {
        let kinds: Vec<&str> = verdict.events.iter().map(|e| e.kind).collect();
        assert!(verdict.found == Found::Moved && kinds == ["ramp"], "{kinds:?} {}", verdict.message);
        assert!(is_near(&verdict.events[0], 0.45), "{}", verdict.message);
    }
}

/// Whether an angle is this one within four standard deviations, which are small.
fn is_near(motion: &Motion, degrees: f64) -> bool {
    let [angle, sigma] = motion.angle_deg;
    (angle - degrees).abs() < 4.0 * sigma && sigma < 0.1 * degrees + 0.01
}

/// The angles' mean square error in their standard deviations.
fn mean_square(angles: &[([f64; 2], f64)]) -> f64 {
    let square = |([angle, sigma], truth): &([f64; 2], f64)| ((angle - truth) / sigma).powi(2);
    angles.iter().map(square).sum::<f64>() / angles.len() as f64
}

/// Slow motions that continue, and that end after hours or one: the size is rate times duration, and both ends are known.
#[test]
fn cases_ramps_are_as_large_as_rate_times_duration() {
    let mut angles = Vec::new();
    for (rate, from_h, to_h) in [(0.02, 0.0, 24.0), (0.05, 12.0, 24.0), (0.1, 6.0, 12.0), (0.5, 6.0, 7.0)] {
        let fleet = still(12, 24.0, 90.0, 12);
        let moved = |t_s: f64| rate * (t_s / HOUR_S - from_h).clamp(0.0, to_h - from_h);
        for verdict in &verdicts(&fleet, |n, t_s| rotation(n % 2, moved(t_s))) {
            let kinds: Vec<&str> = verdict.events.iter().map(|e| e.kind).collect();
            assert!(verdict.found == Found::Moved && kinds == ["ramp"], "{rate}: {}", verdict.message);
            let ramp = &verdict.events[0];
            // The first full period begins after 200 s, the last image is taken 90 s before the end.
            let truth = rate * (to_h.min(24.0 - 90.0 / HOUR_S) - from_h.max(200.0 / HOUR_S));
            assert!(is_near(ramp, truth), "{rate}°/h: {}", verdict.message);
            let off_h = |at_s: f64, h: f64| ((at_s - fleet.simulation.begin_s) / HOUR_S - h).abs();
            assert!(off_h(ramp.since_s, from_h) < 0.6, "{rate}°/h: {}", verdict.message);
            let is_until = ramp.until_s.map_or(to_h == 24.0, |until| off_h(until[0], to_h) < 0.6);
            assert!(is_until, "{rate}°/h: {}", verdict.message);
            angles.push((ramp.angle_deg, truth));
        }
    }
    let square = mean_square(&angles);
    println!("mean square of the sizes of ramps: {square:.2}");
    assert!((0.3..2.0).contains(&square), "{square}");
}

/// A step amid a slow motion: both, each with its size.
#[test]
fn cases_a_step_amid_a_ramp_is_both() {
    let fleet = still(12, 24.0, 90.0, 13);
    let all = verdicts(&fleet, |n, t_s| {
        let step = if 15.0 * HOUR_S <= t_s { 1.0 } else { 0.0 };
        rotation(n % 2, 0.02 * t_s / HOUR_S + step)
    });
    for verdict in &all {
        let kinds: Vec<&str> = verdict.events.iter().map(|e| e.kind).collect();
        assert!(verdict.found == Found::Moved && kinds == ["ramp", "step"], "{}", verdict.message);
        let is_right = is_near(&verdict.events[0], 0.48) && is_near(&verdict.events[1], 1.0);
        assert!(is_right, "{}", verdict.message);
        let (now, covariance) = verdict.now.expect("where it is at the end");
        let axis = now.fixed_rows::<3>(0).iamax();
        let sigma = covariance[(axis, axis)].sqrt();
        assert!((now[axis] - 1.48_f64.to_radians()).abs() < 4.0 * sigma, "{}", verdict.message);
    }
}

/// 12° for the last minutes, 3° within a period, 12° for a period: a period that holds both poses does not make the motion smaller, and a motion
/// that no second period confirms is undecided, not ok.
#[test]
fn cases_a_period_with_both_poses_tells_how_far() {
    for (degrees, from_h, to_h, kind) in [
        (12.0, 23.85, 24.0, "pending"),
        (12.0, 23.75, 24.0, "pending"),
        // A period begins 43,400 s after the first image.
        (3.0, 12.1, 12.25, "excursion"),
        (12.0, 43_400.0 / 3600.0, 44_300.0 / 3600.0, "excursion"),
    ] {
        let fleet = still(12, 24.0, 90.0, 14);
        let is_away = |t_s: f64| (from_h * HOUR_S..to_h * HOUR_S).contains(&t_s);
        let mut angles = Vec::new();
        let away = |n: usize, t_s| if is_away(t_s) { rotation(n % 3, degrees) } else { Vector6::zeros() };
        for verdict in &verdicts(&fleet, away) {
            assert_eq!(verdict.found.status(), Status::Undecided, "{}", verdict.message);
            assert!(verdict.events.len() == 1 && verdict.events[0].kind == kind, "{}", verdict.message);
            // About the axis that is measured worst the scatter of the rows says it to a ninth.
            let [angle, sigma] = verdict.events[0].angle_deg;
            let is_right = (angle - degrees).abs() < 4.0 * sigma && sigma < 0.15 * degrees;
            assert!(is_right, "{degrees}° from {from_h}: {}", verdict.message);
            let off_h = (verdict.events[0].since_s - fleet.simulation.begin_s) / HOUR_S - from_h;
            assert!(off_h.abs() < 0.15, "{}", verdict.message);
            angles.push((verdict.events[0].angle_deg, degrees));
        }
        let square = mean_square(&angles);
        println!("mean square of {degrees}° from {from_h} h: {square:.2}");
        assert!(square < 4.0, "{square}");
    }
}

/// A step amid an undeclared diurnal variation: its standard deviation contains what that does, and there is no shift beside it.
#[test]
fn cases_a_step_amid_a_diurnal_variation() {
    let mut angles = Vec::new();
    for (amplitude, seed) in [(0.03, 15), (0.01, 16)] {
        let fleet = still(12, 24.0, 90.0, seed);
        let all = verdicts(&fleet, |n, t_s| {
            let swing = amplitude * (std::f64::consts::TAU * t_s / (24.0 * HOUR_S)).sin();
            rotation(n % 2, swing + if 14.0 * HOUR_S <= t_s { 0.5 } else { 0.0 })
        });
        for verdict in &all {
            let kinds: Vec<&str> = verdict.events.iter().map(|e| e.kind).collect();
            assert!(kinds == ["step"] && is_near(&verdict.events[0], 0.5), "{}", verdict.message);
            let step = &verdict.events[0];
            let is_shifted = step.rotation_alone_deg.is_none() && 4.0 * step.shift_m[1] < step.shift_m[0];
            assert!(!is_shifted, "{}", verdict.message);
            angles.push((step.angle_deg, 0.5));
        }
    }
    let square = mean_square(&angles);
    println!("mean square of steps amid diurnal variation: {square:.2}");
    assert!(square < 2.0, "{square}");
}

/// Yesterday's motions are no news: a camera that moved yesterday, and perhaps in the last minutes of today, has not moved today, and a mast that
/// moved yesterday is not listed. What a single period said yesterday and others confirm today is news.
#[test]
fn cases_what_is_known_is_no_news() {
    let fleet = still(4, 48.0, 90.0, 18);
    let motion = |n: usize, t_s: f64| {
        let after = |h: f64, degrees: f64| if h * HOUR_S <= t_s { degrees } else { 0.0 };
        let degrees = match n {
            0 => after(10.0, 1.0) + after(47.85, 3.0),
            1 => after(10.0, 1.0) + after(34.0, 0.4),
            2 => after(10.0, 1.0),
            _ => after(23.6, 1.0),
        };
        rotation(1, degrees)
    };
    let solver = solver(&fleet);
    let day = |from_h: f64| state(&fleet, &solver, (from_h, from_h + 24.0), motion);
    let config = AssessConfig::default();
    let yesterday = assess(day(0.0), Some(&solver.cameras), &config).expect("verdicts");
    assert!(yesterday.together.len() == 1 && yesterday.together[0].cameras.len() == 3);
    let today = assess_since(day(24.0), day(0.0), Some(&solver.cameras), &config).expect("verdicts");
    let of = |n: usize| today.cameras.iter().find(|v| v.camera == fleet.cameras[n].name).expect("a verdict");
    let found: Vec<Found> = (0..4).map(|n| of(n).found).collect();
    let expected = [Found::TooFew, Found::Moved, Found::Steady, Found::Moved];
    assert_eq!(found, expected, "{} {}", of(0).message, of(3).message);
    // Where it is at the end, though half of the last period saw it before.
    let now = of(0).now.expect("where it is at the end");
    let (degrees, sigma) = (now.0[1].to_degrees(), now.1[(1, 1)].sqrt().to_degrees());
    assert!((degrees - 4.0).abs() < 4.0 * sigma && sigma < 0.3, "{}", of(0).message);
    // The motion of today, though that of yesterday has more evidence.
    assert!(is_near(of(1).motion().expect("a motion"), 0.4), "{}", of(1).message);
    assert!(today.together.is_empty(), "{:?}", today.together);
}

/// Cameras that stay, amid white noise and diurnal variation, are never called moved.
#[test]
fn cases_cameras_that_stay() {
    for thermal_deg in [1e-6, 0.01, 0.05] {
        let mut day = still(1, 24.0, 90.0, 9).simulation;
        (day.cameras, day.thermal_deg) = (300, thermal_deg);
        let fleet = day.fleet().expect("a fleet");
        let all = verdicts(&fleet, |_, _| Vector6::zeros());
        for verdict in &all {
            let is_quiet = matches!(verdict.found, Found::Steady | Found::Wandering);
            assert!(is_quiet, "{thermal_deg}: {} {}", verdict.camera, verdict.message);
        }
    }
}
