//! The drift sentry: its false alarms, its delays, and what it does not take for a drift.

mod common;

use common::Rng;
use common::sentry::{
    DAY_S, REALISTIC, SIGMA, Scene, Stream, WHITE, cam_from_target, covariance, delays_s, errors, mean,
    monitor, pan,
};
use nalgebra::{Matrix6, Vector6};
use resight_core::monitor::attribute::{Edge, attribute};
use resight_core::monitor::learn::{LearnConfig, learn};
use resight_core::monitor::{Course, Monitor, MonitorConfig, Reading, Watch};
use resight_core::{Error, Pose};

/// Times of the false alarms of thirty days at 1 Hz, started anew after each.
fn false_alarms_s(rate: f64, seed: u64) -> Vec<f64> {
    let (mut stream, mut alarms_s) = (Stream::new(REALISTIC, seed), Vec::new());
    let config = MonitorConfig { false_alarms_per_day: rate, ..sentry_config() };
    let mut sentry = monitor(&REALISTIC, rate);
    for _ in 0..(30.0 * DAY_S) as usize {
        if let Watch::Drifted(_) = sentry.push(&stream.next(&Vector6::zeros())) {
            alarms_s.push(stream.t_s);
            let t_s = stream.t_s;
            stream = Stream::new(REALISTIC, seed + alarms_s.len() as u64);
            stream.t_s = t_s;
            sentry = Monitor::new(&REALISTIC.reference(), &config, t_s).expect("a monitor");
        }
    }
    alarms_s
}

/// Thirty days at 1 Hz, with errors that last and a daily wobble; 1 alarm a day allowed *at most*. χ² with one degree of freedom
/// of the count beside the 30 allowed: one in a thousand exceeds 10.83. Below a quarter of 30 would be a test that wastes delay.
#[test]
fn false_alarm_rate_is_as_stated() {
    let (alarms, allowed) = (false_alarms_s(1.0, 0x5eed_0001).len() as f64, 30.0);
    let chi2 = (alarms - allowed).max(0.0).powi(2) / allowed;
    println!("{alarms} alarms in 30 days, {allowed} allowed, χ² {chi2:.1}");
    assert!(chi2 < 10.83, "{alarms} alarms for {allowed}: χ² {chi2}");
    assert!(0.25 * allowed < alarms, "{alarms}: deaf");
}

/// The same at 1 alarm an hour, where there are enough of them to see when they come: the wobble of the day does not raise them. χ² of the
/// counts by hour of day beside equal ones has 23 degrees of freedom: one in a thousand exceeds 49.7.
#[test]
fn false_alarms_come_at_any_hour_and_at_most_at_the_stated_rate() {
    let (alarms_s, allowed) = (false_alarms_s(24.0, 0x5eed_1001), 720.0);
    let chi2_count = (alarms_s.len() as f64 - allowed).max(0.0).powi(2) / allowed;
    let mut by_hour = [0.0; 24];
    alarms_s.iter().for_each(|t_s| by_hour[(t_s % DAY_S / 3600.0) as usize % 24] += 1.0);
    let expected = alarms_s.len() as f64 / 24.0;
    let chi2: f64 = by_hour.iter().map(|count| (count - expected).powi(2) / expected).sum();
    println!("{} alarms, {allowed} allowed, χ² {chi2_count:.1}; by hour of day χ² {chi2:.1}", alarms_s.len());
    assert!(chi2_count < 10.83 && 0.25 * allowed < alarms_s.len() as f64, "{} alarms", alarms_s.len());
    assert!(chi2 < 49.7, "{by_hour:?}");
}

fn sentry_config() -> MonitorConfig {
    MonitorConfig { false_alarms_per_day: 1.0, decision_period_s: 1.0, ..MonitorConfig::default() }
}

/// The best test that knows size and direction tends to ln A/(δ²/2σ²) readings on average (Lorden); this one knows neither.
#[test]
fn a_step_is_found_within_one_and_a_half_of_the_theoretical_delay() {
    for (rate, allowed) in [(1.0, 1.5), (1.0 / 30.0, 1.5), (1.0 / 365.0, 1.5)] {
        let theory_s = (DAY_S / rate).ln() / (0.5 * (0.1_f64.to_radians() / SIGMA[1]).powi(2));
        let delay_s = mean(&delays_s(WHITE, rate, 300.0, 0..400, |_| pan(0.1)));
        println!("{rate:.4} a day: {delay_s:.1} s, theory {theory_s:.1} s, ratio {:.2}", delay_s / theory_s);
        assert!(delay_s < allowed * theory_s, "{delay_s} s, theory {theory_s} s");
    }
}

/// 0.02° an hour reaches 0.1° after five hours.
#[test]
fn a_slow_drift_is_found_before_a_tenth_of_a_degree() {
    let scene = Scene { period_s: 10.0, ..REALISTIC };
    let delay_s = mean(&delays_s(scene, 1.0 / 30.0, DAY_S, 0..20, |since_s| pan(0.02 * since_s / 3600.0)));
    println!("found at {:.4}°", 0.02 * delay_s / 3600.0);
    assert!(0.02 * delay_s / 3600.0 < 0.1);
}

