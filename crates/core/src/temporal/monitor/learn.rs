//! The reference and its noise, learned from a stream while nothing moves.
//!
//! ```text
//!   y_t  motion of reading t from the mean    S = mean of y yᵀ    C₁ = mean of y_t y_{t+1}ᵀ, its symmetric part
//!   B = C₁ without its negative eigenvalues: what lasts from reading to reading       docs/math/monitor.md eqs. (14)–(16)
//! ```

use super::priors::{MEDIAN, OUTLIER};
pub use super::unsettled::LearnConfig;
use super::unsettled::{self, Sample, Unsettled};
use super::{DriftNoise, Reading, Reference};
use crate::{Error, Matrix6, Pose, Vector6};
use nalgebra::SymmetricEigen;

/// Readings needed.
pub const LEAST_READINGS: usize = 20;
/// Times 1/√n: no eigenvalue of the correlation of n independent readings with the next ones is larger, but for one in some hundreds.
const BY_CHANCE: f64 = 4.5;

/// Returns the motion of the camera amid these readings; none where they may be a reference. False findings are at most one in
/// `1 / FALSE_ALARM_PROBABILITY` tests, whatever correlated errors they have: docs/math/monitor.md section 8.
pub fn unsettled(readings: &[Reading], config: &LearnConfig) -> Option<Unsettled> {
    config.check().ok()?;
    let usable: Vec<(usize, &Reading)> =
        readings.iter().enumerate().filter(|(_, reading)| reading.is_consistent).collect();
    let poses: Vec<&Reading> = usable.iter().map(|(_, reading)| *reading).collect();
    if poses.len() < LEAST_READINGS {
        return None;
    }
    let centre = medoid(&poses);
    let sample = |reading: &&Reading| Sample {
        t_s: reading.t_s,
        motion: motion(&centre, reading),
        covariance: reading.covariance,
    };
    let samples: Vec<Sample> = poses.iter().map(sample).collect();
    let found = unsettled::find(&samples, config, 1)?;
    Some(unsettled::described(&found, &samples, config, usable[found.sample].0))
}

/// The mean pose with its covariance, and the correlated part of the scatter. Of readings amid which the camera moved (`unsettled`) this is the
/// mean of two poses, with a noise as wide as the motion.
///
/// # Errors
/// `TooFewPoints` for fewer than twenty readings that agree with each other; `InvalidSetting` where what is known beforehand makes
/// noise that is none: covariances that hold no numbers, a bias that is forgotten in no time.
pub fn learn(readings: &[Reading], config: &LearnConfig) -> Result<Reference, Error> {
    let too_few = |seen| Error::TooFewPoints { seen, needed: LEAST_READINGS };
    let usable: Vec<&Reading> = readings.iter().filter(|reading| reading.is_consistent).collect();
    if usable.len() < LEAST_READINGS {
        return Err(too_few(usable.len()));
    }
    let mut mean = medoid(&usable);
    let mut kept = usable.clone();
    for _ in 0..5 {
        let scatter = scatter(&mean, &kept);
        kept = usable.iter().copied().filter(|reading| is_near(&mean, reading, &scatter)).collect();
        if kept.len() < LEAST_READINGS {
            return Err(too_few(kept.len()));
        }
        let step = kept.iter().map(|reading| motion(&mean, reading)).sum::<Vector6>() / kept.len() as f64;
        mean = Pose::exp(&(-step)) * mean;
    }
    let learned = reference(&mean, &kept, config);
    learned.check().map(|()| learned)
}

/// y.
fn motion(mean: &Pose, reading: &Reading) -> Vector6 {
    (*mean * reading.a_from_b.inverse()).log()
}

/// The reading nearest to all others, of at most fifty looked at: it cannot be a flipped one while those are fewer than half.
fn medoid(readings: &[&Reading]) -> Pose {
    let stride = readings.len().div_ceil(50);
    let looked_at: Vec<&&Reading> = readings.iter().step_by(stride).collect();
    let distance = |from: &Reading| -> f64 {
        let of = |to: &&&Reading| {
            let y = motion(&from.a_from_b, to);
            (0..6).map(|i| y[i].powi(2) / to.covariance[(i, i)]).sum::<f64>().sqrt()
        };
        looked_at.iter().map(of).sum()
    };
    let distances: Vec<f64> = looked_at.iter().map(|reading| distance(reading)).collect();
    let nearest = (0..looked_at.len()).min_by(|i, j| distances[*i].total_cmp(&distances[*j])).unwrap_or(0);
    looked_at[nearest].a_from_b
}

