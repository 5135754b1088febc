//! Solves for X and Z from a few views, in closed form: docs/math/hand_eye.md eqs. (4)–(9).
//!
//! ```text
//!   C = A_i A_j⁻¹ = X M X⁻¹,  M = H_i H_j⁻¹   ·   c, m  vector parts of their quaternions:  c = ± R m
//!   (R_C − I) t = R t_M − t_C   ·   R, t  rotation and translation of X
//! ```

use super::Height;
use super::motions::half_rotation;
use super::views::Poses;
use crate::Pose;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

/// A view with one of its candidates.
#[derive(Clone, Copy)]
pub(super) struct ViewCandidate {
    /// A.
    pub cam_from_target: Pose,
    /// H.
    pub carrier_from_holder: Pose,
}

/// A motion between two views, as seen by the camera and by the gripper.
struct Motion {
    by_camera: Pose,
    by_carrier: Pose,
    /// c.
    c: Vector3<f64>,
    /// m.
    m: Vector3<f64>,
    /// Whether the sign of the quaternion is certain: near a half turn noise decides it, and both signs are tried.
    has_sign: bool,
}

/// Below this cosine of half the angle (rotations above 168°) a sign may be wrong.
const SURE_OF_SIGN: f64 = 0.1;
/// Two directions closer than this (sine of the angle between them, times their lengths) do not determine a rotation.
const MIN_SPREAD: f64 = 1e-4;

/// Settings for parallel axes.
#[derive(Clone, Copy)]
pub(super) struct Parallel {
    pub height: Height,
}

/// Returns every solution for the robot poses: one, or one for each choice of signs of the half turns.
pub(super) fn closed_forms(view_candidates: &[ViewCandidate], parallel: Option<&Parallel>) -> Vec<Poses> {
    let motions = motions(view_candidates);
    let unsure: Vec<usize> = (0..motions.len()).filter(|i| !motions[*i].has_sign).collect();
    let choices = 1usize << unsure.len().min(6);
    let solve = |choice: usize| {
        let sign = |i: usize| match unsure.iter().position(|u| *u == i) {
            Some(bit) if choice >> bit & 1 == 1 => -1.0,
            _ => 1.0,
        };
        let signs: Vec<f64> = (0..motions.len()).map(sign).collect();
        let cam_from_carrier = match parallel {
            Some(parallel) => about_one_axis(&motions, &signs, parallel)?,
            None => about_many_axes(&motions, &signs)?,
        };
        Some(Poses { cam_from_carrier, holder_from_target: mean_holder(view_candidates, &cam_from_carrier)? })
    };
    (0..choices).filter_map(solve).collect()
}

fn motions(view_candidates: &[ViewCandidate]) -> Vec<Motion> {
    let mut motions = Vec::new();
    for (i, first) in view_candidates.iter().enumerate() {
        for second in &view_candidates[..i] {
            let by_camera = first.cam_from_target * second.cam_from_target.inverse();
            let by_carrier = first.carrier_from_holder * second.carrier_from_holder.inverse();
            let half_cosine = by_camera.quaternion_wxyz()[0].min(by_carrier.quaternion_wxyz()[0]);
            let (c, m) = (half_rotation(&by_camera), half_rotation(&by_carrier));
            motions.push(Motion { by_camera, by_carrier, c, m, has_sign: SURE_OF_SIGN < half_cosine });
        }
    }
    motions
}

/// Solves for the rotation first, eq. (5); then for the translation, eq. (6).
fn about_many_axes(motions: &[Motion], signs: &[f64]) -> Option<Pose> {
    let outer = motions.iter().zip(signs).map(|(motion, sign)| motion.c * motion.m.transpose() * *sign);
    let rotation = nearest_rotation(&outer.sum())?;
    let (mut information, mut gradient) = (Matrix3::zeros(), Vector3::zeros());
    for motion in motions {
        let (left, right) = translation_rows(motion, &rotation);
        information += left.transpose() * left;
        gradient += left.transpose() * right;
    }
    let translation = information.cholesky()?.solve(&gradient);
    translation.iter().all(|x| x.is_finite()).then_some(Pose::new(rotation, translation))
}

/// Returns R_C − I and R t_M − t_C.
fn translation_rows(motion: &Motion, rotation: &Matrix3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
    let right = rotation * motion.by_carrier.translation - motion.by_camera.translation;
    (motion.by_camera.rotation - Matrix3::identity(), right)
}

