//! Frames explained together: contacts that stay while their strengths change.
//!
//! Where two fingers are so near that one wide contact explains a frame as well, that contact moves as weight goes from one finger to the other, and no single place of it explains
//! all frames: two that stay do. So places, radii and what is not known of the detector are common to all frames, and strengths are each frame's own, about a common level. The rival
//! of more contacts that stay are as many as before that move, about a mean place. Explanations are compared by [evidence](crate::evidence), by Laplace's approximation over all
//! parameters.

mod frames;
#[cfg(test)]
mod tests;

use self::frames::Frames;
use crate::answer::Contact;
use crate::fit::{Bench, Scene, Went, Work, Working};
use crate::frame::{Errors, Frame};
use crate::held::Room;
use crate::loaded::Spot;
use crate::normal::ANY_RADIUS;
use crate::real::Real;
use crate::round::On;
use crate::scan::{Candidate, no_candidates};
use crate::solver::{Solver, Task};
use crate::table::Table;
use crate::unknown::Unknown;
use crate::vector::{Matrix, Vector};

/// Frames at most.
pub const MOST_TOGETHER: usize = 8;
/// Standard deviations about their means, of what differs from frame to frame: of the logarithm of a resistance, a factor of e; of that of a radius, as a ball's grows with the cube
/// root of the force (Hertz, 1882).
const STRENGTH_DEVIATION: f32 = 1.0;
const GROWTH_DEVIATION: f32 = 1.0 / 3.0;
/// Least standard deviation of a place that moves (usual radii).
const LEAST_SPREAD: f32 = 0.02;
/// Passes over all frames at most, where a start is tried and to the end.
const TRYING: u8 = 8;
const TO_THE_END: u8 = 30;
/// Starts of one contact more that are tried.
const STARTS: usize = 3;
/// What one contact more has to take off the sum of squares for its fit to be ended: each of its strengths alone costs six, where frames tell it to 5 %.
const PROMISING: f32 = 20.0;

/// How contacts may differ from frame to frame besides in strength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion<T, const K: usize> {
    /// Not at all.
    Still,
    /// Places, by these standard deviations of each contact's coordinates (m).
    Moving([T; K]),
    /// Places likewise, and radii.
    Growing([T; K]),
}

impl<T: Real, const K: usize> Motion<T, K> {
    /// What is known of each parameter of contacts in a frame: one over the variance about its mean; none is of one that all frames have in common.
    fn known(self, radius_m: T) -> Vector<T, K> {
        let weight = |deviation: T| T::ONE / (deviation * deviation);
        let strength = weight(T::of(STRENGTH_DEVIATION));
        let place = |spread_m: T| weight((spread_m / radius_m).max(T::of(LEAST_SPREAD)));
        Vector(match self {
            Self::Still => [[T::ZERO, T::ZERO, strength, T::ZERO]; K],
            Self::Moving(spreads_m) => spreads_m.map(place).map(|place| [place, place, strength, T::ZERO]),
            Self::Growing(spreads_m) => {
                spreads_m.map(place).map(|place| [place, place, strength, weight(T::of(GROWTH_DEVIATION))])
            }
        })
    }
}

/// An explanation of some frames.
#[derive(Clone, Debug)]
pub struct Together<T, const K: usize, const D: usize> {
    /// What frames have in common, or the means of what they have not; and contacts in each.
    common: Scene<T, K, D>,
    own: [[Spot<T>; K]; MOST_TOGETHER],
    frames: usize,
    motion: Motion<T, K>,
    /// What is taken for noise, in deviations of it; what is to become least by that.
    tau: T,
    objective: T,
    /// Sum of squares of what is left, in noise.
    cost: T,
    /// Logarithm of the evidence, and whether no more is left than noise leaves.
    ln_evidence: T,
    fits: bool,
    covariance: Matrix<T, K>,
    contacts: [[Contact<T>; K]; MOST_TOGETHER],
}

impl<T: Real, const K: usize, const D: usize> Together<T, K, D> {
    /// How many contacts.
    pub fn count(&self) -> usize {
        self.common.count
    }

    /// Those of a frame, without standard errors.
    pub fn contacts(&self, frame: usize) -> &[Contact<T>] {
        self.contacts.get(frame).map_or(&[], |all| &all[..self.common.count.min(K)])
    }

    /// The detector that they make likely: a step in each direction that is not known, in standard deviations.
    pub fn steps(&self) -> &[T; D] {
        &self.common.steps
    }

    /// Logarithm of the evidence, but for what is the same for all explanations of the same frames.
    pub fn ln_evidence(&self) -> T {
        self.ln_evidence
    }

