//! Noise that is measured, not believed: what the readings themselves say of their errors, and how far a change must explain them better than
//! any error that they have not excluded.
//!
//! ```text
//!   L̂     predictive density of the readings so far, by the models in use        L_θ  the same by one model θ of a coordinate
//!   ρ_k    Π_{s ≥ k} L̂ over the largest of L̂ and of the L_θ that were not excluded before the onset k; at most one
//!   R      Σ_k w_k Λ_k ρ_k: the ratio of each change to every error that is still possible
//! ```
//! Derivation: docs/math/monitor.md section 9.

use super::axis::{AXES, AxisNoise, Innovation, Transition, Whitened};
use super::bank::{AxisBank, FURTHEST_BEHIND, Passed};
use super::models::{self, EXCLUDED, MODELS};
use super::priors::{BETWEEN, GROWN, most_grown, read_grown};
use super::promise::{self, Detectable, MeasuredNoise, Promise};
use crate::temporal::snapshot::numbers;
use nalgebra::{Matrix6, Vector6};

/// Readings over which the time between them is taken.
const BETWEEN_OVER: f64 = 100.0;
/// A time longer than this many times that is a gap.
const MOST_APART: f64 = 10.0;
/// Where the coordinates, the grown noise and the models stand in a standing.
const GROWN_AT: usize = AXES;
const HEAVY_AT: usize = AXES + GROWN.len();
const READINGS_AT: usize = HEAVY_AT + 1;
const CHANGED_AT: usize = READINGS_AT + 1;
const MODELS_AT: usize = CHANGED_AT + 1;
const STANDING: usize = MODELS_AT + AXES * MODELS;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Measured {
    banks: Box<[AxisBank; AXES]>,
    /// Unit of the time constants, seconds.
    unit_s: f64,
    /// ln L̂ of each coordinate.
    own: [f64; AXES],
    /// The same of all, were the variances grown.
    grown: [f64; GROWN.len()],
    /// The same, were the readings of Student's t.
    heavy: f64,
    /// Readings so far, and the time between them, seconds.
    readings: f64,
    between_s: f64,
    /// Whether errors became such as had been refuted.
    has_changed: bool,
    /// What the readings of motions that are reported said of each model: counted when it comes back by itself.
    set_aside: Vec<f64>,
}

impl Measured {
    pub fn new(noise: &[AxisNoise; AXES], typical: &Vector6<f64>, unit_s: f64) -> Self {
        Measured {
            banks: Box::new(std::array::from_fn(|axis| AxisBank::new(&noise[axis], typical[axis]))),
            unit_s,
            own: [0.0; AXES],
            grown: [0.0; GROWN.len()],
            heavy: 0.0,
            readings: 0.0,
            between_s: unit_s,
            has_changed: false,
            set_aside: Vec::new(),
        }
    }

    /// The scales that readings show roughly, before anything is known of their correlation.
    pub fn set_scales(&mut self, scales: &Vector6<f64>) {
        self.banks.iter_mut().zip(scales).for_each(|(bank, scale)| bank.scale.fill(*scale));
    }

    /// The constant part is as widely known as `noise` says, the likelihoods count from here.
    pub fn begin(&mut self, noise: &[AxisNoise; AXES]) {
        self.banks.iter_mut().zip(noise).for_each(|(bank, noise)| bank.begin(noise));
    }

    /// There is no reading to begin with.
    pub fn presume(&mut self) {
        self.banks.iter_mut().for_each(AxisBank::presume);
    }

    pub fn forget_likelihoods(&mut self) {
        self.banks.iter_mut().for_each(AxisBank::forget_likelihoods);
    }

    /// A time passes: how states of the models in use move.
    pub fn predict(&mut self, elapsed_s: f64, stated: &[Transition; AXES]) -> [Transition; AXES] {
        let passed = self.passed(elapsed_s);
        // A gap is not how far apart readings are.
        let apart_s = elapsed_s.min(MOST_APART * self.between_s);
        self.between_s += (apart_s - self.between_s) / (1.0 + self.readings.min(BETWEEN_OVER));
        self.banks.iter_mut().zip(stated).for_each(|(bank, stated)| bank.predict(&passed, stated));
        std::array::from_fn(|axis| self.banks[axis].transition(&passed, &stated[axis]))
    }