/// Pushes `n` readings and gives what is said at the end.
fn push(sentry: &mut Monitor, stream: &mut Stream, n: usize, moved: &Vector6<f64>) -> Watch {
    let mut last = Watch::Steady;
    for _ in 0..n {
        last = sentry.push(&stream.next(moved));
    }
    last
}

#[test]
fn the_drift_says_how_far_when_and_how() {
    let (mut stream, mut sentry) = (Stream::new(WHITE, 0xabcd), monitor(&WHITE, 1.0 / 30.0));
    assert_eq!(push(&mut sentry, &mut stream, 500, &Vector6::zeros()), Watch::Steady);
    let Watch::Drifted(drift) = push(&mut sentry, &mut stream, 100, &pan(0.4)) else { panic!("no alarm") };
    let error = drift.old_from_new - pan(0.4);
    let chi2 = error.dot(&(drift.covariance.try_inverse().expect("a covariance") * error));
    assert!(chi2 < 22.5, "χ² {chi2}; one in a thousand exceeds 22.5");
    assert!((drift.began_s - 501.0).abs() <= 2.0, "began at {}", drift.began_s);
    assert_eq!(drift.course, Course::Step);
}

#[test]
fn it_is_steady_again_when_the_camera_is_put_back() {
    let (mut stream, mut sentry) = (Stream::new(WHITE, 0x1234), monitor(&WHITE, 1.0 / 30.0));
    push(&mut sentry, &mut stream, 300, &Vector6::zeros());
    assert!(matches!(push(&mut sentry, &mut stream, 100, &pan(0.5)), Watch::Drifted(_)));
    assert_eq!(push(&mut sentry, &mut stream, 100, &Vector6::zeros()), Watch::Steady);
}

#[test]
fn an_accepted_drift_is_the_new_reference() {
    let (mut stream, mut sentry) = (Stream::new(WHITE, 0x4321), monitor(&WHITE, 1.0 / 30.0));
    push(&mut sentry, &mut stream, 300, &Vector6::zeros());
    push(&mut sentry, &mut stream, 100, &pan(0.5));
    sentry.accept().expect("accepted");
    assert_eq!(push(&mut sentry, &mut stream, 500, &pan(0.5)), Watch::Steady);
    assert!(matches!(push(&mut sentry, &mut stream, 100, &Vector6::zeros()), Watch::Drifted(_)));
}

/// Flipped poses and passers-by: far off, but alone or in disagreement.
#[test]
fn single_outliers_raise_no_alarm_and_are_counted() {
    let (mut stream, mut sentry) = (Stream::new(WHITE, 0x777), monitor(&WHITE, 1.0 / 30.0));
    let mut chance = Rng::new(99);
    for i in 0..2000 {
        let flip = if i % 10 == 9 { errors(&mut chance, 200.0) } else { Vector6::zeros() };
        let said = sentry.push(&stream.next(&flip));
        assert!(matches!(said, Watch::Steady | Watch::Settling), "{i}: {said:?}");
    }
    assert_eq!(sentry.outliers, 199); // the last one still waits
}

#[test]
fn a_gross_step_is_found_at_the_third_reading() {
    let (mut stream, mut sentry) = (Stream::new(REALISTIC, 0x31), monitor(&REALISTIC, 1.0 / 365.0));
    push(&mut sentry, &mut stream, 300, &Vector6::zeros());
    assert_eq!(push(&mut sentry, &mut stream, 2, &pan(5.0)), Watch::Settling);
    assert!(matches!(push(&mut sentry, &mut stream, 1, &pan(5.0)), Watch::Drifted(_)));
}

#[test]
fn a_blind_monitor_is_never_steady() {
    let (mut stream, mut sentry) = (Stream::new(WHITE, 0x55), monitor(&WHITE, 1.0));
    assert!(matches!(sentry.watch(6.0), Watch::Unseen { .. }), "before the first reading too");
    push(&mut sentry, &mut stream, 50, &Vector6::zeros());
    assert_eq!(sentry.watch(stream.t_s + 4.0), Watch::Steady);
    assert_eq!(sentry.watch(stream.t_s + 60.0), Watch::Unseen { for_s: 60.0 });
}

#[test]
fn contradictory_readings_are_named_and_not_used() {
    let (mut stream, mut sentry) = (Stream::new(WHITE, 0x66), monitor(&WHITE, 1.0));
    let mut last = Watch::Steady;
    for _ in 0..40 {
        last = sentry.push(&Reading { is_consistent: false, ..stream.next(&pan(3.0)) });
    }
    assert_eq!(last, Watch::Inconsistent);
    assert!(sentry.drift().is_none());
}

#[test]
fn clocks_that_step_back_and_numbers_that_are_none_are_left_out() {
    let (mut stream, mut sentry) = (Stream::new(WHITE, 0x77), monitor(&WHITE, 1.0));
    push(&mut sentry, &mut stream, 50, &Vector6::zeros());
    let good = stream.next(&Vector6::zeros());
    sentry.push(&Reading { t_s: 10.0, ..good });
    sentry.push(&Reading { t_s: f64::NAN, ..good });
    sentry.push(&Reading { covariance: Matrix6::from_element(f64::NAN), ..good });
    assert_eq!(sentry.out_of_order, 1);
    assert_eq!(sentry.push(&good), Watch::Steady);
}

