//! Files that are written.

use std::fs::File;
use std::io::Write as _;
use std::path::Path;

use pyo3::PyResult;
use pyo3::exceptions::PyOSError;

/// Writes a new file; one that exists is not replaced.
pub fn write_new(path: &Path, bytes: &[u8]) -> PyResult<()> {
    let written = File::create_new(path).and_then(|mut file| file.write_all(bytes));
    written.map_err(|error| PyOSError::new_err(format!("cannot write {}: {error}", path.display())))
}
