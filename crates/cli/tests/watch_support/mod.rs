//! Lines of detections for `watch`, and the program run while they come.

use super::rig_support::{Chance, SIGMA_PX};
use super::support::demo;
use nalgebra::Vector6;
use resight::core::target::Feature;
use resight::core::{Camera, Pose, Target};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// The dots at times `period_s` apart, seen by a camera whose motion is given for each frame.
pub fn lines(
    frames: std::ops::Range<usize>,
    period_s: f64,
    seed: u64,
    old_from_new: impl Fn(usize) -> Vector6<f64>,
) -> Vec<String> {
    let camera: Camera = resight::formats::read_camera(demo("left.toml")).expect("a camera").camera;
    let target: Target = resight::formats::read_target(demo("dots.toml")).expect("a target").target;
    let cam_from_target = Pose::exp(&Vector6::new(0.35, -0.25, 0.1, -0.03, -0.02, 0.6));
    let mut chance = Chance(seed);
    let mut line = |frame: usize| {
        let now = Pose::exp(&old_from_new(frame)).inverse() * cam_from_target;
        let seen: Vec<Value> = target
            .features()
            .into_iter()
            .map(|feature| {
                let Feature { id, corner } = feature;
                let known = target.point(feature).expect("a known point");
                let x_in_cam = now.rotation * known.position + now.translation;
                let pixel = camera.project(&x_in_cam).expect("in the image");
                let (u, v) = (pixel.x + SIGMA_PX * chance.normal(), pixel.y + SIGMA_PX * chance.normal());
                json!({"id": id, "corner": corner, "u_px": u, "v_px": v, "sigma_px": SIGMA_PX})
            })
            .collect();
        format!("{}\n", json!({"t_s": frame as f64 * period_s, "detections": seen}))
    };
    frames.map(&mut line).collect()
}

pub fn still(_: usize) -> Vector6<f64> {
    Vector6::zeros()
}

/// A session that runs while the test continues.
pub struct Session {
    pub child: Child,
    pub stdin: Option<ChildStdin>,
    said: Arc<Mutex<Vec<String>>>,
    logged: Arc<Mutex<Vec<String>>>,
    readers: Vec<JoinHandle<()>>,
}

/// Longest wait for anything; a loaded machine is slow.
const PATIENCE: Duration = Duration::from_secs(120);

/// `resight watch` with detections on stdin, events and frames as JSON; `before` is put in front of the program.
pub fn start(before: &[&str], arguments: &[&str]) -> Session {
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    start_with(before, &[&["--camera", &camera, "--target", &target][..], arguments].concat())
}

/// The same of any cameras and targets.
pub fn start_with(before: &[&str], arguments: &[&str]) -> Session {
    let program = assert_cmd::cargo::cargo_bin("resight");
    let program = program.to_str().expect("a path");
    let fixed = ["watch", "--source", "-", "--json", "--frames"];
    let all: Vec<&str> =
        before.iter().copied().chain([program]).chain(fixed).chain(arguments.iter().copied()).collect();
    let mut child = Command::new(all[0])
        .args(&all[1..])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("it starts");
    let (said, logged) = (Arc::default(), Arc::default());
    let readers = vec![
        gather(child.stdout.take().expect("stdout"), Arc::clone(&said)),
        gather(child.stderr.take().expect("stderr"), Arc::clone(&logged)),
    ];
    Session { stdin: child.stdin.take(), child, said, logged, readers }
}

/// Whole lines only: the last one of a killed program may be torn.
fn gather(from: impl Read + Send + 'static, into: Arc<Mutex<Vec<String>>>) -> JoinHandle<()> {
    std::thread::spawn(move || {
        let mut from = BufReader::new(from);
        let mut line = String::new();
        while from.read_line(&mut line).is_ok_and(|n| 0 < n) {
            if line.ends_with('\n') {
                into.lock().expect("the lines").push(line.trim_end().to_string());
            }
            line.clear();
        }
    })
}

impl Session {
    pub fn feed(&mut self, lines: &[String]) {
        let stdin = self.stdin.as_mut().expect("stdin");
        for line in lines {
            stdin.write_all(line.as_bytes()).expect("written");
        }
        stdin.flush().expect("flushed");
    }

    pub fn events(&self) -> Vec<Value> {
        let said = self.said.lock().expect("the lines");
        said.iter().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }

    pub fn log(&self) -> String {
        self.logged.lock().expect("the lines").join("\n")
    }

    /// How many lines it has printed.
    pub fn n_said(&self) -> usize {
        self.said.lock().expect("the lines").len()
    }

    pub fn wait_until(&self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let began = Instant::now();
        while !is_so(self) {
            assert!(began.elapsed() < PATIENCE, "{what}: not within {PATIENCE:?}; the log: {}", self.log());
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// SIGKILL, then all that it had said.
    pub fn kill(&mut self) {
        self.child.kill().expect("killed");
        self.child.wait().expect("its end");
        self.read_to_the_end();
    }

    /// The end of the input; its exit status.
    pub fn end(&mut self) -> i32 {
        drop(self.stdin.take());
        let status = self.child.wait().expect("its end");
        self.read_to_the_end();
        status.code().expect("an exit status")
    }

    fn read_to_the_end(&mut self) {
        drop(self.stdin.take());
        self.readers.drain(..).for_each(|reader| reader.join().expect("a reader"));
    }
}

impl Drop for Session {
    /// A failed test leaves no program behind.
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

pub fn text(path: &Path) -> &str {
    path.to_str().expect("a path")
}
