//! `detect`: where the target's points are in each image.

use crate::args::{CornerArgs, OutputArgs, TagArgs};
use crate::output::{Outcome, Printer};
use anyhow::Result;
use clap::Args;
use resight::GrayImage;
use resight::core::correspondence::Detection;
use resight::detect::Detector;
use resight::report::verdict::Status;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Finds the target in images: point names, pixels and their standard deviations.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  resight detect photos/*.png --target target.toml --json")]
pub struct Detect {
    /// PNG or JPEG images, or patterns such as 'photos/*.png'.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<String>,
    /// Target file: own TOML, Kalibr YAML or WPILib JSON.
    #[arg(long, value_name = "FILE")]
    target: PathBuf,
    #[command(flatten)]
    corners: CornerArgs,
    #[command(flatten)]
    tags: TagArgs,
    #[command(flatten)]
    output: OutputArgs,
}

#[derive(Serialize)]
struct Found {
    view: String,
    detections: Vec<DetectionObject>,
    #[serde(serialize_with = "crate::answer::status_name")]
    status: Status,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
}

#[derive(Serialize)]
struct DetectionObject {
    id: u32,
    corner: u8,
    u_px: f64,
    v_px: f64,
    sigma_px: f64,
    lens_sigma_px: f64,
}

impl From<&Detection> for DetectionObject {
    fn from(d: &Detection) -> Self {
        DetectionObject {
            id: d.feature.id,
            corner: d.feature.corner,
            u_px: d.pixel.x,
            v_px: d.pixel.y,
            sigma_px: d.sigma_px,
            lens_sigma_px: d.lens_sigma_px,
        }
    }
}

/// See `Detect`.
pub fn run(args: &Detect) -> Result<Outcome> {
    args.output.check()?;
    let images = crate::files::expand(&args.images)?;
    let mut printer = Printer::new(&args.output, images.len());
    let (target, _) = super::target(&args.target, &args.tags, |warning| printer.remark(warning))?;
    let work = |detector: &mut Detector, path: &PathBuf| detect(detector, path);
    super::detect_in_order(
        &images,
        || args.corners.detector(&target),
        work,
        |found: Found| printer.result(&found, &describe(&found), found.status),
    )?;
    printer.finish()
}

fn detect(detector: &mut Detector, path: &Path) -> Found {
    let view = view_name(path);
    let found = GrayImage::read(path)
        .map_err(|e| e.to_string())
        .and_then(|image| detector.detect(&image).map_err(|e| e.to_string()));
    match found {
        Err(reason) => Found { view, detections: Vec::new(), status: Status::Error, message: Some(reason) },
        Ok(detections) => {
            let detections: Vec<_> = detections.iter().map(DetectionObject::from).collect();
            let missing = detections.is_empty();
            let message = missing.then(|| "no target in this image".to_string());
            let status = if missing { Status::NotFound } else { Status::Ok };
            Found { view, detections, status, message }
        }
    }
}

fn describe(found: &Found) -> String {
    let mut out = match &found.message {
        Some(message) => format!("{}   {message}\n", found.view),
        None => format!("{}   {} points\n", found.view, found.detections.len()),
    };
    for d in &found.detections {
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "  id {:>4}  corner {}   u {:>9.3} px   v {:>9.3} px   ± {:.3} px",
            d.id, d.corner, d.u_px, d.v_px, d.sigma_px
        );
    }
    out
}

/// How an image is called in results: the path as given.
pub fn view_name(path: &Path) -> String {
    path.display().to_string()
}
