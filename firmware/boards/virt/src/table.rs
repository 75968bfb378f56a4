//! The frames that the emulated board reads instead of an ADC, and that its test on the host expects, bit for bit.

/// Electrodes of the board.
pub const ELECTRODES: usize = 16;
/// Bits of a reading in the table.
pub const ADC_BITS: u8 = 12;
/// Largest reading.
pub const FULL_SCALE: u16 = (1 << ADC_BITS) - 1;
/// Frames in the table: all zeros, all full scale, then one for each width of the largest reading from 1 to 12 bits.
pub const FRAMES: usize = 2 + ADC_BITS as usize;

/// Reading of electrode `electrode` while `ground` is grounded, in frame `frame` of the table.
pub const fn reading(frame: usize, ground: usize, electrode: usize) -> u16 {
    match frame {
        0 => 0,
        1 => FULL_SCALE,
        _ => scattered(frame, ground, electrode),
    }
}

/// Readings all over `0..2^(frame - 1)`, the largest of them included.
const fn scattered(frame: usize, ground: usize, electrode: usize) -> u16 {
    let largest = (1 << (frame - 1)) - 1;
    if ground == frame && electrode == 1 {
        return largest;
    }
    let place = (frame * ELECTRODES + ground) * ELECTRODES + electrode;
    // Knuth's multiplicative hash: neighbours fall far apart.
    ((place as u32).wrapping_mul(2_654_435_761) >> 20) as u16 & largest
}
