//! Files that are written. There is one rule for all of them: a file that exists is never replaced.

use std::cell::RefCell;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use tactomo_table::file::Unfinished;

/// Why a file cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NewFileError {
    /// There is one of that name.
    #[error("{path} exists already, and no file is replaced: give another name, or remove it first")]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// There is a folder of that name.
    #[error("cannot write {path}: it is a folder; name a file in it")]
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// The folder that it is to be in is not there.
    #[error("cannot write {path}: there is no folder {folder}; make it first")]
    NoFolder {
        /// The file.
        path: PathBuf,
        /// The folder.
        folder: PathBuf,
    },
    /// The disk is full, or a quota is used up.
    #[error("cannot write {path}: the disk is full; make room on it, or write to another one")]
    Full {
        /// The file.
        path: PathBuf,
    },
    /// Whatever else the system says.
    #[error("cannot write {path}")]
    System {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
}

impl NewFileError {
    /// Why `path` cannot be written, as the system says it.
    pub fn of(path: &Path, source: io::Error) -> Self {
        let (folder, path) = (path.parent().unwrap_or(Path::new("")), path.to_owned());
        match source.kind() {
            ErrorKind::AlreadyExists => Self::Exists { path },
            ErrorKind::IsADirectory => Self::Folder { path },
            ErrorKind::NotFound if !folder.as_os_str().is_empty() => Self::NoFolder { folder: folder.to_owned(), path },
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Self::Full { path },
            _ => Self::System { path, source },
        }
    }
}

/// Makes a new file. A device or a pipe, which nothing is lost of, is opened as it is.
///
/// # Errors
/// [`NewFileError`] if there is a file of that name, or it cannot be made.
pub fn create(path: &Path) -> Result<File, NewFileError> {
    let made = match fs::metadata(path) {
        Ok(found) if found.is_dir() => return Err(NewFileError::Folder { path: path.to_owned() }),
        Ok(found) if !found.is_file() => OpenOptions::new().write(true).open(path),
        _ => File::create_new(path),
    };
    made.map_err(|source| NewFileError::of(path, source))
}

/// Has what was written to a file reach its disk; a device or a pipe has none.
///
/// # Errors
/// If that fails.
pub fn sync(file: &File) -> io::Result<()> {
    match file.sync_all() {
        Err(error) if error.kind() == ErrorKind::InvalidInput => Ok(()),
        synced => synced,
    }
}

/// A new file that has its name only once it is complete; nothing is left of one that is not.
#[derive(Debug)]
pub struct NewFile {
    path: PathBuf,
    /// Whether it is a device or a pipe, which is written to as it is.
    is_open: bool,
    /// Where it is written until it is complete.
    unfinished: RefCell<Option<Unfinished>>,
}

impl NewFile {
    /// Checks that a file can be written, before the work for it begins.
    ///
    /// # Errors
    /// [`NewFileError`] as of [`create`].
    pub fn new(path: &Path) -> Result<Self, NewFileError> {
        let own = path.to_owned();
        match fs::symlink_metadata(path).and_then(|_| fs::metadata(path)) {
            Ok(found) if found.is_dir() => Err(NewFileError::Folder { path: own }),
            Ok(found) if !found.is_file() => Ok(Self { path: own, is_open: true, unfinished: RefCell::default() }),
            // A link to nothing is something too.
            Err(_) if fs::symlink_metadata(path).is_err() => {
                let file = Self { path: own, is_open: false, unfinished: RefCell::default() };
                file.create()?;
                // Whoever is ended before there is anything to write leaves no empty file.
                file.unfinished.take();
                Ok(file)
            }
            _ => Err(NewFileError::Exists { path: own }),
        }
    }

    /// The same for a file that may be wanted.
    ///
    /// # Errors
    /// [`NewFileError`] as of [`create`].
    pub fn optional(path: Option<&PathBuf>) -> Result<Option<Self>, NewFileError> {
        path.map(|path| Self::new(path)).transpose()
    }

    /// Its name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Opens it for writing, once.
    ///
    /// # Errors
    /// [`NewFileError`] if that fails.
    pub fn create(&self) -> Result<BufWriter<File>, NewFileError> {
        if self.is_open {
            return create(&self.path).map(BufWriter::new);
        }
        let (unfinished, file) = Unfinished::beside(&self.path).map_err(|source| self.failed(source))?;
        self.unfinished.replace(Some(unfinished));
        Ok(BufWriter::new(file))
    }

