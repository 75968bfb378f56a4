//! The firmware on an emulated microcontroller: its UART, its frames, its log, its faults, what a frame costs.

mod host;
mod qemu;
#[path = "../../../firmware/boards/virt/src/table.rs"]
mod table;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use anyhow::{Context, Result, ensure};
use tactomo::detector::Detector;
use tactomo::scene::{Hand, Scene, SceneName};
use tactomo::simulate::{Physics, Simulation};
use tactomo::solve::{Problem, compile};
use tactomo_firmware::hid::{LAST_PLACE, REPORT_BYTES, TOUCH_ID};
use tactomo_protocol::{BoardMessage, Command, Fault, Frame, Plan, Scope, Settings, Status};

use crate::host::Host;
use crate::qemu::{Qemu, Request};

/// The table several times over.
const FRAMES: usize = 4 * table::FRAMES;

/// The board's firmware as it is, with contacts, and as a touch screen.
struct Built {
    plain: PathBuf,
    contacts: PathBuf,
    hid: PathBuf,
}

/// Builds the board once; `None` if the tools are missing and that is allowed.
fn built() -> Result<Option<&'static Built>> {
    static BUILT: OnceLock<std::result::Result<Built, String>> = OnceLock::new();
    if !qemu::available()? {
        return Ok(None);
    }
    let build = || {
        let [plain, contacts, hid] = [None, Some("contacts"), Some("hid")].map(qemu::build);
        Ok(Built { plain: plain?, contacts: contacts?, hid: hid? })
    };
    let built = BUILT.get_or_init(|| build().map_err(|error: anyhow::Error| format!("{error:#}")));
    Ok(Some(built.as_ref().map_err(|error| anyhow::anyhow!("{error}"))?))
}

fn elf() -> Result<Option<&'static Path>> {
    Ok(built()?.map(|built| &*built.plain))
}

/// The frame of the table that `readings` is, at `fraction_bits` below a code.
fn place_in_table(frame: &Frame) -> Option<usize> {
    (0..table::FRAMES).find(|place| frame.readings.as_slice() == expected(*place, frame.head.fraction_bits))
}

fn expected(place: usize, fraction_bits: u8) -> Vec<u16> {
    let cells = (0..table::ELECTRODES).flat_map(|ground| (0..table::ELECTRODES).map(move |e| (ground, e)));
    cells.map(|(ground, electrode)| table::reading(place, ground, electrode) << fraction_bits).collect()
}

/// Checks that the frames follow each other in the table and in number, and that their status is right.
fn check(frames: &[Frame]) -> Result<()> {
    let first = place_in_table(&frames[0]).context("the first frame is none of the table's")?;
    for (count, frame) in frames.iter().enumerate() {
        let place = (first + count) % table::FRAMES;
        let saturated = expected(place, 0).contains(&table::FULL_SCALE);
        ensure!(frame.readings.as_slice() == expected(place, frame.head.fraction_bits), "frame {count} differs");
        ensure!(
            frame.head.sequence == frames[0].head.sequence.wrapping_add(count as u16),
            "frame {count} is out of order"
        );
        ensure!(frame.head.status.contains(Status::SATURATED) == saturated, "frame {count}: {:?}", frame.head.status);
        ensure!(!frame.head.status.contains(Status::TIMED_OUT), "frame {count} timed out");
    }
    ensure!(frames.windows(2).all(|pair| pair[0].head.time_us < pair[1].head.time_us), "board time does not run on");
    Ok(())
}

#[test]
fn frames_arrive_bit_for_bit_and_the_log_with_them() -> Result<()> {
    let Some(elf) = elf()? else { return Ok(()) };
    let board = Qemu::start(elf, Request::ExitOnStop)?;
    let mut host = Host::open(board.pty(), elf)?;
    let hello = host.hello()?;
    assert_eq!((hello.board.as_str(), hello.electrodes, hello.adc_bits), ("virt", 16, table::ADC_BITS));

    // A cap that any machine keeps up with, so that no frame is dropped.
    let settings = Settings { settle_us: 5, max_frames_per_s: 1000, ..Settings::default() };
    host.send(&Command::Configure(settings))?;
    host.send(&Command::Start)?;
    check(&host.frames(FRAMES)?)?;

    host.send(&Command::Configure(Settings { average_log2: 4, ..settings }))?;
    let averaged = host.frames_where(table::FRAMES, |frame| frame.head.fraction_bits == 4)?;
    check(&averaged)?;

    assert_eq!(host.counters().corrupt, 0);
    assert_eq!(host.log(), ["INFO the first of 14 frames is out"]);
    host.send(&Command::Stop)?;
    assert_eq!(board.exit_code()?, 0);
    Ok(())
}

