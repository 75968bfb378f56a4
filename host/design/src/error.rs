//! Why a study of detectors cannot be made.

use tactomo_physics::forward::ForwardError;
use tactomo_physics::hertz::SkinError;
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
    Skin(#[from] SkinError),
}
