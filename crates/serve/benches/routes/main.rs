//! How soon each route answers while everything else is busy: targets are searched in photographs of 12 megapixels, photographs come, sweeps are solved,
//! and 256 bodies do not come. Exit status 1 where `/healthz` takes more than its bar, or a route of the description is not asked.
//!
//! With `--soak SECONDS` sessions are opened, worked on, saved and loaded for so long instead, and memory must stay flat.
//!
//! ```sh
//! cargo bench -p resight-serve --bench routes
//! cargo bench -p resight-serve --bench routes -- --soak 3600
//! ```
#![allow(missing_docs)]

#[allow(dead_code)] // The tests use the rest.
#[path = "../../tests/client.rs"]
mod client;

use client::{Answer, ask, get, post, server, session};
use resight::GrayImage;
use serde_json::{Value, json};
use std::collections::BTreeSet;
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
/// Sessions that the program keeps.
const MOST_SESSIONS: usize = 32;
/// By how much memory may differ between the thirds of a soak, MB: what the allocator's pieces scatter by.
const GROWN_MB: f64 = 8.0;

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

/// Routes that are not asked: they need a history file or a capture, wait for a camera's next frame, or begin what others here have begun.
const LEFT_OUT: [&str; 7] = [
    "GET /api/live/history",
    "GET /api/live/frame",
    "GET /cameras.mjpg",
    "POST /api/live/reference",
    "GET /api/capture",
    "POST /api/capture/take-back",
    "POST /api/capture/finish",
];

/// How soon routes answer.
struct Timing {
    place: SocketAddr,
    /// Method and path of those that were asked.
    asked: BTreeSet<String>,
}

impl Timing {
    fn get(&mut self, path: &str, requests: usize) -> f64 {
        let place = self.place;
        self.asked(&format!("GET {path}"), requests, || get(place, path))
    }

    fn post(&mut self, path: &str, requests: usize, body: &Value) -> f64 {
        let place = self.place;
        self.asked(&format!("POST {path}"), requests, || post(place, path, body))
    }

    /// Asks so often, and prints and returns the 99th percentile, ms.
    fn asked(&mut self, name: &str, requests: usize, ask: impl Fn() -> Answer) -> f64 {
        let once = |_| {
            let began = Instant::now();
            assert_eq!(ask().status, 200, "{name}");
            1e3 * began.elapsed().as_secs_f64()
        };
        let mut took_ms: Vec<f64> = (0..requests).map(once).collect();
        took_ms.sort_by(f64::total_cmp);
        let at = |share: usize| took_ms[share * (requests - 1) / 100];
        let (route, query) = name.split_once('?').unwrap_or((name, ""));
        let format = query.split('&').find(|part| part.starts_with("format=")).unwrap_or_default();
        println!(
            "{:44} {requests:3} times   p50 {:8.2}   p99 {:8.2}",
            format!("{route} {format}"),
            at(50),
            at(99)
        );
        self.asked.insert(route.to_owned());
        at(99)
    }

    /// Asks every route; whether `/healthz` is in time.
    fn all(&mut self, own: &str, png: &[u8]) -> bool {
        let of = |path: &str| format!("/api/session{path}session={own}");
        let p99_ms = self.get("/healthz", REQUESTS);
        for path in
            ["/", "/app.js", "/app.css", "/openapi.json", "/api/session/exports", "/api/session/cameras"]
        {
            self.get(path, REQUESTS);
        }
        self.live();
        for path in ["/view?", "/photograph?"] {
            self.get(&of(path), REQUESTS);
        }
        let drag =
            json!({ "command": { "kind": "put_point", "name": "A", "u_px": 278, "v_px": 72, "drag": true } });
        self.post(&of("/command?"), REQUESTS, &drag);
        self.post(&of("/cancel?"), REQUESTS, &json!({}));
        for path in ["/save?", "/export?format=csv&", "/export?format=report&", "/birdseye?"] {
            self.get(&of(path), WAITING_REQUESTS);
        }
        let (place, id) = (self.place, session(self.place));
        let path = format!("POST /api/session/photograph?session={id}&name=a.png");
        self.asked(&path, WAITING_REQUESTS, || ask(place, &path, &[("Content-Type", "image/png")], png));
        // Fewer sessions than the program keeps, so that none of those above goes.
        for path in ["/api/session", "/api/rig", "/api/whisker"] {
            self.post(path, WAITING_REQUESTS, &json!({ "example": true }));
        }
        p99_ms <= HEALTHZ_MS
    }

