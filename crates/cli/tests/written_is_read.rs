//! What one command writes, the others read that say so: each file of `-o` goes through every command that takes its kind.

use crate::support::{Run, folder, resight};

fn repository(name: &str) -> String {
    format!("{}/../../{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Runs a command that must answer; 1 is an answer that is not to be relied on.
fn answered(words: &[&str], codes: &[i32]) -> Run {
    let run = resight(words);
    assert!(codes.contains(&run.code), "{words:?}: {} {}", run.code, run.stderr);
    run
}

/// A file of a rig in the commands that read rigs; `stated` where the format holds no covariance.
fn rig_is_read(file: &str, stated: &[&str]) {
    let unmoved = answered(&[&["compare", file, file], stated].concat(), &[0]);
    assert!(!unmoved.stdout.is_empty(), "{file}");
    answered(&["explain", file], &[0]);
}

#[test]
fn a_rig_is_compared_explained_and_converted() {
    let (folder, at) = (folder("written_rig"), |name: &str| repository(&format!("examples/rig/{name}")));
    let path = |name: &str| folder.join(name).display().to_string();
    let (toml, json, converted) = (path("rig.toml"), path("rig.json"), path("array.toml"));
    let (cameras, detections) = (at("cameras.toml"), at("detections.csv"));
    let run =
        answered(&["rig", "--camera", &cameras, "--detections", &detections, "-o", &toml, "--json"], &[0, 1]);
    std::fs::write(&json, &run.stdout).unwrap();
    rig_is_read(&toml, &[]);
    answered(&["compare", &json, &toml], &[0]);
    answered(&["convert", &toml, "--to", "caliscope", "-o", &converted], &[0]);
    rig_is_read(&converted, &["--sigma-mm", "0.5", "--sigma-deg", "0.02"]);
}

/// Poses without lenses are a rig for `compare`, as `pose-graph` writes them.
#[test]
fn poses_alone_are_compared_and_explained() {
    let folder = folder("written_pose_graph");
    let path = |name: &str| folder.join(name).display().to_string();
    let (pairs, first, moved) = (path("pairs.csv"), path("a.toml"), path("b.toml"));
    let rows = |x_m: &str| {
        format!(
            "a,b,qw,qx,qy,qz,x_m,y_m,z_m,sigma_deg,sigma_mm\nc1,c0,1,0,0,0,{x_m},0,0,0.1,2\nc2,c0,1,0,0,0,-2,0.001,0,0.1,2\n\
            c2,c1,1,0,0,0,-1,0.001,0,0.1,2\n"
        )
    };
    for (x_m, file) in [("-1", &first), ("-1.003", &moved)] {
        std::fs::write(&pairs, rows(x_m)).unwrap();
        answered(&["pose-graph", &pairs, "-o", file], &[0]);
        rig_is_read(file, &[]);
    }
    std::fs::write(&pairs, rows("-1").replace("-2,", "-2.5,").replace("-1,0.001", "-1.5,0.001")).unwrap();
    answered(&["pose-graph", &pairs, "-o", &moved], &[0]);
    answered(&["compare", &first, &moved], &[3]);
}

#[test]
fn intrinsics_poses_and_targets_are_read_on() {
    let (folder, at) = (folder("written_camera"), |name: &str| repository(&format!("examples/photo/{name}")));
    let path = |name: &str| folder.join(name).display().to_string();
    let (camera, poses, sheet) = (path("camera.toml"), path("poses.jsonl"), path("sheet.pdf"));
    let (board, images) = (at("board.toml"), at("left0*.jpg"));
    answered(&["intrinsics", &images, "--target", &board, "-o", &camera], &[0]);
    answered(&["explain", &camera], &[0]);
    answered(&["locate", &images, "--camera", &camera, "--target", &board, "-o", &poses], &[0]);
    answered(&["compare", &poses, &poses], &[0]);
    answered(
        &[
            "print",
            "--kind",
            "chessboard",
            "--rows",
            "6",
            "--columns",
            "9",
            "--square-m",
            "0.025",
            "-o",
            &sheet,
        ],
        &[0],
    );
    answered(&["explain", &path("sheet.toml")], &[0]);
    answered(&["detect", &at("left01.jpg"), "--target", &path("sheet.toml")], &[0]);
}
