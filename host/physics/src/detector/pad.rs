//! What a pad puts between the foam and a wire.

use std::f64::consts::PI;

use super::{Detector, Electrode};

/// Contact impedance where none is given (ohm m2).
pub(super) const CONTACT_IMPEDANCE_OHM_M2: f64 = 1e-5;

impl Detector {
    /// Resistance of an electrode's pad (ohm): that of the current which spreads from it into the layer, `1 / (4 a sigma)` with its radius `a` and the
    /// conductivity at the electrode side (Holm, "Electric Contacts": a round contact on a half-space), and that of the contact itself.
    ///
    /// The layer counts as thick against the pad, and the way from there to ground is left out: under a light contact the pad that is grounded adds
    /// as much again.
    pub fn pad_ohm(&self, electrode: &Electrode) -> f64 {
        let sigma_s_per_m = self.layers.first().map_or(f64::NAN, |layer| layer.bottom_s_per_m);
        let contact_ohm_m2 = electrode.contact_impedance_ohm_m2.unwrap_or(self.contact_impedance_ohm_m2);
        let radius_m = electrode.radius_m;
        1.0 / (4.0 * radius_m * sigma_s_per_m) + contact_ohm_m2 / (PI * radius_m.powi(2))
    }

    /// The largest of its [pads' resistances](Self::pad_ohm) (ohm).
    pub fn largest_pad_ohm(&self) -> f64 {
        self.electrodes.iter().map(|electrode| self.pad_ohm(electrode)).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pads_have_the_resistance_of_their_foam() {
        let of = |foam: &str| {
            let detector = Detector::default().in_material(&foam.parse().unwrap()).unwrap();
            detector.largest_pad_ohm()
        };
        let found = ["A", "B", "C", "D"].map(|foam| (of(foam) / 10.0).round() * 10.0);
        assert_eq!(found, [550.0, 240.0, 74_990.0, 15_630.0]);
        let small = Detector::preset("fingertip-10").unwrap();
        // 1 / (4 x 0.5 mm x 0.2273 S/m), and 1e-5 ohm m2 over the area.
        assert!((small.largest_pad_ohm() - (2199.7 + 12.7)).abs() < 0.1, "{}", small.largest_pad_ohm());
    }

    #[test]
    fn the_layer_at_the_electrodes_counts() {
        let mut detector = Detector::default();
        detector.layers[0].top_s_per_m = 100.0;
        assert_eq!(detector.largest_pad_ohm(), Detector::default().largest_pad_ohm());
        detector.layers[0].bottom_s_per_m *= 2.0;
        assert!(detector.largest_pad_ohm() < 0.51 * Detector::default().largest_pad_ohm());
    }
}
