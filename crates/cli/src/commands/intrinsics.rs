//! `intrinsics`: focal length, principal point and distortion of cameras with their covariance, or a check of existing ones.

pub mod words;

use crate::args::{CornerArgs, parse_size, positive};
use crate::camera::cameras_of;
use crate::output::{Outcome, print_answer, remark, with_progress};
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use resight::core::camera::ImageSize;
use resight::formats::{NamedCamera, own_file, write_atomically};
use resight::intrinsics::{IntrinsicsRequest, IntrinsicsSource, Models, Noise, TargetShape, model_names};
use resight::report::intrinsics_page;
use resight::rig::{CameraImage, Detections, ImageOptions};
use std::path::PathBuf;

/// Estimates a camera's intrinsics with their covariance from images of a target.
///
/// Focal length, principal point and as many distortion coefficients as the images carry; bad images and corners are named. Take 10 images or
/// more, the target tilted by 30° to 45° in several directions, near and far, and in the corners of the image.
#[derive(Debug, Args)]
#[command(
    after_help = "Example: resight intrinsics 'left*.jpg' --target board.toml -o left.toml --report left.html",
    after_long_help = "Examples:
  resight intrinsics 'left*.jpg' --target board.toml -o left.toml --report left.html
  resight intrinsics --images left='left*.jpg' --images right='right*.jpg' --target board.toml -o cameras.toml
  resight intrinsics --detections corners.csv --image-size-px 640x480 --sigma-px 0.1 -o camera.toml
  resight intrinsics 'today*.jpg' --target board.toml --check left.toml

How to photograph, and how good is good enough: docs/intrinsics.md."
)]
pub struct Intrinsics {
    /// Images of one camera: paths, patterns such as 'left*.png', or its video.
    #[arg(value_name = "IMAGE")]
    inputs: Vec<String>,
    /// Target file; several targets may be seen.
    #[arg(long = "target", value_name = "FILE", num_args = 1)]
    targets: Vec<PathBuf>,
    /// Images of one of several cameras, a path or a pattern.
    #[arg(long, hide_short_help = true, value_name = "NAME=GLOB", conflicts_with_all = ["inputs", "detections"], num_args = 1..)]
    images: Vec<String>,
    /// Points that were detected already (CSV), instead of images.
    ///
    /// The columns are view,id,x_m,y_m,z_m,u_px,v_px and optionally camera, target, corner, sigma_px, sigma_m; x_m,y_m,z_m may be missing where
    /// --target knows the id.
    #[arg(long, value_name = "FILE.csv", conflicts_with = "inputs", num_args = 1..)]
    detections: Vec<PathBuf>,
    /// Size of the images that the detections come from [default: that of the camera of --check].
    #[arg(long, value_name = "WIDTHxHEIGHT", requires = "detections", value_parser = size)]
    image_size_px: Option<ImageSize>,
    /// Name of the camera; with --detections the cameras that are calibrated [default: all].
    #[arg(long, hide_short_help = true, value_name = "NAME")]
    camera_name: Vec<String>,
    /// Checks the intrinsics of an existing file on these images instead of estimating them.
    #[arg(long, value_name = "CAMERA")]
    check: Option<PathBuf>,
    /// Lens model: auto, or one of those of camera.toml [default: auto].
    ///
    /// auto tries pinhole, brown_conrady and kannala_brandt. Each model has as many coefficients as the images carry.
    #[arg(long, help_heading = "Solving", value_name = "MODEL", value_parser = model, default_value = "auto", hide_default_value = true)]
    model: Models,
    /// Standard deviation of u_px and v_px where the detections have no sigma_px [default: 0.5].
    #[arg(long, hide_short_help = true, help_heading = "Solving", value_name = "S", requires = "detections", allow_negative_numbers = true, value_parser = positive)]
    sigma_px: Option<f64>,
    /// Takes the stated standard deviations of corners as they are, unless the residuals prove them too small.
    ///
    /// Otherwise the residuals say how large they are, and the stated ones are weights.
    #[arg(long, hide_short_help = true, help_heading = "Solving")]
    stated_noise: bool,
    /// Whether stretch and bend of a flat target are estimated: auto (where they are beyond doubt), free (always) or exact (never).
    #[arg(
        long,
        hide_short_help = true,
        help_heading = "Solving",
        value_name = "HOW",
        value_enum,
        default_value = "auto",
        hide_default_value = true,
        hide_possible_values = true
    )]
    target_shape: Shape,
    #[command(flatten)]
    corners: CornerArgs,
    /// Prints one JSON object on stdout and nothing else.
    #[arg(long, help_heading = "Output")]
    json: bool,
    /// Writes the cameras to FILE (TOML), which other commands read; none that may not be relied on.
    #[arg(long, short, help_heading = "Output", value_name = "FILE")]
    output: Option<PathBuf>,
    /// Writes a self-contained page (HTML) with coverage, residuals and projection uncertainty to FILE.
    #[arg(long, help_heading = "Output", value_name = "FILE.html")]
    report: Option<PathBuf>,
}

/// What is done about a target that is stretched or bent.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum Shape {
    Auto,
    Free,
    Exact,
}

