//! How much readings scatter, beside what the noise model says: the Allan variance, from one decision to hours.
//!
//! ```text
//!   ȳ_k  mean of the k-th block of 2ʲ decisions       d_k = ȳ_{k+1} − ȳ_k, whitened coordinates, one at a time
//!   v_k  what the model makes the variance of d_k     u_k = d_k/√v_k: of variance one where the model is right
//! ```
//! A step is in one difference of each length, a ramp in the mean of all: neither makes errors look larger. Correlated errors longer than
//! was learned, or are larger, do. docs/math/monitor.md eqs. (46)–(47).

use super::axis::{AXES, AxisNoise, Whitened};
use crate::statistics::chi_square::quick_quantile;
use crate::temporal::snapshot::numbers;
use arrayvec::ArrayVec;
use nalgebra::Vector6;

/// Lengths of blocks: 2⁰ to 2¹⁵ decisions.
const OCTAVES: usize = 16;
/// Differences over which a scatter is taken; older ones are forgotten.
const OVER: f64 = 64.0;
/// A difference counts as no larger than this many times what is usual: a step is no scatter.
const USUAL: f64 = 10.0;
/// Least differences of a block's length.
const LEAST: f64 = 4.0;
/// An excess smaller than this is none: no model is that exact.
pub(super) const NEGLIGIBLE: f64 = 1.2;
/// Neighbouring differences share a block: they are worth this share of independent ones.
const INDEPENDENT: f64 = 0.6;
/// One scatter in ten thousand of a right model seems this many standard deviations too large.
const ONE_IN_10_000: f64 = 3.72;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Block {
    /// Middle, seconds.
    t_s: f64,
    value: Vector6<f64>,
    /// Variance of its white errors.
    white: Vector6<f64>,
}

/// The last differences say nothing yet: the change that an alarm is about may be in them.
const HELD: usize = 1;

/// A difference in units of what is expected of it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Difference {
    u: Vector6<f64>,
    expected: Vector6<f64>,
    apart_s: f64,
}

/// Blocks of one length.
#[derive(Debug, Clone, PartialEq, Default)]
struct Octave {
    /// The last block, for the next difference; and the first half of the next longer one.
    last: Option<Block>,
    half: Option<Block>,
    held: ArrayVec<Difference, { HELD + 1 }>,
    /// Differences so far, at most `OVER`; mean and mean square of u.
    n: f64,
    mean: Vector6<f64>,
    square: Vector6<f64>,
    /// Mean of v, and of the time between the middles of neighbours, seconds.
    expected: Vector6<f64>,
    apart_s: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Scatter {
    octaves: Box<ArrayVec<Octave, OCTAVES>>,
}

/// By how much the errors exceed the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Excess {
    /// Variance over the model's, with confidence; one at least.
    pub factor: f64,
    /// Time over which it was seen, seconds.
    pub over_s: f64,
    /// Variance of differences over that time, beyond the model's.
    pub variance: Vector6<f64>,
}

impl Scatter {
    pub fn new() -> Self {
        Scatter { octaves: Box::default() }
    }

    pub fn push(&mut self, t_s: f64, reading: &Whitened, noise: &[AxisNoise; AXES]) {
        let mut next = Some(Block { t_s, value: reading.value, white: reading.variance });
        for octave in 0..OCTAVES {
            let Some(block) = next else { return };
            if self.octaves.len() == octave {
                self.octaves.push(Octave::default());
            }
            next = self.octaves[octave].push(block, noise);
        }
    }

    /// The level it is read against has changed: differences across that are none.
    pub fn interrupt(&mut self) {
        self.octaves.iter_mut().for_each(|octave| (octave.last, octave.half) = (None, None));
    }

    /// The largest excess over times up to `longest_s`; none where the model holds.
    pub fn excess(&self, longest_s: f64) -> Option<Excess> {
        let seen = self.octaves.iter().filter(|octave| LEAST <= octave.n && octave.apart_s <= longest_s);
        let all = seen.map(Octave::excess);
        all.max_by(|a, b| a.factor.total_cmp(&b.factor)).filter(|excess| NEGLIGIBLE < excess.factor)
    }
}

