//! Firmware of the emulated board: QEMU's riscv32 `virt` machine with a table of frames for an ADC.
//!
//! Everything else is what a chip runs: the firmware library, the wire, the log, the panic record.
#![no_std]
#![no_main]

mod detector;
mod gauge;
mod machine;
mod table;
mod uart;

use core::cell::Cell;
use core::panic::PanicInfo;

use embedded_hal::delay::DelayNs;
use tactomo_firmware::mux::Transparent;
use tactomo_firmware::{Activity, Adc, Board16, Chip, Identity, Parts, Serial, log};
use tactomo_protocol::{Command, Fault, MAX_COMMAND, Output, Request as HostRequest, encode_request};

use crate::detector::{AddressLine, Played, TableSampler, address_lines};
use crate::gauge::Gauge;
use crate::machine::Request;
use crate::uart::Uart;

const IDENTITY: Identity = Identity {
    firmware_version: env!("CARGO_PKG_VERSION"),
    board: "virt",
    electrodes: table::ELECTRODES as u8,
    adc: Adc::new(table::ADC_BITS, 3300),
    drive_mv: 2000,
};

/// Scan from which something presses: by then readings at rest are known.
const PRESSED_FROM: u32 = 80;
/// Frames in which a search ends: 400 pieces, one after each of 16 rows.
const SEARCH_FRAMES: u64 = 26;
/// Frames that a measurement of contacts counts after the search.
const FOLLOWED_FRAMES: u64 = 32;
/// Frames that something presses a touch screen, and as many after that.
const PRESS_FRAMES: u32 = 20;
/// Frames that a measurement counts after the first: every 32nd is sent as it is.
const MEASURED_FRAMES: u64 = 4 * 32;

/// What finds contacts: nothing, or, so that what a frame costs stays that of a board without, by a feature.
#[cfg(not(feature = "contacts"))]
type Finder = tactomo_firmware::NoTouch;
#[cfg(all(feature = "contacts", not(feature = "hid")))]
type Finder = tactomo_firmware::ContactFinder<Store, READINGS>;
#[cfg(feature = "hid")]
type Finder = tactomo_firmware::Digitizer<Store, Report, READINGS>;
#[cfg(feature = "contacts")]
type Store = tactomo_firmware::RamStore<&'static mut [u8]>;
#[cfg(feature = "contacts")]
const READINGS: usize = table::ELECTRODES * table::ELECTRODES;
type VirtBoard<'a> = Board16<Transparent<AddressLine<'a>>, TableSampler<'a>, Line, VirtChip<'a>, Finder>;

defmt::timestamp!("{=u64:us}", machine::now_us());

#[allow(missing_docs, reason = "the macro makes a public symbol of it")]
#[riscv_rt::entry]
fn main() -> ! {
    gauge::paint_stack();
    let request = Request::read();
    let (levels, gauge) = (Cell::new(0), Gauge::default());
    let played = match request {
        Request::Measure => Played::Rest,
        Request::MeasureContacts => Played::Press { from: PRESSED_FROM, to: u32::MAX },
        Request::Press => Played::Press { from: PRESSED_FROM, to: PRESSED_FROM + PRESS_FRAMES },
        _ => Played::Table,
    };
    let parts = Parts {
        mux: Transparent::new(address_lines(&levels)),
        sampler: TableSampler::new(&levels, &gauge, played),
        serial: Line::new(request),
        chip: VirtChip(&gauge),
        touch: touch(),
    };
    let mut board = match VirtBoard::new(parts, IDENTITY) {
        Ok(board) => board,
        Err(_) => panic!("the board's identity does not fit"),
    };
    match request {
        Request::Measure => measure(&mut board, &gauge),
        Request::MeasureContacts => measure_contacts(&mut board, &gauge),
        Request::Press => watch_press(&mut board),
        _ => serve(&mut board, request),
    }
}

#[cfg(not(feature = "contacts"))]
fn touch() -> Finder {
    tactomo_firmware::NoTouch
}

#[cfg(feature = "contacts")]
fn touch() -> Finder {
    let finder = tactomo_firmware::ContactFinder::new(Store::new(machine::table_memory()));
    #[cfg(feature = "hid")]
    let finder = tactomo_firmware::Digitizer::new(finder, Report(Uart::new()));
    finder
}

/// Serves the host, as a chip would.
fn serve(board: &mut VirtBoard, request: Request) -> ! {
    let last_panic = machine::panic_record().take();
    let panics = request == Request::Panic && last_panic.is_none();
    if let Some(text) = last_panic {
        board.report(Fault::Panic(text));
    }
    let mut streamed = false;
    loop {
        let Ok(activity) = board.step();
        match activity {
            Activity::Frame if panics => panic!("as it was asked to"),
            Activity::Frame if !streamed => {
                defmt::info!("the first of {=usize} frames is out", table::FRAMES);
                streamed = true;
            }
            Activity::Idle if streamed && request == Request::ExitOnStop => machine::exit(),
            _ => {}
        }
    }
}

