//! How late the change detector is, for which rate of false alarms: the numbers of docs/images/watch-delay.csv.

use super::conditions::{Condition, Scene as Tag};
use super::rivals::{alarms, cusum_delays, cusum_threshold, lorden, three_in_a_row};
use super::sentry::{DAY_S, REALISTIC, SIGMA, Scene, Stream, WHITE, delays_s, pan};
use nalgebra::Vector6;
use resight_core::temporal::monitor::{Monitor, MonitorConfig, Watch};

/// A row: what changed, at which rate of false alarms, which test, and how late it was.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// `white` or `correlated` (correlated errors, and a diurnal variation): steps; `slow`: drifts under such errors; `tag 10 s after 3600 s`: steps
    /// of a tag whose corners err by 30 % correlated over 10 s, after 3600 s of watching.
    pub noise: String,
    /// σ of a reading of a step; degrees an hour of a slow drift; degrees of a tag's step.
    pub size: f64,
    /// False alarms a day that are promised.
    pub per_day: f64,
    /// `detector`, `lorden`, `cusum` or `three`; of a tag `measured` (nothing declared) or `known` (share and time constant stated); `cusum_false` and `three_false`: alarms a day while nothing moves, in `mean`.
    pub test: String,
    /// Of the delay: readings (seconds) of steps, degrees that a slow drift has gone.
    pub mean: f64,
    /// Exceeded by one in ten; NaN of a bound.
    pub p90: f64,
    /// Standard deviation; 0 where the mean is exact.
    pub sigma: f64,
    /// Simulated.
    pub trials: usize,
}

pub const RATES: [f64; 6] = [24.0, 4.0, 1.0, 1.0 / 7.0, 1.0 / 30.0, 1.0 / 365.0];
pub const FEW_RATES: [f64; 4] = [24.0, 1.0, 1.0 / 30.0, 1.0 / 365.0];
pub const SIZES: [f64; 4] = [0.5, 1.0, 2.0, 4.0];
/// Steps under correlated errors as large as a reading's; no larger than those, a step hides in them for hours.
pub const LARGE: [f64; 3] = [2.0, 4.0, 8.0];
pub const SLOPES_DEG_PER_H: [f64; 5] = [0.005, 0.01, 0.02, 0.05, 0.1];
/// Readings before a step.
const QUIET_S: f64 = 300.0;

pub const HEADER: &str = "noise,size,per_day,test,mean,p90,sigma,trials";

impl Row {
    /// As a line of the file.
    pub fn line(&self) -> String {
        let Row { noise, size, per_day, test, mean, p90, sigma, trials } = self;
        format!("{noise},{size},{per_day:.6},{test},{mean:.4},{p90:.4},{sigma:.4},{trials}")
    }

    /// None where it is no line of the file.
    pub fn parse(line: &str) -> Option<Row> {
        let parts: Vec<&str> = line.split(',').collect();
        let [noise, size, per_day, test, mean, p90, sigma, trials] = parts[..] else { return None };
        Some(Row {
            noise: noise.to_string(),
            size: size.parse().ok()?,
            per_day: per_day.parse().ok()?,
            test: test.to_string(),
            mean: mean.parse().ok()?,
            p90: p90.parse().ok()?,
            sigma: sigma.parse().ok()?,
            trials: trials.parse().ok()?,
        })
    }

    fn of(noise: &str, size: f64, per_day: f64, test: &str, delays: Vec<f64>) -> Row {
        let (mean, p90, sigma) = summary(&delays);
        let (noise, test) = (noise.to_string(), test.to_string());
        Row { noise, size, per_day, test, mean, p90, sigma, trials: delays.len() }
    }
}

/// Mean, 90 % quantile, standard deviation.
fn summary(delays: &[f64]) -> (f64, f64, f64) {
    let mut sorted = delays.to_vec();
    sorted.sort_by(f64::total_cmp);
    let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
    let variance = sorted.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (sorted.len() - 1) as f64;
    (mean, sorted[(0.9 * (sorted.len() - 1) as f64).round() as usize], variance.sqrt())
}

/// A pan by so many σ.
pub fn step(noise: &str, size: f64, per_day: f64, trials: std::ops::Range<u64>) -> Row {
    let scene = if noise == "white" { WHITE } else { REALISTIC };
    let moved = |_| pan((size * SIGMA[1]).to_degrees());
    Row::of(noise, size, per_day, "sentry", delays_s(scene, per_day, QUIET_S, trials, moved))
}

