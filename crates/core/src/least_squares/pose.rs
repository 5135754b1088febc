//! The loop for a pose, in small left motions.
//!
//! The pose is stored as the rotation R and the position c of a pivot (the centroid of the points) in the camera frame, and is moved by
//! x ← x + ω × (x − c) + ν. Rotating about the pivot nearly decouples rotation from translation, so that the normal equations
//! are as well conditioned at a kilometre as at one metre, and at coordinates of millions of metres.
//! Derivation: docs/math/refine.md eqs. (2)–(7).

use super::{LeastSquares, Minimum, Tolerance, minimize};
use crate::{Matrix6, Point, Pose, Vector6};
use nalgebra::{Matrix3, Vector3};

/// A pose stored with the position of a pivot instead of the origin of the target frame.
#[derive(Debug, Clone, Copy)]
pub struct PivotedPose {
    /// Rotation from target to camera.
    pub rotation: Matrix3<f64>,
    /// The pivot in the camera frame, metres.
    pub pivot_in_cam: Point,
}

impl PivotedPose {
    /// Converts a pose to one with the pivot `pivot_in_target`.
    pub fn new(cam_from_target: &Pose, pivot_in_target: &Point) -> Self {
        PivotedPose { rotation: cam_from_target.rotation, pivot_in_cam: cam_from_target * pivot_in_target }
    }

    /// Converts to an ordinary pose, whose rotation is orthonormal to rounding.
    #[inline(always)]
    pub fn pose(&self, pivot_in_target: &Point) -> Pose {
        let rotation = crate::pose::orthonormalized(&self.rotation);
        Pose { rotation, translation: self.pivot_in_cam - rotation * pivot_in_target }
    }

    /// Moves by `[rotation_rad; translation_m]` about the pivot. The rotation is Cayley's, equal to the exponential to
    /// second order and free of trigonometry: any retraction leads to the same minimum.
    #[inline(always)]
    pub(crate) fn moved(&self, motion: &Vector6) -> Self {
        let a = Vector3::new(motion[0], motion[1], motion[2]) * 0.5;
        let k = a.cross_matrix();
        let turn = Matrix3::identity() + (k + k * k) * (2.0 / (1.0 + a.norm_squared()));
        PivotedPose {
            rotation: turn * self.rotation,
            pivot_in_cam: self.pivot_in_cam + Vector3::new(motion[3], motion[4], motion[5]),
        }
    }
}

/// The Gauss–Newton approximation of a cost at one pose, in blocks: rotation (ω), translation (ν) and their coupling.
#[derive(Debug, Clone, Copy)]
pub struct NormalEquations {
    /// Sum of squared whitened residuals.
    pub chi2: f64,
    /// Jᵀr for the rotation, r = observed − predicted.
    gradient_rotation: Vector3<f64>,
    /// Jᵀr for the translation.
    gradient_translation: Vector3<f64>,
    /// JᵀJ, rotation × rotation.
    rotation_rotation: Symmetric3,
    /// JᵀJ, rotation (rows) × translation (columns).
    rotation_translation: Matrix3<f64>,
    /// JᵀJ, translation × translation.
    translation_translation: Symmetric3,
}

/// Upper triangle of a symmetric 3×3 matrix: xx, xy, xz, yy, yz, zz.
#[derive(Debug, Clone, Copy)]
struct Symmetric3([f64; 6]);

/// A minimum over poses.
pub type PoseMinimum = Minimum<PivotedPose, NormalEquations>;

struct PoseCost<F>(F);

impl<F: Fn(&PivotedPose) -> Option<NormalEquations>> LeastSquares for PoseCost<F> {
    type State = PivotedPose;
    type Equations = NormalEquations;
    type Step = Vector6;

    #[inline(always)]
    fn evaluate(&self, place: &PivotedPose) -> Option<NormalEquations> {
        self.0(place)
    }

    #[inline(always)]
    fn chi2(normal: &NormalEquations) -> f64 {
        normal.chi2
    }

    #[inline(always)]
    fn step(&self, normal: &NormalEquations, damping: f64) -> Option<(Vector6, f64)> {
        normal.step(damping)
    }

    #[inline(always)]
    fn apply(&self, place: &PivotedPose, motion: &Vector6) -> Option<PivotedPose> {
        Some(place.moved(motion))
    }
}

/// Minimises a cost over poses. `evaluate` returns `None` where a point leaves the camera's field; for `alternative_chi2` see [`Tolerance`].
#[inline]
pub fn minimize_pose(
    start: PivotedPose,
    alternative_chi2: Option<f64>,
    evaluate: impl Fn(&PivotedPose) -> Option<NormalEquations>,
) -> Option<PoseMinimum> {
    minimize(&PoseCost(evaluate), start, &Tolerance { alternative_chi2, ..Tolerance::FINE })
}

impl NormalEquations {
    /// Returns zeros.
    #[inline]
    pub fn zero() -> Self {
        NormalEquations {
            chi2: 0.0,
            gradient_rotation: Vector3::zeros(),
            gradient_translation: Vector3::zeros(),
            rotation_rotation: Symmetric3([0.0; 6]),
            rotation_translation: Matrix3::zeros(),
            translation_translation: Symmetric3([0.0; 6]),
        }
    }