    /// Why it cannot be written, as the system says it.
    pub fn failed(&self, source: io::Error) -> NewFileError {
        NewFileError::of(&self.path, source)
    }

    /// Gives it its name; it is complete. One that has come to exist meanwhile stays.
    ///
    /// # Errors
    /// [`NewFileError`] if that fails.
    pub fn finish(self) -> Result<(), NewFileError> {
        let named = self.unfinished.take().map(|unfinished| unfinished.name(&self.path, false));
        named.unwrap_or(Ok(())).map_err(|source| self.failed(source))
    }

    /// Writes all of it.
    ///
    /// # Errors
    /// [`NewFileError`] if that fails.
    pub fn write(self, content: impl AsRef<[u8]>) -> Result<(), NewFileError> {
        let mut out = self.create()?;
        out.write_all(content.as_ref()).and_then(|()| out.flush()).map_err(|source| self.failed(source))?;
        self.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder of its own, which is gone at the end.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("tactomo-{}-new-{name}", std::process::id()));
            fs::create_dir_all(&path).unwrap();
            Self(path)
        }

        fn names(&self) -> Vec<String> {
            let mut names: Vec<_> =
                fs::read_dir(&self.0).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
            names.sort();
            names
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            drop(fs::remove_dir_all(&self.0));
        }
    }

    #[test]
    fn what_exists_is_never_replaced() {
        let folder = Folder::new("kept");
        let (path, other) = (folder.0.join("a.csv"), folder.0.join("a.csv.unfinished"));
        fs::write(&other, "another's").unwrap();
        let late = NewFile::new(&path).unwrap();
        NewFile::new(&path).unwrap().write("one").unwrap();
        for refused in [NewFile::new(&path).unwrap_err(), create(&path).unwrap_err(), late.write("two").unwrap_err()] {
            assert!(matches!(refused, NewFileError::Exists { .. }), "{refused}");
        }
        assert_eq!([&path, &other].map(|path| fs::read_to_string(path).unwrap()), ["one", "another's"]);
        assert_eq!(folder.names(), ["a.csv", "a.csv.unfinished"]);
    }

    #[cfg(unix)]
    #[test]
    fn nothing_is_written_through_a_link() {
        let folder = Folder::new("link");
        let (link, target) = (folder.0.join("a.csv"), folder.0.join("target"));
        std::os::unix::fs::symlink(&target, &link).unwrap();
        for refused in [NewFile::new(&link).unwrap_err(), create(&link).unwrap_err()] {
            assert!(matches!(refused, NewFileError::Exists { .. }), "{refused}");
        }
        assert_eq!(folder.names(), ["a.csv"]);
    }

    #[test]
    fn nothing_is_left_of_what_was_not_completed() {
        let folder = Folder::new("broken");
        let file = NewFile::new(&folder.0.join("a.csv")).unwrap();
        assert!(folder.names().is_empty());
        file.create().unwrap().write_all(b"half").unwrap();
        assert_eq!(folder.names(), ["a.csv.unfinished"]);
        drop(file);
        assert!(folder.names().is_empty());
    }

    #[test]
    fn why_there_is_no_file_says_what_to_do() {
        let folder = Folder::new("told");
        let inside = folder.0.join("none/a.csv");
        for (path, told) in [(&folder.0, "it is a folder; name a file in it"), (&inside, "none; make it first")] {
            for refused in [NewFile::new(path).unwrap_err(), create(path).unwrap_err()] {
                assert!(refused.to_string().contains(told), "{refused}");
            }
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_is_written_to_and_a_full_one_is_told() {
        NewFile::new(Path::new("/dev/null")).unwrap().write("gone").unwrap();
        let full = NewFile::new(Path::new("/dev/full")).unwrap().write("much").unwrap_err();
        assert_eq!(
            full.to_string(),
            "cannot write /dev/full: the disk is full; make room on it, or write to another one"
        );
        assert!(!Path::new("/dev/full").is_file() && !Path::new("/dev/null").is_file());
    }
}
