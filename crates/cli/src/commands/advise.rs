//! `advise`: where to put the next point, target or board, and how uncertain it will make the answer.

mod words;

use crate::args::{TagArgs, positive};
use crate::camera::cameras_of;
use crate::output::{Outcome, print, remark};
use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use resight::advise::heat::draw;
use resight::advise::{
    AimFor, MeasuredPoint, NextBoardRequest, NextPointRequest, TargetRequest, advise_boards, advise_points,
    advise_target, read_points, read_poses,
};
use resight::answer::advise::Picture;
use resight::core::Pose;
use resight::core::advise::board::Criterion;
use resight::core::advise::volume::Volume;
use resight::formats::{self, NamedCamera};
use resight::input::table::how_file_is_read;
use resight::report::verdict::Status;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Where to put the next point, target or board for the smallest uncertainty. Nothing has to be photographed yet.
///
/// Three questions, distinguished by what is given: --points, control points measured so far (where should the next one go?); --target with one
/// camera (how uncertain over a volume, and which change of the target helps?); --target with a file of several cameras (where should the
/// next board go?). Every figure is one standard deviation; where a first-order figure does not hold, the answer says so.
#[derive(Debug, Args)]
#[command(
    after_help = "Example: resight advise --camera camera.toml --points marks.csv --region-m -5,8,5,20 -o advice"
)]
#[command(after_long_help = "Examples:
  resight advise --camera camera.toml --points marks.csv --region-m -5,8,5,20 --length-m -1.5,13,2.3,14 -o advice
  resight advise --camera camera.toml --points marks.csv --pose pose.json --candidates places.csv --json
  resight advise --camera camera.toml --target dots.toml --distance-m 0.5..2 --tilt-deg 10..60 -o advice
  resight advise --camera rig.toml --target board.toml --views views.jsonl --distance-m 1..3 -o advice

marks.csv has columns x_m,y_m,z_m and, where the control points were seen already, u_px,v_px (then no --pose is needed); optionally id, sigma_m.
pose.json is a pose object as `solve --json` or `locate --json` prints it; views.jsonl has one object with rig_from_target a line.")]
pub struct Advise {
    /// Reads the camera; a file of several cameras with poses is a rig. FILE#NAME picks one.
    #[arg(long, value_name = "FILE")]
    camera: String,
    /// Reads the control points measured so far.
    #[arg(long, value_name = "FILE.csv", required_unless_present = "target", conflicts_with = "target")]
    points: Option<PathBuf>,
    /// Reads the target or board.
    #[arg(long, value_name = "FILE")]
    target: Option<PathBuf>,
    /// States the standard deviation of u and v.
    #[arg(long, value_name = "S", default_value = "0.5", allow_negative_numbers = true, value_parser = positive)]
    sigma_px: f64,
    /// States about where the camera is, where the control points have no pixels yet.
    #[arg(
        hide_short_help = true,
        help_heading = "Next point",
        long,
        value_name = "FILE.json",
        requires = "points"
    )]
    pose: Option<PathBuf>,
    /// Lists the places to choose from: columns x_m,y_m,z_m and optionally id, sigma_m [default: a grid over the region]
    #[arg(
        hide_short_help = true,
        help_heading = "Next point",
        long,
        value_name = "FILE.csv",
        requires = "points",
        conflicts_with = "region_m"
    )]
    candidates: Option<PathBuf>,
    /// States the height of the ground in the target frame.
    #[arg(hide_short_help = true, help_heading = "Next point", long, value_name = "Z", default_value = "0", allow_negative_numbers = true, value_parser = number)]
    ground_z_m: f64,
    /// States where on the ground the next point may go [default: around the control points]
    #[arg(help_heading = "Next point", long, value_name = "X0,Y0,X1,Y1", requires = "points", allow_hyphen_values = true, value_parser = region)]
    region_m: Option<[f64; 4]>,
    /// States the ends of a length that will be measured on the ground.
    #[arg(help_heading = "Next point", long, value_name = "X1,Y1,X2,Y2", requires = "points", allow_hyphen_values = true, value_parser = four)]
    length_m: Option<[f64; 4]>,
    /// Chooses the standard deviation to minimise [default: length where one is given, else position]
    #[arg(
        hide_short_help = true,
        help_heading = "Next point",
        long,
        value_name = "AIM",
        requires = "points"
    )]
    minimise: Option<AimName>,
    /// States how far the camera is from the target, or the boards from the cameras.
    #[arg(help_heading = "Target over a volume", long, value_name = "A..B", requires = "target", allow_hyphen_values = true, value_parser = range)]
    distance_m: Option<[f64; 2]>,
    /// States the angle between the target's normal and the direction to the camera.
    #[arg(help_heading = "Target over a volume", long, value_name = "A..B", requires = "target", default_value = "0..60", allow_hyphen_values = true, value_parser = tilts)]
    tilt_deg: [f64; 2],
    /// States the direction around the normal, from the target's x axis (0) towards its y axis (90).
    #[arg(hide_short_help = true, help_heading = "Target over a volume", long, value_name = "A..B", requires = "target", default_value = "-180..180", allow_hyphen_values = true, value_parser = directions)]
    direction_deg: [f64; 2],
    /// Reads the boards seen so far, one object with rig_from_target a line.
    #[arg(
        hide_short_help = true,
        help_heading = "Next board of a rig",
        long,
        value_name = "FILE.jsonl",
        requires = "target"
    )]
    views: Option<PathBuf>,
    /// Plans so many boards, each with those before it taken as seen.
    #[arg(hide_short_help = true, help_heading = "Next board of a rig", long, value_name = "N", default_value = "3", value_parser = clap::value_parser!(u8).range(1..=50))]
    next: u8,
    /// Chooses what to minimise.
    #[arg(
        hide_short_help = true,
        help_heading = "Next board of a rig",
        long,
        value_name = "WHAT",
        default_value = "worst"
    )]
    criterion: CriterionName,
    /// Names the camera whose frame is the rig's [default: the first]
    #[arg(
        hide_short_help = true,
        help_heading = "Next board of a rig",
        long,
        value_name = "NAME",
        requires = "target"
    )]
    reference: Option<String>,
    /// Prints JSON Lines on stdout, one object per suggestion and nothing else.
    #[arg(long)]
    json: bool,
    /// Writes maps (PNG) into this folder.
    #[arg(long, short, value_name = "DIR")]
    output: Option<PathBuf>,
}

