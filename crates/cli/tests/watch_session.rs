//! `watch SESSION.toml`: the file says what the flags say.

use crate::support::{folder, resight};
use std::path::{Path, PathBuf};

fn gate(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/gate").join(name).display().to_string()
}

/// A folder with the lines of the day as a file that is given on stdin by the shell is not needed: the recording is a file of detections.
fn session(name: &str, text: &str) -> PathBuf {
    let path = folder(name).join("session.toml");
    std::fs::write(&path, text).expect("a file");
    path
}

fn watch(arguments: &[&str]) -> (i32, String, String) {
    let day = std::fs::read(gate("day.jsonl")).expect("the day");
    let run = assert_cmd::Command::cargo_bin("resight")
        .expect("the program")
        .arg("watch")
        .args(arguments)
        .write_stdin(day)
        .output()
        .expect("it runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (run.status.code().expect("a status"), text(run.stdout), text(run.stderr))
}

#[test]
fn a_session_file_means_the_same_as_its_flags() {
    let (camera, target) = (format!("gate={}", gate("gate.toml")), format!("door={}", gate("tag.toml")));
    let flags = [
        "--camera",
        &camera,
        "--target",
        &target,
        "--source",
        "gate=-",
        "--once",
        "--json",
        "--learn",
        "40",
        "--tolerance-deg",
        "0.1",
    ];
    let by_flags = watch(&flags);
    assert_eq!(by_flags.0, 3, "{}", by_flags.2);
    let printed = watch(&[&flags[..], &["--print-session"]].concat());
    assert_eq!(printed.0, 0, "{}", printed.2);
    for line in [
        "[camera.gate]",
        "source = \"-\"",
        "[target.door]",
        "once = true",
        "learn = 40",
        "tolerance_deg = 0.1",
        "# state = …",
    ] {
        assert!(printed.1.contains(line), "{line} is missing:\n{}", printed.1);
    }
    let file = session("session_same", &printed.1);
    assert_eq!(watch(&[&file.display().to_string()]), by_flags);
    // A flag beside the file takes the place of its key.
    let other = watch(&[&file.display().to_string(), "--tolerance-deg", "5"]);
    assert_eq!(other.0, 0, "{}", other.1);
}

/// A name may have dots, quoted in the file or not: the camera is the same as by its flags, and so is the file that is printed.
#[test]
fn names_with_dots_are_names() {
    let [camera, target] = [gate("gate.toml"), gate("tag.toml")];
    let by_flags = watch(&[
        "--camera",
        &format!("cam.north={camera}"),
        "--target",
        &format!("door.1={target}"),
        "--source",
        "cam.north=-",
        "--once",
        "--json",
    ]);
    assert!(by_flags.1.contains("\"cam.north\""), "{} {}", by_flags.1, by_flags.2);
    let text = |north: &str, door: &str, source: &str| {
        format!(
            "once = true\njson = true\n[camera.{north}]\nfile = {camera:?}\n{source}\n[target.{door}]\nfile = {target:?}\n"
        )
    };
    let quoted = text("\"cam.north\"", "\"door.1\"", "source = \"-\"");
    let plain = text("cam.north", "door.1", "source = \"-\"");
    let by_key = text("cam.north", "door.1", "[source]\ncam.north = \"-\"");
    for (name, text) in [("quoted", quoted), ("plain", plain), ("by_key", by_key)] {
        let file = session(&format!("session_dots_{name}"), &text).display().to_string();
        assert_eq!(watch(&[&file]), by_flags, "{name}");
        let printed = watch(&[&file, "--print-session"]);
        assert_eq!(printed.0, 0, "{name}: {}", printed.2);
        assert!(printed.1.contains("[camera.\"cam.north\"]"), "{name}: {}", printed.1);
        let again = session(&format!("session_dots_{name}_again"), &printed.1).display().to_string();
        assert_eq!(watch(&[&again]), by_flags, "{name}, printed");
    }
    // A file of landmarks for such a camera.
    let text = "[camera.cam.north]\nsource = \"-\"\nhfov_deg = 60\nlandmarks = \"no/such.png\"\n";
    let file = session("session_dots_landmarks", text).display().to_string();
    let (code, _, stderr) = watch(&[&file]);
    assert!(code == 2 && stderr.contains("no/such.png"), "{stderr}");
}

/// Every key that is listed is one that can be given.
#[test]
fn every_key_is_listed_and_is_a_flag() {
    let listed = watch(&["--print-session"]).1;
    let keys: Vec<&str> = listed
        .lines()
        .filter_map(|line| line.strip_prefix("# ")?.split_once(" = "))
        .map(|(key, _)| key)
        .collect();
    assert!(40 < keys.len() && keys.iter().all(|key| !key.contains(' ')), "{keys:?}");
    let help = resight(&["watch", "--help"]).stdout;
    for key in keys {
        assert!(help.contains(&format!("--{}", key.replace('_', "-"))), "{key}");
    }
}

/// A session file of version 1 means what it meant.
#[test]
fn keys_of_version_1_are_read() {
    let text = "unseen_after_s = 7.0\n";
    let path = session("session_of_version_1", text);
    let (status, printed, said) = watch(&[path.to_str().expect("a name"), "--print-session"]);
    assert_eq!(status, 0, "{said}");
    assert!(printed.contains("stale_after_s = 7"), "{printed}");
}

#[test]
fn what_is_wrong_with_a_session_file_is_named() {
    for (name, text, said) in [
        ("unknown", "tolerence_deg = 1\n", "did you mean `tolerance_deg`?"),
        ("dashed", "tolerance-deg = 1\n", "did you mean `tolerance_deg`?"),
        ("section", "[camera.gate]\nfile = \"a\"\nsorce = \"-\"\n", "did you mean `source`?"),
        ("kind", "once = 3\n", "once: true or false is needed"),
        ("list", "learn = [1, 2]\n", "learn: one value is needed"),
        ("number", "learn = \"many\"\n", "invalid value 'many' for '--learn <N>'"),
        ("syntax", "learn = \n", "session.toml"),
        ("missing", "learn = 50\n", "--source"),
        ("own", "print_session = true\n", "no such key"),
    ] {
        let file = session(&format!("session_{name}"), text).display().to_string();
        let (code, stdout, stderr) = watch(&[&file]);
        assert_eq!((code, stdout.as_str()), (2, ""), "{name}: {stderr}");
        assert!(stderr.contains(said) && stderr.contains("session.toml"), "{name}: {stderr}");
    }
    let (code, _, stderr) = watch(&["no/such/session.toml"]);
    assert!(code == 2 && stderr.contains("no/such/session.toml"), "{stderr}");
}
