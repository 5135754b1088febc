//! `watch` with several cameras and targets: what moved is named, and what only looks like a motion is not one.

use crate::carried_support::{NAMES, cam_from_rig, carried_lines, lens, rig_arguments, turned};
use crate::rig_support::{Chance, SIGMA_PX};
use crate::support::folder;
use assert_cmd::Command;
use nalgebra::Vector6;
use resight::core::{Point, Pose, Target};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::Path;

struct Run {
    code: i32,
    events: Vec<Value>,
    stderr: String,
}

impl Run {
    fn moved(&self) -> Vec<&Value> {
        self.events.iter().filter(|e| e["event"] == "moved").collect()
    }

    /// The verdict on a camera, or on a `camera/target`.
    fn last(&self, pair: &str) -> &str {
        let (camera, target) =
            pair.split_once('/').map_or((pair, None), |(camera, target)| (camera, Some(target)));
        let is_its = |e: &&Value| {
            e["event"] == "verdict"
                && e["camera"] == camera
                && target.is_none_or(|target| e["target"] == target)
        };
        self.events.iter().find(is_its).and_then(|e| e["state"].as_str()).expect("a verdict")
    }
}

fn watch(arguments: &[String], input: &str) -> Run {
    let run = Command::cargo_bin("resight")
        .expect("the program")
        .args(["watch", "--once", "--json", "--source", "-"])
        .args(arguments)
        .write_stdin(input)
        .output()
        .expect("it runs");
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("text");
    let events = text(&run.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    Run { code: run.status.code().expect("an exit status"), events, stderr: text(&run.stderr) }
}

#[test]
fn a_rig_that_stays_is_steady_learned_or_from_its_file() {
    for is_certain in [true, false] {
        let mut arguments = rig_arguments(&format!("watch-rig-stays-{is_certain}"), 4, is_certain);
        let history = folder(&format!("watch-rig-history-{is_certain}")).join("rig.sqlite");
        arguments.extend(["--history".to_string(), history.display().to_string()]);
        let run = watch(&arguments, &carried_lines(4, 150, 0x21, |_, _| Some(Vector6::zeros())));
        assert_eq!((run.code, run.moved().len()), (0, 0), "{:?}{}", run.moved(), run.stderr);
        let stored = rusqlite::Connection::open(&history).expect("the history");
        let with_pose =
            "SELECT count(*) FROM frame WHERE readings = 1 AND rms_px < 1 AND covariance IS NOT NULL";
        let n: i64 = stored.query_row(with_pose, [], |row| row.get(0)).expect("a count");
        assert_eq!(n, 600, "each frame keeps the pose of the target that is hand-held");
    }
}

#[test]
fn the_camera_that_moved_is_named() {
    for camera in 0..4 {
        let arguments = rig_arguments(&format!("watch-rig-moves-{camera}"), 4, true);
        let motion = turned(camera % 3, 1.0);
        let moved =
            |i, frame_set| Some(if i == camera && 60 <= frame_set { motion } else { Vector6::zeros() });
        let run = watch(&arguments, &carried_lines(4, 100, 0x31, moved));
        assert_eq!(run.code, 3, "{}", run.stderr);
        for event in run.moved() {
            assert_eq!(event["moved"], json!([NAMES[camera]]), "{event}");
        }
        for (i, name) in NAMES.iter().enumerate() {
            assert_eq!(run.last(name), if i == camera { "drifted" } else { "steady" }, "{name}");
        }
        let state =
            run.events.iter().rfind(|e| e["event"] == "state" && e["state"] == "drifted").expect("told");
        let turn = state["old_from_new"][camera % 3].as_f64().expect("a number").to_degrees();
        let sigma =
            state["covariance"][camera % 3][camera % 3].as_f64().expect("a number").sqrt().to_degrees();
        assert!((turn - 1.0).abs() < 4.0 * sigma && sigma < 0.2, "{turn}° ± {sigma}°");
        let began_s = state["began_s"].as_f64().expect("a time");
        assert!((began_s - 6.0).abs() < 0.5, "{began_s}");
    }
}

#[test]
fn a_camera_that_moved_before_the_start_is_found_against_the_file() {
    let arguments = rig_arguments("watch-rig-before", 4, true);
    let moved = |i, _| Some(if i == 2 { turned(1, 2.0) } else { Vector6::zeros() });
    let run = watch(&arguments, &carried_lines(4, 80, 0x41, moved));
    assert_eq!((run.code, run.last("south")), (3, "drifted"), "{:?}", run.moved());
}

#[test]
fn of_two_cameras_either_may_have_moved() {
    let arguments = rig_arguments("watch-rig-two", 2, true);
    let moved =
        |i, frame_set| Some(if i == 0 && 60 <= frame_set { turned(1, 2.0) } else { Vector6::zeros() });
    let run = watch(&arguments, &carried_lines(2, 100, 0x51, moved));
    assert_eq!(run.code, 3, "{}", run.stderr);
    for event in run.moved() {
        let message = event["message"].as_str().expect("words");
        assert!(
            message.contains("one of") && message.contains("north") && message.contains("east"),
            "{message}"
        );
    }
    assert!(["north", "east"].iter().all(|name| run.last(name) != "drifted"));
}

#[test]
fn flips_people_and_darkness_are_no_motion() {
    let arguments = rig_arguments("watch-rig-nuisances", 4, true);
    let flip = Vector6::new(0.5, -0.4, 0.3, 0.2, 0.1, 0.4);
    let seen = |i, frame_set| match (i, frame_set) {
        // A pose of another branch; a person before two cameras; the light off; a wrong frame set of one camera after the other.
        (1, 50) | (2, 70) | (3, 71) => Some(flip),
        (0 | 1, 80..=95) => None,
        (_, 100..=110) => None,
        _ => Some(Vector6::zeros()),
    };
    let run = watch(&arguments, &carried_lines(4, 150, 0x61, seen));
    assert_eq!((run.code, run.moved().len()), (0, 0), "{:?}{}", run.moved(), run.stderr);
}

#[test]
fn a_blind_camera_of_a_rig_is_unseen() {
    let arguments = rig_arguments("watch-rig-blind", 4, true);
    let seen = |i, frame_set| (i != 3 || frame_set < 60).then(Vector6::zeros);
    let run = watch(&arguments, &carried_lines(4, 150, 0x71, seen));
    assert_eq!((run.code, run.last("west"), run.last("north")), (1, "stale", "steady"), "{}", run.stderr);
}

/// A board of five tags whose numbers begin with `first`, as a file.
fn tags(first: usize) -> String {
    let place = |i: usize| [0.12 * (i % 3) as f64, 0.12 * (i / 3) as f64, 0.02 * (i % 2) as f64];
    let tag = |i: usize| {
        format!(
            "[[tag]]\nid = {}\nsize_m = 0.08\nworld_from_tag = {{ rotation_wxyz = [1.0, 0.0, 0.0, 0.0], translation_m = {:?} }}\n",
            first + i,
            place(i)
        )
    };
    "kind = \"tag_map\"\nfamily = \"tag36h11\"\n".to_string() + &(0..5).map(tag).collect::<String>()
}

const BOARDS: [(&str, usize); 2] = [("door", 0), ("wall", 10)];

/// Boards that stand still, seen once a second; a line of a camera has the corners of all.
fn standing_lines(
    folder: &Path,
    cameras: usize,
    boards: usize,
    moved: impl Fn(&str, usize) -> Vector6<f64>,
) -> String {
    let (mut chance, lens, mut text) = (Chance(0x81), lens(), String::new());
    let read = |name: &str| {
        resight::formats::read_target(folder.join(format!("{name}.toml"))).expect("a target").target
    };
    let targets: Vec<(&str, Target)> =
        BOARDS.iter().take(boards).map(|(name, _)| (*name, read(name))).collect();
    for second in 0..90 {
        for (i, place) in cam_from_rig().iter().enumerate().take(cameras) {
            let cam_from_rig = Pose::exp(&moved(NAMES[i], second)).inverse() * *place;
            let mut seen = Vec::new();
            for (board, (name, target)) in targets.iter().enumerate() {
                let stands = Pose::exp(&Vector6::new(0.3, -0.4, 0.2 * board as f64, 0.0, 0.0, 0.0));
                let x = Point::new(0.35 * board as f64 - 0.35, -0.1, 1.2);
                let cam_from_board = cam_from_rig
                    * (Pose { translation: x, ..Pose::identity() } * stands)
                    * Pose::exp(&moved(name, second));
                for feature in target.features() {
                    let at = target.point(feature).expect("a known point").position;
                    let pixel = lens.project(&(cam_from_board * at)).expect("in front");
                    let (u, v) = (pixel.x + SIGMA_PX * chance.normal(), pixel.y + SIGMA_PX * chance.normal());
                    seen.push(json!({"id": feature.id, "corner": feature.corner, "u_px": u, "v_px": v, "sigma_px": SIGMA_PX}));
                }
            }
            let line = json!({"camera": NAMES[i], "t_s": second as f64, "detections": seen});
            writeln!(text, "{line}").expect("text");
        }
    }
    text
}

fn standing_arguments(folder: &Path, cameras: usize, boards: usize) -> Vec<String> {
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("written");
        path.display().to_string()
    };
    let camera = "model = \"pinhole\"\nwidth_px = 1280\nheight_px = 800\nfx_px = 600.0\nfy_px = 600.0\ncx_px = 639.5\ncy_px = 399.5\n";
    let camera = file("camera.toml", camera);
    let mut arguments = vec!["--learn".to_string(), "30".into()];
    for name in NAMES.iter().take(cameras) {
        arguments.extend(["--camera".into(), format!("{name}={camera}")]);
    }
    for (name, first) in BOARDS.iter().take(boards) {
        arguments
            .extend(["--target".into(), format!("{name}={}", file(&format!("{name}.toml"), &tags(*first)))]);
    }
    arguments
}

