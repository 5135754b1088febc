//! A camera that moves while its reference is learned: the motion is recognised, and chance is not taken for one.

use crate::common::Rng;
use crate::common::sentry::{REALISTIC, SIGMA, Scene, Stream, WHITE, covariance, pan};
use nalgebra::{Matrix6, Vector6};
use resight_core::temporal::monitor::learn::{LearnConfig, learn, unsettled};
use resight_core::temporal::monitor::{Drift, FALSE_ALARM_PROBABILITY, Reading, Unrest, Unsettled};

fn nothing_stated() -> LearnConfig {
    LearnConfig { bias: Matrix6::zeros(), bias_time_s: 60.0, diurnal: Matrix6::zeros() }
}

fn readings(scene: Scene, seed: u64, n: usize, moved: impl Fn(usize) -> Vector6<f64>) -> Vec<Reading> {
    let mut stream = Stream::new(scene, seed);
    (0..n).map(|i| stream.next(&moved(i))).collect()
}

fn correlated(bias: f64, bias_time_s: f64) -> Scene {
    Scene { bias, bias_time_s, ..WHITE }
}

/// Looks of each kind; RESIGHT_LEARN_RUNS=100000 holds the stated probability itself.
fn runs() -> u64 {
    std::env::var("RESIGHT_LEARN_RUNS").ok().and_then(|runs| runs.parse().ok()).unwrap_or(100)
}

/// A pan of so many standard deviations of a reading.
fn turned(sigmas: f64) -> Vector6<f64> {
    Vector6::y() * sigmas * SIGMA[1]
}

fn stepped(at: usize, sigmas: f64) -> impl Fn(usize) -> Vector6<f64> {
    move |i| if at <= i { turned(sigmas) } else { Vector6::zeros() }
}

/// White noise, correlated errors for less and for more than the look, stated or not, of the size of a reading's noise or twenty times
/// that: none is taken for a motion more often than is stated. What is no larger than the noise ends the learning too.
#[test]
fn a_camera_that_stays_is_hardly_ever_said_to_have_moved() {
    let stated = LearnConfig { bias: covariance(1.0), bias_time_s: 120.0, diurnal: covariance(0.5) };
    let cases = [
        (WHITE, nothing_stated()),
        (correlated(1.0, 10.0), nothing_stated()),
        (correlated(1.0, 60.0), nothing_stated()),
        (REALISTIC, stated),
        (correlated(3.0, 20.0), nothing_stated()),
        (correlated(20.0, 100.0), nothing_stated()),
    ];
    let (mut false_alarms, mut looks) = (0, 0);
    for (scene, config) in cases {
        for n in [20, 50, 200] {
            for run in 0..runs() {
                let all = readings(scene, 0x1ea2_0000 + run, n, |_| Vector6::zeros());
                let found = unsettled(&all, &config).map(|found| found.unrest);
                false_alarms += u64::from(matches!(found, Some(Unrest::Step | Unrest::Ramp)));
                assert!(1.0 < scene.bias || found.is_none(), "run {run}, {n} readings: {found:?}");
                looks += 1;
            }
        }
    }
    let allowed = FALSE_ALARM_PROBABILITY * looks as f64;
    println!("{false_alarms} false alarms in {looks} looks, {allowed:.2} allowed");
    assert!(false_alarms as f64 <= allowed + 3.0 * allowed.sqrt(), "{false_alarms} in {looks}");
}

/// Normalised squared error of the motion that is reported, 6 in the mean where its covariance is true.
fn nees(drift: &Drift, truth: &Vector6<f64>) -> f64 {
    let error = drift.old_from_new - truth;
    error.dot(&drift.covariance.cholesky().expect("a covariance").solve(&error))
}

/// A rotation by ten standard deviations of a reading, wherever it is: found at its reading, with its size and a true error.
#[test]
fn a_sudden_motion_is_found_at_its_reading_with_its_size() {
    for at in [6, 25, 44] {
        let (mut found, mut sum) = (0, 0.0);
        for run in 0..40 {
            let reported =
                unsettled(&readings(WHITE, 0x57e9 + run, 50, stepped(at, 12.0)), &nothing_stated());
            let Some(Unsettled { unrest: Unrest::Step, reading, drift }) = reported else { continue };
            assert_eq!(reading, at);
            assert_eq!(drift.began_s, (at + 1) as f64);
            found += 1;
            sum += nees(&drift, &turned(12.0));
        }
        let mean = sum / f64::from(found);
        println!("after {at} readings: {found} of 40, mean NEES {mean:.2}");
        assert!(38 <= found && (3.0..9.0).contains(&mean), "{found} of 40 after {at}, mean NEES {mean}");
    }
}