    fn passed(&self, elapsed_s: f64) -> Passed {
        Passed::after(elapsed_s, self.readings * self.between_s, self.unit_s)
    }

    pub fn innovations(&self, value: &Vector6<f64>, variance: &Vector6<f64>) -> [Innovation; AXES] {
        std::array::from_fn(|axis| self.banks[axis].innovation(value[axis], variance[axis]))
    }

    /// A reading after a time beside what is expected of it; the banks stay.
    pub fn predicted(
        &self,
        elapsed_s: f64,
        stated: &[Transition; AXES],
        reading: &Whitened,
    ) -> [Innovation; AXES] {
        let passed = self.passed(elapsed_s);
        std::array::from_fn(|axis| {
            let (value, variance) = (reading.value[axis], reading.variance[axis]);
            self.banks[axis].predicted(&passed, &stated[axis], value, variance)
        })
    }

    /// Σ ν²/S of a reading after a time.
    pub fn surprise(&self, elapsed_s: f64, stated: &[Transition; AXES], reading: &Whitened) -> f64 {
        let square = |innovation: &Innovation| innovation.value * innovation.value / innovation.variance;
        self.predicted(elapsed_s, stated, reading).iter().map(square).sum()
    }

    pub fn update(
        &mut self,
        value: &Vector6<f64>,
        variance: &Vector6<f64>,
        innovations: &[Innovation; AXES],
    ) {
        self.readings += 1.0;
        let square = |of: &Innovation| of.value * of.value / of.variance;
        let squares: f64 = innovations.iter().map(square).sum();
        let log_volume: f64 = innovations.iter().map(|of| of.variance.ln()).sum();
        self.heavy += log_student(squares) - 0.5 * log_volume;
        for (axis, bank) in self.banks.iter_mut().enumerate() {
            let Innovation { value: nu, variance: s, .. } = innovations[axis];
            self.own[axis] -= 0.5 * (nu * nu / s + s.ln());
            read_grown(&mut self.grown, nu * nu / s, s.ln(), 1.0);
            bank.update(value[axis], variance[axis]);
        }
        self.bound_heavy();
    }

    /// What a model of heavy tails is behind by is bounded, as that of the others.
    fn bound_heavy(&mut self) {
        self.heavy = self.heavy.max(self.own.iter().sum::<f64>() - FURTHEST_BEHIND);
    }

    /// All logarithms of likelihoods as they are now: what an onset remembers of the readings before it.
    pub fn standing(&self) -> Vec<f64> {
        let mut standing = Vec::with_capacity(STANDING);
        standing.extend(self.own);
        standing.extend(self.grown);
        standing.push(self.heavy);
        standing.push(self.readings);
        standing.push(f64::from(u8::from(self.has_changed)));
        self.banks.iter().for_each(|bank| standing.extend(bank.log_likelihood));
        standing
    }

    /// ln ρ of an onset that remembers `then`.
    pub fn log_against(&self, then: &[f64]) -> f64 {
        if then.len() != STANDING {
            return 0.0;
        }
        let (mut own, mut best) = (0.0, 0.0);
        for axis in 0..AXES {
            let gained = self.own[axis] - then[axis];
            let at = MODELS_AT + axis * MODELS;
            let of_models = most_since(&self.banks[axis].log_likelihood, &then[at..at + MODELS]);
            own += gained;
            best += gained.max(of_models);
        }
        let between = BETWEEN * (self.readings - then[READINGS_AT]);
        let grown = most_grown(&self.grown, &then[GROWN_AT..HEAVY_AT]);
        // As the models: what the readings before the onset excluded had to make up for that.
        let least = then[..AXES].iter().sum::<f64>() - EXCLUDED;
        let heavy = self.heavy - then[HEAVY_AT].max(least);
        own - grown.max(best.max(heavy)) - between
    }

    /// Goes back to what the models were worth at an onset: what came after it was a motion, and says nothing of noise unless it comes back.
    pub fn set_aside(&mut self, then: &[f64]) {
        if then.len() != STANDING {
            return;
        }
        self.has_changed = then[CHANGED_AT] != 0.0;
        self.set_aside.resize(AXES * MODELS, 0.0);
        for (axis, bank) in self.banks.iter_mut().enumerate() {
            let at = axis * MODELS;
            let then = &then[MODELS_AT + at..MODELS_AT + at + MODELS];
            let aside = &mut self.set_aside[at..at + MODELS];
            aside
                .iter_mut()
                .zip(&bank.log_likelihood)
                .zip(then)
                .for_each(|((aside, now), then)| *aside += now - then);
            bank.set_log_likelihoods(then);
            bank.forget_refuted();
        }
    }

