//! Real time: four cameras of 1280 × 960 pixels at 30 frames a second on two cores, none dropped, each pose within milliseconds.
//!
//! ```sh
//! cargo bench -p resight-watch --bench live                                  # a minute of each part
//! cargo bench -p resight-watch --bench live -- --part memory --seconds 3600  # memory over an hour
//! ```
//! `search`: one image. `memory`: rendered images held in memory. `boards`: the same of boards, one of which is taken away. `films`: four H.264 films through four ffmpeg. `readings`: detections to decision.
//! Exit status 1 when a bar is missed.
#![allow(missing_docs)]

mod boards;
mod cameras;
mod figures;
mod films;
mod process;
mod readings;
mod search;
mod session;
#[allow(dead_code)] // The tests use the rest.
#[path = "../../tests/live_support/mod.rs"]
mod live_support;

use std::process::ExitCode;

const PARTS: [&str; 6] = ["search", "readings", "memory", "boards", "films", "all"];

/// What is run.
struct Arguments {
    part: String,
    seconds: f64,
}

fn arguments() -> Result<Arguments, String> {
    let mut parsed = Arguments { part: "all".to_string(), seconds: 60.0 };
    // Cargo says --bench to every bench.
    let mut words = std::env::args().skip(1).filter(|word| word != "--bench");
    while let Some(word) = words.next() {
        let value = words.next().ok_or_else(|| format!("{word} needs a value"))?;
        match word.as_str() {
            "--part" if PARTS.contains(&value.as_str()) => parsed.part = value,
            "--seconds" => {
                parsed.seconds = value.parse().map_err(|_| format!("--seconds {value}: not a number"))?
            }
            _ => {
                return Err(format!("{word} {value}: give --part {} or --seconds N", PARTS.join("|")));
            }
        }
    }
    Ok(parsed)
}

fn main() -> ExitCode {
    let arguments = match arguments() {
        Ok(arguments) => arguments,
        Err(reason) => {
            eprintln!("{reason}");
            return ExitCode::from(2);
        }
    };
    let is_run = |part: &str| [part, "all"].contains(&arguments.part.as_str());
    let mut bars = figures::Bars::default();
    if is_run("search") {
        search::run();
    }
    if is_run("readings") {
        readings::run(&mut bars);
    }
    if is_run("memory") {
        println!("\nfour cameras, rendered images from memory");
        session::run(cameras::from_memory(arguments.seconds), arguments.seconds, &session::TAGS, &mut bars);
    }
    if is_run("boards") {
        println!("\nfour cameras that see boards, rendered images from memory");
        session::run(boards::from_memory(arguments.seconds), arguments.seconds, &session::BOARDS, &mut bars);
    }
    if is_run("films") {
        match films::cameras(arguments.seconds) {
            Ok(cameras) => {
                println!("\nfour cameras, H.264 decoded by four ffmpeg");
                session::run(cameras, arguments.seconds, &session::TAGS, &mut bars);
            }
            Err(reason) => println!("\nfilms: skipped, {reason}"),
        }
    }
    bars.verdict()
}
