//! Rigid transforms `b_from_a` and their small motions.
//!
//! Notation: x_in_b = b_from_a · x_in_a = R x_in_a + t. A small motion ξ = [ω; ν] = `[rotation_rad; translation_m]`
//! acts on the left, in frame b: b_from_a ← Exp(ξ) b_from_a, so to first order x_in_b ← x_in_b + ω × x_in_b + ν.
//! Every 6×6 covariance in this library is the covariance of such a ξ. Derivations: docs/math/pose.md.

use crate::{Matrix6, Point, Vector6};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3, Vector4};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Below this angle the series of `exp` and `log` are exact to rounding: θ⁵/120 < ε up to θ = 1.9e-3
/// (docs/math/pose.md eq. (6)).
const SMALL_ANGLE_RAD: f64 = 1e-3;

/// A rigid transform between two named frames, always called `b_from_a`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Rotation matrix R, orthonormal to rounding.
    pub rotation: Matrix3<f64>,
    /// Translation t, metres: the origin of frame a seen in frame b.
    pub translation: Vector3<f64>,
}

impl Pose {
    /// The transform that changes nothing.
    pub fn identity() -> Self {
        Pose { rotation: Matrix3::identity(), translation: Vector3::zeros() }
    }

    /// From a rotation matrix (3×3, orthonormal) and a translation (metres).
    pub fn new(rotation: Matrix3<f64>, translation: Vector3<f64>) -> Self {
        Pose { rotation, translation }
    }

    /// From a quaternion `[w, x, y, z]` of any nonzero length, and a translation in metres.
    pub fn from_quaternion_wxyz(wxyz: [f64; 4], translation: Vector3<f64>) -> Self {
        let [w, x, y, z] = wxyz;
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        Pose { rotation: rotation.to_rotation_matrix().into_inner(), translation }
    }

    /// Unit quaternion `[w, x, y, z]` of the rotation, w ≥ 0.
    pub fn quaternion_wxyz(&self) -> [f64; 4] {
        let [w, x, y, z] = quaternion_of(&self.rotation).into();
        let sign = if w < 0.0 { -1.0 } else { 1.0 };
        [sign * w, sign * x, sign * y, sign * z]
    }

    /// Homogeneous 4×4 matrix, row by row.
    pub fn matrix(&self) -> [[f64; 4]; 4] {
        let (r, t) = (&self.rotation, &self.translation);
        let row = |i: usize| [r[(i, 0)], r[(i, 1)], r[(i, 2)], t[i]];
        [row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    }

    /// `a_from_b`.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Pose { rotation, translation: -(rotation * self.translation) }
    }

    /// The origin of frame b, in frame a: for `cam_from_world` the camera's position in the world, metres.
    pub fn origin(&self) -> Point {
        -(self.rotation.tr_mul(&self.translation))
    }

    /// Angle of the rotation between two poses, radians, accurate near 0 and near π.
    pub fn angle_to_rad(&self, other: &Pose) -> f64 {
        log_rotation(&(self.rotation * other.rotation.transpose())).norm()
    }

    /// Exp(ξ), ξ = `[rotation_rad; translation_m]`.
    pub fn exp(motion: &Vector6) -> Self {
        let w: Vector3<f64> = motion.fixed_rows::<3>(0).into();
        let v: Vector3<f64> = motion.fixed_rows::<3>(3).into();
        let (a, b, c) = rodrigues_coefficients(w.norm());
        let k = w.cross_matrix();
        let kk = k * k;
        let rotation = Matrix3::identity() + k * a + kk * b;
        let translation = v + k * v * b + kk * v * c;
        Pose { rotation, translation }
    }

    /// Log: the ξ = `[rotation_rad; translation_m]` with Exp(ξ) = self; rotation part of length ≤ π.
    pub fn log(&self) -> Vector6 {
        let w = log_rotation(&self.rotation);
        let k = w.cross_matrix();
        let theta = w.norm();
        let d = if theta < SMALL_ANGLE_RAD {
            1.0 / 12.0 + theta * theta / 720.0
        } else {
            let (a, b, _) = rodrigues_coefficients(theta);
            (1.0 - a / (2.0 * b)) / (theta * theta)
        };
        let v = self.translation - k * self.translation * 0.5 + k * k * self.translation * d;
        Vector6::new(w.x, w.y, w.z, v.x, v.y, v.z)
    }

