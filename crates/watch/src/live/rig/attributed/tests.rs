//! Two cameras that look at a door, and the reports about them; each camera's own monitor provides its state, as in a session.

use super::*;
use crate::live::pace::Pace;
use resight::render::Pcg;
use resight_core::temporal::monitor::learn::{LearnConfig, learn};
use resight_core::temporal::monitor::{DriftNoise, Reading};
use resight_core::{Matrix6, Vector6};
use std::sync::Arc;

const SIGMA: f64 = 1e-3;
const PERIOD_S: f64 = 0.1;

fn cam_from_door(camera: usize) -> Pose {
    let side = camera as f64 - 0.5;
    Pose::exp(&Vector6::new(0.1, 0.5 * side, 0.0, 0.4 * side, 0.1, 2.0))
}

fn reference(camera: usize) -> Reference {
    let spread = |sigma: f64| Matrix6::identity() * sigma * sigma;
    let noise = DriftNoise {
        reference: spread(0.1 * SIGMA),
        reading: spread(SIGMA),
        bias: spread(0.1 * SIGMA),
        bias_time_s: 60.0,
        diurnal: Matrix6::zeros(),
    };
    Reference { a_from_b: cam_from_door(camera), noise }
}

struct Hall {
    pairs: Pairs,
    own: Vec<Monitor>,
    chance: Pcg,
    frame: u32,
    reported: Vec<Event>,
    asked: u32,
}

impl Hall {
    fn new(own: Option<Vec<Monitor>>) -> Self {
        let config = LiveConfig::default();
        let nodes = Nodes {
            cameras: vec!["north".to_string(), "east".to_string()],
            lenses: Vec::new(),
            targets: vec!["door".to_string()],
            is_live: vec![false; 2],
            settings: Default::default(),
            references: (0..2).map(|camera| Some(reference(camera))).collect(),
            monitors: (0..2).map(|camera| Some(own.as_ref()?[camera].clone())).collect(),
            pace: Arc::new(Pace::new(2)),
        };
        let fresh = |camera| {
            let mut monitor = Monitor::new(&reference(camera), &config.monitor, 0.0).expect("a monitor");
            monitor.measure_noise(&[]);
            monitor
        };
        let frame = own.as_ref().map_or(0.0, |own| own[1].last_s() / PERIOD_S).round() as u32;
        let own = own.unwrap_or_else(|| (0..2).map(fresh).collect());
        let pairs = Pairs::new(nodes, &config);
        Hall { pairs, own, chance: Pcg::new(0x51), frame, reported: Vec::new(), asked: 0 }
    }

    /// Reports the state of each camera, as at the start of a session.
    fn stand(&mut self, camera: usize, t_s: f64) {
        let state = self.own[camera].watch(t_s).into();
        self.reported.extend(self.pairs.take(Event::StateChanged { camera, target: 0, t_s, state }));
    }

    /// Processes frames of both cameras; `moved` is the pose of each node (0, 1 the cameras, 2 the door) in its old frame.
    fn watch(&mut self, frames: u32, moved: impl Fn(usize) -> Vector6) {
        for _ in 0..frames {
            self.frame += 1;
            for camera in 0..2 {
                self.look(camera, &moved);
            }
        }
    }

    fn look(&mut self, camera: usize, moved: &impl Fn(usize) -> Vector6) {
        let t_s = PERIOD_S * f64::from(self.frame) + 0.01 * camera as f64;
        let noise = Vector6::from_fn(|_, _| SIGMA * self.chance.normal());
        let now = Pose::exp(&moved(camera)).inverse() * cam_from_door(camera) * Pose::exp(&moved(2));
        let reading = Reading {
            t_s,
            a_from_b: Pose::exp(&noise) * now,
            covariance: Matrix6::identity() * SIGMA * SIGMA,
            is_consistent: true,
        };
        let before: State = self.own[camera].watch(t_s).into();
        self.own[camera].push(&reading);
        let observation =
            Box::new(Observation { capture_s: t_s, reading: Some(reading), ..Observation::default() });
        let asked = self.pairs.asked_s.clone();
        self.reported.extend(self.pairs.take(Event::Observed { camera, target: 0, observation }));
        self.asked += u32::from(asked != self.pairs.asked_s);
        let now: State = self.own[camera].watch(t_s).into();
        if std::mem::discriminant(&before) != std::mem::discriminant(&now) {
            self.stand(camera, t_s);
        }
    }

