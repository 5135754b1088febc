//! Many frames of one camera: a test of the given intrinsics, and an estimate of them.
//!
//! `check_intrinsics` tests without changing anything; `refine_intrinsics` estimates chosen intrinsics together with every pose.
//! Derivation: docs/math/frames.md.

mod equations;
mod check;
mod refined;

pub use check::{Blame, FALSE_ALARM_RATE, IntrinsicsCheck, ParameterOffset, check_intrinsics};
pub(in crate::multiview) use equations::{Direction, PointModel};
pub use refined::{Focal, Free, RefinedFrame, RefinedIntrinsics, refine_intrinsics};

use crate::camera::Parameters;
use crate::locate::choose::Minimum;
use crate::locate::{Config, locate};
use crate::{Camera, Correspondence, Error};
use nalgebra::{DMatrix, DVector};

/// A parameter whose standard deviation exceeds this part of its scale is undetermined: at a tenth of its focal length a camera's
/// linearised covariance means nothing. Frontal views of a plane, where only noise separates focal length and distance, come out at 0.2
/// and more.
pub const MAX_RELATIVE_SIGMA: f64 = 0.1;

/// A frame that took no part, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct SkippedFrame {
    /// Index of the frame.
    pub frame: usize,
    /// The reason.
    pub reason: Error,
}

/// The kind of an intrinsic parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// fx, fy, or f.
    FocalLength,
    /// Principal point.
    PrincipalPoint,
    /// Everything else of the lens model.
    Distortion,
}

impl Group {
    /// Every group.
    pub const ALL: [Group; 3] = [Group::FocalLength, Group::PrincipalPoint, Group::Distortion];

    /// Returns the group of a parameter, by its name in `Camera::parameters`.
    pub fn of(parameter: &str) -> Group {
        match parameter {
            "fx_px" | "fy_px" | "f" => Group::FocalLength,
            "cx_px" | "cy_px" | "xp" | "yp" => Group::PrincipalPoint,
            _ => Group::Distortion,
        }
    }

    /// Returns the name of the group in words.
    pub fn name(self) -> &'static str {
        match self {
            Group::FocalLength => "focal length",
            Group::PrincipalPoint => "principal point",
            Group::Distortion => "distortion",
        }
    }
}

/// A frame and its pose under the given camera.
struct View {
    frame: usize,
    seen: Vec<Correspondence>,
    minimum: Minimum,
}

/// Locates every frame, or returns the reason why it has no pose. Bearings are derived from the pixels again: those of the input may belong to
/// another camera.
fn located<F: AsRef<[Correspondence]>>(frames: &[F], camera: &Camera) -> (Vec<View>, Vec<SkippedFrame>) {
    let (mut views, mut skipped) = (Vec::new(), Vec::new());
    for (frame, seen) in frames.iter().enumerate() {
        match view(frame, seen.as_ref(), camera) {
            Ok(view) => views.push(view),
            Err(reason) => skipped.push(SkippedFrame { frame, reason }),
        }
    }
    (views, skipped)
}

fn view(frame: usize, seen: &[Correspondence], camera: &Camera) -> Result<View, Error> {
    let rebased = |c: &Correspondence| Ok(Correspondence { bearing: camera.bearing(&c.pixel)?, ..*c });
    let seen: Vec<Correspondence> = seen.iter().map(rebased).collect::<Result<_, Error>>()?;
    let found = locate(&seen, camera, &Config::default())?;
    let (cam_from_target, covariance) = (found.cam_from_target, found.covariance);
    let (chi2, rms_px, log_determinant) = (found.chi2, found.rms_px, found.log_determinant);
    let minimum = Minimum { cam_from_target, covariance, chi2, rms_px, log_determinant };
    Ok(View { frame, seen, minimum })
}

/// Returns the redundancy: two equations for each point, six unknowns for each view.
fn redundancy(views: &[View]) -> usize {
    views.iter().map(|view| (2 * view.seen.len()).saturating_sub(6)).sum()
}

/// Returns the scale with which each parameter's standard deviation is compared, eq. (9): for a focal length its own value, for any other
/// parameter the change that moves some observed point by one focal length.
fn scales(views: &[View], camera: &Camera) -> Vec<f64> {
    let parameters = camera.parameters();
    let mut reach = vec![0.0f64; parameters.len()];
    for view in views {
        for c in &view.seen {
            let x = view.minimum.cam_from_target * c.x_in_target;
            let columns = camera.intrinsics_jacobian(&x).unwrap_or_default();
            for (reach, column) in reach.iter_mut().zip(&columns) {
                *reach = reach.max(column.norm());
            }
        }
    }
    let focal = focal_length(&parameters);
    let scale = |((name, value), reach): (&(&str, f64), &f64)| match Group::of(name) {
        Group::FocalLength => *value,
        _ => focal / reach,
    };
    parameters.iter().zip(&reach).map(scale).collect()
}

pub(crate) fn focal_length(parameters: &Parameters) -> f64 {
    let focal = parameters.iter().filter(|(name, _)| Group::of(name) == Group::FocalLength);
    focal.map(|(_, value)| *value).fold(0.0, f64::max)
}

/// Returns the least determined parameter: its index and its relative standard deviation, which is infinite where the matrix is singular.
pub(crate) fn weakest(information: &DMatrix<f64>, scales: &[f64]) -> Option<(usize, f64)> {
    let n = scales.len();
    let Some(covariance) = information.clone().cholesky().map(|c| c.inverse()) else {
        return Some((missing(information, scales), f64::INFINITY));
    };
    let relative = (0..n).map(|i| (i, covariance[(i, i)].sqrt() / scales[i]));
    relative.fold(None, |worst: Option<(usize, f64)>, next| {
        worst.filter(|worst| next.1 <= worst.1).or(Some(next))
    })
}

/// Returns the parameter with the largest share in the null direction of a singular matrix.
fn missing(information: &DMatrix<f64>, scales: &[f64]) -> usize {
    let n = scales.len();
    let scaled = DMatrix::from_fn(n, n, |i, j| information[(i, j)] * scales[i] * scales[j]);
    let eigen = scaled.iter().all(|x| x.is_finite()).then(|| scaled.symmetric_eigen());
    eigen.map_or(0, |eigen| eigen.eigenvectors.column(eigen.eigenvalues.imin()).iamax())
}

/// Returns the rows and columns `keep` of a symmetric matrix.
fn restricted(matrix: &DMatrix<f64>, keep: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(keep.len(), keep.len(), |i, j| matrix[(keep[i], keep[j])])
}

/// Returns the entries `keep` of a vector.
fn picked(vector: &DVector<f64>, keep: &[usize]) -> DVector<f64> {
    DVector::from_fn(keep.len(), |i, _| vector[keep[i]])
}
