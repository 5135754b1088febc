//! What a pose is sought for: everything the cost depends on besides the pose.

use crate::loss::Loss;
use crate::prior::Prior;
use crate::{Camera, Correspondence, Error};

/// The observations of one view.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// Known points and where they were seen.
    pub seen: &'a [Correspondence],
    /// The camera they were seen with.
    pub camera: &'a Camera,
    /// What else is known about the pose; each is a factor of the likelihood, independent of the others.
    pub priors: &'a [Prior],
    /// What a point's residual costs.
    pub loss: Loss,
}

impl<'a> Problem<'a> {
    /// Points seen by a camera, and nothing else known.
    pub fn new(seen: &'a [Correspondence], camera: &'a Camera) -> Self {
        Problem { seen, camera, priors: &[], loss: Loss::Squared }
    }

    /// Points and nothing else, under the square: the inner loop's usual case.
    #[inline(always)]
    pub(crate) fn is_points_alone(&self) -> bool {
        self.priors.is_empty() && self.loss == Loss::Squared
    }

    /// How many numbers the cost is made of: two of each point, and those of the priors.
    pub fn rows(&self) -> usize {
        2 * self.seen.len() + self.priors.iter().map(Prior::rows).sum::<usize>()
    }

    /// Numbers beyond the six that a pose takes.
    pub fn degrees_of_freedom(&self) -> usize {
        self.rows().saturating_sub(6)
    }

    /// Whether priors and loss are what they are said to be (`solve::configuration::classify` checks the points).
    ///
    /// # Errors
    /// `InvalidPrior`, `InvalidLoss`.
    pub fn check(&self) -> Result<(), Error> {
        self.loss.check()?;
        self.priors.iter().enumerate().try_for_each(|(index, prior)| prior.check(index))
    }
}