    /// Returns the cameras that were ever reported as drifted.
    fn alarms(&self) -> Vec<usize> {
        let drifted = |event: &Event| match event {
            Event::StateChanged { camera, state: State::Drifted(_), .. } => Some(*camera),
            _ => None,
        };
        self.reported.iter().filter_map(drifted).collect()
    }

    fn now(&self, camera: usize) -> &State {
        self.pairs.pairs[camera].reported.as_ref().expect("told")
    }

    fn moved(&self) -> Vec<Vec<String>> {
        let names = |event: &Event| match event {
            Event::Attributed { moved, .. } => Some(moved.iter().map(|(name, _)| name.clone()).collect()),
            _ => None,
        };
        self.reported.iter().filter_map(names).collect()
    }
}

fn knock() -> Vector6 {
    Vector6::new(0.02, 0.03, 0.0, 0.02, 0.0, 0.01)
}

fn still(_: usize) -> Vector6 {
    Vector6::zeros()
}

fn carried(node: usize) -> Vector6 {
    if node == 2 { knock() } else { Vector6::zeros() }
}

/// No camera is reported even at first, while it is not known which node moved.
#[test]
fn a_door_that_is_carried_away_alarms_no_camera() {
    let mut hall = Hall::new(None);
    hall.watch(50, still);
    hall.watch(50, carried);
    assert_eq!(hall.moved().last(), Some(&vec!["door".to_string()]));
    assert_eq!((hall.alarms(), hall.now(0), hall.now(1)), (vec![], &State::Steady, &State::Steady));
}

#[test]
fn a_knocked_camera_alarms_alone() {
    for knocked in 0..2 {
        let mut hall = Hall::new(None);
        hall.watch(50, still);
        hall.watch(50, |node| if node == knocked { knock() } else { Vector6::zeros() });
        assert!(hall.alarms().contains(&knocked) && !hall.alarms().contains(&(1 - knocked)));
        assert!(matches!(hall.now(knocked), State::Drifted(_)), "{:?}", hall.now(knocked));
    }
}

#[test]
fn who_moved_is_known_after_a_restart() {
    let mut hall = Hall::new(None);
    hall.watch(50, still);
    hall.watch(50, carried);
    let mut again = Hall::new(Some(hall.own.clone()));
    (0..2).for_each(|camera| again.stand(camera, 10.1));
    assert_eq!((again.alarms(), again.moved()), (vec![], vec![vec!["door".to_string()]]));
    again.watch(20, carried);
    assert_eq!((again.alarms(), again.moved().len()), (vec![], 1));
}

/// The door is removed, and landmarks show that a camera rotated: that is no motion of the door.
#[test]
fn landmarks_are_believed_while_the_door_is_away() {
    let mut hall = Hall::new(None);
    hall.watch(50, still);
    hall.watch(50, carried);
    let drift = Drift { began_s: 11.5, ..hall.own[0].drift().expect("a drift") };
    let state = State::Drifted(Box::new(drift));
    hall.reported.extend(hall.pairs.take(Event::StateChanged { camera: 0, target: 0, t_s: 12.0, state }));
    assert_eq!((hall.alarms(), hall.now(1)), (vec![0], &State::Steady));
}

/// A decision period has two frames of each of the two cameras; after the alarm there is at most one attribution in each, also with one camera.
#[test]
fn what_moved_is_not_asked_for_every_frame() {
    let mut hall = Hall::new(None);
    hall.watch(50, still);
    assert_eq!(hall.asked, 0);
    hall.watch(20, carried);
    hall.asked = 0;
    hall.watch(100, carried);
    assert!((30..=51).contains(&hall.asked), "{}", hall.asked);
    hall.asked = 0;
    for _ in 0..100 {
        hall.frame += 1;
        hall.look(1, &carried);
    }
    assert!((30..=51).contains(&hall.asked), "{}", hall.asked);
}

/// One camera before two targets, one of which moved by 5 mm and 0.5°: four hours with a reference from fifty readings. The report is right, and
/// there is one report, not thousands; its reading noise was estimated from those fifty.
#[test]
fn a_moved_target_is_reported_once() {
    for seed in 0..4 {
        let mut room = Room::new(seed);
        room.watch(300, &Vector6::zeros());
        room.watch(14_400, &Vector6::new(0.0, 0.5_f64.to_radians(), 0.0, 0.005, 0.0, 0.0));
        let answers = room.answers();
        assert!((1..=4).contains(&answers.len()), "{seed}: {} answers", answers.len());
        assert_eq!(answers.last(), Some(&(vec!["door".to_string()], 0)), "{seed}: {answers:?}");
    }
}

