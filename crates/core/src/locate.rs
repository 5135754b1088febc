//! The single-camera pipeline: correspondences in, one pose with covariance and ambiguity out.
//!
//! classify → closed form → refine each candidate → choose → consistency. Each line of `locate` is one file.

use crate::camera::MAX_PARAMETERS;
use crate::choose::{AMBIGUITY_GATE_CHI2, Ambiguity, Minima, Minimum, choose, insert};
use crate::consistency::{Consistency, consistency, is_unlikely, noise_scale};
use crate::curvature::with_curvature;
use crate::refine::{centroid, information, refine_against, residual_sums};
use crate::solve::Candidates;
use crate::solve::configuration::{Configuration, classify};
use crate::solve::line_plus_one::Weakness;
use crate::solve::{line_plus_one, p3p, planar, sqpnp, wang2004};
use crate::{Bearing, Camera, Correspondence, Error, Matrix6, Point, Pose, Vector6};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Vector2, Vector3};

/// How a pose is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Method {
    /// Decide from the configuration.
    #[default]
    Auto,
    /// The seed paper, literally: no refinement, the solution of least residual in its eq. (3).
    Wang2004,
    /// Three collinear points and one off the line.
    LinePlusOne,
    /// Three points; with more, three of them and the rest to choose.
    P3p,
    /// Coplanar points.
    Planar,
    /// Any n ≥ 3 points.
    Sqpnp,
}

/// What to do beyond the defaults.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Config<'a> {
    /// The method; `Auto` decides from the points.
    pub method: Method,
    /// Covariance of the camera's intrinsic parameters, row by row, in the order of `Camera::parameters`; adds their share
    /// to the pose covariance.
    pub intrinsics_covariance: Option<&'a [f64]>,
}

/// A pose, how sure, and whether another one fits as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseEstimate {
    /// The pose: x_in_cam = cam_from_target · x_in_target.
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Matrix6,
    /// Root mean square reprojection error over points, px.
    pub rms_px: f64,
    /// Sum of squared residuals over their variances.
    pub chi2: f64,
    /// 2 n − 6.
    pub degrees_of_freedom: usize,
    /// How many correspondences took part.
    pub n_points: usize,
    /// The method that answered (never `Auto`).
    pub method: Method,
    /// Does another pose fit as well?
    pub ambiguity: Ambiguity,
    /// Does the residual fit the sigmas?
    pub consistency: Consistency,
    /// What makes the view weak: found by the closed form, before refinement, or by the two poses that fit alike.
    pub weakness: Option<Weakness>,
}

/// The pose of a camera from known points.
///
/// No heap is touched. Fails with a named error where the points do not determine a pose; a pose that another one rivals is
/// `Ambiguous`, one whose residual contradicts the sigmas `Inconsistent`.
pub fn locate(seen: &[Correspondence], camera: &Camera, config: &Config) -> Result<PoseEstimate, Error> {
    let configuration = classify(seen)?;
    let method = resolve(config.method, &configuration)?;
    let mut minima = Minima::new();
    let weakness = match method {
        Method::Wang2004 => literal(&configuration, seen, camera, &mut minima)?,
        _ => search(method, &configuration, seen, camera, &mut minima),
    };
    let degrees_of_freedom = 2 * seen.len() - 6;
    let noise_scale = minima.first().map_or(1.0, |m| noise_scale(m.chi2, degrees_of_freedom));
    let (best, ambiguity) = choose(&minima, seen.len(), noise_scale)?;
    let weakness = weakness.or_else(|| weakness_of_rivals(&configuration, &best, &ambiguity, seen, camera));
    let best = Minimum { covariance: with_curvature(&best, seen, camera), ..best };
    let covariance = match config.intrinsics_covariance {
        Some(given) => best.covariance + intrinsics_share(&best, seen, camera, given)?,
        None => best.covariance,
    };
    let estimate = PoseEstimate {
        cam_from_target: best.cam_from_target,
        covariance: covariance * noise_scale,
        rms_px: best.rms_px,
        chi2: best.chi2,
        degrees_of_freedom,
        n_points: seen.len(),
        method,
        ambiguity: widened(ambiguity, noise_scale),
        consistency: consistency(&best, degrees_of_freedom, seen, camera),
        weakness,
    };
    if estimate.is_finite() { Ok(estimate) } else { Err(OVERFLOW) }
}

