//! `rig` on simulated recordings whose truth is known, and what it says about what it cannot use.

use crate::rig_support::*;
use crate::support::{Run, folder, json_lines, resight};
use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;

/// χ² with six degrees of freedom exceeds this once in ten thousand.
const CHI2_6: f64 = 27.9;

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

fn rig(cameras: &[String], extra: &[&str]) -> Run {
    let arguments: Vec<&str> = std::iter::once("rig")
        .chain(cameras.iter().map(String::as_str))
        .chain(extra.iter().copied())
        .collect();
    resight(&arguments)
}

/// Every camera where it is, by its own covariance.
fn is_true(answer: &Value, wanted: &[&str]) {
    for (name, cam_from_rig) in cameras().into_iter().skip(1).filter(|(name, _)| wanted.contains(name)) {
        let camera = &answer["cameras"][name];
        let distance2 = distance2(&pose_of(&camera["cam_from_rig"]), &cam_from_rig, &camera["covariance"]);
        assert!(distance2 < CHI2_6, "{name}: {distance2}");
    }
}

#[test]
fn detections_give_the_true_rig_with_every_key_of_the_contract() {
    let folder = folder("rig_true");
    let cameras = camera_arguments(&folder);
    let points = write(&folder, "points.csv", &csv(&recording(1)));
    let out = folder.join("rig.toml").display().to_string();
    let run = rig(
        &cameras,
        &["--detections", &points, "--sigma-px", "0.2", "-o", &out, "--json", "--joint-covariance"],
    );
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stderr.contains("shared views") && run.stderr.contains("middle"), "{}", run.stderr);
    let answer = &json_lines(&run)[0];
    let keys = "status reference rms_px n_views cameras pairs rejected weakest_link scale views targets joint_covariance inputs command";
    assert!(keys.split(' ').all(|key| answer.get(key).is_some()), "{answer}");
    let keys =
        "cam_from_rig rig_from_cam covariance sigma_rad sigma_m n_views n_seen n_used n_rejected rms_px";
    assert!(keys.split(' ').all(|key| answer["cameras"]["right"].get(key).is_some()), "{answer}");
    assert_eq!((&answer["reference"], &answer["n_views"]), (&"left".into(), &12.into()));
    is_true(answer, &["middle", "right"]);
    // Each coordinate of a residual is about sigma: the root mean square of both together √2 of it, to 10 %.
    let rms_px = answer["rms_px"].as_f64().unwrap();
    assert!((rms_px / (2f64.sqrt() * SIGMA_PX) - 1.0).abs() < 0.1, "{rms_px}");
    pairs_are_relative_poses(answer);
    let from_middle =
        rig(&cameras, &["--detections", &points, "--sigma-px", "0.2", "--reference", "middle", "--json"]);
    covariances_are_equal(
        &answer["pairs"][2]["covariance"],
        &json_lines(&from_middle)[0]["cameras"]["right"]["covariance"],
    );
    assert_eq!(answer["joint_covariance"]["matrix"].as_array().map(Vec::len), Some(18));
    assert_eq!(answer["views"].as_array().map(Vec::len), Some(12));
    written_cameras_are_read_again(&out, answer);
}

/// To a thousandth of the product of the standard deviations.
fn covariances_are_equal(a: &Value, b: &Value) {
    let at = |m: &Value, i: usize, j: usize| m[i][j].as_f64().unwrap();
    for (i, j) in (0..6).flat_map(|i| (0..6).map(move |j| (i, j))) {
        let scale = (at(b, i, i) * at(b, j, j)).sqrt();
        assert!((at(a, i, j) - at(b, i, j)).abs() < 1e-3 * scale, "{i} {j}: {} {}", at(a, i, j), at(b, i, j));
    }
}

