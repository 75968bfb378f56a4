//! How pickle keeps an object: the class method `_restored`, which makes it again, and what that is given.

use pyo3::PyClass;
use pyo3::prelude::*;

/// What `__reduce__` returns.
pub type Restored<'py, Arguments> = (Bound<'py, PyAny>, Arguments);

/// That of an object whose class makes it from these arguments.
pub fn restored<'py, T: PyClass, Arguments>(
    object: &Bound<'py, T>,
    arguments: Arguments,
) -> PyResult<Restored<'py, Arguments>> {
    Ok((object.as_any().get_type().getattr("_restored")?, arguments))
}
