//! Detection × target × camera → correspondences, the input of every solver.

#[cfg(feature = "std")]
use crate::target::{Feature, Target};
use crate::{Bearing, Camera, Error, Pixel, Point};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;
#[cfg(feature = "std")]
use std::collections::HashMap;

/// A named feature found in an image.
#[cfg(feature = "std")]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detection {
    /// The point of the target.
    pub feature: Feature,
    /// Its position in the image, pixels.
    pub pixel: Pixel,
    /// Standard deviation of each pixel coordinate due to the image alone: noise, blur, and errors of the detector.
    pub sigma_px: f64,
    /// Standard deviation of each pixel coordinate due to the lens model; 0 where `sigma_px` includes it. [`correspond`] adds it, once.
    pub lens_sigma_px: f64,
    /// Covariance of the pixel, where it differs between directions; replaces `sigma_px`.
    pub covariance_px2: Option<PixelCovariance>,
}

#[cfg(feature = "std")]
impl Detection {
    /// Returns the standard deviation of each pixel coordinate against the camera model, including the error of the lens model.
    pub fn total_sigma_px(&self) -> f64 {
        self.sigma_px.hypot(self.lens_sigma_px)
    }
}

/// Covariance of a pixel, such as that of the centre of an ellipse: large across a blurred or slanted dot, small along it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelCovariance {
    /// Variance of u, px².
    pub uu_px2: f64,
    /// Covariance of u and v, px².
    pub uv_px2: f64,
    /// Variance of v, px².
    pub vv_px2: f64,
}

impl PixelCovariance {
    /// Returns the root mean square of the two standard deviations, px: that of isotropic noise with the same total variance.
    pub fn sigma_px(&self) -> f64 {
        (0.5 * (self.uu_px2 + self.vv_px2)).sqrt()
    }

    /// Returns the covariance of (v, u).
    #[cfg(feature = "std")]
    pub(crate) const fn with_axes_exchanged(&self) -> Self {
        PixelCovariance { uu_px2: self.vv_px2, uv_px2: self.uv_px2, vv_px2: self.uu_px2 }
    }

    /// Returns the smaller eigenvalue, px²; positive for a valid covariance.
    pub(crate) fn least_variance_px2(&self) -> f64 {
        let (mean, half) = (0.5 * (self.uu_px2 + self.vv_px2), 0.5 * (self.uu_px2 - self.vv_px2));
        // det / largest is exact where mean − hypot would cancel.
        (self.uu_px2 * self.vv_px2 - self.uv_px2 * self.uv_px2) / (mean + half.hypot(self.uv_px2))
    }
}

/// A known point and its observation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correspondence {
    /// Position in the target frame, metres.
    pub x_in_target: Point,
    /// Position in the image, pixels (or the camera's own unit).
    pub pixel: Pixel,
    /// Unit vector towards it, camera frame; computed from `pixel` by the camera.
    pub bearing: Bearing,
    /// Standard deviation of each pixel coordinate. Where `covariance_px2` is given, it only weights the starts of the search.
    pub sigma_px: f64,
    /// Covariance of the pixel, where it is not `sigma_px`² in every direction.
    pub covariance_px2: Option<PixelCovariance>,
    /// Standard deviation of each coordinate of `x_in_target`, metres; 0 when exact.
    pub sigma_m: f64,
}

impl Correspondence {
    /// Creates a correspondence of an exactly known point and a pixel. Fails outside the camera's valid field.
    pub fn new(camera: &Camera, x_in_target: Point, pixel: Pixel, sigma_px: f64) -> Result<Self, Error> {
        let bearing = camera.bearing(&pixel)?;
        Ok(Correspondence { x_in_target, pixel, bearing, sigma_px, covariance_px2: None, sigma_m: 0.0 })
    }

    /// Replaces the standard deviation of the pixel by a covariance.
    pub fn with_covariance(self, covariance_px2: PixelCovariance) -> Self {
        Correspondence { covariance_px2: Some(covariance_px2), sigma_px: covariance_px2.sigma_px(), ..self }
    }

    /// Returns uu, uv, vv of the pixel's covariance, px².
    pub(crate) fn pixel_covariance(&self) -> [f64; 3] {
        match self.covariance_px2 {
            Some(c) => [c.uu_px2, c.uv_px2, c.vv_px2],
            None => [self.sigma_px * self.sigma_px, 0.0, self.sigma_px * self.sigma_px],
        }
    }

    /// Returns whether the point is exact and its noise isotropic, so that its residual is whitened by one division.
    #[inline(always)]
    pub(crate) fn is_plain(&self) -> bool {
        self.sigma_m == 0.0 && self.covariance_px2.is_none()
    }
}

/// Finds observations that repeat an earlier one: the same point at the same pixel, both to the last digit.
#[cfg(feature = "std")]
#[derive(Debug, Clone, Default)]
pub struct Observations {
    first: HashMap<[u64; 6], usize>,
}

#[cfg(feature = "std")]
impl Observations {
    /// Returns the index of the first observation of this point (metres) at this pixel: `index` where this is the first. Observations with
    /// different `view` (a frame, camera or target) are never equal.
    pub fn first(&mut self, view: usize, x_in_target: &Point, pixel: &Pixel, index: usize) -> usize {
        let bits = |x: f64| (x + 0.0).to_bits(); // −0 and 0 are one number.
        let (x, p) = (x_in_target, pixel);
        let key = [view as u64, bits(x.x), bits(x.y), bits(x.z), bits(p.x), bits(p.y)];
        *self.first.entry(key).or_insert(index)
    }
}

/// Returns, for each observation of one view, the index of the first one that is equal to it: its own index where it repeats none. Equal
/// observations count once: each further copy would reduce the covariance, although nothing more was measured.
#[cfg(feature = "std")]
pub fn first_of_equals(seen: &[Correspondence]) -> Vec<usize> {
    let mut known = Observations::default();
    seen.iter().enumerate().map(|(i, c)| known.first(0, &c.x_in_target, &c.pixel, i)).collect()
}

/// Returns the observations of one view without those that repeat an earlier one.
#[cfg(feature = "std")]
pub fn without_equals(mut seen: Vec<Correspondence>) -> Vec<Correspondence> {
    let first = first_of_equals(&seen);
    let mut index = 0..;
    seen.retain(|_| index.next().is_some_and(|i| first[i] == i));
    seen
}

/// A detection that took no part, with the reason.
#[cfg(feature = "std")]
#[derive(Debug, Clone, PartialEq)]
pub struct Skipped {
    /// The feature.
    pub feature: Feature,
    /// The reason: outside the valid field, or `None` when the target has no such feature.
    pub reason: Option<Error>,
}

/// Joins detections with the target's points; what cannot be used is returned with its reason. What the lens model leaves is added to the sigmas
/// here and nowhere else.
#[cfg(feature = "std")]
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
        let lens_px2 = d.lens_sigma_px * d.lens_sigma_px;
        match Correspondence::new(camera, known.position, d.pixel, d.total_sigma_px()) {
            Ok(c) => {
                let with_lens = |covariance: PixelCovariance| PixelCovariance {
                    uu_px2: covariance.uu_px2 + lens_px2,
                    vv_px2: covariance.vv_px2 + lens_px2,
                    ..covariance
                };
                let c = d.covariance_px2.map_or(c, |covariance| c.with_covariance(with_lens(covariance)));
                seen.push((d.feature, Correspondence { sigma_m: known.sigma_m, ..c }));
            }
            Err(reason) => skipped.push(Skipped { feature: d.feature, reason: Some(reason) }),
        }
    }
    (seen, skipped)
}
