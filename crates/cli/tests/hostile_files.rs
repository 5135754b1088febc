//! Files that are none, or far too large, where files are expected: refused by name in time and memory, and a session continues past them.

use crate::support::{demo, folder};
use assert_cmd::Command;
use resight::GrayImage;
use serde_json::Value;
use std::path::Path;
use std::time::Duration;

/// Longer than any refusal takes on a machine that does much besides.
const PATIENCE: Duration = Duration::from_secs(20);
/// Address space, KiB: a file of 1.5 GB that is read whole does not fit beside its copy.
const MEMORY_KIB: u64 = 2_000_000;

struct Ended {
    /// None where it was killed: it waited for ever.
    code: Option<i32>,
    stdout: String,
    stderr: String,
}

fn limited(words: &[&str]) -> Ended {
    let program = assert_cmd::cargo::cargo_bin("resight").display().to_string();
    let mut command = match cfg!(target_os = "linux") {
        true => {
            let mut shell = Command::new("sh");
            shell.args(["-c", &format!("ulimit -v {MEMORY_KIB}; exec \"$@\""), "sh", &program]);
            shell
        }
        false => Command::new(&program),
    };
    let output = command.args(words).timeout(PATIENCE).output().expect("it runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Ended { code: output.status.code(), stdout: text(&output.stdout), stderr: text(&output.stderr) }
}

#[cfg(unix)]
fn pipe(path: &Path) {
    let made = std::process::Command::new("mkfifo").arg(path).status().expect("mkfifo");
    assert!(made.success());
}

/// Commands with a file in each of their places, `@` for the file under test.
fn places() -> Vec<Vec<String>> {
    let (camera, target, picture) = (demo("left.toml"), demo("dots.toml"), demo("left.png"));
    let lines = [
        "explain @".to_string(),
        format!("detect @ --target {target}"),
        format!("detect {picture} --target @"),
        format!("locate @ --camera {camera} --target {target}"),
        format!("locate {picture} --camera @ --target {target}"),
        format!("solve @ --camera {camera}"),
        format!("compare @ {camera}"),
        "measure @".to_string(),
        format!("watch --camera {camera} --target @ --source - --once"),
        format!("watch --camera {camera} --target {target} --source - --once --reference @"),
        format!("watch --camera {camera} --target {target} --source - --once --state @"),
        format!("watch --camera {camera} --landmarks @ --source - --once"),
        format!(
            "watch --camera {camera} --target {target} --source - --once --mqtt mqtt://me@127.0.0.1:9 --mqtt-password-file @"
        ),
        format!(
            "watch --camera {camera} --target {target} --source - --once --ca-file @ --mqtt mqtts://127.0.0.1:9"
        ),
    ];
    lines.iter().map(|line| line.split(' ').map(str::to_string).collect()).collect()
}

fn put_in<'a>(place: &'a [String], file: &'a str) -> Vec<&'a str> {
    place.iter().map(|word| if word == "@" { file } else { word }).collect()
}

#[cfg(unix)]
#[test]
fn a_named_pipe_or_a_device_in_the_place_of_a_file_is_refused_at_once() {
    let folder = folder("pipes");
    let named = folder.join("pipe");
    pipe(&named);
    std::os::unix::fs::symlink("/dev/zero", folder.join("zeros")).expect("a link");
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(&named, std::fs::Permissions::from_mode(0o600)).expect("private");
    for file in [named, folder.join("zeros")] {
        let file = file.display().to_string();
        for place in places() {
            let words = put_in(&place, &file);
            let ended = limited(&words);
            assert_eq!(ended.code, Some(2), "{words:?}: {}{}", ended.stdout, ended.stderr);
            assert!(ended.stderr.contains(&file), "{words:?}: {}", ended.stderr);
        }
    }
}

/// Sparse, so that it takes no disk; each ending is another reader.
#[test]
fn a_file_of_one_and_a_half_gigabytes_is_refused_by_name_for_each_kind() {
    let folder = folder("sparse");
    let make = |ending: &str| {
        let path = folder.join(format!("huge.{ending}"));
        let file = std::fs::File::create(&path).expect("a file");
        file.set_len(1_500_000_000).expect("sparse");
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            file.set_permissions(std::fs::Permissions::from_mode(0o600)).expect("private");
        }
        path.display().to_string()
    };
    for ending in ["png", "jpg", "toml", "yaml", "xml", "json", "txt", "csv", "jsonl", "launch"] {
        let file = make(ending);
        let ended = limited(&["explain", &file]);
        assert_eq!(ended.code, Some(2), "{ending}: {}{}", ended.stdout, ended.stderr);
        assert!(ended.stderr.contains(&file), "{ending}: {}", ended.stderr);
    }
    let file = make("toml");
    for place in places() {
        let words = put_in(&place, &file);
        let ended = limited(&words);
        let said = ended.stdout + &ended.stderr;
        // One image of many is answered as such, and the others are gone on with.
        let is_picture = ["detect", "locate"].contains(&words[0]) && words[1] == file;
        assert_eq!(ended.code, Some(if is_picture { 1 } else { 2 }), "{words:?}: {said}");
        assert!(said.contains(&file) && said.contains("MiB"), "{words:?}: {said}");
    }
    std::fs::remove_dir_all(&folder).expect("removed");
}

