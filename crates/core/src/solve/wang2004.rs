//! Paper: F.-Y. Wang, "A Simple and Analytical Procedure for Calibrating Extrinsic Camera Parameters", IEEE T-RA 2004.
//!
//! The paper of Wang (2004), literally: rotation first, from relative positions only; then translation. Solves (7a), (7b) for pitch
//! and roll by (8), (9), then (10) for yaw, then (4).
//!   u, v  negated perspective image coordinates, eq. (1): u = −X/Z, v = −Y/Z  ·  Δu = u − u₀  ·  W = R P + p, eq. (2)
//!   G₀, G₁, G₂ on the line, G₃ off it  ·  L₁, L₂ abscissae of G₁, G₂ from G₀
//!   ω yaw, ϕ pitch, φ roll: R = R_Z(φ) R_Y(ϕ) R_X(ω)  ·  c2, s2 of pitch, c3, s3 of roll
//! This is the record of the paper and a teaching reference, not what a user should get by default: with noise it loses a
//! factor of ten and more in accuracy against `line_plus_one` (docs/math/wang2004.md, with the list of misprints).

use crate::{Bearing, Error, Point, Pose};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// One of the four solutions for (pitch, roll) with the yaw that (10) gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// R and p of (2): W = R P + p, P in the caller's frame, W the camera frame (Z > 0 visible).
    pub cam_from_target: Pose,
    /// (cos, sin) of ω, ϕ, φ: see `yaw_pitch_roll_rad`.
    pub yaw_pitch_roll_cos_sin: [(f64, f64); 3],
    /// cos²ω + sin²ω − 1 from (10), constraint (11).
    pub constraint_11: f64,
    /// Total residual in (3) with f = 1: Σ (X + u Z)² + (Y + v Z)², metres².
    pub residual_3: f64,
    /// Whether all four points lie in front of the camera. The paper does not ask; yet two of the four solutions satisfy
    /// every printed equation with the scene mirrored through the camera centre, Z < 0.
    pub in_front: bool,
}

impl Solution {
    /// ω, ϕ, φ of R in the paper's frame G (X axis along the line), radians. Where the caller's X axis is parallel to the
    /// line, G has the caller's axes. R = R_Z(φ) R_Y(ϕ) R_X(ω).
    pub fn yaw_pitch_roll_rad(&self) -> [f64; 3] {
        self.yaw_pitch_roll_cos_sin.map(|(cos, sin)| sin.atan2(cos))
    }

    /// The solution with the other sign in (8) and in (9). It turns the signs of cos φ, sin φ and cos ϕ; every coefficient
    /// of (10) on the left changes its sign with them and none on the right, so cos ω and sin ω do too, and the same R comes
    /// out: "both lead to the same rotation matrix".
    fn duplicate(&self) -> Self {
        let [(cw, sw), (c2, s2), (c3, s3)] = self.yaw_pitch_roll_cos_sin;
        Solution { yaw_pitch_roll_cos_sin: [(-cw, -sw), (-c2, s2), (-c3, -s3)], ..*self }
    }
}

/// The four solutions; none is dropped. They are one pose in two Euler triples and its mirror image behind the camera in two:
/// (3) and (11) are the same for all four, `in_front` tells (docs/math/wang2004.md section 3).
pub type Solutions = ArrayVec<Solution, 4>;

/// Below this fraction of its terms a determinant of the procedure is rounding, and the procedure undefined.
const UNDEFINED: f64 = 1e-12;

/// All solutions of the printed procedure, in the order (roll +, pitch +), (+, −), (−, +), (−, −) of (8), (9).
///
/// `bearings` and `points_in_target` belong together: three points of the line in any order, then the one off it. The line
/// may lie anywhere in the caller's frame. `Error::DegenerateView` names the condition of the paper that failed.
#[inline]
pub fn wang2004(bearings: &[Bearing; 4], points_in_target: &[Point; 4]) -> Result<Solutions, Error> {
    let frame = PaperFrame::of(points_in_target);
    let image = ImagePoints::of(bearings)?;
    let line = LineTerms::of(&image, &frame);
    let (roll, pitch, yaw) = (Roll::of(&line)?, Pitch::of(&line)?, YawTerms::of(&image, &frame));
    let solve = |pitch_sign: f64| {
        let (c2, s2) = (pitch_sign * pitch.sin_beta, pitch_sign * pitch.cos_beta);
        frame.solution(&image, &yaw, [c2, s2, roll.sin_alpha, roll.cos_alpha])
    };
    let (first, second) = (solve(1.0)?, solve(-1.0)?);
    let mut solutions = Solutions::new();
    for solution in [first, second, second.duplicate(), first.duplicate()] {
        solutions.push(solution);
    }
    Ok(solutions)
}

