//! Many views of four points at once: the answers of `locate`, several views in the lanes of one vector.
//!
//! A view takes the lanes when nothing about it is doubtful: a pinhole camera, three points on a line and one off it, a strong view,
//! two minima that are far apart, a straight likelihood, a residual that fits. Every other view, whatever is wrong with it,
//! goes to `locate` itself, so that there is one place for each decision; the lanes only prove that it need not be taken.
//!
//! The vectors are those of the machine it runs on (AVX-512, AVX2, NEON; single numbers elsewhere). No thread is started: callers
//! with several cores split the views.

mod lanes;
mod refine;
mod closed_form;
mod bend;
mod line_plus_one;

use crate::locate::{Config, PoseEstimate, locate};
use crate::solve::configuration::{Configuration, classify};
use crate::{Bearing, Camera, Correspondence, Error, Lens, Pixel, Point};
use nalgebra::{Unit, Vector3};

/// Something every view has: the same for all, or one for each.
#[derive(Debug, Clone, Copy)]
pub enum Given<'a, T> {
    /// All views share it.
    Shared(&'a T),
    /// One for each view, in their order.
    Each(&'a [T]),
}

impl<T> Given<'_, T> {
    /// That of a view; none beyond the end.
    fn of(&self, view: usize) -> Option<&T> {
        match self {
            Given::Shared(value) => Some(value),
            Given::Each(values) => values.get(view),
        }
    }

    fn check(&self, what: &'static str, views: usize) -> Result<(), Error> {
        match self {
            Given::Each(values) if values.len() != views => {
                Err(Error::CountMismatch { what, seen: values.len(), needed: views })
            }
            _ => Ok(()),
        }
    }
}

/// Views of four known points, all taken with one camera.
#[derive(Debug, Clone, Copy)]
pub struct Views<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Places of the four points in the target frame, metres.
    pub points_in_target: Given<'a, [Point; 4]>,
    /// Where each view shows them, pixels.
    pub pixels: &'a [[Pixel; 4]],
    /// Standard deviation of each pixel coordinate, by point.
    pub sigma_px: Given<'a, [f64; 4]>,
}

/// The answer of `locate` with the default configuration for every view, in their order; `answers` is cleared first. Returns how
/// many views went to the single path, which takes ten to twenty times as long.
///
/// An answer is that of the single path to rounding, and so is an error: a view that has none leaves the others alone.
///
/// # Errors
/// `CountMismatch` when targets or sigmas are given for each view, but not for as many as there are.
pub fn locate_each(views: &Views, answers: &mut Vec<Result<PoseEstimate, Error>>) -> Result<usize, Error> {
    let count = views.pixels.len();
    views.points_in_target.check("points_in_target", count)?;
    views.sigma_px.check("sigma_px", count)?;
    answers.clear();
    answers.reserve(count);
    match &views.camera.lens {
        Lens::Pinhole(model) => Ok(line_plus_one::locate_each(views, &model.matrix, answers)),
        _ => {
            answers.extend((0..count).map(|view| alone(views, view)));
            Ok(count)
        }
    }
}

/// A view on the single path.
#[cold]
fn alone(views: &Views, view: usize) -> Result<PoseEstimate, Error> {
    let seen = correspondences(views, view)?;
    locate(&seen, views.camera, &Config::default())
}

fn correspondences(views: &Views, view: usize) -> Result<[Correspondence; 4], Error> {
    let (Some(points), Some(sigmas)) = (views.points_in_target.of(view), views.sigma_px.of(view)) else {
        return Err(Error::TooFewPoints { seen: 0, needed: 4 });
    };
    let pixels = &views.pixels[view];
    let one = |k: usize| Correspondence::new(views.camera, points[k], pixels[k], sigmas[k]);
    Ok([one(0)?, one(1)?, one(2)?, one(3)?])
}

/// The points in order along the line, then the one off it; none where they are not in this configuration.
fn order_of(points: &[Point; 4]) -> Option<[usize; 4]> {
    let bearing = Bearing::from(Unit::new_unchecked(Vector3::z()));
    let somewhere = |k: usize| Correspondence {
        x_in_target: points[k],
        pixel: Pixel::new(k as f64, 0.0),
        bearing,
        sigma_px: 1.0,
        sigma_m: 0.0,
        covariance_px2: None,
    };
    match classify(&[0, 1, 2, 3].map(somewhere)) {
        Ok(Configuration::LinePlusOne { order }) => Some(order),
        _ => None,
    }
}
