//! One coordinate of the readings that a reference is learned from: what speaks for a change against every noise that is no change.
//!
//! ```text
//!   e = Σ w p(y | change, θ) / max p(y | no change, θ)     θ = (σ_b, τ_b) of a correlated error; E e ≤ 1 whatever θ is
//! ```
//! Derivation: docs/math/monitor.md eqs. (29)–(31).

use crate::temporal::monitor::LogSum;
use crate::temporal::monitor::axis::{AxisFilter, AxisNoise, Transition};
use crate::temporal::monitor::onsets::Gathered;
use nalgebra::Vector4;

/// Readings on either side of a change, at least: fewer may be outliers, which the monitor handles.
pub const EITHER_SIDE: usize = 3;
/// Sizes looked for of a step, in standard deviations of a reading, and of a ramp from the first reading to the last: a size that is
/// larger than expected costs a share of its evidence, which of a gross motion would be more than any noise costs.
const SIZES: [f64; 4] = [5.0, 50.0, 500.0, 5000.0];
/// Prior weights of step and ramp.
const WEIGHTS: [f64; 2] = [0.7, 0.3];
/// Correlated errors that a change is looked for amid, besides none and the stated one: standard deviation in units of a reading's, time in
/// units of the span.
const AMID: [(f64, f64); 2] = [(1.0, 0.125), (2.0, 0.5)];
/// Steps of the search for the noise that explains the readings best, in ln σ_b and ln τ_b, and the last one.
const FIRST_STEP: f64 = 0.8;
const LAST_STEP: f64 = 0.1;
/// Evaluations of that search, at most.
const EVALUATIONS: usize = 120;

/// A correlated error, exp(−Δ/τ).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correlated {
    /// Standard deviation.
    pub sigma: f64,
    /// The time in which it is forgotten, seconds.
    pub time_s: f64,
}

/// Values along one direction, in order of time.
#[derive(Debug, Clone)]
pub struct Series<'a> {
    /// When, seconds.
    pub t_s: &'a [f64],
    /// y.
    pub values: Vec<f64>,
    /// Variances of the readings' own noise.
    pub variances: Vec<f64>,
    /// Of what is stated beforehand.
    pub stated: Correlated,
    pub diurnal_sigma: f64,
}

/// How likely the readings of a series are with and without a change.
#[derive(Debug, Clone)]
pub struct Weighed {
    /// ln of prior times likelihood of a step and a ramp that begin with reading `begins(i)`.
    pub log_masses: Vec<[f64; 2]>,
    /// The largest likelihood without a change, of the correlated errors tried so far, and that error.
    log_null: f64,
    pub null: Correlated,
}

