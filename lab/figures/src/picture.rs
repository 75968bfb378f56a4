//! Pictures of the documents: charts of reports, and the live page in a browser, still or as a film.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use crc::{CRC_64_XZ, Crc};

use crate::job::Tools;
use crate::store::{Pictured, Place, Store};

const CHECKSUM: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);

/// A picture.
#[derive(Clone, Copy, Debug)]
pub struct Picture {
    /// Its file, from the repository's root.
    pub file: &'static str,
    /// How it is made.
    pub how: How,
    /// Width and height (CSS pixels).
    pub size: [u32; 2],
    /// Files and folders, from the repository's root, whose change makes it old, in groups.
    pub sources: &'static [&'static [&'static str]],
}

/// How a picture is made.
#[derive(Clone, Copy, Debug)]
pub enum How {
    /// From the page that a run writes with this option. What the run's figures are is a part of what it shows.
    Chart {
        /// The run.
        job: &'static str,
        /// The option that takes the page's file.
        option: &'static str,
    },
    /// The live page of a simulated board, once it tells what is wanted.
    Live(Live),
    /// A film of the live page of a simulated board.
    Film(Film),
    /// By an example of the package `tactomo`, which writes the file that it is given.
    Drawn {
        /// The example.
        example: &'static str,
    },
}

/// A state of the live page.
#[derive(Clone, Copy, Debug)]
pub struct Live {
    /// Arguments of `tactomo live`.
    pub args: &'static str,
    /// `light` or `dark`.
    pub theme: &'static str,
    /// How many contacts it tells.
    pub contacts: usize,
    /// What its headline has to say.
    pub headline: &'static str,
}

impl Live {
    /// What is wanted, in words.
    pub fn wanted(&self) -> String {
        match self.contacts {
            0 => format!("\"{}\"", self.headline),
            contacts => format!("\"{}\" and {contacts} in the table", self.headline),
        }
    }
}

/// A film of the live page. It begins when the page tells what is wanted, for what opens it is its first picture.
#[derive(Clone, Copy, Debug)]
pub struct Film {
    /// What it begins with.
    pub live: Live,
    /// How long it is (s): once round what the scene does, so that it goes on where it ends.
    pub seconds: f64,
    /// Its pixels for each of the page's.
    pub scale: f64,
}

/// What the live page is drawn by.
const PAGE: &[&str] = &[
    "host/src/sink/page/web",
    "host/src/sink/page/update.rs",
    "host/src/sink/page/wire.rs",
    "host/src/sink/page/messages.rs",
];
/// What films of the demonstrations are made by beside the page.
const FILMS: &[&str] = &[
    "host/physics/src/scene/demonstration.rs",
    "host/physics/src/scene/hand.rs",
    "lab/figures/src/film.rs",
    "lab/figures/src/palette.rs",
];
/// What charts are drawn by.
const CHARTS: &[&str] = &["lab/study/src/view", "lab/study/src/tradeoff/view"];

const fn live(
    file: &'static str,
    args: &'static str,
    theme: &'static str,
    contacts: usize,
    headline: &'static str,
) -> Picture {
    Picture { file, how: How::Live(Live { args, theme, contacts, headline }), size: [1400, 860], sources: &[PAGE] }
}

const fn film(
    file: &'static str,
    args: &'static str,
    contacts: usize,
    headline: &'static str,
    seconds: f64,
) -> Picture {
    let live = Live { args, theme: "light", contacts, headline };
    Picture { file, how: How::Film(Film { live, seconds, scale: 0.75 }), size: [1120, 720], sources: &[PAGE, FILMS] }
}

/// All pictures.
pub const PICTURES: &[Picture] = &[
    live("docs/live.png", "--scene several", "light", 3, "3 contacts"),
    live("docs/live-dark.png", "--scene several", "dark", 3, "3 contacts"),
    film("docs/demo-gripper.png", "--scene gripper", 0, "Line", 6.0),
    film("docs/demo-display.png", "--scene display", 2, "2 contacts", 8.0),
    film("docs/demo-pointer.png", "--scene pointer", 1, "1 contact", 7.6),
    film("docs/demo-texture.png", "--scene texture", 2, "2 contacts", 3.0),
    film("docs/demo-hand.png", "--scene hand", 6, "6 contacts", 6.0),
    Picture {
        file: "docs/tradeoff.png",
        how: How::Chart { job: "tradeoff", option: "--picture" },
        size: [1320, 880],
        sources: &[CHARTS],
    },
    Picture {
        file: "docs/scan.png",
        how: How::Chart { job: "scan", option: "--picture" },
        size: [1300, 926],
        sources: &[&["lab/study/src/view", "lab/study/src/scanning/view.rs"]],
    },
    Picture {
        file: "docs/design-materials.png",
        how: How::Chart { job: "materials", option: "--out" },
        size: [1300, 930],
        sources: &[&["lab/study/src/view", "lab/design/src/materials/view.rs", "lab/design/src/claim.rs"]],
    },
    Picture {
        file: "docs/cost.svg",
        how: How::Drawn { example: "cost" },
        size: [960, 460],
        sources: &[&["lab/examples/cost.rs"]],
    },
];

impl Picture {
    /// What documents and the command call it: its file's name without the ending.
    pub fn id(&self) -> &'static str {
        let name = self.file.rsplit('/').next().unwrap_or(self.file);
        name.split('.').next().unwrap_or(name)
    }

