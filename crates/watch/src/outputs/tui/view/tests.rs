//! Images of a session with invented events, compared with golden ones. `RESIGHT_BLESS=1` writes the golden ones again; read the difference.

use super::*;
use crate::board::{Board, Instants};
use crate::live::{CheckingReason, Event, Observation, StageTimes, State};
use crate::log::Log;
use crate::names::Names;
use crate::outputs::Session;
use crate::outputs::tui::keys::View;
use nalgebra::{Matrix6, Vector6};
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use resight::core::correspondence::{Detection, correspond};
use resight::core::locate::{Config, PoseEstimate, locate};
use resight::core::temporal::monitor::{Drift, DriftNoise, MotionKind, Reading, Reference};
use resight::core::{Camera, Pose, Target};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

fn shipped(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/demo").join(name).display().to_string()
}

fn cam_from_target() -> Pose {
    Pose::exp(&Vector6::new(0.35, -0.25, 0.1, -0.03, -0.02, 0.6))
}

fn diagonal(turn: f64, shift: f64) -> Matrix6<f64> {
    let (r, t) = (turn * turn, shift * shift);
    Matrix6::from_diagonal(&Vector6::new(r, r, r, t, t, t))
}

fn reference() -> Reference {
    let noise = DriftNoise {
        reference: diagonal(1e-4, 1e-4),
        reading: diagonal(8e-4, 5e-4),
        bias: diagonal(1e-4, 1e-4),
        bias_time_s: 60.0,
        diurnal: diagonal(0.0, 0.0),
    };
    Reference { a_from_b: cam_from_target(), noise }
}

/// Returns the estimate of a pose whose pixels have errors of up to 0.1 px.
fn estimate(pose: &Pose) -> PoseEstimate {
    let camera: Camera = resight::formats::read_camera(shipped("left.toml")).expect("a camera").camera;
    let target: Target = resight::formats::read_target(shipped("dots.toml")).expect("a target").target;
    let detection = |feature| {
        let x_in_cam = *pose * target.point(feature).expect("a point").position;
        let error = 0.1 * (5.0 * x_in_cam.x + 40.0 * x_in_cam.y).sin();
        let pixel = camera.project(&x_in_cam).expect("in the image").map(|x| x + error);
        Detection { feature, pixel, sigma_px: 0.2, lens_sigma_px: 0.0, covariance_px2: None }
    };
    let detections: Vec<Detection> = target.features().into_iter().map(detection).collect();
    let points: Vec<_> = correspond(&detections, &target, &camera).0.into_iter().map(|(_, c)| c).collect();
    locate(&points, &camera, &Config::default()).expect("a pose")
}

fn observed(camera: usize, number: u64, rotation_rad: f64, reported: &PoseEstimate) -> Event {
    let ripple = (number as f64 * 0.7).sin();
    let error = Vector6::new(2e-4, 3e-4, 5e-4, 2e-4, 1e-4, 3e-4) * ripple;
    let turn = Vector6::new(0.0, rotation_rad, 0.0, 0.0, 0.0, 0.0);
    let a_from_b = Pose::exp(&(turn + error)).inverse() * cam_from_target();
    let capture_s = number as f64 / 30.0;
    let reading = Reading { t_s: capture_s, a_from_b, covariance: reported.covariance, is_consistent: true };
    let times = StageTimes {
        waited_us: 12.0 + 3.0 * ripple,
        detect_us: 2300.0 + 150.0 * ripple,
        solve_us: 48.0 + 4.0 * ripple,
        decide_us: 6.5 + ripple,
    };
    let observation = Observation {
        number,
        capture_s,
        name: format!("{number:06}.png"),
        n_points: 4,
        is_readable: true,
        estimate: Some(*reported),
        reading: Some(reading),
        times,
        ..Observation::default()
    };
    Event::Observed { camera, target: 0, observation: Box::new(observation) }
}

fn is_now(camera: usize, t_s: f64, state: State) -> Event {
    Event::StateChanged { camera, target: 0, t_s, state }
}

fn turned_right() -> State {
    State::Drifted(Box::new(Drift {
        old_from_new: Vector6::new(0.0, 0.5_f64.to_radians(), 0.0, 0.0, 0.0, 0.0),
        covariance: diagonal(2e-4, 2e-4),
        began_s: 6.7,
        began_sigma_s: 0.1,
        rate: None,
        again: None,
        course: MotionKind::Step,
        course_probability: 1.0,
    }))
}

/// A session of some cameras; it has run for an hour, at half past noon of some day.
struct Made {
    board: Board,
    log: Log,
    now: Instants,
}

impl Made {
    fn new(cameras: &[&str]) -> Self {
        let files: Vec<String> = cameras.iter().map(|name| format!("{name}=file")).collect();
        let names = Names::new(&files, &["tag=file".to_string()]);
        let (log, stop) = (Log::default(), Arc::new(AtomicBool::new(false)));
        log.hold(); // log.hold(); // A test prints nothing on stderr.
        let references = vec![Some(reference()); cameras.len()];
        let session = Session {
            names: &names,
            references,
            false_alarms_per_day: 1.0 / 30.0,
            log: &log,
            stop: &stop,
            is_once: false,
        };
        let board = Board::new(session.names, &session.references, 100);
        Made { board, log, now: Instants { up_s: 3600.0, unix_s: 45_000.0 } }
    }

    fn take(&mut self, event: &Event, after_s: f64) {
        self.now.up_s += after_s;
        self.now.unix_s += after_s;
        self.board.take(event, self.now);
    }

