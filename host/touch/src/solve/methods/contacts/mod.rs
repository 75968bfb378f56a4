//! A few contacts fitted to the full contact physics, off any grid.
//!
//! Each contact is a disc with a place, a conductance and a radius. Discs are fitted with the forward model itself ([`discs`]), from where contacts
//! would explain most as [spots](crate::solve::fit::spots) of a small circuit ([`scan`], [`spot_fit`], [`starts`]), as long as the evidence for
//! them grows ([`search`], [`evidence`]). From one frame to the next the fit starts where it was. Where single frames do not tell how many contacts stay
//! while their strengths change, several do together ([`window`]).

#[cfg(test)]
mod coverage_tests;
mod discrepancy;
mod discs;
mod doubt;
mod evidence;
mod focus;
mod informed;
mod keep;
mod marginals;
#[cfg(test)]
mod motion_tests;
mod multiple_models;
mod on_detector;
#[cfg(test)]
mod places_tests;
mod rows;
mod scan;
mod search;
mod smoother;
mod solver;
mod spot_fit;
mod starts;
mod systematic_error;
#[cfg(test)]
mod tests;
mod window;

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, OnceLock};

use nalgebra::{DMatrix, Matrix2, Vector2};

use self::discs::{DiscFit, PARAMETERS, place_m};
use self::evidence::Prior;
use self::marginals::{Logs, Usual};
use self::on_detector::{OnDetector, of_place};
use self::scan::Scan;
pub use self::solver::Contacts;
pub(crate) use self::solver::{ContactSearch, ContactTracker};
use self::window::KeyFrame;
use crate::solve::answer::{Alternative, Calibrated, Flags, FoundContact, Solution, SolveError, Uncertainty, check};
use crate::solve::before::adaptive_mean;
use crate::solve::before::adaptive_mean::{AdaptiveMean, Mean};
use crate::solve::fit::approximation::{About, ApproximationError};
use crate::solve::fit::balance::balance;
use crate::solve::fit::evidence::{Evidence, misfit_limit};
use crate::solve::fit::linear::full_v;
use crate::solve::fit::policy;
use crate::solve::fit::spots::SpotModel;
use crate::solve::fit::target::{Errors, PAD_ERROR, Target, model_error};
use crate::solve::methods::compiled::Compiled;
use crate::solve::problem::Problem;
use tactomo_physics::baseline::Leakage;
use tactomo_physics::forward::spots::SpotFields;
use tactomo_physics::forward::{ForwardError, ForwardModel};
use tactomo_physics::readings::{Readings, Says};
use tactomo_physics::space;

/// Places of the scan.
const SCAN_PLACES: usize = 600;

/// Error of a detector as built, as a share of the largest reading, as long as no more is known of it: one contact leaves 0.044 in the
/// median of 100 presses on ten detectors drawn from the usual tolerances of `square-60`. With 0.05, places are off by 1.0 standard
/// error in the median, and 95 % by less than 3.3.
const UNKNOWN_DETECTOR_SHARE: f64 = 0.05;

/// How contacts are fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSettings {
    /// Most contacts.
    pub most: usize,
    /// Usual radius of contacts (m): what is known of it before anything is read, a fingertip's or that of the indenter.
    pub radius_m: f64,
    /// Standard deviation of the logarithm of a radius: 0.7 is a factor of two or so.
    pub radius_deviation: f64,
    /// Error of the forward model, as a share of the largest reading.
    pub model_error: f64,
    /// Error of the model's, or the builder's, impedance of a pad, as a share of it.
    pub pad_error: f64,
}

impl ContactSettings {
    /// For fingers on a detector: contacts of a sixth of the mean distance of its electrodes.
    pub fn of(problem: &Problem) -> Self {
        let model_error = model_error(&*problem.model);
        // Five fingers and a palm.
        Self { most: 6, radius_m: problem.usual_radius_m(), radius_deviation: 0.7, model_error, pad_error: PAD_ERROR }
    }
}

