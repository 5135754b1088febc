//! Did the camera move while its reference was being learned?
//!
//! A sudden motion or one that continues would give a mean between two poses, and a noise as wide as the motion, amid which nothing is ever
//! noticed again. The readings are therefore tested first. What is tested is a ratio whose mean is at most one for every noise that the
//! monitor knows, so that the rate of false alarms is bounded without a table: docs/math/monitor.md eqs. (29)–(33).

mod series;

use super::priors::{MEDIAN, OUTLIER};
use super::test::{DriftNoise, whitening};
use super::{Drift, LogSum, MotionKind};
use crate::Error;
use crate::covariance::is_covariance;
use crate::{Matrix6, Vector6};
use nalgebra::SVector;
use series::{Series, Weighed, begins};

/// What is known beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearnConfig {
    /// Least covariance of the error that lasts: a short look cannot show it all.
    pub bias: Matrix6,
    /// Least time in which that error is forgotten, seconds.
    pub bias_time_s: f64,
    /// Covariance of the diurnal variation, which only days show.
    pub diurnal: Matrix6,
}

impl LearnConfig {
    /// # Errors
    /// `InvalidSetting` for numbers that are none, a variance below zero, or a bias that is forgotten in no time.
    pub fn check(&self) -> Result<(), Error> {
        let nothing = Matrix6::zeros();
        let LearnConfig { bias, bias_time_s, diurnal } = *self;
        DriftNoise { reference: nothing, reading: nothing, bias, bias_time_s, diurnal }.check()
    }
}

/// How the readings of a reference are no such.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unrest {
    /// A sudden motion; it stays where it then is.
    Step,
    /// A motion that continues.
    Ramp,
    /// Motions to and fro that last about as long as the readings, and are much larger than the error of a reading.
    Wander,
}

/// Why readings are no reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unsettled {
    /// How it moved.
    pub unrest: Unrest,
    /// The first reading after the motion began, counted from zero; a wander has none and begins with the first.
    pub reading: usize,
    /// How far: of a step from before to after, of a ramp or wander from the first quarter of the readings to the last.
    pub drift: Drift,
}

/// A motion and its covariance at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sample {
    pub t_s: f64,
    pub motion: Vector6,
    pub covariance: Matrix6,
}

/// One test says falsely that the camera moved, at most this often. Learning tests at N, 2N, 4N and 8N readings: once in 10⁴ together.
pub const FALSE_ALARM_PROBABILITY: f64 = 2.5e-5;
/// Samples that are tested; of more, every second, third … is.
const MOST: usize = 64;
/// Fewer say nothing of a change.
const FEWEST: usize = 12;
/// A scatter from reading to reading beyond this many standard deviations of one, which lasts longer than half of the span, is no
/// noise: there is no pose that it is about.
const WANDER: f64 = 5.0;
/// What samples, in order of time, say of a change: its kind, the first sample after it, and its evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Found {
    pub unrest: Unrest,
    pub sample: usize,
    pub began_s: f64,
    pub began_sigma_s: f64,
    pub probability: f64,
    /// ln e.
    pub log_evidence: f64,
}

/// The motion that the samples show; none where chance and correlated errors explain them. `tests` of this kind share the rate.
pub(super) fn find(samples: &[Sample], config: &LearnConfig, tests: usize) -> Option<Found> {
    let kept = without_outliers(samples);
    let thinned = thinned(&kept);
    let t_s: Vec<f64> = thinned.iter().map(|i| samples[*i].t_s).collect();
    let all = all_series(samples, &thinned, &t_s, config)?;
    let mut weighed: Vec<Weighed> = all.iter().map(Series::weigh).collect();
    let limit = (tests.max(1) as f64 / FALSE_ALARM_PROBABILITY).ln();
    if limit <= log_mean(&weighed) {
        for (series, weighed) in all.iter().zip(&mut weighed).filter(|(_, weighed)| 0.0 < weighed.log_e()) {
            series.settle_null(weighed);
        }
    }
    let log_evidence = log_mean(&weighed);
    if limit <= log_evidence {
        let (found, at) = change(&t_s, &weighed);
        let sample = first_after(samples, &kept, &thinned, at);
        let began_sigma_s = found.began_sigma_s.hypot(interval_s(samples, sample));
        return Some(Found { sample, began_s: samples[sample].t_s, began_sigma_s, log_evidence, ..found });
    }
    let wanders = |(series, weighed): (&Series, &mut Weighed)| is_wander(series, weighed);
    all.iter().zip(&mut weighed).any(wanders).then(|| Found {
        unrest: Unrest::Wander,
        sample: 0,
        began_s: samples[0].t_s,
        began_sigma_s: interval_s(samples, 0),
        probability: 1.0,
        log_evidence,
    })
}

