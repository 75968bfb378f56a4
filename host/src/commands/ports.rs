//! `tactomo ports`: which serial ports there are, and which have a board.

use tactomo::board::link::ports::ports;
use tactomo::board::link::serial::DEFAULT_BAUD;
use tactomo::board::source::discover::{self, Probe};
use tactomo_protocol::Hello;

use tactomo_cli::output::{self, message};

/// Lists the serial ports, and which USB ports have a board.
///
/// Example: tactomo ports
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {
    /// Lists the ports without opening them: opening resets many boards
    #[arg(long)]
    no_probe: bool,
    /// Baud rate of the serial ports
    #[arg(long, default_value_t = DEFAULT_BAUD, value_parser = clap::value_parser!(u32).range(300..=12_000_000))]
    baud: u32,
}

/// Prints one line for each serial port.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let ports = ports();
    if ports.is_empty() {
        message!("no serial ports: is the board plugged in, with a cable that carries data?");
        return Ok(());
    }
    if args.no_probe {
        return Ok(output::print(&lines(ports.iter().map(|port| port.name.clone())))?);
    }
    let (usb, others): (Vec<_>, Vec<_>) = ports.into_iter().partition(|port| port.usb);
    let probed = discover::probe(usb, args.baud);
    let others = others.into_iter().map(|port| format!("{}  not USB, not asked", port.name));
    Ok(output::print(&lines(probed.iter().map(line).chain(others)))?)
}

fn lines(lines: impl Iterator<Item = String>) -> String {
    lines.collect::<Vec<_>>().join("\n")
}

fn line(probe: &Probe) -> String {
    let Probe { port, answer } = probe;
    let serial = port.serial.as_ref().map(|serial| format!("serial number {serial}"));
    let device: Vec<_> = [port.product.clone(), serial].into_iter().flatten().collect();
    let device = if device.is_empty() { String::new() } else { format!(" ({})", device.join(", ")) };
    format!("{}{device}  {}", port.name, answer.as_ref().map_or_else(ToString::to_string, board))
}

fn board(hello: &Hello) -> String {
    let Hello { board, firmware_version, electrodes, .. } = hello;
    format!("board {board}, firmware {firmware_version}, {electrodes} electrodes")
}
