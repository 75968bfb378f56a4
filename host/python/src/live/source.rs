//! Where the bytes of a live board come from.

use std::path::PathBuf;

use pyo3::prelude::*;
use tactomo::board::record::RecordReader;
use tactomo::board::simulated::{BoardModel, Options, SimulatedBoard};
use tactomo::board::source::{AnyBoard, NamedPort, Opened, Recording, Source};
use tactomo::detector::Detector as Described;
use tactomo::scene::{Hand, Scene, SceneName};
use tactomo::simulate::{self, Fault, Simulation};

use crate::error::{raised, refused};

/// The board, the simulated one or a recording.
pub enum Chosen {
    /// The board on this port, or on whichever one answers.
    Board { port: Option<String>, baud: u32 },
    /// The simulated board.
    Simulated(Simulated),
    /// A recording, played so many times as fast.
    Replay { path: PathBuf, speed: f64 },
}

/// A simulated board, before it is started.
pub struct Simulated {
    /// What touches.
    pub scene: SceneName,
    /// What is wrong.
    pub faults: Vec<Fault>,
    /// Of places, noise and faults.
    pub seed: u64,
    /// The detector as it was built, if it is not the one described.
    pub as_built: Option<u64>,
    /// The board; the usual one unless it is chosen.
    pub model: Option<BoardModel>,
}

impl Chosen {
    /// Whether it is a recording.
    pub fn is_replay(&self) -> bool {
        matches!(self, Self::Replay { .. })
    }

    /// The detector that is told, where `given` may be another one than the usual.
    pub fn detector(&self, given: Option<Described>) -> PyResult<Described> {
        match self {
            Self::Board { .. } => Ok(given.unwrap_or_default()),
            Self::Simulated(simulated) => Ok(simulated.told(given)),
            Self::Replay { path, .. } => match given {
                Some(given) => Ok(given),
                None => {
                    let told = RecordReader::open(path).and_then(|reader| reader.header().detector(path));
                    told.map_err(raised)?.ok_or_else(|| {
                        refused(format!(
                            "{}: its header does not say which detector it is of: give one as `detector`",
                            path.display()
                        ))
                    })
                }
            },
        }
    }

    /// Begins to give bytes of this detector as told.
    pub fn open(&self, told: &Described) -> PyResult<Box<dyn Source>> {
        match self {
            Self::Board { port: Some(port), baud } => Ok(Box::new(NamedPort { port: port.clone(), baud: *baud })),
            Self::Board { port: None, baud } => Ok(Box::new(AnyBoard { baud: *baud })),
            Self::Simulated(simulated) => simulated.start(told),
            Self::Replay { path, speed } => {
                Ok(Box::new(Recording { path: path.clone(), speed: *speed, stays_open: false }))
            }
        }
    }
}

impl Simulated {
    fn model(&self, detector: &Described) -> BoardModel {
        self.model.unwrap_or_else(|| BoardModel::usual(detector))
    }

    fn told(&self, given: Option<Described>) -> Described {
        let made_for = || self.scene.detector().and_then(Described::preset);
        let detector = given.or_else(made_for).unwrap_or_default();
        self.model(&detector).described(detector, self.as_built.is_some())
    }

    fn start(&self, told: &Described) -> PyResult<Box<dyn Source>> {
        if told.surface.is_some() && !self.scene.is_of_discs() {
            return Err(refused("only discs can touch a curved detector: choose another scene"));
        }
        let scene = Scene::new(self.scene, told, Hand::relative(told), self.seed);
        let built = match self.as_built {
            Some(seed) => simulate::try_drawn(told, seed).map_err(raised)?,
            None => told.clone(),
        };
        let simulation = Simulation::new(&built, scene, &self.faults, self.seed).map_err(raised)?;
        let options = Options { seed: self.seed, model: self.model(&built) };
        let board = SimulatedBoard::simulate(&built, simulation, options).map_err(raised)?;
        Ok(Box::new(Opened::new(Box::new(board))))
    }
}
