//! `tactomo live`: the live picture.

pub mod body;
mod several;
mod together;

use std::io::IsTerminal;
use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, anyhow};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use tactomo::board::record::Header;
use tactomo::board::session::RequestedSettings;
use tactomo::board::source::Source;
use tactomo::detector::{Chosen, Detector};
use tactomo::forward::jacobian::Jacobian;
use tactomo::learned::Learned;
use tactomo::run::Listener;
use tactomo::run::calibration::{Keeping, Learning};
use tactomo::run::options::{RunOptions, Solving, Summary};
use tactomo::run::scanning::ScanChoice;
use tactomo::run::table::{BoardTable, What, WithTable};
use tactomo::scene::SceneName;
use tactomo::sink::address::Address;
use tactomo::sink::door::{Door, Origin};
use tactomo::sink::page::{Finger, Listen, Server, Shown, code};
use tactomo::sink::place::Place;
use tactomo::solve::{Method, Problem};

use self::body::Patch;
use super::source::{self, BoardArgs};
use super::streams::StreamArgs;
use super::{browser, keep};
use tactomo_cli::choice::{DetectorArgs, Model};
use tactomo_cli::options;
use tactomo_cli::output::message;
use tactomo_protocol::Output;

/// What `--simulate` is here, where there may be several.
const SIMULATE: &str = "Uses the simulated board: the real firmware on simulated pins. With a number so many of them, each with a scene of its own";
/// What `--port` is here, where there may be several.
const PORT: &str = "Serial port of the board, or the serial number of its USB device, as `ports` prints it. May be given several times, for boards on one page \
     [default: the USB serial port on which a board answers]";

/// Shows the live picture of a board, the simulated board or a recording.
///
/// Examples:
///   tactomo live                                    finds the board and serves the page
///   tactomo live --simulate                         without hardware
///   tactomo live --simulate --scene five-fingers --force 10 --fault open:3
///   tactomo live --simulate --scene gripper         a demonstration, on the detector that it was made for
///   tactomo live --simulate --board esp32           at the pace and with the ADCs of the paper's board
///   tactomo live --simulate --as-built 7            a detector that is not quite the one described
///   tactomo live --port /dev/ttyUSB0 --seconds 10 --json
///   tactomo live --learned mine.safetensors         by what presses on this sensor have taught
///   tactomo live --simulate --scan adaptive         the rows that a scene needs, as they come
///   tactomo live --simulate --board-sends contacts  what the board finds by itself
///   tactomo live --replay touch.tactomo --speed 0.25
///   tactomo live --simulate --listen 0.0.0.0        for a phone or a projector on the same network
///   tactomo live --stream - --stream-hz 100 | python robot.py
///   tactomo live --foxglove --mcap touch.mcap       for Foxglove, live and afterwards
///   tactomo live --simulate 5                       five boards on one page
///   tactomo live --body hand.toml                   several detectors, each with its board, on one page
#[derive(Clone, Debug, clap::Args)]
#[command(verbatim_doc_comment)]
#[command(mut_arg("simulate", |arg| arg.num_args(0..=1).help(SIMULATE)))]
#[command(mut_arg("port", |arg| arg.help(PORT)))]
pub struct Args {
    /// Shows several detectors, each with its board, on one page: a TOML file with a [[patch]] for each, that has a name and options of this
    /// command; or a folder of recordings of several
    #[arg(long, alias = "skin", value_name = "FILE|FOLDER", conflicts_with_all = body::OF_ONE)]
    pub body: Option<PathBuf>,
    #[command(flatten)]
    pub board: BoardArgs,
    /// Plays a recording instead
    #[arg(long, value_name = "FILE", conflicts_with_all = ["port", "simulate", "settle_us", "average", "max_fps", "select_us", "discard"])]
    pub replay: Option<PathBuf>,
    /// How many times faster the recording is played; `max` for as fast as it can be read
    #[arg(long, value_name = "FACTOR", default_value = "1", requires = "replay", value_parser = source::speed)]
    pub speed: f64,
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Which rows the board scans: `whole` frames; `four` grounds far apart; `adaptive`, what the scene needs at the moment, which
    /// gives five times as many answers a second as whole frames on the ESP32's line; or a list of electrodes to ground, such as 0,5,10,15
    #[arg(long, value_name = "PLAN", default_value_t = ScanChoice::Whole, conflicts_with = "replay")]
    pub scan: ScanChoice,
    /// What the board sends: `frames` of readings; the `contacts` that it finds in them by itself, up to three, by a table of the detector that it is given
    /// first; or `both`
    #[arg(long, value_name = "WHAT", default_value = "frames", value_parser = output(), conflicts_with = "replay")]
    pub board_sends: Output,
    /// Ends this many seconds after the board said Hello
    #[arg(long, value_parser = options::seconds)]
    pub seconds: Option<Duration>,
    /// Keeps all bytes that come in a new file; of several boards in a new folder, with a file for each, which --body FOLDER shows again
    #[arg(long, value_name = "FILE")]
    pub record: Option<PathBuf>,
    #[command(flatten)]
    pub streams: StreamArgs,
    /// ELF file of the board's firmware, to print its log
    #[arg(long, value_name = "FILE")]
    pub elf: Option<PathBuf>,
}

