//! Reads a recording, whatever has happened to it.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read, Seek};
use std::path::Path;

use super::format::{CRC, Chunk, Kind, MAX_CHUNK, MAX_HEADER, MAX_OVERHEAD, Parsed, Version};
use super::window::Window;
use super::{Header, HeaderDamage, Loss, RecordError, VERSION, is_recording};

/// Bytes before the first header: magic and version.
const START: usize = super::MAGIC.len() + 1;
/// Bytes at the end in which the last chunk is looked for first: four of the longest.
const LAST_BYTES: u64 = 4 * (MAX_CHUNK + MAX_OVERHEAD) as u64;

/// Reads a recording, chunk by chunk; its bytes are not trusted.
#[derive(Debug)]
pub struct RecordReader<R: Read> {
    window: Window<R>,
    version: Version,
    header: Header,
    loss: Loss,
    /// Where the first chunk of data is, or what is damaged before it.
    first: u64,
    /// Where damage ends that was counted: it is not counted again when it is read again.
    counted: BTreeSet<u64>,
    /// Time of the last chunk (us).
    time_us: u64,
}

impl RecordReader<File> {
    /// Opens a recording.
    ///
    /// # Errors
    /// [`RecordError`] if the file is not there, or no recording that this program reads.
    pub fn open(path: &Path) -> Result<Self, RecordError> {
        let file = File::open(path).map_err(|source| RecordError::Open { path: path.to_owned(), source })?;
        Self::new(file, path)
    }
}

impl<R: Read> RecordReader<R> {
    /// Reads the header of the recording in `input`, called `path` in errors.
    ///
    /// # Errors
    /// [`RecordError`] if it is no recording that this program reads.
    pub fn new(input: R, path: &Path) -> Result<Self, RecordError> {
        let open = |source| RecordError::Open { path: path.to_owned(), source };
        let not_a_recording = || RecordError::NotARecording { path: path.to_owned() };
        let mut window = Window::new(input);
        let start = window.ahead(START).map_err(open)?;
        let Some(&found) = start.get(START - 1).filter(|_| is_recording(start)) else { return Err(not_a_recording()) };
        let magic_is_whole = start.starts_with(&super::MAGIC);
        window.skip(START);
        let opened = Opened::read(&mut window, found).map_err(open)?;
        let Some(Opened { version, header, damage }) = opened else {
            return Err(match found {
                1 | VERSION => not_a_recording(),
                found => RecordError::Version { path: path.to_owned(), found },
            });
        };
        let header_damage = if magic_is_whole { damage } else { damage.max(HeaderDamage::Repaired) };
        let loss = Loss { header: header_damage, ..Loss::default() };
        let first = window.offset();
        Ok(Self { window, version, header, loss, first, counted: BTreeSet::new(), time_us: 0 })
    }

    /// What the recording says about itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// What is damaged, as far as it was read.
    pub fn loss(&self) -> Loss {
        self.loss
    }

    /// Puts the bytes of the next chunk in place of what `bytes` holds; returns the time at which they came (us), or `None`
    /// at the end. Bytes of a chunk in which only these are damaged come all the same.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn next_into(&mut self, bytes: &mut Vec<u8>) -> io::Result<Option<u64>> {
        loop {
            let begin = self.window.offset();
            let (chunk, is_whole) = match parse(&mut self.window, self.version)? {
                Parsed::Whole(chunk) => (chunk, true),
                Parsed::Damaged(chunk) if is_one_chunk(&mut self.window, self.version, chunk.length)? => {
                    self.count(begin + chunk.length as u64, |loss| loss.damaged_places += 1);
                    (chunk, false)
                }
                parsed => {
                    if !self.pass_damage(begin, matches!(parsed, Parsed::Short(_)))? {
                        return Ok(None);
                    }
                    continue;
                }
            };
            if chunk.kind == Kind::Data {
                bytes.clear();
                bytes.extend_from_slice(&self.window.held()[chunk.bytes.clone()]);
                // The time of a damaged chunk may be what is damaged.
                self.time_us = if is_whole { chunk.time_us } else { self.time_us };
            }
            self.window.skip(chunk.length);
            if chunk.kind == Kind::Data {
                return Ok(Some(self.time_us));
            }
        }
    }

    /// Goes on to the next whole chunk; whether there is one. `may_be_cut`: whether what is here would be the end of a file that was cut.
    fn pass_damage(&mut self, begin: u64, may_be_cut: bool) -> io::Result<bool> {
        if self.window.ahead(1)?.is_empty() {
            return Ok(false);
        }
        let found = find_whole(&mut self.window, self.version)?;
        let passed = self.window.offset() - begin;
        self.count(self.window.offset(), |loss| match found {
            None if may_be_cut => loss.tail_bytes += passed,
            _ => {
                loss.damaged_places += 1;
                loss.left_out_bytes += passed;
            }
        });
        Ok(found.is_some())
    }

    /// Counts damage that ends at `end`, unless it was counted before.
    fn count(&mut self, end: u64, add: impl FnOnce(&mut Loss)) {
        if self.counted.insert(end) {
            add(&mut self.loss);
        }
    }
}

