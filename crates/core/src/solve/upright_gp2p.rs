//! Two rays of a rig whose vertical is known: up to two poses. Own derivation, docs/math/upright_gp2p.md; equation numbers
//! refer to it.
//!
//! The height of B over A is known in the rig frame too: one linear equation in the two depths. Along the line that it leaves, the
//! horizontal part D of A–B moves straight, and its length is known: a circle cut by a line.
//!
//!   a, b, w  bearings of A and B, origin of B's ray from that of A's   ·   x_z = up · x, x_h = x − x_z up
//!   η, ρ     height and horizontal length of B − A   ·   (λ, μ) = (λ₀, μ₀) + τ (b_z, a_z)  depths
//!   D        w_h + μ b_h − λ a_h = D₀ + τ q,  q = a_z b − b_z a

use super::gp3p::Ray;
use crate::{Point, Pose};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Unit, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// Candidate poses `rig_from_target`, on the stack; no order promised.
pub type UprightCandidates = ArrayVec<Pose, 2>;

/// Horizontal length over length below which B stands on A: the rotation about the vertical is lost.
const MIN_HORIZONTAL: f64 = 1e-10;
/// |q| below this: both rays are horizontal, or parallel.
const MIN_MOTION: f64 = 1e-12;
/// The line may miss the circle by this part of ρ² through rounding: B then misses its ray by half of it times ρ.
const MAX_DEFECT: f64 = 1e-12;

/// Every upright pose that puts both points onto their rays, in front of their cameras. `up_in_rig` and `up_in_target` are one
/// direction in the two frames. None where that does not fix the rotation: one point above the other, both rays horizontal, parallel rays.
pub fn upright_gp2p(
    rays: &[Ray; 2],
    points_in_target: &[Point; 2],
    up_in_target: &Unit<Vector3<f64>>,
    up_in_rig: &Unit<Vector3<f64>>,
) -> UprightCandidates {
    let mut poses = UprightCandidates::new();
    let segment = points_in_target[1] - points_in_target[0];
    let height = segment.dot(up_in_target);
    let level = segment - up_in_target.into_inner() * height;
    let length = level.norm();
    let Some(line) = Line::new(rays, height, up_in_rig) else { return poses };
    let is_fixed = MIN_HORIZONTAL * segment.amax() < length && length < f64::INFINITY;
    // Eq. (4): the line cuts the circle where ρ² − D_min² is not negative.
    let half_chord2 = length * length - line.nearest.norm_squared();
    if !(is_fixed && -MAX_DEFECT * length * length <= half_chord2) {
        return poses;
    }
    let half_chord = half_chord2.max(0.0).sqrt();
    let from_target = upright_frame(&level, up_in_target).transpose();
    for side in [half_chord, -half_chord] {
        let [depth_a, depth_b] = line.depths(side);
        if 0.0 < depth_a && 0.0 < depth_b {
            let level_in_rig = line.nearest + line.along * side;
            let rotation = upright_frame(&level_in_rig, up_in_rig) * from_target;
            let a_in_rig = rays[0].origin_in_rig + rays[0].bearing_in_rig.into_inner() * depth_a;
            poses.push(Pose { rotation, translation: a_in_rig - rotation * points_in_target[0] });
        }
        if half_chord == 0.0 {
            break;
        }
    }
    poses
}

/// Columns: the horizontal direction, the one to its left, up. Orthonormal also where `level` is short and its rounding
/// points upwards.
#[inline]
fn upright_frame(level: &Vector3<f64>, up: &Unit<Vector3<f64>>) -> Matrix3<f64> {
    let left = up.cross(level);
    let left = left / left.norm();
    Matrix3::from_columns(&[left.cross(up), left, up.into_inner()])
}

/// The horizontal part of A–B for all depths that give it the right height, eqs. (1)–(3).
struct Line {
    /// D nearest to zero.
    nearest: Vector3<f64>,
    /// q/|q|.
    along: Vector3<f64>,
    /// Depths of A and B at `nearest`, and their change along the line.
    depths_at_nearest: [f64; 2],
    slopes: [f64; 2],
}

impl Line {
    #[inline]
    fn new(rays: &[Ray; 2], height: f64, up: &Unit<Vector3<f64>>) -> Option<Self> {
        let [a, b] = [rays[0].bearing_in_rig.into_inner(), rays[1].bearing_in_rig.into_inner()];
        let w = rays[1].origin_in_rig - rays[0].origin_in_rig;
        let (az, wz, difference) = (up.dot(&a), up.dot(&w), b - a);
        let difference_z = up.dot(&difference);
        let bz = az + difference_z;
        // a_z b − b_z a, by differences: bearings close to each other keep their digits.
        let q = difference * az - a * difference_z;
        let speed = q.norm();
        let along = q / speed;
        let missing = (height - wz) / (az * az + bz * bz);
        let [a0, b0] = [-az * missing, bz * missing];
        let d0 = w + b * b0 - a * a0;
        let level = d0 - up.into_inner() * up.dot(&d0);
        let passed = level.dot(&along);
        let slopes = [bz / speed, az / speed];
        let depths_at_nearest = [a0 - passed * slopes[0], b0 - passed * slopes[1]];
        let nearest = level - along * passed;
        (MIN_MOTION < speed).then_some(Line { nearest, along, depths_at_nearest, slopes })
    }

    #[inline]
    fn depths(&self, side: f64) -> [f64; 2] {
        [0, 1].map(|i| self.depths_at_nearest[i] + self.slopes[i] * side)
    }
}
