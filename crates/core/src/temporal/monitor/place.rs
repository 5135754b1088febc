//! Errors that stay as long as the camera does, and how large a motion is beside them.
//!
//! Where in its pixel a corner lies, and in its block of a compressed image, moves it by as much in each image from one place: averaging does not
//! remove that, and a camera that moved has another such error. How large it is the residuals show, `PointErrors`; what a motion is
//! worth beside it, `Places`. docs/math/monitor.md section 12.

use super::{Monitor, Reading, is_numbers};
use crate::temporal::snapshot::numbers;
use crate::{Camera, Correspondence, Matrix6, Pose, Vector6};
use nalgebra::{Matrix2x6, Vector2};
use std::collections::BTreeMap;

/// Readings over which the scatter is taken, the error of a place, and the mean residual of a point.
const SCATTER_OVER: f64 = 200.0;
const PLACE_OVER: f64 = 20.0;
const RESIDUALS_OVER: f64 = 200.0;
/// A difference counts for no more than so many times the mean square: a step is no scatter.
const USUAL: f64 = 10.0;
/// The differences that show how readings scatter.
const FEW: f64 = 3.0;
/// The views of a place that show its mean residual.
const VIEWS: f64 = 10.0;
/// What a detector states of its variance shows in residuals, on the average: the rest is caution.
const SHOWN: f64 = 0.75;
/// The least of it that is presumed to stay.
const LEAST: f64 = 0.06;
/// Degrees of freedom that what is presumed counts for.
const PRESUMED: f64 = 4.0;
/// Mean residuals of one place that are larger than stated so many times are of the lens.
const MOST: f64 = 2.0;
/// Of a pose's errors that stay over those of residuals: of points of one fit, and of points that are measured one by one.
const SHARED: f64 = 2.0;
const APART: f64 = 0.8;

/// What stays of the errors of points, from their residuals where the camera is and where it was before.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PointErrors {
    now: BTreeMap<u64, Mean>,
    before: BTreeMap<u64, Mean>,
    /// Of places before that.
    known: Shares,
}

/// Residual of a point over the standard deviation by the image: mean, and mean square about it, of both coordinates together.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Mean {
    views: f64,
    mean: Vector2<f64>,
    square: f64,
}

/// Sums of residuals over the variances stated by the image.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Shares {
    stays: f64,
    scatters: f64,
    degrees_of_freedom: f64,
}

impl PointErrors {
    /// Residuals of a view of the place where the camera is, each over the standard deviation that the image states, by any name of its point.
    pub fn push(&mut self, residuals: impl Iterator<Item = (u64, Vector2<f64>)>) {
        for (point, residual) in residuals.filter(|(_, residual)| residual.iter().all(|x| x.is_finite())) {
            self.now.entry(point).or_default().push(&residual);
        }
    }

    /// The camera is at another place from here on.
    pub fn moved(&mut self) {
        let between = self.between();
        if 0.0 < between.degrees_of_freedom {
            self.known = between;
        }
        if self.now.values().any(Mean::is_known) {
            self.before = std::mem::take(&mut self.now);
        }
        self.now.clear();
    }

    /// Variance of what stays of a pose's errors over that which the image states: docs/math/monitor.md eq. (113). `is_shared`: whether points
    /// are measured by one fit, as the corners of a tag, so that a pose takes up more of their errors than their residuals show.
    pub fn staying(&self, is_shared: bool) -> f64 {
        let here = self.here();
        let (between, known) = (self.between(), self.known);
        let has_moved = 0.0 < between.degrees_of_freedom + known.degrees_of_freedom;
        let stays = match has_moved {
            true => presumed_and(&[between, known], here),
            false if here.stays <= MOST * here.degrees_of_freedom => presumed_and(&[here], here),
            false => presumed_and(&[], here),
        };
        stays * if is_shared { SHARED } else { APART }
    }

    /// Mean residuals where the camera is: what stays, and what the lens leaves.
    fn here(&self) -> Shares {
        let of_point = |mean: &Mean| (mean.mean.norm_squared() - mean.variance(), mean.scatter());
        Shares::of(self.now.values().filter(|mean| mean.is_known()).map(of_point))
    }

    /// Half of the difference of the mean residuals of two places: what the lens leaves is the same.
    fn between(&self) -> Shares {
        let of_point = |(point, now): (&u64, &Mean)| {
            let before = self.before.get(point).filter(|before| before.is_known() && now.is_known())?;
            let square = (now.mean - before.mean).norm_squared();
            let scatter = 0.5 * (now.scatter() + before.scatter());
            Some((0.5 * (square - now.variance() - before.variance()), scatter))
        };
        Shares::of(self.now.iter().filter_map(of_point))
    }
}

/// What stays where residuals scatter as `here`, before and after residuals of places are known.
fn presumed_and(places: &[Shares], here: Shares) -> f64 {
    let scatters = here.scatters / here.degrees_of_freedom.max(1.0);
    let (mut stays, mut weight) = (PRESUMED * (SHOWN - scatters).max(LEAST), PRESUMED);
    for place in places {
        (stays, weight) = (stays + place.stays, weight + place.degrees_of_freedom);
    }
    stays.max(0.0) / weight
}

