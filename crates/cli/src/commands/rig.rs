//! `rig`: where several cameras sit relative to each other, from targets that they see together.

mod detections;
mod moments;
pub(super) mod named;
pub(super) mod object;
mod pictures;
pub(super) mod placed;
pub(super) mod solving;
mod words;

use crate::args::{CornerArgs, positive};
use crate::output::{Outcome, print};
use anyhow::{Result, bail};
use clap::Args;
use moments::Moments;
use resight::core::rig::KnownDistance;
use resight::core::{Correspondence, Pose};
use resight::formats::{own_rig_file, status_keys, write_atomically};
use resight::report::rig::rig_verdict_sentence;
use resight::report::rig_page;
use resight::rig::gather::{Gathered, Glimpse, gather};
use resight::rig::{InputFile, NamedTarget, digest};
use resight::scene::rig_scene;
use solving::Solved;
use std::path::{Path, PathBuf};

/// Where several cameras sit relative to each other, from targets that they see through time.
///
/// Intrinsics stay as they are given. Needed: one or more targets, moved about so that cameras see them together, two at a time
/// is enough; nothing surveyed. Prints every camera's place in the rig (the reference camera's frame) with its covariance.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight rig --camera left=left.yaml --camera right=right.yaml --target board.toml \\
      --images left='left*.jpg' --images right='right*.jpg' -o rig.toml
  resight rig --camera cameras.toml --target board.toml --images cam0=cam0.mp4 --images cam1=cam1.mp4 \\
      --timestamps times.csv --sync-tolerance-ms 20 -o rig.toml --report rig.html --scene rig.mcap
  resight rig --camera rig.toml --detections corners.csv --sigma-px 0.2 --json

A rig from relative poses of pairs of cameras: resight pose-graph. A camera or rig on a robot or vehicle: resight hand-eye.")]
pub struct Rig {
    #[command(flatten)]
    observed: ObservationArgs,
    /// The target (surveyed points, a tag map) that stands still beside the cameras and whose frame is the world: the answer then
    /// has world_from_rig and world_from_cam.
    #[arg(long, value_name = "TARGET")]
    world: Option<String>,
    #[command(flatten)]
    solving: SolvingArgs,
    /// Adds the covariance of all cameras together to the JSON, as `compare` uses it (the file of -o always holds it).
    #[arg(long)]
    joint_covariance: bool,
    #[command(flatten)]
    output: AnswerArgs,
    /// Writes one self-contained page to FILE (HTML): the rig to rotate, residuals, views, pairs, input hashes.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Writes cameras, targets and frames to FILE (MCAP) for Foxglove and Rerun.
    #[arg(long, value_name = "FILE.mcap")]
    scene: Option<PathBuf>,
}

/// What was observed, and by which cameras.
#[derive(Debug, Args)]
pub struct ObservationArgs {
    /// Camera file in any supported format, under the name it is to have; without NAME= every camera of the file under its own
    /// name. FILE#NAME picks one of several.
    #[arg(long = "camera", value_name = "[NAME=]FILE", num_args = 1..)]
    cameras: Vec<String>,
    /// Target file; several targets move independently of each other. The name is the file's unless given.
    #[arg(long = "target", value_name = "[NAME=]FILE", num_args = 1..)]
    targets: Vec<String>,
    /// Images of a camera (a path or a pattern such as 'left*.png'), or its video file. Images of one name are one view; where
    /// the cameras' names differ, as left01 and right01, what the pattern's * stands for names the view.
    #[arg(long, value_name = "NAME=GLOB", conflicts_with = "detections", num_args = 1..)]
    images: Vec<String>,
    /// Points found already, instead of images. Columns camera,view,id,x_m,y_m,z_m,u_px,v_px and optionally target, body, corner,
    /// sigma_px, sigma_m, t_s; x_m,y_m,z_m may be missing where --target knows the id.
    #[arg(long, value_name = "FILE.csv", num_args = 1..)]
    detections: Vec<PathBuf>,
    /// When each frame was taken. Columns camera,frame,t_s: frame is the image's name without its ending, or the number of the
    /// video's frame counted from 0.
    #[arg(long, value_name = "FILE.csv", requires = "images")]
    timestamps: Option<PathBuf>,
    /// Frames within MS milliseconds of each other are one view, whatever their names; needs time stamps.
    #[arg(long, value_name = "MS", allow_negative_numbers = true, value_parser = positive)]
    sync_tolerance_ms: Option<f64>,
    /// Targets mounted on one body, whose places relative to each other are not known but stay.
    #[arg(long, value_name = "TARGET,TARGET…")]
    fixed_together: Vec<String>,
    /// Standard deviation of u_px and v_px where the detections have no sigma_px [default: 0.5]
    #[arg(long, value_name = "S", requires = "detections", allow_negative_numbers = true, value_parser = positive)]
    sigma_px: Option<f64>,
    #[command(flatten)]
    corners: CornerArgs,
}

