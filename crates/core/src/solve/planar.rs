//! Four or more points in one plane, seen from either face: both poses. Own derivation: docs/math/planar.md.
//!
//! A homography from bearings gives the map around the centroid of the points. To first order that map is a scaled part of a rotation,
//! and it is the same for two rotations, mirrored about the line of sight. (The idea of using the local map is that of Collins and Bartoli,
//! "Infinitesimal plane-based pose estimation", IJCV 2014.)
//!
//!   X = U (x, y, 0)  target point, centred and scaled, U the axes of the plane   ·   H  (x, y, 1) to a ray, up to scale
//!   v  line of sight to the centroid   ·   A  local map, 2×2, seen along v   ·   w  third row of the rotation, seen along v

use super::Candidates;
use super::sqpnp::{Cost, Minimum, Normalization, Sums};
use crate::{Correspondence, Pose};
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, SymmetricEigen, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

type Matrix9 = SMatrix<f64, 9, 9>;
type Vector9 = SVector<f64, 9>;

/// Poses closer than this (chordal) are one.
const SAME_ROTATION: f64 = 1e-6;
/// Smallest second eigenvalue, relative to the trace, of points that determine a homography. Four points, three on a line, give rounding;
/// bent by a thousandth of the line's length already 1e-8.
const MIN_SECOND_EIGENVALUE: f64 = 1e-11;

/// Smallest triangle of four points, twice its area in units of the largest coordinate squared: about the same bound.
const MIN_TRIANGLE: f64 = 3e-5;

/// Both poses of coplanar points, the one of smaller object-space error first; a single one when they coincide; none when the points do
/// not determine a homography (fewer than 4, or all but one on a line).
///
/// Each is followed to its minimum of that error where there is one: with few distant points the local map alone is too noisy a start.
pub fn planar(points: &[Correspondence]) -> Candidates {
    poses(points).unwrap_or_default()
}

fn poses(points: &[Correspondence]) -> Option<Candidates> {
    if points.len() < 4 {
        return None;
    }
    let frame = Normalization::new(points)?;
    let axes = plane_axes(points, &frame)?;
    let homography =
        homography_of_four(points, &frame, &axes).or_else(|| homography(points, &frame, &axes))?;
    let sums = Sums::new(points, |c| frame.apply(&c.x_in_target), |c| c.bearing.into_inner());
    let cost = Cost::new(&sums)?;
    let raw = rotations(&homography)?.map(|r| r * axes.transpose());
    let first = cost.descend(raw[0], &[])?;
    let in_front = |m: &Minimum| 0.0 < sums.depth(&m.rotation, &cost.translation(&m.rotation));
    let second = cost.descend(raw[1], &[first]).filter(in_front).unwrap_or_else(|| {
        // Both descents end in one place. The mirrored pose, whichever of the two it is, may still be a minimum of the reprojection error.
        let [near, far] = raw.map(|r| (r - first.rotation).norm());
        cost.at(if near < far { raw[1] } else { raw[0] })
    });
    let mut poses = Candidates::new();
    let ordered = if second.value < first.value { [second, first] } else { [first, second] };
    for Minimum { rotation, .. } in ordered {
        let is_new = poses.iter().all(|pose| SAME_ROTATION < (pose.rotation - rotation).norm());
        if is_new {
            let pose: Pose = frame.undo(rotation, cost.translation(&rotation));
            poses.push(pose);
        }
    }
    Some(poses)
}

/// Columns: two directions in the plane of the points, then its normal (on whichever side).
fn plane_axes(points: &[Correspondence], frame: &Normalization) -> Option<Matrix3<f64>> {
    let spread: Matrix3<f64> = points
        .iter()
        .map(|c| {
            let x = frame.apply(&c.x_in_target);
            x * x.transpose()
        })
        .sum();
    if !spread.iter().all(|x| x.is_finite()) {
        return None; // the eigenvalue iteration would not end
    }
    let eigen = SymmetricEigen::try_new(spread, f64::EPSILON, 100)?;
    let thin = eigen.eigenvalues.imin();
    let x: Vector3<f64> = eigen.eigenvectors.column((thin + 1) % 3).into();
    let y: Vector3<f64> = eigen.eigenvectors.column((thin + 2) % 3).into();
    Some(Matrix3::from_columns(&[x, y, x.cross(&y)]))
}

/// H, eq. (2), with the points in front of the camera.
fn homography(points: &[Correspondence], frame: &Normalization, axes: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let view = View::new(points)?;
    let on_plane = |c: &Correspondence| {
        let x = axes.tr_mul(&frame.apply(&c.x_in_target));
        Vector3::new(x.x, x.y, 1.0)
    };
    let sums = Sums::new(points, on_plane, |c| (view.image_from_cam * c.bearing.into_inner()).normalize());
    let h = smallest_eigenvector(&sums.q)?;
    let h = Matrix3::from_fn(|i, j| h[3 * i + j]);
    let facing = if sums.depth_r.dot(&h) < 0.0 { -h } else { h };
    Some(view.cam_from_image * facing)
}

