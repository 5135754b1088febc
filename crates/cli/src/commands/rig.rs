//! `rig`: where several cameras sit relative to each other, from targets that they see together.

pub(super) mod named;
mod words;

use crate::args::{CornerArgs, ToleranceArgs, positive};
use crate::output::{Outcome, error, print_answer, remark, with_progress};
use anyhow::{Result, bail};
use clap::Args;
use resight::answer::{RigAnswer, SolvedRig, Unsolved};
use resight::formats::write_atomically;
use resight::input::not_among;
use resight::report::rig_page;
use resight::rig::{
    CameraDistance, CameraImage, Detections, FrameTimes, ImageOptions, ObservedRig, RigRequest,
};
use resight::scene::rig_scene;
use std::path::PathBuf;

/// Computes the extrinsics of several cameras from targets that they see together.
///
/// Intrinsics stay as they are given. Move one or more targets so that cameras see them together; two cameras at a time are enough, and
/// nothing needs to be surveyed. The answer is every camera's pose in the rig (the reference camera's frame) with its covariance.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  resight rig --camera left=left.yaml --camera right=right.yaml --target board.toml \\
      --images left='left*.jpg' --images right='right*.jpg' -o rig.toml")]
#[command(after_long_help = "Examples:
  resight rig --camera left=left.yaml --camera right=right.yaml --target board.toml \\
      --images left='left*.jpg' --images right='right*.jpg' -o rig.toml
  resight rig --camera cameras.toml --target board.toml --images cam0=cam0.mp4 --images cam1=cam1.mp4 \\
      --timestamps times.csv --sync-tolerance-s 0.02 -o rig.toml --report rig.html --scene rig.mcap
  resight rig --camera rig.toml --detections corners.csv --sigma-px 0.2 --json
  resight rig --camera rig.toml --detections corners.csv --tolerance-mm 2 --tolerance-deg 0.1

A rig from relative poses of pairs of cameras: resight pose-graph. A camera or rig on a robot or vehicle: resight hand-eye.")]
pub struct Rig {
    #[command(flatten)]
    observed: ObservationArgs,
    /// The target that stands still beside the cameras and whose frame is the world.
    ///
    /// Surveyed points or a tag map. The answer then has world_from_rig and world_from_cam.
    #[arg(long, hide_short_help = true, help_heading = "Solving", value_name = "TARGET")]
    world: Option<String>,
    #[command(flatten)]
    solving: SolvingArgs,
    /// Adjusts the lenses together with the rig.
    ///
    /// The covariance of a camera file (as `intrinsics` writes it) is what is known of its lens; a file without one gives initial values and the
    /// lens model, and the lens of a camera without a file is estimated from its own images first. The answer states how far each lens moved, and -o writes lenses and poses with their covariances.
    #[arg(long, hide_short_help = true, help_heading = "Solving")]
    adjust_lenses: bool,
    /// Estimates the time from one row of a rolling shutter to the next.
    ///
    /// All cameras share it. It needs time stamps and a target that moves, as the time offsets of the cameras do, which are estimated anyway.
    #[arg(long, hide_short_help = true, help_heading = "Solving")]
    rolling_shutter: bool,
    /// Adds the joint covariance of all cameras to the JSON.
    ///
    /// `compare` uses it. The file of -o always holds it.
    #[arg(long, hide_short_help = true, help_heading = "Output")]
    joint_covariance: bool,
    #[command(flatten)]
    output: AnswerArgs,
    /// Writes a self-contained page (HTML) to FILE.
    ///
    /// It shows the rig in space, residuals, views, pairs and hashes of the input.
    #[arg(long, help_heading = "Output", value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Writes cameras, targets and frames to FILE (MCAP) for Foxglove and Rerun.
    #[arg(long, hide_short_help = true, help_heading = "Output", value_name = "FILE.mcap")]
    scene: Option<PathBuf>,
}

