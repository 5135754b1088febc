//! `rig-pose` as a user runs it: a made-up rig of three cameras with wrong input of all kinds, and photographs of a real stereo pair.

use crate::budget::parts;
use crate::support::{Run, folder, json_lines, resight};
use resight_core::camera::{CameraMatrix, Pinhole};
use resight_core::{Camera, Lens, Point, Pose};
use serde_json::Value;
use std::path::Path;

const SIZE: [f64; 2] = [1280.0, 960.0];
const F_PX: f64 = 900.0;

/// Three cameras, 0.6 m apart, the outer two turned inwards.
fn cameras() -> [(&'static str, Pose); 3] {
    let at = |yaw: f64, x: f64| {
        let rotation = Pose::exp(&[0.0, yaw, 0.0, 0.0, 0.0, 0.0].into()).rotation;
        Pose::new(rotation, -(rotation * Point::new(x, 0.0, 0.0)))
    };
    [("left", at(-0.15, -0.6)), ("middle", at(0.0, 0.0)), ("right", at(0.15, 0.6))]
}

fn rig_file(intrinsics_sigma: &str) -> String {
    let one = |(name, cam_from_rig): &(&str, Pose)| {
        let place = format!(
            "placement = {{ b = \"{name}\", a = \"rig\", rotation_wxyz = {:?}, translation_m = {:?} }}\n",
            cam_from_rig.quaternion_wxyz(),
            [cam_from_rig.translation.x, cam_from_rig.translation.y, cam_from_rig.translation.z]
        );
        format!(
            "[[camera]]\nname = \"{name}\"\nmodel = \"pinhole\"\nwidth_px = 1280\nheight_px = 960\nfx_px = {F_PX:?}\nfy_px = {F_PX:?}\ncx_px = 639.5\ncy_px = 479.5\n{intrinsics_sigma}{place}\n"
        )
    };
    cameras().iter().map(one).collect()
}

fn truth() -> Pose {
    Pose::exp(&[0.2, -0.3, 0.1, 0.1, -0.05, 3.0].into())
}

/// Twelve points a camera, to 0.2 px.
fn rows(wrong: impl Fn(usize) -> bool, unit: f64, wanted: &str) -> String {
    let matrix = CameraMatrix { fx_px: F_PX, fy_px: F_PX, cx_px: 639.5, cy_px: 479.5 };
    let lens = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
    let mut text = "camera,view,id,x_m,y_m,z_m,u_px,v_px,sigma_px\n".to_string();
    let noise = |i: usize| 0.2 * ((i as f64 * 12.9898).sin() * 43758.5453).fract();
    let mut i = 0;
    for (name, cam_from_rig) in cameras().iter().filter(|(name, _)| wanted.contains(name)) {
        for k in 0..12 {
            let angle = f64::from(k) * 2.399 + if *name == "left" { 0.4 } else { 0.0 };
            let x = Point::new(0.5 * angle.cos(), 0.4 * angle.sin(), 0.25 * (1.7 * angle).sin());
            let pixel = lens.project(&(*cam_from_rig * (truth() * x))).unwrap();
            i += 1;
            let far = if wrong(i) { 150.0 + 20.0 * f64::from(k) } else { 0.0 };
            let (u, v) =
                ((pixel.x + noise(i) + far) % SIZE[0], (pixel.y + noise(i + 500) + 0.7 * far) % SIZE[1]);
            let x = x * unit;
            text += &format!("{name},a,{k},{:?},{:?},{:?},{u:.3},{v:.3},0.2\n", x.x, x.y, x.z);
        }
    }
    text
}

fn run(name: &str, rig: &str, points: &str, further: &[&str]) -> Run {
    let folder = folder(&format!("rig_pose_{name}"));
    let write = |file: &str, text: &str| {
        let path = folder.join(file);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let (rig, points) = (write("rig.toml", rig), write("points.csv", points));
    resight(&[&["rig-pose", &points, "--rig", &rig, "--json"], further].concat())
}

fn answer(run: &Run) -> Value {
    json_lines(run).pop().unwrap_or_else(|| panic!("{}", run.stderr))
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    core::array::from_fn(|i| value[i].as_f64().unwrap())
}

/// Metres from the truth, and the standard deviation of the position in its worst direction at most.
fn off(answer: &Value) -> (f64, f64) {
    let place: [f64; 3] = numbers(&answer["target_from_rig"]["translation_m"]);
    let sigma: [f64; 3] = numbers(&answer["sigma_m"]);
    ((Point::from(place) - truth().origin()).norm(), sigma.iter().map(|s| s * s).sum::<f64>().sqrt())
}

const ALL: &str = "left middle right";

#[test]
fn a_rig_is_located_within_its_error_bar() {
    let run_all = run("all", &rig_file(""), &rows(|_| false, 1.0, ALL), &[]);
    assert_eq!(run_all.code, 0, "{}{}", run_all.stdout, run_all.stderr);
    let all = answer(&run_all);
    let (error, sigma) = off(&all);
    assert!(error < 3.5 * sigma && sigma < 0.004, "{error} ± {sigma}");
    assert_eq!((all["n_points"].as_u64(), all["cameras"].as_array().map(Vec::len)), (Some(36), Some(3)));
    assert!(all["sigma_exact_intrinsics_m"].is_null());

    // One camera alone still locates the rig, less well; a camera that sees nothing is not missed.
    let one = answer(&run("one", &rig_file(""), &rows(|_| false, 1.0, "middle"), &[]));
    assert_eq!(one["status"], "ok");
    let (error, alone) = off(&one);
    assert!(error < 3.5 * alone && sigma < alone, "{error} ± {alone}, together {sigma}");

    // Uncertain intrinsics widen every ±, and the answer says by how much.
    let uncertain = rig_file("intrinsics_sigma = { fx_px = 4.0, fy_px = 4.0, cx_px = 3.0, cy_px = 3.0 }\n");
    let wide = answer(&run("uncertain", &uncertain, &rows(|_| false, 1.0, ALL), &[]));
    let exact: [f64; 3] = numbers(&wide["sigma_exact_intrinsics_m"]);
    assert!(2.0 * sigma < off(&wide).1, "{wide}");
    assert_eq!(parts(&wide), ["pixels", "lens"]);
    // The pose is another one by less than its ±: the cameras weigh what their lenses allow.
    assert!((exact.iter().map(|s| s * s).sum::<f64>().sqrt() / sigma - 1.0).abs() < 0.02, "{wide}");
}

/// Equal rows are one observation; rows of another camera are others.
#[test]
fn equal_rows_count_once() {
    let text = rows(|_| false, 1.0, ALL);
    let (header, body) = text.split_once('\n').unwrap();
    let once = answer(&run("once", &rig_file(""), &text, &[]));
    let copied = run("copied", &rig_file(""), &format!("{header}\n{body}{body}"), &[]);
    let twice = answer(&copied);
    assert_eq!((copied.code, &once["covariance"]), (0, &twice["covariance"]), "{twice}");
    assert_eq!(once["target_from_rig"], twice["target_from_rig"]);
    assert!(twice["remarks"][0].as_str().unwrap().starts_with("36 of 72 rows repeat"), "{twice}");
}

#[test]
fn wrong_correspondences_are_found_or_not_ok() {
    let third = |i: usize| i.is_multiple_of(3);
    let plain = run("third", &rig_file(""), &rows(third, 1.0, ALL), &[]);
    assert_eq!(
        (plain.code, answer(&plain)["status"].as_str()),
        (1, Some("inconsistent")),
        "{}",
        plain.stdout
    );
    assert!(plain.stdout.contains("--robust"), "{}", plain.stdout);
    let robust = run("robust", &rig_file(""), &rows(third, 1.0, ALL), &["--robust", "1"]);
    let found = answer(&robust);
    assert_eq!(robust.code, 0, "{found}");
    let inliers: Vec<u64> =
        found["agreement"]["inliers"].as_array().unwrap().iter().map(|i| i.as_u64().unwrap()).collect();
    let good: Vec<u64> = (0..36).filter(|row: &u64| !(row + 1).is_multiple_of(3)).collect();
    assert_eq!(inliers, good);
    let (error, sigma) = off(&found);
    assert!(error < 3.5 * sigma, "{error} ± {sigma}");

    // More than half wrong: a pose may be found, but nobody should rely on it unseen.
    let most = |i: usize| i % 9 < 5;
    let run_most = run("most", &rig_file(""), &rows(most, 1.0, ALL), &["--robust", "1"]);
    assert!(run_most.code == 1 && answer(&run_most)["status"] != "ok", "{}", run_most.stdout);
    // A camera that contradicts the others by all its points was moved.
    let moved = run("moved", &rig_file(""), &rows(|i| 24 < i, 1.0, ALL), &["--robust", "1"]);
    let said = answer(&moved);
    assert_eq!(said["status"], "inconsistent", "{said}");
    assert!(said["message"].as_str().unwrap().contains("camera right"), "{said}");
}

#[test]
fn wrong_input_is_named() {
    let good = rows(|_| false, 1.0, ALL);
    let refused = |run: &Run, wanted: &str| {
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{wanted}: {}", run.stderr);
        assert!(run.stderr.contains(wanted), "{wanted}: {}", run.stderr);
    };
    refused(&run("unknown", &rig_file(""), &good.replace("middle", "midle"), &[]), "did you mean `middle`?");
    refused(&run("no_column", &rig_file(""), &good.replace("camera,", "kamera,"), &[]), "camera");
    let intrinsics_only: String = rig_file("")
        .lines()
        .filter(|line| !line.starts_with("placement"))
        .map(|line| format!("{line}\n"))
        .collect();
    refused(&run("no_poses", &intrinsics_only, &good, &[]), "states no poses");

    let few: String = good.lines().take(3).map(|line| format!("{line}\n")).collect();
    let said = answer(&run("few", &rig_file(""), &few, &[]));
    assert_eq!(said["status"], "degenerate", "{said}");
    // Millimetres in columns of metres.
    let mm = run("mm", &rig_file(""), &rows(|_| false, 1000.0, ALL), &[]);
    assert!(mm.code == 1 && answer(&mm)["status"] != "ok", "{}", mm.stdout);
    let broken = good.replacen("0.2\n", "-1\n", 1);
    let said = answer(&run("sigma", &rig_file(""), &broken, &[]));
    assert!(said["status"] == "error" && said["message"].as_str().unwrap().contains("line 2"), "{said}");
}

/// A stereo pair of real photographs: the rig is calibrated on five views and located on others. Its pose agrees with the poses of either
/// camera alone, to within both ±.
#[test]
fn a_real_stereo_pair_agrees_with_each_of_its_cameras() {
    let photo = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/photo");
    let file = |name: &str| photo.join(name).display().to_string();
    let folder = folder("rig_pose_real");
    let rig = folder.join("rig.toml").display().to_string();
    let [left, right, board] = ["left.yml", "right.yml", "board.toml"].map(file);
    let solved = resight(&[
        "rig",
        "--camera",
        &format!("left={left}"),
        "--camera",
        &format!("right={right}"),
        "--target",
        &board,
        "--images",
        &format!("left={}", file("left0[1-5].jpg")),
        "--images",
        &format!("right={}", file("right0[1-5].jpg")),
        "-o",
        &rig,
    ]);
    assert_eq!(solved.code, 0, "{}{}", solved.stdout, solved.stderr);
    let mut compared = 0;
    for view in ["06", "07", "08"] {
        let mut table = "camera,view,x_m,y_m,z_m,u_px,v_px,sigma_px\n".to_string();
        let mut alone = Vec::new();
        for (name, camera) in [("left", &left), ("right", &right)] {
            let image = file(&format!("{name}{view}.jpg"));
            let seen = &json_lines(&resight(&["detect", &image, "--target", &board, "--json"]))[0];
            for d in seen["detections"].as_array().unwrap() {
                let (id, number) = (d["id"].as_f64().unwrap(), |key: &str| d[key].as_f64().unwrap());
                let square_m = 0.025;
                let (x, y) = (square_m * (id % 9.0), square_m * (id / 9.0).floor());
                table += &format!("{name},{view},{x},{y},0,{},{},0.2\n", number("u_px"), number("v_px"));
            }
            alone.push(
                json_lines(&resight(&["locate", &image, "--camera", camera, "--target", &board, "--json"]))
                    [0]
                .clone(),
            );
        }
        let points = folder.join(format!("{view}.csv"));
        std::fs::write(&points, &table).unwrap();
        let together = answer(&resight(&["rig-pose", points.to_str().unwrap(), "--rig", &rig, "--json"]));
        assert_eq!(together["status"], "ok", "{together}");
        // The rig's frame is that of its reference camera, the left one.
        let place = |pose: &Value| Point::from(numbers::<3>(&pose["translation_m"]));
        let norm = |s: [f64; 3]| s.iter().map(|x| x * x).sum::<f64>().sqrt();
        let (rig_at, left_at) = (place(&together["target_from_rig"]), place(&alone[0]["target_from_cam"]));
        let sigma = norm(numbers(&together["sigma_m"])).hypot(norm(numbers(&alone[0]["sigma_m"])));
        let apart = (rig_at - left_at).norm();
        println!("{view}: {:.2} mm apart, ± {:.2} mm", 1e3 * apart, 1e3 * sigma);
        assert!(apart < 3.5 * sigma, "{view}: {apart} m apart, ± {sigma} m");
        compared += 1;
    }
    assert_eq!(compared, 3);
}

/// The page's command runs as printed, in the root of the repository, and prints what the page shows.
#[test]
#[cfg(unix)]
fn the_page_shows_what_the_command_prints() {
    use crate::book_support::{self, Piece, is_shown};
    let page = std::fs::read_to_string(book_support::root().join("docs/rigs.md")).unwrap();
    let mut pieces = book_support::pieces(&page).into_iter();
    let line = pieces.find_map(|piece| match piece {
        Piece::Commands(commands) => {
            commands.into_iter().map(|c| c.line).find(|line| line.starts_with("resight rig-pose"))
        }
        Piece::File { .. } | Piece::Printed(_) => None,
    });
    let Some(Piece::Printed(shown)) = pieces.next() else { panic!("the page shows no answer") };
    let words = line.unwrap();
    let program = assert_cmd::cargo::cargo_bin("resight");
    let run = std::process::Command::new(program)
        .args(words.split(' ').skip(1))
        .current_dir(book_support::root())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&run.stdout).into_owned();
    assert_eq!(run.status.code(), Some(0), "{said}{}", String::from_utf8_lossy(&run.stderr));
    let (said, shown): (Vec<&str>, Vec<&str>) = (said.trim_end().lines().collect(), shown.lines().collect());
    assert!(is_shown(&said, &shown), "printed {said:#?}\nshown {shown:#?}");
}
