//! Files that a person or another file names: read within bounds, and written without harm to any that is there.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Names that are tried for a file under way, before somebody has to tidy up.
const MOST_NAMES: u32 = 1000;

/// A format whose files are read whole.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// What a file of it is called, such as `a list of foams`.
    name: &'static str,
    /// Longest file that is read (bytes).
    longest: u64,
}

impl Format {
    /// A format with such a name, of whose files none is longer (bytes).
    pub const fn new(name: &'static str, longest: u64) -> Self {
        Self { name, longest }
    }

    /// All bytes of a file, which may be a pipe.
    ///
    /// # Errors
    /// What the system says; [`ErrorKind::FileTooLarge`] beyond the format's limit.
    pub fn read(self, path: &Path) -> io::Result<Vec<u8>> {
        self.read_from(File::open(path)?)
    }

    /// The text of a file, which may be a pipe.
    ///
    /// # Errors
    /// Those of [`read`](Self::read), and [`ErrorKind::InvalidData`] for what is no text.
    pub fn read_text(self, path: &Path) -> io::Result<String> {
        self.text(self.read(path)?)
    }

    /// All bytes of what is open, or what a file is unpacked to.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn read_from(self, input: impl Read) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        input.take(self.longest + 1).read_to_end(&mut bytes)?;
        if bytes.len() as u64 > self.longest {
            let long = format!("it is longer than {}, and {} never is", size(self.longest), self.name);
            return Err(io::Error::new(ErrorKind::FileTooLarge, long));
        }
        Ok(bytes)
    }

    /// Bytes as text.
    ///
    /// # Errors
    /// [`ErrorKind::InvalidData`] if they are none.
    pub fn text(self, bytes: Vec<u8>) -> io::Result<String> {
        let none = |_| io::Error::new(ErrorKind::InvalidData, format!("it is no text (UTF-8), and {} is", self.name));
        String::from_utf8(bytes).map_err(none)
    }
}

/// A number of bytes for people.
fn size(bytes: u64) -> String {
    if bytes >= 1 << 20 { format!("{} MiB", bytes >> 20) } else { format!("{bytes} bytes") }
}

/// Checks the path of what is read piece by piece, or what another file names: a pipe would be waited for, and a device has no end.
///
/// # Errors
/// What the system says; [`ErrorKind::InvalidInput`] if it is no regular file, nor a link to one.
pub fn check_regular(path: &Path) -> io::Result<()> {
    let not_regular = || io::Error::new(ErrorKind::InvalidInput, "it is no regular file: copy what it gives into one");
    fs::metadata(path)?.is_file().then_some(()).ok_or_else(not_regular)
}

/// A file under way, beside the one that it is to be: removed unless it gets that name.
#[derive(Debug)]
pub struct Unfinished {
    /// `None` once it has its name.
    path: Option<PathBuf>,
}

impl Unfinished {
    /// A new file, open for writing, in the folder of `path`: `path` with `.unfinished`, or with a number behind that if that is taken.
    ///
    /// # Errors
    /// What the system says.
    pub fn beside(path: &Path) -> io::Result<(Self, File)> {
        let named = |number: u32| {
            let mut name = OsString::from(path);
            name.push(".unfinished");
            if number > 1 {
                name.push(format!("-{number}"));
            }
            PathBuf::from(name)
        };
        new_file((1..=MOST_NAMES).map(named)).map(|(path, file)| (Self { path: Some(path) }, file))
    }

    /// Gives it its name, in one step: whoever reads meanwhile, or after a loss of power, finds what was there, or all of this.
    ///
    /// # Errors
    /// What the system says; [`ErrorKind::AlreadyExists`] if there is something of that name which is not to be `replaced`.
    pub fn name(mut self, path: &Path, replaced: bool) -> io::Result<()> {
        let Some(unfinished) = &self.path else { return Ok(()) };
        if !replaced {
            match fs::hard_link(unfinished, path) {
                Ok(()) => return Ok(()),
                Err(error) if error.kind() == ErrorKind::AlreadyExists => return Err(error),
                // Some file systems have no links.
                Err(_) if path.symlink_metadata().is_ok() => return Err(ErrorKind::AlreadyExists.into()),
                Err(_) => {}
            }
        }
        fs::rename(unfinished, path)?;
        self.path = None;
        Ok(())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        self.path.iter().for_each(|path| drop(fs::remove_file(path)));
    }
}

