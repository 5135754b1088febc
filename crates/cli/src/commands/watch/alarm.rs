//! What counts as drift, and how often a false alarm is allowed.

use clap::Args;
use nalgebra::{Matrix6, Vector6};
use resight::core::monitor::MonitorConfig;
use resight::core::monitor::learn::LearnConfig;

/// The alarm.
#[derive(Debug, Args)]
pub struct AlarmArgs {
    /// False alarms a day, on average at most, for all cameras together.
    #[arg(long, value_name = "N", default_value_t = 1.0 / 30.0, value_parser = crate::args::positive)]
    pub false_alarms_per_day: f64,
    /// A camera without a usable reading for this long is unseen.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = crate::args::positive)]
    unseen_after_s: f64,
    /// Turns below this are no drift.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0)]
    tolerance_deg: f64,
    /// Shifts below this are no drift.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    tolerance_mm: f64,
    /// Errors of the pose that last from frame to frame, as far as they are known beforehand: of the rotation
    /// [default: 0, with --moving-target 0.2].
    #[arg(long, value_name = "DEGREES")]
    bias_deg: Option<f64>,
    /// The same of the place [default: 0, with --moving-target 2].
    #[arg(long, value_name = "MM")]
    bias_mm: Option<f64>,
    /// How long such errors last.
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = crate::args::positive)]
    bias_time_s: f64,
    /// The wobble of every day (sun, load), as a standard deviation: of the rotation.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0)]
    daily_deg: f64,
    /// The same of the place.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    daily_mm: f64,
}

/// What a lens model leaves over changes as the target is carried through the picture, and a short look shows little of it: degrees and
/// millimetres that four webcams need to be quiet (docs/watch.md).
const CARRIED_ABOUT: [f64; 2] = [0.2, 2.0];

impl AlarmArgs {
    /// Shared among the pairs watched, so that the rate holds for all of them together.
    pub fn monitor(&self, pairs: usize) -> MonitorConfig {
        MonitorConfig {
            false_alarms_per_day: self.false_alarms_per_day / pairs as f64,
            unseen_after_s: self.unseen_after_s,
            tolerance_rotation_rad: self.tolerance_deg.to_radians(),
            tolerance_translation_m: 1e-3 * self.tolerance_mm,
            ..MonitorConfig::default()
        }
    }

    /// Errors known beforehand.
    pub fn lasting(&self, is_target_moving: bool) -> LearnConfig {
        let [bias_deg, bias_mm] = if is_target_moving { CARRIED_ABOUT } else { [0.0, 0.0] };
        LearnConfig {
            bias: spread(self.bias_deg.unwrap_or(bias_deg), self.bias_mm.unwrap_or(bias_mm)),
            bias_time_s: self.bias_time_s,
            daily: spread(self.daily_deg, self.daily_mm),
        }
    }
}

/// The same about and along every axis.
fn spread(degrees: f64, mm: f64) -> Matrix6<f64> {
    let (r, t) = (degrees.to_radians().powi(2), (1e-3 * mm).powi(2));
    Matrix6::from_diagonal(&Vector6::new(r, r, r, t, t, t))
}
