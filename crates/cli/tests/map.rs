//! `map` as a user runs it: corners of a walk with truth, and wrong input of all kinds.

use crate::rig_support::Chance;
use crate::support::{Run, folder, json_lines, resight};
use resight_core::{Pose, Vector6};
use serde_json::{Value, json};
use std::path::Path;

fn example(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/walk").join(name).display().to_string()
}

fn map(detections: &str, flags: &[&str]) -> Run {
    let (camera, given) = (example("camera.toml"), ["map", "--detections", detections]);
    resight(&[&given[..], &["--camera", &camera, "--size-m", "0.165"], flags].concat())
}

/// A walk with changed rows: `change` gets view, id and the rest of the row, and returns a row or none.
fn changed(name: &str, change: impl Fn(u32, u32, &str) -> Option<String>) -> String {
    let text = std::fs::read_to_string(example("corners.csv")).unwrap();
    let mut out = String::from("view,id,corner,u_px,v_px,sigma_px\n");
    for row in text.lines().skip(1) {
        let mut cells = row.splitn(3, ',');
        let mut number = || cells.next().unwrap().parse().unwrap();
        let (view, id) = (number(), number());
        out.extend(change(view, id, cells.next().unwrap()).map(|row| row + "\n"));
    }
    let path = folder(&format!("map-{name}")).join("corners.csv");
    std::fs::write(&path, out).unwrap();
    path.display().to_string()
}

fn answer(run: &Run) -> Value {
    json_lines(run).remove(0)
}

fn tag(answer: &Value, id: u32) -> &Value {
    answer["tags"].as_array().unwrap().iter().find(|tag| tag["id"] == id).unwrap()
}

fn pose(transform: &Value) -> Pose {
    let numbers = |key: &str| -> Vec<f64> {
        transform[key].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let (q, t) = (numbers("rotation_wxyz"), numbers("translation_m"));
    Pose::from_quaternion_wxyz([q[0], q[1], q[2], q[3]], nalgebra::Vector3::new(t[0], t[1], t[2]))
}

/// The true poses of the tags, those of the first walk.
fn truth(id: u32) -> Pose {
    let text = std::fs::read_to_string(example("truth.csv")).unwrap();
    let row = text.lines().find(|row| row.starts_with(&format!("{id},"))).unwrap();
    let x: Vec<f64> = row.split(',').map(|x| x.parse().unwrap()).collect();
    let pose = Pose::from_quaternion_wxyz([x[1], x[2], x[3], x[4]], nalgebra::Vector3::new(x[5], x[6], x[7]));
    // Tag 5 is where it stood before the second walk.
    let moved = Pose::exp(&Vector6::new(0.0, 0.0, 0.1, 0.0, 0.0, 0.0)).rotation;
    match id {
        5 => pose * Pose::new(moved, nalgebra::Vector3::new(0.3, 0.0, 0.0)).inverse(),
        _ => pose,
    }
}

#[test]
fn a_walk_becomes_a_map_that_other_commands_read() {
    let folder = folder("map-walk");
    let file = folder.join("map.toml").display().to_string();
    let layout = folder.join("field.json").display().to_string();
    let run =
        map(&example("corners.csv"), &["--reference", "0", "-o", &file, "--field-layout", &layout, "--json"]);
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    let answer = answer(&run);
    assert_eq!((&answer["kind"], &answer["status"]), (&"map".into(), &"ok".into()));
    let mut sum = 0.0;
    for id in 1..24 {
        let found = tag(&answer, id);
        let covariance: Vec<f64> = found["covariance"]
            .as_array()
            .unwrap()
            .iter()
            .flat_map(|row| row.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()))
            .collect();
        let covariance = nalgebra::Matrix6::from_row_slice(&covariance);
        let true_pose = truth(0).inverse() * truth(id);
        let error = (pose(&found["world_from_tag"]) * true_pose.inverse()).log();
        sum += error.dot(&covariance.cholesky().unwrap().solve(&error));
    }
    // One walk: all tags share most of their error.
    assert!((2.0..14.0).contains(&(sum / 23.0)), "NEES {}", sum / 23.0);
    for file in [&file, &layout] {
        let run = resight(&["explain", file]);
        assert_eq!(run.code, 0, "{}", run.stderr);
    }
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains("joint_covariance") && text.matches("[[tag]]").count() == 24, "{text}");
}

