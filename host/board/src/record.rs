//! Recordings: the raw bytes of a board, with the times at which they came.
//!
//! Nothing is decoded before it is written, so a recording holds what the board said, whatever becomes of the decoder.
//!
//! | bytes | what |
//! |---|---|
//! | 8 | magic: `89 T C T O 0D 0A 1A` (not text, and broken by any program that takes it for text) |
//! | 1 | version of the format: 1 |
//! | 2 | length of the header, little-endian |
//! | n | [header](Header): JSON in UTF-8 |
//! | 4 | CRC-32 (as in zlib) of version, length and header, little-endian |
//! | ... | chunks, to the end of the file |
//!
//! A chunk: time since the start of the recording in microseconds and number of bytes (at most 65536), both as LEB128; the
//! bytes; CRC-32 of all of these, little-endian. A file that was cut off loses the chunk that was cut, no more; a chunk whose
//! CRC is wrong is left out and counted.

mod recorder;

pub use recorder::Recorder;

use std::fmt;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// What a recording begins with.
pub const MAGIC: [u8; 8] = *b"\x89TCTO\r\n\x1a";
const VERSION: u8 = 1;
/// Most bytes in a chunk.
const MAX_CHUNK: usize = 65_536;
/// Most bytes of a LEB128 number of 64 bits.
const MAX_LEB128: usize = 10;

static CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// What a recording says about itself.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Name of the detector it was taken for.
    pub detector: String,
    /// Where the bytes came from.
    pub source: String,
    /// Seconds since 1970 at its start (s).
    pub started_unix_s: u64,
    /// Whatever else a person wants to remember.
    #[serde(default)]
    pub notes: String,
}

impl fmt::Display for Header {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "detector {}, recorded from {}", self.detector, self.source)?;
        if self.notes.is_empty() { Ok(()) } else { write!(f, " ({})", self.notes) }
    }
}

/// Why a recording cannot be read or kept.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The file cannot be opened or created.
    #[error("cannot open the recording {path}")]
    Open {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The file does not begin as a recording does.
    #[error("{path} is not a recording of tactomo, or its header is damaged")]
    NotARecording {
        /// The file.
        path: PathBuf,
    },
    /// A newer format.
    #[error("{path} is a recording in version {found} of the format; this program reads version {VERSION}: update it")]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u8,
    },
    /// The recording can no longer be written.
    #[error("cannot go on recording to {path}; what came before is kept")]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

/// Writes a recording.
#[derive(Debug)]
pub struct RecordWriter<W: Write> {
    out: W,
    /// The chunk as it goes out, kept to be filled again.
    chunk: Vec<u8>,
}

impl<W: Write> RecordWriter<W> {
    /// Begins a recording in `out`, which should be buffered.
    ///
    /// # Errors
    /// If `out` takes no bytes, or the header is longer than 65535 bytes.
    pub fn new(mut out: W, header: &Header) -> io::Result<Self> {
        let json = serde_json::to_vec(header)?;
        let length = u16::try_from(json.len())
            .map_err(|_| io::Error::new(io::ErrorKind::InvalidInput, "the header is too long"))?;
        let mut head = vec![VERSION];
        head.extend(length.to_le_bytes());
        head.extend(json);
        out.write_all(&MAGIC)?;
        out.write_all(&head)?;
        out.write_all(&CRC.checksum(&head).to_le_bytes())?;
        Ok(Self { out, chunk: Vec::new() })
    }

    /// Adds bytes that came `time_us` after the start (us).
    ///
    /// # Errors
    /// If `out` takes no bytes.
    pub fn write(&mut self, time_us: u64, bytes: &[u8]) -> io::Result<()> {
        bytes.chunks(MAX_CHUNK).try_for_each(|bytes| self.write_chunk(time_us, bytes))
    }

    fn write_chunk(&mut self, time_us: u64, bytes: &[u8]) -> io::Result<()> {
        self.chunk.clear();
        put_leb128(time_us, &mut self.chunk);
        put_leb128(bytes.len() as u64, &mut self.chunk);
        self.chunk.extend_from_slice(bytes);
        let crc = CRC.checksum(&self.chunk);
        self.chunk.extend(crc.to_le_bytes());
        self.out.write_all(&self.chunk)
    }

    /// Hands everything to the system.
    ///
    /// # Errors
    /// If `out` takes no bytes.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// What is written to.
    pub fn get_ref(&self) -> &W {
        &self.out
    }
}

