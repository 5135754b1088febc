//! `watch` on UDP, which has no connection, on RTMP from either end, and on a V4L2 camera that a film stands in for.

use crate::film_support::streamed::{
    capture_times_are_those_of_the_camera, film, is_source, nothing_stays_behind, wait_for_listener,
};
use crate::film_support::{
    Running, Watching, free_port, has_ffmpeg, said, serve, speaks, states, studio, watch_once,
};
use std::net::UdpSocket;
use std::path::Path;

/// A socket on a port of its own.
fn udp_port() -> (UdpSocket, u16) {
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a port");
    let port = socket.local_addr().expect("an address").port();
    (socket, port)
}

fn send_udp(film: &Path, address: &str) -> Running {
    serve(film, &["-f", "mpegts", &format!("{address}?pkt_size=1316")])
}

/// Watched until poses come, with a loss after two seconds.
fn watched(studio: &Path, address: &str) -> Watching {
    let options = ["--frames", "--source", address, "--lost-after-s", "2", "--learn", "20"];
    Watching::start(studio, &[&options[..], &["--stale-after-s", "50"]].concat())
}

/// What was reported in the end: learned, lost once, back once.
fn nothing_else_was_reported(watching: &Watching) {
    assert_eq!(states(&watching.seen), ["learning", "steady"], "{:?}", said(&watching.seen));
    capture_times_are_those_of_the_camera(&watching.seen);
}

/// A stream over UDP has no end marker: silence is a loss, and the sender's return is noticed.
#[test]
fn a_udp_sender_that_falls_silent_is_lost_and_comes_back() {
    if !speaks("udp") {
        return;
    }
    let studio = studio("streams-udp");
    let (film, (socket, port)) = (film(&studio), udp_port());
    drop(socket);
    let address = format!("udp://127.0.0.1:{port}");
    let mut watching = watched(&studio, &address);
    let sender = send_udp(&film, &address);
    watching.until("learned reference", |event| event["event"] == "learned");
    watching.frames(5);
    drop(sender);
    let lost = watching.until("loss", |event| is_source(event, false));
    // What ffmpeg said of the packets before the first key frame is no reason.
    let reason = format!("{address}: no frame for 2 s");
    assert_eq!(lost["reason"], reason.as_str());
    let _sender = send_udp(&film, &address);
    watching.until("return", |event| is_source(event, true));
    watching.frames(30);
    nothing_else_was_reported(&watching);
    nothing_stays_behind(watching, &format!("-i {address}"));
}

/// Another program reads the port: that is said, not what ffmpeg makes of it.
#[test]
fn a_udp_port_that_is_taken_is_reported() {
    if !speaks("udp") {
        return;
    }
    let studio = studio("streams-udp-taken");
    let (_socket, port) = udp_port();
    let run = watch_once(&studio, &["--source", &format!("udp://127.0.0.1:{port}")]);
    let lost = run.events.iter().find(|event| is_source(event, false)).expect("a loss");
    assert!(lost["reason"].as_str().is_some_and(|reason| reason.contains("bind failed")), "{lost}");
    assert_eq!(run.code, 1);
}

/// The server is killed and started again.
#[test]
fn an_rtmp_server_is_watched_lost_and_watched_again() {
    if !speaks("rtmp") {
        return;
    }
    let studio = studio("streams-rtmp");
    let (film, port) = (film(&studio), free_port());
    let address = format!("rtmp://127.0.0.1:{port}/live/gate");
    let start = || serve(&film, &["-f", "flv", "-listen", "1", &address]);
    let server = start();
    wait_for_listener(port);
    let mut watching = watched(&studio, &address);
    watching.until("learned reference", |event| event["event"] == "learned");
    drop(server);
    let lost = watching.until("loss", |event| is_source(event, false));
    assert!(lost["reason"].as_str().is_some_and(|reason| reason.starts_with(&address)), "{lost}");
    let _server = start();
    watching.until("return", |event| is_source(event, true));
    watching.frames(30);
    nothing_else_was_reported(&watching);
    nothing_stays_behind(watching, &format!("-i {address}"));
}