impl<R: Read + Seek> RecordReader<R> {
    /// Time of the last whole chunk (us); `None` if there is none. Reads the end of the file only, and then goes on where it was.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn last_time_us(&mut self) -> io::Result<Option<u64>> {
        let here = self.window.offset();
        let length = self.window.file_length()?;
        let mut back = LAST_BYTES;
        let last = loop {
            let from = length.saturating_sub(back).max(self.first);
            let last = self.last_from(from)?;
            if last.is_some() || from == self.first {
                break last;
            }
            back *= 16;
        };
        self.window.go_to(here)?;
        Ok(last)
    }

    /// Time of the last whole chunk behind a place of the file.
    fn last_from(&mut self, from: u64) -> io::Result<Option<u64>> {
        let mut last = None;
        self.window.go_to(from)?;
        while let Some(chunk) = find_whole(&mut self.window, self.version)? {
            last = Some(chunk.time_us);
            self.window.skip(chunk.length);
        }
        Ok(last)
    }

    /// Goes on with the first chunk that came at `time_us` or later (us), found by halving the file: times never fall.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn seek(&mut self, time_us: u64) -> io::Result<()> {
        let (mut low, mut high) = (self.first, self.window.file_length()?);
        while high - low > LAST_BYTES {
            let middle = low + (high - low) / 2;
            self.window.go_to(middle)?;
            match find_whole(&mut self.window, self.version)? {
                Some(chunk) if chunk.time_us < time_us && self.window.offset() < high => low = self.window.offset(),
                _ => high = middle,
            }
        }
        self.window.go_to(low)?;
        self.time_us = time_us;
        while let Some(chunk) = find_whole(&mut self.window, self.version)? {
            if chunk.kind == Kind::Data && chunk.time_us >= time_us {
                break;
            }
            self.window.skip(chunk.length);
        }
        Ok(())
    }

    /// Goes on with the first chunk.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn rewind(&mut self) -> io::Result<()> {
        self.time_us = 0;
        self.window.go_to(self.first)
    }
}

/// What the start of a file says.
struct Opened {
    version: Version,
    header: Header,
    damage: HeaderDamage,
}

impl Opened {
    /// Reads the header behind a version, and goes on to the first chunk; `None` if this is no version that is known, or there is
    /// neither a header nor a chunk.
    fn read<R: Read>(window: &mut Window<R>, found: u8) -> io::Result<Option<Self>> {
        let version_damage = |right| if found == right { HeaderDamage::None } else { HeaderDamage::Repaired };
        if found != 1
            && let Some((header, damage)) = two_headers(window)?
        {
            let damage = damage.max(version_damage(VERSION));
            return Ok(Some(Self { version: Version::Two, header, damage }));
        }
        if let Some((header, length)) = one_header(window)? {
            window.skip(length);
            return Ok(Some(Self { version: Version::One, header, damage: version_damage(1) }));
        }
        let version = match found {
            1 => Version::One,
            VERSION => Version::Two,
            _ => return Ok(None),
        };
        let found = find_whole(window, version)?;
        Ok(found.map(|_| Self { version, header: Header::default(), damage: HeaderDamage::Lost }))
    }
}

/// The two headers of version 2, of which one may be damaged; goes on behind them. `None` if both are, or it is another version.
fn two_headers<R: Read>(window: &mut Window<R>) -> io::Result<Option<(Header, HeaderDamage)>> {
    let first = parse(window, Version::Two)?;
    if let Parsed::Whole(chunk) = &first {
        let Some(header) = header_in(window, chunk) else { return Ok(None) };
        window.skip(chunk.length);
        return Ok(Some((header, skip_copy(window, chunk.length)?)));
    }
    // The second one is as long as the first, so it is not far if it is there.
    let begin = window.ahead(2 * (MAX_HEADER + MAX_OVERHEAD))?;
    let mut at = 0;
    while at < begin.len() {
        at += Version::Two.skip(&begin[at..]);
        match Version::Two.parse(begin.get(at..).unwrap_or_default()) {
            Parsed::Whole(chunk) if chunk.kind == Kind::Header => {
                window.skip(at);
                let header = header_in(window, &chunk);
                window.skip(chunk.length);
                return Ok(header.map(|header| (header, HeaderDamage::Repaired)));
            }
            Parsed::Whole(_) => return Ok(None),
            _ => {}
        }
    }
    Ok(None)
}

