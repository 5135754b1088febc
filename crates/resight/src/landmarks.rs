//! Measures with natural landmarks how a camera rotated since a reference image, when no target is in view.
//!
//! Corners of the reference (FAST) are found again by their BRIEF descriptors, or near the positions predicted by the last rotation, and then
//! aligned to a fraction of a pixel; `resight_core::temporal::relative_rotation` weights them. The scene is assumed to be distant, or the camera
//! to rotate about its own centre: a translation is not observed.
//!
//! reference ─► `select` ─► windows · now ─► `features` (coarse) ─► `patch` (sub-pixel) ─► `relative_rotation` ─► rotation, shift, covariance

mod draw;
mod features;
mod patch;
mod lens_error;
mod pyramid;
mod select;
mod parallax;

use crate::GrayImage;
use crate::locate::IntrinsicsCovariance;
pub use draw::draw;
use features::{Features, Pattern};
use nalgebra::{Matrix2, Matrix3, Vector2};
pub use parallax::{NoParallax, Parallax};
use patch::Aligned;
use pyramid::Reduced;
use resight_core::temporal::relative_rotation::{
    Landmark, RelativeRotation, RelativeRotationConfig, relative_rotation,
};
use resight_core::{Bearing, Camera, Error as CoreError};
use select::{LandmarkPatch, select};
use thiserror::Error;

/// Landmarks of a reference image.
pub struct Landmarks {
    camera: Camera,
    size_px: [u32; 2],
    marks: Vec<LandmarkPatch>,
    pattern: Pattern,
    features: Features,
    /// Directions of the features.
    bearings: Vec<Option<Bearing>>,
    /// The uncertainty of the intrinsics; `None` where they are exact.
    intrinsics: Option<IntrinsicsCovariance>,
}

/// The landmarks that an image shows.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkObservation {
    /// The rotation since the reference.
    pub relative_rotation: RelativeRotation,
    /// The motion of the image centre; `None` where it is not in the field of the lens any more.
    pub shift: Option<Shift>,
    /// Landmarks found again; `relative_rotation.used` lists those that were used.
    pub found: Vec<Found>,
    /// Number of landmarks that are in the image after the rotation.
    pub in_view: usize,
}

/// The motion of the image centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shift {
    /// Right and down, px.
    pub px: Vector2<f64>,
    /// Its covariance, px².
    pub covariance_px2: Matrix2<f64>,
}

/// A landmark found again.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Found {
    /// Its position in the reference, px.
    pub reference_px: Vector2<f64>,
    /// Its current position, px.
    pub now_px: Vector2<f64>,
}

/// Why an image cannot be a reference.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum LandmarksError {
    /// The image has too few landmarks.
    #[error(
        "the reference image has {seen} landmarks, {needed} are needed; use a sharp image, by day, with more to see"
    )]
    TooFew {
        /// Number of landmarks found.
        seen: usize,
        /// Number needed.
        needed: usize,
    },
    /// The image has another size than the camera's.
    #[error("the reference image: {0}")]
    Size(String),
}

/// Why an image gives no rotation.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum NotObserved {
    /// The image has another size than the reference.
    #[error(
        "the image is {}×{} px, the reference {}×{}; take a reference of the same size", seen_px[0], seen_px[1], needed_px[0],
        needed_px[1]
    )]
    Size {
        /// Columns and rows.
        seen_px: [u32; 2],
        /// Of the reference.
        needed_px: [u32; 2],
    },
    /// The image has too few corners.
    #[error("{corners} corners in this image, {needed} are needed: it is dark, covered, blurred or empty")]
    Blank {
        /// Number of corners in the image.
        corners: usize,
        /// Number needed.
        needed: usize,
    },
    /// Too few landmarks agree with one rotation.
    #[error(
        "{agreeing} of {landmarks} landmarks found again, {needed} are needed: another scene, something in front of it, or very other light"
    )]
    TooFew {
        /// Number of landmarks that agree.
        agreeing: usize,
        /// Number that could have been found: all landmarks of the reference, or those in the image after the rotation.
        landmarks: usize,
        /// Number needed.
        needed: usize,
    },
}

/// Least number of landmarks that must agree.
pub const LEAST: usize = 15;
/// Least share of the visible landmarks that must be found and agree: some agree by chance.
const LEAST_SHARE: f64 = 0.15;
/// Least number of landmarks in a reference: half of them may be hidden later.
const LEAST_IN_REFERENCE: usize = 2 * LEAST;
/// Largest residual of a landmark that agrees with a rotation, px of the image.
const FINE_PX: f64 = 1.0;
/// The same limit in the reduced image, in its pixels.
const COARSE_PX: f64 = 1.0;
/// The same limit for corners found by their descriptors, px of the reduced image: their positions are whole pixels.
const CORNER_PX: f64 = 2.0;
/// A window is searched for this far from its expected position, in its own pixels.
const REACH_PX: f64 = 4.0;
/// Error that is not visible in a window (interpolation, lens), px.
const FLOOR_PX: f64 = 0.02;

