//! The place of a point from two or more calibrated views, with its covariance: maximum likelihood for Gaussian pixel errors.
//!
//! Two views start from the global minimum of the image error (`two_view`), more from that of the best pair and from a linear
//! estimate of all; the end is the minimum over the exact pixels of every lens. What is too far away to have a place is refused.
//!
//! ```text
//!   x = R X + t  the point in the camera frame, J = ∂π/∂x  ·  C pose, S intrinsics: covariances  ·  K = ∂π/∂θ
//!   V = Σ + J [−[x]ₓ I] C [−[x]ₓ I]ᵀ Jᵀ + K S Kᵀ  covariance of a residual      docs/math/triangulate.md eq. (1)
//! ```

mod two_view;
mod linear;

use crate::correspondence::PixelCovariance;
use crate::least_squares::point::{PointEquations, PointMinimum, minimize_point};
use crate::locate::consistency::is_unlikely;
use crate::{Bearing, Camera, Error, Matrix6, Pixel, Point, Pose};
use nalgebra::{Matrix2, Matrix2x3, Matrix2x6, Matrix3, Vector2, Vector3};

/// A point seen by a calibrated camera at a known place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointView<'a> {
    /// Its lens.
    pub camera: &'a Camera,
    /// Its place: x_in_cam = cam_from_world · x_in_world.
    pub cam_from_world: Pose,
    /// 6×6 covariance of the place's small left motion `[rotation_rad; translation_m]`, camera frame; none where exact. Places of
    /// different views are taken as independent.
    pub covariance: Option<Matrix6>,
    /// Covariance of the intrinsic parameters, row by row, in the order of `Camera::parameters`; none where exact. Views are taken
    /// as independent: photographs of one camera go through `network`.
    pub intrinsics_covariance: Option<&'a [f64]>,
    /// Where the point was seen.
    pub pixel: Pixel,
    /// How uncertain that is.
    pub covariance_px2: PixelCovariance,
}

/// A point's place, how uncertain, and how well the views agree.
#[derive(Debug, Clone, PartialEq)]
pub struct TriangulatedPoint {
    /// The place.
    pub x_in_world: Point,
    /// Its covariance, m²: the pixels', the poses' and the intrinsics' share.
    pub covariance_m2: Matrix3<f64>,
    /// Residuals, observed − predicted, px, one a view.
    pub residuals_px: Vec<Vector2<f64>>,
    /// Root mean square of their lengths, px.
    pub rms_px: f64,
    /// Sum of squared residuals over their variances, those of poses and intrinsics included.
    pub chi2: f64,
    /// 2 n − 3.
    pub degrees_of_freedom: usize,
    /// Whether views as sure as stated would hardly ever disagree so much (once in ten thousand).
    pub is_inconsistent: bool,
    /// The view whose residual is the largest in standard deviations.
    pub worst_view: usize,
    /// Largest angle between two rays.
    pub parallax_rad: f64,
    /// Its standard deviation.
    pub parallax_sigma_rad: f64,
}

/// Standard deviations that the parallax must differ from zero by: a point at infinity passes once in 740 times.
pub(crate) const LEAST_PARALLAX_SIGMAS: f64 = 3.0;
/// Rounds of new weights: V depends on the point, by a part in 10⁴ once the start is good.
const REWEIGHTINGS: usize = 4;
/// Variance of a pixel below which it is no measurement (1e-12 px).
const LEAST_VARIANCE_PX2: f64 = 1e-24;

/// A view with its ray, and the metric of pixels about it.
pub(crate) struct BearingObservation<'a> {
    pub(crate) view: &'a PointView<'a>,
    pub(crate) bearing: Bearing,
    pub(crate) bearing_in_world: Vector3<f64>,
    pub(crate) centre_in_world: Point,
}

/// The place of a point seen by two or more views.
///
/// # Errors
/// `TooFewPoints` below two views, `InvalidView` for numbers that cannot be right, `OutsideField`, `ParallaxTooSmall` where the point
/// cannot be distinguished from one at infinity (also: one camera centre, or a point on the line through both), `BehindView`.
pub fn triangulate(views: &[PointView]) -> Result<TriangulatedPoint, Error> {
    if views.len() < 2 {
        return Err(Error::TooFewPoints { seen: views.len(), needed: 2 });
    }
    for (index, view) in views.iter().enumerate() {
        check(index, view)?;
    }
    let bearing_observations =
        views.iter().map(BearingObservation::new).collect::<Result<Vec<_>, Error>>()?;
    let pair = widest_pair(&bearing_observations);
    let corrected = two_view::correct(&bearing_observations[pair.0], &bearing_observations[pair.1]);
    let parallax =
        Parallax::of(&bearing_observations[pair.0], &bearing_observations[pair.1], corrected.as_ref());
    parallax.check(pair)?;
    let best = starts(&bearing_observations, corrected.as_ref().map(|c| c.x_in_world))
        .filter_map(|start| refine(&start, &bearing_observations))
        .min_by(|a, b| a.equations.chi2.total_cmp(&b.equations.chi2))
        .ok_or(Error::NoSolution { n_points: 1 })?;
    conclude(&best, &bearing_observations, &parallax)
}

