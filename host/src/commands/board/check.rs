//! `tactomo board check`: whether a new board and its detector are wired as they should be.

use std::time::{Duration, Instant};

use anyhow::{bail, ensure};
use serde::Serialize;
use tactomo::board::check::{Counted, Listening};
use tactomo::board::inputs::{Settling, settling};
use tactomo::board::link::{Control, ControlError, Link};
use tactomo::board::measured;
use tactomo::board::session;
use tactomo::check::{Ask, Check, FINGERS, Presser, Report, picture};
use tactomo::detector::Detector;
use tactomo::scene::SceneName;
use tactomo::solve::Problem;
use tactomo_protocol::Settings;

use crate::commands::source::{self, BoardArgs};
use tactomo_cli::choice::{DetectorArgs, Model};
use tactomo_cli::options;
use tactomo_cli::output::{self, message};

/// How often a person who is waited for is told what hinders.
const REMIND_EVERY: Duration = Duration::from_secs(10);

/// Checks a board and the wires of its detector: who answers, and whether every electrode is connected.
///
/// It asks you to lay a hand on the foam and to press with a fingertip, draws the electrodes, and says of each one that is not as it should be
/// what is wrong and what to do. Exit code 0 if all are right, else 1.
///
/// Examples:
///   tactomo board check                              finds the board
///   tactomo board check --port /dev/ttyUSB0 --detector my.toml
///   tactomo board check --simulate --fault swap:5,6  without hardware; the hand is simulated too
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    #[command(flatten)]
    board: BoardArgs,
    #[command(flatten)]
    detector: DetectorArgs,
    /// How long each touch that is asked for is waited for (s)
    #[arg(long, value_name = "SECONDS", default_value = "60", value_parser = options::seconds)]
    patience: Duration,
    /// Prints `{source, board, firmware, frames, frames_per_s, dropped, corrupt, faults, presses, electrodes, notes, sound, settling}` as JSON
    #[arg(long)]
    json: bool,
}

/// What is printed as JSON.
#[derive(Serialize)]
struct Output {
    source: String,
    board: String,
    firmware: String,
    #[serde(flatten)]
    counted: Counts,
    /// Faults that the board reported itself.
    faults: Vec<String>,
    #[serde(flatten)]
    report: Report,
    /// How the board's settings suit the resistance of the foam's pads; absent for boards of which that is not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    settling: Option<Settling>,
}

#[derive(Serialize)]
struct Counts {
    frames: u64,
    frames_per_s: f64,
    dropped: u64,
    corrupt: u64,
}

/// Checks, prints and judges.
pub fn run(args: &Args) -> anyhow::Result<()> {
    ensure!(
        args.board.scene.scene.is_none(),
        "--scene does not go with `board check`: the simulated hand does what a person would be asked to"
    );
    let mut board = args.board.clone();
    board.scene.scene = Some(SceneName::Rest);
    let described = source::described(&board, args.detector.get()?);
    let (mut source, finger) = source::board(&board, &described)?;
    let mut listening = Listening::open(&mut *source, board.settings.requested())?;
    greet(&listening);
    let detector = measured::as_measured(&described, listening.hello())?;
    let problem = Problem::new(Model::Auto.build(&described, None)?).measured_as(&detector);
    problem.make_nuisance_beside();
    let mesh = &problem.jacobian.image_mesh;
    let presser = finger.map(|finger| Presser::new(&detector, mesh, finger.radius_m, finger.conductance_s));
    let mut check = Check::new(problem, listening.hello().settings.conversions());
    guide(&mut check, &mut listening, presser.as_ref(), args.patience)?;
    let report = check.report(&listening.hello().board);
    show(&listening, source.name(), &detector, &report, args.json)?;
    if !report.sound {
        bail!("{}", report.verdict());
    }
    message!("{}", report.verdict());
    Ok(())
}

