//! The detector of the simulated board: a scene that moves by itself, the physics that answers to it, and its measurement.

mod measure;
mod noise;
mod scene;
mod slab;

use crate::readings::Readings;

pub use measure::measured;
pub use noise::Noise;
pub use scene::Scene;
pub use slab::SlabPhysics;

/// What the simulated board measures.
pub trait Physics: Send {
    /// Pad voltages of a whole frame (V), noise-free, at `time_s` seconds after the start.
    fn readings_v(&mut self, time_s: f64) -> Readings;
}
