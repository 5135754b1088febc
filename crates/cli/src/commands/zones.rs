//! `zones`: polygons drawn on a reference image, moved with the camera.

use crate::args::{OutputArgs, not_negative, positive};
use crate::output::{Outcome, Printer};
use anyhow::{Result, bail};
use clap::Args;
use resight::answer::Status;
use resight::zones::{ZoneOptions, move_zones, read_motion, read_zones};
use std::path::PathBuf;

/// Moves zones (masks, polygons) of a reference image to the present image of a camera that has rotated.
///
/// ZONES is TOML or JSON: a list `zone` of name and polygon_px, or of name and coordinates as Frigate writes them (x,y,x,y,… from 0 to 1). MOTION
/// is the output of `compare --json` (poses before and after), `landmarks --json` or `watch --json`. A rotation moves everything alike; a shift
/// moves near things more: a zone that it may displace by more than --limit-px is not moved, and the answer states from which distance on the
/// rotation explains the image.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight compare before.jsonl after.jsonl --json > motion.json
  resight zones zones.toml --camera camera.toml --motion motion.json --nearest-m 8 --write moved.toml")]
pub struct Zones {
    /// Zones as drawn on the reference image.
    #[arg(value_name = "ZONES")]
    zones: PathBuf,
    /// Camera file in any supported format; FILE#NAME picks one of several.
    #[arg(long, value_name = "FILE")]
    camera: String,
    /// How the camera moved: JSON Lines of `compare`, `landmarks` or `watch`, of which the last motion is taken.
    #[arg(long, value_name = "FILE")]
    motion: PathBuf,
    /// The camera or view of the motion, where the file holds several.
    #[arg(long, hide_short_help = true, value_name = "NAME")]
    name: Option<String>,
    /// Distance of the nearest thing in the zones that matters.
    #[arg(long, value_name = "M", allow_negative_numbers = true, value_parser = positive)]
    nearest_m: Option<f64>,
    /// By how much the camera may have shifted, one standard deviation along each axis; 0 where it turned about its own centre.
    ///
    /// A single target shows a rotation and a shift badly apart; what is known of the mount decides between them. A motion that contradicts it makes
    /// the zones inconsistent. [default: only the motion states it]
    #[arg(long, value_name = "MM", allow_negative_numbers = true, value_parser = not_negative)]
    shift_sigma_mm: Option<f64>,
    /// How far a moved zone may be off, with 95 % confidence.
    #[arg(long, value_name = "PX", default_value = "2", allow_negative_numbers = true, value_parser = positive)]
    limit_px: f64,
    /// Writes the moved zones in the format of ZONES, only if every zone is ok.
    #[arg(long, value_name = "FILE")]
    write: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

/// See `Zones`.
pub fn run(args: &Zones) -> Result<Outcome> {
    args.output.check()?;
    args.write.as_deref().map_or(Ok(()), crate::files::must_be_writable)?;
    crate::files::must_exist(&args.zones)?;
    crate::files::must_exist(&args.motion)?;
    let mut cameras = crate::camera::cameras_of(&args.camera)?;
    if cameras.len() != 1 {
        bail!("{} holds {} cameras; pick one: {}#NAME", args.camera, cameras.len(), args.camera);
    }
    let camera = cameras.swap_remove(0).camera;
    let zones = read_zones(&args.zones, camera.size)?;
    let motion = read_motion(&args.motion, args.name.as_deref())?;
    let options = ZoneOptions {
        limit_px: args.limit_px,
        nearest_m: args.nearest_m,
        shift_sigma_m: args.shift_sigma_mm.map(|mm| 1e-3 * mm),
    };
    let moved = move_zones(&zones, &camera, &motion, &options)?;
    let mut printer = Printer::new(&args.output, moved.answers.len());
    moved
        .remarks
        .iter()
        .for_each(|text| printer.remark(&format!("warning: {}: {text}", args.motion.display())));
    for answer in &moved.answers {
        let mut words =
            format!("{}   {}\n", answer.zone, answer.status.name().to_uppercase().replace('_', " "));
        crate::text::line(&mut words, "zone", &format!("{}.", answer.message));
        printer.result(answer, &words, answer.status)?;
    }
    match (&args.write, &moved.file) {
        (Some(path), Some(text)) => resight::formats::write_atomically(path, text.as_bytes())?,
        (Some(path), None) => {
            let n = moved.answers.iter().filter(|answer| answer.status != Status::Ok).count();
            printer.remark(&format!(
                "{} is not written: {n} of {} zones are not ok",
                path.display(),
                moved.answers.len()
            ));
        }
        (None, _) => {}
    }
    printer.finish()
}
