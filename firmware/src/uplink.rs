//! The way to the host: packets wait here, and go out as the line takes them.
//!
//! Answers and faults go first, then frames; a packet of log may go between two frames. There is room for one frame, until all of it has gone.

use heapless::Deque;
use tactomo_protocol::{
    BoardMessage, Contacts, Keys, MAX_LOG, Scope, encode_board, encode_contacts, encode_keyed, encode_log, wire_bytes,
};

use crate::scan::Scanned;
use crate::{Chip, Serial};

/// Bytes of answers and faults that can wait: three of the longest, four of a board with two converters.
const CONTROL_BYTES: usize = 512;
/// Longest answer or fault on the wire.
const CONTROL_PACKET: usize = 176;
/// Longest packet of log on the wire.
const LOG_PACKET: usize = wire_bytes(1 + MAX_LOG + 4);
/// Packets that one [`Uplink::poll`] begins at most, so that it ends on any line.
const PACKETS_A_POLL: usize = 4;

/// A wire packet.
#[derive(Debug)]
struct Packet<const N: usize> {
    bytes: [u8; N],
    length: usize,
}

impl<const N: usize> Packet<N> {
    const EMPTY: Self = Self { bytes: [0; N], length: 0 };

    fn from(&self, begin: usize) -> &[u8] {
        self.bytes.get(begin..self.length).unwrap_or_default()
    }
}

/// What is being sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sending {
    Nothing,
    Control,
    Frame,
    Log,
    /// Nothing, until the line may be used again.
    Held,
}

/// Packets on their way to the host; a frame has `READINGS` readings and takes `WIRE` bytes at most.
#[derive(Debug)]
pub struct Uplink<const READINGS: usize, const WIRE: usize> {
    /// Whole packets, each with its closing zero.
    control: Deque<u8, CONTROL_BYTES>,
    frame: Packet<WIRE>,
    /// Whether no byte of the frame is gone yet.
    frame_waits: bool,
    /// Number of the frame that was encoded last.
    sequence: u16,
    /// The keys that the host has.
    keys: Keys<READINGS>,
    log: Packet<LOG_PACKET>,
    /// Where bytes of the log are pulled to. On the stack it would be cleared in each idle look at the line: 17 000 instructions a frame.
    pulled: [u8; MAX_LOG],
    sending: Sending,
    /// Bytes of the frame or log under way that are gone.
    gone: usize,
    /// Whether the last packet was a frame, so that the log has its turn.
    after_frame: bool,
    /// Whether nothing is to be begun but answers.
    holds: bool,
}

impl<const READINGS: usize, const WIRE: usize> Default for Uplink<READINGS, WIRE> {
    /// Begins with a lone zero, which cuts off whatever the boot loader said on the line.
    fn default() -> Self {
        let mut control = Deque::new();
        // There is room in an empty queue.
        let _ = control.push_back(0);
        Self {
            control,
            frame: Packet::EMPTY,
            frame_waits: false,
            sequence: u16::MAX,
            keys: Keys::default(),
            log: Packet::EMPTY,
            pulled: [0; MAX_LOG],
            sending: Sending::Nothing,
            gone: 0,
            after_frame: false,
            holds: false,
        }
    }
}

impl<const READINGS: usize, const WIRE: usize> Uplink<READINGS, WIRE> {
    /// Queues an answer or a fault; returns whether there was room. Without it the message is lost: the host has left
    /// several of them unread.
    pub fn message(&mut self, message: &BoardMessage) -> bool {
        let mut packet = [0; CONTROL_PACKET];
        let Ok(length) = encode_board(message, &mut packet) else { return false };
        let fits = self.control.storage_capacity() - self.control.len() >= length;
        if fits {
            self.control.extend(packet.into_iter().take(length));
        }
        fits
    }

    /// Sends the next frames as they are: the host may have none of the keys.
    pub fn forget_keys(&mut self) {
        self.keys.clear();
    }

    /// Sends what is being sent and the answers that wait, then nothing until it is [released](Self::release).
    pub fn hold(&mut self) {
        self.holds = true;
        self.hold_if_done();
    }

    fn hold_if_done(&mut self) {
        if self.holds && self.sending == Sending::Nothing && self.control.is_empty() {
            self.sending = Sending::Held;
        }
    }

    /// Whether all that was to be sent has gone to the line.
    pub fn is_held(&self) -> bool {
        self.sending == Sending::Held
    }

