//! The accuracy of the hub's pose: the rounding of its angle is common to many samples.

use super::constraints::Stretch;
use super::fit::Noise;
use crate::{Cell, Sample};
use nalgebra::Matrix6;

/// Covariance of `[fx, fy, mz, x, y, angle]`.
pub fn observed_noise(cell: &Cell) -> Noise {
    let covariance = |cell: &Cell| {
        let mut noise = Matrix6::zeros();
        noise.fixed_view_mut::<3, 3>(0, 0).copy_from(&cell.load_covariance());
        noise.fixed_view_mut::<3, 3>(3, 3).copy_from(&cell.hub_covariance());
        noise
    };
    Noise {
        moving: covariance(cell),
        still: covariance(&Cell { hub_angle_step_rad: 0.0, ..*cell }),
        rounding_rad: cell.hub_angle_step_rad / 12.0_f64.sqrt(),
    }
}

/// Shorter stretches of constant hub angle are taken for chance.
const LEAST_STILL: usize = 4;

/// To which stretch each sample belongs: what the encoder's rounding has in common over a stretch is an unknown of it.
///
/// An angle that stands still is rounded by the same amount every time; sweeps at the same reading share it, as a stage sent twice
/// to the same place stands twice at the same angle. A turning hub may be rounded alike, too, where it turns by whole steps of the
/// encoder (28.001 steps a sample in one recorded sweep): each sweep has its own unknown besides the rounding of every sample.
pub fn stretches(cell: &Cell, samples: &[Sample]) -> Vec<Stretch> {
    let apart = |a: f64, b: f64| 0.5 * cell.hub_angle_step_rad <= (a - b).abs();
    let angle = |sample: &Sample| sample.world_from_hub.angle_rad;
    // What each unknown belongs to: a reading, or none for a sweep that turns.
    let mut unknowns: Vec<Option<f64>> = Vec::new();
    let mut stretches = Vec::with_capacity(samples.len());
    for sweep in samples.chunk_by(|a, b| a.sweep == b.sweep) {
        let mut turning = None;
        for stretch in sweep.chunk_by(|a, b| !apart(angle(a), angle(b))) {
            let reading = (LEAST_STILL <= stretch.len()).then(|| angle(&stretch[0]));
            let known = match reading {
                Some(reading) => {
                    unknowns.iter().position(|known| known.is_some_and(|known| !apart(known, reading)))
                }
                None => turning,
            };
            let unknown = known.unwrap_or_else(|| {
                unknowns.push(reading);
                unknowns.len() - 1
            });
            turning = if reading.is_none() { Some(unknown) } else { turning };
            let is_still = reading.is_some();
            stretches.extend(stretch.iter().map(|_| Stretch { unknown, is_still }));
        }
    }
    stretches
}
