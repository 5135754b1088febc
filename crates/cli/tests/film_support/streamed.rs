//! Streams of a film that does not end during a test, and what must hold of a session that watches one.

use super::{H264, PATIENCE, Watching, encode, frames, runs};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Thirty seconds of a camera that stays.
pub fn film(studio: &Path) -> PathBuf {
    let film = studio.join("film.ts");
    let all = frames(studio, (0..300).map(|_| 0.0));
    encode(&all, 10, &[&H264[..], &[&film.display().to_string()]].concat());
    film
}

pub fn is_source(event: &Value, connected: bool) -> bool {
    event["event"] == "source" && event["connected"] == connected
}

/// Frames were taken a tenth of a second apart, and about now.
pub fn capture_times_are_those_of_the_camera(events: &[Value]) {
    let times: Vec<f64> =
        events.iter().filter(|e| e["event"] == "frame").filter_map(|e| e["t_s"].as_f64()).collect();
    let now_s = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970").as_secs_f64();
    assert!(times.iter().all(|t| (now_s - 300.0..=now_s).contains(t)), "{now_s}: {times:?}");
    assert!(times.windows(2).all(|pair| pair[0] <= pair[1]), "{times:?}");
    // In the first second after each connection a frame with a shorter delay than those before it may move the time of day.
    let connected = times.chunk_by(|earlier, later| later - earlier < 1.0);
    let steps: Vec<f64> = connected
        .flat_map(|times| {
            times.windows(2).skip_while(|pair| pair[0] < times[0] + 1.0).map(|pair| pair[1] - pair[0])
        })
        .collect();
    let is_even = |step: &&f64| {
        let tenths = (**step / 0.1).round();
        1.0 <= tenths && (tenths - **step / 0.1).abs() < 0.05
    };
    let even = steps.iter().filter(is_even).count();
    assert!(2 * steps.len() < 3 * even, "{even} of {}: {steps:?}", steps.len());
}

/// The program is killed outright: its ffmpeg notices that nobody reads.
pub fn nothing_stays_behind(watching: Watching, of: &str) {
    assert_ne!(runs(of, &[]), Some(false), "{of} should run");
    drop(watching);
    let end = Instant::now() + Duration::from_secs(30);
    while Instant::now() < end {
        match runs(of, &[]) {
            Some(true) => std::thread::sleep(Duration::from_millis(100)),
            _ => return,
        }
    }
    panic!("{of} still runs");
}

/// Until somebody listens on a port, without connecting to it: the server takes one visitor only.
pub fn wait_for_listener(port: u16) {
    let listening = format!(":{port:04X} 00000000:0000 0A");
    let end = Instant::now() + PATIENCE;
    while Instant::now() < end {
        match std::fs::read_to_string("/proc/net/tcp") {
            Ok(table) if table.contains(&listening) => return,
            Ok(_) => std::thread::sleep(Duration::from_millis(50)),
            // Another system: it will be there by then.
            Err(_) => return std::thread::sleep(Duration::from_secs(5)),
        }
    }
    panic!("nobody listens on port {port} within {PATIENCE:?}")
}
