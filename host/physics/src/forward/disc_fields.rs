//! Fields of an even current over a disc: what a table of a detector is made of.

use super::{ForwardError, ForwardModel};
use crate::geometry::Point;
use crate::scene::Contact;

/// Conductances of the light discs that fields are had from (sheet conductances): their current is even.
const LIGHT_SHEETS: [f64; 2] = [1e-4, 1e-3];

/// Fields of an even current over the part of a disc that is on the detector, in the gauge in which the electrodes' fields have no mean there.
#[derive(Clone, Debug, PartialEq)]
pub struct DiscFields {
    /// Field of each electrode, mean over the disc (ohm).
    pub electrodes_ohm: Vec<f64>,
    /// Field of its own current, mean over it (ohm).
    pub own_ohm: f64,
    /// Part of it that is on the detector.
    pub share: f64,
}

impl DiscFields {
    /// From fields in any gauge.
    pub(super) fn centred(mut electrodes_ohm: Vec<f64>, own_ohm: f64, share: f64) -> Self {
        let mean = electrodes_ohm.iter().sum::<f64>() / electrodes_ohm.len() as f64;
        electrodes_ohm.iter_mut().for_each(|ohm| *ohm -= mean);
        Self { electrodes_ohm, own_ohm: own_ohm - 2.0 * mean, share }
    }

    /// From the impedances that a light disc gives, on any model. With one contact, `Z[e][g] = E[e][g] + A - u_e - u_g` (fields `E` between the electrodes, `u`
    /// at the contact, `A` its resistance with its own field), so that `u` and `A` follow from `Z` in the gauge in which `u` has no mean.
    pub(super) fn of_light(
        model: &(impl ForwardModel + ?Sized),
        [x_m, y_m]: Point,
        radius_m: f64,
    ) -> Result<Self, ForwardError> {
        let pads_ohm = model.electrode_fields_ohm();
        let conductances_s = LIGHT_SHEETS.map(|sheets| sheets * model.detector().sheet_conductance_s());
        let by_contact = |conductance_s: f64| {
            let contact = Contact::flat(x_m, y_m, radius_m, conductance_s);
            Ok(model.impedance_ohm(&[contact])? - pads_ohm)
        };
        let [lighter, firmer] = [by_contact(conductances_s[0])?, by_contact(conductances_s[1])?];
        let [lighter_ohm, firmer_ohm] = [lighter.mean(), firmer.mean()];
        // The resistance of the contact is that of its part on the detector.
        let whole_ohm = conductances_s[0].recip() - conductances_s[1].recip();
        let share = whole_ohm / (lighter_ohm - firmer_ohm);
        let own_ohm = firmer_ohm - 1.0 / (share * conductances_s[1]);
        let electrodes_ohm = (0..pads_ohm.nrows()).map(|e| firmer_ohm - firmer.row(e).mean()).collect();
        Ok(Self { electrodes_ohm, own_ohm, share: share.clamp(0.0, 1.0) })
    }
}
