//! `watch` on live streams of a local ffmpeg: lost and back, stalled, ended, other sizes; no ffmpeg stays behind.

use crate::film_support::streamed::{
    capture_times_are_those_of_the_camera, film, is_source, nothing_stays_behind, wait_for_listener,
};
use crate::film_support::{
    H264, Running, Watching, encode, frames, free_port, has_ffmpeg, runs, said, serve, states, studio,
    watch_once,
};
use serde_json::Value;
use std::io::Write;
use std::net::TcpListener;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

fn serve_tcp(film: &Path, port: u16) -> Running {
    serve(film, &["-f", "mpegts", &format!("tcp://127.0.0.1:{port}?listen=1")])
}

/// `--source` with an address that only its owner can read.
fn private_address(studio: &Path, address: &str) -> String {
    let file = studio.join("address");
    std::fs::write(&file, format!("{address}\n")).expect("written");
    let mode = std::os::unix::fs::PermissionsExt::from_mode(0o600);
    std::fs::set_permissions(&file, mode).expect("only for me");
    format!("@{}", file.display())
}

/// The server is killed and restarted: the loss of the source and its return are reported once each, and nothing else changes.
#[test]
fn a_stream_that_breaks_is_lost_and_comes_back() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("streams-tcp");
    let (film, port) = (film(&studio), free_port());
    let address = format!("gate=tcp://127.0.0.1:{port}");
    let server = serve_tcp(&film, port);
    let camera = format!("gate={}", studio.join("camera.toml").display());
    let target = studio.join("target.toml").display().to_string();
    let mut watching = Watching::with(&[
        "watch",
        "--json",
        "--frames",
        "--camera",
        &camera,
        "--target",
        &target,
        "--source",
        &address,
        "--learn",
        "20",
        "--stale-after-s",
        "50",
    ]);
    watching.until("learned reference", |event| event["event"] == "learned");
    watching.frames(5);
    drop(server);
    let lost = watching.until("loss", |event| is_source(event, false));
    assert!(
        lost["reason"].as_str().is_some_and(|r| r.contains(&format!("tcp://127.0.0.1:{port}"))),
        "{lost}"
    );
    let _server = serve_tcp(&film, port);
    watching.until("return", |event| is_source(event, true));
    // Enough that a burst of frames on a busy machine is a small part of them.
    watching.frames(30);
    let reported: Vec<&Value> =
        watching.seen.iter().filter(|e| e["event"] == "source").map(|e| &e["connected"]).collect();
    // The first attempt may have come before the server was ready.
    let reported = if reported.len() == 4 { &reported[2..] } else { &reported[..] };
    assert_eq!(reported, [false, true], "{:?}", said(&watching.seen));
    assert_eq!(states(&watching.seen), ["learning", "steady"], "{:?}", said(&watching.seen));
    capture_times_are_those_of_the_camera(&watching.seen);
    nothing_stays_behind(watching, &format!("-i tcp://127.0.0.1:{port}"));
}

/// With `--once` a stream that ends has ended; HTTP, its password from a file and not shown.
#[test]
fn a_stream_that_ends_gives_a_verdict() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("streams-http");
    let (film, port) = (film(&studio), free_port());
    let _server = serve(&film, &["-listen", "1", "-f", "mpegts", &format!("http://127.0.0.1:{port}/x")]);
    wait_for_listener(port);
    let source = private_address(&studio, &format!("http://me:secret@127.0.0.1:{port}/x"));
    let options = ["--ffmpeg-input-options", "-t 8", "--learn", "20", "--frames"];
    let run = watch_once(&studio, &[&["--source", &source][..], &options].concat());
    assert_eq!((run.code, states(&run.events)), (0, vec!["learning", "steady"]), "{}", run.stderr);
    assert!(run.events.iter().all(|event| !event.to_string().contains("secret")));
}

/// A server that falls silent in the middle without ending.
#[test]
fn a_stream_that_stalls_is_given_up() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("streams-stalled");
    let bytes = std::fs::read(film(&studio)).expect("a film");
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = format!("tcp://{}", listener.local_addr().expect("an address"));
    std::thread::spawn(move || {
        let mut visitors = Vec::new();
        for mut visitor in listener.incoming().flatten() {
            // Half of it, and then nothing while the connection stays.
            let _ = visitor.write_all(&bytes[..bytes.len() / 2]);
            visitors.push(visitor);
        }
    });
    let mut watching =
        Watching::start(&studio, &["--frames", "--source", &address, "--lost-after-s", "2", "--learn", "20"]);
    watching.frames(5);
    let lost = watching.until("loss", |event| is_source(event, false));
    assert!(
        lost["reason"].as_str().is_some_and(|r| r.contains("no frame for 2 s") || r.contains("ended")),
        "{lost}"
    );
    watching.until("return", |event| is_source(event, true));
    watching.until("second loss", |event| is_source(event, false));
    watching.until("second return", |event| is_source(event, true));
    nothing_stays_behind(watching, &format!("-i {address}"));
}

