//! From an image, or from known points, to a pose: the job behind `resight locate` and `resight solve`.

use crate::GrayImage;
use crate::answer::consensus::locate_most;
use crate::answer::{Agreement, PoseAnswer, Status};
use crate::detect::absent::{self, Explainer};
use crate::detect::{CornerWindow, Detector};
use crate::error::Error;
use crate::formats::plausible;
use crate::nominal::lens_of_unknown_focal;
use crate::overlay::{self, Tone};
use crate::report::face;
use crate::report::verdict::{self, Verdict};
use resight_core::camera::ImageSize;
use resight_core::correspondence::{Detection, Skipped, correspond};
use resight_core::locate::consistency::Consistency;
use resight_core::locate::observability::Observability;
use resight_core::locate::prior::Prior;
use resight_core::locate::suspects::Origin;
use resight_core::locate::unknown_focal::LensPrior;
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::multiview::tag_map::{TargetPose, locate_target};
use resight_core::target::Feature;
use resight_core::{Camera, Correspondence, Error as MathError, Target};

pub use causes::PointsCause;
pub(crate) use causes::{of_table, outside_field};
pub use intrinsics::{IntrinsicsCost, IntrinsicsCovariance, camera_file};
pub use lines::{NamedLine, locate_lines_and_points};
pub use method::{METHODS, method_name};
pub use named_point::NamedPoint;
use once::Once;
pub use resight_core::locate::Method;
pub(crate) use rows::LARGEST;
pub use rows::{PointRows, RowFault, SeenRows, is_missing};

mod causes;
mod focal;
mod intrinsics;
mod lines;
mod method;
mod named_point;
mod once;
mod rows;
mod symmetric;

/// Settings of [`locate_image`]; the default is right for most jobs.
#[derive(Debug, Clone, Default)]
pub struct LocateOptions {
    /// The solver; `Auto` decides from the points.
    pub method: Method,
    /// The uncertainty of the intrinsics; `None` where they are exact.
    pub intrinsics: Option<IntrinsicsCovariance>,
    /// The window in which corners of chessboards and ChArUco boards are refined.
    pub corner_window: CornerWindow,
    /// Whether the focal length is estimated with the pose of each image; the intrinsics of the camera are then ignored.
    pub estimate_focal: bool,
}

/// Returns the pose of a camera from an image of a target.
///
/// The answer has a status: `NotFound` where the image does not show the target, `Error` where the image and the camera do not belong
/// together or the target cannot be read from it unambiguously.
///
/// # Errors
/// A target that cannot be detected, or a corner window that it does not have. For many images, keep an [`ImageLocator`].
pub fn locate_image(
    image: &GrayImage,
    camera: &Camera,
    target: &Target,
    options: &LocateOptions,
) -> Result<PoseAnswer, Error> {
    let mut answer = ImageLocator::new(camera, target, options)?.locate(image, String::new()).answer;
    explain(&mut answer, target, &mut Explainer::default(), || Some(image.clone()));
    Ok(answer)
}

/// Explains what an image without the target shows instead, for the first such image of a session; `image` reads it again. Images have to be
/// given in their order.
pub fn explain(
    answer: &mut PoseAnswer,
    target: &Target,
    explainer: &mut Explainer,
    image: impl FnOnce() -> Option<GrayImage>,
) {
    if answer.status() == Status::NotFound {
        answer.verdict.message = explainer.explain(target, image);
    }
}

/// Locates one target in images of one camera; built once per thread.
pub struct ImageLocator<'a> {
    camera: &'a Camera,
    target: &'a Target,
    options: &'a LocateOptions,
    detector: Detector,
    /// Remarks about implausible sizes of the target.
    sizes: Vec<String>,
}

/// The points found in one image, and the answer.
#[derive(Debug, Clone)]
pub struct Located {
    /// The camera at the image's size; `None` where the image has another aspect ratio.
    pub camera: Option<Camera>,
    /// The points found.
    pub detections: Vec<Detection>,
    /// The answer.
    pub answer: PoseAnswer,
}

impl<'a> ImageLocator<'a> {
    /// # Errors
    /// The errors of [`locate_image`].
    pub fn new(camera: &'a Camera, target: &'a Target, options: &'a LocateOptions) -> Result<Self, Error> {
        let detector = Detector::with_corner_window(target, options.corner_window)?;
        Ok(ImageLocator { camera, target, options, detector, sizes: plausible::of_target(target) })
    }

