//! Bytes of log that wait, of which a frame goes in whole or not at all, so that what is left decodes.

use heapless::Deque;

/// Bytes of log that can wait.
const BYTES: usize = 512;

/// Bytes that wait, and the frame being written behind them.
#[derive(Debug)]
pub(crate) struct LogQueue {
    bytes: Deque<u8, BYTES>,
    /// Bytes of whole frames.
    whole: usize,
    /// Whether the frame under way did not fit.
    overflowed: bool,
}

impl LogQueue {
    pub(crate) const fn new() -> Self {
        Self { bytes: Deque::new(), whole: 0, overflowed: false }
    }

    /// Begins a frame.
    pub(crate) fn begin(&mut self) {
        (self.whole, self.overflowed) = (self.bytes.len(), false);
    }

    /// Puts a part of the frame behind what is there.
    pub(crate) fn put(&mut self, part: &[u8]) {
        self.overflowed |= part.iter().any(|byte| self.bytes.push_back(*byte).is_err());
    }

    /// Ends the frame; one that did not fit is taken out again.
    pub(crate) fn end(&mut self) {
        if self.overflowed {
            self.bytes.truncate(self.whole);
        }
    }

    /// Moves bytes into `buffer`, as far as it fits; returns how many. Not to be called within a frame.
    pub(crate) fn pull(&mut self, buffer: &mut [u8]) -> usize {
        let count = buffer.len().min(self.bytes.len());
        buffer.iter_mut().zip(core::iter::from_fn(|| self.bytes.pop_front())).for_each(|(to, byte)| *to = byte);
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put_frame(queue: &mut LogQueue, byte: u8, length: usize) {
        queue.begin();
        (0..length).for_each(|_| queue.put(&[byte]));
        queue.end();
    }

    #[test]
    fn a_frame_that_does_not_fit_leaves_nothing_and_the_next_one_that_does_is_kept() {
        let mut queue = LogQueue::new();
        put_frame(&mut queue, 1, 500);
        put_frame(&mut queue, 2, 13);
        put_frame(&mut queue, 3, 12);
        put_frame(&mut queue, 4, 1);
        let mut buffer = [0; 600];
        assert_eq!(queue.pull(&mut buffer), 512);
        assert!(buffer[..500].iter().all(|byte| *byte == 1) && buffer[500..512].iter().all(|byte| *byte == 3));
        put_frame(&mut queue, 5, 512);
        assert_eq!((queue.pull(&mut buffer[..500]), queue.pull(&mut buffer)), (500, 12), "room is had again");
    }
}
