//! Where is the camera when its rotation is known: from a gyroscope, a pan–tilt head, vanishing points.
//!
//! Everything known about the place is then linear in the translation t: points and lines on their rays, a distance, a height, the place
//! itself with a covariance (the last one: then this is a Kalman update). Own derivation, docs/math/known_rotation.md.
//!
//!   x = R X + t  a point in the camera frame, on its bearing b at depth λ   ·   Π = ∂pixel/∂x at λ b, so that Π b = 0
//!   N t = r, the normal equations   ·   K: N δt = −K ω for a left rotation ω of R

use crate::line::LineCorrespondence;
use crate::locate::refine::{information, whitened_residual};
use crate::pose::{ROTATION_TOLERANCE, off_rotation};
use crate::{Camera, Correspondence, Error, Matrix6, Point, Pose};
use nalgebra::{Matrix3, Unit, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// A rotation known beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KnownRotation {
    /// Rotation matrix, target to camera.
    pub cam_from_target: Matrix3<f64>,
    /// Covariance of its small left rotation, rad² (3×3); zero where it is exact.
    pub covariance: Matrix3<f64>,
}

/// Something known about the camera's position besides what it sees; errors independent of each other and of the rotation's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Known {
    /// The distance of the camera centre from one of the points. One number.
    Distance {
        /// Which point, counted from 0.
        point: usize,
        /// Metres.
        distance_m: f64,
        /// Its standard deviation.
        sigma_m: f64,
    },
    /// The signed distance of the camera centre from a plane of the target frame. One number.
    Height {
        /// The plane's normal n: points with n · x = `offset_m`.
        normal_in_target: Unit<Vector3<f64>>,
        /// The plane's place along its normal.
        offset_m: f64,
        /// Signed distance, positive on the side the normal points to.
        height_m: f64,
        /// Its standard deviation.
        sigma_m: f64,
    },
    /// The camera's position as far as it is known already: three numbers.
    Place {
        /// The camera centre, target frame, metres.
        origin_in_target: Point,
        /// Its covariance along the target's axes, m² (3×3, positive definite).
        covariance_m2: Matrix3<f64>,
    },
}

/// A pose whose rotation was known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionEstimate {
    /// The pose.
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, camera frame: the rotation's own, carried into the
    /// translation, and what the measurements leave open.
    pub covariance: Matrix6,
    /// Sum of squared residuals over their variances; takes the rotation as exact, so it is larger where the rotation is not.
    pub chi2: f64,
    /// Numbers measured less three.
    pub degrees_of_freedom: usize,
}

/// Inverse condition number of the normal equations, or less, at which a direction is open to rounding.
const MIN_CONDITION: f64 = 1e-13;
/// The distance must exceed its own standard deviation by this factor, or the linearisation means nothing.
const MIN_DISTANCE_SIGMA: f64 = 3.0;
/// Passes; each takes the depths of the one before, which only weigh.
const PASSES: usize = 4;

impl Known {
    /// The place of an earlier pose, with the covariance of its small left motion, both as `locate` returns them. A camera that has
    /// moved since wants `covariance_m2` widened by what it may have moved.
    pub fn position_of(cam_from_target: &Pose, covariance: &Matrix6) -> Known {
        let r = &cam_from_target.rotation;
        let covariance_m2 = r.tr_mul(&covariance.fixed_view::<3, 3>(3, 3)) * r;
        Known::Place { origin_in_target: cam_from_target.origin(), covariance_m2 }
    }

    fn rows(&self) -> usize {
        match self {
            Known::Distance { .. } | Known::Height { .. } => 1,
            Known::Place { .. } => 3,
        }
    }

