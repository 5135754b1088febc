//! `whisker`: object profiles by touch, one file per job.

mod answer;
mod calibrate;
mod check;
mod drift;
mod identify;
mod input;
mod picture;
mod simulate;
mod solve;
mod solving;
mod stream;
mod summary;

pub use answer::Answer;
pub use calibrate::CalibrateObject;
pub use check::CheckObject;
pub use summary::RecordObject;

use crate::output::Outcome;
use anyhow::Result;
use clap::{Args, Subcommand};

/// Object profiles by touch: where an elastic whisker meets an object, from the forces and the torque at its hub.
///
/// The load cell at the hub and the hub's pose determine the whole bent whisker; where its bending moment vanishes, there it
/// touches. One reading gives one contact with its covariance, a sweep gives a locus, the locus gives the object: docs/whisker.md.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight whisker solve --whisker meta.json hub.csv -o contacts.csv --picture locus.svg
  resight whisker identify contacts.csv -o object.json --picture object.png
  resight whisker simulate --whisker meta.json --object object.json --path path.json -o hub.csv
  resight whisker calibrate --whisker meta.json hub.csv -o calibrated.json
  load-cell | resight whisker stream --whisker meta.json
  resight whisker check contacts.csv truth.csv")]
pub struct Whisker {
    #[command(subcommand)]
    job: Job,
}

#[derive(Debug, Subcommand)]
#[allow(clippy::large_enum_variant)] // One job a run.
enum Job {
    /// The contact of every reading of a record, with its covariance and a verdict.
    Solve(solve::Solve),
    /// The object behind the contacts, or what is missing to name it.
    Identify(identify::Identify),
    /// Stiffness, zeros, gains, angles and offsets from sweeps.
    Calibrate(calibrate::Calibrate),
    /// What the hub would have felt: readings and truth of a whisker swept over an object.
    Simulate(simulate::Simulate),
    /// One line in, one line out, before the next arrives.
    Stream(stream::Stream),
    /// Contacts beside the truth: errors, whether the error bars hold, modes.
    Check(check::Check),
}

/// See `Whisker`.
pub fn run(args: &Whisker) -> Result<Outcome> {
    match &args.job {
        Job::Solve(args) => solve::run(args),
        Job::Identify(args) => identify::run(args),
        Job::Calibrate(args) => calibrate::run(args),
        Job::Simulate(args) => simulate::run(args),
        Job::Stream(args) => stream::run(args),
        Job::Check(args) => check::run(args),
    }
}
