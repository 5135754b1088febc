//! Solves a scene: the answer to every query, or the reason why there is none, and a verdict on all of them.

use super::again::Known;
use super::causes::causes;
use super::scene::{NamedQuery, NamedScene, QueryKind};
use super::words;
use crate::core::Error;
use crate::core::budget::Budget;
use crate::core::multiview::network::{
    ALTERNATIVE_GATE_CHI2, Adjusted, Constraint, ErrorSource, Measured, NetworkReliability, NetworkStatus,
    NetworkWarning, Query, QueryReliability, adjust, adjust_provisionally,
};
use crate::formats::plausible;
use crate::report::verdict::Status;
use nalgebra::Matrix1;

/// The answer to one query.
#[derive(Debug, Clone, PartialEq)]
pub struct QueryAnswer {
    /// The query.
    pub query: NamedQuery,
    /// The status of the answer: that of the network, unless it has no value or both solutions agree.
    pub status: NetworkStatus,
    /// One value, or three for a position; or the reason why there is none.
    pub result: Result<Vec<Measured>, String>,
    /// The answer of the second solution, where it is ambiguous.
    pub other: Option<Vec<Measured>>,
    /// How well each value is checked; empty where there are no values.
    pub reliability: Vec<QueryReliability>,
    /// The parts of each value's variance by the sources of the errors; empty where there are no values.
    pub budgets: Vec<Budget<Matrix1<f64>>>,
}

/// A solved scene.
#[derive(Debug, Clone)]
pub struct Answers {
    /// The adjusted network.
    pub adjusted: Adjusted,
    /// The status of the whole network.
    pub status: NetworkStatus,
    /// One answer for each query, in order.
    pub answers: Vec<QueryAnswer>,
    /// Faults to be read before any number: contradictions, second solutions, control points on a line.
    pub verdict: Vec<String>,
    /// Stated lengths that are implausible in metres, in sentences: with one, an answer that would be `ok` is `implausible`.
    pub sizes: Vec<String>,
    /// Remarks: what was left out, and what cannot be checked.
    pub remarks: Vec<String>,
    /// Each constraint and lens with the smallest error of it that would be noticed, in its own unit; `None` where nothing checks it.
    pub smallest_noticed_errors: Vec<(ErrorSource, Option<f64>)>,
}

impl Answers {
    /// Returns the status of the network or of one of its answers: `implausible` where it is `ok` and a length is implausible in metres.
    pub fn word(&self, status: NetworkStatus) -> Status {
        match Status::from(status) {
            Status::Ok if !self.sizes.is_empty() => Status::Implausible,
            status => status,
        }
    }
}

/// Why a scene has no answer.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Refusal {
    /// The status for the network and all its answers; `None` where the scene file itself is wrong.
    pub status: Option<NetworkStatus>,
    /// A sentence, with the scene's names.
    pub reason: String,
}

/// Solves a scene; answers that are still valid are reused from the earlier scene.
pub(super) fn solve(scene: &NamedScene, before: Option<(&NamedScene, &Answers)>) -> Result<Answers, Refusal> {
    let cameras = scene.network_cameras();
    let adjusted = adjust(&scene.network(&cameras)).map_err(|e| refusal(scene, &e))?;
    let status = adjusted.status();
    let known = before.and_then(|(scene_before, answers)| {
        Some((Known::new(scene, &adjusted, scene_before, &answers.adjusted)?, &answers.answers))
    });
    let answered =
        |query: &NamedQuery| match known.as_ref().and_then(|(known, all)| all.get(known.question(query)?)) {
            Some(known) => QueryAnswer { query: query.clone(), ..known.clone() },
            None => answer(scene, &adjusted, status, query, Adjusted::measure),
        };
    let (reliability, budgets) = (adjusted.reliability(), adjusted.budgets());
    let checked = |query: &NamedQuery| {
        let answer = with_reliability(scene, &reliability, answered(query));
        let queries = scene.core_queries(query).into_iter();
        match answer.result {
            Ok(_) => {
                QueryAnswer { budgets: queries.filter_map(|q| budgets.of_query(&q).ok()).collect(), ..answer }
            }
            Err(_) => answer,
        }
    };
    let answers: Vec<QueryAnswer> = scene.queries.iter().map(checked).collect();
    let (mut verdict, mut remarks) = sentences(scene, &adjusted);
    remarks.extend(unchecked_answers(&answers));
    remarks.extend(words::hardly_checked_lenses(scene, &reliability));
    let sources = reliability.sources().into_iter();
    let smallest_noticed_errors = sources.map(|of| (of, reliability.smallest_noticed_error(of))).collect();
    let sizes = units(scene);
    verdict.extend(sizes.iter().map(|text| format!("implausible: {text}")));
    Ok(Answers { status, answers, verdict, sizes, remarks, smallest_noticed_errors, adjusted })
}