/// Sigmas, coordinates or intrinsics so far apart that their squares leave the range of numbers.
const OVERFLOW: Error = Error::DegenerateView {
    reason: "coordinates, sigmas and camera differ by so many orders of magnitude that the answer overflows; check their units",
    metric: f64::INFINITY,
    needed: f64::MAX,
};

impl PoseEstimate {
    /// Every number in it is one, and no variance is negative.
    fn is_finite(&self) -> bool {
        let other = match &self.ambiguity {
            Ambiguity::Ambiguous { ratio, other } => ratio.is_finite() && other.is_finite(),
            Ambiguity::Unique { ratio } => ratio.is_none_or(f64::is_finite),
        };
        let residual = match self.consistency {
            Consistency::Inconsistent { chi2_per_dof, worst_px, .. } => {
                chi2_per_dof.is_finite() && worst_px.is_finite()
            }
            Consistency::Consistent => true,
        };
        let (cam_from_target, covariance) = (self.cam_from_target, self.covariance);
        let first = Minimum { cam_from_target, covariance, chi2: self.chi2, rms_px: self.rms_px };
        first.is_finite() && other && residual
    }
}

/// `Auto` becomes the method for the configuration; a method that does not fit it is refused.
fn resolve(method: Method, configuration: &Configuration) -> Result<Method, Error> {
    let wrong = |method, reason| Err(Error::WrongLayout { method, reason });
    let four = "it takes three points on a line and one off it";
    match (method, configuration) {
        (Method::Auto, Configuration::LinePlusOne { .. }) => Ok(Method::LinePlusOne),
        (Method::Auto, Configuration::Three) => Ok(Method::P3p),
        (Method::Auto, Configuration::Planar) => Ok(Method::Planar),
        (Method::Auto, Configuration::General) => Ok(Method::Sqpnp),
        (Method::LinePlusOne | Method::Wang2004, Configuration::LinePlusOne { .. }) => Ok(method),
        (Method::LinePlusOne, _) => wrong("line_plus_one", four),
        (Method::Wang2004, _) => wrong("wang2004", four),
        (Method::Planar, Configuration::Three) => wrong("planar", "it takes at least four points"),
        (Method::Planar, Configuration::General) => wrong("planar", "the points do not lie in one plane"),
        (Method::Planar, Configuration::LinePlusOne { .. }) => {
            wrong("planar", "three collinear points and one off the line leave a homography open")
        }
        (method, _) => Ok(method),
    }
}

/// A second start farther off than this fits nothing near: it is not refined once a first minimum is known.
const HOPELESS_CHI2: f64 = 1e4;

/// The minima reached from the closed form's candidates, and from more starts where those leave a doubt.
fn search(
    method: Method,
    configuration: &Configuration,
    seen: &[Correspondence],
    camera: &Camera,
    minima: &mut Minima,
) -> Option<Weakness> {
    let (candidates, weakness) = closed_form(method, configuration, seen, camera);
    let flat = 3 < seen.len() && !matches!(configuration, Configuration::General);
    if flat {
        let normal = plane_normal(configuration, seen);
        refine_pair(candidates, &normal, seen, camera, minima);
    } else {
        refine_each(&candidates, seen, camera, minima);
    }
    if minima.first().is_none_or(|m| is_unlikely(m.chi2, 2 * seen.len() - 6)) {
        refine_each(&sqpnp::sqpnp(seen), seen, camera, minima);
        refine_each(&three_of(seen), seen, camera, minima);
    } else if seen.len() == 4 && (weakness.is_some() || is_in_doubt(minima)) {
        refine_each(&three_of(seen), seen, camera, minima);
    }
    weakness
}

