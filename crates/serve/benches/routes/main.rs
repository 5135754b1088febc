//! How soon each route answers while everything else is busy: targets are searched in photographs of 12 megapixels, photographs come, sweeps are solved,
//! and 256 bodies do not come. Exit status 1 where `/healthz` takes more than its bar.
//!
//! ```sh
//! cargo bench -p resight-serve --bench routes
//! ```
#![allow(missing_docs)]

#[allow(dead_code)] // The tests use the rest.
#[path = "../../tests/client.rs"]
mod client;

use client::{Answer, ask, get, post, server, session};
use resight::GrayImage;
use serde_json::json;
use std::io::Write;
use std::net::{SocketAddr, TcpStream};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Requests of each route.
const REQUESTS: usize = 200;
/// Requests of each route whose work waits for its turn behind searches, photographs or sweeps.
const WAITING_REQUESTS: usize = 10;
/// p99 of `/healthz`, whatever else runs.
const HEALTHZ_MS: f64 = 10.0;

/// Blocks of noise: a search has much to do.
fn blocks(width_px: u32, height_px: u32) -> Vec<u8> {
    let mut image = GrayImage::filled(width_px, height_px, 0);
    for v in 0..height_px {
        for u in 0..width_px {
            let mixed = (u / 8).wrapping_mul(2_654_435_761) ^ (v / 8).wrapping_mul(40_503);
            image.data[(v * width_px + u) as usize] = (mixed.wrapping_mul(2_246_822_519) >> 24) as u8;
        }
    }
    image.png().expect("a PNG")
}

fn put(place: SocketAddr, id: &str, png: &[u8]) {
    let path = format!("POST /api/session/photograph?session={id}&name=a.png");
    assert_eq!(ask(place, &path, &[("Content-Type", "image/png")], png).status, 200);
}

/// Repeats a job until the end.
fn busy(over: &Arc<AtomicBool>, job: impl Fn() + Send + 'static) -> std::thread::JoinHandle<()> {
    let over = Arc::clone(over);
    std::thread::spawn(move || {
        while !over.load(Ordering::Relaxed) {
            job();
        }
    })
}

/// Asks every route and prints how soon it answers; whether `/healthz` is in time.
fn timed(place: SocketAddr, own: &str, png: &[u8]) -> bool {
    let of = |path: &str| format!("/api/session/{path}session={own}");
    let drag =
        json!({ "command": { "kind": "put_point", "name": "A", "u_px": 278, "v_px": 72, "drag": true } });
    let example = json!({ "example": true });
    let gets = [
        "/healthz".to_owned(),
        "/".into(),
        "/app.js".into(),
        "/openapi.json".into(),
        "/api/live/cameras".into(),
        "/api/session/exports".into(),
        "/api/session/cameras".into(),
        of("view?"),
        of("photograph?"),
    ];
    let mut is_met = true;
    for path in gets {
        let p99_ms = asked(&path, REQUESTS, || get(place, &path));
        is_met &= path != "/healthz" || p99_ms <= HEALTHZ_MS;
    }
    asked("POST …/command", REQUESTS, || post(place, &of("command?"), &drag));
    asked("POST …/cancel", REQUESTS, || post(place, &of("cancel?"), &json!({})));
    for path in [of("save?"), of("export?format=csv&"), of("export?format=report&"), of("birdseye?")] {
        asked(&path, WAITING_REQUESTS, || get(place, &path));
    }
    let id = session(place);
    let path = format!("POST /api/session/photograph?session={id}&name=a.png");
    let sent = || ask(place, &path, &[("Content-Type", "image/png")], png);
    asked("POST …/photograph, 12 MP", WAITING_REQUESTS, sent);
    asked("POST /api/session", WAITING_REQUESTS, || post(place, "/api/session", &json!({})));
    // Fewer sessions than the program keeps, so that none of those above goes.
    for path in ["/api/session", "/api/rig", "/api/whisker"] {
        asked(&format!("POST {path}, example"), WAITING_REQUESTS, || post(place, path, &example));
    }
    is_met
}

/// Asks so often, and prints and returns the 99th percentile, ms.
fn asked(name: &str, requests: usize, ask: impl Fn() -> Answer) -> f64 {
    let once = |_| {
        let began = Instant::now();
        assert_eq!(ask().status, 200, "{name}");
        1e3 * began.elapsed().as_secs_f64()
    };
    let mut took_ms: Vec<f64> = (0..requests).map(once).collect();
    took_ms.sort_by(f64::total_cmp);
    let at = |share: usize| took_ms[share * (requests - 1) / 100];
    let name = name.split("session=").next().unwrap_or(name);
    println!("{name:40} {requests:3} times   p50 {:8.2}   p99 {:8.2}", at(50), at(99));
    at(99)
}

fn main() -> ExitCode {
    let place = server(None);
    let png = Arc::new(blocks(4000, 3000));
    let over = Arc::new(AtomicBool::new(false));
    let search = json!({ "command": { "kind": "find_target", "target": { "by": "family", "family": "any", "size_m": 0.1 } } });
    let mut all = Vec::new();
    for _ in 0..2 {
        let (id, search) = (session(place), search.clone());
        put(place, &id, &png);
        all.push(busy(&over, move || {
            drop(post(place, &format!("/api/session/command?session={id}"), &search))
        }));
    }
    let (uploaded, id) = (Arc::clone(&png), session(place));
    all.push(busy(&over, move || put(place, &id, &uploaded)));
    all.push(busy(&over, move || drop(post(place, "/api/whisker", &json!({ "example": true })))));
    let own = post(place, "/api/session", &json!({ "example": true })).json();
    let own = own["session"].as_str().expect("an id").to_owned();
    let head = format!(
        "POST /api/rig HTTP/1.1\r\nHost: 127.0.0.1:{}\r\nContent-Type: application/json\r\nContent-Length: 1000000\r\n\r\n{{",
        place.port()
    );
    let slow: Vec<TcpStream> = (0..256)
        .filter_map(|_| {
            let mut stream = TcpStream::connect(place).ok()?;
            stream.write_all(head.as_bytes()).ok()?;
            Some(stream)
        })
        .collect();
    println!("{} bodies do not come; answers, ms:", slow.len());
    let is_met = timed(place, &own, &png);
    over.store(true, Ordering::Relaxed);
    drop(slow);
    println!("{}", if is_met { "met" } else { "missed: /healthz is later than 10 ms" });
    ExitCode::from(u8::from(!is_met))
}
