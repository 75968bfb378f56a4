//! What a session does on its link: it sets the rate and sends commands.

use std::io;
use std::thread;
use std::time::{Duration, Instant};

use tactomo_physics::causes::with_causes;
use tactomo_protocol::{Command, MAX_COMMAND, Request, encode_request};

use super::Session;
use super::rate::Rates;
use crate::link::Link;

/// Pause after a link was set to another rate: by then the board's FIFO of 128 bytes is empty (1.4 ms at 921 600 baud) and a USB bridge has
/// done its part.
const SETTLE: Duration = Duration::from_millis(3);

impl Session {
    /// Does what is due on `link`: sets its rate and sends commands. `damaged` is how many stretches of bytes from it were no packet so far.
    ///
    /// # Errors
    /// If the link is gone or does not take bytes in time.
    pub fn transmit(&mut self, link: &mut dyn Link, damaged: u64) -> io::Result<()> {
        let now = Instant::now();
        if self.rates.is_none() {
            self.rates = link.baud().map(|baud| Rates::new(baud, now));
        }
        if let Some(rates) = &mut self.rates {
            rates.damaged(damaged, now);
            set_rate(rates, link, now)?;
        }
        while let Some(request) = self.command(Instant::now()) {
            send(link, &request)?;
        }
        Ok(())
    }

    /// Bits a second that the link is set to, where it has a rate.
    pub fn baud(&self) -> Option<u32> {
        self.rates.as_ref().map(Rates::link_baud)
    }

    /// Whether the rate of the line is being changed: what comes damaged meanwhile is no fault of the line.
    pub fn is_changing_rate(&self) -> bool {
        self.rates.as_ref().is_some_and(Rates::is_changing)
    }

    /// Whether board and host agreed on a higher rate than the first.
    pub(super) fn is_raised(&self) -> bool {
        self.rates.as_ref().is_some_and(|rates| rates.first_if_raised().is_some())
    }

    /// Takes note of something that came whole.
    pub(super) fn whole(&mut self, now: Instant) {
        self.rates.iter_mut().for_each(|rates| rates.heard(now));
    }

    /// Leaves the board at its first rate, for whoever opens the link next. One that does not hear it goes there by itself, within 2 s.
    pub fn leave(&mut self, link: &mut dyn Link) {
        let first = self.rates.as_ref().and_then(Rates::first_if_raised);
        let Some(baud) = first else { return };
        let request = Request { tag: self.next_tag(), command: Command::Rate { baud } };
        if let Err(error) = send(link, &request) {
            tracing::debug!("{}: {}", link.name(), with_causes(&error));
        }
    }
}

/// Sets the link to the rate that is due.
fn set_rate(rates: &mut Rates, link: &mut dyn Link, now: Instant) -> io::Result<()> {
    let Some(baud) = rates.link_due(now) else { return Ok(()) };
    match link.set_baud(baud) {
        Ok(()) => {
            thread::sleep(SETTLE);
            rates.link_set(baud, Instant::now());
        }
        Err(error) if error.kind() == io::ErrorKind::BrokenPipe => return Err(error),
        Err(error) => {
            tracing::debug!("{} cannot be set to {baud} baud: {}", link.name(), with_causes(&error));
            rates.link_refused(now);
        }
    }
    Ok(())
}

/// Sends a command.
///
/// # Errors
/// If the link does not take it.
pub fn send(link: &mut dyn Link, request: &Request) -> io::Result<()> {
    let mut wire = [0; MAX_COMMAND];
    let length = encode_request(request, &mut wire).map_err(io::Error::other)?;
    // A zero ends whatever noise the board may have got before.
    link.write_all(&[0])?;
    link.write_all(&wire[..length])
}
