//! A detector compiled for [`tactomo_touch_core`]: its table, and what it may differ by.

mod between;
mod changes;
mod detector;
mod file;
mod splines;
mod table;
mod unknown;

use std::f64::consts::TAU;
use std::sync::Arc;

#[cfg(test)]
pub(crate) use self::between::Ways;
pub(crate) use self::detector::{CompiledDetector, CompiledFields, MOST_CONTACTS, MOST_DIRECTIONS};
pub use self::file::{CompiledTable, TableFileError};
pub use self::table::CompileError;
pub(crate) use self::table::compiled;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::ForwardModel;

/// A detector as it is measured, with the model of it that is compiled.
#[derive(Clone, Copy)]
pub(crate) struct Modelled<'a> {
    /// The model.
    pub model: &'a Arc<dyn ForwardModel>,
    /// The detector as measured.
    pub detector: &'a Detector,
    /// Radius of contacts that is usual (m).
    pub radius_m: f64,
}

impl Modelled<'_> {
    /// Resistance of the current that crowds under a disc of the usual radius on a bare layer (ohm): on a half space, and of a sheet from there to `e` times
    /// as far.
    pub fn constriction_ohm(&self) -> Option<f64> {
        let top_s_per_m = self.detector.layers.last()?.top_s_per_m;
        Some(1.0 / (4.0 * top_s_per_m * self.radius_m) + 1.0 / (TAU * self.detector.sheet_conductance_s()))
    }
}
