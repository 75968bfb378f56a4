//! The simulated board: the firmware library, unchanged, over simulated pins and a simulated converter, in a thread of its own.
//!
//! The board has a clock of its own, which conversions and delays move on; its thread runs ahead and sleeps once a frame until the
//! wall clock has caught up. At the settings after a reset a frame of 16 electrodes takes 16 (20 us + 16 x 2 us) = 832 us.

mod circuit;
mod line;

use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tactomo_firmware::mux::Transparent;
use tactomo_firmware::{Activity, Adc, Board32, Identity, NewBoardError, Parts};

use self::circuit::{AddressPin, Circuit, SimulatedChip, SimulatedSampler};
use self::line::{BoardEnd, Line};
use crate::link::{Control, ControlError, Link, Playing};
use tactomo_physics::detector::Detector;
use tactomo_physics::simulate::{Controls, Physics, Simulation};

/// How far the board's clock may run ahead within a frame before the thread sleeps.
const AHEAD: Duration = Duration::from_millis(5);
/// How far it may fall behind before the lost time is given up, so that a busy machine is not made busier.
const BEHIND: Duration = Duration::from_millis(20);
/// Longest sleep of a board with nothing to do.
const IDLE: Duration = Duration::from_millis(5);
/// Longest wait for bytes of one read.
const READ_WAIT: Duration = Duration::from_millis(50);
/// Longest wait for room of one write.
const WRITE_WAIT: Duration = Duration::from_secs(1);

/// Electrodes are addressed by five lines, as an ADG732 has them: 32 are the most that the protocol carries.
type SimulatedFirmware = Board32<Transparent<AddressPin, 5>, SimulatedSampler, BoardEnd, SimulatedChip>;

/// How the simulated board differs from one of the detector's description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Seed of the converter's noise.
    pub seed: u64,
    /// Bits a second of its UART (ten bits a byte, FIFO of 128 bytes); `None` for USB, as fast as the host reads.
    pub baud: Option<u32>,
}

impl Default for Options {
    fn default() -> Self {
        Self { seed: 1, baud: None }
    }
}

/// A simulated board that cannot be started.
#[derive(Debug, thiserror::Error)]
pub enum SimulatedBoardError {
    /// The firmware does not take the detector.
    #[error("the board cannot scan detector `{detector}`: {source}")]
    Board {
        /// Name of the detector.
        detector: String,
        /// Why not.
        source: NewBoardError,
    },
    /// The protocol has voltages as whole millivolts up to 65535.
    #[error("detector `{detector}`: {field} is {volts} V; a board can report 0.001 V to 65.535 V")]
    Voltage {
        /// Name of the detector.
        detector: String,
        /// Which voltage.
        field: &'static str,
        /// Its value (V).
        volts: f64,
    },
    /// No thread for it.
    #[error("no thread for the simulated board")]
    Thread(#[source] io::Error),
}

/// The host's end of a simulated board's line; the board stops when this is dropped.
pub struct SimulatedBoard {
    line: Arc<Line>,
    /// `None` if the physics are given from outside.
    controls: Option<Controls>,
    thread: Option<JoinHandle<()>>,
}

impl SimulatedBoard {
    /// Starts the firmware on a board with a simulation of `detector`, of which presses, scene and faults can be [changed](Control).
    ///
    /// # Errors
    /// [`SimulatedBoardError`] if the firmware or the protocol cannot carry the detector.
    pub fn simulate(
        detector: &Detector,
        simulation: Simulation,
        options: Options,
    ) -> Result<Self, SimulatedBoardError> {
        let controls = simulation.controls();
        let mut board = Self::start(detector, Box::new(simulation), options)?;
        board.controls = Some(controls);
        Ok(board)
    }

    /// Starts the firmware on a board with `detector`, which answers to touch as `physics` says.
    ///
    /// # Errors
    /// [`SimulatedBoardError`] if the firmware or the protocol cannot carry the detector.
    pub fn start(
        detector: &Detector,
        physics: Box<dyn Physics>,
        options: Options,
    ) -> Result<Self, SimulatedBoardError> {
        let circuit = Arc::new(Circuit::default());
        let line = Arc::new(Line::default());
        let board = firmware(detector, physics, options, &circuit, &line)?;
        let thread = {
            let line = Arc::clone(&line);
            thread::Builder::new().name("simulated board".to_owned()).spawn(move || run(board, &circuit, &line))
        };
        Ok(Self { line, controls: None, thread: Some(thread.map_err(SimulatedBoardError::Thread)?) })
    }
}

impl Link for SimulatedBoard {
    fn name(&self) -> String {
        "simulated board".to_owned()
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.line.up.take_within(buffer, READ_WAIT)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.line.down.put_all_within(bytes, WRITE_WAIT)
    }

