//! `locate`: from images to poses.

use crate::answer::Answer;
use crate::args::{CornerArgs, OutputArgs, TagArgs, parse_method};
use crate::intrinsics::{IntrinsicsArgs, IntrinsicsSigma};
use crate::output::{Outcome, Printer};
use anyhow::Result;
use clap::Args;
use resight::GrayImage;
use resight::core::correspondence::{Detection, Skipped};
use resight::core::locate::{Config, Method};
use resight::core::observability::Observability;
use resight::core::tag_map::locate_target;
use resight::core::target::Feature;
use resight::core::{Camera, Correspondence, Target};
use resight::detect::Detector;
use resight::detect::absent;
use resight::overlay::{self, Tone};
use resight::report::verdict::{self, Status};
use std::path::{Path, PathBuf};

/// Finds the target in each image and says where the camera was, how sure that is, and whether another pose fits.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  resight locate photos/*.png --camera camera.toml --target target.toml --overlay pictures\n  \
        resight locate field.jpg --camera camera.yml --target 2023-chargedup.json --tag-family tag16h5 --tag-size-m 0.1524"
)]
pub struct Locate {
    /// PNG or JPEG images, or patterns such as 'photos/*.png'.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<String>,
    /// Camera file in any supported format; FILE#NAME picks one of several.
    #[arg(long, value_name = "FILE")]
    camera: String,
    /// Target file: own TOML, Kalibr YAML or WPILib JSON.
    #[arg(long, value_name = "FILE")]
    target: PathBuf,
    /// Draws each answer over its photograph into this folder (PNG).
    #[arg(long, value_name = "DIR")]
    overlay: Option<PathBuf>,
    /// auto, wang2004, line_plus_one, p3p, planar or sqpnp.
    #[arg(long, default_value = "auto", value_parser = parse_method)]
    method: Method,
    #[command(flatten)]
    intrinsics: IntrinsicsArgs,
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
    let camera = super::camera(&args.camera)?;
    let intrinsics = args.intrinsics.check(&camera, args.method)?;
    let mut printer = Printer::new(&args.output, images.len());
    let (target, remarks) = super::target(&args.target, &args.tags, |warning| printer.remark(warning))?;
    let pictures = args.overlay.as_deref().map(|folder| picture_paths(folder, &images)).transpose()?;
    let jobs: Vec<(PathBuf, Option<PathBuf>)> = images
        .into_iter()
        .enumerate()
        .map(|(i, image)| (image, pictures.as_ref().and_then(|p| p.get(i).cloned())))
        .collect();
    let sight =
        Sight { camera: &camera, target: &target, method: args.method, intrinsics, remarks: &remarks };
    let work = |detector: &mut Detector, (image, picture): &(PathBuf, Option<PathBuf>)| -> Result<Answer> {
        let view = sight.look(detector, image);
        if let (Some(picture), Some(image)) = (picture, &view.image) {
            resight::formats::write_atomically(picture, &view.png(image, &target)?)?;
        }
        Ok(view.answer)
    };
    super::detect_in_order(
        &jobs,
        || args.corners.detector(&target),
        work,
        |answer| {
            let answer = answer?;
            printer.result(&answer.json(), &crate::text::describe(&answer), answer.verdict.status)
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

/// What is looked for, and with what.
pub struct Sight<'a> {
    /// Calibrated camera.
    pub camera: &'a Camera,
    /// The target.
    pub target: &'a Target,
    /// How to solve.
    pub method: Method,
    /// How well the intrinsics are known; none: exactly.
    pub intrinsics: Option<IntrinsicsSigma>,
    /// What is unusual about the target's file.
    pub remarks: &'a [String],
}

/// One image, looked at.
pub struct Seen {
    /// The image, when it could be read.
    pub image: Option<GrayImage>,
    /// The camera at this image's size.
    pub camera: Option<Camera>,
    /// What was found.
    pub detections: Vec<Detection>,
    /// What it means.
    pub answer: Answer,
}

impl Sight<'_> {
    /// Reads an image and answers.
    pub fn look(&self, detector: &mut Detector, path: &Path) -> Seen {
        let view = super::detect::view_name(path);
        match GrayImage::read(path) {
            Ok(image) => self.look_at(detector, image, view),
            Err(reason) => Seen::nothing(None, Answer::without_pose(view, Status::Error, reason.to_string())),
        }
    }

    /// Answers for an image in memory.
    pub fn look_at(&self, detector: &mut Detector, image: GrayImage, view: String) -> Seen {
        let camera = match resight::formats::check_image_size(self.camera, image.width_px, image.height_px) {
            Ok(camera) => camera,
            Err(reason) => {
                return Seen::nothing(Some(image), Answer::without_pose(view, Status::Error, reason));
            }
        };
        let detections = match detector.detect_with_camera(&image, &camera) {
            Ok(detections) => detections,
            Err(reason) => {
                return Seen::nothing(
                    Some(image),
                    Answer::without_pose(view, Status::Error, reason.to_string()),
                );
            }
        };
        let answer = match detections.is_empty() {
            true => Answer::without_pose(view, Status::NotFound, absent::not_found(self.target, &image)),
            false => self.answer(&detections, &camera, view),
        };
        let mut remarks = self.remarks.to_vec();
        remarks.extend(detector.remarks());
        let answer = Answer { remarks, ..answer };
        Seen { image: Some(image), camera: Some(camera), detections, answer }
    }

    /// The size that the intrinsics are of, where `camera` is them at another.
    fn scaled_from_px(&self, camera: &Camera) -> Option<[u32; 2]> {
        let calibrated = self.camera.size?;
        (camera.size != Some(calibrated)).then_some([calibrated.width_px, calibrated.height_px])
    }

    fn answer(&self, detections: &[Detection], camera: &Camera, view: String) -> Answer {
        let intrinsics_covariance = self.intrinsics.as_ref().map(|sigma| sigma.covariance(camera));
        let config = Config {
            method: self.method,
            intrinsics_covariance: intrinsics_covariance.as_deref(),
            ..Config::default()
        };
        let found = locate_target(detections, self.target, camera, &config);
        let names: Vec<String> = found.features.iter().map(|f| feature_name(*f, self.target)).collect();
        let mut verdict = verdict::of_target(&found, |i| names.get(i).cloned().unwrap_or_default());
        let scaled_from_px = self.scaled_from_px(camera);
        if let (Some([w, h]), Status::Inconsistent) = (scaled_from_px, verdict.status) {
            verdict.message += &format!(
                "; the intrinsics were scaled from {w} × {h} px to this image's size, which is wrong where the image is a crop or of another \
                 sensor mode"
            );
        }
        let (points, estimate) = (found.seen, found.estimate.ok());
        Answer {
            view,
            verdict,
            observability: estimate.as_ref().map(|e| Observability::of(e, &points)),
            estimate,
            n_points: points.len(),
            image_unit: "px",
            sigma_px: mean_square_root(points.iter().map(|c| c.sigma_px)),
            point_sigma_m: point_sigma_m(&points),
            intrinsics_sigma: self.intrinsics.as_ref().map(IntrinsicsSigma::stated),
            names,
            scaled_from_px,
            skipped: found.skipped.iter().map(|s| skipped_text(s, self.target)).collect(),
            agreement: None,
            left_out: found.left_out,
            contradicting: found.contradicting,
            remarks: Vec::new(),
        }
    }
}

impl Seen {
    fn nothing(image: Option<GrayImage>, answer: Answer) -> Self {
        Seen { image, camera: None, detections: Vec::new(), answer }
    }

