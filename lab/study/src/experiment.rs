//! What solvers are tried with: a detector, the model of it that is inverted, and frames from a finer one.

mod truth;

use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::DMatrix;

use self::truth::Truth;
use super::independent::Independent;
use super::scenes::electrode_distance_m;
use tactomo_physics::baseline::{Baseline, BaselinePatterns, BaselineSum, Leakage};
use tactomo_physics::detector::{Adc, Detector, Electrode, Tolerances};
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::{Auto, ForwardError, ForwardModel};
use tactomo_physics::readings::{Range, Readings};
use tactomo_physics::scene::{Contact, Touch};
use tactomo_physics::simulate::{CannotDraw, Fault, FaultError, Measurement, drawn, finer_model};
use tactomo_touch::solve::{Problem, SolveError};

/// Frames before the first that the baseline is taken from, as many as live takes. At rest it is never zero: the converter cuts off what
/// noise would be below zero, so 1.5 LSB of noise read 0.6 LSB in the mean, which is a press to a solver that looks at 1024 readings.
const BASELINE_FRAMES: u8 = 32;
/// What is added to the seed of a baseline that was taken before something changed: its noise is another.
const BEFORE: u64 = 1 << 40;

/// Why a study cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StudyError {
    /// There is no such model.
    #[error(transparent)]
    Forward(#[from] ForwardError),
    /// A fault cannot be.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// A solver refused readings that fit its detector.
    #[error("solver {solver}: {error}")]
    Solve {
        /// Name of the solver.
        solver: String,
        /// Why.
        error: SolveError,
    },
    /// Frames have no time.
    #[error("fault {fault} acts through time, which the frames of a study do not have; `live --simulate` plays it")]
    OfTime {
        /// The fault.
        fault: String,
    },
    /// What was built cannot be drawn.
    #[error(transparent)]
    Draw(#[from] CannotDraw),
    /// A detector on which not all scenes can be.
    #[error("detector {detector} is curved: studies press flat detectors, where contacts of any shape have a model")]
    Curved {
        /// Its name.
        detector: String,
    },
    /// An independent solution has no such scenes, or is of another detector.
    #[error("{solution}: {what}")]
    Independent {
        /// Its name.
        solution: String,
        /// What is wrong.
        what: String,
    },
}

/// What was there and what was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// What touched.
    pub touches: Vec<Touch>,
    /// The same as contacts, if all are discs.
    pub contacts: Option<Vec<Contact>>,
    /// Readings less the baseline, over the gains that the detector is described with (V).
    pub readings: Readings,
}

/// A detector, what it is simulated with and what is inverted.
pub struct Experiment {
    /// The detector as it is described to solvers.
    pub detector: Detector,
    /// What solvers get.
    pub problem: Problem,
    /// Time that the inverted model and its Jacobian took.
    pub model_time: Duration,
    /// Name of the inverted model.
    pub model: String,
    truth: Truth,
    /// The detector as it is, and as it is measured: no solver sees it.
    built: Detector,
    faults: Vec<Fault>,
    /// The linear theory of all its electrodes, as it is described.
    whole: Arc<Jacobian>,
    /// Impedance while the baseline is taken (ohm), if something presses meanwhile.
    rest_ohm: Option<DMatrix<f64>>,
    /// The detector while the baseline is taken, where it changes afterwards.
    before: Option<Arc<Self>>,
}

impl Experiment {
    /// A sound detector that is as it is described, and that solvers take as exact, inverted on the model that it needs.
    ///
    /// # Errors
    /// [`StudyError`] if it is curved or cannot be modelled.
    pub fn new(detector: &Detector) -> Result<Self, StudyError> {
        if detector.surface.is_some() {
            return Err(StudyError::Curved { detector: detector.name.clone() });
        }
        let start = Instant::now();
        let model = Auto::new(detector, None)?.model;
        let name = model.name().to_owned();
        let problem = Problem::new(model).measured_as(&detector.taken_as_exact());
        let model_time = start.elapsed();
        let truth = finer_model(detector, &[], 0)?.into();
        Ok(Self {
            detector: detector.clone(),
            whole: Arc::clone(&problem.jacobian),
            problem,
            model_time,
            model: name,
            truth,
            built: with_right_converters(detector),
            faults: Vec::new(),
            rest_ohm: None,
            before: None,
        })
    }

