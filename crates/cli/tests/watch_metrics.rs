//! `watch --metrics`: what the page says, and to whom.

use crate::receivers::web::{Web, get, metrics_place, page};
use crate::receivers::{Session, lines, wait_for};
use crate::support::folder;
use std::collections::BTreeMap;
use std::net::TcpStream;

/// Past the end of every feed.
const NEVER: usize = usize::MAX;

/// The only pair of a session without names.
fn of(name: &str) -> String {
    format!("{name}{{camera=\"cam0\",target=\"target0\"}}")
}

fn state(state: &str) -> String {
    format!("resight_state{{camera=\"cam0\",target=\"target0\",state=\"{state}\"}}")
}

/// The page once so many frames are counted.
fn page_after(place: &str, frames: f64) -> BTreeMap<String, f64> {
    let counted = of("resight_frames_total");
    wait_for("all frames", || Some(page(place, "")).filter(|page| page[&counted] == frames))
}

fn health(place: &str) -> (u16, String) {
    get(place, &format!("GET /healthz HTTP/1.1\r\nHost: {place}")).expect("an answer")
}

#[test]
fn metrics_of_a_camera_that_stays() {
    let mut session = Session::start(&["--metrics", "127.0.0.1:0", "--false-alarms-per-day", "0.25"]);
    let place = metrics_place(&session);
    assert_eq!(health(&place), (503, "degraded\n".to_string()), "nothing has been seen yet");
    assert_eq!(page(&place, "")[&state("stale")], 1.0);
    session.feed(&format!("{}no JSON\n", lines(None, 0..80, NEVER)));
    let page = page_after(&place, 81.0);
    assert_eq!([page[&state("steady")], page[&state("stale")], page[&state("drifted")]], [1.0, 0.0, 0.0]);
    assert_eq!(page[&of("resight_frames_with_pose_total")], 80.0);
    assert_eq!(page[&of("resight_frames_unreadable_total")], 1.0);
    assert_eq!(page["resight_frame_trouble{camera=\"cam0\",target=\"target0\",reason=\"unreadable\"}"], 1.0);
    assert_eq!(page["resight_source_up{camera=\"cam0\"}"], 1.0);
    assert_eq!(page["resight_allowed_false_alarms_per_day"], 0.25);
    assert_eq!(health(&place), (200, "ok\n".to_string()));
    assert_eq!(session.end().code, 0);
}

#[test]
fn metrics_of_a_camera_that_moved() {
    let web = Web::start(|_| Some("200 OK"));
    let mut session =
        Session::start(&["--metrics", "127.0.0.1:0", "--webhook", &format!("http://{}/", web.place)]);
    let place = metrics_place(&session);
    session.feed(&lines(None, 0..120, 80));
    let moved = page_after(&place, 120.0);
    assert_eq!([moved[&state("drifted")], moved[&state("steady")]], [1.0, 0.0]);
    assert_eq!(moved[&of("resight_alarms_total")], 1.0);
    let rotation_rad = moved[&of("resight_deviation_rotation_radians")];
    let sigma_rad = moved[&of("resight_deviation_rotation_sigma_radians")];
    let error_rad = (rotation_rad - f64::to_radians(1.0)).abs();
    assert!(error_rad < 4.0 * sigma_rad && sigma_rad < 0.01, "{rotation_rad} ± {sigma_rad}");
    let stage = "{camera=\"cam0\",target=\"target0\",stage=\"solve\"";
    assert_eq!(moved[&format!("resight_stage_seconds_count{stage}}}")], 120.0);
    assert_eq!(moved[&format!("resight_stage_seconds_bucket{stage},le=\"+Inf\"}}")], 120.0);
    assert!(0.0 < moved[&format!("resight_stage_seconds_sum{stage}}}")]);
    assert_eq!(health(&place).0, 503);
    let delivered = "resight_notices_total{output=\"webhook\",outcome=\"delivered\"}";
    let waiting = "resight_notices_waiting{output=\"webhook\"}";
    let reported =
        wait_for("deliveries counted", || Some(page(&place, "")).filter(|page| page[waiting] == 0.0));
    assert_eq!(reported[delivered], web.asked().len() as f64);
    assert_eq!(session.end().code, 3);
}