/// What was observed, and by which cameras.
#[derive(Debug, Args)]
pub struct ObservationArgs {
    /// Camera file in any supported format.
    ///
    /// NAME is the name that the camera gets; without NAME= every camera of the file has its own. FILE#NAME picks one of several.
    #[arg(long = "camera", value_name = "[NAME=]FILE", num_args = 1..)]
    cameras: Vec<String>,
    /// Target file.
    ///
    /// Several targets move independently of each other. The name is the file's unless given.
    #[arg(long = "target", value_name = "[NAME=]FILE", num_args = 1..)]
    targets: Vec<String>,
    /// Images of a camera, a path or a pattern such as 'left*.png', or its video file.
    ///
    /// Images of one name are one view; where the names differ between cameras, as left01 and right01, the part that the pattern's * stands
    /// for names the view.
    #[arg(long, value_name = "NAME=GLOB", conflicts_with = "detections", num_args = 1..)]
    images: Vec<String>,
    /// Points that were detected already (CSV), instead of images.
    ///
    /// The columns are camera,view,id,x_m,y_m,z_m,u_px,v_px and optionally target, body, corner, sigma_px, sigma_m, t_s; x_m,y_m,z_m may be
    /// missing where --target knows the id.
    #[arg(long, value_name = "FILE.csv", num_args = 1..)]
    detections: Vec<PathBuf>,
    /// Times of the frames (CSV).
    ///
    /// The columns are camera,frame,t_s: frame is the image's name without its ending, or the number of the video's frame counted from 0.
    #[arg(
        long,
        hide_short_help = true,
        help_heading = "Synchronisation",
        value_name = "FILE.csv",
        requires = "images"
    )]
    timestamps: Option<PathBuf>,
    /// Frames within this time of each other are one synchronised frame set.
    ///
    /// Their names do not count then; time stamps are needed.
    #[arg(long, hide_short_help = true, help_heading = "Synchronisation", value_name = "SECONDS", allow_negative_numbers = true, value_parser = positive)]
    sync_tolerance_s: Option<f64>,
    /// Targets on one rigid body, whose poses relative to each other are unknown but constant.
    #[arg(long, hide_short_help = true, help_heading = "Solving", value_name = "TARGET,TARGET…")]
    fixed_together: Vec<String>,
    /// Standard deviation of u_px and v_px where the detections have no sigma_px [default: 0.5].
    #[arg(long, hide_short_help = true, help_heading = "Solving", value_name = "S", requires = "detections", allow_negative_numbers = true, value_parser = positive)]
    sigma_px: Option<f64>,
    #[command(flatten)]
    corners: CornerArgs,
}

impl ObservationArgs {
    /// Returns whether neither cameras nor observations are given.
    pub(super) fn is_empty(&self) -> bool {
        self.cameras.is_empty() && self.images.is_empty() && self.detections.is_empty()
    }
}

/// How it is solved.
#[derive(Debug, Args)]
pub struct SolvingArgs {
    /// The camera whose frame is the rig's [default: the first by name].
    #[arg(long, hide_short_help = true, help_heading = "Solving", value_name = "NAME")]
    reference: Option<String>,
    /// A measured distance between the centres of two cameras and its standard deviation, in metres.
    ///
    /// It joins the adjustment, and with it the target's size can be checked.
    #[arg(long, hide_short_help = true, help_heading = "Solving", value_name = "A,B,METRES,SIGMA")]
    known_distance_m: Vec<String>,
    #[command(flatten, next_help_heading = "Solving")]
    pub(super) tolerance: ToleranceArgs,
}

