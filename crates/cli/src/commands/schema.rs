//! `schema`: what the JSON of every answer looks like.

use crate::output::{Outcome, print};
use anyhow::Result;
use clap::Args;

/// Prints the JSON schema of every answer, generated from the types that write them (JSON Schema 2020-12).
///
/// Every JSON object has the key "schema" with the number 2. Under one number keys may be added, but none is renamed or given another
/// meaning. The schema of one job's answer is at "#/answers/JOB", for example "#/answers/pose".
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  resight schema > resight.schema.json")]
pub struct Schema {}

/// See `Schema`.
pub fn run(_: &Schema) -> Result<Outcome> {
    let text = serde_json::to_string_pretty(&resight::answer::json_schema())?;
    print(&format!("{text}\n"))?;
    Ok(Outcome::Answered)
}
