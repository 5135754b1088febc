//! `solve`: real output, exit codes and complaints.

use crate::support::{data, folder, json_lines, matches_golden, resight};

fn solve(arguments: &[&str]) -> crate::support::Run {
    resight(&[&["solve"], arguments].concat())
}

#[test]
fn two_views_in_words() {
    let run = solve(&[&data("points.csv"), "--camera", &data("camera.toml")]);
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
    matches_golden("solve.txt", &run.stdout);
}

/// The pose the points were made from: rotation vector (0.3, −0.4, 0.1), translation (0.05, −0.1, 2.0) m.
#[test]
fn poses_are_the_ones_the_points_were_made_from() {
    let run = solve(&[&data("points.csv"), "--camera", &data("camera.toml"), "--json"]);
    let answers = json_lines(&run);
    assert_eq!(answers.len(), 2);
    for (answer, method) in answers.iter().zip(["line_plus_one", "sqpnp"]) {
        assert_eq!((&answer["status"], &answer["method"]), (&"ok".into(), &method.into()));
        let number = |key: &str, i: usize| answer["cam_from_target"][key][i].as_f64().unwrap();
        for (i, t) in [0.05, -0.1, 2.0].iter().enumerate() {
            let sigma_m = answer["sigma_m"][i].as_f64().unwrap();
            assert!((number("translation_m", i) - t).abs() < 4.0 * (sigma_m + 1e-4), "{answer}");
        }
        let half = 0.5 * (0.09f64 + 0.16 + 0.01).sqrt();
        assert!((number("rotation_wxyz", 0) - half.cos()).abs() < 2e-3);
    }
}

/// Minima, observability and geometry as docs/files.md names them.
#[test]
fn minima_observability_and_geometry_are_in_the_pose_object() {
    let run = solve(&[&data("points.csv"), "--camera", &data("camera.toml"), "--json"]);
    for (answer, configuration) in json_lines(&run).iter().zip(["line_plus_one", "general"]) {
        let minima = answer["minima"].as_array().unwrap();
        assert!((1..=4).contains(&minima.len()));
        assert_eq!(minima[0]["cam_from_target"], answer["cam_from_target"]);
        assert_eq!((&minima[0]["delta_chi2"], &minima[0]["within_gate"]), (&0.0.into(), &true.into()));
        let total: f64 = minima.iter().map(|m| m["probability"].as_f64().unwrap()).sum();
        assert!((total - 1.0).abs() < 1e-9);
        let weak = &answer["observability"];
        assert!(["rotation", "shift"].contains(&weak["weakest"].as_str().unwrap()));
        assert_eq!(weak["motion"].as_array().unwrap().len(), 6);
        for key in ["sigma_rad", "sigma_m", "correlation", "ratio"] {
            assert!(weak[key].as_f64().is_some_and(|x| 0.0 <= x), "{key}: {weak}");
        }
        assert!(
            weak["rotation_axis"].is_string()
                && weak["shift_axis"].is_string()
                && weak["correlated"].is_boolean()
        );
        let geometry = &answer["geometry"];
        assert_eq!(geometry["configuration"], configuration);
        let width = &geometry["width_over_length"];
        assert!(width["threshold"].as_f64() < width["ratio"].as_f64());
        assert_eq!(geometry["thickness_over_width"].is_null(), configuration == "line_plus_one");
    }
}

#[test]
fn three_points_give_every_pose_in_minima() {
    let path = folder("three").join("three.csv");
    let rows: String = std::fs::read_to_string(data("points.csv"))
        .unwrap()
        .lines()
        .filter(|l| l.starts_with("view") || l.starts_with("box"))
        .take(4)
        .map(|l| format!("{l}\n"))
        .collect();
    std::fs::write(&path, rows).unwrap();
    let run = solve(&[path.to_str().unwrap(), "--camera", &data("camera.toml"), "--json"]);
    let answer = &json_lines(&run)[0];
    let minima = answer["minima"].as_array().unwrap();
    assert_eq!(
        (&answer["status"], &answer["geometry"]["configuration"]),
        (&"ambiguous".into(), &"three".into())
    );
    assert!(2 <= minima.len() && minima.iter().all(|m| m["within_gate"] == true), "{answer}");
    assert!(answer["message"].as_str().unwrap().contains("probabilities"), "{answer}");
    let weights: Vec<f64> = minima.iter().map(|m| m["probability"].as_f64().unwrap()).collect();
    assert!(weights.is_sorted_by(|a, b| b <= a), "the more probable first: {weights:?}");
    assert_eq!(answer["probability"], minima[0]["probability"]);
    let run = solve(&[path.to_str().unwrap(), "--camera", &data("camera.toml")]);
    assert_eq!(run.code, 1, "an ambiguous answer is not ok");
    // Every pose stands with its probability and its own standard deviations.
    for label in ["  pose ", "  distance ", "  camera at "] {
        let count = run.stdout.lines().filter(|line| line.starts_with(label)).count();
        assert_eq!(count, minima.len(), "{label}: {}", run.stdout);
    }
}

