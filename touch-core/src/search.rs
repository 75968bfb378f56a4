//! The search for what explains a frame: what is to be done next, and what becomes of what was found by that. The work itself is the [solver](crate::Solver)'s,
//! who does it piece by piece.

mod mend;
mod others;

use self::mend::CLOSE;
use crate::answer::Certainty;
use crate::evidence::{better, is_misfit, is_nothing, limit, score, weakest};
use crate::fit::{Fit, Scene, TRYING};
use crate::normal::{ANY_RADIUS, USUAL_RADIUS};
use crate::real::Real;
use crate::scan::{CANDIDATES, Candidates, no_candidates};

/// Gain in the sum of squares, in the linear theory, for there being any contact at all, the host's; also for there being more than were found. Of 120 random
/// scenes of three discs on `square-60` 62 are explained by three contacts: with 60 it is said of 3 that there are more, with 30 of 10. Of 201 scenes in
/// which `auto` finds four or five it is said of 176 and of 188.
pub(crate) const FIRST_GAIN: f32 = 60.0;
/// Squares that are left, in those of a misfit, above which more contacts are there for sure.
const MOST_OF: f32 = 8.0;
/// Gain, in the linear theory, for one more contact to be tried: about what one has to gain at least for the evidence not to speak against it. Where there is none, one place in a
/// hundred gains so much by chance. With 12 one in ten of the wrong answers less has the right number for its alternative, and three contacts take a fifth less time.
const TRIED_GAIN: f32 = 6.0;
/// Steps at most where the best start is searched.
const SEARCHING: u8 = 20;

/// What a search needs done next.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wants<T, const K: usize, const D: usize> {
    /// A scene fitted, with a standard deviation of the logarithms of radii, in so many steps at most.
    Fit(Scene<T, K, D>, T, u8),
    /// The places for a first contact in [`Search::starts`].
    First,
    /// The places for one more beside a scene, which is looked at with such a standard deviation, there.
    Beside(Scene<T, K, D>, T),
    /// Nothing: this was found.
    Nothing(Option<Fit<T, K, D>>),
}

/// What a search waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Awaits {
    /// What it grows from, fitted with any radii.
    Grown,
    /// Places for one more beside that.
    More,
    /// Places for a first contact.
    First,
    /// The fit of the start with this number, and of the best of them to its end.
    Start(u8),
    Best,
    /// An explanation without the contact that the readings speak least for.
    Pruned,
    /// Places for one more beside an explanation.
    Another,
    /// The best explanation without the contact that is looked for anew, and the other explanation with this number, that may be as good.
    Rest,
    Other(u8),
    /// That one, where it came near, fitted to its end.
    OtherToEnd(u8),
}

/// What an explanation is made from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// What was followed.
    Followed,
    /// Nothing.
    Nothing,
    /// The best explanation but for one contact.
    Rest,
}

/// What a search is told before.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Terms {
    /// Whether the detector's fields are known.
    pub is_known: bool,
    /// Most contacts that are looked for.
    pub most: usize,
    /// Usual radius of a contact, and where the detector begins and ends along x and y (m).
    pub radius_m: f32,
    pub bounds_m: [[f32; 2]; 2],
}

/// A search, of which one piece after the other is done.
#[derive(Clone, Debug)]
pub(crate) struct Search<T, const K: usize, const D: usize> {
    awaits: Awaits,
    from: Way,
    /// What one more contact is looked for beside.
    at: Fit<T, K, D>,
    /// Best explanation by what was made from here on.
    best: Option<Fit<T, K, D>>,
    /// The best before that: by what was followed, or of all.
    kept: Option<Fit<T, K, D>>,
    /// Best of some that are tried.
    tried: Option<Fit<T, K, D>>,
    /// Where contacts may be.
    pub starts: Candidates<T>,
    /// Whether one more is looked for beside a whole explanation, with any radii.
    completes: bool,
    /// Whether what was found leaves enough for another contact, and whether it did before one was looked for anew.
    pub more: bool,
    more_before: bool,
    /// The contact that is looked for anew, and how many were.
    contact: u8,
    anew: u8,
    terms: Terms,
    /// Lowest [score] of explanations with one, two and up to `K` contacts, of those that were tried and fitted with any radii.
    by_count: [Option<T>; K],
}

