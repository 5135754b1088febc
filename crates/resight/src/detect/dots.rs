//! Three dots on a line and one off it: lamps, retro-reflectors or printed discs.
//!
//! image → classes (`threshold`) → regions (`components`) → dots with sub-pixel position and sigma (`centroid`) →
//! the four that are the target (`identify`, `layout`) → shift by perspective removed → detections.
//! The target is opaque, or at least known to be seen from its front; a mirrored or backward view is not found.
//! Every dot must be completely inside the image; if one is covered, the target is not found. Derivations: docs/math/dots.md.
//!
//! The cost is linear in the number of pixels, and bounded whatever they show: at most 160 dots of each polarity take part, the most conspicuous
//! first. At 1280×960 it is 1.1 to 1.4 ms for a clean image, about 10 ms among a hundred dots, and 40 ms with a hundred thousand specks or 170
//! equal lamps (dev profile, one shared core).

mod centroid;
mod components;
mod find;
mod identify;
mod layout;
mod threshold;
mod view;

use crate::GrayImage;
use identify::{Explanation, Search};
use layout::{Layout, ViewDot};
use resight_core::correspondence::Detection;
use resight_core::target::{Feature, LinePlusOne, Target};
use resight_core::{Camera, Pixel};
use thiserror::Error;
use view::View;

pub use centroid::Dot;
pub use find::DotFinder;
pub(super) use layout::rim_centroid;

/// Why an image cannot be searched.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum DotError {
    /// The pixel buffer does not match the size.
    #[error("image of {width_px}×{height_px} px has {seen} bytes; it must have one per pixel")]
    BufferSize {
        /// Columns stated.
        width_px: u32,
        /// Rows stated.
        height_px: u32,
        /// Bytes found.
        seen: usize,
    },
    /// The intrinsics belong to images of another size.
    #[error(
        "image is {width_px}×{height_px} px but the camera was calibrated at {camera_width_px}×{camera_height_px} px; \
         scale the camera or use its own images"
    )]
    CameraSize {
        /// Columns of the image.
        width_px: u32,
        /// Rows of the image.
        height_px: u32,
        /// Columns of the camera's images.
        camera_width_px: u32,
        /// Rows of the camera's images.
        camera_height_px: u32,
    },
    /// Several copies of the target.
    #[error(
        "the dot target is seen {count} times, so which one is meant is not known; cover or remove the copies"
    )]
    Copies {
        /// How often it was seen.
        count: usize,
    },
}

/// The polarity of the dots that are searched for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Polarity {
    /// Both.
    #[default]
    Either,
    /// Dark dots on a light ground.
    DarkOnLight,
    /// Light dots on a dark ground: lamps, retro-reflectors.
    LightOnDark,
}

/// The dots' geometry, and the detector's thresholds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DotConfig {
    /// Diameter of the discs, metres; `None` for any, as long as the four are alike.
    pub diameter_m: Option<f64>,
    /// Dark or light.
    pub polarity: Polarity,
    /// Least difference to the surroundings, grey levels; ten times the image's noise is required in any case.
    pub min_contrast: f64,
    /// Accepted expected number of false targets per image, if its dots were distributed at random.
    pub max_false_alarms: f64,
    /// Error of a centroid that is not noise (pixel response, lens, print), px; added in quadrature to each sigma.
    pub sigma_floor_px: f64,
}

impl Default for DotConfig {
    fn default() -> Self {
        DotConfig {
            diameter_m: None,
            polarity: Polarity::Either,
            min_contrast: 12.0,
            max_false_alarms: 1e-4,
            sigma_floor_px: 0.01,
        }
    }
}

/// One target found in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct DotTarget {
    /// The four dots, ids 0 to 3: centres corrected for perspective.
    pub detections: Vec<Detection>,
    /// The dots as measured, in the same order.
    pub dots: [Dot; 4],
    /// log₁₀ of the number of such targets expected by chance in this image.
    pub log10_false_alarms: f64,
}

/// Finds one dot target; keeps its buffers between images.
pub struct DotDetector {
    layout: Layout,
    config: DotConfig,
    finder: DotFinder,
}

impl DotDetector {
    /// Builds a detector for one target, with dots of any size and polarity. Fails on invalid dimensions of the target.
    pub fn new(target: &LinePlusOne) -> Result<Self, resight_core::Error> {
        Self::with_config(target, DotConfig::default())
    }

    /// Returns a detector for one target with limits on the size and polarity of its dots. Fails as `new`.
    pub fn with_config(target: &LinePlusOne, config: DotConfig) -> Result<Self, resight_core::Error> {
        Target::LinePlusOne(*target).check()?;
        let unfit = |parameter, seen| {
            Err(resight_core::Error::InvalidTarget { parameter, seen, needed: "it must be positive" })
        };
        if let Some(d) = config.diameter_m.filter(|d| !(0.0 < *d && d.is_finite())) {
            return unfit("diameter_m", d);
        }
        if !(0.0 < config.max_false_alarms) {
            return unfit("max_false_alarms", config.max_false_alarms);
        }
        Ok(DotDetector {
            layout: Layout::new(target, config.diameter_m),
            config,
            finder: DotFinder::new(config.polarity, config.min_contrast),
        })
    }

