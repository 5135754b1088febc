//! Answers as a table of columns for pandas, Polars and Arrow: the Arrow PyCapsule interface, without a copy on their side.

use crate::answer::{PoseAnswer, PoseFigures, Row};
use crate::many::Poses;
use crate::{error, notebook};
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{
    ArrayRef, FixedSizeListArray, Float64Array, RecordBatch, RecordBatchIterator, StringArray, UInt32Array,
};
use arrow_ipc::reader::StreamReader;
use arrow_ipc::writer::StreamWriter;
use arrow_schema::{ArrowError, DataType, Field};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyCapsule};
use std::sync::Arc;

/// One row an answer; the columns of a pose are null where there is none.
#[pyclass(frozen, module = "resight")]
pub struct Table {
    batch: RecordBatch,
}

impl From<RecordBatch> for Table {
    fn from(batch: RecordBatch) -> Self {
        Table { batch }
    }
}

#[pymethods]
impl Table {
    /// The Arrow PyCapsule interface: `pandas.DataFrame.from_arrow`, `polars.DataFrame`, `pyarrow.table` take it.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        let _ = requested_schema; // A wish that the interface allows to be left unheard.
        let batches = RecordBatchIterator::new([Ok(self.batch.clone())], self.batch.schema());
        let stream = FFI_ArrowArrayStream::new(Box::new(batches));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }

    /// Names of its columns.
    #[getter]
    fn column_names(&self) -> Vec<String> {
        self.batch.schema().fields().iter().map(|field| field.name().clone()).collect()
    }

    /// A column as an array: doubles with NaN where there is no number, whole numbers, or text.
    fn column<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let array = self.batch.column_by_name(name).ok_or_else(|| {
            let there = self.column_names().join(", ");
            error::input(py, format!("no column `{name}`; the columns are {there}"))
        })?;
        match array.data_type() {
            DataType::Float64 | DataType::Int32 | DataType::UInt32 => {
                let numbers = resight_fleet::columns::numbers(array.as_ref()).into_owned();
                Ok(numpy::PyArray1::from_vec(py, numbers).into_any())
            }
            DataType::Utf8 | DataType::Dictionary(_, _) => {
                let text = resight_fleet::columns::text(array.as_ref());
                Ok(text.into_pyobject(py)?)
            }
            other => {
                Err(error::input(py, format!("column `{name}` is of type {other}; ask pyarrow.table for it")))
            }
        }
    }

    /// What `__reduce__` kept: a stream of Arrow.
    #[staticmethod]
    fn _of(py: Python<'_>, stream: &[u8]) -> PyResult<Self> {
        let batch = StreamReader::try_new(stream, None).and_then(|mut batches| batches.next().transpose());
        let batch = batch.ok().flatten();
        let batch = batch.ok_or_else(|| error::input(py, "this is no table that was pickled"))?;
        Ok(Table { batch })
    }

    /// How `pickle` and `copy` make it again.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        let mut stream = Vec::new();
        let written = StreamWriter::try_new(&mut stream, &self.batch.schema())
            .and_then(|mut writer| writer.write(&self.batch).and_then(|()| writer.finish()));
        written.map_err(|reason| error::error(py, "write", reason.to_string()))?;
        Ok((py.get_type::<Table>().getattr("_of")?, (PyBytes::new(py, &stream),)))
    }

    fn __len__(&self) -> usize {
        self.batch.num_rows()
    }

    /// What a notebook shows: the first rows of the columns that hold a number or text.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        /// Rows shown.
        const MOST: usize = 20;
        let first = self.batch.slice(0, self.batch.num_rows().min(MOST));
        let cells = |array: &ArrayRef| -> Option<Vec<String>> {
            match array.data_type() {
                DataType::Float64 | DataType::Int32 | DataType::UInt32 => {
                    let numbers = resight_fleet::columns::numbers(array.as_ref());
                    Some(
                        numbers
                            .iter()
                            .map(|x| if x.is_nan() { String::new() } else { x.to_string() })
                            .collect(),
                    )
                }
                DataType::Utf8 | DataType::Dictionary(_, _) => Some(
                    resight_fleet::columns::text(array.as_ref())
                        .into_iter()
                        .map(Option::unwrap_or_default)
                        .collect(),
                ),
                _ => None,
            }
        };
        let named = self.column_names().into_iter().zip(first.columns());
        let columns: Vec<_> =
            named.filter_map(|(name, array)| cells(array).map(|cells| (name, cells))).collect();
        notebook::columns(py, &columns, self.batch.num_rows() - first.num_rows())
    }

    fn __repr__(&self) -> String {
        format!("Table({} answers: {})", self.batch.num_rows(), self.column_names().join(", "))
    }
}