    /// The same detector, in truth with such faults. `seed` chooses what they leave open.
    ///
    /// # Errors
    /// [`StudyError`] if it cannot have them.
    pub fn with_faults(&self, faults: &[Fault], seed: u64) -> Result<Self, StudyError> {
        if let Some(fault) = faults.iter().find(|fault| fault.is_of_time()) {
            return Err(StudyError::OfTime { fault: fault.to_string() });
        }
        let truth = match faults.iter().any(Fault::is_of_model) {
            true => finer_model(&self.built, faults, seed)?.into(),
            false => self.truth.clone(),
        };
        Ok(Self { truth, faults: faults.to_vec(), ..self.again() })
    }

    /// A sound detector, or one as it was [built](Self::as_built) with a seed.
    ///
    /// # Errors
    /// As for both.
    pub fn of(detector: &Detector, as_built: Option<u64>) -> Result<Self, StudyError> {
        let sound = Self::new(detector)?;
        match as_built {
            Some(seed) => sound.as_built(seed),
            None => Ok(sound),
        }
    }

    /// The same, in truth drawn from the tolerances around the detector that is described.
    ///
    /// # Errors
    /// [`StudyError`] if what is drawn is no detector or cannot be modelled.
    pub fn as_built(&self, seed: u64) -> Result<Self, StudyError> {
        self.as_built_within(self.detector.tolerances, seed)
    }

    /// The same with other tolerances than those that the detector is described with, which are what solvers know.
    ///
    /// # Errors
    /// As for [`as_built`](Self::as_built).
    pub fn as_built_within(&self, tolerances: Tolerances, seed: u64) -> Result<Self, StudyError> {
        let built = drawn(&Detector { tolerances, ..self.detector.clone() }, seed);
        let wrong = |source| CannotDraw::Wrong { detector: self.detector.name.clone(), seed, source };
        built.check().map_err(wrong)?;
        self.made_as(&built)
    }

    /// The same, in truth a detector as it was built, of which solvers know the description and its tolerances.
    ///
    /// # Errors
    /// [`StudyError`] if it cannot be modelled.
    pub fn made_as(&self, built: &Detector) -> Result<Self, StudyError> {
        Ok(Self { problem: self.tolerant().problem, ..self.with_truth(built)? })
    }

    /// The same, whose solvers know the tolerances of its description: what they make of those is made once for all copies.
    pub fn tolerant(&self) -> Self {
        match self.problem.detector() == &self.detector {
            true => self.again(),
            false => Self { problem: self.problem.measured_as(&self.detector), ..self.again() },
        }
    }

    /// The same, in truth another detector than the one described: thicker, or noisier.
    ///
    /// # Errors
    /// [`StudyError`] if it cannot be modelled.
    pub fn with_truth(&self, detector: &Detector) -> Result<Self, StudyError> {
        let truth = match self.faults.is_empty() && unmeasured(detector) == unmeasured(&self.built) {
            true => self.truth.clone(),
            false => finer_model(detector, &[], 0)?.into(),
        };
        Ok(Self { truth, built: detector.clone(), ..self.again() })
    }

    /// The same description and its tolerances, in truth what another program solved, whose patches alone can touch.
    ///
    /// # Errors
    /// [`StudyError::Independent`] if that has another number of electrodes.
    pub fn solved_by(&self, solution: Arc<Independent>) -> Result<Self, StudyError> {
        let (there, described) = (solution.electrodes, self.detector.electrodes.len());
        if there != described {
            let what = format!("it has {there} electrodes, but {} has {described}", self.detector.name);
            return Err(StudyError::Independent { solution: solution.name.clone(), what });
        }
        Ok(Self { truth: Truth::Independent(solution), ..self.tolerant() })
    }

