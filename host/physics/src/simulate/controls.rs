//! What a person changes of a simulation while it runs.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;

use super::model::{SimulationError, finer_model};
use super::{Fault, Foam, Measurement};
use crate::detector::Detector;
use crate::forward::ForwardModel;
use crate::scene::{Contact, Hand, Scene, SceneName};

/// Presses, scene and faults of a [`Simulation`](super::Simulation) that runs in another thread, which never waits for them. A handle: clones
/// share it.
#[derive(Clone)]
pub struct Controls(Arc<Shared>);

struct Shared {
    detector: Detector,
    hand: Hand,
    seed: u64,
    state: Mutex<State>,
}

struct State {
    pressed: Vec<Contact>,
    scene: SceneName,
    faults: Vec<Fault>,
    /// How often faults were asked for: a model that is ready after it was asked for another is not taken.
    asked: u64,
    next_scene: Option<Scene>,
    next_built: Option<Built>,
}

/// A detector with its faults, and the board that measures it.
pub(super) struct Built {
    pub(super) model: Box<dyn ForwardModel>,
    pub(super) foam: Foam,
    pub(super) measurement: Measurement,
}

impl Built {
    /// Takes up to a second.
    pub(super) fn new(detector: &Detector, faults: &[Fault], seed: u64) -> Result<Self, SimulationError> {
        let measurement = Measurement::new(detector, faults, seed)?;
        Ok(Self { model: finer_model(detector, faults, seed)?, foam: Foam::new(faults), measurement })
    }
}

/// What has changed since the last time.
pub(super) struct Changes {
    pub(super) pressed: Vec<Contact>,
    pub(super) scene: Option<Scene>,
    pub(super) built: Option<Built>,
}

impl Controls {
    pub(super) fn new(detector: &Detector, scene: &Scene, faults: &[Fault], seed: u64) -> Self {
        let state = State {
            pressed: Vec::new(),
            scene: scene.name(),
            faults: faults.to_vec(),
            asked: 0,
            next_scene: None,
            next_built: None,
        };
        Self(Arc::new(Shared { detector: detector.clone(), hand: *scene.hand(), seed, state: Mutex::new(state) }))
    }

    /// Presses with these contacts beside the scene and with no others; with none, lets go.
    pub fn press(&self, contacts: Vec<Contact>) {
        self.state().pressed = contacts;
    }

    /// Plays another scene, from its beginning.
    ///
    /// # Errors
    /// [`SimulationError::Shape`] if the detector is curved and the scene not of discs.
    pub fn play(&self, name: SceneName) -> Result<(), SimulationError> {
        let Shared { detector, hand, seed, .. } = &*self.0;
        if detector.surface.is_some() && !name.is_of_discs() {
            return Err(SimulationError::Shape(name));
        }
        let scene = Scene::new(name, detector, *hand, *seed);
        let mut state = self.state();
        state.scene = name;
        state.next_scene = Some(scene);
        Ok(())
    }

    /// Gives the detector these faults and no others, once its model is made: in another thread, within about a second. If that
    /// fails, `failed` is called there, and everything stays as it was.
    ///
    /// # Errors
    /// [`SimulationError::Fault`] if a fault names an electrode that is not there, [`SimulationError::Thread`] if there is no thread.
    pub fn set_faults(
        &self,
        faults: Vec<Fault>,
        failed: impl FnOnce(SimulationError) + Send + 'static,
    ) -> Result<(), SimulationError> {
        faults.iter().try_for_each(|fault| fault.check(self.0.detector.electrodes.len()))?;
        let mut state = self.state();
        state.asked += 1;
        let (asked, controls) = (state.asked, self.clone());
        drop(state);
        let build = move || match Built::new(&controls.0.detector, &faults, controls.0.seed) {
            Ok(built) => controls.built(asked, faults, built),
            Err(error) => failed(error),
        };
        let spawned = thread::Builder::new().name("faulty detector".to_owned()).spawn(build);
        spawned.map(drop).map_err(|error| SimulationError::Thread(error.to_string()))
    }

    fn built(&self, asked: u64, faults: Vec<Fault>, built: Built) {
        let mut state = self.state();
        if state.asked == asked {
            state.faults = faults;
            state.next_built = Some(built);
        }
    }

    /// The scene that is played.
    pub fn scene(&self) -> SceneName {
        self.state().scene
    }

    /// The faults that the detector has: those asked for, once its model is made.
    pub fn faults(&self) -> Vec<Fault> {
        self.state().faults.clone()
    }

    /// What presses, and what else is to be taken over.
    pub(super) fn changes(&self) -> Changes {
        let mut state = self.state();
        let (scene, built) = (state.next_scene.take(), state.next_built.take());
        Changes { pressed: state.pressed.clone(), scene, built }
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.0.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
