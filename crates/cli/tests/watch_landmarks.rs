//! `watch --landmarks` and `landmarks` as a user runs them: images in, turns and states out.

use crate::landmarks_support::{camera, exposed, picture, turned};
use crate::support::folder;
use assert_cmd::Command;
use resight::core::target::Tag;
use resight::core::{Camera, Pose, Target, Vector6};
use resight::formats::write_atomically;
use resight::render::{Finish, Pcg, Placed, Scene, Style, render};
use serde_json::Value;
use std::path::{Path, PathBuf};

const CAMERA: &str = "model = \"pinhole\"\nwidth_px = 480\nheight_px = 360\nfx_px = 400.0\nfy_px = 400.0\ncx_px = 239.5\ncy_px = 179.5\n";

fn small() -> Camera {
    camera(480, 360, 400.0)
}

fn write(path: PathBuf, bytes: &[u8]) -> String {
    write_atomically(&path, bytes).expect("written");
    path.display().to_string()
}

/// A folder with the camera's file, the reference image and `night/`, one image a second, rotated as specified.
struct Night {
    folder: PathBuf,
    camera: String,
    reference: String,
}

impl Night {
    fn new(name: &str) -> Self {
        let folder = folder(name);
        std::fs::create_dir_all(folder.join("night")).expect("a folder");
        let mut chance = Pcg::new(1);
        let image = exposed(&small(), &picture(&small(), &turned([0.0; 3]), 31), 1.0, 2.0, &mut chance);
        let reference = write(folder.join("reference.png"), &image.png().expect("a PNG"));
        let camera = write(folder.join("gate.toml"), CAMERA.as_bytes());
        Night { folder, camera, reference }
    }

    /// Images `numbers` of the camera rotated by `degrees`, finished by `draw`.
    fn take(&self, numbers: std::ops::Range<u64>, degrees: [f64; 3], draw: impl Fn(&mut resight::GrayImage)) {
        let grey = picture(&small(), &turned(degrees), 31);
        let mut chance = Pcg::new(numbers.start + 100);
        for number in numbers {
            let mut image = exposed(&small(), &grey, 1.0, 2.0, &mut chance);
            draw(&mut image);
            write(self.folder.join(format!("night/{number:04}.png")), &image.png().expect("a PNG"));
        }
    }

    /// The file of the tag that `tag_in_view` draws.
    fn tag(&self) -> String {
        let text = b"kind = \"tag\"\nfamily = \"tag36h11\"\nid = 3\nsize_m = 0.1\n";
        write(self.folder.join("tag.toml"), text)
    }

    fn watch(&self, arguments: &[&str]) -> Run {
        let source = format!("gate={}", self.folder.join("night").display());
        let camera = format!("gate={}", self.camera);
        let fixed = ["watch", "--camera", &camera, "--source", &source, "--period-s", "1", "--once"];
        run(&[&fixed[..], arguments].concat())
    }
}

struct Run {
    code: i32,
    stdout: String,
    stderr: String,
}

impl Run {
    fn events(&self, kind: &str) -> Vec<Value> {
        let all = self.stdout.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
        all.filter(|event| event["event"] == kind).collect()
    }

    fn states(&self) -> Vec<String> {
        self.events("state").iter().map(|e| e["state"].as_str().expect("a word").to_string()).collect()
    }
}