#[test]
fn a_later_walk_updates_it_and_names_what_moved() {
    let folder = folder("map-later");
    let (before, after) = (folder.join("before.toml"), folder.join("after.toml"));
    let (before, after) = (before.display().to_string(), after.display().to_string());
    assert_eq!(map(&example("corners.csv"), &["-o", &before]).code, 0);
    let run = map(&example("later.csv"), &["--known", &before, "-o", &after, "--json"]);
    assert_eq!(run.code, 1, "{}{}", run.stdout, run.stderr);
    let answer = answer(&run);
    assert_eq!(answer["status"], "inconsistent");
    for found in answer["tags"].as_array().unwrap() {
        let expected = if found["id"] == 5 { "inconsistent" } else { "ok" };
        assert_eq!(found["status"], expected, "{found}");
    }
    assert!(tag(&answer, 5)["message"].as_str().unwrap().contains("from where the known map says"));
    let text = std::fs::read_to_string(&after).unwrap();
    assert!(text.contains("id = 24") && !text.contains("\nid = 5\n"), "{text}");
}

#[test]
fn wrong_tags_are_named_and_never_ok() {
    let named = |file: &str, id: u32, word: &str| {
        let answer = answer(&map(file, &["--json"]));
        assert_ne!(answer["status"], "ok", "{word}");
        let message = tag(&answer, id)["message"].as_str().unwrap_or_default().to_string();
        assert!(message.contains(word), "{word}: {message}");
    };
    // Tag 15 reads 3: two tags with one id, on opposite walls.
    named(
        &changed("twice", |view, id, rest| Some(format!("{view},{},{rest}", if id == 15 { 3 } else { id }))),
        3,
        "two places",
    );
    // Corners 1 and 3 exchanged.
    named(
        &changed("mirrored", |view, id, rest| {
            let (corner, rest) = rest.split_once(',').unwrap();
            let corner =
                if id == 7 { ["0", "3", "2", "1"][corner.parse::<usize>().unwrap()] } else { corner };
            Some(format!("{view},{id},{corner},{rest}"))
        }),
        7,
        "mirrored",
    );
    // A stated size that is wrong is measured.
    for stated in ["4=0.17", "4=0.175", "4=0.2", "4=0.3", "4=0.1"] {
        let answer = answer(&map(&example("corners.csv"), &["--tag-size", stated, "--json"]));
        let message = tag(&answer, 4)["message"].as_str().unwrap();
        assert!(
            answer["status"] == "inconsistent" && message.contains("size is 0.16"),
            "{stated}: {message}"
        );
    }
}

#[test]
fn input_without_a_map_is_explained() {
    let only = |keep: fn(u32, u32) -> bool| {
        move |view, id, rest: &str| keep(view, id).then(|| format!("{view},{id},{rest}"))
    };
    let refused = |file: &str, flags: &[&str], code: i32, status: &str, word: &str| {
        let run = map(file, &[flags, &["--json"]].concat());
        assert_eq!(run.code, code, "{word}: {}{}", run.stdout, run.stderr);
        assert!(
            format!("{}{}", run.stdout, run.stderr).contains(word),
            "{word}: {}{}",
            run.stdout,
            run.stderr
        );
        if !status.is_empty() {
            assert_eq!(answer(&run)["status"], status);
        }
    };
    refused(&changed("one", only(|_, id| id == 4)), &[], 1, "not_connected", "only tag 4 is seen");
    refused(
        &changed("two-groups", only(|_, id| id < 6 || (10..16).contains(&id))),
        &[],
        1,
        "not_connected",
        "not connected",
    );
    refused(&changed("none", only(|_, _| false)), &[], 2, "", "no");
    let unit = |view: u32, id: u32, rest: &str| {
        Some(format!("{view},{id},{}-1", rest.strip_suffix("0.3").expect("the standard deviation last")))
    };
    refused(&changed("sigma", unit), &[], 2, "", "sigma_px");
    refused(&example("corners.csv"), &["--reference", "99"], 2, "", "no view shows this tag");
    refused(&example("corners.csv"), &["--known", &example("camera.toml")], 2, "", "camera.toml");
    let known = folder("map-known").join("known.toml");
    std::fs::write(&known, "kind = \"chessboard\"\nrows = 6\ncolumns = 9\nsquare_m = 0.03\n").unwrap();
    refused(
        &example("corners.csv"),
        &["--known", &known.display().to_string()],
        2,
        "",
        "a map of tags is needed",
    );
}