impl<T: Real, const K: usize, const D: usize> Search<T, K, D> {
    /// None under way.
    pub const NONE: Self = Self {
        awaits: Awaits::First,
        from: Way::Nothing,
        at: Fit::NONE,
        best: None,
        kept: None,
        tried: None,
        starts: no_candidates(),
        completes: false,
        more: false,
        more_before: false,
        contact: 0,
        anew: 0,
        terms: Terms { is_known: true, most: K, radius_m: 1.0, bounds_m: [[0.0; 2]; 2] },
        by_count: [None; K],
    };

    /// Looks for what explains a frame best, from what was followed, and from nothing; where one contact would explain most of it alone may be known.
    pub fn begin(
        &mut self,
        followed: Option<Fit<T, K, D>>,
        alone: Option<Candidates<T>>,
        readings: T,
        terms: Terms,
    ) -> Wants<T, K, D> {
        (self.best, self.kept, self.tried, self.by_count) = (None, None, None, [None; K]);
        self.terms = terms;
        self.from = Way::Followed;
        match (followed, alone) {
            (Some(fit), _) => self.grow(fit),
            (None, None) => self.begin_from_nothing(),
            (None, Some(alone)) => {
                self.begin_from_nothing();
                self.starts = alone;
                self.placed(readings)
            }
        }
    }

    /// The best so far, where a search is to end early.
    pub fn best_so_far(&self) -> Option<Fit<T, K, D>> {
        let at = Some(self.at).filter(|at| at.scene.count > 0);
        better(self.kept, self.best).or(self.tried).or(at)
    }

    /// How sure the count of what was found is, against other counts that were tried.
    pub fn certainty(&self, found: &Fit<T, K, D>) -> Certainty<T> {
        Certainty::of(found.scene.count, score(found), &self.by_count, self.terms.is_known)
    }

    fn note(&mut self, found: &Fit<T, K, D>) {
        if found.radius_deviation == T::of(ANY_RADIUS)
            && let Some(best) = found.scene.count.checked_sub(1).and_then(|count| self.by_count.get_mut(count))
        {
            *best = Some(best.map_or(score(found), |best| best.min(score(found))));
        }
    }

    /// Takes the fit that it waited for.
    pub fn fitted(&mut self, found: Option<Fit<T, K, D>>, readings: T) -> Wants<T, K, D> {
        if let Some(found) = &found {
            self.note(found);
        }
        match self.awaits {
            Awaits::Grown => {
                self.best = better(self.best, found.or(Some(self.at)));
                if self.at.scene.count >= self.terms.most || self.is_enough(readings) {
                    return self.grown(readings);
                }
                self.awaits = Awaits::More;
                Wants::Beside(self.at.scene, self.at.radius_deviation)
            }
            Awaits::Start(number) => {
                self.tried = better(self.tried, found.filter(|found| self.completes || self.leaves_less(found)));
                let next = usize::from(number) + 1;
                let fits = self.tried.is_some_and(|tried| !is_misfit(&tried, readings));
                let leaves_most = self.tried.filter(|tried| self.leaves_most(tried, readings));
                if let (Some(tried), 0, Way::Followed | Way::Nothing) = (leaves_most, self.at.scene.count, self.from) {
                    // Others of the first are on the same hill.
                    return self.grow_beyond(tried);
                }
                // Beside others on a detector that is not known, what is left is seldom the fault of the start: of 360 scenes as many are right without more of them, in a seventh less time.
                let may_be_better = !fits && (self.terms.is_known || self.at.scene.count == 0 || self.tried.is_none());
                // One alone that readings place badly reads nearly alike elsewhere.
                let may_be_elsewhere = self.at.scene.count == 0
                    && self.tried.is_some_and(|tried| tried.scene.count == 1 && self.is_loose(&tried, 0));
                if (may_be_better || may_be_elsewhere)
                    && self.starts.get(next).is_some_and(|start| start.gain > T::ZERO)
                {
                    return self.start(next, readings);
                }
                let Some(tried) = self.tried else { return self.added(None, readings) };
                if let Some(tried) = leaves_most {
                    return self.grow_beyond(tried);
                }
                if fits && !self.completes {
                    return self.grow_on(tried);
                }
                self.awaits = Awaits::Best;
                Wants::Fit(tried.scene, self.radius_deviation(), SEARCHING)
            }
            Awaits::Best => self.added(found, readings),
            Awaits::Pruned => match (self.best, found) {
                (Some(best), Some(fewer)) if score(&fewer) < score(&best) || is_nothing(&best) => {
                    self.best = found;
                    self.prune(readings)
                }
                // A contact alone has to be told.
                (Some(best), None) if best.scene.count == 1 => {
                    self.best = None;
                    self.prune(readings)
                }
                // The readings do not tell how strong it is, but that it is there.
                _ => self.complete(readings),
            },
            Awaits::Rest => match found {
                Some(rest) => self.grow(rest),
                None => self.exchanged(readings),
            },
            Awaits::Other(contact) => {
                let is_close = |fewer: &Fit<T, K, D>| {
                    self.kept.is_some_and(|kept| score(fewer) < score(&kept) + T::of(CLOSE) * limit(readings))
                };
                match found.filter(is_close) {
                    Some(fewer) => {
                        self.awaits = Awaits::OtherToEnd(contact);
                        Wants::Fit(fewer.scene, T::of(ANY_RADIUS), SEARCHING)
                    }
                    None => self.try_others_after(Some(contact)),
                }
            }
            Awaits::OtherToEnd(contact) => {
                self.tried = better(self.tried, found);
                self.try_others_after(Some(contact))
            }
            Awaits::More | Awaits::First | Awaits::Another => Wants::Nothing(self.best_so_far()),
        }
    }

