//! `solve`: poses from known correspondences.

use crate::args::{OutputArgs, parse_method, positive};
use crate::camera::{CameraArgs, GivenCamera, ImageSizeArgs};
use crate::gravity::GravityArgs;
use crate::map::MapArgs;
use crate::output::{Outcome, Printer};
use crate::robust::RobustArgs;
use anyhow::{Result, bail};
use clap::Args;
use resight::PoseAnswer;
use resight::core::camera::ImageSize;
use resight::core::locate::unknown_focal::LensPrior;
use resight::locate::{Method, PointsOptions};
use resight::marked_lines::{SceneLens, is_marked_lines, scene_views};
use resight::nominal::lens_of_unknown_focal;
use resight::points::{TableLocator, read_table, repeated_names};
use std::path::PathBuf;

/// Computes the camera's pose from known points and their pixels in a CSV file.
///
/// The columns are x_m,y_m,z_m,u_px,v_px (with --normalized: x_m,y_m,z_m,xn,yn) and optionally view, id, sigma_px (of u and v) and
/// sigma_m (of x, y, z; 0 when exact), by name and in any order. A row whose columns x2_m,y2_m,z2_m,u2_px,v2_px are filled is a line: two points
/// on it in the target, and two on its image, which need not be the same. Each view gets one pose, in file order; rows of a view need not be
/// adjacent.
///
/// Instead of x_m,y_m,z_m the columns may be lat_deg,lon_deg,height_m (WGS 84), or easting_m,northing_m,height_m with a column zone (33N) or --crs:
/// the answer then states the camera's latitude, longitude, height and heading, docs/georeference.md.
///
/// A file with the columns direction,u_px,v_px,u2_px,v2_px (direction: across, along, up or horizon) holds lines marked in a photograph, and
/// optionally length_m: with --estimate-focal the answer is focal length, tilt, roll and, where a length is known, height; with a camera the same without
/// the focal length.
#[derive(Debug, Args)]
#[command(after_help = "Example: resight solve points.csv --camera camera.toml --sigma-px 0.3")]
#[command(after_long_help = "Examples:
  resight solve points.csv --camera camera.toml --sigma-px 0.3
  resight solve matches.csv --camera camera.toml --sigma-px 1 --robust 4
  resight solve points.csv --normalized --sigma-normalized 0.0005 --method line_plus_one --json")]
pub struct Solve {
    /// CSV file of points with a header line.
    #[arg(value_name = "POINTS.csv")]
    points: PathBuf,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    image_size: ImageSizeArgs,
    /// Without a camera: estimates the focal length of each view with its pose, from 4 points or more and --image-size-px.
    ///
    /// The points must not lie in one plane, or the plane must be tilted. The lens is taken as one of square pixels with the principal
    /// point in the middle and little distortion, each as uncertain as such lenses are; every ± holds that.
    #[arg(long, conflicts_with_all = ["camera", "hfov_deg", "focal_mm", "intrinsics_sigma", "normalized", "robust", "gravity"])]
    estimate_focal: bool,
    /// Reads columns xn,yn: undistorted coordinates on the plane z = 1, for which no camera is needed.
    #[arg(long, hide_short_help = true, conflicts_with_all = ["camera", "hfov_deg", "focal_mm"])]
    normalized: bool,
    /// Solver: auto, wang2004, line_plus_one, p3p, planar, sqpnp or upright (2 points and --gravity).
    #[arg(long, default_value = "auto", value_parser = parse_method)]
    method: Method,
    /// Standard deviation of u and v where the file has no sigma_px [default: 0.5].
    ///
    /// With a photogrammetric camera it has the unit of f, and its default is f / 2000.
    #[arg(long, help_heading = "Noise", value_name = "S", conflicts_with = "normalized", allow_negative_numbers = true, value_parser = positive)]
    sigma_px: Option<f64>,
    /// Standard deviation of xn and yn where the file has no sigma_px [default: 0.0005].
    #[arg(long, hide_short_help = true, help_heading = "Noise", value_name = "S", requires = "normalized", allow_negative_numbers = true, value_parser = positive)]
    sigma_normalized: Option<f64>,
    #[command(flatten)]
    robust: RobustArgs,
    #[command(flatten)]
    gravity: GravityArgs,
    #[command(flatten)]
    map: MapArgs,
    #[command(flatten)]
    output: OutputArgs,
}

