//! From readings back to touch: one file a method, one trait.

mod balance;
mod locate;
mod tikhonov;

pub use self::tikhonov::{Lambda, Tikhonov, Variant};
use crate::readings::Readings;

/// A method that reads touch from the readings of a frame.
pub trait Solver: Send {
    /// Name on the command line.
    fn name(&self) -> &'static str;

    /// What the readings, less the readings at rest, say of the contacts.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector the solver was made for.
    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError>;
}

/// What a solver found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solution {
    /// Contact conductance per area at each node of the model's image mesh (S/m2), if the method makes an image. A density,
    /// so that it does not change where the mesh is finer; times the nodes' areas, it is conductance (S).
    pub image_s_per_m2: Option<Vec<f32>>,
    /// Contacts found.
    pub contacts: Vec<FoundContact>,
}

/// One contact found.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct FoundContact {
    /// Centre, x (m).
    pub x_m: f64,
    /// Centre, y (m).
    pub y_m: f64,
    /// Centre, z (m): on a curved detector; zero on a flat one.
    #[serde(skip_serializing_if = "crate::geometry::is_zero")]
    pub z_m: f64,
    /// Conductance (S).
    pub conductance_s: f64,
}

impl FoundContact {
    /// A contact on a flat detector.
    pub const fn flat(x_m: f64, y_m: f64, conductance_s: f64) -> Self {
        Self { x_m, y_m, z_m: 0.0, conductance_s }
    }
}

/// Why a solver cannot answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
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

impl Readings {
    /// Checks that there is a finite number for each pair of `electrodes`.
    ///
    /// # Errors
    /// [`SolveError`], which says what is wrong.
    pub fn check(&self, electrodes: usize) -> Result<(), SolveError> {
        if self.electrodes() != electrodes {
            return Err(SolveError::Electrodes { found: self.electrodes(), expected: electrodes });
        }
        match self.volts().iter().position(|volts| !volts.is_finite()) {
            Some(index) => Err(SolveError::NotFinite { g: index / electrodes, e: index % electrodes }),
            None => Ok(()),
        }
    }
}
