//! A few contacts fitted to the full contact physics, off any grid.
//!
//! Each contact is a spot ([`network`]) with a place and a resistance; spots are fitted with exact derivatives ([`fit`]) from
//! a look at all places ([`scan`]), one more at a time as long as the readings ask for more ([`search`]). What spots leave out
//! of discs of contact is taken from the forward model at the contacts found, and the fit repeated: so the answer is that of
//! the full model, at the cost of the small one. Where contacts of the usual radius cannot explain the readings, their radii
//! are found too ([`discs`]). From one frame to the next the fit starts where it was.

mod discs;
mod fit;
mod network;
#[cfg(test)]
mod places_tests;
mod radii;
mod scan;
mod search;
mod solver;
mod target;
#[cfg(test)]
mod tests;

use nalgebra::DMatrix;

use self::discs::DiscFit;
use self::fit::Fit;
use self::network::{FitSpot, Network};
use self::radii::Radii;
use self::scan::Scan;
pub(super) use self::search::WORTH as PRICE;
pub use self::solver::Contacts;
pub(super) use self::solver::{ContactFollower, ContactSearcher};
use self::target::Errors;
pub(super) use self::target::Target;
use super::evidence::{Evidence, misfit_limit};
use super::{Flags, FoundContact, Problem, Solution, SolveError, Uncertainty};
use tactomo_physics::forward::ForwardError;
use tactomo_physics::forward::spots::SpotFields;
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

/// Places of the scan.
const SCAN_PLACES: usize = 600;
/// Conductance of a contact in sheet conductances above which it is taken as saturated.
const MOST_CONDUCTANCE: f64 = 300.0;
/// Readings above this share of the converter's range, or of the drive, say nothing.
const FULL: f64 = 0.995;

/// How contacts are fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactSettings {
    /// Most contacts.
    pub most: usize,
    /// Radius that contacts are taken to have (m) where the readings do not tell.
    pub radius_m: f64,
    /// Error of the forward model, as a share of the largest reading.
    pub model_error: f64,
    /// Error of the model's, or the builder's, impedance of a pad, as a share of it.
    pub pad_error: f64,
}

impl ContactSettings {
    /// For fingers on a detector: contacts of a sixth of the mean distance of its electrodes.
    pub fn of(problem: &Problem) -> Self {
        // Against three times its nodes, a shell of 2000 is off by 0.0005 (curved) to 0.002 (0.4 mm of square-60), in the root of
        // the mean square and but for the pads' own impedances; the slab by 0.0002 to 0.0005.
        let model_error = if problem.model.name() == "shell" { 0.0015 } else { 0.0007 };
        Self { most: 5, radius_m: problem.spacing_m() / 6.0, model_error, pad_error: 0.03 }
    }
}

/// What finds contacts: the same for all frames, and shared by the threads that follow and search.
pub(super) struct ContactFinder {
    problem: Problem,
    settings: ContactSettings,
    network: Network,
    fields: Box<dyn SpotFields>,
    scan: Scan,
    sheet_s: f64,
    spacing_m: f64,
    /// Widest radius of a disc (m).
    widest_m: f64,
    errors: Errors,
}

/// Contacts that explain a frame, for another frame to go on from.
#[derive(Clone, Debug)]
pub(super) struct Found(Explanation);

impl Found {
    /// What they leave of the frame, and what they take for that.
    pub fn evidence(&self) -> Evidence {
        self.0.evidence()
    }
}

/// Contacts that explain a frame.
#[derive(Clone, Debug)]
enum Explanation {
    /// Spots, what the forward model's readings of contacts of these radii are over theirs (V), and the radii.
    Spots(Fit, Vec<f64>, Radii),
    /// Discs.
    Discs(DiscFit),
}

impl Explanation {
    /// Sum of squares of the weighted residuals.
    fn cost(&self) -> f64 {
        match self {
            Self::Spots(fit, ..) => fit.cost,
            Self::Discs(fit) => fit.cost,
        }
    }

    /// Number of parameters that were fitted.
    fn parameters(&self) -> usize {
        match self {
            Self::Spots(fit, ..) => 3 * fit.spots.len(),
            Self::Discs(fit) => discs::PARAMETERS * fit.contacts.len(),
        }
    }

    fn evidence(&self) -> Evidence {
        Evidence::of(self.cost(), self.parameters())
    }

    fn is_settled(&self) -> bool {
        match self {
            Self::Spots(fit, ..) => fit.settled,
            Self::Discs(fit) => fit.settled,
        }
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
        let network = Network::new(detector, problem.model.electrode_fields_ohm());
        Ok(Self {
            scan: Scan::new(&*fields, &network, SCAN_PLACES),
            network,
            fields,
            errors: Errors {
                noise_v: detector.adc.deviation_v(),
                model: settings.model_error,
                pad: settings.pad_error,
                drive_v: detector.drive_v,
                full_v: FULL * detector.adc.full_scale_v.min(detector.drive_v),
            },
            sheet_s: detector.sheet_conductance_s(),
            spacing_m: problem.spacing_m(),
            widest_m: discs::widest_m(problem),
            problem: problem.clone(),
            settings,
        })
    }

