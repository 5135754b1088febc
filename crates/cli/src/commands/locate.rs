//! `locate`: from images to poses.

use crate::args::{CornerArgs, OutputArgs, TagArgs, parse_method};
use crate::camera::{CameraArgs, GivenCamera};
use crate::output::{Outcome, Printer};
use anyhow::Result;
use clap::Args;
use resight::core::Target;
use resight::detect::absent::Explainer;
use resight::locate::{ImageLocator, LocateOptions, Located, Method, explain};
use resight::{GrayImage, PoseAnswer};
use std::path::{Path, PathBuf};

/// Finds the target in images and prints the pose of the camera for each.
///
/// Every pose has its covariance, and a status that states whether another pose fits as well and whether the residuals agree with the noise.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  resight locate photos/*.png --camera camera.toml --target target.toml --overlay images\n  \
        resight locate field.jpg --camera camera.yml --target 2023-chargedup.json --tag-family tag16h5 --tag-size-m 0.1524"
)]
pub struct Locate {
    /// PNG or JPEG images, or patterns such as 'photos/*.png'.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<String>,
    #[command(flatten)]
    camera: CameraArgs,
    /// Target file: own TOML, Kalibr YAML or WPILib JSON.
    #[arg(long, value_name = "FILE")]
    target: PathBuf,
    /// Draws each answer over its photograph into this folder (PNG).
    #[arg(long, value_name = "DIR")]
    overlay: Option<PathBuf>,
    /// Solver: auto, wang2004, line_plus_one, p3p, planar or sqpnp.
    #[arg(long, default_value = "auto", value_parser = parse_method)]
    method: Method,
    /// Without a camera: estimates the focal length of each image with the pose.
    ///
    /// The target must be tilted, or have points off a plane. The lens is taken as one of square pixels with the principal point in the
    /// middle and little distortion, each as uncertain as such lenses are; every ± holds that.
    #[arg(long, conflicts_with_all = ["camera", "hfov_deg", "focal_mm", "intrinsics_sigma"])]
    estimate_focal: bool,
    #[command(flatten)]
    corners: CornerArgs,
    #[command(flatten)]
    tags: TagArgs,
    #[command(flatten)]
    output: OutputArgs,
}

/// See `Locate`.
pub fn run(args: &Locate) -> Result<Outcome> {
    args.output.check()?;
    let images = crate::files::expand(&args.images)?;
    let GivenCamera { camera, intrinsics, remarks: of_camera } = match args.estimate_focal {
        true => GivenCamera::of_unknown_focal(args.method)?,
        false => args.camera.of_images(&images, args.method)?,
    };
    let mut printer = Printer::new(&args.output, images.len());
    let (target, mut remarks) = super::target(&args.target, &args.tags, |warning| printer.remark(warning))?;
    of_camera.iter().for_each(|remark| printer.remark(&format!("warning: {remark}")));
    remarks.extend(of_camera);
    let pictures = args.overlay.as_deref().map(|folder| picture_paths(folder, &images)).transpose()?;
    let jobs: Vec<(PathBuf, Option<PathBuf>)> = images
        .into_iter()
        .enumerate()
        .map(|(i, image)| (image, pictures.as_ref().and_then(|p| p.get(i).cloned())))
        .collect();
    let corner_window = args.corners.window();
    let options =
        LocateOptions { method: args.method, intrinsics, corner_window, estimate_focal: args.estimate_focal };
    let work =
        |locator: &mut ImageLocator, (path, picture): &(PathBuf, Option<PathBuf>)| -> Result<PoseAnswer> {
            let seen = LocatedImage::look(locator, path);
            if let (Some(picture), Some(image)) = (picture, &seen.image) {
                resight::formats::write_atomically(picture, &seen.png(image, &target)?)?;
            }
            Ok(seen.located.answer)
        };
    let (mut explainer, mut paths) = (Explainer::default(), jobs.iter());
    resight::parallel::detect_in_order(
        &jobs,
        || ImageLocator::new(&camera, &target, &options),
        work,
        |answer| {
            let (mut answer, path) = (answer?, paths.next());
            explain(&mut answer, &target, &mut explainer, || GrayImage::read(&path?.0).ok());
            let words = crate::text::describe(&answer);
            // Remarks about the files have been printed once; here they stand before those about the view.
            answer.remarks.splice(..0, remarks.iter().cloned());
            printer.result(&answer, &words, answer.status())
        },
    )?;
    printer.finish()
}

/// Where each overlay goes: the image's name with `.png`, numbered where two images share a name.
pub(super) fn picture_paths(folder: &Path, images: &[PathBuf]) -> Result<Vec<PathBuf>> {
    crate::files::make_folder("--overlay", folder)?;
    let mut taken = std::collections::HashSet::new();
    let mut path_for = |image: &PathBuf| {
        let stem = image.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mut name = format!("{stem}.png");
        let mut n = 1;
        while !taken.insert(name.clone()) {
            n += 1;
            name = format!("{stem}-{n}.png");
        }
        folder.join(name)
    };
    Ok(images.iter().map(&mut path_for).collect())
}

/// One image, looked at.
pub struct LocatedImage {
    /// The image, when it could be read.
    pub image: Option<GrayImage>,
    /// What was found, and what it means.
    pub located: Located,
}

impl LocatedImage {
    /// Reads an image and answers.
    pub fn look(locator: &mut ImageLocator, path: &Path) -> Self {
        let view = super::detect::view_name(path);
        match GrayImage::read_with_remark(path) {
            Ok((image, remark)) => {
                let mut located = locator.locate(&image, view);
                located.answer.remarks.extend(remark);
                LocatedImage { located, image: Some(image) }
            }
            Err(reason) => LocatedImage { image: None, located: Located::error(view, reason.to_string()) },
        }
    }

    /// The answer drawn over the photograph, as PNG.
    pub fn png(&self, image: &GrayImage, target: &Target) -> Result<Vec<u8>> {
        let view = &self.located.answer.view;
        let title = Path::new(view).file_name().unwrap_or_default().to_string_lossy().into_owned();
        self.located.overlay_png(image, target, &title).map_err(|reason| anyhow::anyhow!("{view}: {reason}"))
    }
}
