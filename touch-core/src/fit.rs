//! Damped Gauss-Newton steps of contacts to the readings of a frame, one look at them at a time.

use crate::circuit::Circuit;
use crate::detector::Detector;
use crate::evidence::{information, known, ln_volume};
use crate::held::Room;
use crate::loaded::Spot;
use crate::normal::Normal;
use crate::real::Real;
use crate::round::OnUnknown;
use crate::solver::{BOARD_CONTACTS, Task};
use crate::table::Table;
use crate::vector::{PARAMETERS, Vector};
use crate::walls::Across;

/// Longest way in a step, in usual radii, and longest change of a logarithm.
const LONGEST_WAY: f32 = 2.0;
const LONGEST_LOG: f32 = 1.0;
/// A step that gains less than this (squared deviations) in the linear theory is not worth it: it moves nothing by a third of its standard error.
pub(crate) const LEAST_GAIN: f32 = 0.1;
/// Damping at the start, shares of the diagonal, and how it changes with a step that is taken or not; steps tried from a place.
const FIRST_DAMPING: f32 = 1e-3;
const LEAST_DAMPING: f32 = 1e-5;
pub(crate) const DAMPING_STEP: f32 = 10.0;
pub(crate) const TRIES: u8 = 4;
/// Steps at most where a start is only tried, and what a round of these, or of others, has to gain (squared deviations) for another one.
pub(crate) const TRYING: u8 = 8;
const ROUGHLY: f32 = 3.0;
const EXACTLY: f32 = 0.3;
/// Radii, as logarithms over the usual one: from a fifth of it to three times it.
pub(crate) const LN_RADII: [f32; 2] = [-1.6, 1.1];
/// Resistances, as logarithms of those of a square of the layer: a contact of 1e-6 squares is nothing, and none leads better than a fifth of one.
pub(crate) const LN_SQUARES: [f32; 2] = [-3.0, 13.8];

/// Contacts of a scene, `K` at most, and the detector that they are on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Scene<T, const K: usize, const D: usize> {
    pub count: usize,
    pub spots: [Spot<T>; K],
    /// Steps from what the detector's table says in the directions that are not known, in deviations.
    pub steps: [T; D],
}

impl<T: Real, const K: usize, const D: usize> Scene<T, K, D> {
    pub const EMPTY: Self = Self { count: 0, spots: [Spot::NONE; K], steps: [T::ZERO; D] };

    pub fn spots(&self) -> &[Spot<T>] {
        &self.spots[..self.count.min(K)]
    }

    /// The scene with one more; itself if it has all that there may be.
    pub fn with(mut self, spot: Spot<T>) -> Self {
        if let Some(free) = self.spots.get_mut(self.count) {
            *free = spot;
            self.count += 1;
        }
        self
    }

    /// A scene so far on the way to another one of as many contacts.
    pub fn towards(mut self, to: &Self, share: T) -> Self {
        // All of the way is that scene, digit by digit.
        let between = |from: &mut T, to: T| *from = share * to + (T::ONE - share) * *from;
        for (spot, to) in self.spots.iter_mut().zip(&to.spots).take(self.count) {
            spot.at_m.iter_mut().zip(to.at_m).for_each(|(from, to)| between(from, to));
            between(&mut spot.ln_ohm, to.ln_ohm);
            between(&mut spot.ln_radius, to.ln_radius);
        }
        self.steps.iter_mut().zip(to.steps).for_each(|(from, to)| between(from, to));
        self
    }

    /// The scene without one.
    pub fn without(self, index: usize) -> Self {
        let kept = self.spots().iter().enumerate().filter(|(k, _)| *k != index);
        kept.fold(Self { steps: self.steps, ..Self::EMPTY }, |scene, (_, spot)| scene.with(*spot))
    }

    /// The step to where contacts leave least, damped, and by how much less that is in the linear theory; those that are at a wall and would go beyond it stay there, and
    /// the others take the best step with these. `None` where nothing is determined.
    pub fn step(&self, normal: &Normal<T, K>, damping: T, table: &Table<'_>) -> Option<(Vector<T, K>, T)> {
        let across = Across::both(table);
        let is_stopped = |i: &usize, step: &Vector<T, K>| {
            across[i % PARAMETERS].is_stopped(self.spots[i / PARAMETERS].at_m[i % PARAMETERS], step[*i])
        };
        let places = || (0..normal.count).filter(|i| i % PARAMETERS < 2);
        let (mut step, mut gain) = normal.step(damping)?;
        if !places().any(|i| is_stopped(&i, &step)) {
            return Some((step, gain));
        }
        let mut free = *normal;
        while let Some(stopped) = places().find(|i| is_stopped(i, &step)) {
            free.hold(stopped);
            (step, gain) = free.step(damping)?;
        }
        Some((step, gain))
    }