/// A pan that continues, after a quiet day, at a reading every ten seconds.
pub fn slow(slope_deg_per_h: f64, per_day: f64, trials: std::ops::Range<u64>) -> Row {
    let scene = Scene { period_s: 10.0, ..REALISTIC };
    let moved = |since_s: f64| pan(slope_deg_per_h * since_s / 3600.0);
    let gone =
        delays_s(scene, per_day, DAY_S, trials, moved).into_iter().map(|s| slope_deg_per_h * s / 3600.0);
    Row::of("slow", slope_deg_per_h, per_day, "sentry", gone.collect())
}

/// Correlated errors of a tag: seconds; steps, degrees; seconds of watching before a step, longer than which a delay is not waited for.
pub const TAG_TIMES_S: [f64; 2] = [10.0, 60.0];
pub const TAG_STEPS_DEG: [f64; 3] = [0.02, 0.05, 0.1];
pub const TAG_QUIET_S: [f64; 3] = [600.0, 3600.0, 21_600.0];
pub const TAG_TRIALS: u64 = 40;
const TAG_LONGEST_S: f64 = 1200.0;

/// A pan of a camera that sees a tag, at one false alarm a month.
pub fn tag(time_s: f64, degrees: f64, quiet_s: f64, is_known: bool, trials: std::ops::Range<u64>) -> Row {
    let config = MonitorConfig::default();
    let delay = |trial: u64| {
        let mut tag = Tag::new(Condition::Correlated { share: 0.3, time_s }, 1.0, 0x7a6_0000 + trial);
        let mut monitor = if is_known { tag.known(50, &config) } else { tag.learned(50, &config) };
        let began_s = tag.t_s + quiet_s;
        tag_alarm_s(&mut monitor, &mut tag, &Vector6::zeros(), began_s)
            .is_none()
            .then(|| tag_alarm_s(&mut monitor, &mut tag, &pan(degrees), began_s + TAG_LONGEST_S))
            .map(|alarm_s| alarm_s.map_or(TAG_LONGEST_S, |alarm_s| alarm_s - began_s))
    };
    let test = if is_known { "known" } else { "measured" };
    let noise = format!("tag {time_s} s after {quiet_s} s");
    Row::of(&noise, degrees, config.false_alarms_per_day, test, trials.filter_map(delay).collect())
}

/// When the alarm is raised; none until then.
fn tag_alarm_s(monitor: &mut Monitor, tag: &mut Tag, moved: &Vector6<f64>, until_s: f64) -> Option<f64> {
    while tag.t_s < until_s {
        if let Watch::Drifted(_) = monitor.push(&tag.next(moved)) {
            return Some(tag.t_s);
        }
    }
    None
}

/// What others are, for the same step in white noise.
pub fn alternatives(size: f64, per_day: f64, trials: u64) -> Vec<Row> {
    let between = DAY_S / per_day;
    let threshold = cusum_threshold(size, between);
    let cusum = cusum_delays(size, threshold, QUIET_S as usize, trials);
    let exact = |test: &str, mean, p90| Row {
        noise: "white".to_string(),
        size,
        per_day,
        test: test.to_string(),
        mean,
        p90,
        sigma: 0.0,
        trials: 0,
    };
    let (mean, p90) = three_in_a_row(size, between);
    vec![
        exact("lorden", lorden(size, between), f64::NAN),
        Row::of("white", size, per_day, "cusum", cusum),
        exact("three", mean, p90),
    ]
}

/// Alarms a day of the others while nothing moves, under correlated errors, when they are set for white noise and this rate.
pub fn alternatives_false(size: f64, per_day: f64, days: u64) -> Vec<Row> {
    let mut stream = Stream::new(Scene { reference: 0.0, ..REALISTIC }, 0xfa15e);
    let mut next = || stream.next_motion(&Vector6::zeros()).component_div(&Vector6::from(SIGMA));
    let readings = (0..days * DAY_S as u64).map(|_| next());
    let (cusum, three) = alarms(size, DAY_S / per_day, readings);
    let row = |test: &str, n: usize| Row {
        noise: "lasting".to_string(),
        size,
        per_day,
        test: test.to_string(),
        mean: n as f64 / days as f64,
        p90: f64::NAN,
        sigma: (n as f64).sqrt() / days as f64,
        trials: n,
    };
    vec![row("cusum_false", cusum), row("three_false", three)]
}