    fn check(&self, prior: usize, n_points: usize) -> Result<(), Error> {
        let refuse = |parameter, seen, needed| Err(Error::InvalidPrior { prior, parameter, seen, needed });
        let (value, sigma) = match self {
            Known::Distance { point, .. } if n_points <= *point => {
                return refuse("point", *point as f64, "it must be the index of a point given");
            }
            Known::Distance { distance_m, sigma_m, .. } => (*distance_m, *sigma_m),
            Known::Height { normal_in_target, offset_m, height_m, sigma_m } => {
                (normal_in_target.sum() + offset_m + height_m, *sigma_m)
            }
            Known::Place { origin_in_target, covariance_m2 } => {
                let least = covariance_m2.cholesky().map_or(-1.0, |c| c.l().diagonal().min());
                (origin_in_target.sum() + covariance_m2.sum(), least)
            }
        };
        if !value.is_finite() {
            return refuse("value", value, "it must be finite");
        }
        let usable = 0.0 < sigma && (sigma * sigma).recip().is_normal();
        if usable {
            Ok(())
        } else {
            refuse("sigma_m", sigma, "a standard deviation must be positive and finite")
        }
    }
}

/// The pose with the rotation given, by weighted linear least squares: maximum likelihood to first order in the noise.
///
/// Two points, or two lines of different planes and a third, or one point and a distance, a height or an earlier place are enough. Lines
/// without `point_in_target` say nothing about the place and are passed over.
///
/// # Errors
/// `TooFewPoints` when nothing is seen; `NotFinite`, `NotPositive`, `InvalidPrior` for numbers that cannot be right; `DegenerateView`
/// when the place is open in some direction, to rounding or compared with the distance; `NoSolution` when a point would lie behind the
/// camera.
pub fn position_with_rotation(
    rotation: &KnownRotation,
    seen: &[Correspondence],
    lines: &[LineCorrespondence],
    camera: &Camera,
    known: &[Known],
) -> Result<PositionEstimate, Error> {
    let inputs = Inputs { r: rotation.cam_from_target, seen, lines, camera, known };
    inputs.check(rotation)?;
    let mut t = inputs.start();
    let mut rows = inputs.rows(t.as_ref())?;
    for _ in 0..PASSES {
        let solved = rows.inverse()? * rows.r;
        rows = inputs.rows(Some(&solved))?;
        t = Some(solved);
    }
    let translation = t.ok_or(Error::NoSolution { n_points: seen.len() })?;
    let cam_from_target = Pose { rotation: inputs.r, translation };
    let covariance = rows.covariance(rotation, inputs.nearest(&translation))?;
    let chi2 = inputs.chi2(&cam_from_target)?;
    let degrees_of_freedom = inputs.numbers() - 3;
    if !covariance.sum().is_finite() {
        return Err(Error::NoSolution { n_points: seen.len() });
    }
    Ok(PositionEstimate { cam_from_target, covariance, chi2, degrees_of_freedom })
}

/// What is seen and known.
struct Inputs<'a> {
    r: Matrix3<f64>,
    seen: &'a [Correspondence],
    lines: &'a [LineCorrespondence],
    camera: &'a Camera,
    known: &'a [Known],
}