#[test]
fn metrics_are_for_those_who_may_read_them() {
    let file = folder("outputs-token").join("token");
    std::fs::write(&file, "0123456789abcdef0123456789abcdef\n").expect("written");
    private(&file);
    let file = file.to_str().expect("a path");
    let session = Session::start(&[
        "--metrics",
        "127.0.0.1:0",
        "--metrics-token-file",
        file,
        "--metrics-host",
        "watch.example",
    ]);
    let place = metrics_place(&session);
    let status =
        |path: &str, head: &str| get(&place, &format!("GET {path} HTTP/1.1{head}")).expect("an answer").0;
    let own = format!("\r\nHost: {place}");
    let right = "\r\nAuthorization: Bearer 0123456789abcdef0123456789abcdef";
    assert_eq!(status("/metrics", &format!("{own}{right}")), 200);
    assert_eq!(status("/metrics", &format!("\r\nHost: watch.example{right}")), 200);
    assert_eq!(status("/metrics", &own), 401);
    assert_eq!(status("/metrics", &format!("{own}{}", right.replace("f0", "f1"))), 401);
    assert_eq!(status("/metrics", &format!("\r\nHost: evil.example{right}")), 403);
    assert_eq!(status("/nowhere", "\r\nHost: evil.example"), 403, "the name comes before the path");
    assert_eq!(status("/healthz", &own), 503, "no token, no details");
    let (status, page) = get(&place, &format!("GET /etc/passwd HTTP/1.1{own}")).expect("an answer");
    assert_eq!((status, page.as_str()), (404, "not found\n"));
    assert_eq!(get(&place, &format!("POST /metrics HTTP/1.1{own}{right}")).expect("an answer").0, 405);
    session.end();
}

#[cfg(unix)]
fn private(file: &std::path::Path) {
    use std::os::unix::fs::PermissionsExt;
    std::fs::set_permissions(file, std::fs::Permissions::from_mode(0o600)).expect("private");
}

#[cfg(not(unix))]
fn private(_file: &std::path::Path) {}

/// More connections that say nothing than are served at once: frames go on at once, and askers are served when those have been cut off.
#[test]
fn idle_connections_delay_no_frame() {
    let mut session = Session::start(&["--metrics", "127.0.0.1:0"]);
    let place = metrics_place(&session);
    let idle: Vec<TcpStream> = (0..300).map(|_| TcpStream::connect(&place).expect("a connection")).collect();
    session.feed(&lines(None, 0..60, NEVER));
    let counted = wait_for("an answer", || get(&place, &format!("GET /metrics HTTP/1.1\r\nHost: {place}")));
    assert_eq!(counted.0, 200);
    drop(idle);
    let ended = session.end();
    assert_eq!(ended.code, 0, "{}", ended.log);
}

/// A reference that an earlier session learned is compared with from the first frame on.
#[test]
fn a_restart_knows_what_was_learned() {
    let state = folder("outputs-restart").join("gate.state");
    let state = state.to_str().expect("a path");
    let mut first = Session::start(&["--state", state]);
    first.feed(&lines(None, 0..80, NEVER));
    assert_eq!(first.end().code, 0);
    let mut second = Session::start(&["--state", state, "--metrics", "127.0.0.1:0"]);
    let place = metrics_place(&second);
    second.feed(&lines(None, 80..90, NEVER));
    let page = page_after(&place, 10.0);
    let rotation_rad = page.get(&of("resight_deviation_rotation_radians"));
    assert!(rotation_rad.is_some_and(|rotation_rad| *rotation_rad < 0.01), "{rotation_rad:?}");
    let ended = second.end();
    assert_eq!(ended.code, 0, "{}", ended.log);
    assert_eq!(crate::receivers::times(&ended.log, "continues from"), 1, "{}", ended.log);
}