#[test]
fn the_pose_object_has_every_key_of_the_contract() {
    let run = solve(&[&data("points.csv"), "--camera", &data("camera.toml"), "--json"]);
    for answer in json_lines(&run) {
        let keys = "view status method n_points cam_from_target target_from_cam covariance sigma_rad sigma_m rms_px ambiguity message";
        assert!(keys.split(' ').all(|key| answer.get(key).is_some()), "{answer}");
        assert_eq!(answer["covariance"].as_array().map(Vec::len), Some(6));
        assert_eq!(answer["cam_from_target"]["matrix"].as_array().map(Vec::len), Some(4));
        assert_eq!(answer["ambiguity"]["verdict"], "unique");
        // target_from_cam undoes cam_from_target: R t' + t = 0.
        let (m, t) = (&answer["cam_from_target"]["matrix"], &answer["target_from_cam"]["translation_m"]);
        for i in 0..3 {
            let sum: f64 = (0..3).map(|j| m[i][j].as_f64().unwrap() * t[j].as_f64().unwrap()).sum();
            assert!((sum + m[i][3].as_f64().unwrap()).abs() < 1e-12);
        }
    }
}

#[test]
fn normalized_columns_in_any_order_need_no_camera() {
    let run = solve(&[&data("normalized.csv"), "--normalized", "--sigma-normalized", "0.0001", "--json"]);
    let answer = &json_lines(&run)[0];
    assert_eq!(
        (run.code, &answer["view"], &answer["image_unit"]),
        (0, &"normalized.csv".into(), &"normalized".into())
    );
    assert!(answer["rms_normalized"].is_f64() && answer["minima"][0]["rms_normalized"].is_f64(), "{answer}");
    assert!(answer.get("rms_px").is_none() && answer["schema"] == 2, "{answer}");
    assert!((answer["cam_from_target"]["translation_m"][2].as_f64().unwrap() - 2.0).abs() < 1e-6);
}

#[test]
fn an_assumed_sigma_is_said() {
    let run = solve(&[&data("normalized.csv"), "--normalized", "--json"]);
    let message = json_lines(&run)[0]["message"].as_str().unwrap().to_string();
    let wanted = "σ 0.0005 normalized is assumed, state yours with --sigma-normalized";
    assert!(message.contains(wanted), "{message}");
}

#[test]
fn each_unanswerable_view_says_why_and_the_rest_are_answered() {
    let run = solve(&[&data("hostile.csv"), "--camera", &data("camera.toml"), "--sigma-px", "0.3", "--json"]);
    assert_eq!(run.code, 1);
    let answers = json_lines(&run);
    let statuses: Vec<_> = answers.iter().map(|a| a["status"].as_str().unwrap()).collect();
    assert_eq!(statuses, ["ok", "degenerate", "error", "degenerate", "inconsistent"]);
    let message = |i: usize| answers[i]["message"].as_str().unwrap();
    assert!(message(1).contains("line"), "{}", message(1));
    assert!(message(2).contains("line 11") && message(2).contains("`u_px` is NaN"), "{}", message(2));
    assert!(message(3).contains("2 points given"), "{}", message(3));
    assert!(message(4).contains("point p4") && answers[4]["worst_point"]["name"] == "p4", "{}", message(4));
    assert!(!run.stdout.contains(":NaN"));
}

#[test]
fn o_writes_the_same_lines_to_a_file() {
    let out = folder("solve_o").join("poses.jsonl");
    let run = solve(&[
        &data("points.csv"),
        "--camera",
        &data("camera.toml"),
        "--json",
        "-o",
        out.to_str().unwrap(),
    ]);
    assert_eq!(std::fs::read_to_string(out).unwrap(), run.stdout);
}

#[test]
fn complaints_name_file_line_and_way_out() {
    let camera = data("camera.toml");
    let folder = folder("solve_complaints");
    let file = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let head = "x_m,y_m,z_m,u_px,v_px\n";
    let cases = [
        (
            file("missing.csv", "x_m,y_m,z_m,u,v_px\n1,2,3,4,5\n"),
            "missing.csv:1: no column `u_px`; the columns are x_m,y_m,z_m,u,v_px",
        ),
        (
            file("word.csv", &format!("{head}1,2,3,4,5\n1,2,three,4,5\n")),
            "word.csv:3: column `z_m` is `three`, which is not a number",
        ),
        (file("empty.csv", &format!("{head}1,2,,4,5\n")), "empty.csv:2: column `z_m` is empty"),
        (file("short.csv", &format!("{head}1,2,3\n")), "short.csv:2: 3 cells where the header has 5"),
        (file("norows.csv", head), "norows.csv: no rows"),
        (file("twice.csv", "x_m,x_m,y_m,z_m,u_px,v_px\n"), "column `x_m` appears twice"),
        (file("xn.csv", "x_m,y_m,z_m,xn,yn\n1,2,3,4,5\n"), "add --normalized"),
        (folder.join("word.cvs").display().to_string(), "did you mean"),
    ];
    for (path, wanted) in cases {
        let run = solve(&[&path, "--camera", &camera]);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{path}");
        assert!(run.stderr.contains(wanted), "{path}: {}", run.stderr);
    }
}

