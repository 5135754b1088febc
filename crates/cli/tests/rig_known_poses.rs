//! `pose-graph` and `hand-eye`: rigs and mountings from poses that something else measured.

use crate::support::{folder, json_lines, resight};
use resight::core::{Point, Pose, Vector6};
use serde_json::Value;
use std::fmt::Write;
use std::path::Path;

fn pose(w: [f64; 3], t: [f64; 3]) -> Pose {
    let turn = Pose::exp(&Vector6::new(w[0], w[1], w[2], 0.0, 0.0, 0.0));
    Pose { translation: Point::from(t), ..turn }
}

fn cells(pose: &Pose) -> String {
    let numbers = pose.quaternion_wxyz().into_iter().chain(pose.translation.iter().copied());
    numbers.map(|x| x.to_string()).collect::<Vec<_>>().join(",")
}

fn read(value: &Value) -> Pose {
    let numbers = |key: &str| -> Vec<f64> {
        value[key].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let (q, t) = (numbers("rotation_wxyz"), numbers("translation_m"));
    Pose::from_quaternion_wxyz([q[0], q[1], q[2], q[3]], Point::new(t[0], t[1], t[2]))
}

fn apart(a: &Pose, b: &Pose) -> f64 {
    (*a * b.inverse()).log().amax()
}

const POSE: &str = "qw,qx,qy,qz,x_m,y_m,z_m";

/// Five cameras in a row, the first at the identity.
fn cameras() -> Vec<Pose> {
    let place = |i: usize| {
        let i = i as f64;
        pose([0.1 * i, -0.3 * i, 0.05 * i], [-0.5 * i, 0.02 * i * i, 0.1 * i])
    };
    (0..5).map(place).collect()
}

/// Every pair but 2–5 (which would be exact), with sigmas; pair 1–4 wrong by 3°.
pub fn pairs_file(path: &Path) {
    let cameras = cameras();
    let mut text = format!("a,b,{POSE},sigma_deg,sigma_mm\n");
    for (a, b) in (0..5).flat_map(|a| (a + 1..5).map(move |b| (a, b))) {
        // A quarter of a sigma, another one for each pair: no pair agrees exactly with the others.
        let off = 1e-4 * ((3 * a + 5 * b) as f64).sin();
        let wrong = if (a, b) == (0, 3) { 0.05 } else { 0.0 };
        let b_from_a = pose([off + wrong, -off, off], [off, off, -off]) * cameras[b] * cameras[a].inverse();
        writeln!(text, "cam{},cam{},{},0.02,0.4", a + 1, b + 1, cells(&b_from_a)).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn pairs_make_a_rig_and_a_wrong_one_is_named() {
    let folder = folder("pairs");
    let (file, out) = (folder.join("pairs.csv"), folder.join("rig.toml"));
    pairs_file(&file);
    let (file, out) = (file.display().to_string(), out.display().to_string());
    let run = resight(&["pose-graph", &file, "--reference", "cam1", "--json", "-o", &out]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    let answer = &json_lines(&run)[0];
    assert_eq!(answer["suspicious"], serde_json::json!(["cam1-cam4"]));
    assert_eq!(answer["reference"], "cam1");
    for (i, truth) in cameras().iter().enumerate() {
        let camera = &answer["cameras"][format!("cam{}", i + 1)];
        assert!(apart(&read(&camera["cam_from_rig"]), truth) < 3e-4);
        assert_eq!(0.0 < camera["sigma_rad"][0].as_f64().unwrap(), i != 0);
    }
    let written: toml::Table = std::fs::read_to_string(&out).unwrap().parse().unwrap();
    assert_eq!(written["relation"].as_array().unwrap().len(), 5);
    let lens = "model = \"pinhole\"\nwidth_px = 640\nheight_px = 480\nfx_px = 500.0\nfy_px = 500.0\ncx_px = 320.0\ncy_px = 240.0\n";
    let lenses: Vec<String> = (1..=2)
        .map(|i| {
            let path = folder.join(format!("cam{i}.toml"));
            std::fs::write(&path, lens).unwrap();
            path.display().to_string()
        })
        .collect();
    let full = folder.join("full.toml").display().to_string();
    let joined = resight(&["convert", &lenses[0], &lenses[1], &out, "--to", "resight", "-o", &full]);
    assert_eq!(joined.code, 0, "{}", joined.stderr);
    let full: toml::Table = std::fs::read_to_string(&full).unwrap().parse().unwrap();
    let placed = full["camera"].as_array().unwrap().iter().filter(|c| c.get("placement").is_some());
    assert_eq!(placed.count(), 2);
    let said = resight(&["pose-graph", &file]).stdout;
    assert!(said.contains("pairs that contradict others: cam1-cam4"), "{said}");
}

/// The chain from cam1 takes the wrong pair, which is as good as any by its sigmas: 3° off.
#[test]
fn a_chain_follows_one_path() {
    let folder = folder("pairs_chain");
    let file = folder.join("pairs.csv");
    pairs_file(&file);
    let run = resight(&["pose-graph", &file.display().to_string(), "--chain", "--json"]);
    let answer = &json_lines(&run)[0];
    assert_eq!(answer["cameras"]["cam4"]["path"], serde_json::json!(["cam1", "cam4"]));
    let off = apart(&read(&answer["cameras"]["cam4"]["cam_from_rig"]), &cameras()[3]);
    assert!((0.045..0.055).contains(&off), "{off}");
}

#[test]
fn groups_that_nothing_joins_are_named() {
    let folder = folder("pairs_apart");
    let file = folder.join("pairs.csv");
    std::fs::write(&file, format!("a,b,{POSE}\n1,2,1,0,0,0,1,0,0\n3,4,1,0,0,0,1,0,0\n")).unwrap();
    let run = resight(&["pose-graph", &file.display().to_string(), "--json"]);
    assert_eq!(run.code, 1);
    assert_eq!(json_lines(&run)[0]["groups"], serde_json::json!([["1", "2"], ["3", "4"]]));
    let run = resight(&["pose-graph", &file.display().to_string(), "--reference", "9"]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("there is no camera `9`"), "{}", run.stderr);
}

const CAMERA: &str = "model = \"pinhole\"\nwidth_px = 640\nheight_px = 480\nfx_px = 800.0\nfy_px = 800.0\ncx_px = 319.5\ncy_px = 239.5\n";

/// A camera on a hand that looks at a flat target from nine places.
struct Cell {
    cam_from_gripper: Pose,
    base_from_target: Pose,
    base_from_gripper: Vec<Pose>,
}

fn cell(second_axis: f64) -> Cell {
    let cam_from_gripper = pose([0.2, -0.1, 1.2], [0.03, -0.05, 0.08]);
    let base_from_target = pose([0.1, 0.2, -0.4], [0.6, 0.1, 0.02]);
    let station = |i: usize| {
        let (a, b) = (i as f64 * 0.7, i as f64 * 1.9);
        // With no second axis: turns about the hand's own z only, here the camera's optical axis turned into the hand.
        let tilt = pose([second_axis * a.sin(), second_axis * b.cos(), 0.0], [0.0; 3]);
        let cam_from_target =
            tilt * pose([0.0, 0.0, 0.5 * b.sin()], [0.05 * a.cos(), 0.04 * b.sin(), 0.8 + 0.05 * a.sin()]);
        base_from_target * cam_from_target.inverse() * cam_from_gripper
    };
    Cell { cam_from_gripper, base_from_target, base_from_gripper: (0..9).map(station).collect() }
}

/// Writes camera, motions and points (columns of `solve`, and of `rig --detections`).
fn cell_files(folder: &Path, cell: &Cell) {
    std::fs::write(folder.join("camera.toml"), CAMERA).unwrap();
    let mut motions = format!("view,{POSE}\n");
    let mut points = String::from("camera,view,id,x_m,y_m,z_m,u_px,v_px\n");
    for (i, base_from_gripper) in cell.base_from_gripper.iter().enumerate() {
        writeln!(motions, "v{i},{}", cells(base_from_gripper)).unwrap();
        let cam_from_target = cell.cam_from_gripper * base_from_gripper.inverse() * cell.base_from_target;
        for k in 0..16 {
            let x = Point::new(0.05 * f64::from(k % 4) - 0.075, 0.05 * f64::from(k / 4) - 0.075, 0.0);
            let seen = cam_from_target * x;
            let (u, v) = (800.0 * seen.x / seen.z + 319.5, 800.0 * seen.y / seen.z + 239.5);
            // A twentieth of a pixel, in no order.
            let noise = 0.05 * f64::from((7 * k + 3 * i as i32) % 5 - 2);
            writeln!(points, "cam,v{i},{k},{},{},{},{},{}", x.x, x.y, x.z, u + noise, v - noise).unwrap();
        }
    }
    std::fs::write(folder.join("motions.csv"), motions).unwrap();
    std::fs::write(folder.join("points.csv"), points).unwrap();
}

fn in_folder(folder: &Path, name: &str) -> String {
    folder.join(name).display().to_string()
}

fn agrees(answer: &Value, cell: &Cell) {
    assert_eq!(answer["n_used"], 9, "{answer}");
    let (hand, target) = (read(&answer["cam_from_gripper"]), read(&answer["base_from_target"]));
    // 0.07 px over 144 points at 0.8 m: a tenth of a milliradian.
    assert!(apart(&hand, &cell.cam_from_gripper) < 1e-3, "{}", apart(&hand, &cell.cam_from_gripper));
    assert!(apart(&target, &cell.base_from_target) < 1e-3);
    assert!(answer["cam_from_gripper"]["sigma_m"][0].as_f64().unwrap() < 1e-2);
}

#[test]
fn points_and_motions_say_where_the_camera_sits() {
    let folder = folder("hand_eye");
    let cell = cell(0.4);
    cell_files(&folder, &cell);
    let [camera, motions, points] =
        ["camera.toml", "motions.csv", "points.csv"].map(|name| in_folder(&folder, name));
    let named = format!("cam={camera}");
    let run = resight(&[
        "hand-eye",
        "--motions",
        &motions,
        "--camera",
        &named,
        "--detections",
        &points,
        "--sigma-px",
        "0.1",
        "--json",
    ]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    agrees(&json_lines(&run)[0], &cell);
}

/// With the target on the hand the hand's motions are the other way round: the same images, motions inverted.
#[test]
fn a_target_on_the_hand_says_where_the_camera_stands() {
    let folder = folder("eye_to_hand");
    let cell = cell(0.4);
    cell_files(&folder, &cell);
    let mut text = format!("view,{POSE}\n");
    for (i, base_from_gripper) in cell.base_from_gripper.iter().enumerate() {
        writeln!(text, "v{i},{}", cells(&base_from_gripper.inverse())).unwrap();
    }
    let [camera, motions, points] =
        ["camera.toml", "motions.csv", "points.csv"].map(|name| in_folder(&folder, name));
    std::fs::write(&motions, text).unwrap();
    let named = format!("cam={camera}");
    let arguments = ["hand-eye", "--motions", &motions, "--camera", &named, "--detections", &points];
    let more = ["--sigma-px", "0.1", "--json", "--eye-to-hand"];
    let run = resight(&[&arguments[..], &more].concat());
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(!run.stderr.contains("counterpart"), "{}", run.stderr);
    let answer = &json_lines(&run)[0];
    assert_eq!(answer["n_used"], 9, "{answer}");
    assert!(apart(&read(&answer["cam_from_base"]), &cell.cam_from_gripper) < 1e-3, "{answer}");
    assert!(apart(&read(&answer["gripper_from_target"]), &cell.base_from_target) < 1e-3, "{answer}");
    let other = &json_lines(&resight(&[&arguments[..], &more[..3]].concat()))[0];
    assert_ne!(other["status"], "ok", "{other}");
}

/// Parallel axes leave the place along them open; measured with a tape, it is all that was missing.
#[test]
fn a_known_height_is_enough_for_parallel_axes() {
    let folder = folder("hand_eye_height");
    let cell = cell(0.0);
    cell_files(&folder, &cell);
    let gripper_from_cam = cell.cam_from_gripper.inverse();
    let axis = gripper_from_cam.rotation.column(2).into_owned();
    let height_m = gripper_from_cam.translation.dot(&axis).to_string();
    let direction = format!("{},{},{}", axis.x, axis.y, axis.z);
    let [camera, motions, points] =
        ["camera.toml", "motions.csv", "points.csv"].map(|name| in_folder(&folder, name));
    let named = format!("cam={camera}");
    let arguments = ["hand-eye", "--motions", &motions, "--camera", &named, "--detections", &points];
    let known = ["--known-height-m", &height_m, "--height-axis", &direction, "--sigma-px", "0.1", "--json"];
    let run = resight(&[&arguments[..], &known].concat());
    assert_eq!(run.code, 0, "{}", run.stderr);
    agrees(&json_lines(&run)[0], &cell);
}

/// The same from the poses that `solve` wrote, and with one hand pose that belongs to another view.
#[test]
fn poses_of_another_command_serve_as_well() {
    let folder = folder("hand_eye_poses");
    let cell = cell(0.4);
    cell_files(&folder, &cell);
    let [camera, motions, points, poses] =
        ["camera.toml", "motions.csv", "points.csv", "poses.jsonl"].map(|name| in_folder(&folder, name));
    let solved = resight(&["solve", &points, "--camera", &camera, "--sigma-px", "0.1", "-o", &poses]);
    assert_eq!(solved.code, 0, "{}", solved.stderr);
    let run = resight(&["hand-eye", "--motions", &motions, "--poses", &poses, "--json"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    agrees(&json_lines(&run)[0], &cell);
    let text = std::fs::read_to_string(&motions).unwrap();
    let mut lines: Vec<&str> = text.lines().collect();
    let moved = lines[4].replace("v3", "v7");
    lines[8] = &moved;
    std::fs::write(&motions, lines.join("\n")).unwrap();
    let run = resight(&["hand-eye", "--motions", &motions, "--poses", &poses, "--json"]);
    let answer = &json_lines(&run)[0];
    assert_eq!(
        (answer["n_used"].clone(), answer["rejected"][0]["view"].clone()),
        (8.into(), "v7".into()),
        "{answer}"
    );
}

#[test]
fn what_says_too_little_or_is_not_named_is_refused() {
    let folder = folder("hand_eye_refused");
    cell_files(&folder, &cell(0.0));
    let [camera, motions, points] =
        ["camera.toml", "motions.csv", "points.csv"].map(|name| in_folder(&folder, name));
    let named = format!("cam={camera}");
    let arguments =
        ["hand-eye", "--motions", &motions, "--camera", &named, "--detections", &points, "--json"];
    let run = resight(&arguments);
    assert_eq!(run.code, 1);
    let answer = &json_lines(&run)[0];
    assert_eq!(answer["status"], "degenerate");
    assert!(answer["message"].as_str().unwrap().contains("second axis"), "{answer}");
    let text = std::fs::read_to_string(&motions).unwrap().replace(POSE, "q1,q2,q3,q4,x_m,y_m,z_m");
    std::fs::write(&motions, text).unwrap();
    let run = resight(&arguments);
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("quaternion must be named"), "{}", run.stderr);
}

/// What pairs have in common and how well their loops told the noise goes into the places, through `convert` and into `compare`; a format
/// that cannot hold it is said not to. Without a loop nothing says how uncertain the places are.
#[test]
fn what_loops_reported_outlives_convert() {
    let folder = folder("pairs_joint");
    let (file, out) = (in_folder(&folder, "pairs.csv"), in_folder(&folder, "rig.toml"));
    pairs_file(Path::new(&file));
    let short = |line: &str| line.rsplitn(3, ',').last().unwrap_or_default().to_owned();
    let text: Vec<String> = std::fs::read_to_string(&file).unwrap().lines().map(short).collect();
    std::fs::write(&file, text.join("\n")).unwrap();
    let run = resight(&["pose-graph", &file, "--json", "-o", &out]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    // Nine pairs of five cameras take part: five loops of three numbers each.
    assert_eq!(json_lines(&run)[0]["noise_degrees_of_freedom"], 15);
    let lens = "model = \"pinhole\"\nwidth_px = 640\nheight_px = 480\nfx_px = 500.0\nfy_px = 500.0\ncx_px = 320.0\ncy_px = 240.0\n";
    let lenses: Vec<String> = (1..=5).map(|i| in_folder(&folder, &format!("cam{i}.toml"))).collect();
    lenses.iter().for_each(|path| std::fs::write(path, lens).unwrap());
    let converted = |n: usize, to: &str, name: &str| {
        let path = in_folder(&folder, name);
        let files: Vec<&str> = lenses[..n].iter().map(String::as_str).chain([out.as_str()]).collect();
        let run = resight(&[&["convert"], &files[..], &["--to", to, "-o", &path]].concat());
        assert_eq!(run.code, 0, "{}", run.stderr);
        (path, run)
    };
    for n in [5, 3] {
        let (full, run) = converted(n, "resight", "full.toml");
        assert!(!run.stderr.contains("covariance of all cameras"), "{}", run.stderr);
        let joint: toml::Table = std::fs::read_to_string(&full).unwrap().parse().unwrap();
        let joint = joint["joint_covariance"].as_table().unwrap();
        assert_eq!(joint["cameras"].as_array().unwrap().len(), n - 1);
        assert_eq!(joint["noise_degrees_of_freedom"].as_float(), Some(15.0));
        let run = resight(&["compare", &full, &full, "--json"]);
        let answer = &json_lines(&run)[0];
        assert_eq!((run.code, &answer["joint_covariance"]), (0, &true.into()), "{answer}");
        // Two calibrations alike: the sum of their degrees.
        assert!((answer["noise_degrees_of_freedom"].as_f64().unwrap() - 30.0).abs() < 1e-6, "{answer}");
        let said = resight(&["compare", &full, &full]).stdout;
        assert!(said.contains("estimated from loops of pairs with 30"), "{said}");
    }
    let (_, run) = converted(5, "kalibr", "chain.yaml");
    let said = run.stdout + &run.stderr;
    assert!(said.contains("the covariance of all cameras together"), "{said}");
    let tree: Vec<&str> = text.iter().take(5).map(String::as_str).collect();
    std::fs::write(&file, tree.join("\n")).unwrap();
    let run = resight(&["pose-graph", &file, "--json", "--joint-covariance"]);
    let answer = &json_lines(&run)[0];
    assert_eq!((run.code, &answer["noise_degrees_of_freedom"]), (0, &0.into()), "{answer}");
    assert!(answer["cameras"]["cam2"].get("covariance").is_none_or(Value::is_null), "{answer}");
    assert!(answer.get("joint_covariance").is_none(), "{answer}");
    let silent = in_folder(&folder, "tree.json");
    std::fs::write(&silent, &run.stdout).unwrap();
    let run = resight(&["compare", &silent, &silent]);
    assert!(run.code == 2 && run.stderr.contains("--sigma-mm"), "{} {}", run.code, run.stderr);
}

/// Keys, status and exit status: of right files, of a stated noise, and of hand poses that were inverted.
#[test]
fn hand_eye_states_what_it_found_and_what_is_wrong() {
    let folder = folder("hand_eye_keys");
    let cell = cell(0.4);
    cell_files(&folder, &cell);
    let [camera, motions, points] =
        ["camera.toml", "motions.csv", "points.csv"].map(|name| in_folder(&folder, name));
    let named = format!("cam={camera}");
    let asked = |more: &[&str]| {
        let arguments = ["hand-eye", "--motions", &motions, "--camera", &named, "--detections", &points];
        resight(&[&arguments[..], &["--sigma-px", "0.1"], more].concat())
    };
    let run = asked(&["--json"]);
    let answer = json_lines(&run)[0].clone();
    assert_eq!((run.code, &answer["status"], &answer["causes"]), (0, &"ok".into(), &serde_json::json!([])));
    let keys = [
        "schema",
        "status",
        "mounting",
        "cam_from_gripper",
        "base_from_target",
        "n_views",
        "n_used",
        "chi2",
        "degrees_of_freedom",
        "pose_chi2",
        "pose_degrees_of_freedom",
        "noise_scale",
        "block_scale",
        "robot_noise",
        "target_size",
        "rotations_rad",
        "views",
        "rejected",
        "causes",
        "explanations",
        "remarks",
        "message",
    ];
    let found: Vec<&str> = answer.as_object().unwrap().keys().map(String::as_str).collect();
    let (lost, new): (Vec<_>, Vec<_>) = (
        keys.iter().filter(|key| !found.contains(*key)).collect(),
        found.iter().filter(|key| !keys.contains(*key)).collect(),
    );
    assert!(lost.is_empty() && new.is_empty(), "lost {lost:?}, new {new:?}");
    let number = |value: &Value| value.as_f64().unwrap();
    // Nine views of 32 numbers; twelve unknowns.
    assert_eq!(
        (&answer["degrees_of_freedom"], &answer["pose_degrees_of_freedom"]),
        (&276.into(), &42.into())
    );
    assert!(
        (number(&answer["target_size"]["ratio"]) - 1.0).abs() < 5.0 * number(&answer["target_size"]["sigma"])
    );
    assert!(
        number(&answer["robot_noise"]["sigma_rad"]) < 1e-3
            && number(&answer["robot_noise"]["sigma_m"]) < 1e-3
    );
    assert_eq!(answer["views"].as_array().unwrap().len(), 9);
    assert!(answer["views"].as_array().unwrap().iter().all(|view| view["is_used"] == true));
    let stated = asked(&["--json", "--robot-sigma-deg", "0.01", "--robot-sigma-mm", "0.1"]);
    let stated = &json_lines(&stated)[0];
    assert_eq!((&stated["status"], stated.get("robot_noise")), (&"ok".into(), None));
    let mut text = format!("view,{POSE}\n");
    for (i, base_from_gripper) in cell.base_from_gripper.iter().enumerate() {
        writeln!(text, "v{i},{}", cells(&base_from_gripper.inverse())).unwrap();
    }
    std::fs::write(&motions, text).unwrap();
    let run = asked(&["--json"]);
    let answer = &json_lines(&run)[0];
    assert_eq!(run.code, 1, "{answer}");
    assert_ne!(answer["status"], "ok");
    assert!(run.stdout.contains("inverted"), "{answer}");
    let words = asked(&[]);
    assert!(words.code == 1 && words.stdout.contains("inverted"), "{}", words.stdout);
}

/// Poses of robot and target in one file need no image; a robot's own convention is stated by an option, and refused without it.
#[test]
fn hand_eye_reads_poses_in_other_conventions() {
    let folder = folder("hand_eye_conventions");
    let cell = cell(0.4);
    let list = |poses: Vec<Pose>| {
        let rows: Vec<String> = poses.iter().map(|pose| format!("{:?}", pose.matrix().concat())).collect();
        format!("[{}]", rows.join(",\n"))
    };
    let seen = |hand: &Pose| cell.cam_from_gripper * hand.inverse() * cell.base_from_target;
    let text = format!(
        "{{\"base_from_gripper\": {},\n\"cam_from_target\": {}}}",
        list(cell.base_from_gripper.to_vec()),
        list(cell.base_from_gripper.iter().map(seen).collect())
    );
    let (pairs, kuka) = (in_folder(&folder, "pairs.json"), in_folder(&folder, "kuka.csv"));
    let target = in_folder(&folder, "target.json");
    std::fs::write(&pairs, text).unwrap();
    std::fs::write(&target, list(cell.base_from_gripper.iter().map(seen).collect())).unwrap();
    let run = resight(&["hand-eye", "--motions", &pairs, "--json"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    agrees(&json_lines(&run)[0], &cell);
    let mut text = "X,Y,Z,A,B,C\n".to_string();
    for hand in &cell.base_from_gripper {
        let (r, t) = (hand.rotation, hand.translation * 1e3);
        let angles = [r[(1, 0)].atan2(r[(0, 0)]), (-r[(2, 0)]).asin(), r[(2, 1)].atan2(r[(2, 2)])];
        let [a, b, c] = angles.map(f64::to_degrees);
        writeln!(text, "{},{},{},{a},{b},{c}", t.x, t.y, t.z).unwrap();
    }
    std::fs::write(&kuka, text).unwrap();
    let arguments = ["hand-eye", "--motions", &kuka, "--poses", &target, "--json"];
    let run = resight(&[&arguments[..], &["--rotation", "kuka"]].concat());
    assert_eq!(run.code, 0, "{}", run.stderr);
    agrees(&json_lines(&run)[0], &cell);
    let run = resight(&arguments);
    assert!(run.code == 2 && run.stderr.contains("mitsubishi, yaskawa, kuka"), "{}", run.stderr);
    let run = resight(&[&arguments[..], &["--rotation", "mitsubishi"]].concat());
    assert!(run.code == 1 && run.stdout.contains("KUKA's A B C"), "{} {}", run.stdout, run.stderr);
}

/// The focal length of one camera stated 4 % too long: the explanation is named with how far the camera moves, and no more than the user tolerates is
/// no reason to refuse the answer.
#[test]
fn a_tolerance_larger_than_what_a_wrong_lens_moves_accepts_the_rig() {
    let (folder, root) =
        (folder("rig_tolerance"), concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/rig"));
    let right = std::fs::read_to_string(format!("{root}/cameras.toml")).unwrap();
    let wrong = right.replace("fx_px = 812.0", "fx_px = 844.48").replace("fy_px = 811.0", "fy_px = 843.44");
    assert_ne!(wrong, right);
    std::fs::write(folder.join("cameras.toml"), wrong).unwrap();
    let cameras = folder.join("cameras.toml").display().to_string();
    let detections = format!("{root}/detections.csv");
    let solved = |tolerance: &[&str], code: i32| {
        let run = ["rig", "--camera", &cameras, "--detections", &detections];
        let said = resight(&[&run[..], tolerance].concat());
        assert_eq!(said.code, code, "{tolerance:?}: {}{}", said.stdout, said.stderr);
        (said.stdout, json_lines(&resight(&[&run[..], tolerance, &["--json"]].concat())).remove(0))
    };
    let (words, refused) = solved(&[], 1);
    let page = std::fs::read_to_string(format!("{root}/../../docs/reading-the-answer.md")).unwrap();
    let shown =
        page.split("```").find(|block| block.contains("  explained ")).unwrap().trim_start_matches("text\n");
    assert!(words.contains(shown), "{shown}\n{words}");
    let best = &refused["explanations"][0];
    let named = (best["explanation"].as_str(), best["of"].as_str());
    assert_eq!(named, (Some("other_focal_length"), Some("right")), "{best}");
    let moved_mm = 1e3 * best["motions"]["right"]["translation_m"].as_f64().unwrap();
    let less = (0.9 * moved_mm).to_string();
    solved(&["--tolerance-deg", "1", "--tolerance-mm", &less], 1);
    let (_, accepted) = solved(&["--tolerance-deg", "1", "--tolerance-mm", &(1.1 * moved_mm).to_string()], 0);
    assert_eq!(accepted["cameras"]["right"]["covariance"], refused["cameras"]["right"]["covariance"]);
    for wrong in ["-1", "nan", "inf"] {
        let said =
            resight(&["rig", "--camera", &cameras, "--detections", &detections, "--tolerance-mm", wrong]);
        assert!(said.code == 2 && said.stderr.contains("--tolerance-mm"), "{wrong}: {}", said.stderr);
    }
}
