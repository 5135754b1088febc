//! Which way is forward, and where the vehicle drives straight or through a curve: docs/math/vehicle.md section 2.

use super::{FrameMotion, TravelDirection, Undetermined, VehicleAxes};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};

/// Rates of heading are means over this time to both sides, so that a pitching body is no curve, seconds.
const SMOOTHED_S: f64 = 1.0;
/// Below this rate a stretch is straight, rad/s: a radius of 500 m at 15 m/s.
const STRAIGHT_RAD_S: f64 = 0.03;
/// Above this rate it is a curve, rad/s.
const CURVE_RAD_S: f64 = 0.05;
/// A share of pairs against the main direction from which on forward and reverse cannot be distinguished.
const MOST_REVERSE: f64 = 0.3;

/// A motion with what its neighbours tell of it. Directions are those of driving forward.
pub(super) struct Driven<'a> {
    pub motion: &'a FrameMotion,
    pub direction: TravelDirection,
    /// Rate of rotation across the direction of travel, camera frame, smoothed, rad/s.
    pub rate: Vector3<f64>,
    pub is_reverse: bool,
}

impl Driven<'_> {
    pub fn is_straight(&self) -> bool {
        self.rate.norm() <= STRAIGHT_RAD_S
    }
}

/// All motions that have a direction.
pub(super) struct Stretches<'a> {
    pub driven: Vec<Driven<'a>>,
    /// Seconds of motion.
    pub moving_s: f64,
    /// Seconds from one pair to the next.
    pub spacing_s: f64,
    /// Share of the less frequent sign, where no speed states the sign.
    pub ambiguous_sign: Option<f64>,
    /// Main direction of travel, camera frame.
    pub forward: Vector3<f64>,
}

/// A stretch of one curve.
pub(super) struct Curve {
    /// Rotation vector of the camera across the direction of travel, in all, radians.
    pub rotation: Vector3<f64>,
}

impl<'a> Stretches<'a> {
    pub fn new(motions: &'a [FrameMotion]) -> Self {
        let spacing_s = spacing_s(motions);
        let (forward, ambiguous_sign) = forward(motions);
        let driven: Vec<Driven> = motions
            .iter()
            .enumerate()
            .filter_map(|(i, _)| driven(motions, i, &forward, ambiguous_sign))
            .collect();
        let moving_s = driven.len() as f64 * spacing_s;
        Stretches { driven, moving_s, spacing_s, ambiguous_sign, forward }
    }

    pub fn straight(&self) -> impl Iterator<Item = &Driven<'a>> {
        self.driven.iter().filter(|driven| driven.is_straight())
    }

    pub fn straight_s(&self) -> f64 {
        self.straight().count() as f64 * self.spacing_s
    }

    pub fn curve_s(&self) -> f64 {
        self.driven.iter().filter(|driven| CURVE_RAD_S <= driven.rate.norm()).count() as f64 * self.spacing_s
    }

    /// The curves: stretches without a gap whose axes of rotation point to one side.
    pub fn curves(&self) -> Vec<Curve> {
        let mut curves: Vec<(Curve, &Driven)> = Vec::new();
        for driven in self.driven.iter().filter(|driven| CURVE_RAD_S <= driven.rate.norm()) {
            let share = (self.spacing_s / driven.motion.duration_s).min(1.0);
            let rotation = driven.motion.rotation_rad * share;
            let rotation = rotation - self.forward * self.forward.dot(&rotation);
            match curves.last_mut() {
                Some((curve, last))
                    if driven.motion.t_s - last.motion.t_s < 3.0 * self.spacing_s
                        && 0.0 < last.rate.dot(&driven.rate) =>
                {
                    curve.rotation += rotation;
                    *last = driven;
                }
                _ => curves.push((Curve { rotation }, driven)),
            }
        }
        curves.into_iter().map(|(curve, _)| curve).collect()
    }

    /// Why there is no forward direction at all.
    pub fn undetermined(&self, needed_s: f64) -> Option<Undetermined> {
        if self.moving_s < needed_s {
            return Some(Undetermined::Standing { moving_s: self.moving_s, needed_s });
        }
        self.ambiguous_sign.map(|share| Undetermined::ForwardSign { share })
    }
}

/// Median time between neighbours.
fn spacing_s(motions: &[FrameMotion]) -> f64 {
    let mut steps: Vec<f64> = motions.windows(2).map(|pair| pair[1].t_s - pair[0].t_s).collect();
    steps.sort_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// The axis that most directions lie along, with the sign of forward driving; and the share of the less frequent sign where it is not known.
fn forward(motions: &[FrameMotion]) -> (Vector3<f64>, Option<f64>) {
    let directions = || motions.iter().filter_map(|m| Some((m.direction?.in_cam, m.speed_m_s)));
    let moments: Matrix3<f64> = directions().map(|(d, _)| d * d.transpose()).sum();
    let eigen = SymmetricEigen::new(moments);
    let axis: Vector3<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
    let signs: Vec<(f64, Option<f64>)> = directions().map(|(d, v)| (axis.dot(&d).signum(), v)).collect();
    let stated: f64 =
        signs.iter().filter_map(|(sign, speed)| speed.filter(|v| *v != 0.0).map(|v| sign * v.signum())).sum();
    if stated != 0.0 {
        return (axis * stated.signum(), None);
    }
    let sum: f64 = signs.iter().map(|(sign, _)| sign).sum();
    let less = 0.5 * (1.0 - sum.abs() / signs.len().max(1) as f64);
    let is_ambiguous = !signs.is_empty() && MOST_REVERSE < less;
    (axis * if sum < 0.0 { -1.0 } else { 1.0 }, is_ambiguous.then_some(less))
}

fn driven<'a>(
    motions: &'a [FrameMotion],
    i: usize,
    forward: &Vector3<f64>,
    ambiguous_sign: Option<f64>,
) -> Option<Driven<'a>> {
    let motion = &motions[i];
    let mut direction = motion.direction?;
    let is_against = direction.in_cam.dot(forward) < 0.0;
    let is_reverse = match motion.speed_m_s {
        Some(speed) if speed != 0.0 => speed < 0.0,
        _ => is_against && ambiguous_sign.is_none(),
    };
    // A direction against its stated sign belongs to no vehicle on wheels.
    if is_reverse != is_against && ambiguous_sign.is_none() {
        return None;
    }
    if is_against {
        direction.in_cam = -direction.in_cam;
    }
    Some(Driven { motion, direction, rate: rate(motions, i, forward), is_reverse })
}

/// Rotation over time of the neighbours within the smoothing time.
fn rate(motions: &[FrameMotion], i: usize, forward: &Vector3<f64>) -> Vector3<f64> {
    let t_s = motions[i].t_s;
    let is_near = |m: &&FrameMotion| (m.t_s - t_s).abs() <= SMOOTHED_S;
    let before = motions[..i].iter().rev().take_while(is_near);
    let after = motions[i..].iter().take_while(is_near);
    let (mut rotation, mut duration_s) = (Vector3::zeros(), 0.0);
    for motion in before.chain(after) {
        rotation += motion.rotation_rad;
        duration_s += motion.duration_s;
    }
    let rate = rotation / duration_s;
    rate - forward * forward.dot(&rate)
}

/// Coordinates (to the left, up) of a direction about the forward axis of `axes`, as tangents.
pub(super) fn tangent(axes: &VehicleAxes, direction: &Vector3<f64>) -> [f64; 2] {
    let along = axes.forward.dot(direction);
    [axes.left.dot(direction) / along, axes.up.dot(direction) / along]
}
