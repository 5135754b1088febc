//! `advise`: the three questions, their images, and what is refused.

use crate::support::{Run, folder, json_lines, resight};
use std::path::Path;

const CAMERA: &str = "model = \"pinhole\"\nwidth_px = 640\nheight_px = 480\nfx_px = 800.0\nfy_px = 800.0\ncx_px = 319.5\ncy_px = 239.5\n";
/// Three control points on a road, seen by that camera from (0, 0, 8) m with 0.3 px of noise.
const MARKS: &str =
    "id,x_m,y_m,z_m,u_px,v_px\nA,-2,10,0,167.56,313.46\nB,2.5,11,0,438.91,268.99\nC,-1,16,0,243.93,140.96\n";
const DOTS: &str = "kind = \"line_plus_one\"\nline_m = [0.0, 0.12, 0.2]\noff_m = [0.1, 0.15]\n";
const BOARD: &str = "kind = \"chessboard\"\nrows = 5\ncolumns = 7\nsquare_m = 0.06\n";
const VIEWS: &str = "{\"rig_from_target\":{\"rotation_wxyz\":[0.95,0.2,0.2,0.1284],\"translation_m\":[-0.1,-0.1,1.8]}}\n{\"rig_from_target\":{\"rotation_wxyz\":[0.97,-0.2,0.1,0.0943],\"translation_m\":[-0.2,-0.1,2.2]}}\n";

fn rig() -> String {
    let camera =
        |name: &str, placement: &str| format!("[[camera]]\nname = \"{name}\"\n{CAMERA}{placement}\n");
    let right = "placement = { b = \"right\", a = \"left\", rotation_wxyz = [0.995, 0.0, 0.0998, 0.0], translation_m = [-0.5, 0.0, 0.0] }";
    camera("left", "") + &camera("right", right)
}

/// A folder with the files above; `advise` run in it: `@` stands for the folder.
fn advise(name: &str, arguments: &str) -> (std::path::PathBuf, Run) {
    let folder = folder(name);
    for (file, text) in [
        ("camera.toml", CAMERA),
        ("marks.csv", MARKS),
        ("dots.toml", DOTS),
        ("board.toml", BOARD),
        ("views.jsonl", VIEWS),
        ("rig.toml", &rig()),
        ("line.csv", "x_m,y_m,z_m,u_px,v_px\n0,0,0,1,1\n1,0,0,2,2\n2,0,0,3,3\n"),
        ("places.csv", "id,x_m,y_m,z_m\nkerb,3,17,0\nsky,0,-9,0\nmiddle,0.5,12,0\n"),
    ] {
        std::fs::write(folder.join(file), text).unwrap();
    }
    let arguments: Vec<String> =
        arguments.split_whitespace().map(|a| a.replace('@', &format!("{}/", folder.display()))).collect();
    let all: Vec<&str> = std::iter::once("advise").chain(arguments.iter().map(String::as_str)).collect();
    let run = resight(&all);
    (folder, run)
}

fn number(object: &serde_json::Value, key: &str) -> f64 {
    object[key].as_f64().unwrap_or_else(|| panic!("{key}: {object}"))
}

fn is_a_picture(path: &Path) {
    let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    assert!(bytes.starts_with(b"\x89PNG") && 5000 < bytes.len(), "{}", path.display());
}

#[test]
fn the_fourth_mark_is_placed_and_ranked() {
    let (folder, run) = advise(
        "advise-points",
        "--camera @camera.toml --points @marks.csv --region-m -5,8,5,20 --length-m -1.5,13,2.3,14.2 --json -o @out",
    );
    assert_eq!(run.code, 0, "{}", run.stderr);
    let said = json_lines(&run);
    assert_eq!((&said[0]["kind"], number(&said[0], "n_points")), (&"now".into(), 3.0));
    assert_eq!(said[0]["first_order_valid"], false, "three points are ambiguous");
    let best: Vec<_> = said.iter().filter(|o| o["kind"] == "suggestion").collect();
    assert_eq!(best.len(), 5);
    let length: Vec<f64> = best.iter().map(|o| number(o, "sigma_length_m")).collect();
    assert!(length.is_sorted() && length[0] < number(&said[0], "sigma_length_m"), "{length:?}");
    assert!(best.iter().all(|o| o["first_order_valid"] == true && number(o, "separation_sigma") > 6.0));
    for name in ["next-point-ground.png", "next-point-image.png", "places-ground.png", "places-image.png"] {
        is_a_picture(&folder.join("out").join(name));
    }
    assert!(run.stderr.contains("poses fit these control points"), "{}", run.stderr);
}

