//! From a fitted strip to the shape that leaves a solver.

use nalgebra::DMatrix;

use super::strip::{Course, Strip};
use crate::solve::answer::{FoundLine, FoundRing, FoundShape, LineUncertainty, RingUncertainty};

/// A strip with the covariance of its parameters.
pub(super) fn found_shape(strip: &Strip, covariance: Option<&DMatrix<f64>>) -> FoundShape {
    let Strip { course, width_m, conductance_s } = *strip;
    let layout = strip.layout();
    let error = |all: &DMatrix<f64>, parameter: usize| all[(parameter, parameter)].max(0.0).sqrt();
    let place = |all: &DMatrix<f64>, first: usize| [error(all, first), error(all, first + 1)];
    match course {
        Course::Line([from_m, to_m]) => {
            let uncertainty = covariance.map(|all| LineUncertainty {
                from_m: place(all, 0),
                to_m: place(all, 2),
                width_m: width_m * error(all, layout.width),
                conductance_s: conductance_s * error(all, layout.conductance),
            });
            FoundShape::Line(FoundLine { from_m, to_m, width_m, conductance_s, uncertainty })
        }
        Course::Ring { centre_m, radius_m } => {
            let uncertainty = covariance.map(|all| RingUncertainty {
                centre_m: place(all, 0),
                radius_m: radius_m * error(all, layout.coordinates),
                width_m: width_m * error(all, layout.width),
                conductance_s: conductance_s * error(all, layout.conductance),
            });
            FoundShape::Ring(FoundRing { centre_m, radius_m, width_m, conductance_s, uncertainty })
        }
    }
}
