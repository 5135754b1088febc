//! One exception class, `resight.Error`, whose `kind` says what went wrong.

use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use resight::core::Error as MathError;
use resight::{Error, FileError};

static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();

/// An exception of this kind.
pub fn error(py: Python<'_>, kind: &str, message: String) -> PyErr {
    match CLASS.import(py, "resight._error", "Error") {
        Ok(class) => match class.call1((message, kind)) {
            Ok(value) => PyErr::from_value(value),
            Err(reason) => reason,
        },
        Err(_) => PyException::new_err(message),
    }
}

/// An argument that is none of those that can be.
pub fn input(py: Python<'_>, message: impl Into<String>) -> PyErr {
    error(py, "input", message.into())
}

/// An error of the library.
pub fn job(py: Python<'_>, reason: &Error) -> PyErr {
    let kind = match reason {
        Error::File(_) => "file",
        Error::Detect(_) => "target",
        Error::Math(reason) => return math(py, reason),
        Error::Write(_) => "write",
        Error::Intrinsics { .. } => "intrinsics",
        _ => "request",
    };
    error(py, kind, reason.to_string())
}

/// A file that cannot be read.
pub fn file(py: Python<'_>, reason: &FileError) -> PyErr {
    error(py, "file", reason.to_string())
}

/// An error of the mathematics; its kind is that of `resight_core::Error`, in Python's spelling.
pub fn math(py: Python<'_>, reason: &MathError) -> PyErr {
    error(py, &math_kind(reason), reason.to_string())
}

/// `TooFewPoints { … }` is `too_few_points`.
pub fn math_kind(reason: &MathError) -> String {
    let text = format!("{reason:?}");
    let name: String = text.chars().take_while(|c| c.is_alphanumeric()).collect();
    let mut kind = String::new();
    for c in name.chars() {
        if c.is_uppercase() && !kind.is_empty() {
            kind.push('_');
        }
        kind.extend(c.to_lowercase());
    }
    kind
}
