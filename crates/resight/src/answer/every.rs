//! The JSON schema of every answer, generated from the types that serialise.

use super::{advise, compare, detection, files, hand_eye, measure, pose, pose_graph, rig};
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde_json::{Map, Value, json};
use std::borrow::Cow;

/// Answers that serialise as another type have its schema.
macro_rules! serialised_as {
    ($($answer:ty => $object:ty),* $(,)?) => {$(
        impl JsonSchema for $answer {
            fn schema_name() -> Cow<'static, str> {
                <$object as JsonSchema>::schema_name()
            }

            fn inline_schema() -> bool {
                true
            }

            fn json_schema(generator: &mut SchemaGenerator) -> Schema {
                generator.subschema_for::<$object>()
            }
        }
    )*};
}

serialised_as! {
    pose::PoseAnswer => pose::PoseObject,
    rig::SolvedRig => rig::RigObject,
    pose_graph::SolvedPoseGraph => pose_graph::GraphObject,
    hand_eye::SolvedHandEye => hand_eye::HandEyeObject,
}

/// The schema of one answer.
type Generate = fn(&mut SchemaGenerator) -> Schema;

/// Every answer by the job that gives it.
const ANSWERS: [(&str, Generate); 17] = [
    ("pose", SchemaGenerator::subschema_for::<pose::PoseAnswer>),
    ("rig", SchemaGenerator::subschema_for::<rig::RigAnswer>),
    ("pose_graph", SchemaGenerator::subschema_for::<pose_graph::PoseGraphAnswer>),
    ("hand_eye", SchemaGenerator::subschema_for::<hand_eye::HandEyeAnswer>),
    ("compare_rigs", SchemaGenerator::subschema_for::<compare::RigsCompared>),
    ("compare_poses", SchemaGenerator::subschema_for::<compare::ViewCompared>),
    ("detect", SchemaGenerator::subschema_for::<detection::DetectionAnswer>),
    ("explain", SchemaGenerator::subschema_for::<files::Explanation>),
    ("convert", SchemaGenerator::subschema_for::<files::ConvertAnswer>),
    ("advise_points", SchemaGenerator::subschema_for::<advise::PointsNow>),
    ("advise_point", SchemaGenerator::subschema_for::<advise::PointSuggestion>),
    ("advise_target", SchemaGenerator::subschema_for::<advise::VolumeOutlook>),
    ("advise_change", SchemaGenerator::subschema_for::<advise::TargetChange>),
    ("advise_rig", SchemaGenerator::subschema_for::<advise::RigNow>),
    ("advise_board", SchemaGenerator::subschema_for::<advise::BoardSuggestion>),
    ("measure_query", SchemaGenerator::subschema_for::<measure::QueryObject>),
    ("measure_survey", SchemaGenerator::subschema_for::<measure::SurveyAnswer>),
];

/// One document (JSON Schema 2020-12): an object is one of the answers below `answers`, each by the name of its job.
pub fn json_schema() -> Value {
    let mut generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    let answers: Map<String, Value> =
        ANSWERS.iter().map(|(name, of)| ((*name).to_owned(), of(&mut generator).to_value())).collect();
    let any: Vec<Value> = answers.keys().map(|name| json!({ "$ref": format!("#/answers/{name}") })).collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Answers of Resight",
        "anyOf": any,
        "answers": answers,
        "$defs": generator.take_definitions(true),
    })
}
