//! How each camera is, from the session's events.

use resight::core::Point;
use resight::core::locate::choose::Ambiguity;
use resight_watch::Event;
use resight_watch::live::{Observation, State};
use resight_watch::names::Names;
use resight_watch::outputs::said::{state_words, word};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::VecDeque;

/// Frames that rates and standard deviations are of.
const WINDOW: usize = 300;
/// Changes of state kept for the strip of a camera without a history file.
const CHANGES: usize = 500;

/// How everything is.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct LiveView {
    /// The cameras, in the session's order.
    pub cameras: Vec<CameraView>,
    /// Why there is no session any more.
    pub failed: Option<String>,
    /// Whether a history file is there to be asked.
    pub has_history: bool,
}

/// How a camera is.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CameraView {
    name: String,
    /// `learning`, `steady`, `checking`, `drifted`, `stale`, `inconsistent` or `tracking`, of the worst target; none before the first frame.
    state: Option<&'static str>,
    /// In a sentence, with what puts the camera back.
    words: String,
    /// `[rotation_rad; translation_m]` of a motion, camera axes; the way back is its negative.
    old_from_new: Option<[f64; 6]>,
    /// An alarm that nobody has acknowledged.
    is_alarm: bool,
    /// Whether its source is connected and has not ended.
    connected: bool,
    /// Why not.
    reason: Option<String>,
    /// Seconds since the last frame was looked at.
    age_s: Option<f64>,
    /// Frames a second, over the last 300.
    fps: Option<f64>,
    /// Mean times over the last 300 frames.
    waited_ms: f64,
    detect_ms: f64,
    solve_ms: f64,
    decide_ms: f64,
    /// Frames dropped and left out.
    dropped: u64,
    left_out: u64,
    /// Points in the last frame, and why there is no pose.
    n_points: usize,
    no_pose: Option<String>,
    rms_px: Option<f64>,
    /// Whether two poses fit the last frame.
    is_ambiguous: bool,
    /// Where the camera was in the last frame, frame of the target.
    position_m: Option<[f64; 3]>,
    /// 1σ of that by the pose's covariance.
    sigma_m: Option<[f64; 3]>,
    /// Standard deviation over the frames since Reset, at most 300.
    measured_sigma_m: Option<[f64; 3]>,
    n_measured: usize,
    /// Changes of state: seconds of capture and the word.
    changes: Vec<(f64, &'static str)>,
}

struct One {
    view: CameraView,
    states: Vec<Option<State>>,
    seen_at_s: VecDeque<f64>,
    times_ms: VecDeque<[f64; 4]>,
    positions: VecDeque<Point>,
    arrived: Option<std::time::Instant>,
}

/// All cameras.
pub struct Cameras {
    all: Vec<One>,
    n_targets: usize,
    failed: Option<String>,
}

impl Cameras {
    /// None has been seen.
    pub fn new(names: &Names) -> Self {
        let n_targets = names.targets.len();
        let one = |name: &String| One {
            view: nothing(name),
            states: vec![None; n_targets],
            seen_at_s: VecDeque::new(),
            times_ms: VecDeque::new(),
            positions: VecDeque::new(),
            arrived: None,
        };
        Cameras { all: names.cameras.iter().map(one).collect(), n_targets, failed: None }
    }

    /// The next event.
    pub fn take(&mut self, event: &Event) {
        match event {
            Event::Observed { camera, target, observation } => {
                if let Some(one) = self.all.get_mut(*camera) {
                    one.observed(*target, observation);
                }
            }
            Event::StateChanged { camera, target, t_s, state } => {
                if let Some(one) = self.all.get_mut(*camera) {
                    one.changed(*target, *t_s, state);
                }
            }
            Event::Dropped { camera, frames } => self.each(*camera, |v| v.dropped += frames),
            Event::LeftOut { camera, frames, .. } => self.each(*camera, |v| v.left_out += frames),
            Event::Source { camera, connected, reason } => self.each(*camera, |v| {
                (v.connected, v.reason) = (*connected, reason.clone());
            }),
            Event::Ended { camera } => self.each(*camera, |v| {
                (v.connected, v.reason) = (false, Some("its source has ended".to_owned()));
            }),
            _ => {}
        }
    }

    fn each(&mut self, camera: usize, change: impl FnOnce(&mut CameraView)) {
        if let Some(one) = self.all.get_mut(camera) {
            change(&mut one.view);
        }
    }

    /// How it is now; alarms come first when the page sorts by them.
    pub fn view(&self, _now_s: f64) -> LiveView {
        LiveView {
            cameras: self.all.iter().map(One::now).collect(),
            failed: self.failed.clone(),
            has_history: false,
        }
    }

    pub fn number(&self, name: &str) -> Option<usize> {
        self.all.iter().position(|one| one.view.name == name)
    }

    /// Whether there was an alarm.
    pub fn acknowledge(&mut self, camera: usize) -> bool {
        self.all.get_mut(camera).is_some_and(|one| std::mem::take(&mut one.view.is_alarm))
    }

