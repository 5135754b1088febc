//! Every command fed spoilt copies of shipped files, as a child with a deadline and a limit of memory: it ends by itself, with an exit
//! status that is one of its own, without a panic, without a number that is none, and never says `ok` with a covariance that is none.
//!
//! Some seconds by default; `RESIGHT_FUZZ_SECONDS=3600` runs for an hour, `RESIGHT_FUZZ_SEED` draws others. A failure prints seed, case
//! and command; the spoilt file is kept below target/tmp.
#![cfg(target_os = "linux")] // `ulimit -v` bounds memory there.

use crate::fuzz_support::{Draw, setting, spoilt};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Of one run, on a machine that does much besides.
const DEADLINE: Duration = Duration::from_secs(60);
/// Of one run, KiB of address space: threads and their stacks count.
const MEMORY_KIB: u64 = 3 << 20;

/// A command line; `@` is the folder of shipped files, `%` that of results; the file numbered `spoilt` is given spoilt.
struct Job {
    words: &'static str,
}

/// Words that begin with `@` name shipped files; one of them, drawn, is spoilt.
const JOBS: [Job; 25] = [
    Job { words: "explain @formats/own_rig.toml" },
    Job { words: "explain @formats/photonvision_new.json" },
    Job { words: "explain @mcap/rosbags_plain.mcap" },
    Job { words: "convert @formats/own_rig.toml --to kalibr -o %out.yaml" },
    Job { words: "convert @formats/kalibr_camchain.yaml --to own -o %out.toml" },
    Job { words: "convert @formats/robot.urdf @formats/own_pinhole.toml --to own -o %out.toml" },
    Job { words: "solve @wang2004/points1.csv --camera @wang2004/camera1.toml --json" },
    Job { words: "solve @wang2004/points2.csv --camera @wang2004/camera2.toml --json" },
    Job {
        words: "solve @../crates/cli/tests/data/points.csv --camera @../crates/cli/tests/data/camera.toml --json --robust 4",
    },
    Job { words: "solve @../crates/cli/tests/data/normalized.csv --normalized --json" },
    Job { words: "locate @demo/left.png --camera @demo/left.toml --target @demo/grid.toml --json" },
    Job { words: "locate @demo/critical.png --camera @demo/left.toml --target @demo/dots.toml --json" },
    Job { words: "detect @demo/left.png --target @demo/grid.toml --json" },
    Job { words: "detect @demo/right.png --target @formats/target_charuco.toml --json" },
    Job { words: "compare @formats/own_rig.toml @formats/placed_rig.toml --json" },
    Job { words: "compare @watch_rig/rig.toml @watch_rig/rig.toml --sigma-mm 1 --sigma-deg 0.1 --json" },
    Job { words: "measure @measure/accident.toml --json" },
    Job {
        words: "advise --camera @demo/left.toml --target @demo/dots.toml --distance-m 0.5..2 --tilt-deg 10..60 --json",
    },
    Job { words: "whisker solve --whisker @whisker/whisker.json @whisker/hub.csv --json" },
    Job { words: "whisker calibrate --whisker @whisker/whisker.json @whisker/hub.csv --json" },
    Job {
        words: "whisker simulate --whisker @whisker/whisker.json --object @whisker/square.json --path @whisker/path.json",
    },
    Job { words: "whisker check @whisker/truth.csv @whisker/truth.csv" },
    Job {
        words: "watch --camera @demo/left.toml --target @demo/grid.toml --source @demo/left.png --once --json",
    },
    Job {
        words: "rig --camera left=@demo/left.toml --camera right=@demo/right.toml --target @demo/grid.toml --images left=@demo/left.png --images right=@demo/right.png --json",
    },
    Job { words: "history @history/frames.csv" },
];

/// The words with their files, one of which is spoilt and lies in `folder`.
fn command_line(job: &Job, folder: &Path, draw: &mut Draw) -> (Vec<String>, PathBuf) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata");
    let words: Vec<&str> = job.words.split(' ').collect();
    let named: Vec<usize> = (0..words.len()).filter(|i| words[*i].contains('@')).collect();
    let chosen = named[draw.below(named.len())];
    let file_of = |word: &str| root.join(&word[word.find('@').map_or(0, |at| at + 1)..]);
    let spoilt_path = {
        let original = file_of(words[chosen]);
        let bytes = std::fs::read(&original).expect("a shipped file");
        let other = std::fs::read(file_of(words[named[draw.below(named.len())]])).expect("a shipped file");
        let path = folder.join(original.file_name().expect("a name"));
        // `accident.toml` names its clicks and its camera by their paths.
        for beside in ["clicks.csv", "camera.toml"] {
            let _ = std::fs::copy(original.with_file_name(beside), folder.join(beside));
        }
        std::fs::write(&path, spoilt(&bytes, &other, draw)).expect("written");
        path
    };
    let word = |(i, word): (usize, &&str)| match word.split_once('@') {
        Some((before, _)) if i == chosen => format!("{before}{}", spoilt_path.display()),
        Some((before, _)) => format!("{before}{}", file_of(word).display()),
        None => word.replace('%', &format!("{}/", folder.display())),
    };
    (words.iter().enumerate().map(word).collect(), spoilt_path)
}

