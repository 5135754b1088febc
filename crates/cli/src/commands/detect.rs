//! `detect`: where the target's points are in each image.

use crate::args::{CornerArgs, OutputArgs, TagArgs};
use crate::output::{Outcome, Printer};
use anyhow::Result;
use clap::Args;
use resight::GrayImage;
use resight::answer::DetectionAnswer;
use resight::detect::absent::Explainer;
use resight::detect::every_tag::EveryTagFinder;
use resight::detect::job::{detect_every_tag, detect_target, explain};
use resight::report::words::counted;
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
    /// Reads the target: own TOML, Kalibr YAML or WPILib JSON.
    #[arg(long, value_name = "FILE")]
    target: Option<PathBuf>,
    /// Finds every tag of this family (tag36h11, DICT_5X5_100, …) or of `any` family, instead of a target
    #[arg(long, value_name = "FAMILY", conflicts_with_all = ["target", "corner_window_px", "tag_family", "tag_size_m", "tag_sigma_m"])]
    family: Option<String>,
    #[command(flatten)]
    corners: CornerArgs,
    #[command(flatten)]
    tags: TagArgs,
    #[command(flatten)]
    output: OutputArgs,
}

/// See `Detect`.
pub fn run(args: &Detect) -> Result<Outcome> {
    args.output.check()?;
    let images = crate::files::expand(&args.images)?;
    let mut printer = Printer::new(&args.output, images.len());
    let print = |printer: &mut Printer, found: DetectionAnswer| {
        printer.result(&found, &describe(&found), found.status)
    };
    match (&args.family, &args.target) {
        (Some(family), _) => resight::parallel::detect_in_order(
            &images,
            || EveryTagFinder::new(family),
            |finder, path: &PathBuf| {
                of_image(path, |view, image| detect_every_tag(finder, family, view, image))
            },
            |found| print(&mut printer, found),
        )?,
        (None, Some(file)) => {
            let (target, _) = super::target(file, &args.tags, |warning| printer.remark(warning))?;
            let (mut explainer, mut paths) = (Explainer::default(), images.iter());
            resight::parallel::detect_in_order(
                &images,
                || args.corners.detector(&target),
                |detector, path: &PathBuf| {
                    of_image(path, |view, image| detect_target(detector, &target, view, image))
                },
                |mut found| {
                    let path = paths.next();
                    explain(&mut found, &target, &mut explainer, || GrayImage::read(path?).ok());
                    print(&mut printer, found)
                },
            )?;
        }
        (None, None) => anyhow::bail!("--target or --family is needed"),
    }
    printer.finish()
}

fn of_image(path: &Path, detect: impl FnOnce(&str, &GrayImage) -> DetectionAnswer) -> DetectionAnswer {
    let view = view_name(path);
    match GrayImage::read_with_remark(path) {
        Ok((image, remark)) => {
            let mut found = detect(&view, &image);
            found.remarks.extend(remark);
            found
        }
        Err(reason) => DetectionAnswer::error(view, reason.to_string()),
    }
}

fn describe(found: &DetectionAnswer) -> String {
    let mut out = match &found.message {
        Some(message) if found.detections.is_empty() => format!("{}   {message}\n", found.view),
        Some(message) => {
            let points = counted(found.detections.len(), "point");
            format!("{}   {}: {points}; {message}\n", found.view, found.status.name())
        }
        None => format!("{}   {}\n", found.view, counted(found.detections.len(), "point")),
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
