//! `solve --robust`: wrong rows are found, named and left out; too few right ones are an error.

use crate::support::{folder, json_lines, resight};
use std::path::Path;

const CAMERA: &str = "model = \"pinhole\"\nwidth_px = 1280\nheight_px = 960\nfx_px = 1000.0\nfy_px = 1000.0\ncx_px = 639.5\ncy_px = 479.5\n";

/// Numbers spread over 0..1 without a generator: multiples of the golden ratio and two relatives (R₃ sequence).
fn spread(i: usize) -> [f64; 3] {
    [0.8191725, 0.6710436, 0.5497005].map(|a| (0.5 + a * i as f64).fract())
}

/// Row i of a scene before a camera at the origin, moved by (1, 2, −3): right, or seen where it is not.
fn row(i: usize, right: bool) -> String {
    let [a, b, c] = spread(i);
    let (z, u, v) = (4.0 + 6.0 * c, 1280.0 * a, 960.0 * b);
    let (x, y) = ((u - 639.5) / 1000.0 * z, (v - 479.5) / 1000.0 * z);
    let [p, q, r] = spread(7 * i + 1000);
    let (u, v) = if right { (u + 0.6 * (p - 0.5), v + 0.6 * (q - 0.5)) } else { (1280.0 * q, 960.0 * r) };
    format!("p{i},{},{},{},{u},{v}", x + 1.0, y + 2.0, z - 3.0)
}

fn written(folder: &Path, rows: impl Iterator<Item = String>) -> [String; 2] {
    let (camera, points) = (folder.join("camera.toml"), folder.join("points.csv"));
    std::fs::write(&camera, CAMERA).unwrap();
    let rows: Vec<String> = rows.collect();
    std::fs::write(&points, format!("id,x_m,y_m,z_m,u_px,v_px\n{}\n", rows.join("\n"))).unwrap();
    [points, camera].map(|path| path.display().to_string())
}

fn is_right(i: usize) -> bool {
    i % 5 < 2
}

/// 60 % of 100 rows wrong: the other 40 are the inliers, by row number, and the pose is the true one.
#[test]
fn wrong_rows_are_found_and_reported() {
    let [points, camera] = written(&folder("robust_found"), (0..100).map(|i| row(i, is_right(i))));
    let arguments = ["solve", &points, "--camera", &camera, "--sigma-px", "0.2", "--robust", "1"];
    let run = resight(&[&arguments[..], &["--json"]].concat());
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    let answer = &json_lines(&run)[0];
    let right: Vec<usize> = (0..100).filter(|i| is_right(*i)).collect();
    assert_eq!(answer["status"], "ok");
    assert_eq!((&answer["n_inliers"], &answer["n_points"]), (&40.into(), &40.into()));
    assert_eq!(answer["inliers"], serde_json::json!(right));
    assert!(0.9999 <= answer["consensus"]["confidence"].as_f64().unwrap());
    let moved = answer["target_from_cam"]["translation_m"].as_array().unwrap();
    for (moved, wanted) in moved.iter().zip([1.0, 2.0, -3.0]) {
        assert!((moved.as_f64().unwrap() - wanted).abs() < 2e-3, "{moved}");
    }
    let text = resight(&arguments);
    let said = text.stdout.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(said.contains("40 of 100 points agree to within 1 px"), "{}", text.stdout);
    assert!(said.contains("60 thrown out: p2, p3, p4, p7, p8, …"), "{}", text.stdout);
    assert_eq!(resight(&arguments).stdout, text.stdout);
}

/// Without the flag the same file is inconsistent or has no pose; the keys of the flag are absent.
#[test]
fn without_the_flag_nothing_is_thrown_out() {
    let [points, camera] = written(&folder("robust_without"), (0..100).map(|i| row(i, is_right(i))));
    let run = resight(&["solve", &points, "--camera", &camera, "--json"]);
    let answer = &json_lines(&run)[0];
    assert_ne!(answer["status"], "ok");
    assert!(answer.get("inliers").is_none() && answer.get("consensus").is_none());
}

#[test]
fn too_few_right_rows_are_an_error_with_a_way_out() {
    let [points, camera] = written(&folder("robust_refused"), (0..30).map(|i| row(i, i < 4)));
    let run = resight(&["solve", &points, "--camera", &camera, "--robust", "2", "--json"]);
    assert_eq!(run.code, 1, "{}", run.stdout);
    let answer = &json_lines(&run)[0];
    assert_eq!(
        (answer["status"].as_str(), &answer["cam_from_target"]),
        (Some("error"), &serde_json::Value::Null)
    );
    let message = answer["message"].as_str().unwrap();
    assert!(
        message.contains("needed to rule out chance") && message.contains("check that labels"),
        "{message}"
    );
}

/// A row that is no number is named by its line, robust or not.
#[test]
fn a_row_that_is_no_number_is_named() {
    let rows = (0..30).map(|i| if i == 7 { "p7,NaN,0,1,5,5".to_string() } else { row(i, true) });
    let [points, camera] = written(&folder("robust_nan"), rows);
    let run = resight(&["solve", &points, "--camera", &camera, "--robust", "2", "--json"]);
    assert_eq!(run.code, 1);
    assert!(json_lines(&run)[0]["message"].as_str().unwrap().contains("line 9"), "{}", run.stdout);
}

/// The four corners of one id fall together: of five tags on a wall, one is labelled as another was, and one of its corners happens to
/// be where it should.
#[test]
fn a_tag_falls_as_a_whole() {
    let corners = [[0.0, 0.0], [0.2, 0.0], [0.2, 0.2], [0.0, 0.2]];
    let places = [[-1.2, -0.8, 4.0], [0.9, -0.7, 4.5], [0.1, 0.1, 5.0], [-1.0, 0.7, 3.8], [1.1, 0.8, 4.2]];
    let rows = (0..20).map(|i| {
        let (tag, [dx, dy]) = (i / 4, corners[i % 4]);
        let [x, y, z] = [places[tag][0] + dx, places[tag][1] + dy, places[tag][2]];
        // Tag 3 is seen half as large, its first corner in place.
        let shrink = if tag == 3 { 0.5 } else { 1.0 };
        let (u, v) = ((places[tag][0] + shrink * dx) / z, (places[tag][1] + shrink * dy) / z);
        format!("tag{tag},{x},{y},{z},{},{}", 1000.0 * u + 639.5, 1000.0 * v + 479.5)
    });
    let [points, camera] = written(&folder("robust_tags"), rows);
    let run = resight(&["solve", &points, "--camera", &camera, "--robust", "2", "--json"]);
    assert_eq!(run.code, 0, "{}", run.stdout);
    let right: Vec<usize> = (0..20).filter(|i| i / 4 != 3).collect();
    assert_eq!(json_lines(&run)[0]["inliers"], serde_json::json!(right));
}

/// The page of the book shows what the program says.
#[test]
fn the_page_shows_a_real_answer() {
    let folder = folder("robust_page");
    let [points, camera] = written(&folder, (0..100).map(|i| row(i, is_right(i))));
    let run = resight(&["solve", &points, "--camera", &camera, "--sigma-px", "0.2", "--robust", "1"]);
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/robust.md");
    let page = std::fs::read_to_string(page).unwrap();
    let shown = page.split("```text\n").nth(1).unwrap().split("```").next().unwrap();
    let said = run.stdout.replace("points.csv", "matches.csv");
    assert!(crate::support::same(&said, shown), "said\n{said}\nshown\n{shown}");
}
