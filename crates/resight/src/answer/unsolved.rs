//! The answer of a job that found no solution.

use super::Status;
use super::pose::status_name;
use serde::Serialize;

/// Why there is no rig, pose graph or hand–eye calibration. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unsolved {
    /// Never `Ok`.
    #[serde(serialize_with = "status_name")]
    pub status: Status,
    /// What is wrong and what would help.
    pub message: String,
    /// Cameras by group, where they are not connected.
    pub groups: Vec<Vec<String>>,
}

impl Unsolved {
    pub(crate) fn new(status: Status, message: impl Into<String>) -> Self {
        Unsolved { status, message: message.into(), groups: Vec::new() }
    }
}
