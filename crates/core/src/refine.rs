//! One pose: reprojection residual, Jacobian, covariance. Maximum likelihood for independent Gaussian pixel errors.
//!
//! ```text
//!   r = (observed − π(x)) / σ,   x = R (X − X̄) + c,   y = x − c
//!   ∂π/∂[ω; ν] = [ −Π [y]×  Π ],  Π = ∂π/∂x (2×3): each row j of Π gives the row [y × j ; j]
//! ```
//! Derivation: docs/math/refine.md eqs. (1)–(3).

use crate::camera::Pinhole;
use crate::choose::Minimum;
use crate::least_squares::{NormalEquations, PivotedPose, Solution, minimize};
use crate::problem::Problem;
use crate::{Camera, Correspondence, Error, Lens, Pixel, Point, Pose};
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

/// The points leave a direction free, to rounding.
const UNDETERMINED: Error = Error::DegenerateView {
    reason: "these points leave a direction of the pose undetermined; add points away from the others",
    metric: 0.0,
    needed: f64::MIN_POSITIVE,
};

/// Refines `start` to the nearest minimum of the reprojection error, with its covariance.
///
/// `Error::NotConverged` when no minimum is reached, `Error::NoSolution` when the start has points outside the camera's
/// field, `Error::DegenerateView` when the points do not determine the pose to first order.
pub fn refine(start: &Pose, seen: &[Correspondence], camera: &Camera) -> Result<Minimum, Error> {
    refine_against(start, None, &Problem::new(seen, camera))
}

/// As `refine`, for a minimum that will be compared with a rival of known χ²: it may end early
/// where it stays far above the rival.
pub(crate) fn refine_against(
    start: &Pose,
    rival_chi2: Option<f64>,
    problem: &Problem,
) -> Result<Minimum, Error> {
    let pivot = centroid(problem.seen);
    let start = PivotedPose::new(start, &pivot);
    let solution = match &problem.camera.lens {
        Lens::Pinhole(model) => {
            minimize(start, rival_chi2, |place| accumulate_pinhole(place, &pivot, problem.seen, model))
        }
        _ => minimize_any_lens(start, rival_chi2, &pivot, problem),
    };
    let solution = solution.ok_or(Error::NoSolution { n_points: problem.seen.len() })?;
    if !solution.converged {
        return Err(Error::NotConverged { steps: solution.steps });
    }
    let covariance =
        solution.normal.covariance_at_camera(&solution.place.pivot_in_cam).ok_or(UNDETERMINED)?;
    let cam_from_target = solution.place.pose(&pivot);
    let (chi2, rms_px) = residual_sums(&cam_from_target, problem);
    Ok(Minimum { cam_from_target, covariance, chi2, rms_px })
}

/// Apart from the loop of the usual lens, which then compiles as one piece and keeps the normal equations in place.
#[inline(never)]
fn minimize_any_lens(
    start: PivotedPose,
    rival_chi2: Option<f64>,
    pivot: &Point,
    problem: &Problem,
) -> Option<Solution> {
    minimize(start, rival_chi2, |place| accumulate(place, pivot, problem.seen, problem.camera))
}

/// Residual of one correspondence, observed − predicted, px; none outside the camera's field.
pub fn residual_px(cam_from_target: &Pose, c: &Correspondence, camera: &Camera) -> Option<Vector2<f64>> {
    Some(c.pixel - camera.project(&(cam_from_target * &c.x_in_target))?)
}

/// The mean of the target points: the pivot of the refinement.
pub(crate) fn centroid(seen: &[Correspondence]) -> Point {
    seen.iter().map(|c| c.x_in_target).sum::<Point>() / seen.len().max(1) as f64
}

/// χ² and root mean square distance, px; infinite where a point leaves the field.
#[inline]
pub(crate) fn residual_sums(cam_from_target: &Pose, problem: &Problem) -> (f64, f64) {
    let Problem { seen, camera } = *problem;
    let sums = match &camera.lens {
        Lens::Pinhole(model) => sum_residuals(cam_from_target, problem, |x| model.project(x)),
        _ => sum_residuals(cam_from_target, problem, |x| camera.project(x)),
    };
    let (chi2, sum) = sums.unwrap_or((f64::INFINITY, f64::INFINITY));
    (chi2, (sum / seen.len().max(1) as f64).sqrt())
}

