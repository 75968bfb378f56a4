//! The circuit around the simulated firmware: address lines, converter, and the clock that both move on.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering::Relaxed};
use std::time::Duration;

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, OutputPin};
use tactomo_firmware::{Chip, Sampler, TimedOut};

use tactomo_physics::detector::Adc;
use tactomo_physics::readings::Readings;
use tactomo_physics::simulate::{Noise, Physics, code};

/// Time of one conversion, the firmware's share included: that of a fast SAR converter.
const CONVERSION_NS: u64 = 2_000;

/// What pins, converter and chip share. Only the board's thread touches it.
#[derive(Debug, Default)]
pub(super) struct Circuit {
    now_ns: AtomicU64,
    /// The electrode on the address lines: the grounded one.
    address: AtomicU8,
    /// Times that an address line was driven, which tells a ground set anew from one that stayed.
    writes: AtomicU64,
    /// When that was last.
    written_ns: AtomicU64,
}

impl Circuit {
    /// Board time since the reset.
    pub(super) fn now(&self) -> Duration {
        Duration::from_nanos(self.now_ns.load(Relaxed))
    }

    /// Moves the board's clock on to `time`, never back.
    pub(super) fn advance_to(&self, time: Duration) {
        self.now_ns.fetch_max(time.as_nanos() as u64, Relaxed);
    }

    fn advance(&self, ns: u64) {
        self.now_ns.fetch_add(ns, Relaxed);
    }

    fn note_write(&self) {
        self.writes.fetch_add(1, Relaxed);
        self.written_ns.store(self.now_ns.load(Relaxed), Relaxed);
    }
}

/// One address line of the multiplexer.
#[derive(Debug)]
pub(super) struct AddressPin {
    circuit: Arc<Circuit>,
    mask: u8,
}

impl AddressPin {
    pub(super) fn new(circuit: &Arc<Circuit>, line: u8) -> Self {
        Self { circuit: Arc::clone(circuit), mask: 1 << line }
    }
}

impl ErrorType for AddressPin {
    type Error = Infallible;
}

impl OutputPin for AddressPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.circuit.address.fetch_and(!self.mask, Relaxed);
        self.circuit.note_write();
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.circuit.address.fetch_or(self.mask, Relaxed);
        self.circuit.note_write();
        Ok(())
    }
}

/// Clock and delay of the simulated chip. It has no watchdog: nothing outside its thread could hold it up.
#[derive(Debug)]
pub(super) struct SimulatedChip(Arc<Circuit>);

impl SimulatedChip {
    pub(super) fn new(circuit: &Arc<Circuit>) -> Self {
        Self(Arc::clone(circuit))
    }
}

impl DelayNs for SimulatedChip {
    fn delay_ns(&mut self, ns: u32) {
        self.0.advance(u64::from(ns));
    }
}

impl Chip for SimulatedChip {
    fn now_us(&mut self) -> u64 {
        self.0.now().as_micros() as u64
    }

    fn feed_watchdog(&mut self) {}
}

/// The converter on the pads of a simulated detector. The scene stands still for the length of a scan.
pub(super) struct SimulatedSampler {
    circuit: Arc<Circuit>,
    physics: Box<dyn Physics>,
    adc: Adc,
    noise: Noise,
    /// Pad voltages of the scan under way.
    readings: Option<Readings>,
    /// Writes to the address lines when the last scan began.
    begun_at_write: u64,
    /// When the first scan began: the scene begins with it, however long the host took to start the board.
    first_scan: Option<Duration>,
}

impl SimulatedSampler {
    pub(super) fn new(circuit: &Arc<Circuit>, physics: Box<dyn Physics>, adc: Adc, seed: u64) -> Self {
        Self {
            circuit: Arc::clone(circuit),
            physics,
            adc,
            noise: Noise::new(seed),
            readings: None,
            begun_at_write: 0,
            first_scan: None,
        }
    }

    /// Asks for the pad voltages anew, as they were at that moment, if electrode 0 was grounded since the last time: a scan
    /// begins there.
    fn readings(&mut self, ground: u8) -> &Readings {
        let writes = self.circuit.writes.load(Relaxed);
        if ground == 0 && writes != self.begun_at_write {
            self.begun_at_write = writes;
            self.readings = None;
        }
        let begun = Duration::from_nanos(self.circuit.written_ns.load(Relaxed));
        let first = *self.first_scan.get_or_insert(begun);
        self.readings.get_or_insert_with(|| self.physics.readings_v((begun - first).as_secs_f64()))
    }

    /// The code nearest to a voltage (V), with noise.
    fn convert(&mut self, volts: f64) -> u16 {
        // The board refuses converters of more than 16 bits.
        code(volts, &self.adc, &mut self.noise).min(u32::from(u16::MAX)) as u16
    }
}

impl Sampler for SimulatedSampler {
    fn sample(&mut self, electrode: u8) -> Result<u16, TimedOut> {
        let ground = self.circuit.address.load(Relaxed);
        let volts = self.readings(ground).at(usize::from(ground), usize::from(electrode));
        self.circuit.advance(CONVERSION_NS);
        Ok(self.convert(volts))
    }
}
