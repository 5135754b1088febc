//! The sequential test on one stream of poses: whitened coordinates, one filter each, one statistic for all.

use super::axis::{AxisFilter, AxisNoise, Transition};
use super::onsets::{AXES, Change, Onsets};
use crate::Error;
use crate::covariance::is_covariance;
use crate::snapshot::numbers;
use nalgebra::{Matrix6, SymmetricEigen, Vector6};

/// What is no drift, for the six coordinates of the small motion `[rotation_rad; translation_m]`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriftNoise {
    /// Covariance of the reference.
    pub reference: Matrix6<f64>,
    /// Covariance of one reading, typical; it gives the coordinates in which readings are independent.
    pub reading: Matrix6<f64>,
    /// Covariance of the error that lasts from reading to reading.
    pub bias: Matrix6<f64>,
    /// The time in which that error is forgotten, seconds.
    pub bias_time_s: f64,
    /// Covariance of the daily wobble.
    pub daily: Matrix6<f64>,
}

/// Beyond this, products of variances leave the range of numbers.
pub(super) const MOST_VARIANCE: f64 = 1e100;

impl DriftNoise {
    /// # Errors
    /// `InvalidSetting` for numbers that are none, a variance below zero, or a bias that is forgotten in no time.
    pub(super) fn check(&self) -> Result<(), Error> {
        let DriftNoise { reference, reading, bias, bias_time_s, daily } = self;
        let invalid = |setting, seen, needed| Err(Error::InvalidSetting { setting, seen, needed });
        for covariance in [reference, reading, bias, daily] {
            if let Some(seen) = covariance.iter().copied().find(|x| !x.is_finite()) {
                return invalid("covariance of a reference", seen, "it must hold finite numbers");
            }
            let least = covariance.diagonal().min();
            if least < 0.0 {
                return invalid("variance in a reference", least, "it must not be below zero");
            }
            if MOST_VARIANCE < covariance.amax() {
                let needed = "it must be below 1e100: the change detector multiplies such numbers";
                return invalid("variance in a reference", covariance.amax(), needed);
            }
            if !is_covariance(covariance) {
                let least = covariance.symmetric_eigenvalues().min();
                let needed = "it must be symmetric, and its least eigenvalue not negative";
                return invalid("covariance of a reference", least, needed);
            }
        }
        if !(bias_time_s.is_finite() && 0.0 < *bias_time_s) {
            return invalid("bias_time_s", *bias_time_s, "it must be a positive number of seconds");
        }
        Ok(())
    }
}

/// Says at a stated rate of false alarms that the stream has left its reference.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct DriftTest {
    /// Whitened coordinates from the motion's.
    whitened_from_motion: Matrix6<f64>,
    motion_from_whitened: Matrix6<f64>,
    noise: [AxisNoise; AXES],
    filters: [AxisFilter; AXES],
    onsets: Onsets,
    last_s: Option<f64>,
}

/// A reading in whitened coordinates, in which its errors are independent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Whitened {
    /// y.
    pub value: Vector6<f64>,
    /// r.
    pub variance: Vector6<f64>,
}

impl DriftTest {
    /// None where a covariance is not positive definite.
    pub fn new(noise: &DriftNoise) -> Option<Self> {
        let (whitened_from_motion, motion_from_whitened) = whitening(&(noise.reading + noise.bias))?;
        let sigmas = |covariance: &Matrix6<f64>| variances(&whitened_from_motion, covariance).map(f64::sqrt);
        let [reference, bias, daily] = [&noise.reference, &noise.bias, &noise.daily].map(sigmas);
        let noise = std::array::from_fn(|axis| AxisNoise {
            reference_sigma: reference[axis],
            bias_sigma: bias[axis],
            bias_time_s: noise.bias_time_s,
            daily_sigma: daily[axis],
        });
        let mut directions = whitened_from_motion;
        directions.column_iter_mut().for_each(|mut column| {
            column.normalize_mut();
        });
        Some(DriftTest {
            whitened_from_motion,
            motion_from_whitened,
            noise,
            filters: noise.map(|axis| AxisFilter::new(&axis)),
            onsets: Onsets::new(directions),
            last_s: None,
        })
    }

    /// Whether its noise is such as `new` makes: numbers of a file may be any.
    pub fn is_sound(&self) -> bool {
        self.noise.iter().all(|axis| 0.0 < axis.bias_time_s)
    }

    /// A reading of the small motion from the reference, its covariance, in whitened coordinates.
    pub fn whitened(&self, motion: &Vector6<f64>, covariance: &Matrix6<f64>) -> Whitened {
        Whitened {
            value: self.whitened_from_motion * motion,
            // No reading is a million times better than a typical one; a zero would make the rest NaN.
            variance: variances(&self.whitened_from_motion, covariance).map(|v| v.max(1e-12)),
        }
    }

