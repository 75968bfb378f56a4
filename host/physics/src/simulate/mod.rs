//! A detector without hardware: what touches it, its wires and their faults, and its measurement.
//!
//! One way for all: a [`Scene`](crate::scene::Scene) touches a model of the detector, which gives impedances;
//! [`Measurement`] makes readings of them. [`Simulation`] is both together, for the simulated board.

mod board;
mod built;
mod circuit;
mod controls;
mod fault;
mod foam;
mod measure;
mod measurement;
mod model;
mod noise;

use crate::readings::Readings;

pub use board::Simulation;
pub use built::{CannotDraw, as_built, drawn, drawn_top_over_bottom, try_drawn};
pub use controls::Controls;
pub use fault::{Fault, FaultError};
pub use foam::{Foam, Pressed};
pub use measure::{code, measured};
pub use measurement::Measurement;
pub use model::{SimulationError, driving_layer, finer_model};
pub use noise::Noise;

/// What the simulated board measures.
pub trait Physics: Send {
    /// Pad voltages of a whole frame (V), before the converter, at `time_s` seconds after the first frame.
    fn readings_v(&mut self, time_s: f64) -> Readings;
}
