//! JSON as Python's objects.

use pyo3::prelude::*;

/// The objects of a text.
pub fn loads<'py>(py: Python<'py>, text: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (text,))
}
