//! The state of a session: small, and copied for every step that can be undone. Photographs are shared.

use crate::command::{GivenLens, MeasuredKind, Template};
use crate::photograph::Photograph;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Standard deviation of a point placed by hand where none is stated, px.
pub const SIGMA_PX: f64 = 1.0;

/// Everything that can be undone and is saved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct State {
    pub sigma_px: f64,
    pub template: Template,
    pub show_grid: bool,
    pub show_axes: bool,
    #[serde(default)]
    pub photos: Vec<PhotoState>,
    #[serde(default)]
    pub positions: BTreeMap<String, Position>,
    #[serde(default)]
    pub distances: Vec<Distance>,
    #[serde(default)]
    pub measurements: Vec<Measurement>,
}

impl State {
    /// Memory that it takes besides its photographs: texts, and lists by their lengths.
    pub fn weight_bytes(&self) -> usize {
        const ENTRY: usize = 128; // A name, a handful of numbers and what holds them.
        let lens = |lens: &Option<GivenLens>| match lens {
            Some(GivenLens::File { name, text }) => name.len() + text.len(),
            Some(GivenLens::Lines { lines }) => ENTRY * lines.len(),
            Some(GivenLens::Photograph { name } | GivenLens::Common { name }) => name.len(),
            _ => 0,
        };
        let photo = |p: &PhotoState| lens(&p.lens) + ENTRY * (1 + p.points.len());
        let measured = |m: &Measurement| ENTRY + 16 * m.points.len();
        self.photos.iter().map(photo).sum::<usize>()
            + self.measurements.iter().map(measured).sum::<usize>()
            + ENTRY * (self.positions.len() + self.distances.len())
    }
}

impl Default for State {
    fn default() -> Self {
        State {
            sigma_px: SIGMA_PX,
            template: Template::default(),
            show_grid: true,
            show_axes: true,
            photos: Vec::new(),
            positions: BTreeMap::new(),
            distances: Vec::new(),
            measurements: Vec::new(),
        }
    }
}

/// One photograph, with the statements about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhotoState {
    #[serde(with = "crate::photograph::shared")]
    pub photograph: Arc<Photograph>,
    pub lens: Option<GivenLens>,
    /// The minimum that the user chose; by default the first.
    pub chosen: Option<usize>,
    #[serde(default)]
    pub points: Vec<ImagePoint>,
}

/// A point of a photograph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImagePoint {
    pub name: String,
    pub u_px: f64,
    pub v_px: f64,
    /// The detector's standard deviation; `None` for a point placed by hand.
    pub sigma_px: Option<f64>,
}

/// Coordinates of a point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Position {
    pub x_m: f64,
    pub y_m: f64,
    pub z_m: f64,
    pub sigma_m: f64,
}

/// A distance, as typed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Distance {
    pub a: String,
    pub b: String,
    pub distance_m: f64,
    pub sigma_m: f64,
}

impl Distance {
    pub fn joins(&self, a: &str, b: &str) -> bool {
        (self.a == a && self.b == b) || (self.a == b && self.b == a)
    }
}

/// Something to measure in a photograph.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measurement {
    pub name: String,
    pub photo: usize,
    pub what: MeasuredKind,
    pub points: Vec<[f64; 2]>,
}
