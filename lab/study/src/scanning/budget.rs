//! What an ESP32 can read and send in a second.

/// Bytes that a serial line of 921600 baud carries in a second: ten bits each.
const BYTES_PER_S: f64 = 92_160.0;
/// Time of a row (s): settling, a conversion, and the processor's work.
const SETTLE_S: f64 = 20e-6;
const CONVERSION_S: f64 = 10e-6;
const WORK_S: f64 = 26e-6;
/// Conversions one after the other in a row of 16: two converters work side by side, on 6 and 10 of its pins.
const SLOTS: usize = 10;
const PINS: usize = 16;
/// Bits of a reading on the wire as of coded frames of contacts that move (5.2 where nothing does), and bytes of a frame besides: head, age, number of
/// electrodes and rows, check and framing.
const BITS: usize = 6;
const BESIDES: usize = 8 + 1 + 2 + 7;

/// Times of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FrameTimes {
    /// From one row to the next (s).
    pub row_s: f64,
    /// From a frame's start to the next one's (s): the board reads a frame while it sends the one before, so the slower of both.
    pub period_s: f64,
    /// From its first row to the end of its last (s).
    pub scan_s: f64,
    /// From its start to its last byte (s).
    pub age_s: f64,
}

/// A frame of so many rows, of so many readings each; of as many rows as readings it is whole.
pub(super) fn frame(rows: usize, electrodes: usize) -> FrameTimes {
    let slots = (SLOTS * electrodes).div_ceil(PINS);
    let row_s = SETTLE_S + slots as f64 * CONVERSION_S + WORK_S;
    // The grounds, and a bit for each electrode that is read.
    let scope = if rows == electrodes { 0 } else { rows + electrodes.div_ceil(8) };
    let bytes = BESIDES + scope + (rows * BITS * electrodes).div_ceil(8);
    let (scan_s, wire_s) = (rows as f64 * row_s, bytes as f64 / BYTES_PER_S);
    FrameTimes { row_s, period_s: scan_s.max(wire_s), scan_s, age_s: scan_s + wire_s }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wire_carries_every_whole_frame_and_is_slower_than_the_scan_of_few_rows() {
        let per_s = [1, 2, 4, 16].map(|rows| (1.0 / frame(rows, 16).period_s).round());
        assert_eq!(per_s, [2793.0, 2003.0, 1280.0, 428.0]);
        let whole = frame(16, 16);
        assert!((whole.row_s - 146e-6).abs() < 1e-12 && (whole.age_s - 4.615e-3).abs() < 1e-5);
    }
}
