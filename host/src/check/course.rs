//! The course of a check: what the person is asked, and when that was done.

use std::sync::Arc;

use tactomo_board::baseline::{self, BaselineState, BaselineTracker};
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_touch::solve::{ElectrodeWatch, Problem};

use super::touch::{Mean, is_pressed, level_v, median};

/// Places that a fingertip presses.
pub const FINGERS: usize = 3;

/// How long a person takes to lay down a hand or a fingertip (s): what comes until then is no steady touch.
const LAID_S: f64 = 0.7;
/// How long frames of the hand and of a fingertip are taken (s). The slowest board sends 90 a second.
const HAND_S: f64 = 2.0;
const FINGER_S: f64 = 0.5;
/// Fewest frames of a press. A faulty electrode is told after 8 in a row, and taken back after 64: see [`ElectrodeWatch`].
const FEWEST: u32 = 32;
/// An input whose readings at rest are above the middle one's by this share of the drive floats, or is wired to something else ...
const RESTLESS: f64 = 0.05;
/// ... as long as no more than this share of all inputs do: otherwise something presses.
const FEW: f64 = 0.25;

/// What the person is asked to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    /// To leave the foam alone, before anything was pressed.
    Rest,
    /// To lay a flat hand on the foam.
    Hand,
    /// To let go; then comes the press of a fingertip, of this number.
    LetGo(usize),
    /// To press with one fingertip, at another place than before; the first is 0.
    Finger(usize),
    /// Nothing more.
    Nothing,
}

/// A check under way.
pub struct Check {
    pub(super) problem: Problem,
    pub(super) detector: Detector,
    ask: Ask,
    baseline: BaselineTracker,
    resting: Mean,
    /// Inputs that do not rest where the others do.
    pub(super) restless: Vec<usize>,
    /// What all inputs read at rest (V).
    pub(super) rest: Option<Readings>,
    pub(super) watch: ElectrodeWatch,
    pressed_since_s: Option<f64>,
    pressing: Mean,
    /// Means (V) of what was pressed: the hand first, then the fingertips.
    pub(super) presses: Vec<Readings>,
}

impl Check {
    /// A check of a problem's detector, whose board takes means of so many conversions.
    pub fn new(problem: Problem, conversions: u32) -> Self {
        let detector = problem.detector().clone();
        Self {
            baseline: BaselineTracker::new(Arc::clone(&problem.jacobian), conversions),
            watch: ElectrodeWatch::new(&detector),
            problem,
            detector,
            ask: Ask::Rest,
            resting: Mean::default(),
            restless: Vec::new(),
            rest: None,
            pressed_since_s: None,
            pressing: Mean::default(),
            presses: Vec::new(),
        }
    }

    /// What the person is asked now.
    pub fn ask(&self) -> Ask {
        self.ask
    }

    /// Why nothing goes on, if something is amiss: the foam is to rest, and something presses.
    pub fn hindrance(&self) -> Option<f64> {
        match (self.ask, self.baseline.state()) {
            (Ask::Rest, BaselineState::Pressed(largest_v)) => Some(largest_v),
            _ => None,
        }
    }

    /// Takes a frame (V) of this time since the start (s).
    pub fn take(&mut self, readings: &Readings, time_s: f64) {
        let is_whole = readings.electrodes() == self.detector.electrodes.len();
        if !is_whole || readings.volts().iter().any(|volts| !volts.is_finite()) {
            return;
        }
        match self.ask {
            Ask::Rest => self.rest(readings, time_s),
            Ask::Hand => self.press(readings, time_s, HAND_S, Ask::LetGo(0)),
            Ask::Finger(last) if last + 1 >= FINGERS => self.press(readings, time_s, FINGER_S, Ask::Nothing),
            Ask::Finger(finger) => self.press(readings, time_s, FINGER_S, Ask::LetGo(finger + 1)),
            Ask::LetGo(finger) => self.let_go(readings, finger),
            Ask::Nothing => {}
        }
    }

    /// Takes the baseline, of those electrodes that do rest.
    fn rest(&mut self, readings: &Readings, time_s: f64) {
        self.resting.add(readings);
        if self.resting.frames() < baseline::FRAMES {
            return;
        }
        let taken = std::mem::take(&mut self.resting);
        let Some(mean) = taken.readings(readings.electrodes()) else { return };
        self.restless = restless(&mean, self.detector.drive_v);
        self.baseline.add(&mean.touches_v(), taken.frames(), time_s, &self.restless);
        if !self.baseline.state().is_taking() && self.hindrance().is_none() {
            self.rest = Some(mean);
            self.ask = Ask::Hand;
        }
    }

    fn touch(&self, readings: &Readings) -> Readings {
        let mut touch = readings.clone();
        self.baseline.subtract(readings.volts(), touch.volts_mut());
        touch
    }

    fn is_pressed(&self, touch: &Readings, was: bool) -> bool {
        let electrodes = 0..self.detector.electrodes.len();
        let trusted: Vec<usize> = electrodes.filter(|electrode| !self.restless.contains(electrode)).collect();
        is_pressed(was, level_v(touch, &trusted), self.detector.drive_v)
    }

    fn press(&mut self, readings: &Readings, time_s: f64, length_s: f64, next: Ask) {
        let touch = self.touch(readings);
        if !self.is_pressed(&touch, self.pressed_since_s.is_some()) {
            // Let go too early: from the beginning.
            (self.pressed_since_s, self.pressing) = (None, Mean::default());
            return;
        }
        let pressed_s = time_s - *self.pressed_since_s.get_or_insert(time_s);
        if pressed_s < LAID_S {
            return;
        }
        self.watch.note(&touch);
        self.pressing.add(&touch);
        if pressed_s < LAID_S + length_s || self.pressing.frames() < FEWEST {
            return;
        }
        self.presses.extend(std::mem::take(&mut self.pressing).readings(readings.electrodes()));
        (self.pressed_since_s, self.ask) = (None, next);
    }

    fn let_go(&mut self, readings: &Readings, finger: usize) {
        if !self.is_pressed(&self.touch(readings), true) {
            self.ask = Ask::Finger(finger);
        }
    }
}

/// Inputs that read something at rest that the others do not: none, if they are many.
fn restless(rest: &Readings, drive_v: f64) -> Vec<usize> {
    let n = rest.electrodes();
    let level_v = |e: usize| median((0..n).filter(|g| *g != e).map(|g| rest.touch_v(g, e)).collect());
    let levels_v: Vec<f64> = (0..n).map(level_v).collect();
    let middle_v = median(levels_v.clone());
    let found: Vec<usize> = (0..n).filter(|e| levels_v[*e] - middle_v > RESTLESS * drive_v).collect();
    if found.len() as f64 > FEW * n as f64 { Vec::new() } else { found }
}