/// What becomes of the bytes.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Solver and page")]
pub struct PictureArgs {
    #[command(flatten)]
    pub detector: DetectorArgs,
    /// Solver that reads the touch; on the page another can be chosen [default: auto; with --learned, what that teaches]
    #[arg(long, value_name = "NAME")]
    pub solver: Option<Method>,
    /// What `tactomo-lab learn` has learned on this sensor: its solver takes that in place of presses simulated on the model
    #[arg(long, value_name = "MODEL")]
    pub learned: Option<PathBuf>,
    /// Jacobian from `forward --save-jacobian`, instead of computing it
    #[arg(long, value_name = "FILE")]
    pub jacobian: Option<PathBuf>,
    /// Port of the page; 0 for any
    #[arg(long, value_name = "PORT", conflicts_with = "listen")]
    pub http_port: Option<u16>,
    /// Where the page is served: ADDRESS, ADDRESS:PORT or PORT. With an address of this machine, or 0.0.0.0 for all it has, it is shared on the
    /// network; else only this machine reaches it. The address that is printed then has a random token: who has it sees the page and can press
    /// its buttons, and the link is not encrypted
    #[arg(long, value_name = "ADDRESS", conflicts_with = "json")]
    pub listen: Option<Address>,
    /// Pages of this site in a browser, such as https://app.example, may read what is touched too: through Foxglove's connection, or the socket of
    /// the page. May be given several times
    #[arg(long, value_name = "ORIGIN")]
    pub allow_origin: Vec<Origin>,
    /// Leaves it to you to open the page: else the browser opens by itself where there is a desktop
    #[arg(long)]
    pub no_open: bool,
    /// Takes the detector as it is described. Else, on a board, it is learned from what presses, and used once it helps. What is learned of a
    /// detector that a file describes is kept beside it for the next time, for each board in a file of its own: of my.toml in my.BOARD.learned.toml, where
    /// BOARD is the serial number of its USB device, or its port
    #[arg(long)]
    pub no_learning: bool,
    /// Makes a pointer of a contact: its motion, presses and clicks are `events` in `--stream`, and move a cursor on the page. The scene
    /// `pointer` does so by itself
    #[arg(long)]
    pub pointer: bool,
    /// Serves no page, and prints `{source, solver, frames, frames_per_s, folded, dropped, skipped, solved, corrupt, latency_us, age_us, vibration?,
    /// learned?}` at the end as JSON
    #[arg(long)]
    pub json: bool,
}