/// What readings scatter by, robustly: the stated covariance, scaled so that half of them lie within the median of χ².
fn scatter(mean: &Pose, readings: &[&Reading]) -> f64 {
    let mut chi2: Vec<f64> = readings.iter().filter_map(|reading| chi2(mean, reading)).collect();
    chi2.sort_by(f64::total_cmp);
    chi2.get(chi2.len() / 2).map_or(1.0, |median| (median / MEDIAN).max(1.0))
}

fn chi2(mean: &Pose, reading: &Reading) -> Option<f64> {
    let y = motion(mean, reading);
    Some(y.dot(&reading.covariance.cholesky()?.solve(&y)))
}

fn is_near(mean: &Pose, reading: &Reading, scatter: &f64) -> bool {
    chi2(mean, reading).is_some_and(|chi2| chi2 < OUTLIER * scatter)
}

fn reference(mean: &Pose, kept: &[&Reading], config: &LearnConfig) -> Reference {
    let n = kept.len() as f64;
    let y: Vec<Vector6> = kept.iter().map(|reading| motion(mean, reading)).collect();
    let total = y.iter().map(|y| y * y.transpose()).sum::<Matrix6>() / n;
    let stated = kept.iter().map(|reading| reading.covariance).sum::<Matrix6>() / n;
    let lagged = |lag: usize| {
        let sum: Matrix6 = y.iter().zip(&y[lag..]).map(|(now, later)| now * later.transpose()).sum();
        (sum + sum.transpose()) / (2.0 * (y.len() - lag) as f64)
    };
    let bias = significant(&lagged(1), &total, y.len()) + config.bias;
    let span_s = kept[kept.len() - 1].t_s - kept[0].t_s;
    let bias_time_s = memory_s(&lagged, &stated, y.len(), span_s).max(config.bias_time_s);
    // The mean of correlated errors τ over a span T errs like one of T/2τ independent ones.
    let independent = (0.5 * span_s / bias_time_s).max(1.0);
    let noise = DriftNoise {
        reference: total.map(|v| v / n) + stated / n + bias / independent,
        reading: stated,
        bias,
        bias_time_s,
        diurnal: config.diurnal,
    };
    Reference { a_from_b: *mean, noise }
}

/// The part of a symmetric matrix with positive eigenvalues, in units of the scatter `total`; of those only what chance does not give:
/// white noise makes the largest of six about 2 √(6/2n).
fn significant(matrix: &Matrix6, total: &Matrix6, n: usize) -> Matrix6 {
    let scale = total.diagonal().map(|v| v.abs().sqrt().max(1e-12));
    let eigen = SymmetricEigen::new(Matrix6::from_fn(|i, j| matrix[(i, j)] / (scale[i] * scale[j])));
    let least = BY_CHANCE / (n as f64).sqrt();
    let kept = eigen.eigenvectors
        * Matrix6::from_diagonal(&eigen.eigenvalues.map(|v| if least < v { v } else { 0.0 }))
        * eigen.eigenvectors.transpose();
    Matrix6::from_fn(|i, j| kept[(i, j)] * scale[i] * scale[j])
}

/// The lag at which the autocorrelation, in units of the stated noise, has fallen to 1/e of that at the first lag.
fn memory_s(lagged: &impl Fn(usize) -> Matrix6, stated: &Matrix6, n: usize, span_s: f64) -> f64 {
    let size = |lag: usize| (0..6).map(|i| lagged(lag)[(i, i)] / stated[(i, i)]).sum::<f64>();
    let first = size(1);
    let forgotten = (2..n / 2).find(|lag| size(*lag) < first / std::f64::consts::E);
    forgotten.unwrap_or(n / 2) as f64 * span_s / (n - 1) as f64
}
