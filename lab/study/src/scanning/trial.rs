//! A solver that follows contacts by the frames of a plan, as they arrive.

use std::ops::ControlFlow;
use tactomo_physics::baseline::{Baseline, BaselineSum};
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_physics::simulate::{Noise, code};
use tactomo_touch::solve::{Followed, FoundContact, Latest, Method, Parts, Solution, SolveError};

use super::budget::{FrameTimes, frame};
use super::grounds::{Choice, Grounds};
use super::path::Path;
use crate::experiment::{Experiment, StudyError};
use crate::variant::Variation;

/// Time in which a board scans nothing while it takes over another plan (s): a command on the wire, and its answer.
const TAKEN_OVER_S: f64 = 1.5e-3;
/// From one search to the next, at least (s): about what a search for one contact takes, which live makes beside.
const SEARCH_S: f64 = 4e-3;
/// Frames of the baseline, as in live.
const REST_FRAMES: usize = 32;

/// What is scanned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plan {
    pub choice: Choice,
    /// Rows of a frame.
    pub rows: usize,
}

/// The answer to a frame.
pub(super) struct Answer {
    /// When the frame had arrived (s), counted from the touch.
    pub arrived_s: f64,
    /// The middle of the time in which its rows were read (s).
    pub middle_s: f64,
    /// The grounds of its rows.
    pub grounds: Vec<usize>,
    /// What was found.
    pub contacts: Vec<FoundContact>,
}

/// A solver and the converter before it.
pub(super) struct Bench<'a> {
    detector: &'a Detector,
    parts: Parts,
    /// Time since the last search (s).
    since_search_s: f64,
}

/// A converter with its noise, less what it reads at rest.
struct Converter<'a> {
    detector: &'a Detector,
    noise: Noise,
    rest: Baseline,
}

impl<'a> Bench<'a> {
    /// With the solver of contacts for an experiment's problem.
    ///
    /// # Errors
    /// [`StudyError`] if it cannot be made for the model.
    pub fn new(experiment: &'a Experiment) -> Result<Self, StudyError> {
        let solver = Variation::default_of(Method::Contacts).build(&experiment.problem)?;
        Ok(Self { detector: &experiment.detector, parts: solver.split(), since_search_s: f64::INFINITY })
    }

    /// Answers to the frames that arrive within `until_s` (s) of contacts that touch at 0 s and go at a speed (m/s) from then on.
    ///
    /// # Errors
    /// [`StudyError::Solve`] if readings are refused.
    pub fn run(
        &mut self,
        path: &Path,
        plan: Plan,
        speed_m_per_s: f64,
        until_s: f64,
        seed: u64,
    ) -> Result<Vec<Answer>, StudyError> {
        let electrodes = self.detector.electrodes.len();
        let times = frame(plan.rows, electrodes);
        let mut converter = Converter::new(self.detector, seed);
        let mut latest = Latest::new(electrodes);
        self.parts.tracker.reset();
        self.since_search_s = f64::INFINITY;
        let follower = &self.parts.tracker;
        let telling = |count: usize| follower.telling_grounds(count).unwrap_or_default();
        let mut grounds = Grounds::new(plan.choice, plan.rows, self.detector, telling);
        let (mut start_s, mut elapsed_s, mut answers) = (0.0, times.period_s, Vec::new());
        while start_s + times.age_s <= until_s {
            let rows = grounds.take(plan.rows);
            let way_m = |row: usize| speed_m_per_s * (start_s + (row as f64 + 0.5) * times.row_s);
            let readings = converter.frame(path, &rows, way_m);
            latest.add(&readings, elapsed_s, None);
            self.since_search_s += elapsed_s;
            let solution = match plan.choice {
                Choice::Whole => self.whole(&readings),
                _ => self.rows(&readings, &latest.readings(f64::MAX, None), elapsed_s),
            };
            let solution =
                solution.map_err(|error| StudyError::Solve { solver: Method::Contacts.name().into(), error })?;
            let arrived_s = start_s + times.age_s;
            let telling = |count: usize| self.parts.tracker.telling_grounds(count).unwrap_or_default();
            let is_new = grounds.consider(arrived_s, !solution.contacts.is_empty(), telling);
            answers.push(Answer::of(solution, rows, start_s, &times));
            elapsed_s = times.period_s + if is_new { TAKEN_OVER_S } else { 0.0 };
            start_s += elapsed_s;
        }
        Ok(answers)
    }

    /// What a whole frame says.
    fn whole(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let followed = self.parts.tracker.follow(readings)?;
        self.thorough(followed, readings)
    }

    /// What rows say.
    fn rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Solution, SolveError> {
        let followed = self.parts.tracker.follow_rows(rows, latest, elapsed_s)?;
        self.thorough(followed, latest)
    }

    /// What a search says, at once, if one is worth it and the last one is over.
    fn thorough(&mut self, followed: Followed, readings: &Readings) -> Result<Solution, SolveError> {
        if !followed.search || self.since_search_s < SEARCH_S {
            return Ok(followed.solution);
        }
        self.since_search_s = 0.0;
        let lead = self.parts.tracker.hypothesis();
        let lead = match &mut self.parts.search {
            Some(searcher) => searcher.search(lead, readings, &mut |_| ControlFlow::Continue(()))?,
            None => lead,
        };
        Ok(self.parts.tracker.adopt(lead, readings)?.solution)
    }
}

impl<'a> Converter<'a> {
    fn new(detector: &'a Detector, seed: u64) -> Self {
        let electrodes = detector.electrodes.len();
        let mut new = Self { detector, noise: Noise::new(seed), rest: Baseline::zero(electrodes * electrodes) };
        let mut sum = BaselineSum::default();
        for _ in 0..REST_FRAMES {
            let frame_v: Vec<f64> = (0..electrodes * electrodes).map(|_| new.measured_v(0.0)).collect();
            sum.add(&frame_v, 1);
        }
        new.rest = sum.baseline(&detector.adc, detector.ground_v, 1);
        new
    }

    fn measured_v(&mut self, volts: f64) -> f64 {
        let (adc, ground_v) = (&self.detector.adc, self.detector.ground_v);
        f64::from(code(volts + ground_v, adc, &mut self.noise)) * adc.lsb_v() - ground_v
    }

    /// A frame of rows, read where the contacts have gone so far (m); a ground that is there several times gives its mean.
    fn frame(&mut self, path: &Path, grounds: &[usize], way_m: impl Fn(usize) -> f64) -> Readings {
        let electrodes = self.detector.electrodes.len();
        let (mut volts, mut counts) = (vec![0.0; electrodes * electrodes], vec![0usize; electrodes]);
        for (row, g) in grounds.iter().copied().enumerate() {
            counts[g] += 1;
            for (e, exact_v) in path.row_v(g, way_m(row)).into_iter().enumerate() {
                volts[g * electrodes + e] += self.measured_v(exact_v);
            }
        }
        volts.iter_mut().enumerate().for_each(|(i, volts)| *volts /= counts[i / electrodes].max(1) as f64);
        let mut touch_v = volts.clone();
        self.rest.subtract(&volts, &mut touch_v);
        Readings::from_fn(electrodes, |g, e| touch_v[g * electrodes + e]).hiding(|g, _| counts[g] == 0)
    }
}

impl Answer {
    fn of(solution: Solution, grounds: Vec<usize>, start_s: f64, times: &FrameTimes) -> Self {
        Self {
            arrived_s: start_s + times.age_s,
            middle_s: start_s + 0.5 * times.scan_s,
            grounds,
            contacts: solution.contacts,
        }
    }
}