/// The paper's choice, the solution of least total residual in (3), among those with the points in front of the camera.
pub fn least_residual(solutions: &Solutions) -> Option<&Solution> {
    solutions
        .iter()
        .filter(|s| s.in_front && s.residual_3.is_finite())
        .min_by(|a, b| a.residual_3.total_cmp(&b.residual_3))
}

/// `cam1_from_cam2` by (13), (14): needs no absolute position, any target frame and any G₀ give the same.
///
/// R12 = R1 R2ᵀ, p12 = p1 − R12 p2.
#[cfg(test)]
fn cam1_from_cam2(cam1_from_target: &Pose, cam2_from_target: &Pose) -> Pose {
    let r12 = cam1_from_target.rotation * cam2_from_target.rotation.transpose();
    Pose::new(r12, cam1_from_target.translation - r12 * cam2_from_target.translation)
}

/// u, v of the four points, and their differences from the first.
struct ImagePoints {
    u: [f64; 4],
    v: [f64; 4],
    du: [f64; 4],
    dv: [f64; 4],
    /// The points with the largest |Δu| and |Δv|: j of (4a), k of (4b).
    widest: (usize, usize),
}

impl ImagePoints {
    fn of(bearings: &[Bearing; 4]) -> Result<Self, Error> {
        let (mut u, mut v) = ([0.0; 4], [0.0; 4]);
        for i in 0..4 {
            let b = &bearings[i];
            if !(0.0 < b.z) {
                return Err(undefined(
                    "eq. (1) has no image coordinate for a point beside or behind the camera",
                    b.z,
                ));
            }
            let inverse = -b.z.recip();
            (u[i], v[i]) = (b.x * inverse, b.y * inverse);
        }
        let (du, dv) = (u.map(|x| x - u[0]), v.map(|x| x - v[0]));
        let widest =
            |d: &[f64; 4]| (1..4).fold(1, |best, i| if d[best].abs() < d[i].abs() { i } else { best });
        Ok(ImagePoints { u, v, du, dv, widest: (widest(&du), widest(&dv)) })
    }
}

/// The paper's frame G: the caller's axes turned so that X runs along the line; ΔG by (L, 0, 0) and ΔG₃.
struct PaperFrame {
    paper_from_target: Matrix3<f64>,
    points_in_target: [Point; 4],
    l1: f64,
    l2: f64,
    delta_g: [Vector3<f64>; 4],
}

impl PaperFrame {
    fn of(points: &[Point; 4]) -> Self {
        let line = points[2] - points[0];
        let x = line * if line.x < 0.0 { -1.0 } else { 1.0 };
        let paper_from_target = turn_onto_x(&(x / x.norm()));
        let delta_g = points.map(|p| paper_from_target * (p - points[0]));
        PaperFrame {
            paper_from_target,
            points_in_target: *points,
            l1: delta_g[1].x,
            l2: delta_g[2].x,
            delta_g,
        }
    }

    /// Yaw by (10) with (ΔG₁, ΔG₃), translation by (4), residual by (3).
    fn solution(
        &self,
        image: &ImagePoints,
        yaw: &YawTerms,
        [c2, s2, c3, s3]: [f64; 4],
    ) -> Result<Solution, Error> {
        let (cos, sin) = yaw.cos_sin([c2, s2, c3, s3])?;
        let inverse = 1.0 / length(cos, sin);
        let (cw, sw) = (cos * inverse, sin * inverse);
        #[rustfmt::skip]
        let r = Matrix3::new(
            c2 * c3, sw * s2 * c3 - cw * s3, cw * s2 * c3 + sw * s3,
            c2 * s3, sw * s2 * s3 + cw * c3, cw * s2 * s3 - sw * c3,
            -s2,     sw * c2,                cw * c2,
        );
        let g0_in_cam = self.first_point_in_cam(image, &r)?;
        let rotation = r * self.paper_from_target;
        let cam_from_target = Pose::new(rotation, g0_in_cam - rotation * self.points_in_target[0]);
        Ok(Solution {
            cam_from_target,
            yaw_pitch_roll_cos_sin: [(cw, sw), (c2, s2), (c3, s3)],
            constraint_11: cos * cos + sin * sin - 1.0,
            residual_3: self.residual_3(image, &cam_from_target),
            in_front: self.points_in_target.iter().all(|x| 0.0 < (cam_from_target * *x).z),
        })
    }

