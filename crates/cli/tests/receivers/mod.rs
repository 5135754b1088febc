//! Those who are reported: small servers on 127.0.0.1, and sessions that tell them.

pub mod broker;
pub mod networktables;
pub mod web;

use crate::support::demo;
use resight::core::target::Feature;
use resight::core::{Camera, Pose, Target};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// "Did it happen at all": never how fast.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// Waits until something is there.
pub fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let until = Instant::now() + PATIENCE;
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(Instant::now() < until, "waited in vain for {what}");
        thread::sleep(Duration::from_millis(20));
    }
}

/// The demo's dots seen once a second, as lines of JSON; from `moved_at` on the camera is turned to the right by one degree.
pub fn lines(camera: Option<&str>, seconds: std::ops::Range<usize>, moved_at: usize) -> String {
    let lens: Camera = resight::formats::read_camera(demo("left.toml")).expect("a camera").camera;
    let target: Target = resight::formats::read_target(demo("dots.toml")).expect("a target").target;
    let cam_from_target = Pose::exp(&[0.35, -0.25, 0.1, -0.03, -0.02, 0.6].into());
    let mut all = String::new();
    for second in seconds {
        let rotation_rad = if second < moved_at { 0.0 } else { f64::to_radians(1.0) };
        let now = Pose::exp(&[0.0, rotation_rad, 0.0, 0.0, 0.0, 0.0].into()).inverse() * cam_from_target;
        let seen: Vec<Value> = target
            .features()
            .into_iter()
            .enumerate()
            .map(|(i, feature)| {
                let Feature { id, corner } = feature;
                let point = target.point(feature).expect("a known point").position;
                let pixel = lens.project(&(now.rotation * point + now.translation)).expect("in the image");
                let [u_px, v_px] = [pixel.x + noise_px(second, 2 * i), pixel.y + noise_px(second, 2 * i + 1)];
                json!({"id": id, "corner": corner, "u_px": u_px, "v_px": v_px, "sigma_px": 0.2})
            })
            .collect();
        let mut line = json!({"t_s": second as f64, "detections": seen});
        if let Some(camera) = camera {
            line["camera"] = json!(camera);
        }
        all += &format!("{line}\n");
    }
    all
}

/// About normal with a sigma of 0.2 px: a sum of four draws of a hash (SplitMix64) of second and number.
fn noise_px(second: usize, number: usize) -> f64 {
    let draw = |k: u64| {
        let mut z = ((second as u64) << 16 | (number as u64) << 4 | k).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    0.2 * (0..4).map(draw).sum::<f64>() * f64::sqrt(3.0)
}

/// A session of the program that is fed through its stdin.
pub struct Session {
    child: Child,
    stdin: Option<ChildStdin>,
    stdout: JoinHandle<String>,
    log: Arc<Mutex<String>>,
    log_reader: JoinHandle<()>,
}

/// How a session ended.
pub struct Ended {
    pub code: i32,
    pub events: Vec<Value>,
    pub log: String,
}

impl Session {
    /// One camera without a name, one target.
    pub fn start(arguments: &[&str]) -> Self {
        let (camera, target) = (demo("left.toml"), demo("dots.toml"));
        let fixed = ["--camera", &camera, "--target", &target];
        Self::of(&[&fixed, arguments].concat())
    }

    /// Cameras and targets among the arguments.
    pub fn of(arguments: &[&str]) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_resight"))
            // A machine that is busy elsewhere is not blind.
            .args(["watch", "--source", "-", "--once", "--json", "--stale-after-s", "600"])
            .args(arguments)
            .envs([("NO_PROXY", "*"), ("no_proxy", "*")])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("it starts");
        let stdin = child.stdin.take();
        let (mut out, err) = (child.stdout.take().expect("stdout"), child.stderr.take().expect("stderr"));
        let stdout = thread::spawn(move || {
            let mut text = String::new();
            out.read_to_string(&mut text).expect("text");
            text
        });
        let log = Arc::new(Mutex::new(String::new()));
        let shared = Arc::clone(&log);
        let log_reader = thread::spawn(move || {
            for line in BufReader::new(err).lines() {
                *shared.lock().expect("the log") += &format!("{}\n", line.expect("text"));
            }
        });
        Session { child, stdin, stdout, log, log_reader }
    }

    pub fn feed(&mut self, text: &str) {
        let stdin = self.stdin.as_mut().expect("an open stdin");
        stdin.write_all(text.as_bytes()).and_then(|()| stdin.flush()).expect("fed");
    }

    pub fn log(&self) -> String {
        self.log.lock().expect("the log").clone()
    }

    /// The part of the log's first line with this text that follows it.
    pub fn reported(&self, text: &str) -> String {
        wait_for(text, || {
            let log = self.log();
            log.lines().find_map(|line| line.split_once(text).map(|(_, rest)| rest.to_string()))
        })
    }

    /// No warning, no farewell.
    pub fn kill(mut self) {
        self.child.kill().expect("killed");
        self.child.wait().expect("gone");
    }

    /// Ends the input and waits.
    pub fn end(mut self) -> Ended {
        drop(self.stdin.take());
        let child = &mut self.child;
        let code = wait_for("the end of the session", || child.try_wait().expect("a status"));
        self.log_reader.join().expect("the log");
        let text = self.stdout.join().expect("stdout");
        let events = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
        let log = self.log.lock().expect("the log").clone();
        Ended { code: code.code().expect("an exit status"), events, log }
    }
}

impl Ended {
    /// The JSON lines that others are told, as they are.
    pub fn notices(&self) -> Vec<&Value> {
        let is_reported =
            |e: &&Value| ["state", "source", "moved"].contains(&e["event"].as_str().unwrap_or_default());
        self.events.iter().filter(is_reported).collect()
    }
}

/// How often the log says something.
pub fn times(log: &str, text: &str) -> usize {
    log.lines().filter(|line| line.contains(text)).count()
}
