//! The errors that a coordinate may have while nothing moves: a bank of noise models, each with its filter, its measured scale and its likelihood.
//!
//! ```text
//!   model θ = (v, τ)   y = m + b + n,  n of variance s² r,  b of variance s² v r̄ and autocorrelation exp(−Δ/τ); s² is measured, model by model
//!   ν, s² S̃            innovation and its variance; gain and S̃ do not depend on s²
//!   ℓ_θ                Σ ln N(ν; 0, s² S̃), predictive: what θ says of the readings before they are seen
//! ```
//! Derivation: docs/math/monitor.md section 9.

use super::axis::{AxisFilter, AxisNoise, DAY_S, Innovation, Transition};
use super::models::{
    DAYS, DIRECTIONS, DIURNAL_SHARES, EXCLUDED, GRID, GRID_MODELS, MODELS, Model, STATED, WHITE, best,
    between,
};
use super::priors::SCALE_OVER;
use crate::temporal::snapshot::numbers;
use arrayvec::ArrayVec;
use nalgebra::Vector4;

/// Correlated errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrelatedError {
    /// Their standard deviation over that of a reading's own noise.
    pub sigma_ratio: f64,
    /// The time in which they are forgotten, seconds; a day for those that come back every day.
    pub time_s: f64,
}

/// Largest distance by which a model may fall behind, so that errors that come back are recognised within minutes.
pub(super) const FURTHEST_BEHIND: f64 = 60.0;
/// Another model is used when it is ahead by this much.
const AHEAD: f64 = 2.0;
/// Correlated errors are presumed up to this share while there is no reading; ln of how improbable larger ones are.
const PRESUMED: f64 = 1.2;
const UNPRESUMED: f64 = -12.0;
/// A model that was behind by this much was refuted: where it leads later, the errors are others.
const REFUTED: f64 = 30.0;
/// How many readings the stated scale counts for.
const STATED_COUNTS: f64 = 10.0;
/// A square of a standardised innovation counts up to this: nine in ten thousand are larger by chance, outliers and steps are.
const LARGEST_SQUARE: f64 = 11.0;
/// Of the square of a normal variable that is cut off there.
const MEAN_SQUARE: f64 = 0.998_3;

/// All models of one coordinate.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AxisBank {
    /// r̄: variance of a typical reading, as stated.
    typical: f64,
    mean: [[f64; GRID]; 2],
    /// Of m, of both, of b; in units of s².
    covariance: [[f64; GRID]; 3],
    /// Of the diurnal variations, in units of s², and the stated error.
    full: [AxisFilter; DAYS + 1],
    /// Whether there is a stated error; else the model is that of white noise.
    is_stated: bool,
    /// s².
    pub scale: [f64; MODELS],
    /// ℓ.
    pub log_likelihood: [f64; MODELS],
    /// The same with squares cut off: the few readings of a step do not choose the model.
    record: [f64; MODELS],
    /// The least that it was.
    least: [f64; MODELS],
    /// The model whose filter is used.
    pub used: usize,
    readings: f64,
}

