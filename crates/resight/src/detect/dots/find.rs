//! Finds every dot of an image, whatever they belong to.

use super::components::{Component, Labeller};
use super::{Dot, DotConfig, DotError, Polarity, centroid, threshold};
use crate::GrayImage;
use crate::detect::stop;

/// Finds dots; keeps its buffers between images.
pub struct DotFinder {
    polarity: Polarity,
    min_contrast: f64,
    classes: Vec<u8>,
    labeller: Labeller,
    scratch: centroid::Scratch,
}

/// Regions smaller than this are specks, px.
const MIN_AREA_PX: f64 = 2.0;
/// Beyond this number, the least conspicuous specks are discarded before any is measured.
pub(super) const MAX_MEASURED: usize = 1200;

impl Default for DotFinder {
    /// Returns a finder of dots of either polarity.
    fn default() -> Self {
        DotFinder::new(Polarity::Either, DotConfig::default().min_contrast)
    }
}

impl DotFinder {
    /// Returns a finder of dots that differ from their surroundings by at least `min_contrast` grey levels.
    pub fn new(polarity: Polarity, min_contrast: f64) -> Self {
        DotFinder {
            polarity,
            min_contrast,
            classes: Vec::new(),
            labeller: Labeller::default(),
            scratch: centroid::Scratch::default(),
        }
    }

    /// Returns every dot in the image, target or not, the most conspicuous first (contrast times radius).
    pub fn dots(&mut self, image: &GrayImage) -> Result<Vec<Dot>, DotError> {
        let (width, height) = (image.width_px as usize, image.height_px as usize);
        if image.data.len() != width * height {
            let seen = image.data.len();
            return Err(DotError::BufferSize { width_px: image.width_px, height_px: image.height_px, seen });
        }
        if stop::is_stopped() {
            return Ok(Vec::new());
        }
        #[cfg(test)]
        crate::detect::work::count(image.data.len());
        let noise = threshold::noise_sigma(image);
        threshold::classify(image, self.min_contrast.max(10.0 * noise), &mut self.classes);
        let max_area = 0.25 * (width * height) as f64;
        let mut regions = self.labeller.components(&self.classes, width, MIN_AREA_PX, max_area);
        regions.retain(|c| self.may_be_dot(c));
        if MAX_MEASURED < regions.len() {
            regions.sort_by(|a, b| b.area.total_cmp(&a.area));
            regions.truncate(MAX_MEASURED);
        }
        let (classes, scratch) = (&self.classes, &mut self.scratch);
        let mut dots: Vec<Dot> =
            regions.iter().filter_map(|c| centroid::measure(image, classes, c, noise, scratch)).collect();
        dots.retain(|d| self.min_contrast.max(6.0 * noise) <= d.contrast.abs());
        let weight = |d: &Dot| d.contrast.abs() * d.moments_px2.determinant().max(0.0).powf(0.25);
        dots.sort_by(|a, b| weight(b).total_cmp(&weight(a)));
        Ok(dots)
    }

    fn may_be_dot(&self, c: &Component) -> bool {
        let wanted = match self.polarity {
            Polarity::Either => true,
            Polarity::DarkOnLight => c.class == threshold::DARK,
            Polarity::LightOnDark => c.class == threshold::LIGHT,
        };
        // Letters, rings and dots that touch a neighbour fill their ellipse less; few pixels fill it badly anyway.
        let least_fill = 0.98 - 1.2 / c.area.sqrt();
        wanted && !c.at_border && (c.area < 20.0 || least_fill < c.ellipse_fill())
    }
}
