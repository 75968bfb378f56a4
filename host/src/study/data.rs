//! What solvers are tried with: a detector, the model of it that is inverted, and frames from a finer one.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::scenes::electrode_distance_m;
use crate::detector::Detector;
use crate::forward::{Auto, ForwardError, ForwardModel, touched_impedance_ohm};
use crate::readings::Readings;
use crate::scene::{Contact, Touch};
use crate::simulate::{Fault, FaultError, Measurement, finer_model};
use crate::solve::{Problem, SolveError};

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
    /// Readings less those at rest (V).
    pub readings: Readings,
}

/// A detector, what it is simulated with and what is inverted.
pub struct Laboratory {
    /// The detector as it is told.
    pub detector: Detector,
    /// What solvers get.
    pub problem: Problem,
    /// Time that the inverted model and its Jacobian took.
    pub model_time: Duration,
    /// Name of the inverted model.
    pub model: String,
    truth: Arc<dyn ForwardModel>,
    faults: Vec<Fault>,
}

impl Laboratory {
    /// A sound detector, inverted on the model that it needs.
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
        let problem = Problem::new(model);
        let model_time = start.elapsed();
        let truth = finer_model(detector, &[], 0)?.into();
        Ok(Self { detector: detector.clone(), problem, model_time, model: name, truth, faults: Vec::new() })
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

    /// The same, in truth another detector than the one told: thicker, or of another converter.
    ///
    /// # Errors
    /// [`StudyError`] if it cannot be modelled.
    pub fn with_truth(&self, detector: &Detector) -> Result<Self, StudyError> {
        Ok(Self { truth: finer_model(detector, &[], 0)?.into(), ..self.again() })
    }

    /// The same readings, measured by another converter or drive, which solvers know of.
    pub fn measured_as(&self, detector: &Detector) -> Self {
        Self { detector: detector.clone(), problem: self.problem.measured_as(detector), ..self.again() }
    }

    /// The same, inverted on another model.
    pub fn inverted_on(&self, model: Box<dyn ForwardModel>) -> Self {
        let name = model.name().to_owned();
        let problem = Problem::new(model).measured_as(&self.detector);
        Self { problem, model: name, ..self.again() }
    }

    fn again(&self) -> Self {
        Self {
            detector: self.detector.clone(),
            problem: self.problem.clone(),
            model_time: self.model_time,
            model: self.model.clone(),
            truth: Arc::clone(&self.truth),
            faults: self.faults.clone(),
        }
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
        let mut measurement = Measurement::new(&self.detector, &self.faults, seed)?;
        let mut frames: Vec<Frame> = Vec::with_capacity(touches.len());
        let mut last = None;
        for touches in touches {
            let impedance_ohm = match last.take() {
                Some((before, impedance_ohm)) if before == touches => impedance_ohm,
                _ if touches.is_empty() => None,
                _ => Some(touched_impedance_ohm(&*self.truth, touches)?),
            };
            let readings = measurement.readings_v(impedance_ohm.as_ref());
            let contacts = touches.iter().map(Touch::disc).collect();
            frames.push(Frame { touches: touches.clone(), contacts, readings });
            last = Some((touches, impedance_ohm));
        }
        Ok(frames)
    }
}
