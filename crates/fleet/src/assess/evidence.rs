//! What readings say for steps, against every error that is none: docs/math/fleet.md eqs. (9)–(16).

use super::partition::candidates;
use super::readings::motion;
use super::series::{Correlated, Jump, Ramp, Series};
use resight::core::temporal::monitor::Reading;
use resight::core::temporal::monitor::learn::LearnConfig;
use resight::core::{Matrix6, Vector6};

/// A camera that stayed is reported to have moved by this test once in so many records: a tenth of the rate of the test of a single motion.
pub(super) const FALSE_ALARM_PROBABILITY: f64 = 2.5e-6;
/// Standard deviations of the sizes of steps that are looked for, in those of a reading; besides none, for a direction need not show a step.
const SIZES: [f64; 4] = [5.0, 50.0, 500.0, 5000.0];

/// A camera's readings, seen along directions in which steps show.
pub(super) struct Record<'a> {
    t_s: &'a [f64],
    /// The begin of the first reading and the end of the last, seconds.
    pub span_s: (f64, f64),
    /// Motions from the middle reading, whitened by the mean covariance.
    whitened: Vec<Vector6>,
    /// How much more a reading counts than the mean one.
    weights: Vec<f64>,
    /// Whitened coordinates, then those that show a change of each coordinate alone best.
    pub series: Vec<Series<'a>>,
    /// Turns a whitened motion into `[rotation_rad; translation_m]`.
    pub motion_from_whitened: Matrix6,
}

/// How the mean pose changes over a record.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Course {
    /// First readings after steps, rising.
    pub steps: Vec<usize>,
    /// A slow motion besides.
    pub ramp: Option<Ramp>,
}

impl<'a> Record<'a> {
    /// None where no time passes, or a covariance is none.
    pub fn new(readings: &[Reading], t_s: &'a [f64], config: &LearnConfig) -> Option<Self> {
        let centre = readings.get(readings.len() / 2)?.a_from_b;
        let span_s = t_s.last()? - t_s[0];
        let typical: Matrix6 = readings.iter().map(|r| r.covariance).sum::<Matrix6>() / readings.len() as f64;
        let motion_from_whitened = typical.cholesky()?.l();
        let whitened_from_motion = motion_from_whitened.try_inverse()?;
        let motions: Vec<Vector6> = readings.iter().map(|r| motion(&centre, &r.a_from_b)).collect();
        if !(0.0 < span_s && span_s.is_finite()) || motions.iter().any(|y| !y.iter().all(|x| x.is_finite())) {
            return None;
        }
        let information = whitened_from_motion.transpose() * whitened_from_motion;
        let along = |i: usize| match i < 6 {
            true => whitened_from_motion.row(i).transpose(),
            false => information.column(i - 6) / information[(i - 6, i - 6)].sqrt(),
        };
        let series = |i: usize| {
            let u: Vector6 = along(i);
            let sigma = |covariance: &Matrix6| u.dot(&(covariance * u)).max(0.0).sqrt();
            Series {
                t_s,
                values: motions.iter().map(|y| u.dot(y)).collect(),
                variances: readings.iter().map(|r| sigma(&r.covariance).powi(2).max(1e-12)).collect(),
                stated: Correlated { sigma: sigma(&config.bias), time_s: config.bias_time_s },
                diurnal_sigma: sigma(&config.diurnal),
            }
        };
        let size = |covariance: &Matrix6| covariance.trace() / typical.trace();
        Some(Record {
            t_s,
            span_s: self::span_s(t_s),
            whitened: motions.iter().map(|y| whitened_from_motion * y).collect(),
            weights: readings.iter().map(|r| 1.0 / size(&r.covariance)).collect(),
            series: (0..12).map(series).collect(),
            motion_from_whitened,
        })
    }

    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    pub fn t_s(&self) -> &[f64] {
        self.t_s
    }

    pub fn whitened(&self) -> &[Vector6] {
        &self.whitened
    }

    pub fn weights(&self) -> &[f64] {
        &self.weights
    }

    /// Sets of steps that explain the readings, where the evidence for one of them is beyond that of a probability of false alarms.
    pub fn steps(&self, false_alarms: f64) -> Option<Vec<Vec<usize>>> {
        let limit = -false_alarms.ln();
        let found = candidates(&self.whitened, &self.weights);
        let nothing: Vec<f64> = match found.is_empty() {
            true => return None,
            false => self.series.iter().map(|s| s.likeliest(&[], f64::NEG_INFINITY).0).collect(),
        };
        // The likelihood of no step is a lower bound until the search for the error that explains all without any is over.
        let promising: Vec<Vec<usize>> =
            found.into_iter().filter(|steps| limit <= self.log_evidence(steps, &nothing)).collect();
        if promising.is_empty() {
            return None;
        }
        let nothing: Vec<f64> = self.series.iter().map(|s| s.likeliest(&[], f64::INFINITY).0).collect();
        let is_certain = promising.iter().any(|steps| limit <= self.log_evidence(steps, &nothing));
        is_certain.then_some(promising)
    }

