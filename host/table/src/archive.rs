//! An NPZ file in which a text stands beside the numbers.

use std::path::{Path, PathBuf};

use super::npy::Value;
use super::{Array, TableError, bytes_of, npz};

/// Arrays and texts of an NPZ file, taken out by their names. A text is what `numpy.savez(FILE, name="text")` writes: an array of no
/// dimensions, as in a description in JSON.
///
/// ```
/// use std::path::Path;
/// use tactomo_table::{Archive, NpzWriter, Values};
///
/// let mut bytes = Vec::new();
/// let mut writer = NpzWriter::new(std::io::Cursor::new(&mut bytes));
/// writer.add("green", &[2], &[1.0, 2.0])?;
/// writer.add_values("about", &[], Values::Text("two numbers"))?;
/// writer.finish()?;
/// let mut archive = Archive::parse(Path::new("a.npz"), &bytes)?;
/// assert_eq!(archive.array("green")?.values, [1.0, 2.0]);
/// assert_eq!(archive.text("about")?, "two numbers");
/// assert_eq!(archive.text("meta").unwrap_err().to_string(), "a.npz: no array is called meta; there are none");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Archive {
    path: PathBuf,
    values: Vec<(String, Value)>,
}

impl Archive {
    /// Reads a file.
    ///
    /// # Errors
    /// [`TableError`], which says where the file is wrong.
    pub fn read(path: &Path) -> Result<Self, TableError> {
        Self::parse(path, &bytes_of(path)?)
    }

    /// Reads the bytes of a file; `path` is what messages call it.
    ///
    /// # Errors
    /// [`TableError::Format`], which says where the file is wrong.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, TableError> {
        let path = path.to_owned();
        match npz::parse_values(bytes) {
            Ok(values) => Ok(Self { path, values }),
            Err(what) => Err(TableError::Format { path, what }),
        }
    }

    /// Takes an array of numbers out.
    ///
    /// # Errors
    /// [`TableError::Format`] if there is none of this name, or it is a text.
    pub fn array(&mut self, name: &str) -> Result<Array, TableError> {
        match self.take(name)? {
            Value::Numbers(array) => Ok(array),
            Value::Text(_) => Err(self.wrong(format!("array {name} is a text; numbers are needed"))),
        }
    }

    /// Takes a text out.
    ///
    /// # Errors
    /// [`TableError::Format`] if there is none of this name, or it is numbers.
    pub fn text(&mut self, name: &str) -> Result<String, TableError> {
        match self.take(name)? {
            Value::Text(text) => Ok(text),
            Value::Numbers(_) => Err(self.wrong(format!("array {name} is numbers; a text is needed"))),
        }
    }

    fn take(&mut self, wanted: &str) -> Result<Value, TableError> {
        match self.values.iter().position(|(name, _)| name == wanted) {
            Some(index) => Ok(self.values.remove(index).1),
            None => {
                let there = super::names(self.values.iter().map(|(name, _)| name));
                Err(self.wrong(format!("no array is called {wanted}; there are {there}")))
            }
        }
    }

    fn wrong(&self, what: String) -> TableError {
        TableError::Format { path: self.path.clone(), what }
    }
}
