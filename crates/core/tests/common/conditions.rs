//! What a camera that stays is watched through: a tag whose corners err in all the ways that are met, none of them declared.

use super::Rng;
use nalgebra::{Matrix6, SMatrix, SVector, Vector6};
use resight_core::Pose;
use resight_core::locate::consistency::is_inconsistent;
use resight_core::temporal::monitor::learn::{LearnConfig, learn};
use resight_core::temporal::monitor::{DriftNoise, Monitor, MonitorConfig, Reading, Reference, Watch};

pub const DAY_S: f64 = 86_400.0;
/// Stated noise of a corner, pixels.
pub const SIGMA_PX: f64 = 0.2;

/// A tag and the camera that sees it.
#[derive(Debug, Clone, Copy)]
pub struct View {
    focal_px: f64,
    half_tag_m: f64,
    cam_from_target: Pose,
}

impl View {
    /// 0.2 m at 2 m.
    pub fn far() -> Self {
        View { focal_px: 900.0, half_tag_m: 0.1, cam_from_target: cam_from_target() }
    }

    /// 0.16 m at 1.2 m.
    pub fn near() -> Self {
        let cam_from_target = Pose::exp(&Vector6::new(0.45, -0.35, 0.1, 0.28, 0.26, 1.15));
        View { focal_px: 1000.0, half_tag_m: 0.08, cam_from_target }
    }
}

/// Errors of corners, and motions that are none of the camera's mounting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Condition {
    White,
    /// The stated sigma is so many times too small.
    Understated(f64),
    /// Twice as noisy from 18 to 6 o'clock.
    NightDoubled,
    /// Every corner's error is an AR(1) process of that time constant for that share of its variance.
    Correlated {
        share: f64,
        time_s: f64,
    },
    /// A sine of the camera about its y axis, degrees, seconds.
    Sine {
        amplitude_deg: f64,
        period_s: f64,
    },
    /// All corners off by so much in one direction, for a time, beginning so often a day.
    Biased {
        px: f64,
        for_s: f64,
        per_day: f64,
        corners: usize,
    },
    /// Student's t of so many degrees of freedom.
    HeavyTails(f64),
    /// A random walk of the camera about its x axis, reflected at a limit.
    LimitedWalk {
        deg_per_sqrt_h: f64,
        limit_deg: f64,
    },
    /// Correlated errors and a daily sine.
    CorrelatedAndDaily,
    /// A reading a second, and for every second hour one in ten.
    ChangingRate,
    /// A lamp flickers from 18 to 6 o'clock: while it is bright (20 s in the mean, dark for 40 s) the corners bloom outward by so many pixels.
    Flicker(f64),
    /// An insect sits on one corner for five minutes in the mean, once an hour, and puts it off by so many pixels.
    Insect(f64),
    /// Twenty minutes of every two hours: one corner in ten is off by half a pixel to three, and drops on the glass put all of them off by
    /// so many pixels for half a minute in the mean.
    Rain(f64),
    /// As `Correlated`, from 18 to 6 o'clock.
    CorrelatedAtNight {
        share: f64,
        time_s: f64,
    },
    /// From 18 to 6 o'clock the infrared filter is off: the image is shifted by so many pixels, and larger by three in ten thousand.
    Infrared(f64),
    /// A video of a still scene: errors of so many pixels, others from each key frame on, and a tenth of that from frame to frame.
    KeyFrames {
        px: f64,
        every_s: f64,
    },
}

impl Condition {
    /// Whether a reading whose corners contradict each other is left out, as by a session.
    fn is_judged(&self) -> bool {
        matches!(
            self,
            Condition::Flicker(_)
                | Condition::Insect(_)
                | Condition::Rain(_)
                | Condition::CorrelatedAtNight { .. }
                | Condition::Infrared(_)
                | Condition::KeyFrames { .. }
        )
    }
}

/// A camera that stays and a tag, a reading every `period_s`.
pub struct Scene {
    view: View,
    condition: Condition,
    chance: Rng,
    /// Motion of the camera from errors of the corners.
    motion_from_corners: SMatrix<f64, 6, 8>,
    corners_from_motion: SMatrix<f64, 8, 6>,
    covariance: Matrix6<f64>,
    persistent: SVector<f64, 8>,
    walk_deg: f64,
    biased_until_s: f64,
    is_biased: bool,
    bias: SVector<f64, 8>,
    phase: f64,
    period_s: f64,
    /// Of the corners' variance, what the readings state.
    stated_share: f64,
    /// Variance of the corners over the stated one, as a monitor measures it: corners that contradict each other are judged by it.
    pub measured_variance: f64,
    pub t_s: f64,
}

