//! Noise that comes and goes: which models of a coordinate's errors its readings have needed in the last days.
//!
//! Nights, rain and infrared filters have errors of their own, and by day the record excludes them. A model that was needed stays possible for
//! some days: an error that comes back has nothing to make up for. Derivation: docs/math/monitor.md section 14, eq. (104).

use super::axis::DAY_S;
use super::models::{EXCLUDED, MODELS, WHITE};
use crate::temporal::snapshot::numbers;

/// How far behind the best model one falls at most, nats: errors that come for the first time are recognised within minutes.
pub(super) const FURTHEST_BEHIND: f64 = 60.0;
/// Readings that must have needed a model: those of a step are fewer.
const NEEDED: f64 = 60.0;
/// Models as good as the best one, nats.
const AS_GOOD: f64 = 2.0;
/// How long a model stays possible, and after which time it is as any other, seconds.
const KEPT_S: f64 = 2.0 * DAY_S;
const FORGOTTEN_S: f64 = 4.0 * DAY_S;

/// What is remembered of each model.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Memory {
    /// Readings that needed it, in a row but for as many that did not.
    needed: [f64; MODELS],
    /// Time since it was needed, seconds.
    since_s: [f64; MODELS],
}

impl Memory {
    pub fn none() -> Self {
        Memory { needed: [0.0; MODELS], since_s: [FORGOTTEN_S; MODELS] }
    }

    pub fn pass(&mut self, elapsed_s: f64) {
        self.since_s.iter_mut().for_each(|since_s| *since_s = (*since_s + elapsed_s).min(FORGOTTEN_S));
    }

    /// One reading on: models are needed where white noise is excluded beside them.
    pub fn note(&mut self, log_likelihood: &[f64; MODELS], most: f64) {
        let is_white_excluded = log_likelihood[WHITE] < most - EXCLUDED;
        for (model, log) in log_likelihood.iter().enumerate() {
            let is_needed = is_white_excluded && most - AS_GOOD < *log;
            let by = if is_needed { 1.0 } else { -1.0 };
            self.needed[model] = (self.needed[model] + by).clamp(0.0, 2.0 * NEEDED);
            if is_needed && NEEDED <= self.needed[model] {
                self.since_s[model] = 0.0;
            }
        }
    }

    /// What the readings of a motion needed says nothing of noise.
    pub fn set_aside(&mut self) {
        self.needed.fill(0.0);
    }

    /// How far behind the best model this one falls at most, nats.
    pub fn furthest_behind(&self, model: usize) -> f64 {
        let forgotten = ((self.since_s[model] - KEPT_S) / (FORGOTTEN_S - KEPT_S)).clamp(0.0, 1.0);
        EXCLUDED + forgotten * (FURTHEST_BEHIND - EXCLUDED)
    }
}

numbers!(Memory { needed, since_s });
