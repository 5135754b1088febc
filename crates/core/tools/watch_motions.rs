//! Motions after the first, restarts, and what is only noise: what a watched camera is said to do, beside what it does. The rows of
//! docs/math/monitor.md section 11.
//!
//! `cargo run --release -p resight-core --example watch_motions -- PART [RUNS]`

#[path = "../tests/common/mod.rs"]
mod common;

use common::conditions::{Condition, Scene, View};
use nalgebra::Vector6;
use resight_core::temporal::monitor::{Drift, Monitor, MonitorConfig, Watch};

/// A tag of 0.16 m at 1.2 m, 0.2 px, a reading a second.
fn scene(condition: Condition, seed: u64) -> Scene {
    Scene::of(View::near(), condition, 1.0, seed)
}

fn pan(degrees: f64) -> Vector6<f64> {
    Vector6::y() * degrees.to_radians()
}

/// What is told, as a session tells it: another motion, or (none) that the camera is where it was.
type Told = Option<Drift>;

struct Watched {
    monitor: Monitor,
    scene: Scene,
    last: Option<f64>,
    told: Vec<(f64, Told)>,
}

impl Watched {
    fn new(condition: Condition, seed: u64) -> Self {
        Watched::of(scene(condition, seed))
    }

    fn of(mut scene: Scene) -> Self {
        let monitor = scene.learned(50, &MonitorConfig::default());
        Watched { monitor, scene, last: None, told: Vec::new() }
    }

    fn until(&mut self, until_s: f64, at: &Vector6<f64>) {
        while self.scene.t_s < until_s {
            let reading = self.scene.next(at);
            match self.monitor.push(&reading) {
                Watch::Drifted(drift) if self.last != Some(drift.began_s) => {
                    self.last = Some(drift.began_s);
                    self.told.push((reading.t_s, Some(drift)));
                }
                Watch::Steady if self.last.is_some() => {
                    self.last = None;
                    self.told.push((reading.t_s, None));
                }
                _ => {}
            }
        }
    }

    /// Seconds after `since_s` of the first word, and what it was.
    fn word(&self, since_s: f64, before_s: f64) -> Option<(f64, Told)> {
        let (t_s, told) = self.told.iter().find(|(t_s, _)| since_s < *t_s && *t_s <= before_s)?;
        Some((t_s - since_s, *told))
    }
}

/// Angles that follow each other, a motion every `apart_s`.
fn motions(name: &str, degrees: &[f64], apart_s: f64, runs: u64) {
    let mut delays: Vec<Vec<f64>> = vec![Vec::new(); degrees.len()];
    let mut missed = vec![0; degrees.len()];
    let (mut words, mut ended) = (0, [0; 3]);
    let (mut nees, mut steady) = (Vec::new(), vec![0; degrees.len()]);
    for seed in 0..runs {
        let mut watched = Watched::new(Condition::White, 0x2ec0 + seed);
        let mut at_s = 1000.0;
        watched.until(at_s, &pan(0.0));
        let mut last = 0.0;
        for (i, now) in degrees.iter().enumerate() {
            watched.until(at_s + apart_s, &pan(*now));
            match watched.word(at_s, at_s + apart_s) {
                Some((delay_s, told)) => {
                    delays[i].push(delay_s);
                    match told {
                        Some(drift) => {
                            let own = drift.last();
                            let error = own.old_from_new - pan(now - last);
                            let factor = own.covariance.cholesky().expect("a covariance");
                            nees.push(error.dot(&factor.solve(&error)));
                        }
                        None => steady[i] += 1,
                    }
                }
                None => missed[i] += 1,
            }
            (at_s, last) = (at_s + apart_s, *now);
        }
        match watched.monitor.watch(watched.scene.t_s) {
            Watch::Steady => ended[0] += 1,
            Watch::Drifted(_) => ended[2] += 1,
            _ => ended[1] += 1,
        }
        words += watched.told.len();
        if runs <= 2 {
            for (t_s, told) in &watched.told {
                println!("   {t_s} {told:?}");
            }
        }
    }
    nees.sort_by(f64::total_cmp);
    print!("{name}: ");
    for (i, delays) in delays.iter_mut().enumerate() {
        delays.sort_by(f64::total_cmp);
        let half = delays.get(delays.len() / 2).copied().unwrap_or(f64::NAN);
        let most = delays.last().copied().unwrap_or(f64::NAN);
        print!("to {}°: {half} s (most {most}), {} missed, {} steady; ", degrees[i], missed[i], steady[i]);
    }
    let mean = nees.iter().sum::<f64>() / nees.len() as f64;
    println!(
        "steady, in doubt, drifted at the end {ended:?}; {:.1} words a run, NEES {mean:.1} mean, {:.1} at most",
        words as f64 / runs as f64,
        nees.last().unwrap_or(&0.0)
    );
}