pub fn cam_from_target() -> Pose {
    Pose::exp(&Vector6::new(0.45, -0.5, 0.1, 0.2, -0.1, 2.0))
}

/// Corners in pixels, relative to the principal point.
fn corners(view: &View, pose: &Pose) -> SVector<f64, 8> {
    let mut all = SVector::<f64, 8>::zeros();
    for (i, (x, y)) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].into_iter().enumerate() {
        let p = pose.rotation * nalgebra::Vector3::new(view.half_tag_m * x, view.half_tag_m * y, 0.0)
            + pose.translation;
        all[2 * i] = view.focal_px * p.x / p.z;
        all[2 * i + 1] = view.focal_px * p.y / p.z;
    }
    all
}

impl Scene {
    pub fn new(condition: Condition, period_s: f64, seed: u64) -> Self {
        Scene::of(View::far(), condition, period_s, seed)
    }

    pub fn of(view: View, condition: Condition, period_s: f64, seed: u64) -> Self {
        let pose = view.cam_from_target;
        let mut jacobian = SMatrix::<f64, 8, 6>::zeros();
        for i in 0..6 {
            let step = |h: f64| corners(&view, &(Pose::exp(&Vector6::ith(i, h)) * pose));
            jacobian.set_column(i, &((step(1e-5) - step(-1e-5)) / 2e-5));
        }
        let inverse = (jacobian.transpose() * jacobian).try_inverse().expect("six motions");
        let mut chance = Rng::new(seed);
        let persistent = SVector::from_fn(|_, _| chance.normal());
        let phase = chance.uniform(0.0, 1.0);
        Scene {
            view,
            condition,
            motion_from_corners: inverse * jacobian.transpose(),
            corners_from_motion: jacobian,
            covariance: inverse * SIGMA_PX * SIGMA_PX,
            persistent,
            walk_deg: 0.0,
            biased_until_s: f64::MIN,
            is_biased: false,
            bias: SVector::zeros(),
            phase,
            period_s,
            stated_share: 1.0,
            measured_variance: 1.0,
            t_s: 0.0,
            chance,
        }
    }

    /// Standard deviations of a reading, `[rotation_rad; translation_m]`.
    pub fn sigma(&self) -> Vector6<f64> {
        self.covariance.diagonal().map(f64::sqrt)
    }

    fn white(&mut self) -> SVector<f64, 8> {
        SVector::from_fn(|_, _| self.chance.normal())
    }

    /// AR(1) of unit variance.
    fn correlated(&mut self, time_s: f64, elapsed_s: f64) -> SVector<f64, 8> {
        let kept = (-elapsed_s / time_s).exp();
        let fresh = self.white();
        self.persistent = self.persistent * kept + fresh * (1.0 - kept * kept).sqrt();
        self.persistent
    }

    /// Whether it is night, from 18 to 6 o'clock; sessions begin at noon.
    fn is_night(&self) -> bool {
        !(6.0..18.0).contains(&((self.t_s / 3600.0 + 12.0) % 24.0))
    }

    /// Whether something that comes for `on_s` and goes for `off_s` in the mean has just come or gone.
    fn toggles(&mut self, on_s: f64, off_s: f64) -> bool {
        let is_due = self.biased_until_s <= self.t_s;
        if is_due {
            self.is_biased = !self.is_biased && 0.0 < self.biased_until_s;
            let mean_s = if self.is_biased { on_s } else { off_s };
            self.biased_until_s = self.t_s.max(0.0) - mean_s * (1.0 - self.chance.uniform(0.0, 1.0)).ln();
        }
        is_due
    }

    /// A corner displaced by so many pixels in any direction, in units of the stated sigma.
    fn displace(&mut self, errors: &mut SVector<f64, 8>, corner: usize, px: f64) {
        let (sin, cos) = (std::f64::consts::TAU * self.chance.uniform(0.0, 1.0)).sin_cos();
        errors[2 * corner] += cos * px / SIGMA_PX;
        errors[2 * corner + 1] += sin * px / SIGMA_PX;
    }