/// A camera that pushes: the session's ffmpeg waits for it.
#[test]
fn an_rtmp_camera_that_pushes_is_watched() {
    if !speaks("rtmp") {
        return;
    }
    let studio = studio("streams-rtmp-pushed");
    let (film, port) = (film(&studio), free_port());
    let address = format!("rtmp://127.0.0.1:{port}/live/gate");
    let listen = ["--ffmpeg-input-options", "-listen 1", "--lost-after-s", "30"];
    let session = [&["--source", &address, "--learn", "20", "--frames"][..], &listen].concat();
    let mut watching = Watching::start(&studio, &session);
    wait_for_listener(port);
    let _camera = serve(&film, &["-f", "flv", &address]);
    watching.until("steady state", |event| event["state"] == "steady");
    watching.frames(30);
    nothing_else_was_reported(&watching);
}

/// A script called `ffmpeg` that reads the recorded frames where V4L2 and the camera are asked for: the device's options, which the
/// reader of raw frames knows by the same names, have to be there and before it.
#[cfg(unix)]
const STAND_IN: &str = r#"#!/bin/sh
PATH=$WITHOUT_STAND_IN
for word do
    shift
    case $word in
        v4l2) set -- "$@" rawvideo -re -pixel_format gray ;;
        /dev/video7) set -- "$@" "$FRAMES" ;;
        *) set -- "$@" "$word" ;;
    esac
done
exec ffmpeg "$@"
"#;

/// Puts the script before all other programs, and returns the path to look for programs in.
#[cfg(unix)]
fn stand_in(studio: &Path, path: &std::ffi::OsStr) -> std::ffi::OsString {
    use std::os::unix::fs::PermissionsExt;
    let bin = studio.join("bin");
    std::fs::create_dir(&bin).expect("a folder");
    std::fs::write(bin.join("ffmpeg"), STAND_IN).expect("written");
    let runs = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(bin.join("ffmpeg"), runs).expect("a program");
    std::env::join_paths(std::iter::once(bin).chain(std::env::split_paths(path))).expect("a path")
}

/// A camera that is plugged in after the start, unplugged and plugged in again: from the name of its device to poses.
#[cfg(unix)]
#[test]
fn a_v4l2_camera_is_watched_when_it_is_there() {
    if !has_ffmpeg() {
        return;
    }
    let studio = studio("streams-v4l2");
    let path = std::env::var_os("PATH").unwrap_or_default();
    let (recorded, plugged) = (studio.join("recorded.gray"), studio.join("plugged.gray"));
    std::fs::write(&recorded, crate::film_support::frames(&studio, (0..40).map(|_| 0.0))).expect("written");
    let options = "-video_size 320x240 -framerate 10";
    let session = ["--source", "/dev/video7", "--ffmpeg-input-options", options, "--learn", "20", "--frames"];
    let environment = [
        ("PATH", stand_in(&studio, &path)),
        ("WITHOUT_STAND_IN", path.clone()),
        ("FRAMES", plugged.clone().into_os_string()),
    ];
    let mut watching = Watching::start_in(&studio, &session, environment);
    let lost = watching.until("loss", |event| is_source(event, false));
    assert!(lost["reason"].as_str().is_some_and(|reason| reason.contains("No such file")), "{lost}");
    std::fs::rename(&recorded, &plugged).expect("plugged in");
    watching.until("camera", |event| is_source(event, true));
    watching.until("steady state", |event| event["state"] == "steady");
    watching.until("end", |event| is_source(event, false));
    watching.until("return", |event| is_source(event, true));
    watching.frames(30);
    nothing_else_was_reported(&watching);
    nothing_stays_behind(watching, &plugged.display().to_string());
}
