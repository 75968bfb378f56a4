//! A board that finds contacts, on a simulated detector.

use std::cell::{Cell, RefCell};
use std::convert::Infallible;
use std::rc::Rc;
use std::sync::{Arc, LazyLock};

use embedded_hal_mock::eh1::delay::NoopDelay;
use tactomo::detector::Detector;
use tactomo::scene::{Contact, Hand, Scene, SceneName};
use tactomo::simulate::{self, Physics, Simulation};
use tactomo::solve::{Problem, compile};
use tactomo_firmware::{ContactFinder, Identity, Mux, RamStore, TimedOut, Touch};
use tactomo_protocol::{BoardMessage, Command, Contacts, Fault, MAX_PIECE, TablePiece, TableState};

use crate::parts::{IDENTITY, Outside, TestBoard, board_of, step};

/// Room for a table (bytes).
pub const ROOM: usize = 128 * 1024;

pub static DETECTOR: LazyLock<Detector> = LazyLock::new(Detector::default);
pub static TABLE: LazyLock<Arc<[u8]>> = LazyLock::new(|| compile(&Problem::of(&DETECTOR).unwrap()).unwrap().into());

/// Finds contacts by a table in memory.
pub type Finder = ContactFinder<RamStore<Vec<u8>>, 256>;

/// One whose memory has these bytes.
pub fn finder(memory: Vec<u8>) -> Finder {
    let other = vec![0; memory.len()];
    ContactFinder::new(RamStore::new([memory, other]))
}

/// Memory with the detector's table.
pub fn table_memory() -> Vec<u8> {
    memory_of(&TABLE)
}

/// Memory with a table.
pub fn memory_of(table: &[u8]) -> Vec<u8> {
    let mut memory = table.to_vec();
    memory.resize(ROOM, 0);
    memory
}

type Sample = Box<dyn FnMut(u64, u8) -> Result<u16, TimedOut>>;
type FindingBoard<T> = TestBoard<KnownGround, Sample, NoopDelay, T>;

/// A multiplexer that tells which electrode is grounded.
#[derive(Clone, Default)]
pub struct KnownGround(Rc<Cell<u8>>);

impl Mux for KnownGround {
    type Error = Infallible;
    const SELECT_US: u16 = 0;

    fn ground(&mut self, electrode: u8) -> Result<(), Infallible> {
        self.0.set(electrode);
        Ok(())
    }

    fn select(&mut self, _electrode: u8) -> Result<(), Infallible> {
        Ok(())
    }
}

/// A board with this touch part, the voltages that it reads, and its outside.
pub struct Bench<T> {
    pub board: FindingBoard<T>,
    volts: Rc<RefCell<Vec<f64>>>,
    pub outside: Outside,
    tag: u8,
    electrodes: usize,
}

impl<T: Touch> Bench<T> {
    pub fn new(touch: T) -> Self {
        Self::of(touch, IDENTITY, 0.0)
    }

    /// A board of this identity, whose ground is lifted by so much (V), and whose converter reads nothing below its floor.
    pub fn of(touch: T, identity: Identity, ground_v: f64) -> Self {
        let electrodes = usize::from(identity.electrodes);
        let (outside, volts) = (Outside::default(), Rc::new(RefCell::new(vec![0.0; electrodes * electrodes])));
        let (mux, read) = (KnownGround::default(), Rc::clone(&volts));
        let (ground, floor) = (mux.clone(), f64::from(identity.adc.ranges[0].floor));
        let sample: Sample = Box::new(move |number, electrode| {
            let volts: f64 = read.borrow()[electrodes * usize::from(ground.0.get()) + usize::from(electrode)];
            // Noise of half a code, as a converter of little has.
            let noise = ((number.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) as f64 / f64::from(1 << 24)) - 0.5;
            Ok(((volts + ground_v) / 3.3 * 4096.0 + 0.5 + noise).max(floor) as u16)
        });
        let board = board_of(&outside, mux, sample, NoopDelay::new(), touch, identity);
        Self { board, volts, outside, tag: 0, electrodes }
    }

    pub fn command(&mut self, command: Command) -> Vec<BoardMessage> {
        self.tag = self.tag % 255 + 1;
        self.outside.send_tagged(self.tag, command);
        step(&mut self.board, 1);
        self.outside.messages()
    }

    /// Sends a piece; what the board has then, and whether it refuses the piece.
    pub fn piece(&mut self, at: usize, bytes: &[u8]) -> (TableState, bool) {
        let piece = TablePiece { at: at as u32, bytes: bytes.iter().copied().collect() };
        let messages = self.command(Command::Table(piece));
        let state = messages.iter().find_map(|message| match message {
            BoardMessage::Table(state) => Some(*state),
            _ => None,
        });
        let refused = messages.contains(&BoardMessage::Fault(Fault::NoTable { answers: self.tag }));
        (state.unwrap(), refused)
    }

    pub fn send(&mut self, table: &[u8]) -> (TableState, bool) {
        let mut last = (TableState::default(), false);
        for (number, bytes) in table.chunks(MAX_PIECE).enumerate() {
            last = self.piece(number * MAX_PIECE, bytes);
        }
        last
    }

    /// Reads this from now on.
    pub fn read(&mut self, simulation: &mut Simulation) {
        *self.volts.borrow_mut() = simulation.readings_v(0.0).volts().to_vec();
    }

    /// Scans so many frames of this; the contacts that are sent.
    pub fn scan(&mut self, simulation: &mut Simulation, frames: usize) -> Vec<Contacts> {
        self.read(simulation);
        step(&mut self.board, self.electrodes * frames);
        let contacts = |message| match message {
            BoardMessage::Contacts(contacts) => Some(contacts),
            _ => None,
        };
        self.outside.messages().into_iter().filter_map(contacts).collect()
    }
}

pub fn simulation(contacts: &[Contact]) -> Simulation {
    simulated(contacts, &[])
}

/// With a fault of the wires, such as `open:5`.
pub fn faulty_simulation(contacts: &[Contact], fault: &str) -> Simulation {
    simulated(contacts, &[fault.parse().unwrap()])
}

fn simulated(contacts: &[Contact], faults: &[simulate::Fault]) -> Simulation {
    simulated_on(&DETECTOR, contacts, faults)
}

/// On any detector.
pub fn simulated_on(detector: &Detector, contacts: &[Contact], faults: &[simulate::Fault]) -> Simulation {
    let scene = Scene::new(SceneName::Rest, detector, Hand::relative(detector), 1);
    let simulation = Simulation::new(detector, scene, faults, 1).unwrap();
    simulation.controls().press(contacts.to_vec());
    simulation
}

pub fn finger(at_m: [f64; 2]) -> Contact {
    let hand = Hand::relative(&DETECTOR);
    hand.tip(at_m, 0.5, 1.0).disc().unwrap()
}
