//! Noise that is measured, not believed: what the readings themselves say of their errors, and how far a change must explain them better than
//! any error that they have not excluded.
//!
//! ```text
//!   L̂     predictive density of the readings so far, by the models in use        L_θ  the same by one model θ of a coordinate
//!   ρ_k    Π_{s ≥ k} L̂ over the largest of L̂ and of the L_θ that were not excluded before the onset k; at most one
//!   R      Σ_k w_k Λ_k ρ_k: the ratio of each change to every error that is still possible
//! ```
//! Derivation: docs/math/monitor.md section 9.

use super::axis::{AxisNoise, Innovation, Transition};
use super::bank::{AxisBank, EXCLUDED, MODELS, decays};
use super::onsets::AXES;
use super::test::Whitened;
use crate::snapshot::numbers;
use nalgebra::Vector6;

/// Noise may have grown since an onset, in all coordinates at once: its variance by these factors.
const GROWN: [f64; 3] = [1.5, 3.0, 9.0];
/// Where the coordinates, the grown noise and the models stand in a standing.
const GROWN_AT: usize = AXES;
const MODELS_AT: usize = AXES + GROWN.len();
const STANDING: usize = MODELS_AT + AXES * MODELS;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Measured {
    banks: [AxisBank; AXES],
    /// Unit of the time constants, seconds.
    unit_s: f64,
    /// ln L̂ of each coordinate.
    own: [f64; AXES],
    /// The same of all, were the variances grown.
    grown: [f64; GROWN.len()],
}

impl Measured {
    pub fn new(noise: &[AxisNoise; AXES], typical: &Vector6<f64>, unit_s: f64) -> Self {
        Measured {
            banks: std::array::from_fn(|axis| AxisBank::new(&noise[axis], typical[axis])),
            unit_s,
            own: [0.0; AXES],
            grown: [0.0; GROWN.len()],
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

    pub fn forget_likelihoods(&mut self) {
        self.banks.iter_mut().for_each(|bank| bank.log_likelihood.fill(0.0));
    }

    pub fn predict(&mut self, elapsed_s: f64, stated: &[Transition; AXES]) {
        let decays = decays(elapsed_s, self.unit_s);
        self.banks.iter_mut().zip(stated).for_each(|(bank, stated)| bank.predict(&decays, stated));
    }

    /// Of the models in use, over a time that passes.
    pub fn transitions(&self, elapsed_s: f64, stated: &[Transition; AXES]) -> [Transition; AXES] {
        std::array::from_fn(|axis| self.banks[axis].transition(elapsed_s, self.unit_s, &stated[axis]))
    }

    pub fn innovations(&self, value: &Vector6<f64>, variance: &Vector6<f64>) -> [Innovation; AXES] {
        std::array::from_fn(|axis| self.banks[axis].innovation(value[axis], variance[axis]))
    }

    /// Σ ν²/S of a reading after a time; the banks stay.
    pub fn surprise(&self, elapsed_s: f64, stated: &[Transition; AXES], reading: &Whitened) -> f64 {
        let of_axis = |axis: usize| {
            let innovation = self.banks[axis].foreseen(
                elapsed_s,
                self.unit_s,
                &stated[axis],
                reading.value[axis],
                reading.variance[axis],
            );
            innovation.value * innovation.value / innovation.variance
        };
        (0..AXES).map(of_axis).sum()
    }

    pub fn update(&mut self, value: &Vector6<f64>, variance: &Vector6<f64>, innovations: &[Innovation; AXES]) {
        for (axis, bank) in self.banks.iter_mut().enumerate() {
            let Innovation { value: nu, variance: s, .. } = innovations[axis];
            self.own[axis] -= 0.5 * (nu * nu / s + s.ln());
            for (grown, factor) in self.grown.iter_mut().zip(GROWN) {
                *grown -= 0.5 * (nu * nu / (factor * s) + (factor * s).ln());
            }
            bank.update(value[axis], variance[axis]);
        }
    }

    /// All logarithms of likelihoods as they are now: what an onset remembers of the readings before it.
    pub fn standing(&self) -> Vec<f64> {
        let mut standing = Vec::with_capacity(STANDING);
        standing.extend(self.own);
        standing.extend(self.grown);
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
        let grown = self.grown.iter().zip(&then[GROWN_AT..]).map(|(now, then)| now - then);
        own - grown.fold(best, f64::max)
    }

    /// Goes back to what the models were worth at an onset: what came after it was a motion, and says nothing of noise.
    pub fn go_back(&mut self, then: &[f64]) {
        if then.len() != STANDING {
            return;
        }
        for (axis, bank) in self.banks.iter_mut().enumerate() {
            let at = MODELS_AT + axis * MODELS;
            bank.log_likelihood.copy_from_slice(&then[at..at + MODELS]);
        }
    }

    /// Mean and variance of the constant part of each coordinate.
    pub fn level(&self, axis: usize) -> (f64, f64) {
        self.banks[axis].level()
    }

    /// Variances of the readings over the stated ones.
    pub fn scales(&self) -> Vector6<f64> {
        Vector6::from_fn(|axis, _| self.banks[axis].scale())
    }

    pub fn banks(&self) -> &[AxisBank; AXES] {
        &self.banks
    }

    pub fn is_sound(&self) -> bool {
        self.banks.iter().all(AxisBank::is_sound) && 0.0 < self.unit_s
    }
}

/// The most that a model has gained since an onset, of those that were not excluded before it; one that was had to make up for that.
fn most_since(now: &[f64; MODELS], then: &[f64]) -> f64 {
    let least = then.iter().copied().fold(f64::NEG_INFINITY, f64::max) - EXCLUDED;
    let mut stated = f64::NEG_INFINITY;
    let mut most = f64::NEG_INFINITY;
    for (i, (now, then)) in now.iter().zip(then).enumerate() {
        most = most.max(now - then.max(least));
        if i == super::bank::STATED {
            stated = now - then;
        }
    }
    most.max(stated)
}

numbers!(Measured { banks, unit_s, own, grown });
