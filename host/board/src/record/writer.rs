//! Writes a recording.

use std::io::{self, Write};

use tactomo_protocol::{BoardMessage, Hello, MAX_WIRE, encode_board};

use super::format::{Kind, MAX_CHUNK, MAX_HEADER, put_chunk};
use super::{Header, MAGIC, Note, VERSION};

/// Writes a recording.
///
/// ```
/// use tactomo_board::record::{Header, RecordReader, RecordWriter};
/// use tactomo_physics::detector::Detector;
///
/// let mut file = Vec::new();
/// let header = Header::now(&Detector::default(), "a board".to_owned());
/// RecordWriter::new(&mut file, &header)?.write(1500, b"bytes of the board")?;
///
/// let mut recording = RecordReader::new(&file[..], "memory".as_ref())?;
/// let mut bytes = Vec::new();
/// assert_eq!(recording.next_into(&mut bytes)?, Some(1500));
/// assert_eq!(bytes, b"bytes of the board");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct RecordWriter<W: Write> {
    pub(super) out: W,
    /// The chunk as it goes out, kept to be filled again.
    pub(super) chunk: Vec<u8>,
}

impl<W: Write> RecordWriter<W> {
    /// Begins a recording.
    ///
    /// # Errors
    /// If `out` takes no bytes, or the header is longer than 16 MiB.
    pub fn new(mut out: W, header: &Header) -> io::Result<Self> {
        let json = serde_json::to_vec(header)?;
        if json.len() > MAX_HEADER {
            let what = "the detector's surface has too many triangles for a recording: simplify its mesh";
            return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
        }
        let mut start = MAGIC.to_vec();
        start.push(VERSION);
        put_chunk(Kind::Header, 0, &json, &mut start);
        put_chunk(Kind::Header, 0, &json, &mut start);
        out.write_all(&start)?;
        Ok(Self { out, chunk: Vec::new() })
    }

    /// Adds bytes that came `time_us` after the start (us), not before those that are written already.
    ///
    /// # Errors
    /// If `out` takes no bytes.
    pub fn write(&mut self, time_us: u64, bytes: &[u8]) -> io::Result<()> {
        for bytes in bytes.chunks(MAX_CHUNK) {
            self.chunk.clear();
            put_chunk(Kind::Data, time_us, bytes, &mut self.chunk);
            self.out.write_all(&self.chunk)?;
        }
        Ok(())
    }

    /// Adds a note of `time_us` after the start (us), not before what is written already.
    ///
    /// # Errors
    /// If `out` takes no bytes, or the note is longer than 16 MiB.
    pub fn note(&mut self, time_us: u64, note: &Note) -> io::Result<()> {
        let json = serde_json::to_vec(note)?;
        if json.len() > MAX_HEADER {
            return Err(io::Error::new(io::ErrorKind::InvalidInput, "a note is too long for a recording"));
        }
        self.chunk.clear();
        put_chunk(Kind::Note, time_us, &json, &mut self.chunk);
        self.out.write_all(&self.chunk)
    }

    /// Adds what a board says of itself, at the start and twice, so that damage to one does not cost the meaning of all frames. Each begins with a zero:
    /// without, damage to the first one's last byte would join them.
    ///
    /// # Errors
    /// If `out` takes no bytes.
    pub fn hello(&mut self, hello: &Hello) -> io::Result<()> {
        let mut wire = [0; 1 + MAX_WIRE];
        let length = encode_board(&BoardMessage::Hello(hello.clone()), &mut wire[1..])
            .map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error))?;
        self.write(0, &wire[..=length])?;
        self.write(0, &wire[..=length])
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