fn greet(listening: &Listening) {
    let hello = listening.hello();
    let Settings { settle_us, select_us, discarded, .. } = hello.settings;
    message!(
        "board {} with firmware {}: {} electrodes, {} bits of {} mV, drive {} mV; {settle_us} us to settle, {select_us} us to select, {discarded} \
         conversions discarded",
        hello.board,
        hello.firmware_version,
        hello.electrodes,
        hello.adc_bits,
        hello.adc_full_scale_mv,
        hello.drive_mv
    );
}

/// Asks for one touch after another, until all were felt or one is not.
fn guide(
    check: &mut Check,
    listening: &mut Listening,
    presser: Option<&Presser>,
    patience: Duration,
) -> anyhow::Result<()> {
    let begin = Instant::now();
    let (mut asked, mut asked_at, mut reminded) = (None, begin, begin);
    while check.ask() != Ask::Nothing {
        let ask = check.ask();
        if asked != Some(ask) {
            (asked, asked_at, reminded) = (Some(ask), Instant::now(), Instant::now());
            message!("{}", words(ask));
            if let Some(presser) = presser {
                press(listening.link(), presser, ask)?;
            }
        }
        if let Some(frame) = listening.next_frame()? {
            check.take(&frame, begin.elapsed().as_secs_f64());
        }
        if asked_at.elapsed() > patience {
            message!("waited long enough: judging by what was felt");
            return Ok(());
        }
        if reminded.elapsed() > REMIND_EVERY {
            reminded = Instant::now();
            remind(check);
        }
    }
    Ok(())
}

/// Does on the simulated detector what a person is asked to.
fn press(link: &mut dyn Link, presser: &Presser, ask: Ask) -> Result<(), ControlError> {
    let (scene, contacts) = presser.touch(ask);
    link.control(&Control::Scene(scene))?;
    link.control(&Control::Press(contacts))
}

fn words(ask: Ask) -> String {
    match ask {
        Ask::Rest => "1. Leave the foam alone for a moment.".to_owned(),
        Ask::Hand => "2. Lay a hand flat on the middle of the foam, press, and keep it there.".to_owned(),
        Ask::LetGo(_) => "   Felt it. Let go.".to_owned(),
        Ask::Finger(0) => "3. Press firmly with one fingertip, near the middle, and keep it there.".to_owned(),
        Ask::Finger(number) => format!("   Press at another place ({} of {FINGERS}).", number + 1),
        Ask::Nothing => String::new(),
    }
}

fn remind(check: &Check) {
    match check.hindrance() {
        Some(largest_v) => message!(
            "   Something presses (readings up to {:.0} mV): lift it. If nothing lies there, the layers are pressed together: loosen them.",
            1e3 * largest_v
        ),
        None => message!("   Still waiting: {}", words(check.ask()).trim_start()),
    }
}

fn show(listening: &Listening, source: String, detector: &Detector, report: &Report, json: bool) -> anyhow::Result<()> {
    let Counted { frames, dropped, corrupt } = listening.counted();
    let counted = Counts { frames, frames_per_s: listening.frames_per_s(), dropped, corrupt };
    let faults: Vec<String> = listening.faults().iter().map(session::explain).collect();
    let hello = listening.hello();
    let settling = settling(&hello.board, &hello.settings, detector.largest_pad_ohm());
    if json {
        let (board, firmware) = (hello.board.to_string(), hello.firmware_version.to_string());
        let output = Output { source, board, firmware, counted, faults, report: report.clone(), settling };
        return Ok(output::print(&serde_json::to_string(&output)?)?);
    }
    message!("{frames} frames, {:.0} a second, {dropped} dropped, {corrupt} corrupt", counted.frames_per_s);
    faults.iter().for_each(|fault| message!("the board says: {fault}"));
    let mut lines = vec![picture(detector, &report.electrodes)];
    let named = |advice: &String, electrode: usize| format!("electrode {electrode}: {advice}");
    lines.extend(report.faulty().filter_map(|found| Some(named(found.advice.as_ref()?, found.electrode))));
    lines.extend(report.notes.iter().cloned());
    lines.extend(settling.filter(|settling| !settling.suits).map(|settling| settling.to_string()));
    Ok(output::print(&lines.join("\n"))?)
}