/// Error common to all landmarks from interpolation at a quarter of a pixel, standard deviation, px: measured on ten photographs rotated by
/// known angles, docs/math/turn.md eq. (12).
const FRACTION_PX: f64 = 0.002;

impl Landmarks {
    /// Selects the landmarks of an image taken by `camera` (at the size of this image).
    ///
    /// # Errors
    /// An image of another size than the camera's, or with too few landmarks.
    pub fn new(picture: &GrayImage, camera: &Camera) -> Result<Self, LandmarksError> {
        let camera = crate::formats::check_image_size(camera, picture.width_px, picture.height_px)
            .map_err(LandmarksError::Size)?;
        let reduced = Reduced::new(picture);
        let marks = select(picture, &reduced, &camera);
        if marks.len() < LEAST_IN_REFERENCE {
            return Err(LandmarksError::TooFew { seen: marks.len(), needed: LEAST_IN_REFERENCE });
        }
        let pattern = Pattern::new();
        let features = Features::of(&reduced, &pattern);
        let bearings = features.pixels(&reduced).iter().map(|pixel| camera.bearing(pixel).ok()).collect();
        let size_px = [picture.width_px, picture.height_px];
        Ok(Landmarks { camera, size_px, marks, pattern, features, bearings, intrinsics: None })
    }

    /// Sets the covariance of the intrinsics, whose effect the covariances of rotations include from now on: docs/math/turn.md eq. (14).
    pub fn with_intrinsics(mut self, intrinsics: Option<IntrinsicsCovariance>) -> Self {
        self.intrinsics = intrinsics;
        self
    }

    /// Returns the number of landmarks.
    pub fn count(&self) -> usize {
        self.marks.len()
    }

    /// Measures how the camera is rotated in `picture`. `near`, now_from_reference of the previous image, is tried first; without it, or where
    /// it fails, the landmarks are searched for in the whole image.
    ///
    /// # Errors
    /// Why this image gives no rotation: no contrast, another scene, another size.
    pub fn observe(
        &self,
        picture: &GrayImage,
        near: Option<&Matrix3<f64>>,
    ) -> Result<LandmarkObservation, NotObserved> {
        let seen_px = [picture.width_px, picture.height_px];
        if seen_px != self.size_px {
            return Err(NotObserved::Size { seen_px, needed_px: self.size_px });
        }
        let reduced = Reduced::new(picture);
        let followed =
            near.and_then(|near| self.follow(&reduced, near).filter(RelativeRotation::is_consistent));
        let start = match followed {
            Some(relative_rotation) => relative_rotation.now_from_reference,
            None => self.search(&reduced)?,
        };
        self.measure(picture, &start)
    }

    /// Searches the whole image by descriptors.
    fn search(&self, picture: &Reduced) -> Result<Matrix3<f64>, NotObserved> {
        let now = Features::of(picture, &self.pattern);
        if now.len() < LEAST {
            return Err(NotObserved::Blank { corners: now.len(), needed: LEAST });
        }
        let scale = f64::from(picture.factor);
        let landmark = |m: features::Match| {
            Some(Landmark {
                in_reference: self.bearings[m.reference]?,
                pixel: m.pixel,
                covariance_px2: Matrix2::identity() * (0.5 * scale).powi(2),
                neighbourhood: 0,
                bent_px: Vector2::zeros(),
                unobserved_px: Matrix2::zeros(),
            })
        };
        let matched: Vec<Landmark> =
            self.features.matches(&now, picture).into_iter().filter_map(landmark).collect();
        let config = RelativeRotationConfig::with_threshold_px(CORNER_PX * scale);
        let found = relative_rotation(&matched, &self.camera, None, &config).map_err(|e| self.refused(&e))?;
        let followed = self.follow(picture, &found.now_from_reference);
        Ok(followed
            .map_or(found.now_from_reference, |relative_rotation| relative_rotation.now_from_reference))
    }

    /// Searches windows of the reduced image near the positions predicted by a rotation.
    fn follow(&self, picture: &Reduced, near: &Matrix3<f64>) -> Option<RelativeRotation> {
        let scale = f64::from(picture.factor);
        let find = |mark: &LandmarkPatch| {
            let (patch, centre) = mark.coarse.as_ref()?;
            let (at, slope) = self.expected(mark, near)?;
            // The centre of the window is a whole pixel of the reduced image, slightly beside the landmark.
            let start = picture.reduced(at + slope * (centre - mark.pixel));
            let aligned = patch.find(&picture.image, start, &slope, REACH_PX)?;
            let pixel = picture.full_size(aligned.pixel) - slope * (centre - mark.pixel);
            let covariance = aligned.covariance * scale * scale;
            Some(landmark(mark, &Aligned { pixel, covariance, bent_px: aligned.bent_px * scale }))
        };
        let found: Vec<Landmark> = self.marks.iter().filter_map(find).collect();
        relative_rotation(
            &found,
            &self.camera,
            Some(near),
            &RelativeRotationConfig::with_threshold_px(COARSE_PX * scale),
        )
        .ok()
    }

