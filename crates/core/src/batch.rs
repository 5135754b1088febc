//! Solves many views of three or four points at once: the answers of `locate`, several views in the lanes of one vector.
//!
//! Four points, three of them on a line, seen by a pinhole camera: the lanes compute both minima of the closed form's candidates. Where all
//! tests are then clear (a strong view, two minima far apart, a straight likelihood, a residual that fits) these are the answer. Otherwise
//! `doubtful` continues as `search` does, with the starts of many views side by side, and `locate::answer::conclude` decides. Three points: P3P
//! view by view, with the poses of many views refined side by side. Every other view, including invalid ones, is solved by `locate` itself, so
//! that each decision has one implementation; the lanes only prove that it is not needed.
//!
//! | proven | by (tests/batch.rs, unless another is named) |
//! | --- | --- |
//! | every field of an answer, all minima included, is that of `locate` to rounding | `views_answer_together_as_each_alone` |
//! | also for targets and sigmas that change from view to view, points in any order | `targets_and_sigmas_of_each_view` |
//! | three points: the same set of poses, covariances and weights | `views_of_three_points_answer_together_as_each_alone` |
//! | a bad view gives its own error and leaves the others alone to the last bit | `a_bad_view_leaves_its_neighbours_alone`, `a_bad_view_of_three_points_leaves_its_neighbours_alone` |
//! | an answer does not depend on how many views there are | `every_length_gives_the_same_answers` |
//! | every width of vector gives the same | `every_width_gives_the_same_answers` in batch/line_plus_one.rs |
//!
//! The vectors are those of the machine (AVX-512, AVX2, NEON; single numbers elsewhere). No thread is started: callers with several cores divide
//! the views.

mod lanes;
mod refine;
mod closed_form;
mod bend;
mod group;
mod starts;
mod doubtful;
mod line_plus_one;
mod three;

use crate::camera::CameraMatrix;
use crate::locate::{Config, PoseEstimate, locate};
use crate::solve::configuration::{Geometry, describe_geometry};
use crate::{Bearing, Camera, Correspondence, Error, Lens, Pixel, Point};
use arrayvec::ArrayVec;
use nalgebra::{Unit, Vector3};

/// A property of every view: the same for all, or one for each.
#[derive(Debug)]
pub enum Given<'a, T> {
    /// All views share it.
    Shared(&'a T),
    /// One value for each view, in their order.
    Each(&'a [T]),
    /// One of several values, by an index for each view.
    Numbered {
        /// All values.
        values: &'a [T],
        /// The index of the value for each view.
        numbers: &'a [u32],
    },
}

// A derived implementation would require T to be `Clone` as well, although only a reference is held.
impl<T> Clone for Given<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Given<'_, T> {}

impl<'a, T> Given<'a, T> {
    /// Returns the value for a view; `None` beyond the end.
    fn of(&self, view: usize) -> Option<&'a T> {
        match self {
            Given::Shared(value) => Some(value),
            Given::Each(values) => values.get(view),
            Given::Numbered { values, numbers } => values.get(*numbers.get(view)? as usize),
        }
    }

    fn check(&self, what: &'static str, views: usize) -> Result<(), Error> {
        match self {
            Given::Each(values) if values.len() != views => {
                Err(Error::CountMismatch { what, seen: values.len(), needed: views })
            }
            Given::Numbered { numbers, .. } if numbers.len() != views => {
                Err(Error::CountMismatch { what, seen: numbers.len(), needed: views })
            }
            _ => Ok(()),
        }
    }
}

/// Views of N known points, taken with one camera or with many.
#[derive(Debug, Clone, Copy)]
pub struct Views<'a, const N: usize = 4> {
    /// The camera.
    pub camera: Given<'a, Camera>,
    /// Positions of the points in the target frame, metres.
    pub points_in_target: Given<'a, [Point; N]>,
    /// The points' positions in each view, pixels.
    pub pixels: &'a [[Pixel; N]],
    /// Standard deviation of each pixel coordinate, by point.
    pub sigma_px: Given<'a, [f64; N]>,
}

/// The answer of a view.
type Answer = Result<PoseEstimate, Error>;

