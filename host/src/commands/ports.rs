//! `tactomo ports`: which serial ports there are.

/// Lists the serial ports.
///
/// Example: tactomo ports
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub struct Args {}

/// Prints one line for each serial port.
pub fn run(Args {}: Args) -> anyhow::Result<()> {
    for port in serialport::available_ports()? {
        println!("{}", port.port_name);
    }
    Ok(())
}
