//! Seeded chance: a small generator, and an order of the points that does not depend on the order of the rows.

use crate::Correspondence;

/// SplitMix64 (Steele, Lea and Flood 2014): 64 bits of state, equidistributed, four operations a number.
#[derive(Debug, Clone)]
pub(crate) struct Chance {
    state: u64,
}

const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;

/// The finaliser of SplitMix64: a bijection that spreads every bit over all.
fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

impl Chance {
    pub(crate) fn new(seed: u64) -> Self {
        Chance { state: mixed(seed ^ GOLDEN) }
    }

    fn next(&mut self) -> u64 {
        self.state = self.state.wrapping_add(GOLDEN);
        mixed(self.state)
    }

    /// Uniform on (0, 1]: 53 bits, never 0.
    fn uniform(&mut self) -> f64 {
        ((self.next() >> 11) + 1) as f64 * 0.5f64.powi(53)
    }

    /// Standard normal, by Box and Muller.
    pub(crate) fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (core::f64::consts::TAU * self.uniform()).cos()
    }

    /// Uniform on 0..n, n < 2³²; off from uniform by n/2⁶⁴ at most.
    #[inline]
    pub(crate) fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.next()) * n as u128) >> 64) as usize
    }
}

/// Row numbers, shuffled by a hash of each row's own numbers: the same rows in another order give the same sequence of points,
/// so that the answer does not depend on how a file is sorted. Rows alike in every number keep their order.
pub(super) fn shuffled(seen: &[Correspondence], seed: u64) -> Vec<u32> {
    let mut keyed: Vec<(u64, u32)> = seen.iter().zip(0..).map(|(c, row)| (hash(c, seed), row)).collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, row)| row).collect()
}

fn hash(c: &Correspondence, seed: u64) -> u64 {
    let numbers = c.x_in_target.iter().chain(c.pixel.iter());
    // Adding zero makes −0 and 0 alike.
    numbers.fold(mixed(seed), |key, x| mixed(key.wrapping_add(GOLDEN) ^ (x + 0.0).to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each of ten values falls within five standard deviations of its share.
    #[test]
    fn draws_are_uniform() {
        let mut chance = Chance::new(1);
        let mut counts = [0usize; 10];
        (0..100_000).for_each(|_| counts[chance.below(10)] += 1);
        let sigma = (100_000.0f64 * 0.1 * 0.9).sqrt();
        assert!(counts.iter().all(|c| (*c as f64 - 10_000.0).abs() < 5.0 * sigma), "{counts:?}");
    }
}
