//! A scripted board at the master's end of a pseudo-terminal.

use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serialport::{SerialPort, TTYPort};
use tactomo_protocol::{
    BoardMessage, Command, CommandReceiver, FrameHead, Hello, MAX_WIRE, Request, encode_board, encode_frame,
};

/// How long the host may take for anything.
const PATIENCE: Duration = Duration::from_secs(10);

pub struct Board {
    /// `None` once it is unplugged.
    master: Option<TTYPort>,
    /// A name that stays when the board is plugged in again, as udev gives.
    port: PathBuf,
    receiver: CommandReceiver,
    sequence: u16,
    streaming: bool,
}

impl Board {
    /// Plugs a board in, which is silent.
    pub fn plug(name: &str) -> Self {
        let (mut master, slave) = TTYPort::pair().unwrap();
        master.set_timeout(Duration::from_millis(20)).unwrap();
        let port = std::env::temp_dir().join(format!("tactomo-{}-{name}", std::process::id()));
        let _ = std::fs::remove_file(&port); // Left by the board before, if there was one.
        std::os::unix::fs::symlink(slave.name().unwrap(), &port).unwrap();
        Self { master: Some(master), port, receiver: CommandReceiver::default(), sequence: 0, streaming: false }
    }

    /// Pulls the cable: port and name are gone.
    pub fn unplug(&mut self) {
        self.master = None;
        std::fs::remove_file(&self.port).unwrap();
    }

    pub fn port(&self) -> &Path {
        &self.port
    }

    /// Waits for a host that asks, and until it has started the board.
    pub fn greet(&mut self) {
        let tag = self.wait_for(Command::Hello);
        self.answer(tag);
        self.wait_for_start();
    }

    /// Waits until the host has started the board, and answers what it says on the way there.
    pub fn wait_for_start(&mut self) {
        loop {
            let Request { tag, command } = self.next_request();
            self.streaming |= command == Command::Start;
            self.answer(tag);
            if command == Command::Start {
                return;
            }
        }
    }

    /// Reads until the host says `command`, and answers nothing; returns its tag.
    pub fn wait_for(&mut self, command: Command) -> u8 {
        loop {
            let request = self.next_request();
            if request.command == command {
                return request.tag;
            }
        }
    }

    /// Reads until the host says something.
    fn next_request(&mut self) -> Request {
        let begin = Instant::now();
        while begin.elapsed() < PATIENCE {
            let mut byte = [0];
            // Before the host opens its end, and while it says nothing, reading fails.
            let Ok(1) = self.master.as_mut().unwrap().read(&mut byte) else {
                std::thread::sleep(Duration::from_millis(1));
                continue;
            };
            if let Some(Ok(request)) = self.receiver.receive(&mut &byte[..]) {
                return request;
            }
        }
        panic!("the host says nothing");
    }

    /// Says Hello in answer to the command with this tag; 0 after a start.
    pub fn answer(&mut self, answers: u8) {
        self.say(&BoardMessage::Hello(Hello { answers, is_streaming: self.streaming, ..Hello::example(16) }));
    }

    pub fn say(&mut self, message: &BoardMessage) {
        let mut wire = [0; MAX_WIRE];
        let length = encode_board(message, &mut wire).unwrap();
        self.raw(&wire[..length]);
    }

    /// The next scan as a packet, whether or not it is sent.
    pub fn next_frame(&mut self) -> Vec<u8> {
        let head =
            FrameHead { sequence: self.sequence, time_us: 1000 * u32::from(self.sequence), ..FrameHead::default() };
        self.sequence += 1;
        let readings: [u16; 256] = std::array::from_fn(|i| (i * 8) as u16);
        let mut wire = vec![0; MAX_WIRE];
        let length = encode_frame(head, &readings, &mut wire).unwrap();
        wire.truncate(length);
        wire
    }

    pub fn frames(&mut self, count: usize) {
        for _ in 0..count {
            let frame = self.next_frame();
            self.raw(&frame);
        }
    }

    /// Counts and clock begin again, and nothing is sent.
    pub fn reset(&mut self) {
        (self.sequence, self.streaming) = (0, false);
    }

    /// Sends bytes as they are, however long the host takes to read them.
    pub fn raw(&mut self, mut bytes: &[u8]) {
        let begin = Instant::now();
        while !bytes.is_empty() {
            assert!(begin.elapsed() < PATIENCE, "the host does not read");
            match self.master.as_mut().unwrap().write(bytes) {
                Ok(count) => bytes = &bytes[count..],
                Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(error) => panic!("the pseudo-terminal broke: {error}"),
            }
        }
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        if self.master.is_some() {
            let _ = std::fs::remove_file(&self.port); // Another board may have taken the name away.
        }
    }
}
