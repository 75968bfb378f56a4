//! Machine output and tables, on stdout.

use std::io::{self, ErrorKind, Write};

/// Prints a line or lines. A reader that has seen enough and closed the pipe, as `head` does, is no error.
pub fn print(text: &str) -> io::Result<()> {
    match writeln!(io::stdout(), "{text}") {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}

/// The command that runs now, as one would type it: for reports.
pub fn command_line() -> String {
    let quoted = |word: String| if word.contains(char::is_whitespace) { format!("'{word}'") } else { word };
    let arguments = std::env::args_os().skip(1).map(|word| quoted(word.to_string_lossy().into_owned()));
    std::iter::once("tactomo".to_owned()).chain(arguments).collect::<Vec<_>>().join(" ")
}
