//! Motions after the first: each is reported as soon as the first, with its own beginning and size, and only a camera that is back is steady.
//!
//! A tag of 0.16 m at 1.2 m, 0.2 px, white noise, a reading a second, nothing declared. What it leaves out: longer records and other noise, of which
//! `cargo run --release -p resight-core --example watch_motions` makes tables.

use crate::common::conditions::{Condition, Scene, View};
use nalgebra::Vector6;
use resight_core::temporal::monitor::{Drift, Monitor, MonitorConfig, MotionKind, Watch};

struct Watched {
    monitor: Monitor,
    scene: Scene,
    last_s: Option<f64>,
    /// When, and another motion than the last one; none: the camera is where it was.
    told: Vec<(f64, Option<Drift>)>,
}

impl Watched {
    fn new(seed: u64) -> Self {
        let mut scene = Scene::of(View::near(), Condition::White, 1.0, seed);
        let monitor = scene.learned(50, &MonitorConfig::default());
        Watched { monitor, scene, last_s: None, told: Vec::new() }
    }

    /// With a pan at each time, degrees.
    fn until(&mut self, until_s: f64, degrees: impl Fn(f64) -> f64) {
        while self.scene.t_s < until_s {
            let reading = self.scene.next(&pan(degrees(self.scene.t_s)));
            match self.monitor.push(&reading) {
                Watch::Drifted(drift) if self.last_s != Some(drift.began_s) => {
                    self.last_s = Some(drift.began_s);
                    self.told.push((reading.t_s, Some(drift)));
                }
                Watch::Steady if self.last_s.take().is_some() => {
                    self.told.push((reading.t_s, None));
                }
                _ => {}
            }
        }
    }
}

fn pan(degrees: f64) -> Vector6<f64> {
    Vector6::y() * degrees.to_radians()
}

/// Of what is said of a pan, degrees, beside its covariance.
fn chi2(said: &Drift, degrees: f64) -> f64 {
    let error = said.old_from_new - pan(degrees);
    error.dot(&said.covariance.cholesky().expect("a covariance").solve(&error))
}

/// A motion every five minutes: delay, beginning, size alone and size in all; no other word.
#[test]
fn each_motion_is_told_with_its_own_beginning_and_size() {
    const APART_S: f64 = 300.0;
    for (row, angles) in [
        [0.02, 1.02, 1.12],
        [0.3, 1.3, 0.3],
        [0.3, 0.6, 0.3],
        [0.3, 0.6, 0.9],
        [1.0, 1.1, 1.12],
        [0.05, 0.1, 0.15],
    ]
    .into_iter()
    .enumerate()
    {
        for seed in 0..2 {
            let mut watched = Watched::new(0x2ec0 + 16 * row as u64 + seed);
            watched.until(APART_S, |_| 0.0);
            let mut before = 0.0;
            for (i, now) in angles.into_iter().enumerate() {
                let began_s = APART_S * (i + 1) as f64;
                watched.until(began_s + APART_S, |_| now);
                let name = format!("{angles:?}, motion {}: {:?}", i + 1, watched.told);
                assert_eq!(watched.told.len(), i + 1, "{name}");
                let Some((t_s, Some(drift))) = watched.told.last() else { panic!("{name}") };
                let longest_s = if (now - before).abs() < 0.03 { 12.0 } else { 4.0 };
                assert!(t_s - began_s <= longest_s, "{name}");
                assert!((drift.began_s - began_s).abs() <= 4.0 && drift.course == MotionKind::Step, "{name}");
                let Watch::Drifted(known) = watched.monitor.watch(watched.scene.t_s) else {
                    panic!("{name}")
                };
                assert_eq!(known.again.map(|again| again.number), (0 < i).then_some(i as u32 + 1), "{name}");
                assert!((known.first_began_s() - APART_S).abs() <= 4.0, "{name}");
                for (said, truly) in
                    [(known, now), (known.last(), now - before), (drift.last(), now - before)]
                {
                    let chi2 = chi2(&said, truly);
                    assert!(chi2 < 27.9, "{name}: χ² {chi2} of {truly}°");
                }
                before = now;
            }
        }
    }
}

/// All of the way back is as soon reported as the way there. Half of it is a further motion and not back.
#[test]
fn a_return_is_told_as_soon_and_half_of_one_is_none() {
    for (row, (away, next, is_back)) in
        [(1.0, 0.0, true), (0.05, 0.0, true), (0.02, 0.0, true), (0.04, 0.02, false), (0.1, 0.05, false)]
            .into_iter()
            .enumerate()
    {
        for seed in 0..4 {
            let mut watched = Watched::new(0xbac0 + 16 * row as u64 + seed);
            watched.until(300.0, |_| 0.0);
            watched.until(600.0, |_| away);
            watched.until(900.0, |_| next);
            let name = format!("{away}° to {next}°: {:?}", watched.told);
            let [(first_s, Some(_)), (second_s, _), ..] = watched.told[..] else { panic!("{name}") };
            assert!(second_s - 600.0 <= 1.5 * (first_s - 300.0) + if is_back { 1.0 } else { 6.0 }, "{name}");
            let are_steady = || watched.told.iter().map(|(_, told)| told.is_none());
            // One in ten returns of the smallest size seems to be a motion that ends before it is back, until more is read.
            assert!(are_steady().filter(|is_steady| *is_steady).count() == usize::from(is_back), "{name}");
            assert!(watched.told.len() <= 3 && are_steady().next_back() == Some(is_back), "{name}");
        }
    }
}

