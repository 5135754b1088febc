//! Small days, and folders for them.

use resight_fleet::run::{Job, Progress, run};
use resight_fleet::simulate::{SimulatedFleet, Simulation, write_day};
use resight_fleet::{FleetState, Solver};
use std::path::{Path, PathBuf};

/// A fresh folder.
pub fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder");
    path
}

pub fn day(cameras: usize, hours: f64, every_s: f64, seed: u64) -> SimulatedFleet {
    let day = Simulation {
        cameras,
        duration_s: 3600.0 * hours,
        every_s,
        seed,
        poison: 1e-3,
        ..Simulation::default()
    };
    day.fleet().expect("a fleet")
}

pub fn written(fleet: &SimulatedFleet, folder: &Path) -> Vec<PathBuf> {
    write_day(fleet, folder).expect("a day")
}

pub fn solver(fleet: &SimulatedFleet) -> Solver {
    Solver { cameras: fleet.known().expect("cameras").into(), sigma_px: fleet.simulation.sigma_px }
}

/// The output's bytes and the state.
pub fn solved(
    inputs: &[PathBuf],
    solver: &Solver,
    output: &Path,
    threads: usize,
) -> (Vec<u8>, FleetState, usize) {
    let job = Job { inputs, solver, output, period_s: 900.0, threads };
    let done = run(&job, &|_: Progress| true).expect("a run");
    assert!(done.failed.is_empty(), "{:?}", done.failed);
    (std::fs::read(output).expect("an output"), done.state, done.resumed_parts)
}