    /// Asks the routes of watched cameras, of the two that the program draws.
    fn live(&mut self) {
        self.post("/api/live/example", 1, &json!({}));
        self.get("/api/live/cameras", REQUESTS);
        let names = get(self.place, "/api/live/cameras").json();
        let camera = names[0].as_str().expect("a camera").to_owned();
        let strip = format!("/api/live/strip?camera={camera}");
        let began = Instant::now();
        while get(self.place, &strip).status != 200 && began.elapsed().as_secs() < 30 {
            std::thread::sleep(std::time::Duration::from_millis(100));
        }
        for path in ["/api/live", "/api/live/scene", "/api/live/log", &strip] {
            self.get(path, REQUESTS);
        }
        for path in ["lens", "reference"] {
            self.get(&format!("/api/live/{path}?camera={camera}"), REQUESTS);
        }
        for path in ["acknowledge", "reset"] {
            self.post(&format!("/api/live/{path}"), REQUESTS, &json!({ "camera": camera }));
        }
    }

    /// Routes of the description that were neither asked nor left out.
    fn forgotten(&self) -> Vec<String> {
        let description = get(self.place, "/openapi.json").json();
        let paths = description["paths"].as_object().expect("paths");
        let all = paths.iter().flat_map(|(path, methods)| {
            let methods = methods.as_object().expect("methods").keys();
            methods.map(move |method| format!("{} {path}", method.to_uppercase()))
        });
        all.filter(|route| !self.asked.contains(route) && !LEFT_OUT.contains(&route.as_str())).collect()
    }
}

/// Resident memory of this process, server and client, MB; `None` where the system does not state it.
fn resident_mb() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: f64 = text.split_whitespace().nth(1)?.parse().ok()?;
    Some(pages * 4096.0 / 1e6)
}

/// Opens a session, works on it with a further photograph, saves it and opens what was saved.
fn worked(place: SocketAddr, png: &[u8]) {
    let opened = post(place, "/api/session", &json!({ "example": true })).json();
    let id = opened["session"].as_str().expect("an id");
    let command = format!("/api/session/command?session={id}");
    put(place, id, png);
    for i in 0..10 {
        let (u_px, name) = (277.0 + 0.1 * f64::from(i), format!("length {i}"));
        let put = json!({ "kind": "put_point", "name": "A", "u_px": u_px, "v_px": 72.0, "drag": i % 5 != 4 });
        let points = [[300.0, 150.0 + 10.0 * f64::from(i)], [400.0, 170.0]];
        let add = json!({ "kind": "add_measurement", "name": name, "what": "length", "points": points });
        for one in [put, add] {
            assert_eq!(post(place, &command, &json!({ "command": one })).status, 200);
        }
    }
    assert_eq!(post(place, &command, &json!({ "command": { "kind": "undo" } })).status, 200);
    assert_eq!(get(place, &format!("/api/session/export?format=report&session={id}")).status, 200);
    let saved = get(place, &format!("/api/session/save?session={id}")).body;
    let load = json!({ "load": String::from_utf8(saved).expect("text") });
    assert_eq!(post(place, "/api/session", &load).status, 200);
}

/// Sessions for so long; whether memory stays flat.
fn is_flat(seconds: f64) -> bool {
    let (place, png, began) = (server(None), blocks(2000, 1500), Instant::now());
    let mut resident: Vec<f64> = Vec::new();
    while began.elapsed().as_secs_f64() < seconds {
        worked(place, &png);
        resident.extend(resident_mb());
    }
    // The first sessions fill what the program keeps: twice as many as that.
    let steady = resident.get(2 * MOST_SESSIONS..).unwrap_or_default();
    let middle = |part: &[f64]| {
        let mut sorted = part.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let third = steady.len() / 3;
    let (early, late) = (middle(&steady[..third]), middle(&steady[steady.len() - third..]));
    println!(
        "{} sessions in {seconds:.0} s: {early:.1} MB in the first third, {late:.1} MB in the last",
        2 * resident.len()
    );
    late - early < GROWN_MB
}

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    if let [flag, seconds] = words.as_slice()
        && flag == "--soak"
    {
        let is_met = is_flat(seconds.parse().expect("a number of seconds"));
        println!("{}", if is_met { "met" } else { "missed: memory grows" });
        return ExitCode::from(u8::from(!is_met));
    }
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
    let mut timing = Timing { place, asked: BTreeSet::new() };
    let is_met = timing.all(&own, &png);
    let forgotten = timing.forgotten();
    over.store(true, Ordering::Relaxed);
    drop(slow);
    println!("{}", if is_met { "met" } else { "missed: /healthz is later than 10 ms" });
    if !forgotten.is_empty() {
        println!("not asked: {}", forgotten.join(", "));
    }
    ExitCode::from(u8::from(!is_met || !forgotten.is_empty()))
}
