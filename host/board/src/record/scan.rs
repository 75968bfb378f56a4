//! Looks for chunks in a stretch of a file.

use std::io::{self, Read};

use super::format::{self, Chunk, MAX_OVERHEAD, Parsed};
use super::window::Window;

/// What is at the front of the window.
pub(super) fn parse<R: Read>(window: &mut Window<R>) -> io::Result<Parsed> {
    let mut wanted = MAX_OVERHEAD;
    loop {
        let bytes = window.ahead(wanted)?;
        match format::parse(bytes) {
            Parsed::Short(more) if bytes.len() >= wanted => wanted = more.max(wanted + 1),
            parsed => return Ok(parsed),
        }
    }
}

/// Whether a damaged chunk is so long as it claims: a chunk or the end of the file follows, and it swallows no whole one.
pub(super) fn is_one_chunk<R: Read>(window: &mut Window<R>, length: usize) -> io::Result<bool> {
    if !follows(window, length)? {
        return Ok(false);
    }
    let bytes = &window.held()[..length];
    let mut at = format::skip(bytes);
    while at < length {
        if matches!(format::parse(&bytes[at..]), Parsed::Whole(_)) {
            return Ok(false);
        }
        at += format::skip(&bytes[at..]);
    }
    Ok(true)
}

/// Whether a chunk, or the end of the file, follows `length` bytes ahead.
fn follows<R: Read>(window: &mut Window<R>, length: usize) -> io::Result<bool> {
    let mut wanted = length + MAX_OVERHEAD;
    loop {
        let bytes = window.ahead(wanted)?;
        let is_end = bytes.len() == length;
        match format::parse(bytes.get(length..).unwrap_or_default()) {
            Parsed::Short(more) if bytes.len() >= wanted => wanted = (length + more).max(wanted + 1),
            // A mark tells enough.
            Parsed::Damaged(_) => return Ok(true),
            parsed => return Ok(is_end || matches!(parsed, Parsed::Whole(_))),
        }
    }
}

/// Goes on to the next chunk whose checksum is right, this one included; `None` at the end of the file.
pub(super) fn find_whole<R: Read>(window: &mut Window<R>) -> io::Result<Option<Chunk>> {
    loop {
        match parse(window)? {
            Parsed::Whole(chunk) => return Ok(Some(chunk)),
            _ if window.ahead(1)?.is_empty() => return Ok(None),
            _ => {
                let skipped = format::skip(window.held());
                window.skip(skipped);
            }
        }
    }
}