/// A list of places, and a pose instead of pixels; the figures are those of the pose, the place out of sight is left out.
#[test]
fn places_of_a_list_are_ranked() {
    let (folder, run) =
        advise("advise-list", "--camera @camera.toml --points @marks.csv --candidates @places.csv --json");
    let said = json_lines(&run);
    let ids: Vec<_> = said.iter().filter_map(|o| o["id"].as_str()).collect();
    assert_eq!(ids, ["kerb", "middle"], "{}", run.stdout);
    // The same with the pose from `solve`, its pixels taken away.
    let path = |name: &str| folder.join(name).display().to_string();
    let solved = resight(&["solve", &path("marks.csv"), "--camera", &path("camera.toml"), "--json"]);
    let minima = json_lines(&solved)[0]["minima"].clone();
    let above = minima
        .as_array()
        .unwrap()
        .iter()
        .find(|m| 5.0 < m["target_from_cam"]["translation_m"][2].as_f64().unwrap());
    std::fs::write(folder.join("pose.json"), above.unwrap().to_string()).unwrap();
    std::fs::write(folder.join("bare.csv"), "x_m,y_m,z_m\n-2,10,0\n2.5,11,0\n-1,16,0\n").unwrap();
    let arguments =
        ["--points", &path("bare.csv"), "--pose", &path("pose.json"), "--candidates", &path("places.csv")];
    let again =
        resight(&[&["advise", "--camera", &path("camera.toml"), "--json"], arguments.as_slice()].concat());
    let place = |run: &Run| number(&json_lines(run)[1], "sigma_position_m");
    assert!((place(&again) / place(&run) - 1.0).abs() < 1e-6, "{}{}", again.stdout, again.stderr);
}

#[test]
fn a_target_over_a_volume_is_reported_in_a_table_and_pictures() {
    let line = "--camera @camera.toml --target @dots.toml --distance-m 0.5..1.5 --tilt-deg 20..60 --sigma-px 0.3 -o @out";
    let (folder, run) = advise("advise-target", line);
    assert_eq!(run.code, 0, "{}", run.stderr);
    for word in ["whole volume", "changes, best first", "off_m[0] 0.1 → 0", "will be ambiguous"] {
        assert!(run.stdout.contains(word), "{word}: {}", run.stdout);
    }
    assert!(run.stderr.contains("over the middle of the line"), "{}", run.stderr);
    for name in ["target-image.png", "around-x.png", "around-y.png"] {
        is_a_picture(&folder.join("out").join(name));
    }
    let (_, run) = advise("advise-target-json", &format!("{line} --json"));
    let said = json_lines(&run);
    let whole = &said[0];
    assert!(
        (0.0..1.0).contains(&number(whole, "ambiguous"))
            && 0.0 < number(&whole["sigma_position_m"], "median")
    );
    let near_upright = number(&said[1]["sigma_position_m"], "median");
    assert!(near_upright < number(&said[7]["sigma_position_m"], "median"), "nearer is surer");
    assert!(said.iter().any(|o| o["kind"] == "change" && number(o, "cost_ratio") < 2.0));
}

#[test]
fn boards_of_a_rig_are_planned_one_after_the_other() {
    let (folder, run) = advise(
        "advise-rig",
        "--camera @rig.toml --target @board.toml --views @views.jsonl --distance-m 1..3 --json -o @out",
    );
    assert_eq!(run.code, 0, "{}", run.stderr);
    let said = json_lines(&run);
    assert_eq!(said.len(), 4);
    assert_eq!(number(&said[0], "n_views"), 2.0, "{}", run.stderr);
    let place = |o: &serde_json::Value| number(&o["cameras"]["right"], "sigma_position_m");
    assert!(said.windows(2).all(|pair| place(&pair[1]) < place(&pair[0])), "{}", run.stdout);
    assert_eq!(said[1]["seen_by"], serde_json::json!(["left", "right"]));
    for name in ["next-board-above.png", "next-board-left.png", "next-board-right.png"] {
        is_a_picture(&folder.join("out").join(name));
    }
    // Told in the other camera's frame, it is the other that is known less or more; without views neither is known.
    let (_, run) = advise(
        "advise-rig-new",
        "--camera @rig.toml --target @board.toml --distance-m 1..3 --reference right --json",
    );
    let said = json_lines(&run);
    assert_eq!(
        (&said[0]["reference"], &said[0]["cameras"]["left"]["determined"]),
        (&"right".into(), &false.into())
    );
    assert_eq!(said[1]["cameras"]["left"]["determined"], true);
}

#[test]
fn what_cannot_be_advised_is_refused_with_the_way_out() {
    for (name, line, says) in [
        ("a", "--camera @camera.toml", "--points"),
        ("b", "--camera @camera.toml --target @dots.toml", "--distance-m A..B is needed"),
        ("c", "--camera @rig.toml --points @marks.csv", "rig.toml#left"),
        ("d", "--camera @camera.toml --points @line.csv", "line"),
        ("e", "--camera @camera.toml --points @places.csv", "--pose"),
        ("f", "--camera @camera.toml --points @marks.csv --region-m 5,8,-5,20", "X0 < X1"),
        (
            "g",
            "--camera @camera.toml --points @marks.csv --region-m -5,-30,5,-20",
            "can be seen by the camera",
        ),
        ("h", "--camera @camera.toml --points @marks.csv --minimise length", "--length-m"),
        ("i", "--camera @camera.toml --target @dots.toml --distance-m 3..1", "A..B"),
        (
            "j",
            "--camera @rig.toml --target @board.toml --distance-m 100..200 --reference middle",
            "left, right",
        ),
        (
            "k",
            "--camera @camera.toml --points @marks.csv --pose @views.jsonl",
            "no object with `cam_from_target`",
        ),
        ("l", "--camera @camera.toml --points @dots.toml", "no column `x_m`"),
    ] {
        let (_, run) = advise(&format!("advise-refused-{name}"), line);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{line}");
        assert!(run.stderr.contains(says), "{line}: {}", run.stderr);
    }
}
