//! The course of a motion, from means of readings: at once, or slowly and at which rate.
//!
//! ```text
//!   ȳ_i  mean of the readings of block i at t_i     step: ȳ = m + δ [t ≥ k]      ramp: ȳ = m + ρ (t − k)⁺
//!   both have the unknowns m, δ or ρ, and k: what explains the blocks better is what happened, whatever the scale of the errors
//! ```
//! The alarm weighs the same two, but it must be early; this continues as readings come. docs/math/monitor.md eq. (48).

use super::priors::{GAP_SHARE, MotionKind};
use crate::temporal::snapshot::numbers;
use crate::{Matrix6, Vector6};
use arrayvec::ArrayVec;
use nalgebra::{Matrix3, Matrix3x6, Vector3};

/// Blocks kept; older ones are longer.
const BLOCKS: usize = 40;
/// Blocks after the onset of a ramp: fewer are a line in any case.
const LEAST_AFTER: usize = 8;
/// The part of a ramp that may be missing without being missed.
const EARLY: f64 = 0.1;
/// Δχ² by which a further step must explain the blocks better than a ramp does: six numbers and an onset of forty, by chance once in 10⁴.
const TWO: f64 = 38.3;

/// Mean of neighbouring readings.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Block {
    t_s: f64,
    /// From the pose of the reference.
    motion: Vector6,
    readings: f64,
    /// Of its first and last reading, seconds.
    from_s: f64,
    to_s: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Trace {
    blocks: Box<ArrayVec<Block, { BLOCKS + 1 }>>,
}

/// What explains the blocks, and by how much better than the other course.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fitted {
    pub course: MotionKind,
    /// χ² by which the other course fits worse, in units of what this one leaves per degree of freedom.
    pub lead: f64,
    pub onset_s: f64,
    pub onset_sigma_s: f64,
    /// ρ, a second, and its covariance; zero of a step.
    pub rate: Vector6,
    pub rate_covariance: Matrix6,
}

impl Trace {
    pub fn new() -> Self {
        Trace { blocks: Box::default() }
    }

    /// `onset_s`: a change that must not be lost within a block.
    pub fn push(&mut self, t_s: f64, motion: &Vector6, onset_s: Option<f64>) {
        if self.blocks.len() == BLOCKS {
            self.merge(t_s, onset_s.unwrap_or(f64::INFINITY));
        }
        self.blocks.push(Block { t_s, motion: *motion, readings: 1.0, from_s: t_s, to_s: t_s });
    }

    /// What came before that belongs to an earlier motion.
    pub fn forget_before(&mut self, t_s: f64) {
        self.blocks.retain(|block| t_s <= block.t_s);
    }

    /// Whether its means are of readings: numbers of a file may be any.
    pub fn is_sound(&self) -> bool {
        self.blocks.iter().all(|block| 1.0 <= block.readings)
    }

    /// Joins the neighbours that lie closest for their age.
    fn merge(&mut self, now_s: f64, onset_s: f64) {
        let closeness = |i: &usize| {
            let (a, b) = (&self.blocks[*i], &self.blocks[i + 1]);
            let is_apart = a.from_s < onset_s && onset_s <= b.to_s;
            let closeness = (b.to_s - a.from_s) / (now_s - a.from_s).max(f64::MIN_POSITIVE);
            if is_apart { f64::INFINITY } else { closeness }
        };
        let first = (0..self.blocks.len() - 2).min_by(|a, b| closeness(a).total_cmp(&closeness(b)));
        let Some(first) = first else { return };
        let later = self.blocks.remove(first + 1);
        let block = &mut self.blocks[first];
        let readings = block.readings + later.readings;
        let share = later.readings / readings;
        block.motion += share * (later.motion - block.motion);
        block.t_s += share * (later.t_s - block.t_s);
        (block.readings, block.to_s) = (readings, later.to_s);
    }