    /// Standard deviations begin anew.
    pub fn reset(&mut self, camera: usize) {
        if let Some(one) = self.all.get_mut(camera) {
            one.positions.clear();
        }
    }

    pub fn failed(&mut self, reason: String) {
        self.failed = Some(reason);
    }

    pub fn started_again(&mut self) {
        self.failed = None;
        let n = self.n_targets;
        self.all.iter_mut().for_each(|one| {
            one.states = vec![None; n];
            one.positions.clear();
            one.view.connected = true;
            one.view.reason = None;
        });
    }
}

impl One {
    fn observed(&mut self, target: usize, observation: &Observation) {
        self.arrived = Some(std::time::Instant::now());
        if target == 0 {
            push(&mut self.seen_at_s, observation.capture_s);
            let t = &observation.times;
            push(&mut self.times_ms, [t.waited_us, t.detect_us, t.solve_us, t.decide_us].map(|us| 1e-3 * us));
        }
        let view = &mut self.view;
        let is_better = observation.estimate.is_some() || target == 0;
        if !is_better {
            return;
        }
        (view.n_points, view.no_pose) = (observation.n_points, observation.reason.clone());
        let estimate = observation.estimate.as_ref();
        view.rms_px = estimate.map(|e| e.rms_px);
        view.is_ambiguous = estimate.is_some_and(|e| matches!(e.ambiguity, Ambiguity::Ambiguous { .. }));
        view.position_m = estimate.map(|e| e.cam_from_target.origin().into());
        view.sigma_m = estimate.map(|e| resight::report::words::position_with_sigma_m(e).1.into());
        if let (Some(e), 0) = (estimate, target) {
            push(&mut self.positions, e.cam_from_target.origin());
        }
    }

    fn changed(&mut self, target: usize, t_s: f64, state: &State) {
        let was_drifted = self.states.iter().flatten().any(|s| matches!(s, State::Drifted(_)));
        if let Some(slot) = self.states.get_mut(target) {
            *slot = Some(state.clone());
        }
        if matches!(state, State::Drifted(_)) && !was_drifted {
            self.view.is_alarm = true;
        }
        let Some(worst) = self.states.iter().flatten().max_by_key(|s| severity(s)) else { return };
        self.view.words = state_words(worst);
        self.view.old_from_new = match worst {
            State::Drifted(drift) => Some(std::array::from_fn(|i| drift.old_from_new[i])),
            _ => None,
        };
        if self.view.state != Some(word(worst)) {
            self.view.state = Some(word(worst));
            self.view.changes.push((t_s, word(worst)));
            if CHANGES < self.view.changes.len() {
                self.view.changes.remove(0);
            }
        }
    }

    fn now(&self) -> CameraView {
        let mut view = self.view.clone();
        view.age_s = self.arrived.map(|at| at.elapsed().as_secs_f64());
        let (first, last) = (self.seen_at_s.front(), self.seen_at_s.back());
        let span = first.zip(last).map(|(a, b)| b - a).filter(|s| 0.0 < *s);
        view.fps = span.map(|span| (self.seen_at_s.len() - 1) as f64 / span);
        let n = self.times_ms.len().max(1) as f64;
        let mean = |k: usize| self.times_ms.iter().map(|t| t[k]).sum::<f64>() / n;
        (view.waited_ms, view.detect_ms, view.solve_ms, view.decide_ms) =
            (mean(0), mean(1), mean(2), mean(3));
        view.n_measured = self.positions.len();
        view.measured_sigma_m = self.deviation();
        view
    }

    fn deviation(&self) -> Option<[f64; 3]> {
        let n = self.positions.len();
        let mean = self.positions.iter().sum::<Point>() / n as f64;
        let squares = self.positions.iter().map(|p| (p - mean).map(|x| x * x)).sum::<Point>();
        (1 < n).then(|| squares.map(|x| (x / (n - 1) as f64).sqrt()).into())
    }
}

fn severity(state: &State) -> u8 {
    match state {
        State::Drifted(_) => 6,
        State::Inconsistent => 5,
        State::Checking(_) => 4,
        State::Stale { .. } => 3,
        State::Learning { .. } => 2,
        State::Tracking => 1,
        State::Steady => 0,
    }
}

fn push<T>(queue: &mut VecDeque<T>, item: T) {
    if WINDOW <= queue.len() {
        queue.pop_front();
    }
    queue.push_back(item);
}

fn nothing(name: &str) -> CameraView {
    CameraView {
        name: name.to_owned(),
        state: None,
        words: "no frame yet".to_owned(),
        old_from_new: None,
        is_alarm: false,
        connected: true,
        reason: None,
        age_s: None,
        fps: None,
        waited_ms: 0.0,
        detect_ms: 0.0,
        solve_ms: 0.0,
        decide_ms: 0.0,
        dropped: 0,
        left_out: 0,
        n_points: 0,
        no_pose: None,
        rms_px: None,
        is_ambiguous: false,
        position_m: None,
        sigma_m: None,
        measured_sigma_m: None,
        n_measured: 0,
        changes: Vec::new(),
    }
}
