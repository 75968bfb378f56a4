//! From the detector on paper to the one that was built.
//!
//! A finger rubbed over the foam is enough: the impedance matrix of a single contact, centred, is that of the bare detector wherever
//! the contact is (`centred`), which tells single contacts from others and finds the order of the wires (`wires`); then detector and all
//! contacts are fitted together (`bundle`), with the builder's tolerances as prior. What is left unknown is kept with the detector
//! (`posterior`); what that is worth, presses say that were not used (`held_out`). What no parameter explains is corrected by presses at known places (`known`).

mod bundle;
mod centred;
mod contact;
pub mod force;
mod held_out;
pub mod known;
mod posterior;
pub mod pressed;
mod presses;
mod rub;
mod slopes;
#[cfg(test)]
mod tests;
mod wires;

use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;

pub use self::held_out::{HeldOut, Missing};
pub use self::rub::{Rub, RubSettings, rub};

/// A frame of a rub, or a press of a table.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Readings (V), less the baseline.
    pub readings: Readings,
    /// Where the one contact is known to be (m).
    pub known_m: Option<[f64; 2]>,
}

/// How far an adjustment is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// Iterations done.
    pub iteration: usize,
    /// Sum of squares for each reading, in standard deviations of noise and model error: about 1 or less where all fits.
    pub chi_square: f64,
}

/// Why there is no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrateError {
    /// Nothing was touched.
    #[error(
        "nothing presses in any of {frames} frames: rub one fingertip firmly over the whole sensor while it records, for half a minute"
    )]
    NoPress {
        /// Frames that were looked at.
        frames: usize,
    },
    /// There is hardly a frame with one contact only.
    #[error(
        "only {single} of {touched} touched frames agree on one detector under a single contact: rub with one fingertip alone, and nothing else \
         on the sensor"
    )]
    NotSingle {
        /// Frames that something touched in.
        touched: usize,
        /// Those that agree.
        single: usize,
    },
    /// Of every touch, some electrodes read less than the converter can tell.
    #[error(
        "in none of {touched} touched frames do all electrodes read more than the converter's floor: rub firmer, or lift the ground of the \
         multiplexer (`ground_v` in the detector's file)"
    )]
    Light {
        /// Frames that something touched in.
        touched: usize,
    },
    /// Too many electrodes are wrong.
    #[error("electrodes {faulty:?} are broken, shorted or contradict the others: mend their wires before calibrating")]
    Electrodes {
        /// Which.
        faulty: Vec<usize>,
    },
    /// Readings of another number of electrodes.
    #[error(
        "the readings are of {readings} electrodes, the detector {detector} has {electrodes}: choose the detector that was rubbed"
    )]
    Count {
        /// Electrodes of the readings.
        readings: usize,
        /// Name of the detector.
        detector: String,
        /// Electrodes of the detector.
        electrodes: usize,
    },
    /// What was found is too far from the description.
    #[error(
        "the readings are not those of {detector} within its tolerances: the bare detector differs by {distance:.0} %, where {usual:.0} % is usual: \
         choose the detector that was rubbed, see that no wires touch, or widen [tolerances]"
    )]
    OtherDetector {
        /// Name of the detector.
        detector: String,
        /// Distance of the centred matrices (%).
        distance: f64,
        /// What tolerances make of it (%).
        usual: f64,
    },
    /// No detector near the description, with one contact for each press, has such readings.
    #[error(
        "no detector within the tolerances of {detector} explains the presses: they are off by {residual:.1} x noise: rub with one fingertip \
         alone, see that no wire is loose, choose the detector that was rubbed, or widen [tolerances]"
    )]
    Unfit {
        /// Name of the detector.
        detector: String,
        /// Root of the mean square of what is left, in deviations of noise and the model's own error.
        residual: f64,
    },
    /// Known places contradict the readings.
    #[error(
        "the presses at known places do not fit: they are off by {off_mm:.1} mm, in whatever way the sensor is turned or mirrored: see that \
         each place belongs to its row, x and y from the middle in the unit that is asked for"
    )]
    Places {
        /// Root mean square (mm).
        off_mm: f64,
    },
    /// There is no model of the detector.
    #[error(transparent)]
    Forward(#[from] ForwardError),
    /// It was asked to stop.
    #[error("stopped before the end")]
    Stopped,
}
