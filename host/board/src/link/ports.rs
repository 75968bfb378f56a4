//! Which serial ports there are.

use serialport::SerialPortType;
use tactomo_physics::causes::with_causes;

/// A serial port of this machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Port {
    /// Such as `/dev/ttyUSB0`.
    pub name: String,
    /// Whether it is at the end of a USB cable.
    pub usb: bool,
    /// What the USB device calls itself, if it does.
    pub product: Option<String>,
    /// The USB device's serial number, if it has one: it stays whichever socket the cable is in.
    pub serial: Option<String>,
}

/// The serial ports of this machine, by name.
pub fn ports() -> Vec<Port> {
    // The library panics where the system has no such folder, as in some containers.
    if cfg!(target_os = "linux") && !std::path::Path::new("/sys/class/tty").is_dir() {
        return Vec::new();
    }
    let found = serialport::available_ports().unwrap_or_else(|error| {
        tracing::warn!("cannot list the serial ports: {}", with_causes(&error));
        Vec::new()
    });
    let mut ports: Vec<Port> = found.into_iter().map(|info| port(info.port_name, info.port_type)).collect();
    ports.sort_by(|a, b| a.name.cmp(&b.name));
    ports
}

/// Name of the port whose USB device has this serial number; else of the port itself.
pub fn named(port: &str) -> String {
    of_serial(port, ports())
}

/// The serial number of the USB device on a port, if no other port's device has the same: some makers give all of theirs one.
pub fn serial_number(port: &str) -> Option<String> {
    // udev names ports by links.
    let port = std::fs::canonicalize(port).map_or_else(|_| port.to_owned(), |path| path.display().to_string());
    serial_of(&port, &ports())
}

fn serial_of(port: &str, ports: &[Port]) -> Option<String> {
    let serial = ports.iter().find(|known| known.name == port)?.serial.clone().filter(|serial| !serial.is_empty())?;
    let is_alone = ports.iter().filter(|other| other.serial.as_ref() == Some(&serial)).count() == 1;
    is_alone.then_some(serial)
}

fn of_serial(wanted: &str, ports: Vec<Port>) -> String {
    let is_name = ports.iter().any(|port| port.name == wanted);
    let found = ports.into_iter().find(|port| !is_name && port.serial.as_deref() == Some(wanted));
    found.map_or_else(|| wanted.to_owned(), |port| port.name)
}

fn port(name: String, kind: SerialPortType) -> Port {
    match kind {
        SerialPortType::UsbPort(usb) => Port { name, usb: true, product: usb.product, serial: usb.serial_number },
        _ => Port { name, usb: false, product: None, serial: None },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_is_found_by_its_name_or_by_the_serial_number_of_its_device() {
        let port = |name: &str, serial: Option<&str>| Port {
            name: name.to_owned(),
            usb: true,
            product: None,
            serial: serial.map(str::to_owned),
        };
        let ports = || vec![port("/dev/ttyUSB0", None), port("/dev/ttyUSB1", Some("0001")), port("COM3", Some("A7"))];
        let found = ["0001", "A7", "/dev/ttyUSB0", "COM9"].map(|wanted| of_serial(wanted, ports()));
        assert_eq!(found, ["/dev/ttyUSB1", "COM3", "/dev/ttyUSB0", "COM9"]);
        let serials = |ports: &[Port]| ["/dev/ttyUSB0", "/dev/ttyUSB1", "COM3"].map(|name| serial_of(name, ports));
        assert_eq!(serials(&ports()), [None, Some("0001".to_owned()), Some("A7".to_owned())]);
        let twice = [ports(), vec![port("/dev/ttyUSB2", Some("0001")), port("COM3", Some(""))]].concat();
        assert_eq!(
            serials(&twice),
            [None, None, Some("A7".to_owned())],
            "two boards that say the same are not told apart"
        );
    }
}
