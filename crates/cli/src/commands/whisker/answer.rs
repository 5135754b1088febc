//! What every answer of `whisker` begins with.

use anyhow::Result;
use resight::answer::SchemaNumber;
use schemars::JsonSchema;
use serde::Serialize;

// Without a description of its own: the schema shows that of the answer.
#[derive(Serialize, JsonSchema)]
#[schemars(rename = "{T}")]
pub struct Answer<T> {
    schema: SchemaNumber,
    #[serde(flatten)]
    answer: T,
}

/// One line of JSON Lines.
pub fn line<T: Serialize>(answer: T) -> Result<String> {
    Ok(serde_json::to_string(&Answer { schema: SchemaNumber, answer })? + "\n")
}