/// Solves the first arrangement of a scene, with intervals to first order: see [`super::measure_provisionally`].
pub(super) fn solve_provisionally(scene: &NamedScene) -> Result<Answers, Refusal> {
    let cameras = scene.network_cameras();
    let adjusted = adjust_provisionally(&scene.network(&cameras)).map_err(|e| refusal(scene, &e))?;
    let status = adjusted.status();
    let answered = |query| answer(scene, &adjusted, status, query, Adjusted::measure_to_first_order);
    let answers = scene.queries.iter().map(answered).collect();
    let (verdict, sizes, remarks, smallest_noticed_errors) = Default::default();
    Ok(Answers { status, answers, verdict, sizes, remarks, smallest_noticed_errors, adjusted })
}

/// Returns the remark that answers depend on unchecked measurements; each answer names its own.
fn unchecked_answers(answers: &[QueryAnswer]) -> Option<String> {
    let is_unchecked = |answer: &&QueryAnswer| {
        answer.reliability.iter().any(|r| !(r.unchecked.is_empty() && r.partly_checked.is_empty()))
    };
    let names: Vec<&str> =
        answers.iter().filter(is_unchecked).map(|answer| answer.query.name.as_str()).collect();
    (!names.is_empty()).then(|| {
        format!(
            "not checked: {}; no other measurement checks what these depend on, or only in one direction, so an error of any size in it may go unnoticed; another photograph, distance or control point of the same point checks it",
            names.join(", ")
        )
    })
}

fn refusal(scene: &NamedScene, error: &Error) -> Refusal {
    let status = match error {
        Error::NoLength
        | Error::InvalidConstraint { .. }
        | Error::InvalidCamera { .. }
        | Error::InvalidSetting { .. } => None,
        Error::InconsistentDistances { .. } => Some(NetworkStatus::Inconsistent),
        _ => Some(NetworkStatus::Degenerate),
    };
    Refusal { status, reason: words::error(scene, error) }
}

/// How the value of a query is measured.
type Measure = fn(&Adjusted, &Query) -> Result<Measured, Error>;

fn answer(
    scene: &NamedScene,
    adjusted: &Adjusted,
    status: NetworkStatus,
    query: &NamedQuery,
    measure: Measure,
) -> QueryAnswer {
    let (result, reliability) = (Ok(Vec::new()), Vec::new());
    let base =
        QueryAnswer { query: query.clone(), status, result, other: None, reliability, budgets: Vec::new() };
    if let Some(line) = &adjusted.on_line {
        return QueryAnswer { result: Err(words::on_line(scene, line)), ..base };
    }
    let values = match values(scene, adjusted, query, measure) {
        Ok(values) => values,
        Err(reason) => return QueryAnswer { status: NetworkStatus::Degenerate, result: Err(reason), ..base },
    };
    let other =
        adjusted.second_solution().and_then(|second| self::values(scene, second, query, measure).ok());
    let other = other.filter(|other| differ(&values, other));
    let status = match status {
        // What was left out affects this answer only if the query includes it.
        NetworkStatus::Degenerate => NetworkStatus::Ok,
        NetworkStatus::Ambiguous if other.is_none() => NetworkStatus::Ok,
        status => status,
    };
    QueryAnswer { status, result: Ok(values), other, ..base }
}

fn with_reliability(scene: &NamedScene, of: &NetworkReliability<'_>, mut answer: QueryAnswer) -> QueryAnswer {
    answer.reliability = match answer.result {
        Ok(_) => {
            let queries = scene.core_queries(&answer.query).into_iter();
            queries.filter_map(|query| of.of_query(&query).ok()).collect()
        }
        Err(_) => Vec::new(),
    };
    answer
}

/// Two solutions give the same answer where they differ by less than this share of a standard deviation.
const SAME_SIGMAS: f64 = 0.1;

fn differ(values: &[Measured], others: &[Measured]) -> bool {
    values.iter().zip(others).any(|(a, b)| SAME_SIGMAS * a.sigma < (a.value - b.value).abs())
}

fn values(
    scene: &NamedScene,
    adjusted: &Adjusted,
    query: &NamedQuery,
    measure: Measure,
) -> Result<Vec<Measured>, String> {
    let value = |(axis, q): (usize, Query)| {
        let shift = if query.kind == QueryKind::Position { scene.origin_m[axis] } else { 0.0 };
        let moved =
            |m: Measured| Measured { value: m.value + shift, low: m.low + shift, high: m.high + shift, ..m };
        measure(adjusted, &q).map(moved).map_err(|e| words::error(scene, &e))
    };
    scene.core_queries(query).into_iter().enumerate().map(value).collect()
}

