//! The judgement of one camera.

use super::AssessConfig;
use super::clock::FleetSpan;
use super::drift::{Course, Wander, course};
use super::motion::{Motion, length};
use super::readings::{motion, readings};
use crate::state::CameraState;
use crate::words::{duration, utc, with_sigma};
use resight::core::temporal::monitor::Detectable;
use resight::core::temporal::monitor::learn::LEAST_READINGS;
use resight::core::{Matrix6, Pose, Vector6};
use resight::report::verdict::Status;
use serde::Serialize;

/// The verdict on a camera, the most urgent first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Found {
    /// Its pose changed, suddenly or slowly.
    Moved,
    /// Its rows contradict themselves: points, labels or intrinsics are wrong.
    WrongMap,
    /// It was seen, and then no more, or not at all.
    Dead,
    /// Its times are impossible.
    Clock,
    /// It moves to and fro by more than the errors of a period, as by diurnal variation.
    Wandering,
    /// It has too few poses for a verdict, or a single period says that it moved.
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

    /// Returns whether the answer may be relied on.
    pub fn status(self) -> Status {
        match self {
            Found::Moved | Found::Steady | Found::Wandering => Status::Ok,
            Found::WrongMap => Status::Inconsistent,
            Found::TooFew => Status::Undecided,
            Found::Dead | Found::Clock | Found::Unknown => Status::Error,
        }
    }
}

/// A camera with its verdict.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraVerdict {
    /// Its name.
    pub camera: String,
    /// The word.
    pub found: Found,
    /// The sentence.
    pub message: String,
    /// Its motions, in order of time.
    pub events: Vec<Motion>,
    /// Its final pose in its own initial frame, `[rotation_rad; translation_m]`, with its covariance, where it moved more than once.
    pub now: Option<(Vector6, Matrix6)>,
    /// The pose before any motion, and its covariance.
    pub cam_from_target: Option<(Pose, Matrix6)>,
    /// The motion that would have been found.
    pub detectable: Option<Detectable>,
    /// Rows of each status: ok, ambiguous, degenerate, inconsistent, implausible, anything else.
    pub counts: [u64; 6],
    /// First and last time of a row, seconds.
    pub span_s: Option<(f64, f64)>,
    /// Motions before this time, seconds, are known.
    pub known_until_s: Option<f64>,
    /// Small motions from the first period's pose, by the middle of each period, seconds; for pictures.
    pub history: Vec<(f64, [f64; 6])>,
}

impl CameraVerdict {
    /// The motion with the most evidence, of those that are not known.
    pub fn motion(&self) -> Option<&Motion> {
        let moved = self.new_motions().filter(|_| self.found == Found::Moved);
        moved.max_by(|a, b| a.chi2.total_cmp(&b.chi2))
    }

    /// The confirmed motions that are not known.
    pub(super) fn new_motions(&self) -> impl Iterator<Item = &Motion> {
        self.events.iter().filter(|event| event.is_confirmed() && event.is_new(self.known_until_s))
    }
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
        events: Vec::new(),
        now: None,
        cam_from_target: None,
        detectable: None,
        counts: state.counts,
        span_s: state.span_s,
        known_until_s: config.known_until_s,
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
    judged(plain(Found::Steady, String::new()), course(state, fleet.period_s, config), config)
}

fn dead(state: &CameraState, fleet: &FleetSpan, config: &AssessConfig) -> Option<String> {
    if state.rows() == 0 {
        return Some("no row of this camera was seen".into());
    }
    let silent_s = fleet.silent_s(state)?;
    let is_silent = f64::from(config.dead_periods) * fleet.period_s < silent_s;
    is_silent.then(|| {
        format!(
            "not seen for the last {}, since {}, after {} rows",
            duration(silent_s),
            utc(state.span_s.map_or(0.0, |s| s.1)),
            state.rows()
        )
    })
}

fn judged(plain: CameraVerdict, course: Course, config: &AssessConfig) -> CameraVerdict {
    let mut new = course.events.iter().filter(|event| event.is_new(config.known_until_s)).peekable();
    let is_unconfirmed = new.peek().is_some();
    let is_moved = new.any(Motion::is_confirmed);
    let (found, message) = match (&course.unrest, &course.reference) {
        _ if is_moved => (Found::Moved, moved(&course)),
        _ if is_unconfirmed => {
            (Found::TooFew, format!("{}; two periods are needed to confirm a motion", moved(&course)))
        }
        _ if !course.events.is_empty() => {
            (Found::Steady, format!("stayed since; before that: {}", moved(&course)))
        }
        (Some(wander), _) => (Found::Wandering, wandering(wander)),
        (None, Some(_)) => (Found::Steady, steady(course.detectable.as_ref())),
        (None, None) => (Found::TooFew, too_few(course.readings, &plain.counts, config)),
    };
    CameraVerdict {
        found,
        message,
        events: course.events,
        now: course.now,
        cam_from_target: course.reference,
        detectable: course.detectable,
        ..plain
    }
}