/// Away by a degree and back to 0.05° from its place, where it was before: some runs hold that for its place, and none calls it steady.
#[test]
fn a_camera_that_comes_back_near_its_place_is_not_steady() {
    let mut in_doubt = 0;
    for seed in 0..24 {
        let mut watched = Watched::new(0x2ec0 + seed);
        let degrees = |t_s: f64| match t_s {
            _ if t_s < 1000.0 => 0.0,
            _ if (2000.0..3000.0).contains(&t_s) => 1.05,
            _ => 0.05,
        };
        watched.until(3003.0, degrees);
        for _ in 0..300 {
            let said = watched.monitor.push(&watched.scene.next(&pan(0.05)));
            assert!(matches!(said, Watch::Drifted(_) | Watch::Away(_)), "{seed}: {said:?}");
            in_doubt += u32::from(matches!(said, Watch::Away(_)));
        }
    }
    assert!(0 < in_doubt, "no run was in doubt: other seeds are needed");
}

/// Half a degree an hour is one motion, however long; a step amid it is one more.
#[test]
fn a_ramp_that_goes_on_is_no_news_and_a_step_amid_it_is() {
    const QUIET_S: f64 = 3600.0;
    const STEP_S: f64 = 8000.0;
    let mut watched = Watched::new(0x4a3b);
    watched.until(QUIET_S, |_| 0.0);
    let ramp = |t_s: f64| 0.5 * (t_s - QUIET_S) / 3600.0;
    watched.until(STEP_S, ramp);
    let Watch::Drifted(drift) = watched.monitor.watch(STEP_S) else { panic!("{:?}", watched.told) };
    assert_eq!((drift.course, drift.again), (MotionKind::Ramp, None), "{:?}", watched.told);
    let before = watched.told.len();
    assert!(before <= 3, "{:?}", watched.told);
    watched.until(STEP_S + 60.0, |t_s| ramp(t_s) + 0.3);
    assert_eq!(before + 1, watched.told.len(), "{:?}", watched.told);
    let (told_s, told) = watched.told[before];
    assert!(told_s <= STEP_S + 5.0, "{:?}", watched.told);
    let Some(drift) = told else { panic!("{told:?}") };
    let chi2 = chi2(&drift.last(), 0.3);
    assert!(chi2 < 27.9, "χ² {chi2}: {drift:?}");
}

/// Whenever the next motion comes, also right after the last one was told, when the level is hardly known: in any direction it is measured as it is.
#[test]
fn a_motion_right_after_an_alarm_is_measured() {
    for (degrees, wait_s) in [(0.4, 0), (0.4, 1), (0.4, 2), (4.0, 0), (4.0, 1), (4.0, 2)] {
        for (then, seed) in [Vector6::x(), Vector6::z(), -3.0 * Vector6::y()].into_iter().zip(0..) {
            let mut watched = Watched::new(0x5ea7 + 16 * wait_s + seed);
            watched.until(100.0, |_| 0.0);
            while watched.told.is_empty() {
                let next_s = watched.scene.t_s + 0.5;
                watched.until(next_s, |_| degrees);
                assert!(next_s < 120.0);
            }
            let then_s = watched.scene.t_s + wait_s as f64;
            watched.until(then_s, |_| degrees);
            let motion = pan(degrees) + then * f64::to_radians(degrees);
            while watched.scene.t_s < then_s + 60.0 {
                watched.monitor.push(&watched.scene.next(&motion));
            }
            let Watch::Drifted(now) = watched.monitor.watch(watched.scene.t_s) else { panic!("{motion}") };
            let error = now.old_from_new - motion;
            let chi2 = error.dot(&now.covariance.cholesky().expect("a covariance").solve(&error));
            assert!(chi2 < 27.9, "{degrees}°, after {wait_s} s {then:?}: χ² {chi2}");
        }
    }
}

/// Whenever it is put back, also right after the last motion was told: its level then holds readings of two places.
#[test]
fn a_camera_put_back_right_after_an_alarm_is_steady_soon() {
    for (degrees, wait_s) in
        [0.4, 4.0].into_iter().flat_map(|degrees| (0..6).map(move |wait_s| (degrees, wait_s)))
    {
        for seed in 0..4 {
            let mut watched = Watched::new(0x5ea7 + 16 * wait_s + seed);
            watched.until(100.0, |_| 0.0);
            watched.until(120.0, |_| degrees);
            assert_eq!(watched.told.len(), 1, "{:?}", watched.told);
            while watched.told.len() < 2 {
                let next_s = watched.scene.t_s + 0.5;
                watched.until(next_s, |_| 0.5 * degrees);
                assert!(next_s < 140.0, "{:?}", watched.told);
            }
            let back_s = watched.scene.t_s + wait_s as f64;
            watched.until(back_s, |_| 0.5 * degrees);
            watched.until(back_s + 60.0, |_| 0.0);
            let name = format!("{degrees}° and half of it for {wait_s} s: {:?}", watched.told);
            let Some((t_s, None)) = watched.told.last() else { panic!("{name}") };
            assert!(t_s - back_s <= 10.0 && watched.told.len() == 3, "{name}");
        }
    }
}
