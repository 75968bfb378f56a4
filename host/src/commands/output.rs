//! Machine output and tables, on stdout.

use std::io::{self, ErrorKind, Write};

/// Prints a line or lines. A reader that has seen enough and closed the pipe, as `head` does, is no error.
pub fn print(text: &str) -> io::Result<()> {
    match writeln!(io::stdout(), "{text}") {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}
