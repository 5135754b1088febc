//! Readings that contradict their noise: `inconsistent` is a statement with a rate, and single faults do not raise it.
//!
//! A camera that stays, one reading a second; which readings contradict is drawn. What it leaves out: why they do.

use crate::common::Rng;
use crate::common::conditions::{Condition, Scene, View};
use nalgebra::Vector6;
use resight_core::temporal::monitor::{Monitor, MonitorConfig, Reading, Watch};

struct Watched {
    monitor: Monitor,
    scene: Scene,
}

impl Watched {
    fn new(seed: u64) -> Self {
        let mut scene = Scene::of(View::near(), Condition::White, 1.0, seed);
        let monitor = scene.learned(50, &MonitorConfig::default());
        Watched { monitor, scene }
    }

    fn push(&mut self, contradicts: bool) -> Watch {
        let reading = self.scene.next(&Vector6::zeros());
        self.monitor.push(&Reading { is_consistent: !contradicts, ..reading })
    }

    /// How many of the readings leave the monitor inconsistent.
    fn inconsistent(&mut self, readings: usize, mut contradicts: impl FnMut(usize) -> bool) -> usize {
        (0..readings).filter(|i| matches!(self.push(contradicts(*i)), Watch::Inconsistent)).count()
    }
}

/// One in a hundred, one in five, and runs of four in every thirty: none is reported in 20,000 readings each.
#[test]
fn single_faults_and_short_runs_are_not_reported() {
    let mut rng = Rng::new(3);
    for share in [0.01, 0.2] {
        let said = Watched::new(1).inconsistent(20_000, |_| rng.uniform(0.0, 1.0) < share);
        assert_eq!(said, 0, "of a share of {share}");
    }
    assert_eq!(Watched::new(2).inconsistent(20_000, |i| i % 30 < 4), 0, "of runs of four");
}

/// From one reading on all contradict: said within thirty, not before the fifth, and ended within ten once they agree again.
#[test]
fn a_lasting_contradiction_is_reported_and_ends() {
    for seed in 0..10 {
        let mut watched = Watched::new(seed);
        assert_eq!(watched.inconsistent(1000, |_| false), 0);
        let said = watched.inconsistent(100, |_| true);
        assert!((70..=96).contains(&said), "after {} readings", 100 - said);
        let ends = watched.inconsistent(100, |_| false);
        assert!((2..=10).contains(&ends), "ended after {ends}");
    }
}

/// Nine in ten contradict, and the tenth does not end it.
#[test]
fn most_contradicting_readings_are_reported_once() {
    let mut watched = Watched::new(5);
    let states: Vec<bool> =
        (0..2000).map(|i| matches!(watched.push(i % 10 != 0), Watch::Inconsistent)).collect();
    let changes = states.windows(2).filter(|pair| pair[0] != pair[1]).count();
    assert_eq!(changes, 1, "the state changes {changes} times");
    assert!(states[1999]);
}

/// One corner in fifty is off. Of 48 corners that is 62 % of the readings: reported once at most, at the start, and then a noise that is known.
#[test]
fn outliers_among_many_corners_are_reported_once() {
    for (corners, seed) in [(4, 11), (28, 12), (48, 13), (48, 14), (48, 15)] {
        let (mut rng, mut watched) = (Rng::new(seed), Watched::new(seed));
        let share = 1.0 - 0.98_f64.powi(corners);
        let states: Vec<bool> = (0..28_800)
            .map(|_| matches!(watched.push(rng.uniform(0.0, 1.0) < share), Watch::Inconsistent))
            .collect();
        let reports = states.windows(2).filter(|pair| !pair[0] && pair[1]).count();
        assert!(reports <= 1 && !states[1000..].contains(&true), "{corners} corners: {reports} times");
        let lasting = watched.inconsistent(200, |_| true);
        assert!(100 <= lasting, "of {corners} corners one that lasts is reported after {}", 200 - lasting);
    }
}

/// No reading could be used of late, and that is not decided: in doubt, neither steady nor stale.
#[test]
fn a_camera_without_usable_readings_is_in_doubt() {
    let mut watched = Watched::new(6);
    watched.inconsistent(100, |_| false);
    let states: Vec<Watch> = (0..7).map(|_| watched.push(true)).collect();
    assert!(matches!(states[6], Watch::Checking | Watch::Inconsistent), "{:?}", states[6]);
}
