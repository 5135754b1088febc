//! The JSON schema of every answer, generated from the types that serialise.

use super::{
    advise, capture, compare, detection, files, georeference, hand_eye, intrinsics, landmarks, map, measure,
    pose, pose_graph, print, rig, rig_pose, scene_view, vehicle, zones,
};
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde_json::{Map, Value, json};
use std::borrow::Cow;

/// Gives each of these answers the schema of the type that it serialises as.
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
    map::SolvedMap => map::MapObject,
    pose_graph::SolvedPoseGraph => pose_graph::GraphObject,
    hand_eye::SolvedHandEye => hand_eye::HandEyeObject,
}

/// The schema of one answer.
pub type Generate = fn(&mut SchemaGenerator) -> Schema;

/// Every answer, with the name of its job.
const ANSWERS: [(&str, Generate); 29] = [
    ("pose", SchemaGenerator::subschema_for::<pose::PoseAnswer>),
    ("rig", SchemaGenerator::subschema_for::<rig::RigAnswer>),
    ("map", SchemaGenerator::subschema_for::<map::MapAnswer>),
    ("rig_pose", SchemaGenerator::subschema_for::<rig_pose::RigPoseAnswer>),
    ("scene_view", SchemaGenerator::subschema_for::<scene_view::SceneViewAnswer>),
    ("pose_graph", SchemaGenerator::subschema_for::<pose_graph::PoseGraphAnswer>),
    ("hand_eye", SchemaGenerator::subschema_for::<hand_eye::HandEyeAnswer>),
    ("intrinsics", SchemaGenerator::subschema_for::<intrinsics::IntrinsicsAnswer>),
    ("intrinsics_check", SchemaGenerator::subschema_for::<intrinsics::IntrinsicsCheckAnswer>),
    ("capture_view", SchemaGenerator::subschema_for::<capture::CaptureViewAnswer>),
    ("capture", SchemaGenerator::subschema_for::<capture::CaptureAnswer>),
    ("compare_rigs", SchemaGenerator::subschema_for::<compare::RigsCompared>),
    ("compare_poses", SchemaGenerator::subschema_for::<compare::ViewCompared>),
    ("detect", SchemaGenerator::subschema_for::<detection::DetectionAnswer>),
    ("explain", SchemaGenerator::subschema_for::<files::Explanation>),
    ("convert", SchemaGenerator::subschema_for::<files::ConvertAnswer>),
    ("map_point", SchemaGenerator::subschema_for::<georeference::MapPointAnswer>),
    ("print", SchemaGenerator::subschema_for::<print::PrintAnswer>),
    ("advise_points", SchemaGenerator::subschema_for::<advise::PointsNow>),
    ("advise_point", SchemaGenerator::subschema_for::<advise::PointSuggestion>),
    ("advise_target", SchemaGenerator::subschema_for::<advise::VolumeOutlook>),
    ("advise_change", SchemaGenerator::subschema_for::<advise::TargetChange>),
    ("advise_rig", SchemaGenerator::subschema_for::<advise::RigNow>),
    ("advise_board", SchemaGenerator::subschema_for::<advise::BoardSuggestion>),
    ("zone", SchemaGenerator::subschema_for::<zones::ZoneAnswer>),
    ("vehicle", SchemaGenerator::subschema_for::<vehicle::VehicleAnswer>),
    ("landmarks", SchemaGenerator::subschema_for::<landmarks::LandmarksAnswer>),
    ("measure_query", SchemaGenerator::subschema_for::<measure::QueryObject>),
    ("measure_network", SchemaGenerator::subschema_for::<measure::NetworkAnswer>),
];

/// Returns one document (JSON Schema 2020-12), in which an object is one of the answers listed below `answers`, each under the name of its job.
/// `further` adds the answers of crates above this one.
pub fn json_schema(further: &[(&str, Generate)]) -> Value {
    let mut generator = SchemaSettings::draft2020_12().for_serialize().into_generator();
    let all = ANSWERS.iter().chain(further);
    let mut answers: Map<String, Value> =
        all.map(|(name, of)| ((*name).to_owned(), of(&mut generator).to_value())).collect();
    for unit in ["normalized", "unit_of_f"] {
        answers.insert(format!("pose_{unit}"), pose_in_unit(unit));
    }
    let any: Vec<Value> = answers.keys().map(|name| json!({ "$ref": format!("#/answers/{name}") })).collect();
    json!({
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Answers of Resight",
        "anyOf": any,
        "answers": answers,
        "$defs": generator.take_definitions(true),
    })
}

/// Returns the schema of the pose object with keys for image coordinates that are not pixels.
fn pose_in_unit(unit: &str) -> Value {
    let settings = SchemaSettings::draft2020_12().for_serialize().with(|s| s.inline_subschemas = true);
    let schema = settings.into_generator().into_root_schema_for::<pose::PoseObject>().to_value();
    required_in_unit(pose::in_unit(schema, unit), unit)
}

fn required_in_unit(value: Value, unit: &str) -> Value {
    match value {
        Value::Object(keys) => {
            let one = |(key, value): (String, Value)| match (key.as_str(), value) {
                ("required", Value::Array(names)) => {
                    let names = names.iter().filter_map(Value::as_str);
                    (key, names.map(|name| pose::key_in_unit(name.to_owned(), unit)).collect())
                }
                (_, value) => (key, required_in_unit(value, unit)),
            };
            keys.into_iter().map(one).collect()
        }
        Value::Array(values) => values.into_iter().map(|value| required_in_unit(value, unit)).collect(),
        other => other,
    }
}
