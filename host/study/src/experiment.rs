//! What solvers are tried with: a detector, the model of it that is inverted, and frames from a finer one.

use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::DMatrix;

use super::scenes::electrode_distance_m;
use tactomo_physics::detector::{Adc, Detector, Problem as Wrong, Tolerances};
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::{Auto, ForwardError, ForwardModel, touched_impedance_ohm};
use tactomo_physics::readings::Readings;
use tactomo_physics::rest::{Leakage, Rest, RestPatterns, RestSum};
use tactomo_physics::scene::{Contact, Touch};
use tactomo_physics::simulate::{Fault, FaultError, Measurement, drawn, finer_model};
use tactomo_touch::solve::{Problem, SolveError};

/// Frames before the first that the baseline is taken from, as many as live takes. At rest it is never zero: the converter cuts off what
/// noise would be below zero, so 1.5 LSB of noise read 0.6 LSB in the mean, which is a press to a solver that looks at 1024 readings.
const BASELINE_FRAMES: u8 = 32;

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
    /// Tolerances so wide that what was drawn is no detector.
    #[error("{detector} as built with seed {seed}: {wrong}; its tolerances are too wide, or another seed is needed")]
    AsBuilt {
        /// Its name.
        detector: String,
        /// The seed.
        seed: u64,
        /// What is wrong with what was drawn.
        wrong: Wrong,
    },
    /// A detector on which not all scenes can be.
    #[error("detector {detector} is curved: studies press flat detectors, where contacts of any shape have a model")]
    Curved {
        /// Its name.
        detector: String,
    },
}

