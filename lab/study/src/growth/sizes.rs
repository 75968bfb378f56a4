//! What is varied, and what one size of it costs.

use std::time::Duration;

use super::{Cost, Plan, SizeReport};
use crate::experiment::{Experiment, Frame, StudyError};
use crate::score::Spread;
use crate::stopwatch::timed;
use tactomo_physics::detector::{Detector, electrode_grid};
use tactomo_physics::forward::{Auto, ForwardError};
use tactomo_physics::scene::{Contact, Touch};
use tactomo_touch::solve::{Method, Problem, Solver};

/// Electrodes on the sides of a square.
const GRIDS: [[usize; 2]; 4] = [[4, 2], [4, 4], [8, 4], [8, 8]];
const ELECTRODES: [usize; 4] = [8, 16, 32, 64];
/// Nodes of the image.
const NODES: [usize; 5] = [500, 1000, 2000, 4000, 8000];
const CONTACTS: [usize; 6] = [1, 2, 3, 4, 5, 6];
/// Frames since a contact came: what is kept of them has its limits.
const FRAMES: [usize; 8] = [2, 4, 8, 16, 32, 64, 128, 256];
/// Frames at a place, unless their number is varied; of their second half the median counts as following.
const OWN_FRAMES: usize = 8;
/// Set-ups of which the median counts.
const SET_UPS: usize = 3;
/// Contacts lie near the middles of the fields of a grid of so many columns and rows, at most so far from them (m): 18 mm or more apart on 60 mm.
const FIELDS: [usize; 2] = [3, 2];
const AWAY_M: f64 = 1e-3;
/// Their radius (m) and conductance (sheet conductances): firm fingertips.
const RADIUS_M: f64 = 3e-3;
const SHEETS: f64 = 0.3;

/// What is varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Against {
    /// Electrodes of the detector, on the same square; of `auto`, with one contact.
    Electrodes,
    /// Nodes of the image; of `tikhonov`, with one contact.
    Nodes,
    /// Contacts; of `contacts`.
    Contacts,
    /// Frames since a contact came; of `contacts`.
    Frames,
}

/// The detector of which sizes are varied.
pub(super) fn detector() -> Detector {
    Detector::default()
}

