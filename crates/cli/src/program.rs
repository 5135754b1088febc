//! The command line as a whole: its commands, and what runs each.

use crate::commands::{
    advise, batch, capture, compare, completions, convert, demo, detect, explain, fleet_report, georeference,
    hand_eye, history, intrinsics, landmarks, locate, map, measure, pose_graph, print, rig, rig_pose, schema,
    serve, solve, vehicle, watch, whisker, zones,
};
use crate::meant;
use crate::output::Outcome;
use anyhow::{Result, anyhow};
use clap::parser::ValueSource;
use clap::{ArgAction, CommandFactory, FromArgMatches, Parser, Subcommand};
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Where a build knows it, with the commit and its date.
const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), env!("RESIGHT_BUILT_FROM"));

/// Resight finds where cameras are, with the uncertainty of every answer.
///
/// It takes known intrinsics and a few known points, and gives the camera's pose with its covariance and a status. Start with
/// `resight demo`. `resight COMMAND -h` shows a command on one screen, `resight COMMAND --help` explains every flag.
#[derive(Debug, Parser)]
#[command(name = "resight", version = VERSION, arg_required_else_help = true, max_term_width = 110)]
#[command(disable_help_subcommand = true)] // `resight COMMAND --help` is one way; the list fits one screen.
#[command(disable_version_flag = true)] // It is below, in the long help only, for the same reason.
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
    /// No progress and no remarks on stderr; errors are still reported.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Prints the version, and for an optimised build its commit and date.
    #[arg(long, short = 'V', action = ArgAction::Version, hide_short_help = true)]
    pub version: Option<bool>,
}

impl Arguments {
    /// From the command line, and for `watch SESSION.toml` from the session file.
    ///
    /// # Errors
    /// What is wrong with the session file or the command line, or the help that it asks for.
    pub fn read(words: &[OsString]) -> anyhow::Result<Self> {
        let command = Arguments::command();
        let words = meant::flags(words);
        let mut matches = command.clone().try_get_matches_from(words).map_err(meant::with_advice)?;
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
            watch.outputs.come_from(session.as_deref());
            watch.sources.session = session;
        }
        Ok(arguments)
    }
}