/// Where the refinement starts: the optimum of the widest pair, and the linear estimate from all.
fn starts(
    bearing_observations: &[BearingObservation],
    of_pair: Option<Point>,
) -> impl Iterator<Item = Point> {
    let of_all = if 2 < bearing_observations.len() || of_pair.is_none() {
        linear::nearest_to_rays(bearing_observations)
    } else {
        None
    };
    of_pair.into_iter().chain(of_all)
}

/// The minimum over the exact pixels, weights following the point.
fn refine(start: &Point, bearing_observations: &[BearingObservation]) -> Option<PointMinimum> {
    let mut place = *start;
    let mut found = None;
    for _ in 0..REWEIGHTINGS {
        let weights: Vec<Matrix2<f64>> = bearing_observations
            .iter()
            .map(|s| s.covariance_at(&place)?.try_inverse())
            .collect::<Option<_>>()?;
        let solution = minimize_point(&place, |x| equations(x, bearing_observations, &weights))?;
        let moved2 = {
            let step = solution.state - place;
            step.dot(&(solution.equations.information * step))
        };
        place = solution.state;
        found = Some(solution).filter(|s| s.is_minimum());
        if moved2 < 1e-8 {
            break;
        }
    }
    found
}

fn equations(
    x_in_world: &Point,
    bearing_observations: &[BearingObservation],
    weights: &[Matrix2<f64>],
) -> Option<PointEquations> {
    let mut sum = PointEquations::zero();
    for (bearing_observation, weight) in bearing_observations.iter().zip(weights) {
        let (pixel, by_point) = bearing_observation.predict(x_in_world)?;
        sum.add(&(bearing_observation.view.pixel - pixel), weight, &by_point);
    }
    Some(sum)
}

fn conclude(
    found: &PointMinimum,
    bearing_observations: &[BearingObservation],
    parallax: &Parallax,
) -> Result<TriangulatedPoint, Error> {
    let lost = Error::NoSolution { n_points: 1 };
    let x_in_world = found.state;
    check_in_front(&x_in_world, bearing_observations)?;
    let (mut chi2, mut information) = (0.0, Matrix3::zeros());
    let mut seen = Vec::with_capacity(bearing_observations.len());
    for bearing_observation in bearing_observations {
        let (pixel, by_point) = bearing_observation.predict(&x_in_world).ok_or(lost.clone())?;
        let residual = bearing_observation.view.pixel - pixel;
        let v = bearing_observation.covariance_at(&x_in_world).ok_or(lost.clone())?;
        let weight = v.try_inverse().ok_or(lost.clone())?;
        chi2 += residual.dot(&(weight * residual));
        information += by_point.tr_mul(&(weight * by_point));
        seen.push((residual, v, by_point));
    }
    let covariance_m2 = information.cholesky().ok_or(lost.clone())?.inverse();
    let worst_view = worst(&seen, &covariance_m2);
    let residuals_px: Vec<Vector2<f64>> = seen.iter().map(|s| s.0).collect();
    let degrees_of_freedom = 2 * bearing_observations.len() - 3;
    let squares: f64 = residuals_px.iter().map(|r| r.norm_squared()).sum();
    if !(x_in_world.sum() + covariance_m2.sum() + chi2).is_finite() {
        return Err(lost);
    }
    Ok(TriangulatedPoint {
        x_in_world,
        covariance_m2,
        rms_px: (squares / bearing_observations.len() as f64).sqrt(),
        residuals_px,
        chi2,
        degrees_of_freedom,
        is_inconsistent: is_unlikely(chi2, degrees_of_freedom),
        worst_view,
        parallax_rad: parallax.angle_rad,
        parallax_sigma_rad: parallax.sigma_rad,
    })
}

fn check_in_front(x_in_world: &Point, bearing_observations: &[BearingObservation]) -> Result<(), Error> {
    for (view, bearing_observation) in bearing_observations.iter().enumerate() {
        let depth_m =
            (x_in_world - bearing_observation.centre_in_world).dot(&bearing_observation.bearing_in_world);
        if !(0.0 < depth_m) {
            return Err(Error::BehindView { view, depth_m });
        }
    }
    Ok(())
}