/// The two minima of a flat target: from the better candidate, then from its mirror pose or the other candidate, whichever
/// fits better to begin with. Closed forms often give one minimum twice; the mirror pose finds the other.
fn refine_pair(
    mut candidates: Candidates,
    normal: &Vector3<f64>,
    seen: &[Correspondence],
    camera: &Camera,
    minima: &mut Minima,
) {
    let start_chi2 = |start: &Pose| residual_sums(start, seen, camera).0;
    if candidates.len() == 2 && start_chi2(&candidates[1]) < start_chi2(&candidates[0]) {
        candidates.swap(0, 1);
    }
    let Some((first, others)) = candidates.split_first() else { return };
    refine_each(&[*first], seen, camera, minima);
    let Some(best) = minima.first() else { return refine_each(others, seen, camera, minima) };
    let mut starts: ArrayVec<(f64, Pose), 4> =
        others.iter().map(|start| (start_chi2(start), *start)).collect();
    let mirrored = mirrored(&best.cam_from_target, normal, seen);
    starts.push((start_chi2(&mirrored), mirrored));
    starts.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    for (i, (chi2, start)) in starts.iter().enumerate() {
        if i == 0 || (minima.len() == 1 && *chi2 < HOPELESS_CHI2) {
            refine_each(&[*start], seen, camera, minima);
        }
    }
}

/// Whether the best minimum leaves room within the ambiguity gate for one not found yet: another is that near, or its own
/// χ² is that large. Four points have up to four minima, and the closed form's two candidates need not lead to the lowest:
/// of 586 photographed quadruples 6 had it elsewhere, of 20,000 random ones at 1 px 6 (1 with the P3P starts).
fn is_in_doubt(minima: &Minima) -> bool {
    let near = |chi2: f64| chi2 < AMBIGUITY_GATE_CHI2;
    minima.first().is_none_or(|m| !near(m.chi2))
        || minima.get(1).is_some_and(|m| near(m.chi2 - minima[0].chi2))
}

fn refine_each(candidates: &[Pose], seen: &[Correspondence], camera: &Camera, minima: &mut Minima) {
    for candidate in candidates {
        let rival = minima.first().map(|m| m.chi2);
        if let Ok(minimum) = refine_against(candidate, rival, seen, camera) {
            insert(minima, minimum);
        }
    }
}

/// The closed form of a method, and what makes the view weak.
fn closed_form(
    method: Method,
    configuration: &Configuration,
    seen: &[Correspondence],
    camera: &Camera,
) -> (Candidates, Option<Weakness>) {
    match (method, configuration) {
        (Method::LinePlusOne, Configuration::LinePlusOne { order }) => {
            let (bearings, points) = four_of(seen, order);
            let candidates = line_plus_one::line_plus_one(&bearings, &points);
            let sigma_rad = sigma_rad(&seen[order[3]], camera);
            let weakness = line_plus_one::weakness(&candidates, &bearings, &points, sigma_rad);
            (candidates, weakness)
        }
        (Method::P3p, _) => (three_of(seen), None),
        (Method::Planar, _) => (planar::planar(seen), None),
        _ => (sqpnp::sqpnp(seen), None),
    }
}

/// Why two refined poses fit alike, where the closed form's candidates were too noisy to tell.
fn weakness_of_rivals(
    configuration: &Configuration,
    best: &Minimum,
    ambiguity: &Ambiguity,
    seen: &[Correspondence],
    camera: &Camera,
) -> Option<Weakness> {
    let (Configuration::LinePlusOne { order }, Ambiguity::Ambiguous { other, .. }) =
        (configuration, ambiguity)
    else {
        return None;
    };
    let rivals: Candidates = [best.cam_from_target, other.cam_from_target].into_iter().collect();
    let (bearings, points) = four_of(seen, order);
    line_plus_one::weakness(&rivals, &bearings, &points, sigma_rad(&seen[order[3]], camera))
}