    /// Hash of what it is made of: how, its sources, and the figures of its run.
    ///
    /// # Errors
    /// If a source is not there.
    pub fn made_of(&self, root: &Path, store: &Store) -> Result<String> {
        let mut digest = CHECKSUM.digest();
        digest.update(format!("{:?} {:?}", self.how, self.size).as_bytes());
        for source in self.sources.iter().copied().flatten() {
            for file in files(&root.join(source))? {
                digest.update(&fs::read(&file).with_context(|| file.display().to_string())?);
            }
        }
        if let How::Chart { job, .. } = self.how {
            for (id, taken) in store.figures.iter().filter(|(_, taken)| taken.run == job) {
                digest.update(format!("{id}={}", taken.value).as_bytes());
            }
        }
        Ok(format!("{:016x}", digest.finalize()))
    }

    /// Sets down that it was taken just now, and shows this.
    ///
    /// # Errors
    /// If it is not there.
    pub fn keep(&self, tools: &Tools, store: &mut Store, place: Place, shows: String) -> Result<()> {
        let pictured = Pictured {
            shows,
            command: format!("{} -- {}", crate::COMMAND, self.id()),
            made_of: self.made_of(&tools.root, store)?,
            file: hash_of(&tools.root.join(self.file))?,
            place,
        };
        store.pictures.insert(self.file.to_owned(), pictured);
        Ok(())
    }

    /// What is wrong with it as it is in the repository, if anything is.
    ///
    /// # Errors
    /// If it or a source cannot be read.
    pub fn trouble(&self, root: &Path, store: &Store) -> Result<Option<String>> {
        let again = format!("take it again: {} -- {}", crate::COMMAND, self.id());
        let Some(pictured) = store.pictures.get(self.file) else {
            return Ok(Some(format!("{}: was never taken; {again}", self.file)));
        };
        if hash_of(&root.join(self.file))? != pictured.file {
            return Ok(Some(format!("{}: is not the file that was taken; {again}", self.file)));
        }
        if self.made_of(root, store)? != pictured.made_of {
            return Ok(Some(format!("{}: is older than what it shows; {again}", self.file)));
        }
        Ok(None)
    }
}

fn hash_of(file: &Path) -> Result<String> {
    let bytes = fs::read(file).with_context(|| file.display().to_string())?;
    Ok(format!("{:016x}", CHECKSUM.checksum(&bytes)))
}

/// A file, or all files below a folder, in one order.
fn files(path: &Path) -> Result<Vec<PathBuf>> {
    ensure!(path.exists(), "{} has gone: a picture is made of it", path.display());
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let mut entries: Vec<PathBuf> = fs::read_dir(path)?.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    entries.sort();
    let mut all = Vec::new();
    for entry in entries {
        all.extend(files(&entry)?);
    }
    Ok(all)
}
