//! NumPy arrays as the numbers of the library: a C-contiguous float64 array is read where it is, anything else that is safely that is
//! converted once.

use crate::error::input;
use numpy::{PyArray, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyType};

static MASKED: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// Whether this is an array with a mask, behind which NumPy keeps numbers that are not meant.
pub fn is_masked(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    value.is_instance(MASKED.import(value.py(), "numpy.ma", "MaskedArray")?)
}

/// An array of float64, C-contiguous, kept alive while it is read.
pub struct Numbers<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
}

impl<'py> Numbers<'py> {
    /// The argument called `name`.
    ///
    /// # Errors
    /// `input` for what is no array of real numbers.
    pub fn new(name: &str, value: &Bound<'py, PyAny>) -> PyResult<Self> {
        let py = value.py();
        let unmasked; // What is masked is missing: NaN.
        let value = match is_masked(value)? {
            true => {
                unmasked = py.import("resight._make")?.call_method1("unmasked", (name, value))?;
                &unmasked
            }
            false => value,
        };
        if let Ok(array) = value.cast::<PyArrayDyn<f64>>()
            && array.is_c_contiguous()
        {
            return Self::borrowed(name, array);
        }
        let numpy = py.import("numpy")?;
        let refused = |reason: PyErr| {
            input(py, format!("{name}: an array of real numbers is needed ({})", reason.value(py)))
        };
        let array = numpy.call_method1("asarray", (value,)).map_err(refused)?;
        let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
        if !matches!(kind.as_str(), "f" | "i" | "u") {
            let dtype = array.getattr("dtype")?;
            return Err(input(
                py,
                format!("{name}: numbers of dtype {dtype} are no real numbers; give float64"),
            ));
        }
        let options = PyDict::new(py);
        options.set_item("dtype", "float64")?;
        options.set_item("order", "C")?;
        let array = numpy.call_method("array", (array,), Some(&options)).map_err(refused)?;
        let array =
            array.cast_into::<PyArrayDyn<f64>>().map_err(|_| input(py, format!("{name}: no array")))?;
        Self::borrowed(name, &array)
    }

    fn borrowed(name: &str, array: &Bound<'py, PyArrayDyn<f64>>) -> PyResult<Self> {
        let busy = |_| input(array.py(), format!("{name}: the array is being written to elsewhere"));
        Ok(Numbers { array: array.try_readonly().map_err(busy)? })
    }

    /// Its sizes.
    pub fn shape(&self) -> &[usize] {
        self.array.shape()
    }

    /// Its numbers, row by row.
    pub fn slice(&self) -> &[f64] {
        self.array.as_slice().unwrap_or(&[]) // Contiguous by construction.
    }

    /// Rows of `N` numbers.
    ///
    /// # Errors
    /// `input` for another shape.
    pub fn rows<const N: usize>(&self, name: &str) -> PyResult<&[[f64; N]]> {
        match self.shape() {
            [_, columns] if *columns == N => Ok(self.slice().as_chunks::<N>().0),
            shape => {
                let hint = match shape {
                    [n, rows] if *n == N && 0 < *rows => "; it looks transposed, give its .T",
                    _ => "",
                };
                let message = format!("{name}: shape {} is given, (n, {N}) is needed{hint}", words(shape));
                Err(input(self.array.py(), message))
            }
        }
    }
}

/// A shape as Python writes it.
pub fn words(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// One number for each of `n`: a scalar for all, or an array of `n`.
///
/// # Errors
/// `input` for any other shape.
pub fn each<'py>(name: &str, value: &Bound<'py, PyAny>, n: usize) -> PyResult<Vec<f64>> {
    if let Ok(one) = value.extract::<f64>() {
        return Ok(vec![one; n]);
    }
    let numbers = Numbers::new(name, value)?;
    match numbers.shape() {
        [] => Ok(vec![numbers.slice()[0]; n]),
        [length] if *length == n => Ok(numbers.slice().to_vec()),
        shape => {
            let shape = words(shape);
            Err(input(value.py(), format!("{name}: shape {shape} is given, one number or ({n},) is needed")))
        }
    }
}

/// A new array of these sizes.
pub fn array<'py>(
    py: Python<'py>,
    values: Vec<f64>,
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    PyArray::from_vec(py, values).reshape(shape.to_vec())
}