/// A dangling link, a pipe, a folder that may not be read (where the mode counts: not for root): the images are answered all the same.
#[cfg(unix)]
#[test]
fn a_pattern_goes_on_past_what_is_no_picture() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = folder("pattern");
    for name in ["a", "b", "locked"] {
        std::fs::create_dir(folder.join(name)).expect("a folder");
        std::fs::copy(demo("left.png"), folder.join(name).join("1.png")).expect("an image");
    }
    symlink("nowhere.png", folder.join("a/2.png")).expect("a link");
    symlink("round", folder.join("round")).expect("a link to itself");
    pipe(&folder.join("b/3.png"));
    // A file where the pattern expects a folder.
    std::fs::write(folder.join("file"), "no folder").expect("a file");
    let locked = folder.join("locked");
    std::fs::set_permissions(&locked, std::fs::Permissions::from_mode(0o000)).expect("locked");
    let is_locked = std::fs::read_dir(&locked).is_err();
    let pattern = folder.join("*/*.png").display().to_string();
    let ended = limited(&["detect", &pattern, "--target", &demo("dots.toml"), "--json"]);
    std::fs::set_permissions(&locked, std::fs::Permissions::from_mode(0o700)).expect("unlocked");
    let answers = ended.stdout.lines().count();
    assert_eq!(
        (ended.code, answers),
        (Some(0), if is_locked { 2 } else { 3 }),
        "{}{}",
        ended.stdout,
        ended.stderr
    );
    assert!(ended.stderr.contains("b/3.png: no file, left out"), "{}", ended.stderr);
    assert_eq!(ended.stderr.contains("cannot be looked into"), is_locked, "{}", ended.stderr);
    if !is_locked {
        println!("this user reads folders of mode 000: that a folder may not be read is not tested");
    }
}

/// An image of a hostile shape, one that is torn and a pipe among those of a session: each is reported, and the others are looked at.
#[test]
fn a_session_goes_on_past_pictures_that_cannot_be() {
    let folder = folder("watch-hostile");
    let good = std::fs::read(demo("left.png")).expect("an image");
    let tall =
        GrayImage { width_px: 64, height_px: 32768, data: vec![7; 64 * 32768] }.png().expect("an image");
    let mut other = GrayImage::read(demo("left.png")).expect("an image");
    other.data[0] ^= 1; // The same image twice would be a frozen camera.
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).expect("written");
    write("1.png", &good);
    write("2.png", &tall);
    write("3.png", &good[..good.len() / 3]);
    write("4.png", &other.png().expect("an image"));
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    let pattern = folder.join("*.png").display().to_string();
    let ended = limited(&[
        "watch",
        "--camera",
        &camera,
        "--target",
        &target,
        "--source",
        &pattern,
        "--period-s",
        "1",
        "--once",
        "--json",
        "--frames",
    ]);
    // Two readings are no reference: that cannot be said is 1, and neither a crash nor a refusal.
    assert_eq!(ended.code, Some(1), "{}{}", ended.stdout, ended.stderr);
    let events: Vec<Value> =
        ended.stdout.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let frames: Vec<&Value> = events.iter().filter(|event| event["event"] == "frame").collect();
    let has_pose = |frame: &&Value| frame["cam_from_target"].is_object();
    let poses: Vec<bool> = frames.iter().map(has_pose).collect();
    assert_eq!(poses, [true, false, false, true], "{}", ended.stdout);
    let reason = |i: usize| frames[i]["message"].as_str().expect("a reason").to_string();
    assert!(reason(1).contains("64") && reason(1).contains("32768"), "{}", reason(1));
    assert!(!reason(2).is_empty());
}

/// What a killed session left half written beside its state is removed by the next one; what a living one writes stays.
#[cfg(target_os = "linux")]
#[test]
fn half_written_files_of_a_killed_session_are_removed_at_the_next_start() {
    let folder = folder("leftovers");
    let mut child = std::process::Command::new("true").spawn().expect("a process");
    let dead = child.id();
    child.wait().expect("it ended");
    let hour_ago = std::time::SystemTime::now() - Duration::from_secs(3600);
    let make = |process: u32| {
        let path = folder.join(format!(".gate.state.{process}-0.tmp"));
        std::fs::File::create(&path).and_then(|file| file.set_modified(hour_ago)).expect("a file");
        path
    };
    let (gone, kept) = (make(dead), make(std::process::id()));
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    let state = folder.join("gate.state").display().to_string();
    let pattern = demo("left.png");
    limited(&[
        "watch", "--camera", &camera, "--target", &target, "--source", &pattern, "--once", "--state", &state,
    ]);
    assert!(Path::new(&state).is_file(), "the session kept its state");
    assert!(!gone.exists() && kept.exists());
}
