//! Fleets: views of many cameras as columns in, poses as columns out, and what is kept of each camera.

use crate::arrays::Numbers;
use crate::error;
use crate::run::run;
use crate::table::Table;
use crate::target::Target;
use numpy::PyReadonlyArray1;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use resight_fleet::assess::AssessConfig;
use resight_fleet::batch::SolvedRows;
use resight_fleet::columns::{Column, Columns};
use resight_fleet::images::{ImageCell, ImageRows, locate_rows};
use resight_fleet::job::{self, BatchRequest, News, ReportRequest, json_lines};
use resight_fleet::{FleetError, Solver, solve_columns};
use std::borrow::Cow;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// What the library says of a fleet as an exception.
pub fn raised(py: Python<'_>, reason: &FleetError) -> PyErr {
    let kind = match reason {
        FleetError::File(_) => "file",
        FleetError::Columns(_) => "input",
        _ => "request",
    };
    error::error(py, kind, reason.to_string())
}

/// The cameras of a fleet by name.
#[pyclass(frozen, module = "resight")]
pub struct Cameras {
    pub cameras: Arc<resight_fleet::Cameras>,
}

#[pymethods]
impl Cameras {
    /// A CSV table, a camera file that names several, or a folder of camera files.
    #[staticmethod]
    #[pyo3(signature = (file, target=None))]
    fn read(py: Python<'_>, file: PathBuf, target: Option<&Target>) -> PyResult<Self> {
        let cameras = resight_fleet::Cameras::read(&file).and_then(|cameras| match target {
            Some(target) => cameras.with_target(&target.target),
            None => Ok(cameras),
        });
        Ok(Cameras { cameras: Arc::new(cameras.map_err(|reason| raised(py, &reason))?) })
    }

    /// What `to_text` gave.
    #[staticmethod]
    fn parse(py: Python<'_>, text: &str) -> PyResult<Self> {
        let cameras = resight_fleet::Cameras::of_text(text).map_err(|reason| raised(py, &reason))?;
        Ok(Cameras { cameras: Arc::new(cameras) })
    }

    /// As text, for other machines.
    fn to_text(&self, py: Python<'_>) -> PyResult<String> {
        self.cameras.to_text().map_err(|reason| raised(py, &reason))
    }

    /// Names in column `camera`.
    #[getter]
    fn names(&self) -> Vec<String> {
        self.cameras.names().to_vec()
    }

    /// What is unusual but not wrong, in sentences.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.cameras.warnings.clone()
    }

    /// How `pickle` and `copy` make it again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (String,))> {
        Ok((py.get_type::<Cameras>().getattr("parse")?, (self.to_text(py)?,)))
    }

    fn __len__(&self) -> usize {
        self.cameras.len()
    }

    fn __repr__(&self) -> String {
        format!("Cameras({} cameras)", self.cameras.len())
    }
}

/// A column as `python/resight/_columns.py` hands it over: `("numbers", array)`, `("names", names, rows)`, `("lists", numbers, offsets)`,
/// `("unused",)`.
type Given<'py> = (String, Bound<'py, PyAny>);

/// Arrays that lend their numbers while the columns are read.
enum Lent<'py> {
    Numbers(Numbers<'py>),
    Names(Vec<String>, Vec<u32>),
    Lists(Numbers<'py>, Vec<usize>),
    Unused,
}

impl<'py> Lent<'py> {
    fn new(name: &str, given: &Bound<'py, PyAny>) -> PyResult<Self> {
        let kind: String = given.get_item(0)?.extract()?;
        let item = |i: usize| given.get_item(i);
        match kind.as_str() {
            "numbers" => {
                let numbers = Numbers::new(name, &item(1)?)?;
                match numbers.shape() {
                    [_] => Ok(Lent::Numbers(numbers)),
                    shape => {
                        let shape = crate::arrays::words(shape);
                        let message = format!("column `{name}`: shape {shape} is given, (n,) is needed");
                        Err(error::input(given.py(), message))
                    }
                }
            }
            "names" => {
                let rows: PyReadonlyArray1<'py, i32> = item(2)?.extract()?;
                // A missing name is −1, and the library's is the largest number.
                let rows =
                    rows.as_array().iter().map(|row| u32::try_from(*row).unwrap_or(u32::MAX)).collect();
                Ok(Lent::Names(item(1)?.extract()?, rows))
            }
            "lists" => {
                let offsets: PyReadonlyArray1<'py, i64> = item(2)?.extract()?;
                let offsets = offsets.as_array();
                let offsets = offsets.iter().map(|at| usize::try_from(*at).unwrap_or(usize::MAX)).collect();
                Ok(Lent::Lists(Numbers::new(name, &item(1)?)?, offsets))
            }
            _ => Ok(Lent::Unused),
        }
    }

    fn column(&self) -> Column<'_> {
        match self {
            Lent::Numbers(numbers) => Column::Numbers(Cow::Borrowed(numbers.slice())),
            Lent::Names(names, rows) => Column::Names { names: names.clone(), rows: Cow::Borrowed(rows) },
            Lent::Lists(numbers, offsets) => {
                Column::Lists { values: Cow::Borrowed(numbers.slice()), offsets: Cow::Borrowed(offsets) }
            }
            Lent::Unused => Column::Unused,
        }
    }
}

