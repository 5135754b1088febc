//! `zones`: a motion of `watch` moves the zones of a file, or the reason is said and nothing is written.

use crate::book_support::root;
use crate::support::{folder, json_lines, resight};
use std::path::Path;

#[test]
fn zones_follow_an_alarm() {
    let folder = folder("zones");
    let file = |name: &str| folder.join(name).display().to_string();
    let gate = |name: &str| root().join("examples/gate").join(name).display().to_string();
    let zones = root().join("examples/zones/zones.toml").display().to_string();
    let watched = resight(&[
        "watch",
        "--camera",
        &format!("gate={}", gate("gate.toml")),
        "--target",
        &gate("tag.toml"),
        "--source",
        &gate("day.jsonl"),
        "--once",
        "--json",
    ]);
    assert_eq!(watched.code, 3, "{}", watched.stderr);
    std::fs::write(file("events.jsonl"), &watched.stdout).unwrap();
    let (camera, events, moved) = (gate("gate.toml"), file("events.jsonl"), file("moved.toml"));
    let command = ["zones", &zones, "--camera", &camera, "--motion", &events, "--write", &moved, "--json"];
    let free = resight(&command);
    assert_eq!(free.code, 1, "{}", free.stderr);
    assert!(json_lines(&free).iter().all(|answer| answer["status"] == "undecided"), "{}", free.stdout);
    assert!(!Path::new(&moved).exists() && free.stderr.contains("is not written"), "{}", free.stderr);
    let held = resight(&[&command[..], &["--shift-sigma-mm", "1", "--nearest-m", "5"]].concat());
    assert_eq!(held.code, 0, "{}{}", held.stdout, held.stderr);
    let answers = json_lines(&held);
    // 0.5° to the right of a camera of 900 px: everything moves to the left by 7.9 px and more towards the edges.
    let first = answers[1]["polygon_px"][0][0].as_f64().unwrap();
    assert!((first - (820.0 - 8.1)).abs() < 1.0, "{first}");
    assert!(answers[0]["error_px"].as_f64().unwrap() < 2.0, "{}", answers[0]);
    let written = std::fs::read_to_string(&moved).unwrap();
    assert!(written.contains("coordinates = \"0.0") && written.contains("polygon_px"), "{written}");
    // What was written is read.
    let still = resight(&[
        "zones",
        &moved,
        "--camera",
        &camera,
        "--motion",
        &events,
        "--shift-sigma-mm",
        "1",
        "--nearest-m",
        "5",
    ]);
    assert_eq!(still.code, 0, "{}", still.stderr);
}
