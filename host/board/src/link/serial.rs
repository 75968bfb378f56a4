//! A board on a serial port.

use std::io::{self, Read, Write};
use std::path::Path;
use std::time::Duration;

use serialport::{ErrorKind, SerialPort};
use tactomo_physics::causes::with_causes;

use super::{Link, ports};

/// What the boards send at, and what common USB bridges keep up with (bits a second).
pub const DEFAULT_BAUD: u32 = 921_600;

/// How long a read waits for bytes, and a write for room.
const TIMEOUT: Duration = Duration::from_millis(50);

/// How the system says that a device is no terminal (`ENOTTY`).
const NOT_A_TTY: &str = "Not a typewriter";

/// A serial port that is open.
pub struct SerialLink {
    name: String,
    port: Box<dyn SerialPort>,
}

/// Why a serial port does not open.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PortError {
    /// No such device.
    #[error("there is no serial port {port}: {there}")]
    Missing {
        /// The port asked for.
        port: String,
        /// Which there are.
        there: String,
    },
    /// The device is there, and this user may not open it.
    #[error("no permission to open {port}: {advice}")]
    Permission {
        /// The port asked for.
        port: String,
        /// How to get permission.
        advice: String,
    },
    /// Another program has it open.
    #[error(
        "{port} is busy: another program has it open, such as a serial monitor or another `tactomo live`; close it"
    )]
    Busy {
        /// The port asked for.
        port: String,
    },
    /// Something else than a serial port.
    #[error("{port} is not a serial port; `tactomo ports` lists those that are")]
    NotSerial {
        /// The port asked for.
        port: String,
    },
    /// The system refuses for another reason.
    #[error("cannot open {port} at {baud} baud")]
    System {
        /// The port asked for.
        port: String,
        /// Bits a second asked for.
        baud: u32,
        /// What the system says.
        source: serialport::Error,
    },
}

impl SerialLink {
    /// Opens `port` at `baud` bits a second, for this program alone.
    ///
    /// # Errors
    /// [`PortError`] if it is not there, not allowed, busy, or no serial port.
    pub fn open(port: &str, baud: u32) -> Result<Self, PortError> {
        let opened = serialport::new(port, baud).timeout(TIMEOUT).open();
        let mut link = Self { name: port.to_owned(), port: opened.map_err(|error| explain(port, baud, error))? };
        link.release_reset();
        Ok(link)
    }

    /// Lowers both control lines, which opening has raised: on most boards they hold the chip in reset or choose its boot mode.
    ///
    /// RTS goes first: DTR alone low would pull reset on the usual two-transistor circuit. Ports without such lines (a
    /// pseudo-terminal) refuse, which does no harm.
    fn release_reset(&mut self) {
        let lowered = self.port.write_request_to_send(false).and_then(|()| self.port.write_data_terminal_ready(false));
        if let Err(error) = lowered {
            tracing::debug!("{}: no control lines ({})", self.name, with_causes(&error));
        }
    }
}

impl Link for SerialLink {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn serial_number(&self) -> Option<String> {
        ports::serial_number(&self.name)
    }

    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.port.read(buffer) {
            Ok(0) => Err(io::Error::new(io::ErrorKind::BrokenPipe, "the port hung up")),
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::Interrupted) => Ok(0),
            read => read,
        }
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.write_all(bytes)
    }

    fn baud(&self) -> Option<u32> {
        self.port.baud_rate().ok()
    }

    fn set_baud(&mut self, baud: u32) -> io::Result<()> {
        self.port.set_baud_rate(baud).map_err(io::Error::from)
    }
}

/// What a refusal means and what to do about it.
fn explain(port: &str, baud: u32, error: serialport::Error) -> PortError {
    let port = port.to_owned();
    match error.kind() {
        ErrorKind::Io(io::ErrorKind::NotFound) => PortError::Missing { there: there(), port },
        ErrorKind::Io(io::ErrorKind::PermissionDenied) => PortError::Permission { advice: advice(&port), port },
        ErrorKind::NoDevice if Path::new(&port).exists() => PortError::Busy { port },
        ErrorKind::NoDevice => PortError::Missing { there: there(), port },
        ErrorKind::Unknown if error.description == NOT_A_TTY => PortError::NotSerial { port },
        _ => PortError::System { port, baud, source: error },
    }
}

