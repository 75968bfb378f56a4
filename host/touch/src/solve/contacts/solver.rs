//! Contacts from frame to frame: followed, and searched where following does not explain the readings.

use std::sync::Arc;

use super::search::{WORSE, WORTH_FIRST, score};
use super::{ContactFinder, ContactSettings, Explanation, Found, Target};
use crate::solve::evidence::Evidence;
use crate::solve::follow::{Followed, Follower, Lead, Parts, Searcher, follow_and_search};
use crate::solve::track::Tracker;
use crate::solve::{FoundContact, Problem, Solution, SolveError, Solver};
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;

/// Weight of the newest frame in the running mean of what is left.
const NEWEST: f64 = 0.1;
/// Rise of that mean over what the last search left, or over what noise alone leaves, that asks for a new search: many frames show
/// what one frame's noise hides.
const RISE: f64 = 0.12;

/// Fits contacts.
pub struct Contacts {
    follower: ContactFollower,
}

/// Follows contacts from frame to frame.
pub(in crate::solve) struct ContactFollower {
    finder: Arc<ContactFinder>,
    last: Option<Explanation>,
    /// Sum of squares that the last search left, and its running mean since.
    searched: f64,
    mean: f64,
    /// Whether what is followed could not be brought to the newest frame.
    is_stale: bool,
    tracker: Tracker,
}

/// Searches contacts.
pub(in crate::solve) struct ContactSearcher {
    finder: Arc<ContactFinder>,
}

impl Contacts {
    /// Makes it ready for a problem.
    ///
    /// # Errors
    /// [`ForwardError::Detector`] if the model has no spots.
    pub fn new(problem: &Problem, settings: ContactSettings) -> Result<Self, ForwardError> {
        Ok(Self { follower: ContactFollower::new(Arc::new(ContactFinder::new(problem, settings)?)) })
    }

    /// Mean square of what one contact leaves of readings, in what noise and model error make; `None` if there is none.
    pub fn left_by_one(&self, readings: &Readings) -> Option<f64> {
        self.follower.finder.left_by_one(readings)
    }

    #[cfg(test)]
    pub(super) fn finder(&self) -> &ContactFinder {
        &self.follower.finder
    }
}

impl ContactFollower {
    /// Follows nothing yet.
    pub fn new(finder: Arc<ContactFinder>) -> Self {
        let tracker = Tracker::new(finder.spacing_m);
        Self { finder, last: None, searched: 0.0, mean: 0.0, is_stale: false, tracker }
    }

    /// What finds the contacts.
    pub fn finder(&self) -> &Arc<ContactFinder> {
        &self.finder
    }

    /// What is followed.
    pub fn found(&self) -> Option<Found> {
        self.last.clone().map(Found)
    }

    /// Brings the contacts to the next frame; whether they have to be searched.
    pub fn follow(&mut self, target: &Target) -> bool {
        let Some(last) = self.last.take() else { return self.finder.stands_out(target) };
        let Some(moved) = self.finder.follow(last.clone(), target) else {
            (self.last, self.is_stale) = (Some(last), true);
            return true;
        };
        let is_weak = self.finder.is_weak(&moved);
        let fewer = if is_weak { self.finder.without_weak(&moved, target) } else { None };
        let is_weak = is_weak && fewer.is_none();
        let found = fewer.unwrap_or(moved);
        self.is_stale = false;
        self.mean += NEWEST * (found.cost() - self.mean);
        let has_risen = self.mean > (1.0 + RISE) * self.searched.max(self.finder.freedom(&found, target));
        let search = is_weak || found.cost() > self.enough(target) || has_risen;
        if is_weak && !self.finder.stands_out(target) {
            return false;
        }
        self.last = Some(found);
        search
    }

    /// Takes what a search has found, if it explains this frame better than what is followed; whether the search has to be repeated, because
    /// what it has found does not explain this frame as well as its own.
    pub fn adopt(&mut self, found: Option<Found>, target: &Target) -> bool {
        let left = found.as_ref().map_or(0.0, |Found(found)| found.cost());
        let caught_up = found.and_then(|Found(found)| self.finder.catch_up(found, target));
        let nothing = target.cost(&vec![0.0; target.volts.len()]) - WORTH_FIRST;
        let score_of = |found: &Option<Explanation>| found.as_ref().map_or(nothing, score);
        if self.is_stale || score_of(&caught_up) <= score_of(&self.last) {
            (self.last, self.is_stale) = (caught_up, false);
        }
        let Some(last) = &self.last else { return self.finder.stands_out(target) };
        (self.searched, self.mean) = (left.max(self.finder.freedom(last, target)), last.cost());
        last.cost() > self.enough(target)
    }

