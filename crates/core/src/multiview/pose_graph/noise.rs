//! The uncertainty of each pair: as stated, or estimated from the agreement of the pairs. Derivation: docs/math/pose_graph.md eqs. (8)–(9).

use super::equations::linearised;
use super::{PairNoise, PairSigma, PoseGraph};
use crate::multiview::relative::{information_of, isotropic};
use crate::{Error, Matrix6, Pose};

/// Median of χ² with three degrees of freedom.
const MEDIAN_CHI2_3: f64 = 2.366;
/// A rotation (rad) or translation (m) of at least this is distinguished from rounding: where pairs agree exactly the estimate would be zero.
const LEAST_SIGMA: f64 = 1e-12;

/// Standard deviations of all pairs.
#[derive(Debug, Clone)]
pub(super) enum Noise {
    /// One covariance for each pair.
    Stated(Vec<Matrix6>),
    /// Errors relative to the median, and the sigmas of a pair of median error.
    Relative {
        relative: Vec<f64>,
        sigma: PairSigma,
        /// Whether the sigmas are estimated from the residuals.
        is_estimated: bool,
    },
}

impl Noise {
    /// Returns the noise that the graph states; sigmas to be estimated start from the residuals at the initial poses.
    pub fn of(graph: &PoseGraph, stated: Option<PairSigma>, start: &[Pose]) -> Result<Self, Error> {
        let mut errors = Vec::new();
        let mut covariances = Vec::new();
        for pair in graph.pairs {
            match pair.noise {
                PairNoise::Error(error) => errors.push(error),
                PairNoise::Covariance(covariance) => covariances.push(covariance),
            }
        }
        if errors.is_empty() {
            return Ok(Noise::Stated(covariances));
        }
        let middle = median(errors.clone());
        let relative: Vec<f64> = errors.iter().map(|error| error / middle).collect();
        if let Some(sigma) = stated {
            for (setting, seen) in
                [("sigma_rad of a pair", sigma.sigma_rad), ("sigma_m of a pair", sigma.sigma_m)]
            {
                if !(0.0 < seen && seen.is_finite()) {
                    return Err(Error::InvalidSetting {
                        setting,
                        seen,
                        needed: "it must be positive and finite",
                    });
                }
            }
            return Ok(Noise::Relative { relative, sigma, is_estimated: false });
        }
        let sigma = first_sigma(graph, &relative, start);
        Ok(Noise::Relative { relative, sigma, is_estimated: true })
    }

    pub fn is_estimated(&self) -> bool {
        matches!(self, Noise::Relative { is_estimated: true, .. })
    }

    pub fn median_sigma(&self) -> Option<PairSigma> {
        match self {
            Noise::Stated(_) => None,
            Noise::Relative { sigma, .. } => Some(*sigma),
        }
    }

    pub fn covariance(&self, pair: usize) -> Matrix6 {
        match self {
            Noise::Stated(covariances) => covariances[pair],
            Noise::Relative { relative, sigma, .. } => {
                isotropic(sigma.sigma_rad * relative[pair], sigma.sigma_m * relative[pair])
            }
        }
    }

    pub fn information(&self, pair: usize) -> Result<Matrix6, Error> {
        information_of("pair", pair, &self.covariance(pair))
    }

    /// Returns the noise with sigmas estimated from the residuals of the pairs used, eq. (9): sums of squares over redundancies, one for
    /// rotations and one for translations.
    pub fn re_estimated(&self, turn: (f64, f64), shift: (f64, f64)) -> Self {
        match self {
            Noise::Relative { relative, sigma, is_estimated: true } => {
                let updated = |sigma: f64, (squares, redundancy): (f64, f64)| {
                    let factor = if 0.0 < redundancy { (squares / redundancy).sqrt() } else { 1.0 };
                    f64::max(sigma * factor, LEAST_SIGMA)
                };
                let sigma = PairSigma {
                    sigma_rad: updated(sigma.sigma_rad, turn),
                    sigma_m: updated(sigma.sigma_m, shift),
                };
                Noise::Relative { relative: relative.clone(), sigma, is_estimated: true }
            }
            stated => stated.clone(),
        }
    }
}

/// Returns initial sigmas from the median residual of the pairs that the initial poses do not meet by construction.
fn first_sigma(graph: &PoseGraph, relative: &[f64], start: &[Pose]) -> PairSigma {
    let squares = |from: usize, least: f64| {
        let square = |i: usize| {
            linearised(graph, i, start).residual.fixed_rows::<3>(from).norm_squared()
                / (relative[i] * relative[i])
        };
        let squares: Vec<f64> = (0..graph.pairs.len()).map(square).filter(|s| least * least < *s).collect();
        if squares.is_empty() { least } else { f64::max((median(squares) / MEDIAN_CHI2_3).sqrt(), least) }
    };
    PairSigma { sigma_rad: squares(0, 1e-9), sigma_m: squares(3, 1e-9) }
}

/// Returns the median; of an even number of values the upper of the middle two.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(1.0)
}
