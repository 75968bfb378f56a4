//! What came out of sweeps.

use super::bounds::BoundReport;
use super::breakdown::{Break, CellReport, Classes, Margin};
use crate::machine::Machine;

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Where it ran.
    pub machine: Machine,
    /// How to run it again.
    pub command: String,
    /// Name of the detector.
    pub detector: String,
    /// Mean distance of its electrodes (m): what a contact missed or invented counts.
    pub reach_m: f64,
    /// How far off an answer is wrong (m).
    pub wrong_m: f64,
    /// Seed.
    pub seed: u64,
    /// The seed of the detector as it was built, if everything is simulated on one.
    pub as_built: Option<u64>,
    /// Places of the contacts at each point.
    pub places: usize,
    /// Frames at each place.
    pub frames: usize,
    /// The sweeps.
    pub sweeps: Vec<SweepReport>,
    /// What noise allows, beside what solvers reach.
    pub bounds: BoundReport,
    /// Sweeps and charts that were not done when the study was stopped.
    pub missing: Vec<String>,
}

impl Report {
    /// What to say after the detector's name.
    pub(super) fn whose(&self) -> String {
        self.as_built.map_or_else(String::new, |seed| format!(", as built with seed {seed}"))
    }
}

/// What came out of a sweep.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SweepReport {
    /// What was varied.
    pub title: String,
    /// How.
    pub note: String,
    /// What amounts are multiples of, if points have such.
    pub unit: Option<String>,
    /// The points.
    pub points: Vec<PointReport>,
    /// A row for each solver.
    pub solvers: Vec<SolverRow>,
    /// The same of detectors that were calibrated before, where that was tried.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub calibrated: Vec<SolverRow>,
}

/// A point of a sweep.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PointReport {
    /// Its value, for people.
    pub label: String,
    /// How bad it is: the larger, the worse; the smallest is the harmless one. Only the order counts.
    pub severity: f64,
    /// How much of the sweep's unit it is.
    pub amount: Option<f64>,
}

/// What a solver made of a sweep.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SolverRow {
    /// Its name.
    pub solver: String,
    /// One for each point; `None` where the solver cannot be made for the model.
    pub cells: Vec<Option<CellReport>>,
    /// Its errors, however they compare with each other.
    pub errors: ErrorRange,
    /// The mildest point at which it breaks, if it does.
    pub breaks: Option<Break>,
    /// Of which classes its answers are: the mean over the points.
    pub classes: Classes,
    /// How much of the sweep's unit it bears.
    pub margin: Option<Margin>,
}

/// Errors of a solver over a sweep (m), with contacts missed and invented; `None` where no point has one.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct ErrorRange {
    /// At the harmless point.
    pub harmless_m: Option<f64>,
    /// The median over the points.
    pub median_m: Option<f64>,
    /// The largest.
    pub largest_m: Option<f64>,
}
