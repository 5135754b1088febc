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
pub mod schema;

use crate::args::{Command, TagArgs};
use crate::output::Outcome;
use anyhow::Result;
use resight::core::{Camera, Target};
use resight::formats;
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
        Command::Schema(args) => schema::run(&args),
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
