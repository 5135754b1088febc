//! The status of an estimate, or of a missing one, with a sentence that explains it and the way out.

use crate::core::Error;
use crate::core::locate::choose::Ambiguity;
use crate::core::locate::consistency::Consistency;
use crate::core::locate::{Method, PoseEstimate};
use crate::core::multiview::network::NetworkStatus;
use crate::core::multiview::tag_map::{DisplacedTag, TargetPose};
use crate::core::solve::line_plus_one::Weakness;
use crate::report::words::percent;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether an answer may be relied on, and if not, why. Every answer has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// One pose, and its residual agrees with the stated noise.
    Ok,
    /// Two poses fit.
    Ambiguous,
    /// The points do not determine the pose.
    Degenerate,
    /// The residual is far above the stated noise.
    Inconsistent,
    /// The target is not in the image.
    NotFound,
    /// Several explanations fit, or the data do not reach for one.
    Undecided,
    /// No chain of observations joins all cameras.
    NotConnected,
    /// The numbers agree, but a stated size or unit hardly exists, such as squares of 25 m.
    Implausible,
    /// Anything else that kept the answer back.
    Error,
}

impl Status {
    /// Returns the word used in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Status::Ok => "ok",
            Status::Ambiguous => "ambiguous",
            Status::Degenerate => "degenerate",
            Status::Inconsistent => "inconsistent",
            Status::NotFound => "not_found",
            Status::Undecided => "undecided",
            Status::NotConnected => "not_connected",
            Status::Implausible => "implausible",
            Status::Error => "error",
        }
    }

    /// Returns whether an answer of this status has a pose.
    pub fn has_pose(self) -> bool {
        matches!(self, Status::Ok | Status::Ambiguous | Status::Inconsistent | Status::Implausible)
    }
}

impl From<NetworkStatus> for Status {
    fn from(status: NetworkStatus) -> Self {
        match status {
            NetworkStatus::Ok => Status::Ok,
            NetworkStatus::Ambiguous => Status::Ambiguous,
            NetworkStatus::Inconsistent => Status::Inconsistent,
            NetworkStatus::Degenerate => Status::Degenerate,
        }
    }
}

/// A status and its sentence.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// The status.
    pub status: Status,
    /// The sentence: the current state, the number seen, the number needed, what to do.
    pub message: String,
}

impl Verdict {
    /// Changes `ok` to `implausible` where there is a remark about stated sizes; the message then begins with the first one.
    pub fn with_sizes(self, remarks: &[String]) -> Self {
        match (self.status, remarks.first()) {
            (Status::Ok, Some(remark)) => {
                Verdict { status: Status::Implausible, message: format!("{remark}; {}", self.message) }
            }
            _ => self,
        }
    }
}

/// Judges an estimate. `name_of` returns the name of the point at an index; `unit` is that of the residual, e.g. `px`.
pub fn of_estimate(estimate: &PoseEstimate, name_of: impl Fn(usize) -> String, unit: &str) -> Verdict {
    let uniqueness = uniqueness(estimate);
    match (&estimate.consistency, &estimate.ambiguity) {
        (Consistency::Inconsistent { chi2_per_degree_of_freedom, .. }, _)
            if estimate.method == Method::Wang2004 =>
        {
            Verdict {
                status: Status::Inconsistent,
                message: format!(
                    "the printed procedure is not refined, and its residual is far above the stated noise (χ²/dof {chi2_per_degree_of_freedom:.1}, \
                 expected 1); use method auto for the best pose of these points"
                ),
            }
        }
        (Consistency::Inconsistent { chi2_per_degree_of_freedom, worst_prior: Some(prior), .. }, _) => {
            Verdict {
                status: Status::Inconsistent,
                message: format!(
                    "what is stated of the pose besides the points (prior {}) contradicts them (χ²/dof {chi2_per_degree_of_freedom:.1}, expected 1; without it \
                 they agree with their sigmas); check it and its stated uncertainty before using this pose",
                    prior + 1
                ),
            }
        }
        (
            Consistency::Inconsistent {
                chi2_per_degree_of_freedom,
                worst_point,
                worst_px,
                worst_prior: None,
            },
            _,
        ) => Verdict {
            status: Status::Inconsistent,
            message: format!(
                "the residual is far above the stated noise (χ²/dof {chi2_per_degree_of_freedom:.1}, expected 1; worst is {}, {} {unit} off); \
                 check the intrinsics, the target's dimensions and the labels before using this pose",
                name_of(*worst_point),
                figures(*worst_px),
            ),
        },
        (_, Ambiguity::Ambiguous { .. }) => Verdict { status: Status::Ambiguous, message: uniqueness },
        _ => Verdict { status: Status::Ok, message: uniqueness },
    }
}

