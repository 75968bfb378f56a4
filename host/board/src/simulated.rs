//! The simulated board: the firmware library, unchanged, over simulated pins and a simulated converter, in a thread of its own.
//!
//! The board has a clock of its own, which conversions, delays and the firmware's own work move on; its thread runs ahead and sleeps once a
//! frame until the wall clock has caught up. [`BoardModel`] says which board it is. At the settings after a reset a scan of 16
//! electrodes takes the ideal one 16 (20 us + 16 x 2 us) = 832 us.

mod circuit;
mod converter;
mod line;
mod model;
mod pads;
mod sampler;

use std::convert::Infallible;
use std::io;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use tactomo_firmware::mux::{LatchLines, Latched, Transparent};
use tactomo_firmware::{Activity, Adc, Board32, ContactFinder, Identity, Mux, NewBoardError, Parts, RamStore};

use self::circuit::{Circuit, MuxLine, MuxPin, SimulatedChip};
use self::line::{BoardEnd, Line};
use self::model::Wiring;
pub use self::model::{BoardModel, FRAME_INSTRUCTIONS, UnknownBoard};
use self::sampler::SimulatedSampler;
use crate::link::{Control, ControlError, Link, Playing};
use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_physics::simulate::{Controls, Physics, Simulation};
use tactomo_protocol::MAX_READINGS;

/// How far the board's clock may run ahead within a frame before the thread sleeps.
const AHEAD: Duration = Duration::from_millis(5);
/// How far it may fall behind before the lost time is given up, so that a busy machine is not made busier.
const BEHIND: Duration = Duration::from_millis(20);
/// Longest sleep of a board with nothing to do.
const IDLE: Duration = Duration::from_millis(5);
/// Longest sleep of a board with nothing to do but to send: a third of what its FIFO takes to empty.
const FULL: Duration = Duration::from_micros(400);
/// Longest wait for bytes of one read.
const READ_WAIT: Duration = Duration::from_millis(50);
/// Longest wait for room of one write.
const WRITE_WAIT: Duration = Duration::from_secs(1);

/// Room for a table (bytes): that of a detector of 32 electrodes has 196 kB.
const TABLE_BYTES: usize = 256 * 1024;

/// Contacts that the board finds by itself, by a table in memory.
type Finder = ContactFinder<RamStore<Vec<u8>>, MAX_READINGS>;
type SimulatedFirmware<M> = Board32<M, SimulatedSampler, BoardEnd, SimulatedChip, Finder>;
/// One step of the firmware, whatever its multiplexer.
type Step = Box<dyn FnMut() -> Activity + Send>;

/// Which board is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Seed of the converter's noise, and of what is not as it should be in this one chip.
    pub seed: u64,
    /// The board.
    pub model: BoardModel,
}

impl Default for Options {
    fn default() -> Self {
        Self { seed: 1, model: BoardModel::default() }
    }
}

/// A simulated board that cannot be started.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulatedBoardError {
    /// The firmware does not take the detector.
    #[error("the board cannot scan detector `{detector}`")]
    Board {
        /// Name of the detector.
        detector: String,
        /// Why not.
        source: NewBoardError,
    },
    /// The board has fewer inputs.
    #[error(
        "detector `{detector}` has {electrodes} electrodes; a {board} board has inputs for {most}: choose the ideal board"
    )]
    Electrodes {
        /// Name of the detector.
        detector: String,
        /// Its electrodes.
        electrodes: usize,
        /// Name of the board.
        board: &'static str,
        /// Most electrodes that it has inputs for.
        most: usize,
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
///
/// ```
/// use tactomo_board::link::Link;
/// use tactomo_board::simulated::{BoardModel, Options, SimulatedBoard};
/// use tactomo_physics::detector::Detector;
/// use tactomo_physics::scene::{Hand, Scene, SceneName};
/// use tactomo_physics::simulate::Simulation;
///
/// let detector = Detector::default();
/// let scene = Scene::new(SceneName::Rest, &detector, Hand::relative(&detector), 1);
/// let simulation = Simulation::new(&detector, scene, &[], 1)?;
/// let board = SimulatedBoard::simulate(&detector, simulation, Options { seed: 1, model: BoardModel::Ideal })?;
/// assert!(board.name().contains("simulated"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct SimulatedBoard {
    line: Arc<Line>,
    circuit: Arc<Circuit>,
    model: BoardModel,
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
        let circuit = Arc::new(Circuit::new(options.model.figures().row_work_ns));
        let line = Arc::new(Line::new(options.model.figures()));
        let step = firmware(detector, physics, options, &circuit, &line)?;
        let thread = {
            let (line, circuit) = (Arc::clone(&line), Arc::clone(&circuit));
            thread::Builder::new().name("simulated board".to_owned()).spawn(move || run(step, &circuit, &line))
        };
        let thread = Some(thread.map_err(SimulatedBoardError::Thread)?);
        Ok(Self { line, circuit, model: options.model, controls: None, thread })
    }

    /// Puts a USB bridge in the line that keeps rates up to this one (bits a second), and garbles bytes above it.
    pub fn set_bridge_baud(&self, most: u32) {
        self.line.set_bridge_baud(most);
    }

    /// A clock that tells when the scene began.
    pub fn scene_clock(&self) -> SceneClock {
        SceneClock(Arc::clone(&self.circuit))
    }
}

/// When the scene of a simulated board began.
#[derive(Clone, Debug)]
pub struct SceneClock(Arc<Circuit>);

impl SceneClock {
    /// Board time at which the scene began (s): with the first scan; `None` before.
    pub fn began_s(&self) -> Option<f64> {
        self.0.scene_began_ns().map(pads::seconds)
    }
}

