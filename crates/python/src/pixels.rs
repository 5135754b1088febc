//! Images as arrays: (height, width) or (height, width, channels) of uint8.

use crate::arrays::{is_masked, words};
use crate::error;
use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use resight::image::Channels;

/// Whether a value is an array, or is one for NumPy, as images of PIL are.
pub fn is_array(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    Ok(value.hasattr("__array_interface__")? || value.hasattr("__array__")?)
}

/// Pixels of an array, row by row.
pub struct Pixels {
    data: Vec<u8>,
    /// Height and width, and the channels where the array has such an axis.
    pub shape: Vec<usize>,
}

impl Pixels {
    /// # Errors
    /// `input` for what is no array (height, width) or (height, width, channels) of uint8.
    pub fn new(value: &Bound<'_, PyAny>) -> PyResult<Self> {
        let py = value.py();
        if is_masked(value)? {
            let message =
                "image: what is behind the mask of a masked array has no grey; give image.filled(0)";
            return Err(error::input(py, message));
        }
        let value = py.import("numpy")?.call_method1("asarray", (value,))?;
        let Ok(array) = value.cast::<PyArrayDyn<u8>>() else {
            let dtype = value.getattr("dtype")?;
            let message = format!(
                "image: an array of {dtype} is given, uint8 is needed: scale to 0 to 255, then image.astype(numpy.uint8)"
            );
            return Err(error::input(py, message));
        };
        let shape = numpy::PyUntypedArrayMethods::shape(array).to_vec();
        if !matches!(shape[..], [_, _] | [_, _, 1 | 3 | 4]) || shape.contains(&0) {
            let message = format!(
                "image: shape {} is given; (height, width), or (height, width, channels) with 1, 3 or 4 channels is needed",
                words(&shape)
            );
            return Err(error::input(py, message));
        }
        let busy = |_| error::input(py, "image: the array is being written to elsewhere");
        let data = array.try_readonly().map_err(busy)?.as_array().iter().copied().collect();
        Ok(Pixels { data, shape })
    }

    /// As the library takes them.
    pub fn channels(&self) -> Channels<'_> {
        let n_channels = self.shape.get(2).copied().unwrap_or(1);
        Channels { width_px: self.shape[1], height_px: self.shape[0], n_channels, data: &self.data }
    }
}
