//! The relation between a camera and its image: whether a pixel is in it, whether the intrinsics belong to it, and how they scale.

use super::{Camera, Lens};
use crate::{Error, Pixel};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Width and height of the images to which the intrinsics belong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageSize {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
}

/// Focal length divided by the longer image side: a whole-sphere fisheye has 0.16, a 1000 px image of 0.06° has 1000. Outside this range the
/// focal length is in another unit (mm, metres, normalised).
const FOCAL_TO_SIDE: core::ops::RangeInclusive<f64> = 0.02..=1000.0;

impl Camera {
    /// Creates a camera, and checks its intrinsics against the image size, when there is one.
    ///
    /// # Errors
    /// `InvalidCamera` for an empty image, a principal point outside it, or a focal length below 1/50 or above 1000 times
    /// the longer side.
    pub fn new(lens: impl Into<Lens>, size: Option<ImageSize>) -> Result<Camera, Error> {
        let camera = Camera { lens: lens.into(), size };
        if let Some(ImageSize { width_px, height_px }) = size {
            let (width, height) = (f64::from(width_px), f64::from(height_px));
            check_range("width_px", width, 1.0..=f64::INFINITY, "an image has at least one column")?;
            check_range("height_px", height, 1.0..=f64::INFINITY, "an image has at least one row")?;
            camera.check_against(width, height)?;
        }
        Ok(camera)
    }

    fn check_against(&self, width: f64, height: f64) -> Result<(), Error> {
        let Some(matrix) = self.matrix() else { return Ok(()) };
        let inside =
            "the principal point lies inside the image; check the image size, or leave it out for a crop";
        check_range("cx_px", matrix.cx_px, -0.5..=width - 0.5, inside)?;
        check_range("cy_px", matrix.cy_px, -0.5..=height - 0.5, inside)?;
        let side = width.max(height);
        let bounds = FOCAL_TO_SIDE.start() * side..=FOCAL_TO_SIDE.end() * side;
        let unit = "a focal length is between 1/50 and 1000 image sides; check that it is in pixels";
        check_range("fx_px", matrix.fx_px, bounds.clone(), unit)?;
        check_range("fy_px", matrix.fy_px, bounds, unit)
    }

    /// Returns whether the pixel is in the image, −½ ≤ u ≤ width − ½ and likewise v. True when the size is unknown; false for NaN.
    pub fn contains(&self, pixel: &Pixel) -> bool {
        let (width, height) = match self.size {
            Some(size) => (f64::from(size.width_px), f64::from(size.height_px)),
            None => (f64::INFINITY, f64::INFINITY),
        };
        let low = if self.size.is_some() { -0.5 } else { f64::NEG_INFINITY };
        (low..=width - 0.5).contains(&pixel.x) && (low..=height - 0.5).contains(&pixel.y)
    }

    /// Returns the camera for the same images resampled to another size.
    ///
    /// Pixel (0, 0) remains the centre of the top-left pixel: u' = (u + ½) s − ½ (camera.md eq. (20)).
    ///
    /// # Errors
    /// `InvalidCamera` when the size is unknown, zero, or of another aspect ratio (by a whole pixel or more: a crop).
    pub fn scaled_to(&self, width_px: u32, height_px: u32) -> Result<Camera, Error> {
        let Some(from) = self.size else {
            let needed = "the image size of the intrinsics must be known to scale them";
            return Err(Error::InvalidCamera { parameter: "width_px", seen: f64::NAN, needed });
        };
        let (w0, h0) = (f64::from(from.width_px), f64::from(from.height_px));
        let (w, h) = (f64::from(width_px), f64::from(height_px));
        let same = "the aspect ratio must stay that of the calibrated images; a crop moves the principal point instead";
        check_range("width_px", w, 1.0..=f64::INFINITY, "an image has at least one column")?;
        // Both sides may have been rounded, by half a pixel each, from one scale.
        let same_aspect = (w * h0 - h * w0).abs() <= 0.5 * (w0 + h0);
        if !(0.0 < h && same_aspect) {
            return Err(Error::InvalidCamera { parameter: "height_px", seen: h, needed: same });
        }
        let lens = self.scaled_lens(w / w0, h / h0)?;
        Ok(Camera { lens, size: Some(ImageSize { width_px, height_px }) })
    }

    fn scaled_lens(&self, sx: f64, sy: f64) -> Result<Lens, Error> {
        if let Lens::Photogrammetric(model) = &self.lens {
            return Ok(Lens::Photogrammetric(model.scaled((sx * sy).sqrt())?));
        }
        let mut values = self.parameters();
        for (i, s) in [sx, sy].into_iter().enumerate() {
            values[i].1 *= s;
            values[i + 2].1 = (values[i + 2].1 + 0.5) * s - 0.5;
        }
        let values: arrayvec::ArrayVec<f64, { super::MAX_PARAMETERS }> =
            values.into_iter().map(|(_, value)| value).collect();
        Ok(self.with_parameters(&values)?.lens)
    }
}

fn check_range(
    parameter: &'static str,
    seen: f64,
    bounds: core::ops::RangeInclusive<f64>,
    needed: &'static str,
) -> Result<(), Error> {
    if bounds.contains(&seen) {
        return Ok(());
    }
    Err(Error::InvalidCamera { parameter, seen, needed })
}