impl Shares {
    /// Of points, both coordinates together; six numbers are of the pose.
    fn of(points: impl Iterator<Item = (f64, f64)>) -> Self {
        let mut sum = Shares { degrees_of_freedom: -6.0, ..Shares::default() };
        for (stays, scatters) in points {
            sum.stays += stays;
            sum.scatters += scatters;
            sum.degrees_of_freedom += 2.0;
        }
        if 0.0 < sum.degrees_of_freedom { sum } else { Shares::default() }
    }
}

impl Mean {
    fn push(&mut self, residual: &Vector2<f64>) {
        self.views = (self.views + 1.0).min(RESIDUALS_OVER);
        let off = residual - self.mean;
        self.mean += off / self.views;
        self.square += (off.dot(&(residual - self.mean)) - self.square) / self.views;
    }

    fn is_known(&self) -> bool {
        VIEWS <= self.views
    }

    /// Variance of a residual, and of the mean, both coordinates together.
    fn scatter(&self) -> f64 {
        self.square * self.views / (self.views - 1.0)
    }

    fn variance(&self) -> f64 {
        self.scatter() / self.views
    }
}

/// Covariance of a pose by errors in the image alone, of these standard deviations, px, where it is found with those of `seen`, which may hold
/// what the lens leaves: docs/math/monitor.md eq. (111). None where a point is outside the camera's field, or where the points fix no pose.
pub fn covariance_by_image(
    cam_from_target: &Pose,
    seen: &[Correspondence],
    image_sigmas_px: &[f64],
    camera: &Camera,
) -> Option<Matrix6> {
    let (mut information, mut pull) = (Matrix6::zeros(), Matrix6::zeros());
    for (c, image_px) in seen.iter().zip(image_sigmas_px) {
        let x_in_cam = cam_from_target * &c.x_in_target;
        let (_, by_point) = camera.project_with_jacobian(&x_in_cam)?;
        let mut by_motion = Matrix2x6::zeros();
        by_motion.fixed_columns_mut::<3>(0).copy_from(&(-by_point * x_in_cam.cross_matrix()));
        by_motion.fixed_columns_mut::<3>(3).copy_from(&by_point);
        let square = by_motion.transpose() * by_motion / c.sigma_px.powi(2);
        information += square;
        pull += square * (image_px / c.sigma_px).powi(2);
    }
    let covariance = information.cholesky()?.inverse();
    Some(covariance * pull * covariance)
}

/// The scatter of readings, and the part of their errors that stays with a position of the camera.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Places {
    /// Differences of readings in a row; half of their mean square, over the stated variance; whitened coordinates.
    differences: f64,
    scatter: Vector6,
    last: Option<Vector6>,
    /// Mean covariance of what stays; of so many readings.
    staying: Matrix6,
    readings: f64,
}

impl Places {
    fn push(&mut self, value: &Vector6, variance: &Vector6) {
        let Some(last) = self.last.replace(*value) else { return };
        let difference = value - last;
        let square = 0.5 * difference.component_mul(&difference).component_div(variance);
        let is_known = FEW < self.differences;
        let cut = |axis: usize| {
            let most = if is_known { USUAL * self.scatter[axis].max(1e-6) } else { f64::INFINITY };
            square[axis].min(most)
        };
        self.differences = (self.differences + 1.0).min(SCATTER_OVER);
        self.scatter += (Vector6::from_fn(|axis, _| cut(axis)) - self.scatter) / self.differences;
    }
}

impl Monitor {
    /// Sets the covariance of the part of a reading's errors that stays as long as the camera does: from here on a motion is known no better than
    /// this allows at either place, and as well as readings scatter. Where it is never said, as well as readings are stated to be.
    pub fn stays(&mut self, covariance: &Matrix6) {
        if covariance.iter().all(|x| x.is_finite()) {
            self.places.readings = (self.places.readings + 1.0).min(PLACE_OVER);
            self.places.staying += (covariance - self.places.staying) / self.places.readings;
        }
    }

    pub(super) fn scatters(&mut self, reading: &Reading) {
        if reading.is_consistent && is_numbers(reading) {
            // From the reference, whatever has been reported since.
            let motion = (self.reference.a_from_b * reading.a_from_b.inverse()).log();
            let whitened = self.test.whitened(&motion, &reading.covariance);
            self.places.push(&whitened.value, &whitened.variance);
        }
    }

    /// Of a motion between two places: docs/math/monitor.md eq. (114).
    pub(super) fn between_places(&self, levels: &Matrix6) -> Matrix6 {
        let Places { differences, scatter, staying, readings, .. } = &self.places;
        if *readings == 0.0 || *differences <= FEW {
            return *levels;
        }
        self.test.scattering(levels, scatter) + 2.0 * staying
    }
}

numbers!(Places { differences, scatter, last, staying, readings });
