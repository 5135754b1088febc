//! What counts as drift, and how often a false alarm is allowed.

use crate::args::ToleranceArgs;
use clap::Args;
use nalgebra::{Matrix6, Vector6};
use resight::core::temporal::monitor::MonitorConfig;
use resight::core::temporal::monitor::learn::LearnConfig;

/// The alarm.
#[derive(Debug, Args)]
#[command(next_help_heading = "Alarm")]
pub struct AlarmArgs {
    /// False alarms a day, on average at most, for all cameras together [default: 1/30, one a month]
    #[arg(long, help_heading = None, hide_default_value = true, value_name = "N", default_value_t = 1.0 / 30.0, value_parser = crate::args::positive)]
    pub false_alarms_per_day: f64,
    /// A camera without a usable reading for this long is stale.
    #[arg(long, alias = "unseen-after-s", hide_short_help = true, value_name = "SECONDS", default_value_t = 5.0, value_parser = crate::args::seconds)]
    stale_after_s: f64,
    #[command(flatten)]
    tolerance: ToleranceArgs,
    /// Standard deviation of the rotation error that is correlated from frame to frame, as far as it is known beforehand; it is measured
    /// otherwise [default: 0, with --moving-target 0.2]
    #[arg(long, hide_short_help = true, value_name = "DEGREES")]
    correlated_deg: Option<f64>,
    /// Standard deviation of the correlated position error [default: 0, with --moving-target 2]
    #[arg(long, hide_short_help = true, value_name = "MM")]
    correlated_mm: Option<f64>,
    /// Time constant of these correlated errors (Gauss–Markov).
    #[arg(long, hide_short_help = true, value_name = "SECONDS", default_value_t = 60.0, value_parser = crate::args::seconds)]
    correlation_time_s: f64,
    /// Standard deviation of the diurnal variation (sun, load) of the rotation.
    #[arg(long, hide_short_help = true, value_name = "DEGREES", default_value_t = 0.0)]
    diurnal_deg: f64,
    /// Standard deviation of the diurnal variation of the position.
    #[arg(long, hide_short_help = true, value_name = "MM", default_value_t = 0.0)]
    diurnal_mm: f64,
}

/// What a lens model leaves over changes as the target is carried through the image, and a short look shows little of it: degrees and
/// millimetres that four webcams need to be quiet (docs/watch.md).
const CARRIED_ABOUT: [f64; 2] = [0.2, 2.0];

impl AlarmArgs {
    /// Shared among the pairs watched, so that the rate holds for all of them together.
    pub fn monitor(&self, pairs: usize) -> MonitorConfig {
        let tolerance = self.tolerance.tolerance();
        MonitorConfig {
            false_alarms_per_day: self.false_alarms_per_day / pairs as f64,
            stale_after_s: self.stale_after_s,
            tolerance_rotation_rad: tolerance.rotation_rad.unwrap_or(0.0),
            tolerance_translation_m: tolerance.translation_m.unwrap_or(0.0),
            ..MonitorConfig::default()
        }
    }

    /// Errors known beforehand.
    pub fn correlated(&self, is_target_moving: bool) -> LearnConfig {
        let [correlated_deg, correlated_mm] = if is_target_moving { CARRIED_ABOUT } else { [0.0, 0.0] };
        LearnConfig {
            bias: spread(
                self.correlated_deg.unwrap_or(correlated_deg),
                self.correlated_mm.unwrap_or(correlated_mm),
            ),
            bias_time_s: self.correlation_time_s,
            diurnal: spread(self.diurnal_deg, self.diurnal_mm),
        }
    }
}

/// The same about and along every axis.
fn spread(degrees: f64, mm: f64) -> Matrix6<f64> {
    let (r, t) = (degrees.to_radians().powi(2), (1e-3 * mm).powi(2));
    Matrix6::from_diagonal(&Vector6::new(r, r, r, t, t, t))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        alarm: AlarmArgs,
    }

    fn read(line: &str) -> AlarmArgs {
        Line::parse_from(line.split_whitespace()).alarm
    }

    /// All different, so that no two can be mistaken for each other.
    const ALL: &str = "watch --false-alarms-per-day 0.6 --stale-after-s 7 --tolerance-deg 0.5 --tolerance-mm 3 \
        --correlated-deg 0.2 --correlated-mm 4 --correlation-time-s 90 --diurnal-deg 0.1 --diurnal-mm 5";

    fn is_spread(covariance: &Matrix6<f64>, degrees: f64, metres: f64) -> bool {
        let sigma = covariance.diagonal().map(f64::sqrt);
        let (turn, shift) = (degrees.to_radians(), metres);
        let is_diagonal = (covariance - Matrix6::from_diagonal(&covariance.diagonal())).norm() == 0.0;
        is_diagonal && (0..6).all(|i| (sigma[i] - if i < 3 { turn } else { shift }).abs() < 1e-15)
    }

    #[test]
    fn the_rate_is_shared_and_units_are_ours() {
        let monitor = read(ALL).monitor(3);
        assert!((monitor.false_alarms_per_day - 0.2).abs() < 1e-15);
        assert_eq!(monitor.stale_after_s, 7.0);
        assert!((monitor.tolerance_rotation_rad - 0.5_f64.to_radians()).abs() < 1e-15);
        assert!((monitor.tolerance_translation_m - 0.003).abs() < 1e-15);
    }

    #[test]
    fn errors_known_beforehand_reach_the_monitor() {
        for is_target_moving in [false, true] {
            let correlated = read(ALL).correlated(is_target_moving);
            assert!(is_spread(&correlated.bias, 0.2, 0.004) && is_spread(&correlated.diurnal, 0.1, 0.005));
            assert_eq!(correlated.bias_time_s, 90.0);
        }
        let default = read("watch");
        assert!(is_spread(&default.correlated(false).bias, 0.0, 0.0));
        assert!(is_spread(&default.correlated(true).bias, 0.2, 0.002));
    }

    /// A clock takes no more.
    #[test]
    fn seconds_are_bounded() {
        let read = |line: &str| Line::try_parse_from(line.split_whitespace());
        assert!(read("watch --stale-after-s 1e9").is_ok());
        for bad in ["1e20", "0", "-1", "NaN", "inf"] {
            let refused = read(&format!("watch --stale-after-s={bad}")).err().expect("refused").to_string();
            assert!(
                refused.contains("a positive number of seconds is needed, at most 1000000000"),
                "{refused}"
            );
        }
    }
}