    /// Exp(ξ) · self, with the rotation made orthonormal again so that many steps do not drift.
    pub fn moved(&self, motion: &Vector6) -> Self {
        let moved = Pose::exp(motion) * *self;
        Pose { rotation: orthonormalized(&moved.rotation), translation: moved.translation }
    }

    /// Ad: maps a small motion of frame a into frame b; `b_from_a · Exp(ξ_a) = Exp(Ad ξ_a) · b_from_a`,
    /// docs/math/pose.md eq. (9).
    pub fn adjoint(&self) -> Matrix6 {
        let r = &self.rotation;
        let tr = self.translation.cross_matrix() * r;
        let mut ad = Matrix6::zeros();
        ad.fixed_view_mut::<3, 3>(0, 0).copy_from(r);
        ad.fixed_view_mut::<3, 3>(3, 3).copy_from(r);
        ad.fixed_view_mut::<3, 3>(3, 0).copy_from(&tr);
        ad
    }

    /// Covariance of `self.inverse()` (left, in frame a) from that of `self` (left, in frame b).
    pub fn inverse_covariance(&self, covariance: &Matrix6) -> Matrix6 {
        let ad = self.inverse().adjoint();
        symmetric(&(ad * covariance * ad.transpose()))
    }

    /// Covariance of `c_from_b · b_from_a` (left, in frame c); self is `c_from_b`. The two are taken as independent.
    pub fn product_covariance(&self, covariance: &Matrix6, covariance_b_from_a: &Matrix6) -> Matrix6 {
        let ad = self.adjoint();
        symmetric(&(covariance + ad * covariance_b_from_a * ad.transpose()))
    }
}

impl core::ops::Mul for Pose {
    type Output = Pose;
    /// `c_from_b * b_from_a` is `c_from_a`.
    fn mul(self, b_from_a: Pose) -> Pose {
        Pose {
            rotation: self.rotation * b_from_a.rotation,
            translation: self.rotation * b_from_a.translation + self.translation,
        }
    }
}

impl core::ops::Mul<&Point> for &Pose {
    type Output = Point;
    /// `b_from_a * x_in_a` is `x_in_b`.
    fn mul(self, x_in_a: &Point) -> Point {
        self.rotation * x_in_a + self.translation
    }
}

impl core::ops::Mul<Point> for Pose {
    type Output = Point;
    fn mul(self, x_in_a: Point) -> Point {
        self.rotation * x_in_a + self.translation
    }
}

/// sinθ/θ, (1 − cosθ)/θ², (θ − sinθ)/θ³: the coefficients of Rodrigues' formula, docs/math/pose.md eqs. (5)–(6).
fn rodrigues_coefficients(theta: f64) -> (f64, f64, f64) {
    let t2 = theta * theta;
    if theta < SMALL_ANGLE_RAD {
        return (1.0 - t2 / 6.0, 0.5 - t2 / 24.0, 1.0 / 6.0 - t2 / 120.0);
    }
    let (half_sin, sin) = ((0.5 * theta).sin(), theta.sin());
    (sin / theta, 2.0 * half_sin * half_sin / t2, (theta - sin) / (t2 * theta))
}

/// Rotation vector of a rotation matrix, through the quaternion: accurate at 0 and at π alike.
fn log_rotation(rotation: &Matrix3<f64>) -> Vector3<f64> {
    let [w, x, y, z]: [f64; 4] = quaternion_of(rotation).into();
    let v = Vector3::new(x, y, z) * if w < 0.0 { -1.0 } else { 1.0 };
    let s = v.norm();
    let scale = if s < SMALL_ANGLE_RAD { 2.0 + s * s / 3.0 } else { 2.0 * s.atan2(w.abs()) / s };
    v * scale
}

/// Largest entry of R Rᵀ − I of a rotation given in decimals.
pub(crate) const ROTATION_TOLERANCE: f64 = 1e-6;

/// Returns the largest entry of R Rᵀ − I; for a matrix that mirrors or is no number, at least 2.
pub(crate) fn off_rotation(r: &Matrix3<f64>) -> f64 {
    let off = (r * r.transpose() - Matrix3::identity()).amax();
    if 0.0 < r.determinant() { off } else { off.max(2.0) }
}

