//! Detections as files, or as a table of columns: words as lists, numbers as arrays of float64 in which NaN is missing.

use crate::arrays::each;
use crate::error;
use pyo3::prelude::*;
use resight::rig::{DetectionRow, Detections};
use std::path::PathBuf;

type Words = Option<Vec<Option<String>>>;

/// The columns of a CSV file of detections; none where there is no such column.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Columns<'py> {
    camera: Vec<String>,
    view: Vec<String>,
    target: Words,
    body: Words,
    id: Words,
    corner: Words,
    u_px: Bound<'py, PyAny>,
    v_px: Bound<'py, PyAny>,
    x_m: Option<Bound<'py, PyAny>>,
    y_m: Option<Bound<'py, PyAny>>,
    z_m: Option<Bound<'py, PyAny>>,
    sigma_px: Option<Bound<'py, PyAny>>,
    sigma_m: Option<Bound<'py, PyAny>>,
    t_s: Option<Bound<'py, PyAny>>,
}

/// The same, owned by the thread that solves.
pub struct Owned {
    words: [Words; 4],
    camera: Vec<String>,
    view: Vec<String>,
    image_px: [Vec<f64>; 2],
    position_m: Option<[Vec<f64>; 3]>,
    sigma_px: Option<Vec<f64>>,
    sigma_m: Option<Vec<f64>>,
    t_s: Option<Vec<f64>>,
}

impl Columns<'_> {
    fn owned(self, py: Python<'_>) -> PyResult<Owned> {
        let n = self.camera.len();
        let words = [self.target, self.body, self.id, self.corner];
        let lengths = words.iter().flatten().map(Vec::len).chain([self.view.len()]);
        if let Some(other) = lengths.into_iter().find(|length| *length != n) {
            return Err(error::input(py, format!("detections: columns of {n} and of {other} rows")));
        }
        let some = |name: &str, column: Option<Bound<'_, PyAny>>| {
            column.map(|values| each(name, &values, n)).transpose()
        };
        let position_m = match (some("x_m", self.x_m)?, some("y_m", self.y_m)?, some("z_m", self.z_m)?) {
            (Some(x), Some(y), Some(z)) => Some([x, y, z]),
            _ => None,
        };
        Ok(Owned {
            words,
            image_px: [each("u_px", &self.u_px, n)?, each("v_px", &self.v_px, n)?],
            position_m,
            sigma_px: some("sigma_px", self.sigma_px)?,
            sigma_m: some("sigma_m", self.sigma_m)?,
            t_s: some("t_s", self.t_s)?,
            camera: self.camera,
            view: self.view,
        })
    }
}

impl Owned {
    fn row(&self, i: usize) -> DetectionRow<'_> {
        let [target, body, id, corner] = self.words.each_ref().map(|words| words.as_ref()?[i].as_deref());
        let number =
            |column: &Option<Vec<f64>>| column.as_ref().map(|values| values[i]).filter(|x| !x.is_nan());
        let position_m = self.position_m.as_ref().map(|[x, y, z]| [x[i], y[i], z[i]]);
        DetectionRow {
            camera: &self.camera[i],
            view: &self.view[i],
            t_s: number(&self.t_s),
            target,
            body,
            id,
            corner,
            position_m: position_m.filter(|place| !place.iter().any(|x| x.is_nan())),
            image_px: [self.image_px[0][i], self.image_px[1][i]],
            sigma_px: number(&self.sigma_px),
            sigma_m: number(&self.sigma_m),
            line: None,
        }
    }
}

/// Points that a detector found, as Python has them.
#[derive(FromPyObject)]
#[allow(clippy::large_enum_variant)] // One a call.
pub enum Detected<'py> {
    Files(Vec<PathBuf>),
    Columns(Columns<'py>),
}

/// The same for the thread that solves.
pub enum Found {
    Files(Vec<PathBuf>),
    Columns(Box<Owned>),
}

impl Detected<'_> {
    pub fn owned(self, py: Python<'_>) -> PyResult<Found> {
        Ok(match self {
            Detected::Files(files) => Found::Files(files),
            Detected::Columns(columns) => Found::Columns(Box::new(columns.owned(py)?)),
        })
    }
}

impl Found {
    /// Runs a job on these detections; `sigma_px` is that of rows that state none.
    pub fn with<T>(&self, sigma_px: Option<f64>, job: impl FnOnce(Detections) -> T) -> T {
        match self {
            Found::Files(files) => job(Detections { sigma_px, ..Detections::files(files) }),
            Found::Columns(columns) => {
                let rows: Vec<DetectionRow> = (0..columns.camera.len()).map(|i| columns.row(i)).collect();
                job(Detections { sigma_px, ..Detections::rows(&rows) })
            }
        }
    }
}