/// Returns the rotation with the largest tr(Rᵀ S), by Kabsch's method from two singular directions; `None` where the second is missing.
fn nearest_rotation(s: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let svd = s.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let mut order = [0, 1, 2];
    order.sort_by(|i, j| svd.singular_values[*j].total_cmp(&svd.singular_values[*i]));
    let [first, second, _] = order;
    if svd.singular_values[second] < MIN_SPREAD * MIN_SPREAD {
        return None;
    }
    // The third pair of axes follows from the first two, which makes it a rotation whatever the sign of the third value.
    let frame = |x: Vector3<f64>, y: Vector3<f64>| Matrix3::from_columns(&[x, y, x.cross(&y)]);
    let left = frame(u.column(first).into_owned(), u.column(second).into_owned());
    let right = frame(v_t.row(first).transpose(), v_t.row(second).transpose());
    Some(left * right.transpose())
}

/// Solves for parallel axes: the rotation φ about them and the position perpendicular to them, linearly in (t, cos φ, sin φ), eqs. (7)–(8); the
/// position along them follows from the height, eq. (9).
fn about_one_axis(motions: &[Motion], signs: &[f64], parallel: &Parallel) -> Option<Pose> {
    let largest = motions.iter().map(|x| x.m).max_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()))?;
    let towards = |m: &Vector3<f64>| if m.dot(&largest) < 0.0 { -1.0 } else { 1.0 };
    let along = |pick: fn(&Motion) -> Vector3<f64>| {
        let sum: Vector3<f64> =
            motions.iter().zip(signs).map(|(x, sign)| pick(x) * towards(&x.m) * *sign).sum();
        sum.try_normalize(MIN_SPREAD)
    };
    let unsigned: Vector3<f64> = motions.iter().map(|x| x.m * towards(&x.m)).sum();
    let (axis_in_cam, axis_in_carrier) = (along(|x| x.c)?, unsigned.try_normalize(MIN_SPREAD)?);
    let first = turned_onto(&axis_in_carrier, &axis_in_cam);
    let (cosine, sine) = turn_about(motions, &axis_in_cam, &first)?;
    let rotation = about(&axis_in_cam, cosine, sine) * first;
    let across = place_across(motions, &axis_in_cam, &rotation)?;
    let direction = rotation * parallel.height.direction_in_carrier.normalize();
    let missing = -(parallel.height.height_m + direction.dot(&across)) / direction.dot(&axis_in_cam);
    missing.is_finite().then_some(Pose::new(rotation, across + axis_in_cam * missing))
}

/// Returns a rotation that maps one unit vector to another.
fn turned_onto(from: &Vector3<f64>, to: &Vector3<f64>) -> Matrix3<f64> {
    let frame = |x: &Vector3<f64>| {
        let y = x.cross(&Vector3::ith(x.iamin(), 1.0)).normalize();
        Matrix3::from_columns(&[*x, y, x.cross(&y)])
    };
    frame(to) * frame(from).transpose()
}

/// Returns cos φ (I − ccᵀ) + sin φ [c]× + ccᵀ.
fn about(axis: &Vector3<f64>, cosine: f64, sine: f64) -> Matrix3<f64> {
    let along = axis * axis.transpose();
    (Matrix3::identity() - along) * cosine + axis.cross_matrix() * sine + along
}

/// Solves for cos φ and sin φ by linear least squares together with the position, and normalises them.
fn turn_about(motions: &[Motion], axis: &Vector3<f64>, first: &Matrix3<f64>) -> Option<(f64, f64)> {
    let along = axis * axis.transpose();
    let (mut information, mut gradient) = (DMatrix::zeros(5, 5), DVector::zeros(5));
    for motion in motions {
        let shift = first * motion.by_carrier.translation;
        let mut rows = DMatrix::zeros(3, 5);
        rows.fixed_view_mut::<3, 3>(0, 0).copy_from(&(motion.by_camera.rotation - Matrix3::identity()));
        rows.fixed_view_mut::<3, 1>(0, 3).copy_from(&-(shift - along * shift));
        rows.fixed_view_mut::<3, 1>(0, 4).copy_from(&-axis.cross(&shift));
        let right = along * shift - motion.by_camera.translation;
        information += rows.transpose() * &rows;
        gradient += rows.transpose() * DVector::from_column_slice(right.as_slice());
    }
    // The position along the axis is determined elsewhere: any value will do.
    let mut own = information.fixed_view_mut::<3, 3>(0, 0);
    own += along;
    let solution = information.cholesky()?.solve(&gradient);
    let length = solution[3].hypot(solution[4]);
    (0.0 < length && length.is_finite()).then(|| (solution[3] / length, solution[4] / length))
}