/// The commands, each in its own file.
#[derive(Debug, Subcommand)]
#[allow(clippy::large_enum_variant)] // One command a run.
pub enum Command {
    /// Shows the main job on images that come with the program, without any arguments.
    Demo(demo::Demo),
    /// Finds the target in images and prints the pose of the camera for each.
    Locate(locate::Locate),
    /// Finds the target in images and prints the points only.
    Detect(detect::Detect),
    /// Computes the camera's pose from known points and their pixels in a CSV file.
    Solve(solve::Solve),
    /// Estimates a camera's intrinsics with their covariance from images of a target, or checks existing ones.
    Intrinsics(intrinsics::Intrinsics),
    /// Estimates a camera's intrinsics live, while its target is moved in front of it.
    Capture(capture::CaptureArgs),
    /// Computes the extrinsics of several cameras from targets that they see together.
    Rig(rig::Rig),
    /// Computes where a known rig is, from points seen by any of its cameras.
    RigPose(rig_pose::RigPose),
    /// Makes a map of tags: the pose of every tag of a place, from one camera carried through it.
    Map(map::Map),
    /// Computes the extrinsics of several cameras from the relative poses of pairs of them.
    PoseGraph(pose_graph::PoseGraphArgs),
    /// Computes how a camera or rig is mounted on a robot or vehicle (hand–eye calibration).
    HandEye(hand_eye::HandEyeArgs),
    /// Computes the rotation of a camera against its vehicle, from a video of driving.
    Vehicle(vehicle::Vehicle),
    /// Tests what moved between two rigs or poses, by how much, and with which uncertainty.
    Compare(compare::Compare),
    /// Writes camera files in another program's format, with the poses of other files merged in.
    Convert(convert::Convert),
    /// Measures lengths, positions, angles, areas and heights in photographs, with 95 % intervals.
    Measure(measure::Measure),
    /// Gives pixels of a map image (GeoTIFF, world file) their coordinates.
    Georeference(georeference::Georeference),
    /// Prints targets at exact scale as PDF or SVG, and takes the printer's error, measured, into the target file.
    Print(print::Print),
    /// Explains in sentences what a camera or target file means.
    Explain(explain::Explain),
    /// Advises where to put the next point or target for the smallest uncertainty.
    Advise(advise::Advise),
    /// Finds where an elastic whisker on a load cell touches, and what it touches.
    Whisker(whisker::Whisker),
    /// Watches cameras over time and raises an alarm when one has moved.
    Watch(watch::Watch),
    /// Serves photographs, points and watched cameras over HTTP and WebSocket on this machine.
    Serve(serve::Serve),
    /// Moves zones of a reference image with a camera that has rotated.
    Zones(zones::Zones),
    /// Measures how a camera has rotated since a reference image, without any target.
    Landmarks(landmarks::Landmarks),
    /// Computes the poses of millions of views, of a fleet of cameras, in bounded memory and on all cores.
    Batch(batch::Batch),
    /// Says which cameras of a fleet moved, which are dead, and whose map or clock is wrong.
    FleetReport(fleet_report::FleetReport),
    /// Summarises the file that `watch --history` wrote, or exports it as CSV or Parquet.
    History(history::History),
    /// Prints a script that completes commands and flags in bash, zsh, fish, elvish or PowerShell.
    #[command(hide = true)] // docs/reference names it; the list fits one screen.
    Completions(completions::Completions),
    /// Writes manual pages.
    #[command(hide = true)] // docs/reference names it; the list fits one screen.
    Man(completions::Man),
    /// Prints the JSON schema of every answer.
    #[command(hide = true)] // docs/reference names it; the list fits one screen.
    Schema(schema::Schema),
}

/// Runs a command. An error here is wrong usage or an unreadable argument.
pub fn run(command: Command) -> Result<Outcome> {
    match command {
        Command::Demo(args) => demo::run(&args),
        Command::Locate(args) => locate::run(&args),
        Command::Detect(args) => detect::run(&args),
        Command::Solve(args) => solve::run(&args),
        Command::Intrinsics(args) => intrinsics::run(&args),
        Command::Capture(args) => capture::run(&args),
        Command::Rig(args) => rig::run(&args),
        Command::RigPose(args) => rig_pose::run(&args),
        Command::Map(args) => map::run(&args),
        Command::PoseGraph(args) => pose_graph::run(&args),
        Command::HandEye(args) => hand_eye::run(&args),
        Command::Vehicle(args) => vehicle::run(&args),
        Command::Compare(args) => compare::run(&args),
        Command::Convert(args) => convert::run(&args),
        Command::Measure(args) => measure::run(&args),
        Command::Georeference(args) => georeference::run(&args),
        Command::Print(args) => print::run(&args),
        Command::Explain(args) => explain::run(&args),
        Command::Advise(args) => advise::run(&args),
        Command::Whisker(args) => whisker::run(&args),
        Command::Watch(args) => watch::run(&args),
        Command::Serve(args) => serve::run(&args, session_of),
        Command::Zones(args) => zones::run(&args),
        Command::Landmarks(args) => landmarks::run(&args),
        Command::Batch(args) => batch::run(&args),
        Command::FleetReport(args) => fleet_report::run(&args),
        Command::History(args) => history::run(&args),
        Command::Completions(args) => completions::completions(&args, Arguments::command()),
        Command::Man(args) => completions::man(&args, Arguments::command()),
        Command::Schema(args) => schema::run(&args),
    }
}

/// The session of a file.
fn session_of(path: &Path) -> Result<resight_watch::Request> {
    let words = [OsString::from("resight"), OsString::from("watch"), path.as_os_str().to_owned()];
    match Arguments::read(&words)?.command {
        Command::Watch(args) => watch::request_of(&args),
        _ => Err(anyhow!("this is no session")),
    }
}