impl Octave {
    /// Takes in a block of this length; the longer one that it completes.
    fn push(&mut self, block: Block, noise: &[AxisNoise; AXES]) -> Option<Block> {
        if let Some(last) = self.last.replace(block) {
            self.difference(&last, &block, noise);
        }
        let first = self.half.take();
        if first.is_none() {
            self.half = Some(block);
        }
        first.map(|first| Block {
            t_s: 0.5 * (first.t_s + block.t_s),
            value: 0.5 * (first.value + block.value),
            white: 0.25 * (first.white + block.white),
        })
    }

    fn difference(&mut self, last: &Block, block: &Block, noise: &[AxisNoise; AXES]) {
        let apart_s = (block.t_s - last.t_s).max(f64::MIN_POSITIVE);
        let expected = Vector6::from_fn(|axis, _| {
            last.white[axis] + block.white[axis] + correlated_difference(&noise[axis], apart_s)
        });
        let u = (block.value - last.value).component_div(&expected.map(f64::sqrt));
        self.held.push(Difference { u, expected, apart_s });
        if HELD < self.held.len() {
            let counts = self.held.remove(0);
            self.count(&counts);
        }
    }

    fn count(&mut self, Difference { u, expected, apart_s }: &Difference) {
        self.n = (self.n + 1.0).min(OVER);
        let share = 1.0 / self.n;
        for axis in 0..AXES {
            let usual = (USUAL * self.square[axis].max(1.0)).sqrt();
            let u = if u[axis].is_finite() { u[axis].clamp(-usual, usual) } else { 0.0 };
            self.mean[axis] += share * (u - self.mean[axis]);
            self.square[axis] += share * (u * u - self.square[axis]);
        }
        self.expected += share * (expected - self.expected);
        self.apart_s += share * (apart_s - self.apart_s);
    }

    /// Of the coordinate that exceeds most, or of all together.
    fn excess(&self) -> Excess {
        let of_sample = self.n / (self.n - 1.0);
        let ratios = (self.square - self.mean.component_mul(&self.mean)) * of_sample;
        let degrees = INDEPENDENT * (self.n - 1.0);
        let of_one = ratios.max() * surely(degrees);
        let of_all = ratios.mean() * surely(AXES as f64 * degrees);
        let beyond = ratios.map(|ratio| (ratio - 1.0).max(0.0));
        Excess {
            factor: of_one.max(of_all).max(1.0),
            over_s: self.apart_s,
            variance: beyond.component_mul(&self.expected),
        }
    }
}

/// What correlated errors and the diurnal variation of a day add to the variance of the difference of two neighbouring means, each over `apart_s`.
fn correlated_difference(noise: &AxisNoise, apart_s: f64) -> f64 {
    let x = apart_s / noise.bias_time_s;
    // Twice the variance of a mean less the covariance of two; for short times the two nearly cancel, and a series is exact.
    let shape = if x < 1e-3 {
        4.0 * x / 3.0
    } else {
        let lost = -(-x).exp_m1();
        2.0 * (2.0 * (x - lost) - lost * lost) / (x * x)
    };
    let angle = std::f64::consts::TAU * apart_s / super::axis::DAY_S;
    noise.bias_sigma.powi(2) * shape + 2.0 * noise.diurnal_sigma.powi(2) * (1.0 - angle.cos())
}

/// What a variance of so many degrees of freedom is at least, as a share of what it seems.
pub(super) fn surely(degrees: f64) -> f64 {
    degrees / quick_quantile(degrees, ONE_IN_10_000)
}

numbers!(Block { t_s, value, white });
numbers!(Difference { u, expected, apart_s });
numbers!(Octave { last, half, held, n, mean, square, expected, apart_s });
numbers!(Scatter { octaves });
numbers!(Excess { factor, over_s, variance });
