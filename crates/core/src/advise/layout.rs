//! The faults of a choice of points, in numbers: docs/math/advise.md eqs. (11)–(13).

use super::expect::{Expectation, NEEDED_SEPARATION_SIGMA, View, correspondences_in_view};
use crate::Correspondence;
use crate::solve::configuration::{Configuration, describe_geometry};
use crate::solve::line_plus_one::Weakness;
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// A fault of a layout as seen from a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum LayoutWarning {
    /// The points are nearly on one line: the rotation about it is much less certain than the others.
    NearCollinear {
        /// Extent across the line over extent along it.
        width_ratio: f64,
        /// The ratio needed.
        needed: f64,
    },
    /// The points are close together compared with their distance: the direction of a flat target's tilt is hardly visible.
    FarClustered {
        /// Greatest angle between two of them.
        span_rad: f64,
        /// The angle at which a tilt of 45° would be visible.
        needed_rad: f64,
    },
    /// The points are in a plane that faces the camera, so that its tilt is visible to second order only.
    Frontal {
        /// Angle between the plane's normal and the line of sight.
        tilt_rad: f64,
        /// The tilt from which the two solutions can be distinguished.
        needed_rad: f64,
    },
    /// All points have about the same distance from the camera.
    EqualRange {
        /// Greatest range minus least, over their mean.
        spread: f64,
        /// The spread needed.
        needed: f64,
    },
    /// A line and one point off it, from a pose in which they do not determine the rotation about the line.
    Weak(Weakness),
}

/// Below this ratio the rotation about the line is five times less certain than the others.
pub(crate) const NEEDED_WIDTH: f64 = 0.2;
/// Three points span a plane; more are treated as flat up to this ratio of thickness to width.
const FLAT: f64 = 0.05;

/// Returns the faults of a view, the most severe first. Some are reported only where they matter.
pub fn layout_warnings(view: &View, expectation: &Expectation) -> Vec<LayoutWarning> {
    let Some(seen) = correspondences_in_view(view) else { return Vec::new() };
    let mut found: Vec<LayoutWarning> = expectation.weakness.map(LayoutWarning::Weak).into_iter().collect();
    found.extend(near_collinear(&seen));
    if !expectation.first_order_limits().is_empty() {
        found.extend(Spread::of(view, &seen).into_iter().flat_map(|s| s.layout_warnings()));
    }
    found
}

/// Checks whether points are nearly on one line.
pub(crate) fn near_collinear(seen: &[Correspondence]) -> Option<LayoutWarning> {
    let geometry = describe_geometry(seen).ok()?;
    // Three of four points on a line and one well off it are a layout of their own, whose width is that of the whole.
    let width_ratio = match geometry.configuration {
        Configuration::LinePlusOne { .. } => geometry.width.ratio,
        _ => geometry.width.ratio.min(spread_ratio(seen)),
    };
    (width_ratio < NEEDED_WIDTH).then_some(LayoutWarning::NearCollinear { width_ratio, needed: NEEDED_WIDTH })
}

/// Returns the second principal extent of the points divided by the first.
fn spread_ratio(seen: &[Correspondence]) -> f64 {
    let mut values: Vec<f64> = principal(seen).eigenvalues.iter().copied().collect();
    values.sort_by(f64::total_cmp);
    (values[1].max(0.0) / values[2]).sqrt()
}

fn principal(seen: &[Correspondence]) -> SymmetricEigen<f64, nalgebra::U3> {
    let centre = crate::locate::refine::centroid(seen);
    let scatter: Matrix3<f64> = seen
        .iter()
        .map(|c| c.x_in_target - centre)
        .map(|y| y * y.transpose())
        .fold(Matrix3::zeros(), |sum, square| sum + square);
    SymmetricEigen::new(scatter)
}

/// The extents of a set of points as seen by the camera.
struct Spread {
    span_rad: f64,
    sigma_rad: f64,
    range_spread: f64,
    /// Angle between the plane's normal and the line of sight, if the points are flat.
    tilt_rad: Option<f64>,
}

impl Spread {
    fn of(view: &View, seen: &[Correspondence]) -> Option<Self> {
        let pairs = || {
            seen.iter().enumerate().flat_map(|(i, a)| seen[..i].iter().map(move |b| (a.bearing, b.bearing)))
        };
        let span_rad = pairs().map(|(a, b)| a.angle(&b)).fold(0.0, f64::max);
        let ranges = || seen.iter().map(|c| (view.cam_from_target * c.x_in_target).norm());
        let (least, most) = (ranges().fold(f64::INFINITY, f64::min), ranges().fold(0.0, f64::max));
        let first = seen.first()?;
        let beside = first.pixel + nalgebra::Vector2::new(view.sigma_px, 0.0);
        let sigma_rad = view.camera.bearing(&beside).ok()?.cross(&first.bearing).norm();
        let range_spread = 2.0 * (most - least) / (most + least);
        Some(Spread { span_rad, sigma_rad, range_spread, tilt_rad: tilt_rad(view, seen) })
    }

    fn layout_warnings(&self) -> Vec<LayoutWarning> {
        let relief = 2.0 * NEEDED_SEPARATION_SIGMA * self.sigma_rad / self.span_rad;
        let far = (4.0 * NEEDED_SEPARATION_SIGMA * self.sigma_rad).sqrt();
        let mut found = Vec::new();
        if self.tilt_rad.is_some() && self.span_rad < far {
            found.push(LayoutWarning::FarClustered { span_rad: self.span_rad, needed_rad: far });
        }
        let needed_rad = (relief / self.span_rad).atan();
        match self.tilt_rad {
            Some(tilt_rad) if tilt_rad < needed_rad => {
                found.push(LayoutWarning::Frontal { tilt_rad, needed_rad })
            }
            _ => {}
        }
        if self.range_spread < relief {
            found.push(LayoutWarning::EqualRange { spread: self.range_spread, needed: relief });
        }
        found
    }
}

/// Returns the angle between a flat target's normal and the line of sight to its centre, 0 to π/2; `None` where the points are not flat.
fn tilt_rad(view: &View, seen: &[Correspondence]) -> Option<f64> {
    let axes = principal(seen);
    let thin = axes.eigenvalues.imin();
    let mut values: Vec<f64> = axes.eigenvalues.iter().copied().collect();
    values.sort_by(f64::total_cmp);
    let is_flat = values[0].max(0.0).sqrt() <= FLAT * values[1].max(0.0).sqrt();
    let normal: Vector3<f64> = view.cam_from_target.rotation * axes.eigenvectors.column(thin);
    let sight = (view.cam_from_target * crate::locate::refine::centroid(seen)).try_normalize(0.0)?;
    is_flat.then(|| normal.dot(&sight).abs().min(1.0).acos())
}
