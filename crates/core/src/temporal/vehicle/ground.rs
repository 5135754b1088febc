//! The ground plane in a pair of frames: docs/math/vehicle.md section 5.
//!
//! ```text
//!   q  inverse depth of a point in baselines, along y = R a   ·   plane: n · x = −h, so that q = m · y with m = −n/h
//!   m ⟂ the translation: m = −(α up + β left)   ·   roll about the direction of travel = atan2(β, α), height = 1/√(α² + β²) baselines
//! ```

use super::{VehicleAxes, rotation_vector};
use crate::multiview::two_view::{BearingPair, TwoView};
use crate::statistics::SplitMix64;
use nalgebra::{Matrix2, Rotation3, Vector2, Vector3};

/// The ground below the camera, from one pair of frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundPlane {
    /// Its normal, unit vector, in the camera frame half-way between both frames.
    pub up_in_cam: Vector3<f64>,
    /// Standard deviation of its rotation about the direction of travel, radians.
    pub roll_sigma_rad: f64,
    /// Height of the camera above it, in units of the distance travelled between the frames.
    pub height_per_baseline: f64,
    /// Standard deviation of that, as a share of it.
    pub relative_sigma: f64,
    /// Points that lie on it.
    pub n_points: usize,
}

/// Points that must lie on the ground.
const LEAST: usize = 12;
/// Standard deviations within which a point lies on a plane.
const GATE: f64 = 3.0;
/// A plane is tested with points whose inverse depth it predicts to this many standard deviations: those below the horizon.
const BELOW: f64 = 6.0;
/// Share of points on the plane, of those and the ones beyond it: nothing is seen through the ground.
const LEAST_SHARE: f64 = 0.8;
/// Samples of two points.
const SAMPLES: usize = 60;
/// The ground's normal lies within 45° of the camera's own up, |β| ≤ α.
const STEEPEST: f64 = 1.0;

/// Inverse depth with its regressors.
struct Row {
    q: f64,
    sigma: f64,
    /// −(up · y, left · y).
    x: Vector2<f64>,
}

impl Row {
    fn off(&self, m: &Vector2<f64>) -> f64 {
        (self.q - self.x.dot(m)) / self.sigma
    }

    fn is_below(&self, m: &Vector2<f64>) -> bool {
        BELOW * self.sigma < self.x.dot(m)
    }
}

/// The plane below the camera that the most points lie on, and that none lies beyond; `forward` is whether the camera moves along its direction
/// of travel (else in reverse). `None` where the pair shows none.
pub fn ground_plane(pairs: &[BearingPair], view: &TwoView, is_forward: bool) -> Option<GroundPlane> {
    let sign = if is_forward { -1.0 } else { 1.0 };
    let axes = VehicleAxes::new(&(view.second_from_first.translation * sign));
    let rows: Vec<Row> = view.used.iter().filter_map(|i| row(pairs.get(*i)?, view, &axes)).collect();
    let (mut chance, mut best) =
        (SplitMix64::scattered(view.used.len() as u64), None::<(usize, Vector2<f64>)>);
    for _ in 0..SAMPLES {
        let Some(m) = through_two(&rows, &mut chance) else { continue };
        let score = on_plane(&rows, &m).count();
        if best.is_none_or(|(most, _)| most < score) && is_ground(&rows, &m) {
            best = Some((score, m));
        }
    }
    let (_, mut m) = best?;
    let mut inverse = Matrix2::identity();
    for _ in 0..3 {
        (m, inverse) = fitted(on_plane(&rows, &m))?;
    }
    let n_points = on_plane(&rows, &m).count();
    if n_points < LEAST || !is_ground(&rows, &m) {
        return None;
    }
    let covariance = inverse * view.noise_factor;
    let (length, angle) = (m.norm(), m.y.atan2(m.x));
    let (across, along) = (Vector2::new(-m.y, m.x) / length, m / length);
    let relative = |v: Vector2<f64>| v.dot(&(covariance * v)).max(0.0).sqrt() / length;
    let up = axes.up * angle.cos() + axes.left * angle.sin();
    let middle_from_second = Rotation3::new(-0.5 * rotation_vector(&view.second_from_first.rotation));
    Some(GroundPlane {
        up_in_cam: middle_from_second * up,
        roll_sigma_rad: relative(across),
        height_per_baseline: 1.0 / length,
        relative_sigma: relative(along),
        n_points,
    })
}

fn row(pair: &BearingPair, view: &TwoView, axes: &VehicleAxes) -> Option<Row> {
    let y = view.second_from_first.rotation * pair.first.into_inner();
    let off = view.second_from_first.translation.cross(&pair.second.into_inner()).norm();
    let [depth, _] = view.depths(pair)?;
    let sigma = pair.sigma_first_rad.hypot(pair.sigma_second_rad) * view.noise_factor.sqrt() / off;
    let row = Row { q: 1.0 / depth, sigma, x: -Vector2::new(axes.up.dot(&y), axes.left.dot(&y)) };
    (row.q.is_finite() && row.sigma.is_finite() && 0.0 < row.sigma).then_some(row)
}

fn through_two(rows: &[Row], chance: &mut SplitMix64) -> Option<Vector2<f64>> {
    if rows.len() < LEAST {
        return None;
    }
    let (a, b) = (&rows[chance.below(rows.len())], &rows[chance.below(rows.len())]);
    let m = Matrix2::from_rows(&[a.x.transpose(), b.x.transpose()]).try_inverse()? * Vector2::new(a.q, b.q);
    (m.sum().is_finite() && 0.0 < m.x && m.y.abs() <= STEEPEST * m.x).then_some(m)
}

fn on_plane<'a>(rows: &'a [Row], m: &'a Vector2<f64>) -> impl Iterator<Item = &'a Row> {
    rows.iter().filter(|row| row.is_below(m) && row.off(m).abs() <= GATE)
}

/// Whether hardly any point lies beyond the plane.
fn is_ground(rows: &[Row], m: &Vector2<f64>) -> bool {
    let beyond = rows.iter().filter(|row| row.is_below(m) && row.off(m) < -GATE).count();
    let on = on_plane(rows, m).count();
    LEAST_SHARE * (on + beyond) as f64 <= on as f64
}

/// Weighted least squares with the inverse of its information.
fn fitted<'a>(rows: impl Iterator<Item = &'a Row>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    let (mut information, mut sum) = (Matrix2::zeros(), Vector2::zeros());
    for row in rows {
        let weight = row.sigma.powi(-2);
        information += row.x * row.x.transpose() * weight;
        sum += row.x * (row.q * weight);
    }
    let inverse = information.try_inverse()?;
    let m = inverse * sum;
    (m.sum().is_finite() && 0.0 < m.x).then_some((m, inverse))
}
