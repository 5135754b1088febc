//! Determines which cameras moved, from the sums of each camera, as a report.
//!
//! The means of a camera's periods are readings of the change detector of `core` (`temporal::monitor`): its test of a past record finds a step
//! or a ramp at a stated rate of false alarms, whatever correlated errors the readings have; its bank of noise models determines which motion
//! would have been found. There is no other threshold here except for cameras that are dead, whose map is wrong, or whose clock is:
//! docs/math/fleet.md.

mod clock;
mod readings;
mod motion;
mod series;
mod partition;
mod evidence;
mod amid;
mod ramps;
mod share;
mod events;
mod drift;
mod verdict;
mod masts;

pub use clock::{FleetSpan, unit_of_time};
pub use masts::Together;
pub use motion::Motion;
pub use verdict::{CameraVerdict, Found};

use crate::FleetError;
use crate::cameras::Cameras;
use crate::state::{CameraState, FleetState};
use crate::words;
use nalgebra::Matrix6;
use rayon::prelude::*;
use resight::core::temporal::monitor::FALSE_ALARM_PROBABILITY;
use resight::core::temporal::monitor::learn::LearnConfig;
use resight::parallel::on_all_cores;
use std::collections::BTreeMap;

/// The settings: what counts as a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AssessConfig {
    /// Rows of a period, at least, for its mean to count.
    pub least_rows: u64,
    /// Standard deviation of the diurnal variation of each angle, radians.
    pub diurnal_rad: f64,
    /// Standard deviation of the diurnal variation of each coordinate, metres.
    pub diurnal_m: f64,
    /// Share of inconsistent rows beyond which the points or the intrinsics of a camera are wrong.
    pub wrong_share: f64,
    /// Periods without a row, at the end of the record, after which a camera is dead.
    pub dead_periods: u32,
    /// Motions before this time, seconds, are known: they are reported, but a camera that has stayed since is not called moved.
    pub known_until_s: Option<f64>,
    /// The detectable motion is stated for a step after which the camera is at rest for this many periods.
    pub promise_periods: u32,
}

impl Default for AssessConfig {
    fn default() -> Self {
        AssessConfig {
            least_rows: 5,
            diurnal_rad: 0.0,
            diurnal_m: 0.0,
            wrong_share: 0.5,
            dead_periods: 4,
            known_until_s: None,
            promise_periods: 8,
        }
    }
}

impl AssessConfig {
    fn correlated(&self, period_s: f64) -> LearnConfig {
        let square = |i: usize| if i < 3 { self.diurnal_rad.powi(2) } else { self.diurnal_m.powi(2) };
        LearnConfig {
            bias: Matrix6::zeros(),
            bias_time_s: 4.0 * period_s,
            diurnal: Matrix6::from_diagonal(&nalgebra::Vector6::from_fn(|i, _| square(i))),
        }
    }
}

/// A difference from an earlier state.
#[derive(Debug, Clone, PartialEq)]
pub struct Changes {
    /// When that state ended, seconds.
    pub since_s: f64,
    /// Cameras of which another thing is found now: before (none: they were not there) and now.
    pub cameras: Vec<(String, Option<Found>, Found)>,
}

/// A fleet, judged.
#[derive(Debug, Clone, PartialEq)]
pub struct Assessment {
    /// One entry for each camera of the table and of the rows: those that moved first, by evidence; then by what is wrong, then by name.
    pub cameras: Vec<CameraVerdict>,
    /// The period from where most cameras begin to where most end, seconds.
    pub span_s: Option<(f64, f64)>,
    /// Seconds of a period.
    pub period_s: f64,
    /// Cameras of those that stayed that are expected to be called moved.
    pub expected_false_alarms: f64,
    /// Cameras of one site that moved at one time.
    pub together: Vec<Together>,
    /// The differences from the state before these poses, where that is known.
    pub changes: Option<Changes>,
    /// What could not be read, in sentences: rows of the table of cameras.
    pub unread: Vec<String>,
}

impl Assessment {
    /// Returns the number of cameras with each verdict.
    pub fn counts(&self) -> BTreeMap<&'static str, usize> {
        let mut counts = BTreeMap::new();
        for camera in &self.cameras {
            *counts.entry(camera.found.name()).or_default() += 1;
        }
        counts
    }
}

/// Judges every camera. `known` are those that should be there.
///
/// # Errors
/// `Setting` for a period that is not positive.
pub fn assess(
    state: FleetState,
    known: Option<&Cameras>,
    config: &AssessConfig,
) -> Result<Assessment, FleetError> {
    assess_news(state, known, config, &|_| config.known_until_s)
}

/// As `assess`, with the time until which the motions of each camera are known.
fn assess_news(
    state: FleetState,
    known: Option<&Cameras>,
    config: &AssessConfig,
    known_until_s: &(dyn Fn(&str) -> Option<f64> + Sync),
) -> Result<Assessment, FleetError> {
    let period_s = positive(state.period_s())?;
    let mut cameras: BTreeMap<String, CameraState> = state.into_cameras().into_iter().collect();
    for name in known.iter().flat_map(|cameras| cameras.names()) {
        cameras.entry(name.clone()).or_default();
    }
    let fleet = FleetSpan::of(cameras.values().filter_map(|camera| camera.span_s), period_s);
    let config_of = |name: &str| AssessConfig { known_until_s: known_until_s(name), ..*config };
    Ok(judged(&cameras, known, &fleet, &config_of))
}