/// The ids of the map are on other tags, as in another place: nothing places the walk, whichever tags agree by chance.
#[test]
fn a_known_map_of_another_place_writes_no_map() {
    let folder = folder("map-elsewhere");
    let (known, file) = (folder.join("known.toml"), folder.join("map.toml"));
    let (known_name, file_name) = (known.display().to_string(), file.display().to_string());
    assert_eq!(map(&example("corners.csv"), &["-o", &known_name]).code, 0);
    let text = std::fs::read_to_string(&known).unwrap();
    let exchanged = text.lines().map(|line| match line.strip_prefix("id = ") {
        Some(id) => format!("id = {}", (7 * id.parse::<u32>().unwrap() + 5) % 24),
        None => line.to_string(),
    });
    std::fs::write(&known, exchanged.collect::<Vec<String>>().join("\n")).unwrap();
    let run = map(&example("later.csv"), &["--known", &known_name, "-o", &file_name, "--json"]);
    assert_eq!(run.code, 1, "{}{}", run.stdout, run.stderr);
    let answer = answer(&run);
    assert_eq!(answer["status"], "inconsistent");
    assert!(answer["contradiction"].as_str().unwrap().contains("check --known"), "{answer}");
    assert!(!file.exists() && run.stderr.contains("not written"), "{}", run.stderr);
}

/// Two views of the walk as the cameras of a rig: the map's uncertainty is in their ±, as its tags have it together.
#[test]
fn a_rig_takes_the_map_with_its_covariance() {
    let folder = folder("map-rig");
    let path = |name: &str| folder.join(name).display().to_string();
    assert_eq!(map(&example("corners.csv"), &["-o", &path("joint.toml")]).code, 0);
    let text = std::fs::read_to_string(folder.join("joint.toml")).unwrap();
    let (head, rest) = text.split_once("joint_covariance = [\n").unwrap();
    let apart = format!("{head}{}", rest.split_once("\n]\n").unwrap().1);
    let exact = apart.lines().filter(|line| !line.starts_with("sigma_"));
    std::fs::write(folder.join("exact.toml"), exact.collect::<Vec<&str>>().join("\n")).unwrap();
    std::fs::write(folder.join("apart.toml"), &apart).unwrap();
    let rows = std::fs::read_to_string(example("corners.csv")).unwrap();
    let rows = rows.lines().filter_map(|row| match row.split_once(',') {
        Some(("02", rest)) => Some(format!("a,0,{rest}\n")),
        Some(("04", rest)) => Some(format!("b,0,{rest}\n")),
        _ => None,
    });
    let rows: String = rows.collect();
    std::fs::write(folder.join("rows.csv"), format!("camera,view,id,corner,u_px,v_px,sigma_px\n{rows}"))
        .unwrap();
    let cameras = ["a", "b"].map(|name| format!("{name}={}", example("camera.toml")));
    let variance = |target: &str| {
        let (target, rows) = (path(target), path("rows.csv"));
        let given = ["rig", "--camera", &cameras[0], "--camera", &cameras[1], "--target", &target];
        let run = resight(&[&given[..], &["--detections", &rows, "--json"]].concat());
        let answer = answer(&run);
        let covariance = answer["cameras"]["b"]["covariance"].as_array().expect("a covariance");
        (0..6).map(|i| covariance[i][i].as_f64().unwrap()).sum::<f64>()
    };
    let [exact, joint, apart] = ["exact.toml", "joint.toml", "apart.toml"].map(variance);
    assert!(1.02 * exact < joint, "{exact:e} {joint:e}");
    // Tags by themselves, each as uncertain as in the frame of a tag that is far off, are worse than neighbours are.
    assert!(joint < apart, "{joint:e} {apart:e}");
}

