//! Contacts followed in the mean of the frames that stand still.

use super::{ContactTracker, FrameHypothesis};
use crate::solve::answer::{FoundContact, SolveError};
use crate::solve::before::adaptive_mean::AdaptiveMean;
use crate::solve::fit::target::Target;
use crate::solve::solver::{Followed, Hypothesis, Tracker};
use tactomo_physics::readings::Readings;

/// Follows contacts in the mean of the frames that stand still.
pub(super) struct FrameTracker {
    pub average: AdaptiveMean,
    pub contacts: ContactTracker,
}

impl FrameTracker {
    fn target(&self, readings: &Readings) -> Result<Target, SolveError> {
        self.contacts.finder.target_of(&self.average.mean_or(readings), self.contacts.error())
    }
}

impl Tracker for FrameTracker {
    fn follow(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        self.contacts.finder.check(readings)?;
        self.average.add_beside(readings, self.contacts.slopes_v());
        let target = self.target(readings)?;
        let search = self.contacts.follow(&target);
        Ok(Followed { solution: self.contacts.solution(&target), search })
    }

    fn follow_rows(&mut self, rows: &Readings, _latest: &Readings, elapsed_s: f64) -> Result<Followed, SolveError> {
        self.average.reset();
        self.contacts.follow_rows(rows, elapsed_s)
    }

    fn adopt(&mut self, hypothesis: Hypothesis, readings: &Readings) -> Result<Followed, SolveError> {
        let hypothesis: FrameHypothesis = hypothesis.known();
        self.contacts.finder.check(readings)?;
        match self.contacts.latest() {
            Some(latest) => self.average.add(&latest.readings),
            None => self.average.add_beside(readings, self.contacts.slopes_v()),
        }
        self.contacts.searched_in(hypothesis.mean.as_ref());
        let error = hypothesis.contacts.as_ref().and_then(|found| found.error()).or(self.contacts.error());
        let target = self.contacts.finder.target_of(&self.average.mean_or(readings), error)?;
        let frames = hypothesis.mean.as_ref().map_or(1, |mean| mean.frames);
        let search = self.contacts.adopt(hypothesis.contacts.map(|found| *found), frames, &target);
        Ok(Followed { solution: self.contacts.solution(&target), search })
    }

    fn telling_grounds(&self, count: usize) -> Option<Vec<usize>> {
        self.contacts.telling_grounds(count)
    }

    fn has_news(&self) -> bool {
        self.contacts.has_news()
    }

    fn hypothesis(&self) -> Hypothesis {
        let mean = self.contacts.latest().or_else(|| self.average.mean());
        Hypothesis::of(FrameHypothesis::new(self.contacts.found(), mean))
    }

    fn inherit(&mut self, before: &[FoundContact]) {
        self.contacts.inherit(before);
    }

    fn reset(&mut self) {
        self.average.reset();
        self.contacts.reset();
    }
}
