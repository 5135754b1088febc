//! The page of a watch session under load: ten clients look at four cameras of 1280 × 960 pixels at 30 frames a second. No frame may be dropped
//! for them, each client gets its pictures, and the memory of the server does not grow.
//!
//! ```sh
//! cargo bench -p resight-serve --bench live                      # a minute
//! cargo bench -p resight-serve --bench live -- --seconds 3600    # memory over an hour
//! ```
//! Server and clients are two processes, so that the memory is that of the server. Exit status 1 when a bar is missed.
#![allow(missing_docs)]

mod cameras;
#[allow(dead_code)] // The tests use the rest.
#[path = "../../tests/feed.rs"]
mod feed;
#[allow(dead_code)] // The bench of sessions uses the rest.
#[path = "../../../watch/benches/live/figures.rs"]
mod figures;
#[allow(dead_code)] // The tests use the rest.
#[path = "../../../watch/tests/live_support/mod.rs"]
mod live_support;

use feed::{Feed, Told};
use figures::{Bars, Quantiles};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::net::SocketAddr;
use std::process::{Child, Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const CLIENTS: usize = 10;
/// Pictures of a camera that a client is to get, a second: ten at most are made.
const PICTURES_HZ: f64 = 5.0;
/// Growth of memory once caches are warm, megabytes an hour.
const GROWTH_MB_PER_H: f64 = 1.0;
/// What is kept of the past fills during the first sixth of a run, and in 20 seconds at least.
const WARM_S: f64 = 20.0;
const WARM_SHARE: f64 = 1.0 / 6.0;
/// Less time than this shows no slope of memory.
const SLOPE_NEEDS_S: f64 = 300.0;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| word != "--bench").collect();
    let seconds = match words.as_slice() {
        [] => 60.0,
        [flag, seconds] if flag == "--seconds" => seconds.parse().unwrap_or(60.0),
        [flag, seconds] if flag == "--server" => return cameras::serve(seconds.parse().unwrap_or(60.0)),
        _ => {
            eprintln!("give --seconds N");
            return ExitCode::from(2);
        }
    };
    let (mut server, place) = started(seconds);
    let measured = measured(place, server.id(), seconds);
    let _ = server.kill();
    let _ = server.wait();
    let mut bars = Bars::default();
    report(&measured, seconds, &mut bars);
    bars.verdict()
}

/// The server in a process of its own, and its address.
fn started(seconds: f64) -> (Child, SocketAddr) {
    let program = std::env::current_exe().expect("this program");
    let mut child = Command::new(program)
        .args(["--server", &(seconds + 30.0).to_string()])
        .stdout(Stdio::piped())
        .spawn()
        .expect("a server");
    let mut line = String::new();
    let mut printed = BufReader::new(child.stdout.take().expect("its output"));
    printed.read_line(&mut line).expect("its address");
    (child, line.trim().parse().expect("an address"))
}

struct Measured {
    /// By client.
    pictures: Vec<u64>,
    states: Vec<u64>,
    /// From one picture to the next of a client.
    between: Quantiles,
    /// The last state.
    view: Value,
    /// Seconds since the start, bytes.
    memory: Vec<(f64, f64)>,
    cpu_share: f64,
}

fn measured(place: SocketAddr, server: u32, seconds: f64) -> Measured {
    let end = Instant::now() + Duration::from_secs_f64(seconds);
    let counts: Vec<[AtomicU64; 2]> = (0..CLIENTS).map(|_| Default::default()).collect();
    let (mut memory, cpu_before, began) = (Vec::new(), cpu_s(server), Instant::now());
    let (between, view) = std::thread::scope(|scope| {
        let clients: Vec<_> =
            counts.iter().map(|counts| scope.spawn(move || client(place, end, counts))).collect();
        while Instant::now() < end {
            std::thread::sleep(Duration::from_secs(1).min(end.saturating_duration_since(Instant::now())));
            let since_s = began.elapsed().as_secs_f64();
            memory.extend(resident_bytes(server).map(|bytes| (since_s, bytes)));
        }
        let mut told = clients.into_iter().map(|client| client.join().expect("a client"));
        let (mut between, mut view) = told.next().expect("ten of them");
        for (times, last) in told {
            times.into_iter().for_each(|us| between.push(us));
            view = if last.is_null() { view } else { last };
        }
        let mut quantiles = Quantiles::default();
        between.into_iter().for_each(|us| quantiles.add(us));
        (quantiles, view)
    });
    let cpu_share = cpu_s(server).zip(cpu_before).map_or(0.0, |(after, before)| (after - before) / seconds);
    let of = |k: usize| counts.iter().map(|c| c[k].load(Ordering::Relaxed)).collect();
    Measured { pictures: of(0), states: of(1), between, view, memory, cpu_share }
}

