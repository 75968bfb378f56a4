//! More parts of a board for tests, and what is read of its messages.

use embedded_hal::delay::DelayNs;
use tactomo_firmware::mux::Mux;
use tactomo_firmware::{Activity, Chip, Sampler, Serial, TimedOut};
use tactomo_protocol::{BoardMessage, Command, Fault, MAX_COMMAND, Request, encode_request};

use crate::parts::{Outside, TestBoard, TestSampler, TestSerial};

/// A part that takes no room.
pub struct NullPart;

impl Sampler for NullPart {
    fn sample(&mut self, _electrode: u8) -> Result<u16, TimedOut> {
        Ok(0)
    }
}

impl Serial for NullPart {
    fn push(&mut self, bytes: &[u8]) -> usize {
        bytes.len()
    }

    fn pull(&mut self, _buffer: &mut [u8]) -> usize {
        0
    }
}

impl DelayNs for NullPart {
    fn delay_ns(&mut self, _ns: u32) {}
}

impl Chip for NullPart {
    fn now_us(&mut self) -> u64 {
        0
    }

    fn feed_watchdog(&mut self) {}
}

/// The code of conversion `number` when nothing is averaged: a number of its own for every reading of a frame.
pub fn numbered(number: u64, _electrode: u8) -> Result<u16, TimedOut> {
    Ok(4 * (number % 256) as u16)
}

/// A reading of ten bits that no other tells: a frame of such is not shorter by what it differs by from another.
pub fn restless(number: u64, _electrode: u8) -> Result<u16, TimedOut> {
    Ok((number.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 54) as u16)
}

/// The line of a board with this outside.
pub fn serial(outside: &Outside) -> TestSerial {
    TestSerial(outside.clone())
}

/// A converter that takes its time of this outside's clock.
pub fn sampler<F: FnMut(u64, u8) -> Result<u16, TimedOut>>(outside: &Outside, sample: F) -> TestSampler<F> {
    TestSampler(outside.clone(), sample)
}

/// Steps until `frames` scans are done.
pub fn scan<M: Mux, F, D: DelayNs>(board: &mut TestBoard<M, F, D>, frames: usize)
where
    F: FnMut(u64, u8) -> Result<u16, TimedOut>,
    M::Error: std::fmt::Debug,
{
    for _ in 0..frames {
        while board.step().unwrap() != Activity::Frame {}
    }
}

impl Outside {
    /// Sends a command with the tag 1.
    pub fn send(&self, command: Command) {
        self.send_tagged(1, command);
    }

    /// Sends a command of which nothing is there yet when the board looks next.
    pub fn send_while_waiting(&self, command: Command) {
        let mut packet = [0; MAX_COMMAND];
        let length = encode_request(&Request { tag: 1, command }, &mut packet).unwrap();
        let mut wire = self.wire.borrow_mut();
        wire.soon = packet[..length].to_vec();
        wire.pulls = 0;
    }
}

pub fn faults(messages: &[BoardMessage]) -> Vec<&Fault> {
    messages
        .iter()
        .filter_map(|message| if let BoardMessage::Fault(fault) = message { Some(fault) } else { None })
        .collect()
}
