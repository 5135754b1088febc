//! Nothing declared: the noise is measured, and alarms stay within the stated rate whatever the errors are.

mod common;

use common::conditions::{Condition, Scene, alarms};
use nalgebra::Vector6;
use resight_core::monitor::{MonitorConfig, Watch};

const ROWS: [(&str, Condition); 19] = [
    ("white", Condition::White),
    ("sigma 1.5 times too small", Condition::Understated(1.5)),
    ("sigma 3 times too small", Condition::Understated(3.0)),
    ("sigma 2 times too large", Condition::Understated(0.5)),
    ("doubled at night", Condition::NightDoubled),
    ("10 s, 30 %", Condition::Correlated { share: 0.3, time_s: 10.0 }),
    ("10 s, 70 %", Condition::Correlated { share: 0.7, time_s: 10.0 }),
    ("60 s, 30 %", Condition::Correlated { share: 0.3, time_s: 60.0 }),
    ("60 s, 70 %", Condition::Correlated { share: 0.7, time_s: 60.0 }),
    ("600 s, 30 %", Condition::Correlated { share: 0.3, time_s: 600.0 }),
    ("600 s, 70 %", Condition::Correlated { share: 0.7, time_s: 600.0 }),
    ("daily sine 0.02", Condition::Sine { amplitude_deg: 0.02, period_s: 86_400.0 }),
    ("0.1 px for 300 s", Condition::Biased { px: 0.1, for_s: 300.0, per_day: 24.0, corners: 4 }),
    ("half 1 px for 10 s", Condition::Biased { px: 1.0, for_s: 10.0, per_day: 24.0, corners: 2 }),
    ("t, 4", Condition::HeavyTails(4.0)),
    ("vibration", Condition::Sine { amplitude_deg: 0.05, period_s: 0.19 }),
    ("limited walk", Condition::LimitedWalk { deg_per_sqrt_h: 0.02, limit_deg: 0.05 }),
    ("correlated and daily", Condition::CorrelatedAndDaily),
    ("rate changes", Condition::ChangingRate),
];

fn days() -> f64 {
    std::env::var("RESIGHT_NOISE_DAYS").ok().and_then(|days| days.parse().ok()).unwrap_or(1.0)
}

#[test]
fn rates() {
    let period_s: f64 = std::env::var("P").ok().and_then(|p| p.parse().ok()).unwrap_or(1.0);
    let rate: f64 = std::env::var("RATE").ok().and_then(|p| p.parse().ok()).unwrap_or(24.0);
    let only = std::env::var("ONLY").unwrap_or_default();
    for (name, condition) in ROWS {
        if !name.contains(&only) {
            continue;
        }
        let n = days().ceil() as u64;
        let started = std::time::Instant::now();
        let total: usize =
            (0..n).map(|seed| alarms(condition, period_s, rate, days() / n as f64, 0x77 + seed)).sum();
        println!("{name:28} {:8.2} a day  ({:.1} s)", total as f64 / days(), started.elapsed().as_secs_f64());
    }
}

#[test]
fn delays() {
    let rate = 1.0 / 30.0;
    let config = MonitorConfig { false_alarms_per_day: rate, ..MonitorConfig::default() };
    let only = std::env::var("ONLY").unwrap_or_default();
    for (name, condition) in ROWS {
        if !name.contains(&only) {
            continue;
        }
        let q: f64 = std::env::var("Q").ok().and_then(|p| p.parse().ok()).unwrap_or(0.0);
        let dd: f64 = std::env::var("DEG").ok().and_then(|p| p.parse().ok()).unwrap_or(0.0);
        for quiet in [300.0, 3600.0, 20000.0] {
            if q > 0.0 && q != quiet {
                continue;
            }
            for deg in [0.01, 0.02, 0.05, 0.1] {
                if dd > 0.0 && dd != deg {
                    continue;
                }
                let mut sum = Vec::new();
                for seed in 0..10 {
                    let mut scene = Scene::new(condition, 1.0, 100 + seed);
                    let mut monitor = scene.learned(50, &config);
                    let mut false_alarm = false;
                    while scene.t_s < quiet {
                        if let Watch::Drifted(_) = monitor.push(&scene.next(&Vector6::zeros())) {
                            false_alarm = true;
                            break;
                        }
                    }
                    if false_alarm {
                        continue;
                    }
                    let moved = Vector6::ith(1, f64::to_radians(deg));
                    let began = scene.t_s;
                    loop {
                        if let Watch::Drifted(_) = monitor.push(&scene.next(&moved)) {
                            break;
                        }
                        if scene.t_s - began > 3600.0 {
                            break;
                        }
                    }
                    sum.push(scene.t_s - began);
                }
                sum.sort_by(f64::total_cmp);
                println!(
                    "{name:28} quiet {quiet}: {deg}: median {:?} max {:?} n {}",
                    sum.get(sum.len() / 2),
                    sum.last(),
                    sum.len()
                );
            }
        }
    }
}