    /// The better of both courses; none where a further step amid it explains the blocks better than one motion does. `covariance` of one reading gives the coordinates their weights, `correlated` is the share of it that no mean
    /// takes away. None where there are too few blocks besides.
    pub fn fitted(&self, covariance: &Matrix6, correlated: f64) -> Option<Fitted> {
        let weight = covariance.cholesky()?.inverse();
        let own = |block: &Block| 1.0 / ((1.0 - correlated) / block.readings + correlated);
        let weights: ArrayVec<f64, { BLOCKS + 1 }> = self.blocks.iter().map(own).collect();
        let fits = |course| {
            let after = if course == MotionKind::Ramp { LEAST_AFTER } else { 1 };
            let last = self.blocks.len().saturating_sub(after);
            let is_seen = move |first: &usize| course == MotionKind::Step || !self.is_in_gap(*first);
            (1..=last.min(self.blocks.len().saturating_sub(1)))
                .filter(is_seen)
                .map(move |first| (course, first))
        };
        let fit = |(course, first): (MotionKind, usize)| self.fit(course, first, &weights, &weight);
        let best = |course| -> Option<(Fit, f64)> {
            let all: Vec<Fit> = fits(course).filter_map(fit).collect();
            let best = *all.iter().min_by(|a, b| a.chi2.total_cmp(&b.chi2))?;
            let scale = (best.chi2 / self.degrees()).max(1e-12);
            let odds = |fit: &Fit| (-0.5 * (fit.chi2 - best.chi2) / scale).exp();
            let total: f64 = all.iter().map(odds).sum();
            let away = |fit: &Fit| odds(fit) * (fit.onset_s - best.onset_s).powi(2);
            let spread_s = (all.iter().map(away).sum::<f64>() / total).sqrt();
            Some((best, spread_s.hypot(best.interval_s)))
        };
        let (step, ramp) = (best(MotionKind::Step)?, best(MotionKind::Ramp)?);
        let is_ramp = ramp.0.chi2 < step.0.chi2;
        let ((fit, onset_sigma_s), other) = if is_ramp { (ramp, step.0) } else { (step, ramp.0) };
        if is_ramp && self.are_two([&fit, &step.0], &weights, &weight) {
            return None;
        }
        let scale = (fit.chi2 / self.degrees()).max(1e-12);
        Some(Fitted {
            course: if is_ramp { MotionKind::Ramp } else { MotionKind::Step },
            lead: (other.chi2 - fit.chi2) / scale,
            onset_s: fit.onset_s,
            onset_sigma_s,
            rate: if is_ramp { fit.size } else { Vector6::zeros() },
            rate_covariance: if is_ramp { covariance * (scale * fit.variance) } else { Matrix6::zeros() },
        })
    }

    /// Mean of what was read within `over_s` of the last reading, one block at least: time, motion and readings.
    pub fn end(&self, over_s: f64) -> Option<(f64, Vector6, f64)> {
        let last_s = self.blocks.last()?.to_s;
        let mut readings = 0.0;
        let (mut t_s, mut motion) = (0.0, Vector6::zeros());
        for block in self.blocks.iter().rev().take_while(|block| last_s - over_s <= block.from_s) {
            readings += block.readings;
            t_s += block.readings * block.t_s;
            motion += block.readings * block.motion;
        }
        (0.0 < readings).then(|| (t_s / readings, motion / readings, readings))
    }

    /// Whether nothing was read for most of the time since block `first`: what happened in a gap looks the same whether it went on or not.
    fn is_in_gap(&self, first: usize) -> bool {
        let onset_s = self.blocks[first - 1].to_s;
        let gap_s = |pair: &[Block]| pair[1].from_s - pair[0].to_s;
        let longest_s = self.blocks[first - 1..].windows(2).map(gap_s).fold(0.0, f64::max);
        GAP_SHARE * (self.blocks[self.blocks.len() - 1].to_s - onset_s) < longest_s
    }

    fn degrees(&self) -> f64 {
        (6.0 * (self.blocks.len() as f64 - 2.0) - 1.0).max(1.0)
    }

    /// How long before block `first` nothing was read, seconds. A ramp of which little is before a gap may have begun in that.
    fn interval_s(&self, course: MotionKind, first: usize) -> f64 {
        let (from_s, last_s) = (self.blocks[first - 1].to_s, self.blocks[self.blocks.len() - 1].t_s);
        let early_s = if course == MotionKind::Ramp { from_s + EARLY * (last_s - from_s) } else { from_s };
        let pairs = self.blocks[first - 1..].windows(2).take_while(|pair| pair[0].to_s <= early_s);
        let gaps = pairs.map(|pair| pair[1].from_s - pair[0].to_s);
        gaps.fold(self.blocks[first].t_s - self.blocks[first - 1].t_s, f64::max)
    }

