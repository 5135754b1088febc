//! A day of a fleet with its truth: cameras that stay, sudden motions, slow drifts, diurnal variation, wrong maps, dead cameras, clocks that are off.
//!
//! Every number follows from the seed, the camera and the time of the row, so that any part of a day can be made on its own.

mod camera;
mod write;

pub use camera::{Fate, SimulatedCamera};
pub use write::write_day;

use crate::FleetError;
use crate::cameras::{Cameras, FleetCamera, Site};
use resight::core::statistics::random::SplitMix64;

/// What day of what fleet.
#[derive(Debug, Clone, PartialEq)]
pub struct Simulation {
    /// How many cameras.
    pub cameras: usize,
    /// How long, seconds.
    pub duration_s: f64,
    /// Time between the images of a camera, seconds.
    pub every_s: f64,
    /// Time of the first image, seconds.
    pub begin_s: f64,
    /// Standard deviation of a pixel coordinate.
    pub sigma_px: f64,
    /// Median amplitude of the rotation by diurnal variation, degrees.
    pub thermal_deg: f64,
    /// Shares of cameras with a fate: step, drifting, wrong map, dead, clock off.
    pub shares: [f64; 5],
    /// Share of rows that are poison: missing or absurd numbers, unknown cameras.
    pub poison: f64,
    /// Share of images in which the points are not found; they have no row.
    pub missed: f64,
    /// Seed of all chance.
    pub seed: u64,
}

impl Default for Simulation {
    fn default() -> Self {
        Simulation {
            cameras: 100,
            duration_s: 86_400.0,
            every_s: 10.0,
            begin_s: 1_780_000_000.0,
            sigma_px: 0.3,
            thermal_deg: 0.003,
            shares: [0.02, 0.01, 0.01, 0.01, 0.01],
            poison: 1e-5,
            missed: 0.02,
            seed: 1,
        }
    }
}

/// The fleet of a simulation.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedFleet {
    /// What day it is of.
    pub simulation: Simulation,
    /// Its cameras, by number.
    pub cameras: Vec<SimulatedCamera>,
}

impl Simulation {
    /// # Errors
    /// `Setting` for times, shares or counts that cannot be.
    pub fn check(&self) -> Result<(), FleetError> {
        let positive = [
            ("duration", self.duration_s),
            ("time between images", self.every_s),
            ("sigma_px", self.sigma_px),
        ];
        for (what, value) in positive {
            if !(0.0 < value && value.is_finite()) {
                return Err(FleetError::Setting(format!("{what} is {value}; a positive number is needed")));
            }
        }
        let shares = self.shares.iter().chain([&self.poison, &self.missed]);
        if let Some(share) = shares.copied().find(|share| !(0.0..=1.0).contains(share)) {
            return Err(FleetError::Setting(format!("a share is {share}; 0 to 1 is needed")));
        }
        if self.cameras == 0 || 1_000_000 < self.cameras {
            let reason = format!("{} cameras; 1 to 1000000 are needed", self.cameras);
            return Err(FleetError::Setting(reason));
        }
        Ok(())
    }

    /// The fleet of this day.
    ///
    /// # Errors
    /// As `check`.
    pub fn fleet(&self) -> Result<SimulatedFleet, FleetError> {
        self.check()?;
        let mut rng = SplitMix64::scattered(self.seed);
        let cameras = (0..self.cameras).map(|number| SimulatedCamera::new(self, number, &mut rng)).collect();
        Ok(SimulatedFleet { simulation: self.clone(), cameras })
    }

    /// Times of one camera's images.
    pub fn ticks(&self) -> usize {
        (self.duration_s / self.every_s).ceil() as usize
    }
}

impl SimulatedFleet {
    /// As the operator knows it: lenses, and the points as the map states them, wrong ones too.
    ///
    /// # Errors
    /// None that names of numbers give.
    pub fn known(&self) -> Result<Cameras, FleetError> {
        Cameras::of(self.cameras.iter().map(SimulatedCamera::known).collect())
    }
}

impl SimulatedCamera {
    fn known(&self) -> FleetCamera {
        FleetCamera {
            name: self.name.clone(),
            camera: self.camera.clone(),
            points: Some(self.map_points.to_vec()),
            site: Some(Site { name: self.site.clone(), east_north: Some(self.east_north) }),
        }
    }
}