/// How sessions ended, how long after their start that was clear, and how what they say of where the camera is agrees with its covariance.
#[derive(Default)]
struct Tally {
    steady: u32,
    checking: u32,
    drifted: u32,
    clear_s: Vec<f64>,
    chi2: Vec<f64>,
}

impl Tally {
    /// The next readings of a session, of a camera that is rotated so far.
    fn watch(&mut self, monitor: &mut Monitor, scene: &mut Scene, readings: u32, degrees: f64) {
        let (began_s, mut clear_s, mut last) = (scene.t_s, 0.0, Watch::Checking);
        for _ in 0..readings {
            let now = monitor.push(&scene.next(&pan(degrees)));
            if std::mem::discriminant(&now) != std::mem::discriminant(&last) {
                clear_s = scene.t_s - began_s;
            }
            last = now;
        }
        let said = match &last {
            Watch::Steady => {
                self.steady += 1;
                None
            }
            Watch::Drifted(drift) => {
                self.drifted += 1;
                Some((drift.old_from_new, drift.covariance))
            }
            _ => {
                self.checking += 1;
                None
            }
        };
        let now = monitor.deviation().expect("readings");
        let (motion, covariance) = said.unwrap_or((now.old_from_new, now.covariance));
        let error = motion - pan(degrees);
        self.chi2.push(error.dot(&covariance.cholesky().expect("a covariance").solve(&error)));
        self.clear_s.push(clear_s);
    }

    fn print(&mut self, name: &str) {
        [&mut self.clear_s, &mut self.chi2].into_iter().for_each(|all| all.sort_by(f64::total_cmp));
        let (half, last) = (self.clear_s.len() / 2, self.clear_s.len() - 1);
        let mean = self.chi2.iter().sum::<f64>() / self.chi2.len() as f64;
        let Tally { steady, checking, drifted, clear_s, chi2 } = self;
        println!(
            "{name}: steady {steady}, checking {checking}, drifted {drifted}; clear after {} s (most {}); NEES {mean:.1} mean, {:.1} at most",
            clear_s[half], clear_s[last], chi2[last]
        );
    }
}

/// Watched, off, and watched again where the camera then is: restored from its state.
fn restarts(name: &str, condition: Condition, off_s: f64, degrees: f64, runs: u64) {
    let mut tally = Tally::default();
    for seed in 0..runs {
        let mut watched = Watched::new(condition, 0x9e57 + seed);
        watched.until(600.0, &pan(0.0));
        let mut monitor = Monitor::restore(&watched.monitor.snapshot()).expect("a state");
        watched.scene.t_s += off_s;
        tally.watch(&mut monitor, &mut watched.scene, 60, degrees);
    }
    tally.print(&format!("{name}: off {:.2} h, moved {degrees}°", off_s / 3600.0));
}

/// Compared with a saved reference, its readings from one night to the next.
fn nightly(name: &str, condition: Condition, degrees: f64, readings: u32, runs: u64) {
    let mut tally = Tally::default();
    for seed in 0..runs {
        let mut scene = scene(condition, 0x17e + seed);
        let reference = *scene.learned(50, &MonitorConfig::default()).reference();
        scene.t_s += 80_000.0;
        let mut monitor = Monitor::new(&reference, &MonitorConfig::default(), scene.t_s).expect("a monitor");
        monitor.measure_noise(&[]);
        tally.watch(&mut monitor, &mut scene, readings, degrees);
    }
    tally.print(&format!("{name}: {readings} readings of another night, moved {degrees}°"));
}

/// Watched on where it stays: the share of readings at which it is neither steady nor moved, and alarms.
fn stays(name: &str, condition: Condition, readings: u32, runs: u64) {
    let (mut in_doubt, mut alarms) = (0, 0);
    for seed in 0..runs {
        let mut watched = Watched::new(condition, 0x57a + seed);
        for _ in 0..readings {
            in_doubt +=
                u32::from(matches!(watched.monitor.push(&watched.scene.next(&pan(0.0))), Watch::Away(_)));
        }
        alarms += u32::from(watched.monitor.drift().is_some());
    }
    let share = f64::from(in_doubt) / (f64::from(readings) * runs as f64);
    println!(
        "{name}: in doubt {:.2} % of {readings} readings; {alarms} of {runs} drifted at the end",
        100.0 * share
    );
}