    /// Detects the target in an image and solves for the pose; `view` is the image's name in the answer. For an image without the target, the
    /// answer does not state what the image shows instead, which takes longer than the search: use [`explain`].
    pub fn locate(&mut self, image: &GrayImage, view: String) -> Located {
        if self.options.estimate_focal {
            return self.locate_with_unknown_focal(image, view);
        }
        let camera = match crate::formats::check_image_size(self.camera, image.width_px, image.height_px) {
            Ok(camera) => camera,
            Err(reason) => return Located::error(view, reason),
        };
        let detections = match self.detector.detect_with_camera(image, &camera) {
            Ok(detections) => detections,
            Err(reason) => return Located::error(view, reason.to_string()),
        };
        let answer = if detections.is_empty() {
            PoseAnswer::without_pose(view, Status::NotFound, absent::missing(self.target))
        } else {
            symmetric::judged(self.answer(&detections, &camera, view), self.target)
        };
        let remarks = self.detector.remarks().collect();
        Located { camera: Some(camera), detections, answer: PoseAnswer { remarks, ..answer } }
    }

    fn locate_with_unknown_focal(&mut self, image: &GrayImage, view: String) -> Located {
        let lens = lens_of_unknown_focal(ImageSize { width_px: image.width_px, height_px: image.height_px });
        let detections = match self.detector.detect(image) {
            Ok(detections) => detections,
            Err(reason) => return Located::error(view, reason.to_string()),
        };
        let remarks = self.detector.remarks().collect();
        if detections.is_empty() {
            let reason = absent::missing(self.target);
            let answer = PoseAnswer::without_pose(view, Status::NotFound, reason);
            return Located { camera: None, detections, answer: PoseAnswer { remarks, ..answer } };
        }
        // The join needs no bearings: without a lens there are none.
        let (joined, skipped) = correspond(&detections, self.target, &Camera::normalized());
        let (features, seen): (Vec<_>, Vec<_>) = joined.into_iter().unzip();
        let name_of = |i: usize| features.get(i).map_or_else(String::new, |f| feature_name(*f, self.target));
        let (answer, camera) = focal::with_unknown_focal(&view, &seen, &lens, self.scale_sigma(), name_of);
        let answer = PoseAnswer {
            verdict: answer.verdict.with_sizes(&self.sizes),
            printed_scale: self.target.printed_scale().map(Into::into),
            skipped: skipped.iter().map(|s| skipped_text(s, self.target)).collect(),
            remarks,
            ..answer
        };
        Located { camera, detections, answer: symmetric::judged(answer, self.target) }
    }

    /// Returns the size for which the intrinsics were stated, where `camera` was scaled to another.
    fn scaled_from_px(&self, camera: &Camera) -> Option<[u32; 2]> {
        let calibrated = self.camera.size?;
        (camera.size != Some(calibrated)).then_some([calibrated.width_px, calibrated.height_px])
    }

    /// Returns the uncertainty of a printed target's lengths along x and y that the rulers leave; zeros where the target is exact.
    fn scale_sigma(&self) -> [f64; 2] {
        self.target.printed_scale().map_or([0.0; 2], |scale| scale.relative_sigma())
    }

    fn answer(&self, detections: &[Detection], camera: &Camera, view: String) -> PoseAnswer {
        let intrinsics = self.options.intrinsics.as_ref();
        let intrinsics_covariance = intrinsics.map(|known| known.covariance(camera));
        let config = Config {
            method: self.options.method,
            intrinsics_covariance: intrinsics_covariance.as_deref(),
            ..Config::default()
        };
        let found = locate_target(detections, self.target, camera, &config);
        let names: Vec<String> = found.features.iter().map(|f| feature_name(*f, self.target)).collect();
        let mut verdict = verdict::of_target(&found, |i| names.get(i).cloned().unwrap_or_default());
        if let Ok(estimate) = &found.estimate {
            verdict = face::judged(verdict, self.target, &estimate.cam_from_target, &found.seen);
        }
        verdict = verdict.with_sizes(&self.sizes);
        let scaled_from_px = self.scaled_from_px(camera);
        if let (Some([w, h]), Status::Inconsistent) = (scaled_from_px, verdict.status) {
            verdict.message += &format!(
                "; the intrinsics were scaled from {w} × {h} px to this image's size, which is wrong where the image is a crop or of another \
                 sensor mode"
            );
        }
        let causes = self.causes(&found, camera, &config);
        if let Some(sentence) = causes::sentence(&causes) {
            verdict.message = format!("{sentence}; {}", verdict.message);
        }
        let budget = found.budget(self.target, camera, &config).ok();
        let (points, estimate) = (found.seen, found.estimate.ok());
        let intrinsics_cost = intrinsics
            .zip(estimate.as_ref())
            .and_then(|(known, estimate)| known.cost(estimate, &points, camera, self.scale_sigma()));
        PoseAnswer {
            verdict,
            observability: estimate.as_ref().map(|e| Observability::of(e, &points)),
            estimate,
            budget,
            n_points: points.len(),
            sigma_px: mean_square_root(points.iter().map(|c| c.sigma_px)),
            point_sigma_m: point_sigma_m(&points),
            intrinsics_sigma: intrinsics.map(IntrinsicsCovariance::sigmas),
            intrinsics_cost,
            printed_scale: self.target.printed_scale().map(Into::into),
            names,
            scaled_from_px,
            skipped: found.skipped.iter().map(|s| skipped_text(s, self.target)).collect(),
            left_out: found.left_out,
            contradicting: found.contradicting,
            causes,
            ..PoseAnswer::without_pose(view.to_owned(), Status::Error, "")
        }
    }

