//! What the measured noise is, and which motion it lets the monitor promise to find.

use super::axis::AXES;
pub use super::bank::CorrelatedError;
use super::bank::{AxisBank, Passed};
use super::models::{DIRECTIONS, GRID};
use crate::{Matrix6, Vector6};
use arrayvec::ArrayVec;

/// The noise of the readings, as far as it is measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredNoise {
    /// Standard deviation of a reading's own noise over the stated one.
    pub sigma_ratio: f64,
    /// Its own standard deviation.
    pub sigma_ratio_sigma: f64,
    /// Correlated errors from reading to reading, where they explain the readings better than white noise does: of the coordinate in which
    /// they are largest.
    pub correlated: Option<CorrelatedError>,
    /// Readings that it was measured from, at most 200: older ones are forgotten.
    pub readings: usize,
}

impl MeasuredNoise {
    /// Whether the stated noise is wrong by more than a fifth, and by more than chance: then a look at `sigma_px` is worth while.
    pub fn contradicts_stated(&self) -> bool {
        let off = self.sigma_ratio.ln().abs();
        FAR.ln() < off && 4.0 * self.sigma_ratio_sigma / self.sigma_ratio < off
    }
}

/// The ratio of standard deviations from which on it is reported.
const FAR: f64 = 1.2;

/// The smallest sudden motions that are found within a time, nine times in ten, whatever errors the readings have not excluded yet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Detectable {
    /// The time, seconds.
    pub within_s: f64,
    /// A rotation about x, y and z alone, radians.
    pub rotation_rad: [f64; 3],
    /// A translation along x, y and z alone, metres.
    pub translation_m: [f64; 3],
}

/// Motions that ended by themselves, more of them than the promised rate of false alarms explains, and which motions are held for that.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Recurrence {
    /// How many were counted.
    pub count: u64,
    /// A motion below these is reported only when it has lasted for so long, seconds.
    pub held_s: f64,
    /// A rotation about x, y and z alone, radians.
    pub rotation_rad: [f64; 3],
    /// A translation along x, y and z alone, metres.
    pub translation_m: [f64; 3],
}

/// Errors for which no rate of false alarms is promised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unpromised {
    /// Those of hours that were not watched yet, as of the first night.
    UnwatchedHours {
        /// Seconds that were watched, less than a day.
        watched_s: f64,
    },
    /// Motions came back by themselves: disturbances that come and go look like these.
    Returning {
        /// How many did.
        count: u64,
    },
    /// Readings contradict their noise, as in rain: those that do so too little to be left out are further off, too.
    Contradictions {
        /// The share that does.
        share: f64,
    },
    /// Errors are as the readings before them had excluded.
    ChangedErrors,
}

/// The share of contradictions from which on they are a disturbance.
pub(super) const MANY: f64 = 0.15;

/// Readings that are followed one by one; of more, several count as one.
const FOLLOWED: usize = 128;
/// The statistic of a mean motion is exceeded by half of them; nine in ten do with this much more, in standard deviations of it.
const NINE_IN_TEN: f64 = 1.28;
/// Of a range of 10¹² to a hundredth.
const HALVINGS: usize = 12;
/// What six coordinates lose on average to the errors that fit each by chance, nats.
const FITTED: f64 = 5.0;

/// What is asked for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Promise {
    pub within_s: f64,
    /// ln of what R must reach for a single onset.
    pub log_threshold: f64,
    /// The time that an onset of weight one stands for, seconds.
    pub period_s: f64,
    /// Whether errors that are excluded, or presumed to be none, count where they explain a motion in spite of that.
    pub are_counted: bool,
}

/// With the unit of the time constants and the time between readings, seconds.
pub(super) fn detectable(
    banks: &[AxisBank; AXES],
    (unit_s, between_s): (f64, f64),
    whitened_from_motion: &Matrix6,
    promise: &Promise,
) -> Detectable {
    let within_s = promise.within_s;
    let n = (within_s / between_s).floor().clamp(1.0, 1e6);
    let followed = n.min(FOLLOWED as f64);
    let (elapsed_s, joined) = (between_s * n / followed, n / followed);
    let passed = Passed::new(elapsed_s, unit_s);
    let mut possible: [_; AXES] =
        std::array::from_fn(|axis| banks[axis].possible(&passed, followed as usize, joined));
    if !promise.are_counted {
        possible.iter_mut().for_each(|all| all.retain(|(_, behind)| *behind == 0.0));
    }
    // A mean of E nats scatters by √2E.
    let root = NINE_IN_TEN + (NINE_IN_TEN * NINE_IN_TEN + 2.0 * (promise.log_threshold + FITTED)).sqrt();
    let size = |coordinate: usize| {
        let along: Vector6 = whitened_from_motion.column(coordinate).into();
        smallest(&possible, &along, 0.5 * root * root)
    };
    Detectable {
        within_s,
        rotation_rad: std::array::from_fn(size),
        translation_m: std::array::from_fn(|i| size(3 + i)),
    }
}

/// The size along a direction at which even the models that explain the step best leave so many nats for it.
fn smallest(
    possible: &[ArrayVec<(f64, f64), { GRID + DIRECTIONS.len() }>; AXES],
    along: &Vector6,
    needed: f64,
) -> f64 {
    let nats = |size: f64| -> f64 {
        let of_axis = |axis: usize| -> f64 {
            let square = 0.5 * (size * along[axis]).powi(2);
            possible[axis].iter().map(|(d, behind)| square * d + behind).fold(f64::INFINITY, f64::min)
        };
        (0..AXES).map(of_axis).sum()
    };
    // A motion of one in whitened coordinates is about a standard deviation of a reading.
    let unit = 1.0 / along.norm().max(f64::MIN_POSITIVE);
    let (mut low, mut high) = (1e-6 * unit, 1e6 * unit);
    for _ in 0..HALVINGS {
        let middle = (low * high).sqrt();
        if nats(middle) < needed { low = middle } else { high = middle }
    }
    high
}

/// What the noise is, of all coordinates together.
pub(super) fn noise(banks: &[AxisBank; AXES], unit_s: f64) -> MeasuredNoise {
    let scale = banks.iter().map(|bank| bank.scale().ln()).sum::<f64>() / AXES as f64;
    let readings = banks[0].readings();
    let sigma_ratio = (0.5 * scale).exp();
    let correlated = banks.iter().filter_map(|bank| bank.correlated(unit_s));
    let larger = |a: &CorrelatedError, b: &CorrelatedError| a.sigma_ratio.total_cmp(&b.sigma_ratio);
    MeasuredNoise {
        sigma_ratio,
        sigma_ratio_sigma: sigma_ratio / (2.0 * AXES as f64 * readings.max(1.0)).sqrt(),
        correlated: correlated.max_by(larger),
        readings: readings as usize,
    }
}
