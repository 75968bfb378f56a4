//! What the readings of an experiment are of.

use std::sync::Arc;

use nalgebra::DMatrix;

use crate::independent::Independent;
use tactomo_physics::forward::{ForwardError, ForwardModel, touched_impedance_ohm};
use tactomo_physics::scene::Touch;

/// What gives exact impedances: no solver sees it.
#[derive(Clone)]
pub(super) enum Truth {
    /// A model of the detector as it is.
    Model(Arc<dyn ForwardModel>),
    /// The solution of another program.
    Independent(Arc<Independent>),
}

impl Truth {
    /// The impedance matrix of the electrodes (ohm) under touches.
    ///
    /// # Errors
    /// [`ForwardError`] if it has no such touch, or nothing conducts.
    pub fn impedance_ohm(&self, touches: &[Touch]) -> Result<DMatrix<f64>, ForwardError> {
        match self {
            Self::Model(model) => touched_impedance_ohm(&**model, touches),
            Self::Independent(solution) => solution.impedance_ohm(touches),
        }
    }
}

impl From<Box<dyn ForwardModel>> for Truth {
    fn from(model: Box<dyn ForwardModel>) -> Self {
        Self::Model(model.into())
    }
}
