//! Compares two calibrations, rigs or poses, from files or from answers: what moved between them?

mod read;
mod rigs;
mod views;
mod words;

pub use crate::answer::compare::{CompareAnswer, Motion, RigsCompared, Verdict, ViewCompared};
pub use read::{Compared, ViewPoses, read};
pub use words::evidence;

use crate::Error;
use crate::core::Matrix6;

/// How two calibrations are compared.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompareOptions {
    /// Probability of a false alarm: of reporting a motion when nothing moved.
    pub alpha: f64,
    /// 6×6 covariance `[rotation_rad; translation_m]` of each pose whose file states none.
    pub stated: Option<Matrix6>,
}

impl Default for CompareOptions {
    fn default() -> Self {
        CompareOptions { alpha: 1e-3, stated: None }
    }
}

impl CompareOptions {
    /// Assumes independent errors, in metres for each coordinate and in radians about each axis, for files that state no covariance.
    pub fn with_sigmas(self, sigma_m: f64, sigma_rad: f64) -> Self {
        let variance = |i: usize| if i < 3 { sigma_rad * sigma_rad } else { sigma_m * sigma_m };
        let stated = Matrix6::from_fn(|i, j| if i == j { variance(i) } else { 0.0 });
        CompareOptions { stated: Some(stated), ..self }
    }
}

/// Determines what moved from `before` to `after`. Rigs need no common frame: the largest set of cameras whose relative poses agree is taken to
/// be unmoved. Poses are compared view by view, and the probability of a false alarm is divided among the views.
///
/// # Errors
/// Fewer than two cameras, or no view, in both; a rig compared with poses; poses without a covariance; an invalid covariance.
pub fn compare(
    before: &Compared,
    after: &Compared,
    options: &CompareOptions,
) -> Result<CompareAnswer, Error> {
    let mixed = |a, b| {
        let (before, after) = (before.name(), after.name());
        Err(Error::request(format!("{before} holds {a} and {after} {b}; compare two of a kind")))
    };
    match (before, after) {
        (Compared::Rig { .. }, Compared::Poses { .. }) => mixed("a rig", "poses"),
        (Compared::Poses { .. }, Compared::Rig { .. }) => mixed("poses", "a rig"),
        (Compared::Rig { name: a, rig: before }, Compared::Rig { name: b, rig: after }) => {
            Ok(CompareAnswer::Rigs(Box::new(rigs::compare((a, before), (b, after), options)?)))
        }
        (Compared::Poses { views: before, .. }, Compared::Poses { views: after, .. }) => {
            Ok(CompareAnswer::Views(views::compare(before, after, options)?))
        }
    }
}
