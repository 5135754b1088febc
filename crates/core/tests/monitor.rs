//! The drift change detector: its false alarms, its delays, and what it does not take for a drift.

use crate::common::Rng;
use crate::common::sentry::{
    DAY_S, REALISTIC, SIGMA, Scene, Stream, WHITE, cam_from_target, delays_s, errors, mean, monitor, pan,
};
use nalgebra::{Matrix6, Vector6};
use resight_core::Error;
use resight_core::temporal::monitor::learn::{LearnConfig, learn};
use resight_core::temporal::monitor::{
    DriftNoise, Monitor, MonitorConfig, MotionKind, Reading, Reference, Watch,
};

/// Times of the false alarms of some days at 1 Hz, started anew after each.
fn false_alarms_s(rate: f64, seed: u64, days: f64) -> Vec<f64> {
    let (mut stream, mut alarms_s) = (Stream::new(REALISTIC, seed), Vec::new());
    let config = MonitorConfig { false_alarms_per_day: rate, ..detector_config() };
    let mut detector = monitor(&REALISTIC, rate);
    for _ in 0..(days * DAY_S) as usize {
        if let Watch::Drifted(_) = detector.push(&stream.next(&Vector6::zeros())) {
            alarms_s.push(stream.t_s);
            let t_s = stream.t_s;
            stream = Stream::new(REALISTIC, seed + alarms_s.len() as u64);
            stream.t_s = t_s;
            detector = Monitor::new(&REALISTIC.reference(), &config, t_s).expect("a monitor");
        }
    }
    alarms_s
}

/// Twenty days at 1 Hz, with correlated errors and a diurnal variation; 1 alarm a day allowed *at most*. χ² with one degree of freedom
/// of the count beside the 20 allowed: one in a thousand exceeds 10.83. Below a quarter of 20 would be a test that wastes delay.
#[test]
fn false_alarm_rate_is_as_stated() {
    let (alarms, allowed) = (false_alarms_s(1.0, 0x5eed_0001, 20.0).len() as f64, 20.0);
    let chi2 = (alarms - allowed).max(0.0).powi(2) / allowed;
    println!("{alarms} alarms in 20 days, {allowed} allowed, χ² {chi2:.1}");
    assert!(chi2 < 10.83, "{alarms} alarms for {allowed}: χ² {chi2}");
    assert!(0.25 * allowed < alarms, "{alarms}: deaf");
}

/// Twelve days at 1 alarm an hour, where there are enough of them to see when they come: the diurnal variation of the day does not raise them. χ² of the
/// counts by hour of day beside equal ones has 23 degrees of freedom: one in a thousand exceeds 49.7.
#[test]
fn false_alarms_come_at_any_hour_and_at_most_at_the_stated_rate() {
    let (alarms_s, allowed) = (false_alarms_s(24.0, 0x5eed_1001, 12.0), 288.0);
    let chi2_count = (alarms_s.len() as f64 - allowed).max(0.0).powi(2) / allowed;
    let mut by_hour = [0.0; 24];
    alarms_s.iter().for_each(|t_s| by_hour[(t_s % DAY_S / 3600.0) as usize % 24] += 1.0);
    let expected = alarms_s.len() as f64 / 24.0;
    let chi2: f64 = by_hour.iter().map(|count| (count - expected).powi(2) / expected).sum();
    println!("{} alarms, {allowed} allowed, χ² {chi2_count:.1}; by hour of day χ² {chi2:.1}", alarms_s.len());
    assert!(chi2_count < 10.83 && 0.25 * allowed < alarms_s.len() as f64, "{} alarms", alarms_s.len());
    assert!(chi2 < 49.7, "{by_hour:?}");
}

