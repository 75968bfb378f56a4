//! What unevenness changes at a place.

use nalgebra::DVector;

/// A place of the top, or of the bottom, as unevenness changes the fields on that side.
#[derive(Clone, Debug)]
pub(super) struct UnevenPlace {
    /// `1 / sqrt(s)`.
    pub inverse_root: f64,
    pub modes: DVector<f64>,
    /// Correction of its own current's field, by modes (ohm).
    pub fields: DVector<f64>,
}

impl UnevenPlace {
    /// The correction between two places of the top (ohm), without the roots.
    pub fn correction_ohm(&self, other: &Self) -> f64 {
        self.modes.dot(&other.fields)
    }
}
