//! `schema`: what the JSON of every answer looks like.

use super::{demo, history, whisker};
use crate::output::{Outcome, print};
use anyhow::Result;
use clap::Args;
use resight::answer::{Generate, json_schema};
use resight_fleet::answer::{BatchObject, ColumnsObject, FleetCameraObject};
use resight_watch::outputs::history::StoredObject;
use resight_watch::outputs::said::object::EventObject;
use resight_whisker::files::contacts::ContactObject;
use resight_whisker::files::identification::IdentificationObject;
use schemars::SchemaGenerator;

/// Answers of the crates above the library's.
const FURTHER: [(&str, Generate); 14] = [
    ("event", SchemaGenerator::subschema_for::<EventObject>),
    ("stored", SchemaGenerator::subschema_for::<StoredObject>),
    ("history", SchemaGenerator::subschema_for::<history::HistoryObject>),
    ("history_export", SchemaGenerator::subschema_for::<history::ExportedObject>),
    ("batch", SchemaGenerator::subschema_for::<BatchObject>),
    ("batch_columns", SchemaGenerator::subschema_for::<ColumnsObject>),
    ("fleet_camera", SchemaGenerator::subschema_for::<FleetCameraObject>),
    ("demo_first_pose", SchemaGenerator::subschema_for::<demo::FirstPose>),
    ("demo_pair", SchemaGenerator::subschema_for::<demo::Pair>),
    ("whisker_contact", SchemaGenerator::subschema_for::<whisker::Answer<ContactObject>>),
    ("whisker_record", SchemaGenerator::subschema_for::<whisker::Answer<whisker::RecordObject>>),
    ("whisker_identification", SchemaGenerator::subschema_for::<whisker::Answer<IdentificationObject>>),
    ("whisker_calibration", SchemaGenerator::subschema_for::<whisker::Answer<whisker::CalibrateObject>>),
    ("whisker_check", SchemaGenerator::subschema_for::<whisker::Answer<whisker::CheckObject>>),
];

/// Prints the JSON schema of every answer, generated from the types that write them (JSON Schema 2020-12).
///
/// Every JSON object has the key "schema" with the number 2. Under one number keys may be added, but none is renamed or given another
/// meaning. The schema of one job's answer is at "#/answers/JOB", for example "#/answers/pose".
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  resight schema > resight.schema.json")]
pub struct Schema {}

/// See `Schema`.
pub fn run(_: &Schema) -> Result<Outcome> {
    let text = serde_json::to_string_pretty(&json_schema(&FURTHER))?;
    print(&format!("{text}\n"))?;
    Ok(Outcome::Answered)
}