impl Series<'_> {
    pub fn span_s(&self) -> f64 {
        self.t_s[self.t_s.len() - 1] - self.t_s[0]
    }

    /// Of a typical reading.
    pub fn typical_variance(&self) -> f64 {
        self.variances.iter().sum::<f64>() / self.variances.len() as f64
    }

    /// Mean square about the mean.
    pub fn scatter(&self) -> f64 {
        let n = self.values.len() as f64;
        let mean = self.values.iter().sum::<f64>() / n;
        self.values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n
    }

    /// The likelihood of a change is exact; that of none is a lower bound until `settle_null`.
    pub fn weigh(&self) -> Weighed {
        let (sigma, span_s) = (self.typical_variance().sqrt(), self.span_s());
        let amid = AMID.map(|(size, time)| Correlated { sigma: size * sigma, time_s: time * span_s });
        let none = Correlated { sigma: 0.0, time_s: span_s };
        let mut errors = vec![none, amid[0], amid[1]];
        errors.extend((0.0 < self.stated.sigma).then_some(self.stated));
        let n_onsets = (self.values.len() + 2).saturating_sub(2 * EITHER_SIDE);
        let log_prior = -((errors.len() * n_onsets * SIZES.len()) as f64).ln();
        let mut sums = vec![[LogSum::nothing(); 2]; n_onsets];
        let mut weighed = Weighed { log_masses: Vec::new(), log_null: f64::NEG_INFINITY, null: none };
        for error in errors {
            let (log_null, onsets) = self.changes(&error);
            weighed.offer(log_null, error);
            for (sum, gathered) in sums.iter_mut().zip(&onsets) {
                for course in 0..2 {
                    let log_weight = log_prior + WEIGHTS[course].ln() + log_null;
                    for size in SIZES {
                        let log_ratio = log_ratio((size * sigma).powi(2), &gathered[course]);
                        sum[course].add((log_weight + log_ratio).into());
                    }
                }
            }
        }
        weighed.log_masses = sums.iter().map(|sum| sum.map(|sum| sum.ln())).collect();
        weighed
    }

    /// Seeks the correlated error that explains the readings best without a change.
    pub fn settle_null(&self, weighed: &mut Weighed) {
        let floor = 1e-3 * self.typical_variance().sqrt();
        let ceiling = floor + 1e3 * self.scatter().sqrt();
        let (shortest_s, longest_s) = (1e-3 * self.span_s(), 100.0 * self.span_s());
        let mut attempt = |log_sigma: f64, log_time: f64| {
            let sigma = log_sigma.exp().clamp(floor, ceiling);
            let error = Correlated { sigma, time_s: log_time.exp().clamp(shortest_s, longest_s) };
            weighed.offer(self.log_likelihood(&error), error);
            (weighed.null.sigma.max(floor).ln(), weighed.null.time_s.ln())
        };
        let scatter = self.scatter().sqrt().max(floor);
        let mut best = (0.0, 0.0);
        for size in [1.5, 0.5, 0.15] {
            for time in [0.004, 0.1, 1.0, 8.0] {
                best = attempt((size * scatter).ln(), (time * self.span_s()).ln());
            }
        }
        let (mut step, mut evaluations) = (FIRST_STEP, 0);
        while LAST_STEP < step && evaluations < EVALUATIONS {
            let before = best;
            // The last two go along the ridge on which σ²/τ, what a random walk gains, stays.
            for (s, t) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0), (1.0, 2.0), (-1.0, -2.0)] {
                best = attempt(before.0 + s * step, before.1 + t * step);
                evaluations += 1;
            }
            if best == before {
                step *= 0.5;
            }
        }
    }

    fn noise(&self, error: &Correlated) -> AxisNoise {
        AxisNoise {
            // Of the mean nothing is known: its first reading says all.
            reference_sigma: 1e3 * (self.scatter() + self.typical_variance()).sqrt(),
            bias_sigma: error.sigma,
            bias_time_s: error.time_s,
            diurnal_sigma: self.diurnal_sigma,
        }
    }

    /// ln p(y) of all but the first reading, without a change.
    fn log_likelihood(&self, error: &Correlated) -> f64 {
        self.walk(error, |_, _, _| {})
    }

    /// The same, and what the readings say of a change that begins with each reading.
    fn changes(&self, error: &Correlated) -> (f64, Vec<[Gathered; 2]>) {
        let (n, span_s) = (self.values.len(), self.span_s().max(f64::MIN_POSITIVE));
        let mut onsets: Vec<[Gathered; 2]> = Vec::with_capacity(n);
        let log_null = self.walk(error, |i, transition, innovation| {
            for [step, ramp] in &mut onsets {
                for gathered in [&mut *step, &mut *ramp] {
                    gathered.signature = transition.apply(&gathered.signature);
                }
                ramp.signature[0] += transition.elapsed_s / span_s;
            }
            if i == 0 || (EITHER_SIDE..=n - EITHER_SIDE).contains(&i) {
                let step = Gathered { signature: Vector4::x(), ..Gathered::default() };
                onsets.push([step, Gathered::default()]);
            }
            onsets.iter_mut().flatten().for_each(|gathered| gathered.add(innovation));
        });
        (log_null, onsets)
    }

    /// The filter over all readings: ln p(y) of all but the first.
    fn walk(
        &self,
        error: &Correlated,
        mut each: impl FnMut(usize, &Transition, &crate::temporal::monitor::axis::Innovation),
    ) -> f64 {
        let noise = self.noise(error);
        let mut filter = AxisFilter::new(&noise);
        let mut sum = 0.0;
        for (i, (value, variance)) in self.values.iter().zip(&self.variances).enumerate() {
            let elapsed_s = if i == 0 { 0.0 } else { (self.t_s[i] - self.t_s[i - 1]).max(0.0) };
            let transition = Transition::new(&noise, elapsed_s);
            filter.predict(&transition);
            let innovation = filter.innovation(*value, *variance);
            each(i, &transition, &innovation);
            if 0 < i {
                sum -= 0.5 * (innovation.value.powi(2) / innovation.variance + innovation.variance.ln());
            }
            filter.update(&innovation);
        }
        sum
    }
}

impl Weighed {
    /// ln e.
    pub fn log_e(&self) -> f64 {
        LogSum::of(self.log_masses.iter().flatten().copied()).ln() - self.log_null
    }

    /// ln of the share of one change in e.
    pub fn log_share(&self, onset: usize, course: usize) -> f64 {
        self.log_masses[onset][course] - self.log_null
    }

    fn offer(&mut self, log_null: f64, error: Correlated) {
        if self.log_null < log_null {
            (self.log_null, self.null) = (log_null, error);
        }
    }
}

/// The reading with which onset `i` begins: the first, for what moved before the look began, then those with enough on either side.
pub fn begins(onset: usize) -> usize {
    if onset == 0 { 0 } else { onset - 1 + EITHER_SIDE }
}

/// ln Λ, eq. (8).
fn log_ratio(variance: f64, gathered: &Gathered) -> f64 {
    let shrinkage = 1.0 / (1.0 + variance * gathered.information);
    0.5 * (variance * gathered.score.powi(2) * shrinkage + shrinkage.ln())
}
