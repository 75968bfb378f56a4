//! `tactomo export`: a recording or a folder of them, solved, in a form that other programs read.

mod answers;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

use anyhow::{bail, ensure};
use tactomo::schema::FrameReport;
use tactomo::sink::lines::Fields;
use tactomo::sink::mcap::McapFile;
use tactomo::sink::mcap::ros2::{self, Ros2File};
use tactomo::sink::place::Place;
use tactomo::solve::{Lambda, Method};

use self::answers::{Answer, Answers, Recording};
use super::live::body::{self, Patch};
use super::reconstruct::reader::Input;
use super::reconstruct::writer::{FileForm, Writer};
use super::recording::folder;
use super::streams::Streamed;
use tactomo_cli::choice::{self, DetectorArgs, Model};
use tactomo_cli::interrupt;
use tactomo_cli::output::{NewFile, ProgressBar};

/// Solves a recording, or a folder of several, and writes answers and readings for other programs.
///
/// The detector is the recording's own, with its calibration, unless another one is given. Of a folder, as live --record makes of several
/// boards, MCAP files and JSON Lines have all detectors by their names, in the order of their times.
///
/// Examples:
///   tactomo export touch.tactomo --to mcap --out touch.mcap
///   tactomo export touch.tactomo --to mcap --profile ros2 --out touch.mcap
///   tactomo export touch.tactomo --to npz --fields all --out touch.npz
///   tactomo export taken --to mcap --out all.mcap
///   tactomo export touch.tactomo --to csv --solver contacts --detector calibrated.toml --out touch.csv
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// The recording, or a folder of them
    #[arg(value_name = "RECORDING|FOLDER")]
    file: PathBuf,
    /// Form of the file
    #[arg(long, value_enum, value_name = "FORM")]
    to: Form,
    /// The file
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    detector: DetectorArgs,
    /// Forward model
    #[arg(long, value_enum, default_value = "auto")]
    model: Model,
    /// Solver
    #[arg(long, value_name = "NAME", default_value = "auto", value_parser = choice::method())]
    solver: Method,
    /// Lambda of tikhonov, tikhonov-paper, noser or laplace: a share of the largest singular value, or a rule that chooses it for
    /// each frame
    #[arg(long, value_name = "SHARE|discrepancy|l-curve|gcv")]
    lambda: Option<Lambda>,
    /// Frames at the start whose mean is the baseline, and which are not solved [default: the baseline that live takes]
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u32).range(0..=100_000))]
    rest: Option<u32>,
    /// What jsonl and npz have: only `contacts`; also what to know of the `answer`; its `image`; the `readings`; or `all`. An MCAP file has
    /// all [default: answer]
    #[arg(long, value_name = "FIELDS")]
    fields: Option<Fields>,
    /// Whom the messages of an MCAP file are for [default: foxglove]
    #[arg(long, value_enum, value_name = "PROFILE")]
    profile: Option<Profile>,
    /// Makes a pointer of a contact, as live --pointer does: its motion, presses and clicks are the frames' events
    #[arg(long)]
    pointer: bool,
}

/// Forms of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Form {
    /// Channels for Foxglove and the Python package `mcap`
    Mcap,
    /// Arrays for NumPy, gathered in memory: a frame with its readings takes 4 kB
    Npz,
    /// A table with a contact a row
    Csv,
    /// JSON Lines: an object a frame, as live --stream writes them
    Jsonl,
}

/// Whom the messages of an MCAP file are for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum Profile {
    /// Foxglove's app and everything that reads JSON
    #[default]
    Foxglove,
    /// ROS 2: sensor_msgs/PointCloud2, geometry_msgs/WrenchStamped and tactomo_msgs
    Ros2,
}

impl Form {
    /// What it is called where it has fields of its own; `None` where they are chosen.
    fn with_fields_of_its_own(self) -> Option<&'static str> {
        match self {
            Self::Mcap => Some("an MCAP file"),
            Self::Csv => Some("a CSV table"),
            Self::Npz | Self::Jsonl => None,
        }
    }

    /// What it is called where it is of one detector; `None` where each answer says of which it is.
    fn of_one_detector(self) -> Option<&'static str> {
        match self {
            Self::Csv => Some("a CSV table"),
            Self::Npz => Some("an NPZ file"),
            Self::Mcap | Self::Jsonl => None,
        }
    }
}

/// What is written to.
enum Out {
    Mcap(Box<McapFile<BufWriter<File>>>, NewFile),
    Ros2(Box<Ros2File<BufWriter<File>>>, NewFile),
    Table(Writer),
}