fn pairs_are_relative_poses(answer: &Value) {
    let pairs = answer["pairs"].as_array().unwrap();
    let names: Vec<_> = pairs.iter().map(|p| (p["a"].as_str().unwrap(), p["b"].as_str().unwrap())).collect();
    assert_eq!(names, [("left", "middle"), ("left", "right"), ("middle", "right")]);
    assert!(pairs.iter().all(|p| p["n_shared_views"] == 12));
    let truth = cameras();
    let right_from_middle = truth[2].1 * truth[1].1.inverse();
    let distance2 = distance2(&pose_of(&pairs[2]["b_from_a"]), &right_from_middle, &pairs[2]["covariance"]);
    assert!(distance2 < CHI2_6, "{distance2}");
}

fn written_cameras_are_read_again(file: &str, answer: &Value) {
    assert_eq!(resight(&["explain", file]).code, 0);
    let read = resight::formats::read_camera(format!("{file}#right")).unwrap();
    let placement = read.placement.unwrap();
    assert_eq!((placement.b.as_str(), placement.a.as_str()), ("right", "rig"));
    let said = pose_of(&answer["cameras"]["right"]["cam_from_rig"]);
    assert!((placement.b_from_a.rotation - said.rotation).norm() < 1e-14);
    let covariance = placement.covariance.unwrap();
    assert_eq!(answer["cameras"]["right"]["covariance"][0][0].as_f64(), Some(covariance[(0, 0)]));
    assert_eq!(resight(&["compare", file, file]).code, 0);
}

/// The same input to the bit, whatever order rows and arguments come in and however many threads there are.
#[test]
fn order_and_threads_change_nothing() {
    let folder = folder("rig_order");
    let cameras = camera_arguments(&folder);
    let rows = recording(2);
    let straight = write(&folder, "points.csv", &csv(&rows));
    let shuffled: Vec<Observed> = Chance(5).order(rows.len()).into_iter().map(|i| rows[i].clone()).collect();
    let (one, two) = shuffled.split_at(rows.len() / 2);
    let files = [write(&folder, "b.csv", &csv(one)), write(&folder, "a.csv", &csv(two))];
    let backwards: Vec<String> = cameras.chunks(2).rev().flatten().cloned().collect();
    let said = |cameras: &[String], detections: &[&str], threads: &str, out: &str| {
        let out = folder.join(out);
        let output = Command::cargo_bin("resight")
            .unwrap()
            .env("RAYON_NUM_THREADS", threads)
            .args(["rig", "--json", "--joint-covariance", "-o", out.to_str().unwrap()])
            .args(cameras)
            .arg("--detections")
            .args(detections)
            .output()
            .unwrap();
        let mut answer: Value = serde_json::from_slice(&output.stdout).unwrap();
        // Files and command differ, of course.
        (answer["inputs"], answer["command"]) = (Value::Null, Value::Null);
        (answer.to_string(), std::fs::read(out).unwrap())
    };
    let first = said(&cameras, &[&straight], "1", "1.toml");
    assert_eq!(first, said(&backwards, &[&files[0], &files[1]], "2", "2.toml"));
    assert_eq!(first, said(&backwards, &[&files[1], &files[0]], "1", "3.toml"));
}

#[test]
fn cameras_that_nothing_connects_are_named() {
    let folder = folder("rig_apart");
    let cameras = camera_arguments(&folder);
    let sees = |view: usize, camera: &str| (camera == "right") == (6 <= view);
    let rows = observations(12, &board(), &mut Chance(3), rig_from_board, sees);
    let points = write(&folder, "points.csv", &csv(&rows));
    let out = folder.join("rig.toml");
    let run = rig(&cameras, &["--detections", &points, "-o", out.to_str().unwrap(), "--json"]);
    let answer = &json_lines(&run)[0];
    assert_eq!((run.code, &answer["status"]), (1, &"not_connected".into()));
    assert_eq!(answer["groups"], serde_json::json!([["left", "middle"], ["right"]]));
    for text in [answer["message"].as_str().unwrap(), run.stderr.as_str()] {
        assert!(text.contains("[left, middle] and [right]") && text.contains("at the same time"), "{text}");
    }
    assert!(!out.exists());
}