/// What is to become sure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum AimName {
    /// The camera's position, worst direction.
    #[value(name = "position", alias = "place")]
    Place,
    /// Its rotation, worst axis.
    Rotation,
    /// The length of --length-m.
    Length,
}

/// What is to become small in a rig.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum CriterionName {
    /// The place of the camera known worst.
    Worst,
    /// The sum of the variances of all places.
    Trace,
    /// The volume of the whole uncertainty.
    Determinant,
}

impl From<AimName> for AimFor {
    fn from(name: AimName) -> Self {
        match name {
            AimName::Place => AimFor::Place,
            AimName::Rotation => AimFor::Rotation,
            AimName::Length => AimFor::Length,
        }
    }
}

impl From<CriterionName> for Criterion {
    fn from(name: CriterionName) -> Self {
        match name {
            CriterionName::Worst => Criterion::Worst,
            CriterionName::Trace => Criterion::Trace,
            CriterionName::Determinant => Criterion::Determinant,
        }
    }
}

/// See `Advise`.
pub fn run(args: &Advise) -> Result<Outcome> {
    if let Some(folder) = &args.output {
        crate::files::make_folder("-o", folder)?;
    }
    let cameras = cameras_of(&args.camera)?;
    match (&args.points, cameras.as_slice()) {
        (Some(file), [one]) => points(args, one, file),
        (Some(_), several) => bail!(
            "{}: holds {} cameras; control points are seen by one, pick it: {}#{}",
            args.camera,
            several.len(),
            args.camera,
            several[0].name
        ),
        (None, [one]) => target(args, one),
        (None, several) => boards(args, several),
    }
}

fn points(args: &Advise, named: &NamedCamera, file: &Path) -> Result<Outcome> {
    let points = measured_points(file)?;
    let candidates = args.candidates.as_deref().map(measured_points).transpose()?;
    let pose = args.pose.as_deref().map(|path| poses(path, &["cam_from_target"])).transpose()?;
    let rows = named.intrinsics_rows();
    let advice = advise_points(&NextPointRequest {
        camera: &named.camera,
        intrinsics_covariance: rows.as_deref(),
        points: &points,
        sigma_px: args.sigma_px,
        pose: pose.and_then(|poses| poses.first().copied()),
        candidates: candidates.as_deref(),
        ground_z_m: args.ground_z_m,
        region_m: args.region_m,
        length_m: args.length_m,
        aim: args.minimise.map(AimFor::from),
        pictures: args.output.is_some(),
    })
    .with_context(|| args.camera.clone())?;
    advice.remarks.iter().for_each(|text| remark(text));
    print(&match args.json {
        true => json([&advice.now])? + &json(&advice.suggestions)?,
        false => words::points(&advice),
    })?;
    args.pictures(&advice.pictures)?;
    Ok(Outcome::of([advice.now.status]))
}

fn target(args: &Advise, named: &NamedCamera) -> Result<Outcome> {
    let target = args.target()?;
    let distance_m =
        args.distance_m.context("--distance-m A..B is needed: how far the camera is from the target")?;
    let radians = |range: [f64; 2]| range.map(f64::to_radians);
    let volume =
        Volume { distance_m, tilt_rad: radians(args.tilt_deg), direction_rad: radians(args.direction_deg) };
    let pictures = args.output.is_some();
    let rows = named.intrinsics_rows();
    let request = TargetRequest {
        camera: &named.camera,
        intrinsics_covariance: rows.as_deref(),
        target: &target,
        sigma_px: args.sigma_px,
        volume,
        pictures,
    };
    let advice = advise_target(&request).with_context(|| args.camera.clone())?;
    print(&match args.json {
        true => json(&advice.outlooks)? + &json(&advice.changes)?,
        false => words::target(&advice, args.sigma_px),
    })?;
    args.pictures(&advice.pictures)?;
    Ok(Outcome::of(advice.outlooks.first().map(|whole| whole.status)))
}