/// Judges a view of a target, as `of_estimate`; for a map of tags it also names the tags that were left out, and those that contradict each
/// other.
pub fn of_target(found: &TargetPose, name_of: impl Fn(usize) -> String) -> Verdict {
    let verdict = match &found.estimate {
        Ok(e) if !found.contradicting.is_empty() => {
            Verdict { status: Status::Inconsistent, message: contradiction(&found.contradicting, e) }
        }
        Ok(e) => of_estimate(e, name_of, "px"),
        Err(reason) => of_error(reason),
    };
    if found.left_out.is_empty() {
        return verdict;
    }
    let said: Vec<String> = found.left_out.iter().map(tag_out_of_place).collect();
    let message = format!("{}; {}", said.join("; "), verdict.message);
    Verdict { message, ..verdict }
}

/// Describes a displaced tag: "tag 7 is 41 mm from where the map says (limit 12 mm); left out".
fn tag_out_of_place(tag: &DisplacedTag) -> String {
    let id = tag.id;
    let (Some(distance_m), Some(rotation_rad), Some(limit_m)) =
        (tag.distance_m, tag.rotation_rad, tag.limit_m)
    else {
        return format!("tag {id} is not where the map says; left out");
    };
    let turned = if TURNED_RAD < rotation_rad {
        format!(" and rotated by {:.1}°", rotation_rad.to_degrees())
    } else {
        String::new()
    };
    format!(
        "tag {id} is {}{turned} from where the map says (limit {}); left out",
        length(distance_m),
        length(limit_m)
    )
}

/// Smallest rotation that is mentioned beside the distance.
const TURNED_RAD: f64 = 0.05;

fn length(m: f64) -> String {
    if m < 1.0 { format!("{:.0} mm", 1e3 * m) } else { format!("{m:.2} m") }
}

fn contradiction(ids: &[u32], e: &PoseEstimate) -> String {
    let chi2 = match e.consistency {
        Consistency::Inconsistent { chi2_per_degree_of_freedom, .. } => {
            format!(" (χ²/dof {chi2_per_degree_of_freedom:.1}, expected 1)")
        }
        Consistency::Consistent => String::new(),
    };
    let names: Vec<String> = ids.iter().map(u32::to_string).collect();
    let check = "check where they are, the tags' size_m and the unit of the map before using this pose";
    match names.as_slice() {
        [a, b] => format!(
            "tags {a} and {b} contradict each other{chi2}: one of the two is not where the map says, and a third in view would tell which; {check}"
        ),
        _ => format!(
            "tags {} contradict each other{chi2}: more of them are not where the map says than the rest can prove; {check}",
            names.join(", ")
        ),
    }
}

/// Judges an error.
pub fn of_error(error: &Error) -> Verdict {
    let status = match error {
        Error::TooFewPoints { .. }
        | Error::Coincident { .. }
        | Error::Collinear { .. }
        | Error::UndeterminedFocal { .. }
        | Error::DegenerateView { .. } => Status::Degenerate,
        _ => Status::Error,
    };
    Verdict { status, message: error.to_string() }
}

