//! One camera at a time: motions that come and go, several of them, near an end, slow, amid diurnal variation, with rows lost.

use crate::support::day;
use rayon::prelude::*;
use resight::core::Vector6;
use resight_fleet::assess::{AssessConfig, CameraVerdict, Found, assess};
use resight_fleet::batch::SolvedRows;
use resight_fleet::simulate::SimulatedFleet;
use resight_fleet::solve::{Numbers, ViewColumns};
use resight_fleet::{FleetState, Solver};
use std::sync::Arc;

const HOUR_S: f64 = 3600.0;

/// Each camera's verdict, whose motion in its own frame is a function of its number and the time, seconds from the first image.
fn verdicts(fleet: &SimulatedFleet, motion: impl Fn(usize, f64) -> Vector6 + Sync) -> Vec<CameraVerdict> {
    let day = &fleet.simulation;
    let solver = Solver { cameras: Arc::new(fleet.known().expect("cameras")), sigma_px: day.sigma_px };
    let state = FleetState::new(900.0);
    fleet.cameras.par_iter().enumerate().for_each(|(number, camera)| {
        let of = |tick: usize| camera.row_moved(day, tick, &motion(number, tick as f64 * day.every_s));
        let rows: Vec<_> = (0..day.ticks()).filter_map(of).collect();
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
    let mut judged =
        assess(state, Some(&solver.cameras), &AssessConfig::default()).expect("verdicts").cameras;
    judged.sort_by(|a, b| a.camera.cmp(&b.camera));
    judged
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
    let of = |e: &resight_fleet::assess::Motion| (e.kind, (e.since_s - begin_s) / HOUR_S, e.angle_deg);
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

/// A drift through the day is a ramp, not a staircase.
#[test]
fn cases_a_slow_drift_is_a_ramp() {
    let fleet = still(12, 24.0, 60.0, 8);
    let all = verdicts(&fleet, |_, t_s| rotation(0, 0.5 * (t_s / (24.0 * HOUR_S) - 0.1).max(0.0)));
    for verdict in &all {
        let kinds: Vec<&str> = verdict.events.iter().map(|e| e.kind).collect();
        assert!(verdict.found == Found::Moved && kinds == ["ramp"], "{kinds:?} {}", verdict.message);
    }
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