/// Unit quaternion `[w, x, y, z]` of a rotation matrix, by Shepperd's choice of the largest component.
fn quaternion_of(r: &Matrix3<f64>) -> Vector4<f64> {
    let trace = r.trace();
    let d = [trace, r[(0, 0)], r[(1, 1)], r[(2, 2)]];
    let largest = (0..4).fold(0, |best, i| if d[best] < d[i] { i } else { best });
    let q = if largest == 0 {
        Vector4::new(1.0 + trace, r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)])
    } else {
        let i = largest - 1;
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let mut q = Vector4::zeros();
        q[0] = r[(k, j)] - r[(j, k)];
        q[1 + i] = 1.0 + r[(i, i)] - r[(j, j)] - r[(k, k)];
        q[1 + j] = r[(j, i)] + r[(i, j)];
        q[1 + k] = r[(k, i)] + r[(i, k)];
        q
    };
    q / q.norm()
}

/// The rotation matrix nearest to one that is off by rounding: Gram–Schmidt on its rows.
pub(crate) fn orthonormalized(r: &Matrix3<f64>) -> Matrix3<f64> {
    let x = r.row(0).transpose().normalize();
    let y = r.row(1).transpose();
    let y = (y - x * x.dot(&y)).normalize();
    Matrix3::from_rows(&[x.transpose(), y.transpose(), x.cross(&y).transpose()])
}

/// (M + Mᵀ)/2: removes the rounding that makes a covariance asymmetric.
pub(crate) fn symmetric(m: &Matrix6) -> Matrix6 {
    (m + m.transpose()) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some_motions() -> Vec<Vector6> {
        let axis = Vector3::new(0.3, -0.8, 0.5).normalize();
        let t = Vector3::new(1.0, -2.0, 3.0);
        let angles = [0.0, 1e-12, 1e-6, 0.9e-3, 1.1e-3, 0.3, 2.0, 3.0, 3.13, core::f64::consts::PI - 1e-9];
        angles
            .iter()
            .map(|a| {
                let w = axis * *a;
                Vector6::new(w.x, w.y, w.z, t.x, t.y, t.z)
            })
            .collect()
    }

    #[test]
    fn log_undoes_exp_from_zero_to_pi() {
        for xi in some_motions() {
            assert!((Pose::exp(&xi).log() - xi).norm() < 2e-12, "{xi}");
        }
    }

    #[test]
    fn inverse_undoes() {
        for xi in some_motions() {
            let p = Pose::exp(&xi);
            let i = p * p.inverse();
            assert!((i.rotation - Matrix3::identity()).norm() + i.translation.norm() < 1e-14);
            assert!((p.origin() - p.inverse().translation).norm() < 1e-15);
        }
    }

    #[test]
    fn quaternion_round_trips_at_every_branch() {
        for xi in some_motions() {
            for swap in 0..3 {
                let xi = Vector6::new(xi[swap], xi[(swap + 1) % 3], xi[(swap + 2) % 3], xi[3], xi[4], xi[5]);
                let p = Pose::exp(&xi);
                let q = Pose::from_quaternion_wxyz(p.quaternion_wxyz(), p.translation);
                assert!((p.rotation - q.rotation).norm() < 1e-14);
            }
        }
    }

    /// b_from_a · Exp(ξ) = Exp(Ad ξ) · b_from_a holds exactly, for large ξ too.
    #[test]
    fn adjoint_moves_a_motion_through_a_pose() {
        for xi in some_motions().into_iter().filter(|xi| xi.fixed_rows::<3>(0).norm() < 2.5) {
            let p = Pose::exp(&Vector6::new(0.7, 0.1, -0.4, 3.0, 0.2, -1.0));
            let left = p * Pose::exp(&xi);
            let right = Pose::exp(&(p.adjoint() * xi)) * p;
            assert!(
                (left.rotation - right.rotation).norm() + (left.translation - right.translation).norm()
                    < 1e-12
            );
        }
    }

    /// Propagated covariance of the inverse equals the sample covariance of inverted samples.
    #[test]
    fn inverse_covariance_matches_linear_samples() {
        let p = Pose::exp(&Vector6::new(0.7, 0.1, -0.4, 3.0, 0.2, -1.0));
        let h = 1e-6;
        let jacobian = Matrix6::from_fn(|row, column| {
            let mut xi = Vector6::zeros();
            xi[column] = h;
            ((Pose::exp(&xi) * p).inverse() * p).log()[row] / h
        });
        let covariance = Matrix6::from_fn(|i, j| if i == j { 1.0 + i as f64 } else { 0.1 });
        let numeric = jacobian * covariance * jacobian.transpose();
        assert!((p.inverse_covariance(&covariance) - numeric).norm() < 1e-4 * numeric.norm());
    }
}
