//! Figures of a pose for people: height, tilt and others, with 95 % half widths.

use crate::pose::Solved;
use crate::texts;
use resight::core::advise::ground::Plane;
use resight::core::{Matrix6, Pixel, Pose, Vector6};
use schemars::JsonSchema;
use serde::Serialize;

/// One number of the answer.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Figure {
    /// Which.
    pub name: &'static str,
    /// Its title.
    pub title: &'static str,
    /// Its value.
    pub value: f64,
    /// Half of the 95 % interval.
    pub half_width_95: f64,
    /// Of both: `m` or `°`.
    pub unit: &'static str,
    /// `6.21 ± 0.04 m`.
    pub words: String,
    /// What it is, in a sentence.
    pub help: &'static str,
    /// The page of the book.
    pub link: &'static str,
}

/// Two-sided 95 % point of the normal distribution.
const NORMAL_95: f64 = 1.96;
/// Step of the differences, radians and metres.
const STEP: f64 = 1e-6;

/// Height, tilt, roll, heading, distance and position.
pub fn figures(solved: &Solved) -> Vec<Figure> {
    let up = solved.up;
    let middle = solved
        .camera
        .size
        .map(|s| Pixel::new(0.5 * f64::from(s.width_px) - 0.5, 0.5 * f64::from(s.height_px) - 0.5));
    let axis = |pose: &Pose| pose.rotation.row(2).transpose();
    let up_in_cam = |pose: &Pose| pose.rotation.column(2) * up;
    let ahead = |pose: &Pose| {
        let hit = middle.and_then(|px| Plane::level(0.0).seen_at(&solved.camera, pose, &px));
        hit.map_or(f64::NAN, |x| (x - pose.origin()).norm())
    };
    let degrees = f64::to_degrees;
    [
        one(solved, "height", "m", &|p| up * p.origin().z),
        one(solved, "tilt", "°", &|p| degrees((-up * axis(p).z).clamp(-1.0, 1.0).asin())),
        one(solved, "roll", "°", &|p| degrees((-up_in_cam(p).x).atan2(-up_in_cam(p).y))),
        one(solved, "heading", "°", &|p| degrees(axis(p).y.atan2(axis(p).x))),
        one(solved, "distance", "m", &ahead),
        one(solved, "x", "m", &|p| p.origin().x),
        one(solved, "y", "m", &|p| p.origin().y),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// Returns a number and its standard deviation from the pose's covariance; `None` where it is not finite.
fn one(solved: &Solved, name: &'static str, unit: &'static str, of: &dyn Fn(&Pose) -> f64) -> Option<Figure> {
    let value = of(&solved.cam_from_world);
    let half_width_95 = NORMAL_95 * sigma(&solved.cam_from_world, &solved.covariance, unit, of);
    if !(value.is_finite() && half_width_95.is_finite()) {
        return None;
    }
    let (title, help, link) = texts::figure(name);
    Some(Figure {
        name,
        title,
        value,
        half_width_95,
        unit,
        words: words(value, half_width_95, unit),
        help,
        link,
    })
}

fn sigma(pose: &Pose, covariance: &Matrix6, unit: &str, of: &dyn Fn(&Pose) -> f64) -> f64 {
    let at = |i: usize, by: f64| {
        let mut motion = Vector6::zeros();
        motion[i] = by;
        of(&(Pose::exp(&motion) * *pose))
    };
    let round = |x: f64| if unit == "°" { (x + 180.0).rem_euclid(360.0) - 180.0 } else { x };
    let gradient = Vector6::from_fn(|i, _| round(at(i, STEP) - at(i, -STEP)) / (2.0 * STEP));
    (gradient.transpose() * covariance * gradient)[(0, 0)].max(0.0).sqrt()
}

/// `6.21 ± 0.04 m`: two figures of the uncertainty.
pub fn words(value: f64, half_width: f64, unit: &str) -> String {
    let decimals = match half_width {
        h if 0.0 < h && h.is_finite() => (1.0 - h.log10().floor()).clamp(0.0, 4.0) as usize,
        _ => 3,
    };
    let space = if unit == "°" { "" } else { " " };
    format!("{value:.decimals$} ± {half_width:.decimals$}{space}{unit}")
}
