//! How the cameras move between readings.

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use resight::core::temporal::track::{Motion, TrackConfig};

/// Mounted, or on something that moves.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Kind {
    /// Mounted: it stays where it is, but for its process noise.
    Static,
    /// On a vehicle, an arm or in a hand: it continues as it went. Its pose is followed; that it moves is no drift.
    Moving,
}

/// The motion.
#[derive(Debug, Args)]
#[command(next_help_heading = "Motion")]
pub struct MotionArgs {
    /// How cameras move.
    #[arg(long, hide_short_help = true, value_enum, default_value_t = Kind::Static)]
    motion: Kind,
    /// Process noise of a mounted camera: standard deviation of its rotation about each axis after one second; grows with the root of
    /// time [default: 0.006]
    #[arg(long, hide_short_help = true, value_name = "DEG", value_parser = crate::args::positive)]
    rotation_noise_deg_per_sqrt_s: Option<f64>,
    /// Process noise of a mounted camera: standard deviation of its position along each axis after one second [default: 0.1]
    #[arg(long, hide_short_help = true, value_name = "MM", value_parser = crate::args::positive)]
    position_noise_mm_per_sqrt_s: Option<f64>,
    /// Process noise of a moving camera: standard deviation of the change of its angular velocity about each axis after one second,
    /// degrees per second; grows with the root of time [default: 30]
    #[arg(long, hide_short_help = true, value_name = "DEG", value_parser = crate::args::positive)]
    acceleration_noise_deg_per_s_sqrt_s: Option<f64>,
    /// Process noise of a moving camera: standard deviation of the change of its velocity after one second, mm per second [default: 500]
    #[arg(long, hide_short_help = true, value_name = "MM", value_parser = crate::args::positive)]
    acceleration_noise_mm_per_s_sqrt_s: Option<f64>,
}

impl MotionArgs {
    /// Whether cameras move, so that nothing is compared with a reference.
    pub fn moves(&self) -> bool {
        self.motion == Kind::Moving
    }

    /// As the filter wants it.
    pub fn track(&self) -> Result<TrackConfig> {
        let is_mounted =
            self.rotation_noise_deg_per_sqrt_s.is_some() || self.position_noise_mm_per_sqrt_s.is_some();
        let is_moving = self.acceleration_noise_deg_per_s_sqrt_s.is_some()
            || self.acceleration_noise_mm_per_s_sqrt_s.is_some();
        let motion = match self.motion {
            Kind::Static if is_moving => bail!(
                "--acceleration-noise-deg-per-s-sqrt-s and --acceleration-noise-mm-per-s-sqrt-s belong to --motion moving; a mounted camera has --rotation-noise-deg-per-sqrt-s and --position-noise-mm-per-sqrt-s"
            ),
            Kind::Moving if is_mounted => bail!(
                "--rotation-noise-deg-per-sqrt-s and --position-noise-mm-per-sqrt-s belong to --motion static; a moving camera has --acceleration-noise-deg-per-s-sqrt-s and --acceleration-noise-mm-per-s-sqrt-s"
            ),
            Kind::Static => Motion::Static {
                rotation_rad_per_sqrt_s: self.rotation_noise_deg_per_sqrt_s.map_or(1e-4, f64::to_radians),
                translation_m_per_sqrt_s: 1e-3 * self.position_noise_mm_per_sqrt_s.unwrap_or(0.1),
            },
            Kind::Moving => Motion::ConstantVelocity {
                rotation_rad_per_s_sqrt_s: self
                    .acceleration_noise_deg_per_s_sqrt_s
                    .unwrap_or(30.0)
                    .to_radians(),
                translation_m_per_s_sqrt_s: 1e-3 * self.acceleration_noise_mm_per_s_sqrt_s.unwrap_or(500.0),
            },
        };
        Ok(TrackConfig { motion, ..TrackConfig::default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        motion: MotionArgs,
    }

    fn motion(line: &str) -> Motion {
        Line::parse_from(line.split_whitespace()).motion.track().expect("a motion").motion
    }

    fn near(seen: f64, needed: f64) -> bool {
        (seen / needed - 1.0).abs() < 1e-12
    }

    #[test]
    fn process_noise_is_in_radians_and_metres() {
        let Motion::Static { rotation_rad_per_sqrt_s: turn, translation_m_per_sqrt_s: shift } =
            motion("watch --rotation-noise-deg-per-sqrt-s 0.02 --position-noise-mm-per-sqrt-s 0.7")
        else {
            panic!("static")
        };
        assert!(near(turn, 0.02_f64.to_radians()) && near(shift, 0.7e-3), "{turn} {shift}");
        let Motion::ConstantVelocity { rotation_rad_per_s_sqrt_s: turn, translation_m_per_s_sqrt_s: shift } =
            motion(
                "watch --motion moving --acceleration-noise-deg-per-s-sqrt-s 12 --acceleration-noise-mm-per-s-sqrt-s 80",
            )
        else {
            panic!("moving")
        };
        assert!(near(turn, 12_f64.to_radians()) && near(shift, 0.08), "{turn} {shift}");
    }

    /// As the help states them, in its digits.
    #[test]
    fn defaults_are_those_of_the_help() {
        let Motion::Static { rotation_rad_per_sqrt_s: turn, translation_m_per_sqrt_s: shift } =
            motion("watch")
        else {
            panic!("static")
        };
        assert!((turn.to_degrees() - 0.006).abs() < 5e-4 && near(shift, 1e-4), "{turn} {shift}");
        let Motion::ConstantVelocity { rotation_rad_per_s_sqrt_s: turn, translation_m_per_s_sqrt_s: shift } =
            motion("watch --motion moving")
        else {
            panic!("moving")
        };
        assert!(near(turn, 30_f64.to_radians()) && near(shift, 0.5), "{turn} {shift}");
    }
}
