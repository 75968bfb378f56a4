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
