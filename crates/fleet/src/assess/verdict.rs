//! One camera, judged.

use super::AssessConfig;
use super::clock::{FleetSpan, duration};
use super::drift::{Course, Motion, course, readings};
use crate::state::CameraState;
use resight::core::temporal::monitor::Detectable;
use resight::core::{Matrix6, Pose};
use resight::report::verdict::Status;
use serde::Serialize;

/// What is to be said of a camera, the most urgent first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Found {
    /// Its pose changed, suddenly or slowly.
    Moved,
    /// Its rows contradict themselves: points, labels or intrinsics are wrong.
    WrongMap,
    /// It was seen, and then no more, or not at all.
    Dead,
    /// Its times cannot be.
    Clock,
    /// It moves to and fro by more than the errors of a period, as by the warmth of the day.
    Wandering,
    /// Too few poses to say anything.
    TooFew,
    /// It is in the rows, but not in the table of cameras.
    Unknown,
    /// It stayed where it was.
    Steady,
}

impl Found {
    /// The word in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Found::Moved => "moved",
            Found::WrongMap => "wrong_map",
            Found::Dead => "dead",
            Found::Clock => "clock",
            Found::Wandering => "wandering",
            Found::TooFew => "too_few",
            Found::Unknown => "unknown",
            Found::Steady => "steady",
        }
    }

    /// Whether the answer may be relied on.
    pub fn status(self) -> Status {
        match self {
            Found::Moved | Found::Steady | Found::Wandering => Status::Ok,
            Found::WrongMap => Status::Inconsistent,
            Found::TooFew => Status::Undecided,
            Found::Dead | Found::Clock | Found::Unknown => Status::Error,
        }
    }
}

/// A camera and what is to be said of it.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraVerdict {
    /// Its name.
    pub camera: String,
    /// The word.
    pub found: Found,
    /// The sentence.
    pub message: String,
    /// How far it moved.
    pub motion: Option<Motion>,
    /// The pose before any motion, and its covariance.
    pub cam_from_target: Option<(Pose, Matrix6)>,
    /// The motion that would have been found.
    pub detectable: Option<Detectable>,
    /// Rows of each status: ok, ambiguous, degenerate, inconsistent, anything else.
    pub counts: [u64; 5],
    /// First and last time of a row, seconds.
    pub span_s: Option<(f64, f64)>,
    /// Small motions from the first period's pose, by the middle of each period, seconds; for pictures.
    pub history: Vec<(f64, [f64; 6])>,
}

pub(super) fn of(
    name: &str,
    state: &CameraState,
    is_known: bool,
    fleet: &FleetSpan,
    config: &AssessConfig,
) -> CameraVerdict {
    let plain = |found: Found, message: String| CameraVerdict {
        camera: name.to_string(),
        found,
        message,
        motion: None,
        cam_from_target: None,
        detectable: None,
        counts: state.counts,
        span_s: state.span_s,
        history: history(state, fleet.period_s, config),
    };
    if !is_known {
        return plain(
            Found::Unknown,
            "this camera is in the rows, but not among the cameras; add it to the table".into(),
        );
    }
    if let Some(reason) = fleet.fault(state) {
        return plain(Found::Clock, reason);
    }
    let solved = state.counts[0] + state.counts[1] + state.counts[3];
    let wrong = state.counts[3] as f64 / (solved as f64).max(1.0);
    if config.wrong_share < wrong {
        let message = format!(
            "{:.0} % of its {solved} poses contradict the stated noise: check its points, their labels and its intrinsics",
            100.0 * wrong
        );
        return plain(Found::WrongMap, message);
    }
    if let Some(message) = dead(state, fleet, config) {
        return plain(Found::Dead, message);
    }
    judged(plain(Found::Steady, String::new()), course(state, fleet.period_s, config))
}

fn dead(state: &CameraState, fleet: &FleetSpan, config: &AssessConfig) -> Option<String> {
    if state.rows() == 0 {
        return Some("no row of this camera was seen".into());
    }
    let silent_s = fleet.silent_s(state)?;
    let is_silent = f64::from(config.dead_periods) * fleet.period_s < silent_s;
    is_silent.then(|| {
        format!(
            "not seen for the last {}, since time {:.0} s",
            duration(silent_s),
            state.span_s.map_or(0.0, |s| s.1)
        )
    })
}

fn judged(plain: CameraVerdict, course: Course) -> CameraVerdict {
    let (found, message) = match (&course.motion, &course.wander, &course.reference) {
        (Some(motion), _, _) => (Found::Moved, moved(motion)),
        (None, Some(by), _) => {
            let message = format!(
                "moves to and fro by {:.4}° and {:.2} mm over the record, by more than the errors of its periods",
                by.fixed_rows::<3>(0).norm().to_degrees(),
                by.fixed_rows::<3>(3).norm() * 1e3
            );
            (Found::Wandering, message)
        }
        (None, None, Some(_)) => (Found::Steady, steady(course.detectable.as_ref())),
        (None, None, None) => {
            let message = format!("{} periods hold enough poses that are ok; 20 are needed", course.readings);
            (Found::TooFew, message)
        }
    };
    CameraVerdict {
        found,
        message,
        motion: course.motion,
        cam_from_target: course.reference,
        detectable: course.detectable,
        ..plain
    }
}

fn moved(motion: &Motion) -> String {
    let norm = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let how = if motion.kind == "step" { "moved suddenly" } else { "moves slowly" };
    let far = match &motion.rotation_alone_deg {
        Some(rotation) => format!("rotated by {:.4}° about its centre", norm(rotation)),
        None => format!(
            "rotated by {:.4}°, shifted by {:.2} mm",
            norm(&motion.rotation_deg),
            1e3 * norm(&motion.translation_m)
        ),
    };
    format!(
        "{how} at time {:.0} s (± {}): {far}; χ² = {:.0} with 6 degrees of freedom",
        motion.since_s,
        duration(motion.since_sigma_s),
        motion.chi2
    )
}

fn steady(detectable: Option<&Detectable>) -> String {
    let Some(d) = detectable else { return "stayed".into() };
    let most = |v: &[f64; 3]| v.iter().copied().fold(0.0, f64::max);
    format!(
        "stayed; a step of {:.4}° about one axis, or of {:.2} mm along one, would have been found within {}",
        most(&d.rotation_rad).to_degrees(),
        1e3 * most(&d.translation_m),
        duration(d.within_s)
    )
}

fn history(state: &CameraState, period_s: f64, config: &AssessConfig) -> Vec<(f64, [f64; 6])> {
    let readings = readings(state, period_s, config.least_rows);
    let Some(first) = readings.first().map(|reading| reading.a_from_b) else { return Vec::new() };
    readings.iter().map(|r| (r.t_s, (first * r.a_from_b.inverse()).log().into())).collect()
}
