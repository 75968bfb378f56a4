//! What a host reads to understand reports: "Device Class Definition for HID 1.11", section 6.2.2, with the usages of "HID Usage Tables 1.5", sections 4
//! (generic desktop) and 16 (digitizers).
//!
//! It has what Windows asks of a touch screen: contact identifier, x, y and tip switch of each contact, contact count and scan time of each report, contact
//! count maximum as a feature ("Touchscreen required HID top-level collections"). Pressure is left out, as a board tells no newtons.

use core::iter;

use tactomo_protocol::contacts::MAX_CONTACTS;

use super::{COUNT_ID, LAST_PLACE, TOUCH_ID};

/// Bytes of a [`descriptor`].
pub const DESCRIPTOR_BYTES: usize = HEAD.len() + MAX_CONTACTS * FINGER.len() + TAIL.len();

const LAST: [u8; 2] = LAST_PLACE.to_le_bytes();

#[rustfmt::skip]
const HEAD: [u8; 14] = [
    0x05, 0x0D, // usage page: digitizers
    0x09, 0x04, // usage: touch screen
    0xA1, 0x01, // collection: application
    0x85, TOUCH_ID, // report number
    0x15, 0x00, 0x35, 0x00, // all from 0
    0x95, 0x01, // one field of each
];

#[rustfmt::skip]
const FINGER: [u8; 63] = [
    0x05, 0x0D, // usage page: digitizers
    0x09, 0x22, // usage: finger
    0xA1, 0x02, // collection: logical
    0x25, 0x01, // to 1
    0x75, 0x01, // 1 bit
    0x09, 0x42, 0x81, 0x02, // tip switch
    0x75, 0x07, 0x81, 0x03, // 7 bits that say nothing
    0x26, 0xFF, 0x00, // to 255
    0x75, 0x08, // 8 bits
    0x09, 0x51, 0x81, 0x02, // contact identifier
    0x05, 0x01, // usage page: generic desktop
    0x26, LAST[0], LAST[1], // to the last place
    0x75, 0x10, // 16 bits
    0x55, 0x0D, 0x65, 0x11, // in units of 10^-3 cm
    0x47, 0, 0, 0, 0, // to the width
    0x09, 0x30, 0x81, 0x02, // x
    0x47, 0, 0, 0, 0, // to the height
    0x09, 0x31, 0x81, 0x02, // y
    0x45, 0x00, 0x55, 0x00, 0x65, 0x00, // no size and no unit any more
    0xC0, // end of the collection
];
/// Where width and height stand in it.
const SIZES_AT: [usize; 2] = [39, 48];

#[rustfmt::skip]
const TAIL: [u8; 44] = [
    0x05, 0x0D, // usage page: digitizers
    0x27, 0xFF, 0xFF, 0x00, 0x00, // to 65535
    0x47, 0xFF, 0xFF, 0x00, 0x00, // which are so many
    0x55, 0x0C, 0x66, 0x01, 0x10, // units of 10^-4 s
    0x75, 0x10, // 16 bits
    0x09, 0x56, 0x81, 0x02, // scan time
    0x45, 0x00, 0x55, 0x00, 0x65, 0x00, // no unit any more
    0x25, MAX_CONTACTS as u8, // to as many as there can be
    0x75, 0x08, // 8 bits
    0x09, 0x54, 0x81, 0x02, // contact count
    0x85, COUNT_ID, // report number
    0x09, 0x55, 0xB1, 0x02, // contact count maximum
    0xC0, // end of the collection
];

/// What a host is to read, of a detector of this size, x and y (m).
pub fn descriptor(size_m: [f32; 2]) -> [u8; DESCRIPTOR_BYTES] {
    let mut finger = FINGER;
    for (at, size_m) in SIZES_AT.into_iter().zip(size_m) {
        let hundredths_mm = (size_m * 1e5 + 0.5) as i32;
        finger[at..at + 4].copy_from_slice(&hundredths_mm.to_le_bytes());
    }
    let mut bytes = [0; DESCRIPTOR_BYTES];
    let parts = iter::once(&HEAD[..]).chain(iter::repeat_n(&finger[..], MAX_CONTACTS)).chain(iter::once(&TAIL[..]));
    bytes.iter_mut().zip(parts.flatten()).for_each(|(byte, part)| *byte = *part);
    bytes
}