#[test]
fn a_scan_plan_brings_its_rows_and_no_others() -> Result<()> {
    let Some(elf) = elf()? else { return Ok(()) };
    let board = Qemu::start(elf, Request::Run)?;
    let mut host = Host::open(board.pty(), elf)?;
    host.hello()?;
    host.send(&Command::Configure(Settings { settle_us: 5, max_frames_per_s: 500, ..Settings::default() }))?;
    let (grounds, reads) = ([0, 5, 11, 5], 0b1001_0000_0000_0010);
    let plan = Plan { grounds: grounds.into_iter().collect(), reads, rows_a_frame: 2, average_log2: 1 };
    host.send(&Command::Scan(plan.clone()))?;
    host.send(&Command::Start)?;
    let frames = host.frames(4 * table::FRAMES)?;
    let sent = |place, scope: &Scope| -> Vec<u16> {
        let cells = scope.cells().map(|(ground, electrode)| (usize::from(ground), usize::from(electrode)));
        cells.map(|(ground, electrode)| table::reading(place, ground, electrode) << 1).collect()
    };
    for (frame, count) in frames.iter().zip(0..) {
        ensure!(Some(&frame.scope) == plan.scope(count % 2, 16).as_ref(), "frame {count} has other rows");
    }
    // The table goes on whenever electrode 0 is grounded again: two frames of the plan are one of the table's.
    let follows = |first: &usize| {
        let places = (0..).map(|count| (first + count / 2) % table::FRAMES);
        frames.iter().zip(places).all(|(frame, place)| frame.readings[..] == sent(place, &frame.scope)[..])
    };
    ensure!((0..table::FRAMES).any(|first| follows(&first)), "the readings are not the table's");
    host.send(&Command::Scan(Plan { reads: 1 << 16, ..plan }))?;
    host.wait_for(|message| matches!(message, BoardMessage::Fault(Fault::BadPlan { answers: 1 })).then_some(()))?;
    Ok(())
}

#[test]
fn settings_out_of_range_are_refused() -> Result<()> {
    let Some(elf) = elf()? else { return Ok(()) };
    let board = Qemu::start(elf, Request::Run)?;
    let mut host = Host::open(board.pty(), elf)?;
    let before = host.hello()?.settings;
    host.send(&Command::Configure(Settings { average_log2: 9, ..before }))?;
    host.wait_for(|message| matches!(message, BoardMessage::Fault(Fault::BadSettings { answers: 1 })).then_some(()))?;
    assert_eq!(host.hello()?.settings, before);
    Ok(())
}

#[test]
fn a_panic_is_told_after_the_reset() -> Result<()> {
    let Some(elf) = elf()? else { return Ok(()) };
    let board = Qemu::start(elf, Request::Panic)?;
    let mut host = Host::open(board.pty(), elf)?;
    host.hello()?;
    host.send(&Command::Start)?;
    let text = host.wait_for(|message| match message {
        BoardMessage::Fault(Fault::Panic(text)) => Some(text),
        _ => None,
    })?;
    assert!(text.ends_with(": as it was asked to"), "{text}");
    assert!(text.contains("main.rs:"), "{text}");
    // The board lives on, and does not tell it for ever.
    host.send(&Command::Start)?;
    host.frames(1)?;
    Ok(())
}

