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
        let mut scene = scene(condition, seed);
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
    let mut words = 0;
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
        "{:.1} words a run, NEES {mean:.1} mean, {:.1} at most",
        words as f64 / runs as f64,
        nees.last().unwrap_or(&0.0)
    );
}

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
}