    /// p + R G₀ by (4a) or (4b), whichever divides by the larger difference.
    fn first_point_in_cam(&self, image: &ImagePoints, r: &Matrix3<f64>) -> Result<Vector3<f64>, Error> {
        let (j, k) = image.widest;
        let ImagePoints { u, v, du, dv, .. } = image;
        if du[j].abs().max(dv[k].abs()) < f64::MIN_POSITIVE {
            return Err(undefined(
                "Δu and Δv of every point vanish in (4a), (4b): the points coincide in the image",
                0.0,
            ));
        }
        if dv[k].abs() <= du[j].abs() {
            let w = r * self.delta_g[j];
            let p = [
                u[0] * w.x + u[0] * u[j] * w.z,
                v[j] * w.x - du[j] * w.y + u[0] * v[j] * w.z,
                -w.x - u[j] * w.z,
            ];
            return Ok(Vector3::from(p) * du[j].recip());
        }
        let w = r * self.delta_g[k];
        let p =
            [u[k] * w.y - dv[k] * w.x + v[0] * u[k] * w.z, v[0] * w.y + v[0] * v[k] * w.z, -w.y - v[k] * w.z];
        Ok(Vector3::from(p) * dv[k].recip())
    }

    fn residual_3(&self, image: &ImagePoints, cam_from_target: &Pose) -> f64 {
        let residual = |i: usize| {
            let w = cam_from_target * &self.points_in_target[i];
            (w.x + image.u[i] * w.z).powi(2) + (w.y + image.v[i] * w.z).powi(2)
        };
        (0..4).map(residual).sum()
    }
}

/// The least turn that brings a unit vector with x ≥ 0 onto the X axis: none when it is there already.
fn turn_onto_x(d: &Vector3<f64>) -> Matrix3<f64> {
    let (y, z, k) = (d.y, d.z, 1.0 / (1.0 + d.x));
    Matrix3::new(d.x, y, z, -y, 1.0 - y * y * k, -y * z * k, -z, -y * z * k, 1.0 - z * z * k)
}

/// Coefficients of R(1), R(2), R(3) in (6a), (6b) with j = 1, k = 3: a_1j, b_1j, e_1j, e_2j of (10).
struct YawTerms {
    a: Vector3<f64>,
    b: Vector3<f64>,
    e1: Vector3<f64>,
    e2: Vector3<f64>,
}

impl YawTerms {
    fn of(image: &ImagePoints, frame: &PaperFrame) -> Self {
        let (g1, g3) = (&frame.delta_g[1], &frame.delta_g[3]);
        let ImagePoints { u, v, du, dv, .. } = image;
        YawTerms {
            a: g1 * du[3] - g3 * du[1],
            b: g1 * dv[3] - g3 * dv[1],
            e1: g1 * (u[1] * du[3]) - g3 * (u[3] * du[1]),
            e2: g1 * (v[1] * dv[3]) - g3 * (v[3] * dv[1]),
        }
    }

    /// cos ω and sin ω by (10), as the paper solves it: as if they were independent.
    fn cos_sin(&self, [c2, s2, c3, s3]: [f64; 4]) -> Result<(f64, f64), Error> {
        let YawTerms { a, b, e1, e2 } = self;
        let (m11, m12) = (a.z * s2 * c3 - a.y * s3 + e1.z * c2, a.y * s2 * c3 + a.z * s3 + e1.y * c2);
        let (m21, m22) = (b.y * c3 + b.z * s2 * s3 + e2.z * c2, b.y * s2 * s3 - b.z * c3 + e2.y * c2);
        let (r1, r2) = (e1.x * s2 - a.x * c2 * c3, e2.x * s2 - b.x * c2 * s3);
        let det = m11 * m22 - m12 * m21;
        let scale = length(m11, m12) * length(m21, m22);
        if !(UNDEFINED * scale < det.abs()) {
            return Err(undefined(
                "the system (10) for yaw is singular: the line is vertical or horizontal in the image, or the fourth point lies on it",
                det,
            ));
        }
        let inverse = det.recip();
        Ok(((r1 * m22 - m12 * r2) * inverse, (m11 * r2 - r1 * m21) * inverse))
    }
}

/// a₁, b₁, e₁, e₂ of (7a), (7b).
struct LineTerms {
    a1: f64,
    b1: f64,
    e1: f64,
    e2: f64,
    /// Size of the terms that a₁, b₁ are differences of.
    scale: f64,
}