/// What was there and what was read.
#[derive(Clone, Debug)]
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
    truth: Arc<dyn ForwardModel>,
    /// The detector as it is, and as it is measured: no solver sees it.
    built: Detector,
    faults: Vec<Fault>,
    /// The linear theory of all its electrodes, as it is described.
    whole: Arc<Jacobian>,
    /// Impedance while the baseline is taken (ohm), if something presses meanwhile.
    rest_ohm: Option<DMatrix<f64>>,
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
            built: detector.clone(),
            faults: Vec::new(),
            rest_ohm: None,
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
        let truth: Arc<dyn ForwardModel> = match faults.iter().any(Fault::is_of_model) {
            true => finer_model(&self.built, faults, seed)?.into(),
            false => Arc::clone(&self.truth),
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
        let name = || self.detector.name.clone();
        built.check().map_err(|wrong| StudyError::AsBuilt { detector: name(), seed, wrong })?;
        Ok(Self { problem: self.problem.measured_as(&self.detector), ..self.with_truth(&built)? })
    }

    /// The same, in truth another detector than the one described: thicker, or noisier.
    ///
    /// # Errors
    /// [`StudyError`] if it cannot be modelled.
    pub fn with_truth(&self, detector: &Detector) -> Result<Self, StudyError> {
        let truth = match self.faults.is_empty() && unmeasured(detector) == unmeasured(&self.built) {
            true => Arc::clone(&self.truth),
            false => finer_model(detector, &[], 0)?.into(),
        };
        Ok(Self { truth, built: detector.clone(), ..self.again() })
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
        Ok(Self { rest_ohm: Some(self.truth.impedance_ohm(contacts)?), ..self.again() })
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
            truth: Arc::clone(&self.truth),
            built: self.built.clone(),
            whole: Arc::clone(&self.whole),
            faults: self.faults.clone(),
            rest_ohm: self.rest_ohm.clone(),
        }
    }

    /// The baseline: what the first frames are.
    fn rest(&self, measurement: &mut Measurement) -> Rest {
        // Of a detector that leaks there is something to read even then.
        let rest_ohm = self.rest_ohm.clone().or_else(|| self.truth.impedance_ohm(&[]).ok());
        let mut sum = RestSum::default();
        for _ in 0..BASELINE_FRAMES {
            sum.add(measurement.readings_v(rest_ohm.as_ref()).volts(), 1);
        }
        sum.rest(&self.detector.adc, 1)
    }

    /// Leakage, and how much of it is in a baseline (sheet conductances); none on a detector that does not leak.
    fn leakage(&self, rest: &Rest) -> Option<(Leakage, f64)> {
        self.truth.impedance_ohm(&[]).ok()?;
        let all: Vec<usize> = (0..self.whole.electrodes()).collect();
        let (patterns, leakage) = (RestPatterns::new(&self.whole, &all), Leakage::new(&self.whole, &all));
        let sheets = leakage.at_rest(&patterns, rest.offset_v());
        (sheets > 0.0).then_some((leakage, sheets))
    }

    /// Mean distance of electrodes (m): contacts further from the truth are counted as missed and invented.
    pub fn reach_m(&self) -> f64 {
        electrode_distance_m(&self.detector)
    }

    /// Readings of touches, one frame after the other, at noise of a `seed`.
    ///
    /// # Errors
    /// [`StudyError`] if a touch is off the detector.
    pub fn frames(&self, touches: &[Vec<Touch>], seed: u64) -> Result<Vec<Frame>, StudyError> {
        let mut measurement = Measurement::new(&self.built, &self.faults, seed)?;
        let rest = self.rest(&mut measurement);
        let leakage = self.leakage(&rest);
        let mut frames: Vec<Frame> = Vec::with_capacity(touches.len());
        let mut last = None;
        for touches in touches {
            let impedance_ohm = match last.take() {
                Some((before, impedance_ohm)) if before == touches => impedance_ohm,
                _ => match touched_impedance_ohm(&*self.truth, touches) {
                    Err(ForwardError::NoContact) if touches.is_empty() => None,
                    impedance_ohm => Some(impedance_ohm?),
                },
            };
            let measured = measurement.readings_v(impedance_ohm.as_ref());
            let mut readings = measured.clone();
            rest.subtract(measured.volts(), readings.volts_mut());
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

/// A detector without what measures it: of detectors that are alike in this, one model is enough.
fn unmeasured(detector: &Detector) -> Detector {
    let mut bare = Detector { drive_v: 0.0, on_resistance_ohm: 0.0, adc: Adc::default(), ..detector.taken_as_exact() };
    bare.electrodes.iter_mut().for_each(|pad| (pad.gain, pad.offset_v) = (1.0, 0.0));
    bare
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::SceneKind;
    use tactomo_physics::forward::readings_v;
    use tactomo_touch::solve::Method;

    fn experiment() -> Experiment {
        Experiment::new(&Detector::preset(Detector::DEFAULT).unwrap()).unwrap()
    }

    fn readings(experiment: &Experiment, seed: u64) -> Readings {
        let touches = SceneKind::Firm.frames(&experiment.detector, 1, 1);
        experiment.frames(&touches, seed).unwrap().remove(0).readings
    }

    #[test]
    fn readings_are_the_finer_models_with_noise_and_those_of_a_seed() {
        let experiment = experiment();
        let first = readings(&experiment, 1);
        assert_eq!(first, readings(&experiment, 1));
        assert_ne!(first, readings(&experiment, 2));
        let contact = SceneKind::Firm.frames(&experiment.detector, 1, 1)[0][0].disc().unwrap();
        let model = readings_v(&experiment.problem.model.impedance_ohm(&[contact]).unwrap(), &experiment.detector);
        let off = first.volts().iter().zip(model.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off > 0.0 && off < 0.02 * model.largest_v() + 0.006, "{off}");
    }

    #[test]
    fn at_rest_readings_are_zero_in_the_mean_although_the_converter_cuts_noise_off() {
        let experiment = experiment();
        let frames = experiment.frames(&vec![Vec::new(); 20], 1).unwrap();
        let all: Vec<f64> = frames.iter().flat_map(|frame| frame.readings.volts().iter().copied()).collect();
        let mean_v = all.iter().sum::<f64>() / all.len() as f64;
        // The noise that is left is about 0.9 LSB: that of the mean of 5120 readings and of 256 baselines of 32 frames is 0.016 LSB.
        assert!(mean_v.abs() < 0.06 * experiment.detector.adc.lsb_v(), "{mean_v}");
    }

    /// As in live and `reconstruct`, which take the same baseline; more readings show less of a press.
    #[test]
    fn nothing_is_found_at_rest_on_many_electrodes() {
        let experiment = Experiment::new(&Detector::preset("display-140x70").unwrap()).unwrap();
        let mut solver = Method::Auto.build(&experiment.problem).unwrap();
        for seed in 0..4 {
            for frame in experiment.frames(&vec![Vec::new(); 25], seed).unwrap() {
                assert_eq!(solver.solve(&frame.readings).unwrap().contacts, [], "seed {seed}");
            }
        }
    }

    #[test]
    fn a_wrong_sign_shows_in_the_baseline_and_is_taken_off() {
        let experiment = experiment();
        let wrong = experiment.with_faults(&[Fault::Invert { channel: 3 }], 1).unwrap();
        let (sound, wrong) = (readings(&experiment, 1), readings(&wrong, 1));
        assert!(sound.at(7, 3) > 0.02 && (wrong.at(7, 3) + sound.at(7, 3)).abs() < 0.02, "{}", wrong.at(7, 3));
        assert!((wrong.at(7, 4) - sound.at(7, 4)).abs() < 0.02);
    }

    #[test]
    fn a_baseline_under_load_is_taken_off() {
        let experiment = experiment();
        let contact = SceneKind::Firm.frames(&experiment.detector, 1, 1)[0][0].disc().unwrap();
        let loaded = readings(&experiment.with_baseline(&[contact]).unwrap(), 1);
        assert!(loaded.volts().iter().all(|volts| volts.abs() < 0.01), "the same contact is no change");
    }

    #[test]
    fn a_leak_is_a_baseline_under_all_that_presses() {
        let experiment = experiment();
        let leaking = experiment.with_faults(&["leak:0.01".parse().unwrap()], 1).unwrap();
        let rest = leaking.frames(&vec![Vec::new(); 10], 1).unwrap();
        assert!(rest.iter().all(|frame| frame.readings.volts().iter().all(|volts| volts.abs() < 0.01)));
        let (sound, leaking) = (readings(&experiment, 1), readings(&leaking, 1));
        let off = sound.volts().iter().zip(leaking.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        // Its voltages at rest alone would leave 16 mV. The noise is the same.
        assert!(off < 0.003, "{off}");
    }

    #[test]
    fn faults_of_time_are_refused() {
        let error = experiment().with_faults(&["creep:0.2:3".parse().unwrap()], 1).err().unwrap();
        assert_eq!(error, StudyError::OfTime { fault: "creep:0.2:3".to_owned() });
    }

    #[test]
    fn solvers_know_of_another_converter_but_not_of_a_wrong_detector() {
        let experiment = experiment();
        let mut other = experiment.detector.clone();
        other.adc.bits = 10;
        assert_eq!(experiment.measured_as(&other).problem.detector().adc.bits, 10);
        other.layers[0].thickness_m *= 2.0;
        let wrong = experiment.with_truth(&other).unwrap();
        assert_eq!(wrong.problem.detector(), &experiment.detector.taken_as_exact());
        assert_ne!(readings(&wrong, 1), readings(&experiment, 1));
    }

    #[test]
    fn what_was_drawn_is_measured_and_solvers_know_the_description_only() {
        let experiment = experiment();
        let built = experiment.as_built(3).unwrap();
        assert_eq!(built.problem.detector(), &experiment.detector);
        assert_eq!(built.truth(), &drawn(&experiment.detector, 3));
        assert_ne!(readings(&built, 1), readings(&experiment, 1));
        assert_ne!(readings(&built, 1), readings(&experiment.as_built(4).unwrap(), 1));
        let known = built.known_as(built.truth()).unwrap();
        assert_eq!(known.problem.detector(), built.truth());
        let mut wide = Detector { name: "wide".to_owned(), ..experiment.detector };
        wide.tolerances.gain_share = 1.0;
        let error = Experiment::of(&wide, Some(1)).err().unwrap().to_string();
        assert!(error.starts_with("wide as built with seed 1: electrodes.gains["), "{error}");
    }

    /// Readings of one contact, foretold by who knows what was built, and not by who knows the description.
    #[test]
    fn who_knows_the_truth_foretells_readings_and_who_knows_the_description_does_not() {
        // The converter cuts off offsets below zero, which no knowledge of the detector brings back.
        let tolerances = Tolerances { offset_lsb: 0.0, ..Tolerances::default() };
        let built = experiment().as_built_within(tolerances, 2).unwrap();
        let known = built.known_as(built.truth()).unwrap();
        let touches = SceneKind::Firm.frames(&built.detector, 1, 1);
        let off = |experiment: &Experiment| {
            let frame = experiment.frames(&touches, 1).unwrap().remove(0);
            let Problem { model, .. } = &experiment.problem;
            let impedance_ohm = model.impedance_ohm(&frame.contacts.unwrap()).unwrap();
            let foretold = readings_v(&impedance_ohm, model.detector());
            let pairs = frame.readings.volts().iter().zip(foretold.volts());
            pairs.map(|(read, foretold)| (read - foretold).abs()).fold(0.0, f64::max) / foretold.largest_v()
        };
        let [described, known] = [&built, &known].map(off);
        // Five deviations of the noise are 6 of some 700 mV.
        assert!(known < 0.02 && described > 5.0 * known, "{described} {known}");
    }

    #[test]
    fn gains_that_are_described_are_taken_off_and_others_are_not() {
        let experiment = experiment();
        let mut told = experiment.detector.clone();
        told.electrodes.iter_mut().enumerate().for_each(|(e, pad)| pad.gain = 1.0 + 0.02 * (e % 3) as f64);
        let wrong = experiment.with_truth(&told).unwrap();
        assert!(Arc::ptr_eq(&wrong.truth, &experiment.truth), "gains need no other model");
        let right = wrong.known_as(&told).unwrap();
        let off = |other: &Experiment| {
            let pair = [readings(&experiment, 1), readings(other, 1)];
            let volts = pair[0].volts().iter().zip(pair[1].volts()).map(|(a, b)| (a - b).abs());
            volts.fold(0.0, f64::max) / pair[0].largest_v()
        };
        // Noise is that of one seed, so codes differ by rounding alone: 0.8 of 0.8 mV in 0.3 V.
        assert!(off(&wrong) > 0.02 && off(&right) < 0.006, "{} {}", off(&wrong), off(&right));
    }
}