impl Link for SimulatedBoard {
    fn name(&self) -> String {
        self.model.figures().link.to_owned()
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.line.up.take_within(buffer, READ_WAIT)
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.line.down.put_all_within(bytes, WRITE_WAIT)
    }

    fn baud(&self) -> Option<u32> {
        self.line.host_baud()
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        self.line.set_host_baud(baud)
    }

    fn control(&mut self, control: &Control) -> Result<(), ControlError> {
        let Some(controls) = &self.controls else { return Err(ControlError::Fixed) };
        match control {
            Control::Press(contacts) => controls.press(contacts.clone()),
            Control::Scene(name) => controls.play(*name)?,
            Control::Faults(faults) => {
                let failed = |error| tracing::warn!("the detector cannot have these faults: {}", with_causes(&error));
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
) -> Result<Step, SimulatedBoardError> {
    let figures = options.model.figures();
    let identity = identity(detector, options.model)?;
    let sampler = SimulatedSampler::new(circuit, physics, figures, detector, options.seed);
    let serial = BoardEnd::new(line, circuit, figures);
    let chip = SimulatedChip::new(circuit);
    let pin = |line| MuxPin::new(circuit, line);
    let address = |bit| pin(MuxLine::Address(bit));
    let touch = ContactFinder::new(RamStore::new([(); 2].map(|()| vec![0; TABLE_BYTES])));
    let made = match figures.wiring {
        // Five lines, as an ADG732 has them: 32 electrodes are the most that the protocol carries.
        Wiring::Transparent => {
            let mux = Transparent::new([0, 1, 2, 3, 4].map(address));
            steps(Parts { mux, sampler, serial, chip, touch }, identity)
        }
        Wiring::Latched => {
            let lines = LatchLines { wr: pin(MuxLine::Wr), csa: pin(MuxLine::Csa), csb: pin(MuxLine::Csb) };
            let mux = match Latched::new([0, 1, 2, 3].map(address), lines) {
                Ok(mux) => mux,
                Err(never) => match never {},
            };
            steps(Parts { mux, sampler, serial, chip, touch }, identity)
        }
    };
    made.map_err(|source| SimulatedBoardError::Board { detector: detector.name.clone(), source })
}

fn steps<M>(
    parts: Parts<M, SimulatedSampler, BoardEnd, SimulatedChip, Finder>,
    identity: Identity,
) -> Result<Step, NewBoardError>
where
    M: Mux<Error = Infallible> + Send + 'static,
{
    let mut board = SimulatedFirmware::new(parts, identity)?;
    Ok(Box::new(move || match board.step() {
        Ok(activity) => activity,
        Err(never) => match never {},
    }))
}

/// What the board says of itself.
fn identity(detector: &Detector, model: BoardModel) -> Result<Identity<'static>, SimulatedBoardError> {
    let name = || detector.name.clone();
    let (electrodes, most) = (detector.electrodes.len(), model.most_electrodes());
    if model != BoardModel::Ideal && electrodes > most {
        let board = model.figures().name;
        return Err(SimulatedBoardError::Electrodes { detector: name(), electrodes, board, most });
    }
    Ok(Identity {
        firmware_version: env!("CARGO_PKG_VERSION"),
        board: model.figures().name,
        electrodes: u8::try_from(electrodes).unwrap_or(u8::MAX),
        adc: adc(detector, model)?,
        drive_mv: millivolts(detector, "drive_v", detector.drive_v + detector.ground_v)?,
    })
}

/// The board's own converter, or the one that the detector's description has.
fn adc(detector: &Detector, model: BoardModel) -> Result<Adc, SimulatedBoardError> {
    let bits = detector.adc.bits;
    match model.firmware_adc() {
        Some(adc) => Ok(adc),
        None if (1..=16).contains(&bits) => {
            Ok(Adc::new(bits, millivolts(detector, "adc.full_scale_v", detector.adc.full_scale_v)?))
        }
        None => {
            let source = NewBoardError::AdcBits(bits);
            Err(SimulatedBoardError::Board { detector: detector.name.clone(), source })
        }
    }
}

fn millivolts(detector: &Detector, field: &'static str, volts: f64) -> Result<u16, SimulatedBoardError> {
    let rounded_mv = (1000.0 * volts).round();
    if !(1.0..=f64::from(u16::MAX)).contains(&rounded_mv) {
        return Err(SimulatedBoardError::Voltage { detector: detector.name.clone(), field, volts });
    }
    Ok(rounded_mv as u16)
}

/// Runs the board until the host lets go of the line.
fn run(mut step: Step, circuit: &Circuit, line: &Line) {
    // Even if the board's thread panics, the host is not left waiting.
    let _closes = line::CloseOnDrop(line);
    while line.is_open() {
        match step() {
            Activity::Row => wait_if_ahead_by(AHEAD, circuit),
            Activity::Frame => wait_if_ahead_by(Duration::ZERO, circuit),
            Activity::Idle if line.is_full() => idle(line, circuit, FULL),
            Activity::Idle => idle(line, circuit, IDLE),
            Activity::Waiting { until_us } => {
                idle(line, circuit, Duration::from_micros(until_us).saturating_sub(circuit.wall()).min(IDLE));
            }
        }
    }
}

/// Sleeps until the wall clock has caught up, if the board's is ahead by more than `bound`.
fn wait_if_ahead_by(bound: Duration, circuit: &Circuit) {
    let (board, wall) = (circuit.now(), circuit.wall());
    if board > wall + bound {
        circuit.wait_until(board);
    } else if wall > board + BEHIND {
        circuit.advance_to(wall);
    }
}

/// Waits for a command, at most for `bound`; the board's time passes as the wall clock's does.
fn idle(line: &Line, circuit: &Circuit, bound: Duration) {
    line.down.wait(bound);
    circuit.advance_to(circuit.wall());
}