    /// Whether no more is left of the readings than noise leaves.
    pub fn fits(&self) -> bool {
        self.fits
    }

    /// Sum of squares of what is left, in noise.
    pub fn cost(&self) -> T {
        self.cost
    }

    /// Covariance of what frames have in common: for each contact, of its place along x and y in usual radii, of the logarithm of its resistance, and of that of its radius.
    pub fn covariance(&self, i: usize, j: usize) -> T {
        self.covariance[i][j]
    }

    /// What begins there, in frames in which contacts differ so.
    fn begun(common: Scene<T, K, D>, own: [[Spot<T>; K]; MOST_TOGETHER], frames: usize, motion: Motion<T, K>) -> Self {
        let mut begun = Self {
            common,
            own,
            frames,
            motion,
            tau: T::ONE,
            objective: T::ZERO,
            cost: T::ZERO,
            ln_evidence: T::ZERO,
            fits: false,
            covariance: Matrix::ZERO,
            contacts: [[Contact::default(); K]; MOST_TOGETHER],
        };
        begun.make_common();
        begun
    }

    /// About the mean of contacts in each frame.
    fn about(own: [[Spot<T>; K]; MOST_TOGETHER], count: usize, frames: usize, motion: Motion<T, K>) -> Self {
        let mut common = Scene { count, ..Scene::EMPTY };
        let share = T::ONE / T::of(frames as u32);
        for spots in own.iter().take(frames) {
            for (mean, one) in common.spots.iter_mut().zip(spots).take(count) {
                mean.at_m.iter_mut().zip(one.at_m).for_each(|(mean, m)| *mean += share * m);
                mean.ln_ohm += share * one.ln_ohm;
                mean.ln_radius += share * one.ln_radius;
            }
        }
        Self::begun(common, own, frames, motion)
    }

    /// The same with one contact more that stays.
    fn with(&self, start: &Candidate<T>) -> Self {
        let add = |scene: Scene<T, K, D>| match start.half_of {
            Some((contact, other_half)) => {
                let firmer = scene.spots[contact].ln_ohm - self.common.spots[contact].ln_ohm;
                let half = |spot: Spot<T>| Spot { ln_ohm: spot.ln_ohm + firmer, ..spot };
                scene.without(contact).with(half(other_half)).with(half(start.spot))
            }
            None => scene.with(start.spot),
        };
        let mut own = self.own;
        (0..self.frames).for_each(|frame| own[frame] = add(self.scene(frame)).spots);
        // The detector was bent to explain what a contact is missing for.
        let common = Scene { steps: [T::ZERO; D], ..add(self.common) };
        Self::begun(common, own, self.frames, self.motion)
    }

    /// What touches in a frame.
    fn scene(&self, frame: usize) -> Scene<T, K, D> {
        Scene { spots: self.own[frame], ..self.common }
    }

    /// Makes what frames have in common the same in all of them.
    fn make_common(&mut self) {
        for spots in self.own.iter_mut().take(self.frames) {
            for (spot, common) in spots.iter_mut().zip(&self.common.spots) {
                match self.motion {
                    Motion::Still => (spot.at_m, spot.ln_radius) = (common.at_m, common.ln_radius),
                    Motion::Moving(_) => spot.ln_radius = common.ln_radius,
                    Motion::Growing(_) => (),
                }
            }
        }
    }
}

