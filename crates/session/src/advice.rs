//! Where the next point would reduce the uncertainty most.

use crate::pose::Solved;
use crate::texts;
use resight::advise::points::{AimFor, NextPointRequest};
use resight::advise::read::MeasuredPoint;
use resight::advise_points;
use resight::core::Point;
use resight::core::target::KnownPoint;
use schemars::JsonSchema;
use serde::Serialize;

/// A place for the next point.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Advice {
    /// Column.
    pub u_px: f64,
    /// Row.
    pub v_px: f64,
    /// On the plane of the points, metres.
    pub position_m: [f64; 3],
    /// What it would bring, in a sentence.
    pub words: String,
    /// Standard deviation of the position now, over that with the point.
    pub gain: f64,
}

/// Smallest gain that is worth a sentence.
const LEAST_GAIN: f64 = 1.15;

/// Returns the best position; `None` where a further point hardly helps, or where the effect is unknown.
pub fn advice(solved: &Solved, sigma_px: f64) -> Option<Advice> {
    let points: Vec<MeasuredPoint> = solved.points.iter().map(measured).collect();
    let request = NextPointRequest {
        camera: &solved.camera,
        intrinsics_covariance: solved.intrinsics_covariance.as_deref(),
        points: &points,
        sigma_px,
        pose: Some(solved.cam_from_world),
        candidates: None,
        ground_z_m: 0.0,
        region_m: None,
        length_m: None,
        aim: Some(AimFor::Place),
        pictures: false,
    };
    let advised = advise_points(&request).ok()?;
    let best = advised.suggestions.first()?;
    let (now_m, then_m) = (advised.now.figures.sigma_position_m?, best.figures.sigma_position_m?);
    let gain = now_m / then_m;
    let place = Point::from(best.x_in_target_m);
    let pixel = solved.camera.project(&(solved.cam_from_world * place))?;
    (LEAST_GAIN < gain && gain.is_finite()).then(|| Advice {
        u_px: pixel.x,
        v_px: pixel.y,
        position_m: best.x_in_target_m,
        words: texts::advice(now_m, then_m),
        gain,
    })
}

fn measured(point: &resight::locate::NamedPoint) -> MeasuredPoint {
    let seen = &point.seen;
    MeasuredPoint {
        name: point.name.clone(),
        known: KnownPoint { position: seen.x_in_target, sigma_m: seen.sigma_m },
        pixel: Some([seen.pixel.x, seen.pixel.y]),
    }
}