/// The four points of a line-plus-one layout, in order along the line, the one off it last.
fn four_of(seen: &[Correspondence], order: &[usize; 4]) -> ([Bearing; 4], [Point; 4]) {
    (order.map(|i| seen[i].bearing), order.map(|i| seen[i].x_in_target))
}

/// P3P on the three points that span the largest triangle found from the first point.
fn three_of(seen: &[Correspondence]) -> Candidates {
    let [i, j, k] = wide_triangle(seen);
    let order = [i, j, k];
    p3p::p3p(&order.map(|i| seen[i].bearing), &order.map(|i| seen[i].x_in_target))
}

/// The farthest point from the first, the farthest from that, and the one farthest off their line.
fn wide_triangle(seen: &[Correspondence]) -> [usize; 3] {
    let x = |i: usize| seen[i].x_in_target;
    let farthest = |measure: &dyn Fn(usize) -> f64| {
        (0..seen.len()).fold(0, |best, i| if measure(best) < measure(i) { i } else { best })
    };
    let i = farthest(&|n| (x(n) - x(0)).norm_squared());
    let j = farthest(&|n| (x(n) - x(i)).norm_squared());
    let k = farthest(&|n| (x(n) - x(i)).cross(&(x(j) - x(i))).norm_squared());
    [i, j, k]
}

/// The standard deviation of a pixel as an angle, radians.
fn sigma_rad(c: &Correspondence, camera: &Camera) -> f64 {
    let beside = c.pixel + Vector2::new(c.sigma_px, 0.0);
    camera.bearing(&beside).map_or(f64::INFINITY, |b| b.cross(&c.bearing).norm())
}

/// Unit normal of a flat target, target frame.
fn plane_normal(configuration: &Configuration, seen: &[Correspondence]) -> Vector3<f64> {
    let [i, j, k] = match configuration {
        Configuration::LinePlusOne { order: [a, _, c, d] } => [*a, *c, *d],
        _ => wide_triangle(seen),
    };
    let x = |n: usize| seen[n].x_in_target;
    (x(j) - x(i)).cross(&(x(k) - x(i))).normalize()
}

/// The start for the other minimum of a flat target: the target mirrored in the plane through its centre perpendicular to
/// the line of sight. From afar the two look alike: docs/math/line_plus_one.md eqs. (9)–(11).
fn mirrored(cam_from_target: &Pose, normal: &Vector3<f64>, seen: &[Correspondence]) -> Pose {
    let centre = centroid(seen);
    let centre_in_cam = cam_from_target * &centre;
    let sight = centre_in_cam.normalize();
    let reflection = |n: &Vector3<f64>| Matrix3::identity() - n * n.transpose() * 2.0;
    // Two reflections make a rotation; the one in the target's own plane does not move its points.
    let rotation = reflection(&sight) * cam_from_target.rotation * reflection(normal);
    Pose::new(rotation, centre_in_cam - rotation * centre)
}

