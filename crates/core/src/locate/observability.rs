//! Which motion do the points show least? The weakest direction of a covariance, in terms a person can act on.
//!
//! ```text
//!   ω, ν  turn about the target's centre c (mean of its points) and shift of c, camera frame: nearly independent of each other
//!   Σ_c = U Σ Uᵀ, U = [ I 0 ; −[c]× I ]  ·  D = diag(1, 1, 1, 1/d, 1/d, 1/d), d = |c|: shifts as parts of the distance
//! ```
//! The weakest motion is the eigenvector of D Σ_c D with the largest eigenvalue, the weakest rotation and shift those of the blocks of Σ_c:
//! docs/math/posterior.md eqs. (11)–(13).

use crate::locate::PoseEstimate;
use crate::locate::refine::centroid;
use crate::solve::configuration::Configuration;
use crate::{Correspondence, Matrix6, Point, Vector6};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// An axis a person can point at.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Axis {
    /// From the camera to the target's centre.
    LineOfSight,
    /// Across the line of sight, along the image's rows.
    Horizontal,
    /// Across the line of sight, along the image's columns.
    Vertical,
    /// The line of the three collinear points.
    LineOfPoints,
    /// None of these.
    Oblique {
        /// Angle from the line of sight, 0 to π/2.
        from_sight_rad: f64,
        /// Direction across the line of sight, from the image's rows towards its columns, −π/2 to π/2.
        in_image_rad: f64,
    },
}

/// The motion that the points show least: as a whole, and its rotation and its shift for themselves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observability {
    /// The weakest motion, one standard deviation long: `[rotation_rad; shift_m]` about and of the target's centre, camera frame.
    pub motion: Vector6,
    /// Whether it is more of a shift than of a rotation, shifts taken as parts of the distance.
    pub is_shift: bool,
    /// Its standard deviation over that of the next weakest direction.
    pub ratio: f64,
    /// The axis about which turns are known worst.
    pub rotation_axis: Axis,
    /// Standard deviation of the rotation about it, whatever else moves.
    pub sigma_rad: f64,
    /// The direction in which the target's centre is known worst.
    pub shift_axis: Axis,
    /// Standard deviation of the shift along it, whatever else moves.
    pub sigma_m: f64,
    /// Correlation of that rotation with that shift, 0 to 1: near 1 the two go together.
    pub correlation: f64,
}

/// Within about 32° an axis passes for one of the named ones: two across the sight leave 26° between them for "oblique".
const NAMED_COSINE: f64 = 0.85;
/// The line of points is a direction that the user laid: named within 18°.
const LINE_COSINE: f64 = 0.95;
/// Correlation from which a rotation and a shift are said to go together: half the variance of each is the other's.
const TOGETHER: f64 = 0.7;

impl Observability {
    /// The weakest motion of an estimate; `seen` are the points it was found from.
    pub fn of(estimate: &PoseEstimate, seen: &[Correspondence]) -> Self {
        let centre_in_cam = estimate.cam_from_target * centroid(seen);
        let line = match estimate.geometry.map(|g| g.configuration) {
            Some(Configuration::LinePlusOne { order: [a, _, c, _] }) => Some(
                estimate.cam_from_target.rotation * (seen[c].x_in_target - seen[a].x_in_target).normalize(),
            ),
            _ => None,
        };
        Self::weakest(&estimate.covariance, &centre_in_cam, line)
    }