/// Reads and acknowledges; gives the times between its pictures, of the last ten thousand, and the last state.
fn client(place: SocketAddr, end: Instant, counts: &[AtomicU64; 2]) -> (Vec<f64>, Value) {
    let mut feed = Feed::open(place);
    let (mut times, mut view, mut last) = (Vec::new(), Value::Null, Instant::now());
    while let Some(told) = feed.next(end.saturating_duration_since(Instant::now())) {
        match told {
            Told::Picture(..) => {
                feed.acknowledge();
                counts[0].fetch_add(1, Ordering::Relaxed);
                if times.len() < 10_000 {
                    times.push(last.elapsed().as_secs_f64() * 1e6);
                }
                last = Instant::now();
            }
            Told::Text(mut text) => {
                counts[1].fetch_add(1, Ordering::Relaxed);
                if text["live"].is_object() {
                    view = text["live"].take();
                }
            }
        }
    }
    (times, view)
}

fn report(measured: &Measured, seconds: f64, bars: &mut Bars) {
    let cameras = measured.view["cameras"].as_array().cloned().unwrap_or_default();
    let sum = |key: &str| cameras.iter().filter_map(|camera| camera[key].as_f64()).sum::<f64>();
    println!("{CLIENTS} clients, {} cameras, {seconds} s", cameras.len());
    println!("  the server used {:.0} % of one core", 100.0 * measured.cpu_share);
    for camera in &cameras {
        let stage = camera["stages"].as_array().and_then(|stages| stages.last()).cloned().unwrap_or_default();
        println!(
            "  {}: {:.1} frames/s, frame to pose p50 {:.1} ms, p99 {:.1} ms",
            camera["name"].as_str().unwrap_or_default(),
            camera["fps"].as_f64().unwrap_or_default(),
            stage["median_us"].as_f64().unwrap_or_default() * 1e-3,
            stage["p99_us"].as_f64().unwrap_or_default() * 1e-3
        );
    }
    measured.between.row("between pictures");
    let minutes = measured.memory.iter().step_by(60);
    let memory: Vec<String> = minutes.map(|(_, bytes)| format!("{:.1}", bytes / 1e6)).collect();
    println!("  memory of the server each minute, MB: {}", memory.join(" "));
    bars.at_most("cameras that are not there", cameras::CAMERAS as f64 - cameras.len() as f64, 0.0, "");
    bars.at_most("frames dropped", sum("dropped"), 0.0, "");
    let fewest = measured.pictures.iter().min().copied().unwrap_or_default() as f64;
    let slowest_s = seconds / fewest.max(1.0) * cameras::CAMERAS as f64;
    bars.at_most("a picture of a camera, worst client, every", slowest_s, 1.0 / PICTURES_HZ, "s");
    let states = measured.states.iter().min().copied().unwrap_or_default() as f64;
    bars.at_most("a state, worst client, every", seconds / states.max(1.0), 0.3, "s");
    match growth_mb_per_h(&measured.memory, WARM_S.max(WARM_SHARE * seconds)) {
        Some(growth) if SLOPE_NEEDS_S <= seconds => {
            bars.at_most("growth of memory", growth, GROWTH_MB_PER_H, "MB/h")
        }
        _ => println!("  growth of memory: needs --seconds {SLOPE_NEEDS_S} or more"),
    }
}

/// Least squares over all seconds since the caches were warm.
fn growth_mb_per_h(memory: &[(f64, f64)], warm_s: f64) -> Option<f64> {
    let warm: Vec<(f64, f64)> = memory.iter().filter(|(t_s, _)| warm_s <= *t_s).copied().collect();
    let n = warm.len() as f64;
    let (t, m) = (warm.iter().map(|p| p.0).sum::<f64>() / n, warm.iter().map(|p| p.1).sum::<f64>() / n);
    let spread: f64 = warm.iter().map(|p| (p.0 - t).powi(2)).sum();
    let slope = warm.iter().map(|p| (p.0 - t) * (p.1 - m)).sum::<f64>() / spread;
    Some(slope * 3600.0 / 1e6).filter(|slope| slope.is_finite())
}

/// Memory in RAM of a process, bytes, as Linux tells it; nothing elsewhere.
fn resident_bytes(process: u32) -> Option<f64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<f64>().ok().map(|kilobytes| kilobytes * 1024.0)
}

/// Seconds of all cores spent in a process; ticks are a hundredth of a second on Linux.
fn cpu_s(process: u32) -> Option<f64> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks = |i: usize| fields.get(i)?.parse::<f64>().ok();
    Some((ticks(11)? + ticks(12)?) / 100.0)
}