    pub fn moved(&self, step: &Vector<T, K>, table: &Table<'_>) -> Self {
        let mut moved = *self;
        let (head, across) = (table.head(), Across::both(table));
        for (spot, step) in moved.spots.iter_mut().zip(&step.0).take(self.count) {
            let [x, y, ln_ohm, ln_radius] = *step;
            let way_m =
                |d: usize, step: T| across[d].stepped_m(spot.at_m[d], T::of(head.radius_m) * step) - spot.at_m[d];
            let (x_m, y_m) = (way_m(0, x), way_m(1, y));
            let longest_m = T::of(LONGEST_WAY) * T::of(head.radius_m);
            let shorter = (longest_m / (x_m * x_m + y_m * y_m).sqrt().max(T::min_positive_value())).min(T::ONE);
            let held = |step: T| step.clamp(-T::of(LONGEST_LOG), T::of(LONGEST_LOG));
            let to_m = [spot.at_m[0] + shorter * x_m, spot.at_m[1] + shorter * y_m];
            if table.holds(to_m[0], to_m[1]) {
                spot.at_m = to_m;
            }
            spot.ln_ohm = held_ohm(spot.ln_ohm + held(ln_ohm), table);
            spot.ln_radius = (spot.ln_radius + held(ln_radius)).clamp(T::of(LN_RADII[0]), T::of(LN_RADII[1]));
        }
        moved
    }
}

/// The nearest resistance that a contact may have, as logarithms (ohm).
pub(crate) fn held_ohm<T: Real>(ln_ohm: T, table: &Table<'_>) -> T {
    let square = -T::of(table.head().sheet_s).ln();
    ln_ohm.max(square + T::of(LN_SQUARES[0])).min(square + T::of(LN_SQUARES[1]))
}

/// What was done so far.
pub(crate) struct Working<'a, const K: usize> {
    pub done: &'a mut Work<K>,
    /// Called after each piece of it.
    pub attend: &'a mut dyn FnMut(),
}

impl<const K: usize> Working<'_, K> {
    /// The readings of so many contacts and their derivatives were worked out.
    pub fn worked_out(&mut self, contacts: usize) {
        self.done.frames[contacts - 1] += 1;
        (self.attend)();
    }

    /// A place was looked at for a first contact.
    pub fn looked_at_first(&mut self) {
        self.done.first_looks += 1;
        (self.attend)();
    }

    /// A place was looked at for one more contact.
    pub fn looked(&mut self) {
        self.done.looks += 1;
        (self.attend)();
    }
}

/// What an answer took.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work<const K: usize = BOARD_CONTACTS> {
    /// Times that the readings of one, two and up to `K` contacts and all their derivatives were worked out.
    pub frames: [u32; K],
    /// Places that were looked at for a first contact.
    pub first_looks: u32,
    /// Places that were looked at for one more.
    pub looks: u32,
}

impl<const K: usize> Work<K> {
    pub(crate) const NONE: Self = Self { frames: [0; K], first_looks: 0, looks: 0 };
}

impl<const K: usize> Default for Work<K> {
    fn default() -> Self {
        Self::NONE
    }
}

/// Contacts that were fitted to a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit<T, const K: usize, const D: usize> {
    pub scene: Scene<T, K, D>,
    /// Sum of squares of what they leave and of the detector's steps.
    pub cost: T,
    /// Twice the logarithm of the evidence for them, less all that is the same for all explanations.
    pub evidence: T,
    /// What the readings say for each contact (squared deviations).
    pub information: [T; K],
    /// Squares that contacts would leave if the detector were as its table says, and by how much less the readings say for a contact's strength than they would then.
    pub if_known: T,
    pub less_said: T,
    /// Standard deviation of the logarithms of radii that they were fitted with.
    pub radius_deviation: T,
    /// Whether it is known that one more contact beside these would not be worth its price.
    pub is_alone: bool,
    /// Contacts that readings place badly, a bit each, where something is not known of the detector or its board.
    pub loose: u32,
}

impl<T: Real, const K: usize, const D: usize> Fit<T, K, D> {
    /// No contact.
    pub const NONE: Self = Self {
        scene: Scene::EMPTY,
        cost: T::ZERO,
        evidence: T::ZERO,
        information: [T::ZERO; K],
        if_known: T::ZERO,
        less_said: T::ONE,
        radius_deviation: T::ZERO,
        is_alone: false,
        loose: 0,
    };
}

/// How a fit goes on.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Went<T, const K: usize, const D: usize> {
    /// It has not ended.
    On,
    /// It has ended: with this, or with nothing if the scene makes no sense.
    ToEnd(Option<Fit<T, K, D>>),
}

/// What a fit works with.
pub(crate) struct Bench<'a, 'm, T, const K: usize> {
    pub circuit: &'a mut Circuit<T, K>,
    /// Where a detector that is not known is worked out.
    pub room: Option<&'a mut Room<'m, T>>,
}

