//! Films of a tag whose motion is known, made by the ffmpeg that is installed, and streams of them.

pub mod streamed;

use resight::core::{Camera, Pose, Target, Vector6};
use resight::render::{Finish, Scene, Style, render};
use serde_json::Value;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU16, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

pub const CAMERA: &str = "model = \"pinhole\"\nwidth_px = 320\nheight_px = 240\nfx_px = 300.0\nfy_px = 300.0\ncx_px = 159.5\ncy_px = 119.5\n";
pub const TARGET: &str = "kind = \"tag\"\nfamily = \"tag36h11\"\nid = 3\nsize_m = 0.2\n";
/// Longest wait for anything that must happen.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// Whether there is an ffmpeg; says so where there is none.
pub fn has_ffmpeg() -> bool {
    let found = Command::new("ffmpeg").arg("-version").output().is_ok();
    if !found {
        println!("ffmpeg is not installed: this test is skipped");
    }
    found
}

/// Whether there is an ffmpeg that speaks a protocol, at both ends; says so where there is none.
pub fn speaks(protocol: &str) -> bool {
    let asked = Command::new("ffmpeg").args(["-v", "error", "-protocols"]).output();
    let listed =
        asked.map(|reported| String::from_utf8_lossy(&reported.stdout).into_owned()).unwrap_or_default();
    let both = listed.lines().filter(|line| line.trim() == protocol).count() == 2;
    if !both {
        println!("no ffmpeg that reads and writes {protocol}: this test is skipped");
    }
    both
}

/// A folder with the camera and the target.
pub fn studio(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    // A folder of an earlier run.
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder");
    std::fs::write(path.join("camera.toml"), CAMERA).expect("written");
    std::fs::write(path.join("target.toml"), TARGET).expect("written");
    path
}

/// Grey frames, one after the other, of a camera whose rotation to the right is given for each, degrees.
pub fn frames(studio: &Path, pan_deg: impl IntoIterator<Item = f64>) -> Vec<u8> {
    let file = studio.join("camera.toml");
    let camera: Camera = resight::formats::read_camera(file).expect("a camera").camera;
    let target: Target = resight::formats::read_target(studio.join("target.toml")).expect("a target").target;
    let cam_from_target = Pose::exp(&Vector6::new(0.35, -0.3, 0.1, 0.02, -0.01, 0.8));
    let frame = |(i, pan_deg): (usize, f64)| {
        let old_from_new = Pose::exp(&Vector6::new(0.0, pan_deg.to_radians(), 0.0, 0.0, 0.0, 0.0));
        let scene = Scene::of(target.clone(), old_from_new.inverse() * cam_from_target, Style::default());
        let finish = Finish { noise_sigma: 2.0, seed: 1000 + i as u64, ..Finish::default() };
        render(&scene, &camera, &finish).expect("an image").data
    };
    pan_deg.into_iter().enumerate().flat_map(|(i, pan_deg)| frame((i, pan_deg))).collect()
}

