//! `solve` with lines: two points on a line of the target, two on its image.

use crate::support::{data, folder, json_lines, resight};

const HEADER: &str = "id,x_m,y_m,z_m,u_px,v_px,x2_m,y2_m,z2_m,u2_px,v2_px,sigma_px\n";

/// Edges between the points of `data/points.csv`, whose camera is at rotation (0.3, −0.4, 0.1), translation (0.05, −0.1, 2.0) m.
const EDGES: [&str; 5] = [
    "a,0,0,0,665.1100,429.9200,0.6,0,0,908.0244,445.3783,0.1\n",
    "b,0,0.5,0,627.3148,656.0146,0,0,0.4,598.5010,385.2193,0.1\n",
    "c,0.6,0.5,0.1,837.6055,629.2989,0.3,0.2,0.5,682.1201,459.9696,0.1\n",
    "d,0.6,0,0,908.0244,445.3783,0,0.5,0,627.3148,656.0146,0.1\n",
    "e,0,0,0.4,598.5010,385.2193,0.6,0.5,0.1,837.6055,629.2989,0.1\n",
];

fn solve(name: &str, rows: &str, extra: &[&str]) -> crate::support::Run {
    let file = folder(&format!("lines_{name}")).join("edges.csv");
    std::fs::write(&file, format!("{HEADER}{rows}")).unwrap();
    let camera = data("camera.toml");
    resight(&[&["solve", file.to_str().unwrap(), "--camera", &camera, "--json"], extra].concat())
}

/// The answer on the edges of the points.
pub fn edges(name: &str, extra: &[&str]) -> crate::support::Run {
    solve(name, &EDGES.concat(), extra)
}

/// The pose is that of the points, whether the two image points are the images of the two target points or lie elsewhere on the line.
#[test]
fn edges_give_the_pose_and_points_among_them_join() {
    let point = "p,0.3,0.2,0.5,682.1201,459.9696,,,,,,0.1\n";
    let slid = EDGES[0].replace("908.0244,445.3783", "786.5672,437.64915");
    for (name, rows, n) in [
        ("edges", EDGES.concat(), [0, 5]),
        ("slid", format!("{slid}{}", EDGES[1..].concat()), [0, 5]),
        ("mixed", format!("{}{point}", EDGES[..3].concat()), [1, 3]),
    ] {
        let run = solve(name, &rows, &[]);
        let answer = &json_lines(&run)[0];
        assert_eq!((&answer["status"], &answer["method"]), (&"ok".into(), &"lines".into()), "{answer}");
        assert_eq!((&answer["n_points"], &answer["n_lines"]), (&n[0].into(), &n[1].into()));
        for (i, t) in [0.05, -0.1, 2.0].iter().enumerate() {
            let (found, sigma_m) = (
                &answer["cam_from_target"]["translation_m"][i],
                answer["sigma_translation_m"][i].as_f64().unwrap(),
            );
            assert!(
                (found.as_f64().unwrap() - t).abs() < 4.0 * sigma_m + 1e-5 && sigma_m < 0.02,
                "{name}: {answer}"
            );
        }
    }
}

/// Uncertain intrinsics widen the covariance as they do with points.
#[test]
fn uncertain_intrinsics_widen_it() {
    let sigma = |extra: &[&str]| {
        let run = solve("intrinsics", &EDGES.concat(), extra);
        json_lines(&run)[0]["sigma_m"][2].as_f64().unwrap()
    };
    let (exact, uncertain) = (sigma(&[]), sigma(&["--intrinsics-sigma", "fx_px=10,fy_px=10"]));
    // Focal lengths one after another, each 1 % off: about 1 % of 2 m.
    assert!(exact < 0.002 && (0.003..0.06).contains(&uncertain), "{exact} {uncertain}");
}

#[test]
fn what_does_not_do_is_said() {
    let two = solve("two", &EDGES[..2].concat(), &[]);
    let answer = &json_lines(&two)[0];
    assert_eq!((two.code, &answer["status"]), (1, &"degenerate".into()));
    assert!(answer["message"].as_str().unwrap().contains("2 lines and 0 points given"), "{answer}");
    for (name, row, wanted) in [
        ("image", "f,0,0,0,665,429,0.6,0,0,665,429,0.1\n", "one in the image"),
        ("space", "f,0,0,0,665,429,0,0,0,765,429,0.1\n", "one in the target"),
    ] {
        let run = solve(name, &format!("{}{row}", EDGES.concat()), &[]);
        let answer = &json_lines(&run)[0];
        let message = answer["message"].as_str().unwrap();
        assert_eq!(answer["status"], "error");
        assert!(message.contains("line 7") && message.contains(wanted), "{message}");
    }
    let wrong = EDGES.concat().replace("837.6055,629.2989,0.3", "857.6055,629.2989,0.3");
    let answer = &json_lines(&solve("wrong", &wrong, &[]))[0];
    assert_eq!(
        (&answer["status"], &answer["worst_point"]["name"]),
        (&"inconsistent".into(), &"c".into()),
        "{answer}"
    );
    let short = solve("short", "f,0,0,0,665,429,0.6,0,,,,0.1\n", &[]);
    assert!(short.code == 2 && short.stderr.contains("column `z2_m` is empty"), "{}", short.stderr);
    let run = solve("robust", &EDGES.concat(), &["--robust", "3"]);
    let message = json_lines(&run)[0]["message"].as_str().unwrap().to_owned();
    assert!(message.contains("without --robust"), "{message}");
}
