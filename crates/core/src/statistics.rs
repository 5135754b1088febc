//! Distributions and seeded chance, for every module above: tails and quantiles of χ², of ratios of variances and of the normal
//! distribution, and the one random generator.

pub mod normal;
pub mod chi_square;
#[cfg(feature = "std")]
pub mod variance_ratio;
pub mod random;

pub use random::SplitMix64;