    /// Errors of the corners in units of the stated sigma, and a motion of the camera.
    fn errors(&mut self, elapsed_s: f64) -> (SVector<f64, 8>, Vector6<f64>) {
        let still = Vector6::zeros();
        let about = |axis: usize, degrees: f64| Vector6::ith(axis, degrees.to_radians());
        let turn =
            |t_s: f64, period_s: f64, phase: f64| (std::f64::consts::TAU * (t_s / period_s + phase)).sin();
        match self.condition {
            Condition::White | Condition::ChangingRate => (self.white(), still),
            Condition::Understated(factor) => (self.white() * factor, still),
            Condition::NightDoubled => {
                let factor = if self.is_night() { 2.0 } else { 1.0 };
                (self.white() * factor, still)
            }
            Condition::Correlated { share, time_s } => {
                let persistent = self.correlated(time_s, elapsed_s) * share.sqrt();
                (self.white() * (1.0 - share).sqrt() + persistent, still)
            }
            Condition::Sine { amplitude_deg, period_s } => {
                let degrees = amplitude_deg * turn(self.t_s, period_s, self.phase);
                (self.white(), about(1, degrees))
            }
            Condition::Biased { px, for_s, per_day, corners } => {
                let chance = self.chance.uniform(0.0, 1.0);
                if self.biased_until_s < self.t_s {
                    self.bias = SVector::zeros();
                    if chance < per_day * elapsed_s / DAY_S {
                        self.biased_until_s = self.t_s + for_s;
                        let (sin, cos) = (std::f64::consts::TAU * self.chance.uniform(0.0, 1.0)).sin_cos();
                        for corner in 0..corners {
                            self.bias[2 * corner] = cos * px / SIGMA_PX;
                            self.bias[2 * corner + 1] = sin * px / SIGMA_PX;
                        }
                    }
                }
                (self.white() + self.bias, still)
            }
            Condition::HeavyTails(freedom) => {
                let n = freedom as usize;
                let mut student = |_, _| {
                    let chi2: f64 = (0..n).map(|_| self.chance.normal().powi(2)).sum();
                    self.chance.normal() / (chi2 / freedom).sqrt()
                };
                (SVector::from_fn(&mut student), still)
            }
            Condition::LimitedWalk { deg_per_sqrt_h, limit_deg } => {
                self.walk_deg += deg_per_sqrt_h * (elapsed_s / 3600.0).sqrt() * self.chance.normal();
                if limit_deg < self.walk_deg.abs() {
                    self.walk_deg = self.walk_deg.signum() * (2.0 * limit_deg - self.walk_deg.abs());
                }
                (self.white(), about(0, self.walk_deg))
            }
            Condition::CorrelatedAndDaily => {
                let persistent = self.correlated(120.0, elapsed_s) * 0.5_f64.sqrt();
                let degrees = 0.02 * turn(self.t_s, DAY_S, self.phase);
                (self.white() * 0.5_f64.sqrt() + persistent, about(1, degrees))
            }
            Condition::Flicker(px) => {
                self.toggles(20.0, 40.0);
                let seen = corners(&self.view, &self.view.cam_from_target);
                let centre = |axis: usize| (0..4).map(|i| seen[2 * i + axis]).sum::<f64>() / 4.0;
                let (x, y) = (centre(0), centre(1));
                let outward = SVector::<f64, 8>::from_fn(|i, _| {
                    let (dx, dy) = (seen[i / 2 * 2] - x, seen[i / 2 * 2 + 1] - y);
                    if i % 2 == 0 { dx / dx.hypot(dy) } else { dy / dx.hypot(dy) }
                });
                let bloom = if self.is_biased && self.is_night() { px / SIGMA_PX } else { 0.0 };
                (self.white() + outward * bloom, still)
            }
            Condition::Insect(px) => {
                if self.toggles(300.0, 3300.0) {
                    let corner = self.chance.index(4);
                    let mut off = SVector::zeros();
                    self.displace(&mut off, corner, px);
                    self.bias = if self.is_biased { off } else { SVector::zeros() };
                }
                (self.white() + self.bias, still)
            }
            Condition::Rain(px) => {
                let mut errors = self.white();
                if 6000.0 < self.t_s % 7200.0 {
                    for corner in 0..4 {
                        if self.chance.uniform(0.0, 1.0) < 0.1 {
                            let off = self.chance.uniform(0.5, 3.0);
                            self.displace(&mut errors, corner, off);
                        }
                    }
                    if self.toggles(30.0, 30.0) {
                        self.bias = self.white() * (px / SIGMA_PX);
                    }
                    errors += self.bias;
                }
                (errors, still)
            }
            Condition::CorrelatedAtNight { share, time_s } => {
                let persistent = self.correlated(time_s, elapsed_s) * share.sqrt();
                let white = self.white();
                let errors = if self.is_night() { white * (1.0 - share).sqrt() + persistent } else { white };
                (errors, still)
            }
            Condition::Infrared(px) => {
                let seen = corners(&self.view, &self.view.cam_from_target);
                let shift = |i: usize| if i.is_multiple_of(2) { px } else { -0.5 * px };
                let off = SVector::<f64, 8>::from_fn(|i, _| (shift(i) + 3e-4 * seen[i]) / SIGMA_PX);
                let errors = self.white() + if self.is_night() { off } else { SVector::zeros() };
                (errors, still)
            }
            Condition::KeyFrames { px, every_s } => {
                if self.biased_until_s <= self.t_s {
                    self.biased_until_s = ((self.t_s / every_s).floor() + 1.0) * every_s;
                    self.bias = self.white() * (px / SIGMA_PX);
                }
                (self.white() * (0.1 * px / SIGMA_PX) + self.bias, still)
            }
        }
    }

