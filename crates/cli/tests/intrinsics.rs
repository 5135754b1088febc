//! `intrinsics` as a user runs it: photographs and corners of a real recording, wrong input, the check of an existing file.

use crate::recorded::recorded;
use crate::support::{folder, json_lines, resight};
use serde_json::Value;
use std::path::{Path, PathBuf};

const BOARD: &str = "kind = \"chessboard\"\nrows = 6\ncolumns = 9\nsquare_m = 0.025\n";

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// Corners of a board under a camera with f = 600 px, without noise but for rounding to 0.001 px; tilted to and fro.
fn corners(n_views: usize, tilt: f64, camera: &str) -> String {
    let mut text = String::new();
    for view in 0..n_views {
        let angle = view as f64 * 2.4;
        let (ax, ay) = (tilt * angle.cos(), tilt * angle.sin());
        let (sx, cx, sy, cy) = (ax.sin(), ax.cos(), ay.sin(), ay.cos());
        let (tx, ty, tz) =
            (0.06 * (1.7 * angle).sin(), 0.05 * (2.3 * angle).cos(), 0.45 + 0.02 * view as f64);
        for i in 0..54 {
            let (x, y) = (0.03 * (f64::from(i % 9) - 4.0), 0.03 * (f64::from(i / 9) - 2.5));
            // R_y(ay) R_x(ax) (x, y, 0).
            let (py, pz) = (cx * y, sx * y);
            let (qx, qz) = (cy * x + sy * pz, -sy * x + cy * pz);
            let z = qz + tz;
            let (u, v) = (600.0 * (qx + tx) / z + 321.0, 600.0 * (py + ty) / z + 238.0);
            text += &format!("{camera}{view},{i},{u:.3},{v:.3}\n");
        }
    }
    text
}

fn run_on(folder: &Path, rows: &str, header: &str, further: &[&str]) -> (i32, Value, String) {
    let csv = write(folder, "corners.csv", &format!("{header}\n{rows}"));
    let board = write(folder, "board.toml", &BOARD.replace("0.025", "0.03"));
    let mut arguments = vec!["intrinsics", "--json", "--detections", &csv, "--sigma-px", "0.05"];
    arguments.extend(["--target", board.as_str()]);
    if !further.contains(&"--check") {
        arguments.extend(["--image-size-px", "640x480"]);
    }
    arguments.extend(further);
    let run = resight(&arguments);
    let answer = json_lines(&run).pop().unwrap_or_else(|| panic!("{}", run.stderr));
    (run.code, answer, run.stderr)
}

fn parameter(answer: &Value, camera: usize, name: &str) -> (f64, f64) {
    let all = answer["cameras"][camera]["intrinsics"]["parameters"].as_array().unwrap();
    let found = all.iter().find(|p| p["name"] == name).unwrap();
    (found["value"].as_f64().unwrap(), found["sigma"].as_f64().unwrap())
}

/// Rows without a camera are one camera's; the file that is written is read by `--check`, which finds it to fit and f × 1.02 not.
#[test]
fn detections_give_a_camera_that_the_check_accepts() {
    let folder = folder("intrinsics_detections");
    let output = folder.join("camera.toml").display().to_string();
    let report = folder.join("camera.html").display().to_string();
    let further = ["-o", &output, "--report", &report, "--camera-name", "front"];
    let (code, answer, stderr) = run_on(&folder, &corners(10, 0.5, ""), "view,id,u_px,v_px", &further);
    assert_eq!(code, 0, "{answer} {stderr}");
    let (fx, sigma) = parameter(&answer, 0, "fx_px");
    assert!((fx - 600.0).abs() < 0.05 && sigma < 0.05, "{fx} ± {sigma}");
    assert_eq!(answer["cameras"][0]["name"], "front");
    let page = std::fs::read_to_string(&report).unwrap();
    assert!(page.contains("Projection uncertainty") && page.contains("Coverage") && !page.contains("NaN"));
    let text = std::fs::read_to_string(&output).unwrap();
    assert!(text.contains("width_px = 640"), "{text}");
    let (code, checked, _) =
        run_on(&folder, &corners(8, 0.45, ""), "view,id,u_px,v_px", &["--check", &output]);
    assert_eq!((code, checked["cameras"][0]["status"].as_str()), (0, Some("ok")), "{checked}");
    let wrong = text.replacen(&format!("fx_px = {fx}"), &format!("fx_px = {}", 1.02 * fx), 1);
    assert_ne!(wrong, text);
    let wrong = write(&folder, "wrong.toml", &wrong);
    let (code, checked, _) =
        run_on(&folder, &corners(8, 0.45, ""), "view,id,u_px,v_px", &["--check", &wrong]);
    let message = checked["cameras"][0]["message"].as_str().unwrap();
    assert_eq!(code, 1);
    assert!(message.contains("the focal length is off by +2.0") && message.contains("%"), "{message}");
}

