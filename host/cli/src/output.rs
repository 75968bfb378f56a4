//! What the program prints, and the files that it writes.
//!
//! Machine output and tables go to stdout, messages to stderr. Whoever reads them may have seen enough and close the pipe, as `head`
//! does: that is no error, and nothing here panics of it.

use std::borrow::Cow;
use std::fmt::Arguments;
use std::io::{self, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub use tactomo_physics::new_file::NewFile;

/// Prints a message on stderr, as `eprintln!` does, but without a panic where stderr is closed.
#[macro_export]
macro_rules! message {
    ($($text:tt)*) => { $crate::output::print_message(format_args!($($text)*)) };
}
pub use crate::message;

/// Longest line of a message (characters), a few lines of a terminal. A longer one quotes what somebody wrote, and its middle is left out.
const LONGEST_LINE: usize = 500;

/// Prints a line or lines on stderr. Where stderr is closed, nobody reads it.
pub fn print_message(text: Arguments) {
    drop(writeln!(io::stderr(), "{}", message_of(&text.to_string())));
}

/// Prints a line or lines on stdout.
pub fn print(text: &str) -> io::Result<()> {
    unless_closed(writeln!(io::stdout(), "{}", harmless(text))).map(drop)
}

/// A text that a terminal shows as it is: files, boards and the wire have a say in it. What a terminal would obey, and what turns the order of
/// letters, is written out, as JSON writes it.
pub fn harmless(text: &str) -> Cow<'_, str> {
    let is_obeyed = |c: char| {
        (c.is_control() && !matches!(c, '\n' | '\t')) || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !text.contains(is_obeyed) {
        return Cow::Borrowed(text);
    }
    let written = |c: char| if is_obeyed(c) { format!("\\u{:04x}", u32::from(c)) } else { c.into() };
    Cow::Owned(text.chars().map(written).collect())
}

/// A message as it is printed: [`harmless`], and without the middle of lines that are too long to be read.
pub(crate) fn message_of(text: &str) -> String {
    let cut = |line: &str| {
        let length = line.chars().count();
        if length <= LONGEST_LINE {
            return line.to_owned();
        }
        let (first, last) = (LONGEST_LINE * 2 / 3, LONGEST_LINE / 3);
        let (begin, end): (String, String) =
            (line.chars().take(first).collect(), line.chars().skip(length - last).collect());
        format!("{begin} [... {} characters ...] {end}", length - first - last)
    };
    harmless(text).split('\n').map(cut).collect::<Vec<_>>().join("\n")
}

/// Whether anybody still reads what was written.
pub fn unless_closed(written: io::Result<()>) -> io::Result<bool> {
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        written => written.map(|()| true),
    }
}

/// Stderr for the log, which must not fail: a log that cannot be written is reported on stderr by a panic.
pub struct Stderr;

impl Write for Stderr {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        drop(io::stderr().write_all(bytes));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// How often it is told how far something is, where that is not a terminal.
const TOLD_EVERY: Duration = Duration::from_secs(5);
/// How often a terminal's bar is drawn.
const DRAWN_EVERY: Duration = Duration::from_millis(100);
/// Width of the bar.
const BAR: usize = 30;

/// How far something is and how long it will take, on stderr: a bar in a terminal, a line now and then elsewhere.
pub struct ProgressBar {
    what: &'static str,
    all: u64,
    begun: Instant,
    told: Instant,
    is_terminal: bool,
}

impl ProgressBar {
    /// Of so many things of a kind.
    pub fn new(what: &'static str, all: u64) -> Self {
        let now = Instant::now();
        Self { what, all, begun: now, told: now, is_terminal: io::stderr().is_terminal() }
    }

    /// Tells that so many are done, if that is due.
    pub fn tell(&mut self, done: u64) {
        if self.told.elapsed() < if self.is_terminal { DRAWN_EVERY } else { TOLD_EVERY } {
            return;
        }
        self.told = Instant::now();
        let line = bar(self.what, done, self.all, self.begun.elapsed());
        if self.is_terminal {
            drop(write!(io::stderr(), "\r\x1b[2K{line}"));
        } else {
            message!("{line}");
        }
    }

    /// Takes the bar away.
    pub fn end(self) {
        if self.is_terminal {
            drop(write!(io::stderr(), "\r\x1b[2K"));
        }
    }
}

fn bar(what: &str, done: u64, all: u64, elapsed: Duration) -> String {
    let share = done as f64 / all.max(1) as f64;
    let filled = ((share.min(1.0) * BAR as f64) as usize).min(BAR);
    let left = elapsed.mul_f64(all.saturating_sub(done) as f64 / done.max(1) as f64);
    let (full, empty) = ("#".repeat(filled), "-".repeat(BAR - filled));
    format!("[{full}{empty}] {done} of {all} {what}, about {:.0} s left", left.as_secs_f64().ceil())
}

/// The command that runs now, as one would type it: for reports.
pub fn command_line() -> String {
    let quoted = |word: String| if word.contains(char::is_whitespace) { format!("'{word}'") } else { word };
    let arguments = std::env::args_os().skip(1).map(|word| quoted(word.to_string_lossy().into_owned()));
    let program = std::env::args_os().next().map(PathBuf::from);
    let program = program.as_deref().and_then(Path::file_stem).unwrap_or_default().to_string_lossy().into_owned();
    std::iter::once(program).chain(arguments).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_written_out_and_all_else_stays() {
        assert_eq!(harmless("a\tb\n\u{e9} \u{20ac}"), "a\tb\n\u{e9} \u{20ac}");
        assert_eq!(harmless("\x1b[2J\r\u{7}\u{9b}1m\u{202e}\u{7f}"), r"\u001b[2J\u000d\u0007\u009b1m\u202e\u007f");
    }

    #[test]
    fn a_message_leaves_out_the_middle_of_what_it_quotes() {
        let told =
            message_of(&format!("line 1: {}: a number is needed\n{}\nshort", "x".repeat(3 << 20), " ".repeat(3 << 20)));
        assert!(told.len() < 3 * LONGEST_LINE, "{}", told.len());
        assert!(
            told.starts_with("line 1: xxx") && told.contains("xxx: a number is needed\n") && told.ends_with("\nshort")
        );
        assert!(told.contains("[... 3145257 characters ...]"), "{told}");
    }

    #[test]
    fn a_bar_says_how_long_it_will_take() {
        let line = bar("frames", 250, 1000, Duration::from_secs(4));
        assert_eq!(line, "[#######-----------------------] 250 of 1000 frames, about 12 s left");
        assert!(bar("frames", 1003, 1000, Duration::from_secs(4)).starts_with(&format!("[{}] 1003", "#".repeat(30))));
    }
}
