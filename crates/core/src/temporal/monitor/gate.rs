//! The readings that reach the test: those of one decision joined, single outliers held back until others confirm them.
//!
//! A flipped pose or a passing person is far from the expected reading and alone; a camera that moved suddenly is far and stays there. An outlier
//! therefore waits until `CONFIRM` readings in a row, over a decision period at least, agree with each other, and is dropped when the next
//! ones are where they were.

use super::axis::Whitened;
use super::priors::CONFIRM;
use super::test::{DriftTest, SURPRISE};
use crate::temporal::snapshot::numbers;
use arrayvec::ArrayVec;
use nalgebra::Vector6;

/// Of a period: times are rounded.
const ROUNDING: f64 = 1.0 - 1e-6;

/// A reading on its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Passed {
    pub t_s: f64,
    pub reading: Whitened,
}

/// Sums of the readings of one decision, weighted by their information.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Joining {
    last_s: f64,
    readings: u32,
    information: Vector6<f64>,
    weighted: Vector6<f64>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Gate {
    period_s: f64,
    last_decision_s: f64,
    joining: Joining,
    waiting: ArrayVec<Passed, CONFIRM>,
    /// The position at which outliers were confirmed; readings there pass.
    confirmed: Option<Whitened>,
}

/// As many as one reading can let through: those that waited, after the decision before them.
pub(super) type Through = ArrayVec<Passed, { CONFIRM + 1 }>;

impl Gate {
    pub fn new(period_s: f64) -> Self {
        Gate {
            period_s,
            last_decision_s: f64::MIN,
            joining: Joining::default(),
            waiting: ArrayVec::new(),
            confirmed: None,
        }
    }

    /// Whether an outlier waits for others.
    pub fn is_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Processes a reading; returns the readings for the test, and how many outliers are dropped.
    pub fn push(&mut self, test: &DriftTest, t_s: f64, reading: &Whitened) -> (Through, u64) {
        let mut through = Through::new();
        let here = Passed { t_s, reading: *reading };
        let is_expected = test.surprise(t_s, reading) < SURPRISE;
        if is_expected || self.confirmed.is_some_and(|at| agree(test, &at, reading)) {
            let dropped = self.waiting.len() as u64;
            self.waiting.clear();
            self.join(&here, &mut through);
            return (through, dropped);
        }
        let mut dropped = 0;
        if self.waiting.last().is_some_and(|last| !agree(test, &last.reading, reading)) {
            dropped = self.waiting.len() as u64;
            self.waiting.clear();
        }
        // Half an oscillation of a mount that vibrates is three images too: those that confirm must span a decision.
        let is_short = self.waiting.first().is_some_and(|first| t_s < first.t_s + ROUNDING * self.period_s);
        if self.waiting.len() + 1 == CONFIRM && is_short {
            self.waiting.pop();
        }
        self.waiting.push(here);
        if self.waiting.is_full() {
            self.confirmed = Some(*reading);
            self.decide(&mut through);
            through.extend(self.waiting.drain(..));
        }
        (through, dropped)
    }

    /// Adds a reading; a decision is due when a period has passed since the last one.
    fn join(&mut self, here: &Passed, through: &mut Through) {
        let information = here.reading.variance.map(|v| 1.0 / v);
        self.joining.readings += 1;
        self.joining.information += information;
        self.joining.weighted += information.component_mul(&here.reading.value);
        self.joining.last_s = here.t_s;
        if self.last_decision_s + self.period_s <= here.t_s {
            self.decide(through);
        }
    }

    fn decide(&mut self, through: &mut Through) {
        let joining = std::mem::take(&mut self.joining);
        if 0 < joining.readings {
            self.last_decision_s = joining.last_s;
            through.push(joining.done());
        }
    }
}

impl Joining {
    fn done(&self) -> Passed {
        let variance = self.information.map(|i| 1.0 / i);
        Passed {
            t_s: self.last_s,
            reading: Whitened { value: self.weighted.component_mul(&variance), variance },
        }
    }
}

/// Whether two readings can be of one pose: correlated errors do not count between neighbours.
fn agree(test: &DriftTest, a: &Whitened, b: &Whitened) -> bool {
    let difference = a.value - b.value;
    let variance = (a.variance + b.variance).component_mul(&test.scales());
    let chi2: f64 = (0..6).map(|axis| difference[axis].powi(2) / variance[axis]).sum();
    chi2 < SURPRISE
}

numbers!(Passed { t_s, reading });
numbers!(Joining { last_s, readings, information, weighted });
numbers!(Gate { period_s, last_decision_s, joining, waiting, confirmed });
