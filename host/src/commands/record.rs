//! `tactomo record`: keeps what a board sends, without a picture.

use std::io::{BufRead, IsTerminal, stdin};
use std::path::{Path, PathBuf};
use std::sync::{Arc, mpsc};
use std::thread;
use std::time::Duration;

use tactomo::board::record::{Header, Ring, Trigger};
use tactomo::run::options::{Ends, RunOptions, Solving};
use tactomo::run::{Listener, Request, Snapshot, TouchEvent};
use tactomo::solve::{Method, Problem};
use tokio::sync::watch;

use super::source::{self, BoardArgs};
use super::{keep, live};
use tactomo_cli::choice::DetectorArgs;
use tactomo_cli::interrupt;
use tactomo_cli::options;
use tactomo_cli::output::message;

/// Marks that may wait to be set.
const REQUESTS: usize = 64;

/// Keeps the bytes of a board in a new file, with the detector that they came from.
///
/// In a terminal, each line that you type sets a mark, with that line as its text; Ctrl-C ends the recording.
///
/// With --last, nothing is written until something happens: then the last seconds are saved, and those that follow, in a new
/// file each time: touch-1.tactomo, touch-2.tactomo and so on.
///
/// Examples:
///   tactomo record touch.tactomo --seconds 30
///   tactomo record touch.tactomo --port /dev/ttyUSB0 --detector my.toml --average 4 --notes "new foam, 23 degrees"
///   tactomo record touch.tactomo --simulate --scene five-fingers --seconds 10
///   tactomo record touch.tactomo --last 10 --save-on touch
///   tactomo record slip.tactomo --last 30 --save-on enter --after 5
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// The new file
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    board: BoardArgs,
    #[command(flatten)]
    detector: DetectorArgs,
    /// Ends this many seconds after the board said Hello; otherwise with Ctrl-C
    #[arg(long, value_parser = options::seconds)]
    seconds: Option<Duration>,
    /// What is worth remembering; the recording carries it
    #[arg(long, value_name = "TEXT", default_value = "", hide_default_value = true)]
    notes: String,
    /// Holds this many seconds in memory, and saves them on an event only (at most 256 MB: four minutes of a board on USB at 3000
    /// frames/s)
    #[arg(long, value_name = "SECONDS", value_parser = options::seconds, requires = "save_on")]
    last: Option<Duration>,
    /// What they are saved on: `touch`, when something begins to touch; `enter`, when a line is typed or comes on stdin
    #[arg(long, value_enum, value_name = "EVENT", requires = "last")]
    save_on: Vec<SaveOn>,
    /// How many seconds after the event are saved too; a further event meanwhile lengthens the file [default: 2]
    #[arg(long, value_name = "SECONDS", value_parser = options::seconds, requires = "last")]
    after: Option<Duration>,
}

/// What the last seconds are saved on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum SaveOn {
    /// When something begins to touch.
    Touch,
    /// When a line is typed or comes on stdin.
    Enter,
}

/// Records until the end.
pub fn run(args: Args) -> anyhow::Result<()> {
    let Args { file, board, detector, seconds, notes, last, save_on, after } = args;
    match last {
        None => recorded(&file, &board, &detector, seconds, notes),
        Some(last) => {
            let after = after.unwrap_or(Duration::from_secs(2));
            in_ring(&board, &detector, seconds, &save_on, |header| {
                Ring::new(file, Header { notes, ..header }, last, after)
            })
        }
    }
}

/// Records a board in a new file, for so long or until Ctrl-C.
pub fn record(
    file: &Path,
    board: &BoardArgs,
    detector_args: &DetectorArgs,
    seconds: Option<Duration>,
) -> anyhow::Result<()> {
    recorded(file, board, detector_args, seconds, String::new())
}

fn recorded(
    file: &Path,
    board: &BoardArgs,
    detector_args: &DetectorArgs,
    seconds: Option<Duration>,
    notes: String,
) -> anyhow::Result<()> {
    let detector = source::described(board, detector_args.get_or(board.scene.preset())?);
    let (mut source, _) = source::board(board, &detector)?;
    let header = Header { notes, ..Header::now(&detector, source.name()) };
    let options = RunOptions {
        settings: board.settings.requested(),
        recorder: keep::begin(Some(file), &header)?,
        seconds,
        ..RunOptions::new(detector)
    };
    let (request, requests) = mpsc::sync_channel(REQUESTS);
    if stdin().is_terminal() {
        message!("each line that you type sets a mark; Ctrl-C ends the recording");
        on_lines(move |line| {
            if request.try_send(Request::Mark(line.to_owned())).is_ok() {
                message!("marked");
            }
        })?;
    }
    let (snapshots, _) = watch::channel(Arc::new(Snapshot::default()));
    let ends = Ends { snapshots, requests, stop: interrupt::flag()? };
    let summary = tactomo::run::run(&mut *source, options, ends)?;
    message!("{}; kept in {}", live::sentence(&summary), file.display());
    Ok(())
}

/// Holds the last seconds of a board, and saves them on these events.
fn in_ring(
    board: &BoardArgs,
    detector_args: &DetectorArgs,
    seconds: Option<Duration>,
    save_on: &[SaveOn],
    ring: impl FnOnce(Header) -> Ring,
) -> anyhow::Result<()> {
    let detector = source::described(board, detector_args.get_or(board.scene.preset())?);
    let (mut source, _) = source::board(board, &detector)?;
    let ring = ring(Header::now(&detector, source.name()));
    let mut options = RunOptions { settings: board.settings.requested(), seconds, ..RunOptions::new(detector) };
    if save_on.contains(&SaveOn::Enter) {
        let trigger = ring.trigger();
        message!("press Enter to save the last seconds; Ctrl-C ends");
        on_lines(move |_| trigger.save())?;
    }
    if save_on.contains(&SaveOn::Touch) {
        let problem = Problem::of(&options.detector)?;
        options.solving = Some(Solving::new(Method::Contacts, problem));
        options.listeners.push(Box::new(SaveOnTouch { trigger: ring.trigger(), is_touched: true }));
    }
    options.ring = Some(ring);
    let (snapshots, _) = watch::channel(Arc::new(Snapshot::default()));
    let (_, requests) = mpsc::sync_channel(1);
    let ends = Ends { snapshots, requests, stop: interrupt::flag()? };
    let summary = tactomo::run::run(&mut *source, options, ends)?;
    message!("{}", live::sentence(&summary));
    Ok(())
}

/// Does something with each line that comes on stdin.
fn on_lines(mut act: impl FnMut(&str) + Send + 'static) -> std::io::Result<()> {
    let thread = thread::Builder::new().name("lines".to_owned());
    thread.spawn(move || stdin().lock().lines().map_while(Result::ok).for_each(|line| act(line.trim())))?;
    Ok(())
}

/// Saves when something begins to touch.
struct SaveOnTouch {
    trigger: Trigger,
    is_touched: bool,
}

impl Listener for SaveOnTouch {
    fn touched(&mut self, event: &Arc<TouchEvent>) {
        if event.is_taking_baseline {
            return;
        }
        let is_touched = !event.solution.contacts.is_empty();
        if is_touched && !self.is_touched {
            self.trigger.save();
        }
        self.is_touched = is_touched;
    }
}