fn run(arguments: &[&str]) -> Run {
    let run = Command::cargo_bin("resight").expect("the program").args(arguments).output().expect("it runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    Run { code: run.status.code().expect("a status"), stdout: text(run.stdout), stderr: text(run.stderr) }
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number")).collect()
}

#[test]
fn a_camera_that_stays_is_steady_and_says_its_numbers() {
    let night = Night::new("landmarks-steady");
    night.take(0..8, [0.0; 3], |_| ());
    let landmarks = format!("gate={}", night.reference);
    let run = night.watch(&["--landmarks", &landmarks, "--json", "--frames"]);
    assert_eq!((run.code, run.states()), (0, vec!["steady".to_string()]), "{}{}", run.stdout, run.stderr);
    let frames = run.events("frame");
    assert_eq!(frames.len(), 8);
    for frame in &frames {
        let (turn, sigma) = (numbers(&frame["rotation_rad"]), numbers(&frame["sigma_rad"]));
        assert!((0..3).all(|i| turn[i].abs() < 5.0 * sigma[i] && sigma[i] < 1e-4), "{frame}");
        assert!(numbers(&frame["shift_px"]).iter().all(|px| px.abs() < 0.02), "{frame}");
        assert!(30 <= frame["n_landmarks"].as_u64().expect("a count"), "{frame}");
        assert_eq!(frame["target"], "landmarks");
    }
}

/// The table's numbers are those of `--json`, to the last bit, and `reason` does not say them again.
#[test]
fn the_history_keeps_the_turn_that_json_says() {
    let night = Night::new("landmarks-history");
    night.take(0..6, [0.1, -0.2, 0.3], |_| ());
    night.take(6..8, [0.0; 3], |image| image.data.fill(20));
    let landmarks = format!("gate={}", night.reference);
    let [history, table] =
        ["gate.sqlite", "gate.csv"].map(|name| night.folder.join(name).display().to_string());
    let watched = night.watch(&["--landmarks", &landmarks, "--json", "--frames", "--history", &history]);
    let exported = run(&["history", &history, "--export", &table]);
    assert_eq!(exported.code, 0, "{}", exported.stderr);
    let mut table = csv::Reader::from_path(&table).expect("a table");
    let names = table.headers().expect("names").clone();
    let rows: Vec<csv::StringRecord> = table.records().map(|row| row.expect("a row")).collect();
    let frames = watched.events("frame");
    assert_eq!((rows.len(), frames.len()), (8, 8));
    for (row, frame) in rows.iter().zip(&frames) {
        let text = |name: &str| &row[names.iter().position(|n| n == name).expect("a column")];
        let number = |name: &str| text(name).parse::<f64>().expect("a number");
        assert_eq!((text("readings"), text("qw")), ("0", ""));
        if frame["rotation_rad"].is_null() {
            assert_eq!((text("turns"), text("turn_rx_rad"), text("n_landmarks")), ("0", "", ""));
            assert_eq!(Some(text("reason")), frame["message"].as_str());
            continue;
        }
        assert_eq!((text("turns"), text("reason")), ("1", ""));
        assert_eq!(
            ["turn_rx_rad", "turn_ry_rad", "turn_rz_rad"].map(number).to_vec(),
            numbers(&frame["rotation_rad"])
        );
        assert_eq!(Some(number("n_landmarks")), frame["n_landmarks"].as_f64());
        let covariance = &frame["rotation_covariance_rad2"];
        for (i, j) in [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)] {
            let name = format!("cov_turn_r{}_r{}_rad2", ["x", "y", "z"][i], ["x", "y", "z"][j]);
            assert_eq!(Some(number(&name)), covariance[i][j].as_f64(), "{name}");
        }
    }
    assert_eq!(
        rows.iter()
            .filter(|row| row[names.iter().position(|n| n == "turns").expect("turns")] == *"1")
            .count(),
        6
    );
    let said = run(&["history", &history]).stdout;
    assert!(said.contains("a pose in 0.0 %, a rotation of landmarks in 75.0 %"), "{said}");
    let said: Value = serde_json::from_str(&run(&["history", &history, "--json"]).stdout).expect("JSON");
    let states = said["pairs"][0]["states"].as_object().expect("states");
    assert_eq!(
        states.values().map(|state| state["rotations"].as_u64().expect("a count")).sum::<u64>(),
        6,
        "{said}"
    );
}

/// Three thirds of the image that turned in three ways: such a frame must not count in a mean, and has its reason instead.
#[test]
fn the_history_keeps_no_turn_that_most_contradict() {
    let night = Night::new("landmarks-history-contradict");
    night.take(0..4, [0.0; 3], |_| ());
    write(night.folder.join("night/0004.png"), &in_three_ways());
    let landmarks = format!("gate={}", night.reference);
    let history = night.folder.join("gate.sqlite").display().to_string();
    let watched = night.watch(&["--landmarks", &landmarks, "--json", "--frames", "--history", &history]);
    assert_eq!(watched.events("frame")[4]["is_consistent"], false, "{}", watched.stdout);
    let stored = rusqlite::Connection::open(&history).expect("the history");
    let mut select =
        stored.prepare("SELECT turns, turn IS NULL, reason FROM frame ORDER BY t_s").expect("rows");
    let row = |row: &rusqlite::Row| Ok((row.get(0)?, row.get(1)?, row.get(2)?));
    let mut rows: Vec<(i64, bool, Option<String>)> =
        select.query_map([], row).expect("rows").collect::<Result<_, _>>().expect("rows");
    let (turns, is_empty, reason) = rows.pop().expect("the last");
    assert_eq!(rows, vec![(1, false, None); 4]);
    let reason = reason.expect("a reason");
    assert!(turns == 0 && is_empty && reason.starts_with("inconsistent: "), "{reason}");
    assert!(reason.contains("landmarks found agree, half are needed") && !reason.contains('°'), "{reason}");
}

