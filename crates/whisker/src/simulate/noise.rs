//! The instruments' noise, from a seed.

use crate::{Cell, Sample};
use resight_core::statistics::SplitMix64;

/// Readings with Gaussian noise and rounding as `cell` says: each load is disturbed and then rounded to the cell's steps, the hub's
/// place is disturbed, its angle disturbed and rounded. The same seed gives the same noise, whatever the machine.
pub fn add_noise(samples: &[Sample], cell: &Cell, seed: u64) -> Vec<Sample> {
    let mut chance = SplitMix64::new(seed);
    samples.iter().map(|sample| disturbed(sample, cell, &mut chance)).collect()
}

fn disturbed(sample: &Sample, cell: &Cell, chance: &mut SplitMix64) -> Sample {
    let mut noisy = *sample;
    let mut disturb = |values: [(&mut f64, f64, f64); 2]| {
        for ((value, sigma, step), normal) in values.into_iter().zip(chance.normal_pair()) {
            *value = rounded(*value + sigma * normal, step);
        }
    };
    let (load, hub) = (&mut noisy.load, &mut noisy.world_from_hub);
    disturb([
        (&mut load.fx_n, cell.force_sigma_n, cell.force_step_n),
        (&mut load.fy_n, cell.force_sigma_n, cell.force_step_n),
    ]);
    disturb([
        (&mut load.mz_n_m, cell.torque_sigma_n_m, cell.torque_step_n_m),
        (&mut hub.angle_rad, cell.hub_angle_sigma_rad, cell.hub_angle_step_rad),
    ]);
    disturb([(&mut hub.x_m, cell.hub_xy_sigma_m, 0.0), (&mut hub.y_m, cell.hub_xy_sigma_m, 0.0)]);
    noisy
}

fn rounded(value: f64, step: f64) -> f64 {
    if step == 0.0 { value } else { step * (value / step).round() }
}
