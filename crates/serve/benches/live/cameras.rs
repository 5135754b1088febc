//! The server of the bench, with the four cameras of the bench of sessions.

use crate::live_support::config;
use resight_serve::{ServeConfig, Server};
use resight_watch::{Log, Request};
use std::process::ExitCode;

#[path = "../../../watch/benches/live/cameras.rs"]
mod rendered;

pub use rendered::CAMERAS;

const NAMES: [&str; CAMERAS] = ["middle", "small", "wall", "jumps"];

/// Serves a session of so many seconds, and prints the address first.
pub fn serve(seconds: f64) -> ExitCode {
    let mut cameras = rendered::from_memory(seconds);
    cameras.iter_mut().zip(NAMES).for_each(|(camera, name)| camera.name = name.to_owned());
    let request = Request { is_once: false, ..Request::new(cameras, config()) };
    let config = ServeConfig {
        flag: "--listen",
        address: "127.0.0.1:0".into(),
        token_file: None,
        hosts: Vec::new(),
        patience: ServeConfig::PATIENCE,
    };
    let Ok(mut server) = Server::bind(&config) else { return ExitCode::FAILURE };
    let place = server.place();
    if server.watch(request, Log::default()).is_err() {
        return ExitCode::FAILURE;
    }
    println!("{place}");
    match server.run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(_) => ExitCode::FAILURE,
    }
}
