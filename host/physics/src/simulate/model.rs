//! The model of a simulated detector, finer than any that is inverted.

use super::{Fault, FaultError, as_built};
use crate::detector::Detector;
use crate::forward::shell::Shell;
use crate::forward::{DrivingLayer, ForwardError, ForwardModel, Resolution, Slab};
use crate::scene::SceneName;

/// Nodes of the image that touches of other shapes than discs have on a simulated slab: not those that slabs are inverted on.
const SLAB_IMAGE_NODES: usize = 3000;
/// Nodes of a simulated shell for each one of the shell that is inverted.
const FINER: usize = 3;

/// Why a detector cannot be simulated.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulationError {
    /// There is no model of it.
    #[error(transparent)]
    Forward(#[from] ForwardError),
    /// A fault cannot be.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// A scene of another shape than discs, on a curved detector.
    #[error("only discs can touch a curved detector, so it cannot have the scene {0}: choose another one")]
    Shape(SceneName),
    /// The system gives no thread to make a model in.
    #[error("no thread to make the model of the detector: {0}")]
    Thread(String),
}

/// The best model of a detector with such faults, finer than those that are inverted: the slab for rectangles, else the shell, which has no
/// sheet resistance of the driving layer.
///
/// # Errors
/// [`ForwardError::Detector`] if there is no model of the detector.
pub fn finer_model(detector: &Detector, faults: &[Fault], seed: u64) -> Result<Box<dyn ForwardModel>, ForwardError> {
    let driving = driving_layer(detector, faults);
    let detector = &as_built(detector, faults, seed);
    if detector.surface.is_none() && detector.outline.as_rectangle().is_some() {
        return Ok(Box::new(Slab::under(detector, Resolution::FINE, driving)?.on_image(SLAB_IMAGE_NODES)));
    }
    Ok(Box::new(Shell::with_nodes(detector, FINER * Shell::default_nodes(detector))?.under(driving)?))
}

/// The driving layer of `detector` with such faults: of several of a kind, the last one.
pub fn driving_layer(detector: &Detector, faults: &[Fault]) -> DrivingLayer {
    let mut driving = DrivingLayer::default();
    for fault in faults {
        match *fault {
            Fault::DrivingSheet { ohm, points } => (driving.sheet_ohm, driving.points) = (ohm, points),
            Fault::Leak { sheets } => driving.leak_s = sheets * detector.sheet_conductance_s(),
            _ => {}
        }
    }
    driving
}