/// Square of readings of a single contact, without noise, over what it has to be for a contact to be looked for: where it is one, half of frames are taken
/// for nothing. Balanced, such readings are a multiple of one pattern, so that all of their square is what a search gains by a
/// contact at the right place. Readings that are bounds count nothing.
pub fn contact_over_needed(readings: &Readings, model: &dyn ForwardModel) -> f64 {
    let (n, detector) = (readings.electrodes(), model.detector());
    let deviation_v = detector.adc.deviation_v().hypot(model_error(model) * readings.largest_v());
    let mut volts = readings.volts().to_vec();
    balance(&mut volts, n, detector.drive_v);
    let is_read = |index: &usize| readings.says(index / n, index % n) == Says::Voltage;
    let square_v2: f64 = (0..n * n).filter(is_read).map(|index| volts[index] * volts[index]).sum();
    square_v2 / (deviation_v * deviation_v * policy::FIRST_GAIN)
}

/// What finds contacts: the same for all frames, and shared by the threads that follow and search.
pub(crate) struct ContactFinder {
    problem: Problem,
    /// What finds contacts in a frame by itself, on a detector that is not known exactly; made when that is asked for first.
    compiled: Mutex<Option<Compiled>>,
    /// To look where contacts may be.
    rough: Arc<dyn ForwardModel>,
    settings: ContactSettings,
    spot_model: SpotModel,
    fields: Box<dyn SpotFields>,
    scan: Scan,
    sheet_s: f64,
    spacing_m: f64,
    /// Widest radius of a disc (m).
    widest_m: f64,
    errors: Errors,
    prior: Prior,
    /// What leakage does; made when it is asked for first.
    leakage: OnceLock<Leakage>,
    /// The grounds that see a contact come; made when they are asked for first.
    watching: OnceLock<Vec<usize>>,
}

/// Contacts that explain a frame, for another frame to go on from.
#[derive(Clone, Debug)]
pub(crate) struct ContactHypothesis {
    fit: DiscFit,
    /// How sure their count is; none once it has changed without a search.
    certainty: Option<Certainty>,
    /// What the readings may be off by together, by which it was compared with others; none of a detector that is as described.
    error: Option<Arc<ApproximationError>>,
    /// Key frames of what is followed, for a search that is to look at these alone.
    keys: Option<Arc<[KeyFrame]>>,
}

/// How sure a count of contacts is, among the counts that were tried.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Certainty {
    /// Its probability.
    share: f64,
    /// The likeliest other count, if that is worth to be named.
    alternative: Option<Alternative>,
}

impl Certainty {
    /// Of so many contacts, by the logarithms of the evidence for each count, on a detector that is known exactly or not; `None` if nothing can be
    /// said.
    fn of(count: usize, by_count: &[f64], is_exact: bool) -> Option<Self> {
        let [more_nat, untried] = match is_exact {
            true => [1.0, 0.0],
            false => [policy::MORE_CONTACTS_NAT, policy::UNTRIED_SHARE],
        };
        let nat = |other: usize| if other > count { more_nat } else { 1.0 };
        let shares = || by_count.iter().enumerate().map(|(other, ln)| (nat(other) * (ln - by_count[count])).exp());
        let share = Some((1.0 - untried) / shares().sum::<f64>()).filter(|share| share.is_finite())?;
        let others = shares().enumerate().filter(|(other, _)| *other != count);
        let other = others.max_by(|(_, a), (_, b)| a.total_cmp(b));
        let other = other.map(|(contacts, of)| Alternative { contacts, certainty: of * share });
        Some(Self { share, alternative: other.filter(|other| other.certainty >= policy::NAMED_SHARE) })
    }
}

/// Takes each better explanation on the way of a search, and ends it if nothing more is wanted.
type Better<'a> = dyn FnMut(&ContactHypothesis) -> ControlFlow<()> + 'a;

impl ContactHypothesis {
    /// What the readings may be off by together, by which it was compared with others.
    pub fn error(&self) -> Option<&Arc<ApproximationError>> {
        self.error.as_ref()
    }

    /// What it makes of the detector.
    fn about(&self) -> About {
        self.error.as_ref().map_or_else(About::default, |error| error.about.clone())
    }

    /// How many contacts it has.
    pub fn count(&self) -> usize {
        self.fit.contacts.len()
    }

    /// Whether a search looks at key frames alone, and leaves it as it is if these say nothing new.
    pub fn is_of_key_frames(&self) -> bool {
        self.keys.is_some()
    }

