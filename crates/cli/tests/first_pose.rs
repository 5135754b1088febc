//! From an empty folder to a pose: the demo of the guide, its commands typed again, and the guide itself.

use crate::book_support;
use crate::support::{folder, resight};
use serde_json::Value;
use std::path::Path;
use std::process::Output;

/// A line as a shell takes it, in a folder.
fn typed(line: &str, folder: &Path) -> Output {
    let program = assert_cmd::cargo::cargo_bin("resight");
    let path = std::env::var("PATH").unwrap_or_default();
    let path = format!("{}:{path}", program.parent().unwrap().display());
    std::process::Command::new("sh")
        .args(["-c", line])
        .current_dir(folder)
        .env("PATH", path)
        .output()
        .unwrap()
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The demo in an empty folder: every answer agrees with the truth, which the exit status says and the figures are held against; its
/// commands, typed again where it was started, give the same camera and pose.
#[test]
#[cfg(unix)]
fn the_commands_of_the_demo_lead_to_a_pose() {
    let folder = folder("first_pose");
    let demo = typed("resight demo --first-pose --json", &folder);
    assert_eq!(demo.status.code(), Some(0), "{}{}", words(&demo), String::from_utf8_lossy(&demo.stderr));
    let answers: Vec<Value> = words(&demo).lines().map(crate::support::answer).collect();
    let [.., pose, beside_truth] = answers.as_slice() else { panic!("{answers:?}") };
    let number = |key: &str| beside_truth[key].as_f64().unwrap();
    assert!(number("truth_normalized_squared") < 16.81 && number("off_m") < 0.005, "{beside_truth}");
    assert!((number("fx_px") - number("fx_truth_px")).abs() < 3.9 * number("fx_sigma_px"), "{beside_truth}");
    assert!(number("fx_sigma_px") < 1.5, "0.2 % is good: {beside_truth}");
    // Rulers cost most here, and the intrinsics are not blamed for them.
    let cost = |key: &str| pose["intrinsics_cost"][key].as_f64().unwrap();
    assert!(0.95 * cost("position_sigma_m") < cost("with_exact_intrinsics_m"), "{}", pose["intrinsics_cost"]);
    let commands = beside_truth["commands"].as_array().unwrap();
    assert!((1..=5).contains(&commands.len()), "{commands:?}");

    // What the commands wrote goes; photographs remain.
    let out = folder.join("resight-demo");
    for file in ["board.pdf", "board.toml", "camera.toml", "camera.html"] {
        std::fs::remove_file(out.join(file)).unwrap();
    }
    let mut last = String::new();
    for command in commands {
        let run = typed(&format!("{} --json", command.as_str().unwrap()), &folder);
        assert_eq!(run.status.code(), Some(0), "{command}: {}", String::from_utf8_lossy(&run.stderr));
        last = words(&run);
    }
    assert_eq!(crate::support::answer(last.trim())["cam_from_target"], pose["cam_from_target"]);
    the_guide_shows_this(&out);
}

/// The guide's own commands, in a folder with the demo's photographs: they are the demo's, and print what the page shows.
#[cfg(unix)]
fn the_guide_shows_this(photographed: &Path) {
    let page = std::fs::read_to_string(book_support::root().join("docs/first-pose.md")).unwrap();
    let folder = folder("first_pose_guide");
    std::os::unix::fs::symlink(photographed.join("photos"), folder.join("photos")).unwrap();
    std::os::unix::fs::symlink(photographed.join("here.jpg"), folder.join("here.jpg")).unwrap();
    assert_eq!(book_support::follow(&page, &folder), [4, 1]);
}

/// In words each command stands as it is typed, and the truth beside the answer.
#[test]
fn the_demo_tells_what_to_type() {
    let folder = folder("first_pose_words");
    let run = resight(&["demo", "--first-pose", "-o", folder.join("f").to_str().unwrap()]);
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    assert_eq!(
        run.stdout.lines().filter(|line| line.starts_with("    resight ")).count(),
        4,
        "{}",
        run.stdout
    );
    assert!(run.stdout.contains("in truth") && run.stdout.contains("wrote"), "{}", run.stdout);
    assert!(folder.join("f/images/here.png").exists());
}
