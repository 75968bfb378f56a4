//! Whether rows as they come tell what touches, or whole frames have to.
//!
//! Rows move contacts that were found. Where there are others, they are searched in the latest of all rows, which were read over 25 ms: of a hand
//! that moves these contradict each other, and the search finds what fits none of them. Then frames that were read at once are needed.

use crate::solve::fit::policy;

/// How long rows have not fitted of late (s).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Doubt(f64);

impl Doubt {
    /// Rows that come `elapsed_s` (s) after those before fit what is followed, or do not.
    pub fn rows(&mut self, fit: bool, elapsed_s: f64) {
        let change_s = if fit { -elapsed_s } else { policy::UNFIT_WEIGHT * elapsed_s };
        self.0 = (self.0 + change_s).clamp(0.0, 2.0 * policy::UNFIT_S);
    }

    /// A whole frame fits, or does not.
    pub fn whole(&mut self, fits: bool) {
        self.0 = if fits { 0.0 } else { policy::UNFIT_S };
    }

    /// A search has found fewer or more contacts than were followed: that did not show in rows, or not soon.
    pub fn recounted(&mut self) {
        self.whole(false);
    }

    /// Whether whole frames are needed.
    pub fn needs_whole(self) -> bool {
        self.0 >= policy::UNFIT_S
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_do_not_fit_for_a_while_ask_for_whole_frames_until_these_fit() {
        let mut doubt = Doubt::default();
        (0..50).for_each(|_| doubt.rows(false, 1e-3));
        (0..100).for_each(|_| doubt.rows(true, 1e-3));
        assert!(!doubt.needs_whole());
        (0..300).for_each(|step| doubt.rows(step % 4 == 0, 1e-3));
        assert!(doubt.needs_whole());
        doubt.whole(false);
        assert!(doubt.needs_whole());
        doubt.whole(true);
        assert!(!doubt.needs_whole());
        doubt.recounted();
        assert!(doubt.needs_whole(), "a number that changes is not left to rows");
    }
}
