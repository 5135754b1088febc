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
use crate::factor::{self, factors};
use crate::least_squares::{NormalEquations, PivotedPose};
use crate::loss::Loss;
use crate::problem::Problem;
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
        let (_, e, whitened) = whitened_residual(cam_from_target, c, problem.camera)?;
        chi2 += problem.loss.at(whitened).0;
        sum += e.norm_squared();
    }
    Some((chi2, sum))
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

#[inline(never)]
fn accumulate(place: &PivotedPose, pivot: &Point, problem: &Problem) -> Option<NormalEquations> {
    let mut normal = NormalEquations::zero();
    for c in problem.seen {
        let y = place.rotation * (c.x_in_target - pivot);
        let seen = problem.camera.project_with_jacobian(&(y + place.pivot_in_cam))?;
        add_point(&mut normal, c, &y, seen, problem.loss);
    }
    if !problem.priors.is_empty() {
        add_priors(&mut normal, &place.pose(pivot), &place.pivot_in_cam, problem);
    }
    normal.chi2.is_finite().then_some(normal)
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
    add_point(normal, c, y, model.project_with_jacobian(x)?, Loss::Squared);
    Some(())
}

/// Any point: whitened (the uncertainty of a surveyed point, seen through the lens, correlates the two pixel coordinates), then
/// weighted as the loss says.
fn add_point(
    normal: &mut NormalEquations,
    c: &Correspondence,
    y: &Vector3<f64>,
    (pixel, jacobian): (Pixel, Matrix2x3<f64>),
    loss: Loss,
) {
    let e = c.pixel - pixel;
    let (a, b, d) = whitening(c, &jacobian);
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