#[test]
fn tolerated_drifts_raise_no_alarm() {
    let config = MonitorConfig {
        tolerance_rotation_rad: 0.2_f64.to_radians(),
        tolerance_translation_m: 0.01,
        ..sentry_config()
    };
    let mut sentry = Monitor::new(&WHITE.reference(), &config, 0.0).expect("a monitor");
    let mut stream = Stream::new(WHITE, 0x88);
    assert_eq!(push(&mut sentry, &mut stream, 400, &pan(0.1)), Watch::Steady);
    assert!(matches!(push(&mut sentry, &mut stream, 400, &pan(0.4)), Watch::Drifted(_)));
}

/// A hundred readings with a lasting error, one in ten flipped: the mean is found, and the lasting part for what it is.
#[test]
fn a_reference_is_learned_among_flips() {
    let scene = Scene { reference: 0.0, daily: 0.0, bias_time_s: 20.0, ..REALISTIC };
    let mut stream = Stream::new(scene, 0x99);
    let readings: Vec<Reading> =
        (0..1000).map(|i| stream.next(&if i % 10 == 3 { pan(20.0) } else { Vector6::zeros() })).collect();
    let config = LearnConfig { bias: Matrix6::zeros(), bias_time_s: 1.0, daily: Matrix6::zeros() };
    let learned = learn(&readings, &config).expect("a reference");
    let error = (learned.a_from_b * cam_from_target().inverse()).log();
    let chi2 = error.dot(&(learned.noise.reference.try_inverse().expect("a covariance") * error));
    assert!(chi2 < 22.5, "χ² {chi2}");
    let share = (0..6).map(|i| learned.noise.bias[(i, i)] / SIGMA[i].powi(2)).sum::<f64>() / 6.0;
    assert!((0.6..1.4).contains(&share), "lasting variance {share} σ², truth 1");
    assert!((8.0..40.0).contains(&learned.noise.bias_time_s), "{} s, truth 20 s", learned.noise.bias_time_s);
    assert_eq!(learn(&readings[..10], &config).err(), Some(Error::TooFewPoints { seen: 10, needed: 20 }));
}

/// Two cameras and two targets, every pair seen; the motion of `moved` and noise on every edge.
fn edges(moved: Option<usize>, pairs: &[(usize, usize)], seed: u64) -> (Vec<Edge>, Vector6<f64>) {
    let mut chance = Rng::new(seed);
    let motion = Vector6::new(0.01, -0.02, 0.005, 0.03, -0.01, 0.02);
    let of = |node: usize| if Some(node) == moved { Pose::exp(&motion) } else { Pose::identity() };
    let edge = |&(a, b): &(usize, usize)| {
        let a_from_b =
            Pose::exp(&Vector6::new(0.3 * a as f64, 0.2, -0.1 * b as f64, 0.5, 0.1 * a as f64, 2.0));
        // a_from_b now = (a's old_from_new)⁻¹ · a_from_b · b's old_from_new
        let now = of(a).inverse() * a_from_b * of(b);
        let seen = (a_from_b * now.inverse()).log() + errors(&mut chance, 0.5);
        Edge { a, b, a_from_b, motion: seen, covariance: covariance(0.5) }
    };
    (pairs.iter().map(edge).collect(), motion)
}

#[test]
fn a_moved_camera_and_a_moved_target_are_told_apart() {
    let pairs = [(0, 2), (0, 3), (1, 2), (1, 3)];
    for node in 0..4 {
        let (edges, motion) = edges(Some(node), &pairs, 0x1000 + node as u64);
        let answer = attribute(4, &edges);
        assert!(answer.is_explained && answer.rivals.is_empty(), "{answer:?}");
        let [moved] = &answer.moved[..] else { panic!("{answer:?}") };
        assert_eq!(moved.node, node);
        let error = moved.old_from_new - motion;
        assert!(error.norm() < 10.0 * 0.002, "{error}");
    }
    assert!(attribute(4, &edges(None, &pairs, 5).0).moved.is_empty());
}

#[test]
fn one_camera_and_one_target_leave_it_open_which_moved() {
    let answer = attribute(2, &edges(Some(0), &[(0, 1)], 7).0);
    assert_eq!(answer.moved.len() + answer.rivals.len(), 2);
}

#[test]
fn settings_that_cannot_be_are_named() {
    let config = MonitorConfig { false_alarms_per_day: 0.0, ..MonitorConfig::default() };
    let error = Monitor::new(&WHITE.reference(), &config, 0.0).expect_err("no rate");
    assert!(error.to_string().contains("false_alarms_per_day"), "{error}");
    let mut reference = WHITE.reference();
    reference.noise.reading = Matrix6::zeros();
    assert!(Monitor::new(&reference, &MonitorConfig::default(), 0.0).is_err());
}
