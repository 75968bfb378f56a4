//! The frame-rate cap.

/// Tells when the next frame may begin.
#[derive(Debug, Default)]
pub(crate) struct Pace {
    next_us: u64,
}

impl Pace {
    /// Board time (us) from which on the next frame may begin.
    pub(crate) fn next_us(&self) -> u64 {
        self.next_us
    }

    /// Notes that a frame begins at `now_us` under a cap of `max_frames_per_s` (0: none). The next one is due a period after
    /// this one was, so that the rate does not drift; after a late one the count starts anew, so that nothing is caught up.
    pub(crate) fn begin(&mut self, now_us: u64, max_frames_per_s: u16) {
        let period_us = match u64::from(max_frames_per_s) {
            0 => return self.next_us = now_us,
            cap => 1_000_000u64.div_ceil(cap),
        };
        let late = now_us.saturating_sub(self.next_us) >= period_us;
        self.next_us = if late { now_us } else { self.next_us } + period_us;
    }

    /// Lets the next frame begin at once.
    pub(crate) fn reset(&mut self, now_us: u64) {
        self.next_us = now_us;
    }
}