impl Inputs<'_> {
    fn check(&self, rotation: &KnownRotation) -> Result<(), Error> {
        let off = off_rotation(&self.r);
        if !(off <= ROTATION_TOLERANCE && rotation.covariance.sum().is_finite()) {
            let needed = "R Rᵀ must be the identity, det R positive and its covariance finite";
            return Err(Error::InvalidPrior { prior: 0, parameter: "cam_from_target", seen: off, needed });
        }
        for (index, c) in self.seen.iter().enumerate() {
            if !(c.x_in_target.sum() + c.bearing.sum() + c.pixel.sum() + c.sigma_m).is_finite() {
                return Err(Error::NotFinite { what: "the position", index });
            }
            if !(0.0 < c.sigma_px && c.sigma_px < f64::INFINITY && 0.0 <= c.sigma_m) {
                return Err(Error::NotPositive { index, seen: c.sigma_px.min(c.sigma_m) });
            }
        }
        self.known.iter().enumerate().try_for_each(|(i, known)| known.check(i, self.seen.len()))?;
        match (self.numbers(), self.seen.len() + self.placed_lines().count()) {
            (3.., 1..) => Ok(()),
            (_, seen) => Err(Error::TooFewPoints { seen, needed: 2 }),
        }
    }

    /// Lines whose place is known: direction, point and image.
    fn placed_lines(&self) -> impl Iterator<Item = (Vector3<f64>, Point, &LineCorrespondence)> {
        let r = self.r;
        self.lines
            .iter()
            .filter_map(move |l| Some((r * l.direction_in_target.into_inner(), r * l.point_in_target?, l)))
    }

    /// How many numbers are measured.
    fn numbers(&self) -> usize {
        let known: usize = self.known.iter().map(Known::rows).sum();
        2 * (self.seen.len() + self.placed_lines().count()) + known
    }

    /// A place known already gives the depths of the first pass.
    fn start(&self) -> Option<Vector3<f64>> {
        self.known.iter().find_map(|known| match known {
            Known::Place { origin_in_target, .. } => Some(-(self.r * origin_in_target)),
            _ => None,
        })
    }

    /// Distance of the nearest point or line, for the scale of things.
    fn nearest(&self, t: &Vector3<f64>) -> f64 {
        let points = self.seen.iter().map(|c| (self.r * c.x_in_target + t).norm());
        let lines = self.placed_lines().map(|(d, p, _)| d.cross(&(p + t)).norm());
        points.chain(lines).fold(f64::INFINITY, f64::min)
    }

    /// The normal equations, weighed for the translation `t`; for none with all depths alike.
    fn rows(&self, t: Option<&Vector3<f64>>) -> Result<Rows, Error> {
        let mut rows = Rows::default();
        for c in self.seen {
            self.add_point(&mut rows, c, t).ok_or(Error::NoSolution { n_points: self.seen.len() })?;
        }
        for (d, p, line) in self.placed_lines() {
            // The plane's normal as the pose predicts it, or as the image shows it at one metre.
            let m = t.map_or(line.seen.normal().into_inner(), |t| d.cross(&(p + t)));
            for (i, b) in line.seen.bearings.iter().enumerate() {
                let w = 1.0 / line.seen.product_sigma(i, &m);
                let j = b.cross(&d) * w;
                rows.add(&j, -j.dot(&p), &(m.cross(b) * w)); // eq. (5)
            }
        }
        self.known.iter().for_each(|known| self.add_known(&mut rows, known));
        Ok(rows)
    }

    /// Eq. (2): the part of x across the bearing is zero.
    fn add_point(&self, rows: &mut Rows, c: &Correspondence, t: Option<&Vector3<f64>>) -> Option<()> {
        let x = self.r * c.x_in_target;
        let depth = t.map_or(1.0, |t| c.bearing.dot(&(x + t)));
        let on_ray = c.bearing.into_inner() * depth.abs();
        let (_, derivative) = self.camera.project_with_jacobian(&on_ray)?;
        let m = derivative.transpose() * information(c, &derivative) * derivative;
        rows.n += m;
        rows.r -= m * x;
        rows.k -= m * (x + t.copied().unwrap_or_default()).cross_matrix();
        Some(())
    }

    /// Eqs. (3)–(4): a rotation about the camera changes neither of them.
    fn add_known(&self, rows: &mut Rows, known: &Known) {
        match known {
            Known::Distance { point, distance_m, sigma_m } => {
                let c = &self.seen[*point];
                let j = c.bearing.into_inner() / *sigma_m;
                rows.add(&j, distance_m / sigma_m - j.dot(&(self.r * c.x_in_target)), &Vector3::zeros());
            }
            Known::Height { normal_in_target, offset_m, height_m, sigma_m } => {
                let j = -(self.r * normal_in_target.into_inner()) / *sigma_m;
                rows.add(&j, (offset_m + height_m) / sigma_m, &Vector3::zeros());
            }
            Known::Place { origin_in_target, covariance_m2 } => {
                let in_cam = self.r * covariance_m2 * self.r.transpose();
                if let Some(information) = in_cam.try_inverse() {
                    rows.n += information;
                    rows.r -= information * (self.r * origin_in_target);
                }
            }
        }
    }

    fn chi2(&self, cam_from_target: &Pose) -> Result<f64, Error> {
        let nowhere = Error::NoSolution { n_points: self.seen.len() };
        let mut chi2 = 0.0;
        for c in self.seen {
            let (x, _, squared) =
                whitened_residual(cam_from_target, c, self.camera).ok_or(nowhere.clone())?;
            if !(0.0 < x.dot(&c.bearing)) {
                return Err(nowhere);
            }
            chi2 += squared;
        }
        for (d, p, line) in self.placed_lines() {
            let m = d.cross(&(p + cam_from_target.translation));
            chi2 += line.seen.residuals(&m).iter().map(|r| r * r).sum::<f64>();
        }
        chi2 += self.known.iter().map(|known| self.known_chi2(cam_from_target, known)).sum::<f64>();
        if chi2.is_finite() { Ok(chi2) } else { Err(nowhere) }
    }

    fn known_chi2(&self, cam_from_target: &Pose, known: &Known) -> f64 {
        let origin = cam_from_target.origin();
        match known {
            Known::Distance { point, distance_m, sigma_m } => {
                ((distance_m - (origin - self.seen[*point].x_in_target).norm()) / sigma_m).powi(2)
            }
            Known::Height { normal_in_target, offset_m, height_m, sigma_m } => {
                ((offset_m + height_m - normal_in_target.dot(&origin)) / sigma_m).powi(2)
            }
            Known::Place { origin_in_target, covariance_m2 } => {
                let off = origin_in_target - origin;
                covariance_m2.try_inverse().map_or(0.0, |information| off.dot(&(information * off)))
            }
        }
    }
}

