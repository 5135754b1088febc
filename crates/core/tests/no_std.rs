//! The single-pose path without std and without a heap: `no_std/` is a library for a machine that has neither.

use nalgebra::{Vector2, Vector3};
use resight_core::camera::{CameraMatrix, Pinhole};
use resight_core::locate::{Config, locate};
use resight_core::{Camera, Correspondence, Lens};
use std::path::{Path, PathBuf};
use std::process::Command;

fn run(command: &mut Command) -> String {
    let done = command.output().expect("the command starts");
    assert!(done.status.success(), "{command:?}\n{}", String::from_utf8_lossy(&done.stderr));
    String::from_utf8_lossy(&done.stdout).into_owned()
}

/// The points of `no_std/main.c`.
const POINTS: [[f64; 5]; 4] = [
    [0.0, 0.0, 0.0, 535.25, 402.5],
    [0.1, 0.0, 0.0, 660.75, 411.0],
    [0.15, 0.0, 0.0, 719.5, 415.25],
    [0.0, 0.15, 0.0, 529.0, 590.5],
];

/// The library builds, which proves that no std is linked (it brings a panic handler of its own, and two are an error) and no
/// allocator is called (there is none); linked to a program in C it gives the same pose. That the path with std touches no
/// heap either, `allocation.rs` says.
#[test]
fn without_std_and_heap_the_pose_is_the_same() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("no_std");
    let target = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("no_std");
    let manifest = source.join("Cargo.toml");
    run(Command::new(env!("CARGO"))
        .args(["build", "--locked", "--manifest-path"])
        .arg(manifest)
        .arg("--target-dir")
        .arg(&target));
    let (library, program) = (target.join("debug/libresight_core_no_std.a"), target.join("locate_four"));
    run(Command::new("cc").arg(source.join("main.c")).arg(library).arg("-o").arg(&program));
    let printed: Vec<f64> =
        run(&mut Command::new(program)).lines().map(|line| line.parse().expect("a number")).collect();

    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
    let camera = Camera { lens: Lens::Pinhole(Pinhole::new(matrix).expect("a pinhole")), size: None };
    let seen = POINTS.map(|[x, y, z, u, v]| {
        Correspondence::new(&camera, Vector3::new(x, y, z), Vector2::new(u, v), 0.5).expect("in the field")
    });
    let here = locate(&seen, &camera, &Config::default()).expect("a pose").cam_from_target;
    let numbers: Vec<f64> =
        here.rotation.transpose().iter().chain(here.translation.iter()).copied().collect();
    assert_eq!(printed.len(), numbers.len());
    // Both round in their own order (another optimisation, another square root), no more.
    let apart = printed.iter().zip(&numbers).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-9, "{apart:e}");
}