/// Solves every view as `locate` does with the default configuration, in their order; `answers` is cleared first. Returns the number of views
/// that took the single path, which is five to fifteen times as slow.
///
/// Answers and errors equal those of the single path except for rounding: a view with an error does not affect the others.
///
/// # Errors
/// `CountMismatch` when cameras, targets or sigmas are given for each view, but in another number.
pub fn locate_each(views: &Views, answers: &mut Vec<Result<PoseEstimate, Error>>) -> Result<usize, Error> {
    hold_open(views.pixels.len(), answers);
    locate_each_with(views, |view, answer| answers[view] = answer).inspect_err(|_| answers.clear())
}

/// Solves every view, and passes each answer to `take` with the index of its view as soon as it is found, in any order: an answer has 2 kB.
///
/// # Errors
/// The errors of `locate_each`, before any answer.
pub fn locate_each_with(
    views: &Views,
    mut take: impl FnMut(usize, Result<PoseEstimate, Error>),
) -> Result<usize, Error> {
    views.check()?;
    Ok(line_plus_one::locate_each(views, &mut take))
}

/// Solves views of three points, as `locate_each`. The up to four poses that fit exactly are sorted by their rounding errors, possibly not as in
/// `locate`: as sets, with their weights, they agree.
///
/// # Errors
/// The errors of `locate_each`.
pub fn locate_each_of_three(
    views: &Views<3>,
    answers: &mut Vec<Result<PoseEstimate, Error>>,
) -> Result<usize, Error> {
    hold_open(views.pixels.len(), answers);
    locate_each_of_three_with(views, |view, answer| answers[view] = answer).inspect_err(|_| answers.clear())
}

/// Solves views of three points, as `locate_each_with`.
///
/// # Errors
/// The errors of `locate_each`, before any answer.
pub fn locate_each_of_three_with(
    views: &Views<3>,
    mut take: impl FnMut(usize, Result<PoseEstimate, Error>),
) -> Result<usize, Error> {
    views.check()?;
    Ok(three::locate_each(views, &mut take))
}

fn hold_open(n: usize, answers: &mut Vec<Answer>) {
    answers.clear();
    answers.resize_with(n, || Err(Error::NoSolution { n_points: 0 }));
}

impl<'a, const N: usize> Views<'a, N> {
    fn check(&self) -> Result<(), Error> {
        self.camera.check("camera", self.pixels.len())?;
        self.points_in_target.check("points_in_target", self.pixels.len())?;
        self.sigma_px.check("sigma_px", self.pixels.len())
    }

    /// Returns the camera of a view if the lanes support its lens model.
    fn pinhole(&self, view: usize) -> Option<(&'a Camera, &'a CameraMatrix)> {
        let camera = self.camera.of(view)?;
        match &camera.lens {
            Lens::Pinhole(model) => Some((camera, &model.matrix)),
            _ => None,
        }
    }
}

/// Solves a view on the single path.
#[cold]
fn alone<const N: usize>(views: &Views<N>, view: usize) -> Result<PoseEstimate, Error> {
    let (seen, camera) = correspondences(views, view)?;
    locate(&seen, camera, &Config::default())
}

fn correspondences<'a, const N: usize>(
    views: &Views<'a, N>,
    view: usize,
) -> Result<([Correspondence; N], &'a Camera), Error> {
    let too_few = Error::TooFewPoints { seen: 0, needed: N };
    let (points, sigmas) = (views.points_in_target.of(view), views.sigma_px.of(view));
    let (Some(points), Some(sigmas), Some(camera)) = (points, sigmas, views.camera.of(view)) else {
        return Err(too_few);
    };
    let pixels = &views.pixels[view];
    let one = |k: usize| Correspondence::new(camera, points[k], pixels[k], sigmas[k]);
    let seen: ArrayVec<Correspondence, N> = (0..N).map(one).collect::<Result<_, _>>()?;
    Ok((seen.into_inner().map_err(|_| too_few)?, camera))
}

/// Returns the verdict of `locate` on the target, which does not depend on a view.
fn geometry_of<const N: usize>(points: &[Point; N]) -> Result<Geometry, Error> {
    let bearing = Bearing::from(Unit::new_unchecked(Vector3::z()));
    describe_geometry(&core::array::from_fn::<_, N, _>(|k| Correspondence {
        x_in_target: points[k],
        pixel: Pixel::new(k as f64, 0.0),
        bearing,
        sigma_px: 1.0,
        sigma_m: 0.0,
        covariance_px2: None,
    }))
}
