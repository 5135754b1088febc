//! What errors a coordinate may have while nothing moves: a bank of noise models, each with its filter, its measured scale and its likelihood.
//!
//! ```text
//!   model θ = (v, τ)   y = m + b + n,  n of variance s² r,  b of variance s² v r̄ and autocorrelation exp(−Δ/τ); s² is measured, model by model
//!   ν, s² S̃            innovation and its variance; gain and S̃ do not depend on s²
//!   ℓ_θ                Σ ln N(ν; 0, s² S̃), predictive: what θ says of the readings before they are seen
//! ```
//! Derivation: docs/math/monitor.md section 9.

use super::axis::{AxisFilter, AxisNoise, Innovation, Transition};
use crate::snapshot::numbers;
use nalgebra::Vector4;

/// A correlated error: variance in units of a reading's own, time constant in units of the bank's.
#[derive(Debug, Clone, Copy)]
pub(super) struct Model {
    pub share: f64,
    pub time: f64,
}

const fn model(share: f64, time: f64) -> Model {
    Model { share, time }
}

/// White noise alone.
pub(super) const WHITE: usize = 0;
/// Models of the bank besides the stated one.
pub(super) const GRID: usize = 34;
/// And with it.
pub(super) const MODELS: usize = GRID + 1;
/// The error as it was stated beforehand: never excluded.
pub(super) const STATED: usize = GRID;
/// Shares and time constants, a factor of four and of six apart: neighbours differ by hundredths of a nat a reading.
pub(super) const GRID_MODELS: [Model; GRID] = [
    model(0.0, 1.0),
    model(0.3, 2.0),
    model(1.2, 2.0),
    model(5.0, 2.0),
    model(20.0, 2.0),
    model(0.3, 12.0),
    model(1.2, 12.0),
    model(5.0, 12.0),
    model(20.0, 12.0),
    model(0.3, 72.0),
    model(1.2, 72.0),
    model(5.0, 72.0),
    model(20.0, 72.0),
    model(80.0, 72.0),
    model(0.3, 432.0),
    model(1.2, 432.0),
    model(5.0, 432.0),
    model(20.0, 432.0),
    model(80.0, 432.0),
    model(0.3, 2_592.0),
    model(1.2, 2_592.0),
    model(5.0, 2_592.0),
    model(20.0, 2_592.0),
    model(80.0, 2_592.0),
    model(0.3, 15_552.0),
    model(1.2, 15_552.0),
    model(5.0, 15_552.0),
    model(20.0, 15_552.0),
    model(80.0, 15_552.0),
    model(0.3, 93_312.0),
    model(1.2, 93_312.0),
    model(5.0, 93_312.0),
    model(20.0, 93_312.0),
    model(80.0, 93_312.0),
];

/// A model that is behind the best one by less than this, ln 1000, is not excluded.
pub(super) const EXCLUDED: f64 = 6.9;
/// A model falls behind no further than this: errors that come back are recognised within minutes.
const FURTHEST_BEHIND: f64 = 60.0;
/// Another model is used when it is ahead by this much.
const AHEAD: f64 = 2.0;
/// Readings over which the scale is measured, and how many the stated scale counts for.
const SCALE_OVER: f64 = 200.0;
const STATED_COUNTS: f64 = 10.0;
/// A square of a standardised innovation counts up to this: nine in ten thousand are larger by chance, outliers and steps are.
const LARGEST_SQUARE: f64 = 11.0;
/// Of the square of a normal variable that is cut off there.
const MEAN_SQUARE: f64 = 0.994;

/// All models of one coordinate.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AxisBank {
    /// r̄: variance of a typical reading, as stated.
    typical: f64,
    mean: [[f64; GRID]; 2],
    /// Of m, of both, of b; in units of s².
    covariance: [[f64; GRID]; 3],
    stated: AxisFilter,
    /// Whether there is a stated error; else the model is that of white noise.
    is_stated: bool,
    /// s².
    pub scale: [f64; MODELS],
    /// ℓ.
    pub log_likelihood: [f64; MODELS],
    /// The model whose filter is used.
    pub used: usize,
    readings: f64,
}

