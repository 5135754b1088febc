//! The error budget through the program: the parts in JSON add up to the covariance, and the text names them where there are several.

use crate::support::{data, folder, json_lines, resight};
use serde_json::Value;

type Square = [[f64; 6]; 6];

fn square(value: &Value) -> Square {
    serde_json::from_value(value.clone()).expect("six rows")
}

/// The names of the parts, which add up to the covariance beside them; shares to one.
pub fn parts(object: &Value) -> Vec<String> {
    let budget = object["budget"].as_array().expect("a budget");
    let (whole, mut sum) = (square(&object["covariance"]), [[0.0; 6]; 6]);
    for part in budget {
        let one = square(&part["covariance"]);
        (0..36).for_each(|k| sum[k / 6][k % 6] += one[k / 6][k % 6]);
        for axis in 0..3 {
            let sigma = |key: &str| part[key][axis].as_f64().expect("a number");
            assert!((sigma("sigma_m") - one[3 + axis][3 + axis].sqrt()).abs() < 1e-12);
            assert!((sigma("sigma_rad") - one[axis][axis].sqrt()).abs() < 1e-12);
        }
    }
    for k in 0..36 {
        let (i, j) = (k / 6, k % 6);
        let scale = (whole[i][i] * whole[j][j]).sqrt();
        assert!((sum[i][j] - whole[i][j]).abs() < 1e-9 * scale, "{i} {j}: {} {}", sum[i][j], whole[i][j]);
    }
    let shares: f64 = budget.iter().map(|part| part["share"].as_f64().expect("a number")).sum();
    assert!((shares - 1.0).abs() < 1e-9, "{shares}");
    budget.iter().map(|part| part["part"].as_str().expect("a name").to_owned()).collect()
}

fn line_of(text: &str) -> String {
    let line = text.lines().find(|line| line.trim_start().starts_with("budget "));
    line.unwrap_or_else(|| panic!("no budget in\n{text}")).to_owned()
}

#[test]
fn solve_states_the_parts() {
    let (points, camera) = (data("points.csv"), data("camera.toml"));
    let alone = ["solve", &points, "--camera", &camera];
    for answer in json_lines(&resight(&[&alone[..], &["--json"]].concat())) {
        if answer["status"] == "ok" {
            assert_eq!(parts(&answer)[0], "pixels", "{answer}");
        }
    }
    let uncertain = [&alone[..], &["--intrinsics-sigma", "fx_px=4,fy_px=4"]].concat();
    let answers = json_lines(&resight(&[&uncertain[..], &["--json"]].concat()));
    let solved: Vec<&Value> = answers.iter().filter(|answer| !answer["covariance"].is_null()).collect();
    assert!(!solved.is_empty());
    for answer in solved {
        assert!(parts(answer).contains(&"lens".to_owned()), "{answer}");
    }
    let text = line_of(&resight(&uncertain).stdout);
    assert!(text.contains("± ") && text.contains("lens ") && text.contains("pixels "), "{text}");
}

/// Exact points and intrinsics of four points: one source is all there is, and the text has no line for it.
#[test]
fn a_single_source_has_no_line() {
    let (folder, camera) = (folder("budget_single"), data("camera.toml"));
    let file = folder.join("points.csv");
    let rows =
        ["0,0,0,300,200", "0.3,0,0,420,210", "0.3,0.3,0.1,425,330", "0,0.3,0,298,322", "0.1,0.2,0.2,340,285"];
    std::fs::write(&file, format!("x_m,y_m,z_m,u_px,v_px\n{}\n", rows.join("\n"))).unwrap();
    let run = resight(&["solve", &file.display().to_string(), "--camera", &camera, "--sigma-px", "5"]);
    assert!(run.stdout.contains("distance") && !run.stdout.contains("budget"), "{}", run.stdout);
}

#[test]
fn locate_states_the_parts_of_a_photograph() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/photo");
    let [image, camera, target] =
        ["left01.jpg", "left.yml", "board.toml"].map(|name| format!("{root}/{name}"));
    let run = ["locate", &image, "--camera", &camera, "--target", &target];
    let answer = json_lines(&resight(&[&run[..], &["--json"]].concat())).remove(0);
    let names = parts(&answer);
    assert!(names.contains(&"pixels".to_owned()), "{names:?}");
    if 1 < names.len() {
        line_of(&resight(&run).stdout);
    }
}

#[test]
fn rig_states_the_parts_of_every_camera() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/rig");
    let (cameras, detections) = (format!("{root}/cameras.toml"), format!("{root}/detections.csv"));
    let run = ["rig", "--camera", &cameras, "--detections", &detections];
    let answer = json_lines(&resight(&[&run[..], &["--json"]].concat())).remove(0);
    let reference = answer["reference"].as_str().expect("a name");
    for (name, camera) in answer["cameras"].as_object().expect("cameras") {
        match name == reference {
            true => assert_eq!(camera["budget"], serde_json::json!([])),
            false => assert!(parts(camera).contains(&"pixels".to_owned()), "{camera}"),
        }
    }
}

