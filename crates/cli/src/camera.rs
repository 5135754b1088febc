//! The camera of the commands that take one: its file, or what is known of its lens.

use crate::args::{parse_size, positive};
use anyhow::{Result, bail};
use clap::Args;
use resight::core::Camera;
use resight::core::camera::ImageSize;
use resight::formats::{self, NamedCamera};
use resight::image::exif::{self, ExifLens};
use resight::input::{self, Kind};
use resight::locate::{IntrinsicsCovariance, Method};
use resight::nominal::NominalLens;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Where the intrinsics come from, and how well they are known.
#[derive(Debug, Clone, Args)]
pub struct CameraArgs {
    /// Camera file in any supported format; FILE#NAME picks one of several.
    ///
    /// Without one, the lens is taken from --hfov-deg, from --focal-mm and --sensor-width-mm, or from the EXIF of the images; every ± then
    /// holds how far such nominal figures are off.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["hfov_deg", "focal_mm"])]
    camera: Option<String>,
    /// Without a camera file: horizontal field of view of the lens, in degrees.
    #[arg(long, value_name = "DEG", conflicts_with = "focal_mm", allow_negative_numbers = true, value_parser = positive)]
    hfov_deg: Option<f64>,
    /// Without a camera file: focal length of the lens, with --sensor-width-mm.
    #[arg(long, hide_short_help = true, help_heading = "Camera without a file", value_name = "MM", requires = "sensor_width_mm", allow_negative_numbers = true, value_parser = positive)]
    focal_mm: Option<f64>,
    /// Width of the part of the sensor that the images are of.
    #[arg(long, hide_short_help = true, help_heading = "Camera without a file", value_name = "MM", requires = "focal_mm", allow_negative_numbers = true, value_parser = positive)]
    sensor_width_mm: Option<f64>,
    /// Standard deviations of the camera's parameters, in place of those of its file.
    ///
    /// They widen the covariance. For example fx_px=0.8,fy_px=0.8,cx_px=0.5,cy_px=0.5. They are independent of one another; parameters that
    /// are not named are exact.
    #[arg(long, hide_short_help = true, help_heading = "Noise", value_name = "NAME=S,…", value_delimiter = ',', value_parser = assignment)]
    intrinsics_sigma: Vec<(String, f64)>,
}

/// For points in a file, which have no image that would say its size.
#[derive(Debug, Clone, Args)]
pub struct ImageSizeArgs {
    /// Size of the images that the pixels are of.
    #[arg(long, hide_short_help = true, help_heading = "Camera without a file", value_name = "WIDTHxHEIGHT", value_parser = parse_size)]
    pub image_size_px: Option<(u32, u32)>,
}

/// A camera, and what is to be said of it.
pub struct GivenCamera {
    /// Lens and image size.
    pub camera: Camera,
    /// How well its intrinsics are known; none: exactly.
    pub intrinsics: Option<IntrinsicsCovariance>,
    /// That it is not calibrated, say, or what is unusual about its file.
    pub remarks: Vec<String>,
}

/// All cameras of a file, or the one of `FILE#NAME`; what is unusual about the file is printed.
pub fn cameras_of(argument: &str) -> Result<Vec<NamedCamera>> {
    crate::files::camera_must_exist(argument)?;
    let (cameras, remarks) = match Path::new(argument).exists() {
        true => {
            let read = formats::read_cameras(Path::new(argument))?;
            let remarks = read.warnings.iter().map(|warning| format!("{argument}: {warning}")).collect();
            (read.cameras, remarks)
        }
        false => {
            let (camera, remarks) = formats::read_camera_with_remarks(argument)?;
            (vec![camera], remarks)
        }
    };
    remarks.iter().for_each(|text: &String| crate::output::remark(&format!("warning: {text}")));
    Ok(cameras)
}

impl GivenCamera {
    /// Nothing is known of the camera; its rays stand for none.
    pub fn of_unknown_focal(method: Method) -> Result<Self> {
        if method != Method::Auto {
            bail!("--estimate-focal has a method of its own; leave out --method");
        }
        Ok(GivenCamera { camera: Camera::normalized(), intrinsics: None, remarks: Vec::new() })
    }
}

impl CameraArgs {
    /// Whether standard deviations were given.
    pub fn has_sigma(&self) -> bool {
        !self.intrinsics_sigma.is_empty()
    }

