//! Contacts that a board has found by itself, and the table that it finds them by.
//!
//! The body of [`Contacts`]:
//!
//! | bytes | what |
//! |---|---|
//! | 7 | sequence number, board time and status, as of a [frame](crate::frame) |
//! | 1 | low two bits: how many contacts; then the [flags](ContactFlags) |
//! | 8 for each | a [contact](ContactCode): number, x, y, conductance, standard error |
//!
//! Three contacts take 39 bytes on the wire.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::frame::{FrameHead, HEAD_BYTES};
use crate::{CRC_BYTES, coding, wire_bytes};

/// Most contacts in a packet.
pub const MAX_CONTACTS: usize = 3;
/// Most bytes of a table in one command: with the rest of it they fit a UART's FIFO of 128 bytes.
pub const MAX_PIECE: usize = 64;
/// Bytes of a contact.
const CONTACT_BYTES: usize = 8;
/// Longest packet of contacts on the wire (bytes).
pub const MAX_WIRE: usize = wire_bytes(1 + HEAD_BYTES + MAX_CONTACTS * CONTACT_BYTES + CRC_BYTES);
/// Bits of the last byte of the head that count contacts.
const COUNT: u8 = 3;

/// What a board sends while it streams.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Output {
    /// Frames of readings.
    #[default]
    Frames,
    /// The contacts that it finds in them.
    Contacts,
    /// Both: the contacts of a frame just before it, under the same number.
    Both,
}

impl Output {
    /// Whether readings are sent.
    pub fn has_frames(self) -> bool {
        self != Self::Contacts
    }

    /// Whether contacts are found and sent.
    pub fn has_contacts(self) -> bool {
        self != Self::Frames
    }
}

/// The contacts of one scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Contacts {
    /// Number, time and status of the scan. Its fraction bits are not sent.
    pub head: FrameHead,
    /// What to know before they are believed.
    pub flags: ContactFlags,
    /// The contacts.
    pub found: Vec<ContactCode, MAX_CONTACTS>,
}

/// What to know before contacts are believed: all bits beside the count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContactFlags(u8);

impl ContactFlags {
    /// There are more contacts than those that are told.
    pub const MORE: Self = Self(4);
    /// The readings are not those of the contacts, by more than noise and the table's own error.
    pub const MISFIT: Self = Self(8);
    /// Readings are at the end of the converter's range, or contacts conduct so well that more would change nothing.
    pub const SATURATED: Self = Self(16);
    /// Readings of the detector at rest are not known yet, and are taken for those of a perfect detector.
    pub const RESTING: Self = Self(32);
    /// Wires of electrodes are broken: these are left out.
    pub const FAULT: Self = Self(64);
    /// The contacts leave more than noise does, which the table takes for an error of the detector: contacts may be hidden in it until that is calibrated.
    pub const CALIBRATE: Self = Self(128);

    /// Whether all of some flags are raised.
    pub const fn has(self, flags: Self) -> bool {
        self.0 & flags.0 == flags.0
    }

    /// Raises flags.
    pub const fn raise(&mut self, flags: Self) {
        self.0 |= flags.0;
    }
}

/// A contact as it is sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ContactCode {
    /// Number that it keeps from frame to frame: 1 to 255, then from 1 again.
    pub id: u8,
    /// Place, x and y, in units of 10 um.
    pub at: [i16; 2],
    /// Conductance as readings tell it, in series with the current that crowds under the contact: a code with 11 bits of mantissa.
    pub conductance: u16,
    /// Standard error of the place along the axis where it is larger: a code with 3 bits of mantissa.
    pub sigma: u8,
}

/// Metres of a unit of place.
const PLACE_M: f32 = 1e-5;
/// Bits of the mantissas of conductances (S) and standard errors (m), rounded by 2^-12 and 2^-4 at most.
const CONDUCTANCE: u32 = 11;
const SIGMA: u32 = 3;

impl ContactCode {
    /// Of a contact at a place (m), of a conductance (S) and a standard error of the place (m). What is beyond the codes' ranges is at their ends: places
    /// at 0.327 m, the others at 4.
    pub fn new(id: u8, at_m: [f32; 2], conductance_s: f32, sigma_m: f32) -> Self {
        let units = |m: f32| {
            let half = if m < 0.0 { -0.5 } else { 0.5 };
            (m / PLACE_M + half) as i16
        };
        let [conductance, sigma] =
            [(conductance_s, CONDUCTANCE), (sigma_m, SIGMA)].map(|(value, bits)| code(value, bits));
        Self { id, at: at_m.map(units), conductance: conductance as u16, sigma: sigma as u8 }
    }

    /// Place, x and y (m).
    pub fn at_m(&self) -> [f32; 2] {
        self.at.map(|units| f32::from(units) * PLACE_M)
    }

    /// Conductance (S).
    pub fn conductance_s(&self) -> f32 {
        value(self.conductance.into(), CONDUCTANCE)
    }

    /// Standard error of the place (m); `None` if the readings do not determine it.
    pub fn sigma_m(&self) -> Option<f32> {
        (self.sigma < u8::MAX).then(|| value(self.sigma.into(), SIGMA))
    }

    fn to_bytes(self) -> [u8; CONTACT_BYTES] {
        let ([x0, x1], [y0, y1]) = (self.at[0].to_le_bytes(), self.at[1].to_le_bytes());
        let [c0, c1] = self.conductance.to_le_bytes();
        [self.id, x0, x1, y0, y1, c0, c1, self.sigma]
    }

