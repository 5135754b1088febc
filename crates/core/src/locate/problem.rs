//! What a pose is sought for: everything the cost depends on besides the pose.

use crate::locate::group::{RigidGroup, check_groups};
use crate::locate::loss::Loss;
use crate::locate::prior::Prior;
use crate::{Camera, Correspondence, Error, Pose};

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
    /// Runs of `seen` that are displaced together, in order; under the squared loss only.
    pub groups: &'a [RigidGroup],
    /// The pose at which the share of uncertain points in the covariance of their pixels is taken; none: at each pose that is asked
    /// about. A descent holds it: docs/math/refine.md section 4.
    pub weights_at: Option<&'a Pose>,
}

impl<'a> Problem<'a> {
    /// Points seen by a camera, and nothing else known.
    pub fn new(seen: &'a [Correspondence], camera: &'a Camera) -> Self {
        Problem { seen, camera, priors: &[], loss: Loss::Squared, groups: &[], weights_at: None }
    }

    /// The same with the weights of uncertain points, if there are any, as they are at a pose.
    pub(crate) fn held_at<'b>(&self, cam_from_target: &'b Pose) -> Problem<'b>
    where
        'a: 'b,
    {
        Problem { weights_at: self.has_uncertain_points().then_some(cam_from_target), ..*self }
    }

    /// Whether the weights of points depend on the pose.
    pub(crate) fn has_uncertain_points(&self) -> bool {
        self.seen.iter().any(|c| c.sigma_m != 0.0)
    }

    /// Points and nothing else, under the square, each weighed where it is: the inner loop's usual case.
    #[inline(always)]
    pub(crate) fn is_points_alone(&self) -> bool {
        let is_squared = self.priors.is_empty() && self.loss == Loss::Squared;
        is_squared && self.groups.is_empty() && self.weights_at.is_none()
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
    /// `InvalidPrior`, `InvalidLoss`, `InvalidSetting` for groups that cannot be.
    pub fn check(&self) -> Result<(), Error> {
        self.loss.check()?;
        check_groups(self.groups, self.seen.len())?;
        if !self.groups.is_empty() && self.loss != Loss::Squared {
            let needed = "points that are displaced together are weighed by the squared loss only";
            return Err(Error::InvalidSetting { setting: "groups", seen: self.groups.len() as f64, needed });
        }
        self.priors.iter().enumerate().try_for_each(|(index, prior)| prior.check(index))
    }
}
