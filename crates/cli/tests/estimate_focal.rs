//! `--estimate-focal`: real photographs, points in files, and what is refused.

use crate::support::{data, folder, json_lines, resight};

fn photo(name: &str) -> String {
    format!("{}/../../examples/photo/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Fourteen photographs of a chessboard through two lenses whose calibrations say 536 and 542 px: every single one is within 2.5 of its own
/// standard deviations, and their mean square is about one.
#[test]
fn focal_lengths_of_photographs_are_within_what_is_said() {
    let (mut n, mut squares) = (0.0, 0.0);
    for (side, focal_px) in [("left", 535.9), ("right", 542.0)] {
        let run = resight(&[
            "locate",
            &photo(&format!("{side}*.jpg")),
            "--target",
            &photo("board.toml"),
            "--estimate-focal",
            "--json",
        ]);
        assert_eq!(run.code, 0, "{}", run.stderr);
        for answer in json_lines(&run) {
            let found = &answer["estimated_focal"];
            let number = |key: &str| found[key].as_f64().unwrap();
            let off = (number("focal_px") - focal_px) / number("sigma_px");
            assert!(off.abs() < 2.5 && number("sigma_px") < 0.15 * focal_px, "{answer}");
            assert!(
                (found["parameters"]["k1"].as_f64().unwrap() + 0.25).abs() < 0.06,
                "the lens is a barrel: {found}"
            );
            assert_eq!(answer["method"], "unknown_focal");
            (n, squares) = (n + 1.0, squares + off * off);
        }
    }
    assert!(n == 14.0 && (0.5..1.6).contains(&(squares / n)), "{}", squares / n);
}

/// The points were made with f = 1000 px: of a corner of a box it is found, of a wall seen face on it is not, and what would help is said.
#[test]
fn points_in_space_give_it_and_a_frontal_wall_does_not() {
    let points = data("points.csv");
    let run = resight(&["solve", &points, "--estimate-focal", "--image-size-px", "1280x960", "--json"]);
    assert_eq!(run.code, 1);
    let answers = json_lines(&run);
    let (wall, edges) = (&answers[0], &answers[1]);
    let message = wall["message"].as_str().unwrap();
    assert_eq!((&wall["status"], wall.get("estimated_focal")), (&"degenerate".into(), None));
    assert!(message.contains("cannot be distinguished") && message.contains("tilted by"), "{message}");
    let found = &edges["estimated_focal"];
    let number = |key: &str| found[key].as_f64().unwrap();
    assert_eq!(edges["status"], "ok", "{edges}");
    assert!((number("focal_px") - 1000.0).abs() < 3.0 * number("sigma_px"), "{edges}");
    assert_eq!(found["covariance_with_pose"].as_array().map(Vec::len), Some(6));
    let run = resight(&["solve", &points, "--estimate-focal", "--image-size-px", "1280x960"]);
    assert!(run.stdout.contains("px (estimated), a horizontal field of view of"), "{}", run.stdout);
}

#[test]
fn what_it_needs_is_said() {
    let points = data("points.csv");
    let run = resight(&["solve", &points, "--estimate-focal"]);
    assert_eq!(run.code, 2);
    assert!(run.stderr.contains("--image-size-px"), "{}", run.stderr);
    let three = folder("focal_three").join("three.csv");
    let rows: Vec<String> =
        std::fs::read_to_string(&points).unwrap().lines().take(4).map(str::to_owned).collect();
    std::fs::write(&three, rows.join("\n")).unwrap();
    let run = resight(&[
        "solve",
        three.to_str().unwrap(),
        "--estimate-focal",
        "--image-size-px",
        "1280x960",
        "--json",
    ]);
    let answer = &json_lines(&run)[0];
    assert_eq!(answer["status"], "degenerate");
    for extra in [["--camera", "camera.toml"], ["--method", "sqpnp"], ["--robust", "3"]] {
        let flags = ["solve", &points, "--estimate-focal", "--image-size-px", "1280x960", extra[0], extra[1]];
        assert_eq!(resight(&flags).code, 2, "{extra:?}");
    }
}
