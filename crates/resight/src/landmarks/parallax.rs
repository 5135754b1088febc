//! Finds the landmarks of an image again after the camera has moved through the scene, for the relative pose of both images.
//!
//! corners by their descriptors (coarse) ─► `two_view` ─► where each landmark should be, with the depth of its neighbours ─► `patch` (sub-pixel) ─► `two_view`

use super::features::Features;
use super::pyramid::Reduced;
use super::{LEAST, Landmarks, REACH_PX};
use crate::GrayImage;
use nalgebra::Matrix2;
use resight_core::multiview::two_view::{BearingPair, TwoView, TwoViewConfig, two_view};
use resight_core::{Bearing, Camera, Error, Pose};
use thiserror::Error;

/// Standard deviation of a corner found by its descriptor, px of the reduced image: its position is a whole pixel.
const CORNER_PX: f64 = 0.6;
/// Error that is not visible in a window (perspective within it, interpolation), px.
const FLOOR_PX: f64 = 0.1;
/// Standard deviation stated for the reference of a window, px: its position is exact by definition.
const TEMPLATE_PX: f64 = 0.01;
/// Corners with a depth that are asked where a landmark is.
const NEIGHBOURS: usize = 3;
/// Scale of a window between both images that is accepted.
const SCALES: (f64, f64) = (0.5, 2.0);

/// Share of the points that must move through the view: the others are far away, or move along with the camera.
const LEAST_MOVING: f64 = 0.5;

/// The relative pose of two images.
#[derive(Debug, Clone, PartialEq)]
pub struct Parallax {
    /// Landmarks found again.
    pub pairs: Vec<BearingPair>,
    /// The motion of the camera, up to the length of its translation.
    pub view: TwoView,
}

/// Why two images give no direction of motion.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum NoParallax {
    /// The image has another size.
    #[error("an image has another size than the one before")]
    Size,
    /// Few corners: dark, blurred, or covered.
    #[error("{corners} corners, {needed} are needed: an image is dark, covered, blurred or empty")]
    Blank {
        /// Number of corners.
        corners: usize,
        /// Number needed.
        needed: usize,
    },
    /// The camera stood still or only rotated.
    #[error("the images show no parallax: the camera stood still or only rotated")]
    Still,
    /// A part of the view moves, most of it does not.
    #[error(
        "{moving} of {agreeing} points move through the view, half are needed: the camera stands still before traffic, or traffic that moves along covers the view"
    )]
    Mixed {
        /// Number of points that move.
        moving: usize,
        /// Number of points that agree with one motion of the camera.
        agreeing: usize,
    },
    /// Points of one plane only: two motions explain them.
    #[error("all points lie in one plane, which two motions explain")]
    Ambiguous,
    /// No motion explains enough of the points.
    #[error("too few points agree with one motion of the camera")]
    Disagree,
}

/// A corner with its depths, in units of the distance moved.
struct Corner {
    bearing: Bearing,
    depth: f64,
}

impl Landmarks {
    /// Measures the motion of the camera from this image to `picture`; `near`, the motion before, is tried first.
    ///
    /// # Errors
    /// Why there is none.
    pub fn parallax(&self, picture: &GrayImage, near: Option<&Pose>) -> Result<Parallax, NoParallax> {
        if [picture.width_px, picture.height_px] != self.size_px {
            return Err(NoParallax::Size);
        }
        let coarse = self.coarse(picture, near)?;
        let corners = depths(&coarse);
        let pairs: Vec<BearingPair> = self
            .marks
            .iter()
            .filter_map(|mark| self.refound(mark, picture, &coarse.view, &corners))
            .collect();
        let view = two_view(&pairs, Some(&coarse.view.second_from_first), &TwoViewConfig::default())
            .map_err(|reason| refused(&reason))?;
        let share = view.parallax_share(&pairs);
        if share < LEAST_MOVING {
            let agreeing = view.used.len();
            return Err(NoParallax::Mixed { moving: (share * agreeing as f64).round() as usize, agreeing });
        }
        match view.is_ambiguous() {
            true => Err(NoParallax::Ambiguous),
            false => Ok(Parallax { pairs, view }),
        }
    }