#[test]
fn values_that_cannot_be_are_refused() {
    let base = [data("points.csv"), "--camera".into(), data("camera.toml")];
    for (extra, wanted) in [
        (vec!["--robust", "0"], "a positive number is needed"),
        (vec!["--method", "plnar"], "did you mean `planar`"),
        (vec!["--sigma-px", "-1"], "a positive number is needed"),
    ] {
        let arguments: Vec<&str> = base.iter().map(String::as_str).chain(extra).collect();
        let run = solve(&arguments);
        assert_eq!(run.code, 2, "{wanted}");
        assert!(run.stderr.contains(wanted), "{}", run.stderr);
    }
}

#[test]
fn points_without_a_camera_are_wrong_usage() {
    assert_eq!(solve(&[&data("points.csv")]).code, 2);
}

/// Negated perspective with f = 1.5: u = −f X/Z, so a camera 2 m before the points sees (−0.15, 0.3) at (0.2, −0.4).
#[test]
fn a_photogrammetric_camera_counts_in_units_of_its_f() {
    let folder = folder("photogrammetric");
    let (camera, points) = (folder.join("camera.toml"), folder.join("points.csv"));
    let zeros = "xp = 0.0\nyp = 0.0\nk = [0.0, 0.0, 0.0]\np = [0.0, 0.0]\na = [0.0, 0.0]\n";
    std::fs::write(&camera, format!("model = \"photogrammetric\"\nf = 1.5\n{zeros}")).unwrap();
    let row =
        |x: f64, y: f64, z: f64| format!("{x},{y},{z},{},{}\n", -1.5 * x / (z + 2.0), -1.5 * y / (z + 2.0));
    let rows = [
        row(0.2, -0.4, 0.0),
        row(-0.3, 0.1, 0.1),
        row(0.5, 0.5, 0.3),
        row(-0.4, -0.2, 0.5),
        row(0.0, 0.3, 0.2),
    ];
    std::fs::write(&points, format!("x_m,y_m,z_m,u_px,v_px\n{}", rows.concat())).unwrap();
    let run = solve(&[
        points.to_str().unwrap(),
        "--camera",
        camera.to_str().unwrap(),
        "--sigma-px",
        "0.001",
        "--json",
    ]);
    let answer = &json_lines(&run)[0];
    assert_eq!((&answer["status"], &answer["image_unit"]), (&"ok".into(), &"unit of f".into()), "{answer}");
    assert!(answer["rms_unit_of_f"].is_f64(), "{answer}");
    for (i, t) in [0.0, 0.0, 2.0].iter().enumerate() {
        assert!(
            (answer["cam_from_target"]["translation_m"][i].as_f64().unwrap() - t).abs() < 1e-9,
            "{answer}"
        );
    }
}

#[test]
fn the_printed_procedure_is_called_what_it_is() {
    let run = solve(&[&data("points.csv"), "--camera", &data("camera.toml"), "--method", "wang2004"]);
    assert_eq!(run.code, 1, "the second view is no line plus one");
    assert!(
        run.stdout.contains("use method auto for the best pose")
            && run.stdout.contains("wang2004 does not fit")
    );
}

/// Rows that are equal to the last digit are one observation, however often they come: pose and ± stay as they are.
#[test]
fn equal_rows_are_one_observation() {
    let folder = folder("repeated");
    let text = std::fs::read_to_string(data("points.csv")).unwrap();
    let rows: Vec<&str> = text.lines().filter(|l| l.starts_with("box")).collect();
    let solved = |copies: usize, extra: &[&str]| {
        let path = folder.join(format!("{copies}.csv"));
        let copies = vec![&rows[..]; copies].concat();
        std::fs::write(&path, [&[text.lines().next().unwrap()], &copies[..]].concat().join("\n")).unwrap();
        let (path, camera) = (path.display().to_string(), data("camera.toml"));
        solve(&[&[path.as_str(), "--camera", &camera, "--sigma-px", "0.2"], extra].concat())
    };
    for extra in [&["--json"][..], &["--json", "--robust", "2"]] {
        let [once, copied] = [1, 6].map(|copies| solved(copies, extra));
        let [a, b] = [&once, &copied].map(|run| json_lines(run)[0].clone());
        assert_eq!((once.code, copied.code, &a["remarks"]), (0, 0, &serde_json::Value::Null), "{a}");
        for key in ["n_points", "cam_from_target", "covariance", "sigma_m", "status"] {
            assert_eq!(a[key], b[key], "{key}");
        }
        let remark = b["remarks"][0].as_str().unwrap();
        let n = rows.len();
        assert!(remark.starts_with(&format!("{} of {} rows repeat another", 5 * n, 6 * n)), "{remark}");
    }
    let words = solved(6, &[]).stdout;
    assert!(words.contains("  remark ") && words.contains("equal rows are one observation"), "{words}");
}
