//! Errors of the library as Python's exceptions, with the same words.

use std::error::Error;
use tactomo::causes::with_causes;

use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::PyValueError;

create_exception!(
    tactomo,
    TactomoError,
    PyValueError,
    "What the library cannot do, and what to do about it; the words are those of the program `tactomo`."
);

/// The exception for an error and what caused it.
pub fn raised(error: impl Error) -> PyErr {
    TactomoError::new_err(with_causes(&error))
}

/// The exception with these words.
pub fn refused(text: impl Into<String>) -> PyErr {
    TactomoError::new_err(text.into())
}