/// What a reader had to leave out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Loss {
    /// Chunks with a wrong checksum.
    pub damaged_chunks: u64,
    /// Bytes at the end that are no whole chunk.
    pub tail_bytes: u64,
}

/// Reads a recording, chunk by chunk; its bytes are not trusted.
#[derive(Debug)]
pub struct RecordReader<R: BufRead> {
    input: R,
    header: Header,
    loss: Loss,
}

impl RecordReader<BufReader<File>> {
    /// Opens a recording.
    ///
    /// # Errors
    /// [`RecordError`] if the file is not there, or no recording that this program reads.
    pub fn open(path: &Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(|source| RecordError::Open { path: path.to_owned(), source })?;
        Self::new(BufReader::new(file), path)
    }
}

impl<R: BufRead> RecordReader<R> {
    /// Reads the header of the recording in `input`, called `path` in errors.
    ///
    /// # Errors
    /// [`RecordError`] if it is no recording that this program reads.
    pub fn new(mut input: R, path: &Path) -> Result<Self, RecordError> {
        let not_a_recording = || RecordError::NotARecording { path: path.to_owned() };
        let mut start = [0; MAGIC.len() + 3];
        input.read_exact(&mut start).map_err(|_| not_a_recording())?;
        let (magic, head) = start.split_at(MAGIC.len());
        if magic != MAGIC {
            return Err(not_a_recording());
        }
        if head[0] != VERSION {
            return Err(RecordError::Version { path: path.to_owned(), found: head[0] });
        }
        let header = read_header(&mut input, head).ok_or_else(not_a_recording)?;
        Ok(Self { input, header, loss: Loss::default() })
    }

    /// What the recording says about itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// What was left out so far.
    pub fn loss(&self) -> Loss {
        self.loss
    }

    /// Puts the bytes of the next whole chunk in place of what `bytes` holds; returns the time at which they came (us), or `None`
    /// at the end.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn next_into(&mut self, bytes: &mut Vec<u8>) -> io::Result<Option<u64>> {
        loop {
            let mut digest = CRC.digest();
            let mut read = 0;
            match self.chunk_into(bytes, &mut digest, &mut read)? {
                Some((time_us, crc)) if crc == digest.finalize() => return Ok(Some(time_us)),
                Some(_) => self.loss.damaged_chunks += 1,
                None => {
                    // Whatever follows a length that cannot be is lost with it.
                    self.loss.tail_bytes += read + io::copy(&mut self.input, &mut io::sink())?;
                    return Ok(None);
                }
            }
        }
    }

    /// Time and checksum of the next chunk; `None` if there is no whole one. Counts the bytes taken in `read`.
    fn chunk_into(
        &mut self,
        bytes: &mut Vec<u8>,
        digest: &mut crc::Digest<u32>,
        read: &mut u64,
    ) -> io::Result<Option<(u64, u32)>> {
        let Some(time_us) = self.leb128(digest, read)? else { return Ok(None) };
        let Some(length) = self.leb128(digest, read)? else { return Ok(None) };
        if length > MAX_CHUNK as u64 {
            return Ok(None);
        }
        bytes.clear();
        let taken = self.input.by_ref().take(length).read_to_end(bytes)? as u64;
        digest.update(bytes);
        let mut crc = Vec::with_capacity(4);
        *read += taken + self.input.by_ref().take(4).read_to_end(&mut crc)? as u64;
        Ok(<[u8; 4]>::try_from(crc).ok().map(|crc| (time_us, u32::from_le_bytes(crc))))
    }

    /// The next LEB128 number; `None` at the end of the file, or if it has more than 64 bits.
    fn leb128(&mut self, digest: &mut crc::Digest<u32>, read: &mut u64) -> io::Result<Option<u64>> {
        let mut value = 0;
        for place in 0..MAX_LEB128 {
            let Some(&byte) = self.input.fill_buf()?.first() else { return Ok(None) };
            self.input.consume(1);
            *read += 1;
            digest.update(&[byte]);
            value |= u64::from(byte & 0x7f) << (7 * place);
            if byte < 0x80 {
                return Ok(Some(value));
            }
        }
        Ok(None)
    }
}

/// The header whose version and length are `head`, if its checksum is right.
fn read_header(input: &mut impl Read, head: &[u8]) -> Option<Header> {
    let length = u16::from_le_bytes([head[1], head[2]]);
    let mut json = vec![0; usize::from(length)];
    let mut crc = [0; 4];
    input.read_exact(&mut json).ok()?;
    input.read_exact(&mut crc).ok()?;
    let mut digest = CRC.digest();
    digest.update(head);
    digest.update(&json);
    (digest.finalize() == u32::from_le_bytes(crc)).then(|| serde_json::from_slice(&json).ok())?
}