    /// Returns the four detections of the most certain target, or none. Without a camera the lens is assumed to be free of distortion; the shift
    /// by perspective is removed as far as the dots' own shapes determine it.
    pub fn detect(&mut self, image: &GrayImage) -> Result<Vec<Detection>, DotError> {
        self.only(image, None)
    }

    /// Detects with known intrinsics: straightness and rigidity are tested with the distortion of the lens.
    pub fn detect_with_camera(
        &mut self,
        image: &GrayImage,
        camera: &Camera,
    ) -> Result<Vec<Detection>, DotError> {
        self.only(image, Some(camera))
    }

    /// Every instance of the target in the image, surest first.
    pub fn detect_all(
        &mut self,
        image: &GrayImage,
        camera: Option<&Camera>,
    ) -> Result<Vec<DotTarget>, DotError> {
        check_size(image, camera)?;
        let dots = self.finder.dots(image)?;
        let size = Pixel::new(image.width_px as f64, image.height_px as f64);
        let view = match camera {
            Some(camera) => View::Calibrated(camera),
            None => View::Nominal { centre: (size - Pixel::new(1.0, 1.0)) * 0.5, scale_px: size.x.max(1.0) },
        };
        let seen: Vec<ViewDot> = dots.into_iter().filter_map(|d| ViewDot::new(d, &view)).collect();
        let search = Search {
            layout: &self.layout,
            view: &view,
            image_area_px2: size.x * size.y,
            max_log10_false_alarms: self.config.max_false_alarms.log10(),
        };
        let mut found = Vec::new();
        for dark in [true, false] {
            let group: Vec<ViewDot> =
                seen.iter().filter(|d| (d.dot.contrast < 0.0) == dark).copied().collect();
            let explanations = search.explanations(&group);
            found.extend(explanations.iter().map(|e| (e.score, self.finish(&group, e, &view))));
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(found.into_iter().map(|(_, target)| target).collect())
    }

    fn only(&mut self, image: &GrayImage, camera: Option<&Camera>) -> Result<Vec<Detection>, DotError> {
        let found = self.detect_all(image, camera)?;
        match found.len() {
            0 | 1 => Ok(found.into_iter().next().map_or(Vec::new(), |target| target.detections)),
            count => Err(DotError::Copies { count }),
        }
    }

    /// Removes perspective's shift, twice: the first time the homography itself is still shifted.
    fn finish(&self, dots: &[ViewDot], explanation: &Explanation, view: &View) -> DotTarget {
        let four = explanation.dots.map(|i| dots[i]);
        let mut fit = explanation.fit;
        let mut shifts = [Pixel::zeros(); 4];
        for _ in 0..2 {
            let Some(found) = layout::centroid_shifts(&self.layout, &fit, view) else { break };
            shifts = found;
            let Some(better) = self.refit(&four, &shifts, view) else { break };
            fit = better;
        }
        let mut all: Vec<(Detection, Dot)> =
            (0..4).map(|i| self.detection(i, &four[i].dot, &shifts[i])).collect();
        all.sort_by_key(|(d, _)| d.feature.id);
        DotTarget {
            detections: all.iter().map(|(d, _)| *d).collect(),
            dots: std::array::from_fn(|i| all[i].1),
            log10_false_alarms: explanation.log10_false_alarms,
        }
    }

    fn refit(&self, four: &[ViewDot; 4], shifts: &[Pixel; 4], view: &View) -> Option<layout::Fit> {
        let mut moved = *four;
        for (dot, shift) in moved.iter_mut().zip(shifts) {
            dot.y = view.ray(&(dot.dot.centroid - shift))?;
        }
        let along = moved[2].y - moved[0].y;
        let t = (moved[1].y - moved[0].y).dot(&along) / along.norm_squared();
        let k = layout::end_depth(self.layout.r, t);
        if 0.0 < k { layout::fit_shapes(&self.layout, &moved, k) } else { None }
    }

    fn detection(&self, i: usize, dot: &Dot, shift: &Pixel) -> (Detection, Dot) {
        // What the correction left in the test of the largest dots: below 2 % of the shift.
        let unsure = 0.02 * shift.norm();
        let variance = dot.sigma_px.powi(2) + self.config.sigma_floor_px.powi(2) + unsure * unsure;
        let feature = Feature { id: self.layout.ids[i], corner: 0 };
        (
            Detection {
                feature,
                pixel: dot.centroid - shift,
                sigma_px: variance.sqrt(),
                lens_sigma_px: 0.0,
                covariance_px2: None,
            },
            *dot,
        )
    }
}

fn check_size(image: &GrayImage, camera: Option<&Camera>) -> Result<(), DotError> {
    match camera.and_then(|c| c.size) {
        Some(size) if (size.width_px, size.height_px) != (image.width_px, image.height_px) => {
            Err(DotError::CameraSize {
                width_px: image.width_px,
                height_px: image.height_px,
                camera_width_px: size.width_px,
                camera_height_px: size.height_px,
            })
        }
        _ => Ok(()),
    }
}
