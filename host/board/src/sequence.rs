//! Sequence numbers and board times, unwrapped.

use tactomo_protocol::FrameHead;

/// Where a frame stands among those before it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// Number of the scan, unwrapped.
    pub sequence: u64,
    /// Board time in the middle of the scan, unwrapped, in microseconds (us).
    pub time_us: u64,
    /// Scans missing since the frame before.
    pub dropped: u64,
}

/// Unwraps the 16 bits of a sequence number and the 32 bits of a board time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sequence {
    last: Option<Place>,
}

impl Sequence {
    /// The place of the next frame.
    ///
    /// A board that starts anew begins again at zero: where number or time runs backwards, counting starts again at this frame,
    /// and nothing is missing.
    pub fn place(&mut self, head: &FrameHead) -> Place {
        let place = self.last.and_then(|last| follow(last, head)).unwrap_or(Place {
            sequence: u64::from(head.sequence),
            time_us: u64::from(head.time_us),
            dropped: 0,
        });
        self.last = Some(place);
        place
    }

    /// Forgets the frames before, as when the board was unplugged.
    pub fn restart(&mut self) {
        self.last = None;
    }
}

/// The place after `last`, if `head` can be of a later scan since the same start.
fn follow(last: Place, head: &FrameHead) -> Option<Place> {
    let scans = head.sequence.wrapping_sub(last.sequence as u16);
    let elapsed_us = head.time_us.wrapping_sub(last.time_us as u32);
    // More than half the range ahead is behind. Two frames never bear the same number.
    let later = (1..=u16::MAX / 2).contains(&scans) && elapsed_us <= u32::MAX / 2;
    later.then(|| Place {
        sequence: last.sequence + u64::from(scans),
        time_us: last.time_us + u64::from(elapsed_us),
        dropped: u64::from(scans) - 1,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn head(sequence: u64, time_us: u64) -> FrameHead {
        FrameHead { sequence: sequence as u16, time_us: time_us as u32, ..FrameHead::default() }
    }

    proptest! {
        #[test]
        fn any_run_of_scans_is_unwrapped(
            first in 0u64..=0xffff,
            start_us in 0u64..=u64::from(u32::MAX),
            steps in prop::collection::vec((1u64..=0x7fff, 1u64..=u64::from(u32::MAX / 2)), 1..60),
        ) {
            let mut unwrapped = Sequence::default();
            let mut expected = unwrapped.place(&head(first, start_us));
            for (scans, elapsed_us) in steps {
                expected = Place {
                    sequence: expected.sequence + scans,
                    time_us: expected.time_us + elapsed_us,
                    dropped: scans - 1,
                };
                prop_assert_eq!(unwrapped.place(&head(expected.sequence, expected.time_us)), expected);
            }
        }
    }

    #[test]
    fn a_board_that_starts_anew_drops_nothing() {
        let mut unwrapped = Sequence::default();
        unwrapped.place(&head(40_000, 80_000_000));
        assert_eq!(unwrapped.place(&head(3, 9_000)), Place { sequence: 3, time_us: 9_000, dropped: 0 });
        assert_eq!(unwrapped.place(&head(5, 10_000)), Place { sequence: 5, time_us: 10_000, dropped: 1 });
        assert_eq!(unwrapped.place(&head(1, 12_000)).dropped, 0, "it started anew sooner than it had run before");
        unwrapped.restart();
        assert_eq!(unwrapped.place(&head(9, 20_000)).dropped, 0);
    }
}
