//! The normal equations of all poses, some intrinsics and the shape of a flat target, docs/math/frames.md eqs. (1)–(3).

use super::View;
use crate::least_squares::PivotedPose;
use crate::least_squares::shared::{MAX_SHARED, SharedEquations};
use crate::locate::refine::{centroid, information};
use crate::multiview::flat_target::Shape;
use crate::{Camera, Correspondence, Point};
use arrayvec::ArrayVec;
use nalgebra::{Matrix2x6, Vector2};

/// One free parameter as a direction in the space of intrinsics: (index, change per unit) of each parameter that takes part.
pub(in crate::multiview) type Direction = ArrayVec<(usize, f64), 2>;

/// Returns one direction for each parameter.
pub(super) fn every_parameter(camera: &Camera) -> Vec<Direction> {
    (0..camera.parameters().len()).map(|i| Direction::from_iter([(i, 1.0)])).collect()
}

/// Returns the pivots of the views: the centroids of their points.
pub(super) fn pivots(views: &[View]) -> Vec<Point> {
    views.iter().map(|view| centroid(&view.seen)).collect()
}

/// Returns the equations of all views at given poses, the shape's values after those of the directions; none where a point leaves the camera's field.
pub(super) fn equations(
    views: &[View],
    pivots: &[Point],
    places: &[PivotedPose],
    camera: &Camera,
    directions: &[Direction],
    shape: Option<&Shape>,
) -> Option<SharedEquations> {
    let mut sums = SharedEquations::new(directions.len() + shape.map_or(0, Shape::n));
    for ((view, pivot), place) in views.iter().zip(pivots).zip(places) {
        sums.next_view();
        let model = PointModel { camera, directions, shape, pivot, place };
        for c in &view.seen {
            model.add(&mut sums, c, 1.0)?;
        }
    }
    sums.chi2.is_finite().then_some(sums)
}

/// How the pixel of a point follows from the pose of its view and from what all views share.
pub(in crate::multiview) struct PointModel<'a> {
    pub(in crate::multiview) camera: &'a Camera,
    pub(in crate::multiview) directions: &'a [Direction],
    pub(in crate::multiview) shape: Option<&'a Shape>,
    pub(in crate::multiview) pivot: &'a Point,
    pub(in crate::multiview) place: &'a PivotedPose,
}

impl PointModel<'_> {
    /// Adds an observed point with a weight to the current view of `sums`; `None` where it leaves the camera's field.
    pub(in crate::multiview) fn add(
        &self,
        sums: &mut SharedEquations,
        c: &Correspondence,
        weight: f64,
    ) -> Option<()> {
        let x_in_target = self.shape.map_or(c.x_in_target, |shape| shape.at(&c.x_in_target));
        let y = self.place.rotation * (x_in_target - self.pivot);
        let x = y + self.place.pivot_in_cam;
        let (pixel, jacobian) = self.camera.project_with_jacobian(&x)?;
        let columns = self.camera.intrinsics_jacobian(&x)?;
        let mut by_motion = Matrix2x6::zeros();
        by_motion.fixed_view_mut::<2, 3>(0, 0).copy_from(&(-jacobian * y.cross_matrix()));
        by_motion.fixed_view_mut::<2, 3>(0, 3).copy_from(&jacobian);
        let along = |d: &Direction| d.iter().map(|(i, by)| columns[*i] * *by).sum::<Vector2<f64>>();
        let of_shape = self.shape.map(|shape| {
            let by = shape.derivatives(&c.x_in_target).map(|d| jacobian * (self.place.rotation * d));
            by.into_iter().take(shape.n())
        });
        let (mut u, mut v) = (ArrayVec::<f64, MAX_SHARED>::new(), ArrayVec::<f64, MAX_SHARED>::new());
        for by in self.directions.iter().map(along).chain(of_shape.into_iter().flatten()) {
            u.try_push(by.x).ok()?;
            v.try_push(by.y).ok()?;
        }
        sums.add(&(c.pixel - pixel), &(information(c, &jacobian) * weight), &by_motion, [&u, &v]);
        Some(())
    }
}
