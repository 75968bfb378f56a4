//! Sweeps, and what they are made from.

use std::cell::RefCell;

use super::tolerances::Known;
use crate::calibrate::Calibrate;
use crate::experiment::{Experiment, Frame, StudyError};
use crate::scenes::SceneKind;
use tactomo_physics::detector::Detector;
use tactomo_physics::scene::{Contact, Hand, Touch};
use tactomo_touch::solve::Method;

/// Of the points of a sweep, a quick study tries every third, and the last.
const QUICK_STEP: usize = 3;

/// What is tried.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The detector.
    pub detector: Detector,
    /// Solvers.
    pub methods: Vec<Method>,
    /// Places of the contacts at each point.
    pub places: usize,
    /// Frames at each place.
    pub frames: usize,
    /// Where places and noise start.
    pub seed: u64,
    /// Whether only some of the points are tried.
    pub quick: bool,
    /// If given, everything but the sweeps of tolerances is simulated on the detector as it was built with this seed.
    pub as_built: Option<u64>,
    /// If given, sweeps of tolerances are tried after a calibration too.
    pub calibrate: Option<Calibrate>,
}

/// Makes a sweep.
type Make = dyn Fn(&Bench) -> Result<Sweep, StudyError>;

/// How a sweep is made, when its turn comes.
pub(super) struct Maker {
    /// What is varied.
    pub title: &'static str,
    /// How much work that is, in points that are tried without a calibration.
    pub work: usize,
    /// Makes it.
    pub make: Box<Make>,
}

impl Maker {
    /// Of a sweep of so many points.
    pub fn new(title: &'static str, work: usize, make: impl Fn(&Bench) -> Result<Sweep, StudyError> + 'static) -> Self {
        Self { title, work, make: Box::new(make) }
    }
}

/// Something that is varied.
pub(super) struct Sweep {
    pub note: String,
    /// What [amounts](Point::amount) are multiples of, if they are of anything.
    pub unit: Option<&'static str>,
    pub points: Vec<Point>,
}

/// What tolerances are multiples of: [`Tolerances`](tactomo_physics::detector::Tolerances) by default.
pub(super) const BENCH: &str = "what a hobbyist's bench gives";

/// What noise is multiples of.
pub(super) const NOISE: &str = "the described converter's noise";

impl Sweep {
    /// Of some points.
    pub fn new(note: impl Into<String>, points: Vec<Point>) -> Self {
        Self { note: note.into(), unit: None, points }
    }

    /// With how much of a unit each point has.
    pub fn in_units(mut self, unit: &'static str, amounts: impl IntoIterator<Item = f64>) -> Self {
        self.unit = Some(unit);
        for (point, amount) in self.points.iter_mut().zip(amounts) {
            point.amount = Some(amount);
            point.calibrated.iter_mut().for_each(|calibrated| calibrated.amount = Some(amount));
        }
        self
    }
}

/// A value of it.
pub(super) struct Point {
    pub label: String,
    pub severity: f64,
    /// How much of the sweep's unit it is.
    pub amount: Option<f64>,
    pub experiment: Experiment,
    /// Frames of each place.
    pub places: Vec<Vec<Frame>>,
    /// So many of them come before those that count: solvers follow what touches.
    pub lead: usize,
    /// What solvers know at each place, where that is another detector each time; none if they know the experiment's everywhere.
    pub known: Vec<Experiment>,
    /// What solvers' lambda is set to.
    pub lambda: Option<f64>,
    /// The same after a calibration, where that is tried.
    pub calibrated: Option<Box<Point>>,
}

/// What sweeps are made from.
pub(super) struct Bench<'a> {
    pub plan: &'a Plan,
    /// The sound detector: as it is described, or as it was built where that is asked for.
    pub sound: Experiment,
    /// The same, of which solvers know the tolerances.
    pub tolerant: Experiment,
    /// Calibrations of detectors without any tolerances, once there are some.
    pub exact: RefCell<Option<Known>>,
}

impl<'a> Bench<'a> {
    /// Of a plan and its sound detector.
    pub fn new(plan: &'a Plan, sound: Experiment) -> Self {
        Self { plan, tolerant: sound.tolerant(), sound, exact: RefCell::default() }
    }

    /// Another detector, as it is described or as it was built where that is asked for.
    pub fn experiment(&self, detector: &Detector) -> Result<Experiment, StudyError> {
        Experiment::of(detector, self.plan.as_built)
    }

    /// Seeds of the places.
    pub fn seeds(&self) -> Vec<u64> {
        (0..self.plan.places as u64).map(|place| self.plan.seed.wrapping_mul(1_000_003).wrapping_add(place)).collect()
    }

    /// Of the values of a sweep, those that are tried.
    pub fn some<'v, T>(&self, values: &'v [T]) -> impl Iterator<Item = &'v T> {
        let quick = self.plan.quick;
        let last = values.len().saturating_sub(1);
        let kept = move |(index, _): &(usize, &T)| !quick || index % QUICK_STEP == 0 || *index == last;
        values.iter().enumerate().filter(kept).map(|(_, value)| value)
    }

    /// A point at which a kind of scene touches.
    pub fn point(
        &self,
        label: String,
        severity: f64,
        experiment: Experiment,
        kind: SceneKind,
    ) -> Result<Point, StudyError> {
        let detector = self.sound.detector.clone();
        self.touched(label, severity, experiment, |seed| kind.frames(&detector, seed, 1).remove(0))
    }

    /// A point at which something touches that a seed chooses.
    pub fn touched(
        &self,
        label: String,
        severity: f64,
        experiment: Experiment,
        touches: impl Fn(u64) -> Vec<Touch>,
    ) -> Result<Point, StudyError> {
        self.followed(label, severity, experiment, 0, |seed, _| touches(seed))
    }

    /// A point at which something touches that a seed chooses and that moves over so many frames before those that count. It gets how far that
    /// is done, from 0 to 1.
    pub fn followed(
        &self,
        label: String,
        severity: f64,
        experiment: Experiment,
        lead: usize,
        touches: impl Fn(u64, f64) -> Vec<Touch>,
    ) -> Result<Point, StudyError> {
        let share = |frame: usize| if frame < lead { frame as f64 / lead as f64 } else { 1.0 };
        let frames = |seed| (0..lead + self.plan.frames).map(|frame| touches(seed, share(frame))).collect::<Vec<_>>();
        let places = self.seeds().into_iter().map(|seed| experiment.frames(&frames(seed), seed));
        let places = places.collect::<Result<_, _>>()?;
        let (known, lambda, calibrated) = (Vec::new(), None, None);
        Ok(Point { label, severity, amount: None, experiment, places, lead, known, lambda, calibrated })
    }

    /// The one contact of a kind of scene at a seed.
    pub fn contact(&self, kind: SceneKind, seed: u64) -> Contact {
        let touches = kind.frames(&self.sound.detector, seed, 1).remove(0);
        let centre = || Hand::relative(&self.sound.detector).tip([0.0; 2], 1.0, 1.0);
        let disc = touches.into_iter().next().unwrap_or_else(centre).disc();
        disc.unwrap_or(Contact::flat(0.0, 0.0, 0.0, 0.0))
    }
}