    /// A fit whose count was not compared with others.
    fn of(fit: DiscFit, target: &Target) -> Self {
        Self { fit, certainty: None, error: target.error().cloned(), keys: None }
    }

    /// A fit, with the logarithms of the evidence for each count.
    fn new(fit: DiscFit, by_count: &[f64], target: &Target) -> Self {
        let certainty = Certainty::of(fit.contacts.len(), by_count, target.error().is_none());
        Self { certainty, ..Self::of(fit, target) }
    }
}

impl ContactFinder {
    /// Makes it ready for a problem.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the model has no spots.
    pub fn new(problem: &Problem, settings: ContactSettings) -> Result<Self, ForwardError> {
        let detector = problem.detector();
        let fields = problem.model.spots(settings.radius_m).ok_or_else(|| ForwardError::Detector {
            detector: detector.name.clone(),
            what: format!("the {} has no fields of single contacts", problem.model.name()),
        })?;
        let spot_model = SpotModel::new(detector, problem.model.electrode_fields_ohm());
        Ok(Self {
            scan: Scan::new(&*fields, &spot_model, SCAN_PLACES),
            spot_model,
            fields,
            errors: Errors {
                noise_v: detector.adc.deviation_v(),
                rounding_v: adaptive_mean::rounding_v(&detector.adc),
                model: settings.model_error,
                detector: (!detector.unknowns().directions.is_empty()).then_some(UNKNOWN_DETECTOR_SHARE),
                pad: settings.pad_error,
                drive_v: detector.drive_v,
                full_v: full_v(detector),
                converters: detector.converters.clone().into(),
                converter_of: detector.electrodes.iter().map(|pad| pad.converter).collect(),
            },
            sheet_s: detector.sheet_conductance_s(),
            spacing_m: problem.spacing_m(),
            widest_m: discs::widest_m(problem),
            prior: Prior {
                area_m2: problem.jacobian.image_mesh.node_areas_m2.iter().sum(),
                radius_deviation: settings.radius_deviation,
            },
            leakage: OnceLock::new(),
            watching: OnceLock::new(),
            rough: problem.model.rough().unwrap_or_else(|| Arc::clone(&problem.model)),
            problem: problem.clone(),
            compiled: Mutex::default(),
            settings,
        })
    }

    /// Checks that readings can be those of the detector.
    ///
    /// # Errors
    /// [`SolveError`] if they cannot.
    pub fn check(&self, readings: &Readings) -> Result<(), SolveError> {
        check(readings, self.spot_model.electrodes())
    }

    /// What the mean of some frames is fitted as; `error` is what they may be off by together, if the detector is not known exactly.
    ///
    /// # Errors
    /// [`SolveError`] if they cannot be those of the detector.
    pub fn target_of(&self, mean: &Mean, error: Option<&Arc<ApproximationError>>) -> Result<Target, SolveError> {
        self.check(&mean.readings)?;
        Ok(match error {
            Some(_) => Target::of_mean(&mean.readings, mean.frames, &self.errors, error),
            None => Target::provisional(&mean.readings, mean.frames, &self.errors),
        })
    }

    /// What the mean of some frames is searched in: what they may be off by together is found with the contacts, once that can be.
    ///
    /// # Errors
    /// [`SolveError`] if they cannot be those of the detector.
    pub fn target_to_search(&self, mean: &Mean) -> Result<Target, SolveError> {
        if self.problem.nuisance().is_none() {
            return self.target_of(mean, None);
        }
        self.check(&mean.readings)?;
        Ok(Target::of_mean(&mean.readings, mean.frames, &self.errors, None))
    }

    /// Whether it is known by now what the readings of a provisional target may be off by together.
    pub fn is_outdated(&self, target: &Target) -> bool {
        target.is_provisional() && self.knows_unknowns()
    }

    /// Whether it is known by now what readings may be off by together.
    pub fn knows_unknowns(&self) -> bool {
        self.problem.made_already().is_some()
    }

    /// What averages frames that stand still.
    pub fn adaptive_mean(&self) -> AdaptiveMean {
        AdaptiveMean::new(self.errors.noise_v)
    }