/// A chain needs no view of all: left–middle, then middle–right.
#[test]
fn a_chain_is_enough_and_its_weakest_link_is_named() {
    let folder = folder("rig_chain");
    let cameras = camera_arguments(&folder);
    let sees = |view: usize, camera: &str| camera != if view < 9 { "right" } else { "left" };
    let rows = observations(12, &board(), &mut Chance(4), rig_from_board, sees);
    let points = write(&folder, "points.csv", &csv(&rows));
    let run = rig(&cameras, &["--detections", &points, "--sigma-px", "0.2", "--json"]);
    let answer = &json_lines(&run)[0];
    is_true(answer, &["middle", "right"]);
    assert_eq!(answer["weakest_link"]["camera"], "right", "{}", answer["weakest_link"]);
    assert_eq!(answer["weakest_link"]["n_shared_views"], 3);
    let text = rig(&cameras, &["--detections", &points]).stdout;
    let words = text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(words.contains("The rig hangs on right – middle: right is known least"), "{text}");
    assert!(words.contains("with 3 shared views"), "{text}");
    assert!(words.contains("an error of 1 % in it is an error of 1 % in every distance"), "{text}");
}

/// Frames without names, with clocks a few milliseconds apart; one camera misses a frame.
#[test]
fn times_join_frames() {
    let folder = folder("rig_times");
    let cameras = camera_arguments(&folder);
    let rows: Vec<Observed> =
        recording(6).into_iter().filter(|s| !(s.view == 7 && s.camera != "left")).collect();
    let mut text = "camera,id,x_m,y_m,z_m,u_px,v_px,t_s\n".to_string();
    for s in &rows {
        let lag_s = match s.camera {
            "left" => 0.0,
            "middle" => 0.004,
            _ => -0.003,
        };
        let t_s = 100.0 + 0.1 * s.view as f64 + lag_s;
        text += &format!(
            "{},{},{},{},{},{},{},{t_s}\n",
            s.camera, s.id, s.x.x, s.x.y, s.x.z, s.pixel.x, s.pixel.y
        );
    }
    let points = write(&folder, "points.csv", &text);
    let run = rig(
        &cameras,
        &["--detections", &points, "--sync-tolerance-s", "0.01", "--sigma-px", "0.2", "--json"],
    );
    let answer = &json_lines(&run)[0];
    is_true(answer, &["middle", "right"]);
    assert_eq!((&answer["n_views"], &answer["n_frames_alone"]), (&12.into(), &1.into()));
    assert!(
        run.stderr.contains("at most 7.0 ms apart") && run.stderr.contains("1 of 34 frame"),
        "{}",
        run.stderr
    );
    let narrow = rig(&cameras, &["--detections", &points, "--sync-tolerance-s", "0.002"]);
    assert_eq!(narrow.code, 1, "nothing is within 2 ms: {}", narrow.stderr);
}

/// `id` alone is enough where the target knows its points.
#[test]
fn targets_know_their_points() {
    let folder = folder("rig_ids");
    let cameras = camera_arguments(&folder);
    let mut text = "camera,view,id,u_px,v_px\n".to_string();
    for s in recording(7) {
        text += &format!("{},{},{},{},{}\n", s.camera, s.view, s.id, s.pixel.x, s.pixel.y);
    }
    let points = write(&folder, "points.csv", &text);
    let board =
        write(&folder, "board.toml", "kind = \"chessboard\"\nrows = 5\ncolumns = 6\nsquare_m = 0.04\n");
    let run = rig(&cameras, &["--detections", &points, "--target", &board, "--sigma-px", "0.2", "--json"]);
    is_true(&json_lines(&run)[0], &["middle", "right"]);
    let wrong = write(&folder, "wrong.csv", &text.replace("left,0,29,", "left,0,30,"));
    let run = rig(&cameras, &["--detections", &wrong, "--target", &board]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("column `id` is `30`, which target board does not have"), "{}", run.stderr);
}

