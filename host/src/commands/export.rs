//! `tactomo export`: a recording, solved, in a form that other programs read.

use std::fs::File;
use std::io::BufWriter;
use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Duration;

use anyhow::{Context, bail};
use tactomo::board::frames::FileFrame;
use tactomo::board::record::{RecordError, RecordReader};
use tactomo::changes::Changes;
use tactomo::pointer::Pointer;
use tactomo::readings::Readings;
use tactomo::run::{Arrival, Frame, TouchEvent};
use tactomo::schema::FrameReport;
use tactomo::sink::Delivery;
use tactomo::sink::channels::Messages;
use tactomo::sink::lines::Fields;
use tactomo::sink::mcap::McapFile;
use tactomo::sink::mcap::ros2::Ros2File;
use tactomo::solve::{Lambda, Method, Solution};

use super::reconstruct::reader::{Input, Reader};
use super::reconstruct::writer::{FileForm, Writer};
use super::streams;
use tactomo_cli::choice::{self, DetectorArgs, Model};
use tactomo_cli::interrupt;
use tactomo_cli::output::{NewFile, ProgressBar, message};

/// Solves a recording and writes answers and readings for other programs.
///
/// The detector is the recording's own, with its calibration, unless another one is given.
///
/// Examples:
///   tactomo export touch.tactomo --to mcap --out touch.mcap
///   tactomo export touch.tactomo --to mcap --profile ros2 --out touch.mcap
///   tactomo export touch.tactomo --to npz --fields all --out touch.npz
///   tactomo export touch.tactomo --to csv --solver contacts --detector calibrated.toml --out touch.csv
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// The recording
    #[arg(value_name = "RECORDING")]
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
    /// Replaces the file if it exists
    #[arg(long, visible_alias = "force")]
    overwrite: bool,
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
    if let Some((form, _)) = args.to.with_fields_of_its_own().zip(args.fields) {
        bail!("leave out --fields: {form} has its own");
    }
    if args.profile.is_some() && args.to != Form::Mcap {
        bail!("leave out --profile: only an MCAP file has one");
    }
    let file = NewFile::beside(&args.file, &args.out, args.overwrite)?;
    let open = |source| RecordError::Open { path: args.file.clone(), source };
    let mut recording = RecordReader::open(&args.file)?;
    let (header, last_us) = (recording.header().clone(), recording.last_time_us().map_err(open)?.unwrap_or_default());
    let mut reader = Reader::open(&args.input())?;
    let mut out = Out::begin((args.to, args.profile.unwrap_or_default()), file, &reader, &header.source)?;
    let fields = args.fields.unwrap_or_default();
    let mut bar = ProgressBar::new("s recorded", last_us / 1_000_000);
    let (mut lost, mut solved) = (0, 0_u64);
    let mut changes = Changes::default();
    let mut pointer = args.pointer.then(Pointer::default);
    while let Some(frame) = reader.next_frame()? {
        if stop.load(Ordering::Relaxed) {
            bail!("ended before {} was complete: nothing is written", args.out.display());
        }
        let solution = reader.solve(&frame).with_context(|| reader.place())?;
        lost += frame.lost_before;
        let arrived_s = frame.arrived_s.unwrap_or_default();
        let mut event = event(&reader, &frame, solution, (header.started(), lost))?;
        if let Some(pointer) = &mut pointer {
            event.pointer_events = pointer.take(event.frame.time_s(), &event.solution.contacts);
        }
        out.write(&Delivery::at_once(event, &mut changes), fields, reader.frame() as u64)?;
        solved += 1;
        bar.tell(arrived_s as u64);
    }
    bar.end();
    out.finish(&reader)?;
    message!("{}: {solved} frames in {}", reader.name(), args.out.display());
    reader.notice().iter().for_each(|notice| message!("{notice}"));
    reader.losses().iter().for_each(|losses| message!("warning: {losses}"));
    Ok(())
}

impl Args {
    fn input(&self) -> Input<'_> {
        Input {
            file: &self.file,
            detector: &self.detector,
            model: self.model,
            solver: Some(self.solver),
            lambda: self.lambda,
            taught: None,
            rest: self.rest,
            unit: None,
            force: None,
            uncorrected: false,
        }
    }
}

/// What a frame gave; `lost` frames so far of a recording that was `started` at that time since 1970.
fn event(
    reader: &Reader,
    frame: &FileFrame,
    solution: Solution,
    (started, lost): (Duration, u64),
) -> anyhow::Result<TouchEvent> {
    let electrodes = frame.volts.len().isqrt();
    let used = Readings::new(electrodes, reader.used_v().to_vec());
    let touch = reader.touch(frame).with_context(|| reader.place())?;
    let (measured, used) = frame.measured().zip(used).with_context(|| reader.place())?;
    let time_s = frame.time_s.unwrap_or_default().max(0.0);
    let arrived = Duration::from_secs_f64(frame.arrived_s.unwrap_or(time_s).max(0.0));
    let came = Frame {
        sequence: frame.sequence.unwrap_or_default(),
        delay: frame.delay,
        board_time_us: (time_s * 1e6).round() as u64,
        lost,
        ..Frame::first(measured, used.saying(|g, e| touch.says(g, e)), Arrival::recorded(started + arrived))
    };
    Ok(TouchEvent {
        lost_before: frame.lost_before,
        is_taking_baseline: reader.is_taking_baseline(),
        ..TouchEvent::new(came, touch, solution)
    })
}

impl Out {
    fn begin((form, profile): (Form, Profile), file: NewFile, reader: &Reader, source: &str) -> anyhow::Result<Self> {
        let form = match form {
            Form::Npz => FileForm::Npz,
            Form::Csv => FileForm::Csv,
            Form::Jsonl => FileForm::JsonLines,
            Form::Mcap => {
                let (detector, mesh) = reader.measured().zip(reader.mesh()).context("an MCAP file needs a detector")?;
                let about = streams::about(detector, source);
                if profile == Profile::Ros2 {
                    let mcap = Ros2File::new(file.create()?, detector, &about)?;
                    return Ok(Self::Ros2(Box::new(mcap), file));
                }
                let messages = Messages::new(detector, mesh.clone(), reader.usual_radius_m());
                let mcap = McapFile::new(file.create()?, vec![messages], about)?;
                return Ok(Self::Mcap(Box::new(mcap), file));
            }
        };
        Ok(Self::Table(Writer::to_file(form, file)?))
    }

    fn write(&mut self, delivery: &Delivery, fields: Fields, number: u64) -> anyhow::Result<()> {
        match self {
            Self::Mcap(mcap, _) => mcap.write(delivery).context("cannot write the MCAP file"),
            Self::Ros2(mcap, _) => mcap.write(delivery).context("cannot write the MCAP file"),
            Self::Table(writer) => {
                let report = FrameReport { frame: Some(number), ..fields.of(delivery) };
                writer.write(&report).map(drop)
            }
        }
    }

    fn finish(self, reader: &Reader) -> anyhow::Result<()> {
        match self {
            Self::Mcap(mcap, file) => {
                mcap.finish().context("cannot write the MCAP file")?;
                file.finish()
            }
            Self::Ros2(mcap, file) => {
                mcap.finish().context("cannot write the MCAP file")?;
                file.finish()
            }
            Self::Table(writer) => writer.finish(reader.mesh()),
        }
    }
}
