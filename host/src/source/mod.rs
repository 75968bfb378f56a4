//! Where bytes come from: a serial port, the simulated board, a recording.

use std::io;

/// A byte link to a board, in both directions.
pub trait Link: Send {
    /// What a person calls it, such as `/dev/ttyUSB0` or `simulated board`.
    fn name(&self) -> String;

    /// Reads what has come into `buffer`, waiting at most about 50 ms for it; 0 if nothing came.
    ///
    /// # Errors
    /// If the link is gone: the board was unplugged, the recording ended ([`io::ErrorKind::UnexpectedEof`]).
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize>;

    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// If the link is gone or does not take bytes in time.
    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()>;
}