#[test]
fn a_knock_to_the_left_is_reported_in_words_and_numbers() {
    let night = Night::new("landmarks-knock");
    night.take(0..10, [0.0; 3], |_| ());
    night.take(10..20, [0.0, -0.2, 0.0], |_| ());
    let landmarks = format!("gate={}", night.reference);
    let reported = night.watch(&["--landmarks", &landmarks]);
    assert_eq!(reported.code, 3, "{}{}", reported.stdout, reported.stderr);
    let drifted = reported
        .stdout
        .lines()
        .rfind(|line| line.contains("moved in a step, since 10.0 s"))
        .expect("a drift");
    assert!(drifted.contains("left 0.2") && drifted.contains("to put it back: right 0.2"), "{drifted}");
    assert!(!drifted.contains("mm"), "landmarks know of no shift: {drifted}");
    let reported = night.watch(&["--landmarks", &landmarks, "--json"]);
    let drift = reported.events("state").pop().expect("a state");
    let turn = numbers(&drift["pure_rotation_rad"]);
    assert!((turn[1].to_degrees() + 0.2).abs() < 0.02, "{drift}");
}

/// The image saved by one night serves the next.
#[test]
fn a_saved_reference_serves_the_next_night() {
    let night = Night::new("landmarks-save");
    night.take(0..5, [0.0; 3], |_| ());
    let file = night.folder.join("learned.png");
    let learned = format!("gate={}", file.display());
    let first = night.watch(&["--save-landmarks", &learned]);
    assert_eq!(first.code, 0, "{}{}", first.stdout, first.stderr);
    assert!(first.stderr.contains("the reference image of gate is") && file.is_file(), "{}", first.stderr);
    night.take(0..10, [0.3, 0.0, 0.0], |_| ());
    let next = night.watch(&["--landmarks", &learned]);
    assert!(next.code == 3 && next.stdout.contains("rotated up 0.3"), "{}{}", next.stdout, next.stderr);
    // The same command every night: the image stays the one of the first.
    let saved = std::fs::read(&file).expect("the image");
    let again = night.watch(&["--save-landmarks", &learned]);
    assert!(again.code == 3 && again.stdout.contains("rotated up 0.3"), "{}{}", again.stdout, again.stderr);
    assert_eq!(std::fs::read(&file).expect("the image"), saved);
}

/// From a source to an alarm without a file written by hand: the lens from its angle of view and the first image, which is the reference.
#[test]
fn a_first_night_needs_no_file() {
    let night = Night::new("landmarks-first");
    night.take(0..10, [0.0; 3], |_| ());
    night.take(10..20, [0.0, -0.3, 0.0], |_| ());
    let source = format!("gate={}", night.folder.join("night").display());
    let learned = format!("gate={}", night.folder.join("learned.png").display());
    let command = |more: &[&str]| {
        let fixed = ["watch", "--source", &source, "--period-s", "1", "--once"];
        run(&[&fixed[..], more].concat())
    };
    // The camera has 400 px of focal length on 480 px.
    let angle = "gate=61.93";
    for when in ["first", "next"] {
        let watched = command(&["--hfov-deg", angle, "--save-landmarks", &learned]);
        let said = format!("{when}: {}{}", watched.stdout, watched.stderr);
        assert!(watched.code == 3 && said.contains("moved in a step, since 10.0 s"), "{said}");
        assert!(said.contains("left 0.30") && said.contains("not calibrated"), "{said}");
    }
    let none = command(&["--save-landmarks", "gate=none.png", "--hfov-deg", "elsewhere=60"]);
    assert!(none.code == 2, "{}{}", none.stdout, none.stderr);
    std::fs::remove_dir_all(night.folder.join("night")).expect("the folder");
    std::fs::create_dir_all(night.folder.join("night")).expect("a folder");
    let nothing = command(&["--hfov-deg", angle, "--save-landmarks", "gate=none.png"]);
    assert!(nothing.code == 2 && nothing.stderr.contains("it gives no image"), "{}", nothing.stderr);
}