/// Prints what a frame costs, and leaves.
fn measure(board: &mut VirtBoard, gauge: &Gauge) -> ! {
    while board.step() != Ok(Activity::Frame) {}
    let start = gauge.count();
    let mut frames = 0;
    while frames < MEASURED_FRAMES {
        frames += u64::from(board.step() == Ok(Activity::Frame));
    }
    let instructions = (gauge.count() - start) / frames;
    Report(Uart::new()).line(&[
        ("instructions a frame outside conversions", instructions),
        ("stack bytes", gauge::stack_used_bytes() as u64),
        ("board bytes", size_of_val(board) as u64),
    ]);
    machine::exit()
}

/// Prints what contacts cost, and leaves.
fn measure_contacts(board: &mut VirtBoard, gauge: &Gauge) -> ! {
    let mut frames = |count| {
        let start = gauge.count();
        (0..count).for_each(|_| while board.step() != Ok(Activity::Frame) {});
        (gauge.count() - start) / count
    };
    frames(u64::from(PRESSED_FROM) - 1);
    let at_rest = frames(1);
    let landing = frames(1);
    // A search goes on between rows, and has ended by then.
    let searched = frames(SEARCH_FRAMES);
    let following = frames(FOLLOWED_FRAMES);
    let search = searched.saturating_sub(following) * SEARCH_FRAMES;
    Report(Uart::new()).line(&[
        ("instructions a frame at rest", at_rest),
        ("instructions a frame in which something lands", landing),
        ("instructions of a search beside frames that are followed", search),
        ("instructions a frame that is followed", following),
        ("stack bytes", gauge::stack_used_bytes() as u64),
        ("board bytes", size_of_val(board) as u64),
    ]);
    machine::exit()
}

/// Runs without a host until a press is over, and leaves. The touch screen prints its reports.
fn watch_press(board: &mut VirtBoard) -> ! {
    for _ in 0..PRESSED_FROM + 2 * PRESS_FRAMES {
        while !matches!(board.step(), Ok(Activity::Frame | Activity::Idle)) {}
    }
    machine::exit()
}

/// The line to the host: the UART, after what a measurement says in the host's place.
struct Line {
    uart: Uart,
    command: [u8; MAX_COMMAND],
    command_length: usize,
}

impl Line {
    fn new(request: Request) -> Self {
        let mut command = [0; MAX_COMMAND];
        let commands: &[Command] = match request {
            Request::Measure => &[Command::Start],
            Request::MeasureContacts => &[Command::Output(Output::Contacts), Command::Start],
            Request::Press => &[],
            _ => return Self { uart: Uart::new(), command, command_length: 0 },
        };
        static mut NOWHERE: [u8; 8] = [0; 8];
        let nowhere = &raw mut NOWHERE;
        // SAFETY: taken once, here.
        let uart = Uart::nowhere(unsafe { &mut *nowhere });
        let mut command_length = 0;
        for command_to_send in commands {
            let request = HostRequest { tag: 1, command: command_to_send.clone() };
            command_length +=
                command.get_mut(command_length..).map_or(0, |rest| encode_request(&request, rest).unwrap_or(0));
        }
        Self { uart, command, command_length }
    }
}

impl Serial for Line {
    fn push(&mut self, bytes: &[u8]) -> usize {
        self.uart.push(bytes)
    }

    fn pull(&mut self, buffer: &mut [u8]) -> usize {
        let length = core::mem::take(&mut self.command_length);
        if let Some(buffer) = buffer.get_mut(..length).filter(|buffer| !buffer.is_empty()) {
            buffer.copy_from_slice(&self.command[..length]);
            return length;
        }
        self.uart.pull(buffer)
    }
}

/// Writes text to the UART, for a person.
struct Report(Uart);

impl Report {
    fn line(&mut self, figures: &[(&str, u64)]) {
        for (name, value) in figures {
            // Cannot fail: the UART takes any text.
            let _ = core::fmt::write(self, format_args!("{name}: {value}\n"));
        }
    }
}

#[cfg(feature = "hid")]
impl tactomo_firmware::hid::ReportSink for Report {
    fn set_size(&mut self, size_m: [f32; 2]) {
        let [x_um, y_um] = size_m.map(|m| (1e6 * m) as u64);
        self.line(&[("width um", x_um), ("height um", y_um)]);
    }

    fn send(&mut self, report: &tactomo_firmware::hid::Report) -> bool {
        // Cannot fail: the UART takes any text.
        let _ = core::fmt::Write::write_str(self, "report:");
        report.iter().for_each(|byte| _ = core::fmt::write(self, format_args!(" {byte:02x}")));
        let _ = core::fmt::Write::write_str(self, "\n");
        true
    }
}

impl core::fmt::Write for Report {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        let mut rest = text.as_bytes();
        while !rest.is_empty() {
            rest = &rest[self.0.push(rest)..];
        }
        Ok(())
    }
}

/// Clock, delay and log; the machine has no watchdog.
struct VirtChip<'a>(&'a Gauge);

impl DelayNs for VirtChip<'_> {
    fn delay_ns(&mut self, ns: u32) {
        self.0.leave_out(|| machine::wait_ns(ns));
    }
}

impl Chip for VirtChip<'_> {
    fn now_us(&mut self) -> u64 {
        machine::now_us()
    }

    fn feed_watchdog(&mut self) {}

    fn pull_log(&mut self, buffer: &mut [u8]) -> usize {
        log::pull(buffer)
    }
}

#[panic_handler]
fn panic(panic: &PanicInfo) -> ! {
    machine::panic_record().store(panic.location(), panic.message());
    machine::reset()
}
