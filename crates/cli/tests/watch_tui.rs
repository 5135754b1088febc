//! `watch --tui` in a terminal of its own: `script` makes one. What is drawn in it, unit tests of the view say.

use crate::rig_support::{Chance, SIGMA_PX};
use crate::support::{demo, folder, resight};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Far longer than any of it takes.
const PATIENCE: Duration = Duration::from_secs(120);

/// The dots seen so many times, a second apart, as lines of JSON in a file.
fn detections(folder: &Path, frames: usize) {
    let camera = resight::formats::read_camera(demo("left.toml")).expect("a camera").camera;
    let target = resight::formats::read_target(demo("dots.toml")).expect("a target").target;
    let cam_from_target =
        resight::core::Pose::exp(&nalgebra::Vector6::new(0.35, -0.25, 0.1, -0.03, -0.02, 0.6));
    let (mut chance, mut all) = (Chance(0x71), String::new());
    for second in 0..frames {
        let mut seen = |feature: resight::core::target::Feature| {
            let x_in_cam = cam_from_target * target.point(feature).expect("a known point").position;
            let pixel = camera.project(&x_in_cam).expect("in the image");
            let [u, v] = [pixel.x, pixel.y].map(|x| x + SIGMA_PX * chance.normal());
            json!({"id": feature.id, "corner": feature.corner, "u_px": u, "v_px": v, "sigma_px": SIGMA_PX})
        };
        let seen: Vec<Value> = target.features().into_iter().map(&mut seen).collect();
        all += &format!("{}\n", json!({"t_s": second as f64, "detections": seen}));
    }
    std::fs::write(folder.join("lines.jsonl"), all).expect("written");
}

/// A shell command in a terminal of 80 × 24.
struct Session {
    child: Child,
    said: Arc<Mutex<Vec<u8>>>,
    reader: std::thread::JoinHandle<()>,
}

impl Session {
    /// None, said aloud, where there is no `script`.
    fn start(folder: &Path, command: &str) -> Option<Session> {
        let command = format!("stty rows 24 cols 80; {command}");
        let child = Command::new("script")
            .args(["-qec", &command, "/dev/null"])
            .current_dir(folder)
            .env("TERM", "xterm-256color")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn();
        let Ok(mut child) = child else {
            println!("skipped: there is no program `script` to make a terminal with");
            return None;
        };
        let said = Arc::new(Mutex::new(Vec::new()));
        let (to, mut from) = (Arc::clone(&said), child.stdout.take().expect("a pipe"));
        let reader = std::thread::spawn(move || {
            let mut buffer = [0; 4096];
            while let Ok(n @ 1..) = from.read(&mut buffer) {
                to.lock().expect("the reader").extend_from_slice(&buffer[..n]);
            }
        });
        Some(Session { child, said, reader })
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.said.lock().expect("the reader")).into_owned()
    }

    fn wait_for(&self, word: &str) {
        let started = Instant::now();
        while !self.text().contains(word) {
            assert!(started.elapsed() < PATIENCE, "no {word:?} in\n{}", self.text());
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn press(&mut self, keys: &str) {
        self.child.stdin.as_mut().expect("a pipe").write_all(keys.as_bytes()).expect("written");
    }

    /// All that was said, when it has ended.
    fn end(mut self) -> String {
        let started = Instant::now();
        while self.child.try_wait().expect("a child").is_none() {
            assert!(started.elapsed() < PATIENCE, "it does not end:\n{}", self.text());
            std::thread::sleep(Duration::from_millis(20));
        }
        self.reader.join().expect("the reader");
        String::from_utf8_lossy(&self.said.lock().expect("the reader")).into_owned()
    }
}

fn watch(more: &str) -> String {
    fed("cat lines.jsonl", "", more)
}

/// What writes lines, and what starts the program.
fn fed(lines: &str, start: &str, more: &str) -> String {
    format!(
        "{lines} | {start} {} watch --camera {} --target {} --source - {more}",
        env!("CARGO_BIN_EXE_resight"),
        demo("left.toml"),
        demo("dots.toml")
    )
}

/// The alternate screen of a terminal, entered and left.
const ENTERED: &str = "\x1b[?1049h";
const LEFT: &str = "\x1b[?1049l";

fn is_given_back(said: &str) {
    assert_eq!((said.matches(ENTERED).count(), said.matches(LEFT).count()), (1, 1), "{said}");
    let after = said.split(LEFT).last().expect("the end");
    assert!(after.contains(" icanon") && after.contains(" echo "), "single keys, no echo:\n{after}");
}

#[test]
fn the_view_stays_until_q_and_gives_the_terminal_back() {
    let folder = folder("watch-tui-quit");
    detections(&folder, 120);
    let Some(mut session) = Session::start(&folder, &format!("{}; stty -a", watch("--tui"))) else { return };
    session.wait_for("ended");
    session.wait_for("steady");
    session.press("\r");
    session.wait_for("ambiguity");
    session.press("q");
    is_given_back(&session.end());
}

#[test]
fn json_goes_to_its_file_while_the_view_is_drawn() {
    let folder = folder("watch-tui-json");
    detections(&folder, 80);
    let command = format!("{}; stty -a", watch("--tui --once --json > events.jsonl"));
    let Some(session) = Session::start(&folder, &command) else { return };
    is_given_back(&session.end());
    let text = std::fs::read_to_string(folder.join("events.jsonl")).expect("events");
    let events: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(events.last().expect("a verdict")["state"], "steady", "{text}");
}

#[test]
fn what_the_session_said_is_reported_when_the_view_is_closed() {
    let folder = folder("watch-tui-log");
    detections(&folder, 80);
    let command = format!("{}; stty -a", watch("--tui --once --save-reference cam.ref.toml"));
    let Some(session) = Session::start(&folder, &command) else { return };
    let said = session.end();
    is_given_back(&said);
    let after = said.split(LEFT).last().expect("the end");
    assert!(after.contains("is saved in cam.ref.toml") && after.contains("cam0: steady"), "{after}");
}

#[test]
fn a_terminated_session_gives_the_terminal_back() {
    let folder = folder("watch-tui-term");
    detections(&folder, 80);
    // Again and again, until nobody reads it.
    let lines = "while cat lines.jsonl; do sleep 0.2; done";
    let start = "sh -c 'echo $$ > pid; exec \"$@\"' sh";
    let command = format!("{}; stty -a", fed(lines, start, "--tui"));
    let Some(session) = Session::start(&folder, &command) else { return };
    session.wait_for("steady");
    let pid = std::fs::read_to_string(folder.join("pid")).expect("a process");
    assert!(Command::new("kill").arg(pid.trim()).status().expect("kill").success());
    is_given_back(&session.end());
}

#[test]
fn without_a_terminal_the_view_is_refused_by_name() {
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    let fixed = ["watch", "--camera", &camera, "--target", &target, "--source", "-"];
    let run = resight(&[&fixed[..], &["--tui"]].concat());
    assert_eq!(run.code, 2, "{}", run.stderr);
    assert!(run.stderr.contains("--tui needs a terminal") && run.stdout.is_empty(), "{}", run.stderr);
    let window = resight(&[&fixed[..], &["--tui-window", "5"]].concat());
    assert!(window.code == 2 && window.stderr.contains("--tui"), "{}", window.stderr);
}

#[test]
fn a_view_and_json_on_one_terminal_are_refused_by_name() {
    let folder = folder("watch-tui-both");
    detections(&folder, 1);
    let Some(session) = Session::start(&folder, &watch("--tui --json")) else { return };
    let said = session.end();
    assert!(said.contains("--tui and --json") && !said.contains(ENTERED), "{said}");
}