/// See `Solve`.
pub fn run(args: &Solve) -> Result<Outcome> {
    args.output.check()?;
    crate::files::must_exist(&args.points)?;
    if is_marked_lines(&args.points)? {
        return marked_lines(args);
    }
    let (locator, of_camera) = locator(args)?;
    let table = read_table(&args.points, args.normalized, args.map.crs.as_ref())?;
    args.map.check(&table)?;
    let views = &table.views;
    let mut printer = Printer::new(&args.output, views.len());
    repeated_names(views).iter().for_each(|text| printer.remark(&format!("warning: {text}")));
    let locator = locator.for_table(&args.points, &table);
    let mut remarks: Vec<String> = locator.remarks().collect();
    remarks.iter().for_each(|text| printer.remark(&format!("warning: {}: {text}", args.points.display())));
    of_camera.iter().for_each(|text| printer.remark(&format!("warning: {text}")));
    remarks.extend(of_camera);
    let mut answers = Vec::new();
    resight::parallel::in_order(
        views,
        |view| locator.locate(view),
        |answer| {
            let mut answer: PoseAnswer = answer;
            let words = crate::text::describe(&answer);
            answer.remarks.extend(remarks.iter().cloned());
            printer.result(&answer, &words, answer.status())?;
            if args.map.is_wanted() {
                answers.push(answer);
            }
            Ok::<(), anyhow::Error>(())
        },
    )?;
    if args.map.is_wanted() {
        let features = locator.features(&table, &answers, &args.map.ground())?;
        args.map.write(&features)?;
    }
    printer.finish()
}

/// How the camera stands over a scene of marked lines.
fn marked_lines(args: &Solve) -> Result<Outcome> {
    let is_plain = args.method == Method::Auto && !args.normalized && args.robust.threshold_px().is_none();
    if !is_plain || !args.gravity.check(args.method)?.is_empty() {
        bail!(
            "{}: marked lines (column `direction`) take no --method, --normalized, --robust and --gravity",
            args.points.display()
        );
    }
    let (lens, remarks) = match args.estimate_focal {
        true => (SceneLens::Unknown(unknown_lens(args)?), Vec::new()),
        false => {
            let GivenCamera { camera, intrinsics, remarks } =
                args.camera.of_size(args.image_size.image_size_px, args.method)?;
            (SceneLens::Known(Box::new(camera), intrinsics), remarks)
        }
    };
    let answers = scene_views(&args.points, &lens, args.sigma_px)?;
    let mut printer = Printer::new(&args.output, answers.len());
    remarks.iter().for_each(|text| printer.remark(&format!("warning: {text}")));
    for mut answer in answers {
        answer.remarks.extend(remarks.clone());
        printer.result(&answer, &crate::text::scene::describe(&answer), answer.status)?;
    }
    printer.finish()
}

fn unknown_lens(args: &Solve) -> Result<LensPrior> {
    let Some((width_px, height_px)) = args.image_size.image_size_px else {
        bail!(
            "--estimate-focal needs --image-size-px WIDTHxHEIGHT: the principal point is taken to be near the middle of the image"
        )
    };
    Ok(lens_of_unknown_focal(ImageSize { width_px, height_px }))
}

/// The solver, and what is to be said of the lens.
fn locator(args: &Solve) -> Result<(TableLocator, Vec<String>)> {
    if args.normalized && args.camera.has_sigma() {
        bail!("--intrinsics-sigma needs a camera; coordinates given with --normalized have none");
    }
    let given = || match args.estimate_focal {
        true => GivenCamera::of_unknown_focal(args.method),
        false => args.camera.of_size(args.image_size.image_size_px, args.method),
    };
    let given = (!args.normalized).then(given).transpose()?;
    let estimate_focal = args.estimate_focal.then(|| unknown_lens(args)).transpose()?;
    let sigma = if args.normalized { args.sigma_normalized } else { args.sigma_px };
    let (camera, intrinsics, remarks) = match given {
        Some(GivenCamera { camera, intrinsics, remarks }) => (Some(camera), intrinsics, remarks),
        None => (None, None, Vec::new()),
    };
    let options = PointsOptions {
        method: args.method,
        intrinsics,
        priors: args.gravity.check(args.method)?,
        estimate_focal,
        robust_threshold_px: args.robust.threshold_px(),
        ..PointsOptions::default()
    };
    Ok((TableLocator::new(camera, sigma, options), remarks))
}