    /// Sum of squares up to which what is followed explains a frame.
    fn enough(&self, target: &Target) -> f64 {
        (WORSE * self.searched).max(target.count() as f64)
    }

    /// What is left of the frame that was followed last, and what that takes; of nothing, all of it.
    pub fn evidence(&self, target: &Target) -> Evidence {
        let nothing = || Evidence::of(target.cost(&vec![0.0; target.volts.len()]), 0);
        self.last.as_ref().map_or_else(nothing, Explanation::evidence)
    }

    /// Numbers contacts on from those that were found before.
    pub fn inherit(&mut self, before: &[FoundContact]) {
        self.tracker.inherit(before);
    }

    /// What is followed, as a solution, with the numbers that contacts keep.
    pub fn solution(&mut self, target: &Target) -> Solution {
        let mut solution =
            self.last.as_ref().map_or_else(|| self.finder.nothing(target), |found| self.finder.solution(found, target));
        solution.flags.unfinished |= self.is_stale;
        self.tracker.follow(&mut solution.contacts);
        solution
    }

    /// Follows nothing for a time, and keeps the numbers of contacts.
    pub fn let_go(&mut self) {
        (self.last, self.searched, self.mean, self.is_stale) = (None, 0.0, 0.0, false);
    }

    /// Forgets all.
    pub fn reset(&mut self) {
        self.let_go();
        self.tracker.reset();
    }
}

impl Follower for ContactFollower {
    fn follow(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        let target = self.finder.target(readings)?;
        let search = ContactFollower::follow(self, &target);
        Ok(Followed { solution: self.solution(&target), search })
    }

    fn adopt(&mut self, lead: Lead, readings: &Readings) -> Result<Followed, SolveError> {
        let target = self.finder.target(readings)?;
        let search = ContactFollower::adopt(self, lead.into_contacts(), &target);
        Ok(Followed { solution: self.solution(&target), search })
    }

    fn lead(&self) -> Lead {
        Lead::of_contacts(self.found())
    }

    fn inherit(&mut self, before: &[FoundContact]) {
        ContactFollower::inherit(self, before);
    }

    fn reset(&mut self) {
        ContactFollower::reset(self);
    }
}

impl ContactSearcher {
    /// Searches with what a follower follows with.
    pub fn new(finder: Arc<ContactFinder>) -> Self {
        Self { finder }
    }

    /// The contacts that explain the readings, and the solution that they are; `None` if nothing touches. Better ones on the way there go
    /// to `found`.
    pub fn contacts(
        &self,
        from: Option<Found>,
        readings: &Readings,
        found: &mut dyn FnMut(Lead),
    ) -> Result<Option<(Found, Solution)>, SolveError> {
        let target = self.finder.target(readings)?;
        let mut better = |better: &Explanation| found(Lead::of_contacts(Some(Found(better.clone()))));
        let found = self.finder.search(from.map(|Found(from)| from).as_ref(), &target, &mut better);
        Ok(found.map(|found| {
            let solution = self.finder.solution(&found, &target);
            (Found(found), solution)
        }))
    }
}

impl Searcher for ContactSearcher {
    fn search(&mut self, from: Lead, readings: &Readings, found: &mut dyn FnMut(Lead)) -> Result<Lead, SolveError> {
        Ok(Lead::of_contacts(self.contacts(from.into_contacts(), readings, found)?.map(|(found, _)| found)))
    }
}

impl Solver for Contacts {
    fn name(&self) -> &'static str {
        "contacts"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let mut searcher = ContactSearcher::new(Arc::clone(&self.follower.finder));
        follow_and_search(&mut self.follower, &mut searcher, readings)
    }

    fn reset(&mut self) {
        self.follower.reset();
    }

    fn split(self: Box<Self>) -> Parts {
        let searcher = ContactSearcher::new(Arc::clone(&self.follower.finder));
        Parts { follower: Box::new(self.follower), searcher: Some(Box::new(searcher)) }
    }
}