    /// Aligns full-size windows, starting from a rotation that is accurate to about a pixel.
    fn measure(&self, picture: &GrayImage, near: &Matrix3<f64>) -> Result<LandmarkObservation, NotObserved> {
        let align = |(mark, at, slope): (&LandmarkPatch, Vector2<f64>, Matrix2<f64>)| {
            let aligned = mark.fine.find(picture, at, &slope, REACH_PX)?;
            let found = Found { reference_px: mark.pixel, now_px: aligned.pixel };
            Some((landmark(mark, &aligned), found))
        };
        let expected: Vec<_> = self
            .marks
            .iter()
            .filter_map(|mark| self.expected(mark, near).map(|(at, slope)| (mark, at, slope)))
            .filter(|(_, at, _)| self.is_inside(at))
            .collect();
        let in_view = expected.len();
        let (mut landmarks, found): (Vec<Landmark>, Vec<Found>) =
            expected.into_iter().filter_map(align).unzip();
        let config = RelativeRotationConfig::with_threshold_px(FINE_PX);
        let fit = |landmarks: &[Landmark], near: &Matrix3<f64>| {
            relative_rotation(landmarks, &self.camera, Some(near), &config).map_err(|e| self.refused(&e))
        };
        let first = fit(&landmarks, near)?.now_from_reference;
        landmarks.iter_mut().for_each(|landmark| self.read_between_pixels(landmark, &first));
        let mut relative_rotation = fit(&landmarks, &first)?;
        let (agreeing, needed) =
            (relative_rotation.used.len(), LEAST.max((LEAST_SHARE * in_view as f64).ceil() as usize));
        if agreeing < needed {
            return Err(NotObserved::TooFew { agreeing, landmarks: in_view, needed });
        }
        let shift = self.shift(&relative_rotation);
        if let Some(intrinsics) = &self.intrinsics {
            let used: Vec<&Found> = relative_rotation.used.iter().filter_map(|i| found.get(*i)).collect();
            let added = lens_error::covariance(
                &used,
                &relative_rotation.now_from_reference,
                &self.camera,
                intrinsics,
            );
            relative_rotation.covariance += added;
        }
        Ok(LandmarkObservation { shift, relative_rotation, found, in_view })
    }

    /// Adds the error of interpolation common to all landmarks, along rows and along columns: docs/math/turn.md eq. (12). It uses the predicted
    /// position of a landmark, not the found one, whose own error must not decide.
    fn read_between_pixels(&self, landmark: &mut Landmark, relative_rotation: &Matrix3<f64>) {
        let Some(at) = self.camera.project(&(relative_rotation * landmark.in_reference.into_inner())) else {
            return;
        };
        landmark.unobserved_px =
            Matrix2::from_diagonal(&at.map(|x| FRACTION_PX * (core::f64::consts::TAU * x).sin()));
    }

    fn refused(&self, reason: &CoreError) -> NotObserved {
        let agreeing = match reason {
            CoreError::NoConsensus { best, .. } => *best,
            CoreError::TooFewPoints { seen, .. } => *seen,
            _ => 0,
        };
        NotObserved::TooFew { agreeing, landmarks: self.marks.len(), needed: LEAST }
    }

    /// Predicts the position of a landmark from a rotation, and the affine map of its neighbourhood (pixels now by pixels of the reference).
    fn expected(
        &self,
        mark: &LandmarkPatch,
        relative_rotation: &Matrix3<f64>,
    ) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let (at, slope) =
            self.camera.project_with_jacobian(&(relative_rotation * mark.bearing.into_inner()))?;
        let columns = mark.by_pixel.map(|by| slope * (relative_rotation * by));
        Some((at, Matrix2::from_columns(&columns)))
    }

    /// Returns whether a pixel is at least a window's width from the border.
    fn is_inside(&self, pixel: &Vector2<f64>) -> bool {
        let border = f64::from(patch::RADIUS + 4);
        let inside = |x: f64, size: u32| border < x && x < f64::from(size) - 1.0 - border;
        inside(pixel.x, self.size_px[0]) && inside(pixel.y, self.size_px[1])
    }

    fn shift(&self, relative_rotation: &RelativeRotation) -> Option<Shift> {
        let centre = Vector2::from(self.size_px.map(|size| 0.5 * (f64::from(size) - 1.0)));
        let y = relative_rotation.now_from_reference * self.camera.bearing(&centre).ok()?.into_inner();
        let (now, slope) = self.camera.project_with_jacobian(&y)?;
        let by_turn = slope * y.cross_matrix();
        Some(Shift {
            px: now - centre,
            covariance_px2: by_turn * relative_rotation.covariance * by_turn.transpose(),
        })
    }
}

fn landmark(mark: &LandmarkPatch, found: &Aligned) -> Landmark {
    Landmark {
        in_reference: mark.bearing,
        pixel: found.pixel,
        covariance_px2: found.covariance + Matrix2::identity() * FLOOR_PX * FLOOR_PX,
        neighbourhood: mark.neighbourhood,
        bent_px: found.bent_px,
        unobserved_px: Matrix2::zeros(),
    }
}