    /// The weakest motion of a covariance of small left motions, the target's centre being at `centre_in_cam`.
    fn weakest(covariance: &Matrix6, centre_in_cam: &Point, line: Option<Vector3<f64>>) -> Self {
        let about_centre = about_centre(covariance, centre_in_cam);
        let d = centre_in_cam.norm();
        let scale = Vector6::new(1.0, 1.0, 1.0, 1.0 / d, 1.0 / d, 1.0 / d);
        let eigen = SymmetricEigen::new(
            Matrix6::from_diagonal(&scale) * about_centre * Matrix6::from_diagonal(&scale),
        );
        let first = eigen.eigenvalues.imax();
        let others = (0..6).filter(|i| *i != first).map(|i| eigen.eigenvalues[i]);
        let (largest, next) = (eigen.eigenvalues[first].max(0.0), others.fold(0.0, f64::max));
        let direction = eigen.eigenvectors.column(first).into_owned();
        let motion = direction.component_div(&scale) * largest.sqrt();
        let (turn, shift) = (motion.fixed_rows::<3>(0).norm(), motion.fixed_rows::<3>(3).norm());
        let block =
            |i: usize, j: usize| -> Matrix3<f64> { about_centre.fixed_view::<3, 3>(i, j).into_owned() };
        let ((w, sigma_rad), (u, sigma_m)) = (longest(block(0, 0)), longest(block(3, 3)));
        let product = sigma_rad * sigma_m;
        let axes = Axes::new(centre_in_cam, line);
        Observability {
            motion,
            rotation_axis: axes.name(&w, true),
            sigma_rad,
            shift_axis: axes.name(&u, false),
            sigma_m,
            is_shift: turn < shift / d,
            correlation: if 0.0 < product { w.dot(&(block(0, 3) * u)).abs() / product } else { 0.0 },
            ratio: if 0.0 < next { (largest / next).sqrt() } else { f64::INFINITY },
        }
    }

    /// Whether the rotation and the shift are one motion: about half the variance of each comes with the other.
    pub fn correlated(&self) -> bool {
        TOGETHER <= self.correlation
    }
}

/// The covariance of `[turn about the centre; shift of the centre]`: by refine.md eq. (7), ν = ν_left − c × ω.
fn about_centre(covariance: &Matrix6, centre_in_cam: &Point) -> Matrix6 {
    let mut u = Matrix6::identity();
    u.fixed_view_mut::<3, 3>(3, 0).copy_from(&-centre_in_cam.cross_matrix());
    u * covariance * u.transpose()
}

/// The weakest axis of a block and the standard deviation along it.
fn longest(block: Matrix3<f64>) -> (Vector3<f64>, f64) {
    let eigen = SymmetricEigen::new(block);
    let first = eigen.eigenvalues.imax();
    (eigen.eigenvectors.column(first).into_owned(), eigen.eigenvalues[first].max(0.0).sqrt())
}

fn unit(v: &Vector3<f64>) -> Vector3<f64> {
    v.try_normalize(0.0).unwrap_or(Vector3::z())
}

/// The axes that have names.
struct Axes {
    sight: Vector3<f64>,
    horizontal: Vector3<f64>,
    line: Option<Vector3<f64>>,
}

impl Axes {
    fn new(centre_in_cam: &Point, line: Option<Vector3<f64>>) -> Self {
        let sight = unit(centre_in_cam);
        let across = |axis: Vector3<f64>| (axis - sight * sight.dot(&axis)).try_normalize(1e-6);
        // A target seen along the camera's own x axis is only in the field of a fisheye; its rows then run along z.
        let horizontal = across(Vector3::x()).or_else(|| across(-Vector3::z())).unwrap_or(Vector3::x());
        Axes { sight, horizontal, line }
    }

    fn name(&self, axis: &Vector3<f64>, is_turn: bool) -> Axis {
        let near = |named: &Vector3<f64>, cosine: f64| cosine < named.dot(axis).abs();
        if is_turn && self.line.is_some_and(|line| near(&line, LINE_COSINE)) {
            return Axis::LineOfPoints;
        }
        let vertical = self.sight.cross(&self.horizontal);
        for (named, name) in
            [(self.sight, Axis::LineOfSight), (self.horizontal, Axis::Horizontal), (vertical, Axis::Vertical)]
        {
            if near(&named, NAMED_COSINE) {
                return name;
            }
        }
        let (h, v) = (self.horizontal.dot(axis), vertical.dot(axis));
        let from_sight_rad = h.hypot(v).atan2(self.sight.dot(axis).abs());
        let in_image_rad = if h < 0.0 { (-v).atan2(-h) } else { v.atan2(h) };
        Axis::Oblique { from_sight_rad, in_image_rad }
    }
}