/// With points the pixels and the robot; with stated intrinsics the lens too.
#[test]
fn hand_eye_states_the_parts_of_both_poses() {
    let (folder, root) =
        (folder("budget_hand_eye"), concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/hand_eye"));
    let text = std::fs::read_to_string(format!("{root}/camera.toml")).unwrap();
    let file = folder.join("camera.toml");
    std::fs::write(&file, format!("{text}\nintrinsics_sigma = {{ fx_px = 2.0 }}\n")).unwrap();
    let camera = format!("cam={}", file.display());
    let (motions, detections) = (format!("{root}/motions.csv"), format!("{root}/detections.csv"));
    let run = ["hand-eye", "--motions", &motions, "--detections", &detections, "--camera", &camera];
    let answer = json_lines(&resight(&[&run[..], &["--json"]].concat())).remove(0);
    for key in ["cam_from_gripper", "base_from_target"] {
        let names = parts(&answer[key]);
        assert!(["pixels", "lens"].iter().all(|name| names.contains(&(*name).to_owned())), "{names:?}");
    }
    let text = line_of(&resight(&run).stdout);
    assert!(text.contains("lens "), "{text}");
}

/// The names of the parts of numbers, whose variances add up to those of `sigmas`; shares to one.
fn parts_of_numbers(budget: &Value, sigmas: &[f64]) -> Vec<String> {
    let budget = budget.as_array().expect("a budget");
    for (i, whole) in sigmas.iter().enumerate() {
        let sum: f64 = budget.iter().map(|part| part["sigma"][i].as_f64().expect("a number").powi(2)).sum();
        assert!((sum - whole * whole).abs() <= 1e-9 * whole * whole, "{i}: {sum} {whole}");
    }
    let shares: f64 = budget.iter().map(|part| part["share"].as_f64().expect("a number")).sum();
    assert!((shares - 1.0).abs() < 1e-9, "{shares}");
    budget.iter().map(|part| part["part"].as_str().expect("a name").to_owned()).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    let all = value.as_array().cloned().unwrap_or_else(|| vec![value.clone()]);
    all.iter().map(|x| x.as_f64().expect("a number")).collect()
}

#[test]
fn measure_states_the_parts_of_every_answer() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/measure/accident.toml");
    let answers = json_lines(&resight(&["measure", scene, "--json"]));
    let (network, queries) = answers.split_last().expect("answers");
    for query in queries {
        let unit = query["reliability"]["unit"].as_str().expect("a unit");
        let sigmas = numbers(&query[format!("sigma_{unit}")]);
        assert_eq!(query["budget"].as_array().expect("a list").len(), sigmas.len(), "{query}");
        for (budget, sigma) in query["budget"].as_array().expect("a list").iter().zip(sigmas) {
            let names = parts_of_numbers(budget, &[sigma]);
            for name in ["pixels", "distances", "lens"] {
                assert!(names.contains(&name.to_owned()), "{query}");
            }
        }
    }
    for photo in network["photos"].as_array().expect("photographs") {
        assert!(parts(photo).contains(&"pixels".to_owned()), "{photo}");
    }
    for point in network["points"].as_array().expect("points") {
        let of_axis = |i: usize| point["covariance_m2"][i][i].as_f64().expect("a number").sqrt();
        if !point["budget"].as_array().expect("a list").is_empty() {
            parts_of_numbers(&point["budget"], &[0, 1, 2].map(of_axis));
        }
    }
    assert!(resight(&["measure", scene]).stdout.contains("budget"));
}

#[test]
fn pose_graph_states_the_parts_of_every_camera() {
    let file = folder("budget_pairs").join("pairs.csv");
    crate::rig_known_poses::pairs_file(&file);
    let answer =
        json_lines(&resight(&["pose-graph", &file.display().to_string(), "--reference", "cam1", "--json"]))
            .remove(0);
    for (name, camera) in answer["cameras"].as_object().expect("cameras") {
        match name == "cam1" {
            true => assert_eq!(camera["budget"], serde_json::json!([])),
            false => assert!(parts(camera).contains(&"camera_poses".to_owned()), "{camera}"),
        }
    }
}

#[test]
fn lines_and_marked_lines_state_their_parts() {
    let run = crate::solve_lines::edges("budget", &["--intrinsics-sigma", "fx_px=4,fy_px=4"]);
    assert_eq!(parts(&json_lines(&run)[0]), ["pixels", "lens"]);
    let road = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/marked_lines/road.csv");
    let run = resight(&["solve", road, "--json", "--estimate-focal", "--image-size-px", "1280x720"]);
    let names = parts(&json_lines(&run)[0]);
    assert!(
        ["pixels", "lens", "distances"].iter().all(|name| names.contains(&(*name).to_owned())),
        "{names:?}"
    );
}

#[test]
fn intrinsics_state_the_parts_of_every_parameter() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/photo");
    let images: Vec<String> = (1..=9)
        .filter(|i| *i != 2)
        .map(|i| format!("{root}/left0{i}.jpg"))
        .filter(|f| std::path::Path::new(f).exists())
        .collect();
    let board = format!("{root}/board.toml");
    let images: Vec<&str> = images.iter().map(String::as_str).collect();
    let run = [&["intrinsics", "--target", &board], &images[..]].concat();
    let answer = json_lines(&resight(&[&run[..], &["--json"]].concat())).remove(0);
    let found = &answer["cameras"][0]["intrinsics"];
    let sigmas: Vec<f64> = found["parameters"]
        .as_array()
        .expect("parameters")
        .iter()
        .map(|p| p["sigma"].as_f64().expect("a number"))
        .collect();
    let names = parts_of_numbers(&found["budget"], &sigmas);
    assert!(names.contains(&"pixels".to_owned()) && names.contains(&"priors".to_owned()), "{names:?}");
    assert!(resight(&run).stdout.contains("budget of that: "));
}