/// Two boards that move on their own, the second seen by two cameras only.
#[test]
fn targets_move_on_their_own() {
    let folder = folder("rig_two");
    let cameras = camera_arguments(&folder);
    let first = observations(8, &board(), &mut Chance(8), rig_from_board, |_, _| true);
    let second = observations(8, &board(), &mut Chance(9), rig_from_board, |_, camera| camera != "left");
    let text = with_targets(&[(first, "a"), (second, "b")]);
    let points = write(&folder, "points.csv", &text);
    let run = rig(&cameras, &["--detections", &points, "--sigma-px", "0.2", "--json"]);
    let answer = &json_lines(&run)[0];
    is_true(answer, &["middle", "right"]);
    assert_ne!(answer["targets"]["a"]["body"], answer["targets"]["b"]["body"]);
}

fn with_targets(lists: &[(Vec<Observed>, &str)]) -> String {
    let rows = |(seen, target): &(Vec<Observed>, &str)| -> String {
        csv(seen).lines().skip(1).map(|line| format!("{line},{target}\n")).collect()
    };
    let rows: String = lists.iter().map(rows).collect();
    format!("camera,view,id,x_m,y_m,z_m,u_px,v_px,target\n{rows}")
}

/// Two boards on one frame: no camera sees both alone enough to say where they are to each other, all together do.
#[test]
fn targets_fixed_together_find_their_places() {
    let folder = folder("rig_mounted");
    let cameras = camera_arguments(&folder);
    let a_from_b = resight::core::Pose::exp(&resight::core::Vector6::new(0.3, -0.1, 0.2, 0.02, 0.22, 0.03));
    let both: Vec<_> = board().into_iter().chain(board().iter().map(|x| a_from_b * *x)).collect();
    let rows = observations(8, &both, &mut Chance(8), rig_from_board, |_, _| true);
    let (mut of_a, mut of_b): (Vec<Observed>, Vec<Observed>) = rows.into_iter().partition(|s| s.id < 30);
    of_a.retain(|s| s.camera != "right");
    of_b.retain(|s| s.camera != "left");
    of_b.iter_mut().for_each(|s| (s.id, s.x) = (s.id - 30, board()[s.id - 30]));
    let points = write(&folder, "points.csv", &with_targets(&[(of_a, "a"), (of_b, "b")]));
    let arguments = ["--detections", &points, "--sigma-px", "0.2", "--json", "--fixed-together", "a,b"];
    let answer = &json_lines(&rig(&cameras, &arguments))[0];
    is_true(answer, &["middle", "right"]);
    let found = &answer["targets"]["b"]["body_from_target"];
    assert_eq!(answer["targets"]["b"]["body_frame"], "a");
    let distance2 = distance2(&pose_of(found), &a_from_b, &found["covariance"]);
    assert!(distance2 < CHI2_6, "{distance2}");
}