/// How an answer about cameras leaves the program.
#[derive(Debug, Args)]
pub struct AnswerArgs {
    /// Prints one JSON object on stdout and nothing else.
    #[arg(long, help_heading = "Output")]
    pub json: bool,
    /// Writes the answer to FILE, which other commands read.
    ///
    /// It holds the cameras with their poses and covariances (TOML), that of hand-eye its JSON.
    #[arg(long, short, help_heading = "Output", value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// See `Rig`.
pub fn run(args: &Rig) -> Result<Outcome> {
    for path in [&args.output.output, &args.report, &args.scene].into_iter().flatten() {
        crate::files::must_be_writable(path)?;
    }
    let request = RigRequest {
        world: args.world.clone(),
        joint_covariance: args.joint_covariance,
        adjust_lenses: args.adjust_lenses,
        rolling_shutter: args.rolling_shutter,
        ..request(&args.observed, &args.solving)?
    };
    let observed = observed(&args.observed, &request)?;
    remark(words::shared_views(&observed.gathered).trim_end());
    match with_progress(|| observed.solve()) {
        RigAnswer::Solved(solved) => answer(args, &solved),
        RigAnswer::Unsolved(reason) => unanswered(&args.output, "RIG", &reason),
    }
}

/// What is asked, besides the observations.
pub(super) fn request(args: &ObservationArgs, solving: &SolvingArgs) -> Result<RigRequest> {
    let names = |list: &String| {
        let names = list.split(',').map(str::trim).filter(|name| !name.is_empty());
        names.map(str::to_string).collect()
    };
    let distances = solving.known_distance_m.iter().map(|argument| known_distance(argument));
    Ok(RigRequest {
        fixed_together: args.fixed_together.iter().map(names).collect(),
        reference: solving.reference.clone(),
        known_distances: distances.collect::<Result<_>>()?,
        sync_tolerance_s: args.sync_tolerance_s,
        tolerance: solving.tolerance.tolerance(),
        command: Some(command_line()),
        ..named::request(&args.cameras, &args.targets)?
    })
}

/// `A,B,METRES,SIGMA`.
fn known_distance(argument: &str) -> Result<CameraDistance> {
    let flag = "--known-distance-m";
    let parts: Vec<&str> = argument.split(',').map(str::trim).collect();
    let [a, b, distance, sigma] = parts[..] else {
        bail!(
            "{flag} {argument}: two cameras, the distance and its standard deviation in metres are needed, e.g. left,right,0.1205,0.0002"
        )
    };
    let length = |text: &str| positive(text).map_err(|e| anyhow::anyhow!("{flag} {argument}: `{text}`: {e}"));
    let (distance_m, sigma_m) = (length(distance)?, length(sigma)?);
    Ok(CameraDistance { a: a.to_string(), b: b.to_string(), distance_m, sigma_m })
}

/// Reads detections, or finds the targets in images, and says what is unusual about them.
pub(super) fn observed(args: &ObservationArgs, request: &RigRequest) -> Result<ObservedRig> {
    if request.cameras.is_empty() && (!request.adjust_lenses || args.images.is_empty()) {
        bail!(
            "--camera [NAME=]FILE is missing: the cameras' intrinsics are needed; with --images, `rig --adjust-lenses` finds them too"
        );
    }
    let observed = if !args.detections.is_empty() {
        args.detections.iter().try_for_each(|path| crate::files::must_exist(path))?;
        let detections = Detections { sigma_px: args.sigma_px, ..Detections::files(&args.detections) };
        ObservedRig::from_detections(&detections, request)?
    } else if !args.images.is_empty() {
        if request.targets.is_empty() {
            bail!("--images needs --target FILE: what is to be found in them");
        }
        let mut names: Vec<String> = request.cameras.iter().map(|camera| camera.name.clone()).collect();
        if request.adjust_lenses {
            let named = args.images.iter().filter_map(|argument| named::split(argument).0);
            names.extend(named.map(str::to_string));
        }
        let options = ImageOptions {
            times: times(args, &names)?,
            corner_window: args.corners.window(),
            kept: crate::files::kept_detections(),
        };
        let images = images(&args.images, &names)?;
        with_progress(|| ObservedRig::from_images(&images, &options, request))?
    } else {
        bail!("nothing to look at: give --images NAME=GLOB for each camera, or --detections FILE.csv");
    };
    observed.remarks.iter().for_each(|text| remark(text));
    Ok(observed)
}

fn times(args: &ObservationArgs, cameras: &[String]) -> Result<Option<FrameTimes>> {
    let Some(path) = &args.timestamps else { return Ok(None) };
    crate::files::must_exist(path)?;
    Ok(Some(FrameTimes::read(path, cameras)?))
}

/// The files of each `NAME=GLOB`; the name of an only camera may be left out.
fn images(arguments: &[String], cameras: &[String]) -> Result<Vec<CameraImage>> {
    let mut images = Vec::new();
    for argument in arguments {
        let (name, pattern) = match (named::split(argument), cameras) {
            ((Some(name), pattern), _) => (name, pattern),
            ((None, pattern), [only]) => (only.as_str(), pattern),
            _ => bail!(
                "--images {argument}: say which camera took them, e.g. --images {}={argument}",
                cameras.first().map_or("left", String::as_str)
            ),
        };
        if !cameras.iter().any(|known| known == name) {
            bail!("--images {argument}: {}", not_among(name, "camera", cameras));
        }
        let files = crate::files::expand(&[pattern.to_string()])?;
        images.extend(files.into_iter().map(|path| CameraImage::matched(name, path, pattern)));
    }
    Ok(images)
}

/// Prints and writes what was found.
fn answer(args: &Rig, solved: &SolvedRig) -> Result<Outcome> {
    if let Some(path) = &args.output.output {
        write_atomically(path, solved.file()?.as_bytes())?;
    }
    if let Some(path) = &args.report {
        write_atomically(path, rig_page(&solved.run).as_bytes())?;
    }
    if let Some(path) = &args.scene {
        write_atomically(path, &rig_scene(&solved.run)?)?;
    }
    print_answer(args.output.json, solved, &words::describe(solved), solved.status())?;
    Ok(Outcome::of([solved.status()]))
}

/// Says why there is no rig, or no other answer of this name; nothing is written.
pub(super) fn unanswered(args: &AnswerArgs, answer: &str, reason: &Unsolved) -> Result<Outcome> {
    print_answer(args.json, reason, &format!("NO {answer}   {}\n", reason.message), reason.status)?;
    if args.json {
        error(&format!("error: {}", reason.message));
    }
    Ok(Outcome::of([reason.status]))
}

/// The command line as a shell would take it again.
fn command_line() -> String {
    let quoted = |argument: String| {
        let is_plain = |c: char| c.is_alphanumeric() || "-_./=:,#+@%".contains(c);
        match !argument.is_empty() && argument.chars().all(is_plain) {
            true => argument,
            false => format!("'{}'", argument.replace('\'', "'\\''")),
        }
    };
    let arguments = crate::stdio::arguments()
        .iter()
        .skip(1)
        .map(|argument| quoted(argument.to_string_lossy().into_owned()));
    std::iter::once("resight".to_string()).chain(arguments).collect::<Vec<_>>().join(" ")
}