    /// Whether a step after a ramp, or after a step, explains the blocks much better than the ramp alone.
    fn are_two(&self, [ramp, step]: [&Fit; 2], weights: &[f64], weight: &Matrix6) -> bool {
        let firsts = 1..self.blocks.len();
        let with_step = |course, onset_s: f64| {
            let of = |first: usize| self.left_by_two((course, onset_s), first, weights, weight);
            firsts.clone().filter_map(of).fold(f64::INFINITY, f64::min)
        };
        let least = with_step(MotionKind::Ramp, ramp.onset_s).min(with_step(MotionKind::Step, step.onset_s));
        // Where older blocks err by less than is stated, the last ones need not.
        TWO * (least / self.degrees()).max(1.0) < ramp.chi2 - least
    }

    /// χ² that a motion and a step before block `first` leave.
    fn left_by_two(
        &self,
        (course, onset_s): (MotionKind, f64),
        first: usize,
        weights: &[f64],
        weight: &Matrix6,
    ) -> Option<f64> {
        let shapes = |(i, block): (usize, &Block)| {
            Vector3::new(1.0, shape(course, onset_s, block), f64::from(u8::from(first <= i)))
        };
        let (mut normal, mut right) = (Matrix3::zeros(), Matrix3x6::zeros());
        for ((i, block), own) in self.blocks.iter().enumerate().zip(weights) {
            let x = shapes((i, block));
            normal += x * x.transpose() * *own;
            right += x * block.motion.transpose() * *own;
        }
        let sizes = normal.cholesky()?.solve(&right);
        let left = |((i, block), own): ((usize, &Block), &f64)| {
            let residual = block.motion - sizes.transpose() * shapes((i, block));
            own * residual.dot(&(weight * residual))
        };
        Some(self.blocks.iter().enumerate().zip(weights).map(left).sum())
    }

    /// With the onset before block `first`: weighted least squares of the mean and the size.
    fn fit(&self, course: MotionKind, first: usize, weights: &[f64], weight: &Matrix6) -> Option<Fit> {
        let onset_s = 0.5 * (self.blocks[first - 1].to_s + self.blocks[first].from_s);
        let shape = |block: &Block| shape(course, onset_s, block);
        let (mut w, mut wx, mut wxx) = (0.0, 0.0, 0.0);
        let (mut wy, mut wxy) = (Vector6::zeros(), Vector6::zeros());
        for (block, own) in self.blocks.iter().zip(weights) {
            let x = shape(block);
            (w, wx, wxx) = (w + own, wx + own * x, wxx + own * x * x);
            wy += *own * block.motion;
            wxy += *own * x * block.motion;
        }
        let information = wxx - wx * wx / w;
        if !(1e-12 * wxx < information) {
            return None;
        }
        let size = (wxy - wy * (wx / w)) / information;
        let mean = (wy - size * wx) / w;
        let left = |(block, own): (&Block, &f64)| {
            let residual = block.motion - mean - size * shape(block);
            own * residual.dot(&(weight * residual))
        };
        let chi2 = self.blocks.iter().zip(weights).map(left).sum();
        let interval_s = self.interval_s(course, first);
        Some(Fit { onset_s, interval_s, size, variance: 1.0 / information, chi2 })
    }
}

/// What a motion of one, or of one a second, is at a block.
fn shape(course: MotionKind, onset_s: f64, block: &Block) -> f64 {
    match course {
        MotionKind::Step => f64::from(u8::from(onset_s < block.t_s)),
        MotionKind::Ramp => (block.t_s - onset_s).max(0.0),
    }
}

#[derive(Debug, Clone, Copy)]
struct Fit {
    onset_s: f64,
    /// Between the blocks before and after the onset, seconds: no sharper is it known, docs/math/monitor.md eq. (80).
    interval_s: f64,
    size: Vector6,
    /// Of the size, in units of a reading's.
    variance: f64,
    chi2: f64,
}

numbers!(Block { t_s, motion, readings, from_s, to_s });
numbers!(Trace { blocks });