/// Largest number of suspects named; the others follow from the first.
const MOST_SUSPECTS: usize = 3;
/// Two statistics that differ by less than this share cannot be distinguished.
const TIED: f64 = 0.01;

/// Names the constraints that contradict the others.
fn suspects(scene: &NamedScene, adjusted: &Adjusted) -> String {
    let first = adjusted.suspects.first().map_or(0.0, |first| first.sigmas);
    let is_tied = |s: &&crate::core::multiview::network::Suspect| first * (1.0 - TIED) < s.sigmas;
    let tied = adjusted.suspects.iter().take(MOST_SUSPECTS).take_while(is_tied);
    let which: Vec<String> = tied.map(|s| words::suspect(scene, s)).collect();
    let without = match adjusted.left_out.is_empty() {
        true => "",
        false => "; the numbers below are without it",
    };
    format!(
        "inconsistent: {}; check it, correct or remove it, and measure again{without}",
        which.join(", or ")
    )
}

/// Returns the lines to be read before the numbers, and the remarks.
fn sentences(scene: &NamedScene, adjusted: &Adjusted) -> (Vec<String>, Vec<String>) {
    let (mut verdict, mut remarks) = (Vec::new(), scene.remarks.clone());
    for doubt in adjusted.warnings() {
        match doubt {
            NetworkWarning::OnLine => {
                let line = adjusted.on_line.as_ref().map(|line| words::on_line(scene, line));
                verdict.extend(line.map(|line| format!("degenerate: {line}")));
            }
            NetworkWarning::Exchanged => {
                let which: Vec<String> =
                    adjusted.exchanged.iter().map(|exchange| words::exchange(scene, exchange)).collect();
                verdict.push(format!(
                    "inconsistent: {}; with that corrected everything agrees: correct it and measure again; the numbers below are with {} corrected",
                    which.join(", or "),
                    if which.len() == 1 { "it" } else { "the first" }
                ));
            }
            NetworkWarning::Suspects => {
                verdict.push(suspects(scene, adjusted));
                verdict.extend(causes(scene));
            }
            NetworkWarning::Contradiction => {
                verdict.push(format!(
                    "inconsistent: χ² {:.1} for {} degrees of freedom, and no single constraint explains it; the sigmas are too small, or the intrinsics wrong",
                    adjusted.chi2, adjusted.degrees_of_freedom
                ));
                verdict.extend(causes(scene));
            }
            NetworkWarning::Residuals(times) => {
                verdict.push(format!("every interval was widened by {times:.2} for that"));
            }
            NetworkWarning::SecondSolution(delta) => verdict.push(format!(
                "ambiguous: another arrangement of photographs and control points fits about as well (χ² {delta:.1} above, {ALTERNATIVE_GATE_CHI2} needed); add a control point off the others' plane, or another photograph"
            )),
            NetworkWarning::LostControlPoints => verdict.push("degenerate: a control point that was clicked has no place, so that what is known of it took no part; see below".to_string()),
            NetworkWarning::NothingChecks => remarks.push(
                "nothing is left over to check anything with: no wrong image point could be noticed".to_string(),
            ),
            NetworkWarning::Held => remarks.push("coordinates leave a rotation or a shift free: lengths, angles, areas and heights are right, positions only relative to each other".to_string()),
            NetworkWarning::LeftOut(at) => remarks.extend(adjusted.undetermined.get(at).map(|(item, reason)| {
                let (name, reason) = (words::item(scene, *item), words::error(scene, reason));
                if reason.starts_with(&name) {
                    format!("left out: {reason}")
                } else {
                    format!("left out: {name}: {reason}")
                }
            })),
        }
    }
    (verdict, remarks)
}

/// Lists stated lengths that are implausible in metres, in sentences.
fn units(scene: &NamedScene) -> Vec<String> {
    if scene.lengths_are_metres {
        return Vec::new();
    }
    let distances = scene.constraints.iter().filter_map(|constraint| match constraint {
        Constraint::Distance { distance_m, .. } => Some(*distance_m),
        _ => None,
    });
    let control_points = scene.constraints.iter().filter_map(|constraint| match constraint {
        Constraint::Place { x_in_world, sigma_m, .. } => Some((x_in_world + scene.origin_m, sigma_m.min())),
        _ => None,
    });
    let of_control_points = plausible::of_uncertain_points(control_points);
    let remarks =
        of_control_points.into_iter().chain(plausible::of_distances(&distances.collect::<Vec<_>>()));
    remarks.map(|text| format!("{text} (where they are metres, state lengths_are_metres = true)")).collect()
}
