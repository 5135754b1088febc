//! What a residual costs.

use crate::Error;
#[cfg(not(feature = "std"))]
use num_traits::Float as _;

/// The cost of a point's residual, s = squared length in standard deviations (of priors too: never down-weighted).
///
/// Thresholds are in standard deviations of a pixel coordinate, so they need no knowledge of the image.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Loss {
    /// s: maximum likelihood for Gaussian noise. Nothing is more precise where no point is wrong.
    #[default]
    Squared,
    /// s up to the threshold, then linear in √s: single wrong points pull no harder than one at the threshold.
    Huber {
        /// The threshold.
        sigmas: f64,
    },
    /// k² ln(1 + s/k²): the farther off, the weaker the pull.
    Cauchy {
        /// k.
        sigmas: f64,
    },
    /// s up to the square of the threshold, constant beyond: a point farther off takes no part.
    Truncated {
        /// The threshold.
        sigmas: f64,
    },
}

impl Loss {
    /// ρ(s) and ρ′(s): the cost of a squared whitened residual and the weight it gets, docs/math/refine.md eq. (19).
    #[inline]
    pub(crate) fn at(&self, squared: f64) -> (f64, f64) {
        match *self {
            Loss::Squared => (squared, 1.0),
            Loss::Huber { sigmas } if squared <= sigmas * sigmas => (squared, 1.0),
            Loss::Huber { sigmas } => {
                let root = squared.sqrt();
                (sigmas * (2.0 * root - sigmas), sigmas / root)
            }
            Loss::Cauchy { sigmas } => {
                let k2 = sigmas * sigmas;
                (k2 * (squared / k2).ln_1p(), k2 / (k2 + squared))
            }
            Loss::Truncated { sigmas } if squared <= sigmas * sigmas => (squared, 1.0),
            Loss::Truncated { sigmas } => (sigmas * sigmas, 0.0),
        }
    }

    /// # Errors
    /// `InvalidLoss` for a threshold that is not positive and finite.
    pub fn check(&self) -> Result<(), Error> {
        let sigmas = match *self {
            Loss::Squared => return Ok(()),
            Loss::Huber { sigmas } | Loss::Cauchy { sigmas } | Loss::Truncated { sigmas } => sigmas,
        };
        let usable = 0.0 < sigmas && (sigmas * sigmas).is_normal();
        if usable { Ok(()) } else { Err(Error::InvalidLoss { seen: sigmas }) }
    }
}