/// Encodes grey 320×240 frames at `rate` a second; `output` are ffmpeg's further arguments, the file last.
pub fn encode(frames: &[u8], rate: u32, output: &[&str]) {
    let rate = rate.to_string();
    let mut encoder = Command::new("ffmpeg")
        .args(["-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "gray", "-video_size", "320x240"])
        .args(["-framerate", &rate, "-i", "-"])
        .args(output)
        .stdin(Stdio::piped())
        .spawn()
        .expect("ffmpeg");
    encoder.stdin.take().expect("its input").write_all(frames).expect("taken");
    assert!(encoder.wait().expect("an end").success(), "{output:?}");
}

/// A good image, frames to and from, a key frame every ten.
pub const H264: [&str; 12] =
    ["-c:v", "libx264", "-preset", "veryfast", "-crf", "12", "-bf", "2", "-g", "10", "-pix_fmt", "yuv420p"];

/// A process that ends with the test.
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A port that nobody listens on just now, below those that the system gives to others in the meantime.
pub fn free_port() -> u16 {
    static TAKEN: AtomicU16 = AtomicU16::new(0);
    let of_this_process = (std::process::id() % 97) as u16 * 100;
    let ports = || Some(20_000 + of_this_process + TAKEN.fetch_add(1, Ordering::Relaxed) % 100);
    let is_free = |port: &u16| std::net::TcpListener::bind(("127.0.0.1", *port)).is_ok();
    std::iter::from_fn(ports).take(100).find(is_free).expect("a port")
}

/// Serves a file at its own speed to the one who connects.
pub fn serve(file: &Path, arguments: &[&str]) -> Running {
    let child = Command::new("ffmpeg")
        .args(["-v", "error", "-re", "-i"])
        .arg(file)
        .args(["-c", "copy"])
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    Running(child.expect("ffmpeg"))
}

/// `resight watch --json` in the background.
pub struct Watching {
    _process: Running,
    events: Receiver<Value>,
    pub seen: Vec<Value>,
}

/// The arguments that every session of a studio has.
pub fn arguments(studio: &Path) -> Vec<String> {
    let file = |name: &str| studio.join(name).display().to_string();
    ["watch", "--json", "--camera", &file("camera.toml"), "--target", &file("target.toml")]
        .map(String::from)
        .to_vec()
}

impl Watching {
    pub fn start(studio: &Path, more: &[&str]) -> Self {
        let arguments = arguments(studio);
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).chain(more.iter().copied()).collect();
        Watching::with(&arguments)
    }

    /// The same with variables of the environment.
    pub fn start_in<'a>(
        studio: &Path,
        more: &[&str],
        environment: impl IntoIterator<Item = (&'a str, std::ffi::OsString)>,
    ) -> Self {
        let mut session = Command::new(assert_cmd::cargo::cargo_bin("resight"));
        session.args(arguments(studio)).args(more).envs(environment);
        Watching::of(session)
    }

    pub fn with(arguments: &[&str]) -> Self {
        let mut session = Command::new(assert_cmd::cargo::cargo_bin("resight"));
        session.args(arguments);
        Watching::of(session)
    }

    fn of(mut session: Command) -> Self {
        let child = session.stdin(Stdio::null()).stdout(Stdio::piped()).spawn();
        let mut process = Running(child.expect("it runs"));
        let stdout = process.0.stdout.take().expect("its output");
        let (sender, events) = channel();
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                // The test may have ended.
                let _ = sender.send(serde_json::from_str(&line).expect("JSON"));
            }
        });
        Watching { _process: process, events, seen: Vec::new() }
    }

    /// Waits for the first event from now on that passes.
    pub fn until(&mut self, what: &str, test: impl Fn(&Value) -> bool) -> Value {
        let end = Instant::now() + PATIENCE;
        while let Ok(event) = self.events.recv_timeout(end.saturating_duration_since(Instant::now())) {
            self.seen.push(event.clone());
            if test(&event) {
                return event;
            }
        }
        panic!("no {what} within {PATIENCE:?}; {:?}", said(&self.seen))
    }

    pub fn frames(&mut self, number: usize) {
        for _ in 0..number {
            self.until("frame", |event| event["event"] == "frame" && event.get("message").is_none());
        }
    }
}

/// All but frames.
pub fn said(events: &[Value]) -> Vec<&Value> {
    events.iter().filter(|event| event["event"] != "frame").collect()
}

/// The states told, in order.
pub fn states(events: &[Value]) -> Vec<&str> {
    events.iter().filter(|e| e["event"] == "state").filter_map(|e| e["state"].as_str()).collect()
}

/// A finished run: status, events, complaints.
pub struct Run {
    pub code: i32,
    pub events: Vec<Value>,
    pub stderr: String,
}

/// `resight watch --json --once` to its end.
pub fn watch_once(studio: &Path, more: &[&str]) -> Run {
    let mut command = assert_cmd::Command::cargo_bin("resight").expect("the program");
    let run = command.args(arguments(studio)).arg("--once").args(more).output().expect("it runs");
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("text");
    let events = text(&run.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    Run { code: run.status.code().expect("an exit status"), events, stderr: text(&run.stderr) }
}

/// Whether a process runs whose command line holds `text`, except `but`; none where that cannot be reported.
pub fn runs(text: &str, but: &[u32]) -> Option<bool> {
    let processes = std::fs::read_dir("/proc").ok()?.flatten();
    let is_one = |entry: std::fs::DirEntry| -> Option<bool> {
        let id: u32 = entry.file_name().to_str()?.parse().ok()?;
        let line = std::fs::read(entry.path().join("cmdline")).ok()?;
        Some(!but.contains(&id) && String::from_utf8_lossy(&line).replace('\0', " ").contains(text))
    };
    Some(processes.filter_map(is_one).any(|is_one| is_one))
}
