//! A touch screen for an operating system's own driver: what a USB HID digitizer says of itself, and its reports.
//!
//! Three contacts at most, each in a collection of its own, all in one report: what Microsoft calls parallel mode ("Selecting packet reporting modes in
//! multi-touch devices"). Nothing here knows of USB: a report is bytes for an interrupt endpoint, a descriptor is bytes that a host reads.

mod descriptor;
mod fingers;

use tactomo_protocol::contacts::MAX_CONTACTS;

pub use self::descriptor::{DESCRIPTOR_BYTES, descriptor};
pub(crate) use self::fingers::Fingers;

/// First byte of a [`Report`]: the descriptor's number of this kind of report.
pub const TOUCH_ID: u8 = 1;
/// Number of the feature report that tells how many contacts there can be.
pub const COUNT_ID: u8 = 2;
/// That report, as a host asks for it: its number, and the count.
pub const COUNT_REPORT: [u8; 2] = [COUNT_ID, MAX_CONTACTS as u8];

/// Bytes of a finger in a report.
const FINGER_BYTES: usize = 6;
/// Bytes of a [`Report`].
pub const REPORT_BYTES: usize = 1 + MAX_CONTACTS * FINGER_BYTES + 3;
/// Largest place along an axis: the right and the lower edge.
pub const LAST_PLACE: u16 = i16::MAX as u16;

/// What touches, as it is sent:
///
/// | bytes | what |
/// |---|---|
/// | 1 | [`TOUCH_ID`] |
/// | 6 for each of three fingers | 1 while it touches, 0 when it has gone; number; x from the left edge, y from the upper one, 0 to [`LAST_PLACE`] |
/// | 2 | time of the scan, in units of 100 us |
/// | 1 | how many of the fingers, from the first, say something |
pub type Report = [u8; REPORT_BYTES];

/// Where a digitizer's reports go.
pub trait ReportSink {
    /// The detector is so large, x and y (m): what a host is to read of it in the [`descriptor`] from now on.
    fn set_size(&mut self, size_m: [f32; 2]);

    /// Takes a report, if the one before has gone; returns whether it did. Never waits.
    fn send(&mut self, report: &Report) -> bool;
}