/// H of four points, docs/math/planar.md eqs. (7)–(9), at a tenth of the cost of the minimum of (1), which is zero there. None when three
/// points are nearly on a line or when noise puts some of them behind the camera: the weights of (1) choose better then.
fn homography_of_four(
    points: &[Correspondence],
    frame: &Normalization,
    axes: &Matrix3<f64>,
) -> Option<Matrix3<f64>> {
    let points: &[Correspondence; 4] = points.try_into().ok()?;
    let x = [0, 1, 2, 3].map(|i| {
        let c = &points[i];
        let x = axes.tr_mul(&frame.apply(&c.x_in_target));
        Vector3::new(x.x, x.y, 1.0)
    });
    let b = [0, 1, 2, 3].map(|i| points[i].bearing.into_inner());
    let (rows, lambda, whole) = basis(&x);
    let (_, mu, _) = basis(&b);
    if !(MIN_TRIANGLE < lambda.amin().min(whole.abs())) {
        return None;
    }
    let h = (0..3).map(|i| b[i] * (mu[i] / lambda[i]) * rows[i].transpose()).sum::<Matrix3<f64>>();
    let depth = [0, 1, 2, 3].map(|i| b[i].dot(&(h * x[i])));
    let same_side = depth.iter().all(|d| 0.0 < d * depth[0] && d.is_finite());
    same_side.then(|| h / depth[0])
}

/// Rows of the adjugate of (x₁ x₂ x₃), their products with x₄, and the determinant.
fn basis(x: &[Vector3<f64>; 4]) -> ([Vector3<f64>; 3], Vector3<f64>, f64) {
    let rows = [x[1].cross(&x[2]), x[2].cross(&x[0]), x[0].cross(&x[1])];
    let products = Vector3::new(rows[0].dot(&x[3]), rows[1].dot(&x[3]), rows[2].dot(&x[3]));
    (rows, products, rows[0].dot(&x[0]))
}

/// Rays turned so that their mean is the z axis, then stretched so that they fill a wide angle: conditions the linear equations.
struct View {
    image_from_cam: Matrix3<f64>,
    cam_from_image: Matrix3<f64>,
}

impl View {
    fn new(points: &[Correspondence]) -> Option<Self> {
        let mean = points.iter().map(|c| c.bearing.into_inner()).sum::<Vector3<f64>>();
        let turn = facing(&mean.try_normalize(1e-9)?);
        let across = points.iter().map(|c| (turn * c.bearing.into_inner()).xy().norm_squared()).sum::<f64>();
        let spread = (across / points.len() as f64).sqrt();
        if !(0.0 < spread) {
            return None;
        }
        let stretch = (1.0 / spread).max(1.0);
        Some(View {
            image_from_cam: Matrix3::from_diagonal(&Vector3::new(stretch, stretch, 1.0)) * turn,
            cam_from_image: turn.transpose()
                * Matrix3::from_diagonal(&Vector3::new(1.0 / stretch, 1.0 / stretch, 1.0)),
        })
    }
}

/// A rotation that takes the unit vector v to the z axis.
fn facing(v: &Vector3<f64>) -> Matrix3<f64> {
    let other = Vector3::ith(v.iamin(), 1.0);
    let x = v.cross(&other).normalize();
    Matrix3::from_rows(&[x.transpose(), v.cross(&x).transpose(), v.transpose()])
}

/// Eigenvector of the smallest eigenvalue of a positive semidefinite matrix, by inverse iteration; none when the second
/// smallest is zero too.
fn smallest_eigenvector(m: &Matrix9) -> Option<Vector9> {
    let trace = m.trace();
    let shifted = m + Matrix9::identity() * (4.0 * f64::EPSILON * trace);
    let factor = shifted.cholesky()?;
    let mut v = Vector9::ith(8, 1.0); // the depth of the centroid, never zero
    for _ in 0..20 {
        let next = factor.solve(&v).try_normalize(0.0)?;
        let change = (next - v * v.dot(&next).signum()).norm();
        v = next;
        if change < 1e-13 {
            break;
        }
    }
    let mut second = Vector9::from_fn(|i, _| 1.0 + 0.3 * i as f64);
    for _ in 0..3 {
        second -= v * v.dot(&second);
        second = factor.solve(&second).try_normalize(0.0)?;
    }
    second -= v * v.dot(&second);
    let determined = MIN_SECOND_EIGENVALUE * trace * second.norm_squared() < second.dot(&(m * second));
    (determined && v.iter().all(|x| x.is_finite())).then_some(v)
}

/// The two rotations whose local map at the centroid is that of H, eqs. (3)–(6).
fn rotations(h: &Matrix3<f64>) -> Option<[Matrix3<f64>; 2]> {
    let depth = h.column(2).norm();
    let sight = h.column(2) / depth;
    let turn = facing(&sight);
    let seen = turn * h / depth;
    let a: Matrix2<f64> = seen.fixed_view::<2, 2>(0, 0).into();
    let g = a.tr_mul(&a);
    let difference = g[(0, 0)] - g[(1, 1)];
    let gap = difference.hypot(2.0 * g[(0, 1)]);
    let largest = 0.5 * (g.trace() + gap); // 1/distance², eq. (4)
    if !(0.0 < largest && largest.is_finite()) {
        return None;
    }
    let w = mirror_vector(difference, g[(0, 1)], gap) / largest.sqrt();
    let top = a / largest.sqrt();
    let rotation = |w: Vector2<f64>| {
        let x = Vector3::new(top[(0, 0)], top[(1, 0)], w.x);
        let y = Vector3::new(top[(0, 1)], top[(1, 1)], w.y);
        turn.transpose() * Matrix3::from_columns(&[x, y, x.cross(&y)])
    };
    Some([rotation(w), rotation(-w)])
}

/// w √λ from w wᵀ λ = λ I − AᵀA, eq. (5), by its larger component.
fn mirror_vector(difference: f64, g12: f64, gap: f64) -> Vector2<f64> {
    if gap == 0.0 {
        return Vector2::zeros(); // seen face on
    }
    let larger = (0.5 * (gap + difference.abs())).sqrt();
    let smaller = -g12 / larger;
    if difference < 0.0 { Vector2::new(larger, smaller) } else { Vector2::new(smaller, larger) }
}
