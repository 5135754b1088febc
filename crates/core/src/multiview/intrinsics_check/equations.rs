//! The normal equations of all poses and some intrinsics, docs/math/frames.md eqs. (1)–(3).

use super::View;
use crate::camera::MAX_PARAMETERS;
use crate::least_squares::PivotedPose;
use crate::least_squares::shared::SharedEquations;
use crate::locate::refine::{centroid, information};
use crate::{Camera, Point};
use arrayvec::ArrayVec;
use nalgebra::{Matrix2x6, Vector2};

/// One free parameter as a direction in the space of intrinsics: (index, change per unit) of each parameter that takes part.
pub(super) type Direction = ArrayVec<(usize, f64), 2>;

/// Returns one direction for each parameter.
pub(super) fn every_parameter(camera: &Camera) -> Vec<Direction> {
    (0..camera.parameters().len()).map(|i| Direction::from_iter([(i, 1.0)])).collect()
}

/// Returns the pivots of the views: the centroids of their points.
pub(super) fn pivots(views: &[View]) -> Vec<Point> {
    views.iter().map(|view| centroid(&view.seen)).collect()
}

/// Returns the equations of all views at given poses; none where a point leaves the camera's field.
pub(super) fn equations(
    views: &[View],
    pivots: &[Point],
    places: &[PivotedPose],
    camera: &Camera,
    directions: &[Direction],
) -> Option<SharedEquations> {
    let mut sums = SharedEquations::new(directions.len());
    for ((view, pivot), place) in views.iter().zip(pivots).zip(places) {
        sums.next_view();
        for c in &view.seen {
            let y = place.rotation * (c.x_in_target - pivot);
            let x = y + place.pivot_in_cam;
            let (pixel, jacobian) = camera.project_with_jacobian(&x)?;
            let columns = camera.intrinsics_jacobian(&x)?;
            let mut by_motion = Matrix2x6::zeros();
            by_motion.fixed_view_mut::<2, 3>(0, 0).copy_from(&(-jacobian * y.cross_matrix()));
            by_motion.fixed_view_mut::<2, 3>(0, 3).copy_from(&jacobian);
            let along = |d: &Direction| d.iter().map(|(i, by)| columns[*i] * *by).sum::<Vector2<f64>>();
            let (u, v): (ArrayVec<f64, MAX_PARAMETERS>, ArrayVec<f64, MAX_PARAMETERS>) =
                directions.iter().map(along).map(|by| (by.x, by.y)).unzip();
            sums.add(&(c.pixel - pixel), &information(c, &jacobian), &by_motion, [&u, &v]);
        }
    }
    sums.chi2.is_finite().then_some(sums)
}
