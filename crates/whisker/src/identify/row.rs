//! Touches made ready for fitting: whitened, and what a squared distance costs.
//!
//!   Σ  covariance of [x, y, β] and what linearising leaves out, eq. (2)   ·   W = L⁻¹, Σ = L Lᵀ   ·   D  squared distance
//!   c  what an outlier costs                                            docs/math/whisker_identify.md eq. (2), (8)

use super::{Config, Touch, Use};
use crate::estimate::{Mode, Status};
use nalgebra::{Matrix2, Matrix3, Vector2};

/// One touch, ready.
#[derive(Debug, Clone, Copy)]
pub(super) struct Row {
    /// Its number in the caller's list.
    pub index: usize,
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

/// The estimate is linear in the load only over a length like the whisker's free part; a place uncertain by σ along the whisker
/// leaves the tangent by σ²/(2 ℓ), and turns from it by as much per ℓ.
const BEND_LENGTH_M: f64 = 0.15;
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
    pub fn new(index: usize, touch: &Touch, config: &Config) -> Result<Row, Use> {
        let finite = touch.x_in_world.iter().chain(touch.covariance.iter()).all(|v| v.is_finite());
        if touch.status != Status::Ok || touch.mode == Mode::Free {
            return Err(Use::NotOk);
        }
        if !finite || !touch.theta_rad.is_finite() || !(touch.side.abs() == 1.0) {
            return Err(Use::NotOk);
        }
        let along = largest_eigenvalue(&touch.covariance.fixed_view::<2, 2>(0, 0).into_owned());
        if !(along <= config.along_sigma_limit_m.powi(2)) {
            return Err(Use::TooUncertain);
        }
        let beta = touch.normal_angle_rad();
        let n = Vector2::new(beta.cos(), beta.sin());
        let sigma = with_remainder(&touch.covariance, along);
        let w = whitener(&sigma, touch.mode == Mode::Tip).ok_or(Use::TooUncertain)?;
        let across = n.dot(&(sigma.fixed_view::<2, 2>(0, 0) * n));
        Ok(Row {
            index,
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
    let bend = along / (2.0 * BEND_LENGTH_M);
    let place = FLOOR_M * FLOOR_M + bend * bend;
    let turn = FLOOR_RAD * FLOOR_RAD + (bend / BEND_LENGTH_M).powi(2);
    0.5 * (covariance + covariance.transpose())
        + Matrix3::from_diagonal(&nalgebra::Vector3::new(place, place, turn))
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

fn largest_eigenvalue(m: &Matrix2<f64>) -> f64 {
    0.5 * (m[(0, 0)] + m[(1, 1)] + (m[(0, 0)] - m[(1, 1)]).hypot(m[(0, 1)] + m[(1, 0)]))
}

/// What the squared distance costs and how much its row counts, eq. (8): Gaussian with a floor of outliers.
pub(super) fn robust(squared: f64, outlier_cost: f64) -> (f64, f64) {
    let floor = (-0.5 * outlier_cost).exp();
    let inlier = (-0.5 * squared).exp();
    (-2.0 * ((inlier + floor) / (1.0 + floor)).ln(), inlier / (inlier + floor))
}
