//! The answer of the job that measures in photographs: one object for each query, then one for the whole network.

use super::budget::{BudgetPartObject, NumbersPartObject, parts, parts_of_numbers};
use super::georeference::GeoreferencedPose;
use super::{SchemaNumber, Status, TransformObject};
use crate::core::multiview::network::{Constraint, ErrorSource, Measured, NetworkStatus};
use crate::georeference::Geographic;
use crate::measure::map::photo_on_earth;
use crate::measure::words::{self, frame_words, values_in_words};
use crate::measure::{Answers, NamedQuery, NamedScene, QueryAnswer, QueryKind, ScenePhoto};
use schemars::JsonSchema;
use serde::Serialize;

/// The answers to all queries of a scene, and the quality of the network behind them.
#[derive(Debug, Clone)]
pub struct MeasureAnswer {
    /// The solution; `None` where the network was refused.
    pub solved: Option<Answers>,
    /// One answer for each query, in order.
    pub answers: Vec<QueryObject>,
    /// The network behind them.
    pub network: NetworkAnswer,
}

/// The network behind the answers, or why there is none.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum NetworkAnswer {
    /// Where everything is.
    Solved(Box<NetworkObject>),
    /// Why there is no answer at all.
    Refused(RefusedObject),
}

impl MeasureAnswer {
    pub(crate) fn solved(scene: &NamedScene, answers: Answers) -> Self {
        MeasureAnswer {
            answers: answers.answers.iter().map(|answer| answer_object(scene, &answers, answer)).collect(),
            network: NetworkAnswer::Solved(Box::new(network_object(scene, &answers))),
            solved: Some(answers),
        }
    }

    pub(crate) fn refused(scene: &NamedScene, status: NetworkStatus, reason: &str) -> Self {
        let message = reason.to_string();
        let refused = RefusedObject { schema: SchemaNumber, kind: "network", status: status.into(), message };
        MeasureAnswer {
            solved: None,
            answers: scene.queries.iter().map(|query| base(scene, query, status, reason)).collect(),
            network: NetworkAnswer::Refused(refused),
        }
    }

    /// Returns whether the network and every answer may be relied on.
    pub fn is_ok(&self) -> bool {
        let is_ok = |status: NetworkStatus| status == NetworkStatus::Ok;
        self.solved.as_ref().is_some_and(|solved| {
            solved.sizes.is_empty() && is_ok(solved.status) && solved.answers.iter().all(|a| is_ok(a.status))
        })
    }
}

/// One answer. Keys without a value are null; the unit is in the key.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct QueryObject {
    schema: SchemaNumber,
    query: String,
    kind: &'static str,
    points: Vec<String>,
    status: Status,
    #[serde(flatten)]
    values: serde_json::Map<String, serde_json::Value>,
    /// How well the answer is checked; null where there is none.
    reliability: Option<QueryReliabilityObject>,
    /// The parts of its variance by the sources of the errors, for each value: one, or three for a position; empty where there is none.
    budget: Vec<Vec<NumbersPartObject>>,
    message: String,
}

/// What a single wrong measurement may do to an answer unnoticed.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct QueryReliabilityObject {
    /// The largest error that a single wrong measurement or lens puts into the answer without being noticed in four of five cases, in `unit`; null
    /// where nothing checks something that the answer depends on. Of a position the largest of the three.
    largest_unnoticed_error: Option<f64>,
    /// The same, of all measurements and lenses that are checked, however little the answer depends on them and whatever nothing checks.
    largest_error_of_checked: f64,
    /// `m`, `m2` or `rad`.
    unit: &'static str,
    /// The measurements and lenses that the answer depends on and that nothing checks.
    unchecked: Vec<String>,
    /// The measurements that the answer depends on and that are checked in some directions only, as an image point is by one other photograph.
    partly_checked: Vec<String>,
}

