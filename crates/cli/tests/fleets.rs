//! `batch` and `fleet-report` as a user meets them: killed at any instant, asked for the wrong thing, given the wrong files.

use resight_fleet::simulate::{Simulation, write_day};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

fn resight() -> assert_cmd::Command {
    assert_cmd::Command::cargo_bin("resight").expect("the program")
}

/// A small day: cameras, views hour by hour.
fn day(name: &str, cameras: usize, hours: f64, every_s: f64) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    let day = Simulation {
        cameras,
        duration_s: 3600.0 * hours,
        every_s,
        seed: 21,
        poison: 1e-3,
        ..Simulation::default()
    };
    write_day(&day.fleet().expect("a fleet"), &folder).expect("a day");
    folder
}

fn command(folder: &Path, output: &str) -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("resight"));
    command.current_dir(folder).args(["batch", "views", "--cameras", "cameras.csv", "--sigma-px", "0.3"]);
    command.args(["--drift", &format!("{output}.jsonl"), "-o", output, "-q"]);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command
}

/// Two hundred kills by SIGKILL, at instants spread over the run, some of them of runs that continue one that was killed: when a run is
/// left to end, its output and what it says of every camera are those of a run that nobody disturbed, and nothing else is left.
#[test]
fn killed_at_two_hundred_instants_the_output_is_that_of_an_undisturbed_run() {
    let folder = day("killed", 12, 24.0, 60.0);
    let begun = Instant::now();
    assert_eq!(command(&folder, "whole.parquet").status().expect("a run").code(), Some(1));
    let took = begun.elapsed();
    let read = |name: &str| std::fs::read(folder.join(name)).expect(name);
    let (whole, drift) = (read("whole.parquet"), read("whole.parquet.jsonl"));
    let (mut kills, mut amid, mut seed) = (0, 0, 1_u64);
    while kills < 200 {
        let _ = std::fs::remove_file(folder.join("out.parquet"));
        // One to three kills, and then it may end.
        for _ in 0..1 + seed % 3 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let share = (seed >> 11) as f64 / (1_u64 << 53) as f64;
            let mut run = command(&folder, "out.parquet").spawn().expect("a run");
            std::thread::sleep(Duration::from_secs_f64(share * took.as_secs_f64()));
            amid += usize::from(run.try_wait().expect("a process").is_none());
            let _ = run.kill();
            let _ = run.wait();
            kills += 1;
            let out = std::fs::read(folder.join("out.parquet"));
            assert!(out.is_err() || out.is_ok_and(|bytes| bytes == whole), "half an output after {kills} kills");
        }
        assert_eq!(command(&folder, "out.parquet").status().expect("a run").code(), Some(1));
        assert!(read("out.parquet") == whole, "another output after {kills} kills");
        assert!(read("out.parquet.jsonl") == drift, "another drift after {kills} kills");
        assert!(!folder.join("out.parquet.parts").exists());
    }
    assert!(100 < amid, "only {amid} of {kills} kills met a run at work");
}

fn refused(folder: &Path, words: &[&str]) -> String {
    let done = resight().current_dir(folder).args(words).output().expect("a run");
    assert_eq!(done.status.code(), Some(2), "{words:?}: {}", String::from_utf8_lossy(&done.stdout));
    String::from_utf8_lossy(&done.stderr).into_owned()
}

