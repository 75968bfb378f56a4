//! What is found in a frame.

use crate::fit::Work;
use crate::real::Real;
use crate::solver::BOARD_CONTACTS;

/// One contact.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Contact<T = f32> {
    /// Number that it keeps from frame to frame.
    pub id: u32,
    /// Centre, x (m).
    pub x_m: T,
    /// Centre, y (m).
    pub y_m: T,
    /// Conductance (S).
    pub conductance_s: T,
    /// Standard error of the conductance (S).
    pub conductance_sigma_s: T,
    /// Conductance of it in series with the current that crowds under it (S): of a firm contact readings give that far better.
    pub apparent_conductance_s: T,
    /// Force (N), where the table has a law of force.
    pub force_n: Option<T>,
    /// Radius (m), as far as the readings tell it; else the usual one.
    pub radius_m: T,
    /// Standard error of the radius (m).
    pub radius_sigma_m: T,
    /// Standard errors of x and y (m).
    pub sigma_m: [T; 2],
    /// Correlation of the errors of x and y.
    pub correlation: T,
}

impl<T: Real> Contact<T> {
    const NONE: Self = Self {
        id: 0,
        x_m: T::ZERO,
        y_m: T::ZERO,
        conductance_s: T::ZERO,
        conductance_sigma_s: T::ZERO,
        apparent_conductance_s: T::ZERO,
        force_n: None,
        radius_m: T::ZERO,
        radius_sigma_m: T::ZERO,
        sigma_m: [T::ZERO; 2],
        correlation: T::ZERO,
    };
}

/// What to know before an answer is believed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Flags(u8);

impl Flags {
    /// There are more contacts than those that are told: another one would explain much of what they leave.
    pub const MORE: Self = Self(1);
    /// The readings are not those of the contacts, by more than noise and the table's own error.
    pub const MISFIT: Self = Self(2);
    /// Readings are at the end of the converter's range, or contacts conduct so well that more would change nothing.
    pub const SATURATED: Self = Self(4);
    /// Wires of electrodes are broken; these are left out.
    pub const FAULT: Self = Self(8);
    /// The contacts leave more than noise does, in what the table takes for an error of the detector: contacts may be hidden in it, and of a calibrated detector more
    /// would be known.
    pub const CALIBRATE: Self = Self(16);

    /// Whether all of some flags are raised.
    pub const fn has(self, flags: Self) -> bool {
        self.0 & flags.0 == flags.0
    }

    /// As bits: 1 more, 2 misfit, 4 saturated, 8 fault, 16 calibrate.
    pub const fn bits(self) -> u8 {
        self.0
    }

    pub(crate) fn raise(&mut self, flags: Self, if_so: bool) {
        self.0 |= if if_so { flags.0 } else { 0 };
    }
}

/// Odds that there is one more contact than are told where no search has tried it, since it would gain next to nothing in the linear theory: of 790 answers to one to
/// five contacts, on detectors that are known and as built, that would be sure to 95 % and more without it, 3 in 100 have another number than is there.
const UNTRIED: f32 = 0.03;

/// What a nat of the evidence for what is told over more contacts counts where what the detector may differ by is fitted: the best of more contacts that a search comes to is
/// a local minimum oftener than that of as many. Of 504 answers on detectors as built for which more contacts were tried, 71 % are right, and 87 % were claimed with a whole
/// nat, 68 % with a third. (A power of the likelihood, where that is known roughly: Miller and Dunson, Robust Bayesian inference via coarsening, 2019.)
const MORE_NAT: f32 = 1.0 / 3.0;

/// How sure it is how many contacts there are, by the evidence for other numbers of them that a search tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certainty<T = f32> {
    /// Probability that there are as many as are told.
    pub share: T,
    /// The likeliest other number, and its probability.
    pub other: Option<(usize, T)>,
}

impl<T: Real> Certainty<T> {
    /// Of so many contacts, whose evidence is `exp(-score / 2)`, against the best with one, two and more of them, on a detector that is known or not.
    pub(crate) fn of(count: usize, score: T, by_count: &[Option<T>], is_known: bool) -> Self {
        let nat = |other: usize| if is_known || other < count { T::ONE } else { T::of(MORE_NAT) };
        let odds = |other: usize, of: T| (T::of(0.5) * nat(other) * (score - of)).exp();
        let tried =
            by_count.iter().enumerate().map(|(index, of)| (index + 1, of.map_or(T::ZERO, |of| odds(index + 1, of))));
        let others = || tried.clone().filter(|(other, odds)| *other != count && *odds > T::ZERO);
        let untried = if by_count.get(count).is_some_and(Option::is_none) { T::of(UNTRIED) } else { T::ZERO };
        let share = T::ONE / (T::ONE + untried + others().map(|(_, odds)| odds).sum::<T>());
        let likeliest = others().max_by(|(_, a), (_, b)| a.total_cmp(b));
        Self { share, other: likeliest.map(|(other, odds)| (other, odds * share)) }
    }
}

/// The answer for a frame: up to `K` contacts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Answer<T = f32, const K: usize = BOARD_CONTACTS> {
    contacts: [Contact<T>; K],
    count: usize,
    /// What to know before it is believed.
    pub flags: Flags,
    /// Root mean square of what is left of the readings, in standard deviations of the noise and the table's own error.
    pub residual: T,
    /// How sure their number is, since the last search; none where nothing is told, or the readings do not fit.
    pub certainty: Option<Certainty<T>>,
    /// Electrodes that are left out, since their wires are broken: a bit each.
    pub left_out: u32,
    /// What it took.
    pub work: Work<K>,
}

impl<T: Real, const K: usize> Default for Answer<T, K> {
    fn default() -> Self {
        Self::of(Work::NONE)
    }
}

impl<T: Real, const K: usize> Answer<T, K> {
    /// The contacts, those with the lowest numbers first.
    pub fn contacts(&self) -> &[Contact<T>] {
        &self.contacts[..self.count.min(K)]
    }

    pub(crate) fn of(work: Work<K>) -> Self {
        let contacts = [Contact::NONE; K];
        Self { contacts, count: 0, flags: Flags::default(), residual: T::ZERO, certainty: None, left_out: 0, work }
    }

    pub(crate) fn add(&mut self, contact: Contact<T>) {
        if let Some(free) = self.contacts.get_mut(self.count) {
            *free = contact;
            self.count += 1;
        }
    }
}
