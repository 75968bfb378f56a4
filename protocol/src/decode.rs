//! Wire bytes to messages.

use heapless::Vec;

use crate::coded::Keys;
use crate::contacts::Contacts;
use crate::frame::{self, Frame, FrameHead, HEAD_BYTES};
use crate::message::{BoardMessage, Fault, Hello, Kind, Log, Request};
use crate::{CODED_SINCE, CRC, CRC_BYTES, MAX_COMMAND, MAX_READINGS, MAX_WIRE, OLDEST, Scope, VERSION, cobs};

/// Why bytes between two zeros are not a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// Not a packet: noise, boot text, half a packet, or one with a flipped bit.
    #[error("not a whole packet")]
    Corrupt,
    /// A whole packet in another version of the protocol.
    #[error("the peer speaks version {0} of the protocol, this side version {VERSION}")]
    Version(u8),
    /// A whole packet of a frame whose [key](crate::coded) did not come.
    #[error("a frame whose key frame did not come")]
    Key,
    /// A whole packet of a frame, or of contacts, that came before.
    #[error("a frame that came before")]
    Repeated,
    /// A whole packet whose kind or body breaks the rules of the protocol.
    #[error("a whole packet that breaks the rules of the protocol")]
    Body,
}

/// What a receiver has met since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Messages received.
    pub messages: u64,
    /// Whole frames whose key did not come: after a key that was lost, and before the first.
    pub without_key: u64,
    /// Frames and contacts that came once more.
    pub repeated: u64,
    /// Stretches of bytes between two zeros that were not a message.
    pub corrupt: u64,
    /// Bytes in those stretches.
    pub dropped_bytes: u64,
}

/// Finds packets in a stream of bytes; the longest takes `N` bytes on the wire, its closing zero included. Of a longer stretch nothing is taken,
/// whatever it may say.
#[derive(Debug)]
pub struct Receiver<const N: usize> {
    held: Vec<u8, N>,
    /// Bytes of the stretch under way that did not fit, so it cannot be a packet.
    lost: usize,
    counters: Counters,
}

/// The host's receiver, which remembers key frames.
#[derive(Debug, Default)]
pub struct BoardReceiver {
    receiver: Receiver<MAX_WIRE>,
    known: Known,
}

/// What a host's receiver knows of what came before.
#[derive(Debug, Default)]
struct Known {
    keys: Keys<MAX_READINGS>,
    /// Number and board time of the last frame, and of the last contacts.
    frame: Option<(u16, u32)>,
    contacts: Option<(u16, u32)>,
}

/// The board's receiver.
pub type CommandReceiver = Receiver<MAX_COMMAND>;

impl<const N: usize> Default for Receiver<N> {
    fn default() -> Self {
        Self { held: Vec::new(), lost: 0, counters: Counters::default() }
    }
}

impl<const N: usize> Receiver<N> {
    /// What was received and dropped so far.
    pub fn counters(&self) -> Counters {
        self.counters
    }

    fn receive_with<M>(
        &mut self,
        input: &mut &[u8],
        mut parse: impl FnMut(&[u8]) -> Result<M, DecodeError>,
    ) -> Option<Result<M, DecodeError>> {
        while let Some(end) = memchr::memchr(0, input) {
            self.hold(&input[..end]);
            *input = &input[end + 1..];
            let length = self.held.len() + self.lost;
            // Zeros in a row separate nothing.
            if length > 0 {
                let message = self.unstuffed().and_then(&mut parse);
                self.held.clear();
                self.lost = 0;
                self.count(&message, length);
                return Some(message);
            }
        }
        self.hold(input);
        *input = &[];
        None
    }

    /// The packet in the stretch that just ended.
    fn unstuffed(&mut self) -> Result<&[u8], DecodeError> {
        let stretch = if self.lost == 0 { &mut self.held[..] } else { &mut [] };
        let length = cobs::unstuff(stretch).ok_or(DecodeError::Corrupt)?;
        Ok(&stretch[..length])
    }

    /// Keeps bytes of a stretch that is still open, or notes that it is too long for a packet.
    fn hold(&mut self, bytes: &[u8]) {
        // The closing zero is one of the `N` bytes, and is not held.
        let fits = self.held.len() + bytes.len() < N;
        if self.lost > 0 || !fits || self.held.extend_from_slice(bytes).is_err() {
            self.lost += bytes.len();
        }
    }

    fn count<M>(&mut self, packet: &Result<M, DecodeError>, length: usize) {
        match packet {
            Ok(_) => self.counters.messages += 1,
            Err(DecodeError::Key) => self.counters.without_key += 1,
            Err(DecodeError::Repeated) => self.counters.repeated += 1,
            Err(_) => {
                self.counters.corrupt += 1;
                self.counters.dropped_bytes += length as u64;
            }
        }
    }
}

impl BoardReceiver {
    /// Takes bytes from the front of `input` up to the end of the next packet or stretch of junk; `None` when `input` is
    /// used up.
    pub fn receive(&mut self, input: &mut &[u8]) -> Option<Result<BoardMessage, DecodeError>> {
        let Self { receiver, known } = self;
        receiver.receive_with(input, |packet| board_message(packet, known))
    }

    /// What was received and dropped so far.
    pub fn counters(&self) -> Counters {
        self.receiver.counters()
    }
}

