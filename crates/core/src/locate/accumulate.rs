//! The cost of a pose and its normal equations: sums over points and priors.
//!
//! Points known exactly and seen by a pinhole camera with equal noise in u and v are the inner loop of everything and have one of their
//! own; all others, losses and priors go another way. (Two points at a time in packed arithmetic was tried and gained nothing.)
//!
//! ```text
//!   r = (observed − π(x)) / σ,   x = R (X − X̄) + c,   y = x − c
//!   rows of the derivative [y × j ; j], j a row of Π = ∂π/∂x; pinhole: (a, 0, −a x/z), (0, b, −b y/z), a = fx/z, b = fy/z
//! ```
//! Derivation: docs/math/refine.md eqs. (1)–(3), (8), (19); priors: docs/math/priors.md eq. (1).

use crate::camera::{CameraMatrix, Pinhole};
use crate::least_squares::{NormalEquations, PivotedPose};
use crate::locate::factor::{self, factors};
use crate::locate::group::RigidGroup;
use crate::locate::loss::Loss;
use crate::locate::problem::Problem;
use crate::{Camera, Correspondence, Lens, Pixel, Point, Pose};
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// χ² and root mean square distance, px; infinite where a point leaves the field.
#[inline]
pub(crate) fn residual_sums(cam_from_target: &Pose, problem: &Problem) -> (f64, f64) {
    let sums = match &problem.camera.lens {
        _ if !problem.is_points_alone() => sum_any(cam_from_target, problem),
        Lens::Pinhole(model) => sum_residuals(cam_from_target, problem, |x| model.project(x)),
        _ => sum_residuals(cam_from_target, problem, |x| problem.camera.project(x)),
    };
    let (chi2, sum) = sums.unwrap_or((f64::INFINITY, f64::INFINITY));
    (chi2, (sum / problem.seen.len().max(1) as f64).sqrt())
}

#[inline(always)]
fn sum_residuals(
    cam_from_target: &Pose,
    problem: &Problem,
    project: impl Fn(&Point) -> Option<Pixel>,
) -> Option<(f64, f64)> {
    let (mut chi2, mut sum) = (0.0, 0.0);
    for c in problem.seen {
        if !c.is_plain() {
            return sum_any(cam_from_target, problem);
        }
        let squared = (c.pixel - project(&(cam_from_target * &c.x_in_target))?).norm_squared();
        chi2 += squared / (c.sigma_px * c.sigma_px);
        sum += squared;
    }
    Some((chi2, sum))
}

/// As `sum_residuals`, for any points, loss and priors.
#[inline(never)]
fn sum_any(cam_from_target: &Pose, problem: &Problem) -> Option<(f64, f64)> {
    let of_priors = problem.priors.iter().map(|prior| factor::chi2(prior, cam_from_target));
    let (mut chi2, mut sum) = (of_priors.sum(), 0.0);
    for c in problem.seen {
        let (_, e, whitened) = weighed_residual(cam_from_target, c, problem)?;
        chi2 += problem.loss.at(whitened).0;
        sum += e.norm_squared();
    }
    if !problem.groups.is_empty() {
        chi2 = grouped(cam_from_target, problem)?.chi2;
    }
    Some((chi2, sum))
}

/// The normal equations where groups of points are displaced together: their χ² is that of the displacement that suits best.
#[cold]
fn grouped(cam_from_target: &Pose, problem: &Problem) -> Option<NormalEquations> {
    let pivot = centroid(problem.seen);
    accumulate(&PivotedPose::new(cam_from_target, &pivot), &pivot, problem)
}

/// The mean of the target points: the pivot of the refinement.
pub(crate) fn centroid(seen: &[Correspondence]) -> Point {
    seen.iter().map(|c| c.x_in_target).sum::<Point>() / seen.len().max(1) as f64
}

/// As `whitened_residual`, with the weights the problem holds.
pub(crate) fn weighed_residual(
    cam_from_target: &Pose,
    c: &Correspondence,
    problem: &Problem,
) -> Option<(Point, Vector2<f64>, f64)> {
    let Some(held) = held_jacobian(c, problem)? else {
        return whitened_residual(cam_from_target, c, problem.camera);
    };
    let x = cam_from_target * &c.x_in_target;
    let e = c.pixel - problem.camera.project(&x)?;
    Some((x, e, e.dot(&(information(c, &held) * e))))
}

/// The derivative of the projection by which an uncertain point is weighed, where the problem holds it.
pub(crate) fn held_jacobian(c: &Correspondence, problem: &Problem) -> Option<Option<Matrix2x3<f64>>> {
    match problem.weights_at {
        Some(pose) if c.sigma_m != 0.0 => {
            let (_, jacobian) = problem.camera.project_with_jacobian(&(pose * &c.x_in_target))?;
            Some(Some(jacobian))
        }
        _ => Some(None),
    }
}

