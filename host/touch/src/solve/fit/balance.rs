//! Readings as if a firm contact were a light one.

/// Smallest `1 - V / Vcc` that a ratio or a logarithm is taken of: below, a reading is at the drive voltage to its noise.
pub(crate) const LEAST_GAP: f64 = 1e-3;

/// Takes the force out of the readings of a contact, in place (V, row by row, `volts[g * electrodes + e]`).
///
/// A firm contact loads each grounded electrode differently, `V[g][e] = Vcc (Z[g][g] + R - Z[e][g]) / D[g]` with
/// `D[g] = Z[g][g] + R`, where the linear theory has one `D` for all. `Z` is symmetric, so `r = 1 - V / Vcc` gives
/// `r[g][e] D[g] = r[e][g] D[e]`, and hence all `D` but for a common factor: their logarithms are means over electrodes of
/// those of `r[e][g] / r[g][e]` (least squares). Rows times `D[g]`, scaled to a geometric mean of 1, are what the linear
/// theory says exactly for one contact, however firm, of conductance `1 / mean D`; for several it is nearer than before.
/// In the limit of light contacts nothing changes. Returns the rows' scales.
pub fn balance(volts: &mut [f64], electrodes: usize, drive_v: f64) -> Vec<f64> {
    let ratio = |volts: &[f64], g: usize, e: usize| (1.0 - volts[g * electrodes + e] / drive_v).max(LEAST_GAP);
    let mut scales = vec![1.0; electrodes];
    for (g, scale) in scales.iter_mut().enumerate() {
        let product: f64 = (0..electrodes).map(|e| ratio(volts, e, g) / ratio(volts, g, e)).product();
        *scale = product.powf(1.0 / electrodes as f64);
    }
    for (row, scale) in volts.chunks_exact_mut(electrodes).zip(&scales) {
        row.iter_mut().for_each(|volts| *volts *= scale);
    }
    scales
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::jacobian::Jacobian;
    use tactomo_physics::forward::shell::Shell;
    use tactomo_physics::forward::{ForwardError, ForwardModel, readings_v};

    #[test]
    fn one_firm_contact_is_made_exactly_linear() -> Result<(), ForwardError> {
        let Some(detector) = Detector::preset("square-60") else { panic!("no preset") };
        let shell = Shell::with_nodes(&detector, 800)?;
        let jacobian = Jacobian::of(&shell);
        for conductance_s in [1e-6, 1e-3, 1.0] {
            let node = 600;
            let image_s = shell.image_mesh().image_with([(node, conductance_s)]);
            let impedance_ohm = shell.image_fields(&image_s)?.impedance_ohm;
            let mut volts = readings_v(&impedance_ohm, &detector).volts().to_vec();
            balance(&mut volts, 16, detector.drive_v);
            let loads = (0..16).map(|g| (impedance_ohm[(g, g)] + detector.on_resistance_ohm).ln());
            let effective_s = (-loads.sum::<f64>() / 16.0).exp();
            for (i, volts) in volts.iter().enumerate() {
                let linear_v = effective_s * jacobian.volts_per_s(i / 16, i % 16, node);
                assert!((volts - linear_v).abs() < 1e-6 * detector.drive_v, "{conductance_s} S: {volts} {linear_v}");
            }
        }
        Ok(())
    }
}
