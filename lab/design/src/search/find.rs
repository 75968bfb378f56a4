//! The search: a sample of all, then the neighbours of the best, again and again.
//!
//! Pareto local search (Paquete, Chiarandini and Stuetzle, 2004): every candidate that no other beats in all wishes has its neighbours looked
//! at, and so have the few that meet the wishes best, until there is none left or enough was tried. That is done on coarse models of detectors as
//! described; the best, and those that none beats, are then rated in full, as built within their tolerances.

use std::collections::{HashMap, HashSet};
use std::sync::atomic::AtomicBool;

use tactomo_physics::detector::Detector;

use super::super::{DesignError, Progress};
use super::{Candidate, Rating, Space, Wishes};

/// Share of what is tried that is a sample of all.
const SAMPLED: f64 = 0.3;
/// Candidates whose neighbours are looked at in a round: the best ones, and as many of those that none beats.
const BEST: usize = 12;

/// So many of the best as described, and so many of those that none beats, are rated in full first.
const FIRST_IN_FULL: usize = 12;
/// So many of the best as built have their neighbours rated in full next.
const NEAREST: usize = 4;
/// So many are rated in full at most.
const IN_FULL: usize = 48;

/// A candidate that was tried.
#[derive(Clone, Debug)]
pub struct Found {
    /// Which.
    pub candidate: Candidate,
    /// The detector.
    pub detector: Detector,
    /// What it gives.
    pub rating: Rating,
    /// Whether that was found on a standard model, with its tolerances.
    pub is_in_full: bool,
}

/// What was tried so far.
struct Tried {
    found: Vec<Found>,
    /// All that were looked at, those that cannot be built among them; and whether their neighbours were.
    seen: HashMap<Candidate, bool>,
}

/// Tries at most so many candidates, or all if that is as many as there are, the best first; the same seed gives the same.
///
/// # Errors
/// [`DesignError`] if a candidate cannot be modelled.
pub fn find(
    space: &Space,
    wishes: &Wishes,
    most: usize,
    seed: u64,
    progress: Progress,
) -> Result<Vec<Found>, DesignError> {
    let mut tried = Tried { found: Vec::new(), seen: HashMap::new() };
    let searching = progress.part(0, most.min(space.count()));
    if most >= space.count() {
        tried.rate(space, wishes, space.all(), most, searching);
        return tried.in_full(space, wishes, progress);
    }
    let mut random = fastrand::Rng::with_seed(seed);
    let sample = std::iter::repeat_with(|| space.any(&mut random)).take((most as f64 * SAMPLED) as usize).collect();
    tried.rate(space, wishes, sample, most, searching);
    while tried.seen.len() < most && !progress.is_stopped() {
        let next = tried.neighbours(space, wishes);
        if next.is_empty() {
            break;
        }
        let room = most - tried.seen.len();
        tried.rate(space, wishes, next.into_iter().take(room).collect(), most, searching);
    }
    tried.in_full(space, wishes, progress)
}

impl Tried {
    /// Rates those that were not seen yet.
    fn rate(&mut self, space: &Space, wishes: &Wishes, candidates: Vec<Candidate>, most: usize, progress: Progress) {
        let mut new = Vec::new();
        for candidate in candidates {
            if self.seen.insert(candidate, false).is_none() {
                new.push(candidate);
            }
        }
        let built: Vec<_> = new.iter().filter_map(|candidate| Some((*candidate, space.detector(candidate)?))).collect();
        let rated =
            progress.part(self.seen.len() - new.len(), most).map("detectors", &built, |(candidate, detector)| {
                // What has no model, such as electrodes that touch, is no candidate.
                let rating = Rating::roughly(detector, wishes).ok()?;
                Some(Found { candidate: *candidate, detector: detector.clone(), rating, is_in_full: false })
            });
        self.found.extend(rated.into_iter().flatten().flatten());
    }

    /// Neighbours, not seen yet, of the best and of those that none beats, of which neighbours were not looked at.
    fn neighbours(&mut self, space: &Space, wishes: &Wishes) -> Vec<Candidate> {
        sort(&mut self.found, wishes);
        let is_open = |found: &&Found| self.seen.get(&found.candidate) == Some(&false);
        let best = self.found.iter().filter(is_open).take(BEST);
        let unbeaten = front(&self.found).into_iter().filter(is_open).take(BEST);
        let chosen: Vec<Candidate> = best.chain(unbeaten).map(|found| found.candidate).collect();
        let mut next = Vec::new();
        for candidate in chosen {
            self.seen.insert(candidate, true);
            let new = space.neighbours(&candidate).into_iter().filter(|neighbour| !self.seen.contains_key(neighbour));
            next.extend(new);
        }
        next
    }