/// `WIDTHxHEIGHT`.
fn size(text: &str) -> Result<ImageSize, String> {
    parse_size(text).map(|(width_px, height_px)| ImageSize { width_px, height_px })
}

/// A lens model by its name, or `auto`.
pub fn model(text: &str) -> Result<Models, String> {
    if text == "auto" {
        return Ok(Models::ByEvidence);
    }
    let names = model_names();
    let found = names.iter().find(|name| **name == text);
    found.map(|name| Models::Named(name)).ok_or_else(|| {
        let all: Vec<String> =
            std::iter::once("auto").chain(names.iter().copied()).map(str::to_owned).collect();
        resight::input::not_among(text, "lens model", &all)
    })
}

/// See `Intrinsics`.
pub fn run(args: &Intrinsics) -> Result<Outcome> {
    for path in [&args.output, &args.report].into_iter().flatten() {
        crate::files::must_be_writable(path)?;
    }
    let request = request(args)?;
    match &args.check {
        Some(_) => check(args, &request),
        None => estimate(args, &request),
    }
}

fn estimate(args: &Intrinsics, request: &IntrinsicsRequest) -> Result<Outcome> {
    let answer = with_progress(|| resight::intrinsics(request))?;
    answer.remarks.iter().for_each(|text| remark(text));
    let reliable = answer.reliable();
    if let (Some(path), false) = (&args.output, reliable.is_empty()) {
        write_atomically(path, own_file(&reliable)?.as_bytes())?;
    }
    if let Some(path) = &args.report {
        write_atomically(path, intrinsics_page(&answer).as_bytes())?;
    }
    print_answer(args.json, &answer, &words::describe(&answer, args.output.as_deref()), answer.status)?;
    Ok(Outcome::of([answer.status]))
}

fn check(args: &Intrinsics, request: &IntrinsicsRequest) -> Result<Outcome> {
    if args.output.is_some() || args.report.is_some() {
        bail!("--check changes nothing, so -o and --report have nothing to write; leave them out");
    }
    let answer = with_progress(|| resight::check_intrinsics(request))?;
    answer.remarks.iter().for_each(|text| remark(text));
    print_answer(args.json, &answer, &words::describe_check(&answer), answer.status)?;
    Ok(Outcome::of([answer.status]))
}

fn request(args: &Intrinsics) -> Result<IntrinsicsRequest<'_>> {
    let checked = args.check.as_deref().map(|file| cameras_of(&file.to_string_lossy()));
    let checked = checked.transpose()?.unwrap_or_default();
    let (source, cameras) = source(args, &checked)?;
    let mut request = IntrinsicsRequest {
        cameras,
        models: args.model,
        noise: if args.stated_noise { Noise::Stated } else { Noise::Estimated },
        target_shape: match args.target_shape {
            Shape::Auto => TargetShape::ByEvidence,
            Shape::Free => TargetShape::Free,
            Shape::Exact => TargetShape::Exact,
        },
        checked,
        ..IntrinsicsRequest::new(source)
    };
    for path in &args.targets {
        crate::files::must_exist(path)?;
        request.read_target(path)?.iter().for_each(|text| remark(text));
    }
    Ok(request)
}

/// What is looked at, and the names of its cameras.
fn source<'a>(args: &'a Intrinsics, checked: &[NamedCamera]) -> Result<(IntrinsicsSource<'a>, Vec<String>)> {
    if !args.detections.is_empty() {
        let of_camera = || checked.first().and_then(|known| known.camera.size);
        let Some(size) = args.image_size_px.or_else(of_camera) else {
            bail!(
                "--detections: the size of the images is not known; say it with --image-size-px WIDTHxHEIGHT"
            );
        };
        args.detections.iter().try_for_each(|path| crate::files::must_exist(path))?;
        let detections = Detections { sigma_px: args.sigma_px, ..Detections::files(&args.detections) };
        return Ok((IntrinsicsSource::Detections { detections, size }, args.camera_name.clone()));
    }
    let (mut images, mut names) = (Vec::new(), Vec::new());
    for argument in &args.images {
        let Some((name, pattern)) = argument.split_once('=') else {
            bail!("--images {argument}: say which camera took them, e.g. --images left={argument}");
        };
        let files = crate::files::expand(&[pattern.to_string()])?;
        images.extend(files.into_iter().map(|path| CameraImage::matched(name, path, pattern)));
        if !names.contains(&name.to_string()) {
            names.push(name.to_string());
        }
    }
    if !args.inputs.is_empty() {
        let name = match &args.camera_name[..] {
            [] => "camera".to_string(),
            [name] => name.clone(),
            _ => bail!("images of several cameras: give --images NAME=GLOB for each instead"),
        };
        let files = crate::files::expand(&args.inputs)?;
        images.extend(files.into_iter().map(|path| CameraImage::file(&name, path)));
        names.push(name);
    }
    if images.is_empty() {
        bail!("nothing to look at: give images, or --detections FILE.csv with --image-size-px WIDTHxHEIGHT");
    }
    if args.targets.is_empty() {
        bail!("images need --target FILE: what is to be found in them");
    }
    let options = ImageOptions {
        times: None,
        corner_window: args.corners.window(),
        kept: crate::files::kept_detections(),
    };
    Ok((IntrinsicsSource::Images { images, options }, names))
}
