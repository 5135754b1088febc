//! `landmarks`: how a camera turned since a reference picture, picture by picture.

use super::locate::picture_paths;
use crate::args::OutputArgs;
use crate::output::{Outcome, Printer};
use crate::turned;
use anyhow::{Context, Result};
use clap::Args;
use resight::GrayImage;
use resight::landmarks::{Landmarks as Reference, Sighting};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// How a camera turned since a reference picture: far scenes, or cameras that only turn about their own centre.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  resight landmarks reference.png night/*.png --camera camera.toml --overlay drawn"
)]
pub struct Landmarks {
    /// The picture (PNG or JPEG) with which the others are compared.
    #[arg(value_name = "REFERENCE")]
    reference: PathBuf,
    /// PNG or JPEG images, or patterns such as 'night/*.png'.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<String>,
    /// Camera file in any supported format.
    #[arg(long, value_name = "FILE")]
    camera: String,
    /// Draw the landmarks of each picture into this folder: green lines from where they were, red ones disagree.
    #[arg(long, value_name = "DIR")]
    overlay: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

/// What one picture said.
struct Compared {
    view: String,
    seen: Result<(GrayImage, Sighting), String>,
}

/// See `Landmarks`.
pub fn run(args: &Landmarks) -> Result<Outcome> {
    args.output.check()?;
    let images = crate::files::expand(&args.images)?;
    let drawn = args.overlay.as_deref().map(|folder| picture_paths(folder, &images)).transpose()?;
    let mut drawn = drawn.unwrap_or_default().into_iter();
    let mut printer = Printer::new(&args.output, images.len());
    let camera = super::camera(&args.camera)?;
    let picture = GrayImage::read(&args.reference)?;
    let reference =
        Reference::new(&picture, &camera).with_context(|| args.reference.display().to_string())?;
    super::in_order(
        &images,
        |path| compared(&reference, path),
        |compared: Compared| {
            if let Some(file) = drawn.next() {
                compared.draw(&file)?;
            }
            printer.result(&compared.object(), &compared.words(), compared.seen.is_ok())
        },
    )?;
    printer.finish()
}

fn compared(reference: &Reference, path: &Path) -> Compared {
    let sight = |image: GrayImage| {
        let sighting = reference.sight(&image, None).map_err(|e| e.to_string())?;
        Ok((image, sighting))
    };
    let seen = GrayImage::read(path).map_err(|e| e.to_string()).and_then(sight);
    Compared { view: path.display().to_string(), seen }
}

impl Compared {
    fn words(&self) -> String {
        match &self.seen {
            Ok((_, sighting)) => format!("{}\n  {}\n", self.view, turned::words(sighting)),
            Err(reason) => format!("{}\n  {reason}\n", self.view),
        }
    }

    fn object(&self) -> Value {
        let mut object = json!({"view": self.view});
        match &self.seen {
            Ok((_, sighting)) => turned::add_to(&mut object, sighting),
            Err(reason) => object["message"] = json!(reason),
        }
        object
    }

    fn draw(&self, file: &Path) -> Result<()> {
        let Ok((image, sighting)) = &self.seen else { return Ok(()) };
        let png = resight::landmarks::draw(image, sighting)
            .png()
            .map_err(|reason| anyhow::anyhow!("{}: {reason}", file.display()))?;
        Ok(resight::formats::write_atomically(file, &png)?)
    }
}
