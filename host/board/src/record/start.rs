//! The start of a recording: what is before it, its magic, its version and its headers.

use std::io::{self, Read};

use super::format::{self, Chunk, Kind, MAX_HEADER, MAX_OVERHEAD, Parsed};
use super::scan::{find_whole, parse};
use super::window::Window;
use super::{Header, HeaderDamage, MAGIC, VERSION};

/// Bytes before the first header: magic and version.
const START: usize = MAGIC.len() + 1;
/// Most bytes before the magic that are none of the recording: some lines of a log, or of a mail that it came in.
pub(super) const MOST_JUNK: usize = 64 << 10;

/// What the start of a file says.
pub(super) struct Opened {
    pub header: Header,
    pub damage: HeaderDamage,
    /// Bytes before the magic.
    pub junk_bytes: u64,
}

/// Why a file is not opened.
pub(super) enum Refused {
    NotARecording,
    /// Of another version.
    Version(u8),
    Io(io::Error),
}

impl From<io::Error> for Refused {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

/// Where in the first bytes of a file a recording begins: one damaged byte of the magic does not make another file of it, nor do some
/// bytes before it.
pub(super) fn find_magic(start: &[u8]) -> Option<usize> {
    let is_nearly = start.len() >= MAGIC.len()
        && start.iter().zip(&MAGIC).filter(|(ours, theirs)| ours == theirs).count() >= MAGIC.len() - 1;
    if is_nearly {
        return Some(0);
    }
    start.windows(MAGIC.len()).take(MOST_JUNK + 1).position(|window| window == MAGIC)
}

impl Opened {
    /// Reads everything before the first chunk of data.
    pub(super) fn new<R: Read>(window: &mut Window<R>) -> Result<Self, Refused> {
        let start = window.ahead(MOST_JUNK + START)?;
        let at = find_magic(start).ok_or(Refused::NotARecording)?;
        let found = *start.get(at + START - 1).ok_or(Refused::NotARecording)?;
        let is_whole = start[at..].starts_with(&MAGIC);
        window.skip(at + START);
        let opened = Self::read(window, found)?.ok_or(match found {
            VERSION => Refused::NotARecording,
            found => Refused::Version(found),
        })?;
        let damage = if is_whole { opened.damage } else { opened.damage.max(HeaderDamage::Repaired) };
        Ok(Self { damage, junk_bytes: at as u64, ..opened })
    }

    /// Reads the headers behind the byte `found`, which should be the version, and goes on to the first chunk; `None` if there is
    /// neither a header nor a chunk, or this is another version.
    fn read<R: Read>(window: &mut Window<R>, found: u8) -> io::Result<Option<Self>> {
        let is_ours = found == VERSION;
        if let Some((header, damage)) = two_headers(window)? {
            let damage = if is_ours { damage } else { damage.max(HeaderDamage::Repaired) };
            return Ok(Some(Self { header, damage, junk_bytes: 0 }));
        }
        if !is_ours || find_whole(window)?.is_none() {
            return Ok(None);
        }
        Ok(Some(Self { header: Header::default(), damage: HeaderDamage::Lost, junk_bytes: 0 }))
    }
}

/// The two headers, of which one may be damaged; goes on behind them. `None` if both are, or it is another version.
fn two_headers<R: Read>(window: &mut Window<R>) -> io::Result<Option<(Header, HeaderDamage)>> {
    let first = parse(window)?;
    if let Parsed::Whole(chunk) = &first {
        let Some(header) = header_in(window, chunk) else { return Ok(None) };
        window.skip(chunk.length);
        return Ok(Some((header, skip_copy(window, chunk.length)?)));
    }
    // The second one is as long as the first, so it is not far if it is there.
    let begin = window.ahead(2 * (MAX_HEADER + MAX_OVERHEAD))?;
    let mut at = 0;
    while at < begin.len() {
        at += format::skip(&begin[at..]);
        match format::parse(begin.get(at..).unwrap_or_default()) {
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
    match parse(window)? {
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
