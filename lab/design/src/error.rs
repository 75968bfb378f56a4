//! Why a study of detectors cannot be made.

use tactomo_physics::detector::Problem;
use tactomo_physics::forward::ForwardError;
use tactomo_study::StudyError;

/// Why a study of detectors cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DesignError {
    /// There is no model of a detector.
    #[error(transparent)]
    Forward(#[from] ForwardError),
    /// Solvers cannot be tried on a detector.
    #[error(transparent)]
    Study(#[from] StudyError),
    /// A foam is no elastic layer.
    #[error(transparent)]
    Skin(#[from] Problem),
    /// Nothing says how soft a detector is.
    #[error(
        "forces need to know how soft {detector} is: give --material, or write young_pa in a table [skin] of its file"
    )]
    Softness {
        /// Its name.
        detector: String,
    },
    /// No detector can be built of what there is.
    #[error(
        "no detector of this size can be built with {electrodes} electrodes or fewer: electrodes touch or leave the outline; allow more electrodes, or another size"
    )]
    NothingFits {
        /// Electrodes that are allowed.
        electrodes: usize,
    },
}