/// Solves for the position perpendicular to the axis for a known rotation.
fn place_across(motions: &[Motion], axis: &Vector3<f64>, rotation: &Matrix3<f64>) -> Option<Vector3<f64>> {
    let (mut information, mut gradient) = (axis * axis.transpose(), Vector3::zeros());
    for motion in motions {
        let (left, right) = translation_rows(motion, rotation);
        information += left.transpose() * left;
        gradient += left.transpose() * right;
    }
    let place = information.cholesky()?.solve(&gradient);
    Some(place - axis * axis.dot(&place))
}

/// Averages Z over every robot pose.
fn mean_holder(view_candidates: &[ViewCandidate], cam_from_carrier: &Pose) -> Option<Pose> {
    let one = |s: &ViewCandidate| (*cam_from_carrier * s.carrier_from_holder).inverse() * s.cam_from_target;
    let all: Vec<Pose> = view_candidates.iter().map(one).collect();
    let rotation = nearest_rotation(&all.iter().map(|pose| pose.rotation).sum())?;
    let translation = all.iter().map(|pose| pose.translation).sum::<Vector3<f64>>() / all.len() as f64;
    Some(Pose::new(rotation, translation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vector6;

    fn poses() -> Poses {
        Poses {
            cam_from_carrier: Pose::exp(&Vector6::new(0.7, -1.1, 0.4, 0.2, -0.1, 0.3)),
            holder_from_target: Pose::exp(&Vector6::new(-0.3, 0.5, 1.9, 1.0, 2.0, -0.5)),
        }
    }

    fn station(carrier_from_holder: Pose) -> ViewCandidate {
        let Poses { cam_from_carrier, holder_from_target } = poses();
        ViewCandidate {
            cam_from_target: cam_from_carrier * carrier_from_holder * holder_from_target,
            carrier_from_holder,
        }
    }

    fn off(found: &Poses) -> f64 {
        let x = (found.cam_from_carrier * poses().cam_from_carrier.inverse()).log().amax();
        x.max((found.holder_from_target * poses().holder_from_target.inverse()).log().amax())
    }

    /// Three robot poses with rotations about different axes; no adjustment follows that could hide an error.
    #[test]
    fn exact_stations_give_the_exact_poses() {
        let view_candidates = [
            Vector6::new(0.1, 0.2, -0.3, 0.5, 0.1, 0.2),
            Vector6::new(-0.6, 0.3, 0.2, -0.4, 0.3, 0.7),
            Vector6::new(0.2, -0.9, 0.5, 0.1, -0.8, 0.3),
        ]
        .map(|xi| station(Pose::exp(&xi)));
        let found = closed_forms(&view_candidates, None);
        assert!(found.len() == 1 && off(&found[0]) < 1e-12, "{:?}", found.first().map(off));
    }

    /// The first two differ by a rotation of π about z: the right sign is among those tried.
    #[test]
    fn a_half_turn_is_tried_with_both_signs() {
        let view_candidates = [
            Vector6::zeros(),
            Vector6::new(0.0, 0.0, core::f64::consts::PI, 0.4, 0.3, 0.7),
            Vector6::new(0.2, -0.9, 0.5, 0.1, -0.8, 0.3),
        ]
        .map(|xi| station(Pose::exp(&xi)));
        let found = closed_forms(&view_candidates, None);
        assert!(2 <= found.len() && found.iter().any(|poses| off(poses) < 1e-12));
    }

    /// All rotations are about the carrier's z, and the camera's height along it is known.
    #[test]
    fn parallel_axes_and_a_height_give_the_exact_poses() {
        let view_candidates = [
            Vector6::new(0.0, 0.0, -0.3, 0.5, 0.1, 0.0),
            Vector6::new(0.0, 0.0, 0.8, -0.4, 0.3, 0.0),
            Vector6::new(0.0, 0.0, 0.2, 0.1, -0.8, 0.0),
        ]
        .map(|xi| station(Pose::exp(&xi)));
        let height_m = poses().cam_from_carrier.origin().z;
        let height = Height { direction_in_carrier: Vector3::z() * 2.0, height_m, sigma_m: 1.0 };
        let found = closed_forms(&view_candidates, Some(&Parallel { height }));
        assert!(found.len() == 1 && off(&found[0]) < 1e-12, "{:?}", found.first().map(off));
    }
}