/// Logarithm of how much larger the covariances of all pixels are, by area, for the points' own uncertainty: Σ log(det C / det C_px),
/// docs/math/refine.md eq. (8a). 0 for points known exactly.
pub(crate) fn log_determinant(cam_from_target: &Pose, problem: &Problem) -> f64 {
    let mut sum = 0.0;
    for c in problem.seen.iter().filter(|c| c.sigma_m != 0.0) {
        let [uu, uv, vv] = c.pixel_covariance();
        let x = cam_from_target * &c.x_in_target;
        let Some((_, jacobian)) = problem.camera.project_with_jacobian(&x) else { return f64::INFINITY };
        sum -= (information(c, &jacobian).determinant() * (uu * vv - uv * uv)).ln();
    }
    sum
}

/// Point in the camera frame, residual (px) and squared whitened residual of one correspondence.
pub(crate) fn whitened_residual(
    cam_from_target: &Pose,
    c: &Correspondence,
    camera: &Camera,
) -> Option<(Point, Vector2<f64>, f64)> {
    let x = cam_from_target * &c.x_in_target;
    if c.is_plain() {
        let e = c.pixel - camera.project(&x)?;
        return Some((x, e, e.norm_squared() / (c.sigma_px * c.sigma_px)));
    }
    let (pixel, jacobian) = camera.project_with_jacobian(&x)?;
    let e = c.pixel - pixel;
    Some((x, e, e.dot(&(information(c, &jacobian) * e))))
}

/// Inverse covariance of a pixel residual: (C_px + σ_m² Π Πᵀ)⁻¹, the second term for surveyed points,
/// docs/math/refine.md eq. (8).
pub(crate) fn information(c: &Correspondence, jacobian: &Matrix2x3<f64>) -> Matrix2<f64> {
    let [uu, uv, vv] = c.pixel_covariance();
    let p = jacobian * jacobian.transpose() * (c.sigma_m * c.sigma_m);
    let (a, b, d) = (uu + p[(0, 0)], uv + p[(0, 1)], vv + p[(1, 1)]);
    Matrix2::new(d, -b, -b, a) / (a * d - b * b)
}

/// W with WᵀW = information, upper triangular: whitens residuals and derivatives alike.
pub(crate) fn whitening(c: &Correspondence, jacobian: &Matrix2x3<f64>) -> (f64, f64, f64) {
    if c.is_plain() {
        return (1.0 / c.sigma_px, 0.0, 1.0 / c.sigma_px);
    }
    let i = information(c, jacobian);
    let a = i[(0, 0)].sqrt();
    let b = i[(0, 1)] / a;
    (a, b, (i[(1, 1)] - b * b).sqrt())
}

/// The lens is looked up once, not at every point: most cameras of the inner loop are pinholes.
#[inline]
pub(crate) fn normal_equations(
    place: &PivotedPose,
    pivot: &Point,
    problem: &Problem,
) -> Option<NormalEquations> {
    match &problem.camera.lens {
        Lens::Pinhole(model) if problem.is_points_alone() => {
            accumulate_pinhole(place, pivot, problem.seen, model)
        }
        _ => accumulate(place, pivot, problem),
    }
}

/// As `accumulate`, for the lens of most cameras of the inner loop: a third less arithmetic.
#[inline(always)]
pub(crate) fn accumulate_pinhole(
    place: &PivotedPose,
    pivot: &Point,
    seen: &[Correspondence],
    model: &Pinhole,
) -> Option<NormalEquations> {
    let k = &model.matrix;
    let mut normal = NormalEquations::zero();
    for c in seen {
        let y = place.rotation * (c.x_in_target - pivot);
        if !c.is_plain() {
            add_apart(&mut normal, c, &y, &(y + place.pivot_in_cam), model)?;
            continue;
        }
        add_plain(&mut normal, c, &y, &(y + place.pivot_in_cam), k)?;
    }
    normal.chi2.is_finite().then_some(normal)
}

#[inline(always)]
fn add_plain(
    normal: &mut NormalEquations,
    c: &Correspondence,
    y: &Vector3<f64>,
    x: &Point,
    k: &CameraMatrix,
) -> Option<()> {
    let in_front = 0.0 < x.z;
    if !in_front {
        return None;
    }
    let (iz, w) = (1.0 / x.z, 1.0 / c.sigma_px);
    let (xn, yn) = (x.x * iz, x.y * iz);
    let (a, b) = (k.fx_px * iz * w, k.fy_px * iz * w);
    let ru = (c.pixel.x - (k.fx_px * xn + k.cx_px)) * w;
    let rv = (c.pixel.y - (k.fy_px * yn + k.cy_px)) * w;
    normal.add_pinhole([ru, rv], y, [a, -a * xn], [b, -b * yn]);
    Some(())
}