/// Frames that change size in mid-stream: the source is opened again.
#[test]
fn a_stream_that_changes_size_is_opened_again() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("streams-sizes");
    let all = frames(&studio, (0..40).map(|_| 0.0));
    let [wide, high] = ["wide.ts", "high.ts"].map(|name| studio.join(name).display().to_string());
    encode(&all, 10, &[&H264[..], &[&wide]].concat());
    encode(&all, 10, &[&H264[..], &["-vf", "transpose", &high]].concat());
    let bytes = [wide, high].map(|part| std::fs::read(part).expect("a film")).concat();
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = format!("tcp://{}", listener.local_addr().expect("an address"));
    std::thread::spawn(move || {
        for mut visitor in listener.incoming().flatten() {
            // The visitor may leave when it has seen enough.
            let _ = visitor.write_all(&bytes);
        }
    });
    let mut watching = Watching::start(&studio, &["--source", &address, "--learn", "20"]);
    let lost = watching.until("loss", |event| is_source(event, false));
    assert!(lost["reason"].as_str().is_some_and(|r| r.contains("from 320×240 to 240×320 px")), "{lost}");
    watching.until("return", |event| is_source(event, true));
}

/// RTSP, ffmpeg's camera announcing its film to the ffmpeg of the session.
#[test]
fn rtsp_is_watched() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("streams-rtsp");
    let (film, port) = (film(&studio), free_port());
    let address = format!("rtsp://127.0.0.1:{port}/gate");
    let listen = ["--ffmpeg-input-options", "-rtsp_flags listen -listen_timeout 60", "--lost-after-s", "30"];
    let session = [&["--source", &address, "--learn", "20", "--frames"][..], &listen].concat();
    let mut watching = Watching::start(&studio, &session);
    wait_for_listener(port);
    let _camera = serve(&film, &["-f", "rtsp", "-rtsp_transport", "tcp", &address]);
    watching.until("steady state", |event| event["state"] == "steady");
    watching.frames(30);
    assert_eq!(states(&watching.seen), ["learning", "steady"], "{:?}", said(&watching.seen));
    capture_times_are_those_of_the_camera(&watching.seen);
}

/// An address without a server, and a camera that does not exist.
#[test]
fn what_is_not_there_is_reported_with_ffmpegs_words() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("streams-nobody");
    let port = free_port();
    for (source, words) in [
        (private_address(&studio, &format!("rtsp://me:secret@127.0.0.1:{port}/x")), "Connection refused"),
        ("v4l2:///dev/video99".to_string(), "No such file"),
    ] {
        let run = watch_once(&studio, &["--source", &source]);
        let lost = run.events.iter().find(|event| is_source(event, false)).expect("a loss");
        let reason = lost["reason"].as_str().unwrap_or_default();
        assert!(run.code == 1 && reason.contains(words) && !reason.contains("secret"), "{lost}");
    }
}

/// A session that ends in order takes its ffmpeg along.
#[test]
fn an_ffmpeg_ends_with_its_session() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("streams-end");
    let film = film(&studio);
    let port = free_port();
    let _server = serve_tcp(&film, port);
    wait_for_listener(port);
    let mut command = Command::new(assert_cmd::cargo::cargo_bin("resight"));
    command
        .args(crate::film_support::arguments(&studio))
        .args(["--source", &format!("tcp://127.0.0.1:{port}")]);
    // A reader that goes away ends the session in order: its output fails.
    let mut child = command.stdout(std::process::Stdio::piped()).spawn().expect("it runs");
    drop(child.stdout.take());
    let end = Instant::now() + Duration::from_secs(40);
    while Instant::now() < end && child.try_wait().expect("a status").is_none() {
        std::thread::sleep(Duration::from_millis(50));
    }
    assert!(child.try_wait().expect("a status").is_some(), "it continues though nobody listens");
    assert_ne!(runs(&format!("-i tcp://127.0.0.1:{port}"), &[]), Some(true));
}
