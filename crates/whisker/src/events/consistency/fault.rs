//! What may be wrong with a calibration, one at a time.

use crate::{Cell, Sample};
use nalgebra::Vector2;

/// A systematic error of the readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    /// Both forces read too large by this share.
    ForceGain,
    /// The torque reads too large by this share.
    TorqueGain,
    /// The hub's angle reads too large, radians: the clamped whisker points elsewhere, load cell and all.
    HubAngle,
    /// The load cell is turned against the clamped whisker, radians: forces read rotated clockwise.
    CellAngle,
    /// The clamp lies this far ahead of where the stage has it, along the clamped whisker, metres.
    HubAhead,
    /// The clamp lies this far to the left of where the stage has it, metres.
    HubAside,
    /// Zero of fx, newtons.
    ZeroFx,
    /// Zero of fy, newtons.
    ZeroFy,
    /// Zero of mz, newton metres.
    ZeroMz,
}

impl Fault {
    /// All of them.
    pub const ALL: [Fault; 9] = [
        Fault::ForceGain,
        Fault::TorqueGain,
        Fault::HubAngle,
        Fault::CellAngle,
        Fault::HubAhead,
        Fault::HubAside,
        Fault::ZeroFx,
        Fault::ZeroFy,
        Fault::ZeroMz,
    ];

    /// A careful set-up's standard deviation of it: gains 1 %, angles 0.2°, the clamp half a millimetre, zeros half a sigma of a reading.
    pub fn tolerance(self, cell: &Cell) -> f64 {
        let covariance = cell.load_covariance();
        match self {
            Fault::ForceGain | Fault::TorqueGain => 0.01,
            Fault::HubAngle | Fault::CellAngle => 0.2_f64.to_radians(),
            Fault::HubAhead | Fault::HubAside => 5e-4,
            Fault::ZeroFx | Fault::ZeroFy => 0.5 * covariance[(0, 0)].sqrt(),
            Fault::ZeroMz => 0.5 * covariance[(2, 2)].sqrt(),
        }
    }

    /// The reading without a fault of this size.
    pub fn taken_off(self, sample: &Sample, size: f64) -> Sample {
        let mut right = *sample;
        let (load, hub) = (&mut right.load, &mut right.world_from_hub);
        match self {
            Fault::ForceGain => {
                load.fx_n /= 1.0 + size;
                load.fy_n /= 1.0 + size;
            }
            Fault::TorqueGain => load.mz_n_m /= 1.0 + size,
            Fault::HubAngle => hub.angle_rad -= size,
            Fault::CellAngle => {
                let (sin, cos) = size.sin_cos();
                let (fx_n, fy_n) = (load.fx_n, load.fy_n);
                load.fx_n = cos * fx_n - sin * fy_n;
                load.fy_n = sin * fx_n + cos * fy_n;
            }
            Fault::HubAhead | Fault::HubAside => {
                let axis = if self == Fault::HubAhead { Vector2::x() } else { Vector2::y() };
                let shift = hub.rotate(axis * size);
                hub.x_m += shift.x;
                hub.y_m += shift.y;
            }
            Fault::ZeroFx => load.fx_n -= size,
            Fault::ZeroFy => load.fy_n -= size,
            Fault::ZeroMz => load.mz_n_m -= size,
        }
        right
    }

    /// A size small enough for derivatives: far below what noise hides, far above rounding.
    pub(super) fn step(self, cell: &Cell) -> f64 {
        match self {
            Fault::ForceGain | Fault::TorqueGain => 1e-4,
            Fault::HubAngle | Fault::CellAngle => 1e-4,
            Fault::HubAhead | Fault::HubAside => 1e-5,
            Fault::ZeroFx | Fault::ZeroFy => 1e-2 * cell.load_covariance()[(0, 0)].sqrt(),
            Fault::ZeroMz => 1e-1 * cell.load_covariance()[(2, 2)].sqrt(),
        }
    }
}
