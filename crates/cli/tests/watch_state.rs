//! `watch --state`: a session that was killed continues where it stopped, as if nothing had been.

use crate::support::folder;
use crate::watch_support::{Session, lines, start, still, text};
use nalgebra::Vector6;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Rotated by 0.5° after 200 s.
fn knocked(second: usize) -> Vector6<f64> {
    let turn = if second < 200 { 0.0 } else { f64::to_radians(0.5) };
    Vector6::new(0.0, turn, 0.0, 0.0, 0.0, 0.0)
}

/// The machine may be slow: seconds of the wall must not count as seconds unseen.
const PATIENT: [&str; 2] = ["--stale-after-s", "1000"];

fn run(state: &Path, input: &[String], more: &[&str]) -> Session {
    let arguments: Vec<&str> =
        ["--state", text(state), "--once"].into_iter().chain(more.iter().copied()).collect();
    let mut session = start(&[], &arguments);
    session.feed(input);
    session.end();
    session
}

/// The state of the only camera.
fn camera(state: &Path) -> Option<Value> {
    let text = std::fs::read_to_string(state).ok()?;
    let body: Value = serde_json::from_str(text.lines().nth(1)?).expect("JSON");
    Some(body["cameras"][0].clone())
}

/// What frames and states say, without what depends on the machine or counts lines.
fn said(session: &Session, after_s: f64) -> Vec<Value> {
    let is_of_frames = |event: &Value| {
        (event["event"] == "frame" || event["event"] == "state") && event["t_s"].as_f64() > Some(after_s)
    };
    let clean = |mut event: Value| {
        for key in ["times_us", "number", "name"] {
            event[key] = json!(null);
        }
        event
    };
    // A restart first tells how things stand after the pause, before any frame.
    let from_first_frame = session.events().into_iter().skip_while(|event| event["event"] != "frame");
    from_first_frame.filter(is_of_frames).map(clean).collect()
}

/// Killed while it learns, watches, and after the alarm: every pose, word and statistic from the checkpoint on is that of the session that
/// was left alone.
#[test]
fn a_killed_session_goes_on_as_if_nothing_had_been() {
    let folder = folder("state-kill");
    let input = lines(0..300, 1.0, 0x81, knocked);
    let alone = folder.join("alone.state");
    let whole = run(&alone, &input, &PATIENT);
    for killed_at in [30, 150, 260] {
        let state = folder.join(format!("{killed_at}.state"));
        let arguments = ["--state", text(&state), PATIENT[0], PATIENT[1]];
        let mut first = start(&[], &arguments);
        // Frames come slowly, so that the checkpoint stands somewhere among them.
        for line in input[..killed_at].chunks(10) {
            first.feed(line);
            std::thread::sleep(Duration::from_millis(20));
        }
        first.wait_until("a checkpoint", |_| camera(&state).is_some());
        first.kill();
        let last_s = camera(&state).expect("a state")["last_s"].as_f64().expect("a time");
        let rest = &input[last_s as usize + 1..];
        let second = run(&state, rest, &PATIENT);
        assert!(second.log().contains("state: cam0 continues from"), "{}", second.log());
        let (wanted, got) = (said(&whole, last_s), said(&second, last_s));
        assert!(rest.len() <= got.len());
        assert_eq!(got, wanted, "killed at {killed_at}, from {last_s} s on");
        let (of_alone, of_second) = (camera(&alone).expect("a state"), camera(&state).expect("a state"));
        assert_eq!(of_alone["pairs"], of_second["pairs"], "the statistics");
        let verdict = |session: &Session| session.events().last().expect("a verdict")["state"].clone();
        assert_eq!((verdict(&second), verdict(&whole)), (json!("drifted"), json!("drifted")));
    }
}

/// The checkpoint follows the frames within a second; ten on a loaded machine.
#[test]
fn the_checkpoint_is_fresh() {
    let state = folder("state-fresh").join("gate.state");
    let mut session = start(&[], &["--state", text(&state)]);
    for (i, line) in lines(0..60, 1.0, 0x82, still).chunks(20).enumerate() {
        session.feed(line);
        let last_s = (20 * (i + 1) - 1) as f64;
        session.wait_until("the checkpoint", |_| camera(&state).is_some_and(|c| c["last_s"] == last_s));
    }
    session.kill();
}

