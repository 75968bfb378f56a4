//! A clock without end, of a counter that begins again.

/// Microseconds of a counter of 32 bits, which is looked at once a round at least (71 minutes).
#[derive(Debug, Default)]
pub struct Clock {
    last_us: u32,
    /// Microseconds of whole rounds (us).
    rounds_us: u64,
}

impl Clock {
    /// Time since the counter was started (us), which counts `round_us` before it begins again and stands at `counter_us`.
    pub fn now_us(&mut self, counter_us: u32, round_us: u32) -> u64 {
        if counter_us < self.last_us {
            self.rounds_us += u64::from(round_us);
        }
        self.last_us = counter_us;
        self.rounds_us + u64::from(counter_us)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_goes_on_where_the_counter_begins_again() {
        let (mut clock, round_us) = (Clock::default(), 1000);
        for time_us in (0..10_000u64).step_by(333) {
            assert_eq!(clock.now_us((time_us % 1000) as u32, round_us), time_us);
            assert_eq!(clock.now_us((time_us % 1000) as u32, round_us), time_us, "asked twice");
        }
    }
}
