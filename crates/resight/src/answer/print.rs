//! The answer of the job that prints targets.

use super::{SchemaNumber, Status};
use crate::core::target::PrintedScale;
use schemars::JsonSchema;
use serde::Serialize;

/// A target on pages.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct PrintAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// Always `ok`: a target that cannot be printed is an error of the job.
    pub status: Status,
    /// Kind of the target, as in its file.
    pub kind: &'static str,
    /// The files: names, or the paths written to.
    pub files: Vec<String>,
    /// Name of the paper, or its sides.
    pub paper: String,
    /// Width and height of a page, as it is turned.
    pub page_size_mm: [f64; 2],
    /// How many pages there are.
    pub n_pages: usize,
    /// How pages join, where the target is larger than one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tiles: Option<Tiles>,
    /// Designed lengths of the rulers along x and y.
    pub ruler_mm: [f64; 2],
    /// The scale that the target file states, from the rulers measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub printed_scale: Option<PrintedScaleObject>,
    /// What should be known about the print.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// What is on the sheet, and how to go on.
    pub message: String,
    /// The contents of each of `files`.
    #[serde(skip)]
    pub contents: Vec<Vec<u8>>,
}

/// Pages that are put together.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct Tiles {
    /// Pages above each other.
    pub rows: usize,
    /// Pages beside each other.
    pub columns: usize,
}

/// The scale of a print, as in a target file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct PrintedScaleObject {
    /// Printed length over designed length along x.
    pub x: f64,
    /// Along y.
    pub y: f64,
    /// Standard deviation of `x`.
    pub sigma_x: f64,
    /// Standard deviation of `y`.
    pub sigma_y: f64,
}

impl From<&PrintedScale> for PrintedScaleObject {
    fn from(scale: &PrintedScale) -> Self {
        let ([x, y], [sigma_x, sigma_y]) = (scale.ratio, scale.sigma);
        PrintedScaleObject { x, y, sigma_x, sigma_y }
    }
}