/// e^(−Δ/τ) of each model.
pub(super) fn decays(elapsed_s: f64, unit_s: f64) -> [f64; GRID] {
    let mut decays = [1.0; GRID];
    for (i, model) in GRID_MODELS.iter().enumerate() {
        // Models of one time constant stand beside each other.
        decays[i] = match i {
            0 => 1.0,
            _ if 1 < i && GRID_MODELS[i - 1].time == model.time => decays[i - 1],
            _ => (-elapsed_s / (model.time * unit_s)).exp(),
        };
    }
    decays
}

impl AxisBank {
    pub fn new(noise: &AxisNoise, typical: f64) -> Self {
        let typical = typical.max(1e-12);
        let mut bank = AxisBank {
            typical,
            mean: [[0.0; GRID]; 2],
            covariance: [[0.0; GRID]; 3],
            stated: AxisFilter::new(noise),
            is_stated: 0.0 < noise.bias_sigma || 0.0 < noise.daily_sigma,
            scale: [1.0; MODELS],
            log_likelihood: [0.0; MODELS],
            used: WHITE,
            readings: 0.0,
        };
        bank.begin(noise);
        bank
    }

    /// A constant part as widely known as `noise` says; what was learned of the noise stays.
    pub fn begin(&mut self, noise: &AxisNoise) {
        self.mean = [[0.0; GRID]; 2];
        for (i, model) in GRID_MODELS.iter().enumerate() {
            self.covariance[0][i] = noise.reference_sigma.powi(2) / self.scale[i];
            self.covariance[1][i] = 0.0;
            self.covariance[2][i] = model.share * self.typical;
        }
        self.stated = AxisFilter::new(noise);
    }

    pub fn predict(&mut self, decays: &[f64; GRID], stated: &Transition) {
        let ([_, b], [_, mb, bb]) = (&mut self.mean, &mut self.covariance);
        for i in 0..GRID {
            let kept = decays[i];
            b[i] *= kept;
            mb[i] *= kept;
            let steady = GRID_MODELS[i].share * self.typical;
            bb[i] = steady + kept * kept * (bb[i] - steady);
        }
        if self.is_stated {
            self.stated.predict(stated);
        }
    }

    /// Value, variance and gain of the model that is used; nothing is learned of the reading.
    pub fn innovation(&self, y: f64, r: f64) -> Innovation {
        self.innovation_of(self.used, y, r)
    }

    fn innovation_of(&self, model: usize, y: f64, r: f64) -> Innovation {
        let scale = self.scale[model];
        if model == STATED {
            return self.stated.innovation(y, scale * r);
        }
        let [mm, mb, bb] = self.covariance.map(|of| of[model]);
        let variance = mm + 2.0 * mb + bb + r;
        Innovation {
            value: y - self.mean[0][model] - self.mean[1][model],
            variance: scale * variance,
            gain: Vector4::new((mm + mb) / variance, (mb + bb) / variance, 0.0, 0.0),
        }
    }

    /// The same after a time, of the model that is used; the bank stays.
    pub fn foreseen(&self, elapsed_s: f64, unit_s: f64, stated: &Transition, y: f64, r: f64) -> Innovation {
        let (used, scale) = (self.used, self.scale[self.used]);
        if used == STATED {
            let mut filter = self.stated;
            filter.predict(stated);
            return filter.innovation(y, scale * r);
        }
        let kept = (-elapsed_s / (GRID_MODELS[used].time * unit_s)).exp();
        let [mm, mb, bb] = self.covariance.map(|of| of[used]);
        let steady = GRID_MODELS[used].share * self.typical;
        let variance = mm + 2.0 * kept * mb + steady + kept * kept * (bb - steady) + r;
        let value = y - self.mean[0][used] - kept * self.mean[1][used];
        Innovation { value, variance: scale * variance, gain: Vector4::zeros() }
    }