/// Moves a file that cannot be used out of the way, to its name with `.unreadable`, or with a number behind that if that is taken; returns the name.
///
/// # Errors
/// What the system says.
pub fn set_aside(path: &Path) -> io::Result<PathBuf> {
    let named = |number: u32| {
        let mut name = OsString::from(path);
        name.push(if number == 1 { ".unreadable".to_owned() } else { format!(".unreadable-{number}") });
        PathBuf::from(name)
    };
    // What has the name while it is moved is ours, and empty.
    let (aside, _) = new_file((1..=MOST_NAMES).map(named))?;
    fs::rename(path, &aside).inspect_err(|_| drop(fs::remove_file(&aside)))?;
    Ok(aside)
}

/// The first of these names that nothing has, not even a link, as a new file.
fn new_file(names: impl Iterator<Item = PathBuf>) -> io::Result<(PathBuf, File)> {
    for path in names {
        match File::create_new(&path) {
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            file => return file.map(|file| (path, file)),
        }
    }
    Err(io::Error::new(ErrorKind::AlreadyExists, format!("{MOST_NAMES} files of such names are enough: remove some")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn folder(test: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("tactomo-{}-file-{test}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn what_is_longer_than_its_format_or_no_text_is_refused_by_the_formats_name() {
        let (folder, format) = (folder("bounds"), Format::new("a list of foams", 4));
        let path = folder.join("a");
        let read = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            format.read_text(&path).map_err(|error| error.to_string())
        };
        let [whole, long, bytes] = [&b"four"[..], b"fives", b"\xff"].map(read);
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!(whole, Ok("four".to_owned()));
        assert_eq!(long, Err("it is longer than 4 bytes, and a list of foams never is".to_owned()));
        assert!(bytes.is_err_and(|error| error.contains("no text")));
    }

    #[cfg(unix)]
    #[test]
    fn what_never_ends_ends_with_the_limit_and_is_no_regular_file() {
        let zeros = Path::new("/dev/zero");
        let error = Format::new("a list of foams", 1 << 20).read(zeros).unwrap_err();
        assert!(error.to_string().contains("1 MiB"), "{error}");
        assert_eq!(check_regular(zeros).unwrap_err().kind(), ErrorKind::InvalidInput);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_under_way_harms_none_that_is_there_nor_what_a_link_points_to() {
        let folder = folder("unfinished");
        let [path, foreign] = ["a.csv", "foreign"].map(|name| folder.join(name));
        fs::write(&foreign, "foreign").unwrap();
        std::os::unix::fs::symlink(&foreign, folder.join("a.csv.unfinished")).unwrap();
        let begun = |text: &str| {
            let (unfinished, mut file) = Unfinished::beside(&path).unwrap();
            file.write_all(text.as_bytes()).unwrap();
            unfinished
        };
        drop(begun("given up"));
        begun("one").name(&path, false).unwrap();
        let refused = begun("two").name(&path, false).unwrap_err();
        let first = fs::read_to_string(&path).unwrap();
        begun("three").name(&path, true).unwrap();
        let last = fs::read_to_string(&path).unwrap();
        let aside = [(); 2].map(|()| {
            fs::write(&path, "nonsense").unwrap();
            set_aside(&path).unwrap().file_name().unwrap().to_owned()
        });
        let kept = fs::read_to_string(&foreign).unwrap();
        let count = fs::read_dir(&folder).unwrap().count();
        fs::remove_dir_all(&folder).unwrap();
        assert_eq!((&*first, &*last, refused.kind()), ("one", "three", ErrorKind::AlreadyExists));
        assert_eq!((&*kept, count), ("foreign", 4), "the foreign file, the link, and two that were set aside");
        assert_eq!(aside, ["a.csv.unreadable", "a.csv.unreadable-2"]);
    }
}
