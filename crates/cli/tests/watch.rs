//! `watch`: detections in, states out; what moved is said with its direction, its size and its time.

use crate::rig_support::SIGMA_PX;
use crate::support::{demo, folder};
use assert_cmd::Command;
use nalgebra::Vector6;
use serde_json::{Value, json};

/// The dots seen once a second by a camera whose motion is given for each second, as lines of JSON.
fn lines(seconds: std::ops::Range<usize>, seed: u64, old_from_new: impl Fn(usize) -> Vector6<f64>) -> String {
    crate::watch_support::lines(seconds, 1.0, seed, old_from_new).concat()
}

struct Run {
    code: i32,
    events: Vec<Value>,
    stderr: String,
}

fn watch(input: &str, arguments: &[&str]) -> Run {
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    let fixed = ["watch", "--camera", &camera, "--target", &target, "--once", "--json"];
    let run = Command::cargo_bin("resight")
        .expect("the program")
        .args(fixed)
        .args(arguments)
        .write_stdin(input)
        .output()
        .expect("it runs");
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("text");
    let events = text(&run.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    Run { code: run.status.code().expect("an exit status"), events, stderr: text(&run.stderr) }
}

fn states(run: &Run) -> Vec<&str> {
    run.events
        .iter()
        .filter(|e| e["event"] == "state")
        .map(|e| e["state"].as_str().expect("a word"))
        .collect()
}

fn pan(degrees: f64) -> Vector6<f64> {
    Vector6::new(0.0, f64::to_radians(degrees), 0.0, 0.0, 0.0, 0.0)
}

#[test]
fn a_camera_that_stays_is_steady() {
    let run = watch(&lines(0..300, 0x51, |_| Vector6::zeros()), &["--source", "-"]);
    assert_eq!((run.code, states(&run)), (0, vec!["learning", "steady"]), "{}", run.stderr);
}

#[test]
fn a_turned_camera_is_found_with_direction_size_and_time() {
    let turned = |second| if second < 200 { Vector6::zeros() } else { pan(0.5) };
    let run = watch(&lines(0..300, 0x52, turned), &["--source", "-"]);
    assert_eq!(run.code, 3, "{}", run.stderr);
    let drifted =
        run.events.iter().rfind(|e| e["state"] == "drifted" && e["event"] == "state").expect("a drift");
    let first =
        run.events.iter().find(|e| e["state"] == "drifted" && e["event"] == "state").expect("a drift");
    let reported = first["pure_rotation_rad"][1].as_f64().expect("it only turned").to_degrees();
    assert!((reported - 0.5).abs() < 0.1, "told first: {first}");
    let rotation_rad = drifted["old_from_new"][1].as_f64().expect("a number");
    let sigma_rad = drifted["covariance"][1][1].as_f64().expect("a number").sqrt();
    assert!((rotation_rad - 0.5_f64.to_radians()).abs() < 4.0 * sigma_rad, "{drifted}");
    assert!((drifted["began_s"].as_f64().expect("a time") - 200.0).abs() <= 3.0, "{drifted}");
    let turned = drifted["pure_rotation_rad"][1].as_f64().expect("it only turned").to_degrees();
    let sigma = drifted["pure_rotation_sigma_rad"][1].as_f64().expect("a number").to_degrees();
    assert!((turned - 0.5).abs() < 4.0 * sigma && sigma < 0.05, "{turned}° ± {sigma}°");
    let message = drifted["message"].as_str().expect("words");
    assert!(message.contains("right 0.") && message.contains("to put it back: left 0."), "{message}");
}

#[test]
fn a_saved_reference_is_watched_from_the_first_frame() {
    let file = folder("watch-reference").join("left.ref.toml");
    let file = file.to_str().expect("a path");
    let learned =
        watch(&lines(0..100, 0x53, |_| Vector6::zeros()), &["--source", "-", "--save-reference", file]);
    assert_eq!(learned.code, 0, "{}", learned.stderr);
    let same = watch(&lines(0..100, 0x54, |_| Vector6::zeros()), &["--source", "-", "--reference", file]);
    assert_eq!((same.code, same.events.last().expect("a verdict")["state"].as_str()), (0, Some("steady")));
    let moved = watch(&lines(0..100, 0x55, |_| pan(1.0)), &["--source", "-", "--reference", file]);
    assert_eq!(moved.code, 3, "{}", moved.stderr);
}

#[test]
fn bad_lines_are_named_and_the_rest_goes_on() {
    let mut input = lines(0..60, 0x56, |_| Vector6::zeros());
    input += "{\"t_s\": 60}\nnot JSON\n{\"camera\": \"right\", \"t_s\": 61.0, \"detections\": []}\n";
    input += &lines(62..90, 0x57, |_| Vector6::zeros());
    let run = watch(&input, &["--source", "-", "--frames"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let said: Vec<&str> = run.events.iter().filter_map(|e| e["message"].as_str()).collect();
    for (line, reason) in
        [("line 61", "detections"), ("line 62", "expected"), ("line 63", "no camera is called")]
    {
        assert!(said.iter().any(|s| s.contains(line) && s.contains(reason)), "{line}: {said:?}");
    }
}

/// Small motions that come back by themselves are reported until two are known: then the session states what it holds, and for how long.
#[test]
fn motions_that_come_back_by_themselves_are_held_and_stated() {
    let disturbed = |second| if second % 600 < 540 { Vector6::zeros() } else { pan(0.15) };
    let run = watch(&lines(0..7200, 0x58, disturbed), &["--source", "-"]);
    let held = run.events.iter().rfind(|e| !e["detectable"]["held"].is_null()).expect("a statement");
    let of = &held["detectable"]["held"];
    assert!(2 <= of["count"].as_u64().expect("a count"), "{held}");
    let held_s = of["held_s"].as_f64().expect("a time");
    assert!((100.0..200.0).contains(&held_s), "twice a minute: {held}");
    let held_deg = of["rotation_rad"][1].as_f64().expect("an angle").to_degrees();
    assert!(0.15 < held_deg, "{held}");
    assert!(held["message"].as_str().expect("words").contains("came back by themselves"), "{held}");
    let of_later = |e: &&Value| e["state"] == "drifted" && 3600.0 < e["t_s"].as_f64().unwrap_or(0.0);
    assert_eq!(run.events.iter().filter(|e| e["event"] == "state").filter(of_later).count(), 0);
    assert_ne!(run.code, 3, "{}", run.stderr);
}

/// The middle dot is not on the line, as the target's file says it is: that is reported while the reference is being learned, and never learned as one.
#[test]
fn a_wrong_target_is_reported_while_learning() {
    let shifted = |line: &str| {
        let mut frame: Value = serde_json::from_str(line).expect("JSON");
        let v_px = frame["detections"][1]["v_px"].as_f64().expect("a pixel");
        frame["detections"][1]["v_px"] = json!(v_px + 40.0 * SIGMA_PX);
        format!("{frame}\n")
    };
    let input: String = lines(0..100, 0x57, |_| Vector6::zeros()).lines().map(shifted).collect();
    let run = watch(&input, &["--source", "-"]);
    assert_eq!((run.code, states(&run)), (1, vec!["learning", "inconsistent"]), "{}", run.stderr);
}

/// A frozen stream sends its last image again and again: that is no reading.
#[test]
fn a_frozen_camera_is_not_steady() {
    let pictures = folder("watch-frozen");
    for i in 0..30 {
        std::fs::copy(demo("left.png"), pictures.join(format!("{i:03}.png"))).expect("copied");
    }
    let pattern = pictures.join("*.png");
    let run = watch("", &["--source", pattern.to_str().expect("a path"), "--period-s", "1", "--frames"]);
    assert_eq!(run.code, 1, "{}", run.stderr);
    assert!(run.events.iter().any(|e| e["message"].as_str().is_some_and(|m| m.contains("frozen"))));
    let as_folder =
        watch("", &["--source", pictures.to_str().expect("a path"), "--period-s", "1", "--frames"]);
    assert_eq!((as_folder.code, as_folder.events.len()), (1, run.events.len()));
}

#[test]
fn nothing_seen_is_not_steady_and_wrong_names_are_reported() {
    assert_eq!(watch("", &["--source", "-"]).code, 1);
    let wrong = watch("", &["--source", "gate=nowhere"]);
    assert_eq!(wrong.code, 2);
    let few = watch("", &["--source", "-", "--learn", "5"]);
    assert!(few.stderr.contains("at least 20 readings"), "{}", few.stderr);
}

/// Every second of the second half is stamped an hour early: it is said, and the sudden motion after that is found.
#[test]
fn a_clock_that_goes_back_is_said_and_watching_goes_on() {
    let turned = |second| if second < 150 { Vector6::zeros() } else { pan(0.5) };
    let mut input = lines(0..100, 0x58, turned);
    for line in lines(100..200, 0x59, turned).lines() {
        let mut object: Value = serde_json::from_str(line).expect("JSON");
        object["t_s"] = json!(object["t_s"].as_f64().expect("a time") - 3600.0);
        input += &format!("{object}\n");
    }
    let run = watch(&input, &["--source", "-"]);
    assert_eq!(run.code, 3, "{}", run.stderr);
    let clock: Vec<&Value> = run.events.iter().filter(|e| e["event"] == "clock").collect();
    assert!(
        clock.len() == 1 && clock[0]["step_s"].as_f64().is_some_and(|s| (s + 3600.0).abs() < 1.0),
        "{clock:?}"
    );
    let drift = run.events.iter().find(|e| e["state"] == "drifted").expect("a drift");
    assert!((drift["began_s"].as_f64().expect("a time") - 150.0).abs() <= 3.0, "{drift}");
}

/// On a moving camera nothing drifts: it is followed while it is seen.
#[test]
fn a_moving_camera_is_followed() {
    let way = |second: usize| pan(0.05 * second as f64);
    let run = watch(&lines(0..100, 0x5a, way), &["--source", "-", "--motion", "moving"]);
    assert_eq!((run.code, states(&run)), (0, vec!["tracking"]), "{}", run.stderr);
    let mixed = watch("", &["--source", "-", "--motion", "moving", "--rotation-noise-deg-per-sqrt-s", "1"]);
    assert!(
        mixed.code == 2 && mixed.stderr.contains("--acceleration-noise-deg-per-s-sqrt-s"),
        "{}",
        mixed.stderr
    );
    let fixed = watch("", &["--source", "-", "--acceleration-noise-mm-per-s-sqrt-s", "1"]);
    assert!(fixed.code == 2 && fixed.stderr.contains("--position-noise-mm-per-sqrt-s"), "{}", fixed.stderr);
}

/// A blind camera is reported as such from the start; seen again, it continues learning.
#[test]
fn a_camera_that_sees_nothing_does_not_learn() {
    let blind = |t_s: std::ops::Range<u32>| {
        t_s.map(|t_s| format!("{{\"t_s\": {t_s}, \"detections\": []}}\n")).collect::<String>()
    };
    let never = watch(&blind(0..20), &["--source", "-"]);
    assert_eq!((never.code, states(&never)), (1, vec!["learning", "stale"]), "{}", never.stderr);
    let seen = |t_s| lines(t_s, 0x5a, |_| Vector6::zeros());
    let input = [seen(0..20), blind(20..40), seen(40..90)].concat();
    let again = watch(&input, &["--source", "-"]);
    assert_eq!(
        (again.code, states(&again)),
        (0, vec!["learning", "stale", "learning", "steady"]),
        "{}",
        again.stderr
    );
}

/// A sudden motion in the last second cannot be identified yet, so the state is not "all is well".
#[test]
fn a_camera_that_settles_at_the_end_is_not_answered() {
    let knocked = |second: usize| if second < 100 { Vector6::zeros() } else { pan(1.0) };
    let run = watch(&lines(0..102, 0x5b, knocked), &["--source", "-"]);
    assert_eq!(states(&run).last(), Some(&"checking"), "{}", run.stderr);
    let verdict = run.events.last().expect("a verdict");
    assert_eq!((run.code, &verdict["state"]), (1, &json!("checking")), "{verdict}");
    assert_eq!((&verdict["camera"], &verdict["target"]), (&json!("cam0"), &json!("target0")), "{verdict}");
}

#[test]
fn what_does_not_go_together_is_refused_by_name() {
    let named = |kind: &str, name: &str| format!("{name}={}", demo(kind));
    let [gate, twice] = ["dots.toml", "dots.toml"].map(|file| named(file, "cam0"));
    for (arguments, words) in [
        (vec!["--motion", "moving", "--landmarks", "a.png"], "leave --landmarks and --save-landmarks out"),
        (vec!["--target", &gate], "are called cam0"),
        (vec!["--target", &gate, "--target", &twice], "are called cam0"),
        (
            vec!["--save-reference", "no/such/folder/a.toml"],
            "--save-reference no/such/folder/a.toml: there is no folder",
        ),
        (vec!["--lost-after-s", "1e20"], "a positive number of seconds is needed"),
    ] {
        let run = watch("", &[&["--source", "-"], arguments.as_slice()].concat());
        assert!(run.code == 2 && run.stderr.contains(words), "{arguments:?}: {}", run.stderr);
    }
}
