//! What a solver says of a frame, and why it cannot say anything. Knows no other module of this package.

use std::f64::consts::PI;

mod fault;
mod shape;
mod total;

pub use self::fault::ElectrodeFault;
pub use self::shape::{FoundLine, FoundRing, FoundShape, LineUncertainty, RingUncertainty};
pub use self::total::Total;
use tactomo_physics::detector::Newtons;
use tactomo_physics::readings::Readings;
use tactomo_physics::space::Place;

/// What a solver found.
///
/// ```
/// use tactomo_touch::solve::{FoundContact, Solution};
///
/// let solution = Solution { contacts: vec![FoundContact::flat(0.01, -0.005, 2e-4)], ..Solution::default() };
/// assert!(solution.is_contacts() && !solution.flags.is_doubtful());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solution {
    /// Contact conductance per area at each node of the model's image mesh (S/m2), if the method makes an image. A density,
    /// so that it does not change where the mesh is finer; times the nodes' areas, it is conductance (S).
    pub image_s_per_m2: Option<Vec<f32>>,
    /// Contacts found. Where a shape or, by a solver that chooses, an image is the answer, the contacts that would explain the readings best
    /// are kept beside it: [`is_contacts`](Self::is_contacts) tells.
    pub contacts: Vec<FoundContact>,
    /// The one shape that explains the readings, if a solver that knows shapes chose it; then the image is that of the shape.
    pub shape: Option<FoundShape>,
    /// How far the readings are from those of what was found: root mean square, in standard deviations of the noise; if the
    /// method predicts readings. About 1 where noise is all that is left.
    pub residual: Option<f64>,
    /// What to know before this is believed.
    pub flags: Flags,
    /// What a calibration would bring, where [`Flags::calibrate`] asks for one.
    pub calibrated: Option<Calibrated>,
    /// Probability that as many contacts touch as were found, against other numbers of contacts and a shape, or that of a shape against contacts; of a
    /// method that weighs them. `None` where the answer [is doubtful](Flags::is_doubtful).
    pub certainty: Option<f64>,
    /// The likeliest other number of contacts, or the number in place of a shape, where that has 5 % at least.
    pub alternative: Option<Alternative>,
    /// What was chosen and why, by a solver that chooses.
    pub choice: Option<Choice>,
}

impl Solution {
    /// Whether the contacts are the answer, not beside it: no shape and no image.
    pub fn is_contacts(&self) -> bool {
        self.shape.is_none() && self.image_s_per_m2.is_none()
    }

    /// Flags it as a misfit, which is sure of no number.
    pub fn doubt(&mut self) {
        self.flags.misfit = true;
        (self.certainty, self.alternative) = (None, None);
    }
}

/// Another number of contacts than was found, which may be the right one.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Alternative {
    /// How many contacts.
    pub contacts: usize,
    /// Probability that so many touch.
    pub certainty: f64,
}

/// What to know before a solution is believed.
#[derive(Clone, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Flags {
    /// Readings are at an end of the converter's range, or contacts conduct so well that more would change nothing.
    pub saturated: bool,
    /// The readings are not what the model can give for what was found, by more than noise and the model's own error.
    pub misfit: bool,
    /// The method stopped before its end, to keep a limit of time or steps.
    pub unfinished: bool,
    /// A place is known no better than to a fifteenth of the distance of electrodes, since the detector differs from its description within its
    /// tolerances: after a calibration it would be known twice as well.
    pub calibrate: bool,
    /// Electrodes that were left out.
    pub excluded: Vec<usize>,
    /// What is wrong with each of those, in their order.
    pub faults: Vec<ElectrodeFault>,
}

impl Flags {
    /// Whether the answer does not explain the readings, or is not the last word: then nothing can be said of how sure it is.
    pub fn is_doubtful(&self) -> bool {
        self.misfit || self.unfinished
    }
}

/// Standard error of a place, of the least known contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibrated {
    /// As it is now (m).
    pub now_m: f64,
    /// After a calibration by rubbing (m).
    pub calibrated_m: f64,
}

/// What a solver chose.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Choice {
    /// The model of the scene: `nothing`, `2 contacts`, `line`, `ring`, `image`.
    pub what: String,
    /// Why, with the figures that decided.
    pub why: String,
}