/// Goes on behind the second header, which is as long as the first.
fn skip_copy<R: Read>(window: &mut Window<R>, length: usize) -> io::Result<HeaderDamage> {
    match parse(window, Version::Two)? {
        Parsed::Whole(chunk) if chunk.kind == Kind::Header => {
            window.skip(chunk.length);
            Ok(HeaderDamage::None)
        }
        Parsed::Whole(_) => Ok(HeaderDamage::Repaired),
        // A file that was cut in it has no chunk, and says so when it is read.
        _ if window.ahead(length)?.len() < length => Ok(HeaderDamage::None),
        _ => {
            window.skip(length);
            Ok(HeaderDamage::Repaired)
        }
    }
}

fn header_in<R: Read>(window: &Window<R>, chunk: &Chunk) -> Option<Header> {
    (chunk.kind == Kind::Header).then(|| serde_json::from_slice(&window.held()[chunk.bytes.clone()]).ok())?
}

/// The header of version 1 and its length in the file, if its checksum is right.
fn one_header<R: Read>(window: &mut Window<R>) -> io::Result<Option<(Header, usize)>> {
    let Some(&[low, high]) = window.ahead(2)?.first_chunk() else { return Ok(None) };
    let end = 2 + usize::from(u16::from_le_bytes([low, high]));
    let bytes = window.ahead(end + 4)?;
    let Some(crc) = bytes.get(end..end + 4) else { return Ok(None) };
    let mut digest = CRC.digest();
    digest.update(&[1]);
    digest.update(&bytes[..end]);
    let is_whole = digest.finalize().to_le_bytes() == crc;
    let header = if is_whole { serde_json::from_slice(&bytes[2..end]).ok() } else { None };
    Ok(header.map(|header| (header, end + 4)))
}

/// What is at the front of the window.
fn parse<R: Read>(window: &mut Window<R>, version: Version) -> io::Result<Parsed> {
    let mut wanted = MAX_OVERHEAD;
    loop {
        let bytes = window.ahead(wanted)?;
        match version.parse(bytes) {
            Parsed::Short(more) if bytes.len() >= wanted => wanted = more.max(wanted + 1),
            parsed => return Ok(parsed),
        }
    }
}

/// Whether a damaged chunk is so long as it claims: a chunk or the end of the file follows, and it swallows no whole one.
fn is_one_chunk<R: Read>(window: &mut Window<R>, version: Version, length: usize) -> io::Result<bool> {
    if !follows(window, version, length)? {
        return Ok(false);
    }
    let bytes = &window.held()[..length];
    let mut at = version.skip(bytes);
    while at < length {
        if matches!(version.parse(&bytes[at..]), Parsed::Whole(_)) {
            return Ok(false);
        }
        at += version.skip(&bytes[at..]);
    }
    Ok(true)
}

/// Whether a chunk, or the end of the file, follows `length` bytes ahead.
fn follows<R: Read>(window: &mut Window<R>, version: Version, length: usize) -> io::Result<bool> {
    let mut wanted = length + MAX_OVERHEAD;
    loop {
        let bytes = window.ahead(wanted)?;
        let is_end = bytes.len() == length;
        match version.parse(bytes.get(length..).unwrap_or_default()) {
            Parsed::Short(more) if bytes.len() >= wanted => wanted = (length + more).max(wanted + 1),
            // A mark tells enough.
            Parsed::Damaged(_) if version == Version::Two => return Ok(true),
            parsed => return Ok(is_end || matches!(parsed, Parsed::Whole(_))),
        }
    }
}

/// Goes on to the next chunk whose checksum is right, this one included; `None` at the end of the file.
fn find_whole<R: Read>(window: &mut Window<R>, version: Version) -> io::Result<Option<Chunk>> {
    loop {
        match parse(window, version)? {
            Parsed::Whole(chunk) => return Ok(Some(chunk)),
            _ if window.ahead(1)?.is_empty() => return Ok(None),
            _ => {
                let skipped = version.skip(window.held());
                window.skip(skipped);
            }
        }
    }
}
