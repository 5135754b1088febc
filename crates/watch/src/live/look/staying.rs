//! The part of a pair's errors that is constant while the camera does not move; each image updates it in the monitor.
//!
//! It follows from the residuals at the current pose of the camera and at the one before: docs/math/monitor.md section 12.

use resight_core::correspondence::Detection;
use resight_core::locate::refine::residual_px;
use resight_core::target::Feature;
use resight_core::temporal::monitor::{Monitor, PointErrors, Reading, covariance_by_image};
use resight_core::{Camera, Correspondence, Target};

/// Residuals of a pair for each pose.
pub(super) struct Staying {
    errors: PointErrors,
    /// Start of the last motion, seconds.
    began_s: Option<f64>,
    /// Whether the four corners of a tag are measured by one fit.
    is_shared: bool,
}

/// An image of the target.
pub(super) struct View<'a> {
    pub detections: &'a [Detection],
    pub features: &'a [Feature],
    /// The points in the order of `features`.
    pub points: &'a [Correspondence],
    pub lens: &'a Camera,
}

impl Staying {
    pub fn of(target: &Target) -> Self {
        let is_shared = matches!(target.design(), Target::Tag(_) | Target::TagMap(_));
        Staying { errors: PointErrors::default(), began_s: None, is_shared }
    }

    /// Processes the next image; after a motion reported by `monitor` it belongs to a new pose.
    pub fn take(&mut self, view: &View, reading: &Reading, monitor: Option<&mut Monitor>) {
        if !reading.is_consistent {
            return;
        }
        let began_s = monitor.as_ref().and_then(|monitor| monitor.drift()).map(|drift| drift.began_s);
        if began_s != self.began_s {
            self.began_s = began_s;
            self.errors.moved();
        }
        let sigmas_px = view.image_sigmas_px();
        let residuals = view.features.iter().zip(view.points).zip(&sigmas_px);
        self.errors.push(residuals.filter_map(|((feature, point), sigma_px)| {
            let name = (u64::from(feature.id) << 8) | u64::from(feature.corner);
            Some((name, residual_px(&reading.a_from_b, point, view.lens)? / *sigma_px))
        }));
        let by_image = covariance_by_image(&reading.a_from_b, view.points, &sigmas_px, view.lens);
        if let (Some(monitor), Some(by_image)) = (monitor, by_image) {
            monitor.stays(&(by_image * self.errors.staying(self.is_shared)));
        }
    }
}

impl View<'_> {
    /// Returns the standard deviation of each point by the image alone, px.
    fn image_sigmas_px(&self) -> Vec<f64> {
        let own = |(i, feature): (usize, &Feature)| {
            // Detections are in the order of the points, except where some are left out.
            let there = self.detections.get(i).filter(|d| d.feature == *feature);
            let detection = there.or_else(|| self.detections.iter().find(|d| d.feature == *feature));
            detection.map_or(f64::INFINITY, |detection| detection.sigma_px)
        };
        self.features.iter().enumerate().map(own).collect()
    }
}
