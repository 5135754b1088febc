//! The covariance of a point on a plane from one more image point: docs/math/survey.md eq. (18).

use super::Adjusted;
use crate::Point;
use nalgebra::{Matrix2xX, Matrix3, Vector3};

impl Adjusted {
    /// Returns the covariance, m², of the position that one more image point of `sigma_px` in a photograph would give a point of the plane near
    /// `x_in_world`: the share of the image point, and that of photograph, lens and plane with all their correlations. None where one of them is
    /// undetermined, the point is outside the photograph's field, or its ray runs along the plane.
    pub fn image_point_on_plane_covariance_m2(
        &self,
        photo: usize,
        plane: usize,
        x_in_world: &Point,
        sigma_px: f64,
    ) -> Option<Matrix3<f64>> {
        let pose = self.cam_from_world(photo)?;
        let at = self.layout.has_plane(plane).then(|| self.state.planes[plane])?;
        let camera = self.state.camera_of_photo[photo];
        let lens = &self.state.lenses[camera];
        let x = pose * *x_in_world;
        let (_, by_x) = lens.camera.project_with_jacobian(&x)?;
        let (by_turn, by_world) = (by_x * -x.cross_matrix(), by_x * pose.rotation);
        let inverse =
            Matrix3::from_rows(&[by_world.row(0).into(), by_world.row(1).into(), at.normal.transpose()])
                .try_inverse()?;
        // One column for each unknown: its effect on the pixel in the first two rows, on the distance from the plane in the third.
        let mut unknowns: Vec<(usize, Vector3<f64>)> = Vec::with_capacity(16);
        if let Some(first) = self.layout.photo[photo] {
            unknowns.extend((0..3).map(|k| (first + k, Vector3::new(by_turn[(0, k)], by_turn[(1, k)], 0.0))));
            unknowns.extend((0..3).map(|k| (first + 3 + k, Vector3::new(by_x[(0, k)], by_x[(1, k)], 0.0))));
        }
        if !lens.z.is_empty() {
            let by_z = Matrix2xX::from_columns(&lens.camera.intrinsics_jacobian(&x)?) * &lens.root;
            let first = self.layout.lens[camera];
            unknowns.extend(
                (0..by_z.ncols()).map(|k| (first + k, Vector3::new(by_z[(0, k)], by_z[(1, k)], 0.0))),
            );
        }
        unknowns.extend(self.by_plane(plane, x_in_world));
        let mut v = Matrix3::from_diagonal(&Vector3::new(sigma_px * sigma_px, sigma_px * sigma_px, 0.0));
        for (i, by_i) in &unknowns {
            for (j, by_j) in &unknowns {
                v += by_i * by_j.transpose() * self.covariance.at(*i, *j);
            }
        }
        let covariance = inverse * v * inverse.transpose();
        covariance.sum().is_finite().then_some(covariance)
    }

    /// Returns the derivatives of the point's distance from the plane by the plane's unknowns.
    fn by_plane(&self, plane: usize, x_in_world: &Point) -> Vec<(usize, Vector3<f64>)> {
        let at = &self.state.planes[plane];
        let off = x_in_world - at.pivot;
        let tilts =
            self.layout.tilt[plane].map(|first| [0, 1].map(|k| (first + k, at.tangents()[k].dot(&off))));
        let height = self.layout.height[plane].map(|at| (at, -1.0));
        tilts.into_iter().flatten().chain(height).map(|(i, by)| (i, Vector3::z() * by)).collect()
    }
}
