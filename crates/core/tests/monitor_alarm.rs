//! What is made of an alarm: correlated errors are no motion, ramps have a rate, steps an axis, and a camera that is back is steady.
//!
//! A tag of 100 mm a good metre away, five hundredths of a degree known badly and a thousandth known well: its rotations and translations look alike.
//! References are learned from fifty readings, one a second, as by a session, and nothing is stated beforehand.

use crate::common::Rng;
use nalgebra::{Matrix6, Vector6};
use resight_core::Pose;
use resight_core::temporal::monitor::learn::{LearnConfig, learn, unsettled};
use resight_core::temporal::monitor::{Alone, Drift, Monitor, MonitorConfig, MotionKind, Reading, Watch};

const HOUR_S: f64 = 3600.0;

/// Errors of a share of the variance that last, and of a size beside what readings state.
#[derive(Clone, Copy)]
struct Errors {
    correlated: f64,
    time_s: f64,
    scale: f64,
}

const WHITE: Errors = Errors { correlated: 0.0, time_s: 1.0, scale: 1.0 };

struct Stream {
    errors: Errors,
    chance: Rng,
    bias: Vector6<f64>,
    second: u32,
}

fn cam_from_tag() -> Pose {
    Pose::exp(&Vector6::new(0.35, -0.3, 0.2, -0.1, 0.05, 1.3))
}

/// Square root of a reading's covariance.
fn root() -> Matrix6<f64> {
    let mut root = Matrix6::from_diagonal(&Vector6::new(5e-3, 5e-3, 1.5e-3, 3e-4, 3e-4, 7e-4));
    (root[(3, 1)], root[(4, 0)]) = (6e-3, -6e-3);
    root
}

impl Stream {
    fn new(errors: Errors, seed: u64) -> Self {
        let mut stream = Stream { errors, chance: Rng::new(seed), bias: Vector6::zeros(), second: 0 };
        stream.bias = stream.normal() * errors.correlated.sqrt();
        stream
    }

    fn normal(&mut self) -> Vector6<f64> {
        Vector6::from_fn(|_, _| self.chance.normal())
    }

    fn next(&mut self, moved: &Vector6<f64>) -> Reading {
        self.second += 1;
        let Errors { correlated, time_s, scale } = self.errors;
        let kept = (-1.0 / time_s).exp();
        self.bias = self.bias * kept + self.normal() * (correlated * (1.0 - kept * kept)).sqrt();
        let error = root() * (self.bias + self.normal() * (1.0 - correlated).sqrt()) * scale;
        Reading {
            t_s: f64::from(self.second),
            a_from_b: (Pose::exp(moved) * Pose::exp(&error)).inverse() * cam_from_tag(),
            covariance: root() * root().transpose(),
            is_consistent: true,
        }
    }

    /// As a session does: from as many readings as agree.
    fn learned(&mut self) -> Monitor {
        let known = LearnConfig { bias: Matrix6::zeros(), bias_time_s: 60.0, diurnal: Matrix6::zeros() };
        let mut readings = Vec::new();
        loop {
            readings.extend((0..50).map(|_| self.next(&Vector6::zeros())));
            if unsettled(&readings, &known).is_none() {
                let reference = learn(&readings, &known).expect("a reference");
                return Monitor::new(&reference, &MonitorConfig::default(), f64::from(self.second))
                    .expect("a monitor");
            }
        }
    }
}

/// Alarms of a camera that stays for six hours, the seconds in which it was said to have moved, and those in which errors were doubted.
fn false_alarms(errors: Errors, seed: u64) -> (u32, u32, u32) {
    let mut stream = Stream::new(errors, seed);
    let (mut monitor, mut alarms, mut drifted, mut doubted) = (stream.learned(), 0, 0, 0);
    let mut was_drifted = false;
    for _ in 0..21_600 {
        let said = monitor.push(&stream.next(&Vector6::zeros()));
        let is_drifted = matches!(said, Watch::Drifted(_));
        alarms += u32::from(is_drifted && !was_drifted);
        drifted += u32::from(is_drifted);
        doubted += u32::from(said == Watch::CorrelatedErrors);
        was_drifted = is_drifted;
    }
    (alarms, drifted, doubted)
}

/// At one false alarm a month. Errors as long as these were not learned, for fifty seconds do not show them: what they do is reported as that,
/// for a minute each time, and seldom as a motion, which then is taken back. (Without that: 0, 6, 50 and 31 alarms, 0, 37,183, 26,566 and
/// 32,169 s.) Errors as long as the last row's have hardly shown themselves when they raise their first alarms.
#[test]
fn errors_that_last_longer_than_was_learned_are_no_motion() {
    let rows = [
        ("white", WHITE, 0, 0),
        ("σ stated 1.5 times too small", Errors { scale: 1.5, ..WHITE }, 1, 3600),
        ("30 % of the variance, 60 s", Errors { correlated: 0.3, time_s: 60.0, ..WHITE }, 10, 3600),
        ("30 % of the variance, 600 s", Errors { correlated: 0.3, time_s: 600.0, ..WHITE }, 18, 30_000),
    ];
    for (name, errors, allowed, allowed_s) in rows {
        let (mut alarms, mut drifted, mut doubted) = (0, 0, 0);
        for seed in 0..3 {
            let found = false_alarms(errors, 0xa1a_0000 + seed);
            (alarms, drifted, doubted) = (alarms + found.0, drifted + found.1, doubted + found.2);
        }
        println!("{name}: {alarms} alarms in 18 hours, {drifted} s moved, {doubted} s doubted");
        assert!(alarms <= allowed, "{name}: {alarms} alarms, {allowed} allowed");
        assert!(drifted <= allowed_s, "{name}: moved for {drifted} s, {allowed_s} s allowed");
        assert!(allowed == 0 || 0 < doubted, "{name}: never told");
    }
}