/// Where the best displacement of a group explains all but this part of its χ², what is left is not taken from a difference: corners next
/// to the camera's plane have a χ² of 10²⁰, and the difference was rounding, below zero too.
const CANCELLED: f64 = 1e-3;

/// χ² of a group after the displacement m = S g' that suits best, |r − J m|² + mᵀS⁻¹m, point by point: no term is negative, and an m that
/// is not quite the best makes it larger. docs/math/tag_map.md eq. (4a).
#[cold]
fn chi2_of_displaced(
    eliminated: &NormalEquations,
    group: &RigidGroup,
    place: &PivotedPose,
    pivot: &Point,
    problem: &Problem,
) -> Option<f64> {
    let covariance = group.motion_covariance(&(place.rotation * (group.centre_in_target - pivot)));
    let pulled = eliminated.gradient();
    let motion = covariance * pulled;
    let (turn, shift) = (motion.fixed_rows::<3>(0).into_owned(), motion.fixed_rows::<3>(3).into_owned());
    let mut chi2 = pulled.dot(&motion).max(0.0);
    for c in problem.seen.get(group.first..group.end())? {
        let y = place.rotation * (c.x_in_target - pivot);
        let (pixel, jacobian) = problem.camera.project_with_jacobian(&(y + place.pivot_in_cam))?;
        let (a, b, d) = whitening(c, &held_jacobian(c, problem)?.unwrap_or(jacobian));
        let e = c.pixel - pixel - jacobian * (turn.cross(&y) + shift);
        chi2 += (a * e.x + b * e.y).powi(2) + (d * e.y).powi(2);
    }
    Some(chi2)
}

#[inline(never)]
fn accumulate(place: &PivotedPose, pivot: &Point, problem: &Problem) -> Option<NormalEquations> {
    let mut normal = NormalEquations::zero();
    let mut next = 0;
    for group in problem.groups {
        add_points(&mut normal, place, pivot, problem.seen.get(next..group.first)?, problem)?;
        let mut own = NormalEquations::zero();
        add_points(&mut own, place, pivot, problem.seen.get(group.first..group.end())?, problem)?;
        let offset = place.rotation * (group.centre_in_target - pivot);
        let mut left = group.eliminated(&own, &offset)?;
        if left.chi2 < CANCELLED * own.chi2 {
            left.chi2 = chi2_of_displaced(&left, group, place, pivot, problem)?;
        }
        normal.merge(&left);
        next = group.end();
    }
    add_points(&mut normal, place, pivot, problem.seen.get(next..)?, problem)?;
    if !problem.priors.is_empty() {
        add_priors(&mut normal, &place.pose(pivot), &place.pivot_in_cam, problem);
    }
    normal.chi2.is_finite().then_some(normal)
}

fn add_points(
    normal: &mut NormalEquations,
    place: &PivotedPose,
    pivot: &Point,
    seen: &[Correspondence],
    problem: &Problem,
) -> Option<()> {
    for c in seen {
        let y = place.rotation * (c.x_in_target - pivot);
        let projected = problem.camera.project_with_jacobian(&(y + place.pivot_in_cam))?;
        let weighing = held_jacobian(c, problem)?.unwrap_or(projected.1);
        add_point(normal, c, &y, projected, &weighing, problem.loss);
    }
    Some(())
}

/// Each residual of each prior, its derivative taken about the pivot.
fn add_priors(normal: &mut NormalEquations, cam_from_target: &Pose, pivot_in_cam: &Point, problem: &Problem) {
    for f in problem.priors.iter().flat_map(|prior| factors(prior, cam_from_target)) {
        normal.add(f.residual, &f.by_rotation_about(pivot_in_cam), &f.by_translation);
    }
}

/// Out of line: the loop over plain points keeps its registers.
#[inline(never)]
fn add_apart(
    normal: &mut NormalEquations,
    c: &Correspondence,
    y: &Vector3<f64>,
    x: &Point,
    model: &Pinhole,
) -> Option<()> {
    let seen = model.project_with_jacobian(x)?;
    add_point(normal, c, y, seen, &seen.1, Loss::Squared);
    Some(())
}