/// Files that a machine finds in its memory: the default detector's table, and readings of fingers at these places (m).
fn pressed(name: &str, places_m: &[[f64; 2]]) -> Result<[PathBuf; 2]> {
    let detector = Detector::default();
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let files = ["table", "press"].map(|kind| folder.join(format!("virt.{name}.{kind}")));
    std::fs::write(&files[0], compile(&Problem::of(&detector)?)?)?;
    let hand = Hand::relative(&detector);
    let scene = Scene::new(SceneName::Rest, &detector, hand, 1);
    let mut simulation = Simulation::new(&detector, scene, &[], 1)?;
    let tips = places_m.iter().filter_map(|at_m| hand.tip(*at_m, 0.5, 1.0).disc());
    simulation.controls().press(tips.collect());
    let readings = simulation.readings_v(0.0);
    let codes = readings.volts().iter().flat_map(|volts| {
        let code = (volts / detector.adc.lsb_v()).round();
        (code as u16).to_le_bytes()
    });
    std::fs::write(&files[1], codes.collect::<Vec<_>>())?;
    Ok(files)
}

/// Prints what contacts cost on a chip without floating-point hardware.
#[test]
fn contacts_cost_what_the_page_says() -> Result<()> {
    let Some(Built { contacts: elf, .. }) = built()? else { return Ok(()) };
    let places_m = [[0.011, -0.007], [-0.014, 0.009], [0.002, 0.019]];
    for count in 1..=places_m.len() {
        let [table, press] = pressed("cost", &places_m[..count])?;
        let figures = qemu::press(elf, Request::MeasureContacts, &table, &press)?;
        print!("{count} contacts\n{figures}");
    }
    Ok(())
}

/// Without a host, a command or a program: a table is in its memory.
#[test]
fn a_board_that_is_a_touch_screen_tells_a_press_and_its_end_by_itself() -> Result<()> {
    let Some(Built { hid: elf, .. }) = built()? else { return Ok(()) };
    let place_m = [0.011, -0.007];
    let [table, press] = pressed("hid", &[place_m])?;
    let printed = qemu::press(elf, Request::Press, &table, &press)?;
    let bytes = |line: &str| -> Option<Vec<u8>> {
        let bytes = line.strip_prefix("report: ")?.split(' ');
        bytes.map(|byte| u8::from_str_radix(byte, 16).ok()).collect()
    };
    let reports: Vec<_> = printed.lines().filter_map(bytes).collect();
    let size_m = |name: &str| -> Result<f64> {
        let um = printed.lines().find_map(|line| line.strip_prefix(name)).context("no size")?;
        Ok(1e-6 * um.parse::<f64>()?)
    };
    let size_m = [size_m("width um: ")?, size_m("height um: ")?];
    let (last, touching) = reports.split_last().context("no report")?;
    // It lands in the first of 20 frames, is searched while some go by, and stays in the one in which it lifts.
    ensure!((14..=20).contains(&touching.len()), "{printed}");
    for report in &reports {
        let is_last = std::ptr::eq(report, last);
        ensure!(report.len() == REPORT_BYTES && report[0] == TOUCH_ID && report[REPORT_BYTES - 1] == 1, "{report:?}");
        ensure!((report[1] == 1) != is_last && report[2] == 1, "{report:?}");
        let place = |at: usize| f64::from(u16::from_le_bytes([report[at], report[at + 1]])) / f64::from(LAST_PLACE);
        let at_m = [(place(3) - 0.5) * size_m[0], (0.5 - place(5)) * size_m[1]];
        ensure!((at_m[0] - place_m[0]).hypot(at_m[1] - place_m[1]) < 1e-3, "{at_m:?}");
    }
    Ok(())
}

#[test]
fn a_frame_costs_the_same_in_every_run() -> Result<()> {
    let Some(elf) = elf()? else { return Ok(()) };
    let figures = qemu::measure(elf)?;
    print!("{figures}");
    assert_eq!(figures, qemu::measure(elf)?);
    let instructions: u64 = figures
        .lines()
        .find_map(|line| line.strip_prefix("instructions a frame outside conversions: "))
        .context("no figure")?
        .parse()?;
    // What the simulated boards take for a frame, and what the page says, is what was measured.
    let taken = tactomo::board::simulated::FRAME_INSTRUCTIONS;
    assert_eq!(instructions, taken, "host/board/src/simulated/model.rs");
    let page = include_str!("../../../docs/firmware.md");
    let told = format!("{} {:03}", taken / 1000, taken % 1000);
    assert_eq!(page.matches(&format!("{told} instructions")).count(), 3, "docs/firmware.md");
    Ok(())
}
