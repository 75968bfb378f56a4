//! When a line damages too much at its rate.

use std::time::{Duration, Instant};

/// Damaged packets within a second from which on it is too much: bytes that the host itself did not read in time cost one or two.
const DAMAGED_A_SECOND: u64 = 8;
/// Seconds with damage among the last ten from which on it is too much. With one flipped bit in 1e9, a second at 3 Mbaud has damage once in 330, and three
/// of ten have it by chance once in a month; with one in 1e7, a second has it once in four, and three of ten have it in the first minute.
const ERRORED_SECONDS: u32 = 3;
/// The nine seconds before the one under way, a bit each.
const BEFORE: u16 = (1 << 9) - 1;

/// Damage of the last ten seconds.
#[derive(Debug, Default)]
pub(super) struct Damage {
    total: u64,
    /// When the second under way began.
    began: Option<Instant>,
    in_second: u64,
    /// Which of the seconds before had damage, the last one in the lowest bit.
    before: u16,
}

impl Damage {
    /// Takes note of the number of damaged packets since the link was opened, of which the newest are the line's fault or not; returns whether those of
    /// the line are too many. Then it begins anew.
    pub(super) fn is_too_much(&mut self, total: u64, counts: bool, now: Instant) -> bool {
        let newly = total.saturating_sub(self.total);
        if !counts {
            *self = Self { total, ..Self::default() };
            return false;
        }
        self.total = total;
        self.roll(now);
        self.in_second += newly;
        let errored = self.before.count_ones() + u32::from(self.in_second > 0);
        let is_too_much = self.in_second >= DAMAGED_A_SECOND || errored >= ERRORED_SECONDS;
        if is_too_much {
            *self = Self { total, ..Self::default() };
        }
        is_too_much
    }

    /// Ends the second under way where it is over.
    fn roll(&mut self, now: Instant) {
        let began = *self.began.get_or_insert(now);
        let seconds = now.saturating_duration_since(began).as_secs() as u32;
        if seconds > 0 {
            let with_this = self.before << 1 | u16::from(self.in_second > 0);
            self.before = with_this.checked_shl(seconds - 1).unwrap_or(0) & BEFORE;
            self.in_second = 0;
            self.began = Some(began + Duration::from_secs(u64::from(seconds)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether damage at these times (s) is too much.
    fn too_much(times_s: &[f64]) -> bool {
        let (mut damage, begin) = (Damage::default(), Instant::now());
        assert!(!damage.is_too_much(0, true, begin));
        let told: Vec<bool> = (1..)
            .zip(times_s)
            .map(|(total, at_s)| damage.is_too_much(total, true, begin + Duration::from_secs_f64(*at_s)))
            .collect();
        told.contains(&true)
    }

    #[test]
    fn a_flurry_or_three_bad_seconds_of_ten_are_too_much_and_less_is_not() {
        assert!(too_much(&[0.1; 8]));
        assert!(!too_much(&[0.1; 7]));
        assert!(too_much(&[0.1, 4.2, 9.3]));
        assert!(!too_much(&[0.1, 4.2, 10.3]), "the first is out of the ten seconds");
        assert!(!too_much(&[0.1, 0.2, 0.3, 7.0, 7.1]), "two seconds");
        assert!(!too_much(&[0.1, 100.0, 200.0, 300.0]));
    }

    #[test]
    fn what_does_not_count_is_forgotten() {
        let (mut damage, now) = (Damage::default(), Instant::now());
        assert!(!damage.is_too_much(100, false, now));
        assert!(!damage.is_too_much(107, true, now));
        assert!(damage.is_too_much(108, true, now));
    }
}