/// Standard deviations by which a motion that is confirmed may be earlier than it seemed.
const PENDING_SIGMAS: f64 = 3.0;

/// Judges a fleet by the rows of a state and of the one before it: what is new since that one ended.
///
/// # Errors
/// As `assess`; `Setting` for periods of other lengths, and a state that ends when the other has long begun.
pub fn assess_since(
    state: FleetState,
    before: FleetState,
    known: Option<&Cameras>,
    config: &AssessConfig,
) -> Result<Assessment, FleetError> {
    let (period_s, other_s) = (positive(state.period_s())?, before.period_s());
    let span = |state: &FleetState| {
        FleetSpan::of(state.spans().into_iter().filter_map(|(_, span)| span), period_s).span_s()
    };
    let ((begin, _), (_, since_s)) = span(&state)
        .zip(span(&before))
        .ok_or_else(|| FleetError::Setting("a state without any time cannot be compared with".into()))?;
    if begin + 4.0 * period_s < since_s {
        let (since, begin) = (words::utc(since_s), words::utc(begin));
        let reason = format!(
            "the state before ends at {since}, and these poses begin at {begin}; give the state of the time before them"
        );
        return Err(FleetError::Setting(reason));
    }
    let earlier = assess(FleetState::from_bytes(&before.to_bytes())?, known, config)?;
    let whole = state.merge(before).map_err(|_| {
        let reason = format!("the periods are {period_s} s and {other_s} s; states of one length are needed");
        FleetError::Setting(reason)
    })?;
    // What a single period said then is not known: it may be confirmed now.
    let unconfirmed = |v: &CameraVerdict| {
        let event = v.events.iter().find(|event| event.kind == "pending")?;
        Some((v.camera.clone(), event.since_s - PENDING_SIGMAS * event.since_sigma_s))
    };
    let unconfirmed: BTreeMap<String, f64> = earlier.cameras.iter().filter_map(unconfirmed).collect();
    let known_until_s = |name: &str| Some(unconfirmed.get(name).map_or(since_s, |t_s| since_s.min(*t_s)));
    let mut fleet = assess_news(whole, known, config, &known_until_s)?;
    let earlier: BTreeMap<&str, Found> =
        earlier.cameras.iter().map(|v| (v.camera.as_str(), v.found)).collect();
    let changed = |v: &CameraVerdict| {
        let before = earlier.get(v.camera.as_str()).copied();
        // A camera that moved before and is still in its later pose counts as unchanged.
        let is_known = v.found == Found::Steady && before == Some(Found::Moved);
        (before != Some(v.found) && !is_known).then(|| (v.camera.clone(), before, v.found))
    };
    fleet.changes = Some(Changes { since_s, cameras: fleet.cameras.iter().filter_map(changed).collect() });
    Ok(fleet)
}

/// Assesses a part of a fleet whose period is known: only the cameras of the state. All parts together give the result of `assess` for the whole
/// fleet.
///
/// # Errors
/// The errors of `assess`.
pub fn assess_part(
    state: FleetState,
    known: Option<&Cameras>,
    span_s: Option<(f64, f64)>,
    config: &AssessConfig,
) -> Result<Assessment, FleetError> {
    let fleet = FleetSpan::new(span_s, positive(state.period_s())?);
    Ok(judged(&state.into_cameras().into_iter().collect(), known, &fleet, &|_| *config))
}

fn positive(period_s: f64) -> Result<f64, FleetError> {
    if 0.0 < period_s && period_s.is_finite() {
        return Ok(period_s);
    }
    let reason = format!("the period is {period_s} s; a positive number of seconds is needed");
    Err(FleetError::Setting(reason))
}

fn judged(
    cameras: &BTreeMap<String, CameraState>,
    known: Option<&Cameras>,
    fleet: &FleetSpan,
    config_of: &(dyn Fn(&str) -> AssessConfig + Sync),
) -> Assessment {
    let all: Vec<(&String, &CameraState)> = cameras.iter().collect();
    let is_known = |name: &str| known.is_none_or(|cameras| cameras.number(name).is_some());
    let of = |(name, state): &(&String, &CameraState)| {
        verdict::of(name, state, is_known(name), fleet, &config_of(name))
    };
    let mut verdicts: Vec<CameraVerdict> = on_all_cores(|| all.par_iter().map(of).collect());
    verdicts.sort_by(|a, b| {
        let evidence = |v: &CameraVerdict| v.motion().map_or(0.0, |motion| motion.chi2);
        a.found.cmp(&b.found).then(evidence(b).total_cmp(&evidence(a))).then(a.camera.cmp(&b.camera))
    });
    let tested = verdicts.iter().filter(|v| matches!(v.found, Found::Steady | Found::Wandering)).count();
    Assessment {
        together: known.map_or_else(Vec::new, |cameras| masts::together(&verdicts, cameras)),
        unread: known.map_or_else(Vec::new, |cameras| {
            cameras.rejected.iter().map(|(_, reason)| reason.clone()).collect()
        }),
        changes: None,
        cameras: verdicts,
        span_s: fleet.span_s(),
        period_s: fleet.period_s,
        expected_false_alarms: tested as f64 * (FALSE_ALARM_PROBABILITY + evidence::FALSE_ALARM_PROBABILITY),
    }
}
