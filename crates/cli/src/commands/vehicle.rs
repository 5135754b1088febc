//! `vehicle`: how a camera is rotated against the vehicle that carries it, from a video of driving.

use crate::args::{positive, seconds};
use crate::output::{Outcome, print_answer};
use anyhow::{Result, bail};
use clap::Args;
use resight::locate::IntrinsicsCovariance;
use resight::vehicle::{
    VehicleAnswer, VehicleRequest, describe, read_speeds, vehicle_from_images, vehicle_from_video,
};
use resight::video::is_video;
use std::path::PathBuf;

/// Computes the rotation of a camera against its vehicle, from a video of driving.
///
/// Yaw and pitch follow from the direction of travel on straight stretches, roll from the axis of curves and from the ground, the height from the
/// ground and the speed. Each has its own standard deviation, or is named as not determined: standing still, curves only, no curves. A camera that
/// is rotated on the vehicle during the drive is an alarm, exit status 3. No target is needed.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight vehicle drive.mp4 --camera camera.toml --speed speed.csv
  resight vehicle 'drive/*.png' --interval-s 0.1 --camera camera.toml --json")]
pub struct Vehicle {
    /// A video, or images (PNG or JPEG) or patterns such as 'drive/*.png' in the order in which they were taken.
    #[arg(required = true, value_name = "VIDEO|IMAGE")]
    images: Vec<String>,
    /// Camera file in any supported format; FILE#NAME picks one of several. Every ± holds the uncertainty of the intrinsics that it states.
    #[arg(long, value_name = "FILE")]
    camera: String,
    /// Time from one image to the next, for images.
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = seconds)]
    interval_s: Option<f64>,
    /// Speeds of the vehicle (CSV): t_s in seconds from the first frame, speed_m_s, negative in reverse.
    #[arg(long, value_name = "FILE.csv")]
    speed: Option<PathBuf>,
    /// Standard deviation of the scale of the speeds, in percent.
    #[arg(long, hide_short_help = true, value_name = "PERCENT", default_value = "2", requires = "speed", allow_negative_numbers = true, value_parser = positive)]
    speed_sigma_percent: f64,
    /// Time between the two frames of a pair; where images are farther apart, their interval.
    #[arg(long, value_name = "S", default_value = "0.25", allow_negative_numbers = true, value_parser = seconds)]
    every: f64,
    /// Largest mean number of false alarms in 24 hours of driving straight.
    #[arg(long, hide_short_help = true, value_name = "N", default_value = "0.0333", allow_negative_numbers = true, value_parser = positive)]
    false_alarms_per_day: f64,
    /// A rotation of the camera up to this is no alarm [default: only the ± counts].
    #[arg(long, hide_short_help = true, value_name = "DEGREES", allow_negative_numbers = true, value_parser = crate::args::not_negative)]
    tolerance_deg: Option<f64>,
    /// Prints one JSON object on stdout and nothing else.
    #[arg(long, help_heading = "Output")]
    json: bool,
}

/// See `Vehicle`.
pub fn run(args: &Vehicle) -> Result<Outcome> {
    let images = crate::files::expand(&args.images)?;
    let mut cameras = crate::camera::cameras_of(&args.camera)?;
    if cameras.len() != 1 {
        bail!("{} holds {} cameras; pick one: {}#NAME", args.camera, cameras.len(), args.camera);
    }
    let speeds = match &args.speed {
        Some(path) => {
            crate::files::must_exist(path)?;
            read_speeds(path)?
        }
        None => Vec::new(),
    };
    let camera = cameras.swap_remove(0);
    let request = VehicleRequest {
        intrinsics: IntrinsicsCovariance::of(&camera),
        speeds,
        speed_relative_sigma: 0.01 * args.speed_sigma_percent,
        every_s: args.every,
        false_alarms_per_day: args.false_alarms_per_day,
        tolerance_rad: args.tolerance_deg.unwrap_or(0.0).to_radians(),
        ..VehicleRequest::new(camera.camera)
    };
    let answer = match (&images[..], args.interval_s) {
        ([video], None) if is_video(video) => vehicle_from_video(video, &request)?,
        (many, _) if many.iter().any(is_video) => {
            bail!("one video alone is needed, or images with --interval-s; a video states its own times")
        }
        (_, None) => bail!("images state no times; give the time from one to the next: --interval-s 0.1"),
        (images, Some(interval_s)) => vehicle_from_images(images, interval_s, &request)?,
    };
    print_answer(args.json, &answer, &describe(&answer), answer.status)?;
    Ok(outcome(&answer))
}

fn outcome(answer: &VehicleAnswer) -> Outcome {
    match &answer.alarm {
        Some(alarm) if alarm.state == "moved" => Outcome::Moved,
        _ => Outcome::of([answer.status]),
    }
}