/// A measurement or a lens, and which error of it would be noticed.
#[derive(Debug, Clone, Serialize, JsonSchema)]
struct SourceReliabilityObject {
    /// Its name.
    of: String,
    /// The smallest error that would be noticed in four of five cases, in `unit`; null where nothing checks it.
    smallest_noticed_error: Option<f64>,
    /// `px`, `m`, `rad`, `sigma` (of a known pose) or `relative` (of a focal length).
    unit: &'static str,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
struct PhotoObject {
    name: String,
    cam_from_world: Option<TransformObject>,
    covariance: Option<Vec<Vec<f64>>>,
    /// The parts of `covariance` by the sources of the errors.
    budget: Vec<BudgetPartObject>,
    /// Where it is on the Earth, where the control points are given there.
    #[serde(skip_serializing_if = "Option::is_none")]
    georeference: Option<GeoreferencedPose>,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
struct PointObject {
    name: String,
    is_control_point: bool,
    position_m: Option<[f64; 3]>,
    /// Where it is on the Earth, where the control points are given there.
    #[serde(skip_serializing_if = "Option::is_none")]
    georeference: Option<Geographic>,
    covariance_m2: Option<Vec<Vec<f64>>>,
    /// The parts of `covariance_m2` by the sources of the errors.
    budget: Vec<NumbersPartObject>,
}

/// A network without any answer.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct RefusedObject {
    schema: SchemaNumber,
    kind: &'static str,
    /// Never `Ok`.
    pub status: Status,
    /// Why.
    pub message: String,
}

/// The network behind the answers.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct NetworkObject {
    schema: SchemaNumber,
    kind: &'static str,
    status: Status,
    /// What is wrong; empty where nothing is.
    message: String,
    frame: String,
    chi2: f64,
    degrees_of_freedom: usize,
    noise_scale: f64,
    alternative_delta_chi2: Option<f64>,
    photos: Vec<PhotoObject>,
    points: Vec<PointObject>,
    suspects: Vec<String>,
    /// Every measurement and lens that took part.
    reliability: Vec<SourceReliabilityObject>,
    remarks: Vec<String>,
}

fn reliability_object(
    scene: &NamedScene,
    answer: &QueryAnswer,
    unit: &'static str,
) -> QueryReliabilityObject {
    QueryReliabilityObject {
        largest_unnoticed_error: words::largest_unnoticed_error(&answer.reliability),
        largest_error_of_checked: words::largest_error_of_checked(&answer.reliability),
        unit,
        unchecked: words::unchecked(scene, &answer.reliability),
        partly_checked: words::partly_checked(scene, &answer.reliability),
    }
}

fn source_object(scene: &NamedScene, source: ErrorSource, error: Option<f64>) -> SourceReliabilityObject {
    let unit = match source {
        ErrorSource::Focal(_) => "relative",
        ErrorSource::Constraint(i) => match scene.constraints[i] {
            Constraint::ImagePoint { .. } => "px",
            Constraint::Upright { .. } | Constraint::Gravity { .. } => "rad",
            Constraint::Pose { .. } => "sigma",
            Constraint::Place { .. } | Constraint::Distance { .. } | Constraint::OnPlane { .. } => "m",
        },
    };
    SourceReliabilityObject { of: words::source(scene, source), smallest_noticed_error: error, unit }
}

fn answer_object(scene: &NamedScene, answers: &Answers, answer: &QueryAnswer) -> QueryObject {
    let suffix = match answer.query.kind {
        QueryKind::Angle => "rad",
        QueryKind::Area => "m2",
        _ => "m",
    };
    match &answer.result {
        Ok(values) => {
            let mut entries = entries(values, suffix);
            let mut message = values_in_words(answer.query.kind, values);
            if let Some(other) = &answer.other {
                message += &format!(" or {}", values_in_words(answer.query.kind, other));
                entries.insert("other".to_string(), self::entries(other, suffix).into());
            }
            message += &words::reliability(scene, answer.query.kind, &answer.reliability)
                .map_or_else(String::new, |text| format!("; {text}"));
            let status = answers.word(answer.status);
            let reliability = Some(reliability_object(scene, answer, suffix));
            let base = base(scene, &answer.query, answer.status, &message);
            let budget = answer
                .budgets
                .iter()
                .map(|one| parts_of_numbers(one, |part| one.share_of(part, |c| c.x)))
                .collect();
            QueryObject { values: entries, status, reliability, budget, ..base }
        }
        Err(reason) => base(scene, &answer.query, answer.status, reason),
    }
}