    /// By descriptors alone.
    fn coarse(&self, picture: &GrayImage, near: Option<&Pose>) -> Result<Parallax, NoParallax> {
        let reduced = Reduced::new(picture);
        let now = Features::of(&reduced, &self.pattern);
        let fewest = now.len().min(self.features.len());
        if fewest < 2 * LEAST {
            return Err(NoParallax::Blank { corners: fewest, needed: 2 * LEAST });
        }
        let sigma_px = CORNER_PX * f64::from(reduced.factor);
        let pair = |found: super::features::Match| {
            let (first, second) = (self.bearings[found.reference]?, self.camera.bearing(&found.pixel).ok()?);
            self.pair(first, second, [sigma_px, sigma_px])
        };
        let pairs: Vec<BearingPair> =
            self.features.matches(&now, &reduced).into_iter().filter_map(pair).collect();
        let view = two_view(&pairs, near, &TwoViewConfig::default()).map_err(|reason| refused(&reason))?;
        Ok(Parallax { pairs, view })
    }

    fn pair(&self, first: Bearing, second: Bearing, sigma_px: [f64; 2]) -> Option<BearingPair> {
        let [sigma_first_rad, sigma_second_rad] = [(first, sigma_px[0]), (second, sigma_px[1])]
            .map(|(bearing, px)| px / px_per_rad(&self.camera, &bearing));
        let is_number = sigma_first_rad.is_finite() && sigma_second_rad.is_finite();
        is_number.then_some(BearingPair { first, second, sigma_first_rad, sigma_second_rad })
    }

    /// A landmark in the other image, at the depth of one of its nearest corners.
    fn refound(
        &self,
        mark: &super::LandmarkPatch,
        picture: &GrayImage,
        coarse: &TwoView,
        corners: &[Corner],
    ) -> Option<BearingPair> {
        let pose = &coarse.second_from_first;
        nearest(corners, &mark.bearing).into_iter().find_map(|depth| {
            let x = pose.rotation * mark.bearing.into_inner() * depth + pose.translation;
            let (at, slope) = self.camera.project_with_jacobian(&x)?;
            let columns = mark.by_pixel.map(|by| slope * (pose.rotation * by * depth));
            let slope = Matrix2::from_columns(&columns);
            let scale = slope.determinant().abs().sqrt();
            if !((SCALES.0..SCALES.1).contains(&scale) && self.is_inside(&at)) {
                return None;
            }
            let aligned = mark.fine.find(picture, at, &slope, REACH_PX)?;
            let second = self.camera.bearing(&aligned.pixel).ok()?;
            let sigma_px = (0.5 * aligned.covariance.trace() + FLOOR_PX * FLOOR_PX).sqrt();
            self.pair(mark.bearing, second, [TEMPLATE_PX, sigma_px])
        })
    }
}

/// Corners that agree with the motion, with their depths.
fn depths(coarse: &Parallax) -> Vec<Corner> {
    let corner = |i: &usize| {
        let pair = &coarse.pairs[*i];
        let [depth, _] = coarse.view.depths(pair)?;
        (0.0 < depth).then_some(Corner { bearing: pair.first, depth })
    };
    coarse.view.used.iter().filter_map(corner).collect()
}

/// Depths of the nearest corners, the median first.
fn nearest(corners: &[Corner], bearing: &Bearing) -> Vec<f64> {
    let mut all: Vec<(f64, f64)> =
        corners.iter().map(|corner| (-corner.bearing.dot(bearing), corner.depth)).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    all.truncate(NEIGHBOURS);
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    let middle = all.len() / 2;
    let mut depths: Vec<f64> = all.into_iter().map(|(_, depth)| depth).collect();
    if middle < depths.len() {
        depths.swap(0, middle);
    }
    depths
}

fn px_per_rad(camera: &Camera, bearing: &Bearing) -> f64 {
    let slope = camera.project_with_jacobian(&bearing.into_inner());
    slope.map_or(f64::NAN, |(_, slope)| slope.norm() * core::f64::consts::FRAC_1_SQRT_2)
}

fn refused(reason: &Error) -> NoParallax {
    match reason {
        Error::DegenerateView { .. } => NoParallax::Still,
        _ => NoParallax::Disagree,
    }
}