/// Runs it; status, stdout, stderr, or nothing where it did not end in time.
fn run(words: &[String], folder: &Path) -> Option<(Option<i32>, String, String)> {
    let files = ["stdout", "stderr"].map(|name| folder.join(name));
    let [out, err] = files.each_ref().map(|path| std::fs::File::create(path).expect("a file"));
    let mut child = Command::new("sh")
        .args(["-c", "ulimit -v \"$0\"; exec \"$@\"", &MEMORY_KIB.to_string(), env!("CARGO_BIN_EXE_resight")])
        .args(words)
        .env("RUST_BACKTRACE", "0")
        .env("RAYON_NUM_THREADS", "2")
        .stdin(Stdio::null())
        .stdout(out)
        .stderr(err)
        .spawn()
        .expect("sh");
    let began = Instant::now();
    let status = loop {
        match child.try_wait().expect("a child") {
            Some(status) => break status,
            None if DEADLINE < began.elapsed() => {
                let _ = child.kill();
                let _ = child.wait();
                return None;
            }
            None => std::thread::sleep(Duration::from_millis(2)),
        }
    };
    let [out, err] =
        files.map(|path| String::from_utf8_lossy(&std::fs::read(path).expect("read")).into_owned());
    Some((status.code(), out, err))
}

/// Positive definite as far as rounding goes: no variance below zero, no correlation beyond one, Cholesky's steps all positive.
fn is_covariance(rows: &[Value]) -> bool {
    let n = rows.len();
    let mut matrix: Vec<Vec<f64>> = Vec::new();
    for row in rows {
        let Some(row) = row.as_array().filter(|row| row.len() == n) else { return false };
        let Some(row) = row.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>() else { return false };
        matrix.push(row);
    }
    let scale: Vec<f64> = (0..n).map(|i| matrix[i][i].sqrt()).collect();
    if !scale.iter().all(|s| s.is_finite() && 0.0 < *s) {
        return false;
    }
    // Of the correlations, which have no units.
    let mut lower = vec![vec![0.0; n]; n];
    for i in 0..n {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            let rest = matrix[i][j] / (scale[i] * scale[j]) - sum;
            if i == j {
                if rest < -1e-9 {
                    return false;
                }
                lower[i][i] = rest.max(1e-18).sqrt();
            } else {
                lower[i][j] = rest / lower[j][j];
            }
        }
    }
    true
}

/// What is wrong with an answer, anywhere in it.
fn fault(value: &Value) -> Option<String> {
    match value {
        Value::Object(map) => {
            let is_ok = map.get("status").and_then(Value::as_str) == Some("ok");
            if let (true, Some(Value::Array(rows))) = (is_ok, map.get("covariance"))
                && rows.len() == 6
                && rows.iter().all(Value::is_array)
                && !is_covariance(rows)
            {
                return Some(format!("ok with {rows:?}"));
            }
            map.values().find_map(fault)
        }
        Value::Array(items) => items.iter().find_map(fault),
        Value::Number(number) if !number.as_f64().is_some_and(f64::is_finite) => Some(format!("{number}")),
        _ => None,
    }
}

fn complaint(words: &[String], folder: &Path) -> Option<String> {
    let Some((code, out, err)) = run(words, folder) else { return Some("does not end in time".to_string()) };
    if !matches!(code, Some(0..=3)) {
        return Some(format!("ends with {code:?}: {err}"));
    }
    if err.contains("panicked") || err.contains("memory allocation") {
        return Some(err);
    }
    if !words.iter().any(|word| word == "--json") {
        return None;
    }
    for line in out.lines() {
        match serde_json::from_str::<Value>(line) {
            Err(reason) => return Some(format!("{reason}: {line}")),
            Ok(value) => {
                if let Some(fault) = fault(&value) {
                    return Some(format!("{fault} in {line}"));
                }
            }
        }
    }
    None
}

#[test]
fn commands_survive_spoilt_files() {
    let (seconds, seed) = (setting("RESIGHT_FUZZ_SECONDS", 20), setting("RESIGHT_FUZZ_SEED", 1));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    let (began, mut case) = (Instant::now(), 0u64);
    let mut failed = Vec::new();
    while began.elapsed().as_secs() < seconds {
        let mut draw = Draw::of(seed, case);
        let job = &JOBS[case as usize % JOBS.len()];
        let (words, spoilt) = command_line(job, &folder, &mut draw);
        if let Some(complaint) = complaint(&words, &folder) {
            let kept = folder.with_file_name(format!("fuzz-kept-{seed}-{case}"));
            std::fs::copy(&spoilt, &kept).expect("kept");
            let short: String = complaint.chars().take(600).collect();
            println!(
                "seed {seed}, case {case}, kept as {}: {}\n    {short}",
                kept.display(),
                words.join(" ")
            );
            failed.push(case);
        }
        case += 1;
    }
    std::fs::remove_dir_all(&folder).expect("removed");
    println!("{case} runs of {} commands, seed {seed}", JOBS.len());
    assert!(failed.is_empty(), "cases {failed:?} of seed {seed}");
}