/// Events that a sentence names.
const NAMED: usize = 4;

fn moved(course: &Course) -> String {
    let named: Vec<String> = course.events.iter().take(NAMED).map(event).collect();
    let mut text = named.join("; ");
    if NAMED < course.events.len() {
        text += &format!("; {} more", course.events.len() - NAMED);
    }
    if let Some((now, covariance)) = &course.now {
        let angle = length(&now.fixed_rows::<3>(0).into(), &covariance.fixed_view::<3, 3>(0, 0).into());
        let shift = length(&now.fixed_rows::<3>(3).into(), &covariance.fixed_view::<3, 3>(3, 3).into());
        text += &format!(
            "; at the end rotated by {}° and shifted by {} mm from where it was",
            with_sigma(angle.map(f64::to_degrees)),
            with_sigma(shift.map(|x| 1e3 * x))
        );
    }
    text
}

fn event(motion: &Motion) -> String {
    let how = match motion.kind {
        "step" => "moved suddenly at",
        "ramp" if motion.until_s.is_some() => "moved slowly from",
        "ramp" => "moves slowly since",
        "pending" => "only its last period says that it moved, at",
        _ => "away for a single period, at",
    };
    let by = if motion.is_at_least { "at least " } else { "" };
    let far = match &motion.rotation_alone_deg {
        Some(_) => format!("rotated by {by}{}° about its centre", with_sigma(motion.angle_deg)),
        None => format!(
            "rotated by {by}{}°, shifted by {by}{} mm",
            with_sigma(motion.angle_deg),
            with_sigma(motion.shift_m.map(|x| 1e3 * x))
        ),
    };
    let (when, within) = (utc(motion.since_s), duration(motion.since_sigma_s));
    let until = motion.until_s.map_or(String::new(), |[until_s, sigma_s]| {
        format!(" to {} (± {})", utc(until_s), duration(sigma_s))
    });
    format!("{how} {when} (± {within}){until}: {far}; χ² = {:.0} with 6 degrees of freedom", motion.chi2)
}

fn wandering(wander: &Wander) -> String {
    let size = |y: &Vector6| {
        let (angle, shift) = (y.fixed_rows::<3>(0).norm().to_degrees(), y.fixed_rows::<3>(3).norm() * 1e3);
        format!("{angle:.4}° and {shift:.2} mm")
    };
    match wander {
        Wander::ToAndFro { by, likely } => {
            let text = format!(
                "moves to and fro by {} over the record, by more than the errors of its periods",
                size(by)
            );
            match likely.first() {
                Some(likely) => format!("{text}; likelier, but not beyond doubt: {}", event(likely)),
                None => text,
            }
        }
        Wander::Off { readings, farthest, t_s } => format!(
            "{readings} of its periods are farther off than a step that would have been found, by up to {}, at {}; errors that last explain \
             them as well as a motion",
            size(farthest),
            utc(*t_s)
        ),
    }
}

fn too_few(readings: usize, counts: &[u64; 6], config: &AssessConfig) -> String {
    let rows: u64 = counts.iter().sum();
    let words = [
        "are ok",
        "are ambiguous: two poses fit the layout of their points",
        "are degenerate: their points determine no pose",
        "contradict their points",
        "have points that are hardly in metres",
        "have no pose",
    ];
    let most = (1..6).max_by_key(|i| counts[*i]).filter(|i| counts[0] < counts[*i]);
    let why = match most {
        Some(i) => {
            format!("{:.0} % of its {rows} views {}", 100.0 * counts[i] as f64 / rows as f64, words[i])
        }
        None => format!("{} of its {rows} views are ok", counts[0]),
    };
    format!(
        "{why}; {readings} periods hold {} or more that are ok, and {LEAST_READINGS} are needed",
        config.least_rows
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
    readings.iter().map(|r| (r.t_s, motion(&first, &r.a_from_b).into())).collect()
}