    /// Returns the usual faults of a camera file that explain a contradiction; none where tags of a map contradict each other.
    fn causes(&self, found: &TargetPose, camera: &Camera, config: &Config) -> Vec<PointsCause> {
        if !found.contradicting.is_empty() {
            return Vec::new();
        }
        let config = &Config { target_scale_sigma: self.scale_sigma(), ..*config };
        let label = |i: usize| feature_name(found.features[i], self.target);
        causes::causes(found.estimate.as_ref(), &found.seen, camera, config, Origin::Image, label)
    }
}

impl Located {
    /// Returns the answer for an image that could not be read.
    pub fn error(view: String, reason: impl Into<String>) -> Self {
        let answer = PoseAnswer::without_pose(view, Status::Error, reason);
        Located { camera: None, detections: Vec::new(), answer }
    }

    /// Returns the answer drawn over its image, as PNG; `title` is in the caption.
    ///
    /// # Errors
    /// Why the image could not be encoded.
    pub fn overlay_png(&self, image: &GrayImage, target: &Target, title: &str) -> Result<Vec<u8>, String> {
        let status = self.answer.status();
        let scene = overlay::Scene {
            image,
            detections: &self.detections,
            camera: self.camera.as_ref(),
            target,
            estimate: self.answer.estimate.as_ref(),
            title,
            verdict: &status.name().replace('_', " "),
            tone: match status {
                Status::Ok => Tone::Good,
                Status::Ambiguous | Status::Implausible => Tone::Doubtful,
                _ => Tone::Bad,
            },
        };
        overlay::draw(&scene).png()
    }
}

/// Settings of [`locate_points`]: prior knowledge, and the unit of the points.
#[derive(Debug, Clone)]
pub struct PointsOptions {
    /// The solver; `Auto` decides from the points.
    pub method: Method,
    /// The uncertainty of the intrinsics; `None` where they are exact.
    pub intrinsics: Option<IntrinsicsCovariance>,
    /// Prior knowledge of the pose.
    pub priors: Vec<Prior>,
    /// Largest distance, in the points' own unit, of a point that agrees with the pose; `None` where every point is trusted.
    pub robust_threshold_px: Option<f64>,
    /// Prior knowledge of the lens where its focal length is estimated with the pose; the intrinsics of the camera are then ignored.
    pub estimate_focal: Option<LensPrior>,
    /// Unit of image coordinates in the answer: `px`, `normalized` or `unit of f`.
    pub image_unit: &'static str,
    /// Whether points are still being moved: a contradiction is then answered without its causes, whose search takes tens of milliseconds.
    pub is_provisional: bool,
}

impl Default for PointsOptions {
    fn default() -> Self {
        PointsOptions {
            method: Method::Auto,
            intrinsics: None,
            priors: Vec::new(),
            robust_threshold_px: None,
            estimate_focal: None,
            image_unit: "px",
            is_provisional: false,
        }
    }
}

