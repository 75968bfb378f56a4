//! Time that the library itself takes for a frame: parts that cost nothing, on the machine that runs the bench.
//!
//! `cargo bench -p tactomo-firmware`

use std::convert::Infallible;

use divan::Bencher;
use divan::counter::ItemsCount;
use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, OutputPin};
use tactomo_firmware::mux::{LatchLines, Latched, Transparent};
use tactomo_firmware::{Activity, Adc, Board16, Chip, Identity, Mux, NoTouch, Parts, Sampler, Serial, TimedOut};
use tactomo_protocol::{Command, MAX_COMMAND, Request, Settings, encode_request};

fn main() {
    divan::main();
}

/// A pin that leads nowhere.
struct NullPin;

impl ErrorType for NullPin {
    type Error = Infallible;
}

impl OutputPin for NullPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        divan::black_box(self);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        divan::black_box(self);
        Ok(())
    }
}

/// A converter whose codes need all twelve bits.
struct Codes(u16);

impl Sampler for Codes {
    fn sample(&mut self, _electrode: u8) -> Result<u16, TimedOut> {
        self.0 = self.0.wrapping_mul(25_173).wrapping_add(13_849);
        Ok(self.0 >> 4)
    }
}

/// A line that takes what a UART at 921600 baud sends during a conversion of 16 us, and brings the commands.
struct Line {
    commands: Vec<u8>,
    bytes_a_push: usize,
}

impl Serial for Line {
    fn push(&mut self, bytes: &[u8]) -> usize {
        bytes.len().min(self.bytes_a_push)
    }

    fn pull(&mut self, buffer: &mut [u8]) -> usize {
        let count = buffer.len().min(self.commands.len());
        buffer.iter_mut().zip(self.commands.drain(..count)).for_each(|(to, byte)| *to = byte);
        count
    }
}

struct NullChip;

impl DelayNs for NullChip {
    fn delay_ns(&mut self, _ns: u32) {}
}

impl Chip for NullChip {
    fn now_us(&mut self) -> u64 {
        0
    }

    fn feed_watchdog(&mut self) {}
}

fn commands(average_log2: u8) -> Vec<u8> {
    let settings = Settings { average_log2, ..Settings::default() };
    [Command::Configure(settings), Command::Start]
        .into_iter()
        .flat_map(|command| {
            let mut packet = [0; MAX_COMMAND];
            let request = Request { tag: 1, command };
            let length = encode_request(&request, &mut packet).unwrap_or_default();
            packet.into_iter().take(length)
        })
        .collect()
}

/// Time of a frame with this multiplexer and averaging.
fn frame<M: Mux<Error = Infallible>>(bencher: Bencher, mux: M, average_log2: u8) {
    let serial = Line { commands: commands(average_log2), bytes_a_push: 2 };
    let adc = Adc::new(12, 3300);
    let identity = Identity { firmware_version: "0", board: "bench", electrodes: 16, adc, drive_mv: 2000 };
    let parts = Parts { mux, sampler: Codes(1), serial, chip: NullChip, touch: NoTouch };
    let Ok(mut board) = Board16::new(parts, identity) else { return };
    let conversions = 256usize << average_log2;
    bencher.counter(ItemsCount::new(conversions)).bench_local(|| while board.step() != Ok(Activity::Frame) {});
}

#[divan::bench(args = [0, 4])]
fn transparent(bencher: Bencher, average_log2: u8) {
    frame(bencher, Transparent::new([NullPin, NullPin, NullPin, NullPin]), average_log2);
}

#[divan::bench(args = [0, 4])]
fn latched(bencher: Bencher, average_log2: u8) {
    let lines = LatchLines { wr: NullPin, csa: NullPin, csb: NullPin };
    let Ok(mux) = Latched::new([NullPin, NullPin, NullPin, NullPin], lines);
    frame(bencher, mux, average_log2);
}
