//! How the cameras move between readings.

use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use resight::core::track::{Motion, TrackConfig};

/// Mounted, or on something that moves.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Kind {
    /// Mounted: it stays where it is, but for a sway.
    Static,
    /// On a vehicle, an arm or in a hand: it goes on as it went. Its pose is followed; that it moves is no drift.
    Moving,
}

/// The motion.
#[derive(Debug, Args)]
pub struct MotionArgs {
    /// How cameras move.
    #[arg(long, value_enum, default_value_t = Kind::Static)]
    motion: Kind,
    /// How far a mounted camera turns within one second (standard deviation about each axis; grows with the root of time)
    /// [default: 0.006].
    #[arg(long, value_name = "DEGREES", value_parser = crate::args::positive)]
    sway_deg: Option<f64>,
    /// The same, how far it shifts [default: 0.1].
    #[arg(long, value_name = "MM", value_parser = crate::args::positive)]
    sway_mm: Option<f64>,
    /// By how much the turning speed of a moving camera changes within one second, degrees per second (standard deviation about
    /// each axis; grows with the root of time) [default: 30].
    #[arg(long, value_name = "DEG_PER_S", value_parser = crate::args::positive)]
    agility_deg_per_s: Option<f64>,
    /// The same of its speed, millimetres per second [default: 500].
    #[arg(long, value_name = "MM_PER_S", value_parser = crate::args::positive)]
    agility_mm_per_s: Option<f64>,
}

impl MotionArgs {
    /// Whether cameras move, so that nothing is compared with a reference.
    pub fn moves(&self) -> bool {
        self.motion == Kind::Moving
    }

    /// As the filter wants it.
    pub fn track(&self) -> Result<TrackConfig> {
        let sways = self.sway_deg.is_some() || self.sway_mm.is_some();
        let is_agile = self.agility_deg_per_s.is_some() || self.agility_mm_per_s.is_some();
        let motion = match self.motion {
            Kind::Static if is_agile => bail!(
                "--agility-deg-per-s and --agility-mm-per-s belong to --motion moving; a mounted camera has --sway-deg and --sway-mm"
            ),
            Kind::Moving if sways => bail!(
                "--sway-deg and --sway-mm belong to --motion static; a moving camera has --agility-deg-per-s and --agility-mm-per-s"
            ),
            Kind::Static => Motion::Static {
                rotation_rad_per_sqrt_s: self.sway_deg.map_or(1e-4, f64::to_radians),
                translation_m_per_sqrt_s: 1e-3 * self.sway_mm.unwrap_or(0.1),
            },
            Kind::Moving => Motion::ConstantVelocity {
                rotation_rad_per_s_sqrt_s: self.agility_deg_per_s.unwrap_or(30.0).to_radians(),
                translation_m_per_s_sqrt_s: 1e-3 * self.agility_mm_per_s.unwrap_or(500.0),
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
    fn sway_and_agility_are_radians_and_metres() {
        let Motion::Static { rotation_rad_per_sqrt_s: turn, translation_m_per_sqrt_s: shift } =
            motion("watch --sway-deg 0.02 --sway-mm 0.7")
        else {
            panic!("static")
        };
        assert!(near(turn, 0.02_f64.to_radians()) && near(shift, 0.7e-3), "{turn} {shift}");
        let Motion::ConstantVelocity { rotation_rad_per_s_sqrt_s: turn, translation_m_per_s_sqrt_s: shift } =
            motion("watch --motion moving --agility-deg-per-s 12 --agility-mm-per-s 80")
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
