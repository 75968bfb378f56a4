//! The circuit around the simulated firmware: the multiplexer's lines and latches, and the clock of the board.

use std::convert::Infallible;
use std::sync::atomic::{AtomicU8, AtomicU16, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::{Duration, Instant};

use embedded_hal::delay::DelayNs;
use embedded_hal::digital::{ErrorType, OutputPin};
use tactomo_firmware::Chip;

/// What pins, converter and chip share. Only the board's thread changes it.
#[derive(Debug, Default)]
pub(super) struct Circuit {
    now_ns: AtomicU64,
    /// Levels of the multiplexer's lines: a bit for each [`MuxLine`]. All are low, and the switches transparent, until they are driven.
    levels: AtomicU16,
    /// The electrode that half A grounds, and the one that half B brings to the converter.
    grounded: AtomicU8,
    selected: AtomicU8,
    /// Times that half A took an address, which tells a ground set anew from one that stayed.
    groundings: AtomicU64,
    /// When either half last took one.
    grounded_ns: AtomicU64,
    selected_ns: AtomicU64,
    /// When the first scan began: the scene begins with it, however long the host took to start the board.
    scene_began_ns: OnceLock<u64>,
    /// When the board's clock began, by the wall clock.
    began: OnceLock<Instant>,
    /// The firmware's own work for a row.
    row_work_ns: u64,
}

/// A line of the multiplexer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MuxLine {
    /// Address bit 0 to 4.
    Address(u8),
    /// Write, active low.
    Wr,
    /// Chip selects of the halves, active low.
    Csa,
    Csb,
}

impl MuxLine {
    const ADDRESS: u16 = 0b1_1111;

    fn mask(self) -> u16 {
        match self {
            Self::Address(bit) => 1 << bit,
            Self::Wr => 1 << 5,
            Self::Csa => 1 << 6,
            Self::Csb => 1 << 7,
        }
    }
}

impl Circuit {
    /// The circuit of a board whose firmware works so long for a row (ns).
    pub(super) fn new(row_work_ns: u64) -> Self {
        Self { row_work_ns, ..Self::default() }
    }

    /// Board time since the reset.
    pub(super) fn now(&self) -> Duration {
        Duration::from_nanos(self.now_ns())
    }

    pub(super) fn now_ns(&self) -> u64 {
        self.now_ns.load(Relaxed)
    }

    /// Time since the board's clock began, by the wall clock: the board's own may be ahead of it, or behind.
    pub(super) fn wall(&self) -> Duration {
        self.began.get_or_init(Instant::now).elapsed()
    }

    /// Sleeps until the wall clock has caught up with a board time.
    pub(super) fn wait_until(&self, time: Duration) {
        thread::sleep(time.saturating_sub(self.wall()));
    }

    /// Moves the board's clock on to `time`, never back.
    pub(super) fn advance_to(&self, time: Duration) {
        self.now_ns.fetch_max(time.as_nanos() as u64, Relaxed);
    }

    pub(super) fn advance(&self, ns: u64) {
        self.now_ns.fetch_add(ns, Relaxed);
    }

    /// The grounded electrode.
    pub(super) fn grounded(&self) -> u8 {
        self.grounded.load(Relaxed)
    }

    /// The electrode at the one input of a board that has one.
    pub(super) fn selected(&self) -> u8 {
        self.selected.load(Relaxed)
    }

    pub(super) fn groundings(&self) -> u64 {
        self.groundings.load(Relaxed)
    }

    /// Board time of the last grounding (ns).
    pub(super) fn grounded_ns(&self) -> u64 {
        self.grounded_ns.load(Relaxed)
    }

    /// Board time of the first grounding under which anything was converted (ns).
    pub(super) fn scene_began_ns(&self) -> Option<u64> {
        self.scene_began_ns.get().copied()
    }

    /// The same; it is the last grounding if nothing was converted before.
    pub(super) fn scene_begins_ns(&self) -> u64 {
        *self.scene_began_ns.get_or_init(|| self.grounded_ns())
    }

    /// Board time of the last selection (ns).
    pub(super) fn selected_ns(&self) -> u64 {
        self.selected_ns.load(Relaxed)
    }

    /// A half follows the address while WR and its chip select are low, and keeps what it had otherwise. The firmware's work for a row passes
    /// before half A takes the row's address: before its first bit where the switch is transparent, before WR where it is latched.
    fn drive(&self, line: MuxLine, high: bool) {
        let mut levels = self.levels.load(Relaxed);
        levels = if high { levels | line.mask() } else { levels & !line.mask() };
        self.levels.store(levels, Relaxed);
        let follows = |select: MuxLine| levels & (MuxLine::Wr.mask() | select.mask()) == 0;
        if follows(MuxLine::Csa) && matches!(line, MuxLine::Address(0) | MuxLine::Wr) {
            self.advance(self.row_work_ns);
        }
        let (address, now_ns) = ((levels & MuxLine::ADDRESS) as u8, self.now_ns());
        if follows(MuxLine::Csa) {
            self.grounded.store(address, Relaxed);
            self.groundings.fetch_add(1, Relaxed);
            self.grounded_ns.store(now_ns, Relaxed);
        }
        if follows(MuxLine::Csb) {
            self.selected.store(address, Relaxed);
            self.selected_ns.store(now_ns, Relaxed);
        }
    }
}

/// The pin that drives a line of the multiplexer.
#[derive(Debug)]
pub(super) struct MuxPin {
    circuit: Arc<Circuit>,
    line: MuxLine,
}

impl MuxPin {
    pub(super) fn new(circuit: &Arc<Circuit>, line: MuxLine) -> Self {
        Self { circuit: Arc::clone(circuit), line }
    }
}

impl ErrorType for MuxPin {
    type Error = Infallible;
}

impl OutputPin for MuxPin {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.circuit.drive(self.line, false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.circuit.drive(self.line, true);
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
