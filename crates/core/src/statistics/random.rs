//! Seeded chance: the one generator.

#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// SplitMix64 (Steele, Lea and Flood 2014): 64 bits of state, equidistributed, four operations a number, the same on every machine.
#[derive(Debug, Clone)]
pub struct SplitMix64 {
    state: u64,
}

/// The generator's step: 2⁶⁴ over the golden ratio.
pub const GOLDEN: u64 = 0x9E37_79B9_7F4A_7C15;
/// A 53-bit number becomes one below 1.
const UNIT: f64 = 1.0 / (1_u64 << 53) as f64;

/// The finaliser of SplitMix64: a bijection that spreads every bit over all.
pub fn mixed(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

impl SplitMix64 {
    /// The published sequence of a seed.
    pub fn new(seed: u64) -> Self {
        SplitMix64 { state: seed }
    }

    /// A sequence that has nothing in common with that of any other seed near it: the state begins anywhere on the cycle.
    pub fn scattered(seed: u64) -> Self {
        SplitMix64 { state: mixed(seed ^ GOLDEN) }
    }

    /// 64 random bits.
    #[inline]
    pub fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(GOLDEN);
        mixed(self.state)
    }

    /// Uniform on [0, 1), 53 bits.
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * UNIT
    }

    /// Uniform on [low, high).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Uniform on 0..n, n < 2³²; off from uniform by n/2⁶⁴ at most.
    #[inline]
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// Standard normal.
    pub fn normal(&mut self) -> f64 {
        self.normal_pair()[0]
    }

    /// Two independent standard normal numbers, by Box and Muller.
    pub fn normal_pair(&mut self) -> [f64; 2] {
        // On (0, 1]: the logarithm of zero is no number.
        let mut positive = || ((self.bits() >> 11) + 1) as f64 * UNIT;
        let radius = (-2.0 * positive().ln()).sqrt();
        let (sin, cos) = (core::f64::consts::TAU * positive()).sin_cos();
        [radius * cos, radius * sin]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first numbers of seed 1234567, as the authors' reference program prints them.
    #[test]
    fn the_sequence_is_the_published_one() {
        let mut random = SplitMix64::new(1_234_567);
        let first = [0; 3].map(|_| random.bits());
        assert_eq!(first, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }

    /// Each of ten values falls within five standard deviations of its share.
    #[test]
    fn draws_are_uniform() {
        let mut random = SplitMix64::scattered(1);
        let mut counts = [0usize; 10];
        (0..100_000).for_each(|_| counts[random.below(10)] += 1);
        let sigma = (100_000.0f64 * 0.1 * 0.9).sqrt();
        assert!(counts.iter().all(|c| (*c as f64 - 10_000.0).abs() < 5.0 * sigma), "{counts:?}");
    }

    /// Mean, variance and kurtosis (3) of 100,000 pairs within five of their standard deviations, and no correlation in a pair.
    #[test]
    fn normal_numbers_are_normal() {
        let (mut random, n) = (SplitMix64::new(2), 100_000);
        let (mut moments, mut product) = ([[0.0; 3]; 2], 0.0);
        for _ in 0..n {
            let pair = random.normal_pair();
            product += pair[0] * pair[1] / f64::from(n);
            for (sum, x) in moments.iter_mut().zip(pair) {
                [1, 2, 4].into_iter().zip(sum).for_each(|(power, sum)| *sum += x.powi(power) / f64::from(n));
            }
        }
        let sigma = |variance: f64| 5.0 * (variance / f64::from(n)).sqrt();
        assert!(product.abs() < sigma(1.0), "{product}");
        for [mean, square, fourth] in moments {
            assert!(mean.abs() < sigma(1.0) && (square - 1.0).abs() < sigma(2.0), "{mean} {square}");
            assert!((fourth - 3.0).abs() < sigma(96.0), "{fourth}");
        }
    }
}