    fn control(&mut self, control: &Control) -> Result<(), ControlError> {
        let Some(controls) = &self.controls else { return Err(ControlError::Fixed) };
        match control {
            Control::Press(contacts) => controls.press(contacts.clone()),
            Control::Scene(name) => controls.play(*name)?,
            Control::Faults(faults) => {
                let failed = |error| tracing::warn!("the detector cannot have these faults: {error}");
                controls.set_faults(faults.clone(), failed)?;
            }
            Control::Pause(_) | Control::Seek(_) | Control::Speed(_) | Control::Loop(_) => {
                return Err(ControlError::Simulated);
            }
        }
        Ok(())
    }

    fn playing(&self) -> Playing {
        match &self.controls {
            Some(controls) => Playing::Simulated { scene: controls.scene(), faults: controls.faults() },
            None => Playing::Board,
        }
    }
}

impl Drop for SimulatedBoard {
    fn drop(&mut self) {
        self.line.close();
        // A panic of the board's thread was reported when it happened.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// The firmware with everything it is made of.
fn firmware(
    detector: &Detector,
    physics: Box<dyn Physics>,
    options: Options,
    circuit: &Arc<Circuit>,
    line: &Arc<Line>,
) -> Result<SimulatedFirmware, SimulatedBoardError> {
    let parts = Parts {
        mux: Transparent::new([0, 1, 2, 3, 4].map(|line| AddressPin::new(circuit, line))),
        sampler: SimulatedSampler::new(circuit, physics, detector.adc, options.seed),
        serial: BoardEnd::new(line, circuit, options.baud),
        chip: SimulatedChip::new(circuit),
    };
    let refused = |source| SimulatedBoardError::Board { detector: detector.name.clone(), source };
    if !(1..=16).contains(&detector.adc.bits) {
        return Err(refused(NewBoardError::AdcBits(detector.adc.bits)));
    }
    let identity = Identity {
        firmware_version: env!("CARGO_PKG_VERSION"),
        board: "simulated",
        electrodes: u8::try_from(detector.electrodes.len()).unwrap_or(u8::MAX),
        adc: Adc::new(detector.adc.bits, millivolts(detector, "adc.full_scale_v", detector.adc.full_scale_v)?),
        drive_mv: millivolts(detector, "drive_v", detector.drive_v)?,
    };
    SimulatedFirmware::new(parts, identity).map_err(refused)
}

fn millivolts(detector: &Detector, field: &'static str, volts: f64) -> Result<u16, SimulatedBoardError> {
    let rounded_mv = (1000.0 * volts).round();
    if !(1.0..=f64::from(u16::MAX)).contains(&rounded_mv) {
        return Err(SimulatedBoardError::Voltage { detector: detector.name.clone(), field, volts });
    }
    Ok(rounded_mv as u16)
}

/// Runs the board until the host lets go of the line.
fn run(mut board: SimulatedFirmware, circuit: &Circuit, line: &Line) {
    // Even if the board's thread panics, the host is not left waiting.
    let _closes = line::CloseOnDrop(line);
    let clocks = Clocks { circuit, start: Instant::now() };
    while line.is_open() {
        match board.step() {
            Ok(Activity::Row) => clocks.wait_if_ahead_by(AHEAD),
            Ok(Activity::Frame) => clocks.wait_if_ahead_by(Duration::ZERO),
            Ok(Activity::Idle) => clocks.idle(line, IDLE),
            Ok(Activity::Waiting { until_us }) => {
                clocks.idle(line, Duration::from_micros(until_us).saturating_sub(clocks.wall()).min(IDLE));
            }
            Err(never) => match never {},
        }
    }
}

/// The board's clock against the wall clock.
struct Clocks<'a> {
    circuit: &'a Circuit,
    start: Instant,
}

impl Clocks<'_> {
    fn wall(&self) -> Duration {
        self.start.elapsed()
    }

    /// Sleeps until the wall clock has caught up, if the board's is ahead by more than `bound`.
    fn wait_if_ahead_by(&self, bound: Duration) {
        let (board, wall) = (self.circuit.now(), self.wall());
        if board > wall + bound {
            thread::sleep(board - wall);
        } else if wall > board + BEHIND {
            self.circuit.advance_to(wall);
        }
    }

    /// Waits for a command, at most for `bound`; the board's time passes as the wall clock's does.
    fn idle(&self, line: &Line, bound: Duration) {
        line.down.wait(bound);
        self.circuit.advance_to(self.wall());
    }
}
