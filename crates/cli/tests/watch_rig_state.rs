//! `watch --moving-target --state`: a rig's session that was killed continues where it stopped, as if nothing had been.

use crate::carried_support::{NAMES, carried_lines, rig_arguments, turned};
use crate::support::folder;
use crate::watch_support::{Session, start_with, text};
use nalgebra::Vector6;
use serde_json::{Value, json};
use std::path::Path;
use std::time::Duration;

const CAMERAS: usize = 3;
/// The machine may be slow: seconds of the wall must not count as seconds unseen.
const PATIENT: [&str; 2] = ["--stale-after-s", "1000"];

/// `east` moves suddenly after 12 s; `south` looks away now and then.
fn seen(frame_sets: usize, seed: u64) -> Vec<String> {
    let motion = |camera: usize, frame_set: usize| {
        let is_away = camera == 2 && (50..60).contains(&(frame_set % 100));
        let is_knocked = camera == 1 && 120 <= frame_set;
        (!is_away).then(|| if is_knocked { turned(1, 1.0) } else { Vector6::zeros() })
    };
    carried_lines(CAMERAS, frame_sets, seed, motion).lines().map(|line| format!("{line}\n")).collect()
}

fn begin(state: &Path, more: &[&str]) -> Session {
    // A folder for each state: tests that run side by side must not empty each other's.
    let name = state.parent().and_then(Path::file_name).expect("a folder").to_string_lossy();
    let rig = rig_arguments(&format!("{name}-files"), CAMERAS, false);
    let rig: Vec<&str> = rig.iter().map(String::as_str).collect();
    start_with(&[], &[&rig[..], &["--state", text(state)], more].concat())
}

fn run(state: &Path, input: &[String], more: &[&str]) -> Session {
    let mut session = begin(state, &[&["--once"], more].concat());
    session.feed(input);
    session.end();
    session
}

fn rig(state: &Path) -> Option<Value> {
    let text = std::fs::read_to_string(state).ok()?;
    let body: Value = serde_json::from_str(text.lines().nth(1)?).expect("JSON");
    body.get("rig").cloned()
}

/// Up to when each camera was heard, seconds.
fn heard_s(rig: &Value) -> Vec<f64> {
    let of = |camera: &Value| camera["last"][0].as_f64().unwrap_or(f64::NEG_INFINITY);
    rig["cameras"].as_array().expect("cameras").iter().map(of).collect()
}

/// What a detector says after that: each camera continues where it was heard.
fn rest(input: &[String], heard_s: &[f64]) -> Vec<String> {
    let is_new = |line: &&String| {
        let line: Value = serde_json::from_str(line).expect("JSON");
        let camera = NAMES.iter().position(|name| line["camera"] == *name).expect("a camera");
        Some(heard_s[camera]) < line["t_s"].as_f64()
    };
    input.iter().filter(is_new).cloned().collect()
}

/// States and what moved, after a time.
fn said(session: &Session, after_s: f64) -> Vec<Value> {
    let is_of_rig = |event: &Value| {
        (event["event"] == "state" && event["t_s"].as_f64() > Some(after_s)) || event["event"] == "verdict"
    };
    // A restart first tells how things stand after the pause, before any frame.
    let is_first = |event: &Value| event["event"] != "frame" && event["event"] != "verdict";
    session.events().into_iter().skip_while(is_first).filter(is_of_rig).collect()
}

/// Killed while it learns, watches, while an alarm is open and after it: every word and statistic is that of the session that was left alone.
#[test]
fn a_killed_rig_goes_on_as_if_nothing_had_been() {
    let folder = folder("rig-state-kill");
    let input = seen(200, 0x91);
    let alone = folder.join("alone.state");
    let whole = run(&alone, &input, &PATIENT);
    assert_eq!(whole.events().iter().filter(|event| event["event"] == "verdict").count(), 1 + CAMERAS);
    // The checkpoint somewhere on the way, or with all that was seen: then it learns, an alarm is open, or decided.
    for (killed_at, is_fresh) in [(25, true), (90, false), (123, true), (170, true)] {
        let state = folder.join(format!("{killed_at}.state"));
        let mut first = begin(&state, &PATIENT);
        // Frames come slowly, so that the checkpoint stands somewhere among them.
        for lines in input[..CAMERAS * killed_at].chunks(5 * CAMERAS) {
            first.feed(lines);
            std::thread::sleep(Duration::from_millis(40));
        }
        let from_s = if is_fresh { 0.1 * (killed_at - 2) as f64 - 0.01 } else { 0.0 };
        let connected = |rig: Value| Some(from_s) <= rig["last_s"].as_f64();
        first.wait_until("a checkpoint", |_| rig(&state).is_some_and(connected));
        first.kill();
        let waiting = rig(&state).expect("a state")["waiting"].as_array().expect("frames").len();
        assert!(!is_fresh || 0 < waiting, "the last frame set may not be whole yet");
        let heard_s = heard_s(&rig(&state).expect("a state"));
        let last_s = rig(&state).expect("a state")["last_s"].as_f64().expect("a time");
        let second = run(&state, &rest(&input, &heard_s), &PATIENT);
        assert!(second.log().contains("state: the rig continues from"), "{}", second.log());
        assert_eq!(said(&second, last_s), said(&whole, last_s), "killed at {killed_at}, from {last_s} s on");
        let (of_alone, of_second) = (rig(&alone).expect("a state"), rig(&state).expect("a state"));
        for key in ["stage", "first_s", "last_s", "waiting"] {
            assert_eq!(of_alone[key], of_second[key], "{key}, killed at {killed_at}");
        }
    }
}