    /// What a frame's readings are fitted as.
    ///
    /// # Errors
    /// [`SolveError`] if they cannot be those of the detector.
    pub fn target(&self, readings: &Readings) -> Result<Target, SolveError> {
        super::check(readings, self.network.electrodes())?;
        Ok(Target::new(readings, &self.errors))
    }

    /// What is known where there is no contact.
    pub fn nothing(&self, target: &Target) -> Solution {
        // No voltage of a board is far beyond its drive.
        let held = |volts: &f64| volts.clamp(-2.0 * self.errors.drive_v, 2.0 * self.errors.drive_v);
        let squares: f64 = target.volts.iter().map(|volts| (held(volts) / self.errors.noise_v).powi(2)).sum();
        let residual = Some((squares / target.volts.len().max(1) as f64).sqrt());
        Solution { residual, ..Solution::default() }
    }

    /// Readings that are left to noise, which is the sum of squares that noise alone leaves.
    fn freedom(&self, found: &Explanation, target: &Target) -> f64 {
        target.count().saturating_sub(found.parameters()).max(1) as f64
    }

    fn contact(&self, spot: &FitSpot, radius_m: f64) -> Contact {
        let [x_m, y_m, z_m] = spot.spot.place_m;
        Contact { z_m, ..Contact::flat(x_m, y_m, radius_m, self.conductance_s(spot)) }
    }

    /// Conductance of the contact of a spot (S), of which what is beyond an edge does nothing.
    fn conductance_s(&self, spot: &FitSpot) -> f64 {
        1.0 / (spot.ohm - spot.spot.own_ohm).max(1.0 / self.most_s()) / spot.spot.share
    }

    fn most_s(&self) -> f64 {
        MOST_CONDUCTANCE * self.sheet_s
    }

    fn solution(&self, found: &Explanation, target: &Target) -> Solution {
        let contacts = match found {
            Explanation::Spots(fit, _, radii) => {
                let covariance = fit.covariance.as_ref().map(|covariance| radii.widened(covariance));
                let of = |(k, spot)| {
                    let found = self.found_spot(spot, k, covariance.as_ref());
                    FoundContact { radius_m: radii.known_m(k), ..found }
                };
                fit.spots.iter().enumerate().map(of).collect()
            }
            Explanation::Discs(fit) => {
                let of = |(k, contact)| found_disc(contact, k, fit.covariance.as_ref());
                fit.contacts.iter().enumerate().map(of).collect::<Vec<_>>()
            }
        };
        let left = found.cost() / self.freedom(found, target);
        let is_perfect = |contact: &FoundContact| contact.conductance_s > 0.9 * self.most_s();
        let flags = Flags {
            saturated: target.is_saturated() || contacts.iter().any(is_perfect),
            misfit: left > misfit_limit(self.freedom(found, target)),
            unfinished: !found.is_settled(),
            excluded: Vec::new(),
        };
        let residual = Some(left.sqrt() * target.deviation_v() / self.errors.noise_v);
        Solution { contacts, residual, flags, ..Solution::default() }
    }

    fn found_spot(&self, spot: &FitSpot, k: usize, covariance: Option<&DMatrix<f64>>) -> FoundContact {
        let [x_m, y_m, z_m] = spot.spot.place_m;
        let conductance_s = self.conductance_s(spot);
        let uncertainty = covariance.map(|all| radii::uncertainty(all, k, spot, conductance_s));
        FoundContact { z_m, uncertainty, ..FoundContact::flat(x_m, y_m, conductance_s) }
    }
}

fn found_disc(contact: &Contact, k: usize, covariance: Option<&DMatrix<f64>>) -> FoundContact {
    let Contact { x_m, y_m, z_m, radius_m, conductance_s } = *contact;
    let uncertainty = covariance.map(|all| uncertainty(all, discs::PARAMETERS * k, radius_m, conductance_s));
    FoundContact { z_m, uncertainty, radius_m: Some(radius_m), ..FoundContact::flat(x_m, y_m, conductance_s) }
}

/// Standard errors from a covariance where a contact's parameters start: places in `metres`, then a logarithm of which one is
/// `per_log_s` of conductance.
fn uncertainty(covariance: &DMatrix<f64>, start: usize, metres: f64, per_log_s: f64) -> Uncertainty {
    let of = |i: usize, j: usize| covariance[(start + i, start + j)];
    let [x, y, log] = [0, 1, 2].map(|i| of(i, i).max(0.0).sqrt());
    let correlation = (of(0, 1) / (x * y).max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0);
    Uncertainty { x_m: x * metres, y_m: y * metres, correlation, conductance_s: per_log_s * log }
}