/// Returns an answer without values.
fn base(scene: &NamedScene, query: &NamedQuery, status: NetworkStatus, message: &str) -> QueryObject {
    QueryObject {
        schema: SchemaNumber,
        query: query.name.clone(),
        kind: query.kind.name(),
        points: query.points.iter().map(|p| scene.points[*p].clone()).collect(),
        status: status.into(),
        values: serde_json::Map::new(),
        reliability: None,
        budget: Vec::new(),
        message: message.to_string(),
    }
}

/// Returns value, sigma and interval: one number each, or three for a position.
fn entries(values: &[Measured], suffix: &str) -> serde_json::Map<String, serde_json::Value> {
    let one_or_three = |of: fn(&Measured) -> f64| match values {
        [one] => serde_json::Value::from(of(one)),
        many => serde_json::Value::from(many.iter().map(of).collect::<Vec<f64>>()),
    };
    let entries = [
        ("value", one_or_three(|m| m.value)),
        ("sigma", one_or_three(|m| m.sigma)),
        ("low_95", one_or_three(|m| m.low)),
        ("high_95", one_or_three(|m| m.high)),
    ];
    entries.map(|(key, value)| (format!("{key}_{suffix}"), value)).into_iter().collect()
}

fn network_object(scene: &NamedScene, answers: &Answers) -> NetworkObject {
    let adjusted = &answers.adjusted;
    let budgets = adjusted.budgets();
    let photo = |(i, photo): (usize, &ScenePhoto)| PhotoObject {
        name: photo.name.clone(),
        cam_from_world: adjusted.cam_from_world(i).map(TransformObject::from),
        covariance: adjusted
            .photo_covariance(i)
            .map(|c| c.row_iter().map(|r| r.iter().copied().collect()).collect()),
        budget: budgets.of_photo(i).as_ref().map(parts).unwrap_or_default(),
        georeference: photo_on_earth(scene, adjusted, i),
    };
    let point = |(i, name): (usize, &String)| PointObject {
        name: name.clone(),
        is_control_point: scene.is_control_point[i],
        georeference: scene.frame.as_ref().and_then(|frame| frame.geographic(&adjusted.point(i)?)),
        position_m: adjusted.point(i).map(|x| (x + scene.origin_m).into()),
        covariance_m2: adjusted
            .point_covariance_m2(i)
            .map(|c| c.row_iter().map(|r| r.iter().copied().collect()).collect()),
        budget: budgets
            .of_point(i)
            .map_or_else(Vec::new, |one| parts_of_numbers(&one, |part| one.share_of(part, |c| c.trace()))),
    };
    NetworkObject {
        schema: SchemaNumber,
        kind: "network",
        status: answers.word(answers.status),
        message: answers.verdict.join("; "),
        frame: frame_words(scene, adjusted.frame),
        chi2: adjusted.chi2,
        degrees_of_freedom: adjusted.degrees_of_freedom,
        noise_scale: adjusted.noise_scale,
        alternative_delta_chi2: adjusted.alternative_delta_chi2,
        photos: scene.photos.iter().enumerate().map(photo).collect(),
        points: scene.points.iter().enumerate().map(point).collect(),
        reliability: answers
            .smallest_noticed_errors
            .iter()
            .map(|(source, error)| source_object(scene, *source, *error))
            .collect(),
        suspects: adjusted.suspects.iter().map(|s| words::suspect(scene, s)).collect(),
        remarks: answers.verdict.iter().chain(&answers.remarks).cloned().collect(),
    }
}
