//! Recordings of several boards in a folder, cut and joined as one.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, ensure};
use tactomo::board::record::{RecordReader, edit};
use tactomo::new_file::NewFileError;

use crate::commands::live::body::FORMAT;

/// What a recording's file ends in.
pub const EXTENSION: &str = "tactomo";
/// The file in a folder of recordings by which `live --body` shows them together.
pub const BODY: &str = "body.toml";
/// What that file was called before.
const BODY_BEFORE: &str = "skin.toml";

/// The file in a folder by which its recordings are shown together, whether it is there or not.
pub fn body(folder: &Path) -> PathBuf {
    let [body, before] = [BODY, BODY_BEFORE].map(|name| folder.join(name));
    let is_there = |path: &Path| path.symlink_metadata().is_ok();
    if is_there(&before) && !is_there(&body) { before } else { body }
}

/// The files that are meant: of folders, the recordings in them.
pub fn files(paths: &[PathBuf]) -> anyhow::Result<Vec<PathBuf>> {
    let each = paths.iter().map(|path| if path.is_dir() { recordings(path) } else { Ok(vec![path.clone()]) });
    Ok(each.collect::<anyhow::Result<Vec<_>>>()?.concat())
}

/// The recordings in a folder, by name.
///
/// # Errors
/// If it cannot be read, or has none.
pub fn recordings(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    let paths = entries.map(|entry| Ok(entry.with_context(|| format!("cannot read {}", folder.display()))?.path()));
    let mut files: Vec<_> = paths.collect::<anyhow::Result<_>>()?;
    files.retain(|file| file.extension().is_some_and(|extension| extension == EXTENSION));
    files.sort();
    ensure!(!files.is_empty(), "{} has no recordings", folder.display());
    for file in &files {
        check_own(file).with_context(|| format!("cannot read {}", file.display()))?;
    }
    Ok(files)
}

/// Checks that something in a folder is a file of its own: a link could have anything read, and a pipe be waited for.
pub fn check_own(path: &Path) -> io::Result<()> {
    let kind = path.symlink_metadata()?.file_type();
    let refused = |what| Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    match kind.is_symlink() {
        true => refused("it is a link, and only files of the folder itself are read: copy it there"),
        false if !kind.is_file() => refused("it is no regular file"),
        false => Ok(()),
    }
}

/// What the detector of a recording in a folder is called: as its file, without what that ends in.
pub fn name(file: &Path) -> String {
    file.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Cuts the same piece out of all recordings of a folder: times count from the start of the first that began. Returns the new ones.
pub fn cut(folder: &Path, from_s: f64, to_s: f64, out: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let files = recordings(folder)?;
    let starts = files.iter().map(|file| Ok(RecordReader::open(file)?.header().started()));
    let starts: Vec<Duration> = starts.collect::<anyhow::Result<_>>()?;
    let first = starts.iter().min().copied().unwrap_or_default();
    begin(folder, out)?;
    let pieces = files.iter().zip(starts).map(|(file, start)| {
        let later_s = (start - first).as_secs_f64();
        let to = out.join(file.file_name().unwrap_or_default());
        edit::cut(file, from_s - later_s..=to_s - later_s, &to)?;
        Ok(to)
    });
    pieces.collect()
}

/// Joins the recordings of folders, each with those of its name. Returns the new ones.
pub fn merge(folders: &[PathBuf], out: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let all = folders.iter().map(|folder| recordings(folder)).collect::<anyhow::Result<Vec<_>>>()?;
    let names =
        |files: &[PathBuf]| files.iter().filter_map(|file| Some(file.file_name()?.to_owned())).collect::<Vec<_>>();
    let Some(first) = folders.first().zip(all.first()) else { return Ok(Vec::new()) };
    for (folder, files) in folders.iter().zip(&all) {
        let is_same = names(files) == names(first.1);
        ensure!(is_same, "{} has recordings of other names than {}", folder.display(), first.0.display());
    }
    begin(first.0, out)?;
    let joined = names(first.1).into_iter().map(|name| {
        let (parts, to) = (folders.iter().map(|folder| folder.join(&name)).collect::<Vec<_>>(), out.join(&name));
        edit::merge(&parts, &to)?;
        Ok(to)
    });
    joined.collect()
}

/// Makes a new folder.
///
/// # Errors
/// As of a new file, if it is there already or cannot be made.
pub fn make(folder: &Path) -> Result<(), NewFileError> {
    fs::create_dir(folder).map_err(|source| NewFileError::of(folder, source))
}

/// Makes a folder for recordings that are shown together as those of `like` are.
fn begin(like: &Path, out: &Path) -> anyhow::Result<()> {
    let from = body(like);
    let read = || check_own(&from).and_then(|()| FORMAT.read_text(&from));
    let text = match read() {
        Err(error) if error.kind() == io::ErrorKind::NotFound => None,
        read => Some(read.with_context(|| format!("cannot copy {}", from.display()))?),
    };
    make(out)?;
    if let Some(text) = text {
        let to = out.join(BODY);
        fs::write(&to, text).with_context(|| format!("cannot write {}", to.display()))?;
    }
    Ok(())
}
