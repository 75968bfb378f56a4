//! Files that are no tables here: what they are by how they begin, and text in other encodings than UTF-8.

use std::borrow::Cow;

/// How files of other kinds begin, and what they are.
const KINDS: [(&[u8], &str); 19] = [
    (b"\x1f\x8b", "compressed by gzip: unpack it with gunzip"),
    (b"BZh", "compressed by bzip2: unpack it"),
    (b"\xfd7zXZ\0", "compressed by xz: unpack it"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd: unpack it"),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook: save its sheet as CSV"),
    (b"MATLAB ", "a MATLAB file: write the numbers with `writematrix(readings, 'readings.csv')`"),
    (b"\x89HDF\r\n", "an HDF5 file: save the numbers as NPY with h5py and `numpy.save`, or as CSV"),
    (b"\x89MCAP0", "an MCAP file: give the recording that it was made of, or `tactomo export --to npz` of that"),
    (b"#ROSBAG", "a ROS bag: save its numbers as CSV or NPY"),
    (b"TDSm", "a TDMS file of LabVIEW: export it as text"),
    (b"PAR1", "a Parquet file: save it as CSV, with pandas `to_csv(..., index=False)`"),
    (b"ARROW1", "an Arrow file: save it as CSV, with pandas `to_csv(..., index=False)`"),
    (b"\x80\x03", "a Python pickle: save the numbers with `numpy.save`"),
    (b"\x80\x04", "a Python pickle: save the numbers with `numpy.save`"),
    (b"\x80\x05", "a Python pickle: save the numbers with `numpy.save`"),
    (b"SQLite format 3", "an SQLite database: export the table as CSV"),
    (b"%PDF", "a PDF document: save the numbers as CSV"),
    (b"{", "JSON: save the numbers as CSV or NPY"),
    (b"[", "JSON: save the numbers as CSV or NPY"),
];
/// What distinguishes archives that are no NPZ: a name in them, and what they are.
const ARCHIVES: [(&str, &str); 3] = [
    ("[Content_Types].xml", "an Excel workbook: save its sheet as CSV"),
    ("content.xml", "a workbook of LibreOffice: save its sheet as CSV"),
    ("data.pkl", "a model or tensor of PyTorch: save the numbers with `numpy.save`"),
];
/// What is needed instead.
const NEEDED: &str = "CSV, NPY or NPZ is needed";

/// The text of a file: UTF-8, UTF-16 as Windows writes it, or else of a byte a character (Latin-1), if nothing speaks against that.
///
/// # Errors
/// What the file is instead.
pub fn text_of(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    let begins = bytes.trim_ascii_start();
    if let Some((_, what)) = KINDS.iter().find(|(begin, _)| begins.starts_with(begin)) {
        return Err(format!("this is {what}; {NEEDED}"));
    }
    if let Some(text) = utf_16(bytes) {
        return text.map(Cow::Owned).ok_or_else(|| format!("this begins as text in UTF-16, and is none; {NEEDED}"));
    }
    if let Some(text) = str::from_utf8(bytes).ok().filter(|text| !text.contains('\0')) {
        return Ok(Cow::Borrowed(text));
    }
    if bytes.iter().all(|byte| *byte >= b' ' || byte.is_ascii_whitespace()) {
        return Ok(Cow::Owned(bytes.iter().map(|&byte| char::from(byte)).collect()));
    }
    Err("this is neither text nor NPY nor NPZ".to_owned())
}

/// Text in UTF-16, by its mark or by the zeros in its first characters; `None` inside where it is broken.
fn utf_16(bytes: &[u8]) -> Option<Option<String>> {
    let (body, is_big) = match bytes {
        [0xff, 0xfe, body @ ..] => (body, false),
        [0xfe, 0xff, body @ ..] => (body, true),
        [a, 0, b, 0, ..] if *a > 0 && *b > 0 => (bytes, false),
        [0, a, 0, b, ..] if *a > 0 && *b > 0 => (bytes, true),
        _ => return None,
    };
    let (units, rest) = body.as_chunks::<2>();
    let units = units.iter().map(|unit| if is_big { u16::from_be_bytes(*unit) } else { u16::from_le_bytes(*unit) });
    let text: Result<String, _> = char::decode_utf16(units).collect();
    Some(text.ok().filter(|_| rest.is_empty()))
}

/// What an archive with files of such names is, if it is no NPZ.
pub fn archive<'a>(names: impl Iterator<Item = &'a str>) -> Option<String> {
    let names: Vec<&str> = names.collect();
    let is_there = |wanted: &str| names.iter().any(|name| name.rsplit('/').next() == Some(wanted));
    let known = ARCHIVES.iter().find(|(name, _)| is_there(name));
    let what = match known {
        Some((_, what)) => what,
        None if !names.iter().any(|name| name.ends_with(".npy")) => "a ZIP archive without arrays: unpack it",
        None => return None,
    };
    Some(format!("this is {what}; {NEEDED}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Table;

    #[test]
    fn what_is_no_table_is_named() {
        for (bytes, word) in [
            (&b"\x1f\x8b\x08\0rest"[..], "gunzip"),
            (b"MATLAB 5.0 MAT-file, Platform", "writematrix"),
            (b"MATLAB 7.3 MAT-file", "writematrix"),
            (b"\x89HDF\r\n\x1a\n", "HDF5"),
            (b"\x89MCAP0\r\n", "MCAP"),
            (b"  {\"readings_v\": [1]}", "JSON"),
            (b"\x80\x04\x95", "pickle"),
            (b"\xff\xfe1", "UTF-16"),
            (b"\0\0\x01", "neither text"),
        ] {
            let refused = Table::parse(bytes).unwrap_err();
            assert!(refused.contains(word), "{refused}");
        }
        assert!(archive(["xl/a.xml", "[Content_Types].xml"].into_iter()).is_some_and(|what| what.contains("Excel")));
        assert!(archive(["readings.csv"].into_iter()).is_some_and(|what| what.contains("ZIP")));
        assert_eq!(archive(["readings_v.npy"].into_iter()), None);
    }

    #[test]
    fn text_in_other_encodings_is_read() {
        let text = "spannung \u{b5}V;b\r\n0,5;2\r\n";
        let units: Vec<u16> = text.encode_utf16().collect();
        let with = |mark: &[u8], of: fn(u16) -> [u8; 2]| {
            [mark, &units.iter().flat_map(|unit| of(*unit)).collect::<Vec<u8>>()].concat()
        };
        let latin: Vec<u8> = text.chars().map(|character| character as u8).collect();
        for bytes in [
            with(&[0xff, 0xfe], u16::to_le_bytes),
            with(&[0xfe, 0xff], u16::to_be_bytes),
            with(&[], u16::to_le_bytes),
            with(&[], u16::to_be_bytes),
            latin,
        ] {
            let table = Table::parse(&bytes).unwrap();
            assert!(
                matches!(table, Table::Columns { names, rows } if names[0] == "spannung \u{b5}V" && rows.values == [0.5, 2.0])
            );
        }
    }
}