    /// The camera of these images; without a file their size is that of the first.
    pub fn of_images(&self, images: &[PathBuf], method: Method) -> Result<GivenCamera> {
        if self.camera.is_some() {
            return self.of_size(None, method);
        }
        let [first, ..] = images else { bail!("no image is given") };
        let lens = match self.lens() {
            Some(lens) => lens,
            None => NominalLens::Exif(exif_lens(images)?),
        };
        let (width_px, height_px) = resight::image::size(first)?;
        self.given(lens.camera(ImageSize { width_px, height_px })?, Some(lens.remark()), method)
    }

    /// The camera of pixels in a file, whose image size is given where it is known.
    pub fn of_size(&self, size_px: Option<(u32, u32)>, method: Method) -> Result<GivenCamera> {
        if let Some(file) = &self.camera {
            crate::files::camera_must_exist(file)?;
            let (camera, remarks) = formats::read_camera_with_remarks(file)?;
            return Ok(GivenCamera { remarks, ..self.given(camera, None, method)? });
        }
        let Some(lens) = self.lens() else {
            bail!(
                "no camera is given; give --camera FILE, or what is known of its lens: --hfov-deg, or --focal-mm and --sensor-width-mm"
            )
        };
        let Some((width_px, height_px)) = size_px else {
            bail!(
                "the pixels of a camera without a file need --image-size-px WIDTHxHEIGHT, the size of the images they are of"
            )
        };
        self.given(lens.camera(ImageSize { width_px, height_px })?, Some(lens.remark()), method)
    }

    fn lens(&self) -> Option<NominalLens> {
        let by_angle = self.hfov_deg.map(NominalLens::HorizontalFieldOfView);
        let by_length = self.focal_mm.zip(self.sensor_width_mm);
        by_angle.or(by_length
            .map(|(focal_mm, sensor_width_mm)| NominalLens::FocalLength { focal_mm, sensor_width_mm }))
    }

    fn given(&self, camera: NamedCamera, remark: Option<String>, method: Method) -> Result<GivenCamera> {
        let intrinsics = match self.sigmas(&camera.camera)? {
            Some(stated) => Some(stated),
            None => IntrinsicsCovariance::of(&camera),
        };
        let is_printed_procedure = method == Method::Wang2004;
        if is_printed_procedure && (self.has_sigma() || remark.is_some()) {
            bail!(
                "method wang2004 is the printed procedure, which carries no uncertainty of the intrinsics; use auto"
            );
        }
        let intrinsics = intrinsics.filter(|_| !is_printed_procedure);
        Ok(GivenCamera { camera: camera.camera, intrinsics, remarks: remark.into_iter().collect() })
    }

    fn sigmas(&self, camera: &Camera) -> Result<Option<IntrinsicsCovariance>> {
        if !self.has_sigma() {
            return Ok(None);
        }
        let known: Vec<&str> = camera.parameters().iter().map(|(name, _)| *name).collect();
        let mut by_name = BTreeMap::new();
        for (name, sigma) in &self.intrinsics_sigma {
            if !known.contains(&name.as_str()) {
                let known = known.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
                let kind = format!("{} parameter", camera.model_name());
                bail!("--intrinsics-sigma: {}", input::not_among(name, &kind, &known));
            }
            if by_name.insert(name.clone(), *sigma).is_some() {
                bail!("--intrinsics-sigma: `{name}` is given twice");
            }
        }
        Ok(Some(IntrinsicsCovariance::independent(&by_name, camera)?))
    }
}

/// The one lens of all these photographs.
fn exif_lens(images: &[PathBuf]) -> Result<ExifLens> {
    let lens = |path: &Path| -> Result<Option<ExifLens>> { Ok(exif::lens(&input::read(path, Kind::Image)?)) };
    let way_out =
        "give --camera FILE, or what is known of its lens: --hfov-deg, or --focal-mm and --sensor-width-mm";
    let [first, rest @ ..] = images else { bail!("no image is given") };
    let Some(found) = lens(first)? else {
        bail!("no camera is given, and the EXIF of {} names no focal length; {way_out}", first.display())
    };
    for image in rest {
        match lens(image)? {
            Some(other) if other == found => {}
            Some(other) => bail!(
                "{} was taken at {} mm (35 mm film), {} at {} mm: they are not of one lens; locate them one by one, or {way_out}",
                first.display(),
                found.focal_35mm,
                image.display(),
                other.focal_35mm
            ),
            None => bail!("the EXIF of {} names no focal length; {way_out}", image.display()),
        }
    }
    Ok(found)
}

fn assignment(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("NAME=S is needed, e.g. fx_px=0.8")?;
    match value.trim().parse::<f64>() {
        Ok(sigma) if 0.0 <= sigma && sigma.is_finite() => Ok((name.trim().to_string(), sigma)),
        _ => Err(format!("`{}` is no standard deviation; a number of 0 or more is needed", value.trim())),
    }
}
