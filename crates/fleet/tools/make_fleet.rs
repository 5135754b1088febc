//! Writes a simulated day of a fleet with its truth: `cargo run --release -p resight-fleet --example make_fleet -- FOLDER [KEY=NUMBER…]`.
//!
//! Keys: cameras, hours, every_s, sigma_px, thermal_deg, poison, seed.

use resight_fleet::simulate::{Simulation, write_day};
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut words = std::env::args().skip(1);
    let folder = words
        .next()
        .ok_or("a folder is needed: make_fleet FOLDER [cameras=100] [hours=24] [every_s=10] …")?;
    let mut day = Simulation::default();
    for word in words {
        let (key, value) = word.split_once('=').ok_or_else(|| format!("`{word}`: KEY=NUMBER is needed"))?;
        let number: f64 = value.parse().map_err(|_| format!("`{word}`: a number is needed after `=`"))?;
        match key {
            "cameras" => day.cameras = number as usize,
            "hours" => day.duration_s = number * 3600.0,
            "every_s" => day.every_s = number,
            "sigma_px" => day.sigma_px = number,
            "thermal_deg" => day.thermal_deg = number,
            "poison" => day.poison = number,
            "seed" => day.seed = number as u64,
            _ => return Err(format!("`{key}` is no key; see the head of this file").into()),
        }
    }
    let files = write_day(&day.fleet()?, Path::new(&folder))?;
    println!("{} files of views, {} rows at most", files.len(), day.ticks() * day.cameras);
    Ok(())
}