    /// What is known where there is no contact.
    pub fn nothing(&self, target: &Target) -> Solution {
        let readings = target.readings();
        let n = readings.electrodes();
        let touch_v = (0..n * n).map(|i| readings.touch_v(i / n, i % n));
        let squares: f64 = touch_v.map(|volts| (volts / target.noise_v).powi(2)).sum();
        let residual = Some((squares / target.count().max(1) as f64).sqrt());
        Solution { residual, ..Solution::default() }
    }

    /// Readings that are left to noise, which is the sum of squares that noise alone leaves.
    fn freedom(&self, fit: &DiscFit, target: &Target) -> f64 {
        target.count().saturating_sub(PARAMETERS * fit.contacts.len()).max(1) as f64
    }

    /// Whether more is left than noise and model error leave.
    fn is_misfit(&self, fit: &DiscFit, target: &Target) -> bool {
        let freedom = self.freedom(fit, target);
        fit.cost > freedom * misfit_limit(freedom)
    }

    /// How many contacts are searched at most.
    pub fn most(&self) -> usize {
        self.settings.most
    }

    /// Whether a contact is as wide as a fit lets it be: then it stands for others that are missing, or for what is no disc.
    pub fn is_widest(&self, found: &ContactHypothesis) -> bool {
        found.fit.contacts.iter().any(|contact| contact.radius_m > 0.99 * self.widest_m)
    }

    /// What contacts leave of the frames, and what they take for that.
    pub fn evidence_of_found(&self, found: &ContactHypothesis) -> Evidence {
        self.evidence_of(&found.fit)
    }

    /// What a fit leaves, and what its contacts take for that: in squares, what the logarithm of their evidence has besides.
    fn evidence_of(&self, fit: &DiscFit) -> Evidence {
        let parameters = (PARAMETERS * fit.contacts.len()) as f64;
        Evidence { cost: fit.cost, price: -2.0 * self.evidence(fit) - fit.cost, parameters }
    }

    /// What a fit leaves whose sum of squares is `cost`: root mean square, in standard deviations of the noise.
    fn residual(&self, fit: &DiscFit, cost: f64, target: &Target) -> f64 {
        (cost / self.freedom(fit, target)).sqrt() * target.deviation_v() / target.noise_v
    }

    /// An explanation as a solution, but for the certainty of its count: whoever answers knows whether it is an answer.
    fn solution(&self, fit: &DiscFit, target: &Target) -> Solution {
        let covariance = fit.covariance();
        let logs: Vec<_> = (0..fit.contacts.len()).map(|k| self.logs(fit, k, covariance.as_ref())).collect();
        let mut contacts: Vec<_> =
            logs.iter().enumerate().map(|(k, logs)| self.contact(fit, k, covariance.as_ref().zip(*logs))).collect();
        self.add_unseen_scale(fit, &mut contacts);
        // A standard error more and it is as firm as makes a difference.
        let perfect = (policy::CONDUCTANCES_SHEETS[1] * self.sheet_s).ln();
        let is_perfect = |logs: &Option<Logs>| {
            logs.is_some_and(|Logs { conductance: [mean, deviation], .. }| mean + deviation > perfect)
        };
        let calibrated = self.calibrated(fit, target);
        let flags = Flags {
            saturated: target.is_saturated() || logs.iter().any(is_perfect),
            misfit: self.is_misfit(fit, target),
            unfinished: !fit.settled || target.is_provisional(),
            calibrate: calibrated.is_some(),
            ..Flags::default()
        };
        let residual = Some(self.residual(fit, fit.cost, target));
        Solution { contacts, residual, flags, calibrated, ..Solution::default() }
    }

