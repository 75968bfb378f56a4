//! What the program prints, and the files that it writes.
//!
//! Machine output and tables go to stdout, messages to stderr. Whoever reads them may have seen enough and close the pipe, as `head`
//! does: that is no error, and nothing here panics of it.

use std::cell::RefCell;
use std::fmt::Arguments;
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use tactomo_table::file::Unfinished;

/// Prints a message on stderr, as `eprintln!` does, but without a panic where stderr is closed.
#[macro_export]
macro_rules! message {
    ($($text:tt)*) => { $crate::output::print_message(format_args!($($text)*)) };
}
pub use crate::message;

/// Prints a line or lines on stderr. Where stderr is closed, nobody reads it.
pub fn print_message(text: Arguments) {
    drop(writeln!(io::stderr(), "{text}"));
}

/// Prints a line or lines on stdout.
pub fn print(text: &str) -> io::Result<()> {
    unless_closed(writeln!(io::stdout(), "{text}")).map(drop)
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

/// A file to write. It has its name only once it is complete, and replaces another one only if that is wanted.
#[derive(Debug)]
pub struct NewFile {
    path: PathBuf,
    /// Whether it is a device or a pipe, which is written to and not replaced.
    is_open: bool,
    /// Whether it replaces a file of its name.
    overwrite: bool,
    /// Where it is written until it is complete.
    unfinished: RefCell<Option<Unfinished>>,
}

impl NewFile {
    /// Checks that a file can be written, before the work for it begins. `overwrite` replaces one that exists.
    pub fn new(path: &Path, overwrite: bool) -> anyhow::Result<Self> {
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        if path.is_dir() {
            bail!("cannot write {}: it is a folder", path.display());
        }
        let is_open = path.exists() && !path.is_file();
        // A link that leads nowhere is there too.
        if path.symlink_metadata().is_ok() && !overwrite && !is_open {
            bail!("{} exists already: give another name, or --overwrite to replace it", path.display());
        }
        let file = Self { path, is_open, overwrite, unfinished: RefCell::default() };
        file.create()?;
        // Whoever is ended before there is anything to write leaves no empty file.
        file.unfinished.take();
        Ok(file)
    }

    /// The same for a file of a kind that never replaces another one.
    pub fn never_replacing(path: &Path) -> anyhow::Result<Self> {
        let is_there = path.symlink_metadata().is_ok();
        ensure!(!is_there, "{} exists already, and is not replaced: give another name", path.display());
        Self::new(path, false)
    }

    /// The same for a file that is made from `input`, which it must not replace.
    pub fn beside(input: &Path, path: &Path, overwrite: bool) -> anyhow::Result<Self> {
        let is_same = matches!((input.canonicalize(), path.canonicalize()), (Ok(one), Ok(other)) if one == other);
        ensure!(!is_same, "{} is the file that is read: give --out another name", path.display());
        Self::new(path, overwrite)
    }

    /// The same for a file that may be wanted.
    pub fn optional(path: Option<&PathBuf>, overwrite: bool) -> anyhow::Result<Option<Self>> {
        path.map(|path| Self::new(path, overwrite)).transpose()
    }

    /// Opens it for writing, from its beginning.
    pub fn create(&self) -> anyhow::Result<BufWriter<File>> {
        let begun = match self.is_open {
            true => File::options().write(true).open(&self.path),
            false => Unfinished::beside(&self.path).map(|(unfinished, file)| {
                self.unfinished.replace(Some(unfinished));
                file
            }),
        };
        Ok(BufWriter::new(begun.with_context(|| format!("cannot write {}", self.path.display()))?))
    }

    /// Gives it its name; it is complete.
    pub fn finish(self) -> anyhow::Result<()> {
        let named = self.unfinished.take().map(|unfinished| unfinished.name(&self.path, self.overwrite));
        named.unwrap_or(Ok(())).with_context(|| format!("cannot write {}", self.path.display()))
    }

    /// Writes all of it.
    pub fn write(self, content: impl AsRef<[u8]>) -> anyhow::Result<()> {
        let mut out = self.create()?;
        out.write_all(content.as_ref())
            .and_then(|()| out.flush())
            .with_context(|| format!("cannot write {}", self.path.display()))?;
        self.finish()
    }
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

    fn path(name: &str) -> PathBuf {
        std::env::temp_dir().join(format!("tactomo-{}-output-{name}", std::process::id()))
    }

    #[test]
    fn a_bar_says_how_long_it_will_take() {
        let line = bar("frames", 250, 1000, Duration::from_secs(4));
        assert_eq!(line, "[#######-----------------------] 250 of 1000 frames, about 12 s left");
        assert!(bar("frames", 1003, 1000, Duration::from_secs(4)).starts_with(&format!("[{}] 1003", "#".repeat(30))));
    }

    #[test]
    fn a_file_is_replaced_only_if_that_is_wanted() -> anyhow::Result<()> {
        let path = path("kept");
        NewFile::new(&path, false)?.write("one")?;
        let refused = NewFile::new(&path, false).map_or_else(|error| error.to_string(), |_| String::new());
        assert!(refused.contains("exists already") && refused.contains("--overwrite"), "{refused}");
        assert_eq!(std::fs::read_to_string(&path)?, "one");
        NewFile::new(&path, true)?.write("two")?;
        assert_eq!(std::fs::read_to_string(&path)?, "two");
        Ok(std::fs::remove_file(&path)?)
    }

    #[test]
    fn a_file_that_is_not_completed_leaves_the_one_before_and_nothing_else() -> anyhow::Result<()> {
        let path = path("broken");
        let foreign = path.with_extension("unfinished");
        std::fs::write(&path, "whole")?;
        std::fs::write(&foreign, "another's")?;
        let file = NewFile::new(&path, true)?;
        file.create()?.write_all(b"half")?;
        let ours = path.with_extension("unfinished-2");
        assert!(ours.exists());
        drop(file);
        assert!(!ours.exists());
        assert_eq!(std::fs::read_to_string(&path)?, "whole");
        assert_eq!(std::fs::read_to_string(&foreign)?, "another's");
        [path, foreign].iter().try_for_each(|path| Ok(std::fs::remove_file(path)?))
    }

    #[test]
    fn a_file_that_came_meanwhile_stays() -> anyhow::Result<()> {
        let path = path("meanwhile");
        let file = NewFile::new(&path, false)?;
        std::fs::write(&path, "another's")?;
        assert!(file.write("ours").is_err());
        assert_eq!(std::fs::read_to_string(&path)?, "another's");
        Ok(std::fs::remove_file(&path)?)
    }

    #[test]
    fn folders_and_missing_folders_are_refused_at_once() {
        let refused = |path: &Path| NewFile::new(path, true).map_or_else(|error| error.to_string(), |_| String::new());
        assert!(refused(&std::env::temp_dir()).contains("is a folder"));
        assert!(refused(Path::new("no/such/folder/a.csv")).contains("cannot write no/such/folder/a.csv"));
    }

    #[test]
    fn a_device_is_written_to_and_stays_one() -> anyhow::Result<()> {
        NewFile::new(Path::new("/dev/null"), false)?.write("gone")?;
        assert!(!Path::new("/dev/null").is_file());
        Ok(())
    }
}