impl CommandReceiver {
    /// Takes bytes from the front of `input` up to the end of the next packet or stretch of junk; `None` when `input` is
    /// used up.
    pub fn receive(&mut self, input: &mut &[u8]) -> Option<Result<Request, DecodeError>> {
        self.receive_with(input, request)
    }
}

/// Checks the CRC and the version; returns the version, the kind's bits and the body.
fn open(packet: &[u8]) -> Result<(u8, u8, &[u8]), DecodeError> {
    let (content, crc) = packet.split_last_chunk::<CRC_BYTES>().ok_or(DecodeError::Corrupt)?;
    let (head, body) = content.split_first().ok_or(DecodeError::Corrupt)?;
    if CRC.checksum(content) != u32::from_le_bytes(*crc) {
        return Err(DecodeError::Corrupt);
    }
    match head >> 4 {
        version @ OLDEST..=VERSION => Ok((version, head & 15, body)),
        version => Err(DecodeError::Version(version)),
    }
}

fn board_message(packet: &[u8], known: &mut Known) -> Result<BoardMessage, DecodeError> {
    let (version, kind, body) = open(packet)?;
    Ok(match Kind::from_bits(kind).ok_or(DecodeError::Body)? {
        Kind::Hello => {
            let hello = hello(body)?;
            // A board that has just started numbers its frames anew.
            if hello.answers == 0 {
                known.keys.clear();
                (known.frame, known.contacts) = (None, None);
            }
            BoardMessage::Hello(hello)
        }
        Kind::Frame => {
            let frame = frame(body).ok_or(DecodeError::Body)?;
            known.keys.remember(&frame.head, &frame.scope, &frame.readings);
            first(&mut known.frame, &frame.head)?;
            BoardMessage::Frame(frame)
        }
        Kind::CodedFrame if version < CODED_SINCE => return Err(DecodeError::Body),
        Kind::CodedFrame => {
            let frame = coded_frame(body, &mut known.keys)?;
            first(&mut known.frame, &frame.head)?;
            BoardMessage::Frame(frame)
        }
        Kind::Log => BoardMessage::Log(log(body)?),
        Kind::Fault => match from_postcard(body)? {
            // Its frames could be read, but it obeys nobody of this version.
            Fault::UnknownVersion(_) if version < VERSION => return Err(DecodeError::Version(version)),
            fault => BoardMessage::Fault(fault),
        },
        Kind::Clock => BoardMessage::Clock(from_postcard(body)?),
        Kind::Contacts => {
            let contacts = Contacts::read(body).ok_or(DecodeError::Body)?;
            first(&mut known.contacts, &contacts.head)?;
            BoardMessage::Contacts(contacts)
        }
        Kind::Table => BoardMessage::Table(from_postcard(body)?),
        Kind::Command => return Err(DecodeError::Body),
    })
}

/// Takes note of a scan, unless it is the last one once more: no two have the same number and time.
fn first(last: &mut Option<(u16, u32)>, head: &FrameHead) -> Result<(), DecodeError> {
    let scan = Some((head.sequence, head.time_us));
    if *last == scan {
        return Err(DecodeError::Repeated);
    }
    *last = scan;
    Ok(())
}

fn hello(body: &[u8]) -> Result<Hello, DecodeError> {
    let hello: Hello = from_postcard(body)?;
    if hello.is_valid() { Ok(hello) } else { Err(DecodeError::Body) }
}

fn log(body: &[u8]) -> Result<Log, DecodeError> {
    Vec::from_slice(body).map(Log).map_err(|_| DecodeError::Body)
}

fn request(packet: &[u8]) -> Result<Request, DecodeError> {
    let (version, kind, body) = open(packet)?;
    if version != VERSION {
        return Err(DecodeError::Version(version));
    }
    if kind != Kind::Command as u8 {
        return Err(DecodeError::Body);
    }
    let request: Request = from_postcard(body)?;
    if request.tag == 0 { Err(DecodeError::Body) } else { Ok(request) }
}

/// The whole of `body`, nothing left over.
fn from_postcard<'a, T: serde::Deserialize<'a>>(body: &'a [u8]) -> Result<T, DecodeError> {
    match postcard::take_from_bytes(body) {
        Ok((value, [])) => Ok(value),
        _ => Err(DecodeError::Body),
    }
}

fn frame(body: &[u8]) -> Option<Frame> {
    let (head, rest) = body.split_first_chunk::<HEAD_BYTES>()?;
    let (head, bits) = FrameHead::from_bytes(*head);
    let width = bits + 1;
    let (scope, packed) = Scope::read(rest)?;
    let fits = packed.len() == frame::packed_bytes(width, scope.readings());
    let readings = fits.then(|| frame::unpack(packed, width, scope.readings()))??;
    Some(Frame { head, scope, readings })
}

fn coded_frame(body: &[u8], keys: &mut Keys<MAX_READINGS>) -> Result<Frame, DecodeError> {
    let split = || {
        let (head, rest) = body.split_first_chunk::<HEAD_BYTES>()?;
        let (age, rest) = rest.split_first()?;
        Some((FrameHead::from_bytes(*head), *age, Scope::read(rest)?))
    };
    let ((head, k), age, (scope, bytes)) = split().filter(|(_, age, _)| *age > 0).ok_or(DecodeError::Body)?;
    keys.pass(&head);
    if keys.age(&head, &scope) != Some(age) {
        return Err(DecodeError::Key);
    }
    let readings = keys.read(k, &scope, bytes).ok_or(DecodeError::Body)?;
    Ok(Frame { head, scope, readings })
}
