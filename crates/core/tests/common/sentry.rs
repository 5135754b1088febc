//! What the drift change detector is tried on: streams of readings with all the errors of a real camera that stays, or moves as a test says.

use super::Rng;
use nalgebra::{Matrix6, Vector6};
use resight_core::Pose;
use resight_core::temporal::monitor::{DriftNoise, Monitor, MonitorConfig, Reading, Reference, Watch};

pub const DAY_S: f64 = 86_400.0;
/// σ of a reading: 0.05° and 2 mm.
pub const SIGMA: [f64; 6] = [8.7266e-4, 8.7266e-4, 8.7266e-4, 0.002, 0.002, 0.002];

pub fn errors(chance: &mut Rng, scale: f64) -> Vector6<f64> {
    Vector6::from_fn(|i, _| scale * SIGMA[i] * chance.normal())
}

pub fn covariance(scale: f64) -> Matrix6<f64> {
    Matrix6::from_diagonal(&Vector6::from(SIGMA.map(|s| (scale * s).powi(2))))
}

pub fn cam_from_target() -> Pose {
    Pose::exp(&Vector6::new(0.2, -0.7, 0.1, 0.3, -0.2, 2.5))
}

/// Sizes of everything that is no drift, in σ of a reading.
#[derive(Clone, Copy)]
pub struct Scene {
    pub reference: f64,
    pub bias: f64,
    pub bias_time_s: f64,
    pub diurnal: f64,
    pub period_s: f64,
}

/// A board's bias of 0.05° over two minutes, a diurnal variation of 0.025°.
pub const REALISTIC: Scene =
    Scene { reference: 0.3, bias: 1.0, bias_time_s: 120.0, diurnal: 0.5, period_s: 1.0 };
pub const WHITE: Scene = Scene { reference: 0.3, bias: 0.0, bias_time_s: 1.0, diurnal: 0.0, period_s: 1.0 };

impl Scene {
    pub fn reference(&self) -> Reference {
        let noise = DriftNoise {
            reference: covariance(self.reference),
            reading: covariance(1.0),
            bias: covariance(self.bias),
            bias_time_s: self.bias_time_s,
            diurnal: covariance(self.diurnal),
        };
        Reference { a_from_b: cam_from_target(), noise }
    }
}

/// A camera that stays, seen with all the errors of a scene; `camera_moved` is added by the test.
pub struct Stream {
    scene: Scene,
    chance: Rng,
    constant: Vector6<f64>,
    bias: Vector6<f64>,
    wobble: [Vector6<f64>; 2],
    pub t_s: f64,
}

impl Stream {
    pub fn new(scene: Scene, seed: u64) -> Self {
        let mut chance = Rng::new(seed);
        let constant = errors(&mut chance, scene.reference);
        let bias = errors(&mut chance, scene.bias);
        let wobble = [errors(&mut chance, scene.diurnal), errors(&mut chance, scene.diurnal)];
        Stream { scene, chance, constant, bias, wobble, t_s: 0.0 }
    }

    /// The next errors; in them it moves by `camera_moved`.
    pub fn next_motion(&mut self, camera_moved: &Vector6<f64>) -> Vector6<f64> {
        self.t_s += self.scene.period_s;
        let kept = (-self.scene.period_s / self.scene.bias_time_s).exp();
        self.bias = self.bias * kept + errors(&mut self.chance, self.scene.bias * (1.0 - kept * kept).sqrt());
        let (sin, cos) = (std::f64::consts::TAU * self.t_s / DAY_S).sin_cos();
        let errors = self.constant
            + self.bias
            + self.wobble[0] * cos
            + self.wobble[1] * sin
            + errors(&mut self.chance, 1.0);
        camera_moved + errors
    }

    pub fn next(&mut self, camera_moved: &Vector6<f64>) -> Reading {
        let old_from_new = Pose::exp(&self.next_motion(camera_moved));
        Reading {
            t_s: self.t_s,
            a_from_b: old_from_new.inverse() * cam_from_target(),
            covariance: covariance(1.0),
            is_consistent: true,
        }
    }
}

pub fn monitor(scene: &Scene, false_alarms_per_day: f64) -> Monitor {
    let config =
        MonitorConfig { false_alarms_per_day, decision_period_s: scene.period_s, ..MonitorConfig::default() };
    Monitor::new(&scene.reference(), &config, 0.0).expect("a monitor")
}

pub fn pan(degrees: f64) -> Vector6<f64> {
    Vector6::new(0.0, degrees.to_radians(), 0.0, 0.0, 0.0, 0.0)
}

/// Seconds from a change, after a quiet time, to its alarm, for each of `trials` whose alarm is not a false one before it.
pub fn delays_s(
    scene: Scene,
    rate: f64,
    quiet_s: f64,
    trials: std::ops::Range<u64>,
    moved: impl Fn(f64) -> Vector6<f64>,
) -> Vec<f64> {
    let delay = |trial: u64| {
        let (mut stream, mut detector) = (Stream::new(scene, 0xde1a_0000 + trial), monitor(&scene, rate));
        loop {
            let since_s = stream.t_s + scene.period_s - quiet_s;
            let motion = if since_s < 0.0 { Vector6::zeros() } else { moved(since_s) };
            if let Watch::Drifted(_) = detector.push(&stream.next(&motion)) {
                return since_s + scene.period_s;
            }
        }
    };
    trials.map(delay).filter(|delay| 0.0 < *delay).collect()
}

pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}