/// Where a target stands still, its frame is the world.
#[test]
fn a_target_at_rest_is_the_world() {
    let folder = folder("rig_world");
    let cameras = camera_arguments(&folder);
    let rig_from_world = rig_from_board(2, &mut Chance(10));
    let landmarks: Vec<_> =
        board().into_iter().map(|x| x + resight::core::Point::new(0.0, 0.0, 0.3 * x.x)).collect();
    let still = observations(4, &landmarks, &mut Chance(11), |_, _| rig_from_world, |_, _| true);
    let points = write(&folder, "points.csv", &with_targets(&[(recording(12), "board"), (still, "hall")]));
    let run = rig(&cameras, &["--detections", &points, "--world", "hall", "--sigma-px", "0.2", "--json"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let answer = &json_lines(&run)[0];
    is_true(answer, &["middle", "right"]);
    let world = &answer["world"]["world_from_rig"];
    let of_rig = distance2(&pose_of(world), &rig_from_world.inverse(), &world["covariance"]);
    assert!(answer["world"]["target"] == "hall" && of_rig < CHI2_6, "{of_rig}");
    for (name, cam_from_rig) in crate::rig_support::cameras() {
        let found = &answer["cameras"][name]["world_from_cam"];
        let truth = (cam_from_rig * rig_from_world).inverse();
        let distance2 = distance2(&pose_of(found), &truth, &found["covariance"]);
        assert!(distance2 < CHI2_6, "{name}: {distance2}");
    }
    // Seen from the right camera the rig's frame is its own: the same covariance by another way.
    let from_right =
        ["--detections", &points, "--world", "hall", "--sigma-px", "0.2", "--json", "--reference", "right"];
    let other_way = &json_lines(&rig(&cameras, &from_right))[0]["world"]["world_from_rig"]["covariance"];
    covariances_are_equal(&answer["cameras"]["right"]["world_from_cam"]["covariance"], other_way);
    let words = rig(&cameras, &["--detections", &points, "--world", "hall"]).stdout;
    assert!(words.contains("(frame of hall)"), "{words}");
}

/// A board that one camera saw a moment later, and a single slip: left out, named, and without influence.
#[test]
fn what_contradicts_is_left_out_by_name() {
    let folder = folder("rig_wrong");
    let cameras = camera_arguments(&folder);
    let mut rows = recording(13);
    for s in rows.iter_mut().filter(|s| s.camera == "right" && s.view == 5) {
        s.pixel.x += 25.0;
    }
    rows[40].pixel.y += 30.0;
    let slip = (rows[40].camera, rows[40].id.to_string());
    let points = write(&folder, "points.csv", &csv(&rows));
    let run = rig(&cameras, &["--detections", &points, "--sigma-px", "0.2", "--json"]);
    let answer = &json_lines(&run)[0];
    is_true(answer, &["middle", "right"]);
    let rejected = answer["rejected"].as_array().unwrap();
    let connected = |kind: &str, camera: &str, view: &str| {
        rejected.iter().find(|r| r["kind"] == kind && r["camera"] == camera && r["view"] == view)
    };
    let observation = connected("observation", "right", "v5").unwrap_or_else(|| panic!("{rejected:?}"));
    assert!(observation["reason"].as_str().unwrap().contains("contradicts"), "{observation}");
    let point = connected("point", slip.0, "v0").unwrap();
    assert_eq!(point["id"].as_str(), Some(slip.1.as_str()));
    assert!(25.0 < point["residual_px"].as_f64().unwrap());
    assert_eq!(answer["cameras"]["right"]["n_rejected"], 30, "{}", answer["cameras"]["right"]);
}

#[test]
fn wrong_usage_is_named() {
    let folder = folder("rig_usage");
    let cameras = camera_arguments(&folder);
    let good = csv(&recording(14));
    let points = write(&folder, "points.csv", &good);
    let file = |name: &str, text: &str| write(&folder, name, text);
    let head = "camera,view,id,x_m,y_m,z_m,u_px,v_px\n";
    let cases: Vec<(Vec<String>, &str)> = vec![
        (vec![], "give --images NAME=GLOB for each camera, or --detections"),
        (vec!["--detections".into(), file("a.csv", &good.replace("left,", "lefft,"))], "did you mean `left`"),
        (vec!["--detections".into(), file("b.csv", &good.replace("u_px", "u"))], "no column `u_px`"),
        (
            vec!["--detections".into(), file("c.csv", &format!("{head}left,1,0,0,0,0,nan,4\n"))],
            "c.csv:2: column `u_px` is NaN",
        ),
        (
            vec![
                "--detections".into(),
                file("d.csv", &format!("{head}left,1,7,0,0,0,3,4\nleft,1,7,0,0,0,5,6\n")),
            ],
            "point 7 of target target is there twice",
        ),
        (vec!["--detections".into(), file("e.csv", "camera,id,x_m,y_m,z_m,u_px,v_px\n")], "no column `view`"),
        (
            vec!["--detections".into(), points.clone(), "--reference".into(), "rihgt".into()],
            "did you mean `right`",
        ),
        (
            vec!["--detections".into(), points.clone(), "--world".into(), "hall".into()],
            "there is no target `hall`",
        ),
        (
            vec!["--detections".into(), points.clone(), "--sync-tolerance-s".into(), "0.005".into()],
            "needs time stamps",
        ),
        (
            vec!["--detections".into(), points.clone(), "--sync-tolerance-s".into(), "-0.005".into()],
            "a positive number",
        ),
        (
            vec!["--detections".into(), points.clone(), "--fixed-together".into(), "target".into()],
            "two names or more",
        ),
        (
            vec![
                "--detections".into(),
                points.clone(),
                "-o".into(),
                folder.join("no/rig.toml").display().to_string(),
            ],
            "make it first",
        ),
        (vec!["--images".into(), format!("left={}", points)], "--images needs --target"),
    ];
    for (extra, wanted) in cases {
        let extra: Vec<&str> = extra.iter().map(String::as_str).collect();
        let run = rig(&cameras, &extra);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{wanted}: {}", run.stderr);
        assert!(run.stderr.contains(wanted), "{wanted}: {}", run.stderr);
    }
    let twice = rig(&[cameras.clone(), cameras[..2].to_vec()].concat(), &["--detections", &points]);
    assert!(twice.code == 2 && twice.stderr.contains("two cameras are called `left`"), "{}", twice.stderr);
    assert!(resight(&["rig", "--help"]).stdout.contains("Examples:"));
}

/// Without ffmpeg the message says how to get it.
#[test]
fn videos_need_ffmpeg() {
    let folder = folder("rig_video");
    let cameras = camera_arguments(&folder);
    let video = folder.join("left.mp4");
    std::fs::write(&video, b"\0\0\0\x20ftypisom\0\0\0\0").unwrap();
    let board =
        write(&folder, "board.toml", "kind = \"chessboard\"\nrows = 5\ncolumns = 6\nsquare_m = 0.04\n");
    let run = |path: &str| {
        let images = format!("left={}", video.display());
        let mut command = Command::cargo_bin("resight").unwrap();
        command.arg("rig").args(&cameras).args(["--target", &board, "--images", &images]);
        let output = command.env("PATH", path).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (code, words) = run("/nowhere");
    assert!(code == Some(2) && words.contains("apt install ffmpeg"), "{words}");
    if std::process::Command::new("ffmpeg").arg("-version").output().is_ok() {
        let (code, words) = run(&std::env::var("PATH").unwrap());
        assert!(code == Some(2) && words.contains("left.mp4: no video in this file"), "{words}");
    }
}

/// A board printed 2 % too large: with one distance between cameras known the scale is found out, and said.
#[test]
fn a_known_distance_checks_the_size_of_the_board() {
    let folder = folder("rig_scale");
    let cameras = camera_arguments(&folder);
    let mut rows = recording(15);
    rows.iter_mut().for_each(|s| s.x *= 0.98);
    let points = write(&folder, "points.csv", &csv(&rows));
    let truth = crate::rig_support::cameras();
    let distance_m = (truth[2].1 * truth[0].1.inverse()).translation.norm();
    let known = format!("right,left,{distance_m},0.0002");
    let run = rig(
        &cameras,
        &["--detections", &points, "--sigma-px", "0.2", "--known-distance-m", &known, "--json"],
    );
    let scale = &json_lines(&run)[0]["scale"];
    let (ratio, sigma) = (&scale["targets"]["target"]["ratio"], &scale["targets"]["target"]["sigma"]);
    let off = ratio.as_f64().unwrap() - 1.0 / 0.98;
    assert!(off.abs() < 4.0 * sigma.as_f64().unwrap(), "{scale}");
    assert!(scale["message"].as_str().unwrap().contains("too small"), "{scale}");
    let wrong = rig(&cameras, &["--detections", &points, "--known-distance-m", "left,rigth,1,0.1"]);
    assert!(wrong.code == 2 && wrong.stderr.contains("did you mean `right`"), "{}", wrong.stderr);
}