    /// The next reading; in it the camera has moved by `moved` besides.
    pub fn next(&mut self, moved: &Vector6<f64>) -> Reading {
        let is_slow = self.condition == Condition::ChangingRate && (self.t_s / 3600.0) as u64 % 2 == 1;
        let elapsed_s = self.period_s * if is_slow { 10.0 } else { 1.0 };
        self.t_s += elapsed_s;
        let (corners, turned) = self.errors(elapsed_s);
        let fitted = self.motion_from_corners * corners;
        let chi2 = (corners - self.corners_from_motion * fitted).norm_squared() / self.measured_variance;
        let motion = fitted * SIGMA_PX + turned + moved;
        Reading {
            t_s: self.t_s,
            a_from_b: Pose::exp(&-motion) * self.view.cam_from_target,
            covariance: self.covariance * self.stated_share,
            is_consistent: !(self.condition.is_judged() && is_inconsistent(chi2, 2)),
        }
    }

    /// A monitor as a session makes it: the reference learned from the next readings, nothing declared.
    pub fn learned(&mut self, readings: usize, config: &MonitorConfig) -> Monitor {
        let readings: Vec<Reading> = (0..readings).map(|_| self.next(&Vector6::zeros())).collect();
        let nothing = LearnConfig { bias: Matrix6::zeros(), bias_time_s: 60.0, diurnal: Matrix6::zeros() };
        let reference = learn(&readings, &nothing).expect("a reference");
        let mut monitor = Monitor::new(&reference, config, self.t_s).expect("a monitor");
        monitor.measure_noise(&readings);
        monitor
    }

    /// A monitor that is told the errors as they are, its reference the mean of as many readings.
    pub fn known(&mut self, readings: usize, config: &MonitorConfig) -> Monitor {
        let mut sum = Vector6::zeros();
        for _ in 0..readings {
            sum += (self.view.cam_from_target * self.next(&Vector6::zeros()).a_from_b.inverse()).log();
        }
        let (share, bias_time_s) = match self.condition {
            Condition::Correlated { share, time_s } => (share, time_s),
            _ => (0.0, 1.0),
        };
        self.stated_share = 1.0 - share;
        let n = readings as f64;
        let independent = (n * self.period_s / (2.0 * bias_time_s)).max(1.0);
        let noise = DriftNoise {
            reference: self.covariance * ((1.0 - share) / n + share / independent),
            reading: self.covariance * (1.0 - share),
            bias: self.covariance * share,
            bias_time_s,
            diurnal: Matrix6::zeros(),
        };
        let a_from_b = Pose::exp(&(-sum / n)) * self.view.cam_from_target;
        Monitor::new(&Reference { a_from_b, noise }, config, self.t_s).expect("a monitor")
    }
}

/// Alarms while nothing moves: each drift that is reported for the first time. One that does not come back within a quarter of an hour is
/// accepted, so that there may be another.
pub fn alarms(condition: Condition, period_s: f64, rate: f64, days: f64, seed: u64) -> u32 {
    let mut scene = Scene::new(condition, period_s, seed);
    let config = MonitorConfig { false_alarms_per_day: rate, ..MonitorConfig::default() };
    let mut monitor = scene.learned(50, &config);
    let readings = std::iter::from_fn(|| (scene.t_s < days * DAY_S).then(|| scene.next(&Vector6::zeros())));
    alarms_among(readings, &mut monitor)
}

/// Drifts that are reported for the first time; one that does not come back within a quarter of an hour is accepted.
pub fn alarms_among(readings: impl Iterator<Item = Reading>, monitor: &mut Monitor) -> u32 {
    let (mut alarms, mut since_s) = (0, None);
    for reading in readings {
        let is_drifted = matches!(monitor.push(&reading), Watch::Drifted(_));
        match since_s {
            None if is_drifted => (alarms, since_s) = (alarms + 1, Some(reading.t_s)),
            Some(_) if monitor.drift().is_none() => since_s = None,
            Some(began_s) if 900.0 < reading.t_s - began_s => {
                monitor.accept().expect("accepted");
                since_s = None;
            }
            _ => {}
        }
    }
    alarms
}
