//! Lines marked in photographs: rows and columns of a real board give the calibrated focal length within what is said; what is wrong is named.

use crate::support::{folder, json_lines, resight};
use serde_json::Value;

const ROAD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/marked_lines/road.csv");
const PHOTO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/photo/");
const OF_ROAD: [&str; 3] = ["--estimate-focal", "--image-size-px", "1280x720"];

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The answer on a file of these lines.
fn solved(name: &str, text: &str, options: &[&str]) -> Value {
    let file = folder(&format!("marked_lines_{name}")).join("lines.csv");
    std::fs::write(&file, text).unwrap();
    let run = resight(&[&["solve", file.to_str().unwrap(), "--json"], options].concat());
    assert!(!run.stdout.is_empty(), "{}", run.stderr);
    json_lines(&run).remove(0)
}

fn assert_within(found: &Value, key: &str, sigma_key: &str, truth: f64) {
    let (value, sigma) = (number(&found[key]), number(&found[sigma_key]));
    assert!((value - truth).abs() < 3.0 * sigma, "{key}: {value} ± {sigma}, in truth {truth}");
}

/// The example's truth is in its `make.py`.
#[test]
fn a_road_gives_focal_length_tilt_roll_and_height() {
    let found = json_lines(&resight(&[&["solve", ROAD, "--json"], &OF_ROAD[..]].concat())).remove(0);
    assert_eq!(found["status"], "ok");
    assert_within(&found, "focal_px", "focal_sigma_px", 980.0);
    assert_within(&found, "tilt_rad", "tilt_sigma_rad", 14f64.to_radians());
    assert_within(&found, "roll_rad", "roll_sigma_rad", -2f64.to_radians());
    assert_within(&found, "heading_rad", "heading_sigma_rad", 18f64.to_radians());
    assert_within(&found, "height_m", "height_sigma_m", 6.2);
    let origin = number(&found["cam_from_scene"]["translation_m"][2]);
    assert!(
        0.0 < origin && found["covariance"][0][0].is_number(),
        "the ground below a tilted camera is before it"
    );
    let nominal =
        json_lines(&resight(&["solve", ROAD, "--hfov-deg", "66", "--image-size-px", "1280x720", "--json"]));
    assert!(nominal[0]["focal_px"].is_null() && nominal[0]["remarks"].to_string().contains("not calibrated"));
    assert_within(&nominal[0], "tilt_rad", "tilt_sigma_rad", 14f64.to_radians());
}

/// Two posts and the horizon of a camera of 900 px, tilted by 14° and rolled by −1.5°, 6 m up; the second post is 4 m high. The page of the book has them.
const HORIZON: &str = "id,direction,u_px,v_px,u2_px,v2_px,length_m,sigma_px
sea,horizon,110.1,122.4,1201.6,150.8,,2
left post,up,304.6,420.4,289.3,178.3,,1
right post,up,983.4,411.3,1005.4,237.9,,1
";

#[test]
fn a_horizon_and_two_posts_are_enough() {
    let found = solved("horizon.csv", HORIZON, &OF_ROAD);
    assert!(found["status"] == "ok" && found["heading_rad"].is_null(), "{found}");
    assert_within(&found, "focal_px", "focal_sigma_px", 900.0);
    assert_within(&found, "tilt_rad", "tilt_sigma_rad", 14f64.to_radians());
    assert_within(&found, "roll_rad", "roll_sigma_rad", -1.5f64.to_radians());
    // A height needs more posts where the lens is not known; the way out holds.
    let high = HORIZON.replace("237.9,,1", "237.9,4,1");
    let few = solved("few.csv", &high, &OF_ROAD);
    let message = few["message"].to_string();
    assert!(few["status"] == "degenerate" && message.contains("mark five, give the camera"), "{few}");
    let known = solved("known.csv", &high, &["--hfov-deg", "70.83", "--image-size-px", "1280x720"]);
    assert_eq!(known["status"], "ok", "{known}");
    assert_within(&known, "height_m", "height_sigma_m", 6.0);
    let alone: String =
        HORIZON.lines().filter(|line| !line.contains("post")).map(|line| format!("{line}\n")).collect();
    let alone = solved("alone.csv", &alone, &OF_ROAD);
    assert!(
        alone["status"] == "degenerate" && alone["message"].to_string().contains("two upright lines"),
        "{alone}"
    );
    let long = HORIZON.replace("150.8,,2", "150.8,7,2");
    let long = solved("long.csv", &long, &OF_ROAD);
    assert!(long["status"] == "error" && long["message"].to_string().contains("horizon"), "{long}");
}

