//! COBS in place: takes the zeros out of a packet, so that a zero on the wire ends a packet and nothing else.
//!
//! S. Cheshire, M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on Networking 7(2), 1999.

/// Longest run of bytes without a zero in one block.
const MAX_RUN: usize = 254;

/// Bytes by which `packet` bytes may grow, and by which [`stuff`] wants them to stand back from the start.
pub(crate) const fn overhead(packet: usize) -> usize {
    1 + packet / MAX_RUN
}

/// Stuffs the packet `wire[start..]` into the front of `wire`; returns its new length.
///
/// With `start` at least [`overhead`] of the packet's length, what is written never reaches what is still to be read.
pub(crate) fn stuff(wire: &mut [u8], start: usize) -> usize {
    let (mut read, mut written) = (start, 0);
    loop {
        let left = &wire[read..];
        let longest = &left[..left.len().min(MAX_RUN)];
        let run = longest.iter().position(|byte| *byte == 0).unwrap_or(longest.len());
        wire[written] = run as u8 + 1;
        wire.copy_within(read..read + run, written + 1);
        written += 1 + run;
        read += run;
        if read == wire.len() {
            return written;
        }
        // A shorter block stands for its run and the zero after it.
        read += usize::from(run < MAX_RUN);
    }
}

/// Undoes [`stuff`] in place; returns the packet's length, or `None` if a block runs over the end.
pub(crate) fn unstuff(wire: &mut [u8]) -> Option<usize> {
    let (mut read, mut written) = (0, 0);
    while let Some(&code) = wire.get(read) {
        let run = usize::from(code).checked_sub(1)?;
        let end = read + 1 + run;
        if end > wire.len() {
            return None;
        }
        wire.copy_within(read + 1..end, written);
        written += run;
        read = end;
        if run < MAX_RUN && read < wire.len() {
            wire[written] = 0;
            written += 1;
        }
    }
    Some(written)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    proptest! {
        /// Long runs, short runs and zeros, so that every kind of block and every end occurs; the `cobs` crate agrees.
        #[test]
        fn stuffing_agrees_with_an_independent_implementation(
            runs in prop::collection::vec((1u8.., prop_oneof![0..4usize, 250..260usize]), 0..5),
            open_end: bool,
        ) {
            let mut packet: Vec<u8> = runs.iter().flat_map(|&(byte, run)| [&[byte].repeat(run)[..], &[0]].concat()).collect();
            if open_end {
                packet.pop();
            }
            let start = overhead(packet.len());
            let mut wire = [&[0xAA].repeat(start)[..], &packet].concat();
            let length = stuff(&mut wire, start);
            wire.truncate(length);
            prop_assert_eq!(&wire, &cobs::encode_vec(&packet));
            let length = unstuff(&mut wire).unwrap();
            prop_assert_eq!(&wire[..length], &packet);
        }

        #[test]
        fn unstuffing_agrees_on_any_bytes(mut wire in prop::collection::vec(1..6u8, 1..40)) {
            let expected = cobs::decode_vec(&wire).ok();
            prop_assert_eq!(unstuff(&mut wire).map(|length| wire[..length].to_vec()), expected);
        }
    }

    #[test]
    fn an_empty_block_after_a_full_one_stands_for_nothing() {
        let full = [&[255][..], &[7; MAX_RUN]].concat();
        assert_eq!(unstuff(&mut full.clone()), Some(MAX_RUN));
        assert_eq!(unstuff(&mut [&full[..], &[1]].concat()), Some(MAX_RUN));
    }
}
