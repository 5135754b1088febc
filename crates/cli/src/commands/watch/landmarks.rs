//! Natural landmarks: reference images read.

use anyhow::{Result, bail};
use clap::Args;
use resight::GrayImage;
use resight_watch::live::WatchedLandmarks;
use resight_watch::names::{Names, by_name};
use std::path::Path;

/// The landmarks.
#[derive(Debug, Args)]
#[command(next_help_heading = "Landmarks")]
pub struct LandmarkArgs {
    /// Reference image of a camera: while it sees no target, its rotation since then is watched.
    ///
    /// PNG or JPEG.
    #[arg(long, help_heading = None, value_name = "[NAME=]FILE")]
    landmarks: Vec<String>,
    /// Takes the first image that shows enough as the reference image and writes it to this PNG file.
    ///
    /// A file that is there already is not overwritten but is the reference image; remove it to take another.
    #[arg(long, hide_short_help = true, value_name = "[NAME=]FILE")]
    save_landmarks: Vec<String>,
}

impl LandmarkArgs {
    /// The arguments with a reference image.
    pub fn images(&self) -> &[String] {
        &self.landmarks
    }

    /// How many cameras have them.
    pub fn count(&self) -> usize {
        self.landmarks.len() + self.save_landmarks.len()
    }

    /// Those of each camera.
    pub fn read(&self, names: &Names) -> Result<Vec<Option<WatchedLandmarks>>> {
        let pictures = by_name("--landmarks", &self.landmarks, &names.cameras)?;
        let saved = self.saved(names)?;
        let watched = |((reference_image, saved), name): ((Option<String>, &Option<String>), &String)| match (
            reference_image,
            saved,
        ) {
            (Some(_), Some(_)) => {
                bail!("camera {name}: --landmarks and --save-landmarks are both given; one is needed")
            }
            (Some(file), None) => {
                let reference_image = GrayImage::read(Path::new(&file))?;
                Ok(Some(WatchedLandmarks { reference_image: Some(reference_image) }))
            }
            // Taken anew at each restart it would be an image from after whatever happened in between.
            (None, Some(file)) => {
                let file = Path::new(file);
                let reference_image = file.exists().then(|| GrayImage::read(file)).transpose()?;
                Ok(Some(WatchedLandmarks { reference_image }))
            }
            (None, None) => Ok(None),
        };
        pictures.into_iter().zip(&saved).zip(&names.cameras).map(watched).collect()
    }

    /// The file of a camera's reference image.
    pub fn file(&self, names: &Names, camera: usize) -> Option<String> {
        by_name("--landmarks", &self.landmarks, &names.cameras).ok()?.get(camera)?.clone()
    }

    /// Where each camera's reference image is written.
    pub fn saved(&self, names: &Names) -> Result<Vec<Option<String>>> {
        by_name("--save-landmarks", &self.save_landmarks, &names.cameras)
    }
}
