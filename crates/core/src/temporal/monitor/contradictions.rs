//! Do the readings contradict their stated noise? Said at the promised rate: single faults, and faults that come in runs, are no news.
//!
//! ```text
//!   q      chance that a reading contradicts, after one that did and after one that did not: learned from the readings so far
//!   ln L   ln (¼ + ¾/q) of a reading that contradicts, ln ¼ of one that does not           (100)
//!   R      (R + 1) L; said at R = A of the promised rate                                   (101)
//! ```
//! Derivation: docs/math/monitor.md section 14.

use super::log_sum::LogSum;
use crate::temporal::snapshot::numbers;

/// Of readings that would agree, the share that contradicts where readings are mostly wrong.
const MOSTLY: f64 = 0.75;
/// The share of all of them that contradicts again where all is well, and ln of the odds at which it is.
const SELDOM: f64 = 0.1;
const WELL: f64 = 6.9;
/// What is expected beforehand, and for how many readings that counts: after a reading that agrees and after one that contradicts.
const EXPECTED: [(f64, f64); 2] = [(0.01, 50.0), (0.3, 10.0)];
/// Faults come in runs, and of many points some are often off: up to this share it is no news.
const LARGEST: f64 = 0.8;
/// Readings over which the share is learned.
const LEARNED_OVER: f64 = 1000.0;

/// Whether they do, and what is known of single ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Contradictions {
    /// Chance and weight of it, after a reading that agrees and after one that contradicts.
    chance: [(f64, f64); 2],
    /// How many of the last readings did, without one between them that agrees.
    run: f64,
    /// ln R.
    log_r: f64,
    is_reported: bool,
    /// ln of the odds that all is well again.
    log_well: f64,
}

impl Contradictions {
    pub fn none() -> Self {
        Contradictions { chance: EXPECTED, run: 0.0, log_r: f64::MIN, is_reported: false, log_well: 0.0 }
    }

    /// Whether the readings contradict their stated noise.
    pub fn are_reported(&self) -> bool {
        self.is_reported
    }

    /// How many of the last readings do, without one between them that agrees.
    pub fn run(&self) -> f64 {
        self.run
    }

    pub fn push(&mut self, contradicts: bool, log_threshold: f64) {
        if self.is_reported {
            let well = if contradicts { SELDOM / MOSTLY } else { (1.0 - SELDOM) / (1.0 - MOSTLY) };
            self.log_well = (self.log_well + well.ln()).max(0.0);
            // Faults that come and go are reported once; then they are noise that is known.
            self.learn(contradicts);
            if WELL <= self.log_well {
                *self = Contradictions { chance: self.chance, ..Contradictions::none() };
            }
            return;
        }
        let (chance, _) = self.chance[usize::from(0.0 < self.run)];
        let others = 1.0 - MOSTLY;
        let ratio = if contradicts { others + MOSTLY / chance } else { others };
        self.log_r = LogSum::of([self.log_r, 0.0]).ln() + ratio.ln();
        if log_threshold <= self.log_r {
            (self.is_reported, self.log_well) = (true, 0.0);
            return;
        }
        self.learn(contradicts);
    }

    /// A run of contradictions counts once it has ended: while it lasts it may be the news.
    fn learn(&mut self, contradicts: bool) {
        match (contradicts, 0.0 < self.run) {
            (false, true) => self.count(1, self.run - 1.0, self.run),
            (_, true) => (),
            (_, false) => self.count(0, f64::from(u8::from(contradicts)), 1.0),
        }
        self.run = if contradicts { self.run + 1.0 } else { 0.0 };
    }

    /// Learns that of so many readings, each after one that agrees (0) or that contradicts (1), some contradicted.
    fn count(&mut self, after: usize, contradicted: f64, of: f64) {
        let (chance, weight) = &mut self.chance[after];
        *weight = (*weight + of).min(LEARNED_OVER);
        *chance = (*chance + (contradicted - of * *chance) / *weight).clamp(1e-3, LARGEST);
    }

    /// The share of the readings that contradict, in the long run.
    pub fn share(&self) -> f64 {
        let [(after_one_that_agrees, _), (after_one_that_contradicts, _)] = self.chance;
        after_one_that_agrees / (1.0 - after_one_that_contradicts + after_one_that_agrees)
    }

    pub fn is_sound(&self) -> bool {
        self.chance.iter().all(|(chance, weight)| 0.0 < *chance && *chance < 1.0 && 1.0 <= *weight)
            && 0.0 <= self.run
    }
}

numbers!(Contradictions { chance, run, log_r, is_reported, log_well });
