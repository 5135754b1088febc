//! Touches prepared for fitting: whitened, with the cost of a squared distance.
//!
//!   Σ  covariance of [x, y, β] and what linearising leaves out, eq. (2)   ·   W = L⁻¹, Σ = L Lᵀ   ·   D  squared distance
//!   c  what an outlier costs                                    docs/math/whisker_identify.md eq. (2), (8)–(10)

use super::{Config, Touch, Use};
use crate::estimate::{Mode, Status};
use nalgebra::{Matrix2, Matrix3, Rotation3, Vector2, Vector3};

/// One touch, ready.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    /// Its number in the caller's list.
    pub index: usize,
    /// Its sweep.
    pub sweep: u32,
    /// The point, metres.
    pub x: Vector2<f64>,
    /// β, radians.
    pub beta: f64,
    /// W; its last row is zero for a tip contact, whose direction says nothing of the object.
    pub w: Matrix3<f64>,
    /// Whether it is a tip contact.
    pub tip: bool,
    /// 1/variance of n·x, 1/m².
    pub line_weight: f64,
}

/// A place uncertain by σ along the whisker leaves the true tangent by σ²/ℓ and turns from it by σ/ℓ′, second-order effects of a load
/// that is weak against its noise; measured on simulated contacts (steel, 1 mm, 0.25 m, 1/320 N), metres.
const OFF_LENGTH_M: f64 = 5.0;
/// ℓ′, metres.
const TURN_LENGTH_M: f64 = 20.0;
/// Errors that no covariance names (stage, clamp, linearity): places, metres.
const FLOOR_M: f64 = 1e-5;
/// The same of directions, radians.
const FLOOR_RAD: f64 = 2e-4;
/// c: a distance that two Gaussian directions exceed 3 times in 10⁴.
pub(super) const OUTLIER_COST: f64 = 16.0;

impl Row {
    /// n.
    pub fn normal(&self) -> Vector2<f64> {
        Vector2::new(self.beta.cos(), self.beta.sin())
    }

    /// The row, or why the touch is none.
    pub fn new(index: usize, touches: &[Touch], config: &Config) -> Result<Row, Use> {
        let touch = &touches[index];
        if !is_sound(touch) {
            return Err(Use::NotOk);
        }
        let along = along_variance(&touch.covariance);
        if !(along <= config.along_sigma_limit_m.powi(2)) {
            return Err(Use::TooUncertain);
        }
        let beta = touch.normal_angle_rad();
        let n = Vector2::new(beta.cos(), beta.sin());
        let sigma = with_remainder(&of_neighbours(index, touches), along);
        let w = whitener(&sigma, touch.mode == Mode::Tip).ok_or(Use::TooUncertain)?;
        let across = n.dot(&(sigma.fixed_view::<2, 2>(0, 0) * n));
        Ok(Row {
            index,
            sweep: touch.sweep,
            x: touch.x_in_world,
            beta,
            w,
            tip: touch.mode == Mode::Tip,
            line_weight: 1.0 / across,
        })
    }
}

/// Σ, eq. (2); `along` is the larger variance of the place, m².
fn with_remainder(covariance: &Matrix3<f64>, along: f64) -> Matrix3<f64> {
    let (off, turn) = (along / OFF_LENGTH_M, along.sqrt() / TURN_LENGTH_M);
    let place = FLOOR_M * FLOOR_M + off * off;
    let turn = FLOOR_RAD * FLOOR_RAD + turn * turn;
    0.5 * (covariance + covariance.transpose()) + Matrix3::from_diagonal(&Vector3::new(place, place, turn))
}

fn whitener(sigma: &Matrix3<f64>, tip: bool) -> Option<Matrix3<f64>> {
    if !tip {
        return sigma.cholesky()?.l().try_inverse();
    }
    let place: Matrix2<f64> = sigma.fixed_view::<2, 2>(0, 0).into_owned();
    let mut w = Matrix3::zeros();
    w.fixed_view_mut::<2, 2>(0, 0).copy_from(&place.cholesky()?.l().try_inverse()?);
    Some(w)
}