/// Calls with the columns, without the interpreter's lock.
fn with_columns<T: Send>(
    py: Python<'_>,
    columns: &[Given<'_>],
    call: impl FnOnce(&Columns) -> Result<T, FleetError> + Send,
) -> PyResult<T> {
    let lent = columns.iter().map(|(name, given)| Lent::new(name, given)).collect::<PyResult<Vec<_>>>()?;
    let named = columns.iter().zip(&lent).map(|((name, _), lent)| (name.clone(), lent.column())).collect();
    let answer = py.detach(move || Columns::new(named).and_then(|columns| call(&columns)));
    answer.map_err(|reason| raised(py, &reason))
}

/// Poses of the views of a table, one a row.
#[pyfunction]
pub fn solve_views(
    py: Python<'_>,
    columns: Vec<Given<'_>>,
    cameras: &Cameras,
    sigma_px: f64,
) -> PyResult<Table> {
    let solver = Solver { cameras: cameras.cameras.clone(), sigma_px };
    with_columns(py, &columns, |columns| solve_columns(columns, &solver)).map(Table::from)
}

/// Poses of the images of a table, one a row.
#[pyfunction]
pub fn locate_views(
    py: Python<'_>,
    columns: Vec<Given<'_>>,
    images: Vec<Option<Bound<'_, PyAny>>>,
    cameras: &Cameras,
    target: &Target,
) -> PyResult<Table> {
    let images = images.iter().map(cell).collect::<PyResult<Vec<_>>>()?;
    let located = with_columns(py, &columns, |columns| {
        let rows = ImageRows::of(columns, images)?;
        locate_rows(rows, &cameras.cameras, &target.target).record_batch()
    });
    located.map(Table::from)
}

fn cell<'a>(image: &'a Option<Bound<'_, PyAny>>) -> PyResult<ImageCell<'a>> {
    let Some(image) = image else { return Ok(ImageCell::Missing) };
    match image.cast::<PyBytes>() {
        Ok(bytes) => Ok(ImageCell::Bytes(Cow::Borrowed(bytes.as_bytes()))),
        Err(_) => Ok(ImageCell::Path(image.extract()?)),
    }
}

/// What is kept of the cameras of a fleet.
#[pyclass(frozen, module = "resight")]
pub struct FleetState {
    state: resight_fleet::FleetState,
}

impl FleetState {
    fn copy(&self, py: Python<'_>) -> PyResult<resight_fleet::FleetState> {
        let bytes = self.state.to_bytes();
        resight_fleet::FleetState::from_bytes(&bytes).map_err(|reason| raised(py, &reason))
    }
}

#[pymethods]
impl FleetState {
    #[new]
    #[pyo3(signature = (period_s=900.0))]
    fn new(py: Python<'_>, period_s: f64) -> PyResult<Self> {
        if !(0.0 < period_s && period_s.is_finite()) {
            return Err(error::input(
                py,
                format!("period_s: {period_s} is given, a positive number is needed"),
            ));
        }
        Ok(FleetState { state: resight_fleet::FleetState::new(period_s) })
    }

    #[getter]
    fn period_s(&self) -> f64 {
        self.state.period_s()
    }

    #[getter]
    fn counts(&self) -> [u64; 6] {
        self.state.counts()
    }

    #[getter]
    fn spans_s(&self) -> Vec<(String, Option<(f64, f64)>)> {
        self.state.spans()
    }

    fn add_columns(&self, py: Python<'_>, columns: Vec<Given<'_>>) -> PyResult<()> {
        with_columns(py, &columns, |columns| {
            let rows = SolvedRows::of_record_batch(&columns.record_batch()?)?;
            self.state.add(&rows);
            Ok(())
        })
    }

    fn expect(&self, names: Vec<String>) {
        names.iter().for_each(|name| self.state.expect(name));
    }

    fn merge(&self, py: Python<'_>, other: &FleetState) -> PyResult<()> {
        let other = other.copy(py)?;
        self.state.absorb(other).map_err(|other| {
            let (mine, theirs) = (self.period_s(), other.period_s());
            let message =
                format!("states of periods of {mine} s and {theirs} s do not mix; sum the rows again");
            error::input(py, message)
        })
    }

    fn split<'py>(&self, py: Python<'py>) -> Vec<(String, Bound<'py, PyBytes>)> {
        let parts = self.state.split();
        parts.into_iter().map(|(name, bytes)| (name, PyBytes::new(py, &bytes))).collect()
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.state.to_bytes())
    }

    #[staticmethod]
    fn from_bytes(py: Python<'_>, state: &[u8]) -> PyResult<Self> {
        let state = resight_fleet::FleetState::from_bytes(state).map_err(|reason| raised(py, &reason))?;
        Ok(FleetState { state })
    }

    /// JSON lines, one a camera; of a part of a fleet where the span of the whole is given.
    #[pyo3(signature = (cameras, span_s, is_part, output, diurnal_deg, diurnal_mm))]
    #[allow(clippy::too_many_arguments)]
    fn assessed(
        &self,
        py: Python<'_>,
        cameras: Option<&Cameras>,
        span_s: Option<(f64, f64)>,
        is_part: bool,
        output: Option<PathBuf>,
        diurnal_deg: f64,
        diurnal_mm: f64,
    ) -> PyResult<Vec<String>> {
        let state = self.copy(py)?;
        let config = config(diurnal_deg, diurnal_mm);
        let known = cameras.map(|cameras| &*cameras.cameras);
        let lines = py.detach(|| {
            let fleet = match is_part {
                true => resight_fleet::assess::assess_part(state, known, span_s, &config),
                false => job::report_of(state, known, output.as_deref(), &config),
            };
            json_lines(&fleet?)
        });
        lines.map_err(|reason| raised(py, &reason))
    }

    fn __len__(&self) -> usize {
        self.state.spans().len()
    }
}

