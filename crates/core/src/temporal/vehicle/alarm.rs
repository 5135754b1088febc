//! The direction of travel over time as readings of the change detector: docs/math/vehicle.md section 8.

use super::stretches::{Driven, Stretches, tangent};
use super::travel::{Travel, median};
use super::{FrameMotion, VehicleAxes};
use crate::temporal::monitor::learn::{LEAST_READINGS, LearnConfig, learn, unsettled};
use crate::temporal::monitor::{Drift, Monitor, MonitorConfig, Reading, Unsettled, Watch};
use crate::{Error, Matrix6, Pose, Vector6};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// Settings of the alarm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleAlarmConfig {
    /// Largest mean number of alarms in 24 hours of driving straight while nothing moves.
    pub false_alarms_per_day: f64,
    /// Pairs of frames within this time are one reading, seconds.
    pub period_s: f64,
    /// Readings from which the reference is learned.
    pub n_learn: usize,
    /// Rotations up to this raise no alarm, radians.
    pub tolerance_rad: f64,
}

impl Default for VehicleAlarmConfig {
    fn default() -> Self {
        VehicleAlarmConfig {
            false_alarms_per_day: 1.0 / 30.0,
            period_s: 1.0,
            n_learn: 40,
            tolerance_rad: 0.0,
        }
    }
}

/// What the change detector found.
#[derive(Debug, Clone, PartialEq)]
pub enum VehicleAlarm {
    /// Too few readings to learn the reference from.
    TooFew {
        /// Readings.
        seen: usize,
        /// Needed, to learn and then to compare.
        needed: usize,
    },
    /// The camera moved while the reference was learned.
    Unsettled(Box<Unsettled>),
    /// The camera stayed where it was.
    Steady {
        /// Whether the last state is steady; else the change detector checks a difference.
        is_steady: bool,
        /// Readings compared with the reference.
        compared: usize,
    },
    /// The camera moved.
    Moved {
        /// How it moved, as known at the end: its new frame in its old one, in the axes right, down, forward of the direction of travel. The
        /// rotation about the last, and the translation, are not seen.
        drift: Box<Drift>,
        /// When the alarm was raised, seconds.
        alarm_s: f64,
    },
}

/// Variance of what a direction does not determine (the rotation about it, and the translation) over that of what it does: it is read as zero, and has
/// no information.
const UNKNOWN: f64 = 1e4;
/// A drive has gaps without straight stretches, after which the state is not stale, seconds.
const NEVER_S: f64 = 1e9;
/// Standard deviations of slow changes of the body's attitude, by braking, speed and wind, and the time over which they are correlated.
const SLOW_PITCH_RAD: f64 = 0.001;
const SLOW_YAW_RAD: f64 = 0.0005;
const SLOW_S: f64 = 10.0;
/// Pairs in a reading at least.
const LEAST_PAIRS: usize = 2;

/// Compares the direction of travel on straight stretches, period by period, with that at the beginning.
///
/// # Errors
/// `InvalidSetting` for a rate, period or tolerance that cannot be.
pub fn vehicle_alarm(
    motions: &[FrameMotion],
    travel: &Travel,
    config: &VehicleAlarmConfig,
) -> Result<VehicleAlarm, Error> {
    let settings = MonitorConfig {
        false_alarms_per_day: config.false_alarms_per_day,
        decision_period_s: config.period_s,
        stale_after_s: NEVER_S,
        tolerance_rotation_rad: config.tolerance_rad,
        ..MonitorConfig::default()
    };
    settings.check()?;
    let readings = readings(&Stretches::new(motions), travel, config.period_s);
    let needed = config.n_learn.max(LEAST_READINGS);
    if readings.len() <= needed {
        return Ok(VehicleAlarm::TooFew { seen: readings.len(), needed: needed + 1 });
    }
    let (first, rest) = readings.split_at(needed);
    let learned = presumed(config);
    if let Some(found) = unsettled(first, &learned) {
        return Ok(VehicleAlarm::Unsettled(Box::new(found)));
    }
    let reference = learn(first, &learned)?;
    let mut monitor = Monitor::new(&reference, &settings, first[needed - 1].t_s)?;
    let (mut watch, mut alarm_s) = (Watch::Checking, None);
    for reading in rest {
        watch = monitor.push(reading);
        if matches!(watch, Watch::Drifted(_)) && alarm_s.is_none() {
            alarm_s = Some(reading.t_s);
        }
    }
    Ok(match (monitor.drift(), alarm_s) {
        (Some(drift), Some(alarm_s)) => VehicleAlarm::Moved { drift: Box::new(drift), alarm_s },
        _ => VehicleAlarm::Steady { is_steady: watch == Watch::Steady, compared: rest.len() },
    })
}