/// A fit under way.
#[derive(Clone, Debug)]
pub(crate) struct Fitting<T, const K: usize, const D: usize> {
    pub(crate) scene: Scene<T, K, D>,
    /// Of the scene.
    pub normal: Normal<T, K>,
    /// What is looked at next.
    trial: Scene<T, K, D>,
    pub(crate) radius_deviation: T,
    pub(crate) damping: T,
    /// Steps that it may still take, and tries of the next one so far.
    pub(crate) steps: u8,
    tries: u8,
    pub(crate) has_looked: bool,
    /// Where the detector is not known: whether derivatives are those where the scene is, and the standard deviation of the logarithms of radii that is in them.
    pub(crate) is_derived: bool,
    pub(crate) weighed: T,
    /// What another round has to gain (squared deviations).
    pub(crate) worth: T,
    /// What is not known of a detector, and the scene whose patterns are held.
    pub(crate) on: OnUnknown<T>,
    pub(crate) held_at: Scene<T, K, D>,
    /// Whether it goes on from the frame before; the last fit whose derivatives were taken where it ended, and what was to become least in it.
    pub(crate) goes_on: bool,
    pub(crate) ended: Fit<T, K, D>,
    pub(crate) ended_objective: T,
}

impl<T: Real, const K: usize, const D: usize> Fitting<T, K, D> {
    /// One that has nothing to do.
    pub const NONE: Self = Self {
        scene: Scene::EMPTY,
        normal: Normal::EMPTY,
        trial: Scene::EMPTY,
        radius_deviation: T::ZERO,
        damping: T::ZERO,
        steps: 0,
        tries: 0,
        has_looked: false,
        is_derived: false,
        weighed: T::ONE,
        worth: T::ZERO,
        on: OnUnknown::NONE,
        held_at: Scene::EMPTY,
        goes_on: false,
        ended: Fit::NONE,
        ended_objective: T::ZERO,
    };

    /// Begins to step from a scene to where it fits best, so many steps at most.
    pub fn begin(&mut self, scene: Scene<T, K, D>, radius_deviation: T, steps: u8) {
        self.goes_on = false;
        self.is_derived &= scene == self.scene;
        self.on.damping = T::ONE;
        self.worth = T::of(if steps <= TRYING { ROUGHLY } else { EXACTLY });
        (self.scene, self.trial, self.radius_deviation) = (scene, scene, radius_deviation);
        (self.damping, self.steps, self.tries, self.has_looked) = (T::of(FIRST_DAMPING), steps, 0, false);
    }

    /// Takes one look; where the detector is not known, goes one round.
    pub fn go_on(
        &mut self,
        task: Task<'_, T>,
        bench: &mut Bench<'_, '_, T, K>,
        work: &mut Working<'_, K>,
    ) -> Went<T, K, D> {
        if D > 0
            && let (Some(unknown), Some(room)) = (task.unknown, &mut bench.room)
        {
            return self.go_round(task, unknown, bench.circuit, room, work);
        }
        if !self.has_looked {
            self.has_looked = true;
            if !look(task, bench.circuit, &self.trial, self.radius_deviation, &mut self.normal, work) {
                return Went::ToEnd(None);
            }
        } else {
            let mut normal = Normal::EMPTY;
            let makes_sense = look(task, bench.circuit, &self.trial, self.radius_deviation, &mut normal, work);
            if makes_sense && normal.objective() < self.normal.objective() {
                (self.scene, self.normal) = (self.trial, normal);
                self.is_better();
                (self.steps, self.tries) = (self.steps - 1, 0);
            } else {
                self.is_worse();
                self.tries += 1;
            }
        }
        let may_step = self.steps > 0 && self.tries < TRIES;
        match self
            .scene
            .step(&self.normal, self.damping, task.table)
            .filter(|(_, gain)| may_step && *gain >= T::of(LEAST_GAIN))
        {
            Some((step, _)) => {
                self.trial = self.scene.moved(&step, task.table);
                Went::On
            }
            None => Went::ToEnd(Some(self.fit(task, bench.circuit))),
        }
    }

    /// A step was taken: the next one is damped less.
    pub(crate) fn is_better(&mut self) {
        self.damping = (self.damping / T::of(DAMPING_STEP)).max(T::of(LEAST_DAMPING));
    }

    /// It was not.
    pub(crate) fn is_worse(&mut self) {
        self.damping *= T::of(DAMPING_STEP);
    }

    fn fit(&self, task: Task<'_, T>, circuit: &Circuit<T, K>) -> Fit<T, K, D> {
        let posterior = self.normal.posterior(&known(task.table, circuit));
        let posterior = posterior.as_ref();
        Fit {
            scene: self.scene,
            cost: self.normal.cost,
            evidence: T::of(2.0) * ln_volume(task.table, circuit, posterior) - self.normal.objective(),
            information: information(&self.normal, posterior),
            radius_deviation: self.radius_deviation,
            ..Fit::NONE
        }
    }
}

/// What a scene leaves of a frame; `false` if it makes no sense.
fn look<T: Real, const K: usize, const D: usize>(
    Task { table, frame, errors, .. }: Task<'_, T>,
    circuit: &mut Circuit<T, K>,
    scene: &Scene<T, K, D>,
    radius_deviation: T,
    normal: &mut Normal<T, K>,
    work: &mut Working<'_, K>,
) -> bool {
    let detector = Detector::described(table);
    if scene.count == 0 || !circuit.solve(&detector, scene.spots()) {
        return false;
    }
    normal.sum_up(&detector, circuit, frame, errors, radius_deviation);
    work.worked_out(scene.count);
    normal.objective().is_finite()
}