/// The view with the largest residual against what it should scatter by, V − J C Jᵀ; against V where two views leave nothing to tell
/// them apart. docs/math/triangulate.md eq. (11).
fn worst(seen: &[(Vector2<f64>, Matrix2<f64>, Matrix2x3<f64>)], covariance_m2: &Matrix3<f64>) -> usize {
    let statistic = |(residual, v, by_point): &(Vector2<f64>, Matrix2<f64>, Matrix2x3<f64>)| {
        let left =
            if 2 < seen.len() { by_point * covariance_m2 * by_point.transpose() } else { Matrix2::zeros() };
        (v - left).try_inverse().map_or(0.0, |weight| residual.dot(&(weight * residual)))
    };
    let statistics: Vec<f64> = seen.iter().map(statistic).collect();
    (0..statistics.len()).max_by(|a, b| statistics[*a].total_cmp(&statistics[*b])).unwrap_or(0)
}

impl<'a> BearingObservation<'a> {
    fn new(view: &'a PointView<'a>) -> Result<Self, Error> {
        let bearing = view.camera.bearing(&view.pixel)?;
        Ok(BearingObservation {
            view,
            bearing,
            bearing_in_world: view.cam_from_world.rotation.tr_mul(&bearing),
            centre_in_world: view.cam_from_world.origin(),
        })
    }

    /// Pixel and its derivative by the point in the world, px/m.
    fn predict(&self, x_in_world: &Point) -> Option<(Pixel, Matrix2x3<f64>)> {
        let cam_from_world = &self.view.cam_from_world;
        let (pixel, by_point) = self.view.camera.project_with_jacobian(&(cam_from_world * x_in_world))?;
        Some((pixel, by_point * cam_from_world.rotation))
    }

    /// V of docs/math/triangulate.md eq. (1) for a point in the world.
    fn covariance_at(&self, x_in_world: &Point) -> Option<Matrix2<f64>> {
        let x = &self.view.cam_from_world * x_in_world;
        let mut v = matrix_of(&self.view.covariance_px2);
        if let Some(covariance) = &self.view.covariance {
            let (_, by_point) = self.view.camera.project_with_jacobian(&x)?;
            let mut by_motion = Matrix2x6::zeros();
            by_motion.fixed_view_mut::<2, 3>(0, 0).copy_from(&(by_point * -x.cross_matrix()));
            by_motion.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_point);
            v += by_motion * covariance * by_motion.transpose();
        }
        if let Some(covariance) = self.view.intrinsics_covariance {
            let columns = self.view.camera.intrinsics_jacobian(&x)?;
            for (i, left) in columns.iter().enumerate() {
                for (j, right) in columns.iter().enumerate() {
                    v += left * right.transpose() * covariance[i * columns.len() + j];
                }
            }
        }
        Some(v)
    }

    /// Variance of the ray's direction across itself along a unit vector of the world, rad²: that of the pixel, pose and intrinsics
    /// at a far point.
    fn angular_variance(&self, across: &Vector3<f64>) -> f64 {
        let far = self.centre_in_world + self.bearing_in_world;
        let Some((_, by_point)) = self.predict(&far) else { return f64::INFINITY };
        let (e1, e2) = two_view::tangents(&self.bearing_in_world);
        let by_angles = Matrix2::from_columns(&[by_point * e1, by_point * e2]);
        // The translation of an uncertain place counts for nothing far away.
        let v = self.covariance_at_infinity(&far).and_then(|v| {
            let inverse = by_angles.try_inverse()?;
            Some(inverse * v * inverse.transpose())
        });
        let direction = Vector2::new(across.dot(&e1), across.dot(&e2));
        v.map_or(f64::INFINITY, |v| direction.dot(&(v * direction)))
    }

    fn covariance_at_infinity(&self, x_in_world: &Point) -> Option<Matrix2<f64>> {
        let turns_only = self.view.covariance.map(|full| {
            let mut turns = Matrix6::zeros();
            turns.fixed_view_mut::<3, 3>(0, 0).copy_from(&full.fixed_view::<3, 3>(0, 0));
            turns
        });
        let view = PointView { covariance: turns_only, ..*self.view };
        BearingObservation { view: &view, ..*self }.covariance_at(x_in_world)
    }
}

/// The angle between two rays, towards the point positive.
struct Parallax {
    angle_rad: f64,
    sigma_rad: f64,
    /// Distance of the corrected point along either ray; none where the rays have no common point.
    depths_m: Option<[f64; 2]>,
}