/// What a body does for longer than a reading, at least, besides what the first readings show: about the axes to the right and down.
fn presumed(config: &VehicleAlarmConfig) -> LearnConfig {
    let [pitch, yaw] = [SLOW_PITCH_RAD, SLOW_YAW_RAD].map(|sigma| sigma * sigma);
    let bias = Matrix6::from_diagonal(&Vector6::new(pitch, yaw, 0.0, 0.0, 0.0, 0.0));
    LearnConfig { bias, bias_time_s: SLOW_S.max(2.0 * config.period_s), diurnal: Matrix6::zeros() }
}

/// The mean of each period of straight motion.
fn readings(stretches: &Stretches, travel: &Travel, period_s: f64) -> Vec<Reading> {
    let straight: Vec<&Driven> = stretches.straight().collect();
    let axes = VehicleAxes::new(&travel.in_cam);
    let period = |driven: &&Driven| (driven.motion.t_s / period_s).floor();
    let mut readings: Vec<Reading> = straight
        .chunk_by(|a, b| period(a) == period(b))
        .filter(|chunk| LEAST_PAIRS <= chunk.len())
        .map(|chunk| reading(chunk, &axes, travel))
        .collect();
    widen(&mut readings);
    readings
}

/// In the axes right, down, forward of the direction of travel, in which what is not determined is one coordinate.
fn reading(chunk: &[&Driven], axes: &VehicleAxes, travel: &Travel) -> Reading {
    let n = chunk.len() as f64;
    let at =
        |k: usize| chunk.iter().map(|driven| tangent(axes, &driven.direction.in_cam)[k]).sum::<f64>() / n;
    let now = Vector3::new(-at(0), -at(1), 1.0);
    let level_from_travel =
        Rotation3::rotation_between(&Vector3::z(), &now).unwrap_or_else(Rotation3::identity);
    let own = chunk.iter().map(|driven| driven.direction.covariance).sum::<Matrix3<f64>>() / (n * n);
    // A rotation about the axis to the right moves the direction up, one about the axis down moves it to the right.
    let scatter = travel.scatter_rad.map(|s| s * s / n);
    let about_right = axes.up.dot(&(own * axes.up)) + scatter.y;
    let about_down = axes.left.dot(&(own * axes.left)) + scatter.x;
    let unknown = UNKNOWN * about_right.max(about_down);
    let variances = Vector6::new(about_right, about_down, unknown, unknown, unknown, unknown);
    Reading {
        t_s: chunk.iter().map(|driven| driven.motion.t_s).sum::<f64>() / n,
        a_from_b: Pose::new(level_from_travel.into_inner(), Vector3::zeros()),
        covariance: Matrix6::from_diagonal(&variances),
        is_consistent: true,
    }
}

/// Covariances scaled so that neighbours differ by as much as they state, in the median: a step is one difference of many.
fn widen(readings: &mut [Reading]) {
    let ratio = |pair: &[Reading]| {
        let y = (pair[0].a_from_b * pair[1].a_from_b.inverse()).log();
        let factor = (pair[0].covariance + pair[1].covariance).cholesky()?;
        Some(y.dot(&factor.solve(&y)))
    };
    // Median of χ² with two degrees of freedom.
    let scale = median(readings.windows(2).filter_map(ratio)) / (2.0 * core::f64::consts::LN_2);
    let scale = if scale.is_finite() { scale.clamp(0.1, 1e4) } else { 1.0 };
    readings.iter_mut().for_each(|reading| reading.covariance *= scale);
}