/// What is shown, whichever command asks for it.
pub struct Show {
    /// Where the bytes come from.
    pub source: Box<dyn Source>,
    /// Where the detector lies on a body, if that is told.
    pub place: Option<Place>,
    /// What the mouse presses with, if the detector is simulated.
    pub finger: Option<Finger>,
    /// The detector that is connected.
    pub detector: Detector,
    /// What becomes of the bytes.
    pub picture: PictureArgs,
    /// Settings asked of the board.
    pub settings: RequestedSettings,
    /// Which rows the board is asked to scan.
    pub scan: ScanChoice,
    /// What the board is asked to send.
    pub output: Output,
    /// The table that it finds contacts by, if it does.
    pub table: BoardTable,
    /// How the detector is learned, if it is; a recording is taken as it was.
    pub learning: Option<Learning>,
    /// Time from Hello to the end.
    pub seconds: Option<Duration>,
    /// Where all bytes are kept.
    pub record: Option<PathBuf>,
    /// Where answers go besides the page.
    pub streams: StreamArgs,
    /// ELF file of the board's firmware.
    pub elf: Option<PathBuf>,
}

/// Shows what `args` choose.
pub fn run(args: Args) -> anyhow::Result<()> {
    let Some(detectors) = several::detectors(&args)? else { return show(prepared(args, "")?) };
    let of_patch = |Patch { name, place, args: patch }| {
        let PictureArgs { http_port, listen, allow_origin, no_open, json, .. } = args.picture.clone();
        let picture = PictureArgs { http_port, listen, allow_origin, no_open, json, ..patch.picture };
        let show = prepared(Args { picture, seconds: args.seconds, ..patch }, &name);
        let show = show.with_context(|| format!("patch {name}"))?;
        Ok((name, Show { place, ..show }))
    };
    let shows = detectors.into_iter().map(of_patch).collect::<anyhow::Result<_>>()?;
    together::show_all(shows, Some(&args.streams))
}

/// What one detector is shown by, that has such a name among several.
fn prepared(args: Args, patch: &str) -> anyhow::Result<Show> {
    let chosen = &args.picture.detector;
    let detector = match &args.replay {
        Some(path) => source::recorded_detector(chosen, path)?,
        None => source::described(&args.board, chosen.get_or(args.board.scene.preset())?),
    };
    let learning = learning(&args, &detector, patch);
    let (source, finger) = match args.replay {
        Some(file) => (source::recording(file, args.speed, !args.picture.json && args.seconds.is_none()), None),
        None => source::board(&args.board, &detector)?,
    };
    let output = args.board_sends;
    let table = BoardTable::default();
    let source = match output.has_contacts() {
        true => {
            let of_description = || What::Detector(Box::new(detector.clone()));
            let what = learning.clone().map_or_else(of_description, |learning| What::Learned(Box::new(learning)));
            Box::new(WithTable::new(source, what, table.clone()))
        }
        false => source,
    };
    let settings = args.board.settings.requested();
    let is_pointer = args.board.scene.scene == Some(SceneName::Pointer);
    let Args { mut picture, scan, seconds, record, streams, elf, .. } = args;
    scan.check(detector.electrodes.len()).map_err(|what| anyhow!("--scan {scan}: {what}"))?;
    picture.pointer |= is_pointer;
    if output.has_contacts() {
        picture.solver.get_or_insert(Method::Core);
    }
    Ok(Show {
        source,
        place: None,
        finger,
        settings,
        scan,
        output,
        table,
        learning,
        detector,
        picture,
        seconds,
        record,
        streams,
        elf,
    })
}

/// How the detector is learned, if it is.
fn learning(args: &Args, description: &Detector, patch: &str) -> Option<Learning> {
    let PictureArgs { no_learning, learned, jacobian, detector, .. } = &args.picture;
    // What a person has brought in place of the model holds for the detector as it is described.
    if *no_learning || learned.is_some() || jacobian.is_some() || args.replay.is_some() {
        return None;
    }
    let keeping = match &detector.detector {
        // No two simulations are of one sensor.
        Some(Chosen::File(path)) if !args.board.is_simulated() => {
            Keeping::Beside { description: path.clone(), patch: patch.to_owned() }
        }
        _ => Keeping::Nowhere,
    };
    Learning::of(description, keeping)
}