/// Rows and columns of a photographed chessboard as lines of a scene: the lens is calibrated at 536 px.
#[test]
fn a_photographed_board_gives_the_calibrated_focal_length() {
    let (mut answered, mut squares) = (0, 0.0);
    for name in
        ["left01.jpg", "left03.jpg", "left04.jpg", "left05.jpg", "left06.jpg", "left07.jpg", "left08.jpg"]
    {
        let board = format!("{PHOTO}board.toml");
        let corners =
            json_lines(&resight(&["detect", &format!("{PHOTO}{name}"), "--target", &board, "--json"]));
        let corners = corners[0]["detections"].as_array().unwrap_or_else(|| panic!("{}", corners[0]));
        let points: Vec<[f64; 2]> =
            corners.iter().map(|c| [number(&c["u_px"]), number(&c["v_px"])]).collect();
        let n_columns = points.len() / 6;
        assert_eq!((points.len(), n_columns), (54, 9));
        let mut text = "direction,u_px,v_px,u2_px,v2_px\n".to_string();
        let mut line = |direction: &str, a: [f64; 2], b: [f64; 2]| {
            text += &format!("{direction},{},{},{},{}\n", a[0], a[1], b[0], b[1]);
        };
        (0..6).for_each(|row| line("across", points[9 * row], points[9 * row + 8]));
        (0..9).for_each(|column| line("up", points[column], points[45 + column]));
        let found = solved(
            &format!("{name}.csv"),
            &text,
            &["--estimate-focal", "--image-size-px", "640x480", "--sigma-px", "0.2"],
        );
        if found["focal_px"].is_number() {
            // The board lies on its side in some; then its columns are not up, which the answer says.
            let is_on_its_side = number(&found["roll_rad"]).abs() > std::f64::consts::FRAC_PI_4;
            assert_eq!(found["status"], if is_on_its_side { "inconsistent" } else { "ok" }, "{found}");
            let (value, sigma) = (number(&found["focal_px"]), number(&found["focal_sigma_px"]));
            println!("{name}: {value:.1} ± {sigma:.1}");
            assert!((value - 536.0).abs() < 3.0 * sigma, "{name}: {value} ± {sigma}");
            squares += ((value - 536.0) / sigma).powi(2);
            answered += 1;
        } else {
            assert_eq!(found["status"], "degenerate", "{found}");
        }
    }
    assert!(4 <= answered && squares < 3.0 * f64::from(answered), "{answered} {squares}");
}

/// Wrong labels, units, marks and files: never `ok`, and the line is named.
#[test]
fn what_is_wrong_is_named() {
    let road = std::fs::read_to_string(ROAD).unwrap();
    let swapped = road.replace("crossing,across", "crossing,up");
    let found = solved("label.csv", &swapped, &OF_ROAD);
    assert!(found["status"] != "ok" && found["message"].to_string().contains("crossing"), "{found}");
    let (up, across) = ("post,up", "post,across");
    let on_its_side = road
        .replace(",across,", ",UP,")
        .replace(",up,", ",across,")
        .replace(",UP,", ",up,")
        .replace(up, across);
    let on_its_side = on_its_side.replace(",7,0.05", ",,");
    let found = solved("side.csv", &on_its_side, &OF_ROAD);
    assert!(found["status"] == "inconsistent" && found["message"].to_string().contains("swapped"), "{found}");
    let with_feet = road.lines().map(|line| {
        if line.starts_with("lamp post") {
            format!("{},16.4,0.1\n", line.trim_end_matches(','))
        } else {
            format!("{line}\n")
        }
    });
    let found = solved("feet.csv", &with_feet.collect::<String>(), &OF_ROAD);
    assert_eq!(found["status"], "inconsistent", "{found}");
    for (text, needed) in [
        (road.replace("sign,up", "sign,down"), "across, along, up or horizon"),
        (road.replace(",480.9,", ",nan,"), "right kerb"),
        (road.replace("u2_px", "u3_px"), "u2_px"),
        ("direction,u_px,v_px,u2_px,v2_px\n".to_string(), "no"),
    ] {
        let file = folder("marked_lines_bad").join("lines.csv");
        std::fs::write(&file, text).unwrap();
        let run = resight(&[&["solve", file.to_str().unwrap()], &OF_ROAD[..]].concat());
        assert!(run.code == 1 || run.code == 2, "{}", run.code);
        assert!((run.stdout + &run.stderr).contains(needed), "{needed}");
    }
    let few: String = road.lines().take(5).map(|line| format!("{line}\n")).collect();
    let found = solved("few.csv", &few, &OF_ROAD);
    assert!(
        found["status"] == "degenerate" && found["message"].to_string().contains("5 are needed"),
        "{found}"
    );
    let run = resight(&["solve", ROAD, "--estimate-focal"]);
    assert!(run.code != 0 && run.stderr.contains("--image-size-px"), "{}", run.stderr);
    let run = resight(&[&["solve", ROAD, "--robust", "3"], &OF_ROAD[1..]].concat());
    assert!(run.code != 0, "{}", run.stdout);
}
