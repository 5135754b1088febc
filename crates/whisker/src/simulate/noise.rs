//! The instruments' noise, from a seed.

use crate::{Cell, Sample};
use std::f64::consts::TAU;

/// Readings with Gaussian noise and rounding as `cell` says: each load is disturbed and then rounded to the cell's steps, the hub's
/// place is disturbed, its angle disturbed and rounded. The same seed gives the same noise, whatever the machine.
pub fn add_noise(samples: &[Sample], cell: &Cell, seed: u64) -> Vec<Sample> {
    let mut chance = Chance::new(seed);
    samples.iter().map(|sample| disturbed(sample, cell, &mut chance)).collect()
}

fn disturbed(sample: &Sample, cell: &Cell, chance: &mut Chance) -> Sample {
    let mut noisy = *sample;
    let mut disturb = |value: &mut f64, sigma: f64, step: f64| {
        *value = rounded(*value + sigma * chance.gaussian(), step);
    };
    disturb(&mut noisy.load.fx_n, cell.force_sigma_n, cell.force_step_n);
    disturb(&mut noisy.load.fy_n, cell.force_sigma_n, cell.force_step_n);
    disturb(&mut noisy.load.mz_n_m, cell.torque_sigma_n_m, cell.torque_step_n_m);
    disturb(&mut noisy.world_from_hub.angle_rad, cell.hub_angle_sigma_rad, cell.hub_angle_step_rad);
    disturb(&mut noisy.world_from_hub.x_m, cell.hub_xy_sigma_m, 0.0);
    disturb(&mut noisy.world_from_hub.y_m, cell.hub_xy_sigma_m, 0.0);
    noisy
}

fn rounded(value: f64, step: f64) -> f64 {
    if step == 0.0 { value } else { step * (value / step).round() }
}

/// SplitMix64 (Steele, Lea and Flood 2014): one addition and one mix per number, every seed as good as any other.
struct Chance {
    state: u64,
    spare: Option<f64>,
}

impl Chance {
    fn new(seed: u64) -> Self {
        Chance { state: seed, spare: None }
    }

    fn bits(&mut self) -> u64 {
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In (0, 1].
    fn uniform(&mut self) -> f64 {
        ((self.bits() >> 11) + 1) as f64 / (1_u64 << 53) as f64
    }

    /// Box and Muller's pair, one at a time.
    fn gaussian(&mut self) -> f64 {
        if let Some(spare) = self.spare.take() {
            return spare;
        }
        let radius = (-2.0 * self.uniform().ln()).sqrt();
        let (sin, cos) = (TAU * self.uniform()).sin_cos();
        self.spare = Some(radius * sin);
        radius * cos
    }
}