/// Draws a tag into an image.
fn tag_in_view() -> impl Fn(&mut resight::GrayImage) {
    let target = Target::Tag(Tag { family: "tag36h11".to_string(), id: 3, size_m: 0.1 });
    let cam_from_target = Pose::exp(&Vector6::new(0.2, -0.3, 0.05, -0.05, 0.02, 0.5));
    let placed = Placed { target, cam_from_target, style: Style::default() };
    let scene = Scene { placed: vec![placed], background: 128.0, clutter: Vec::new() };
    let finish = Finish { blur_sigma_px: 0.0, noise_sigma: 0.0, ..Finish::default() };
    let tag = render(&scene, &small(), &finish).expect("an image");
    move |image: &mut resight::GrayImage| {
        let all = image.data.iter_mut().zip(&tag.data);
        // What is not background is the tag, with a little of the image's noise.
        all.filter(|(_, tag)| **tag != 128).for_each(|(grey, tag)| *grey = (*grey % 4) + (*tag).min(250));
    }
}

/// A tag, while it is there, gives the pose; when it is taken away the landmarks go on.
#[test]
fn landmarks_stand_in_for_a_target_that_is_gone() {
    let night = Night::new("landmarks-stand-in");
    let with_tag = tag_in_view();
    night.take(0..30, [0.0; 3], with_tag);
    night.take(30..45, [0.0; 3], |_| ());
    night.take(45..60, [0.0, 0.0, 0.5], |_| ());
    let target = night.tag();
    let landmarks = format!("gate={}", night.reference);
    let run =
        night.watch(&["--target", &target, "--landmarks", &landmarks, "--learn", "20", "--json", "--frames"]);
    let states = run.states();
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert_eq!(states.first().map(String::as_str), Some("learning"), "{states:?}");
    assert!(!states.contains(&"stale".to_string()), "{states:?}");
    assert_eq!(states.last().map(String::as_str), Some("drifted"), "{states:?}");
    for frame in run.events("frame") {
        let is_gone = 30 <= frame["number"].as_u64().expect("a number");
        assert_eq!(frame["rotation_rad"].is_array(), is_gone, "{frame}");
        assert_eq!(frame["cam_from_target"].is_object(), !is_gone, "{frame}");
    }
    let last = run.events("state").pop().expect("a state");
    assert!(
        last["message"].as_str().expect("words").contains("rotated")
            && last["message"].to_string().contains(" clockwise 0.5"),
        "{last}"
    );
}

/// The image is taken while the tag is still there: a sudden motion that comes as it is taken away is found.
#[test]
fn a_knock_while_the_target_is_taken_away_is_found() {
    let night = Night::new("landmarks-away");
    night.take(0..30, [0.0; 3], tag_in_view());
    night.take(30..45, [0.0, 0.0, 0.5], |_| ());
    let (target, file) = (night.tag(), night.folder.join("saved.png"));
    let saved = format!("gate={}", file.display());
    let run = night.watch(&["--target", &target, "--save-landmarks", &saved, "--learn", "20", "--json"]);
    assert_eq!(run.code, 3, "{:?}{}", run.states(), run.stderr);
    assert!(run.stderr.contains("night/0000.png, saved in"), "{}", run.stderr);
    assert_eq!(run.states().last().map(String::as_str), Some("drifted"));
}

