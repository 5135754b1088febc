//! An image to the points in it, as an answer.

use super::every_tag::{EveryTagFinder, FamilyTags};
use super::tags::FoundTag;
use super::{Detector, absent};
use crate::GrayImage;
use crate::answer::DetectionAnswer;
use crate::answer::detection::DetectedPoint;
use crate::core::Target;

/// The points of a target in an image; where there are none, the message says what the image holds instead. `view` names the image.
pub fn detect_target(
    detector: &mut Detector,
    target: &Target,
    view: &str,
    image: &GrayImage,
) -> DetectionAnswer {
    match detector.detect(image) {
        Err(reason) => DetectionAnswer::error(view, reason.to_string()),
        Ok(detections) => {
            let message = detections.is_empty().then(|| absent::not_found(target, image));
            let points = detections.iter().map(|d| DetectedPoint::new(d, None)).collect();
            DetectionAnswer {
                remarks: detector.remarks().collect(),
                ..DetectionAnswer::new(view, points, message)
            }
        }
    }
}

/// Every tag of the family that `finder` looks for, or of `any` family.
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