/// Alarms of each session of a camera that stays, and the share of readings at which it is reported as moved or undecided.
fn disturbed(name: &str, condition: Condition, period_s: f64, days: f64, runs: u64) {
    let (mut alarms, mut drifted, mut checking, mut readings) = (Vec::new(), 0, 0, 0);
    for seed in 0..runs {
        let mut scene = Scene::of(View::near(), condition, period_s, 0xd157 + seed);
        let mut monitor = scene.learned(50, &MonitorConfig::default());
        let (mut count, mut last) = (0, None);
        while scene.t_s < days * 86_400.0 {
            let variance = monitor.measured_noise().map_or(1.0, |noise| noise.sigma_ratio.powi(2));
            scene.measured_variance = variance.max(1.0);
            let now = monitor.push(&scene.next(&pan(0.0)));
            let began_s = if let Watch::Drifted(drift) = now { Some(drift.began_s) } else { None };
            let is_new = began_s.is_some() && began_s != last;
            (count, last) = (count + u32::from(is_new), began_s);
            drifted += u32::from(began_s.is_some());
            checking += u32::from(began_s.is_none() && now != Watch::Steady);
            readings += 1;
        }
        alarms.push(count);
    }
    let share = |of: u32| 100.0 * f64::from(of) / f64::from(readings);
    println!(
        "{name}: {alarms:?} alarms; moved {:.1} %, in doubt {:.1} % of {days} days",
        share(drifted),
        share(checking)
    );
}

const DISTURBANCES: [(&str, Condition, f64, f64); 9] = [
    ("flicker, 0.15 px", Condition::Flicker(0.15), 1.0, 2.0),
    ("flicker, 0.3 px", Condition::Flicker(0.3), 1.0, 2.0),
    ("insect, 0.6 px", Condition::Insect(0.6), 1.0, 2.0),
    ("insect, 1.5 px", Condition::Insect(1.5), 1.0, 2.0),
    ("rain, 0.15 px", Condition::Rain(0.15), 1.0, 2.0),
    ("correlated at night", Condition::CorrelatedAtNight { share: 0.7, time_s: 60.0 }, 1.0, 2.0),
    ("infrared, 0.3 px, a reading every 10 s", Condition::Infrared(0.3), 10.0, 4.0),
    ("key frames every 10 s, 5 Hz", Condition::KeyFrames { px: 0.15, every_s: 10.0 }, 0.2, 0.05),
    ("key frames every 4 s, 25 Hz", Condition::KeyFrames { px: 0.15, every_s: 4.0 }, 0.04, 0.02),
];

/// Normalised squared errors of what is reported of a motion.
fn nees(drift: &Drift, degrees: f64) -> f64 {
    let error = drift.old_from_new - pan(degrees);
    error.dot(&drift.covariance.cholesky().expect("a covariance").solve(&error))
}

/// Their mean and the largest.
fn mean_and_most(nees: &[f64]) -> String {
    let mean = nees.iter().sum::<f64>() / nees.len() as f64;
    format!("{mean:.1} (most {:.1})", nees.iter().copied().fold(f64::NAN, f64::max))
}

/// A camera that is panned at `at_s` amid a disturbance: how soon a motion of that size is reported, the NEES of its size then and at the end, and
/// what comes after it.
fn amid(name: &str, (condition, period_s): (Condition, f64), at_s: f64, degrees: f64, runs: u64) {
    let (mut delays, mut missed, mut later, mut held) = (Vec::new(), 0, 0, 0);
    let (mut at_alarm, mut at_end) = (Vec::new(), Vec::new());
    for seed in 0..runs {
        let scene = Scene::of(View::near(), condition, period_s, 0xa31d + seed);
        let (mut watched, last_s) = (Watched::of(scene), at_s + (1200.0 * period_s).min(1200.0));
        watched.until(at_s, &pan(0.0));
        held += u32::from(watched.monitor.recurrence().is_some());
        watched.until(last_s, &pan(degrees));
        let is_it = |told: &(f64, Told)| {
            let drift = told.1.filter(|drift| 0.5 * degrees < drift.old_from_new[1].to_degrees())?;
            (at_s < told.0).then_some((told.0, drift))
        };
        let Some((t_s, drift)) = watched.told.iter().find_map(is_it) else {
            missed += 1;
            continue;
        };
        delays.push(t_s - at_s);
        later += watched.told.iter().filter(|told| t_s < told.0).count();
        at_alarm.push(nees(&drift, degrees));
        at_end.extend(watched.monitor.drift().map(|drift| nees(&drift, degrees)));
    }
    delays.sort_by(f64::total_cmp);
    println!(
        "{name}, {degrees}°: {:.1} s (most {:.1}), {missed} missed of {runs}, {later} words later, NEES at the alarm {}, at the end {}; held before in {held}",
        delays.get(delays.len() / 2).unwrap_or(&f64::NAN),
        delays.last().unwrap_or(&f64::NAN),
        mean_and_most(&at_alarm),
        mean_and_most(&at_end),
    );
}