    /// All, the best first, with those that matter rated in full: also after a search that was stopped, whose answer they are. First those that are best
    /// as described, and of those that none beats; then, as tolerances do not cost all alike, neighbours of what is best as built.
    fn in_full(mut self, space: &Space, wishes: &Wishes, progress: Progress) -> Result<Vec<Found>, DesignError> {
        let never = AtomicBool::new(false);
        let progress = Progress::new(&never, progress.say);
        sort(&mut self.found, wishes);
        let best = self.found.iter().take(FIRST_IN_FULL);
        let unbeaten = front(&self.found).into_iter().take(FIRST_IN_FULL);
        let mut next: HashSet<Candidate> = best.chain(unbeaten).map(|found| found.candidate).collect();
        let mut rated = 0;
        while !next.is_empty() && rated < IN_FULL {
            rated += next.len();
            self.rate_in_full(&next, wishes, progress)?;
            sort(&mut self.found, wishes);
            let nearest = self.found.iter().filter(|found| found.is_in_full).take(NEAREST);
            let around: Vec<_> = nearest.flat_map(|found| space.neighbours(&found.candidate)).collect();
            // Those that the search did not come to.
            self.rate(space, wishes, around.clone(), self.seen.len() + around.len(), progress);
            sort(&mut self.found, wishes);
            next = around.into_iter().collect();
            // As described none gives less than as built: what is no better then will not be.
            let least = self.found.first().map_or(f64::NEG_INFINITY, |found| found.rating.score(wishes));
            let may_be_best = |found: &&Found| !found.is_in_full && found.rating.score(wishes) > least;
            let open = self.found.iter().filter(may_be_best).map(|found| found.candidate);
            next = open.filter(|candidate| next.contains(candidate)).take(IN_FULL - rated.min(IN_FULL)).collect();
        }
        Ok(self.found)
    }

    fn rate_in_full(
        &mut self,
        chosen: &HashSet<Candidate>,
        wishes: &Wishes,
        progress: Progress,
    ) -> Result<(), DesignError> {
        let mut chosen: Vec<&mut Found> =
            self.found.iter_mut().filter(|found| chosen.contains(&found.candidate)).collect();
        let detectors: Vec<&Detector> = chosen.iter().map(|found| &found.detector).collect();
        let ratings = progress.map("best detectors as built", &detectors, |detector| Rating::of(detector, wishes));
        for (found, rating) in chosen.iter_mut().zip(ratings) {
            if let Some(rating) = rating {
                (found.rating, found.is_in_full) = (rating?, true);
            }
        }
        Ok(())
    }
}

/// The best first; what was rated in full before what was not, for only that can be trusted.
fn sort(found: &mut [Found], wishes: &Wishes) {
    found.sort_by(|a, b| {
        b.is_in_full.cmp(&a.is_in_full).then(b.rating.score(wishes).total_cmp(&a.rating.score(wishes)))
    });
}

/// Those that no other beats in all wishes and in the number of electrodes, in their order.
pub fn front<'a>(found: impl IntoIterator<Item = &'a Found>) -> Vec<&'a Found> {
    let mut front: Vec<&Found> = Vec::new();
    for one in found {
        if !front.iter().any(|other| one.rating.is_beaten_by(&other.rating)) {
            front.retain(|other| !other.rating.is_beaten_by(&one.rating));
            front.push(one);
        }
    }
    front
}

#[cfg(test)]
mod tests {
    use super::super::Material;
    use super::super::wishes::tests::wishes;
    use super::*;

    /// A small space can be searched in full, and what the search finds with a third of the work is as good within 2 %.
    #[test]
    fn what_is_found_is_within_2_percent_of_the_best_of_all() {
        let foams: Vec<Material> = Material::of_paper()
            .into_iter()
            .take(2)
            .map(|foam| Material { thicknesses_m: vec![5e-3, 10e-3], ..foam })
            .collect();
        let stop = AtomicBool::new(false);
        let progress = Progress::new(&stop, &|_| {});
        let wishes = Wishes { electrodes: 6, place_m: 0.2e-3, two_points_m: 5e-3, ..wishes() };
        let space = Space::new(&wishes, &foams);
        let all = find(&space, &wishes, usize::MAX, 0, progress).unwrap();
        let best = all[0].rating.score(&wishes);
        for seed in 1..=3 {
            let found = find(&space, &wishes, space.count() / 3, seed, progress).unwrap();
            assert!(found.len() < all.len());
            let score = found[0].rating.score(&wishes);
            assert!(score > best - 0.02, "{} of {}: {score} {best}", found.len(), all.len());
        }
    }
}