/// What is said after `seconds` of a motion that began at 600 s, and at its alarm.
fn said_of(seed: u64, seconds: u32, moved: impl Fn(f64) -> Vector6<f64>) -> (Option<Drift>, Drift) {
    let mut stream = Stream::new(WHITE, seed);
    let (mut monitor, mut first, mut last) = (stream.learned(), None, None);
    while stream.second < 600 + seconds {
        let since_s = (f64::from(stream.second) - 599.0).max(0.0);
        if let Watch::Drifted(drift) = monitor.push(&stream.next(&moved(since_s))) {
            first = first.or(Some(drift));
            last = Some(drift);
        }
    }
    (first, last.expect("an alarm"))
}

/// 0.03 and 0.1° an hour, about each axis: slowly, with the rate that it is, and mostly from the first word on.
#[test]
fn ramps_are_named_with_their_rate() {
    let mut sudden = 0;
    for (i, (axis, deg_per_h)) in
        [(0, 0.03_f64), (1, 0.03), (0, 0.1), (1, 0.1), (2, 0.1)].into_iter().enumerate()
    {
        let rate = Vector6::ith(axis, deg_per_h.to_radians() / HOUR_S);
        let (first, last) = said_of(0xa2a_0000 + i as u64, 36_000, |since_s| rate * since_s);
        sudden += u32::from(first.is_some_and(|first| first.course == MotionKind::Step));
        assert_eq!(last.course, MotionKind::Ramp, "{deg_per_h}°/h about {axis}");
        let found = last.rate.expect("a rate");
        let error = found.per_s - rate;
        let chi2 = error.dot(&found.covariance.cholesky().expect("a covariance").solve(&error));
        let (turn, covariance) = found.rotation_alone().expect("it turns");
        let [seen, sigma] =
            [turn[axis], covariance[(axis, axis)].sqrt()].map(|rad| rad.to_degrees() * HOUR_S);
        println!("{deg_per_h}°/h about {axis}: {seen:.4} ± {sigma:.4}°/h, χ² {chi2:.1}");
        assert!((seen / deg_per_h - 1.0).abs() < 0.1 && sigma < 0.1 * deg_per_h, "{seen} ± {sigma}°/h");
        let moved = rate * 36_000.0;
        let error = last.old_from_new - moved;
        let chi2 = error.dot(&last.covariance.cholesky().expect("a covariance").solve(&error));
        assert!(chi2 < 30.0, "where it has come to: χ² {chi2}");
    }
    // The alarm comes early, and the course is looked at again as readings come.
    assert!(sudden <= 1, "{sudden} of five were sudden at their alarm");
}

/// Steps about and along one axis: sudden, also hours later, and the axis is named though six numbers at once are all lost in their errors.
#[test]
fn steps_are_sudden_and_name_their_axis() {
    let steps = [
        (2, 0.5_f64.to_radians()),
        (2, -2_f64.to_radians()),
        (5, 0.01),
        (5, -0.02),
        (0, 0.3_f64.to_radians()),
    ];
    for (i, (axis, size)) in steps.into_iter().enumerate() {
        let (first, last) = said_of(0xa3a_0000 + i as u64, 7200, |since_s| {
            Vector6::ith(axis, if 0.0 < since_s { size } else { 0.0 })
        });
        let first = first.expect("an alarm");
        for (when, drift) in [("at the alarm", first), ("two hours later", last)] {
            assert_eq!(drift.course, MotionKind::Step, "{axis} {when}");
            let Some(Alone { axis: named, size: seen, sigma }) = drift.alone() else {
                assert!(axis < 2 && when == "at the alarm", "{axis} {size}: no axis {when}: {drift:?}");
                continue;
            };
            assert_eq!(named, axis, "{when}");
            assert!(
                (seen - size).abs() < 4.0 * sigma && sigma < 0.3 * size.abs(),
                "{seen} ± {sigma}, truly {size}"
            );
        }
    }
}

/// Moved for five minutes by a little or by much and put back: steady within a minute; where correlated errors as long and are as large were
/// learned from the fifty readings, within a quarter of an hour.
#[test]
fn a_camera_that_is_back_is_steady_soon() {
    for (i, size_deg) in [0.03, 0.05, 0.1, 1.0, 10.0_f64].into_iter().enumerate() {
        for seed in 0..4 {
            let mut stream = Stream::new(WHITE, 0xa4a_0000 + 16 * i as u64 + seed);
            let (mut monitor, mut reported) = (stream.learned(), None);
            let (mut back_s, mut away) = (None, Vector6::ith(0, size_deg.to_radians()));
            while stream.second < 4000 {
                let is_away = (1000..1300).contains(&stream.second);
                away[0] = if is_away { size_deg.to_radians() } else { 0.0 };
                match monitor.push(&stream.next(&away)) {
                    Watch::Drifted(_) => (reported, back_s) = (reported.or(Some(stream.second)), None),
                    Watch::Steady if 1300 < stream.second => back_s = back_s.or(Some(stream.second - 1300)),
                    _ => {}
                }
            }
            let (delay, back_s) = (reported.expect("an alarm") - 1000, back_s.expect("it is steady again"));
            println!("{size_deg}°: told after {delay} s, steady {back_s} s after it was put back");
            let allowed_s = if size_deg < 0.1 { 900 } else { 60 };
            assert!(back_s <= allowed_s, "{size_deg}°: {back_s} s, the alarm took {delay} s");
        }
    }
}
