//! What solvers are made for.

use std::borrow::Cow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread;

use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_physics::forward::{Auto, ForwardError, ForwardModel, Joint, JointCurrents, Nuisance, Through};
use tactomo_physics::readings::Readings;
use tactomo_physics::threads;

use crate::learned::Learned;
use crate::solve::before::complete::Completer;
use crate::solve::compiled::{CompiledDetector, CompiledFields, Modelled};

/// A detector as it is measured, and the model of it that is inverted. Cheap to clone.
///
/// ```
/// use tactomo_physics::detector::Detector;
/// use tactomo_touch::solve::{Method, Problem};
///
/// let problem = Problem::of(&Detector::default())?;
/// // All solvers of a detector share it.
/// let solvers = [Method::Tikhonov.build(&problem)?, Method::Contacts.build(&problem)?];
/// assert_eq!(solvers.map(|solver| solver.name()), ["tikhonov", "contacts"]);
/// # Ok::<(), tactomo_physics::forward::ForwardError>(())
/// ```
#[derive(Clone)]
pub struct Problem {
    /// The model. Its fields do not depend on drive voltage and converter, so it serves any board.
    pub model: Arc<dyn ForwardModel>,
    /// The linear theory for the detector as measured, and the mesh that solvers' images are on.
    pub jacobian: Arc<Jacobian>,
    nuisance: Arc<Unknown>,
    /// Made when readings are not whole for the first time.
    completer: Arc<OnceLock<Completer>>,
    /// What was learned on the sensor itself.
    learned: Option<Learned>,
}

/// Why something learned does not serve a problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("it learned from {channels} readings a press, but a detector with {electrodes} electrodes gives {}", electrodes * electrodes)]
pub struct LearnedElsewhere {
    channels: usize,
    electrodes: usize,
}

/// What is not known of the detector; made when it is asked for first.
#[derive(Default)]
struct Unknown {
    made: OnceLock<Option<Nuisance>>,
    /// Fields of the detector with it.
    fields: OnceLock<Option<CompiledFields>>,
    /// Whether a thread of its own makes it.
    beside: AtomicBool,
    /// Of a problem through some of the electrodes: where it is had from in next to no time.
    seen_of: Option<Whole>,
}

/// A problem with all electrodes, some of which are seen.
struct Whole {
    problem: Problem,
    kept: Vec<usize>,
    joints: Vec<Joint>,
}

impl Problem {
    /// The problem of a detector, on the model that it needs: see [`Auto`].
    ///
    /// # Errors
    /// [`ForwardError`] if the detector cannot be modelled.
    pub fn of(detector: &Detector) -> Result<Self, ForwardError> {
        Ok(Self::new(Auto::new(detector, None)?.model))
    }

    /// The problem of a model, measured as its detector says.
    pub fn new(model: impl Into<Arc<dyn ForwardModel>>) -> Self {
        let model = model.into();
        let jacobian = Arc::new(Jacobian::of(&*model));
        Self { model, jacobian, nuisance: Arc::default(), completer: Arc::default(), learned: None }
    }

    /// This problem with another linear theory, on a mesh of its own.
    pub fn with_jacobian(self, jacobian: Jacobian) -> Self {
        Self { jacobian: Arc::new(jacobian), completer: Arc::default(), ..self }
    }

    /// This problem with what was learned on the sensor itself: its method takes that, in place of what it would make of the model.
    ///
    /// # Errors
    /// [`LearnedElsewhere`] if it needs other readings.
    pub fn with_learned(self, learned: Learned) -> Result<Self, LearnedElsewhere> {
        let (channels, electrodes) = (learned.channels(), self.detector().electrodes.len());
        match channels == electrodes * electrodes {
            true => Ok(Self { learned: Some(learned), ..self }),
            false => Err(LearnedElsewhere { channels, electrodes }),
        }
    }

    /// What was learned on the sensor itself.
    pub fn learned(&self) -> Option<&Learned> {
        self.learned.as_ref()
    }

    /// This problem with drive voltage, multiplexer and converter of `detector`, and with what is not known of it.
    pub fn measured_as(&self, detector: &Detector) -> Self {
        let known = |detector: &Detector| (detector.tolerances, detector.calibration.clone());
        let nuisance = match known(detector) == known(self.detector()) {
            true => Arc::clone(&self.nuisance),
            false => Arc::default(),
        };
        let problem = self.clone().with_jacobian(Jacobian { detector: detector.clone(), ..(*self.jacobian).clone() });
        Self { nuisance, ..problem }
    }

    /// The detector as measured.
    pub fn detector(&self) -> &Detector {
        &self.jacobian.detector
    }

    /// What is not known of the detector; `None` if it is exact, and as long as it is [made beside](Self::make_nuisance_beside). Else the
    /// first call makes a model for each of some dozens of parameters, which takes about a second with 16 electrodes, and half a minute with 32.
    pub fn nuisance(&self) -> Option<&Nuisance> {
        if self.is_made_beside() {
            return self.made_already();
        }
        self.made_nuisance(threads::cores())
    }

    /// Whether a thread of its own makes what is not known of the detector, or has made it.
    fn is_made_beside(&self) -> bool {
        let of_whole = self.nuisance.seen_of.as_ref().is_some_and(|whole| whole.problem.is_made_beside());
        of_whole || self.nuisance.beside.load(Ordering::Acquire)
    }

