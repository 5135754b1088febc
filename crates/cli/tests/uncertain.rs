//! Uncertain intrinsics and uncertain points: the covariance grows as re-solving with other values says it must.

use crate::support::{data, demo, folder, json_lines, resight};
use serde_json::Value;

/// The first answer of a `solve`.
fn solved(points: &str, camera: &str, extra: &[&str]) -> Value {
    let run = resight(&[&["solve", points, "--camera", camera, "--json"], extra].concat());
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    json_lines(&run).remove(0)
}

fn covariance(answer: &Value) -> [[f64; 6]; 6] {
    serde_json::from_value(answer["covariance"].clone()).unwrap()
}

/// Rotation and translation.
fn pose(transform: &Value) -> ([[f64; 3]; 3], [f64; 3]) {
    let m: [[f64; 4]; 4] = serde_json::from_value(transform["matrix"].clone()).unwrap();
    (std::array::from_fn(|i| std::array::from_fn(|j| m[i][j])), std::array::from_fn(|i| m[i][3]))
}

/// The small left motion ξ of `cam_from_target` with b ≈ Exp(ξ) a, to first order.
fn motion(a: &Value, b: &Value) -> [f64; 6] {
    motion_of(&a["cam_from_target"], &b["cam_from_target"])
}

fn motion_of(a: &Value, b: &Value) -> [f64; 6] {
    let ((ra, ta), (rb, tb)) = (pose(a), pose(b));
    let d: [[f64; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| rb[i][k] * ra[j][k]).sum()));
    let turn = [(d[2][1] - d[1][2]) / 2.0, (d[0][2] - d[2][0]) / 2.0, (d[1][0] - d[0][1]) / 2.0];
    let shift = |i: usize| tb[i] - (0..3).map(|j| d[i][j] * ta[j]).sum::<f64>();
    [turn[0], turn[1], turn[2], shift(0), shift(1), shift(2)]
}

const CAMERA: [(&str, f64); 4] = [("fx_px", 1000.0), ("fy_px", 1000.0), ("cx_px", 640.0), ("cy_px", 480.0)];

