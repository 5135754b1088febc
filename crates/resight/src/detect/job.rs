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
    match face::is_mirrored(target, detections) {
        Some(true) => DetectionAnswer {
            status: Status::Inconsistent,
            message: Some(format!("the {} {}", target.design().kind(), face::MIRRORED)),
            ..answer
        },
        _ => answer,
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