fn learned(name: &str) -> (std::path::PathBuf, Vec<String>) {
    let (state, input) = (folder(name).join("rig.state"), seen(100, 0x92));
    let session = run(&state, &input, &PATIENT);
    assert!(said(&session, 1e9).iter().all(|verdict| verdict["state"] == "steady"), "{}", session.log());
    (state, input)
}

/// A recording read again says nothing of now, and changes nothing that is kept.
#[test]
fn frame_sets_taken_in_before_are_passed_over() {
    let (state, input) = learned("rig-state-again");
    let before = rig(&state).expect("a state");
    let again = run(&state, &input[150..], &PATIENT);
    let frames: Vec<Value> = again.events().into_iter().filter(|event| event["event"] == "frame").collect();
    assert_eq!(frames.len(), input.len() - 150);
    let is_old = |event: &Value| event["message"].as_str().is_some_and(|m| m.contains("taken before"));
    assert!(frames.iter().all(is_old), "{:?}", frames[0]);
    assert_eq!(rig(&state).expect("a state"), before);
}

#[test]
fn a_pause_of_a_rig_is_time_unseen() {
    let (state, input) = (folder("rig-state-pause").join("rig.state"), seen(100, 0x93));
    let brief = ["--stale-after-s", "2"];
    run(&state, &input, &brief);
    std::thread::sleep(Duration::from_millis(2200));
    // With nothing on stdin for a while, the clock continues.
    let mut after = begin(&state, &[&["--once"], &brief[..]].concat());
    after.wait_until("states", |session| CAMERAS <= session.events().len());
    std::thread::sleep(Duration::from_millis(500));
    after.end();
    let reported = after.events();
    assert_eq!(reported.iter().filter(|event| event["event"] == "verdict").count(), CAMERAS);
    let states = reported.iter().filter(|event| !event["state"].is_null());
    assert!(states.clone().all(|event| event["state"] == "stale"), "{reported:?}");
}

/// The program is there again, the detector is not.
#[test]
fn a_rig_that_sees_nothing_after_a_restart_becomes_unseen() {
    let (state, input) = (folder("rig-state-silent").join("rig.state"), seen(100, 0x95));
    let brief = ["--stale-after-s", "2"];
    run(&state, &input, &brief);
    let mut after = begin(&state, &brief);
    let unseen = |session: &Session| session.events().iter().filter(|e| e["state"] == "stale").count();
    after.wait_until("every camera stale", |session| unseen(session) == CAMERAS);
    after.end();
}

/// Three tenths of a second between frame sets, so that learning takes longer than a camera may stay stale.
#[test]
fn a_rig_that_was_learning_goes_on_learning() {
    let state = folder("rig-state-learning").join("rig.state");
    let slower = |line: &String| {
        let mut line: Value = serde_json::from_str(line).expect("JSON");
        line["t_s"] = json!(3.0 * line["t_s"].as_f64().expect("a time"));
        format!("{line}\n")
    };
    let input: Vec<String> = seen(60, 0x94).iter().map(slower).collect();
    let brief = ["--stale-after-s", "6"];
    run(&state, &input[..90], &brief);
    let after = run(&state, &input[90..], &brief);
    let states: Vec<String> =
        after.events().iter().filter_map(|event| event["state"].as_str().map(String::from)).collect();
    assert_eq!((&states[0], states.contains(&"stale".to_string())), (&"learning".to_string(), false));
    assert_eq!(states.last().map(String::as_str), Some("steady"));
}

#[test]
fn a_state_of_another_rig_is_refused_by_name() {
    let (state, input) = learned("rig-state-other");
    let other = run(&state, &input, &["--stale-after-s", "1000", "--sync-tolerance-s", "0.03"]);
    let words = "the rig begins anew: sync_tolerance_s was 0.02 and is 0.03";
    assert!(other.log().contains(words), "{}", other.log());
    let learning = other.events().into_iter().find(|event| event["event"] == "state").expect("a state");
    assert_eq!(learning["state"], json!("learning"));
}

/// As the system says it.
fn sha256(text: &str) -> String {
    let said = assert_cmd::Command::new("sha256sum").write_stdin(text).output().expect("coreutils");
    String::from_utf8_lossy(&said.stdout)[..64].to_string()
}

/// The file is whole, but what it says of the rig is not: said, and learned anew.
#[test]
fn a_spoilt_rig_begins_anew() {
    let (state, input) = learned("rig-state-spoilt");
    let text = std::fs::read_to_string(&state).expect("a state");
    let mut body: Value = serde_json::from_str(text.lines().nth(1).expect("two lines")).expect("JSON");
    body["rig"]["stage"]["watching"]["numbers"].as_array_mut().expect("numbers").pop();
    let body = body.to_string();
    let head = json!({"format": "resight watch state", "version": 1, "sha256": sha256(&body)});
    std::fs::write(&state, format!("{head}\n{body}\n")).expect("written");
    let again = run(&state, &input, &PATIENT);
    assert!(again.log().contains("the rig begins anew"), "{}", again.log());
    assert!(said(&again, 1e9).iter().all(|verdict| verdict["state"] == "steady"), "{}", again.log());
}
