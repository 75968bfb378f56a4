//! What came out, as data.

use super::{Group, Machine, SceneKind};
use crate::score::{Spread, Summary};
use tactomo_touch::solve::Family;

/// What came out.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Report {
    /// Where it ran.
    pub machine: Machine,
    /// How to run it again.
    pub command: String,
    /// Seed.
    pub seed: u64,
    /// The seed of the detectors as they were built, if all is simulated on such.
    pub as_built: Option<u64>,
    /// Places of each kind of scene.
    pub places: usize,
    /// Frames at each place.
    pub frames: usize,
    /// One for each detector.
    pub detectors: Vec<DetectorReport>,
    /// What was not tried when the study was stopped.
    pub missing: Vec<String>,
}

/// What came out on one detector.
#[derive(Clone, Debug, serde::Serialize)]
pub struct DetectorReport {
    /// Its name.
    pub detector: String,
    /// Width and height (m).
    pub size_m: [f64; 2],
    /// Model that was inverted.
    pub model: String,
    /// Time to make that model and its Jacobian (ms).
    pub model_ms: f64,
    /// What a contact missed or invented counts (m).
    pub reach_m: f64,
    /// Solvers that cannot be made for this model, and why.
    pub unavailable: Vec<String>,
    /// What noise allows there.
    pub floors: Vec<Floor>,
    /// One for each solver and parameter.
    pub solvers: Vec<SolverReport>,
    /// The same solvers with their defaults on detectors drawn from the tolerances: as solvers know them, one after the other.
    pub as_built: Vec<AsBuiltReport>,
}

/// What came out on detectors drawn from the tolerances of one.
#[derive(Clone, Debug, serde::Serialize)]
pub struct AsBuiltReport {
    /// What solvers know of them.
    pub known: Known,
    /// The calibration, if they are calibrated.
    pub calibration: Option<String>,
    /// How many calibrations were refused, which left solvers the description.
    pub refused: usize,
    /// How many detectors, each with a place of each of these kinds of scenes.
    pub detectors: usize,
    /// The kinds.
    pub scenes: Vec<SceneKind>,
    /// What noise allows there.
    pub floors: Vec<Floor>,
    /// One for each solver.
    pub solvers: Vec<SolverReport>,
}

/// What solvers know of a detector as it was built.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Known {
    /// Its description.
    Described,
    /// What a calibration found.
    Calibrated,
}

/// What came out for one solver.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SolverReport {
    /// Its name.
    pub solver: String,
    /// What it is made of.
    pub family: Family,
    /// Its main parameter, where that is not the default.
    pub parameter: Option<String>,
    /// The most unknowns of its model, where that follows from its parameter.
    pub unknowns: Option<usize>,
    /// Time to make it (ms).
    pub set_up_ms: f64,
    /// Memory, if it was counted.
    pub memory: Option<Memory>,
    /// Over all scenes.
    pub all: Summary,
    /// Over the scenes of each group.
    pub groups: Vec<GroupReport>,
    /// Over each kind of scene.
    pub scenes: Vec<SceneReport>,
}

/// What a solver allocates beyond the model (bytes).
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Memory {
    /// Kept after all frames.
    pub kept_bytes: usize,
    /// At most, while it was made or solved.
    pub peak_bytes: usize,
}

/// A group's means.
#[derive(Clone, Debug, serde::Serialize)]
pub struct GroupReport {
    /// The group.
    pub group: Group,
    /// Its means.
    pub summary: Summary,
    /// Of the first frame at each place alone: a cold start.
    pub first: Summary,
    /// Of the frames that follow.
    pub following: Summary,
}

/// Errors (m) of an unbiased method that is as good as noise allows in the places of contacts whose number is known and whose radii are known to a factor of
/// two: normal ones with the covariance of the [Cramer-Rao bound](crate::cramer_rao), over the same frames.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Floor {
    /// Of which scenes.
    pub group: Group,
    /// From one frame.
    pub first_m: Option<Spread>,
    /// From all frames at a place up to each of those that follow the first.
    pub following_m: Option<Spread>,
}

/// Which frames of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Course {
    /// The first one: a cold start.
    First,
    /// Those that follow.
    Following,
}

/// A kind's means.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SceneReport {
    /// The kind.
    pub scene: SceneKind,
    /// Its means.
    pub summary: Summary,
    /// Of those places alone at which other values of parameters are tried too.
    pub swept: Summary,
}

impl AsBuiltReport {
    /// Figures of a solver.
    pub fn of(&self, solver: &str) -> Option<&SolverReport> {
        self.solvers.iter().find(|report| report.solver == solver)
    }
}

impl SolverReport {
    /// Figures of some frames of a group; `None` if there are none.
    pub fn course(&self, group: Group, course: Course) -> Option<&Summary> {
        let report = self.groups.iter().find(|report| report.group == group)?;
        let summary = match course {
            Course::First => &report.first,
            Course::Following => &report.following,
        };
        (summary.frames > 0).then_some(summary)
    }

    /// Means of a group.
    pub fn group(&self, group: Group) -> Option<&Summary> {
        Some(&self.groups.iter().find(|report| report.group == group)?.summary)
    }

    /// Means of a kind over the places at which all values of parameters are tried; `None` if there are none.
    pub fn swept(&self, kind: SceneKind) -> Option<&Summary> {
        let summary = &self.scenes.iter().find(|report| report.scene == kind)?.swept;
        (summary.frames > 0).then_some(summary)
    }

    /// Means of a kind.
    pub fn scene(&self, kind: SceneKind) -> Option<&Summary> {
        Some(&self.scenes.iter().find(|report| report.scene == kind)?.summary)
    }
}

impl Known {
    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Described => "by their description",
            Self::Calibrated => "calibrated",
        }
    }
}