fn largest(of: &[f64; MODELS]) -> f64 {
    of.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

/// What errors that the readings have not shown may gain by the hour while nothing is read, in variances of a reading, and for how many hours
/// they gain it: docs/math/monitor.md eqs. (90), (91).
const UNSEEN_PER_HOUR: f64 = 1.0;
const MOST_HOURS: f64 = 24.0;
const HOUR_S: f64 = 3600.0;
/// The shortest time that counts as watched, seconds.
const LEAST_WATCHED_S: f64 = 60.0;

/// A time that has passed, for all models of all coordinates.
pub(super) struct Passed {
    /// e^(−Δ/τ) of each model.
    decays: [f64; GRID],
    /// Of a diurnal variation of variance one.
    day: Transition,
    /// What an error may have gained besides, in variances of a reading.
    unseen: f64,
    /// Δ, seconds.
    elapsed_s: f64,
}

impl Passed {
    /// A gap of `elapsed_s` after `watched_s` of readings. Beyond the watched time the models are not trusted, because nothing has tested
    /// them over such a time.
    pub fn after(elapsed_s: f64, watched_s: f64, unit_s: f64) -> Self {
        let known_s =
            if watched_s < DAY_S { elapsed_s.min(watched_s.max(LEAST_WATCHED_S)) } else { elapsed_s };
        let hours = ((elapsed_s - known_s) / HOUR_S).min(MOST_HOURS);
        Passed { unseen: UNSEEN_PER_HOUR * hours, elapsed_s, ..Passed::new(known_s, unit_s) }
    }

    pub fn new(elapsed_s: f64, unit_s: f64) -> Self {
        let mut decays = [1.0; GRID];
        for (i, model) in GRID_MODELS.iter().enumerate().skip(1) {
            // Models of one time constant stand beside each other.
            let is_same = GRID_MODELS[i - 1].time == model.time;
            decays[i] = if is_same { decays[i - 1] } else { (-elapsed_s / (model.time * unit_s)).exp() };
        }
        let of_day =
            AxisNoise { reference_sigma: 0.0, bias_sigma: 0.0, bias_time_s: 1.0, diurnal_sigma: 1.0 };
        Passed { decays, day: Transition::new(&of_day, elapsed_s), unseen: 0.0, elapsed_s }
    }

    /// A diurnal variation of this variance after the time.
    fn carry(&self, filter: &mut AxisFilter, steady: f64, typical: f64) {
        filter.predict(&self.day.with_diurnal_variance(1.0, steady));
        let known = filter.covariance[(2, 2)];
        filter.covariance[(2, 2)] = self.spread(1.0, known, steady, typical);
    }

    /// The variance of an error after the time: no more than it ever has.
    fn spread(&self, kept: f64, variance: f64, steady: f64, typical: f64) -> f64 {
        let known = steady + kept * kept * (variance - steady);
        (known + self.unseen * typical).min(known.max(steady))
    }
}

impl AxisBank {
    pub fn new(noise: &AxisNoise, typical: f64) -> Self {
        let typical = typical.max(1e-12);
        let mut bank = AxisBank {
            typical,
            mean: [[0.0; GRID]; 2],
            covariance: [[0.0; GRID]; 3],
            full: [AxisFilter::new(noise); DAYS + 1],
            is_stated: 0.0 < noise.bias_sigma || 0.0 < noise.diurnal_sigma,
            scale: [1.0; MODELS],
            log_likelihood: [0.0; MODELS],
            record: [0.0; MODELS],
            least: [0.0; MODELS],
            used: WHITE,
            readings: 0.0,
        };
        bank.begin(noise);
        bank
    }

    /// Resets the constant part to the uncertainty of `noise`; what was learned of the noise stays.
    pub fn begin(&mut self, noise: &AxisNoise) {
        self.mean = [[0.0; GRID]; 2];
        for (i, model) in GRID_MODELS.iter().enumerate() {
            self.covariance[0][i] = noise.reference_sigma.powi(2) / self.scale[i];
            self.covariance[1][i] = 0.0;
            self.covariance[2][i] = model.share * self.typical;
        }
        for (day, share) in DIURNAL_SHARES.iter().enumerate() {
            let reference_sigma = noise.reference_sigma / self.scale[GRID + day].sqrt();
            let diurnal_sigma = (share * self.typical).sqrt();
            let of_day = AxisNoise { reference_sigma, bias_sigma: 0.0, bias_time_s: 1.0, diurnal_sigma };
            self.full[day] = AxisFilter::new(&of_day);
        }
        self.full[DAYS] = AxisFilter::new(noise);
    }

    pub fn predict(&mut self, passed: &Passed, stated: &Transition) {
        let ([_, b], [_, mb, bb]) = (&mut self.mean, &mut self.covariance);
        for i in 0..GRID {
            let kept = passed.decays[i];
            b[i] *= kept;
            mb[i] *= kept;
            bb[i] = passed.spread(kept, bb[i], GRID_MODELS[i].share * self.typical, self.typical);
        }
        for (day, share) in DIURNAL_SHARES.iter().enumerate() {
            passed.carry(&mut self.full[day], share * self.typical, self.typical);
        }
        if self.is_stated {
            self.full[DAYS].predict(stated);
        }
    }

    /// Value, variance and gain of the model that is used; nothing is learned of the reading.
    pub fn innovation(&self, y: f64, r: f64) -> Innovation {
        self.innovation_of(self.used, y, r)
    }

    fn innovation_of(&self, model: usize, y: f64, r: f64) -> Innovation {
        let scale = self.scale[model];
        if GRID <= model {
            return self.of_full(model, &self.full[model - GRID], y, r);
        }
        let [mm, mb, bb] = self.covariance.map(|of| of[model]);
        let variance = mm + 2.0 * mb + bb + r;
        Innovation {
            value: y - self.mean[0][model] - self.mean[1][model],
            variance: scale * variance,
            gain: Vector4::new((mm + mb) / variance, (mb + bb) / variance, 0.0, 0.0),
        }
    }

    /// A diurnal variation is scaled as a whole; of what is stated only the reading's own noise is.
    fn of_full(&self, model: usize, filter: &AxisFilter, y: f64, r: f64) -> Innovation {
        let scale = self.scale[model];
        if model == STATED {
            return filter.innovation(y, scale * r);
        }
        let innovation = filter.innovation(y, r);
        Innovation { variance: scale * innovation.variance, ..innovation }
    }

    /// The same after a time, of the model that is used; the bank stays.
    pub fn predicted(&self, passed: &Passed, stated: &Transition, y: f64, r: f64) -> Innovation {
        let (used, scale) = (self.used, self.scale[self.used]);
        if GRID <= used {
            let mut filter = self.full[used - GRID];
            match used {
                STATED => filter.predict(stated),
                day => passed.carry(&mut filter, DIURNAL_SHARES[day - GRID] * self.typical, self.typical),
            }
            return self.of_full(used, &filter, y, r);
        }
        let kept = passed.decays[used];
        let [mm, mb, bb] = self.covariance.map(|of| of[used]);
        let spread = passed.spread(kept, bb, GRID_MODELS[used].share * self.typical, self.typical);
        let variance = mm + 2.0 * kept * mb + spread + r;
        let value = y - self.mean[0][used] - kept * self.mean[1][used];
        Innovation { value, variance: scale * variance, gain: Vector4::zeros() }
    }

    /// Updates every model with a reading.
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
            let (log, square) = (variances[i].ln(), squares[i].min(LARGEST_SQUARE));
            self.log_likelihood[i] -= 0.5 * (squares[i] + log);
            self.record[i] -= 0.5 * (square + log);
            let square = square / MEAN_SQUARE;
            self.scale[i] = (self.scale[i] * (1.0 + forgets * (square - 1.0))).max(1e-9);
        }
        let full = GRID..if self.is_stated { MODELS } else { STATED };
        for model in full {
            let innovation = self.innovation_of(model, y, r);
            let square = innovation.value * innovation.value / innovation.variance;
            let (log, cut) = (innovation.variance.ln(), square.min(LARGEST_SQUARE));
            self.log_likelihood[model] -= 0.5 * (square + log);
            self.record[model] -= 0.5 * (cut + log);
            let own = if model == STATED { 1.0 } else { self.scale[model] };
            self.full[model - GRID].update(&Innovation { variance: innovation.variance / own, ..innovation });
            self.scale[model] = (self.scale[model] * (1.0 + forgets * (cut / MEAN_SQUARE - 1.0))).max(1e-9);
        }
        if !self.is_stated {
            self.log_likelihood[STATED] = self.log_likelihood[WHITE];
            self.record[STATED] = self.record[WHITE];
            self.scale[STATED] = self.scale[WHITE];
        }
        self.choose();
    }

    fn choose(&mut self) {
        let most = largest(&self.log_likelihood);
        self.log_likelihood.iter_mut().for_each(|of| *of = of.max(most - FURTHEST_BEHIND));
        let most = largest(&self.record);
        self.record.iter_mut().for_each(|of| *of = (*of - most).max(-FURTHEST_BEHIND));
        if self.record[self.used] < -AHEAD {
            self.used = self.record.iter().position(|of| *of == 0.0).unwrap_or(WHITE);
        }
        self.least.iter_mut().zip(&self.record).for_each(|(least, now)| *least = least.min(*now));
    }

    /// Whether the model in use had been refuted.
    pub fn has_changed(&self) -> bool {
        self.least[self.used] <= -REFUTED
    }

    /// What was refuted is what is behind so far now.
    pub fn forget_refuted(&mut self) {
        self.least = self.record;
    }

    pub fn set_log_likelihoods(&mut self, all: &[f64]) {
        self.log_likelihood.copy_from_slice(all);
        self.record.copy_from_slice(all);
        self.choose();
    }

    pub fn forget_likelihoods(&mut self) {
        self.log_likelihood.fill(0.0);
        self.record.fill(0.0);
        self.least.fill(0.0);
    }

    /// Before the first reading: errors much larger than a reading's own are not looked for until they show.
    pub fn presume(&mut self) {
        let shares = GRID_MODELS.iter().map(|model| model.share).chain(DIURNAL_SHARES);
        for (i, share) in shares.enumerate() {
            let log = if share <= PRESUMED { 0.0 } else { UNPRESUMED };
            (self.log_likelihood[i], self.record[i]) = (log, log);
        }
        // For how long nothing was read is not known: eq. (91).
        let most = UNSEEN_PER_HOUR * MOST_HOURS * self.typical;
        self.covariance[2].iter_mut().for_each(|variance| *variance = variance.min(most));
        for of_day in &mut self.full[..DAYS] {
            of_day.covariance[(2, 2)] = of_day.covariance[(2, 2)].min(most);
        }
    }

    /// Mean and variance of the constant part.
    pub fn level(&self) -> (f64, f64) {
        let used = self.used;
        let scale = if used == STATED { 1.0 } else { self.scale[used] };
        if GRID <= used {
            let filter = &self.full[used - GRID];
            return (filter.mean[0], scale * filter.covariance[(0, 0)]);
        }
        (self.mean[0][used], scale * self.covariance[0][used])
    }

    /// The transition of the model in use.
    pub fn transition(&self, passed: &Passed, stated: &Transition) -> Transition {
        match self.used {
            STATED => *stated,
            used if GRID <= used => {
                let day = passed.day.with_diurnal_variance(1.0, DIURNAL_SHARES[used - GRID] * self.typical);
                day.over(passed.elapsed_s)
            }
            used => Transition::of_bias(passed.decays[used], passed.elapsed_s),
        }
    }

    /// Variance of a reading over the stated one.
    pub fn scale(&self) -> f64 {
        self.scale[self.used]
    }

    pub fn readings(&self) -> f64 {
        self.readings
    }

    /// The error that lasts of the model in use, where white noise is excluded.
    pub fn correlated(&self, unit_s: f64) -> Option<CorrelatedError> {
        if largest(&self.log_likelihood) - EXCLUDED <= self.log_likelihood[WHITE] {
            return None;
        }
        match self.used {
            WHITE | STATED => None,
            used if GRID <= used => Some(CorrelatedError {
                sigma_ratio: DIURNAL_SHARES[used - GRID].sqrt(),
                time_s: super::axis::DAY_S,
            }),
            used => {
                let Model { share, time } = GRID_MODELS[used];
                Some(CorrelatedError { sigma_ratio: share.sqrt(), time_s: time * unit_s })
            }
        }
    }

    /// The variance of that error; zero where there is none.
    pub fn correlated_variance(&self, unit_s: f64) -> f64 {
        let share = self.correlated(unit_s).map_or(0.0, |error| error.sigma_ratio.powi(2));
        share * self.scale() * self.typical
    }

    /// What `n` readings, a time apart and each as good as `joined`, say of a step of one under each model and under those between the best
    /// and the next, and what each has to make up for before it explains them: nothing where it is not excluded.
    pub fn possible(
        &self,
        passed: &Passed,
        n: usize,
        joined: f64,
    ) -> ArrayVec<(f64, f64), { GRID + DIRECTIONS.len() }> {
        let best = best(&self.log_likelihood);
        let least = self.log_likelihood[best] - EXCLUDED;
        let of = |model: usize| {
            let behind = (least - self.log_likelihood[model]).max(0.0);
            (self.information(model, passed, n, joined), behind)
        };
        let mut all: ArrayVec<_, { GRID + DIRECTIONS.len() }> = (0..GRID).map(of).collect();
        for between in between(best, &self.log_likelihood) {
            // Of three numbers far apart a parabola may leave their range.
            let d = between.of(|model| all[model].0);
            all.push((d.max(0.0), 0.0));
        }
        all
    }

    fn information(&self, model: usize, passed: &Passed, n: usize, joined: f64) -> f64 {
        let (kept, r) = (passed.decays[model], self.typical / joined);
        let steady = GRID_MODELS[model].share * self.typical;
        let [mut mm, mut mb, mut bb] = self.covariance.map(|of| of[model]);
        let (mut of_m, mut of_b, mut sum) = (1.0, 0.0, 0.0);
        for _ in 0..n {
            (mb, bb, of_b) = (kept * mb, steady + kept * kept * (bb - steady), kept * of_b);
            let variance = mm + 2.0 * mb + bb + r;
            let (gain_m, gain_b) = ((mm + mb) / variance, (mb + bb) / variance);
            let seen: f64 = of_m + of_b;
            sum += seen * seen / (self.scale[model] * variance);
            (of_m, of_b) = (of_m - gain_m * seen, of_b - gain_b * seen);
            (mm, mb, bb) = (mm - gain_m * (mm + mb), mb - gain_m * (mb + bb), bb - gain_b * (mb + bb));
        }
        sum
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
    full,
    is_stated,
    scale,
    log_likelihood,
    record,
    least,
    used,
    readings,
});