/// Any point: whitened (the uncertainty of a surveyed point, seen through the lens, correlates the two pixel coordinates), then
/// weighted as the loss says. `weighing` is the derivative by which an uncertain point is whitened.
fn add_point(
    normal: &mut NormalEquations,
    c: &Correspondence,
    y: &Vector3<f64>,
    (pixel, jacobian): (Pixel, Matrix2x3<f64>),
    weighing: &Matrix2x3<f64>,
    loss: Loss,
) {
    let e = c.pixel - pixel;
    let (a, b, d) = whitening(c, weighing);
    let (ru, rv) = (a * e.x + b * e.y, d * e.y);
    let squared = ru * ru + rv * rv;
    let (cost, weight) = loss.at(squared);
    let root = weight.sqrt();
    let (ju, jv) = (jacobian.row(0).transpose(), jacobian.row(1).transpose());
    let (ju, jv) = ((ju * a + jv * b) * root, jv * (d * root));
    normal.add(ru * root, &y.cross(&ju), &ju);
    normal.add(rv * root, &y.cross(&jv), &jv);
    // What `add` counted is the parabola that touches the loss here; the loss itself is what must fall.
    normal.chi2 += cost - weight * squared;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::CameraMatrix;
    use nalgebra::{Matrix6, SMatrix, SVector};

    fn camera() -> Camera {
        let matrix = CameraMatrix { fx_px: 340.0, fy_px: 340.0, cx_px: 320.0, cy_px: 240.0 };
        Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
    }

    /// rᵀ (1 + J S Jᵀ)⁻¹ r of the four corners, all at once.
    fn dense(seen: &[Correspondence], group: &RigidGroup, pose: &Pose) -> f64 {
        let (mut r, mut j) = (SVector::<f64, 8>::zeros(), SMatrix::<f64, 8, 6>::zeros());
        let centre = pose * &group.centre_in_target;
        for (i, c) in seen.iter().enumerate() {
            let x = pose * &c.x_in_target;
            let (pixel, by_point) = camera().project_with_jacobian(&x).unwrap();
            r.fixed_rows_mut::<2>(2 * i).copy_from(&((c.pixel - pixel) / c.sigma_px));
            let turned = by_point * -(x - centre).cross_matrix();
            j.fixed_view_mut::<2, 3>(2 * i, 0).copy_from(&(turned / c.sigma_px));
            j.fixed_view_mut::<2, 3>(2 * i, 3).copy_from(&(by_point / c.sigma_px));
        }
        let s: Matrix6<f64> = group.motion_covariance(&Vector3::zeros());
        let whole: SMatrix<f64, 8, 8> = SMatrix::identity() + j * s * j.transpose();
        r.dot(&whole.cholesky().unwrap().solve(&r))
    }

    /// A tag one corner of which nears the plane of the camera: χ² is that of the whole covariance, and never below zero.
    #[test]
    fn chi2_of_a_displaced_group_is_no_rounding() {
        let corners = [[-0.03, -0.03], [0.03, -0.03], [0.03, 0.03], [-0.03, 0.03]];
        let pixels = [[250.0, 200.0], [330.0, 190.0], [340.0, 260.0], [240.0, 270.0]];
        let camera = camera();
        let seen = [0, 1, 2, 3].map(|i| {
            let [[x, y], [u, v]] = [corners[i], pixels[i]];
            Correspondence::new(&camera, Point::new(x, y, 0.0), Pixel::new(u, v), 0.2).unwrap()
        });
        let centre_in_target = Point::zeros();
        let group = RigidGroup { first: 0, n_points: 4, centre_in_target, sigma_m: 0.005, sigma_rad: 0.03 };
        let groups = [group];
        let problem = Problem { groups: &groups, ..Problem::new(&seen, &camera) };
        for turn in 0..40 {
            let tilt = Vector3::new(0.5 + 0.02 * f64::from(turn), -0.9 + 0.03 * f64::from(turn), 0.3);
            let motion = crate::Vector6::new(tilt.x, tilt.y, tilt.z, 0.0, 0.0, 0.0);
            let rotation = Pose::exp(&motion).rotation;
            let nearest =
                seen.map(|c| (rotation * c.x_in_target).z).into_iter().fold(f64::INFINITY, f64::min);
            for nearness in 1..12 {
                let depth_m = 10f64.powi(-nearness);
                let pose = Pose::new(rotation, Point::new(0.02, -0.01, depth_m - nearest));
                let (chi2, _) = residual_sums(&pose, &problem);
                assert!(0.0 <= chi2, "{depth_m} m: {chi2}");
                if nearness <= 3 {
                    let expected = dense(&seen, &group, &pose);
                    assert!((chi2 / expected - 1.0).abs() < 1e-6, "{depth_m} m: {chi2}, not {expected}");
                }
            }
        }
    }
}