/// Solves and writes all frames.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let stop = interrupt::flag()?;
    let files = args.checked()?;
    let out = NewFile::new(&args.out)?;
    let places = args.places()?;
    let open = |(name, file): &(String, PathBuf)| {
        let place = places.iter().find(|(patch, _)| patch == name).map(|(_, place)| *place);
        Recording::open(name, place, &args.input(file), args.pointer)
    };
    let recordings = files.iter().map(open).collect::<anyhow::Result<Vec<_>>>()?;
    let mut out = Out::begin((args.to, args.profile.unwrap_or_default()), out, &recordings)?;
    let fields = args.fields.unwrap_or_default();
    let mut answers = Answers::new(recordings);
    let mut bar = ProgressBar::new("s recorded", answers.recorded_s() as u64);
    while let Some(answer) = answers.next()? {
        if stop.load(Ordering::Relaxed) {
            bail!("ended before {} was complete: nothing is written", args.out.display());
        }
        out.write(&answer, fields)?;
        bar.tell(answers.solved_s() as u64);
    }
    bar.end();
    let recordings = answers.recordings();
    out.finish(recordings)?;
    recordings.iter().for_each(|recording| recording.tell(&args.out));
    Ok(())
}

impl Args {
    /// The recordings that are meant, each by the name of its detector, which is empty if there is one; what cannot be is said.
    fn checked(&self) -> anyhow::Result<Vec<(String, PathBuf)>> {
        if let Some((form, _)) = self.to.with_fields_of_its_own().zip(self.fields) {
            bail!("leave out --fields: {form} has its own");
        }
        let profile = self.profile.unwrap_or_default();
        ensure!(self.profile.is_none() || self.to == Form::Mcap, "leave out --profile: only an MCAP file has one");
        if !self.file.is_dir() {
            return Ok(vec![(String::new(), self.file.clone())]);
        }
        if let Some(form) = self.to.of_one_detector() {
            bail!("{form} is of one detector: give a recording of {}, or --to mcap or jsonl", self.file.display());
        }
        ensure!(
            self.detector.detector.is_none(),
            "leave out --detector: the recordings of a folder have each their own"
        );
        let files: Vec<_> =
            folder::recordings(&self.file)?.into_iter().map(|file| (folder::name(&file), file)).collect();
        let called = |name: &str| if profile == Profile::Ros2 { ros2::name(name) } else { name.to_owned() };
        let mut names = BTreeSet::new();
        for (name, file) in &files {
            let is_new = names.insert(called(name));
            ensure!(is_new, "two detectors would be called {}: give {} another name", called(name), file.display());
        }
        Ok(files)
    }

    /// Where the detectors of a folder lie on a body, by name, as far as it tells.
    fn places(&self) -> anyhow::Result<Vec<(String, Place)>> {
        if folder::body(&self.file).symlink_metadata().is_err() {
            return Ok(Vec::new());
        }
        let placed = |Patch { name, place, .. }| Some((name, place?));
        Ok(body::read(&self.file)?.into_iter().filter_map(placed).collect())
    }

    fn input<'a>(&'a self, file: &'a Path) -> Input<'a> {
        Input {
            file,
            detector: &self.detector,
            model: self.model,
            solver: Some(self.solver),
            lambda: self.lambda,
            taught: None,
            rest: self.rest,
            unit: None,
            force: None,
            uncorrected: false,
            keeps_found: true,
        }
    }
}

impl Out {
    fn begin((form, profile): (Form, Profile), file: NewFile, recordings: &[Recording]) -> anyhow::Result<Self> {
        let form = match form {
            Form::Npz => FileForm::Npz,
            Form::Csv => FileForm::Csv,
            Form::Jsonl => FileForm::JsonLines,
            Form::Mcap => {
                let streamed = recordings.iter().map(Recording::streamed).collect::<anyhow::Result<Vec<_>>>()?;
                let (messages, about) = Streamed::parts(streamed);
                if profile == Profile::Foxglove {
                    let mcap = McapFile::new(file.create()?, messages, about).map_err(|error| file.failed(error))?;
                    return Ok(Self::Mcap(Box::new(mcap), file));
                }
                let detectors = recordings.iter().filter_map(Recording::named).collect();
                let mcap = Ros2File::new(file.create()?, detectors, &about).map_err(|error| file.failed(error))?;
                return Ok(Self::Ros2(Box::new(mcap), file));
            }
        };
        Ok(Self::Table(Writer::to_file(form, file)?))
    }

    fn write(&mut self, Answer { delivery, number }: &Answer, fields: Fields) -> anyhow::Result<()> {
        match self {
            Self::Mcap(mcap, file) => Ok(mcap.write(delivery).map_err(|error| file.failed(error))?),
            Self::Ros2(mcap, file) => Ok(mcap.write(delivery).map_err(|error| file.failed(error))?),
            Self::Table(writer) => {
                let report = FrameReport { frame: Some(*number), ..fields.of(delivery) };
                writer.write(&report).map(drop)
            }
        }
    }

    fn finish(self, recordings: &[Recording]) -> anyhow::Result<()> {
        match self {
            Self::Mcap(mcap, file) => {
                mcap.finish().map_err(|error| file.failed(error))?;
                Ok(file.finish()?)
            }
            Self::Ros2(mcap, file) => {
                mcap.finish().map_err(|error| file.failed(error))?;
                Ok(file.finish()?)
            }
            // What has a mesh or a board in it is of one detector.
            Self::Table(writer) => {
                let of = recordings.first();
                writer.finish(of.and_then(Recording::mesh), of.and_then(Recording::board))
            }
        }
    }
}