/// From the sample before this one, of the first to the next, seconds: what happened in between is known no better, eq. (80).
fn interval_s(samples: &[Sample], sample: usize) -> f64 {
    let second = sample.max(1).min(samples.len() - 1);
    samples[second].t_s - samples[second.saturating_sub(1)].t_s
}

/// Samples that half of the three before and the three after agree with: a flipped pose is no step.
fn without_outliers(samples: &[Sample]) -> Vec<usize> {
    let chi2 = |i: usize, j: usize| {
        let y = samples[i].motion - samples[j].motion;
        let factor = (samples[i].covariance + samples[j].covariance).cholesky();
        factor.map_or(0.0, |factor| y.dot(&factor.solve(&y)))
    };
    let mut neighbours: Vec<f64> = (1..samples.len()).map(|i| chi2(i - 1, i)).collect();
    neighbours.sort_by(f64::total_cmp);
    let typical = neighbours.get(neighbours.len() / 2).map_or(1.0, |median| (median / MEDIAN).max(1.0));
    let is_confirmed = |i: &usize| {
        let others: Vec<usize> = (i.saturating_sub(3)..samples.len().min(i + 4)).filter(|j| j != i).collect();
        let agree = others.iter().filter(|j| chi2(*i, **j) < OUTLIER * typical).count();
        others.len() / 2 <= agree
    };
    (0..samples.len()).filter(is_confirmed).collect()
}

/// Every so many of them, from the last back: few enough, and each of one pose, as a mean of those around a step would not be.
fn thinned(kept: &[usize]) -> Vec<usize> {
    let stride = kept.len().div_ceil(MOST).max(1);
    let mut thinned: Vec<usize> = kept.iter().rev().step_by(stride).copied().collect();
    thinned.reverse();
    thinned
}

/// The first sample that is nearer to those after a step than to those before, of the ones that thinning left out.
fn first_after(samples: &[Sample], kept: &[usize], thinned: &[usize], at: usize) -> usize {
    let (last, first) = (thinned[at.saturating_sub(1)], thinned[at]);
    let mean = |of: &[usize]| of.iter().map(|i| samples[*i].motion).sum::<Vector6>() / of.len().max(1) as f64;
    let (before, after) =
        (mean(&thinned[at.saturating_sub(3)..at]), mean(&thinned[at..thinned.len().min(at + 3)]));
    let is_after = |i: &&usize| {
        let Some(factor) = samples[**i].covariance.cholesky() else { return false };
        let distance =
            |to: &Vector6| (samples[**i].motion - to).dot(&factor.solve(&(samples[**i].motion - to)));
        distance(&after) < distance(&before)
    };
    kept.iter().filter(|i| last < **i && **i < first).find(is_after).copied().unwrap_or(first)
}

/// Directions looked along: a change of each coordinate alone shows best along P⁻¹ of it, one of several together in what whitens P.
const DIRECTIONS: usize = 12;

/// None where there are too few, no time passes, or a covariance is none.
fn all_series<'a>(
    samples: &[Sample],
    thinned: &[usize],
    t_s: &'a [f64],
    config: &LearnConfig,
) -> Option<Vec<Series<'a>>> {
    let span_s = t_s.last()? - t_s[0];
    if t_s.len() < FEWEST || !(0.0 < span_s && span_s.is_finite()) {
        return None;
    }
    let of = || thinned.iter().map(|i| &samples[*i]);
    let typical: Matrix6 = of().map(|sample| sample.covariance).sum::<Matrix6>() / t_s.len() as f64;
    let (whitened_from_motion, _) = whitening(&typical).filter(|_| is_covariance(&typical))?;
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
            values: of().map(|sample| u.dot(&sample.motion)).collect(),
            variances: of().map(|sample| sigma(&sample.covariance).powi(2).max(1e-12)).collect(),
            stated: series::Correlated { sigma: sigma(&config.bias), time_s: config.bias_time_s },
            diurnal_sigma: sigma(&config.diurnal),
        }
    };
    Some((0..DIRECTIONS).map(series).collect())
}

/// ln of the mean of e over the directions: a mean of ratios whose means are at most one.
fn log_mean(weighed: &[Weighed]) -> f64 {
    LogSum::of(weighed.iter().map(Weighed::log_e)).ln() - (weighed.len() as f64).ln()
}

