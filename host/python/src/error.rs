//! Errors of the library as Python's exceptions, with the same words.

use std::error::Error;

use pyo3::PyErr;
use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use tactomo::causes::with_causes;

create_exception!(
    tactomo,
    TactomoError,
    PyValueError,
    "What the library cannot do, and what to do about it; the words are those of the program `tactomo`."
);

/// The exception for an error and what caused it.
pub fn raised(error: impl Error) -> PyErr {
    refused(in_python(&with_causes(&error)))
}

/// The program's words, with its options as the arguments that they are here.
pub fn in_python(words: &str) -> String {
    let options = [("`--port`", "`port`"), ("`--simulate`", "`simulate=True`"), ("`--detector`", "`detector`")];
    options.into_iter().fold(words.to_owned(), |words, (option, argument)| words.replace(option, argument))
}

/// The exception with these words.
pub fn refused(text: impl Into<String>) -> PyErr {
    TactomoError::new_err(text.into())
}