    /// Every model reads.
    pub fn update(&mut self, y: f64, r: f64) {
        self.readings = (self.readings + 1.0).min(SCALE_OVER);
        let forgets = 1.0 / (self.readings + STATED_COUNTS);
        let ([m, b], [mm, mb, bb]) = (&mut self.mean, &mut self.covariance);
        let mut squares = [0.0; GRID];
        let mut variances = [0.0; GRID];
        for i in 0..GRID {
            let (of_m, of_b) = (mm[i] + mb[i], mb[i] + bb[i]);
            let variance = of_m + of_b + r;
            let (gain_m, gain_b) = (of_m / variance, of_b / variance);
            let value = y - m[i] - b[i];
            m[i] += gain_m * value;
            b[i] += gain_b * value;
            mm[i] -= gain_m * of_m;
            mb[i] -= gain_m * of_b;
            bb[i] -= gain_b * of_b;
            squares[i] = value * value / (variance * self.scale[i]);
            variances[i] = variance * self.scale[i];
        }
        for i in 0..GRID {
            self.log_likelihood[i] -= 0.5 * (squares[i] + variances[i].ln());
            let square = squares[i].min(LARGEST_SQUARE) / MEAN_SQUARE;
            self.scale[i] = (self.scale[i] * (1.0 + forgets * (square - 1.0))).max(1e-9);
        }
        if self.is_stated {
            let innovation = self.stated.innovation(y, self.scale[STATED] * r);
            let square = innovation.value * innovation.value / innovation.variance;
            self.log_likelihood[STATED] -= 0.5 * (square + innovation.variance.ln());
            let square = square.min(LARGEST_SQUARE) / MEAN_SQUARE;
            // A reading's own noise is all that is scaled: what is stated to last is what it is.
            self.scale[STATED] = (self.scale[STATED] * (1.0 + forgets * (square - 1.0))).max(1e-9);
            self.stated.update(&innovation);
        } else {
            self.log_likelihood[STATED] = self.log_likelihood[WHITE];
            self.scale[STATED] = self.scale[WHITE];
        }
        self.choose();
    }

    fn choose(&mut self) {
        let best = (0..MODELS)
            .max_by(|i, j| self.log_likelihood[*i].total_cmp(&self.log_likelihood[*j]))
            .unwrap_or(WHITE);
        let most = self.log_likelihood[best];
        self.log_likelihood.iter_mut().for_each(|of| *of = of.max(most - FURTHEST_BEHIND));
        if AHEAD < most - self.log_likelihood[self.used] {
            self.used = best;
        }
    }

    /// Mean and variance of the constant part.
    pub fn level(&self) -> (f64, f64) {
        match self.used {
            STATED => (self.stated.mean[0], self.stated.covariance[(0, 0)]),
            used => (self.mean[0][used], self.scale[used] * self.covariance[0][used]),
        }
    }

    /// The error that lasts, of the model that is used; the same model for a signature.
    pub fn transition(&self, elapsed_s: f64, unit_s: f64, stated: &Transition) -> Transition {
        match self.used {
            STATED => *stated,
            used => {
                let kept = (-elapsed_s / (GRID_MODELS[used].time * unit_s)).exp();
                Transition::of_bias(kept, elapsed_s)
            }
        }
    }

    /// Variance of a reading over the stated one.
    pub fn scale(&self) -> f64 {
        self.scale[self.used]
    }

    pub fn is_sound(&self) -> bool {
        let positive = self.scale.iter().all(|s| 0.0 < *s) && 0.0 < self.typical && 0.0 <= self.readings;
        positive && self.used < MODELS
    }
}

numbers!(AxisBank {
    typical,
    mean,
    covariance,
    stated,
    is_stated,
    scale,
    log_likelihood,
    used,
    readings,
});
