//! What the drift change detector is compared with, for white noise of one σ around a reference that is known exactly: what the best test tends
//! to, the CUSUM tuned to the step's size, and three readings in a row beyond a threshold, which is what many do.
//!
//! ```text
//!   δ  step, in σ of a reading      A  readings between false alarms      both watch six coordinates to both sides: 12 A for each
//! ```

use super::Rng;
use resight_core::statistics::normal::upper_tail;

/// Six coordinates, two sides.
const SIDES: f64 = 12.0;

/// ln A/I with I = δ²/2: what the least mean delay, readings, tends to for large A when size, coordinate and side are known (Lorden).
pub fn lorden(delta: f64, between: f64) -> f64 {
    between.ln() / (0.5 * delta * delta)
}

/// Readings between false alarms of a CUSUM of log-likelihood ratios with threshold h: (e^b − b − 1)/I with b = h + 1.166 δ
/// (Siegmund, Sequential Analysis, 1985: the overshoot taken as 0.583 at either end).
pub fn between_alarms_of_cusum(delta: f64, threshold: f64) -> f64 {
    let b = threshold + 1.166 * delta;
    (b.exp() - b - 1.0) / (0.5 * delta * delta)
}

/// The threshold for so many readings between false alarms on all sides together.
pub fn cusum_threshold(delta: f64, between: f64) -> f64 {
    bisect(-1.166 * delta, 100.0, |h| between_alarms_of_cusum(delta, h) < SIDES * between)
}

/// The same by simulation of one side while nothing happens.
pub fn cusum_between_alarms(delta: f64, threshold: f64, alarms: usize) -> f64 {
    let (mut chance, mut sum, mut n, mut raised) = (Rng::new(0xa1a5), 0.0_f64, 0_u64, 0);
    while raised < alarms {
        sum = (sum + delta * (chance.normal() - 0.5 * delta)).max(0.0);
        n += 1;
        if threshold <= sum {
            (sum, raised) = (0.0, raised + 1);
        }
    }
    n as f64 / alarms as f64
}

/// Readings from a step after `quiet` readings to the CUSUM's alarm.
pub fn cusum_delays(delta: f64, threshold: f64, quiet: usize, trials: u64) -> Vec<f64> {
    let delay = |trial: u64| {
        let (mut chance, mut sum, mut n) = (Rng::new(0xc050_0000 + trial), 0.0_f64, 0);
        loop {
            let step = if n < quiet { 0.0 } else { delta };
            sum = (sum + delta * (chance.normal() + step - 0.5 * delta)).max(0.0);
            n += 1;
            if threshold <= sum {
                return n as f64 - quiet as f64;
            }
        }
    };
    (0..trials).map(delay).filter(|delay| 0.0 < *delay).collect()
}

/// Mean and 90 % quantile of the delay, readings, of an alarm at three readings in a row beyond a threshold.
pub fn three_in_a_row(delta: f64, between: f64) -> (f64, f64) {
    let p = upper_tail(three_threshold(between) - delta);
    // Probability of having seen 0, 1, 2 in a row.
    let (mut in_a_row, mut alarmed, mut n) = ([1.0, 0.0, 0.0], 0.0, 0.0);
    while alarmed < 0.9 && n < 1e7 {
        alarmed += p * in_a_row[2];
        in_a_row = [(1.0 - p) * in_a_row.iter().sum::<f64>(), p * in_a_row[0], p * in_a_row[1]];
        n += 1.0;
    }
    (mean_run(p), n)
}

/// The threshold, in σ, that any of the sides exceeds three times in a row once in so many readings.
pub fn three_threshold(between: f64) -> f64 {
    let q = bisect(1e-9, 0.5, |q| SIDES * between < mean_run(q));
    bisect(0.0, 10.0, |k| q < upper_tail(k))
}

/// Alarms of the CUSUM and of three in a row in a stream of six coordinates, in σ: each begins anew after its own.
pub fn alarms(
    delta: f64,
    between: f64,
    readings: impl Iterator<Item = nalgebra::Vector6<f64>>,
) -> (usize, usize) {
    let (high, beyond) = (cusum_threshold(delta, between), three_threshold(between));
    let (mut sums, mut runs, mut reported) = ([[0.0_f64; 6]; 2], [[0; 6]; 2], (0, 0));
    for y in readings {
        for (side, sign) in [1.0, -1.0].into_iter().enumerate() {
            for axis in 0..6 {
                let value = sign * y[axis];
                sums[side][axis] = (sums[side][axis] + delta * (value - 0.5 * delta)).max(0.0);
                runs[side][axis] = if beyond < value { runs[side][axis] + 1 } else { 0 };
            }
        }
        if sums.as_flattened().iter().any(|sum| high <= *sum) {
            (sums, reported.0) = (Default::default(), reported.0 + 1);
        }
        if runs.as_flattened().iter().any(|run| 3 <= *run) {
            (runs, reported.1) = (Default::default(), reported.1 + 1);
        }
    }
    reported
}

/// Mean readings until three in a row of probability q each.
fn mean_run(q: f64) -> f64 {
    (1.0 - q.powi(3)) / ((1.0 - q) * q.powi(3))
}

/// Where a condition that holds at `low` and not at `high` ends.
fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if holds(middle) { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}