/// What a board sends, by its name.
fn output() -> impl TypedValueParser<Value = Output> {
    PossibleValuesParser::new(["frames", "contacts", "both"]).map(|name| match &*name {
        "contacts" => Output::Contacts,
        "both" => Output::Both,
        _ => Output::Frames,
    })
}

/// Serves the page of one detector, or only counts, until the end.
pub fn show(show: Show) -> anyhow::Result<()> {
    together::show_all(vec![(String::new(), show)], None)
}

fn problem(args: &PictureArgs, detector: &Detector) -> anyhow::Result<Problem> {
    let loaded = args.jacobian.as_ref().map(|path| Jacobian::load(path, detector)).transpose()?;
    let problem = Problem::new(Model::Auto.build(detector, None)?);
    let problem = match loaded {
        Some(jacobian) => problem.with_jacobian(jacobian),
        None => problem,
    };
    let Some(path) = &args.learned else { return Ok(problem) };
    let learned = Learned::read(path)?;
    problem.with_learned(learned).with_context(|| format!("{} is of another sensor", path.display()))
}

/// The method to begin with.
fn method(args: &PictureArgs, problem: &Problem) -> Method {
    args.solver.or(problem.learned().map(Learned::method)).unwrap_or(Method::Auto)
}

fn options(
    name: &str,
    show: &mut Show,
    problem: Problem,
    listener: Option<Box<dyn Listener>>,
) -> anyhow::Result<RunOptions> {
    let detector = show.detector.clone();
    let solving = Solving { learning: show.learning.clone(), ..Solving::new(method(&show.picture, &problem), problem) };
    Ok(RunOptions {
        settings: show.settings,
        scan: show.scan.clone(),
        output: show.output,
        table: show.table.clone(),
        solving: Some(if show.output.has_frames() { solving } else { solving.on_board() }),
        recorder: keep::begin(show.record.as_deref(), &Header::now(&detector, show.source.name()))?,
        begin_recording: Some(keep::on_request(detector.clone(), show.source.name(), name)),
        listeners: listener.into_iter().collect(),
        pointer: show.picture.pointer,
        board_log: keep::board_log(show.elf.as_deref())?,
        seconds: show.seconds,
        ..RunOptions::new(detector)
    })
}

/// The page, unless only the figures are wanted.
fn serve(picture: &PictureArgs, all: Vec<Shown>) -> anyhow::Result<Option<Server>> {
    if picture.json {
        return Ok(None);
    }
    let PictureArgs { listen, http_port: port, no_open, .. } = picture;
    let door = door(picture);
    let listen = match listen {
        Some(address) => Listen::at(address, door)?,
        None => Listen { address: None, port: *port, door },
    };
    let server = Server::start(listen, all)?;
    message!("live picture: {}", server.url());
    if let Some(url) = server.shared_url() {
        message!("on the network: {url}\nwho has this address can see the page and press its buttons");
        message!("{}", code::lines(url, std::io::stderr().is_terminal()));
    }
    if !no_open {
        browser::open(&server.url());
    }
    Ok(Some(server))
}

/// Who gets in besides those who always do.
fn door(args: &PictureArgs) -> Door {
    Door { origins: args.allow_origin.clone(), ..Door::default() }
}

/// A summary in a line.
pub fn sentence(summary: &Summary) -> String {
    let Summary { source, frames, frames_per_s, folded, dropped, skipped, corrupt, solved, age_us, learned, .. } =
        summary;
    let learned = learned.map_or_else(String::new, |learned| format!("; {learned}"));
    let scans = match *folded {
        0 => String::new(),
        folded => format!(" (the mean of {:.1} scans each)", 1.0 + folded as f64 / *frames as f64),
    };
    let received =
        format!("{source}: {frames} frames, {frames_per_s:.0} a second{scans}, {dropped} lost, {corrupt} corrupt");
    if *solved == 0 {
        return received;
    }
    format!(
        "{received}; {solved} answers, {skipped} frames skipped by the solver; age of answers p50 {:.2} ms, p99 {:.2} ms, at most {:.2} ms{learned}",
        age_us.p50 * 1e-3,
        age_us.p99 * 1e-3,
        age_us.max * 1e-3
    )
}
