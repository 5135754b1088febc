//! Positions and lengths measured on a plane in one image, and their uncertainty: docs/math/advise.md eqs. (8)–(10).

use crate::{Camera, Error, Matrix6, Pixel, Point, Pose, Vector6};
use nalgebra::{Matrix2x3, Matrix3, Matrix3x2, Matrix3x6, Vector3};

/// A plane of the target frame: the points x with n · x = offset_m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Its unit normal n.
    pub normal_in_target: Vector3<f64>,
    /// Its offset along the normal.
    pub offset_m: f64,
}

/// A point of a plane as measured in one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundPoint {
    /// Its position, target frame.
    pub x_in_target: Point,
    /// Derivative of the position with respect to the pose's small left motion `[rotation_rad; translation_m]`, 3×6.
    pub by_motion: Matrix3x6<f64>,
    /// Derivative of the position with respect to the image point, 3×2, m/px.
    pub by_pixel: Matrix3x2<f64>,
}

/// A length measured on a plane in one image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundLength {
    /// The length.
    pub length_m: f64,
    /// Derivative of the length with respect to the pose's small left motion.
    pub by_motion: Vector6,
    /// Its variance due to the two image points.
    pub image_point_variance_m2: f64,
}

/// At a flatter angle (sine of the angle between ray and plane) nothing is measured on a plane.
const GRAZING: f64 = 1e-6;

impl Plane {
    /// Returns the plane z = `z_m`.
    pub fn level(z_m: f64) -> Self {
        Plane { normal_in_target: Vector3::z(), offset_m: z_m }
    }

    /// Returns where the ray of a pixel meets the plane in front of the camera, target frame; `None` where it does not.
    pub fn seen_at(&self, camera: &Camera, cam_from_target: &Pose, pixel: &Pixel) -> Option<Point> {
        let bearing = camera.bearing(pixel).ok()?;
        let (origin, ray) =
            (cam_from_target.origin(), cam_from_target.rotation.tr_mul(&bearing.into_inner()));
        let (sine, height_m) =
            (self.normal_in_target.dot(&ray), self.offset_m - self.normal_in_target.dot(&origin));
        let depth_m = height_m / sine;
        (GRAZING < sine.abs() && 0.0 < depth_m).then(|| origin + ray * depth_m)
    }

    /// Returns a point of the plane with its derivatives with respect to pose and pixel; `None` where it is not visible.
    pub fn point(&self, camera: &Camera, cam_from_target: &Pose, x_in_target: &Point) -> Option<GroundPoint> {
        let x_in_cam = cam_from_target * x_in_target;
        let (_, by_point): (_, Matrix2x3<f64>) = camera.project_with_jacobian(&x_in_cam)?;
        let along = self.axes();
        let by_shift = by_point * cam_from_target.rotation * along;
        let by_pixel = along * by_shift.try_inverse()?;
        let mut moved = Matrix3x6::zeros();
        moved.fixed_view_mut::<3, 3>(0, 0).copy_from(&-x_in_cam.cross_matrix());
        moved.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
        let by_motion = -(by_pixel * by_point * moved);
        let is_finite = by_motion.sum().is_finite() && by_pixel.sum().is_finite();
        is_finite.then_some(GroundPoint { x_in_target: *x_in_target, by_motion, by_pixel })
    }

    /// Returns the length between two points of the plane; `sigma_px` is the standard deviation of each image point.
    ///
    /// # Errors
    /// `InvalidSetting` when an end is not visible or the two coincide.
    pub fn length(
        &self,
        camera: &Camera,
        cam_from_target: &Pose,
        ends_in_target: [Point; 2],
        sigma_px: f64,
    ) -> Result<GroundLength, Error> {
        let refused = |seen: f64, needed| Error::InvalidSetting { setting: "length", seen, needed };
        let end = |i: usize| {
            self.point(camera, cam_from_target, &ends_in_target[i])
                .ok_or(refused(i as f64, "the end of this number (0 or 1) cannot be seen by the camera"))
        };
        let (a, b) = (end(0)?, end(1)?);
        let between = b.x_in_target - a.x_in_target;
        let length_m = between.norm();
        let u = between.try_normalize(0.0).ok_or(refused(length_m, "its two ends must differ"))?;
        let image_point = u.tr_mul(&a.by_pixel).norm_squared() + u.tr_mul(&b.by_pixel).norm_squared();
        Ok(GroundLength {
            length_m,
            by_motion: (b.by_motion - a.by_motion).tr_mul(&u),
            image_point_variance_m2: image_point * sigma_px * sigma_px,
        })
    }

    /// Returns two unit vectors along the plane, as columns.
    fn axes(&self) -> Matrix3x2<f64> {
        let n = &self.normal_in_target;
        let far = if n.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
        let first = (far - n * n.dot(&far)).normalize();
        Matrix3x2::from_columns(&[first, n.cross(&first)])
    }
}

impl GroundPoint {
    /// Returns the covariance of the position, m², target frame, for a pose of this covariance and an image point of `sigma_px`.
    pub fn covariance_m2(&self, covariance: &Matrix6, sigma_px: f64) -> Matrix3<f64> {
        self.by_motion * covariance * self.by_motion.transpose()
            + self.by_pixel * self.by_pixel.transpose() * (sigma_px * sigma_px)
    }

    /// Returns the standard deviation in the worst direction.
    pub fn worst_sigma_m(&self, covariance: &Matrix6, sigma_px: f64) -> f64 {
        self.covariance_m2(covariance, sigma_px).symmetric_eigenvalues().max().max(0.0).sqrt()
    }
}

impl GroundLength {
    /// Returns the standard deviation of the length for a pose of this covariance.
    pub fn sigma_m(&self, covariance: &Matrix6) -> f64 {
        (self.by_motion.dot(&(covariance * self.by_motion)) + self.image_point_variance_m2).max(0.0).sqrt()
    }
}