/// Solves for the pose of a camera from known points; `view` is their name in the answer. Equal points at equal pixels are one observation.
pub fn locate_points(
    view: &str,
    points: &[NamedPoint],
    camera: &Camera,
    options: &PointsOptions,
) -> PoseAnswer {
    let seen: Vec<Correspondence> = points.iter().map(|point| point.seen).collect();
    if let Some(once) = Once::of(&seen) {
        return once.answered(points, |points| locate_points(view, points, camera, options));
    }
    if let Some(lens) = &options.estimate_focal {
        return located_with_unknown_focal(view, points, &seen, lens);
    }
    let intrinsics = options.intrinsics.as_ref();
    let covariance = intrinsics.map(|known| known.covariance(camera));
    let config = Config {
        method: options.method,
        intrinsics_covariance: covariance.as_deref(),
        priors: &options.priors,
        ..Config::default()
    };
    let solved = match options.robust_threshold_px {
        None => locate(&seen, camera, &config).map(|e| (e, None)),
        Some(limit) => locate_most(points, &seen, camera, limit, config).map(|(e, a)| (e, Some(a))),
    };
    let label = |i: usize| format!("point {}", points[i].label());
    let causes = match options.robust_threshold_px {
        None if !options.is_provisional => {
            causes::causes(solved.as_ref().map(|(e, _)| e), &seen, camera, &config, Origin::Table, label)
        }
        _ => Vec::new(),
    };
    let budget = solved.as_ref().ok().and_then(|(e, agreement)| {
        let agreeing = agreement.as_ref().map(|a| a.inliers.iter().map(|i| seen[*i]).collect::<Vec<_>>());
        e.budget(agreeing.as_deref().unwrap_or(&seen), camera, &config).ok()
    });
    let (mut verdict, estimate, agreement): (Verdict, Option<PoseEstimate>, Option<Agreement>) = match solved
    {
        Ok((e, agreement)) => (verdict::of_estimate(&e, label, options.image_unit), Some(e), agreement),
        Err(reason) => (named(verdict::of_error(&reason), &reason, points), None, None),
    };
    let outside = || causes::outside(&seen, camera, label);
    let outside = (options.image_unit == "px" && verdict.status != Status::Ok).then(outside).flatten();
    for sentence in outside.into_iter().chain(causes::sentence(&causes)) {
        verdict.message = format!("{sentence}; {}", verdict.message);
    }
    let intrinsics_cost = intrinsics
        .zip(estimate.as_ref())
        .and_then(|(known, estimate)| known.cost(estimate, &seen, camera, [0.0; 2]));
    PoseAnswer {
        verdict,
        observability: estimate.as_ref().map(|e| Observability::of(e, &seen)),
        estimate,
        budget,
        n_points: seen.len(),
        image_unit: options.image_unit,
        sigma_px: mean_square_root(seen.iter().map(|c| c.sigma_px)),
        point_sigma_m: point_sigma_m(&seen),
        intrinsics_sigma: intrinsics.map(IntrinsicsCovariance::sigmas),
        intrinsics_cost,
        names: points.iter().map(|point| point.name.clone()).collect(),
        agreement,
        causes,
        ..PoseAnswer::without_pose(view.to_owned(), Status::Error, "")
    }
}

fn located_with_unknown_focal(
    view: &str,
    points: &[NamedPoint],
    seen: &[Correspondence],
    lens: &LensPrior,
) -> PoseAnswer {
    let label = |i: usize| format!("point {}", points[i].label());
    let (answer, _) = focal::with_unknown_focal(view, seen, lens, [0.0; 2], label);
    PoseAnswer { names: points.iter().map(|point| point.name.clone()).collect(), ..answer }
}

/// Adds the names of the points to a refusal that concerns two of them.
fn named(verdict: Verdict, reason: &MathError, points: &[NamedPoint]) -> Verdict {
    match reason {
        MathError::Coincident { first, second, where_ } => {
            let (a, b) = (points[*first].label(), points[*second].label());
            Verdict {
                message: format!("points {a} and {b} coincide {where_}; remove one of them"),
                ..verdict
            }
        }
        _ => verdict,
    }
}

/// Returns whether the priors contradict the points.
pub fn is_contradicted_by_priors(answer: &PoseAnswer) -> bool {
    let consistency = answer.estimate.as_ref().map(|e| e.consistency);
    matches!(consistency, Some(Consistency::Inconsistent { worst_prior: Some(_), .. }))
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

/// Returns the root mean square of the known points' standard deviations, metres; `None` when all are exact.
fn point_sigma_m(points: &[Correspondence]) -> Option<f64> {
    mean_square_root(points.iter().map(|c| c.sigma_m)).filter(|sigma_m| 0.0 < *sigma_m)
}

/// Returns the root mean square; `None` without values.
fn mean_square_root(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (n, sum) = values.fold((0, 0.0), |(n, sum), x| (n + 1, sum + x * x));
    (0 < n).then(|| (sum / n as f64).sqrt())
}