    /// Takes the places that it waited for.
    pub fn placed(&mut self, readings: T) -> Wants<T, K, D> {
        let gain = self.starts[0].gain;
        match self.awaits {
            Awaits::More if gain <= T::of(TRIED_GAIN) && self.best.is_none() => self.grow_on(self.at),
            Awaits::More if gain <= T::of(TRIED_GAIN) => {
                // With any radii they leave still less.
                let count = self.at.scene.count;
                self.best = self.best.map(|best| Fit { is_alone: best.scene.count == count, ..best });
                self.grown(readings)
            }
            Awaits::More => self.start_above(T::of(TRIED_GAIN), false, readings),
            // What was followed is no longer there.
            Awaits::First if gain < T::of(FIRST_GAIN) && self.from != Way::Rest => self.nothing_found(),
            Awaits::First => {
                (self.at, self.best) = (Fit::NONE, None);
                self.start_above(T::ZERO, false, readings)
            }
            Awaits::Another => {
                // Halves may gain much by a contact's shape.
                self.more = self.starts.iter().any(|start| start.half_of.is_none() && start.gain > T::of(FIRST_GAIN));
                let is_full = self.best.is_some_and(|best| best.scene.count >= self.terms.most);
                if gain > T::of(TRIED_GAIN) && !is_full {
                    self.start_above(T::of(TRIED_GAIN), true, readings)
                } else {
                    self.completed(readings)
                }
            }
            _ => Wants::Nothing(self.best_so_far()),
        }
    }

    fn begin_from_nothing(&mut self) -> Wants<T, K, D> {
        (self.from, self.awaits) = (Way::Nothing, Awaits::First);
        Wants::First
    }

    /// Looks for the likeliest number of contacts from some that are found on, one more at a time.
    fn grow(&mut self, from: Fit<T, K, D>) -> Wants<T, K, D> {
        self.best = None;
        self.grow_on(from)
    }

    fn grow_on(&mut self, at: Fit<T, K, D>) -> Wants<T, K, D> {
        (self.at, self.awaits) = (at, Awaits::Grown);
        Wants::Fit(at.scene, T::of(ANY_RADIUS), SEARCHING)
    }

    /// Whether what was grown last is less likely than what explains the readings with fewer contacts: more beside it would be sought in vain. Of 1800 random scenes on a detector that is
    /// known 89.7 % are right, and of 800 on detectors as built 61.0; 89.0 and 60.5 where the search goes on, in a third more time on the former.
    fn is_enough(&self, readings: T) -> bool {
        self.best.is_some_and(|best| best.scene.count < self.at.scene.count && !is_misfit(&best, readings))
    }

    /// Whether so much is left of the readings that more contacts are there for sure, and fewer need not be found exactly.
    fn leaves_most(&self, tried: &Fit<T, K, D>, readings: T) -> bool {
        !self.completes && tried.scene.count < self.terms.most && tried.cost > T::of(MOST_OF) * limit(readings)
    }

    /// Whether one more contact has made what is left of the readings less.
    fn leaves_less(&self, found: &Fit<T, K, D>) -> bool {
        self.at.scene.count == 0 || found.cost < self.at.cost
    }

