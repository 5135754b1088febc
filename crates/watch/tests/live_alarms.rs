//! What a session says of corners that are off for a while and of a mount that vibrates: neither is a motion, and nothing is said too often.

use crate::live_support::{camera, tag, tag_pose, watched};
use nalgebra::Vector6;
use resight::core::correspondence::Detection;
use resight::core::{Pixel, Pose};
use resight::render::Pcg;
use resight_watch::live::{self, Event, LiveConfig, State};
use resight_watch::source::{Content, Frame, Next, Source};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

const SIGMA_PX: f64 = 0.2;

/// How far a corner is off at a time, pixels.
type Off = fn(f64, u8) -> Pixel;

/// What happens to a camera before a tag.
#[derive(Clone, Copy)]
struct Scene {
    rate_hz: f64,
    seconds: f64,
    /// Where the camera is in its old frame at a time.
    moved: fn(f64) -> Vector6<f64>,
    /// How far a corner is off at a time, pixels.
    off: Off,
}

struct Corners {
    scene: Scene,
    chance: Pcg,
    next: u64,
}

impl Source for Corners {
    fn next(&mut self, _: Duration) -> Next {
        let capture_s = self.next as f64 / self.scene.rate_hz;
        if self.scene.seconds <= capture_s {
            return Next::End;
        }
        let number = self.next;
        self.next += 1;
        let target = tag();
        let cam_from_tag = Pose::exp(&(self.scene.moved)(capture_s)).inverse() * tag_pose(120.0, -60.0, 35.0);
        let mut corner = |feature: resight::core::target::Feature| {
            let x = cam_from_tag * target.point(feature).expect("a corner").position;
            let noise = SIGMA_PX * Pixel::new(self.chance.normal(), self.chance.normal());
            let pixel =
                camera().project(&x).expect("in front") + noise + (self.scene.off)(capture_s, feature.corner);
            Detection { feature, pixel, sigma_px: SIGMA_PX, lens_sigma_px: 0.0, covariance_px2: None }
        };
        let seen = target.features().into_iter().map(&mut corner).collect();
        Next::Frame(Frame { number, capture_s, name: String::new(), content: Content::Detections(seen) })
    }

    fn is_live(&self) -> bool {
        false
    }
}

fn still(_: f64) -> Vector6<f64> {
    Vector6::zeros()
}

fn exact(_: f64, _: u8) -> Pixel {
    Pixel::zeros()
}

/// States told, with their times.
fn reported(scene: Scene, seed: u64) -> Vec<(f64, State)> {
    let source = Corners { scene, chance: Pcg::new(seed), next: 0 };
    let mut states = Vec::new();
    let stop = Arc::new(AtomicBool::new(false));
    live::run(vec![watched(&tag(), source)], &LiveConfig::default(), &stop, |event| {
        if let Event::StateChanged { t_s, state, .. } = event {
            states.push((*t_s, state.clone()));
        }
        true
    })
    .expect("a session");
    states
}

fn drifts(states: &[(f64, State)]) -> usize {
    states.iter().filter(|(_, state)| matches!(state, State::Drifted(_))).count()
}

fn half_for_ten_seconds(t_s: f64, corner: u8) -> Pixel {
    let is_off = (200.0..210.0).contains(&t_s) && corner < 2;
    if is_off { Pixel::new(0.8, 0.6) } else { Pixel::zeros() }
}

fn across_for_ten_seconds(t_s: f64, corner: u8) -> Pixel {
    let is_off = (200.0..210.0).contains(&t_s) && corner % 2 == 1;
    if is_off { Pixel::new(-0.2, 1.0) } else { Pixel::zeros() }
}

fn one_for_good(t_s: f64, corner: u8) -> Pixel {
    if 200.0 <= t_s && corner == 2 { Pixel::new(1.5, 0.0) } else { Pixel::zeros() }
}

/// Two corners of four off by a pixel for ten seconds, one for good: no alarm; a real step of half a degree later is found, also while one is
/// off: most views of a target of which one corner is always off contradict themselves, wherever the camera is, so that it takes longer.
/// RESIGHT_ALARM_SEEDS for a larger count.
#[test]
fn corners_that_are_off_alone_raise_no_alarm() {
    let seeds = std::env::var("RESIGHT_ALARM_SEEDS").ok().and_then(|n| n.parse().ok()).unwrap_or(3);
    let scene = Scene { rate_hz: 1.0, seconds: 400.0, moved: still, off: exact };
    let mut delays = [const { Vec::new() }; 3];
    let faults: [(Off, f64); 3] =
        [(half_for_ten_seconds, 10.0), (across_for_ten_seconds, 10.0), (one_for_good, 99.0)];
    for (i, (off, within_s)) in faults.into_iter().enumerate() {
        for seed in 0..seeds {
            let seed = 0xc0_0000 + 0x1000 * i as u64 + seed;
            let states = reported(Scene { off, ..scene }, seed);
            assert_eq!(drifts(&states), 0, "{i}, {seed}: {states:?}");
            let moved =
                |t_s: f64| if t_s < 300.0 { still(t_s) } else { Vector6::ith(1, 0.5_f64.to_radians()) };
            let states = reported(Scene { off, moved, ..scene }, seed);
            let is_drifted = |(_, state): &&(f64, State)| matches!(state, State::Drifted(_));
            let alarm_s = states.iter().find(is_drifted).map(|(t_s, _)| *t_s);
            assert!(
                alarm_s.is_some_and(|t_s| (300.0..300.0 + within_s).contains(&t_s)),
                "{i}, {seed}: {states:?}"
            );
            delays[i].push(alarm_s.map_or(f64::INFINITY, |t_s| t_s - 300.0));
        }
    }
    println!("seconds from step to alarm: {delays:?}");
}

fn vibrates(t_s: f64) -> Vector6<f64> {
    let phase = std::f64::consts::TAU * 5.0 * t_s;
    Vector6::new(phase.sin(), 0.6 * (phase + 1.0).sin(), 0.0, 0.0, 0.0, 0.0) * 0.05_f64.to_radians()
}

/// 5 Hz and 0.05°, thirty images a second, from the start on: no alarm in five minutes, and no flood of doubts. (A mount that begins to
/// vibrate later still raises alarms, which are taken back: docs/watch.md.)
#[test]
fn a_mount_that_vibrates_raises_no_alarm() {
    let scene = Scene { rate_hz: 30.0, seconds: 300.0, moved: vibrates, off: exact };
    let states = reported(scene, 0xc2_0000);
    assert_eq!(drifts(&states), 0, "{states:?}");
    assert!(states.len() <= 2 * (10 + 5) + 1, "{} states in five minutes", states.len());
}