    /// The answer drawn over the photograph, as PNG.
    pub fn png(&self, image: &GrayImage, target: &Target) -> Result<Vec<u8>> {
        let status = self.answer.verdict.status;
        let title =
            Path::new(&self.answer.view).file_name().unwrap_or_default().to_string_lossy().into_owned();
        let scene = overlay::Scene {
            image,
            detections: &self.detections,
            camera: self.camera.as_ref(),
            target,
            estimate: self.answer.estimate.as_ref(),
            title: &title,
            verdict: &status.name().replace('_', " "),
            tone: match status {
                Status::Ok => Tone::Good,
                Status::Ambiguous => Tone::Doubtful,
                _ => Tone::Bad,
            },
        };
        overlay::draw(&scene).png().map_err(|reason| anyhow::anyhow!("{}: {reason}", self.answer.view))
    }
}

fn feature_name(feature: Feature, target: &Target) -> String {
    match target {
        Target::Points(points) => {
            points.get(feature.id as usize).map_or_else(String::new, |p| format!("point {}", p.name))
        }
        _ if target.has_tag_corners() => format!("corner {} of tag {}", feature.corner, feature.id),
        _ => format!("point {}", feature.id),
    }
}

fn skipped_text(skipped: &Skipped, target: &Target) -> String {
    let name = feature_name(skipped.feature, target);
    match &skipped.reason {
        Some(reason) => format!("{name}: {reason}"),
        None => format!("{name}: not part of the target"),
    }
}

/// Root mean square of the known points' standard deviations, metres; none when all are exact.
pub fn point_sigma_m(points: &[Correspondence]) -> Option<f64> {
    mean_square_root(points.iter().map(|c| c.sigma_m)).filter(|sigma_m| 0.0 < *sigma_m)
}

/// Root of the mean square; none of nothing.
pub fn mean_square_root(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (n, sum) = values.fold((0, 0.0), |(n, sum), x| (n + 1, sum + x * x));
    (0 < n).then(|| (sum / n as f64).sqrt())
}
