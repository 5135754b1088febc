//! The command line as a whole: its commands, and what runs each.

use crate::commands::{
    advise, compare, completions, convert, demo, detect, explain, hand_eye, history, landmarks, locate,
    measure, pose_graph, rig, schema, solve, watch, whisker,
};
use crate::output::Outcome;
use anyhow::{Result, anyhow};
use clap::parser::ValueSource;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::path::PathBuf;

/// Where is the camera, and how uncertain is that?
///
/// Known intrinsics and a few known points in, the camera's pose with its error bar and an honest verdict out.
/// Start with `resight demo`.
#[derive(Debug, Parser)]
#[command(name = "resight", version, arg_required_else_help = true, max_term_width = 110)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// No progress and no remarks on stderr; errors are still reported.
    #[arg(long, short, global = true)]
    pub quiet: bool,
}

impl Arguments {
    /// From the command line, and for `watch SESSION.toml` from the session file.
    ///
    /// # Errors
    /// What is wrong with the session file. Ends the program where the command line asks for help or is wrong.
    pub fn read() -> anyhow::Result<Self> {
        let command = Arguments::command();
        let mut matches = command.clone().get_matches();
        let (mut printed, mut session) = (None, None);
        if let (Some(("watch", given)), Some(watch)) =
            (matches.subcommand(), command.find_subcommand("watch"))
        {
            let is_printed = given.get_flag("print_session");
            if let Some(path) = given.get_one::<PathBuf>("session") {
                let is_argument = given.value_source("source") == Some(ValueSource::CommandLine);
                session = (!is_argument).then(|| path.clone());
                let words = watch::session::words(path, watch, given)?;
                let own = ["resight", "watch"].map(String::from).into_iter();
                let own = own.chain(is_printed.then(|| "--print-session".to_string()));
                matches = command.clone().try_get_matches_from(own.chain(words)).map_err(|e| {
                    let text = e.to_string();
                    anyhow!("{}: {}", path.display(), text.trim_start_matches("error: ").trim_end())
                })?;
            }
            if let (true, Some((_, given))) = (is_printed, matches.subcommand()) {
                printed = Some(watch::session::text(watch, given));
            }
        }
        let mut arguments = Arguments::from_arg_matches(&matches)?;
        if let Command::Watch(watch) = &mut arguments.command {
            watch.printed = printed;
            watch.sources.session = session;
        }
        Ok(arguments)
    }
}

/// The commands, each in its own file.
#[derive(Debug, Subcommand)]
#[allow(clippy::large_enum_variant)] // One command a run.
pub enum Command {
    /// The whole path on shipped images with known truth: detection, poses, relative extrinsics, a report.
    Demo(demo::Demo),
    /// Finds the target in images and says where each was taken from.
    Locate(locate::Locate),
    /// Finds the target in images: points only.
    Detect(detect::Detect),
    /// The pose from points you already have, in a CSV file.
    Solve(solve::Solve),
    /// The extrinsics of several cameras relative to each other, from targets that they see together.
    Rig(rig::Rig),
    /// The poses of several cameras in one frame, from the relative poses of pairs of them.
    PoseGraph(pose_graph::PoseGraphArgs),
    /// Where a camera or rig is mounted on a robot or vehicle (hand–eye calibration).
    HandEye(hand_eye::HandEyeArgs),
    /// What moved between two rigs or poses, by how much, and how uncertain that is.
    Compare(compare::Compare),
    /// Writes camera files in another program's format, with the poses of other files merged in.
    Convert(convert::Convert),
    /// Lengths, positions, angles, areas and heights from photographs, each with its 95 % interval.
    Measure(measure::Measure),
    /// Says in sentences what a camera or target file means.
    Explain(explain::Explain),
    /// Where to put the next point, target or board for the smallest uncertainty.
    Advise(advise::Advise),
    /// Object profiles by touch: contacts, outlines, calibration and simulation of a whisker on a load cell.
    Whisker(whisker::Whisker),
    /// Watches cameras over time and raises an alarm when one moved.
    Watch(watch::Watch),
    /// How a camera rotated since a reference image, without any target.
    Landmarks(landmarks::Landmarks),
    /// What `watch --history` wrote: a summary, or a table as CSV or Parquet.
    History(history::History),
    /// Prints a script that completes commands and flags in bash, zsh, fish, elvish or PowerShell.
    Completions(completions::Completions),
    /// Writes manual pages.
    Man(completions::Man),
    /// Prints the JSON schema of every answer.
    Schema(schema::Schema),
}

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
        Command::Completions(args) => completions::completions(&args, Arguments::command()),
        Command::Man(args) => completions::man(&args, Arguments::command()),
        Command::Schema(args) => schema::run(&args),
    }
}
