//! Which board it is, as far as it tells.

use tactomo_physics::detector::Detector;
use tactomo_protocol::Hello;

/// What tells a board from others: its name, its converter and its drive, as it says Hello with. The protocol has no serial number, so two
/// boards of one build are one; the firmware's version and the settings, which change on one board, are no part of it.
pub fn identity(board: &Hello) -> String {
    let Hello { board, electrodes, adc_bits, adc_full_scale_mv, drive_mv, .. } = board;
    format!("{board}, {electrodes} electrodes, {adc_bits} bits of {adc_full_scale_mv} mV, drive of {drive_mv} mV")
}

/// What a person should know of a detector that was calibrated on another board than this one, in a sentence; `None` if it was calibrated on
/// this one, on none that is known, or not at all.
pub fn other_board(detector: &Detector, board: &Hello) -> Option<String> {
    let calibrated = detector.calibration.as_ref()?.board.as_deref()?;
    let here = identity(board);
    (calibrated != here).then(|| {
        format!(
            "{} was calibrated on another board ({calibrated}) than this one ({here}): gains and on-resistance are that board's. \
             Calibrate it with this one, or choose the file that was made with it.",
            detector.name
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Calibration;
    use tactomo_protocol::Settings;

    fn calibrated(board: Option<String>) -> Detector {
        Detector { calibration: Some(Calibration { board, ..Calibration::default() }), ..Detector::default() }
    }

    #[test]
    fn a_board_is_the_same_with_other_settings_and_firmware() {
        let board = Hello::example(16);
        assert_eq!(identity(&board), "test, 16 electrodes, 12 bits of 3300 mV, drive of 2000 mV");
        let settings = Settings { settle_us: 99, ..Settings::default() };
        let later = Hello { firmware_version: "9.9.9".try_into().unwrap(), settings, ..board.clone() };
        assert_eq!(other_board(&calibrated(Some(identity(&board))), &later), None);
    }

    #[test]
    fn another_board_is_named_with_the_one_that_was_calibrated() {
        let board = Hello::example(16);
        let another = Hello { adc_bits: 10, ..board.clone() };
        let notice = other_board(&calibrated(Some(identity(&another))), &board).unwrap();
        assert!(notice.contains("(test, 16 electrodes, 10 bits") && notice.contains("(test, 16 electrodes, 12 bits"));
        assert_eq!(other_board(&calibrated(None), &board), None, "a table tells no board");
        assert_eq!(other_board(&Detector::default(), &board), None);
    }
}