    /// The same truth, described to solvers in another way: as a calibration found it.
    ///
    /// # Errors
    /// [`StudyError`] if that cannot be modelled.
    pub fn known_as(&self, detector: &Detector) -> Result<Self, StudyError> {
        let problem = Problem::of(detector)?;
        let model = problem.model.name().to_owned();
        Ok(Self { detector: detector.clone(), problem, model, ..self.again() })
    }

    /// The detector as it is, to compare with: never for a solver.
    pub fn truth(&self) -> &Detector {
        &self.built
    }

    /// The same, with such contacts while the baseline is taken.
    ///
    /// # Errors
    /// [`StudyError`] if a contact is off the detector.
    pub fn with_baseline(&self, contacts: &[Contact]) -> Result<Self, StudyError> {
        let touches: Vec<Touch> = contacts.iter().copied().map(Touch::from).collect();
        Ok(Self { rest_ohm: Some(self.truth.impedance_ohm(&touches)?), ..self.again() })
    }

    /// The same, whose baseline was taken of a detector as it was before, and is not followed: what `--rest` says of a recording.
    #[must_use]
    pub fn changed_since(self, before: &Self) -> Self {
        Self { before: Some(Arc::new(before.again())), ..self }
    }

    /// The same readings, measured by another converter or drive, which solvers know of.
    pub fn measured_as(&self, detector: &Detector) -> Self {
        let problem = self.problem.measured_as(&self.as_known(detector));
        let built = Detector { drive_v: detector.drive_v, adc: detector.adc, ..self.built.clone() };
        let whole = Jacobian { detector: detector.clone(), ..(*self.whole).clone() }.into();
        Self { detector: detector.clone(), built, problem, whole, ..self.again() }
    }

    /// A detector with what is known of this one: to tolerances, or exactly.
    fn as_known(&self, detector: &Detector) -> Detector {
        let Detector { tolerances, calibration, .. } = self.problem.detector().clone();
        Detector { tolerances, calibration, ..detector.clone() }
    }

    /// The same, inverted on another model.
    pub fn inverted_on(&self, model: Box<dyn ForwardModel>) -> Self {
        let name = model.name().to_owned();
        let problem = Problem::new(model).measured_as(&self.as_known(&self.detector));
        Self { problem, model: name, ..self.again() }
    }

    /// The same, inverted with some of the electrodes only.
    pub fn inverted_with(&self, electrodes: &[usize]) -> Self {
        Self { problem: self.problem.through(electrodes, &[]), ..self.again() }
    }

    fn again(&self) -> Self {
        Self {
            detector: self.detector.clone(),
            problem: self.problem.clone(),
            model_time: self.model_time,
            model: self.model.clone(),
            truth: self.truth.clone(),
            built: self.built.clone(),
            whole: Arc::clone(&self.whole),
            faults: self.faults.clone(),
            rest_ohm: self.rest_ohm.clone(),
            before: self.before.clone(),
        }
    }

    /// The baseline, what the first frames are; and leakage.
    fn rest_and_leakage(&self, measurement: &mut Measurement) -> (Baseline, Option<(Leakage, f64)>) {
        let rest = self.rest(measurement);
        let leakage = self.leakage(&rest);
        (rest, leakage)
    }

    fn rest(&self, measurement: &mut Measurement) -> Baseline {
        // Of a detector that leaks there is something to read even then.
        let rest_ohm = self.rest_ohm.clone().or_else(|| self.truth.impedance_ohm(&[]).ok());
        let mut sum = BaselineSum::default();
        for _ in 0..BASELINE_FRAMES {
            sum.add(measurement.readings_v(rest_ohm.as_ref()).volts(), 1);
        }
        sum.baseline(&self.detector.adc, self.detector.ground_v, 1)
    }