/// The table of answers: a list of them, or the poses of `solve_many`.
#[pyfunction]
pub fn table(py: Python<'_>, answers: &Bound<'_, PyAny>) -> PyResult<Table> {
    if let Ok(poses) = answers.cast::<Poses>() {
        return made(py, &poses.get().rows().collect::<Vec<_>>());
    }
    let answers: Vec<Bound<'_, PoseAnswer>> = answers.extract().map_err(|_| {
        error::input(
            py,
            "answers: a list of PoseAnswer (of locate_images, solve, solve_table) or Poses is needed",
        )
    })?;
    made(py, &answers.iter().map(row).collect::<Vec<_>>())
}

fn row<'a>(answer: &'a Bound<'_, PoseAnswer>) -> Row<'a> {
    let figures = answer.get().figures();
    Row {
        view: figures.view.clone(),
        status: &figures.status,
        message: &figures.message,
        n_points: figures.n_points,
        pose: figures.pose.as_ref(),
    }
}

fn made(py: Python<'_>, rows: &[Row]) -> PyResult<Table> {
    let batch = batch(rows).map_err(|reason| error::error(py, "write", reason.to_string()))?;
    Ok(Table { batch })
}

fn batch(rows: &[Row]) -> Result<RecordBatch, ArrowError> {
    let text = |of: &dyn Fn(&Row) -> String| -> ArrayRef {
        Arc::new(rows.iter().map(|row| Some(of(row))).collect::<StringArray>())
    };
    let number = |of: &dyn Fn(&PoseFigures) -> f64| -> ArrayRef {
        Arc::new(rows.iter().map(|row| row.pose.map(of)).collect::<Float64Array>())
    };
    RecordBatch::try_from_iter_with_nullable([
        ("view", text(&|row| row.view.clone()), false),
        ("status", text(&|row| row.status.to_owned()), false),
        ("message", text(&|row| row.message.to_owned()), false),
        (
            "n_points",
            Arc::new(
                rows.iter()
                    .map(|row| Some(u32::try_from(row.n_points).unwrap_or(u32::MAX)))
                    .collect::<UInt32Array>(),
            ),
            false,
        ),
        ("rotation_wxyz", lists::<4>(rows, |e| e.cam_from_target.quaternion_wxyz())?, true),
        ("translation_m", lists::<3>(rows, |e| e.cam_from_target.translation.into())?, true),
        ("covariance", lists::<36>(rows, |e| std::array::from_fn(|i| e.covariance.as_slice()[i]))?, true),
        ("probability", number(&|e| e.probability), true),
        ("rms_px", number(&|e| e.rms_px), true),
        ("chi2", number(&|e| e.chi2), true),
    ])
}

/// Lists of `N` numbers, null where there is no pose.
fn lists<const N: usize>(
    rows: &[Row],
    of: impl Fn(&PoseFigures) -> [f64; N],
) -> Result<ArrayRef, ArrowError> {
    let numbers = rows.iter().flat_map(|row| row.pose.map_or([0.0; N], &of));
    let item = Arc::new(Field::new("item", DataType::Float64, false));
    let has_pose = rows.iter().map(|row| row.pose.is_some()).collect::<Vec<bool>>().into();
    let size = i32::try_from(N).map_err(|_| ArrowError::ComputeError("too long a list".to_owned()))?;
    let numbers = Arc::new(Float64Array::from_iter_values(numbers));
    Ok(Arc::new(FixedSizeListArray::try_new(item, size, numbers, Some(has_pose))?))
}
