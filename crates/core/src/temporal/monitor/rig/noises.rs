//! The measured noise of a rig's observations: its scale, and how far errors alone look like a motion.
//!
//! ```text
//!   s²     νᵀS⁻¹ν of each frame_set over its degrees of freedom, of the last frame_sets
//!   ρ_k    L̂ since the onset k over the same likelihood with noise that grew there; at most one
//!   f²_T   mean of c²/d, what blocks of T frame_sets seemed to say of a motion while there was none: one if the errors are as learned
//! ```
//! Derivation: docs/math/monitor.md section 7.

use super::RigReference;
use super::evidence::{Gathered, Then};
use super::filter::{Innovation, Propagated, RigFilter};
use crate::temporal::monitor::priors::{self, BETWEEN, GROWN, SCALE_OVER, most_grown, read_grown};
use crate::temporal::snapshot::numbers;
use crate::{Matrix6, Vector6};

/// How many frame sets the learned scale counts for.
const LEARNED_COUNTS: f64 = 20.0;
/// νᵀS⁻¹ν counts up to so many standard deviations beyond its mean.
const LARGEST: f64 = 6.0;
/// Lengths of blocks, in frame sets.
const LENGTHS: [u32; 5] = [4, 16, 64, 256, 1024];
/// Blocks over which f² is measured, and how many what shorter blocks said counts for.
const BLOCKS_OVER: f64 = 100.0;
const PRESUMED_COUNTS: f64 = 4.0;
/// A block counts for so many times the mean at most: the one with a step says little.
const LARGEST_BLOCK: f64 = 5.0;
/// f² of white noise as learned reaches this by chance.
const BY_CHANCE: f64 = 1.25;
/// Errors that do not change at all within a block of a length grow by this from it to the next.
const FASTEST: f64 = 4.0;
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Noises {
    filter: RigFilter,
    /// s².
    scale: f64,
    /// ln L̂, and the same were the noise grown.
    own: f64,
    grown: [f64; GROWN.len()],
    frame_sets: f64,
    /// One of each length.
    blocks: Vec<Block>,
}

/// What a block of frame sets says of motions, and what those before it said on the average.
#[derive(Debug, Clone, PartialEq)]
struct Block {
    frame_sets: u32,
    gathered: Gathered,
    /// Of each camera: mean of c²/d over its coordinates, and of how many blocks.
    means: Vec<f64>,
    counts: Vec<f64>,
}

impl Noises {
    pub fn new(reference: &RigReference) -> Self {
        let RigReference { cam_from_rig, covariance, noise } = reference;
        Noises::of_learned(RigFilter::new(cam_from_rig, covariance, noise), cam_from_rig.len())
    }

    /// Of a filter that believes its noise.
    pub fn of_learned(filter: RigFilter, cameras: usize) -> Self {
        let block = || Block {
            frame_sets: 0,
            gathered: Gathered::of_jumps(cameras),
            means: vec![0.0; cameras],
            counts: vec![0.0; cameras],
        };
        Noises {
            filter,
            scale: 1.0,
            own: 0.0,
            grown: [0.0; GROWN.len()],
            frame_sets: 0.0,
            blocks: LENGTHS.iter().map(|_| block()).collect(),
        }
    }

    /// From here on a filter around other places; what is known of the noise stays. Blocks that have begun were of a motion.
    pub fn begin(&mut self, filter: RigFilter) {
        let cameras = self.blocks.first().map_or(0, |block| block.means.len());
        self.filter = filter;
        for block in &mut self.blocks {
            (block.frame_sets, block.gathered) = (0, Gathered::of_jumps(cameras));
        }
    }

    /// The filter carried to a time, and how far.
    pub fn ahead(&self, t_s: f64) -> (RigFilter, Propagated) {
        let mut filter = self.filter.clone();
        let carried = filter.predict(t_s);
        (filter, carried)
    }

    /// The filter and s², which is never below one: of few frame sets a little more noise is learned than there seems to be.
    pub fn filter(&self) -> (&RigFilter, f64) {
        (&self.filter, self.scale.max(1.0))
    }

    /// A frame set is read with the filter `ahead` that was carried to it.
    pub fn read(&mut self, ahead: RigFilter, carried: &Propagated, innovation: &Innovation) {
        self.filter = ahead;
        self.filter.update(innovation);
        self.frame_sets += 1.0;
        let forgets = 1.0 / (self.frame_sets.min(SCALE_OVER) + LEARNED_COUNTS);
        let (n, chi2) = (innovation.degrees_of_freedom() as f64, innovation.chi2());
        let log_volume = innovation.log_volume();
        self.own -= 0.5 * (chi2 + log_volume);
        read_grown(&mut self.grown, chi2, log_volume, n);
        // S is of the scale as it is used.
        let cut = (chi2 * self.scale.max(1.0) / self.scale).min(n + LARGEST * (2.0 * n).sqrt());
        self.scale = (self.scale * (1.0 + forgets * (cut / n - 1.0))).max(1e-9);
        let presumed = self.factors();
        for ((block, length), presumed) in self.blocks.iter_mut().zip(LENGTHS).zip(&presumed) {
            block.gathered.predict(carried);
            block.gathered.add(innovation);
            block.frame_sets += 1;
            if length <= block.frame_sets {
                block.end(presumed);
            }
        }
    }