impl LineTerms {
    fn of(image: &ImagePoints, frame: &PaperFrame) -> Self {
        let (l1, l2) = (frame.l1, frame.l2);
        let ImagePoints { u, v, du, dv, .. } = image;
        LineTerms {
            a1: du[2] * l1 - du[1] * l2,
            b1: dv[2] * l1 - dv[1] * l2,
            e1: u[1] * du[2] * l1 - u[2] * du[1] * l2,
            e2: v[1] * dv[2] * l1 - v[2] * dv[1] * l2,
            scale: (length(du[2], dv[2]) * l1.abs()).max(length(du[1], dv[1]) * l2.abs()),
        }
    }
}

/// α of (8): roll φ = ±π/2 − α.
struct Roll {
    cos_alpha: f64,
    sin_alpha: f64,
}

/// β of (9): pitch ϕ = ±π/2 ∓ β.
struct Pitch {
    cos_beta: f64,
    sin_beta: f64,
}

impl Roll {
    fn of(t: &LineTerms) -> Result<Self, Error> {
        let (c, s) = (t.a1 * t.e2, t.b1 * t.e1);
        let delta1 = length(c, s);
        if t.a1.abs().max(t.b1.abs()) <= UNDEFINED * t.scale {
            let reason = "a₁ = b₁ = 0 in (8): the line is parallel to the image plane";
            return Err(undefined(reason, length(t.a1, t.b1)));
        }
        if !(UNDEFINED * t.scale * t.scale < delta1) {
            return Err(undefined(
                "Δ₁ = 0 in (8): the line is vertical or horizontal in the image, passes through the principal point, or pitch is ±90°",
                delta1,
            ));
        }
        Ok(Roll { cos_alpha: c / delta1, sin_alpha: s / delta1 })
    }
}

impl Pitch {
    fn of(t: &LineTerms) -> Result<Self, Error> {
        let delta1 = length(t.a1 * t.e2, t.b1 * t.e1);
        let product = t.a1 * t.b1;
        let delta2 = length(delta1, product);
        if !(0.0 < delta2 && delta2.is_finite()) {
            return Err(undefined("Δ₂ = 0 in (9): pitch is undetermined", delta2));
        }
        Ok(Pitch { cos_beta: product / delta2, sin_beta: delta1 / delta2 })
    }
}