/// The most probable change, and the one of the tested samples that it begins with.
fn change(t_s: &[f64], weighed: &[Weighed]) -> (Found, usize) {
    let n_onsets = weighed[0].log_masses.len();
    let of =
        |onset: usize, course: usize| LogSum::of(weighed.iter().map(|w| w.log_share(onset, course))).ln();
    let masses: Vec<[f64; 2]> = (0..n_onsets).map(|onset| [of(onset, 0), of(onset, 1)]).collect();
    let all = LogSum::of(masses.iter().flatten().copied()).ln();
    let share = |course: usize| masses.iter().map(|mass| (mass[course] - all).exp()).sum::<f64>();
    let course = usize::from(share(0) < share(1));
    let best = (0..n_onsets).max_by(|a, b| masses[*a][course].total_cmp(&masses[*b][course])).unwrap_or(0);
    let apart_s = |onset: usize| t_s[begins(onset)] - t_s[begins(best)];
    let away = |onset: usize| (masses[onset][course] - all).exp() * apart_s(onset).powi(2);
    let spread = (0..n_onsets).map(away).sum::<f64>() / share(course).max(f64::MIN_POSITIVE);
    let found = Found {
        unrest: if course == 0 { Unrest::Step } else { Unrest::Ramp },
        sample: 0,
        began_s: t_s[begins(best)],
        began_sigma_s: spread.sqrt(),
        probability: share(course).min(1.0),
        log_evidence: 0.0,
    };
    (found, begins(best))
}

/// Whether what lasts about as long as the samples is far larger than their error, and than what is stated to last.
fn is_wander(series: &Series, weighed: &mut Weighed) -> bool {
    let stated = series.stated.sigma.powi(2) + series.diurnal_sigma.powi(2);
    let least = WANDER.powi(2) * (series.typical_variance() + stated);
    // A correlated error is not known from a span that shows it once: its scatter within the span says how large it is at least.
    if series.scatter() < 0.25 * least {
        return false;
    }
    series.settle_null(weighed);
    let (error, span_s) = (weighed.null, series.span_s());
    let within = 2.0 * error.sigma.powi(2) * -(-span_s / error.time_s).exp_m1();
    0.5 * span_s < error.time_s && least < within
}

/// In numbers; `reading` is the number of the reading that sample `found.sample` is.
pub(super) fn described(
    found: &Found,
    samples: &[Sample],
    config: &LearnConfig,
    reading: usize,
) -> Unsettled {
    let (before, after) = sides(found, samples);
    let [before, after] = [before, after].map(|side| mean(side, config));
    let drift = Drift {
        old_from_new: after.0 - before.0,
        covariance: before.1 + after.1,
        began_s: found.began_s,
        began_sigma_s: found.began_sigma_s,
        course: if found.unrest == Unrest::Step { MotionKind::Step } else { MotionKind::Ramp },
        rate: None,
        again: None,
        course_probability: found.probability,
    };
    Unsettled { unrest: found.unrest, reading, drift }
}

/// The samples before and after a motion: of one that continues the first quarter and the last.
fn sides<'a, T>(found: &Found, all: &'a [T]) -> (&'a [T], &'a [T]) {
    match found.unrest {
        Unrest::Step => all.split_at(found.sample.clamp(1, all.len() - 1)),
        Unrest::Ramp | Unrest::Wander => {
            let quarter = (all.len() / 4).max(1);
            (&all[..quarter], &all[all.len() - quarter..])
        }
    }
}

/// The mean motion of samples and its covariance: what they scatter by besides what is stated, and what may last through all of them.
fn mean(samples: &[Sample], config: &LearnConfig) -> (Vector6, Matrix6) {
    let median = SVector::<f64, 6>::from_fn(|axis, _| {
        let mut values: Vec<f64> = samples.iter().map(|sample| sample.motion[axis]).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    });
    let chi2 = |sample: &Sample| {
        let y = sample.motion - median;
        sample.covariance.cholesky().map_or(f64::INFINITY, |factor| y.dot(&factor.solve(&y)))
    };
    let mut sizes: Vec<f64> = samples.iter().map(chi2).collect();
    sizes.sort_by(f64::total_cmp);
    let typical = (sizes[sizes.len() / 2] / MEDIAN).max(1.0);
    let near: Vec<&Sample> = samples.iter().filter(|sample| chi2(sample) < OUTLIER * typical).collect();
    let n = near.len().max(1) as f64;
    if near.is_empty() {
        return (median, samples[0].covariance);
    }
    let mean = near.iter().map(|sample| sample.motion).sum::<Vector6>() / n;
    let scatter = near.iter().map(|sample| (sample.motion - mean) * (sample.motion - mean).transpose());
    let stated = near.iter().map(|sample| sample.covariance).sum::<Matrix6>();
    (mean, (scatter.sum::<Matrix6>() + stated) / (n * n) + config.bias)
}