    /// A contact of a fit with its standard errors: near the edge, the mean of where on the detector it may be.
    fn contact(&self, fit: &DiscFit, k: usize, known: Option<(&DMatrix<f64>, Logs)>) -> FoundContact {
        let contact = fit.contacts[k];
        let conductance_s = known.map_or(contact.conductance_s, |(_, logs)| logs.conductance[0].exp());
        let near_edge = known.and_then(|(covariance, _)| OnDetector::of(fit, k, covariance, &self.disc_fitter()));
        let uncertainty = known.map(|(covariance, logs)| {
            let covariance = near_edge.as_ref().map_or_else(|| of_place(covariance, k), |place| place.covariance);
            let conductance_s = conductance_s * logs.conductance[1];
            Uncertainty { conductance_s, ..place_uncertainty(fit, k, &covariance) }
        });
        let radius =
            known.map(|(_, logs)| logs.radius).filter(|[_, deviation]| *deviation < policy::KNOWN_RADIUS_DEVIATION);
        let [x_m, y_m, z_m] = near_edge.map_or(place_m(&contact), |place| {
            let (along, unit_m) = fit.along(k);
            self.fields.footing(space::moved(place_m(&contact), (unit_m * place.mean).into(), along)).0
        });
        FoundContact {
            z_m,
            apparent_conductance_s: Some(contact.conductance_s / (1.0 + fit.constriction(k))),
            uncertainty,
            radius_m: radius.map(|[mean, _]| mean.exp()),
            ..FoundContact::flat(x_m, y_m, conductance_s)
        }
    }

    /// Adds to the standard errors of conductances what of the detector no readings tell from them.
    fn add_unseen_scale(&self, fit: &DiscFit, contacts: &mut [FoundContact]) {
        let Some(nuisance) = self.problem.made_already() else { return };
        for (contact, deviation) in contacts.iter_mut().zip(nuisance.conductance_deviations(&fit.contacts)) {
            let conductance_s = contact.conductance_s;
            let uncertainty = contact.uncertainty.iter_mut();
            uncertainty.for_each(|known| known.conductance_s = known.conductance_s.hypot(conductance_s * deviation));
        }
    }

    /// What a calibration would bring, if a place is not known well, the detector as described leaves more of the readings than noise and the model's
    /// own error do, and that is what the place is not known better for.
    fn calibrated(&self, fit: &DiscFit, target: &Target) -> Option<Calibrated> {
        let exact = target.as_exact(&self.errors)?;
        let freedom = self.freedom(fit, &exact);
        let is_off = exact.cost(&fit.volts) > freedom * misfit_limit(freedom);
        let known = self.disc_fitter().covariance(fit, &exact)?;
        let largest_m = |covariance: &DMatrix<f64>| {
            let of = |k: usize| place_uncertainty(fit, k, &of_place(covariance, k));
            (0..fit.contacts.len()).map(of).map(|place| place.x_m.max(place.y_m)).fold(0.0, f64::max)
        };
        let [now_m, exact_m] = [&fit.covariance()?, &known].map(largest_m);
        let calibrated_m = exact_m.hypot(policy::CALIBRATED_SHARE * self.spacing_m);
        let worth_m = (policy::CALIBRATION_WORTH * calibrated_m).max(policy::KNOWN_SHARE * self.spacing_m);
        (is_off && now_m > worth_m).then_some(Calibrated { now_m, calibrated_m })
    }

    /// What the readings say of a contact's conductance and radius.
    fn logs(&self, fit: &DiscFit, k: usize, covariance: Option<&DMatrix<f64>>) -> Option<Logs> {
        let [ln_conductance, conductance_deviation] = self.disc_fitter().usual_strength(fit.still.as_deref(), k);
        let usual = Usual {
            conductance_s: ln_conductance.exp(),
            conductance_deviation,
            most_s: policy::CONDUCTANCES_SHEETS[1] * self.sheet_s,
            radius_m: self.settings.radius_m,
            radius_deviation: self.settings.radius_deviation,
        };
        usual.logs(fit, k, covariance?)
    }
}

/// Standard errors of a contact's place, from its covariance in the parameters.
fn place_uncertainty(fit: &DiscFit, k: usize, covariance: &Matrix2<f64>) -> Uncertainty {
    let (along, unit_m) = fit.along(k);
    // Directions along the surface to x and y.
    let parts = |axis: usize| Vector2::new(along[0][axis], along[1][axis]);
    let between = |a: Vector2<f64>, b: Vector2<f64>| a.dot(&(covariance * b));
    let [x, y] = [0, 1].map(|axis| between(parts(axis), parts(axis)).max(0.0).sqrt());
    let correlation = (between(parts(0), parts(1)) / (x * y).max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0);
    Uncertainty { x_m: x * unit_m, y_m: y * unit_m, correlation, conductance_s: 0.0 }
}
