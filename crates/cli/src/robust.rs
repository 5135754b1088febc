//! `--robust`: the flag.

use clap::Args;

/// The flag, for every command that solves from points.
#[derive(Debug, Clone, Args)]
pub struct RobustArgs {
    /// Allows wrong rows: the pose is solved from the rows that agree to within PX.
    ///
    /// PX has the unit of u and v and is three to five times their standard deviation. `inliers` in JSON are row numbers within the view,
    /// counted from 0 in file order. Four rows of one id that form a square are a tag and agree all together or not at all.
    #[arg(long, value_name = "PX", allow_negative_numbers = true, value_parser = crate::args::positive)]
    robust: Option<f64>,
}

impl RobustArgs {
    /// The threshold; none without the flag.
    pub fn threshold_px(&self) -> Option<f64> {
        self.robust
    }
}
