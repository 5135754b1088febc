//! `solve --method upright`: two points and the direction of down.

use crate::support::{data, folder, json_lines, resight};

/// The test data's camera (f = 1000 px, centre 640, 480) 1.5 m above a floor whose z points up, level, looking along y: down is the
/// camera's y axis. A point (x, y, z) of the floor's frame is seen at (640 + 1000 x/y, 480 + 1000 (1.5 − z)/y).
fn rows(points: &[[f64; 3]]) -> String {
    let row = |[x, y, z]: &[f64; 3]| {
        format!("{x},{y},{z},{},{}\n", 640.0 + 1000.0 * x / y, 480.0 + 1000.0 * (1.5 - z) / y)
    };
    format!("x_m,y_m,z_m,u_px,v_px\n{}", points.iter().map(row).collect::<String>())
}

/// Two points on the floor and gravity give the place, and say so with an error bar; a third point joins them.
#[test]
fn two_points_and_gravity_give_the_pose() {
    let folder = folder("upright");
    for (name, points) in [
        ("two.csv", vec![[-0.4, 5.0, 0.0], [0.6, 4.5, 0.0]]),
        ("line.csv", vec![[-0.4, 5.0, 0.0], [0.1, 5.0, 0.0], [0.6, 5.0, 0.0]]),
    ] {
        let path = folder.join(name);
        std::fs::write(&path, rows(&points)).unwrap();
        let (path, camera) = (path.display().to_string(), data("camera.toml"));
        let arguments = ["solve", &path, "--camera", &camera, "--sigma-px", "0.3", "--json"];
        let gravity = [
            "--method",
            "upright",
            "--gravity",
            "0,9.81,0",
            "--target-down",
            "0,0,-1",
            "--gravity-sigma-deg",
            "0.2",
        ];
        let run = resight(&[&arguments[..], &gravity].concat());
        assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
        let answer = &json_lines(&run)[0];
        assert_eq!((&answer["status"], &answer["method"]), (&"ok".into(), &"upright".into()), "{answer}");
        // target_from_cam: the camera stands over the origin at 1.5 m.
        for (i, wanted) in [0.0, 0.0, 1.5].iter().enumerate() {
            let t = answer["target_from_cam"]["translation_m"][i].as_f64().unwrap();
            assert!((t - wanted).abs() < 1e-6, "{name}: {answer}");
            let sigma_m = answer["sigma_m"][i].as_f64().unwrap();
            assert!(0.0 < sigma_m && sigma_m < 0.1, "{name}: {answer}");
        }
        // The other way up, the target says so.
        let upside = ["--method", "upright", "--gravity", "0,-1,0", "--target-down", "0,0,1"];
        assert_eq!(resight(&[&arguments[..], &upside].concat()).code, 0);
    }
}

#[test]
fn gravity_that_is_missing_or_wrong_is_refused_by_name() {
    let (points, camera) = (data("points.csv"), data("camera.toml"));
    let base = ["solve", &points, "--camera", &camera];
    for (extra, wanted) in [
        (vec!["--method", "upright"], "add --gravity X,Y,Z"),
        (vec!["--gravity", "0,1"], "three numbers X,Y,Z"),
        (vec!["--gravity", "0,0,0"], "three numbers X,Y,Z"),
        (vec!["--gravity", "0,1,0", "--gravity-sigma-deg", "0"], "a positive number of degrees"),
        (vec!["--gravity-sigma-deg", "1"], "--gravity"),
        (vec!["--gravity", "0,1,0"], "add --target-down 0,0,-1 where its z points up"),
        (vec!["--gravity", "0,1,0", "--method", "wang2004"], "takes no prior"),
    ] {
        let run = resight(&[&base[..], &extra].concat());
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{wanted}");
        assert!(run.stderr.contains(wanted), "{wanted}: {}", run.stderr);
    }
}