fn detector_config() -> MonitorConfig {
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
fn push(detector: &mut Monitor, stream: &mut Stream, n: usize, moved: &Vector6<f64>) -> Watch {
    let mut last = Watch::Steady;
    for _ in 0..n {
        last = detector.push(&stream.next(moved));
    }
    last
}

#[test]
fn the_drift_says_how_far_when_and_how() {
    let (mut stream, mut detector) = (Stream::new(WHITE, 0xabcd), monitor(&WHITE, 1.0 / 30.0));
    assert_eq!(push(&mut detector, &mut stream, 500, &Vector6::zeros()), Watch::Steady);
    let Watch::Drifted(drift) = push(&mut detector, &mut stream, 100, &pan(0.4)) else { panic!("no alarm") };
    let error = drift.old_from_new - pan(0.4);
    let chi2 = error.dot(&(drift.covariance.try_inverse().expect("a covariance") * error));
    assert!(chi2 < 22.5, "χ² {chi2}; one in a thousand exceeds 22.5");
    assert!((drift.began_s - 501.0).abs() <= 2.0, "began at {}", drift.began_s);
    assert_eq!(drift.course, MotionKind::Step);
}

#[test]
fn it_is_steady_again_when_the_camera_is_put_back() {
    let (mut stream, mut detector) = (Stream::new(WHITE, 0x1234), monitor(&WHITE, 1.0 / 30.0));
    push(&mut detector, &mut stream, 300, &Vector6::zeros());
    assert!(matches!(push(&mut detector, &mut stream, 100, &pan(0.5)), Watch::Drifted(_)));
    assert_eq!(push(&mut detector, &mut stream, 100, &Vector6::zeros()), Watch::Steady);
}

#[test]
fn an_accepted_drift_is_the_new_reference() {
    let (mut stream, mut detector) = (Stream::new(WHITE, 0x4321), monitor(&WHITE, 1.0 / 30.0));
    push(&mut detector, &mut stream, 300, &Vector6::zeros());
    push(&mut detector, &mut stream, 100, &pan(0.5));
    detector.accept().expect("accepted");
    assert_eq!(push(&mut detector, &mut stream, 500, &pan(0.5)), Watch::Steady);
    assert!(matches!(push(&mut detector, &mut stream, 100, &Vector6::zeros()), Watch::Drifted(_)));
}

/// Flipped poses and passers-by: far off, but alone or in disagreement.
#[test]
fn single_outliers_raise_no_alarm_and_are_counted() {
    let (mut stream, mut detector) = (Stream::new(WHITE, 0x777), monitor(&WHITE, 1.0 / 30.0));
    let mut chance = Rng::new(99);
    for i in 0..2000 {
        let flip = if i % 10 == 9 { errors(&mut chance, 200.0) } else { Vector6::zeros() };
        let said = detector.push(&stream.next(&flip));
        assert!(matches!(said, Watch::Steady | Watch::Checking), "{i}: {said:?}");
    }
    assert_eq!(detector.outliers, 199); // the last one still waits
}

#[test]
fn a_gross_step_is_found_at_the_third_reading() {
    let (mut stream, mut detector) = (Stream::new(REALISTIC, 0x31), monitor(&REALISTIC, 1.0 / 365.0));
    push(&mut detector, &mut stream, 300, &Vector6::zeros());
    assert_eq!(push(&mut detector, &mut stream, 2, &pan(5.0)), Watch::Checking);
    assert!(matches!(push(&mut detector, &mut stream, 1, &pan(5.0)), Watch::Drifted(_)));
}

#[test]
fn a_blind_monitor_is_never_steady() {
    let (mut stream, mut detector) = (Stream::new(WHITE, 0x55), monitor(&WHITE, 1.0));
    assert!(matches!(detector.watch(6.0), Watch::Stale { .. }), "before the first reading too");
    push(&mut detector, &mut stream, 50, &Vector6::zeros());
    assert_eq!(detector.watch(stream.t_s + 4.0), Watch::Steady);
    assert_eq!(detector.watch(stream.t_s + 60.0), Watch::Stale { for_s: 60.0 });
}

#[test]
fn contradictory_readings_are_named_and_not_used() {
    let (mut stream, mut detector) = (Stream::new(WHITE, 0x66), monitor(&WHITE, 1.0));
    let mut last = Watch::Steady;
    for _ in 0..40 {
        last = detector.push(&Reading { is_consistent: false, ..stream.next(&pan(3.0)) });
    }
    assert_eq!(last, Watch::Inconsistent);
    assert!(detector.drift().is_none());
    assert_eq!(detector.watch(stream.t_s + 4.0), Watch::Inconsistent);
    let unobserved_s = stream.t_s + 60.0;
    assert_eq!(
        detector.watch(unobserved_s),
        Watch::Stale { for_s: unobserved_s },
        "contradictions of long ago"
    );
}

#[test]
fn clocks_that_step_back_and_numbers_that_are_none_are_left_out() {
    let (mut stream, mut detector) = (Stream::new(WHITE, 0x77), monitor(&WHITE, 1.0));
    push(&mut detector, &mut stream, 50, &Vector6::zeros());
    let good = stream.next(&Vector6::zeros());
    detector.push(&Reading { t_s: 10.0, ..good });
    detector.push(&Reading { t_s: f64::NAN, ..good });
    detector.push(&Reading { covariance: Matrix6::from_element(f64::NAN), ..good });
    assert_eq!(detector.out_of_order, 1);
    assert_eq!(detector.push(&good), Watch::Steady);
}

fn tolerant(rotation_deg: f64, translation_m: f64) -> Monitor {
    let config = MonitorConfig {
        tolerance_rotation_rad: rotation_deg.to_radians(),
        tolerance_translation_m: translation_m,
        ..detector_config()
    };
    Monitor::new(&WHITE.reference(), &config, 0.0).expect("a monitor")
}

fn shift(x_m: f64) -> Vector6<f64> {
    Vector6::ith(3, x_m)
}

#[test]
fn tolerated_drifts_raise_no_alarm() {
    let (mut detector, mut stream) = (tolerant(0.2, 0.01), Stream::new(WHITE, 0x88));
    assert_eq!(push(&mut detector, &mut stream, 400, &pan(0.1)), Watch::Steady);
    assert!(matches!(push(&mut detector, &mut stream, 400, &pan(0.4)), Watch::Drifted(_)));
}

/// Either tolerance alone: turns in each direction, shifts none, and the other way round. The other three coordinates are never exactly
/// zero; fifty streams, each looked at a thousand times, have them as large as chance makes them. (The tolerated motion is four
/// standard deviations of a reading below its tolerance: an alarm after two readings errs by that much once in a thousand.)
#[test]
fn one_tolerance_alone_silences_what_it_names() {
    for seed in 0..50 {
        for (mut detector, tolerated) in
            [(tolerant(0.3, 0.0), pan(0.1)), (tolerant(0.0, 0.014), shift(0.006))]
        {
            let mut stream = Stream::new(WHITE, 0x8_8000 + seed);
            for i in 0..1000 {
                let said = detector.push(&stream.next(&tolerated));
                assert!(matches!(said, Watch::Steady | Watch::Checking), "{seed}: {i}, {said:?}");
            }
        }
    }
}

#[test]
fn one_tolerance_alone_leaves_the_rest_to_be_reported() {
    let beyond =
        [(0.2, 0.0, pan(0.4)), (0.2, 0.0, shift(0.01)), (0.0, 0.01, shift(0.02)), (0.0, 0.01, pan(0.2))];
    for (i, (rotation_deg, translation_m, moved)) in beyond.into_iter().enumerate() {
        let (mut detector, mut stream) =
            (tolerant(rotation_deg, translation_m), Stream::new(WHITE, 0x99 + i as u64));
        push(&mut detector, &mut stream, 100, &Vector6::zeros());
        assert!(matches!(push(&mut detector, &mut stream, 40, &moved), Watch::Drifted(_)), "{i}");
    }
}

/// A gross drift that is tolerated keeps the test running: its ratios are beyond any number, and what is said stays finite.
#[test]
fn a_tolerated_gross_drift_leaves_every_number_finite() {
    let (mut detector, mut stream) = (tolerant(5.0, 1.0), Stream::new(WHITE, 0x101));
    push(&mut detector, &mut stream, 100, &Vector6::zeros());
    for _ in 0..100 {
        assert_eq!(push(&mut detector, &mut stream, 3, &pan(3.0)), Watch::Steady);
        detector = Monitor::restore(&detector.snapshot()).expect("its own snapshot");
    }
    let Watch::Drifted(drift) = push(&mut detector, &mut stream, 40, &pan(9.0)) else { panic!("no alarm") };
    assert!((0.0..=1.0).contains(&drift.course_probability), "{}", drift.course_probability);
    assert!((0.0..500.0).contains(&drift.began_sigma_s), "{}", drift.began_sigma_s);
    assert!((100.0..=402.0).contains(&drift.began_s), "{}", drift.began_s);
}

/// A hundred readings with a correlated error, one in ten flipped: the mean is found, and the lasting part for what it is.
#[test]
fn a_reference_is_learned_among_flips() {
    let scene = Scene { reference: 0.0, diurnal: 0.0, bias_time_s: 20.0, ..REALISTIC };
    let mut stream = Stream::new(scene, 0x99);
    let readings: Vec<Reading> =
        (0..1000).map(|i| stream.next(&if i % 10 == 3 { pan(20.0) } else { Vector6::zeros() })).collect();
    let config = LearnConfig { bias: Matrix6::zeros(), bias_time_s: 1.0, diurnal: Matrix6::zeros() };
    let learned = learn(&readings, &config).expect("a reference");
    let error = (learned.a_from_b * cam_from_target().inverse()).log();
    let chi2 = error.dot(&(learned.noise.reference.try_inverse().expect("a covariance") * error));
    assert!(chi2 < 22.5, "χ² {chi2}");
    let share = (0..6).map(|i| learned.noise.bias[(i, i)] / SIGMA[i].powi(2)).sum::<f64>() / 6.0;
    assert!((0.6..1.4).contains(&share), "lasting variance {share} σ², truth 1");
    assert!((8.0..40.0).contains(&learned.noise.bias_time_s), "{} s, truth 20 s", learned.noise.bias_time_s);
    assert_eq!(learn(&readings[..10], &config).err(), Some(Error::TooFewPoints { seen: 10, needed: 20 }));
}

#[test]
fn settings_that_cannot_be_are_named() {
    let config = MonitorConfig { false_alarms_per_day: 0.0, ..MonitorConfig::default() };
    let error = Monitor::new(&WHITE.reference(), &config, 0.0).expect_err("no rate");
    assert!(error.to_string().contains("false_alarms_per_day"), "{error}");
    let mut reference = WHITE.reference();
    reference.noise.reading = Matrix6::zeros();
    assert!(Monitor::new(&reference, &MonitorConfig::default(), 0.0).is_err());
    for seen in [f64::NAN, f64::INFINITY, -0.1] {
        for config in [
            MonitorConfig { tolerance_rotation_rad: seen, ..MonitorConfig::default() },
            MonitorConfig { tolerance_translation_m: seen, ..MonitorConfig::default() },
        ] {
            let error = Monitor::new(&WHITE.reference(), &config, 0.0).expect_err("a tolerance");
            assert!(error.to_string().contains("tolerance"), "{error}");
        }
    }
}

/// Each is refused by name; none of them leads to a NaN.
#[test]
fn noise_that_is_none_is_named() {
    let refused = |noise: DriftNoise| {
        let reference = Reference { noise, ..REALISTIC.reference() };
        Monitor::new(&reference, &MonitorConfig::default(), 0.0).expect_err("noise").to_string()
    };
    let good = REALISTIC.reference().noise;
    for bias_time_s in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let error = refused(DriftNoise { bias_time_s, ..good });
        assert!(error.contains("bias_time_s"), "{error}");
    }
    let spoilt = |seen: f64| {
        let mut spoilt = good.diurnal;
        spoilt[(2, 2)] = seen;
        spoilt
    };
    for bad in [spoilt(f64::NAN), spoilt(f64::INFINITY), spoilt(-1e-6)] {
        for noise in [
            DriftNoise { reference: bad, ..good },
            DriftNoise { reading: bad, ..good },
            DriftNoise { bias: bad, ..good },
            DriftNoise { diurnal: bad, ..good },
        ] {
            assert!(refused(noise).contains("in a reference") || refused(noise).contains("of a reference"));
        }
    }
    let mut reference = REALISTIC.reference();
    reference.a_from_b.translation.x = f64::NAN;
    assert!(Monitor::new(&reference, &MonitorConfig::default(), 0.0).is_err());
    let config = LearnConfig { bias: Matrix6::zeros(), bias_time_s: 1.0, diurnal: spoilt(f64::NAN) };
    let mut stream = Stream::new(WHITE, 0x7);
    let readings: Vec<Reading> = (0..30).map(|_| stream.next(&Vector6::zeros())).collect();
    assert!(config.check().is_err() && learn(&readings, &config).is_err(), "learned noise that is none");
    assert!(LearnConfig { bias_time_s: 0.0, diurnal: Matrix6::zeros(), ..config }.check().is_err());
}