    fn text(&self, width: u16, height: u16, view: &View) -> String {
        let mut view = view.clone();
        view.choose_among(self.board.pairs.len());
        // The session's own lines have the time of the machine; here they get that of the last event.
        let mut lines = self.log.lines();
        lines.iter_mut().for_each(|line| line.unix_s = self.now.unix_s);
        let picture =
            Picture { board: &self.board, lines: &lines, now: self.now, view: &view, has_color: true };
        let mut terminal = Terminal::new(TestBackend::new(width, height)).expect("a terminal");
        terminal.draw(|frame| draw(frame, &picture)).expect("drawn");
        let buffer = terminal.backend().buffer().clone();
        let row = |y| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
        (0..height).map(|y| row(y).trim_end().to_string() + "\n").collect()
    }
}

/// Two cameras at 30 frames a second; after 200 frames the first is rotated by half a degree, and the other has no observation any more.
fn knocked() -> Made {
    let mut made = Made::new(&["gate", "yard"]);
    let reported = estimate(&cam_from_target());
    for camera in 0..2 {
        made.take(&is_now(camera, 0.0, State::Steady), 0.0);
    }
    for number in 0..400 {
        let rotation_rad = if number < 200 { 0.0 } else { 0.5_f64.to_radians() };
        made.take(&observed(0, number, rotation_rad, &reported), 1.0 / 30.0);
        if number < 200 {
            made.take(&observed(1, number, 0.0, &reported), 0.0);
        }
        if number == 202 {
            made.take(&is_now(0, 6.733, turned_right()), 0.0);
        }
    }
    made.take(&Event::Dropped { camera: 1, frames: 17 }, 0.0);
    made.take(&is_now(1, 11.7, State::Stale { for_s: 5.0, reason: None }), 0.0);
    made.log.say("webhook", "no answer from 127.0.0.1:8080; tried again in 4 s");
    made.now.up_s += 2.0;
    made
}

fn golden(name: &str, drawn: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    if std::env::var_os("RESIGHT_BLESS").is_some() {
        std::fs::write(&path, drawn).expect("written");
    }
    let wanted = std::fs::read_to_string(&path).expect("a golden file");
    assert!(drawn == wanted, "{name}: drawn\n{drawn}\nwanted\n{wanted}");
}

#[test]
fn a_usual_terminal_shows_it_all() {
    golden("tui-80x24.txt", &knocked().text(80, 24, &View::default()));
}

#[test]
fn a_small_terminal_shows_what_matters() {
    golden("tui-40x10.txt", &knocked().text(40, 10, &View::default()));
}

#[test]
fn details_show_pose_covariance_and_ambiguity() {
    let view = View { has_details: true, ..View::default() };
    golden("tui-100x34-details.txt", &knocked().text(100, 34, &view));
}

#[test]
fn many_cameras_scroll_and_lost_ones_are_named() {
    let names: Vec<String> = (0..12).map(|i| format!("camera-{i:02}")).collect();
    let mut made = Made::new(&names.iter().map(String::as_str).collect::<Vec<_>>());
    let reported = estimate(&cam_from_target());
    for number in 0..60 {
        (0..12).for_each(|camera| made.take(&observed(camera, number, 0.0, &reported), 0.0));
        made.now.up_s += 1.0;
    }
    (0..11).for_each(|camera| made.take(&is_now(camera, 1.0, State::Steady), 0.0));
    made.take(&is_now(3, 1.0, State::Learning { readings: 1, needed: 50 }), 0.0);
    made.take(&is_now(4, 1.0, State::Inconsistent), 0.0);
    made.take(&is_now(5, 1.0, State::Checking(CheckingReason::Different)), 0.0);
    let reason = Some("/dev/video2: no such device".to_string());
    made.take(&Event::Source { camera: 10, connected: false, reason }, 0.0);
    let mut view = View::default();
    view.choose_among(12);
    view.chosen = 10;
    golden("tui-120x30-many.txt", &made.text(120, 30, &view));
}

#[test]
fn a_reset_forgets_statistics_and_keeps_what_is_known() {
    let mut made = knocked();
    made.board.reset();
    let drawn = made.text(80, 24, &View::default());
    assert!(drawn.contains("std-dev of 0 frames") && drawn.contains("median         –"), "{drawn}");
    assert!(drawn.contains("▲ drifted") && drawn.contains("full height 0.5"), "{drawn}");
    assert_eq!(made.board.cameras[1].dropped, 0);
}

#[test]
fn learning_and_blindness_go_on_between_events() {
    let mut made = Made::new(&["gate"]);
    let reported = estimate(&cam_from_target());
    made.take(&is_now(0, 0.0, State::Learning { readings: 1, needed: 50 }), 0.0);
    (0..20).for_each(|number| made.take(&observed(0, number, 0.0, &reported), 1.0));
    assert!(made.text(80, 24, &View::default()).contains("learning: 21 of 50 readings"));
    made.take(&is_now(0, 20.0, State::Stale { for_s: 5.0, reason: None }), 5.0);
    made.now.up_s += 7.0;
    assert!(made.text(80, 24, &View::default()).contains("stale: no usable reading for 12.0 s"));
}

/// Any size is drawn; nothing is written outside, which would panic.
#[test]
fn every_size_of_terminal_is_drawn() {
    let made = knocked();
    for (width, height) in [(1, 1), (5, 3), (20, 5), (72, 18), (71, 18), (300, 100), (80, 17)] {
        for has_details in [false, true] {
            let drawn = made.text(width, height, &View { has_details, is_paused: true, ..View::default() });
            assert_eq!(drawn.lines().count(), usize::from(height));
        }
    }
    let nothing = Made::new(&[]);
    nothing.text(80, 24, &View::default());
}
