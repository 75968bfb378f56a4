//! The bytes of a file about where it is read.

use std::io::{self, Read, Seek, SeekFrom};

/// Bytes that are asked for at once.
const READ_AHEAD: usize = 64 * 1024;
/// Bytes behind that are kept before they are cleared away.
const KEPT_BEHIND: usize = 256 * 1024;

/// A stretch of a file, from where it is read on.
#[derive(Debug)]
pub(super) struct Window<R> {
    input: R,
    held: Vec<u8>,
    /// Bytes of `held` that are behind.
    behind: usize,
    /// Where in the file its first byte ahead is.
    offset: u64,
    ended: bool,
}

impl<R: Read> Window<R> {
    pub(super) fn new(input: R) -> Self {
        Self { input, held: Vec::new(), behind: 0, offset: 0, ended: false }
    }

    /// What is ahead: at least `count` bytes, or all up to the end of the file.
    pub(super) fn ahead(&mut self, count: usize) -> io::Result<&[u8]> {
        while self.held.len() - self.behind < count && !self.ended {
            let missing = count - (self.held.len() - self.behind);
            let wanted = missing.max(READ_AHEAD) as u64;
            self.ended = self.input.by_ref().take(wanted).read_to_end(&mut self.held)? == 0;
        }
        Ok(&self.held[self.behind..])
    }

    /// What is ahead and held already.
    pub(super) fn held(&self) -> &[u8] {
        &self.held[self.behind..]
    }

    /// Goes on by `count` bytes that were seen.
    pub(super) fn skip(&mut self, count: usize) {
        let count = count.min(self.held.len() - self.behind);
        self.behind += count;
        self.offset += count as u64;
        if self.behind > KEPT_BEHIND {
            self.held.drain(..self.behind);
            self.behind = 0;
            // A header may have been as long as 16 MiB.
            self.held.shrink_to(2 * KEPT_BEHIND);
        }
    }

    /// Where in the file the next byte is.
    pub(super) fn offset(&self) -> u64 {
        self.offset
    }
}

impl<R: Read + Seek> Window<R> {
    /// Goes to a place of the file.
    pub(super) fn go_to(&mut self, offset: u64) -> io::Result<()> {
        self.input.seek(SeekFrom::Start(offset))?;
        self.held.clear();
        (self.behind, self.offset, self.ended) = (0, offset, false);
        Ok(())
    }

    /// Length of the file; leaves the window somewhere.
    pub(super) fn file_length(&mut self) -> io::Result<u64> {
        let length = self.input.seek(SeekFrom::End(0))?;
        self.go_to(length)?;
        Ok(length)
    }
}
