//! What an analogue-to-digital converter makes of voltages.

use super::Noise;
use crate::detector::Adc;
use crate::readings::Readings;

/// The code that a converter gives for a voltage (V): with its noise, rounded, held within its range.
pub fn code(volts: f64, adc: &Adc, noise: &mut Noise) -> u32 {
    let codes = 2f64.powi(i32::from(adc.bits));
    (volts / adc.full_scale_v * codes + adc.noise_lsb * noise.normal()).round().clamp(0.0, codes - 1.0) as u32
}

/// Readings (V) as a converter gives them: each the voltage of its code.
pub fn measured(readings: &Readings, adc: &Adc, noise: &mut Noise) -> Readings {
    let lsb_v = adc.lsb_v();
    let measure = |volts: f64| f64::from(code(volts, adc, noise)) * lsb_v;
    let electrodes = readings.electrodes();
    let mut volts = readings.volts().iter().copied().map(measure);
    Readings::from_fn(electrodes, |_, _| volts.next().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_whole_and_within_range() {
        let adc = Adc { bits: 10, full_scale_v: 1.024, noise_lsb: 0.0 };
        let readings = Readings::from_fn(2, |g, e| [-0.1, 0.0104, 0.5996, 3.0][2 * g + e]);
        let volts = measured(&readings, &adc, &mut Noise::new(1)).volts().to_vec();
        for (volts, code) in volts.iter().zip([0.0, 10.0, 600.0, 1023.0]) {
            assert!((volts - code * 1e-3).abs() < 1e-12, "{volts}");
        }
    }

    #[test]
    fn noise_has_the_deviation_asked_for() {
        let adc = Adc { bits: 12, full_scale_v: 4.096, noise_lsb: 2.0 };
        let readings = Readings::from_fn(32, |_, _| 2.0);
        let volts = measured(&readings, &adc, &mut Noise::new(5)).volts().to_vec();
        let variance = volts.iter().map(|volts| (volts - 2.0).powi(2)).sum::<f64>() / volts.len() as f64;
        // Rounding adds a twelfth of a code's square; 10 % is about 4.5 standard errors of 1024 numbers.
        let expected = (4.0 + 1.0 / 12.0) * 1e-6;
        assert!((variance / expected - 1.0).abs() < 0.2, "{variance}");
    }
}
