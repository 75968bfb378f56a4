//! Files that are written.

use std::path::Path;

use pyo3::PyResult;
use pyo3::exceptions::PyOSError;
use tactomo::causes::with_causes;
use tactomo::new_file::NewFile;

/// Writes a new file; one that exists is not replaced.
pub fn write_new(path: &Path, bytes: &[u8]) -> PyResult<()> {
    let written = NewFile::new(path).and_then(|file| file.write(bytes));
    written.map_err(|error| PyOSError::new_err(with_causes(&error)))
}