/// The seed paper's answer as it stands, its covariance propagated from the pixels by central differences.
fn literal(
    configuration: &Configuration,
    seen: &[Correspondence],
    camera: &Camera,
    minima: &mut Minima,
) -> Result<Option<Weakness>, Error> {
    let Configuration::LinePlusOne { order } = configuration else {
        return Err(Error::WrongLayout {
            method: "wang2004",
            reason: "it takes three points on a line and one off it",
        });
    };
    let solve = |bearings: &[Bearing; 4], points: &[Point; 4]| {
        let solutions = wang2004::wang2004(bearings, points)?;
        wang2004::least_residual(&solutions)
            .map(|s| s.cam_from_target)
            .ok_or(Error::NoSolution { n_points: seen.len() })
    };
    let (bearings, points) = four_of(seen, order);
    let cam_from_target = solve(&bearings, &points)?;
    let mut covariance = Matrix6::zeros();
    for (slot, index) in order.iter().enumerate() {
        let c = &seen[*index];
        for axis in 0..2 {
            let moved = |step: f64| {
                let mut pixel = c.pixel;
                pixel[axis] += step * c.sigma_px;
                let mut bearings = bearings;
                bearings[slot] = camera.bearing(&pixel)?;
                Ok((solve(&bearings, &points)? * cam_from_target.inverse()).log())
            };
            let column = (moved(LITERAL_STEP)? - moved(-LITERAL_STEP)?) / (2.0 * LITERAL_STEP);
            covariance += column * column.transpose();
        }
    }
    let (chi2, rms_px) = residual_sums(&cam_from_target, seen, camera);
    minima.push(Minimum { cam_from_target, covariance, chi2, rms_px });
    Ok(None)
}

/// Step of the central differences, in standard deviations of a pixel: small beside the noise, large beside rounding.
const LITERAL_STEP: f64 = 1e-2;

/// What uncertain intrinsics add to the covariance: δξ = Σ Jᵀ W (−∂π/∂θ) δθ, docs/math/refine.md eq. (9).
fn intrinsics_share(
    best: &Minimum,
    seen: &[Correspondence],
    camera: &Camera,
    covariance: &[f64],
) -> Result<Matrix6, Error> {
    let mut by_parameter = [Vector6::zeros(); MAX_PARAMETERS];
    let mut n_parameters = 0;
    for c in seen {
        let x = best.cam_from_target * c.x_in_target;
        let no_solution = Error::NoSolution { n_points: seen.len() };
        let (_, jacobian) = camera.project_with_jacobian(&x).ok_or(no_solution.clone())?;
        let columns = camera.intrinsics_jacobian(&x).ok_or(no_solution)?;
        n_parameters = columns.len();
        for (sum, column) in by_parameter.iter_mut().zip(&columns) {
            let force = jacobian.tr_mul(&(information(c, &jacobian) * column));
            let torque = x.cross(&force);
            *sum -= Vector6::new(torque.x, torque.y, torque.z, force.x, force.y, force.z);
        }
    }
    check_intrinsics_covariance(covariance, n_parameters)?;
    let mut share = Matrix6::zeros();
    for i in 0..n_parameters {
        for j in 0..n_parameters {
            share += by_parameter[i] * by_parameter[j].transpose() * covariance[i * n_parameters + j];
        }
    }
    Ok(best.covariance * share * best.covariance)
}

/// Refuses a matrix that is no covariance: another size, not finite, a negative variance.
fn check_intrinsics_covariance(covariance: &[f64], n_parameters: usize) -> Result<(), Error> {
    let invalid = |parameter, seen, needed| Err(Error::InvalidCamera { parameter, seen, needed });
    if covariance.len() != n_parameters * n_parameters {
        let needed = "give its n × n covariance, n the number of parameters";
        return invalid("intrinsics covariance size", covariance.len() as f64, needed);
    }
    if let Some(&seen) = covariance.iter().find(|x| !x.is_finite()) {
        return invalid("intrinsics covariance", seen, "every entry must be finite");
    }
    let variances = (0..n_parameters).map(|i| covariance[i * n_parameters + i]);
    match variances.into_iter().find(|x| *x < 0.0) {
        Some(seen) => invalid("intrinsics covariance", seen, "no variance can be negative"),
        None => Ok(()),
    }
}

fn widened(ambiguity: Ambiguity, noise_scale: f64) -> Ambiguity {
    match ambiguity {
        Ambiguity::Ambiguous { ratio, mut other } => {
            other.covariance *= noise_scale;
            Ambiguity::Ambiguous { ratio, other }
        }
        unique => unique,
    }
}