/// If a motion is attributed, it is attributed to `node`, or not decided.
fn only_right_names(run: &Run, node: &str) {
    assert_eq!(run.code, 3, "{node}: {}", run.stderr);
    let reported = run.moved();
    assert_eq!(reported.last().expect("told")["moved"], json!([node]), "{reported:?}");
    for event in &reported {
        let is_right = event["moved"] == json!([node]);
        assert!(is_right || event["alternatives"] != json!([]), "a wrong name: {event}");
    }
}

fn knocked(name: &str, node: &str, second: usize) -> Vector6<f64> {
    if name == node && 50 <= second {
        Vector6::new(0.02, 0.03, 0.0, 0.02, 0.0, 0.01)
    } else {
        Vector6::zeros()
    }
}

#[test]
fn two_cameras_tell_a_target_carried_away_from_a_camera() {
    for node in ["door", "north", "east"] {
        let folder = folder(&format!("watch-standing-{node}"));
        let arguments = standing_arguments(&folder, 2, 1);
        let run =
            watch(&arguments, &standing_lines(&folder, 2, 1, |name, second| knocked(name, node, second)));
        only_right_names(&run, node);
        for name in ["north", "east"] {
            assert_eq!(
                run.last(name) == "drifted",
                name == node,
                "{node} moved; {name} is {}",
                run.last(name)
            );
        }
    }
}

#[test]
fn two_targets_tell_a_camera_from_a_target_carried_away() {
    for node in ["door", "wall", "north"] {
        let folder = folder(&format!("watch-standing-two-{node}"));
        let arguments = standing_arguments(&folder, 1, 2);
        let run =
            watch(&arguments, &standing_lines(&folder, 1, 2, |name, second| knocked(name, node, second)));
        only_right_names(&run, node);
        for pair in ["north/door", "north/wall"] {
            assert_eq!(
                run.last(pair) == "drifted",
                node == "north",
                "{node} moved; {pair} is {}",
                run.last(pair)
            );
        }
    }
}