/// The normal equations N t = r, and K: what a left rotation of the rotation does, N δt = −K ω.
#[derive(Default)]
struct Rows {
    n: Matrix3<f64>,
    r: Vector3<f64>,
    k: Matrix3<f64>,
}

impl Rows {
    /// One number: j · t = `value`, which a left rotation ω moves by `by_rotation` · ω.
    fn add(&mut self, j: &Vector3<f64>, value: f64, by_rotation: &Vector3<f64>) {
        self.n += j * j.transpose();
        self.r += j * value;
        self.k += j * by_rotation.transpose();
    }

    fn inverse(&self) -> Result<Matrix3<f64>, Error> {
        let inverse = self.n.cholesky().map(|c| c.inverse());
        let metric = inverse.map_or(0.0, |i| 1.0 / (self.n.trace() * i.trace()));
        match inverse {
            Some(inverse) if MIN_CONDITION < metric => Ok(inverse),
            _ => {
                let reason = "what is seen leaves the place open in one direction; add a point, a distance or a height";
                Err(Error::DegenerateView { reason, metric, needed: MIN_CONDITION })
            }
        }
    }

    /// Eq. (7).
    fn covariance(&self, rotation: &KnownRotation, distance: f64) -> Result<Matrix6, Error> {
        let inverse = self.inverse()?;
        let metric = distance / inverse.trace().sqrt();
        if !(MIN_DISTANCE_SIGMA < metric) {
            let reason = "the place is known worse than a third of the distance; use points farther apart";
            return Err(Error::DegenerateView { reason, metric, needed: MIN_DISTANCE_SIGMA });
        }
        let gain = -(inverse * self.k);
        let (s, cross) = (&rotation.covariance, gain * rotation.covariance);
        let mut covariance = Matrix6::zeros();
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(s);
        covariance.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross);
        covariance.fixed_view_mut::<3, 3>(0, 3).tr_copy_from(&cross);
        covariance.fixed_view_mut::<3, 3>(3, 3).copy_from(&(inverse + cross * gain.transpose()));
        Ok(crate::pose::symmetric(&covariance))
    }
}
