//! Detection × target × camera → correspondences: what every solver takes.

use crate::target::{Feature, Target};
use crate::{Bearing, Camera, Error, Pixel, Point};

/// A named feature found in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// Which point of the target it is.
    pub feature: Feature,
    /// Where it was seen, pixels.
    pub pixel: Pixel,
    /// Standard deviation of each pixel coordinate.
    pub sigma_px: f64,
}

/// A known point and where it was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correspondence {
    /// Place in the target frame, metres.
    pub x_in_target: Point,
    /// Place in the image, pixels (or the camera's own unit).
    pub pixel: Pixel,
    /// Unit vector towards it, camera frame; derived from `pixel` by the camera.
    pub bearing: Bearing,
    /// Standard deviation of each pixel coordinate.
    pub sigma_px: f64,
    /// Standard deviation of each coordinate of `x_in_target`, metres; 0 when exact.
    pub sigma_m: f64,
}

impl Correspondence {
    /// A point known exactly, seen at a pixel. Fails outside the camera's valid field.
    pub fn new(camera: &Camera, x_in_target: Point, pixel: Pixel, sigma_px: f64) -> Result<Self, Error> {
        let bearing = camera.bearing(&pixel)?;
        Ok(Correspondence { x_in_target, pixel, bearing, sigma_px, sigma_m: 0.0 })
    }
}

/// A detection that took no part, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Skipped {
    /// Which feature.
    pub feature: Feature,
    /// The reason: outside the valid field; none when the target has no such feature.
    pub reason: Option<Error>,
}

/// Joins detections with the target's points; what cannot be used is returned with its reason.
pub fn correspond(
    detections: &[Detection],
    target: &Target,
    camera: &Camera,
) -> (Vec<(Feature, Correspondence)>, Vec<Skipped>) {
    let mut seen = Vec::with_capacity(detections.len());
    let mut skipped = Vec::new();
    for d in detections {
        let Some(known) = target.point(d.feature) else {
            skipped.push(Skipped { feature: d.feature, reason: None });
            continue;
        };
        match Correspondence::new(camera, known.position, d.pixel, d.sigma_px) {
            Ok(c) => seen.push((d.feature, Correspondence { sigma_m: known.sigma_m, ..c })),
            Err(reason) => skipped.push(Skipped { feature: d.feature, reason: Some(reason) }),
        }
    }
    (seen, skipped)
}