    /// Goes on after a [hold](Self::hold).
    pub fn release(&mut self) {
        self.holds = false;
        if self.is_held() {
            self.sending = Sending::Nothing;
        }
    }

    /// Whether no frame waits or is being sent.
    pub fn has_room(&self) -> bool {
        !self.frame_waits && self.sending != Sending::Frame
    }

    /// Encodes a frame: its contacts, and its readings by what they differ by from their key if they have one. It takes the place and the number of one of
    /// which no byte is gone. It is dropped if another is being sent.
    pub fn frame(&mut self, scanned: &Scanned, readings: Option<(&Scope, &[u16])>, contacts: Option<Contacts>) {
        if self.frame_waits {
            // The host has not got the last frame, nor its key.
            self.forget_keys();
            if self.sending == Sending::Frame {
                self.sending = Sending::Nothing;
            }
        } else if self.sending == Sending::Frame {
            return;
        } else {
            self.sequence = self.sequence.wrapping_add(1);
        }
        let head = scanned.head(self.sequence);
        let Packet { bytes, length } = &mut self.frame;
        *length = contacts.map_or(0, |contacts| encode_contacts(&Contacts { head, ..contacts }, bytes).unwrap_or(0));
        if let Some((scope, readings)) = readings {
            let rest = bytes.get_mut(*length..).unwrap_or_default();
            *length += encode_keyed(head, scope, readings, &mut self.keys, rest).unwrap_or(0);
        }
        self.frame_waits = self.frame.length > 0;
    }

    /// Pushes as many bytes as `serial` takes at this moment; never waits. Log bytes come from `chip`.
    pub fn poll(&mut self, serial: &mut impl Serial, chip: &mut impl Chip) {
        for _ in 0..PACKETS_A_POLL {
            if self.sending == Sending::Nothing {
                self.begin(chip);
            }
            if self.sending == Sending::Nothing || !self.push(serial) {
                return;
            }
        }
    }

    /// Chooses what goes next.
    fn begin(&mut self, chip: &mut impl Chip) {
        self.gone = 0;
        self.sending = if !self.control.is_empty() {
            Sending::Control
        } else if (self.after_frame || !self.frame_waits) && self.fill_log(chip) {
            Sending::Log
        } else if self.frame_waits {
            Sending::Frame
        } else {
            Sending::Nothing
        };
        self.after_frame = self.sending == Sending::Frame;
    }

    fn fill_log(&mut self, chip: &mut impl Chip) -> bool {
        let count = chip.pull_log(&mut self.pulled).min(MAX_LOG);
        let Some(bytes) = self.pulled.get(..count).filter(|bytes| !bytes.is_empty()) else { return false };
        self.log.length = encode_log(bytes, &mut self.log.bytes).unwrap_or(0);
        true
    }

    /// Pushes the rest of the packet under way; returns whether the line took all of it.
    fn push(&mut self, serial: &mut impl Serial) -> bool {
        let done = match self.sending {
            Sending::Nothing => true,
            Sending::Held => false,
            Sending::Control => self.push_control(serial),
            Sending::Frame => push_from(&self.frame, &mut self.gone, serial),
            Sending::Log => push_from(&self.log, &mut self.gone, serial),
        };
        self.frame_waits &= self.sending != Sending::Frame || self.gone == 0;
        if done {
            self.sending = Sending::Nothing;
            self.hold_if_done();
        }
        done
    }

    /// Pushes answers and faults up to the end of the first packet, or of the queue's first piece of memory.
    fn push_control(&mut self, serial: &mut impl Serial) -> bool {
        loop {
            let (bytes, _) = self.control.as_slices();
            let length = bytes.iter().position(|byte| *byte == 0).map_or(bytes.len(), |zero| zero + 1);
            let Some(bytes) = bytes.get(..length).filter(|bytes| !bytes.is_empty()) else { return true };
            let ends = bytes.ends_with(&[0]);
            let taken = serial.push(bytes).min(length);
            for _ in 0..taken {
                self.control.pop_front();
            }
            if taken < length || ends {
                return taken == length;
            }
        }
    }
}

/// Pushes what is left of `packet`; returns whether the line took all of it.
fn push_from<const N: usize>(packet: &Packet<N>, gone: &mut usize, serial: &mut impl Serial) -> bool {
    let rest = packet.from(*gone);
    let taken = serial.push(rest).min(rest.len());
    *gone += taken;
    taken == rest.len()
}
