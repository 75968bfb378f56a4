//! Chunks as bytes.

use super::VERSION;

/// Most bytes in a chunk of data.
pub(super) const MAX_CHUNK: usize = 65_536;
/// Most bytes of a header: a surface of 200000 triangles as text takes about 13 MB.
pub(super) const MAX_HEADER: usize = 16 << 20;
/// Most bytes of a LEB128 number of 64 bits.
const MAX_LEB128: usize = 10;
/// Bytes of a chunk beside those that it holds, at most.
pub(super) const MAX_OVERHEAD: usize = MARK.len() + 1 + 2 * MAX_LEB128 + CRC_BYTES;
const CRC_BYTES: usize = 4;
/// What every chunk begins with; its kind follows.
pub(super) const MARK: [u8; 3] = *b"\xa5Tc";

static CRC: crc::Crc<u32, crc::Table<16>> = crc::Crc::<u32, crc::Table<16>>::new(&crc::CRC_32_ISO_HDLC);

/// What a chunk holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Header,
    Data,
    Note,
}

impl Kind {
    fn letter(self) -> u8 {
        match self {
            Self::Header => b'H',
            Self::Data => b'D',
            Self::Note => b'N',
        }
    }

    /// Most bytes that a chunk of this kind holds.
    fn longest(self) -> usize {
        match self {
            // A note may hold a detector, as the header does.
            Self::Header | Self::Note => MAX_HEADER,
            Self::Data => MAX_CHUNK,
        }
    }
}

/// A chunk that begins at the front of some bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Chunk {
    pub kind: Kind,
    /// Time since the start of the recording (us).
    pub time_us: u64,
    /// Where its bytes are.
    pub bytes: std::ops::Range<usize>,
    /// Length of the whole chunk in the file.
    pub length: usize,
}

/// What is at the front of some bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Parsed {
    /// A chunk whose checksum is right.
    Whole(Chunk),
    /// What would be a chunk, but for its checksum.
    Damaged(Chunk),
    /// What may be the front of a chunk: so many bytes are needed to tell.
    Short(usize),
    /// No chunk.
    Nothing,
}

/// Looks for a chunk at the front of `bytes`.
pub(super) fn parse(bytes: &[u8]) -> Parsed {
    let Some(kind) = kind(bytes) else {
        let may_be = bytes.len() <= MARK.len() && MARK.starts_with(bytes);
        return if may_be { Parsed::Short(MARK.len() + 1) } else { Parsed::Nothing };
    };
    let number = |at: usize| leb128(bytes.get(at..).unwrap_or_default()).map(|(value, length)| (value, at + length));
    let (time_us, at) = match number(MARK.len() + 1) {
        Ok(found) => found,
        Err(parsed) => return parsed.within(bytes.len()),
    };
    let (count, at) = match number(at) {
        Ok(found) => found,
        Err(parsed) => return parsed.within(bytes.len()),
    };
    if count > kind.longest() as u64 {
        return Parsed::Nothing;
    }
    let end = at + count as usize;
    let length = end + CRC_BYTES;
    let Some(crc) = bytes.get(end..length) else { return Parsed::Short(length) };
    let chunk = Chunk { kind, time_us, bytes: at..end, length };
    if crc == checksum(&bytes[..end]).to_le_bytes() { Parsed::Whole(chunk) } else { Parsed::Damaged(chunk) }
}

fn kind(bytes: &[u8]) -> Option<Kind> {
    let letter = bytes.strip_prefix(&MARK)?.first()?;
    [Kind::Header, Kind::Data, Kind::Note].into_iter().find(|kind| kind.letter() == *letter)
}

fn checksum(bytes: &[u8]) -> u32 {
    let mut digest = CRC.digest();
    digest.update(&[VERSION]);
    digest.update(bytes);
    digest.finalize()
}

/// Bytes from the second of `bytes` on in which no chunk begins for sure. Part of a mark may be at the very end.
pub(super) fn skip(bytes: &[u8]) -> usize {
    let rest = bytes.get(1..).unwrap_or_default();
    1 + rest.iter().position(|byte| *byte == MARK[0]).unwrap_or(rest.len())
}

/// Puts a chunk behind what is in `out`.
pub(super) fn put_chunk(kind: Kind, time_us: u64, bytes: &[u8], out: &mut Vec<u8>) {
    let start = out.len();
    out.extend(MARK);
    out.push(kind.letter());
    put_leb128(time_us, out);
    put_leb128(bytes.len() as u64, out);
    out.extend_from_slice(bytes);
    let crc = checksum(&out[start..]);
    out.extend(crc.to_le_bytes());
}

/// Whether a number may go on behind the bytes that are there, or is none.
enum NoNumber {
    Cut,
    TooLong,
}

impl NoNumber {
    fn within(self, length: usize) -> Parsed {
        match self {
            Self::Cut => Parsed::Short(length + 1),
            Self::TooLong => Parsed::Nothing,
        }
    }
}

/// The LEB128 number at the front of `bytes`, and its length.
fn leb128(bytes: &[u8]) -> Result<(u64, usize), NoNumber> {
    let mut value = 0;
    for (place, byte) in bytes.iter().take(MAX_LEB128).enumerate() {
        value |= u64::from(byte & 0x7f) << (7 * place);
        if *byte < 0x80 {
            return Ok((value, place + 1));
        }
    }
    Err(if bytes.len() < MAX_LEB128 { NoNumber::Cut } else { NoNumber::TooLong })
}

fn put_leb128(mut value: u64, out: &mut Vec<u8>) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}
