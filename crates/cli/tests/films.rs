//! `watch` on video files: every frame has its own time, drift is found, and damaged files and a missing ffmpeg are reported.

use crate::film_support::{H264, encode, frames, has_ffmpeg, states, studio, watch_once};
use serde_json::Value;

/// Knocked by a degree after 90 of 150 frames.
fn knocked() -> impl Iterator<Item = f64> {
    (0..150).map(|i| if i < 90 { 0.0 } else { 1.0 })
}

fn times(events: &[Value]) -> Vec<f64> {
    events.iter().filter(|e| e["event"] == "frame").filter_map(|e| e["t_s"].as_f64()).collect()
}

/// The same film, frames evenly spaced in MP4 and at irregular times in Matroska: the sudden motion is found at its time, and times are those
/// of the container.
#[test]
fn a_knock_is_found_at_its_time() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("films-knock");
    let all = frames(&studio, knocked());
    let even = |i: usize| i as f64 / 10.0;
    let uneven = |i: usize| i as f64 / 10.0 + 0.03 * (i as f64).sin();
    let stamps = ["-vf", "settb=1/90000,setpts='(N/10+0.03*sin(N))/TB'", "-fps_mode", "passthrough"];
    let stamps = [&stamps[..], &["-enc_time_base", "1/90000"]].concat();
    for name in ["even.mp4", "uneven.mkv", "uneven.mp4"] {
        let is_even = name.starts_with("even");
        let how = if is_even { &[][..] } else { &stamps };
        let time_s = |i| if is_even { even(i) } else { uneven(i) };
        let film = studio.join(name).display().to_string();
        encode(&all, 10, &[&H264[..], how, &[&film]].concat());
        let run = watch_once(&studio, &["--source", &film, "--frames"]);
        assert_eq!(run.code, 3, "{name}: {}", run.stderr);
        let times = times(&run.events);
        assert_eq!(times.len(), 150, "{name}");
        let error = |(i, t): (usize, &f64)| (t - time_s(i)).abs();
        let worst = times.iter().enumerate().map(error).fold(0.0, f64::max);
        assert!(worst < 1e-3, "{name}: capture times are off by {worst} s");
        let drift = run.events.iter().rfind(|e| e["state"] == "drifted" && e["event"] == "state");
        let began_s = drift.and_then(|d| d["began_s"].as_f64()).expect("a beginning");
        assert!((began_s - 9.0).abs() < 0.5, "{name}: {began_s}");
        let turn_deg = drift.and_then(|d| d["pure_rotation_rad"][1].as_f64()).expect("a turn").to_degrees();
        assert!((turn_deg - 1.0).abs() < 0.1, "{name}: {turn_deg}");
    }
}

/// Cut off in the middle, or with bytes overwritten: what can be decoded is watched, the rest is reported.
#[test]
fn damaged_films_are_watched_as_far_as_they_go() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("films-damaged");
    let all = frames(&studio, (0..100).map(|_| 0.0));
    for name in ["cut.mkv", "bent.ts"] {
        let film = studio.join(name);
        encode(&all, 10, &[&H264[..], &[&film.display().to_string()]].concat());
        let mut bytes = std::fs::read(&film).expect("a film");
        match name {
            "cut.mkv" => bytes.truncate(bytes.len() * 2 / 3),
            _ => (20..80).for_each(|i| {
                let place = bytes.len() * i / 100;
                bytes[place..place + 40].fill(0xa5);
            }),
        }
        std::fs::write(&film, bytes).expect("written");
        let film = film.display().to_string();
        let run = watch_once(&studio, &["--source", &film, "--frames", "--learn", "20"]);
        let good = run.events.iter().filter(|e| e["event"] == "frame" && e.get("message").is_none()).count();
        assert!((20..100).contains(&good), "{name}: {good}");
        assert!(!states(&run.events).contains(&"drifted"), "{name}: {:?}", states(&run.events));
        let reported = run.events.iter().find(|e| e["event"] == "left_out").expect("what is missing");
        assert!(reported["message"].as_str().is_some_and(|m| m.contains(name)), "{reported}");
    }
    let none = studio.join("none.mp4");
    std::fs::write(&none, b"\0\0\0\x20ftypisom and nothing else").expect("written");
    let run = watch_once(&studio, &["--source", none.to_str().expect("a path")]);
    assert!(run.code == 2 && run.stderr.contains("none.mp4: no video in this file"), "{}", run.stderr);
}

/// From the middle on, the camera gives the same image.
#[test]
fn a_film_that_freezes_is_not_steady() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("films-frozen");
    let mut all = frames(&studio, (0..60).map(|_| 0.0));
    let last = all[all.len() - 320 * 240..].to_vec();
    (0..60).for_each(|_| all.extend_from_slice(&last));
    let film = studio.join("frozen.mkv").display().to_string();
    encode(&all, 10, &["-c:v", "ffv1", &film]);
    let run = watch_once(&studio, &["--source", &film, "--frames", "--learn", "30", "--stale-after-s", "2"]);
    assert_eq!((run.code, states(&run.events)), (1, vec!["learning", "steady", "stale"]), "{}", run.stderr);
    let frozen = run.events.iter().filter(|e| e["message"].as_str().is_some_and(|m| m.contains("frozen")));
    let (frames, states): (Vec<_>, Vec<_>) = frozen.partition(|e| e["event"] == "frame");
    assert_eq!(
        (frames.len(), states.len()),
        (60, 2),
        "each frame, once the state, and their number at the end"
    );
}

/// A camera that was switched in the middle: frames of another size belong to no lens.
#[test]
fn frames_of_another_size_are_left_out() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("films-sizes");
    let all = frames(&studio, (0..30).map(|_| 0.0));
    let parts = ["a.ts", "b.ts"].map(|name| studio.join(name).display().to_string());
    encode(&all, 10, &[&H264[..], &[&parts[0]]].concat());
    encode(&all, 10, &[&H264[..], &["-vf", "transpose", &parts[1]]].concat());
    let film = studio.join("both.ts");
    let both = parts.map(|part| std::fs::read(part).expect("a film")).concat();
    std::fs::write(&film, both).expect("written");
    let run = watch_once(&studio, &["--source", film.to_str().expect("a path"), "--frames", "--learn", "20"]);
    let said: Vec<&str> = run.events.iter().filter_map(|e| e["message"].as_str()).collect();
    let resized = said.iter().filter(|m| m.contains("from 320×240 to 240×320 px")).count();
    assert!(25 < resized, "{resized}: {said:?}");
}

#[test]
fn without_ffmpeg_the_message_says_how_to_get_it() {
    let studio = studio("films-none");
    let film = studio.join("film.mp4");
    std::fs::write(&film, b"\0\0\0\x20ftypisom\0\0\0\0").expect("written");
    for source in [film.to_str().expect("a path"), "rtsp://127.0.0.1:1/x", "/dev/video0"] {
        let mut command = assert_cmd::Command::cargo_bin("resight").expect("the program");
        let run = command
            .args(crate::film_support::arguments(&studio))
            .args(["--source", source])
            .env("PATH", "")
            .output()
            .expect("it runs");
        let words = String::from_utf8_lossy(&run.stderr);
        assert!(run.status.code() == Some(2) && words.contains("apt install ffmpeg"), "{source}: {words}");
    }
}