    /// What an onset remembers of the frame sets before it.
    pub fn then(&self) -> Then {
        Then { own: self.own, grown: self.grown, frame_sets: self.frame_sets }
    }

    /// ln ρ of an onset.
    pub fn log_against(&self, then: &Then) -> f64 {
        let own = self.own - then.own;
        own - most_grown(&self.grown, &then.grown).max(own) - BETWEEN * (self.frame_sets - then.frame_sets)
    }

    /// ln R as far as errors like those so far do not explain it, of a change since `then`.
    pub fn deflated(&self, log_r: f64, then: &Then) -> f64 {
        let since = self.frame_sets - then.frame_sets;
        priors::deflated(log_r, self.factor(since))
    }

    /// The largest f² of blocks that are no longer than a few times so many frame sets.
    fn factor(&self, frame_sets: f64) -> f64 {
        let mut largest: f64 = 1.0;
        for (factors, length) in self.factors().iter().zip(LENGTHS) {
            largest = factors.iter().map(|factor| factor / BY_CHANCE).fold(largest, f64::max);
            if 2.0 * frame_sets < f64::from(length) {
                break;
            }
        }
        largest
    }

    /// f² of each length and camera. Of lengths of which there are few blocks yet it is presumed to grow as it did from the length before to
    /// the one before that: correlated errors do not end where the record does.
    fn factors(&self) -> Vec<Vec<f64>> {
        let cameras = self.blocks.first().map_or(0, |block| block.means.len());
        let (mut before, mut all) = (vec![1.0; cameras], Vec::new());
        let mut presumed = vec![1.0; cameras];
        for block in &self.blocks {
            let factors = block.factors(&presumed);
            let grown = |(now, before): (&f64, &f64)| match now / before {
                growth if growth < BY_CHANCE => *now,
                growth => now * growth.min(FASTEST),
            };
            presumed = factors.iter().zip(&before).map(grown).collect();
            before.clone_from(&factors);
            all.push(factors);
        }
        all
    }

    /// Mean and covariance of m of a camera; not smaller than stated where observations scatter by less.
    pub fn level(&self, camera: usize) -> (Vector6, Matrix6) {
        let (mean, covariance) = self.filter.level(camera);
        (mean, covariance * self.scale.max(1.0))
    }

    /// Whether it is such as a rig of this many cameras makes: numbers of a file may be any.
    pub fn is_sound(&self, cameras: usize) -> bool {
        let is_sound = |block: &Block| {
            block.gathered.is_sound(cameras)
                && [block.means.len(), block.counts.len()] == [cameras; 2]
                && block.means.iter().chain(&block.counts).all(|number| 0.0 <= *number)
        };
        self.filter.is_sound(cameras)
            && 0.0 < self.scale
            && 0.0 <= self.frame_sets
            && self.blocks.len() == LENGTHS.len()
            && self.blocks.iter().all(is_sound)
    }
}

impl Block {
    /// Takes in what its frame sets said, and begins anew.
    fn end(&mut self, presumed: &[f64]) {
        let factors = self.factors(presumed);
        for (camera, factor) in factors.iter().enumerate() {
            let Some(said) = self.gathered.mean_square(camera) else { continue };
            let count = &mut self.counts[camera];
            *count = (*count + 1.0).min(BLOCKS_OVER);
            self.means[camera] += (said.min(LARGEST_BLOCK * factor) - self.means[camera]) / *count;
        }
        (self.frame_sets, self.gathered) = (0, Gathered::of_jumps(self.means.len()));
    }

    /// f² of each camera: where there are few blocks yet, about as large as that of shorter ones.
    fn factors(&self, presumed: &[f64]) -> Vec<f64> {
        let measured = self.means.iter().zip(&self.counts).zip(presumed);
        let factor = |((mean, count), presumed): ((&f64, &f64), &f64)| {
            (mean * count + presumed * PRESUMED_COUNTS) / (count + PRESUMED_COUNTS)
        };
        measured.map(factor).collect()
    }
}

numbers!(Block { frame_sets, gathered, means, counts });
numbers!(Noises { filter, scale, own, grown, frame_sets, blocks });