    /// The small motion of a reading's value.
    pub fn motion(&self, value: &Vector6<f64>) -> Vector6<f64> {
        self.motion_from_whitened * value
    }

    /// What is expected of each coordinate.
    pub fn noise(&self) -> &[AxisNoise; AXES] {
        &self.noise
    }

    /// Σ ν²/S of a reading at `t_s`: χ² with six degrees of freedom while nothing happens.
    pub fn surprise(&self, t_s: f64, reading: &Whitened) -> f64 {
        let elapsed_s = self.last_s.map_or(0.0, |last_s| t_s - last_s);
        let of_axis = |axis: usize| {
            let mut filter = self.filters[axis];
            filter.predict(&Transition::new(&self.noise[axis], elapsed_s));
            let innovation = filter.innovation(reading.value[axis], reading.variance[axis]);
            innovation.value * innovation.value / innovation.variance
        };
        (0..AXES).map(of_axis).sum()
    }

    /// ln R after a reading. Readings come in order of time.
    pub fn push(&mut self, t_s: f64, reading: &Whitened) -> f64 {
        if let Some(last_s) = self.last_s {
            let transitions = self.noise.map(|axis| Transition::new(&axis, t_s - last_s));
            self.filters
                .iter_mut()
                .zip(&transitions)
                .for_each(|(filter, transition)| filter.predict(transition));
            self.onsets.predict(&transitions);
        }
        self.last_s = Some(t_s);
        let innovations = std::array::from_fn(|axis| {
            self.filters[axis].innovation(reading.value[axis], reading.variance[axis])
        });
        self.filters.iter_mut().zip(&innovations).for_each(|(filter, innovation)| filter.update(innovation));
        self.onsets.add(t_s, &innovations)
    }

    /// What would explain the readings best; none before the first.
    pub fn change(&self) -> Option<Change> {
        self.onsets.change()
    }

    /// Mean and covariance of the constant part, the reference's own error as the readings correct it, as a small motion.
    pub fn level(&self) -> (Vector6<f64>, Matrix6<f64>) {
        self.shifted_level(&Vector6::zeros(), &Vector6::zeros())
    }

    /// The same after a change.
    pub fn level_after(&self, change: &Change) -> (Vector6<f64>, Matrix6<f64>) {
        self.shifted_level(&change.shift, &change.variance)
    }

    /// The same if it jumped at the onset nearest to `onset_s`; none before the first reading.
    pub fn level_after_jump(&self, onset_s: f64) -> Option<(Vector6<f64>, Matrix6<f64>)> {
        self.onsets.jump_since(onset_s).map(|(shift, variance)| self.shifted_level(&shift, &variance))
    }

    fn shifted_level(&self, shift: &Vector6<f64>, variance: &Vector6<f64>) -> (Vector6<f64>, Matrix6<f64>) {
        let value = Vector6::from_fn(|axis, _| self.filters[axis].mean[0] + shift[axis]);
        let variance = Vector6::from_fn(|axis, _| self.filters[axis].covariance[(0, 0)] + variance[axis]);
        let back = &self.motion_from_whitened;
        (back * value, back * Matrix6::from_diagonal(&variance) * back.transpose())
    }
}

/// Diagonal of W P Wᵀ.
fn variances(whitened_from_motion: &Matrix6<f64>, covariance: &Matrix6<f64>) -> Vector6<f64> {
    (whitened_from_motion * covariance * whitened_from_motion.transpose()).diagonal().map(|v| v.max(0.0))
}

/// W with W P Wᵀ = 1, and its inverse.
pub(super) fn whitening(covariance: &Matrix6<f64>) -> Option<(Matrix6<f64>, Matrix6<f64>)> {
    // Radians and metres differ by orders: scaled to unit variances first.
    let scale = covariance.diagonal().map(f64::sqrt);
    if !scale.iter().all(|s| s.is_finite() && 1.0 / MOST_VARIANCE.sqrt() < *s) {
        return None;
    }
    let correlation = Matrix6::from_fn(|i, j| covariance[(i, j)] / (scale[i] * scale[j]));
    let eigen = SymmetricEigen::new(correlation);
    if !eigen.eigenvalues.iter().all(|v| 1e-14 < *v) {
        return None;
    }
    let roots = eigen.eigenvalues.map(f64::sqrt);
    let forward = Matrix6::from_fn(|i, j| eigen.eigenvectors[(j, i)] / (roots[i] * scale[j]));
    let back = Matrix6::from_fn(|i, j| eigen.eigenvectors[(i, j)] * roots[j] * scale[i]);
    Some((forward, back))
}

numbers!(DriftNoise { reference, reading, bias, bias_time_s, daily });
numbers!(DriftTest { whitened_from_motion, motion_from_whitened, noise, filters, onsets, last_s });
numbers!(Whitened { value, variance });
