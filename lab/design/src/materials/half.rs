//! Materials compared where each is pressed so that its contact is at half of the drive.
//!
//! A contact of one conductivity is a light touch for a good conductor and shorts a poor one: at 1 S/m, foam of 0.001 S/m is saturated and foam of 100 S/m
//! hardly pressed. Here all are as far from saturation.

use tactomo_physics::forward::{ForwardError, ForwardModel};
use tactomo_study::Errors;

use super::super::limit::{at_share_of_drive, place_m, two_points_m};
use super::super::metrics::Sweep;
use super::super::{Imaging, PaperSolver, Press};

/// Potential of the contact as a share of the drive.
const SHARE: f64 = 0.5;

/// What is seen of contacts that are at half of the drive in the middle.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct AtHalf {
    /// Conductivity of such a contact (S/m).
    pub strength_s_per_m: f64,
    /// SR and PA with the paper's solver, without noise.
    #[serde(flatten)]
    pub imaging: Imaging,
    /// Of the sensor itself: [`Limit::place_m`](super::Limit::place_m).
    pub place_m: Option<f64>,
    /// [`Limit::two_points_m`](super::Limit::two_points_m).
    pub two_points_m: Option<f64>,
}

impl AtHalf {
    /// Of a model; `None` if no contact is at half of the drive.
    ///
    /// # Errors
    /// [`ForwardError`] if a contact is off the detector.
    pub(super) fn of(
        model: &dyn ForwardModel,
        press: &Press,
        strengths: [f64; 2],
        solver: &PaperSolver,
    ) -> Result<Option<Self>, ForwardError> {
        let Some(strength) = at_share_of_drive(model, press, strengths, SHARE)? else { return Ok(None) };
        let errors = Errors::of_noise(model.detector(), model.detector().adc.deviation_v());
        Ok(Some(Self {
            strength_s_per_m: strength,
            imaging: Sweep::of(model, press, &[], strength)?.metrics(solver).imaging,
            place_m: place_m(model, press, strength)?,
            two_points_m: two_points_m(model, press, strength, &errors)?,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::{Detector, Layer};
    use tactomo_physics::forward::Slab;

    /// Conductors of one shape, pads and switch aside, look the same at half of the drive, whatever they conduct.
    #[test]
    fn uniform_materials_are_alike() {
        let base = Detector { on_resistance_ohm: 0.0, contact_impedance_ohm_m2: 1e-9, ..Detector::default() };
        let solver = PaperSolver::new(&base).unwrap();
        let [poor, good] = [0.01, 1.0].map(|s_per_m| {
            let slab = Slab::new(&Detector { layers: vec![Layer::uniform(0.010, s_per_m)], ..base.clone() }).unwrap();
            AtHalf::of(&slab, &Press::PAPER, [1e-3, 10.0], &solver).unwrap().unwrap()
        });
        assert!((good.strength_s_per_m / poor.strength_s_per_m / 100.0 - 1.0).abs() < 0.01, "{poor:?} {good:?}");
        let [a, b] = [&poor, &good].map(|at_half| at_half.imaging.position_accuracy.unwrap());
        assert!((a - b).abs() < 2e-3, "{a} {b}");
    }
}