impl Against {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Electrodes, Self::Nodes, Self::Contacts, Self::Frames];

    /// For people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Electrodes => "electrodes",
            Self::Nodes => "nodes",
            Self::Contacts => "contacts",
            Self::Frames => "frames",
        }
    }

    /// The sizes, rising.
    pub fn sizes(self) -> &'static [usize] {
        match self {
            Self::Electrodes => &ELECTRODES,
            Self::Nodes => &NODES,
            Self::Contacts => &CONTACTS,
            Self::Frames => &FRAMES,
        }
    }

    /// The solver that is tried.
    pub fn method(self) -> Method {
        match self {
            Self::Electrodes => Method::Auto,
            Self::Nodes => Method::Tikhonov,
            Self::Contacts | Self::Frames => Method::Contacts,
        }
    }

    /// The costs that can depend on it.
    pub fn costs(self) -> &'static [Cost] {
        match self {
            Self::Electrodes | Self::Nodes => &Cost::ALL,
            Self::Contacts => &[Cost::First, Cost::Following, Cost::Kept, Cost::Peak],
            Self::Frames => &[Cost::Following, Cost::Kept, Cost::Peak],
        }
    }

    /// How long a size takes, about, in shares of a whole.
    pub(super) fn work(self, size: usize) -> usize {
        match self {
            Self::Electrodes => size,
            Self::Nodes => size / 100,
            Self::Contacts => size,
            Self::Frames => 1,
        }
    }

    fn detector(self, size: usize) -> Detector {
        let detector = detector();
        let grid = ELECTRODES.iter().position(|electrodes| *electrodes == size).map(|index| GRIDS[index]);
        match grid.filter(|_| self == Self::Electrodes) {
            Some([columns, rows]) => {
                let [width_m, height_m] = detector.outline.size_m();
                let radius_m = detector.electrodes[0].radius_m;
                Detector { electrodes: electrode_grid(width_m, height_m, columns, rows, radius_m), ..detector }
            }
            None => detector,
        }
    }

    /// All that is made before the first frame.
    fn made(self, size: usize, detector: &Detector) -> Result<(Problem, Box<dyn Solver>), ForwardError> {
        let model = Auto::new(&detector.taken_as_exact(), None)?.model;
        let problem = match self {
            Self::Nodes => Problem::new(model.on_image_of(size)?),
            _ => Problem::new(model),
        };
        let solver = self.method().build(&problem)?;
        Ok((problem, solver))
    }

    /// What a size costs.
    ///
    /// # Errors
    /// [`StudyError`] if the detector cannot be modelled.
    pub(super) fn measured(self, size: usize, plan: &Plan) -> Result<SizeReport, StudyError> {
        let detector = self.detector(size);
        let experiment = Experiment::new(&detector)?;
        let contacts = if self == Self::Contacts { size } else { 1 };
        let frames = if self == Self::Frames { size } else { OWN_FRAMES };
        let places = (0..plan.places as u64).map(|place| {
            let seed = plan.seed.wrapping_mul(1_000_003).wrapping_add(place);
            let touches: Vec<Touch> = pressed(&detector, contacts, seed).into_iter().map(Touch::from).collect();
            experiment.frames(&vec![touches; frames], seed)
        });
        let places = places.collect::<Result<Vec<_>, StudyError>>()?;
        let mut set_ups = Vec::with_capacity(SET_UPS);
        for _ in 0..SET_UPS {
            let (made, time) = timed(|| self.made(size, &detector));
            made?;
            set_ups.push(time);
        }
        (plan.heap.start)();
        let made = self.made(size, &detector).map(|(problem, mut solver)| {
            // Readings that it refuses need no memory.
            places.iter().take(1).flatten().for_each(|frame| drop(solver.solve(&frame.readings)));
            (problem, solver)
        });
        // Both are still there, so what they keep is counted.
        let memory = (plan.heap.stop)();
        let (_, mut solver) = made?;
        let (mut first, mut following) = (Vec::new(), Vec::new());
        for frames in &places {
            let times = times(&mut *solver, frames);
            first.extend(times.first().copied());
            following.extend_from_slice(&times[times.len() / 2..]);
        }
        let spread_s = |times: Vec<Duration>| Spread::of(times.iter().map(Duration::as_secs_f64)).unwrap_or_default();
        let [set_up_s, first_s, following_s] = [set_ups, first, following].map(spread_s);
        Ok(SizeReport { size, set_up_s, first_s, following_s, memory })
    }
}

/// How long each frame takes, from a cold start.
fn times(solver: &mut dyn Solver, frames: &[Frame]) -> Vec<Duration> {
    solver.reset();
    frames.iter().map(|frame| timed(|| drop(solver.solve(&frame.readings))).1).collect()
}

/// So many contacts, each near the middle of a field of its own.
fn pressed(detector: &Detector, count: usize, seed: u64) -> Vec<Contact> {
    let mut random = fastrand::Rng::with_seed(seed);
    let [low, high] = detector.outline.bounds();
    let mut fields: Vec<usize> = (0..FIELDS[0] * FIELDS[1]).collect();
    random.shuffle(&mut fields);
    let mut contact = |field: usize| {
        let at = [field % FIELDS[0], field / FIELDS[0]];
        let [x_m, y_m] = [0, 1].map(|axis| {
            let share = (at[axis] as f64 + 0.5) / FIELDS[axis] as f64;
            low[axis] + share * (high[axis] - low[axis]) + AWAY_M * (2.0 * random.f64() - 1.0)
        });
        Contact::flat(x_m, y_m, RADIUS_M, SHEETS * detector.sheet_conductance_s())
    };
    fields.into_iter().take(count).map(&mut contact).collect()
}
