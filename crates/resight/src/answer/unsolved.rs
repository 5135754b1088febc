//! The answer of a job that found no solution.

use super::{SchemaNumber, Status};
use schemars::JsonSchema;
use serde::Serialize;

/// Why there is no rig, pose graph or hand–eye calibration. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Unsolved {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// Never `Ok`.
    pub status: Status,
    /// What is wrong and what would help.
    pub message: String,
    /// Cameras by group, where they are not connected.
    pub groups: Vec<Vec<String>>,
}

impl Unsolved {
    pub(crate) fn new(status: Status, message: impl Into<String>) -> Self {
        Unsolved { schema: SchemaNumber, status, message: message.into(), groups: Vec::new() }
    }
}
