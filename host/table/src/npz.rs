//! NumPy's archive of arrays: a ZIP file of NPY files.

use std::io::{self, Cursor, Read, Seek, Write};

use zip::write::{SimpleFileOptions, ZipWriter};
use zip::{CompressionMethod, ZipArchive};

use super::npy::{Value, Values};
use super::{Array, LONGEST, kinds, npy};

/// Most arrays in an archive.
const MOST_ARRAYS: usize = 1000;

/// Whether a file begins as one of these.
pub fn is_npz(bytes: &[u8]) -> bool {
    bytes.starts_with(b"PK\x03\x04")
}

/// Reads all arrays; together they may be no longer than the longest file.
///
/// # Errors
/// What is wrong, and in which array.
pub fn parse(bytes: &[u8]) -> Result<Vec<(String, Array)>, String> {
    each(bytes, npy::parse)
}

/// Reads all arrays, of which some may be texts; bounded likewise.
///
/// # Errors
/// What is wrong, and in which array.
pub fn parse_values(bytes: &[u8]) -> Result<Vec<(String, Value)>, String> {
    each(bytes, npy::parse_value)
}

/// Reads what the archive holds, each array with its name.
fn each<T>(bytes: &[u8], parse: impl Fn(&[u8]) -> Result<T, String>) -> Result<Vec<(String, T)>, String> {
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|error| format!("not an NPZ file: {error}"))?;
    if let Some(other) = kinds::archive(archive.file_names()) {
        return Err(other);
    }
    if archive.len() > MOST_ARRAYS {
        return Err(format!("{} arrays, but {MOST_ARRAYS} at most are read", archive.len()));
    }
    let (mut arrays, mut room) = (Vec::new(), LONGEST);
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).map_err(|error| format!("array {index}: {error}"))?;
        let name = file.name().strip_suffix(".npy").unwrap_or(file.name()).to_owned();
        let located = |what: String| format!("array {}: {what}", name.escape_debug());
        let mut bytes = Vec::new();
        // The length in the archive's directory is not trusted.
        file.by_ref().take(room + 1).read_to_end(&mut bytes).map_err(|error| located(error.to_string()))?;
        room = room.checked_sub(bytes.len() as u64).ok_or_else(|| located("too long".to_owned()))?;
        arrays.push((name.clone(), parse(&bytes).map_err(located)?));
    }
    Ok(arrays)
}

/// Writes an archive.
pub struct NpzWriter<W: Write + Seek> {
    zip: ZipWriter<W>,
}

impl<W: Write + Seek> NpzWriter<W> {
    /// Begins it.
    pub fn new(out: W) -> Self {
        Self { zip: ZipWriter::new(out) }
    }

    /// Adds an array in double precision.
    ///
    /// # Errors
    /// If it cannot be written, or one of its name is there already.
    pub fn add(&mut self, name: &str, shape: &[usize], values: &[f64]) -> io::Result<()> {
        self.add_values(name, shape, Values::Numbers(values))
    }

    /// Adds an array of any kind.
    ///
    /// # Errors
    /// If it cannot be written, or one of its name is there already.
    pub fn add_values(&mut self, name: &str, shape: &[usize], values: Values) -> io::Result<()> {
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated).large_file(true);
        self.zip.start_file(format!("{name}.npy"), options)?;
        self.zip.write_all(&npy::bytes(shape, values))
    }

    /// Ends it.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self) -> io::Result<()> {
        self.zip.finish()?.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let mut bytes = Vec::new();
        let mut writer = NpzWriter::new(Cursor::new(&mut bytes));
        writer.add("x_m", &[3], &[1.0, 2.0, 3.0]).unwrap();
        writer.add("readings_v", &[1, 2], &[0.5, -0.5]).unwrap();
        writer.finish().unwrap();
        let arrays = parse(&bytes).unwrap();
        assert_eq!(arrays[0], ("x_m".to_owned(), Array::flat(vec![1.0, 2.0, 3.0])));
        assert_eq!(arrays[1].0, "readings_v");
        assert_eq!(arrays[1].1.shape, [1, 2]);
    }

    #[test]
    fn a_text_is_read_where_it_is_asked_for_and_refused_among_numbers() {
        let mut bytes = Vec::new();
        let mut writer = NpzWriter::new(Cursor::new(&mut bytes));
        writer.add_values("meta", &[], Values::Text("{}")).unwrap();
        writer.finish().unwrap();
        assert_eq!(parse_values(&bytes), Ok(vec![("meta".to_owned(), Value::Text("{}".to_owned()))]));
        assert!(parse(&bytes).unwrap_err().starts_with("array meta: arrays of <U2 are not read"));
    }

    #[test]
    fn no_array_is_written_twice() {
        let mut writer = NpzWriter::new(Cursor::new(Vec::new()));
        writer.add("x_m", &[1], &[1.0]).unwrap();
        assert!(writer.add("x_m", &[0], &[]).is_err());
    }

    #[test]
    fn other_archives_are_refused() {
        assert!(parse(b"PK\x03\x04 and no more").unwrap_err().contains("not an NPZ file"));
        let mut bytes = Vec::new();
        let mut zip = ZipWriter::new(Cursor::new(&mut bytes));
        zip.start_file("letter.npy", SimpleFileOptions::default()).unwrap();
        zip.write_all(b"hello").unwrap();
        zip.finish().unwrap();
        assert_eq!(parse(&bytes).unwrap_err(), "array letter: the header of the array is cut off");
    }
}