#[test]
fn another_scene_and_a_wrong_picture_are_named() {
    let night = Night::new("landmarks-foreign");
    night.take(0..8, [0.0; 3], |image| image.data.fill(20));
    let landmarks = format!("gate={}", night.reference);
    let run = night.watch(&["--landmarks", &landmarks, "--frames"]);
    assert_eq!(run.code, 1, "{}", run.stdout);
    assert!(run.stdout.contains("0 corners in this image, 15 are needed"), "{}", run.stdout);
    assert!(run.stdout.contains("gate: stale"), "{}", run.stdout);
    let refused = |arguments: &[&str], words: &str| {
        let run = night.watch(arguments);
        assert!(run.code == 2 && run.stderr.contains(words), "{arguments:?}: {}", run.stderr);
    };
    let (missing, blank) =
        ("gate=no/such.png".to_string(), format!("gate={}", night.folder.join("night/0000.png").display()));
    refused(&["--landmarks", &missing], "no/such.png");
    refused(&["--landmarks", &blank], "0 landmarks, 30 are needed");
    refused(&["--landmarks", &blank], &format!("--landmarks {}: camera gate", &blank["gate=".len()..]));
    refused(&["--landmarks", &landmarks, "--save-landmarks", &landmarks], "one is needed");
    refused(&["--landmarks", "door=a.png"], "there is no such name");
    refused(&["--landmarks", &landmarks, "--reference", "a.toml"], "belong to a --target");
    refused(&[], "--target");
}

/// `landmarks`: one line an image, an image of what was used, a reason where nothing was found.
#[test]
fn pictures_beside_a_reference_alone() {
    let night = Night::new("landmarks-alone");
    night.take(0..1, [0.0, 1.0, 0.0], |_| ());
    night.take(1..2, [0.0; 3], |image| image.data.fill(20));
    let drawn = night.folder.join("drawn");
    let pictures = format!("{}/night/*.png", night.folder.display());
    let (camera, overlay) = (night.camera.as_str(), drawn.display().to_string());
    let fixed = ["landmarks", &night.reference, &pictures, "--camera", camera];
    let run = run(&[&fixed[..], &["--json", "--overlay", &overlay]].concat());
    assert_eq!(run.code, 1, "{}{}", run.stdout, run.stderr);
    let rows: Vec<Value> = run.stdout.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let turn = numbers(&rows[0]["rotation_rad"]);
    assert!((turn[1].to_degrees() - 1.0).abs() < 0.005, "{}", rows[0]);
    assert!(rows[1]["message"].as_str().expect("a reason").contains("corners"), "{}", rows[1]);
    assert!(resight::GrayImage::read(Path::new(&drawn.join("0000.png"))).is_ok());
}

/// The cameras of a rig's file, without any target.
#[test]
fn a_rig_is_watched_by_landmarks_alone() {
    let night = Night::new("landmarks-rig");
    night.take(0..6, [0.0; 3], |_| ());
    let placement =
        "placement = { b = \"gate\", a = \"rig\", rotation_wxyz = [1, 0, 0, 0], translation_m = [0, 0, 0] }";
    let text = format!("[[camera]]\nname = \"gate\"\n{CAMERA}{placement}\n");
    let rig = write(night.folder.join("rig.toml"), text.as_bytes());
    let (source, landmarks) =
        (format!("gate={}", night.folder.join("night").display()), format!("gate={}", night.reference));
    let fixed = ["watch", "--rig", &rig, "--source", &source, "--period-s", "1", "--once"];
    let run = run(&[&fixed[..], &["--landmarks", &landmarks]].concat());
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("gate: steady"), "{}", run.stdout);
}

/// An image whose thirds turned in three ways.
fn in_three_ways() -> Vec<u8> {
    let thirds = [0.0, 0.3, -0.3].map(|pan| picture(&small(), &turned([0.0, pan, 0.0]), 31));
    let mixed: Vec<f64> = (0..480 * 360).map(|i| thirds[i % 480 / 160][i]).collect();
    let image = exposed(&small(), &mixed, 1.0, 2.0, &mut Pcg::new(7));
    image.png().expect("a PNG")
}

/// Three thirds of the image that turned in three ways: what most contradict is no answer.
#[test]
fn a_turn_that_most_contradict_is_reported_as_one() {
    let night = Night::new("landmarks-contradict");
    let mixed = write(night.folder.join("mixed.png"), &in_three_ways());
    let run = run(&["landmarks", &night.reference, &mixed, "--camera", &night.camera]);
    assert_eq!(run.code, 1, "{}{}", run.stdout, run.stderr);
    assert!(run.stdout.contains("  inconsistent: "), "{}", run.stdout);
}