/// How it is solved.
#[derive(Debug, Args)]
pub struct SolvingArgs {
    /// The camera whose frame is the rig's [default: the first by name]
    #[arg(long, value_name = "NAME")]
    reference: Option<String>,
    /// A distance between the centres of two cameras, measured otherwise, and its standard deviation, metres: it joins the
    /// adjustment, and with it the target's size can be checked.
    #[arg(long, value_name = "A,B,METRES,SIGMA")]
    known_distance_m: Vec<String>,
}

/// How an answer about cameras leaves the program.
#[derive(Debug, Args)]
pub struct AnswerArgs {
    /// One JSON object on stdout and nothing else.
    #[arg(long)]
    pub json: bool,
    /// No tables and no remarks on stderr; errors are still reported.
    #[arg(long, short)]
    pub quiet: bool,
    /// Writes the answer to FILE, which other commands read: the cameras with their poses and covariances (TOML), of hand-eye its JSON.
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
}

/// What one frame shows.
pub(super) struct Frame {
    /// Index into the cameras given.
    camera: usize,
    /// Its view, or the number of the frame.
    name: String,
    /// When it was taken.
    t_s: Option<f64>,
    /// Targets (index into those given) and their points.
    targets: Vec<(usize, Vec<(String, Correspondence)>)>,
}

/// Something that took no part, and why.
pub(super) struct LeftOut {
    camera: String,
    view: String,
    /// A target, a point of it, or the frame.
    what: String,
    reason: String,
}

/// All that was seen.
#[derive(Default)]
pub(super) struct Collected {
    cameras: Vec<resight::formats::NamedCamera>,
    targets: Vec<NamedTarget>,
    frames: Vec<Frame>,
    left_out: Vec<LeftOut>,
    files: Vec<PathBuf>,
    remarks: Vec<String>,
}

/// What was observed, checked and gathered by camera, view and target.
pub struct Observed {
    gathered: Gathered,
    reference: usize,
    distances: Vec<KnownDistance>,
    inputs: Vec<InputFile>,
    left_out: Vec<LeftOut>,
    n_alone: usize,
}

/// See `Rig`.
pub fn run(args: &Rig) -> Result<Outcome> {
    for path in [&args.output.output, &args.report, &args.scene].into_iter().flatten() {
        crate::files::must_be_writable(path)?;
    }
    let observed = observed(&args.observed, args.world.as_deref(), &args.solving, &args.output)?;
    if !args.output.quiet {
        eprintln!("{}", words::shared_views(&observed.gathered).trim_end());
    }
    let Observed { gathered, reference, distances, inputs, left_out, n_alone } = observed;
    match solving::solve(gathered, reference, &distances, inputs) {
        Ok(mut solved) => {
            (solved.left_out, solved.n_alone) = (left_out, n_alone);
            answer(args, &solved)
        }
        Err(reason) => unanswered(&args.output, &reason),
    }
}

/// Reads or detects all observations.
fn observed(
    args: &ObservationArgs,
    world_name: Option<&str>,
    solving: &SolvingArgs,
    output: &AnswerArgs,
) -> Result<Observed> {
    let mut collected = collected(args)?;
    let world = world(world_name, &collected)?;
    let Moments { n_alone, remarks } =
        moments::name_views(&mut collected.frames, args.sync_tolerance_ms.map(|ms| 1e-3 * ms))?;
    collected.remarks.extend(remarks);
    check_twins(&collected)?;
    let inputs = inputs(&collected.files)?;
    let Collected { cameras, targets, frames, left_out, remarks, .. } = collected;
    let gathered = gather(cameras, targets, glimpses(frames), world);
    let reference = reference(solving, &gathered)?;
    let distances = solving::known_distances(&solving.known_distance_m, &gathered)?;
    if !output.quiet {
        remarks.iter().for_each(|text| eprintln!("{text}"));
    }
    Ok(Observed { gathered, reference, distances, inputs, left_out, n_alone })
}

/// What a command takes that needs the rig and its observations.
pub struct Placed {
    /// The observations.
    pub gathered: Gathered,
    /// For each camera, in their order.
    pub cam_from_rig: Vec<Pose>,
    /// What contradicts in the rig.
    pub contradiction: Option<String>,
}

/// The observations, and the cameras' poses in their rig; a single camera is its own rig.
pub fn placed(
    args: &ObservationArgs,
    solving: &SolvingArgs,
    output: &AnswerArgs,
) -> Result<Result<Placed, solving::Unsolved>> {
    let Observed { gathered, reference, distances, inputs, .. } = observed(args, None, solving, output)?;
    if let [_] = &gathered.rig.cameras[..] {
        return Ok(Ok(Placed { gathered, cam_from_rig: vec![Pose::identity()], contradiction: None }));
    }
    let solved = solving::solve(gathered.clone(), reference, &distances, inputs);
    Ok(solved.map(|solved| Placed {
        gathered,
        cam_from_rig: solved.run.solution.cameras.iter().map(|camera| camera.cam_from_rig).collect(),
        contradiction: rig_verdict_sentence(&solved.run),
    }))
}