#[inline(always)]
fn sum_residuals(
    cam_from_target: &Pose,
    problem: &Problem,
    project: impl Fn(&Point) -> Option<Pixel>,
) -> Option<(f64, f64)> {
    let (mut chi2, mut sum) = (0.0, 0.0);
    for c in problem.seen {
        if c.sigma_m == 0.0 {
            let squared = (c.pixel - project(&(cam_from_target * &c.x_in_target))?).norm_squared();
            chi2 += squared / (c.sigma_px * c.sigma_px);
            sum += squared;
        } else {
            let (_, e, whitened) = whitened_residual(cam_from_target, c, problem.camera)?;
            chi2 += whitened;
            sum += e.norm_squared();
        }
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
    if c.sigma_m == 0.0 {
        let e = c.pixel - camera.project(&x)?;
        return Some((x, e, e.norm_squared() / (c.sigma_px * c.sigma_px)));
    }
    let (pixel, jacobian) = camera.project_with_jacobian(&x)?;
    let e = c.pixel - pixel;
    Some((x, e, e.dot(&(information(c, &jacobian) * e))))
}

/// Inverse covariance of a pixel residual: (σ_px² I + σ_m² Π Πᵀ)⁻¹, the second term for surveyed points,
/// docs/math/refine.md eq. (8).
pub(crate) fn information(c: &Correspondence, jacobian: &Matrix2x3<f64>) -> Matrix2<f64> {
    let s = c.sigma_px * c.sigma_px;
    let p = jacobian * jacobian.transpose() * (c.sigma_m * c.sigma_m);
    let (a, b, d) = (s + p[(0, 0)], p[(0, 1)], s + p[(1, 1)]);
    Matrix2::new(d, -b, -b, a) / (a * d - b * b)
}

/// W with WᵀW = information, upper triangular: whitens residuals and derivatives alike.
fn whitening(c: &Correspondence, jacobian: &Matrix2x3<f64>) -> (f64, f64, f64) {
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
        Lens::Pinhole(model) => accumulate_pinhole(place, pivot, problem.seen, model),
        _ => accumulate(place, pivot, problem.seen, problem.camera),
    }
}

/// As `accumulate`, for the lens of most cameras of the inner loop: a third less arithmetic.
#[inline(always)]
fn accumulate_pinhole(
    place: &PivotedPose,
    pivot: &Point,
    seen: &[Correspondence],
    model: &Pinhole,
) -> Option<NormalEquations> {
    let k = &model.matrix;
    let mut normal = NormalEquations::zero();
    for c in seen {
        let y = place.rotation * (c.x_in_target - pivot);
        if c.sigma_m != 0.0 {
            add_surveyed(&mut normal, c, &y, model.project_with_jacobian(&(y + place.pivot_in_cam))?);
            continue;
        }
        let x = y + place.pivot_in_cam;
        let in_front = 0.0 < x.z;
        if !in_front {
            return None;
        }
        let (iz, w) = (1.0 / x.z, 1.0 / c.sigma_px);
        let (xn, yn) = (x.x * iz, x.y * iz);
        let (a, b) = (k.fx_px * iz * w, k.fy_px * iz * w);
        let ru = (c.pixel.x - (k.fx_px * xn + k.cx_px)) * w;
        let rv = (c.pixel.y - (k.fy_px * yn + k.cy_px)) * w;
        normal.add_pinhole([ru, rv], &y, [a, -a * xn], [b, -b * yn]);
    }
    normal.chi2.is_finite().then_some(normal)
}

fn accumulate(
    place: &PivotedPose,
    pivot: &Point,
    seen: &[Correspondence],
    camera: &Camera,
) -> Option<NormalEquations> {
    let mut normal = NormalEquations::zero();
    for c in seen {
        let y = place.rotation * (c.x_in_target - pivot);
        let (pixel, jacobian) = camera.project_with_jacobian(&(y + place.pivot_in_cam))?;
        if c.sigma_m != 0.0 {
            add_surveyed(&mut normal, c, &y, (pixel, jacobian));
            continue;
        }
        let e = c.pixel - pixel;
        let ju = Vector3::new(jacobian[(0, 0)], jacobian[(0, 1)], jacobian[(0, 2)]);
        let jv = Vector3::new(jacobian[(1, 0)], jacobian[(1, 1)], jacobian[(1, 2)]);
        let w = 1.0 / c.sigma_px;
        let (ju, jv) = (ju * w, jv * w);
        normal.add(e.x * w, &y.cross(&ju), &ju);
        normal.add(e.y * w, &y.cross(&jv), &jv);
    }
    normal.chi2.is_finite().then_some(normal)
}

/// A surveyed point: its own uncertainty, seen through the lens, correlates the two pixel coordinates.
fn add_surveyed(
    normal: &mut NormalEquations,
    c: &Correspondence,
    y: &Vector3<f64>,
    (pixel, jacobian): (Pixel, Matrix2x3<f64>),
) {
    let e = c.pixel - pixel;
    let (a, b, d) = whitening(c, &jacobian);
    let (ju, jv) = (jacobian.row(0).transpose(), jacobian.row(1).transpose());
    let (ju, jv) = (ju * a + jv * b, jv * d);
    normal.add(a * e.x + b * e.y, &y.cross(&ju), &ju);
    normal.add(d * e.y, &y.cross(&jv), &jv);
}