/// One contact found. Its names outside of the program are those of [`crate::schema`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FoundContact {
    /// Centre, x (m).
    pub x_m: f64,
    /// Centre, y (m).
    pub y_m: f64,
    /// Centre, z (m): on a curved detector; zero on a flat one.
    pub z_m: f64,
    /// Conductance (S); zero where it is not known, of a solver that was taught something else (see
    /// [`known_conductance_s`](Self::known_conductance_s)).
    pub conductance_s: f64,
    /// Conductance (S) of it in series with the current that crowds under it, its spreading resistance: of a firm contact readings give that far
    /// better than either. Of a method that fits contacts.
    pub apparent_conductance_s: Option<f64>,
    /// Radius (m), where the readings tell it.
    pub radius_m: Option<f64>,
    /// Force (N): on a detector with a law of force, or of a solver that was taught forces.
    pub force_n: Option<f64>,
    /// Depth (m) that it is pressed in: of a solver that was taught depths.
    pub depth_m: Option<f64>,
    /// Standard error of the force (N), of a law of force.
    pub force_deviation_n: Option<f64>,
    /// Whether the force is beyond the largest that the law of force can tell: then it may be more.
    pub force_beyond_maximum: Option<bool>,
    /// Standard errors, of a method that knows them.
    pub uncertainty: Option<Uncertainty>,
    /// Number that a contact keeps from frame to frame, of a method that follows contacts.
    pub id: Option<u32>,
    /// What it has done since the answer that its reader got before: of one that has a number, once [`Changes`](crate::changes::Changes) has
    /// seen it.
    pub change: Option<Change>,
}

/// What a contact has done since the answer before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// It is new.
    Start,
    /// It was there.
    Move {
        /// Its way (m).
        way_m: Place,
    },
}

/// Standard errors of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Uncertainty {
    /// Of x (m).
    pub x_m: f64,
    /// Of y (m).
    pub y_m: f64,
    /// Correlation of the errors of x and y, -1 to 1.
    pub correlation: f64,
    /// Of the conductance (S).
    pub conductance_s: f64,
}

impl FoundContact {
    /// Takes its force.
    pub(crate) fn set_force(&mut self, newtons: Newtons) {
        self.force_n = Some(newtons.force_n);
        self.force_deviation_n = Some(newtons.deviation_n);
        self.force_beyond_maximum = Some(newtons.beyond_maximum);
    }

    /// A contact on a flat detector.
    pub fn flat(x_m: f64, y_m: f64, conductance_s: f64) -> Self {
        Self { x_m, y_m, conductance_s, ..Self::default() }
    }

    /// Its conductance (S), where that is known: nothing that touches has none.
    pub fn known_conductance_s(&self) -> Option<f64> {
        (self.conductance_s != 0.0).then_some(self.conductance_s)
    }

    /// Its area (m2), where the readings tell its radius.
    pub fn area_m2(&self) -> Option<f64> {
        self.radius_m.map(|radius_m| PI * radius_m.powi(2))
    }
}

/// Why a solver cannot answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolveError {
    /// Readings of another number of electrodes.
    #[error("readings of {found} electrodes, but the detector has {expected}")]
    Electrodes {
        /// In the readings.
        found: usize,
        /// In the detector.
        expected: usize,
    },
    /// A reading that is not a number.
    #[error("the reading of electrode {e} with electrode {g} grounded is not a finite number")]
    NotFinite {
        /// Grounded electrode.
        g: usize,
        /// Electrode read.
        e: usize,
    },
}

/// Checks that there is a finite number for each pair of `electrodes`.
///
/// # Errors
/// [`SolveError`], which says what is wrong.
pub fn check(readings: &Readings, electrodes: usize) -> Result<(), SolveError> {
    check_count(readings, electrodes)?;
    match readings.volts().iter().position(|volts| !volts.is_finite()) {
        Some(index) => Err(SolveError::NotFinite { g: index / electrodes, e: index % electrodes }),
        None => Ok(()),
    }
}

/// Checks that there is a number for each pair of `electrodes`.
pub(crate) fn check_count(readings: &Readings, electrodes: usize) -> Result<(), SolveError> {
    match readings.electrodes() == electrodes {
        true => Ok(()),
        false => Err(SolveError::Electrodes { found: readings.electrodes(), expected: electrodes }),
    }
}