/// Seconds from a step, after 3000 s without one, to its alarm: median and most; how many are missed in 1200 s, and raised before the step.
fn steps(name: &str, condition: Condition, degrees: f64, runs: u64) {
    let (mut delays, mut missed, mut early) = (Vec::new(), 0, 0);
    for seed in 0..runs {
        let mut watched = Watched::new(condition, 0x57e9 + seed);
        watched.until(3000.0, &pan(0.0));
        early += u32::from(!watched.told.is_empty());
        watched.until(4200.0, &pan(degrees));
        match watched.word(3000.0, 4200.0) {
            Some((delay_s, _)) => delays.push(delay_s),
            None => missed += 1,
        }
    }
    delays.sort_by(f64::total_cmp);
    let half = delays.get(delays.len() / 2).copied().unwrap_or(f64::NAN);
    let most = delays.last().copied().unwrap_or(f64::NAN);
    println!("{name}, {degrees}°: {half} s (most {most}), {missed} missed, {early} early of {runs}");
}

/// Noise that nobody declared.
const NOISES: [(&str, Condition); 7] = [
    ("white", Condition::White),
    ("sigma 3 times too small", Condition::Understated(3.0)),
    ("30 % over 60 s", Condition::Correlated { share: 0.3, time_s: 60.0 }),
    ("70 % over 600 s", Condition::Correlated { share: 0.7, time_s: 600.0 }),
    ("sine of a day, 0.02°", Condition::Sine { amplitude_deg: 0.02, period_s: 86_400.0 }),
    ("Student's t of 4", Condition::HeavyTails(4.0)),
    ("random walk within 0.05°", Condition::LimitedWalk { deg_per_sqrt_h: 0.02, limit_deg: 0.05 }),
];

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let part = arguments.get(1).map_or("motions", String::as_str);
    let runs = arguments.get(2).and_then(|runs| runs.parse().ok()).unwrap_or(12);
    if part == "motions" {
        motions("0.02 then 1.02", &[0.02, 1.02, 0.0], 1000.0, runs);
        motions("0.05 then 1.05", &[0.05, 1.05, 0.05], 1000.0, runs);
        motions("1 then 1.1", &[1.0, 1.1, 1.0, 0.0], 1000.0, runs);
        motions("0.3 then 0.6", &[0.3, 0.6, 0.3, 0.0], 1000.0, runs);
        motions("0.05 then 0.1", &[0.05, 0.1, 0.05, 0.0], 1000.0, runs);
        motions("0.02 then 0.04", &[0.02, 0.04, 0.02, 0.0], 1000.0, runs);
        motions("1 then 1.02", &[1.0, 1.02, 1.04], 1000.0, runs);
        motions("0.3 then 0.6, a minute", &[0.3, 0.6, 0.3, 0.0], 60.0, runs);
        motions("0.3 then 0.6, ten seconds", &[0.3, 0.6, 0.3, 0.0], 10.0, runs);
    }
    if part == "restarts" {
        for off_s in [600.0, 28_800.0, 259_200.0] {
            for degrees in [0.0, 0.02, 0.05, 0.1, 0.3, 1.0, 3.0] {
                restarts("white", Condition::White, off_s, degrees, runs);
            }
        }
    }
    if part == "nightly" {
        for readings in [10, 30, 100] {
            for degrees in [0.0, 0.02, 0.05, 0.1, 0.3, 0.5, 1.0, 3.0] {
                nightly("white", Condition::White, degrees, readings, runs);
            }
        }
    }
    if part == "steps" {
        for (name, condition) in [
            ("plain", Condition::White),
            ("70 % over 10 s", Condition::Correlated { share: 0.7, time_s: 10.0 }),
            ("70 % over 600 s", Condition::Correlated { share: 0.7, time_s: 600.0 }),
            ("a tenth of the stated sigma", Condition::Understated(0.1)),
        ] {
            [0.02, 0.05, 0.3, 1.0].into_iter().for_each(|degrees| steps(name, condition, degrees, runs));
        }
    }
    if part == "disturbances" {
        let only = arguments.get(3).map_or("", String::as_str);
        for (name, condition, period_s, days) in DISTURBANCES.iter().filter(|of| of.0.contains(only)) {
            disturbed(name, *condition, *period_s, *days, runs);
        }
    }
    if part == "amid" {
        let only = arguments.get(3).map_or("", String::as_str);
        for (name, condition, period_s, days) in DISTURBANCES.iter().filter(|of| of.0.contains(only)) {
            // Amid the second night, a shower and, of a video, its second half.
            let at_s = if *days < 1.0 { 0.5 * days * 86_400.0 } else { 114_200.0 };
            for degrees in [0.1, 0.3, 1.0] {
                amid(name, (*condition, *period_s), at_s, degrees, runs);
            }
        }
    }
    if part == "noise" {
        for (name, condition) in NOISES {
            restarts(name, condition, 28_800.0, 0.0, runs);
            nightly(name, condition, 0.0, 100, runs);
            stays(name, condition, 20_000, runs.min(4));
        }
    }
}