    fn from_bytes([id, x0, x1, y0, y1, c0, c1, sigma]: [u8; CONTACT_BYTES]) -> Self {
        let at = [[x0, x1], [y0, y1]].map(i16::from_le_bytes);
        Self { id, at, conductance: u16::from_le_bytes([c0, c1]), sigma }
    }
}

/// Exponent that codes begin with: 2^-30 is 1e-9.
const LEAST_EXPONENT: u32 = 127 - 30;
/// Exponents of codes: up to 2^1.
const EXPONENTS: u32 = 32;

/// Code of a number: exponent and mantissa of the `f32`, rounded to so many bits. 0 is 2^-30 or less, or no number; the last 4 or more.
fn code(value: f32, mantissa: u32) -> u32 {
    let shift = f32::MANTISSA_DIGITS - 1 - mantissa;
    let last = (EXPONENTS << mantissa) - 1;
    if value.is_nan() || value <= 0.0 {
        return 0;
    }
    let rounded = (value.to_bits() + (1 << (shift - 1))) >> shift;
    rounded.saturating_sub(LEAST_EXPONENT << mantissa).min(last)
}

/// The number of a code.
fn value(code: u32, mantissa: u32) -> f32 {
    let shift = f32::MANTISSA_DIGITS - 1 - mantissa;
    f32::from_bits((code + (LEAST_EXPONENT << mantissa)) << shift)
}

impl Contacts {
    /// Bytes of the body.
    pub(crate) fn byte_count(&self) -> usize {
        HEAD_BYTES + CONTACT_BYTES * self.found.len()
    }

    /// Writes the body, which has just so many bytes.
    pub(crate) fn write(&self, body: &mut [u8]) {
        let (head, contacts) = body.split_at_mut(HEAD_BYTES);
        head.copy_from_slice(&self.head.to_bytes(0));
        head[HEAD_BYTES - 1] = self.flags.0 & !COUNT | self.found.len() as u8;
        let places = contacts.as_chunks_mut().0;
        places.iter_mut().zip(&self.found).for_each(|(place, contact)| *place = contact.to_bytes());
    }

    /// Reads a body; `None` if it is none.
    pub(crate) fn read(body: &[u8]) -> Option<Self> {
        let (head, contacts) = body.split_first_chunk::<HEAD_BYTES>()?;
        let last = head[HEAD_BYTES - 1];
        let (contacts, rest) = contacts.as_chunks();
        if !rest.is_empty() || contacts.len() != usize::from(last & COUNT) {
            return None;
        }
        let (head, _) = FrameHead::from_bytes(*head);
        let found: Vec<_, MAX_CONTACTS> = contacts.iter().map(|bytes| ContactCode::from_bytes(*bytes)).collect();
        let head = FrameHead { fraction_bits: 0, ..head };
        found.iter().all(|contact| contact.id > 0).then_some(Self { head, flags: ContactFlags(last & !COUNT), found })
    }
}

/// A piece of the table that a board is to find contacts by. The first one begins at 0, each other where the one before ended; the table says itself where it
/// ends. One without bytes only asks for the [state](TableState).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TablePiece {
    /// Where in the table it begins (bytes).
    pub at: u32,
    /// Its bytes.
    #[serde(deserialize_with = "coding::list")]
    pub bytes: Vec<u8, MAX_PIECE>,
}

/// What a board has of a table: comes just before the Hello that answers a [piece](TablePiece).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TableState {
    /// Tag of the command.
    pub answers: u8,
    /// Longest table that it can keep (bytes); 0 if it finds no contacts.
    pub room: u32,
    /// Bytes that it has of the table under way, or of the one that it uses.
    pub held: u32,
    /// The table that it can use.
    pub usable: Option<TableId>,
}

/// Which table it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TableId {
    /// The same for all tables of a layout of electrodes.
    pub layout: u32,
    /// Its checksum: its last four bytes.
    pub checksum: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_as_near_as_the_codes_say() {
        for (mantissa, share) in [(CONDUCTANCE, 1.0 / 4096.0), (SIGMA, 1.0 / 16.0)] {
            let mut number = 1.1e-9_f32;
            while number < 3.7 {
                let back = value(code(number, mantissa), mantissa);
                assert!((back / number - 1.0).abs() <= share * 1.0001, "{number} came back as {back}");
                number *= 1.037;
            }
            let last = (EXPONENTS << mantissa) - 1;
            let ends = [0.0, -1.0, f32::NAN, 1e-12, 5.0, f32::INFINITY].map(|number| code(number, mantissa));
            assert_eq!(ends, [0, 0, 0, 0, last, last]);
        }
    }

    #[test]
    fn places_are_rounded_to_the_nearest_and_held_in_range() {
        let contact = ContactCode::new(7, [0.0123456, -0.02], 2e-4, f32::INFINITY);
        assert_eq!((contact.id, contact.at, contact.sigma_m()), (7, [1235, -2000], None));
        assert!(contact.at_m().iter().zip([0.01235, -0.02]).all(|(back_m, at_m)| (back_m - at_m).abs() < 1e-7));
        assert!((contact.conductance_s() / 2e-4 - 1.0).abs() < 3e-4);
        let far = ContactCode::new(0, [1.0, f32::NAN], 0.0, 1e-4);
        assert_eq!(far.at, [i16::MAX, 0]);
        assert!(far.sigma_m().is_some_and(|sigma_m| (sigma_m / 1e-4 - 1.0).abs() < 0.07));
    }
}