    /// Looks for one more beside contacts that are found roughly, but for one that the others have made needless.
    fn grow_beyond(&mut self, tried: Fit<T, K, D>) -> Wants<T, K, D> {
        let gone = weakest(&tried).filter(|_| tried.scene.count > 1);
        let scene = gone.map_or(tried.scene, |gone| tried.scene.without(gone));
        (self.at, self.best, self.awaits) = (Fit { scene, ..tried }, None, Awaits::More);
        Wants::Beside(scene, tried.radius_deviation)
    }

    /// No more contacts are worth their price.
    fn grown(&mut self, readings: T) -> Wants<T, K, D> {
        match self.from {
            Way::Followed => {
                // What there was more than is no place to go on from.
                if !self.more && self.best.is_some_and(|best| !is_misfit(&best, readings)) {
                    return self.prune(readings);
                }
                self.kept = self.best;
                self.begin_from_nothing()
            }
            Way::Nothing => {
                self.best = better(self.kept, self.best);
                self.prune(readings)
            }
            Way::Rest => self.prune(readings),
        }
    }

    /// Tries one more contact at the places where it gains more than this.
    fn start_above(&mut self, least_gain: T, completes: bool, readings: T) -> Wants<T, K, D> {
        self.starts.iter_mut().filter(|start| start.gain <= least_gain).for_each(|start| start.gain = T::ZERO);
        (self.completes, self.tried) = (completes, None);
        self.start(0, readings)
    }

    fn start(&mut self, number: usize, readings: T) -> Wants<T, K, D> {
        const { assert!(CANDIDATES <= u8::MAX as usize) };
        self.awaits = Awaits::Start(number as u8);
        let mut others = if self.completes { self.best.unwrap_or(Fit::NONE) } else { self.at };
        if is_misfit(&others, readings) {
            // The detector was bent to explain what a contact is missing for.
            others.scene.steps = [T::ZERO; D];
        }
        let scene = self.starts.get(number).map_or(others.scene, |start| {
            let others = match start.half_of {
                Some((contact, other_half)) => others.scene.without(contact).with(other_half),
                None => others.scene,
            };
            others.with(start.spot)
        });
        Wants::Fit(scene, self.radius_deviation(), TRYING)
    }

    fn radius_deviation(&self) -> T {
        if self.completes { T::of(ANY_RADIUS) } else { T::of(USUAL_RADIUS) }
    }

    /// One more contact was found, or none.
    fn added(&mut self, found: Option<Fit<T, K, D>>, readings: T) -> Wants<T, K, D> {
        if !self.completes {
            return match found {
                Some(more) => self.grow_on(more),
                // What it was to be added to may be all that there is.
                None if self.best.is_none() && self.at.scene.count > 0 => self.grow_on(self.at),
                None => self.grown(readings),
            };
        }
        let is_better = |new: &Fit<T, K, D>| self.best.is_none_or(|best| score(new) < score(&best));
        match found.filter(is_better) {
            Some(new) => {
                self.best = Some(new);
                self.complete(readings)
            }
            None => self.completed(readings),
        }
    }

    /// Leaves out the contacts that the readings do not speak for.
    fn prune(&mut self, readings: T) -> Wants<T, K, D> {
        match self.best {
            None if self.from == Way::Rest => self.exchanged(readings),
            None => self.nothing_found(),
            Some(best) => match weakest(&best) {
                Some(gone) => {
                    self.awaits = Awaits::Pruned;
                    Wants::Fit(best.scene.without(gone), T::of(ANY_RADIUS), SEARCHING)
                }
                None => self.complete(readings),
            },
        }
    }

    fn nothing_found(&mut self) -> Wants<T, K, D> {
        self.more = false;
        Wants::Nothing(None)
    }

    /// Looks for one more contact beside an explanation, as long as that would explain much of what they leave; notes whether another one would.
    fn complete(&mut self, readings: T) -> Wants<T, K, D> {
        match self.best {
            Some(best) if !best.is_alone => {
                self.awaits = Awaits::Another;
                Wants::Beside(best.scene, best.radius_deviation)
            }
            _ => {
                self.more = false;
                self.completed(readings)
            }
        }
    }

    fn completed(&mut self, readings: T) -> Wants<T, K, D> {
        if self.from == Way::Rest {
            return self.exchanged(readings);
        }
        self.kept = self.best;
        (self.from, self.contact, self.anew) = (Way::Rest, 0, 0);
        self.exchange(readings)
    }
}
