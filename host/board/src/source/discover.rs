//! Which serial ports have a board.

use std::thread;
use std::time::{Duration, Instant};

use tactomo_physics::causes::with_causes;
use tactomo_protocol::Hello;

use crate::link::Link;
use crate::link::ports::{Port, ports};
use crate::link::serial::{PortError, SerialLink};
use crate::session::{self, GreetError};

/// How long a board has to say Hello: opening may have reset it, and then it boots first.
const PATIENCE: Duration = Duration::from_secs(3);

/// What a port answered when it was asked for Hello.
#[derive(Debug)]
pub struct Probe {
    /// The port.
    pub port: Port,
    /// The board's Hello, or why there is none.
    pub answer: Result<Hello, ProbeError>,
}

/// Why a port has no board to work with.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ProbeError {
    /// It does not open.
    #[error(transparent)]
    Port(#[from] PortError),
    /// It opens, and no board says Hello.
    #[error(transparent)]
    Greet(#[from] GreetError),
}

/// No USB serial port has a board.
#[derive(Debug, thiserror::Error)]
#[error(
    "no board found. {tried}\nIs the board plugged in with a data cable, flashed, and at this baud rate? Name its port with \
     `--port`, or run the simulated board with `--simulate`."
)]
pub struct NoBoard {
    /// What was tried, port by port.
    tried: String,
}

/// Asks all `ports` for Hello, at the same time; the answers come in their order.
pub fn probe(ports: Vec<Port>, baud: u32) -> Vec<Probe> {
    thread::scope(|scope| {
        let asked: Vec<_> = ports.iter().map(|port| scope.spawn(move || ask(&port.name, baud))).collect();
        let answers: Vec<_> = asked.into_iter().map(|answer| answer.join()).collect();
        let kept = ports.iter().zip(answers);
        kept.filter_map(|(port, answer)| Some(Probe { port: port.clone(), answer: answer.ok()? })).collect()
    })
}

/// Name of the first USB serial port with a board that says Hello.
///
/// # Errors
/// [`NoBoard`], with what each port answered.
pub fn find_board(baud: u32) -> Result<String, NoBoard> {
    let ports = ports().into_iter().filter(|port| port.usb).collect();
    choose(&probe(ports, baud))
}

fn ask(port: &str, baud: u32) -> Result<Hello, ProbeError> {
    let mut link: Box<dyn Link> = Box::new(SerialLink::open(port, baud)?);
    Ok(session::greet(link.as_mut(), Instant::now() + PATIENCE)?)
}

fn choose(probes: &[Probe]) -> Result<String, NoBoard> {
    if let Some(found) = probes.iter().find(|probe| probe.answer.is_ok()) {
        return Ok(found.port.name.clone());
    }
    let tried: Vec<String> = probes.iter().filter_map(refusal).collect();
    let tried = if tried.is_empty() { "There is no USB serial port.".to_owned() } else { tried.join("\n") };
    Err(NoBoard { tried })
}

fn refusal(probe: &Probe) -> Option<String> {
    let error = probe.answer.as_ref().err()?;
    Some(format!("{}: {}.", probe.port.name, with_causes(error)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::UnframedBytes;

    fn probe_of(name: &str, answer: Result<Hello, ProbeError>) -> Probe {
        Probe { port: Port { name: name.to_owned(), usb: true, product: None, serial: None }, answer }
    }

    #[test]
    fn without_a_board_the_message_says_what_each_port_answered_and_what_to_do() {
        let busy = PortError::Busy { port: "/dev/ttyUSB0".to_owned() };
        let mut unframed = UnframedBytes::default();
        unframed.add(b"hello from blinky");
        let probes = [
            probe_of("/dev/ttyUSB0", Err(busy.into())),
            probe_of("/dev/ttyUSB1", Err(GreetError::Silent { seconds: 3, unframed }.into())),
        ];
        let message = choose(&probes).unwrap_err().to_string();
        for part in ["/dev/ttyUSB0 is busy", "/dev/ttyUSB1: ", "17 bytes", "--simulate", "--port", "cable"] {
            assert!(message.contains(part), "{part} is missing in: {message}");
        }
        assert!(choose(&[]).unwrap_err().to_string().contains("There is no USB serial port."));
    }
}