fn boards(args: &Advise, cameras: &[NamedCamera]) -> Result<Outcome> {
    let target = args.target()?;
    let distance_m =
        args.distance_m.context("--distance-m A..B is needed: how far from the cameras boards are held")?;
    let keys = ["rig_from_target", "rig_from_body", "rig_from_board"];
    let views = args.views.as_deref().map(|path| poses(path, &keys)).transpose()?.unwrap_or_default();
    let advice = advise_boards(&NextBoardRequest {
        cameras,
        target: &target,
        sigma_px: args.sigma_px,
        views: &views,
        distance_m,
        reference: args.reference.as_deref(),
        criterion: args.criterion.into(),
        n_boards: usize::from(args.next),
        pictures: args.output.is_some(),
    })
    .with_context(|| args.camera.clone())?;
    advice.remarks.iter().for_each(|text| remark(text));
    print(&match args.json {
        true => json([&advice.now])? + &json(&advice.suggestions)?,
        false => words::boards(&advice, args.sigma_px),
    })?;
    args.pictures(&advice.pictures)?;
    // What is known before the boards are shown may well determine nothing.
    Ok(Outcome::of(advice.suggestions.is_empty().then_some(Status::Degenerate)))
}

/// One object a line.
fn json<T: Serialize>(objects: impl IntoIterator<Item = T>) -> Result<String> {
    let line = |object| Ok(serde_json::to_string(&object)? + "\n");
    objects.into_iter().map(line).collect()
}

fn measured_points(path: &Path) -> Result<Vec<MeasuredPoint>> {
    crate::files::must_exist(path)?;
    how_file_is_read(path).iter().for_each(|text| remark(text));
    Ok(read_points(path)?)
}

fn poses(path: &Path, keys: &[&str]) -> Result<Vec<Pose>> {
    crate::files::must_exist(path)?;
    Ok(read_poses(path, keys)?)
}

impl Advise {
    /// The target file; its warnings are printed.
    fn target(&self) -> Result<resight::core::Target> {
        let Some(path) = &self.target else { bail!("--target FILE is needed") };
        let (target, _) = super::target(path, &TagArgs::default(), remark)?;
        super::warn_of_scale(path, &target, "advice");
        Ok(target)
    }

    /// Writes maps; says where.
    fn pictures(&self, pictures: &[Picture]) -> Result<()> {
        let Some(folder) = &self.output else { return Ok(()) };
        for (name, map) in pictures {
            let png = draw(map).png().map_err(|reason| anyhow::anyhow!("{name}: {reason}"))?;
            let path = folder.join(name);
            formats::write_atomically(&path, &png)?;
            remark(&format!("written: {}", path.display()));
        }
        Ok(())
    }
}

fn numbers<const N: usize>(text: &str, separator: &str, needed: &str) -> Result<[f64; N], String> {
    let parts: Result<Vec<f64>, _> = text.split(separator).map(|part| part.trim().parse::<f64>()).collect();
    let all = parts.ok().and_then(|p| <[f64; N]>::try_from(p).ok()).ok_or(needed)?;
    if all.iter().all(|x| x.is_finite()) { Ok(all) } else { Err(needed.to_string()) }
}

fn number(text: &str) -> Result<f64, String> {
    Ok(numbers::<1>(text, ",", "a number is needed")?[0])
}

fn four(text: &str) -> Result<[f64; 4], String> {
    numbers(text, ",", "four numbers are needed, e.g. -1.5,13,2.3,14")
}

fn region(text: &str) -> Result<[f64; 4], String> {
    let [x0, y0, x1, y1] = numbers(text, ",", "four numbers X0,Y0,X1,Y1 are needed, e.g. -5,8,5,20")?;
    let is_box = x0 < x1 && y0 < y1;
    if is_box { Ok([x0, y0, x1, y1]) } else { Err("X0 < X1 and Y0 < Y1 are needed".to_string()) }
}

fn range(text: &str) -> Result<[f64; 2], String> {
    let needed = "a range A..B of positive numbers is needed, e.g. 0.5..3";
    let [a, b] = numbers(text, "..", needed)?;
    let is_range = 0.0 < a && a <= b;
    if is_range { Ok([a, b]) } else { Err(needed.to_string()) }
}

fn tilts(text: &str) -> Result<[f64; 2], String> {
    let needed = "a range A..B of degrees from 0 to 85 is needed, e.g. 10..60";
    let [a, b] = numbers(text, "..", needed)?;
    let is_range = 0.0 <= a && a <= b && b <= 85.0;
    if is_range { Ok([a, b]) } else { Err(needed.to_string()) }
}

fn directions(text: &str) -> Result<[f64; 2], String> {
    let needed = "a range A..B of degrees, A ≤ B, each from -360 to 360, is needed, e.g. 60..120";
    let [a, b] = numbers(text, "..", needed)?;
    let is_range = -360.0 <= a && a <= b && b <= 360.0;
    if is_range { Ok([a, b]) } else { Err(needed.to_string()) }
}
