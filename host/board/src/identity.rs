//! Which board it is, as far as it tells.

use tactomo_physics::detector::Detector;
use tactomo_protocol::Hello;

use crate::link::Link;

/// What tells a board from others: its name, its converter and its drive, as it says Hello with. The protocol has no serial number, so two
/// boards of one build are one; the firmware's version and the settings, which change on one board, are no part of it.
pub fn identity(board: &Hello) -> String {
    let Hello { board, electrodes, adc_bits, adc_full_scale_mv, drive_mv, .. } = board;
    format!("{board}, {electrodes} electrodes, {adc_bits} bits of {adc_full_scale_mv} mV, drive of {drive_mv} mV")
}

/// A sensor, as far as its board and the port tell it from others: a board is taken to stay on its sensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sensor {
    /// [`identity`] of the board.
    pub board: String,
    /// Serial number of its USB device, if no other has that.
    pub serial_number: Option<String>,
    /// Name of the port.
    pub port: String,
}

impl Sensor {
    /// The sensor whose board has said Hello on a link.
    pub fn on(link: &dyn Link, board: &Hello) -> Self {
        Self { board: identity(board), serial_number: link.serial_number(), port: link.name() }
    }

    /// What tells it from others: the serial number, or else the port, with the name that it has among several.
    pub fn name(&self, patch: &str) -> String {
        match &self.serial_number {
            Some(serial) => format!("serial number {serial}"),
            None if patch.is_empty() || patch == self.port_label() => self.port.clone(),
            None => format!("{patch} on {}", self.port),
        }
    }

    /// The same, shorter and of letters, digits, - and _ only, as a part of a file's name: others may have it too.
    pub fn label(&self, patch: &str) -> String {
        match &self.serial_number {
            Some(serial) => label(serial),
            None if patch.is_empty() || patch == self.port_label() => self.port_label(),
            None => format!("{patch}-{}", self.port_label()),
        }
    }

    fn port_label(&self) -> String {
        port_label(&self.port)
    }
}

/// The last part of a port's name, of letters, digits, - and _ only.
pub fn port_label(port: &str) -> String {
    label(port.rsplit(['/', '\\']).next().unwrap_or(port))
}

fn label(text: &str) -> String {
    text.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' }).collect()
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
    fn a_sensor_is_told_by_its_boards_serial_number_or_by_port_and_patch() {
        let sensor = |serial: Option<&str>, port: &str| Sensor {
            board: "test".to_owned(),
            serial_number: serial.map(str::to_owned),
            port: port.to_owned(),
        };
        let told = |sensor: Sensor, patch: &str| [sensor.name(patch), sensor.label(patch)];
        let usb = "/dev/ttyUSB0";
        assert_eq!(told(sensor(Some("A/7"), usb), "thumb"), ["serial number A/7", "A_7"]);
        assert_eq!(told(sensor(None, usb), ""), [usb, "ttyUSB0"]);
        assert_eq!(told(sensor(None, usb), "ttyUSB0"), [usb, "ttyUSB0"], "as several ports are called by themselves");
        assert_eq!(told(sensor(None, usb), "thumb"), ["thumb on /dev/ttyUSB0", "thumb-ttyUSB0"]);
        let labels = ["COM3", r"\\.\COM12", "/dev/serial/by-id/usb-1a86_USB_Serial-if00"].map(port_label);
        assert_eq!(labels, ["COM3", "COM12", "usb-1a86_USB_Serial-if00"]);
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
