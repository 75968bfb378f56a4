//! What solvers are tried with: a detector, the model of it that is inverted, and frames from a finer one.

use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::DMatrix;

use super::scenes::electrode_distance_m;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::{Auto, ForwardError, ForwardModel, touched_impedance_ohm};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::{Contact, Touch};
use tactomo_physics::simulate::{Fault, FaultError, Measurement, finer_model};
use tactomo_touch::solve::{Problem, SolveError};

/// Frames before the first whose mean is the baseline, as many as live takes. It is never zero: the converter cuts off what noise would
/// be below zero, so at rest 1.5 LSB of noise read 0.6 LSB in the mean, which is a press to a solver that looks at 1024 readings.
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
    /// Readings less the baseline (V).
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
    /// The detector as it is measured in truth.
    measured: Detector,
    faults: Vec<Fault>,
    /// Impedance while the baseline is taken (ohm), if something presses meanwhile.
    rest_ohm: Option<DMatrix<f64>>,
}

impl Experiment {
    /// A sound detector that is as it is described, and that solvers take as exact, inverted on the model that it needs.
    ///
    /// # Errors
    /// [`StudyError`] if it is curved or cannot be modelled.
    pub fn new(detector: &Detector) -> Result<Self, StudyError> {
        Self::within_tolerances(&detector.taken_as_exact())
    }

    /// The same of a detector that solvers know to its tolerances only.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub fn within_tolerances(detector: &Detector) -> Result<Self, StudyError> {
        if detector.surface.is_some() {
            return Err(StudyError::Curved { detector: detector.name.clone() });
        }
        let start = Instant::now();
        let model = Auto::new(detector, None)?.model;
        let name = model.name().to_owned();
        let problem = Problem::new(model);
        let model_time = start.elapsed();
        let truth = finer_model(detector, &[], 0)?.into();
        Ok(Self {
            detector: detector.clone(),
            problem,
            model_time,
            model: name,
            truth,
            measured: detector.clone(),
            faults: Vec::new(),
            rest_ohm: None,
        })
    }

    /// The same detector, in truth with such faults. `seed` chooses what they leave open.
    ///
    /// # Errors
    /// [`StudyError`] if it cannot have them.
    pub fn with_faults(&self, faults: &[Fault], seed: u64) -> Result<Self, StudyError> {
        let changes_model = |fault: &Fault| {
            matches!(fault, Fault::ContactSpread { .. } | Fault::Conductivity { .. } | Fault::Uneven { .. })
        };
        let truth = match faults.iter().any(changes_model) {
            true => finer_model(&self.detector, faults, seed)?.into(),
            false => Arc::clone(&self.truth),
        };
        Ok(Self { truth, faults: faults.to_vec(), ..self.again() })
    }

    /// The same, in truth another detector than the one described: thicker, or noisier.
    ///
    /// # Errors
    /// [`StudyError`] if it cannot be modelled.
    pub fn with_truth(&self, detector: &Detector) -> Result<Self, StudyError> {
        Ok(Self { truth: finer_model(detector, &[], 0)?.into(), measured: detector.clone(), ..self.again() })
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
        let problem = self.problem.measured_as(detector);
        Self { detector: detector.clone(), measured: detector.clone(), problem, ..self.again() }
    }

    /// The same, inverted on another model.
    pub fn inverted_on(&self, model: Box<dyn ForwardModel>) -> Self {
        let name = model.name().to_owned();
        let problem = Problem::new(model).measured_as(&self.detector);
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
            measured: self.measured.clone(),
            faults: self.faults.clone(),
            rest_ohm: self.rest_ohm.clone(),
        }
    }

    /// The baseline (V): the mean of the first frames.
    fn baseline_v(&self, measurement: &mut Measurement) -> Readings {
        let mut rest = Readings::from_fn(self.detector.electrodes.len(), |_, _| 0.0);
        for _ in 0..BASELINE_FRAMES {
            let frame = measurement.readings_v(self.rest_ohm.as_ref());
            let share = |(sum, volts): (&mut f64, &f64)| *sum += volts / f64::from(BASELINE_FRAMES);
            rest.volts_mut().iter_mut().zip(frame.volts()).for_each(share);
        }
        rest
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
        let mut measurement = Measurement::new(&self.measured, &self.faults, seed)?;
        let rest = self.baseline_v(&mut measurement);
        let mut frames: Vec<Frame> = Vec::with_capacity(touches.len());
        let mut last = None;
        for touches in touches {
            let impedance_ohm = match last.take() {
                Some((before, impedance_ohm)) if before == touches => impedance_ohm,
                _ if touches.is_empty() => None,
                _ => Some(touched_impedance_ohm(&*self.truth, touches)?),
            };
            let mut readings = measurement.readings_v(impedance_ohm.as_ref());
            readings.volts_mut().iter_mut().zip(rest.volts()).for_each(|(volts, rest)| *volts -= rest);
            let contacts = touches.iter().map(Touch::disc).collect();
            frames.push(Frame { touches: touches.clone(), contacts, readings });
            last = Some((touches, impedance_ohm));
        }
        Ok(frames)
    }
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
    fn solvers_know_of_another_converter_but_not_of_a_wrong_detector() {
        let experiment = experiment();
        let mut other = experiment.detector.clone();
        other.adc.bits = 10;
        assert_eq!(experiment.measured_as(&other).problem.detector().adc.bits, 10);
        other.layers[0].thickness_m *= 2.0;
        let wrong = experiment.with_truth(&other).unwrap();
        assert_eq!(wrong.problem.detector(), &experiment.detector);
        assert_ne!(readings(&wrong, 1), readings(&experiment, 1));
    }
}
