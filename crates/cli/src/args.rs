//! Command line arguments; every flag that several commands share is defined here once.

use crate::commands::{
    advise, compare, completions, convert, demo, detect, explain, hand_eye, history, landmarks, locate,
    measure, pose_graph, rig, schema, solve, watch, whisker,
};
use anyhow::anyhow;
use clap::{Args, CommandFactory, FromArgMatches, Parser, Subcommand};
use resight::core::Target;
use resight::detect::{CornerWindow, DetectError, Detector};
use resight::formats::TagOptions;
use resight::locate::{METHODS, Method};
use std::path::PathBuf;

/// Where is the camera, and how sure is that?
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
        let mut printed = None;
        if let (Some(("watch", given)), Some(watch)) =
            (matches.subcommand(), command.find_subcommand("watch"))
        {
            let is_printed = given.get_flag("print_session");
            if let Some(path) = given.get_one::<PathBuf>("session") {
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
        }
        Ok(arguments)
    }
}

/// The commands, each in its own file.
#[derive(Debug, Subcommand)]
#[allow(clippy::large_enum_variant)] // One command a run.
pub enum Command {
    /// The whole path on shipped pictures with known truth: detection, poses, relative extrinsics, a report.
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
    /// What moved between two rigs or poses, by how much, and how sure that is.
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
    /// How a camera turned since a reference picture, without any target.
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

/// How answers leave the program.
#[derive(Debug, Clone, Args)]
pub struct OutputArgs {
    /// JSON Lines on stdout, one object per result and nothing else.
    #[arg(long)]
    pub json: bool,
    /// Also write the results to FILE, as JSON Lines; the file is replaced only when complete.
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

impl OutputArgs {
    /// Refuses a results file that could not be written, before any work is done.
    pub fn check(&self) -> anyhow::Result<()> {
        self.output.as_deref().map_or(Ok(()), crate::files::must_be_writable)
    }
}

/// How corners of squares are refined, for the commands that look into images.
#[derive(Debug, Clone, Args)]
pub struct CornerArgs {
    /// Refine the corners of a chessboard or ChArUco board in a window of this many pixels to each side, neighbours or not, as
    /// OpenCV's cornerSubPix with winSize N [default: as far as the neighbours leave room, which is more accurate]
    #[arg(long, value_name = "N")]
    corner_window_px: Option<u32>,
}

impl CornerArgs {
    /// The window asked for.
    pub fn window(&self) -> CornerWindow {
        self.corner_window_px.map_or(CornerWindow::Clear, CornerWindow::Half)
    }

    /// The detector for a target, with the window asked for.
    pub fn detector(&self, target: &Target) -> Result<Detector, DetectError> {
        Detector::with_corner_window(target, self.window())
    }
}

/// What the file of a map of tags does not state, for the commands that read one.
#[derive(Debug, Clone, Default, Args)]
pub struct TagArgs {
    /// Family of a tag map's tags [default: tag36h11]
    ///
    /// Where its file states none, as WPILib field layouts.
    #[arg(long, value_name = "FAMILY")]
    tag_family: Option<String>,
    /// Outer edge of the black square of a tag map's tags, metres [default for field layouts: 0.1651]
    ///
    /// Where its file states none.
    #[arg(long, value_name = "M", allow_negative_numbers = true, value_parser = positive)]
    tag_size_m: Option<f64>,
    /// Standard deviation of each tag's position, metres [default: 0; field layouts: 0.010]
    ///
    /// Along each axis, where a tag map's file states none; 0 for a map that is exact. Field layouts have 0.8° of rotation besides.
    #[arg(long, value_name = "M", allow_negative_numbers = true, value_parser = not_negative)]
    tag_sigma_m: Option<f64>,
}

impl TagArgs {
    /// As the library takes them.
    pub fn options(&self) -> TagOptions {
        TagOptions { family: self.tag_family.clone(), size_m: self.tag_size_m, sigma_m: self.tag_sigma_m }
    }
}

/// A number from 0 on.
pub fn not_negative(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if 0.0 <= x && x.is_finite() => Ok(x),
        _ => Err("a number that is zero or positive is needed".to_string()),
    }
}

/// A number above 0.
pub fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if 0.0 < x && x.is_finite() => Ok(x),
        _ => Err("a positive number is needed".to_string()),
    }
}

/// Seconds: no clock counts for ever, and whoever means "never" means a year.
pub fn seconds(text: &str) -> Result<f64, String> {
    /// Thirty years.
    const MOST_S: f64 = 1e9;
    match positive(text) {
        Ok(s) if s <= MOST_S => Ok(s),
        _ => Err(format!("a positive number of seconds is needed, at most {MOST_S}")),
    }
}

/// Name of a solver: `auto` decides from the configuration of the points.
pub fn parse_method(name: &str) -> Result<Method, String> {
    match METHODS.iter().find(|(known, _)| *known == name) {
        Some((_, method)) => Ok(*method),
        None => {
            let nearest = resight::input::nearest(name, METHODS.iter().map(|(known, _)| known.to_string()));
            let hint = nearest.map(|n| format!("did you mean `{n}`? ")).unwrap_or_default();
            Err(format!("no such method; {hint}There are {}", names()))
        }
    }
}

fn names() -> String {
    METHODS.map(|(name, _)| name).join(", ")
}