#[test]
fn what_is_wrong_with_files_and_flags_is_named() {
    let folder = day("wrong", 4, 1.0, 60.0);
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("written");
    write("twice.csv", "camera,fx_px,fy_px,cx_px,cy_px\na,900,900,1,1\nb,900,900,1,1\na,900,900,1,1\n");
    write("no-camera.csv", "time_s,u0_px,v0_px\n1,2,3\n");
    let batch = |cameras: &str, input: &str| {
        refused(&folder, &["batch", input, "--cameras", cameras, "-o", "out.parquet"])
    };
    let text = batch("twice.csv", "views");
    assert!(text.contains("`a` appears twice (camera 1 and camera 3)"), "{text}");
    let text = batch("camers.csv", "views");
    assert!(text.contains("camers.csv"), "{text}");
    let text = batch("truth.csv", "views");
    assert!(text.contains("fx_px"), "a table that holds no lenses: {text}");
    let text = batch("cameras.csv", "no-camera.csv");
    assert!(text.contains("no column `camera`") && text.contains("3 or more are needed"), "{text}");
    let text = batch("cameras.csv", "nothing-*.parquet");
    assert!(text.contains("no file of views"), "{text}");
    let text = refused(&folder, &["batch", "views", "--cameras", "cameras.csv", "-o", "views/000.parquet"]);
    assert!(text.contains("one of the inputs"), "{text}");
    let spark = ["batch", "views", "--cameras", "cameras.csv", "-o", "o", "--engine", "spark"];
    let text = refused(&folder, &spark);
    assert!(text.contains("pip install") && text.contains("RESIGHT_PYTHON"), "{text}");
    let text = refused(&folder, &["batch", "views", "--cameras", "cameras.csv", "-o", "o", "--master", "local"]);
    assert!(text.contains("--engine spark"), "{text}");
    let text = refused(&folder, &["fleet-report", "views/000.parquet"]);
    assert!(text.contains("the output of `resight batch` is needed"), "{text}");
}

/// Pixels in millimetres, u and v swapped, times that run backwards, empty cells: rows with a status, never a pose that is called ok.
#[test]
fn wrong_units_and_swapped_pixels_are_no_answers() {
    let folder = day("units", 3, 1.0, 60.0);
    let camera = std::fs::read_to_string(folder.join("cameras.csv")).expect("cameras");
    let name = camera.lines().nth(1).and_then(|line| line.split(',').next()).expect("a camera").to_string();
    let views = std::fs::read(folder.join("views/000.parquet")).expect("views");
    assert!(views.starts_with(b"PAR1"));
    let header = "camera,time_s,u0_px,v0_px,u1_px,v1_px,u2_px,v2_px,u3_px,v3_px\n";
    let pixels = "1000.5,500.5,1100.5,510.5,1207.5,521.5,990.5,660.5";
    let swapped = "500.5,1000.5,510.5,1100.5,521.5,1207.5,660.5,990.5";
    let millimetres = "3.1,1.5,3.3,1.53,3.6,1.56,2.97,1.98";
    let rows = format!(
        "{header}{name},3,{swapped}\n{name},2,{millimetres}\n{name},1,\nnobody,0,{pixels}\n{name},nan,1e70,{pixels}\n"
    );
    std::fs::write(folder.join("wrong.csv"), rows).expect("written");
    let words = ["batch", "wrong.csv", "--cameras", "cameras.csv", "--sigma-px", "0.3", "-o", "out.csv", "--json"];
    let done = resight().current_dir(&folder).args(words).output().expect("a run");
    assert_eq!(done.status.code(), Some(1));
    let text = std::fs::read_to_string(folder.join("out.csv")).expect("an output");
    let lines: Vec<&str> = text.lines().skip(1).collect();
    assert_eq!(lines.len(), 5, "{text}");
    assert!(lines.iter().all(|line| !line.contains(",ok,")), "{text}");
    assert!(lines[2].contains("is missing or not a number") && lines[3].contains("not among the cameras"), "{text}");
    assert!(lines[4].contains("check the unit"), "{text}");
}

#[test]
fn explain_says_what_is_there_and_what_is_missing() {
    let folder = day("explained", 3, 1.0, 60.0);
    let done = resight().current_dir(&folder).args(["batch", "--explain", "views/000.parquet"]).output();
    let text = String::from_utf8_lossy(&done.expect("a run").stdout).into_owned();
    assert!(text.contains("time of the image") && text.contains("u of point 3, px"), "{text}");
    std::fs::write(folder.join("some.csv"), "camra,u0_px,v0_px,u1_px\n").expect("written");
    let done = resight().current_dir(&folder).args(["batch", "--explain", "some.csv", "--json"]).output().expect("a run");
    assert_eq!(done.status.code(), Some(1));
    let answer: serde_json::Value = serde_json::from_slice(&done.stdout).expect("JSON");
    let missing = answer["missing"].to_string();
    assert!(missing.contains("did you mean `camra`") && missing.contains("v1_px"), "{missing}");
}