impl<T: Real, const K: usize, const D: usize> Solver<T, K, D> {
    /// The explanation of some frames, [`MOST_TOGETHER`] at most, by contacts that begin where they are in each: as many, in the same order. `None` if they make no sense. The frames
    /// before are forgotten.
    ///
    /// # Panics
    /// As [`solve_unknown`](Self::solve_unknown).
    pub fn together(
        &mut self,
        table: &Table<'_>,
        unknown: &Unknown<'_>,
        room: &mut Room<'_, T>,
        frames: &[Frame<'_, T>],
        contacts: &[&[Contact<T>]],
        motion: Motion<T, K>,
    ) -> Option<Together<T, K, D>> {
        let count = contacts.first()?.len();
        if contacts.len() != frames.len() || contacts.iter().any(|all| all.len() != count) || count > K {
            return None;
        }
        let mut own = [[Spot::NONE; K]; MOST_TOGETHER];
        for (spots, contacts) in own.iter_mut().zip(contacts) {
            spots.iter_mut().zip(*contacts).for_each(|(spot, contact)| *spot = Spot::of(contact, table));
        }
        let start = Together::about(own, count, frames.len(), motion);
        self.on_frames(table, unknown, room, frames, |all| {
            let found = all.fit(start, TO_THE_END)?;
            all.judged(found)
        })
    }

    /// The likeliest explanation with one contact more, of those that begin where it would explain most of what another explanation of contacts that stay leaves; `None` if none
    /// explains much. The frames before are forgotten.
    ///
    /// # Panics
    /// As [`solve_unknown`](Self::solve_unknown).
    pub fn one_more_together(
        &mut self,
        table: &Table<'_>,
        unknown: &Unknown<'_>,
        room: &mut Room<'_, T>,
        frames: &[Frame<'_, T>],
        from: &Together<T, K, D>,
    ) -> Option<Together<T, K, D>> {
        if from.common.count == K || frames.len() != from.frames {
            return None;
        }
        self.reset();
        let starts = self.starts_together(table, unknown, room, frames, from);
        self.on_frames(table, unknown, room, frames, |all| {
            let starts = starts.iter().filter(|start| start.gain > T::ZERO);
            let tried = starts.filter_map(|start| all.fit(from.with(start), TRYING));
            let best = tried.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
            if from.cost - best.cost < T::of(PROMISING) {
                return None;
            }
            let found = all.fit(best, TO_THE_END)?;
            all.judged(found)
        })
    }

    /// Where one more contact would explain most of all frames, the best first.
    fn starts_together(
        &mut self,
        table: &Table<'_>,
        unknown: &Unknown<'_>,
        room: &mut Room<'_, T>,
        frames: &[Frame<'_, T>],
        from: &Together<T, K, D>,
    ) -> [Candidate<T>; STARTS] {
        let mut best = [Candidate::NONE; STARTS];
        for (number, frame) in frames.iter().enumerate() {
            let (frame, errors) = sound(frame, table);
            let task = Task { table, frame: &frame, errors: &errors, unknown: Some(unknown) };
            (self.fitting.on.is_held, self.fitting.is_derived) = (false, false);
            self.fitting.begin(from.scene(number), T::of(ANY_RADIUS), 0);
            let mut work = Work::NONE;
            let mut working = Working { done: &mut work, attend: &mut || {} };
            let mut bench = Bench { circuit: &mut self.circuit, room: Some(&mut *room) };
            if let Went::ToEnd(Some(_)) = self.fitting.go_on(task, &mut bench, &mut working) {
                let mut found = no_candidates();
                self.fitting.births(task, unknown, &mut self.circuit, room, &mut found, &mut working);
                let found = found.into_iter().filter(|one| one.gain > T::ZERO);
                found.for_each(|one| take(&mut best, one, T::of(table.head().radius_m)));
            }
        }
        best
    }

    /// Works on frames.
    fn on_frames<R>(
        &mut self,
        table: &Table<'_>,
        unknown: &Unknown<'_>,
        room: &mut Room<'_, T>,
        frames: &[Frame<'_, T>],
        work: impl FnOnce(&mut Frames<'_, '_, T, K, D>) -> Option<R>,
    ) -> Option<R> {
        if frames.len() > MOST_TOGETHER || frames.iter().any(|frame| frame.check(table).is_err()) {
            return None;
        }
        let mut all = [sound(frames.first()?, table); MOST_TOGETHER];
        all.iter_mut().zip(frames).for_each(|(to, frame)| *to = sound(frame, table));
        self.reset();
        let [(frame, errors), ..] = &all;
        let task = Task { table, frame, errors, unknown: Some(unknown) };
        let on =
            On { task, unknown, circuit: &mut self.circuit, parts: room.parts(table, unknown, K), is_moved: false };
        work(&mut Frames::new(on, &all[..frames.len()]))
    }
}

/// A frame without broken electrodes, and what is known of its errors: pads are among what is not known.
fn sound<'f, T: Real>(frame: &Frame<'f, T>, table: &Table<'_>) -> (Frame<'f, T>, Errors<T>) {
    let (frame, _) = frame.without_broken(table);
    let mut errors = Errors::of(&frame, table);
    errors.pads.fill(T::ZERO);
    (frame, errors)
}

/// Takes a start among the best: what one gains in several frames is summed up.
fn take<T: Real>(best: &mut [Candidate<T>; STARTS], new: Candidate<T>, near_m: T) {
    let is_same = |other: &&mut Candidate<T>| {
        let [x, y] = [0, 1].map(|d| other.spot.at_m[d] - new.spot.at_m[d]);
        let are_halves_of = [&new, *other].map(|one| one.half_of.map(|(contact, _)| contact));
        other.gain > T::ZERO && are_halves_of[0] == are_halves_of[1] && x * x + y * y < near_m * near_m
    };
    if let Some(same) = best.iter_mut().find(is_same) {
        same.gain += new.gain;
    } else if best[STARTS - 1].gain < new.gain {
        best[STARTS - 1] = new;
    }
    best.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain));
}
