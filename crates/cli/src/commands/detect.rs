//! `detect`: where the target's points are in each image.

use crate::args::{CornerArgs, OutputArgs, TagArgs};
use crate::output::{Outcome, Printer};
use anyhow::Result;
use clap::Args;
use resight::GrayImage;
use resight::core::Target;
use resight::core::correspondence::Detection;
use resight::detect::every_tag::{EveryTagFinder, FamilyTags};
use resight::detect::tags::FoundTag;
use resight::detect::{Detector, absent};
use resight::report::verdict::Status;
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Finds the target in images, or every tag of a family: names, pixels and their standard deviations.
#[derive(Debug, Args)]
#[command(group = clap::ArgGroup::new("looked for").required(true).args(["target", "family"]))]
#[command(
    after_help = "Examples:\n  resight detect photos/*.png --target target.toml --json\n  resight detect photo.jpg --family any"
)]
pub struct Detect {
    /// PNG or JPEG images, or patterns such as 'photos/*.png'.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<String>,
    /// Target file: own TOML, Kalibr YAML or WPILib JSON.
    #[arg(long, value_name = "FILE")]
    target: Option<PathBuf>,
    /// Instead of a target: every tag of this family (tag36h11, DICT_5X5_100, …), or of `any` family
    #[arg(long, value_name = "FAMILY", conflicts_with_all = ["target", "corner_window_px", "tag_family", "tag_size_m", "tag_sigma_m"])]
    family: Option<String>,
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
    #[serde(serialize_with = "resight::answer::pose::status_name")]
    status: Status,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    remarks: Vec<String>,
}

#[derive(Serialize)]
struct DetectionObject {
    /// Where tags of any family were asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    family: Option<String>,
    id: u32,
    corner: u8,
    u_px: f64,
    v_px: f64,
    sigma_px: f64,
    lens_sigma_px: f64,
}

impl DetectionObject {
    fn new(d: &Detection, family: Option<&str>) -> Self {
        DetectionObject {
            family: family.map(str::to_owned),
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
    let print = |printer: &mut Printer, found: Found| printer.result(&found, &describe(&found), found.status);
    match (&args.family, &args.target) {
        (Some(family), _) => resight::parallel::detect_in_order(
            &images,
            || EveryTagFinder::new(family),
            |finder, path: &PathBuf| every_tag(finder, family, path),
            |found| print(&mut printer, found),
        )?,
        (None, Some(file)) => {
            let (target, _) = super::target(file, &args.tags, |warning| printer.remark(warning))?;
            resight::parallel::detect_in_order(
                &images,
                || args.corners.detector(&target),
                |detector, path: &PathBuf| detect(detector, &target, path),
                |found| print(&mut printer, found),
            )?;
        }
        (None, None) => anyhow::bail!("--target or --family is needed"),
    }
    printer.finish()
}

fn detect(detector: &mut Detector, target: &Target, path: &Path) -> Found {
    let view = view_name(path);
    let found = GrayImage::read(path).map_err(|e| e.to_string()).and_then(|image| {
        let detections = detector.detect(&image).map_err(|e| e.to_string())?;
        let message = detections.is_empty().then(|| absent::not_found(target, &image));
        Ok((detections, message))
    });
    match found {
        Err(reason) => Found::error(view, reason),
        Ok((detections, message)) => {
            let detections = detections.iter().map(|d| DetectionObject::new(d, None)).collect();
            Found::new(view, detections, message, detector.remarks().collect())
        }
    }
}

fn every_tag(finder: &mut EveryTagFinder, family: &str, path: &Path) -> Found {
    let view = view_name(path);
    let families = match GrayImage::read(path) {
        Ok(image) => finder.find(&image),
        Err(reason) => return Found::error(view, reason.to_string()),
    };
    let of = |found: &FamilyTags| -> Vec<DetectionObject> {
        let corners = found.tags.iter().flat_map(FoundTag::detections);
        corners.map(|d| DetectionObject::new(&d, Some(&found.family))).collect()
    };
    let detections: Vec<DetectionObject> = families.iter().flat_map(of).collect();
    let of = if family == "any" { "of any known family" } else { family };
    let message = detections.is_empty().then(|| format!("no tag {of} in this image"));
    Found::new(view, detections, message, Vec::new())
}

impl Found {
    fn error(view: String, reason: String) -> Self {
        Found {
            view,
            detections: Vec::new(),
            status: Status::Error,
            message: Some(reason),
            remarks: Vec::new(),
        }
    }

    /// A message where nothing was found.
    fn new(
        view: String,
        detections: Vec<DetectionObject>,
        message: Option<String>,
        remarks: Vec<String>,
    ) -> Self {
        let status = if message.is_some() { Status::NotFound } else { Status::Ok };
        Found { view, detections, status, message, remarks }
    }
}

fn describe(found: &Found) -> String {
    let mut out = match &found.message {
        Some(message) => format!("{}   {message}\n", found.view),
        None => format!("{}   {} points\n", found.view, found.detections.len()),
    };
    for remark in &found.remarks {
        out += &format!("  {remark}\n");
    }
    for d in &found.detections {
        let family = d.family.as_ref().map(|family| format!("{family}  ")).unwrap_or_default();
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "  {family}id {:>4}  corner {}   u {:>9.3} px   v {:>9.3} px   ± {:.3} px",
            d.id, d.corner, d.u_px, d.v_px, d.sigma_px
        );
    }
    out
}

/// How an image is called in results: the path as given.
pub fn view_name(path: &Path) -> String {
    path.display().to_string()
}