fn config(diurnal_deg: f64, diurnal_mm: f64) -> AssessConfig {
    AssessConfig {
        diurnal_rad: diurnal_deg.to_radians(),
        diurnal_m: diurnal_mm / 1e3,
        ..AssessConfig::default()
    }
}

/// From when to when most cameras were seen.
#[pyfunction]
pub fn fleet_span_s(spans_s: Vec<(f64, f64)>) -> Option<(f64, f64)> {
    resight_fleet::assess::FleetSpan::of(spans_s.into_iter(), 1.0).span_s()
}

/// Files of views to a file of poses; the JSON line of the program, and warnings.
#[pyfunction]
#[pyo3(signature = (inputs, cameras, target, output, drift, sigma_px, period_s, threads, progress))]
#[allow(clippy::too_many_arguments)]
pub fn batch(
    py: Python<'_>,
    inputs: Vec<String>,
    cameras: PathBuf,
    target: Option<PathBuf>,
    output: PathBuf,
    drift: Option<PathBuf>,
    sigma_px: f64,
    period_s: f64,
    threads: usize,
    progress: Option<&Bound<'_, PyAny>>,
) -> PyResult<(String, Vec<String>)> {
    for (name, value) in [("sigma_px", sigma_px), ("period_s", period_s)] {
        if !(0.0 < value && value.is_finite()) {
            return Err(error::input(py, format!("{name}: {value} is given, a positive number is needed")));
        }
    }
    let request = BatchRequest { inputs, cameras, target, output, drift, sigma_px, period_s, threads };
    let answer = run(py, progress, move |reporter| {
        let (warnings, reporter) = (Mutex::new(Vec::new()), Mutex::new(reporter.clone()));
        let answer = job::batch(&request, &|news| match news {
            News::Warning(text) => {
                warnings.lock().unwrap_or_else(PoisonError::into_inner).push(text);
                true
            }
            News::Progress(at) => {
                let of = at.of.unwrap_or(0) as usize;
                reporter.lock().unwrap_or_else(PoisonError::into_inner).done(at.rows as usize, of)
            }
        });
        answer.map(|answer| (answer, warnings.into_inner().unwrap_or_else(PoisonError::into_inner)))
    })?;
    let (answer, warnings) = answer.map_err(|reason| raised(py, &reason))?;
    let line = serde_json::to_string(&answer).map_err(|e| error::error(py, "write", e.to_string()))?;
    Ok((line, warnings))
}

/// Which cameras moved: the JSON lines of the program.
#[pyfunction]
#[pyo3(signature = (inputs, cameras, output, since, state, period_s, diurnal_deg, diurnal_mm))]
#[allow(clippy::too_many_arguments)]
pub fn fleet_report(
    py: Python<'_>,
    inputs: Vec<String>,
    cameras: Option<PathBuf>,
    output: Option<PathBuf>,
    since: Option<PathBuf>,
    state: Option<PathBuf>,
    period_s: f64,
    diurnal_deg: f64,
    diurnal_mm: f64,
) -> PyResult<Vec<String>> {
    let config = config(diurnal_deg, diurnal_mm);
    let request = ReportRequest { inputs, cameras, output, since, state, period_s, config };
    let lines = run(py, None, move |_| job::fleet_report(&request).and_then(|fleet| json_lines(&fleet)))?;
    lines.map_err(|reason| raised(py, &reason))
}
