//! Orders for solvers, and what is made of them.

use std::sync::Arc;

use tactomo_physics::detector::Detector;
use tactomo_touch::solve::{FaultyElectrodes, Method, Solver};

use super::options::BoxError;

/// What a solver is made for.
#[derive(Clone, Debug, PartialEq)]
pub struct Order {
    /// Its method.
    pub method: Method,
    /// The detector, as measured.
    pub detector: Arc<Detector>,
    /// Electrodes that are left out, and why.
    pub faulty: FaultyElectrodes,
}

/// A solver that was ordered, or why there is none.
pub struct Made {
    pub(super) order: Order,
    pub(super) solver: Result<Box<dyn Solver>, BoxError>,
}
