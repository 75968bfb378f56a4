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

fn port(name: String, kind: SerialPortType) -> Port {
    match kind {
        SerialPortType::UsbPort(usb) => Port { name, usb: true, product: usb.product },
        _ => Port { name, usb: false, product: None },
    }
}
