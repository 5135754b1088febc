//! The parameters of a request about a camera: the camera and the period.

use crate::error::Problem;
use resight_watch::board::strip::Stretch;
use schemars::JsonSchema;
use serde::Deserialize;

/// Number of parts of a strip, by default and at most.
const BINS: usize = 240;
const MOST_BINS: usize = 1000;

/// A camera and a stretch of time, seconds of capture.
#[derive(Deserialize, JsonSchema)]
pub struct Asked {
    pub(super) camera: String,
    pub(super) from_s: Option<f64>,
    pub(super) to_s: Option<f64>,
    bins: Option<usize>,
}

impl Asked {
    /// Returns the period, with these times as the defaults.
    pub(super) fn stretch(&self, first_s: f64, last_s: f64) -> Stretch {
        let to_s = self.to_s.unwrap_or(last_s);
        let from_s = self.from_s.unwrap_or(first_s).min(to_s - 1e-3);
        Stretch { from_s, to_s, bins: self.bins.unwrap_or(BINS).clamp(1, MOST_BINS) }
    }

    /// Times that are none, or the wrong way round.
    pub(super) fn check(&self) -> Result<(), Problem> {
        let given = [self.from_s, self.to_s];
        let is_fine = given.iter().flatten().all(|t_s| t_s.is_finite() && t_s.abs() < 1e12);
        let is_ordered = self.from_s.zip(self.to_s).is_none_or(|(from_s, to_s)| from_s < to_s);
        match is_fine && is_ordered {
            true => Ok(()),
            false => Err(Problem::input("from_s must be before to_s, both seconds of capture.")),
        }
    }
}