    /// What is not known of the detector, if that was made.
    pub(super) fn made_already(&self) -> Option<&Nuisance> {
        match &self.nuisance.seen_of {
            Some(whole) if whole.problem.nuisance.made.get().is_some() => self.made_nuisance(1),
            _ => self.nuisance.made.get()?.as_ref(),
        }
    }

    /// Begins to make what is not known of the detector in a thread of its own, and leaves a core to others. Meanwhile contacts are found
    /// by an error of each reading that stands for it, and flagged as unfinished: live, rough ones are better than none for half a minute.
    pub fn make_nuisance_beside(&self) {
        let problem = self.clone();
        let made = move || {
            threads::leave_a_core();
            problem.made_nuisance(threads::cores());
            problem.made_fields(threads::cores());
        };
        // Without a thread, whoever asks first makes it.
        let thread = thread::Builder::new().name("unknowns".to_owned()).spawn(made);
        self.nuisance.beside.store(thread.is_ok(), Ordering::Release);
    }

    fn made_nuisance(&self, cores: usize) -> Option<&Nuisance> {
        let made = || {
            let nuisance = match &self.nuisance.seen_of {
                Some(Whole { problem, kept, joints }) => {
                    let whole = problem.made_nuisance(cores);
                    whole.map(|whole| whole.through(&self.model, kept, joints)).transpose()
                }
                None => Nuisance::new(&self.model, self.detector(), cores),
            };
            nuisance.unwrap_or_else(|error| {
                tracing::warn!("what is not known of the detector is left out: {}", with_causes(&error));
                None
            })
        };
        self.nuisance.made.get_or_init(made).as_ref()
    }

    /// The detector as measured, compiled with what is not known of it; `None` if it is curved, has too many electrodes or is seen through some of them, and as long as
    /// that is [made beside](Self::make_nuisance_beside). Else the first call compiles it, which takes half a second of a core with 16 electrodes.
    pub(crate) fn compiled(&self) -> Option<CompiledDetector> {
        let made = || self.nuisance.fields.get().and_then(Option::as_ref);
        let fields = if self.is_made_beside() { made() } else { self.made_fields(threads::cores()) };
        fields?.measured(self.modelled()).ok()
    }

    /// Whether there is one, or the first call makes one.
    pub(crate) fn has_compiled(&self) -> bool {
        match self.nuisance.fields.get() {
            Some(fields) => fields.is_some(),
            None => !self.is_made_beside() && self.nuisance.seen_of.is_none(),
        }
    }

    fn made_fields(&self, cores: usize) -> Option<&CompiledFields> {
        let is_whole = self.nuisance.seen_of.is_none();
        let made = || is_whole.then(|| CompiledFields::of(self.modelled(), cores).ok()).flatten();
        self.nuisance.fields.get_or_init(made).as_ref()
    }

    /// Readings that are all voltages: those that were not read, or reached an end of the converter's range, as the linear theory has them
    /// from the others.
    pub fn completed<'a>(&self, readings: &'a Readings) -> Cow<'a, Readings> {
        if readings.all_say().is_empty() {
            return Cow::Borrowed(readings);
        }
        self.completer.get_or_init(|| Completer::new(&self.jacobian)).completed(readings)
    }

    /// Mean distance of electrodes (m): the side of a square that each has for itself.
    pub fn spacing_m(&self) -> f64 {
        let area_m2: f64 = self.jacobian.image_mesh.node_areas_m2.iter().sum();
        (area_m2 / self.detector().electrodes.len().max(1) as f64).sqrt()
    }

    /// Radius of contacts that is usual (m), a fingertip's: a sixth of the mean distance of electrodes.
    pub fn usual_radius_m(&self) -> f64 {
        self.spacing_m() / 6.0
    }

    /// The detector as measured, with what is compiled of it.
    pub(crate) fn modelled(&self) -> Modelled<'_> {
        Modelled { model: &self.model, detector: self.detector(), radius_m: self.usual_radius_m() }
    }

    /// The problem through some of its electrodes, in this order, with some of all its electrodes joined. Joined electrodes are one:
    /// one of them is kept.
    pub fn through(&self, kept: &[usize], joints: &[Joint]) -> Self {
        let detector = self.detector().keeping(kept);
        let pads = &self.jacobian.electrode_fields_ohm;
        let joint_currents = JointCurrents::new(pads, joints);
        let jacobian = Jacobian {
            detector,
            fields_ohm: joint_currents.applied(&self.jacobian.fields_ohm).select_columns(kept),
            electrode_fields_ohm: joint_currents.applied(pads).select_rows(kept).select_columns(kept),
            ..(*self.jacobian).clone()
        };
        let model = Through::new(Arc::clone(&self.model), kept.to_vec(), joints.to_vec());
        let (model, jacobian) = (Arc::new(model), Arc::new(jacobian));
        let whole = Whole { problem: self.clone(), kept: kept.to_vec(), joints: joints.to_vec() };
        let nuisance = Arc::new(Unknown { seen_of: Some(whole), ..Unknown::default() });
        Self { model, jacobian, nuisance, completer: Arc::default(), learned: None }
    }
}