/// Which serial ports there are, as a sentence.
fn there() -> String {
    let names: Vec<String> = super::ports::ports().into_iter().map(|port| port.name).collect();
    match names.as_slice() {
        [] => "this machine has none; is the board plugged in, and is its cable one for data?".to_owned(),
        names => format!("there is {}", names.join(", ")),
    }
}

/// How this user gets permission for `port`.
#[cfg(unix)]
fn advice(port: &str) -> String {
    use std::os::unix::fs::MetadataExt;

    let groups = std::fs::read_to_string("/etc/group").unwrap_or_default();
    let group = std::fs::metadata(port).ok().and_then(|device| group_name(&groups, device.gid()));
    match group.as_deref() {
        Some(group) if group != "root" => {
            format!("it belongs to the group {group}; run `sudo usermod -aG {group} $USER`, then log out and in again")
        }
        _ => "it belongs to root alone; give its device a group with a udev rule, and join that group".to_owned(),
    }
}

#[cfg(not(unix))]
fn advice(_port: &str) -> String {
    "ask the administrator of this machine for access to serial ports".to_owned()
}

/// Name of group `gid` in the text of `/etc/group`.
#[cfg(unix)]
fn group_name(groups: &str, gid: u32) -> Option<String> {
    groups.lines().find_map(|line| {
        let mut fields = line.split(':');
        let name = fields.next()?;
        (fields.nth(1)?.parse() == Ok(gid)).then(|| name.to_owned())
    })
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use serialport::TTYPort;

    fn refusal(port: &str) -> PortError {
        SerialLink::open(port, DEFAULT_BAUD).err().expect("the port must not open")
    }

    #[test]
    fn a_port_that_is_not_there_is_named() {
        let error = refusal("/dev/ttyNOT0");
        assert!(matches!(error, PortError::Missing { .. }), "{error:?}");
        assert!(error.to_string().starts_with("there is no serial port /dev/ttyNOT0: "), "{error}");
    }

    #[test]
    fn devices_and_files_that_are_not_serial_ports_are_reported() {
        assert!(matches!(refusal("/dev/null"), PortError::NotSerial { .. }));
        assert!(matches!(refusal(file!()), PortError::NotSerial { .. } | PortError::Missing { .. }));
    }

    #[test]
    fn a_port_that_is_open_elsewhere_is_busy() {
        let (_master, mut slave) = TTYPort::pair().unwrap();
        slave.set_exclusive(true).unwrap();
        assert!(matches!(refusal(&slave.name().unwrap()), PortError::Busy { .. }));
    }

    #[test]
    fn without_permission_the_group_and_the_command_are_named() {
        let permission = serialport::Error::new(ErrorKind::Io(io::ErrorKind::PermissionDenied), "Permission denied");
        assert!(matches!(explain("/dev/null", DEFAULT_BAUD, permission), PortError::Permission { .. }));
        assert_eq!(group_name("root:x:0:\ndialout:x:20:someone\nbroken\n", 20).as_deref(), Some("dialout"));
        assert_eq!(group_name("root:x:0:\n", 20), None);
    }

    #[test]
    fn bytes_pass_both_ways_and_a_closed_peer_is_an_error() {
        let (mut master, slave) = TTYPort::pair().unwrap();
        let name = slave.name().unwrap();
        drop(slave);
        let mut link = SerialLink::open(&name, DEFAULT_BAUD).unwrap();
        let mut buffer = [0; 16];
        assert_eq!(link.read(&mut buffer).unwrap(), 0, "nothing has come");
        master.write_all(b"up").unwrap();
        assert_eq!(link.read(&mut buffer).unwrap(), 2);
        assert_eq!(&buffer[..2], b"up");
        link.write_all(b"down").unwrap();
        master.read_exact(&mut buffer[..4]).unwrap();
        assert_eq!(&buffer[..4], b"down");
        drop(master);
        assert!(link.read(&mut buffer).is_err());
    }
}