/// Without the test the reference is the mean of two poses, and nothing would ever be noticed amid its noise.
#[test]
fn what_was_learned_across_a_motion_was_as_wide_as_the_motion() {
    let all = readings(WHITE, 0x1d, 50, stepped(25, 60.0));
    let across = learn(&all, &nothing_stated()).expect("a reference");
    let sigma = (across.noise.bias[(1, 1)] + across.noise.reference[(1, 1)]).sqrt();
    assert!(20.0 * SIGMA[1] < sigma, "{sigma} rad: then this test is of no use");
    let found = unsettled(&all, &nothing_stated()).expect("a motion");
    assert_eq!((found.unrest, found.reading), (Unrest::Step, 25));
    assert_eq!(unsettled(&all[25..], &nothing_stated()), None);
    let after = learn(&all[25..], &nothing_stated()).expect("a reference");
    assert!(after.noise.reference[(1, 1)].sqrt() < SIGMA[1], "{:?}", after.noise.reference);
}

/// Amid an error that lasts, of the size of the noise, and in long looks, of which not every reading is tested.
#[test]
fn a_large_motion_is_found_whatever_its_size_and_the_length_of_the_look() {
    for (n, at) in [(50, 20), (200, 120), (1000, 700)] {
        for sigmas in [50.0, 500.0, 3000.0] {
            let all = readings(correlated(1.0, 10.0), 0xb19, n, stepped(at, sigmas));
            let found = unsettled(&all, &nothing_stated()).expect("a motion");
            assert_eq!((found.unrest, found.reading), (Unrest::Step, at), "{n} readings, {sigmas} σ");
        }
    }
}

#[test]
fn a_motion_that_goes_on_is_no_reference() {
    for (total, is_certain) in [(25.0, false), (60.0, false), (100.0, true), (1000.0, true)] {
        let mut ramps = 0;
        for run in 0..20 {
            let moved = |i: usize| turned(total) * i as f64 / 49.0;
            let found = unsettled(&readings(WHITE, 0x4a39 + run, 50, moved), &nothing_stated());
            let found = found.unwrap_or_else(|| panic!("{total} σ, run {run}: taken for a reference"));
            ramps += u32::from(found.unrest == Unrest::Ramp);
        }
        assert!(!is_certain || ramps == 20, "{total} σ: {ramps} of 20 are reported as what they are");
    }
}

/// Motion to and fro, as of a camera on a mast in the wind, that no setting states.
#[test]
fn what_does_not_keep_still_is_no_reference() {
    for run in 0..20 {
        let moved = |i: usize| turned(30.0 * (i as f64 / 10.0).sin());
        let found = unsettled(&readings(WHITE, 0x51e + run, 50, moved), &nothing_stated());
        assert!(found.is_some(), "run {run}");
    }
    // Stated as an error that lasts, it is one.
    let stated = LearnConfig { bias: covariance(30.0), ..nothing_stated() };
    let moved = |i: usize| turned(30.0 * (i as f64 / 10.0).sin());
    assert_eq!(unsettled(&readings(WHITE, 0x51e, 50, moved), &stated), None);
}

/// One reading in ten is flipped by 20°: no motion; and a motion amid them is found, unless flips of three in seven confirm each other.
#[test]
fn flipped_poses_are_no_motion() {
    let mut missed = 0;
    for run in 0..30 {
        let mut chance = Rng::new(0xf11b + run);
        let flips: Vec<bool> = (0..60).map(|_| chance.uniform(0.0, 1.0) < 0.1).collect();
        let flip = |i: usize| if flips[i] { pan(20.0) } else { Vector6::zeros() };
        let still = unsettled(&readings(WHITE, 0xf0 + run, 60, flip), &nothing_stated());
        assert_eq!(still, None, "run {run}");
        let moved = |i: usize| flip(i) + stepped(30, 40.0)(i);
        let found = unsettled(&readings(WHITE, 0xf0 + run, 60, moved), &nothing_stated());
        missed += u32::from(found.is_none());
        let is_right = |found: Unsettled| found.unrest == Unrest::Step && (30..=33).contains(&found.reading);
        assert!(found.is_none_or(is_right), "run {run}: {found:?}");
    }
    assert!(missed <= 3, "{missed} of 30 missed");
}

/// Numbers of any kind are answered, and none of them with a motion that is none.
#[test]
fn readings_that_say_nothing_are_no_motion() {
    let all = readings(WHITE, 7, 50, |_| Vector6::zeros());
    let with = |change: &dyn Fn(usize, &mut Reading)| -> Vec<Reading> {
        let mut changed = all.clone();
        changed.iter_mut().enumerate().for_each(|(i, reading)| change(i, reading));
        changed
    };
    let hostile = [
        all[..10].to_vec(),
        with(&|_, reading| reading.t_s = 5.0),
        with(&|_, reading| reading.covariance = Matrix6::zeros()),
        with(&|_, reading| reading.covariance *= 1e300),
        with(&|i, reading| reading.covariance *= if i == 7 { f64::NAN } else { 1.0 }),
        with(&|i, reading| reading.a_from_b.translation.x *= if i == 7 { f64::NAN } else { 1.0 }),
        with(&|i, reading| reading.t_s = if i == 7 { f64::NAN } else { reading.t_s }),
        with(&|_, reading| reading.is_consistent = false),
    ];
    for (i, readings) in hostile.iter().enumerate() {
        assert_eq!(unsettled(readings, &nothing_stated()), None, "case {i}");
    }
    let of_none = LearnConfig { bias_time_s: f64::NAN, ..nothing_stated() };
    assert_eq!(unsettled(&all, &of_none), None);
}
