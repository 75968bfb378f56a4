//! The host's end of the emulated board's line.

use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use defmt_decoder::{DecodeError, Table};
use tactomo::board::link::Link;
use tactomo::board::link::serial::{DEFAULT_BAUD, SerialLink};
use tactomo_protocol::{
    BoardMessage, BoardReceiver, Command, Counters, Frame, Hello, MAX_COMMAND, Request, encode_request,
};

/// Longest wait for anything, on a machine under load.
const PATIENCE: Duration = Duration::from_secs(60);
/// Time between two calls for Hello: QEMU takes up to a second to notice that somebody listens.
const CALL_INTERVAL: Duration = Duration::from_millis(200);

/// Sends commands, receives messages, decodes the log.
pub struct Host {
    link: SerialLink,
    receiver: BoardReceiver,
    /// Bytes received that the receiver has not had yet.
    waiting: Vec<u8>,
    log_table: Table,
    log_bytes: Vec<u8>,
}

impl Host {
    /// Opens the pseudo-terminal; `elf` is the firmware at its other end.
    ///
    /// # Errors
    /// If the pseudo-terminal cannot be opened or the ELF file has no log table.
    pub fn open(pty: &str, elf: &Path) -> Result<Self> {
        let link = SerialLink::open(pty, DEFAULT_BAUD)?;
        let log_table = Table::parse(&std::fs::read(elf)?)?.context("no log table in the ELF file")?;
        Ok(Self { link, receiver: BoardReceiver::default(), waiting: Vec::new(), log_table, log_bytes: Vec::new() })
    }

    /// Sends a command.
    ///
    /// # Errors
    /// If the line does not take it.
    pub fn send(&mut self, command: &Command) -> Result<()> {
        let mut bytes = [0; MAX_COMMAND];
        let request = Request { tag: 1, command: command.clone() };
        let length = encode_request(&request, &mut bytes)?;
        Ok(self.link.write_all(&bytes[..length])?)
    }

    /// Asks for Hello until it comes.
    ///
    /// # Errors
    /// If it does not come.
    pub fn hello(&mut self) -> Result<Hello> {
        let start = Instant::now();
        while start.elapsed() < PATIENCE {
            self.send(&Command::Hello)?;
            let found = self.look_for(CALL_INTERVAL, &mut |message| match message {
                BoardMessage::Hello(hello) => Some(hello),
                _ => None,
            })?;
            if let Some(hello) = found {
                return Ok(hello);
            }
        }
        bail!("the board does not say Hello")
    }

    /// Receives frames.
    ///
    /// # Errors
    /// If they do not come.
    pub fn frames(&mut self, count: usize) -> Result<Vec<Frame>> {
        self.frames_where(count, |_| true)
    }

    /// Receives frames that `wanted` holds for, leaving out others.
    ///
    /// # Errors
    /// If they do not come.
    pub fn frames_where(&mut self, count: usize, wanted: impl Fn(&Frame) -> bool) -> Result<Vec<Frame>> {
        let next = |host: &mut Self| {
            host.wait_for(|message| match message {
                BoardMessage::Frame(frame) => Some(frame).filter(&wanted),
                _ => None,
            })
        };
        (0..count).map(|_| next(self)).collect()
    }

    /// Waits for the first message that `wanted` takes.
    ///
    /// # Errors
    /// If none comes.
    pub fn wait_for<T>(&mut self, mut wanted: impl FnMut(BoardMessage) -> Option<T>) -> Result<T> {
        self.look_for(PATIENCE, &mut wanted)?.context("the board does not send what it should")
    }

    /// What was received and dropped so far.
    pub fn counters(&self) -> Counters {
        self.receiver.counters()
    }

    /// The log so far, without its times.
    pub fn log(&self) -> Vec<String> {
        let mut decoder = self.log_table.new_stream_decoder();
        decoder.received(&self.log_bytes);
        let mut lines = Vec::new();
        loop {
            match decoder.decode() {
                Ok(frame) => {
                    let level = frame.level().map_or("-", |level| level.as_str()).to_uppercase();
                    lines.push(format!("{level} {}", frame.display_message()));
                }
                Err(DecodeError::Malformed) => lines.push("malformed".to_owned()),
                Err(DecodeError::UnexpectedEof) => return lines,
            }
        }
    }

    fn look_for<T>(
        &mut self,
        patience: Duration,
        wanted: &mut impl FnMut(BoardMessage) -> Option<T>,
    ) -> Result<Option<T>> {
        let start = Instant::now();
        while start.elapsed() < patience {
            while let Some(message) = self.next_message() {
                if let Some(found) = wanted(message) {
                    return Ok(Some(found));
                }
            }
            self.read()?;
        }
        Ok(None)
    }

    /// The next message among the bytes received; log bytes are kept aside.
    fn next_message(&mut self) -> Option<BoardMessage> {
        loop {
            let mut rest = self.waiting.as_slice();
            let message = self.receiver.receive(&mut rest);
            let used = self.waiting.len() - rest.len();
            self.waiting.drain(..used);
            match message? {
                Ok(BoardMessage::Log(log)) => self.log_bytes.extend_from_slice(&log.0),
                Ok(message) => return Some(message),
                // Counted by the receiver.
                Err(_) => {}
            }
        }
    }

    fn read(&mut self) -> Result<()> {
        let mut bytes = [0; 4096];
        let count = self.link.read(&mut bytes)?;
        self.waiting.extend_from_slice(&bytes[..count]);
        Ok(())
    }
}
