//! The sequential test on one stream of poses: whitened coordinates, one filter each, one statistic for all.

use super::axis::{AXES, AxisFilter, AxisNoise, Innovation, Transition, Whitened};
use super::measured::Measured;
use super::onsets::{Change, Onsets};
use super::promise::{Detectable, Promise};
use crate::Error;
use crate::covariance::is_covariance;
use crate::temporal::snapshot::numbers;
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
    /// Covariance of the diurnal variation.
    pub diurnal: Matrix6<f64>,
}

/// Beyond this, products of variances leave the range of numbers.
pub(super) const MOST_VARIANCE: f64 = 1e100;

impl DriftNoise {
    /// # Errors
    /// `InvalidSetting` for numbers that are none, a variance below zero, or a bias that is forgotten in no time.
    pub(super) fn check(&self) -> Result<(), Error> {
        let DriftNoise { reference, reading, bias, bias_time_s, diurnal } = self;
        let invalid = |setting, seen, needed| Err(Error::InvalidSetting { setting, seen, needed });
        for covariance in [reference, reading, bias, diurnal] {
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
    /// Variance of a typical reading in each coordinate.
    typical: Vector6<f64>,
    /// None: the noise is what it is stated to be.
    measured: Option<Measured>,
}

/// The evidence that an onset needs at least, however long there was no reading before it.
pub(super) const LEAST_EVIDENCE: f64 = 20.0;

impl DriftTest {
    /// None where a covariance is not positive definite.
    pub fn new(noise: &DriftNoise) -> Option<Self> {
        let (whitened_from_motion, motion_from_whitened) = whitening(&(noise.reading + noise.bias))?;
        let sigmas = |covariance: &Matrix6<f64>| variances(&whitened_from_motion, covariance).map(f64::sqrt);
        let typical = variances(&whitened_from_motion, &noise.reading);
        let [reference, bias, diurnal] = [&noise.reference, &noise.bias, &noise.diurnal].map(sigmas);
        let noise = std::array::from_fn(|axis| AxisNoise {
            reference_sigma: reference[axis],
            bias_sigma: bias[axis],
            bias_time_s: noise.bias_time_s,
            diurnal_sigma: diurnal[axis],
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
            typical,
            measured: None,
        })
    }

    /// The same test from here on, around a constant part as widely known as `noise` says; what was learned of the noise before `onset_s`
    /// stays; what came after says something of it only if the motion `came_back`. None where a covariance is not positive definite.
    pub(crate) fn restarted(&self, noise: &DriftNoise, onset_s: f64, came_back: bool) -> Option<Self> {
        let mut test = DriftTest::new(noise)?;
        test.measured = self.measured.clone();
        if let Some(measured) = &mut test.measured {
            match self.onsets.then(onset_s) {
                _ if came_back => measured.came_back(),
                Some(then) => measured.set_aside(then),
                None => {}
            }
            measured.begin(&test.noise);
        }
        Some(test)
    }

    /// The same where what moved is accepted.
    pub fn accepted(&self, noise: &DriftNoise) -> Option<Self> {
        let mut test = DriftTest::new(noise)?;
        test.measured = self.measured.clone();
        if let Some(measured) = &mut test.measured {
            measured.accept();
            measured.begin(&test.noise);
        }
        Some(test)
    }

    /// From here on noise is measured, beginning with these readings, in order of time, of a camera that stayed.
    pub fn measure(&mut self, readings: &[(f64, Whitened)]) {
        let unit_s = unit_s(readings);
        let mut measured = Measured::new(&self.noise, &self.typical, unit_s);
        if readings.is_empty() {
            measured.presume();
        } else {
            let wide = self
                .noise
                .map(|noise| AxisNoise { reference_sigma: WIDE * (1.0 + noise.bias_sigma), ..noise });
            measured.set_scales(&scales(readings));
            // Once for the scales of all models, once for their likelihoods.
            for _ in 0..2 {
                measured.begin(&wide);
                measured.forget_likelihoods();
                self.last_s = None;
                self.measured = Some(measured);
                readings.iter().for_each(|(t_s, reading)| {
                    self.observe(*t_s, reading);
                });
                measured =
                    self.measured.take().unwrap_or_else(|| Measured::new(&self.noise, &self.typical, unit_s));
            }
        }
        self.measured = Some(measured);
    }

    /// Takes note of whether errors have changed.
    pub fn note_change(&mut self) {
        self.measured.iter_mut().for_each(Measured::note_change);
    }

    pub fn measured(&self) -> Option<&Measured> {
        self.measured.as_ref()
    }

    /// The covariance of a motion that has these variances in whitened coordinates.
    pub fn spread(&self, variance: &Vector6<f64>) -> Matrix6<f64> {
        let back = &self.motion_from_whitened;
        back * Matrix6::from_diagonal(variance) * back.transpose()
    }

    /// What is found within a time, where noise is measured.
    pub fn detectable(&self, promise: &Promise) -> Option<Detectable> {
        Some(self.measured.as_ref()?.detectable(&self.whitened_from_motion, promise))
    }

    /// Variances of a typical reading.
    pub fn typical(&self) -> &Vector6<f64> {
        &self.typical
    }

    /// A reading that is learned from only.
    fn observe(&mut self, t_s: f64, reading: &Whitened) {
        if SURPRISE < self.surprise(t_s, reading) {
            return;
        }
        self.predict(t_s);
        self.last_s = Some(t_s);
        let innovations = self.innovations(reading);
        self.update(reading, &innovations);
    }

    /// Whether its noise is such as `new` makes: numbers of a file may be any.
    pub fn is_sound(&self) -> bool {
        self.noise.iter().all(|axis| 0.0 < axis.bias_time_s)
            && self.measured.as_ref().is_none_or(Measured::is_sound)
    }

    /// Variances of the readings over the stated ones.
    pub fn scales(&self) -> Vector6<f64> {
        self.measured.as_ref().map_or(Vector6::repeat(1.0), Measured::scales)
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
        if let Some(measured) = &self.measured {
            return measured.surprise(elapsed_s, &self.transitions(elapsed_s), reading);
        }
        let of_axis = |axis: usize| {
            let mut filter = self.filters[axis];
            filter.predict(&Transition::new(&self.noise[axis], elapsed_s));
            let innovation = filter.innovation(reading.value[axis], reading.variance[axis]);
            innovation.value * innovation.value / innovation.variance
        };
        (0..AXES).map(of_axis).sum()
    }

    /// Mean and covariance of the small motion that a reading at `t_s` is expected to show, its own noise left out.
    pub fn expected(&self, t_s: f64) -> (Vector6<f64>, Matrix6<f64>) {
        let elapsed_s = self.last_s.map_or(0.0, |last_s| (t_s - last_s).max(0.0));
        let nothing = Whitened { value: Vector6::zeros(), variance: Vector6::zeros() };
        let of_axes = match &self.measured {
            Some(measured) => measured.predicted(elapsed_s, &self.transitions(elapsed_s), &nothing),
            None => std::array::from_fn(|axis| {
                let mut filter = self.filters[axis];
                filter.predict(&Transition::new(&self.noise[axis], elapsed_s));
                filter.innovation(0.0, 0.0)
            }),
        };
        let variance = Vector6::from_fn(|axis, _| of_axes[axis].variance);
        let back = &self.motion_from_whitened;
        let mean = Vector6::from_fn(|axis, _| -of_axes[axis].value);
        (back * mean, back * Matrix6::from_diagonal(&variance) * back.transpose())
    }

    fn transitions(&self, elapsed_s: f64) -> [Transition; AXES] {
        self.noise.map(|axis| Transition::new(&axis, elapsed_s))
    }

    /// Filters and onsets are carried to `t_s`.
    fn predict(&mut self, t_s: f64) {
        let Some(last_s) = self.last_s else { return };
        let elapsed_s = t_s - last_s;
        let mut transitions = self.transitions(elapsed_s);
        match &mut self.measured {
            Some(measured) => {
                transitions = measured.predict(elapsed_s, &transitions);
            }
            None => {
                let filters = self.filters.iter_mut().zip(&transitions);
                filters.for_each(|(filter, transition)| filter.predict(transition));
            }
        }
        self.onsets.predict(&transitions);
    }

    fn innovations(&self, reading: &Whitened) -> [Innovation; AXES] {
        match &self.measured {
            Some(measured) => measured.innovations(&reading.value, &reading.variance),
            None => std::array::from_fn(|axis| {
                self.filters[axis].innovation(reading.value[axis], reading.variance[axis])
            }),
        }
    }

    fn update(&mut self, reading: &Whitened, innovations: &[Innovation; AXES]) {
        match &mut self.measured {
            Some(measured) => measured.update(&reading.value, &reading.variance, innovations),
            None => self.filters.iter_mut().zip(innovations).for_each(|(filter, of)| filter.update(of)),
        }
    }

    /// ln R after a reading, against the noise in use. Readings come in order of time. `period_s` is the time that an onset of weight one
    /// stands for, at most `most` of which one may have: eq. (34).
    pub fn push(&mut self, t_s: f64, reading: &Whitened, period_s: f64, most: f64) -> f64 {
        self.predict(t_s);
        self.last_s = Some(t_s);
        let innovations = self.innovations(reading);
        let then = self.measured.as_ref().map_or(Vec::new(), Measured::standing);
        self.update(reading, &innovations);
        let periods = self.onsets.last_s().map_or(1.0, |last_s| (t_s - last_s) / period_s);
        // Readings that waited together come at once: they share what one onset weighs.
        let log_weight = periods.clamp(1e-6, most.max(1.0)).ln();
        self.onsets.add(t_s, &innovations, log_weight, then)
    }

    /// Whether R passes the threshold against all noise that the readings have not excluded; against the noise in use it is `log_r`.
    pub fn passes(&self, log_r: f64, threshold: f64) -> bool {
        let against = |measured: &Measured| self.onsets.log_statistic_against(measured, threshold);
        threshold <= log_r && threshold <= self.measured.as_ref().map_or(log_r, against)
    }

    /// What would explain the readings best; none before the first.
    pub fn change(&self) -> Option<Change> {
        self.onsets.change(self.measured.as_ref())
    }

    /// Mean and covariance of the constant part, the reference's own error as the readings correct it, as a small motion.
    pub fn level(&self) -> (Vector6<f64>, Matrix6<f64>) {
        self.shifted_level(&Vector6::zeros(), &Vector6::zeros())
    }

    /// The same after a change.
    pub(crate) fn level_after(&self, change: &Change) -> (Vector6<f64>, Matrix6<f64>) {
        self.shifted_level(&change.shift, &change.variance)
    }

    /// The same if it jumped at the onset nearest to `onset_s`; none before the first reading.
    pub(crate) fn level_after_jump(&self, onset_s: f64) -> Option<(Vector6<f64>, Matrix6<f64>)> {
        self.onsets.jump_since(onset_s).map(|(shift, variance)| self.shifted_level(&shift, &variance))
    }

    fn shifted_level(&self, shift: &Vector6<f64>, variance: &Vector6<f64>) -> (Vector6<f64>, Matrix6<f64>) {
        let level = |axis: usize| match &self.measured {
            Some(measured) => measured.level(axis),
            None => (self.filters[axis].mean[0], self.filters[axis].covariance[(0, 0)]),
        };
        // Readings that scatter by less than their sigmas find a motion sooner, but how large it was is known no better than stated: what a
        // lens leaves of a corner's error stays the same while nothing moves.
        let widened = self.scales().map(|scale| 1.0 / scale.clamp(1e-3, 1.0));
        let value = Vector6::from_fn(|axis, _| level(axis).0 + shift[axis]);
        let variance = Vector6::from_fn(|axis, _| widened[axis] * (level(axis).1 + variance[axis]));
        let back = &self.motion_from_whitened;
        (back * value, back * Matrix6::from_diagonal(&variance) * back.transpose())
    }
}

impl DriftTest {
    /// Covariance of levels, widened as `level` does, as well known as readings scatter: `scatter` is their variance over the stated one, in
    /// whitened coordinates.
    pub(crate) fn scattering(&self, levels: &Matrix6<f64>, scatter: &Vector6<f64>) -> Matrix6<f64> {
        // What readings scatter by, where that is more than stated, is in the levels.
        let narrowing = scatter
            .zip_map(&self.scales(), |scatter, scale| if scale < 1.0 { scatter.min(1.0) } else { 1.0 });
        let (forward, back) = (&self.whitened_from_motion, &self.motion_from_whitened);
        let narrower = back * Matrix6::from_diagonal(&narrowing.map(f64::sqrt)) * forward;
        let covariance = narrower * levels * narrower.transpose();
        0.5 * (covariance + covariance.transpose())
    }
}

/// Of a constant part of which nothing is known, in standard deviations of a reading.
const WIDE: f64 = 1e3;
/// χ² of six degrees of freedom that one in 10⁶ readings exceeds: an outlier is not learned from.
pub(super) const SURPRISE: f64 = 38.3;

/// The unit of time constants: a second, or the time between slower readings.
fn unit_s(readings: &[(f64, Whitened)]) -> f64 {
    let mut between_s: Vec<f64> = readings.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    between_s.sort_by(f64::total_cmp);
    between_s.get(between_s.len() / 2).map_or(1.0, |median_s| median_s.clamp(1.0, super::axis::DAY_S))
}

/// Robust variances about the median over the stated ones, the stated ones counted as ten readings.
fn scales(readings: &[(f64, Whitened)]) -> Vector6<f64> {
    /// A normal variable's standard deviation over its median distance from the mean.
    const FROM_MEDIAN: f64 = 1.4826;
    const STATED: f64 = 10.0;
    let middle = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(0.0)
    };
    Vector6::from_fn(|axis, _| {
        let centre = middle(readings.iter().map(|(_, reading)| reading.value[axis]).collect());
        let of = |reading: &Whitened| (reading.value[axis] - centre).abs() / reading.variance[axis].sqrt();
        let sigma = FROM_MEDIAN * middle(readings.iter().map(|(_, reading)| of(reading)).collect());
        let n = readings.len() as f64;
        ((STATED + n * sigma * sigma) / (STATED + n)).clamp(1e-4, 1e8)
    })
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

numbers!(DriftNoise { reference, reading, bias, bias_time_s, diurnal });
numbers!(DriftTest {
    whitened_from_motion,
    motion_from_whitened,
    noise,
    filters,
    onsets,
    last_s,
    typical,
    measured,
});
