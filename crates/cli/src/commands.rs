//! One file per command; what several share is here.

pub mod demo;
pub mod detect;
pub mod explain;
pub mod locate;
pub mod solve;

use crate::args::Command;
use crate::output::Outcome;
use anyhow::Result;
use rayon::prelude::*;
use resight::core::{Camera, Target};
use resight::detect::Detector;
use resight::formats;
use std::path::Path;

/// Runs a command. An error here is wrong usage or an unreadable argument.
pub fn run(command: Command) -> Result<Outcome> {
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Locate(args) => locate::run(&args),
        Command::Detect(args) => detect::run(&args),
        Command::Solve(args) => solve::run(&args),
        Command::Explain(args) => explain::run(&args),
    }
}

/// Reads `FILE` or `FILE#NAME`.
fn camera(argument: &str) -> Result<Camera> {
    crate::files::camera_must_exist(argument)?;
    Ok(formats::read_camera(argument)?.camera)
}

/// Reads a target and passes its warnings on.
fn target(path: &Path, mut remark: impl FnMut(&str)) -> Result<Target> {
    crate::files::must_exist(path)?;
    let file = formats::read_target(path)?;
    for warning in &file.warnings {
        remark(&format!("warning: {}: {warning}", path.display()));
    }
    Ok(file.target)
}

/// Applies `work` to every input on all cores and hands the results on in input order, while later ones are still under way.
fn in_order<T: Sync, R: Send>(
    inputs: &[T],
    work: impl Fn(&T) -> R + Sync,
    mut done: impl FnMut(R) -> Result<()>,
) -> Result<()> {
    let block = 4 * rayon::current_num_threads();
    for inputs in inputs.chunks(block) {
        let results: Vec<R> = inputs.par_iter().map(&work).collect();
        results.into_iter().try_for_each(&mut done)?;
    }
    Ok(())
}

/// As `in_order`, each thread with a detector of its own: the C library keeps state in it.
fn detect_in_order<T: Sync, R: Send>(
    inputs: &[T],
    target: &Target,
    work: impl Fn(&mut Detector, &T) -> R + Sync,
    mut done: impl FnMut(R) -> Result<()>,
) -> Result<()> {
    Detector::new(target)?; // Says now what is wrong with the target, once.
    let block = 4 * rayon::current_num_threads();
    for inputs in inputs.chunks(block) {
        let results: Result<Vec<R>> = inputs
            .par_iter()
            .map_init(
                || Detector::new(target),
                |detector, input| match detector {
                    Ok(detector) => Ok(work(detector, input)),
                    Err(reason) => Err(anyhow::anyhow!("{reason}")),
                },
            )
            .collect();
        results?.into_iter().try_for_each(&mut done)?;
    }
    Ok(())
}
