//! `landmarks`: how a camera rotated since a reference image, image by image.

use super::locate::picture_paths;
use crate::args::OutputArgs;
use crate::camera::CameraArgs;
use crate::output::{Outcome, Printer};
use anyhow::{Context, Result};
use clap::Args;
use resight::GrayImage;
use resight::answer::SchemaNumber;
use resight::answer::landmarks::{LandmarksAnswer, RotationObject};
use resight::landmarks::{LandmarkObservation, Landmarks as Reference, NotObserved};
use resight::locate::Method;
use resight::report::turned;
use resight::report::verdict::Status;
use std::path::{Path, PathBuf};

/// Measures how a camera has rotated since a reference image, without any target.
///
/// The scene must be far away, or the camera must rotate about its own centre only.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  resight landmarks reference.png night/*.png --camera camera.toml --overlay drawn"
)]
pub struct Landmarks {
    /// The image (PNG or JPEG) with which the others are compared.
    #[arg(value_name = "REFERENCE")]
    reference: PathBuf,
    /// PNG or JPEG images, or patterns such as 'night/*.png'.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<String>,
    #[command(flatten)]
    camera: CameraArgs,
    /// Draws the landmarks of each image into this folder: green lines start where they were, red ones disagree.
    #[arg(long, value_name = "DIR")]
    overlay: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

/// What one image said.
struct Compared {
    view: String,
    seen: Result<LandmarkObservation, (Status, String)>,
}

/// See `Landmarks`.
pub fn run(args: &Landmarks) -> Result<Outcome> {
    args.output.check()?;
    let images = crate::files::expand(&args.images)?;
    let drawn = args.overlay.as_deref().map(|folder| picture_paths(folder, &images)).transpose()?;
    let mut printer = Printer::new(&args.output, images.len());
    let given = args.camera.of_images(std::slice::from_ref(&args.reference), Method::Auto)?;
    given.remarks.iter().for_each(|remark| printer.remark(&format!("warning: {remark}")));
    let camera = given.camera;
    let picture = GrayImage::read(&args.reference)?;
    let reference =
        Reference::new(&picture, &camera).with_context(|| args.reference.display().to_string())?;
    let reference = reference.with_intrinsics(given.intrinsics);
    let drawn = |i: usize| drawn.as_ref().and_then(|drawn| drawn.get(i).cloned());
    let jobs: Vec<(PathBuf, Option<PathBuf>)> =
        images.into_iter().enumerate().map(|(i, image)| (image, drawn(i))).collect();
    resight::parallel::in_order(
        &jobs,
        |(image, drawn)| compared(&reference, image, drawn.as_deref()),
        |compared: Result<Compared>| {
            let compared = compared?;
            printer.result(&compared.answer(), &compared.words(), compared.status())
        },
    )?;
    printer.finish()
}

/// Also draws it: images of a whole night do not wait in memory for their turn to be reported.
fn compared(reference: &Reference, path: &Path, drawn: Option<&Path>) -> Result<Compared> {
    let view = path.display().to_string();
    let image = match GrayImage::read(path) {
        Ok(image) => image,
        Err(reason) => return Ok(Compared { view, seen: Err((Status::Error, reason.to_string())) }),
    };
    let seen = reference.observe(&image, None).map_err(|reason| {
        let is_other_size = matches!(reason, NotObserved::Size { .. });
        (if is_other_size { Status::Error } else { Status::NotFound }, reason.to_string())
    });
    if let (Some(file), Ok(landmark_observation)) = (drawn, &seen) {
        draw(&image, landmark_observation, file)?;
    }
    Ok(Compared { view, seen })
}

fn draw(image: &GrayImage, landmark_observation: &LandmarkObservation, file: &Path) -> Result<()> {
    let png = resight::landmarks::draw(image, landmark_observation)
        .png()
        .map_err(|reason| anyhow::anyhow!("{}: {reason}", file.display()))?;
    Ok(resight::formats::write_atomically(file, &png)?)
}

impl Compared {
    /// A rotation that most landmarks contradict is shown, but not to be used.
    fn status(&self) -> Status {
        match &self.seen {
            Ok(landmark_observation) if landmark_observation.relative_rotation.is_consistent() => Status::Ok,
            Ok(_) => Status::Inconsistent,
            Err((status, _)) => *status,
        }
    }

    fn words(&self) -> String {
        match &self.seen {
            Ok(landmark_observation) => format!("{}\n  {}\n", self.view, turned::words(landmark_observation)),
            Err((_, reason)) => format!("{}\n  {reason}\n", self.view),
        }
    }

    fn answer(&self) -> LandmarksAnswer {
        LandmarksAnswer {
            schema: SchemaNumber,
            view: self.view.clone(),
            status: self.status(),
            rotation: self.seen.as_ref().ok().map(RotationObject::from),
            message: self.seen.as_ref().err().map(|(_, reason)| reason.clone()),
        }
    }
}
