//! The ADC of a real board: what calibration leaves of its errors, its noise, its floor and its ceiling.

use tactomo_physics::simulate::Noise;

use super::model::ConverterFigures;

/// An ADC with the errors of one chip.
#[derive(Debug)]
pub(super) struct Converter {
    figures: &'static ConverterFigures,
    /// By how much it reads too high, as a share.
    gain: f64,
    /// Height of its bow (mV).
    bow_mv: f64,
    /// What its sampling capacitor has from the last conversion (V).
    pub(super) held_v: f64,
}

impl Converter {
    /// One chip's, as `chip` draws it.
    pub(super) fn drawn(figures: &'static ConverterFigures, chip: &mut Noise) -> Self {
        let [gain, bow_mv] = [figures.gain_deviation, figures.bow_mv].map(|deviation| deviation * chip.normal());
        Self { figures, gain, bow_mv, held_v: 0.0 }
    }

    /// The calibrated reading (mV) of what was sampled (V).
    pub(super) fn millivolts(&self, volts: f64, noise: &mut Noise) -> u16 {
        let ConverterFigures { floor_mv, ceiling_mv, noise_mv, .. } = *self.figures;
        let (low, high) = (floor_mv, ceiling_mv);
        let true_mv = 1e3 * volts;
        // Calibration is right at two points; between them lies a parabola.
        let share = ((true_mv - low) / (high - low)).clamp(0.0, 1.0);
        let read_mv = true_mv * (1.0 + self.gain) + self.bow_mv * 4.0 * share * (1.0 - share);
        (read_mv + noise_mv * noise.normal()).clamp(low, high).round() as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static QUIET: ConverterFigures = ConverterFigures {
        electrodes: 6,
        floor_mv: 142.0,
        ceiling_mv: 3100.0,
        noise_mv: 0.0,
        gain_deviation: 0.01,
        bow_mv: 12.0,
    };

    #[test]
    fn what_is_outside_its_range_reads_as_its_ends() {
        let converter = Converter { figures: &QUIET, gain: 0.0, bow_mv: 0.0, held_v: 0.0 };
        let read = |volts| converter.millivolts(volts, &mut Noise::new(1));
        assert_eq!([-0.2, 0.0, 0.1, 0.142, 0.5, 3.2].map(read), [142, 142, 142, 142, 500, 3100]);
    }

    #[test]
    fn errors_of_a_chip_are_smooth_and_within_the_data_sheet() {
        let mut chips = Noise::new(3);
        let mut outside = 0;
        for _ in 0..500 {
            let converter = Converter::drawn(&QUIET, &mut chips);
            let error_mv = |mv: i32| {
                let read_mv = converter.millivolts(f64::from(mv) * 1e-3, &mut Noise::new(1));
                f64::from(read_mv) - f64::from(mv)
            };
            let errors: Vec<f64> = (15..=245).map(|step| error_mv(10 * step)).collect();
            assert!(errors.windows(2).all(|pair| (pair[1] - pair[0]).abs() <= 2.0));
            outside += i32::from(errors.iter().any(|error| error.abs() > 60.0));
        }
        // 60 mV is what the data sheet says; 5 % beyond it are two standard deviations.
        assert!(outside < 25, "{outside} of 500");
        assert!(outside > 0, "the figures are smaller than the data sheet's");
    }
}
