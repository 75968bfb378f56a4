//! Codes to volts, as the host makes them (`host/board/src/measured.rs`), in `f32`.

use tactomo_protocol::{Hello, MAX_ELECTRODES};
use tactomo_touch_core::Says;

/// Readings this near to an end of a converter's range count as at it, in standard deviations of its noise: a voltage a little below a floor reads as much
/// above it as noise is. Of a converter whose noise is not known, in codes.
const MARGIN: f32 = 2.0;
const MARGIN_CODES: f32 = 3.0;

/// What the board's codes mean.
#[derive(Debug)]
pub(super) struct Input {
    pub electrodes: u8,
    /// Volts of one code.
    per_code_v: f32,
    /// Voltage of the driving layer (V).
    pub drive_v: f32,
    /// Lowest and highest voltage that each electrode's converter tells (V).
    ranges_v: [[f32; 2]; MAX_ELECTRODES],
}

impl Input {
    pub const NONE: Self = Self {
        electrodes: 0,
        per_code_v: 0.0,
        drive_v: 0.0,
        ranges_v: [[f32::NEG_INFINITY, f32::INFINITY]; MAX_ELECTRODES],
    };

    /// Of a board.
    pub fn of(hello: &Hello) -> Self {
        let codes = (1u32 << hello.adc_bits.min(16)) as f32;
        let per_code_v = f32::from(hello.adc_full_scale_mv) / 1000.0 / codes;
        let mut input = Self {
            electrodes: hello.electrodes,
            per_code_v,
            drive_v: f32::from(hello.drive_mv) / 1000.0,
            ..Self::NONE
        };
        for (electrode, range_v) in input.ranges_v.iter_mut().enumerate() {
            let Some(range) = hello.range_of(electrode as u8) else { break };
            let margin_v = match range.errors.noise_uv {
                0 => MARGIN_CODES * per_code_v,
                noise_uv => MARGIN * 1e-6 * f32::from(noise_uv),
            };
            if range.floor > 0 {
                range_v[0] = f32::from(range.floor) * per_code_v + margin_v;
            }
            if f32::from(range.ceiling) < codes - 1.0 {
                range_v[1] = f32::from(range.ceiling) * per_code_v - margin_v;
            }
        }
        input
    }

    /// The voltage of a reading above a ground that is lifted by `ground_v` (V), and what it says of the electrode's own.
    pub fn used_v(&self, electrode: u8, reading: u16, fraction_bits: u8, ground_v: f32) -> (f32, Says) {
        let volts = f32::from(reading) * self.per_code_v / (1u32 << fraction_bits.min(16)) as f32;
        let [floor_v, ceiling_v] = self.ranges_v.get(usize::from(electrode)).copied().unwrap_or(Self::NONE.ranges_v[0]);
        let says = match volts {
            volts if volts <= floor_v => Says::AtMost,
            volts if volts >= ceiling_v => Says::AtLeast,
            _ => Says::Voltage,
        };
        (volts.clamp(floor_v, ceiling_v) - ground_v, says)
    }
}

#[cfg(test)]
mod tests {
    use tactomo_protocol::{ConverterErrors, Range};

    use super::*;

    /// Two converters: one that sees all its codes but the ends, and one that sees down to zero and up to its last code, whose noise is not known.
    fn hello(first: u8) -> Hello {
        let errors = ConverterErrors { noise_uv: 5000, gain_ppm: 0, bow_uv: 0 };
        let ranges = [Range { electrodes: first, floor: 142, ceiling: 3100, errors }, Range::of_codes(16 - first, 12)];
        Hello { adc_full_scale_mv: 4096, ranges: ranges.into_iter().collect(), ..Hello::example(16) }
    }

    /// Every code of every electrode, at any averaging, over any ground: one code is a millivolt.
    #[test]
    fn codes_are_volts_above_the_ground_and_ends_are_bounds() {
        for first in [1, 6, 15] {
            let input = Input::of(&hello(first));
            assert_eq!((input.electrodes, input.drive_v), (16, 2.0));
            for electrode in 0..16 {
                for fraction_bits in [0, 1, 4] {
                    for code in (0..4096u32).chain([200, 3000]) {
                        let reading = code << fraction_bits;
                        let Ok(reading) = u16::try_from(reading) else { continue };
                        let (volts, says) = input.used_v(electrode, reading, fraction_bits, 0.25);
                        // Ten millivolts of margin, two deviations of noise.
                        let (expected_v, expected) = match code as f32 / 1000.0 {
                            v if electrode < first && v <= 0.152 => (0.152, Says::AtMost),
                            v if electrode < first && v >= 3.09 => (3.09, Says::AtLeast),
                            v => (v, Says::Voltage),
                        };
                        // At the very ends rounding decides.
                        if electrode >= first || ![152, 3090].contains(&code) {
                            assert_eq!(says, expected, "electrode {electrode}, code {code}");
                        }
                        assert!(
                            (volts - (expected_v - 0.25)).abs() < 1e-5,
                            "electrode {electrode}, code {code}: {volts}"
                        );
                    }
                }
            }
            assert_eq!(input.used_v(40, 5, 0, 0.0).1, Says::Voltage);
        }
    }

    /// A converter whose noise is not known has three codes of margin at an end that is none of its scale.
    #[test]
    fn ends_within_the_scale_have_a_margin_and_those_of_the_scale_have_none() {
        let says = |floor, ceiling, code| {
            let ranges = [Range { floor, ceiling, ..Range::of_codes(16, 12) }];
            let hello = Hello { adc_full_scale_mv: 4096, ranges: ranges.into_iter().collect(), ..Hello::example(16) };
            Input::of(&hello).used_v(3, code, 0, 0.0).1
        };
        assert_eq!([0, 1, 4095].map(|code| says(0, 4095, code)), [Says::Voltage; 3]);
        assert_eq!([3, 5].map(|code| says(1, 4095, code)), [Says::AtMost, Says::Voltage]);
        assert_eq!([4090, 4092].map(|code| says(0, 4094, code)), [Says::Voltage, Says::AtLeast]);
    }
}