fn put_leb128(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Chunks = Vec<(u64, Vec<u8>)>;

    fn header() -> Header {
        Header { detector: "square-60".into(), source: "test".into(), started_unix_s: 1, notes: "ä".into() }
    }

    /// The recording, and where each chunk ends.
    fn written(chunks: &Chunks) -> (Vec<u8>, Vec<usize>) {
        let mut writer = RecordWriter::new(Vec::new(), &header()).unwrap();
        let mut ends = vec![writer.get_ref().len()];
        for (time_us, bytes) in chunks {
            writer.write(*time_us, bytes).unwrap();
            ends.push(writer.get_ref().len());
        }
        (writer.out, ends)
    }

    fn read(file: &[u8]) -> Option<(Chunks, Loss)> {
        let mut reader = RecordReader::new(file, Path::new("test")).ok()?;
        let (mut chunks, mut bytes) = (Vec::new(), Vec::new());
        while let Some(time_us) = reader.next_into(&mut bytes).unwrap() {
            chunks.push((time_us, bytes.clone()));
        }
        Some((chunks, reader.loss()))
    }

    fn any_chunks() -> impl Strategy<Value = Chunks> {
        prop::collection::vec((any::<u64>(), prop::collection::vec(any::<u8>(), 1..300)), 0..8)
    }

    #[test]
    fn long_reads_are_cut_and_come_back_whole() {
        let bytes: Vec<u8> = (0..200_000u32).map(|i| i as u8).collect();
        let (chunks, loss) = read(&written(&vec![(9, bytes.clone())]).0).unwrap();
        assert_eq!((chunks.len(), loss), (4, Loss::default()));
        assert_eq!(chunks.into_iter().flat_map(|chunk| chunk.1).collect::<Vec<_>>(), bytes);
    }

    #[test]
    fn other_files_and_newer_recordings_are_refused() {
        let refusal = |file: &[u8]| RecordReader::new(file, Path::new("some.file")).unwrap_err();
        assert!(matches!(refusal(b"a letter to somebody"), RecordError::NotARecording { .. }));
        assert!(matches!(refusal(b""), RecordError::NotARecording { .. }));
        let (mut file, _) = written(&Vec::new());
        file[MAGIC.len()] = 2;
        assert!(refusal(&file).to_string().contains("version 2"));
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(chunks in any_chunks()) {
            let (file, _) = written(&chunks);
            prop_assert_eq!(read(&file), Some((chunks, Loss::default())));
        }

        #[test]
        fn a_file_that_was_cut_keeps_every_whole_chunk(chunks in any_chunks(), cut in any::<prop::sample::Index>()) {
            let (file, ends) = written(&chunks);
            let cut = cut.index(file.len() + 1);
            let whole = ends.iter().filter(|end| **end <= cut).count();
            let Some(last_end) = whole.checked_sub(1).map(|last| ends[last]) else {
                prop_assert_eq!(read(&file[..cut]), None, "cut inside the header");
                return Ok(());
            };
            let (kept, loss) = read(&file[..cut]).unwrap();
            prop_assert_eq!(&kept[..], &chunks[..whole - 1]);
            prop_assert_eq!(loss, Loss { damaged_chunks: 0, tail_bytes: (cut - last_end) as u64 });
        }

        #[test]
        fn a_damaged_byte_of_data_costs_its_chunk_alone(chunks in any_chunks(), at in any::<prop::sample::Index>()) {
            prop_assume!(!chunks.is_empty());
            let (mut file, ends) = written(&chunks);
            let victim = at.index(chunks.len());
            file[ends[victim + 1] - 5] ^= 0x40; // The last byte before the checksum.
            let (kept, loss) = read(&file).unwrap();
            let mut expected = chunks;
            expected.remove(victim);
            prop_assert_eq!(kept, expected);
            prop_assert_eq!(loss.damaged_chunks, 1);
        }

        #[test]
        fn any_bytes_are_read_without_panic(tail in prop::collection::vec(any::<u8>(), 0..2000)) {
            prop_assert!(read(&tail).is_none());
            let mut file = written(&Vec::new()).0;
            file.extend(&tail);
            let (chunks, _) = read(&file).unwrap();
            prop_assert!(chunks.iter().map(|chunk| chunk.1.len()).sum::<usize>() <= tail.len());
        }
    }
}
