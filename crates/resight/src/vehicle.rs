//! The rotation of a camera against the vehicle that carries it, from its images while the vehicle drives. The job of `resight vehicle`.
//!
//! frames ─► pairs some tenths of a second apart ─► landmarks found again ─► `two_view` ─► `core::temporal::vehicle` ─► answer. Equations:
//! docs/math/vehicle.md.

mod speed;
mod pair;
mod lens;
mod words;
mod job;

pub use crate::answer::vehicle::VehicleAnswer;
use crate::core::Camera;
use crate::error::Error;
use crate::locate::IntrinsicsCovariance;
pub use job::{VehicleFrame, vehicle_from_frames, vehicle_from_images, vehicle_from_video};
pub use speed::{SpeedSample, read_speeds};
pub use words::describe;

/// The camera, and what is known of the drive.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleRequest {
    /// The camera.
    pub camera: Camera,
    /// The uncertainty of its intrinsics; `None` where they are exact.
    pub intrinsics: Option<IntrinsicsCovariance>,
    /// Speeds in order of time, of the frames' clock; empty where none are known.
    pub speeds: Vec<SpeedSample>,
    /// Standard deviation of their scale, as a share.
    pub speed_relative_sigma: f64,
    /// Time between the two frames of a pair, seconds; the interval of images where that is longer.
    pub every_s: f64,
    /// Largest mean number of false alarms in 24 hours of driving straight.
    pub false_alarms_per_day: f64,
    /// Rotations of the camera up to this raise no alarm, radians.
    pub tolerance_rad: f64,
}

impl VehicleRequest {
    /// A request with default settings.
    pub fn new(camera: Camera) -> Self {
        VehicleRequest {
            camera,
            intrinsics: None,
            speeds: Vec::new(),
            speed_relative_sigma: 0.02,
            every_s: 0.25,
            false_alarms_per_day: 1.0 / 30.0,
            tolerance_rad: 0.0,
        }
    }

    fn check(&self) -> Result<(), Error> {
        let is_positive = |x: f64| 0.0 < x && x.is_finite();
        if !is_positive(self.every_s) {
            return Err(Error::request(format!("every_s is {} s; it must be positive", self.every_s)));
        }
        let is_number = |sample: &SpeedSample| (sample.t_s + sample.speed_m_s).is_finite();
        if let Some(sample) = self.speeds.iter().find(|sample| !is_number(sample)) {
            let SpeedSample { t_s, speed_m_s } = sample;
            return Err(Error::request(format!(
                "the speed {speed_m_s} m/s at {t_s} s; both must be numbers"
            )));
        }
        if let Some(pair) = self.speeds.windows(2).find(|pair| pair[1].t_s < pair[0].t_s) {
            let (earlier, later) = (pair[1].t_s, pair[0].t_s);
            return Err(Error::request(format!(
                "the speed at {earlier} s stands below that at {later} s; speeds must be in order of time"
            )));
        }
        Ok(())
    }
}
