//! Readings as instruments give them, from a seed.

use resight_core::statistics::SplitMix64;
use resight_whisker::{Cell, HubLoad, Sample};

/// SplitMix64, and normal numbers by Box and Muller.
pub struct Chance(pub SplitMix64);

impl Chance {
    pub fn uniform(&mut self) -> f64 {
        self.0.uniform()
    }

    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// A reading of `value`: noise, then rounding to the step.
    pub fn reading(&mut self, value: f64, sigma: f64, step: f64) -> f64 {
        let noisy = value + sigma * self.normal();
        if step == 0.0 { noisy } else { (noisy / step).round() * step }
    }

    pub fn load(&mut self, load: &HubLoad, cell: &Cell) -> HubLoad {
        HubLoad {
            fx_n: self.reading(load.fx_n, cell.force_sigma_n, cell.force_step_n),
            fy_n: self.reading(load.fy_n, cell.force_sigma_n, cell.force_step_n),
            mz_n_m: self.reading(load.mz_n_m, cell.torque_sigma_n_m, cell.torque_step_n_m),
        }
    }

    /// A record as the instruments would have read it.
    pub fn record(&mut self, clean: &[Sample], cell: &Cell) -> Vec<Sample> {
        let mut of = |sample: &Sample| {
            let mut read = *sample;
            let pose = &mut read.world_from_hub;
            pose.x_m = self.reading(pose.x_m, cell.hub_xy_sigma_m, 0.0);
            pose.y_m = self.reading(pose.y_m, cell.hub_xy_sigma_m, 0.0);
            pose.angle_rad = self.reading(pose.angle_rad, cell.hub_angle_sigma_rad, cell.hub_angle_step_rad);
            read.load = self.load(&sample.load, cell);
            read
        };
        clean.iter().map(&mut of).collect()
    }
}
