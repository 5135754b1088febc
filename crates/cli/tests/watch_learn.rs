//! `watch` while it learns: a camera that moves meanwhile is reported, and its reference is learned from where it then stands, or not at all.

use crate::support::{demo, folder};
use assert_cmd::Command;
use nalgebra::Vector6;
use serde_json::{Value, json};
use std::path::Path;

struct Run {
    code: i32,
    events: Vec<Value>,
    text: String,
}

impl Run {
    fn of(&self, kind: &str) -> Vec<&Value> {
        self.events.iter().filter(|event| event["event"] == kind).collect()
    }

    fn states(&self) -> Vec<&str> {
        self.of("state").iter().map(|event| event["state"].as_str().expect("a word")).collect()
    }
}

fn run(arguments: &[&str], input: &str) -> Run {
    let output = Command::cargo_bin("resight")
        .expect("the program")
        .args(["watch", "--once", "--source", "-"])
        .args(arguments)
        .write_stdin(input)
        .output()
        .expect("it runs");
    let text = String::from_utf8(output.stdout).expect("text");
    let events = text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    Run { code: output.status.code().expect("an exit status"), events, text }
}

fn watch(more: &[&str], seconds: usize, seed: u64, moved: impl Fn(usize) -> Vector6<f64>) -> Run {
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    let input = crate::watch_support::lines(0..seconds, 1.0, seed, moved).concat();
    run(&[&["--camera", &camera, "--target", &target], more].concat(), &input)
}

fn pan(degrees: f64) -> Vector6<f64> {
    Vector6::new(0.0, f64::to_radians(degrees), 0.0, 0.0, 0.0, 0.0)
}

/// Half a degree after 25 of the 50 readings: reported with size and time, learned again from there, and a later sudden motion is found.
#[test]
fn a_camera_that_is_knocked_while_it_is_learned_is_reported_and_learned_again() {
    let history = folder("watch-learn").join("gate.sqlite");
    let more = ["--json", "--history", history.to_str().expect("a path")];
    let moved = |second: usize| {
        pan(if second < 25 {
            0.0
        } else if second < 110 {
            0.5
        } else {
            1.5
        })
    };
    let ended = watch(&more, 130, 0x1ea2, moved);
    let reported = ended.of("moved_while_learning");
    assert_eq!(reported.len(), 1, "{}", ended.text);
    assert_eq!((&reported[0]["how"], &reported[0]["reading"]), (&json!("step"), &json!(25)));
    assert_eq!((&reported[0]["began_s"], &reported[0]["alternatives"]), (&json!(25.0), &json!([])));
    let pan_rad = reported[0]["old_from_new"][1].as_f64().expect("a number");
    let sigma_rad = reported[0]["covariance"][1][1].as_f64().expect("a variance").sqrt();
    let error_rad = (pan_rad - f64::to_radians(0.5)).abs();
    assert!(error_rad < 4.0 * sigma_rad, "{pan_rad} ± {sigma_rad}");
    let message = reported[0]["message"].as_str().expect("words");
    assert!(message.contains("moved after reading 25") && message.contains("right 0.5"), "{message}");
    assert_eq!(ended.of("learned").len(), 1);
    assert_eq!((ended.code, &ended.states()[..4]), (3, &["learning", "steady", "checking", "drifted"][..]));
    assert_eq!(ended.of("verdict")[0]["moved_while_learning"], json!(true));
    let stored = rusqlite::Connection::open(&history).expect("the history");
    let events =
        "SELECT count(*) FROM event WHERE kind = 'moved_while_learning' AND detail LIKE '%reading 25%'";
    assert_eq!(stored.query_row(events, [], |row| row.get::<_, i64>(0)).expect("a count"), 1);
}

/// It is steady where it now stands, but it has moved: the exit status says so.
#[test]
fn a_session_whose_camera_moved_while_it_was_learned_does_not_end_as_if_nothing_had_been() {
    let ended = watch(&[], 100, 0x1ea3, |second| if second < 20 { Vector6::zeros() } else { pan(-1.0) });
    assert_eq!(ended.code, 3, "{}", ended.text);
    assert!(ended.text.contains("moved after reading 20 while its reference was learned"), "{}", ended.text);
    assert!(ended.text.ends_with("steady; it moved while its reference was learned\n"), "{}", ended.text);
}

