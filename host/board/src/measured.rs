//! A detector as a board measures it, and the volts of the board's codes.

use tactomo_physics::detector::Detector;
use tactomo_protocol::{Frame, Hello};

/// A board that does not fit the detector.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the board scans {board} electrodes, but the detector {detector} has {expected}: choose the detector that is connected \
     with `--detector`"
)]
pub struct Mismatch {
    /// Electrodes that the board scans.
    board: usize,
    /// Name of the detector.
    detector: String,
    /// Its electrodes.
    expected: usize,
}

/// `detector` as `board` measures it: drive voltage and ADC are the board's, who knows them.
///
/// # Errors
/// [`Mismatch`] if the board scans another number of electrodes.
pub fn as_measured(detector: &Detector, board: &Hello) -> Result<Detector, Mismatch> {
    let (found, expected) = (usize::from(board.electrodes), detector.electrodes.len());
    if found != expected {
        return Err(Mismatch { board: found, detector: detector.name.clone(), expected });
    }
    let mut measured = detector.clone();
    measured.drive_v = volts(board.drive_mv);
    measured.adc.bits = board.adc_bits;
    measured.adc.full_scale_v = volts(board.adc_full_scale_mv);
    Ok(measured)
}

/// Volts of whole millivolts: as near as a number gets, so that a board which measures as the description says has its very voltages.
fn volts(millivolts: u16) -> f64 {
    f64::from(millivolts) / 1000.0
}

/// Makes volts of a board's codes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volts {
    /// Volts of one code.
    per_code: f64,
    /// Readings in a frame.
    readings: usize,
}

impl Volts {
    /// For frames of a board.
    pub fn of(board: &Hello) -> Self {
        let codes = f64::from(1u32 << board.adc_bits.min(31));
        let electrodes = usize::from(board.electrodes);
        Self { per_code: volts(board.adc_full_scale_mv) / codes, readings: electrodes * electrodes }
    }

    /// Readings of a whole frame (V), row by row; `None` if it is a frame of another board, or not whole.
    pub fn of_frame<'a>(&self, frame: &'a Frame) -> Option<impl Iterator<Item = f64> + use<'a>> {
        let per_unit = self.per_code / f64::from(1u32 << frame.head.fraction_bits.min(31));
        (frame.scope.is_whole() && frame.readings.len() == self.readings)
            .then(|| frame.readings.iter().map(move |units| f64::from(*units) * per_unit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_protocol::{FrameHead, Scope};

    fn hello(electrodes: u8) -> Hello {
        Hello { adc_bits: 10, adc_full_scale_mv: 1024, drive_mv: 1500, ..Hello::example(electrodes) }
    }

    #[test]
    fn the_board_knows_its_drive_and_its_converter() {
        let preset = Detector::preset(Detector::DEFAULT).unwrap();
        let measured = as_measured(&preset, &hello(16)).unwrap();
        assert_eq!((measured.drive_v, measured.adc.bits, measured.adc.full_scale_v), (1.5, 10, 1.024));
        let mismatch = as_measured(&preset, &hello(32)).unwrap_err().to_string();
        assert!(mismatch.contains("32") && mismatch.contains("square-60 has 16"), "{mismatch}");
    }

    #[test]
    fn a_board_as_described_changes_nothing() {
        let preset = Detector::preset(Detector::DEFAULT).unwrap();
        let board = Hello { adc_bits: 12, adc_full_scale_mv: 3300, drive_mv: 2000, ..hello(16) };
        assert_eq!(as_measured(&preset, &board), Ok(preset));
    }

    #[test]
    fn codes_become_volts_and_frames_of_other_boards_nothing() {
        let head = FrameHead { fraction_bits: 2, ..FrameHead::default() };
        let scope = Scope::whole(16).unwrap();
        let frame = Frame { head, scope, readings: std::iter::repeat_n(0x110, 256).collect() };
        let volts: Vec<_> = Volts::of(&hello(16)).of_frame(&frame).unwrap().collect();
        assert!(volts.len() == 256 && (volts[0] - 0.068).abs() < 1e-12, "272 quarters of a millivolt");
        assert!(Volts::of(&hello(32)).of_frame(&frame).is_none());
        let reversed: Vec<u8> = (0..16).rev().collect();
        let rows = Frame { scope: Scope::of_rows(16, &reversed, 0xFFFF).unwrap(), ..frame };
        assert!(
            Volts::of(&hello(16)).of_frame(&rows).is_none(),
            "as many readings, but not in the order of a whole frame"
        );
    }
}