    /// Adds one whitened residual and its derivative by the motion, `[by_rotation; by_translation]`.
    #[inline(always)]
    pub fn add(&mut self, residual: f64, by_rotation: &Vector3<f64>, by_translation: &Vector3<f64>) {
        self.chi2 += residual * residual;
        self.gradient_rotation += by_rotation * residual;
        self.gradient_translation += by_translation * residual;
        self.rotation_rotation.add_square(by_rotation);
        self.rotation_translation += by_rotation * by_translation.transpose();
        self.translation_translation.add_square(by_translation);
    }

    /// Adds both residuals of a point at `y` from the pivot seen by a pinhole camera, whose derivatives by the point are
    /// (a, 0, s) and (0, b, t): `add` twice, without the multiplications by zero.
    #[inline(always)]
    pub(crate) fn add_pinhole(
        &mut self,
        [ru, rv]: [f64; 2],
        y: &Vector3<f64>,
        [a, s]: [f64; 2],
        [b, t]: [f64; 2],
    ) {
        self.chi2 += ru * ru + rv * rv;
        let u = Vector3::new(y.y * s, y.z * a - y.x * s, -y.y * a);
        let v = Vector3::new(y.y * t - y.z * b, -y.x * t, y.x * b);
        self.gradient_rotation += u * ru + v * rv;
        self.gradient_translation += Vector3::new(a * ru, b * rv, s * ru + t * rv);
        self.rotation_rotation.add_square(&u);
        self.rotation_rotation.add_square(&v);
        self.rotation_translation += Matrix3::from_columns(&[u * a, v * b, u * s + v * t]);
        let tt = &mut self.translation_translation.0;
        tt[0] += a * a;
        tt[2] += a * s;
        tt[3] += b * b;
        tt[4] += b * t;
        tt[5] += s * s + t * t;
    }

    /// Adds the residuals of another set.
    pub(crate) fn merge(&mut self, other: &NormalEquations) {
        let sum = |a: &Symmetric3, b: &Symmetric3| Symmetric3(core::array::from_fn(|i| a.0[i] + b.0[i]));
        self.chi2 += other.chi2;
        self.gradient_rotation += other.gradient_rotation;
        self.gradient_translation += other.gradient_translation;
        self.rotation_rotation = sum(&self.rotation_rotation, &other.rotation_rotation);
        self.rotation_translation += other.rotation_translation;
        self.translation_translation = sum(&self.translation_translation, &other.translation_translation);
    }

    /// Returns the equations if the observed motion is that of the pose plus an unknown one of covariance S, whose best value is eliminated:
    /// docs/math/rig_pose.md eqs. (5)–(6). `None` where the inverse does not exist.
    pub(crate) fn with_uncertain_motion(&self, covariance: &Matrix6) -> Option<Self> {
        let (information, gradient) = (self.information(), self.gradient());
        let share = (Matrix6::identity() + information * covariance).try_inverse()?;
        let eliminated = share * gradient;
        let information = share * information;
        let chi2 = self.chi2 - gradient.dot(&(covariance * eliminated));
        Some(NormalEquations::from_parts(chi2, &eliminated, &information))
    }