/// A camera that turns on and on is never said to be steady, and the reason is reported.
#[test]
fn a_camera_that_keeps_moving_is_never_learned() {
    let ended = watch(&["--json"], 230, 0x1ea4, |second| pan(0.1 * second as f64));
    assert_eq!((ended.code, ended.states()), (3, vec!["learning"]), "{}", ended.text);
    let reported = ended.of("moved_while_learning");
    assert!(5 <= reported.len() && ended.of("learned").is_empty(), "{}", ended.text);
    assert!(reported.iter().all(|event| event["how"] == "ramp"), "{}", ended.text);
    assert!(reported[0]["message"].as_str().expect("words").contains("it is not learned while it moves"));
    assert_eq!(ended.of("verdict")[0]["state"], "learning");
}

/// To and fro over a degree: that is neither a step nor a ramp, and no reference.
#[test]
fn a_camera_that_sways_is_not_learned_until_that_is_stated() {
    let sway = |second: usize| pan(1.0 * (second as f64 / 12.0).sin());
    let ended = watch(&["--json"], 60, 0x1ea5, sway);
    assert_ne!(ended.code, 0, "{}", ended.text);
    assert_eq!(ended.states(), ["learning"]);
    assert!(!ended.of("moved_while_learning").is_empty());
    let stated = watch(&["--json", "--correlated-deg", "1", "--correlated-mm", "20"], 60, 0x1ea5, sway);
    assert_eq!((stated.code, stated.states()), (0, vec!["learning", "steady"]), "{}", stated.text);
}

/// The shipped recording of three cameras, of which `middle` turns by 0.8° after 8 s, watched with these words in the place of its rig.
fn shipped(rig: &str) -> Run {
    let file = |name: &str| {
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../../testdata/watch_rig")
            .join(name)
            .display()
            .to_string()
    };
    let rig = rig.replace('@', &file("rig.toml"));
    let input = std::fs::read_to_string(file("seen.jsonl")).expect("the recording");
    run(&["--rig", &rig, "--target", &file("board.toml"), "--moving-target", "--json"], &input)
}

/// The default learns the noise from 50 moments, across the rotation: the places are known, and the camera that moved is named all the same.
#[test]
fn the_shipped_example_names_the_camera_with_the_default_settings() {
    let ended = shipped("@");
    let moved = ended.of("moved");
    assert!(
        !moved.is_empty() && moved.iter().all(|event| event["moved"] == json!(["middle"])),
        "{}",
        ended.text
    );
    let is_drifted = |event: &&Value| event["event"] == "state" && event["state"] == "drifted";
    let drifted = ended.events.iter().find(is_drifted).expect("a drift");
    assert_eq!((&drifted["camera"], &drifted["began_s"]), (&json!("middle"), &json!(8.0)));
    assert_eq!(ended.code, 3);
}

/// Where the places are learned too, the rotation amid them is reported, and nothing is called steady.
#[test]
fn the_shipped_example_is_reported_to_have_moved_while_its_places_were_learned() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/watch_rig/rig.toml");
    let known = std::fs::read_to_string(file).expect("the rig");
    let unknown: String = known
        .lines()
        .map(|line| match line.split_once(", covariance = ") {
            Some((before, _)) => format!("{before} }}\n"),
            None => format!("{line}\n"),
        })
        .collect();
    assert_ne!(known, unknown);
    let rig = folder("watch-learn-rig").join("rig.toml");
    std::fs::write(&rig, unknown).expect("written");
    let ended = shipped(rig.to_str().expect("a path"));
    let reported = ended.of("moved_while_learning");
    assert_eq!(reported.len(), 1, "{}", ended.text);
    assert_eq!((&reported[0]["camera"], &reported[0]["how"]), (&json!("middle"), &json!("step")));
    assert_eq!(&reported[0]["alternatives"], &json!([]));
    assert!((40..=41).contains(&reported[0]["reading"].as_u64().expect("a count")), "{}", reported[0]);
    let pan_deg = reported[0]["old_from_new"][1].as_f64().expect("a number").to_degrees();
    assert!((pan_deg - 0.8).abs() < 0.4, "{pan_deg}°");
    assert_eq!(ended.code, 3);
    assert!(!ended.states().contains(&"steady"), "{}", ended.text);
}