/// √(a² + b²); the coordinates here are far from overflow, where `hypot` earns its price.
#[inline]
fn length(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

fn undefined(reason: &'static str, metric: f64) -> Error {
    Error::DegenerateView { reason, metric, needed: UNDEFINED }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Unit};

    /// The geometry recovered from Table II by least squares (f cancels in u, v), in centimetres.
    const POINTS: [[f64; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [10.00328485, 0.0, 0.0],
        [15.01261553, 0.0, 0.0],
        [0.04118167, 14.92639476, -0.07460399],
    ];
    const CAMERA1: ([f64; 3], [f64; 3]) = ([45.0, 30.0, 60.0], [20.0, 10.0, 300.0]);
    const CAMERA2: ([f64; 3], [f64; 3]) = ([53.0, 37.0, 81.0], [25.0, 15.0, 250.0]);

    fn rotation_of(degrees: [f64; 3]) -> Matrix3<f64> {
        let [yaw, pitch, roll] = degrees.map(f64::to_radians);
        Rotation3::from_euler_angles(yaw, pitch, roll).into_inner()
    }

    fn points() -> [Point; 4] {
        POINTS.map(Vector3::from)
    }

    fn bearings_of(cam_from_target: &Pose, points: &[Point; 4]) -> [Bearing; 4] {
        points.map(|x| Unit::new_normalize(cam_from_target * &x))
    }

    fn solved(camera: ([f64; 3], [f64; 3])) -> Solutions {
        let truth = Pose::new(rotation_of(camera.0), Vector3::from(camera.1));
        wang2004(&bearings_of(&truth, &points()), &points()).unwrap()
    }

    /// Section IV: "two correct solutions have been found for both cameras, and both lead to the same rotation matrix".
    #[test]
    fn both_printed_euler_triples_and_translations_of_both_cameras() {
        for (camera, duplicate) in [(CAMERA1, [-135.0, 150.0, -120.0]), (CAMERA2, [-127.0, 143.0, -99.0])] {
            let solutions = solved(camera);
            let correct: Vec<_> = solutions.iter().filter(|s| s.residual_3 < 1e-18 && s.in_front).collect();
            assert_eq!(solutions.len(), 4);
            assert_eq!(correct.len(), 2);
            for printed in [camera.0, duplicate] {
                let found = correct.iter().any(|s| {
                    (0..3).all(|i| (s.yaw_pitch_roll_rad()[i].to_degrees() - printed[i]).abs() < 1e-9)
                });
                assert!(found, "{printed:?} not among {correct:?}");
            }
            for s in correct {
                assert!((s.cam_from_target.rotation - rotation_of(camera.0)).norm() < 1e-12);
                assert!((s.cam_from_target.translation - Vector3::from(camera.1)).norm() < 1e-9);
                assert!(s.constraint_11.abs() < 1e-11);
            }
        }
    }

    /// R2 is printed with 0.5686 in the middle, which its own angles make 0.5689.
    #[test]
    fn printed_rotation_matrices_to_their_four_decimals() {
        #[rustfmt::skip]
        let printed = [
            Matrix3::new(0.4330, -0.4356, 0.7891, 0.7500, 0.6597, -0.0474, -0.5000, 0.6124, 0.6124),
            Matrix3::new(0.1249, -0.5192, 0.8455, 0.7888, 0.5689, 0.2328, -0.6018, 0.6378, 0.4806),
        ];
        for (camera, printed) in [CAMERA1, CAMERA2].into_iter().zip(printed) {
            let solutions = solved(camera);
            let best = least_residual(&solutions).unwrap();
            assert!((best.cam_from_target.rotation - printed).abs().max() < 0.6e-4);
        }
    }

    /// (13), (14) give the values of `R12`, `p12` derived from the printed poses; the matrix printed as R12 is R1·R1.
    #[test]
    fn relative_extrinsics_follow_13_and_14_and_the_printed_r12_is_r1_r1() {
        let [one, two] = [CAMERA1, CAMERA2].map(|c| least_residual(&solved(c)).unwrap().cam_from_target);
        let relative = cam1_from_cam2(&one, &two);
        #[rustfmt::skip]
        let r12 = Matrix3::new(
            0.947462, 0.277474, -0.159135, -0.288895, 0.955874, -0.053333, 0.137315, 0.096505, 0.985815,
        );
        assert!((relative.rotation - r12).abs().max() < 0.6e-6);
        let p12 = Vector3::new(31.935148, 16.217564, 48.665772);
        assert!((relative.translation - p12).abs().max() < 0.6e-6);
        #[rustfmt::skip]
        let printed = Matrix3::new(
            -0.5334, 0.0073, 0.8456, 0.8432, 0.0796, 0.5316, -0.0634, 0.9968, -0.0486,
        );
        assert!((one.rotation * one.rotation - printed).abs().max() < 4e-4);
        assert!(0.5 < (relative.rotation - printed).abs().max());
    }

    /// (13), (14) do not depend on the reference frame or on G₀.
    #[test]
    fn relative_extrinsics_need_no_absolute_position() {
        let elsewhere = Pose::new(rotation_of([10.0, -20.0, 170.0]), Vector3::new(4e3, -2e3, 7e3));
        let moved = points().map(|x| elsewhere * x);
        let relative = |points: &[Point; 4]| {
            let [one, two] = [CAMERA1, CAMERA2].map(|c| {
                let truth = Pose::new(rotation_of(c.0), Vector3::from(c.1));
                let seen = bearings_of(&truth, &self::points());
                least_residual(&wang2004(&seen, points).unwrap()).unwrap().cam_from_target
            });
            cam1_from_cam2(&one, &two)
        };
        let (here, there) = (relative(&points()), relative(&moved));
        assert!((here.rotation - there.rotation).norm() < 1e-10);
        assert!((here.translation - there.translation).norm() < 1e-7);
    }

    #[test]
    fn any_order_of_the_line_gives_the_same_pose() {
        let truth = Pose::new(rotation_of(CAMERA1.0), Vector3::from(CAMERA1.1));
        for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let x = [order[0], order[1], order[2], 3].map(|i: usize| points()[i]);
            let solutions = wang2004(&bearings_of(&truth, &x), &x).unwrap();
            let best = least_residual(&solutions).unwrap().cam_from_target;
            assert!(
                best.angle_to_rad(&truth) < 1e-10 && (best.translation - truth.translation).norm() < 1e-8
            );
        }
    }

    #[test]
    fn where_the_procedure_is_undefined_it_says_which_condition_failed() {
        let reason = |degrees: [f64; 3]| {
            let truth = Pose::new(rotation_of(degrees), Vector3::new(20.0, 10.0, 300.0));
            match wang2004(&bearings_of(&truth, &points()), &points()) {
                Err(Error::DegenerateView { reason, .. }) => reason,
                other => panic!("{degrees:?}: {other:?}"),
            }
        };
        assert!(reason([40.0, 0.0, 30.0]).contains("parallel to the image plane"));
        assert!(reason([40.0, 90.0, 0.0]).contains("pitch is ±90°"));
    }
}
