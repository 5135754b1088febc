//! `whisker simulate`: what the hub would have felt.

use super::input::{self, WhiskerArgs};
use crate::args::not_negative;
use crate::output::{Outcome, print};
use anyhow::{Result, anyhow};
use clap::Args;
use resight::formats::write_atomically;
use resight_whisker::files::object::{SweepPath, read_path};
use resight_whisker::files::truth::{self, TruthContact, TruthRow};
use resight_whisker::files::{WhiskerFile, hub};
use resight_whisker::simulate::{
    Change, Record, Simulated, Spacing, add_noise, record, standard_sweeps, sweep,
};
use resight_whisker::{PlanarPose, Sample, Shape};
use std::path::PathBuf;

/// What the hub would have felt: readings of a whisker swept over an object, and the truth behind them.
///
/// Quasi-static, one point of contact, convex objects, full sliding. Readings are exact unless --noise-seed is given. The path is a
/// JSON list `sweeps` of translate, rotate or poses; without one, the three standard sweeps around (0, 0.165 m).
#[derive(Debug, Args)]
pub struct Simulate {
    #[command(flatten)]
    whisker: WhiskerArgs,
    /// Object file: {"object": {"type": "circle", "centre": [x, y], "radius": r}, "friction_coefficient": mu}; also ellipse, square,
    /// rectangle, polygon.
    #[arg(long, value_name = "OBJECT.json")]
    object: PathBuf,
    /// Hub path: {"sweeps": [{"kind": "translate", "x0", "x1", "y", "psi_deg"}, {"kind": "rotate", "hx", "hy", "psi0_deg",
    /// "psi1_deg"}, {"kind": "poses", "poses": [[x, y, angle_rad], …]}]}.
    #[arg(long, value_name = "PATH.json")]
    path: Option<PathBuf>,
    /// Coulomb's coefficient of friction [default: as the object file says, else 0]
    #[arg(long, value_name = "MU", allow_negative_numbers = true, value_parser = not_negative)]
    mu: Option<f64>,
    /// Adds the noise and the rounding of the whisker file's instruments, from this seed.
    #[arg(long, value_name = "SEED")]
    noise_seed: Option<u64>,
    /// Readings from the touch to the end of a sweep that does not say how many.
    #[arg(long, value_name = "N", default_value = "120", value_parser = clap::value_parser!(u32).range(2..10_000_000))]
    samples: u32,
    /// Readings, CSV; without it they go to stdout.
    #[arg(short, long, value_name = "HUB.csv")]
    output: Option<PathBuf>,
    /// Where the contacts are, CSV.
    #[arg(long, value_name = "TRUTH.csv")]
    truth: Option<PathBuf>,
}

/// See `Simulate`.
pub fn run(args: &Simulate) -> Result<Outcome> {
    for path in args.output.iter().chain(&args.truth) {
        crate::files::must_be_writable(path)?;
    }
    let file = args.whisker.read()?;
    let object = input::object(&args.object)?;
    let mu = args.mu.or(object.friction_coefficient).unwrap_or(0.0);
    let records: Vec<(u32, Record)> = sweeps(args)?
        .iter()
        .map(|path| Ok((path.sweep, one(args, &file, &object.shape, mu, path)?)))
        .collect::<Result<_>>()?;
    let all: Vec<Simulated> = records.iter().flat_map(|(_, record)| record.samples.iter().copied()).collect();
    let exact: Vec<Sample> = all.iter().map(|simulated| simulated.sample).collect();
    let samples = match args.noise_seed {
        Some(seed) => add_noise(&exact, &file.cell, seed),
        None => exact,
    };
    if let Some(path) = &args.truth {
        write_atomically(path, truth::write(&truth_rows(&all)).as_bytes())?;
    }
    match &args.output {
        None => print(&hub::write_hub(&samples))?,
        Some(path) => {
            write_atomically(path, hub::write_hub(&samples).as_bytes())?;
            print(&words(args, &records))?;
        }
    }
    Ok(Outcome::Answered)
}

fn sweeps(args: &Simulate) -> Result<Vec<SweepPath>> {
    match &args.path {
        Some(path) => {
            read_path(&input::text(path)?).map_err(|reason| anyhow!("{}: {reason}", path.display()))
        }
        None => {
            let numbered = (0..).zip(standard_sweeps());
            Ok(numbered.map(|(sweep, motion)| SweepPath { sweep, motion, n_samples: None }).collect())
        }
    }
}

fn one(args: &Simulate, file: &WhiskerFile, object: &Shape, mu: f64, path: &SweepPath) -> Result<Record> {
    let spacing = Spacing { after_touch: args.samples, ..Spacing::default() };
    let found = match path.n_samples {
        None => sweep(&file.rod, object, mu, path.sweep, &path.motion, &spacing),
        Some(n) => {
            let last = (n.max(2) - 1) as f64;
            let times = (0..n).map(|i| i as f64 / last);
            let poses: Vec<PlanarPose> = times.clone().map(|t| path.motion.at(t)).collect();
            record(&file.rod, object, mu, path.sweep, &poses).map(|mut record| {
                record.samples.iter_mut().zip(times).for_each(|(s, t)| s.sample.t_s = Some(t));
                record.events.iter_mut().for_each(|event| event.pose /= last);
                record
            })
        }
    };
    found.map_err(|reason| anyhow!("sweep {}: {reason}", path.sweep))
}

fn truth_rows(all: &[Simulated]) -> Vec<TruthRow> {
    let contact = |s: &Simulated| {
        s.truth.map(|truth| TruthContact {
            x_in_world: truth.x_in_world,
            s_m: truth.s_m,
            theta_rad: truth.theta_rad,
            force_n: truth.force_in_world_n,
            friction_angle_rad: truth.friction_angle_rad,
            mode: truth.touching.to_string(),
        })
    };
    all.iter()
        .map(|s| TruthRow { sweep: s.sample.sweep, sample: s.sample.sample, contact: contact(s) })
        .collect()
}

fn words(args: &Simulate, records: &[(u32, Record)]) -> String {
    let mut out = String::new();
    for (sweep, record) in records {
        let touching = record.samples.iter().filter(|s| s.truth.is_some()).count();
        let events: Vec<String> = record
            .events
            .iter()
            .map(|event| format!("{} at t = {:.4}", change(&event.change), event.pose))
            .collect();
        let events = if events.is_empty() { "nothing touched".to_string() } else { events.join(", ") };
        out +=
            &format!("sweep {sweep}: {} readings, {touching} in contact; {events}\n", record.samples.len());
    }
    let written: Vec<String> =
        args.output.iter().chain(&args.truth).map(|path| path.display().to_string()).collect();
    out + &format!("written: {}\n", written.join(", "))
}

fn change(change: &Change) -> String {
    match change {
        Change::Touch { .. } => "touch".to_string(),
        Change::Jump { from, to } => format!("jump from {from} to {to}"),
        Change::Slide => "slide".to_string(),
        Change::SlipOff => "slip-off".to_string(),
        Change::LiftOff => "lift-off".to_string(),
    }
}
