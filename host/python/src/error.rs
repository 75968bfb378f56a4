//! Errors of the library as Python's exceptions, with the same words.

use std::error::Error;
use std::fmt::Write as _;

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
    TactomoError::new_err(words(&error))
}

/// The words of an error and of what caused it.
pub fn words(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        // Writing to a string cannot fail.
        let _ = write!(text, ": {error}");
        cause = error.source();
    }
    text
}

/// The exception with these words.
pub fn refused(text: impl Into<String>) -> PyErr {
    TactomoError::new_err(text.into())
}
