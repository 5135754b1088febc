//! Lenses of cameras without a file, for those that are watched by landmarks.

use anyhow::{Result, bail};
use clap::Args;
use resight::core::camera::ImageSize;
use resight::formats::NamedCamera;
use resight::image::exif;
use resight::input::{self, Kind};
use resight::nominal::NominalLens;
use resight_watch::live::WatchedLandmarks;
use resight_watch::names::{Names, by_name};
use resight_watch::source::{Source, size_of_first};
use std::time::Duration;

/// Time to wait for the first image of a camera whose lens follows from its size.
const FIRST_IMAGE: Duration = Duration::from_secs(30);

/// What is known of the lenses.
#[derive(Debug, Args)]
#[command(next_help_heading = "Camera without a file")]
pub struct LensArgs {
    /// Without a camera file: horizontal field of view, in degrees, of a camera that is watched by landmarks.
    ///
    /// Its rotation then holds in its ± how far such nominal figures are off. Without any flag the EXIF of the reference image of --landmarks is asked.
    #[arg(long, hide_short_help = true, value_name = "[NAME=]DEG")]
    hfov_deg: Vec<String>,
    /// Without a camera file: focal length in millimetres, with --sensor-width-mm.
    #[arg(long, hide_short_help = true, value_name = "[NAME=]MM", requires = "sensor_width_mm")]
    focal_mm: Vec<String>,
    /// Width of the part of the sensor that the images are of, in millimetres.
    #[arg(long, hide_short_help = true, value_name = "[NAME=]MM", requires = "focal_mm")]
    sensor_width_mm: Vec<String>,
}

impl LensArgs {
    /// The arguments that stand for a camera each.
    pub fn arguments(&self) -> impl Iterator<Item = &String> {
        self.hfov_deg.iter().chain(&self.focal_mm)
    }

    /// Returns the size of the images of a camera without a file: of its reference image or, before there is one, of its first frame, which
    /// the source still gives.
    pub fn image_size(
        &self,
        names: &Names,
        i: usize,
        landmarks: Option<&WatchedLandmarks>,
        source: Box<dyn Source>,
    ) -> Result<(ImageSize, Box<dyn Source>)> {
        let name = &names.cameras[i];
        let Some(landmarks) = landmarks else {
            bail!(
                "camera {name} has neither a camera file nor landmarks; give --camera {name}=FILE, or --landmarks {name}=IMAGE or --save-landmarks {name}=IMAGE"
            )
        };
        if let Some(image) = &landmarks.reference_image {
            return Ok((ImageSize { width_px: image.width_px, height_px: image.height_px }, source));
        }
        if self.given(names, i)?.is_none() {
            bail!(
                "camera {name} has neither a camera file nor an angle of view; give --camera {name}=FILE, or --hfov-deg {name}=DEG"
            );
        }
        size_of_first(source, FIRST_IMAGE)
            .map_err(|reason| anyhow::anyhow!("--source of camera {name}: {reason}"))
    }

    /// Returns the camera of a name that has no file.
    pub fn camera(
        &self,
        names: &Names,
        i: usize,
        size: ImageSize,
        picture: Option<&str>,
    ) -> Result<NamedCamera> {
        let name = &names.cameras[i];
        let lens = match self.given(names, i)? {
            Some(lens) => lens,
            None => {
                let bytes = picture.map(|file| input::read(file, Kind::Image)).transpose()?;
                match bytes.and_then(|bytes| exif::lens(&bytes)) {
                    Some(lens) => NominalLens::Exif(lens),
                    None => bail!(
                        "camera {name}: the EXIF of its reference image names no focal length; give --camera {name}=FILE, or --hfov-deg {name}=DEG"
                    ),
                }
            }
        };
        let camera = lens.camera(size)?;
        crate::output::remark(&format!("warning: camera {name}: {}", lens.remark()));
        Ok(camera)
    }

    fn given(&self, names: &Names, i: usize) -> Result<Option<NominalLens>> {
        let number = |flag: &str, arguments: &[String]| -> Result<Option<f64>> {
            let values = by_name(flag, arguments, &names.cameras)?;
            let Some(text) = &values[i] else { return Ok(None) };
            match crate::args::positive(text) {
                Ok(x) => Ok(Some(x)),
                Err(reason) => bail!("{flag} {}={text}: {reason}", names.cameras[i]),
            }
        };
        let angle = number("--hfov-deg", &self.hfov_deg)?;
        let lengths =
            (number("--focal-mm", &self.focal_mm)?, number("--sensor-width-mm", &self.sensor_width_mm)?);
        Ok(match (angle, lengths) {
            (Some(deg), (None, None)) => Some(NominalLens::HorizontalFieldOfView(deg)),
            (None, (Some(focal_mm), Some(sensor_width_mm))) => {
                Some(NominalLens::FocalLength { focal_mm, sensor_width_mm })
            }
            (None, (None, None)) => None,
            _ => bail!(
                "camera {}: either --hfov-deg, or --focal-mm and --sensor-width-mm are needed",
                names.cameras[i]
            ),
        })
    }
}