    /// ln of the mean over the directions of e, eqs. (10), (12): what a set of steps says against `nothing`, ln p of no step along each direction.
    fn log_evidence(&self, steps: &[usize], nothing: &[f64]) -> f64 {
        let prior = log_prior(steps.len(), self.len());
        let e = |(series, nothing): (&Series, &f64)| {
            let jumps = self.jumps(series, steps);
            prior + log_mean_likelihood(series, &jumps) - nothing
        };
        log_mean(&self.series.iter().zip(nothing).map(e).collect::<Vec<_>>())
    }

    /// The likeliest of some sets of steps, all whitened coordinates together.
    pub fn best(&self, sets: &[Vec<usize>]) -> Vec<usize> {
        let score = |steps: &Vec<usize>| self.log_posterior(&Course { steps: steps.clone(), ramp: None });
        let scored = sets.iter().map(|steps| (score(steps), steps));
        scored.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, steps)| steps.clone()).unwrap_or_default()
    }

    /// ln of prior times likelihood of a course, all whitened coordinates together, eq. (14).
    pub fn log_posterior(&self, course: &Course) -> f64 {
        let of = |series: &Series| {
            let jumps = self.jumps(series, &course.steps);
            match course.ramp {
                None => log_mean_likelihood(series, &jumps),
                Some(ramp) => log_mean_likelihood_of_ramp(series, &jumps, &ramp),
            }
        };
        let ramp = if course.ramp.is_some() { self.log_prior_of_ramp() } else { 0.0 };
        log_prior(course.steps.len(), self.len()) + ramp + self.series[..6].iter().map(of).sum::<f64>()
    }

    /// ln of the prior probability of a ramp: half, all its first and last readings alike.
    fn log_prior_of_ramp(&self) -> f64 {
        -((self.len() * (self.len() - 1)) as f64).ln()
    }

    /// Whether a ramp has evidence of its own given steps of any size, as each of these has in eq. (15).
    pub fn is_certain_ramp(&self, steps: &[usize], ramp: &Ramp, false_alarms: f64) -> bool {
        let e = |series: &Series| {
            let wide = wide(series);
            let jumps: Vec<Jump> = steps.iter().map(|at| Jump { at: *at, variance: wide }).collect();
            let some = self.log_prior_of_ramp() + log_mean_likelihood_of_ramp(series, &jumps, ramp);
            some - series.likeliest(&jumps, some).0
        };
        -false_alarms.ln() <= log_mean(&self.series.iter().map(e).collect::<Vec<_>>())
    }

    /// The steps without those that the others explain: each that stays has evidence of its own, eq. (15), but the last `kept`. `events` group
    /// the steps.
    pub fn certain(&self, events: Vec<Vec<usize>>, kept: usize) -> Vec<Vec<usize>> {
        let limit = -FALSE_ALARM_PROBABILITY.ln();
        let mut events = events;
        while kept < events.len() {
            let evidence: Vec<f64> = (0..events.len()).map(|k| self.log_evidence_of(&events, k)).collect();
            let weakest = (0..events.len()).min_by(|a, b| evidence[*a].total_cmp(&evidence[*b])).unwrap_or(0);
            if limit <= evidence[weakest] {
                break;
            }
            events.remove(weakest);
        }
        events
    }

    /// ln of the mean over the directions of e of one event, given the others.
    fn log_evidence_of(&self, events: &[Vec<usize>], k: usize) -> f64 {
        let without: Vec<usize> =
            events.iter().enumerate().filter(|(i, _)| *i != k).flat_map(|(_, steps)| steps.clone()).collect();
        let with: Vec<usize> = events.iter().flatten().copied().collect();
        let prior = log_prior(events[k].len(), self.len());
        let e = |series: &Series| {
            // The others are of any size.
            let wide = wide(series);
            let others: Vec<Jump> = without.iter().map(|at| Jump { at: *at, variance: wide }).collect();
            let own = self.jumps(series, &with);
            let all: Vec<Jump> = own
                .into_iter()
                .map(|jump| if events[k].contains(&jump.at) { jump } else { Jump { variance: wide, ..jump } })
                .collect();
            let some = prior + log_mean_likelihood(series, &all);
            some - series.likeliest(&others, some).0
        };
        log_mean(&self.series.iter().map(e).collect::<Vec<_>>())
    }

    /// The steps with the sizes that are looked for, the least of those that hold what the means on either side say; zero for none.
    fn jumps(&self, series: &Series, steps: &[usize]) -> Vec<Jump> {
        let sigma = series.typical_variance().sqrt();
        let means = means(&series.values, steps);
        let jump = |(k, at): (usize, &usize)| {
            let size = (means[k + 1] - means[k]).abs() / sigma;
            let of = SIZES.into_iter().find(|of| size < 2.0 * of).unwrap_or(SIZES[SIZES.len() - 1]);
            Jump { at: *at, variance: if size < 2.0 { 0.0 } else { (of * sigma).powi(2) } }
        };
        steps.iter().enumerate().map(jump).collect()
    }

    /// How likely each reading is to be the first after a step, the others being as they are: those near `step`, with their shares.
    pub fn onsets(&self, steps: &[usize], step: usize, near: usize) -> Vec<(usize, f64)> {
        let k = steps.iter().position(|at| *at == step).unwrap_or(0);
        let from = if k == 0 { 1 } else { steps[k - 1] + 1 };
        let to = steps.get(k + 1).copied().unwrap_or(self.len());
        let all = from.max(step.saturating_sub(near))..to.min(step + near + 1);
        let errors: Vec<(Correlated, Vec<Jump>)> = self.series[..6]
            .iter()
            .map(|series| {
                (series.likeliest(&self.jumps(series, steps), f64::INFINITY).1, self.jumps(series, steps))
            })
            .collect();
        let log_p: Vec<(usize, f64)> = all
            .map(|at| {
                let of = |(series, (error, jumps)): (&Series, &(Correlated, Vec<Jump>))| {
                    let mut moved = jumps.clone();
                    moved[k].at = at;
                    series.log_likelihood(error, &moved)
                };
                (at, self.series[..6].iter().zip(&errors).map(of).sum())
            })
            .collect();
        let most = log_p.iter().map(|(_, p)| *p).fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = log_p.iter().map(|(_, p)| (p - most).exp()).sum();
        log_p.into_iter().map(|(at, p)| (at, (p - most).exp() / sum)).collect()
    }
}

