//! JSON files of other programs, as they are or compressed by gzip.

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

use flate2::bufread::MultiGzDecoder;
use tactomo_table::file::Format;

/// Readings of some ten thousand scenes.
const FORMAT: Format = Format::new("a file of cases", 256 << 20);

/// Bytes that a compressed file begins with (RFC 1952).
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// The text of a file, decompressed if it begins as gzip writes.
///
/// # Errors
/// What the system says; that it is damaged, longer than is read, or no text.
pub(crate) fn text(path: &Path) -> io::Result<String> {
    let mut file = BufReader::new(File::open(path)?);
    let bytes = match file.fill_buf()?.starts_with(&GZIP) {
        true => FORMAT.read_from(MultiGzDecoder::new(file)),
        false => FORMAT.read_from(file),
    };
    FORMAT.text(bytes?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    #[test]
    fn compressed_or_not_the_text_is_the_same_and_damage_is_told() {
        let folder = std::env::temp_dir().join(format!("tactomo-json-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let mut compressed = GzEncoder::new(Vec::new(), Compression::best());
        compressed.write_all(br#"{"a": 1}"#).unwrap();
        let compressed = compressed.finish().unwrap();
        let cut = &compressed[..compressed.len() - 5];
        let texts = [br#"{"a": 1}"#.as_slice(), &compressed, cut].map(|bytes| {
            std::fs::write(folder.join("a"), bytes).unwrap();
            text(&folder.join("a"))
        });
        std::fs::remove_dir_all(&folder).unwrap();
        let [plain, compressed, cut] = texts;
        assert_eq!(plain.unwrap(), compressed.unwrap());
        assert_eq!(cut.unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }
}