fn learned(name: &str) -> PathBuf {
    let state = folder(name).join("gate.state");
    let session = run(&state, &lines(0..100, 1.0, 0x83, still), &PATIENT);
    assert_eq!(session.events().last().expect("a verdict")["state"], "steady");
    state
}

#[test]
fn a_pause_is_time_unseen() {
    let state = learned("state-pause");
    std::thread::sleep(Duration::from_millis(300));
    // The settings of a state include this one, so it is learned with it first.
    let arguments = ["--stale-after-s", "0.2"];
    let again = run(&state, &lines(100..160, 0.01, 0x84, still), &arguments);
    assert!(again.log().contains("stale_after_s was 1000 and is 0.2"), "{}", again.log());
    std::thread::sleep(Duration::from_millis(300));
    let after = run(&state, &[], &arguments);
    let first = after.events().into_iter().find(|event| event["event"] == "state").expect("a state");
    assert_eq!(first["state"], "stale");
    assert!(0.3 <= first["for_s"].as_f64().expect("a time"), "{first}");
    assert_eq!(after.events().last().expect("a verdict")["state"], "stale");
}

/// All that the folder holds was there before: nothing is known of now, but what the clock says.
#[test]
fn frames_taken_in_before_are_passed_over() {
    let state = learned("state-again");
    let before = camera(&state).expect("a state");
    let mut again = start(&[], &["--state", text(&state), "--once", PATIENT[0], PATIENT[1]]);
    again.feed(&lines(50..100, 1.0, 0x83, still));
    assert_eq!(again.end(), 0, "{}", again.log());
    let frames: Vec<Value> = again.events().into_iter().filter(|event| event["event"] == "frame").collect();
    assert_eq!(frames.len(), 50);
    for frame in frames {
        assert!(
            frame["message"].as_str().is_some_and(|words| words.contains("taken before 99.000 s")),
            "{frame}"
        );
    }
    let after = camera(&state).expect("a state");
    for key in ["pairs", "last_s", "last_unix_s"] {
        assert_eq!(after[key], before[key], "{key}");
    }
}

/// The camera died yesterday, and its folder is looked through every night.
#[test]
fn frames_taken_in_before_do_not_make_a_blind_camera_steady() {
    let state = folder("state-blind").join("gate.state");
    let blind = ["--stale-after-s", "1"];
    let first = run(&state, &lines(0..100, 0.05, 0x88, still), &blind);
    assert_eq!(first.events().last().expect("a verdict")["state"], "steady");
    for _ in 0..2 {
        std::thread::sleep(Duration::from_millis(1200));
        let mut again = start(&[], &["--state", text(&state), "--once", blind[0], blind[1]]);
        again.feed(&lines(0..100, 0.05, 0x88, still));
        assert_eq!(again.end(), 1, "{}", again.log());
        let states: Vec<Value> = again.events().into_iter().filter(|e| e["event"] == "state").collect();
        assert!(states.iter().all(|event| event["state"] == "stale"), "{states:?}");
        assert_eq!(again.events().last().expect("a verdict")["state"], "stale");
    }
}

#[test]
fn a_state_of_something_else_is_refused_by_name() {
    for (more, words) in [
        (["--tolerance-deg", "0.1"], "tolerance_rotation_rad was 0 and is 0.0017"),
        (["--correlated-deg", "0.02"], "bias was"),
        (["--learn", "60"], "learn_readings was 50 and is 60"),
    ] {
        let state = learned("state-else");
        let arguments: Vec<&str> = PATIENT.into_iter().chain(more).collect();
        let session = run(&state, &lines(100..170, 1.0, 0x85, still), &arguments);
        assert!(session.log().contains("state: cam0 with target0 begins anew"), "{}", session.log());
        assert!(session.log().contains(words), "{words}: {}", session.log());
        let states: Vec<Value> = session.events().into_iter().filter(|e| e["event"] == "state").collect();
        assert_eq!(states[0]["state"], "learning");
    }
}