/// The camera of the test data with one parameter moved.
fn camera_with(folder: &std::path::Path, moved: &str, by: f64) -> String {
    let mut text = "model = \"pinhole\"\nwidth_px = 1280\nheight_px = 960\n".to_string();
    for (name, value) in CAMERA {
        text += &format!("{name} = {}\n", value + if name == moved { by } else { 0.0 });
    }
    let path = folder.join(format!("{moved}{by}.toml"));
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// Σ_with − Σ_without is Σ σ² ∂ξ/∂θ ∂ξ/∂θᵀ over the parameters, ∂ξ/∂θ by solving again with θ ± h.
#[test]
fn uncertain_intrinsics_add_what_solving_again_says() {
    let folder = folder("uncertain_intrinsics");
    let (points, camera) = (data("points.csv"), data("camera.toml"));
    let sigmas = [("fx_px", 0.8), ("fy_px", 0.7), ("cx_px", 0.5), ("cy_px", 0.4)];
    let flag: Vec<String> = sigmas.iter().map(|(name, s)| format!("{name}={s}")).collect();
    let exact = solved(&points, &camera, &[]);
    let uncertain = solved(&points, &camera, &["--intrinsics-sigma", &flag.join(",")]);
    let mut wanted = [[0.0; 6]; 6];
    for (name, sigma) in sigmas {
        let h = 0.01;
        let at = |by: f64| solved(&points, &camera_with(&folder, name, by), &[]);
        let xi = motion(&at(-h), &at(h)).map(|x| x / (2.0 * h) * sigma);
        for i in 0..6 {
            for j in 0..6 {
                wanted[i][j] += xi[i] * xi[j];
            }
        }
    }
    let (a, b) = (covariance(&exact), covariance(&uncertain));
    for i in 0..6 {
        for j in 0..6 {
            let size = (wanted[i][i] * wanted[j][j]).sqrt();
            let added = b[i][j] - a[i][j];
            assert!((added - wanted[i][j]).abs() < 0.02 * size, "({i}, {j}): {added} for {}", wanted[i][j]);
        }
    }
    assert_eq!(uncertain["intrinsics_sigma"]["fx_px"], 0.8);
    assert!(exact["intrinsics_sigma"].is_null() && exact["cam_from_target"] == uncertain["cam_from_target"]);
}

/// The six points of the test data's box, every cell of a column filled with one value.
fn box_with(folder: &std::path::Path, name: &str, column: &str, value: &str) -> String {
    let text = std::fs::read_to_string(data("points.csv")).unwrap();
    let rows: Vec<&str> = text.lines().filter(|l| l.starts_with("box")).collect();
    let rows: String =
        rows.iter().map(|row| format!("{},{value}\n", &row[..row.rfind(',').unwrap()])).collect();
    let path = folder.join(name);
    std::fs::write(&path, format!("view,x_m,y_m,z_m,u_px,v_px,{column}\n{rows}")).unwrap();
    path.display().to_string()
}

/// Points so badly surveyed that the pixels hardly count: twice the sigma, four times the covariance.
#[test]
fn uncertain_points_widen_the_covariance() {
    let folder = folder("uncertain_points");
    let camera = data("camera.toml");
    let at = |sigma_m: &str| {
        solved(
            &box_with(&folder, &format!("{sigma_m}.csv"), "sigma_m", sigma_m),
            &camera,
            &["--sigma-px", "0.001"],
        )
    };
    let (one, two) = (at("0.01"), at("0.02"));
    let (a, b) = (covariance(&one), covariance(&two));
    for i in 0..6 {
        assert!((b[i][i] / a[i][i] / 4.0 - 1.0).abs() < 0.02, "{i}: {} {}", a[i][i], b[i][i]);
    }
    assert_eq!(two["point_sigma_m"], 0.02);
    let exact = solved(&box_with(&folder, "exact.csv", "sigma_px", "0.1"), &camera, &[]);
    assert!(exact["point_sigma_m"].is_null());
    assert!((0..6).all(|i| 100.0 * covariance(&exact)[i][i] < a[i][i]), "{exact}");
}

/// Σ = Σ σ_m² ∂ξ/∂X ∂ξ/∂Xᵀ over all coordinates of all points, ∂ξ/∂X by solving again with each coordinate at ± h; the
/// pixels' own share, a ten-thousandth of it, is left out.
#[test]
fn uncertain_points_add_what_solving_again_says() {
    let folder = folder("moved_points");
    let (sigma_m, h) = (0.002, 1e-4);
    let text = std::fs::read_to_string(data("points.csv")).unwrap();
    let cells = |row: &str| row.split(',').skip(1).map(|x| x.parse().unwrap()).collect::<Vec<f64>>();
    let rows: Vec<Vec<f64>> = text.lines().filter(|l| l.starts_with("box")).map(cells).collect();
    let mut file = "view,x_m,y_m,z_m,u_px,v_px,sigma_px,sigma_m\n".to_string();
    let mut view = |name: usize, moved: usize, by: f64| {
        for (i, row) in rows.iter().enumerate() {
            let x = |axis: usize| row[axis] + if moved == 3 * i + axis { by } else { 0.0 };
            let (u, v) = (row[3], row[4]);
            file += &format!("{name},{},{},{},{u},{v},0.01,{sigma_m}\n", x(0), x(1), x(2));
        }
    };
    let n = 3 * rows.len();
    view(0, n, 0.0);
    for k in 0..n {
        view(2 * k + 1, k, -h);
        view(2 * k + 2, k, h);
    }
    let path = folder.join("moved.csv");
    std::fs::write(&path, file).unwrap();
    let run = resight(&["solve", path.to_str().unwrap(), "--camera", &data("camera.toml"), "--json"]);
    let answers = json_lines(&run);
    let mut wanted = [[0.0; 6]; 6];
    for k in 0..n {
        let xi = motion(&answers[2 * k + 1], &answers[2 * k + 2]).map(|x| x / (2.0 * h) * sigma_m);
        for i in 0..6 {
            for j in 0..6 {
                wanted[i][j] += xi[i] * xi[j];
            }
        }
    }
    let said = covariance(&answers[0]);
    for i in 0..6 {
        for j in 0..6 {
            let size = (wanted[i][i] * wanted[j][j]).sqrt();
            assert!(
                (said[i][j] - wanted[i][j]).abs() < 0.03 * size,
                "({i}, {j}): {} {}",
                said[i][j],
                wanted[i][j]
            );
        }
    }
}

#[test]
fn a_wrong_name_is_reported_the_right_one() {
    let (points, camera) = (data("points.csv"), data("camera.toml"));
    for (given, wanted) in [
        ("fxpx=1", "the pinhole parameters are fx_px, fy_px, cx_px, cy_px; did you mean `fx_px`?"),
        ("k1=0.1", "there is no pinhole parameter `k1`; the pinhole parameters are fx_px"),
        ("fx_px", "NAME=S is needed"),
        ("fx_px=-1", "a number of 0 or more is needed"),
        ("fx_px=1,fx_px=2", "given twice"),
    ] {
        let run = resight(&["solve", &points, "--camera", &camera, "--intrinsics-sigma", given]);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{given}");
        assert!(run.stderr.contains(wanted), "{given}: {}", run.stderr);
    }
    let run = resight(&["solve", &data("normalized.csv"), "--normalized", "--intrinsics-sigma", "fx_px=1"]);
    assert!(run.code == 2 && run.stderr.contains("needs a camera"), "{}", run.stderr);
}

/// A lens coefficient by name, and the widening as `locate` prints it.
#[test]
fn locate_takes_uncertain_intrinsics_too() {
    let base = [
        "locate",
        &demo("left.png"),
        "--camera",
        &demo("left.toml"),
        "--target",
        &demo("dots.toml"),
        "--json",
    ];
    let exact = json_lines(&resight(&base)).remove(0);
    let run = resight(&[base.as_slice(), &["--intrinsics-sigma", "fx_px=2,fy_px=2,k1=0.01"]].concat());
    let uncertain = json_lines(&run).remove(0);
    let depth = |answer: &Value| answer["sigma_m"][2].as_f64().unwrap();
    // Two pixels in 742 of focal length are that share of 0.7 m, nearly all of it along the line of sight.
    assert!((1e-3..4e-3).contains(&depth(&uncertain)) && depth(&exact) < 2e-4, "{uncertain}");
    assert_eq!(uncertain["intrinsics_sigma"]["k1"], 0.01);
}

/// A camera's file says how well its intrinsics are known: the same as the flag, and a pose with its cost in words.
#[test]
fn the_camera_file_states_the_same_as_the_flag() {
    let folder = folder("stated_in_file");
    let points = data("points.csv");
    let file = folder.join("camera.toml");
    let text = std::fs::read_to_string(data("camera.toml")).unwrap();
    std::fs::write(&file, format!("{text}\nintrinsics_sigma = {{ fx_px = 0.8, cy_px = 0.4 }}\n")).unwrap();
    let file = file.display().to_string();
    let by_file = solved(&points, &file, &[]);
    let by_flag = solved(&points, &data("camera.toml"), &["--intrinsics-sigma", "fx_px=0.8,cy_px=0.4"]);
    assert_eq!(by_file, by_flag);
    let cost = &by_file["intrinsics_cost"];
    let number = |key: &str| cost[key].as_f64().expect("a number");
    assert!(number("with_exact_intrinsics_m") < number("position_sigma_m"), "{cost}");
    assert!(number("by_that_alone_m") <= number("position_sigma_m") * 1.000_001, "{cost}");
    let words = resight(&["solve", &points, "--camera", &file]).stdout;
    assert!(words.contains("intrinsics  ") && words.contains("with exact ones"), "{words}");
    // The printed procedure takes the intrinsics as exact, whatever their file says.
    let printed = resight(&["solve", &points, "--camera", &file, "--method", "wang2004", "--json"]);
    assert!(json_lines(&printed).iter().all(|answer| answer["intrinsics_sigma"].is_null()));
}

/// The camera's place on the gripper, where fx is known to 2 px: what the answer gains is what solving with fx ± 2 px says.
#[test]
fn hand_eye_holds_what_the_lens_does() {
    let (folder, root) =
        (folder("uncertain_hand_eye"), concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/hand_eye"));
    let text = std::fs::read_to_string(format!("{root}/camera.toml")).unwrap();
    let answer = |name: &str, camera: String| -> Value {
        let file = folder.join(format!("{name}.toml"));
        std::fs::write(&file, camera).unwrap();
        let run = resight(&[
            "hand-eye",
            "--motions",
            &format!("{root}/motions.csv"),
            "--detections",
            &format!("{root}/detections.csv"),
            "--camera",
            &format!("cam={}", file.display()),
            "--json",
        ]);
        json_lines(&run).remove(0)
    };
    let exact = answer("exact", text.clone());
    let uncertain = answer("uncertain", format!("{text}\nintrinsics_sigma = {{ fx_px = 2.0 }}\n"));
    let with = |fx: &str| answer(fx, text.replace("fx_px = 800.0", &format!("fx_px = {fx}")));
    let (plus, minus) = (with("802.0"), with("798.0"));
    let key = "cam_from_gripper";
    let change = motion_of(&minus[key], &plus[key]).map(|x| 0.5 * x);
    let covariance = |answer: &Value| -> [[f64; 6]; 6] {
        serde_json::from_value(answer[key]["covariance"].clone()).unwrap()
    };
    let (a, b) = (covariance(&exact), covariance(&uncertain));
    let largest = change[3..].iter().fold(0.0f64, |most, x| most.max(x.abs()));
    for i in 3..6 {
        let added = b[i][i] - a[i][i];
        assert!(
            (added - change[i] * change[i]).abs() < 0.1 * largest * largest,
            "{i}: {added} {}",
            change[i]
        );
    }
    assert!(largest * largest > a[5][5], "the lens costs more than the pixels: {largest}");
}