    /// Leakage, and how much of it is in a baseline (sheet conductances); none on a detector that does not leak.
    fn leakage(&self, rest: &Baseline) -> Option<(Leakage, f64)> {
        self.truth.impedance_ohm(&[]).ok()?;
        let all: Vec<usize> = (0..self.whole.electrodes()).collect();
        let (patterns, leakage) = (BaselinePatterns::new(&self.whole, &all), Leakage::new(&self.whole, &all));
        let sheets = leakage.at_rest(&patterns, rest.offset_v());
        (sheets > 0.0).then_some((leakage, sheets))
    }

    /// Mean distance of electrodes (m): contacts further from the truth are counted as missed and invented.
    pub fn reach_m(&self) -> f64 {
        electrode_distance_m(&self.detector)
    }

    /// What the readings of each electrode can tell; nothing of a description alone, without a board.
    fn ranges(&self) -> Vec<Range> {
        let Detector { adc, converters, electrodes, .. } = &self.detector;
        let of = |pad: &Electrode| Some(converters.get(pad.converter)?.range(adc.deviation_v()));
        electrodes.iter().filter_map(of).collect()
    }

    /// Readings of touches, one frame after the other, at noise of a `seed`.
    ///
    /// # Errors
    /// [`StudyError`] if a touch is off the detector.
    pub fn frames(&self, touches: &[Vec<Touch>], seed: u64) -> Result<Vec<Frame>, StudyError> {
        let mut measurement = Measurement::new(&self.built, &self.faults, seed)?;
        let ranges = self.ranges();
        // At rest a converter with a floor tells nothing.
        let has_floor = ranges.iter().any(|range| range.floor_v.is_finite());
        let taken = match self.before.as_deref() {
            _ if has_floor => None,
            Some(before) => {
                let seed = seed.wrapping_add(BEFORE);
                let mut measurement = Measurement::new(&before.built, &before.faults, seed)?;
                Some(before.rest_and_leakage(&mut measurement))
            }
            None => Some(self.rest_and_leakage(&mut measurement)),
        };
        let (rest, leakage) = taken.map_or((None, None), |(rest, leakage)| (Some(rest), leakage));
        let mut frames: Vec<Frame> = Vec::with_capacity(touches.len());
        let mut last = None;
        for touches in touches {
            let impedance_ohm = match last.take() {
                Some((before, impedance_ohm)) if before == touches => impedance_ohm,
                _ => match self.truth.impedance_ohm(touches) {
                    Err(ForwardError::NoContact) if touches.is_empty() => None,
                    impedance_ohm => Some(impedance_ohm?),
                },
            };
            let measured = measurement.readings_v(impedance_ohm.as_ref());
            let mut readings = if ranges.is_empty() { measured.clone() } else { measured.clone().within(&ranges) };
            if let Some(rest) = &rest {
                rest.subtract(measured.volts(), readings.volts_mut());
            }
            readings.correct_channels(&self.detector);
            if let Some((leakage, sheets)) = &leakage {
                leakage.take_off(readings.volts_mut(), *sheets);
            }
            let contacts = touches.iter().map(Touch::disc).collect();
            frames.push(Frame { touches: touches.clone(), contacts, readings });
            last = Some((touches, impedance_ohm));
        }
        Ok(frames)
    }
}

/// A detector on a chip whose converters are without errors.
fn with_right_converters(detector: &Detector) -> Detector {
    let mut detector = detector.clone();
    detector.converters.iter_mut().for_each(|converter| (converter.gain_share, converter.bow_v) = (0.0, 0.0));
    detector
}

/// A detector without what measures it: of detectors that are alike in this, one model is enough.
fn unmeasured(detector: &Detector) -> Detector {
    let mut bare = Detector { drive_v: 0.0, on_resistance_ohm: 0.0, adc: Adc::default(), ..detector.taken_as_exact() };
    bare.converters.clear();
    bare.electrodes.iter_mut().for_each(|pad| (pad.gain, pad.offset_v) = (1.0, 0.0));
    bare
}

#[cfg(test)]
mod tests;
