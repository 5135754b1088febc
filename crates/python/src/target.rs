//! `resight.Target`.

use crate::arrays::array;
use crate::error;
use crate::notebook;
use numpy::PyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use resight::core;
use resight::detect::absent::Explainer;
use resight::formats::{self, TargetFile};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// What is looked for in images: points whose places are known.
#[pyclass(frozen, module = "resight")]
pub struct Target {
    pub target: core::Target,
    /// What is unusual about it, in sentences.
    pub warnings: Vec<String>,
    /// Says of the first image without it what that shows instead: loops over frames call for one image at a time.
    pub explainer: Arc<Mutex<Explainer>>,
}

impl From<TargetFile> for Target {
    fn from(file: TargetFile) -> Self {
        Target { target: file.target, warnings: file.warnings, explainer: Arc::default() }
    }
}

#[pymethods]
impl Target {
    /// From the keys of target.toml.
    #[new]
    #[pyo3(signature = (kind, **keys))]
    fn new(py: Python<'_>, kind: &str, keys: Option<&Bound<'_, PyDict>>) -> PyResult<Self> {
        let text = py.import("resight._make")?.call_method("target_text", (kind,), keys)?;
        Self::parse(py, text.extract()?)
    }

    /// From the text of a target file of any format that `read` takes.
    #[staticmethod]
    fn parse(py: Python<'_>, text: &str) -> PyResult<Self> {
        let file = formats::read_target_from_bytes(Path::new("target"), text.as_bytes().to_vec());
        Ok(file.map_err(|reason| error::file(py, &reason))?.into())
    }

    /// The target of a file: own TOML, Kalibr YAML or WPILib JSON.
    #[staticmethod]
    fn read(py: Python<'_>, file: PathBuf) -> PyResult<Self> {
        Ok(formats::read_target(&file).map_err(|reason| error::file(py, &reason))?.into())
    }

    /// `tag`, `aprilgrid`, `chessboard`, `charuco`, `circle_grid`, `tag_map`, `line_plus_one` or `points`.
    #[getter]
    fn kind(&self) -> &'static str {
        self.target.kind()
    }

    /// What is unusual about it, in sentences; every answer repeats them.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// Ids and corners of its points, in the order of `points_m`.
    #[getter]
    fn features(&self) -> Vec<(u32, u32)> {
        self.target.features().iter().map(|f| (f.id, u32::from(f.corner))).collect()
    }

    /// Places of its points in the target frame, metres, (n, 3).
    #[getter]
    fn points_m<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let features = self.target.features();
        let points = features.iter().filter_map(|feature| self.target.point(*feature));
        let rows: Vec<f64> = points.flat_map(|p| <[f64; 3]>::from(p.position)).collect();
        let n = rows.len() / 3;
        array(py, rows, &[n, 3])
    }

    /// The target as a target.toml.
    fn to_toml(&self) -> String {
        formats::own_target_file(&self.target, "")
    }

    /// How `pickle` and `copy` make it again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        let class = py.get_type::<Target>();
        Ok((class.getattr("parse")?, (self.to_toml(),)))
    }

    /// What a notebook shows: the keys of its file, and the number of its points.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let text = self.to_toml();
        let keys =
            text.lines().take_while(|line| !line.starts_with('[')).filter(|line| !line.starts_with('#'));
        let rows = keys.filter_map(|line| line.split_once(" = ")).map(|(key, value)| (key, value.to_owned()));
        notebook::named(py, rows.chain([("points", self.target.features().len().to_string())]))
    }

    fn __repr__(&self) -> String {
        format!("Target({}, {} points)", self.target.kind(), self.target.features().len())
    }
}
