//! Memory below the stack that nobody writes to, painted and looked at again and again: for chips that can stop a write to a few bytes only, over which a function's frame
//! steps. It tells of an overflow after it.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// What the memory is painted with: no small number and no address.
const PAINT: u32 = 0xA55A_C33C;
/// Words that are looked at in one look: before each conversion, so that 32 kB take two whole frames.
const WORDS_A_LOOK: usize = 16;

/// Painted memory.
#[derive(Debug)]
pub struct Paint<'a> {
    words: &'a [AtomicU32],
    next: usize,
}

impl<'a> Paint<'a> {
    /// Paints it.
    pub fn new(words: &'a [AtomicU32]) -> Self {
        words.iter().for_each(|word| word.store(PAINT, Relaxed));
        Self { words, next: 0 }
    }

    /// Looks at a few words more, and after the last ones at the first again; returns whether they are as they were painted.
    pub fn is_whole(&mut self) -> bool {
        let rest = self.words.get(self.next..).unwrap_or_default();
        let looked_at = rest.get(..WORDS_A_LOOK).unwrap_or(rest);
        self.next = if looked_at.len() < rest.len() { self.next + looked_at.len() } else { 0 };
        looked_at.iter().all(|word| word.load(Relaxed) == PAINT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whichever word is written to, by anything: in as many looks as it takes to see all.
    #[test]
    fn a_word_that_is_written_is_seen_before_all_were_looked_at_twice() {
        for count in [0, 1, 15, 16, 17, 64, 100] {
            let words: [AtomicU32; 100] = [const { AtomicU32::new(0) }; 100];
            let words = &words[..count];
            for written in 0..count {
                let mut paint = Paint::new(words);
                let looks = count.div_ceil(WORDS_A_LOOK);
                assert!((0..written + 3 * looks).all(|_| paint.is_whole()), "nothing is written yet");
                words[written].fetch_xor(1 << (written % 32), Relaxed);
                assert_eq!((0..looks).filter(|_| !paint.is_whole()).count(), 1, "{written} of {count}");
            }
            assert!(count > 0 || Paint::new(words).is_whole());
        }
    }
}