#[test]
fn a_damaged_state_is_put_aside() {
    let good = std::fs::read_to_string(learned("state-good")).expect("read");
    let spoilt = |from: &str, to: &str| {
        assert!(good.contains(from), "{from}");
        good.replacen(from, to, 1)
    };
    let cases = [
        ("empty", String::new(), "is damaged"),
        ("torn", good[..good.len() / 2].to_string(), "SHA-256"),
        ("flipped", spoilt("\"last_s\":99.0", "\"last_s\":98.0"), "SHA-256"),
        ("newer", spoilt("\"version\":1,", "\"version\":2,"), "was written in version 2"),
        ("zeros", "\0".repeat(500), "is damaged"),
        ("cut", good[..20].to_string(), "is damaged"),
    ];
    for (name, text, words) in cases {
        let folder = folder(&format!("state-damaged-{name}"));
        let state = folder.join("gate.state");
        std::fs::write(&state, &text).expect("written");
        let session = run(&state, &lines(0..60, 1.0, 0x86, still), &PATIENT);
        assert!(session.log().contains(words), "{name}: {}", session.log());
        let aside =
            std::fs::read_dir(&folder).expect("the folder").map(|entry| entry.expect("an entry").path());
        let aside: Vec<PathBuf> = aside.filter(|path| path.to_string_lossy().contains(".corrupt-")).collect();
        assert_eq!(aside.len(), 1, "{name}");
        assert_eq!(std::fs::read_to_string(&aside[0]).expect("read"), text);
        assert_eq!(camera(&state).expect("a new state")["last_s"], 59.0);
    }
}

/// Somebody's own file, named by mistake, stays as it is; so does one whose name is that of the claim.
#[test]
fn a_file_that_is_no_state_is_left_alone() {
    let folder = folder("state-mistaken");
    let (gate, lock) = (folder.join("gate.toml"), folder.join("gate.toml.lock"));
    for text in ["model = \"pinhole\"\n", "{\"format\": \"x\"}\n{}\n"] {
        std::fs::write(&gate, text).expect("written");
        let mut session = start(&[], &["--state", gate.to_str().expect("a path"), "--once"]);
        assert_eq!(session.end(), 2);
        assert!(session.log().contains("gate.toml: is no state of a session"), "{}", session.log());
        assert_eq!(std::fs::read_to_string(&gate).expect("read"), text);
        assert_eq!(std::fs::read_dir(&folder).expect("the folder").count(), 1, "nothing else is there");
    }
    std::fs::remove_file(&gate).expect("removed");
    std::fs::write(&lock, "mine").expect("written");
    run(&gate, &lines(0..5, 1.0, 0x89, still), &PATIENT);
    assert_eq!(std::fs::read_to_string(&lock).expect("read"), "mine");
}

#[test]
fn a_state_in_no_folder_is_refused() {
    let state = folder("state-nowhere").join("no/gate.state");
    let mut session = start(&[], &["--state", text(&state), "--once"]);
    assert_eq!(session.end(), 2);
    assert!(session.log().contains("there is no folder"), "{}", session.log());
}

/// The first continues; a killed one leaves no claim.
#[test]
fn a_state_in_use_is_refused() {
    let state = folder("state-shared").join("gate.state");
    let mut first = start(&[], &["--state", text(&state)]);
    first.feed(&lines(0..20, 1.0, 0x87, still));
    first.wait_until("a checkpoint", |_| camera(&state).is_some());
    let mut second = start(&[], &["--state", text(&state), "--once"]);
    assert_eq!(second.end(), 2);
    assert!(second.log().contains("is used by another session"), "{}", second.log());
    first.kill();
    let third = run(&state, &lines(20..60, 1.0, 0x87, still), &PATIENT[..0]);
    assert!(third.log().contains("continues from"), "{}", third.log());
}