/// Prints and writes what was found.
fn answer(args: &Rig, solved: &Solved) -> Result<Outcome> {
    if let Some(path) = &args.output.output {
        let file = own_rig_file(&solved.run.placed_cameras(), object::joint_of(solved))?;
        write_atomically(path, stated(&file, rig_verdict_sentence(&solved.run)).as_bytes())?;
    }
    if let Some(path) = &args.report {
        write_atomically(path, rig_page(&solved.run).as_bytes())?;
    }
    if let Some(path) = &args.scene {
        write_atomically(path, &rig_scene(&solved.run)?)?;
    }
    match args.output.json {
        true => {
            print(&format!("{}\n", serde_json::to_string(&object::object(solved, args.joint_covariance))?))?;
        }
        false => print(&words::describe(solved))?,
    }
    Ok(outcome(solved.run.solution.verdict.is_inconsistent))
}

/// A rig that contradicts itself is printed and written, and is no success.
pub(super) fn outcome(is_inconsistent: bool) -> Outcome {
    if is_inconsistent { Outcome::SomeUnanswered } else { Outcome::Answered }
}

/// A file of cameras with its status in the first line: whoever reads it later says so.
pub(super) fn stated(file: &str, contradiction: Option<String>) -> String {
    // A single camera without a place is no rig.
    match file.contains("[[") {
        true => format!("{}{file}", status_keys(contradiction.as_deref())),
        false => file.to_owned(),
    }
}

/// Says why there is no rig; nothing is written.
pub(super) fn unanswered(args: &AnswerArgs, reason: &solving::Unsolved) -> Result<Outcome> {
    match args.json {
        true => print(&format!("{}\n", serde_json::to_string(&object::refusal(reason))?))?,
        false => print(&format!("NO RIG   {}\n", reason.message))?,
    }
    eprintln!("error: {}", reason.message);
    Ok(Outcome::SomeUnanswered)
}

fn collected(args: &ObservationArgs) -> Result<Collected> {
    if args.cameras.is_empty() {
        bail!("--camera [NAME=]FILE is missing: the cameras' intrinsics are needed");
    }
    let mut collected = Collected::default();
    collected.cameras = named::cameras(&args.cameras, &mut collected)?;
    collected.targets = named::targets(&args.targets, &mut collected)?;
    if !args.detections.is_empty() {
        detections::read(&args.detections, args.sigma_px, &mut collected)?;
    } else if !args.images.is_empty() {
        pictures::look(args, &mut collected)?;
    } else {
        bail!("nothing to look at: give --images NAME=GLOB for each camera, or --detections FILE.csv");
    }
    named::fix_together(&args.fixed_together, &mut collected.targets)?;
    Ok(collected)
}

fn world(name: Option<&str>, collected: &Collected) -> Result<Option<usize>> {
    let Some(name) = name else { return Ok(None) };
    let target = named::target_number(&collected.targets, name, "--world")?;
    let body = collected.targets[target].body;
    match collected.targets.iter().filter(|t| t.body == body).count() {
        1 => Ok(Some(target)),
        _ => bail!(
            "--world {name}: this target is fixed together with others, which move; the world stands still"
        ),
    }
}

fn reference(args: &SolvingArgs, gathered: &Gathered) -> Result<usize> {
    let Some(name) = &args.reference else { return Ok(0) };
    match gathered.rig.camera(name) {
        Some(found) => Ok(found),
        None => {
            let names: Vec<String> = gathered.rig.cameras.iter().map(|camera| camera.name.clone()).collect();
            bail!("--reference {name}: {}", named::not_among(name, "camera", &names))
        }
    }
}

/// Two points of one name in one frame: one of them is mislabelled, and nobody can say which.
fn check_twins(collected: &Collected) -> Result<()> {
    for frame in &collected.frames {
        for (target, points) in &frame.targets {
            let mut names: Vec<&str> = points.iter().map(|(name, _)| name.as_str()).collect();
            names.sort_unstable();
            if let Some(twins) = names.windows(2).find(|pair| pair[0] == pair[1]) {
                bail!(
                    "camera {}, view {}: point {} of target {} is there twice; remove one (corners of a tag need the column `corner`, several targets the column `target`)",
                    collected.cameras[frame.camera].name,
                    frame.name,
                    twins[0],
                    collected.targets[*target].name
                );
            }
        }
    }
    Ok(())
}

fn glimpses(frames: Vec<Frame>) -> Vec<Glimpse> {
    let of_frame = |frame: Frame| {
        let Frame { camera, name, targets, .. } = frame;
        targets.into_iter().map(move |(target, points)| Glimpse {
            camera,
            view: name.clone(),
            target,
            points,
        })
    };
    frames.into_iter().flat_map(of_frame).collect()
}

/// Each file once, in order of its path, with its digest.
fn inputs(files: &[PathBuf]) -> Result<Vec<InputFile>> {
    let mut files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    files.sort();
    files.dedup();
    let digest = |path: &Path| -> Result<InputFile> {
        Ok(InputFile { path: path.display().to_string(), sha256: digest::sha256_of_file(path)? })
    };
    files.into_iter().map(digest).collect()
}
