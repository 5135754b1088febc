//! The model of one coordinate of a camera's small motion while nothing moves, and the filter that predicts it.
//!
//! ```text
//!   y = m + b + w + n      m  the reference's own error, constant     b  a correlated error: variance σ_b², forgotten within τ_b
//!                          w  the diurnal variation, σ_w               n  noise of this reading
//!   x = [m, b, w, w⊥]      F transition over Δ   Q what it adds       h = [1, 1, 1, 0]
//!   ν innovation, S its variance, K gain
//! ```
//! Derivation: docs/math/monitor.md eqs. (1)–(4).

use crate::temporal::snapshot::numbers;
use nalgebra::{Matrix4, Vector4, Vector6};

/// Coordinates of a small motion.
pub(super) const AXES: usize = 6;

/// A reading in whitened coordinates, in which its errors are independent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Whitened {
    /// y.
    pub value: Vector6<f64>,
    /// r.
    pub variance: Vector6<f64>,
}

/// A day, seconds.
pub const DAY_S: f64 = 86_400.0;
/// Time over which the diurnal variation is forgotten, because the weather changes.
const DIURNAL_FORGOTTEN_S: f64 = 10.0 * DAY_S;

/// Standard deviations of the errors that are no drift, in the unit of the coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisNoise {
    /// Of the reference.
    pub reference_sigma: f64,
    /// σ_b, of the error that lasts from frame to frame.
    pub bias_sigma: f64,
    /// τ_b, the time in which that error is forgotten, seconds.
    pub bias_time_s: f64,
    /// σ_w, of the diurnal variation.
    pub diurnal_sigma: f64,
}

/// Motion of the state over a time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Transition {
    /// Factor of b.
    bias: f64,
    /// Factor of w times cosine and sine of the rotation of day.
    cos: f64,
    sin: f64,
    /// Variances that b and w regain.
    bias_gain: f64,
    diurnal_gain: f64,
    /// Δ, seconds.
    pub elapsed_s: f64,
}

impl Transition {
    pub fn new(noise: &AxisNoise, elapsed_s: f64) -> Self {
        let bias = (-elapsed_s / noise.bias_time_s).exp();
        let diurnal = (-elapsed_s / DIURNAL_FORGOTTEN_S).exp();
        let (sin, cos) = (std::f64::consts::TAU * elapsed_s / DAY_S).sin_cos();
        Transition {
            bias,
            cos: diurnal * cos,
            sin: diurnal * sin,
            bias_gain: noise.bias_sigma.powi(2) * (1.0 - bias * bias),
            diurnal_gain: noise.diurnal_sigma.powi(2) * (1.0 - diurnal * diurnal),
            elapsed_s,
        }
    }

    /// The transition of a correlated error alone that keeps a share `kept`; its filter adds the gained variance.
    pub fn of_bias(kept: f64, elapsed_s: f64) -> Self {
        Transition { bias: kept, cos: 0.0, sin: 0.0, bias_gain: 0.0, diurnal_gain: 0.0, elapsed_s }
    }

    /// The same of another time, as far as it is not that of the errors.
    pub fn over(&self, elapsed_s: f64) -> Self {
        Transition { elapsed_s, ..*self }
    }

    /// The same for a diurnal variation of another variance.
    pub fn with_diurnal_variance(&self, from: f64, to: f64) -> Self {
        Transition { diurnal_gain: self.diurnal_gain / from * to, ..*self }
    }

    /// F x.
    pub fn apply(&self, x: &Vector4<f64>) -> Vector4<f64> {
        Vector4::new(
            x[0],
            self.bias * x[1],
            self.cos * x[2] - self.sin * x[3],
            self.sin * x[2] + self.cos * x[3],
        )
    }

    /// F P Fᵀ + Q.
    fn spread(&self, p: &Matrix4<f64>) -> Matrix4<f64> {
        let mut left = Matrix4::zeros();
        for column in 0..4 {
            left.set_column(column, &self.apply(&p.column(column).into_owned()));
        }
        let mut both = Matrix4::zeros();
        for row in 0..4 {
            both.set_row(row, &self.apply(&left.row(row).transpose()).transpose());
        }
        both[(1, 1)] += self.bias_gain;
        both[(2, 2)] += self.diurnal_gain;
        both[(3, 3)] += self.diurnal_gain;
        both
    }
}

/// A reading beside the prediction of the filter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Innovation {
    /// ν.
    pub value: f64,
    /// S.
    pub variance: f64,
    /// K.
    pub gain: Vector4<f64>,
}

/// The Kalman filter of one coordinate under "nothing happened".
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxisFilter {
    /// Mean of `[m, b, w, w⊥]`.
    pub mean: Vector4<f64>,
    /// Its covariance.
    pub covariance: Matrix4<f64>,
}

impl AxisFilter {
    pub fn new(noise: &AxisNoise) -> Self {
        let sigmas = [noise.reference_sigma, noise.bias_sigma, noise.diurnal_sigma, noise.diurnal_sigma];
        AxisFilter {
            mean: Vector4::zeros(),
            covariance: Matrix4::from_diagonal(&Vector4::from(sigmas.map(|s| s * s))),
        }
    }

    pub fn predict(&mut self, transition: &Transition) {
        self.mean = transition.apply(&self.mean);
        self.covariance = transition.spread(&self.covariance);
    }

    /// Returns the innovation of reading `y` with noise variance `r`, without changing the filter.
    pub fn innovation(&self, y: f64, r: f64) -> Innovation {
        let ph = self.covariance.column(0) + self.covariance.column(1) + self.covariance.column(2);
        let variance = read(&ph) + r;
        Innovation { value: y - read(&self.mean), variance, gain: ph / variance }
    }

    pub fn update(&mut self, innovation: &Innovation) {
        self.mean += innovation.gain * innovation.value;
        let ph = innovation.gain * innovation.variance;
        self.covariance -= innovation.gain * ph.transpose();
        self.covariance = 0.5 * (self.covariance + self.covariance.transpose());
    }
}

/// h·x.
pub(super) fn read(x: &Vector4<f64>) -> f64 {
    x[0] + x[1] + x[2]
}

numbers!(AxisNoise { reference_sigma, bias_sigma, bias_time_s, diurnal_sigma });
numbers!(AxisFilter { mean, covariance });
numbers!(Whitened { value, variance });