impl Parallax {
    /// Of the rays as corrected onto a common plane; of the rays as seen where there is none. docs/math/triangulate.md eq. (9).
    fn of(
        first: &BearingObservation,
        second: &BearingObservation,
        corrected: Option<&two_view::Corrected>,
    ) -> Self {
        let rays =
            corrected.map_or([first.bearing_in_world, second.bearing_in_world], |c| c.bearings_in_world);
        let baseline = second.centre_in_world - first.centre_in_world;
        let turn = rays[0].cross(&rays[1]);
        let normal = baseline.cross(&(rays[0] + rays[1]));
        // Rays that meet in front of the cameras turn towards each other, as the baseline turns towards them.
        let sign = if 0.0 <= turn.dot(&normal) { 1.0 } else { -1.0 };
        let angle_rad = turn.norm().atan2(rays[0].dot(&rays[1])) * sign;
        let plane = if 0.0 < normal.norm() { normal.normalize() } else { two_view::tangents(&rays[0]).0 };
        let variance = |bearing_observation: &BearingObservation, ray: &Vector3<f64>| {
            let across = plane.cross(ray).normalize();
            bearing_observation.angular_variance(&across)
        };
        let sigma_rad = (variance(first, &rays[0]) + variance(second, &rays[1])).sqrt();
        Parallax { angle_rad, sigma_rad, depths_m: corrected.map(|c| c.depths_m) }
    }

    fn check(&self, pair: (usize, usize)) -> Result<(), Error> {
        let needed = LEAST_PARALLAX_SIGMAS;
        let small =
            Error::ParallaxTooSmall { parallax_rad: self.angle_rad, sigma_rad: self.sigma_rad, needed };
        let is_large = needed * self.sigma_rad < self.angle_rad.abs();
        match self.depths_m {
            _ if !is_large => Err(small),
            None => Err(small),
            Some([first, _]) if !(0.0 < first) => Err(Error::BehindView { view: pair.0, depth_m: first }),
            Some([_, second]) if !(0.0 < second) => Err(Error::BehindView { view: pair.1, depth_m: second }),
            Some(_) => Ok(()),
        }
    }
}

/// The two views whose rays differ most in direction.
fn widest_pair(bearing_observations: &[BearingObservation]) -> (usize, usize) {
    let (mut best, mut widest) = ((0, 1), -1.0);
    for j in 1..bearing_observations.len() {
        for i in 0..j {
            let sine = bearing_observations[i]
                .bearing_in_world
                .cross(&bearing_observations[j].bearing_in_world)
                .norm();
            let baseline =
                (bearing_observations[i].centre_in_world - bearing_observations[j].centre_in_world).norm();
            // Without a baseline a wide angle is a contradiction, not parallax.
            let width = if 0.0 < baseline { sine } else { -0.5 };
            if widest < width {
                (best, widest) = ((i, j), width);
            }
        }
    }
    best
}

pub(crate) fn matrix_of(c: &PixelCovariance) -> Matrix2<f64> {
    Matrix2::new(c.uu_px2, c.uv_px2, c.uv_px2, c.vv_px2)
}

/// The covariance of a pixel as sure in u as in v.
pub fn isotropic(sigma_px: f64) -> PixelCovariance {
    PixelCovariance { uu_px2: sigma_px * sigma_px, uv_px2: 0.0, vv_px2: sigma_px * sigma_px }
}

fn check(index: usize, view: &PointView) -> Result<(), Error> {
    let refuse = |what, seen, needed| Err(Error::InvalidView { view: index, what, seen, needed });
    let pose = &view.cam_from_world;
    let sum = pose.rotation.sum() + pose.translation.sum();
    if !sum.is_finite() {
        return refuse("cam_from_world", sum, "it must be finite");
    }
    if !view.pixel.sum().is_finite() {
        return refuse("pixel", view.pixel.sum(), "it must be finite");
    }
    let least = view.covariance_px2.least_variance_px2();
    if !(LEAST_VARIANCE_PX2 < least && least.is_finite()) {
        return refuse("the least variance of the pixel, px²,", least, "it must be positive and finite");
    }
    if let Some(c) = view.covariance {
        let (sum, least) = (c.sum(), c.diagonal().min());
        if !(sum.is_finite() && 0.0 <= least) {
            return refuse("the pose covariance", least, "variances must be finite and not negative");
        }
    }
    let n = view.camera.parameters().len();
    match view.intrinsics_covariance {
        Some(c) if c.len() != n * n => refuse(
            "the number of entries of the intrinsics covariance",
            c.len() as f64,
            "it must be n × n, n the number of parameters",
        ),
        Some(c) if !c.iter().all(|x| x.is_finite()) => {
            refuse("the intrinsics covariance", f64::NAN, "it must be finite")
        }
        _ => Ok(()),
    }
}
