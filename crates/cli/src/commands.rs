//! One file per command; what several share is here.

pub mod advise;
pub mod compare;
pub mod convert;
pub mod demo;
pub mod detect;
pub mod explain;
pub mod history;
pub mod locate;
pub mod rig;
pub mod pose_graph;
pub mod hand_eye;
pub mod landmarks;
pub mod measure;
pub mod solve;
pub mod whisker;
pub mod watch;
pub mod completions;

use crate::args::{Command, TagArgs};
use crate::output::Outcome;
use anyhow::Result;
use rayon::prelude::*;
use resight::core::{Camera, Target};
use resight::formats;
use std::fmt::Display;
use std::path::Path;

/// Runs a command. An error here is wrong usage or an unreadable argument.
pub fn run(command: Command) -> Result<Outcome> {
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Locate(args) => locate::run(&args),
        Command::Detect(args) => detect::run(&args),
        Command::Solve(args) => solve::run(&args),
        Command::Rig(args) => rig::run(&args),
        Command::PoseGraph(args) => pose_graph::run(&args),
        Command::HandEye(args) => hand_eye::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Measure(args) => measure::run(&args),
        Command::Explain(args) => explain::run(&args),
        Command::Advise(args) => advise::run(&args),
        Command::Whisker(args) => whisker::run(&args),
        Command::Watch(args) => watch::run(&args),
        Command::Landmarks(args) => landmarks::run(&args),
        Command::History(args) => history::run(&args),
        Command::Completions(args) => completions::completions(&args),
        Command::Man(args) => completions::man(&args),
    }
}

/// Reads `FILE` or `FILE#NAME`.
fn camera(argument: &str) -> Result<Camera> {
    crate::files::camera_must_exist(argument)?;
    Ok(formats::read_camera(argument)?.camera)
}

/// Reads a target, passes its warnings on and returns them.
fn target(path: &Path, tags: &TagArgs, mut remark: impl FnMut(&str)) -> Result<(Target, Vec<String>)> {
    crate::files::must_exist(path)?;
    let file = formats::read_target_with(path, &tags.options())?;
    for warning in &file.warnings {
        remark(&format!("warning: {}: {warning}", path.display()));
    }
    Ok((file.target, file.warnings))
}

/// Applies `work` to every input on all cores and hands the results on in input order, a block at a time: memory stays
/// bounded and the first answers appear while later inputs wait.
fn in_order<T: Sync, R: Send>(
    inputs: &[T],
    work: impl Fn(&T) -> R + Sync,
    done: impl FnMut(R) -> Result<()>,
) -> Result<()> {
    in_blocks(inputs, 1024, |block| Ok(block.par_iter().map(&work).collect()), done)
}

/// As `in_order`, each thread with a detector (or several) of its own: the C library keeps state in it.
fn detect_in_order<T: Sync, D, R: Send, E: Display + Into<anyhow::Error>>(
    inputs: &[T],
    detector: impl Fn() -> Result<D, E> + Sync,
    work: impl Fn(&mut D, &T) -> R + Sync,
    done: impl FnMut(R) -> Result<()>,
) -> Result<()> {
    detector().map_err(Into::into)?; // Says now what is wrong with the target, once.
    let look = |detector: &mut Result<D, E>, input: &T| match detector {
        Ok(detector) => Ok(work(detector, input)),
        Err(reason) => Err(anyhow::anyhow!("{reason}")),
    };
    in_blocks(
        inputs,
        4 * rayon::current_num_threads(),
        |block| block.par_iter().map_init(&detector, look).collect(),
        done,
    )
}

fn in_blocks<T, R>(
    inputs: &[T],
    size: usize,
    answers: impl Fn(&[T]) -> Result<Vec<R>>,
    mut done: impl FnMut(R) -> Result<()>,
) -> Result<()> {
    inputs.chunks(size).try_for_each(|block| answers(block)?.into_iter().try_for_each(&mut done))
}