fn uniqueness(estimate: &PoseEstimate) -> String {
    let redundancy = match estimate.degrees_of_freedom {
        0 => format!(
            "; {} leave nothing to check the residual with, so add another",
            points(estimate.n_points)
        ),
        _ => String::new(),
    };
    if estimate.method == Method::Wang2004 {
        return "by the printed procedure, without refinement or search for a second pose; use method auto for those".into();
    }
    match &estimate.ambiguity {
        Ambiguity::Ambiguous { ratio, other } => {
            let (count, all) = match estimate.n_alternatives() {
                ..=2 => ("two", "both"),
                3 => ("three", "all"),
                _ => ("four", "all"),
            };
            let alternatives = estimate.minima().filter(|h| h.is_alternative);
            let probable: Vec<String> = alternatives.map(|h| percent(h.probability)).collect();
            format!(
                "{count} poses fit about equally well (error ratio {ratio:.2}, Δχ² {:.1}, need 9 to exclude one; \
                 probabilities {}); {all} are given, the more probable first: {}",
                (other.chi2 - estimate.chi2).abs(),
                probable.join(", "),
                way_out(estimate.weakness.as_ref())
            )
        }
        Ambiguity::Unique { ratio: Some(ratio) } if ratio.is_finite() => {
            format!("one pose fits; the next best has {} times its residual{redundancy}", figures(*ratio))
        }
        Ambiguity::Unique { .. } => format!("one pose fits; there is no second one{redundancy}"),
    }
}

/// Writes a small number of points in words: `two points`.
fn points(n: usize) -> String {
    match n {
        2 => "two points".into(),
        3 => "three points".into(),
        n => format!("{n} points"),
    }
}

/// Describes what makes a view weak: the key of its JSON object, the number seen and the number needed.
pub fn weakness_figures(weakness: &Weakness) -> (&'static str, f64, f64) {
    match weakness {
        Weakness::CriticalPlane { separation_sigma, needed_sigma } => {
            ("critical_plane", *separation_sigma, *needed_sigma)
        }
        Weakness::LineEndOn { length_sigma, needed_sigma } => ("line_end_on", *length_sigma, *needed_sigma),
        _ => ("unnamed", 0.0, 0.0),
    }
}

fn way_out(weakness: Option<&Weakness>) -> String {
    match weakness {
        Some(Weakness::CriticalPlane { separation_sigma, needed_sigma }) => format!(
            "the camera stands in the critical plane of the target, through the fourth point perpendicular to the line \
             (the two differ by {separation_sigma:.1} σ in the image, need {needed_sigma:.0}); move the camera along the line, or place the \
             fourth point over an end of it"
        ),
        Some(Weakness::LineEndOn { length_sigma, needed_sigma }) => format!(
            "the line is seen nearly end on ({length_sigma:.0} σ long in the image, need {needed_sigma:.0}); look at it from the side"
        ),
        _ => "tilt the target, move closer, or use what you know to choose".into(),
    }
}

/// Writes three significant figures, without an exponent where that is short.
pub fn figures(x: f64) -> String {
    match x.abs() {
        a if a != 0.0 && !(1e-3..1e5).contains(&a) => format!("{x:.1e}"),
        a if a < 1.0 => format!("{x:.3}"),
        a if a < 100.0 => format!("{x:.1}"),
        _ => format!("{x:.0}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_more_or_other_points_would_cure_is_degenerate_and_the_rest_an_error() {
        assert_eq!(of_error(&Error::TooFewPoints { seen: 2, needed: 3 }).status, Status::Degenerate);
        assert_eq!(of_error(&Error::Collinear { ratio: 0.0, needed: 1e-6 }).status, Status::Degenerate);
        assert_eq!(of_error(&Error::NoSolution { n_points: 4 }).status, Status::Error);
        assert_eq!(of_error(&Error::NotFinite { what: "pixel", index: 1 }).status, Status::Error);
    }

    #[test]
    fn three_figures_whatever_the_size() {
        let cases = [
            (0.0, "0.000"),
            (0.1234, "0.123"),
            (12.34, "12.3"),
            (1234.5, "1234"),
            (1.5e-5, "1.5e-5"),
            (2e6, "2.0e6"),
        ];
        for (x, text) in cases {
            assert_eq!(figures(x), text);
        }
    }
}
