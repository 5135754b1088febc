//! Detects the points in an image, as an answer.

use super::absent::Explainer;
use super::every_tag::{EveryTagFinder, FamilyTags};
use super::tags::FoundTag;
use super::{Detector, absent};
use crate::GrayImage;
use crate::answer::detection::DetectedPoint;
use crate::answer::{DetectionAnswer, Status};
use crate::core::Target;
use crate::core::correspondence::Detection;
use crate::report::face;

/// Detects the points of a target in an image; where there are none, [`explain`] describes what the image shows instead. `view` names the image.
pub fn detect_target(
    detector: &mut Detector,
    target: &Target,
    view: &str,
    image: &GrayImage,
) -> DetectionAnswer {
    match detector.detect(image) {
        Err(reason) => DetectionAnswer::error(view, reason.to_string()),
        Ok(detections) => {
            let message = detections.is_empty().then(|| absent::missing(target));
            let points = detections.iter().map(|d| DetectedPoint::new(d, None)).collect();
            let answer = DetectionAnswer {
                remarks: detector.remarks().collect(),
                ..DetectionAnswer::new(view, points, message)
            };
            judged(answer, target, &detections)
        }
    }
}

/// Rejects a flat target that is seen mirrored, whatever was found; this needs no lens.
fn judged(answer: DetectionAnswer, target: &Target, detections: &[Detection]) -> DetectionAnswer {
    match mirrored(target, detections) {
        Some(reason) => DetectionAnswer { status: Status::Inconsistent, message: Some(reason), ..answer },
        None => answer,
    }
}

fn mirrored(target: &Target, detections: &[Detection]) -> Option<String> {
    let is_mirrored = face::is_mirrored(target, detections) == Some(true);
    is_mirrored.then(|| format!("the {} {}", target.design().kind(), face::MIRRORED))
}

/// Returns the points of a target in one image.
///
/// # Errors
/// With the reason, which is that of [`detect_target`] and [`explain`], for every status but `ok`.
pub fn points(target: &Target, image: &GrayImage) -> Result<Vec<Detection>, String> {
    let detections = Detector::new(target).and_then(|mut detector| detector.detect(image));
    let detections = detections.map_err(|reason| reason.to_string())?;
    if detections.is_empty() {
        return Err(absent::not_found(target, image));
    }
    match mirrored(target, &detections) {
        Some(reason) => Err(reason),
        None => Ok(detections),
    }
}

/// Explains what an image without the target shows instead, for the first such image of a session; `image` reads it again.
pub fn explain(
    answer: &mut DetectionAnswer,
    target: &Target,
    explainer: &mut Explainer,
    image: impl FnOnce() -> Option<GrayImage>,
) {
    if answer.status == Status::NotFound {
        answer.message = Some(explainer.explain(target, image));
    }
}

/// Detects every tag of the family that `finder` searches for, or of `any` family.
pub fn detect_every_tag(
    finder: &mut EveryTagFinder,
    family: &str,
    view: &str,
    image: &GrayImage,
) -> DetectionAnswer {
    let of_family = |found: &FamilyTags| -> Vec<DetectedPoint> {
        let corners = found.tags.iter().flat_map(FoundTag::detections);
        corners.map(|d| DetectedPoint::new(&d, Some(&found.family))).collect()
    };
    let points: Vec<DetectedPoint> = finder.find(image).iter().flat_map(of_family).collect();
    let of = if family == "any" { "of any known family" } else { family };
    let message = points.is_empty().then(|| format!("no tag {of} in this image"));
    DetectionAnswer::new(view, points, message)
}