/// Two equally good explanations alternate: there are no more corrections than the logarithm of the time.
#[test]
fn a_correction_must_last_twice_as_long_as_the_one_before() {
    let answer = |node| Answer { moved: vec![node], alternatives: Vec::new(), is_explained: true };
    for turns in [1, 3, 10, 100, 1000] {
        let (mut reported, mut corrections) = (Reported::default(), 0);
        for i in 0..72_000_u32 {
            let corrected =
                reported.corrected(answer((i / turns % 2) as usize), 0.2 * f64::from(i), false, 0.2);
            corrections += u32::from(corrected);
        }
        assert!((1..=17).contains(&corrections), "{turns}: {corrections} corrections in four hours");
    }
}

/// A camera before a door and a wall, with one reading of each per second.
struct Room {
    pairs: Pairs,
    own: Vec<Monitor>,
    chance: Pcg,
    second: u32,
    reported: Vec<Event>,
}

/// Returns the covariance for a tag of 100 mm at a distance of about a metre: rotations and lateral translations are hardly distinguished, so
/// that both are uncertain.
fn of_a_tag() -> Matrix6 {
    let mut lower = Matrix6::from_diagonal(&(Vector6::new(6e-3, 6e-3, 2e-3, 3e-4, 3e-4, 8e-4)));
    (lower[(3, 1)], lower[(4, 0)]) = (7e-3, -7e-3);
    lower
}

fn cam_from(target: usize) -> Pose {
    let side = target as f64 - 0.5;
    Pose::exp(&Vector6::new(-0.3 * side, 0.8 * side, 0.1, 0.3 * side, 0.1, 1.3))
}

impl Room {
    fn new(seed: u64) -> Self {
        let mut room = Room::unwatched(seed);
        let known = LearnConfig { bias: Matrix6::zeros(), bias_time_s: 60.0, diurnal: Matrix6::zeros() };
        for target in 0..2 {
            let seen: Vec<Reading> =
                (0..50).map(|i| room.reading(target, f64::from(i), &Vector6::zeros())).collect();
            let reference = learn(&seen, &known).expect("a reference");
            room.pairs.pairs[target].reference = Some(reference);
            room.own.push(Monitor::new(&reference, &LiveConfig::default().monitor, 49.0).expect("a monitor"));
        }
        room.second = 49;
        room
    }

    fn unwatched(seed: u64) -> Self {
        let nodes = Nodes {
            cameras: vec!["gate".to_string()],
            lenses: Vec::new(),
            targets: vec!["door".to_string(), "wall".to_string()],
            is_live: vec![false],
            settings: Default::default(),
            references: vec![None; 2],
            monitors: vec![None; 2],
            pace: Arc::new(Pace::new(1)),
        };
        let pairs = Pairs::new(nodes, &LiveConfig::default());
        Room { pairs, own: Vec::new(), chance: Pcg::new(0xd00f + seed), second: 0, reported: Vec::new() }
    }

    fn reading(&mut self, target: usize, t_s: f64, moved: &Vector6) -> Reading {
        let noise = of_a_tag() * Vector6::from_fn(|_, _| self.chance.normal());
        let a_from_b = Pose::exp(&noise) * cam_from(target) * Pose::exp(moved);
        Reading { t_s, a_from_b, covariance: of_a_tag() * of_a_tag().transpose(), is_consistent: true }
    }

    fn watch(&mut self, seconds: u32, door: &Vector6) {
        for _ in 0..seconds {
            self.second += 1;
            let t_s = f64::from(self.second);
            for target in 0..2 {
                let still = Vector6::zeros();
                let reading = self.reading(target, t_s, if target == 0 { door } else { &still });
                let before: State = self.own[target].watch(t_s).into();
                self.own[target].push(&reading);
                let observation = Box::new(Observation {
                    capture_s: t_s,
                    reading: Some(reading),
                    ..Observation::default()
                });
                self.reported.extend(self.pairs.take(Event::Observed { camera: 0, target, observation }));
                let state: State = self.own[target].watch(t_s).into();
                if std::mem::discriminant(&before) != std::mem::discriminant(&state) {
                    self.reported.extend(self.pairs.take(Event::StateChanged {
                        camera: 0,
                        target,
                        t_s,
                        state,
                    }));
                }
            }
        }
    }

    /// Returns what moved, and the number of other sets that may have.
    fn answers(&self) -> Vec<(Vec<String>, usize)> {
        let answer = |event: &Event| match event {
            Event::Attributed { moved, alternatives, .. } => {
                Some((moved.iter().map(|(name, _)| name.clone()).collect(), alternatives.len()))
            }
            _ => None,
        };
        self.reported.iter().filter_map(answer).collect()
    }
}