    /// Creates equations from χ², Jᵀr and JᵀJ, which may be slightly asymmetric because of rounding.
    pub(crate) fn from_parts(chi2: f64, gradient: &Vector6, information: &Matrix6) -> Self {
        let symmetric = |at: usize| {
            let entry =
                |i: usize, j: usize| 0.5 * (information[(at + i, at + j)] + information[(at + j, at + i)]);
            Symmetric3([entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)])
        };
        NormalEquations {
            chi2,
            gradient_rotation: gradient.fixed_rows::<3>(0).into(),
            gradient_translation: gradient.fixed_rows::<3>(3).into(),
            rotation_rotation: symmetric(0),
            rotation_translation: information.fixed_view::<3, 3>(0, 3).into(),
            translation_translation: symmetric(3),
        }
    }

    /// Returns Jᵀr.
    pub(crate) fn gradient(&self) -> Vector6 {
        let (w, v) = (&self.gradient_rotation, &self.gradient_translation);
        Vector6::new(w.x, w.y, w.z, v.x, v.y, v.z)
    }

    /// Returns the damped Gauss–Newton step and the promised decrease of χ²; `None` when the damped matrix is not positive.
    ///
    /// Translation is eliminated first: two 3×3 inverses by cofactors cost two divisions instead of six square roots.
    #[inline(always)] // also where the loop is built for more than one cost
    fn step(&self, damping: f64) -> Option<(Vector6, f64)> {
        let tt = self.translation_translation.damped(damping).inverse()?;
        let gain = self.rotation_translation * tt;
        let ww = self
            .rotation_rotation
            .damped(damping)
            .minus_product(&gain, &self.rotation_translation)
            .inverse()?;
        let w = ww * (self.gradient_rotation - gain * self.gradient_translation);
        let v = tt * (self.gradient_translation - self.rotation_translation.tr_mul(&w));
        // gᵀδ: exactly the decrease for no damping, a little more than promised otherwise.
        let promised = w.dot(&self.gradient_rotation) + v.dot(&self.gradient_translation);
        promised.is_finite().then(|| (Vector6::new(w.x, w.y, w.z, v.x, v.y, v.z), promised))
    }

    /// Returns the decrease of χ² that an undamped step promises; `None` where the points do not determine the pose.
    pub(crate) fn promised(&self) -> Option<f64> {
        self.step(0.0).map(|(_, promised)| promised)
    }

    /// Returns JᵀJ for the motion about the pivot, `[rotation; translation]`.
    pub fn information(&self) -> Matrix6 {
        let (rr, tt) = (&self.rotation_rotation, &self.translation_translation);
        Matrix6::from_fn(|i, j| match (i < 3, j < 3) {
            (true, true) => rr.at(i, j),
            (true, false) => self.rotation_translation[(i, j - 3)],
            (false, true) => self.rotation_translation[(j, i - 3)],
            (false, false) => tt.at(i - 3, j - 3),
        })
    }

    /// Returns Jᵀr for the small left motion of the camera frame: the torque about the camera is that about the pivot plus c × force.
    pub fn gradient_at_camera(&self, pivot_in_cam: &Point) -> Vector6 {
        let f = &self.gradient_translation;
        let t = self.gradient_rotation + pivot_in_cam.cross(f);
        Vector6::new(t.x, t.y, t.z, f.x, f.y, f.z)
    }

    /// Returns the covariance (JᵀJ)⁻¹ of the small left motion of the camera frame, from that about the pivot: ν_left = ν + c × ω. `None` where
    /// the points do not determine the pose.
    pub fn covariance_at_camera(&self, pivot_in_cam: &Point) -> Option<Matrix6> {
        let tt = self.translation_translation.inverse()?;
        let gain = self.rotation_translation * tt;
        let ww = self.rotation_rotation.minus_product(&gain, &self.rotation_translation).inverse()?;
        // With ν_left = ν + c × ω and ν = −gainᵀω + (what translation alone leaves free, tt): ν_left = M ω + …,
        // M = [c]× − gainᵀ, so that the blocks are ww, ww Mᵀ and tt + M ww Mᵀ.
        let m = pivot_in_cam.cross_matrix() - gain.transpose();
        let cross = ww * m.transpose();
        let place = m * cross;
        let mut covariance = Matrix6::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&ww);
        covariance.fixed_view_mut::<3, 3>(0, 3).copy_from(&cross);
        covariance.fixed_view_mut::<3, 3>(3, 0).tr_copy_from(&cross);
        for i in 0..3 {
            for j in i..3 {
                let entry = tt[(i, j)] + place[(i, j)];
                covariance[(3 + i, 3 + j)] = entry;
                covariance[(3 + j, 3 + i)] = entry;
            }
        }
        covariance.sum().is_finite().then_some(covariance)
    }
}

impl Symmetric3 {
    fn at(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.min(j), i.max(j));
        self.0[i * (5 - i) / 2 + j]
    }

    #[inline(always)]
    fn add_square(&mut self, v: &Vector3<f64>) {
        let m = &mut self.0;
        m[0] += v.x * v.x;
        m[1] += v.x * v.y;
        m[2] += v.x * v.z;
        m[3] += v.y * v.y;
        m[4] += v.y * v.z;
        m[5] += v.z * v.z;
    }

    #[inline(always)]
    fn damped(&self, damping: f64) -> Self {
        let [a, b, c, d, e, f] = self.0;
        let s = 1.0 + damping;
        Symmetric3([a * s, b, c, d * s, e, f * s])
    }

    /// Returns self − A Bᵀ, for a product known to be symmetric.
    #[inline(always)]
    fn minus_product(&self, a: &Matrix3<f64>, b: &Matrix3<f64>) -> Self {
        let p = |i: usize, j: usize| a[(i, 0)] * b[(j, 0)] + a[(i, 1)] * b[(j, 1)] + a[(i, 2)] * b[(j, 2)];
        let m = self.0;
        Symmetric3([
            m[0] - p(0, 0),
            m[1] - p(0, 1),
            m[2] - p(0, 2),
            m[3] - p(1, 1),
            m[4] - p(1, 2),
            m[5] - p(2, 2),
        ])
    }

    /// Returns the inverse by cofactors; `None` when the matrix is not positive definite or not finite.
    #[inline(always)]
    fn inverse(&self) -> Option<Matrix3<f64>> {
        let [a, b, c, d, e, f] = self.0;
        let (ca, cb, cc, minor) = (d * f - e * e, c * e - b * f, b * e - c * d, a * d - b * b);
        let det = a * ca + b * cb + c * cc;
        let positive = 0.0 < a && 0.0 < minor && 0.0 < det && det.is_finite();
        if !positive {
            return None;
        }
        let i = 1.0 / det;
        let (cd, ce, cf) = (a * f - c * c, b * c - a * e, minor);
        Some(Matrix3::new(ca * i, cb * i, cc * i, cb * i, cd * i, ce * i, cc * i, ce * i, cf * i))
    }
}