/// Places beyond this are no contacts of a whisker and cost the others their digits, metres.
const FARTHEST_M: f64 = 1e3;
/// Directions turned further than this have lost their digits, radians.
const MOST_TURNS_RAD: f64 = 1e4;

/// Whether a touch is evidence at all.
fn is_sound(touch: &Touch) -> bool {
    let numbers = touch.x_in_world.iter().chain(touch.covariance.iter()).chain([&touch.theta_rad]);
    let is_finite = numbers.into_iter().all(|v| v.is_finite());
    let is_near = touch.x_in_world.amax() < FARTHEST_M && touch.theta_rad.abs() < MOST_TURNS_RAD;
    touch.status == Status::Ok && touch.mode != Mode::Free && is_finite && is_near && touch.side.abs() == 1.0
}

/// Neighbours on either side whose covariance stands in for a touch's own.
const NEIGHBOURS: usize = 3;
/// Variances along the whisker that differ by more than this factor belong to different contacts.
const ALIKE: f64 = 3.0;

/// The covariance at a touch as its neighbours in the sweep have it, turned to its own direction, eq. (8): a touch's own covariance is
/// computed from its own error, and weights that know the error shrink every object. Its own where it has no such neighbours.
fn of_neighbours(index: usize, touches: &[Touch]) -> Matrix3<f64> {
    let own = &touches[index];
    let along = along_variance(&own.covariance);
    let is_alike = |other: &Touch| {
        let ratio = along_variance(&other.covariance) / along;
        is_sound(other)
            && (other.sweep, other.mode, other.side) == (own.sweep, own.mode, own.side)
            && (1.0 / ALIKE..=ALIKE).contains(&ratio)
    };
    let (mut sum, mut n) = (Matrix3::zeros(), 0.0);
    for step in 1..=NEIGHBOURS {
        let pair = [index.checked_sub(step), Some(index + step)].map(|i| i.and_then(|i| touches.get(i)));
        // Only both sides together are centred on the touch.
        let [Some(before), Some(after)] = pair else { break };
        if !(is_alike(before) && is_alike(after)) {
            break;
        }
        for other in [before, after] {
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), own.theta_rad - other.theta_rad);
            sum += turn.matrix() * other.covariance * turn.matrix().transpose();
            n += 1.0;
        }
    }
    if n == 0.0 { own.covariance } else { sum / n }
}

/// The larger variance of the place, m².
fn along_variance(covariance: &Matrix3<f64>) -> f64 {
    let m = covariance;
    0.5 * (m[(0, 0)] + m[(1, 1)] + (m[(0, 0)] - m[(1, 1)]).hypot(m[(0, 1)] + m[(1, 0)]))
}

/// The cost of a squared distance and the weight of its row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Loss {
    /// From five standard deviations on the cost grows linearly: far rows keep pulling a start towards them, eq. (10).
    Leading,
    /// Gaussian with a floor of outliers, eq. (9): the one that is compared.
    Final,
}

/// Where the leading loss turns linear, squared standard deviations.
const LINEAR_FROM: f64 = 25.0;

impl Loss {
    /// Cost and weight.
    pub fn of(self, squared: f64) -> (f64, f64) {
        match self {
            Loss::Leading if squared <= LINEAR_FROM => (squared, 1.0),
            Loss::Leading => {
                let weight = (LINEAR_FROM / squared).sqrt();
                (2.0 * weight * squared - LINEAR_FROM, weight)
            }
            Loss::Final => {
                let floor = (-0.5 * OUTLIER_COST).exp();
                let inlier = (-0.5 * squared).exp();
                (-2.0 * ((inlier + floor) / (1.0 + floor)).ln(), inlier / (inlier + floor))
            }
        }
    }
}