    /// It came back by itself: what seemed a motion was an error that lasted, and counts as one.
    pub fn came_back(&mut self) {
        let aside = std::mem::take(&mut self.set_aside);
        for (bank, aside) in self.banks.iter_mut().zip(aside.chunks_exact(MODELS)) {
            let sum: Vec<f64> =
                bank.log_likelihood.iter().zip(aside).map(|(now, aside)| now + aside).collect();
            bank.set_log_likelihoods(&sum);
        }
    }

    /// It is where it is to be.
    pub fn accept(&mut self) {
        self.set_aside.clear();
    }

    /// Mean and variance of the constant part of each coordinate.
    pub fn level(&self, axis: usize) -> (f64, f64) {
        self.banks[axis].level()
    }

    /// Variances of the readings over the stated ones.
    pub fn scales(&self) -> Vector6<f64> {
        Vector6::from_fn(|axis, _| self.banks[axis].scale())
    }

    /// What the noise is.
    pub fn noise(&self) -> MeasuredNoise {
        promise::noise(&self.banks, self.unit_s)
    }

    /// What is found within a time.
    pub fn detectable(&self, whitened_from_motion: &Matrix6<f64>, promise: &Promise) -> Detectable {
        let log_weight = (self.between_s / promise.period_s).max(1.0).ln();
        let own = Promise { log_threshold: promise.log_threshold - log_weight, ..*promise };
        promise::detectable(&self.banks, (self.unit_s, self.between_s()), whitened_from_motion, &own)
    }

    /// The time between readings, seconds.
    pub fn between_s(&self) -> f64 {
        self.between_s.max(1e-3)
    }

    /// The time that was watched, seconds.
    pub fn watched_s(&self) -> f64 {
        self.readings * self.between_s
    }

    /// Takes note of whether errors have changed, of a camera that is where it was: amid a motion nothing is known of that.
    pub fn note_change(&mut self) {
        self.has_changed |= self.banks.iter().any(AxisBank::has_changed);
    }

    /// Whether errors became such as the readings before them had refuted.
    pub fn has_changed(&self) -> bool {
        self.has_changed
    }

    /// Variances of the errors that last, where the readings show them.
    pub fn correlated_variances(&self) -> Vector6<f64> {
        Vector6::from_fn(|axis, _| self.banks[axis].correlated_variance(self.unit_s))
    }

    pub fn is_sound(&self) -> bool {
        let aside = self.set_aside.len();
        self.banks.iter().all(AxisBank::is_sound)
            && 0.0 < self.unit_s
            && 0.0 < self.between_s
            && (aside == 0 || aside == AXES * MODELS)
    }
}

/// ln of the density of Student's t of five degrees of freedom in six coordinates of variance one, over that of the normal one at its
/// centre, at a sum of squares: eq. (41).
fn log_student(squares: f64) -> f64 {
    /// ln Γ(11/2)/Γ(5/2) − 3 ln (5/2) − 3 ln (3/5).
    const AT_CENTRE: f64 = 2.456_735_8;
    AT_CENTRE - 5.5 * (squares / 3.0).ln_1p()
}

/// The most that a model has gained since an onset, of those that were not excluded before it and of those between grid points; one that
/// was excluded had to make up for that.
fn most_since(now: &[f64; MODELS], then: &[f64]) -> f64 {
    let best = models::best(then);
    let least = then[best] - EXCLUDED;
    let of_model = |model: usize| {
        now[model] - if model == models::STATED { then[model] } else { then[model].max(least) }
    };
    let of_grid = (0..MODELS).map(of_model).fold(f64::NEG_INFINITY, f64::max);
    let of_between = |between: models::Between| between.of(|model| now[model] - then[model]);
    models::between(best, then).map(of_between).fold(of_grid, f64::max)
}

numbers!(Measured { banks, unit_s, own, grown, heavy, readings, between_s, has_changed, set_aside });
