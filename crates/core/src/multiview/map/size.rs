//! The size of a target that contradicts the map: its distance from each camera, which is proportional to it, against where all cameras see it.
//!
//! ```text
//!   o_v  camera centre   ·   t_v  target's origin by the view alone, in the map's axes   ·   C  its place   ·   λ  true size over stated size
//!   o_v + λ t_v = C  for every view v                                                     docs/math/map.md eq. (3)
//! ```

use super::{Adjusted, MapProblem, resized};
use crate::least_squares::PivotedPose;
use crate::locate::problem::Problem;
use crate::locate::refine::{centroid, normal_equations};
use crate::locate::{Config, locate};
use crate::{Matrix6, Pose};
use nalgebra::{Matrix4, SMatrix, Vector3, Vector4};

/// A measured size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Size {
    /// True size over the size with which it was solved.
    pub(super) ratio: f64,
}

/// Smaller errors of a size are printing errors.
const SIZE_OFF: f64 = 0.005;
/// A size explains a contradiction where it lowers χ² by the square of so many standard deviations.
const EXPLAINS_SIGMAS: f64 = 6.0;
/// … and the rest is at most so many times what pixels explain: rows leave out the errors of the cameras' poses.
const MOST_NOISE: f64 = 9.0;
/// Least number of views.
const ENOUGH_VIEWS: usize = 4;

/// Returns the size that the target has if it stands at one place in all these observations; none where that does not explain them.
pub(super) fn size(problem: &MapProblem, adjusted: &Adjusted, observations: &[usize]) -> Option<Size> {
    let cam_from_map = adjusted.cam_from_map(problem.n_views);
    let rows: Vec<Row> =
        observations.iter().filter_map(|i| row(problem, adjusted, &cam_from_map, *i)).collect();
    if rows.len() < ENOUGH_VIEWS {
        return None;
    }
    let (found, chi2) = solved(&rows, None)?;
    let (_, chi2_as_stated) = solved(&rows, Some(1.0))?;
    let degrees_of_freedom = 3 * rows.len() - 4;
    let noise = (chi2 / degrees_of_freedom as f64).max(1.0);
    let (ratio, variance) = found;
    let sigma = (variance * noise).sqrt();
    let is_other = 0.0 < ratio && SIZE_OFF < (ratio - 1.0).abs() - 4.0 * sigma;
    let explains = EXPLAINS_SIGMAS * EXPLAINS_SIGMAS * noise < chi2_as_stated - chi2;
    (is_other && explains && noise < MOST_NOISE).then_some(Size { ratio })
}

struct Row {
    o: Vector3<f64>,
    t: Vector3<f64>,
    information: SMatrix<f64, 3, 3>,
}

fn row(problem: &MapProblem, adjusted: &Adjusted, cam_from_map: &[Option<Pose>], i: usize) -> Option<Row> {
    let observation = &problem.observations[i];
    let cam_from_map = cam_from_map[observation.view]?;
    let seen = resized(&observation.seen, adjusted.sizes[observation.target]);
    let found = locate(&seen, problem.camera, &Config::default()).ok()?;
    let t = found.cam_from_target.translation;
    let (camera, pivot_in_cam) = camera_noise(problem, adjusted, observation.view, &cam_from_map)?;
    let noise = at(&t, &found.covariance) + at(&(t - pivot_in_cam), &camera);
    let map_from_cam = cam_from_map.inverse();
    let r = map_from_cam.rotation;
    let information = (r * noise * r.transpose()).try_inverse()?;
    Some(Row { o: map_from_cam.translation, t: r * t, information })
}

/// Returns the covariance of the camera's motion about a pivot, by the targets of its view, and the pivot, camera frame.
fn camera_noise(
    problem: &MapProblem,
    adjusted: &Adjusted,
    view: usize,
    cam_from_map: &Pose,
) -> Option<(Matrix6, Vector3<f64>)> {
    let seen = adjusted.seen_in(problem, view, None);
    let pivot = centroid(&seen);
    let place = PivotedPose::new(cam_from_map, &pivot);
    let information = normal_equations(&place, &pivot, &Problem::new(&seen, problem.camera))?.information();
    Some((information.cholesky()?.inverse(), place.pivot_in_cam))
}

/// Returns the covariance of a point: δx = ν + ω × x.
fn at(x: &Vector3<f64>, covariance: &Matrix6) -> SMatrix<f64, 3, 3> {
    let mut by = SMatrix::<f64, 3, 6>::zeros();
    by.fixed_view_mut::<3, 3>(0, 0).copy_from(&-x.cross_matrix());
    by.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
    by * covariance * by.transpose()
}

/// Returns λ with its variance, and χ²; with `held`, λ is that.
fn solved(rows: &[Row], held: Option<f64>) -> Option<((f64, f64), f64)> {
    // o = C − λ t: unknown are C and λ.
    let (mut h, mut g) = (Matrix4::<f64>::zeros(), Vector4::<f64>::zeros());
    let by = |row: &Row| {
        let mut by = SMatrix::<f64, 3, 4>::identity();
        by.set_column(3, &(if held.is_some() { Vector3::zeros() } else { -row.t }));
        by
    };
    let target = |row: &Row| row.o + row.t * held.unwrap_or(0.0);
    for row in rows {
        let weighted = by(row).tr_mul(&row.information);
        h += weighted * by(row);
        g += weighted * target(row);
    }
    if held.is_some() {
        h[(3, 3)] = 1.0;
    }
    let inverse = h.cholesky()?.inverse();
    let x = inverse * g;
    let chi2 = rows.iter().map(|row| {
        let e = target(row) - by(row) * x;
        e.dot(&(row.information * e))
    });
    let chi2: f64 = chi2.sum();
    chi2.is_finite().then_some(((x[3], inverse[(3, 3)]), chi2))
}