/// Readings are means of equal periods, but the first and the last, which are about as long as it is from their middle to the next border.
fn span_s(t_s: &[f64]) -> (f64, f64) {
    let n = t_s.len();
    let mut apart_s: Vec<f64> = t_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    apart_s.sort_by(f64::total_cmp);
    let period_s = apart_s.get(apart_s.len() / 2).copied().unwrap_or(0.0);
    let half_s = |apart_s: f64| (apart_s - 0.5 * period_s).clamp(0.0, 0.5 * period_s);
    (t_s[0] - half_s(t_s[1] - t_s[0]), t_s[n - 1] + half_s(t_s[n - 1] - t_s[n - 2]))
}

/// The variance of a step of any size.
fn wide(series: &Series) -> f64 {
    1e6 * series.values.iter().map(|v| v * v).fold(series.typical_variance(), f64::max)
}

/// The mean of each stretch between steps.
pub(super) fn means(values: &[f64], steps: &[usize]) -> Vec<f64> {
    let borders: Vec<usize> = std::iter::once(0).chain(steps.iter().copied()).chain([values.len()]).collect();
    borders.windows(2).map(|w| values[w[0]..w[1]].iter().sum::<f64>() / (w[1] - w[0]).max(1) as f64).collect()
}

/// ln of the prior probability of k steps at given places with given sizes: 2⁻ᵏ for their number, all places and sizes alike.
fn log_prior(k: usize, n: usize) -> f64 {
    let places: f64 = (0..k).map(|i| ((n - 1 - i) as f64 / (i + 1) as f64).ln()).sum();
    -(k as f64) * (2.0 * (SIZES.len() + 1) as f64).ln() - places
}

/// ln of the mean of p over the errors that steps are looked for amid.
fn log_mean_likelihood(series: &Series, jumps: &[Jump]) -> f64 {
    let of = |error: &Correlated| series.log_likelihood(error, jumps);
    log_mean(&series.errors().iter().map(of).collect::<Vec<_>>())
}

fn log_mean_likelihood_of_ramp(series: &Series, jumps: &[Jump], ramp: &Ramp) -> f64 {
    let sigma = series.typical_variance().sqrt();
    let of = |error: Correlated| {
        SIZES.map(|size| series.log_likelihood_of_ramp(&error, jumps, ramp, (size * sigma).powi(2)))
    };
    log_mean(&series.errors().into_iter().flat_map(of).collect::<Vec<_>>())
}

/// ln of the mean of numbers whose logarithms are given.
fn log_mean(logs: &[f64]) -> f64 {
    let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if most == f64::NEG_INFINITY {
        return most;
    }
    most + (logs.iter().map(|x| (x - most).exp()).sum::<f64>() / logs.len() as f64).ln()
}