/// Several cameras of one file; one of them selected by its name; a name that does not exist.
#[test]
fn several_cameras_are_calibrated_at_once() {
    let folder = folder("intrinsics_cameras");
    let rows = corners(8, 0.5, "a,") + &corners(8, 0.0, "b,");
    let (code, answer, _) = run_on(&folder, &rows, "camera,view,id,u_px,v_px", &[]);
    let statuses: Vec<&str> =
        answer["cameras"].as_array().unwrap().iter().map(|c| c["status"].as_str().unwrap()).collect();
    assert_eq!((code, &statuses[..]), (1, &["ok", "degenerate"][..]), "{answer}");
    let message = answer["cameras"][1]["message"].as_str().unwrap();
    assert!(
        message.starts_with("no tilted views") && message.contains("tilt the target by 30°"),
        "{message}"
    );
    let (code, answer, _) = run_on(&folder, &rows, "camera,view,id,u_px,v_px", &["--camera-name", "a"]);
    assert_eq!((code, answer["cameras"].as_array().unwrap().len()), (0, 1));
    let csv = folder.join("corners.csv").display().to_string();
    let run = resight(&[
        "intrinsics",
        "--detections",
        &csv,
        "--image-size-px",
        "640x480",
        "--camera-name",
        "c",
        "--target",
        &folder.join("board.toml").display().to_string(),
    ]);
    assert!(run.code == 2 && run.stderr.contains("there is no camera `c`"), "{} {}", run.code, run.stderr);
}

/// A board whose ids run the other way is seen from behind: said, and the intrinsics hold.
#[test]
fn a_mirrored_print_is_said() {
    let folder = folder("intrinsics_mirrored");
    let mirrored: String = corners(8, 0.5, "")
        .lines()
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let i: usize = cells[1].parse().unwrap();
            format!("{},{},{},{}\n", cells[0], i / 9 * 9 + 8 - i % 9, cells[2], cells[3])
        })
        .collect();
    let (code, answer, _) = run_on(&folder, &mirrored, "view,id,u_px,v_px", &[]);
    let names: Vec<&str> = answer["cameras"][0]["findings"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| f["name"].as_str().unwrap())
        .collect();
    assert!(code == 0 && names.contains(&"mirrored_target"), "{names:?}");
    assert!((parameter(&answer, 0, "fx_px").0 - 600.0).abs() < 0.05);
}

/// What cannot be asked for is refused with the way out.
#[test]
fn wrong_requests_are_refused() {
    let cases: [(&[&str], &str); 4] = [
        (&["intrinsics"], "nothing to look at"),
        (&["intrinsics", "nowhere.png", "--target", "t.toml"], "no such file"),
        (&["intrinsics", "--detections", "x.csv"], "--image-size-px"),
        (&["intrinsics", "a.png", "--model", "kanala_brandt"], "did you mean `kannala_brandt`"),
    ];
    for (arguments, needed) in cases {
        let run = resight(arguments);
        assert!(run.code == 2 && run.stderr.contains(needed), "{arguments:?}: {} {}", run.code, run.stderr);
    }
    let help = resight(&["intrinsics", "-h"]).stdout;
    assert!(help.lines().count() <= 24, "{} lines\n{help}", help.lines().count());
}

fn photographs(folder: &Path, pattern: &str) -> Vec<String> {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    paths.retain(|path| {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        name.starts_with(pattern) && name.ends_with(".jpg")
    });
    paths.sort();
    paths.iter().map(|path| path.display().to_string()).collect()
}

/// Thirteen photographs of a chessboard, looked at and calibrated: the published focal length within a per cent, and its error bars. A photograph
/// of another size is refused by name.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn photographs_give_the_published_camera() {
    let data = recorded("opencv_stereo_chessboard");
    let folder = folder("intrinsics_photographs");
    let board = write(&folder, "board.toml", BOARD);
    let images = photographs(&data, "left");
    assert_eq!(images.len(), 13);
    let mut arguments = vec!["intrinsics", "--json", "--target", &board];
    arguments.extend(images.iter().map(String::as_str));
    let run = resight(&arguments);
    let answer = json_lines(&run).pop().unwrap();
    let (fx, sigma) = parameter(&answer, 0, "fx_px");
    println!("photographs: fx {fx:.2} ± {sigma:.2}, {}", answer["cameras"][0]["message"]);
    assert!((fx - 536.07).abs() < 5.4_f64.min(5.0 * sigma), "{fx} ± {sigma}");
    let other = testdata_image();
    arguments.push(&other);
    let run = resight(&arguments);
    assert!(run.code == 2 && run.stderr.contains("another size"), "{} {}", run.code, run.stderr);
}

/// The lens is what is sought: dots are looked for without one, as `detect` does. That four are too few is the reason, not that there are none.
#[test]
fn dots_are_found_without_a_lens() {
    let dots = crate::support::demo("dots.toml");
    let run = resight(&["intrinsics", &testdata_image(), "--target", &dots, "--json"]);
    let answer = json_lines(&run).pop().unwrap();
    let reason = answer["cameras"][0]["message"].as_str().unwrap_or_default();
    assert!(reason.contains("has 4 points at most, 6 are needed"), "{answer}");
}

fn testdata_image() -> String {
    crate::support::demo("left.png")
}