/// A wrong camera file: whatever it makes of the corners, the answer is not `ok`, and no file is written.
#[test]
fn a_wrong_camera_writes_no_map() {
    let folder = folder("map-camera");
    let (camera, file) = (folder.join("camera.toml"), folder.join("map.toml"));
    let text = std::fs::read_to_string(example("camera.toml")).unwrap().replace("900.0", "960.0");
    std::fs::write(&camera, text).unwrap();
    let (camera, file_name) = (camera.display().to_string(), file.display().to_string());
    let run = resight(&[
        "map",
        "--detections",
        &example("corners.csv"),
        "--camera",
        &camera,
        "--size-m",
        "0.165",
        "-o",
        &file_name,
        "--json",
    ]);
    assert_eq!(run.code, 1, "{}{}", run.stdout, run.stderr);
    assert_eq!(answer(&run)["status"], "inconsistent");
    assert!(!file.exists() && run.stderr.contains("not written"), "{}", run.stderr);
}

/// A camera that stays where the walk had its third view is watched by the map, until it is turned by 0.3°.
#[test]
fn a_camera_is_watched_by_the_map() {
    let file = folder("map-watch").join("map.toml").display().to_string();
    assert_eq!(map(&example("corners.csv"), &["-o", &file]).code, 0);
    let text = std::fs::read_to_string(example("corners.csv")).unwrap();
    let rows = text.lines().filter_map(|row| row.strip_prefix("02,"));
    let rows: Vec<Vec<f64>> =
        rows.map(|row| row.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 20);
    let turned = Pose::exp(&Vector6::new(0.0, f64::to_radians(0.3), 0.0, 0.0, 0.0, 0.0));
    let (mut chance, sigma_px) = (Chance(0x61), 0.2);
    let mut line = |second: usize| {
        let old_from_new = if second < 200 { Pose::identity() } else { turned };
        let mut detection = |row: &Vec<f64>| {
            let ray = nalgebra::Vector3::new((row[2] - 639.5) / 900.0, (row[3] - 479.5) / 900.0, 1.0);
            let ray = old_from_new.inverse().rotation * ray;
            let pixel = [639.5 + 900.0 * ray.x / ray.z, 479.5 + 900.0 * ray.y / ray.z];
            let [u, v] = pixel.map(|x| x + sigma_px * chance.normal());
            json!({"id": row[0] as u32, "corner": row[1] as u32, "u_px": u, "v_px": v, "sigma_px": sigma_px})
        };
        let seen: Vec<Value> = rows.iter().map(&mut detection).collect();
        format!("{}\n", json!({"t_s": second, "detections": seen}))
    };
    let input: String = (0..300).map(&mut line).collect();
    let camera = example("camera.toml");
    let run = assert_cmd::Command::cargo_bin("resight")
        .expect("the program")
        .args(["watch", "--camera", &camera, "--target", &file, "--once", "--json", "--source", "-"])
        .write_stdin(input)
        .output()
        .expect("it runs");
    let events = String::from_utf8(run.stdout).expect("text");
    let events: Vec<Value> = events.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let states: Vec<&Value> = events.iter().filter(|event| event["event"] == "state").collect();
    assert_eq!(run.status.code(), Some(3), "{states:?} {}", String::from_utf8_lossy(&run.stderr));
    assert_eq!((&states[0]["state"], &states[1]["state"]), (&"learning".into(), &"steady".into()));
    let drifted = states.iter().rfind(|event| event["state"] == "drifted").expect("a drift");
    let found = drifted["pure_rotation_rad"][1].as_f64().expect("it only turned").to_degrees();
    let sigma = drifted["pure_rotation_sigma_rad"][1].as_f64().expect("a number").to_degrees();
    assert!((found - 0.3).abs() < 4.0 * sigma && sigma < 0.03, "{found}° ± {sigma}°");
    assert!((drifted["began_s"].as_f64().expect("a time") - 200.0).abs() <= 3.0, "{drifted}");
}
