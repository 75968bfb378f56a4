//! Damped Gauss-Newton steps of contacts to the readings of a frame, one look at them at a time.

use crate::circuit::{Circuit, MAX_CONTACTS, Spot};
use crate::normal::{ANY_RADIUS, Normal, PARAMETERS, Vector};
use crate::solver::Task;
use crate::table::Table;

/// Longest way in a step, in usual radii, and longest change of a logarithm.
const LONGEST_WAY: f32 = 2.0;
const LONGEST_LOG: f32 = 1.0;
/// A step that gains less than this (squared deviations) in the linear theory is not worth it: it moves nothing by a third of its standard error.
const LEAST_GAIN: f32 = 0.1;
/// Damping at the start, shares of the diagonal, and how it changes with a step that is taken or not; steps tried from a place.
const FIRST_DAMPING: f32 = 1e-3;
const LEAST_DAMPING: f32 = 1e-5;
const DAMPING_STEP: f32 = 10.0;
const TRIES: u8 = 4;
/// Radii, as logarithms over the usual one: from a fifth of it to three times it.
pub(crate) const LN_RADII: [f32; 2] = [-1.6, 1.1];
/// Resistances, as logarithms of those of a square of the layer: a contact of 1e-6 squares is nothing, and none leads better than a fifth of one.
pub(crate) const LN_SQUARES: [f32; 2] = [-3.0, 13.8];

/// Contacts of a scene, [`MAX_CONTACTS`] at most.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Scene {
    pub count: usize,
    pub spots: [Spot; MAX_CONTACTS],
}

impl Scene {
    pub const EMPTY: Self =
        Self { count: 0, spots: [Spot { at_m: [0.0; 2], ln_ohm: 0.0, ln_radius: 0.0 }; MAX_CONTACTS] };

    pub fn spots(&self) -> &[Spot] {
        &self.spots[..self.count.min(MAX_CONTACTS)]
    }

    /// The scene with one more; itself if it has all that there may be.
    pub fn with(mut self, spot: Spot) -> Self {
        if let Some(free) = self.spots.get_mut(self.count) {
            *free = spot;
            self.count += 1;
        }
        self
    }

    /// The scene without one.
    pub fn without(self, index: usize) -> Self {
        let kept = self.spots().iter().enumerate().filter(|(k, _)| *k != index);
        kept.fold(Self::default(), |scene, (_, spot)| scene.with(*spot))
    }

    fn moved(&self, step: &Vector, table: &Table<'_>) -> Self {
        let mut moved = *self;
        let head = table.head();
        for (spot, step) in moved.spots.iter_mut().zip(step.as_chunks::<PARAMETERS>().0).take(self.count) {
            let [x, y, ln_ohm, ln_radius] = *step;
            let shorter = head.radius_m * (LONGEST_WAY / libm::sqrtf(x * x + y * y).max(1e-9)).min(1.0);
            let held = |step: f32| step.clamp(-LONGEST_LOG, LONGEST_LOG);
            let to_m = table.held([spot.at_m[0] + shorter * x, spot.at_m[1] + shorter * y]);
            if table.holds(to_m[0], to_m[1]) {
                spot.at_m = to_m;
            }
            spot.ln_ohm = held_ohm(spot.ln_ohm + held(ln_ohm), table);
            spot.ln_radius = (spot.ln_radius + held(ln_radius)).clamp(LN_RADII[0], LN_RADII[1]);
        }
        moved
    }
}

/// The nearest resistance that a contact may have, as logarithms (ohm).
pub(crate) fn held_ohm(ln_ohm: f32, table: &Table<'_>) -> f32 {
    let square = -libm::logf(table.head().sheet_s);
    ln_ohm.max(square + LN_SQUARES[0]).min(square + LN_SQUARES[1])
}

/// What was done so far.
pub(crate) struct Working<'a> {
    pub done: &'a mut Work,
    /// Called after each piece of it.
    pub attend: &'a mut dyn FnMut(),
}

impl Working<'_> {
    /// The readings of so many contacts and their derivatives were worked out.
    fn worked_out(&mut self, contacts: usize) {
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Times that the readings of one, two or three contacts and all their derivatives were worked out.
    pub frames: [u32; MAX_CONTACTS],
    /// Places that were looked at for a first contact.
    pub first_looks: u32,
    /// Places that were looked at for one more.
    pub looks: u32,
}

/// Contacts that were fitted to a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    pub scene: Scene,
    /// Sum of squares of what they leave, and the same with what was known of radii before.
    pub cost: f32,
    pub objective: f32,
    /// What the readings say for each contact (squared deviations).
    pub information: [f32; MAX_CONTACTS],
    /// Standard deviation of the logarithms of radii that they were fitted with.
    pub radius_deviation: f32,
    /// Whether it is known that one more contact beside these would not be worth its price.
    pub is_alone: bool,
}

impl Fit {
    /// No contact.
    pub const NONE: Self = Self {
        scene: Scene::EMPTY,
        cost: 0.0,
        objective: 0.0,
        information: [0.0; MAX_CONTACTS],
        radius_deviation: ANY_RADIUS,
        is_alone: false,
    };
}

/// How a fit goes on.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Went {
    /// It has not ended.
    On,
    /// It has ended: with this, or with nothing if the scene makes no sense.
    ToEnd(Option<Fit>),
}

/// A fit under way.
#[derive(Clone, Debug)]
pub(crate) struct Fitting {
    scene: Scene,
    /// Of the scene.
    pub normal: Normal,
    /// What is looked at next.
    trial: Scene,
    radius_deviation: f32,
    damping: f32,
    /// Steps that it may still take, and tries of the next one so far.
    steps: u8,
    tries: u8,
    has_looked: bool,
}

impl Fitting {
    /// One that has nothing to do.
    pub const NONE: Self = Self {
        scene: Scene::EMPTY,
        normal: Normal::EMPTY,
        trial: Scene::EMPTY,
        radius_deviation: ANY_RADIUS,
        damping: FIRST_DAMPING,
        steps: 0,
        tries: 0,
        has_looked: false,
    };

    /// Begins to step from a scene to where it fits best, so many steps at most.
    pub fn begin(&mut self, scene: Scene, radius_deviation: f32, steps: u8) {
        (self.scene, self.trial, self.radius_deviation) = (scene, scene, radius_deviation);
        (self.damping, self.steps, self.tries, self.has_looked) = (FIRST_DAMPING, steps, 0, false);
    }

    /// Takes one look.
    pub fn go_on(&mut self, task: Task<'_>, circuit: &mut Circuit, work: &mut Working<'_>) -> Went {
        if !self.has_looked {
            self.has_looked = true;
            if !look(task, circuit, &self.trial, self.radius_deviation, &mut self.normal, work) {
                return Went::ToEnd(None);
            }
        } else {
            let mut normal = Normal::EMPTY;
            let makes_sense = look(task, circuit, &self.trial, self.radius_deviation, &mut normal, work);
            if makes_sense && normal.objective() < self.normal.objective() {
                (self.scene, self.normal) = (self.trial, normal);
                self.damping = (self.damping / DAMPING_STEP).max(LEAST_DAMPING);
                (self.steps, self.tries) = (self.steps - 1, 0);
            } else {
                self.damping *= DAMPING_STEP;
                self.tries += 1;
            }
        }
        let may_step = self.steps > 0 && self.tries < TRIES;
        match self.normal.step(self.damping).filter(|(_, gain)| may_step && *gain >= LEAST_GAIN) {
            Some((step, _)) => {
                self.trial = self.scene.moved(&step, task.table);
                Went::On
            }
            None => Went::ToEnd(Some(self.fit())),
        }
    }

    fn fit(&self) -> Fit {
        Fit {
            scene: self.scene,
            cost: self.normal.cost,
            objective: self.normal.objective(),
            information: self.normal.information(),
            radius_deviation: self.radius_deviation,
            is_alone: false,
        }
    }
}

/// What a scene leaves of a frame; `false` if it makes no sense.
fn look(
    Task { table, frame, errors }: Task<'_>,
    circuit: &mut Circuit,
    scene: &Scene,
    radius_deviation: f32,
    normal: &mut Normal,
    work: &mut Working<'_>,
) -> bool {
    if scene.count == 0 || !circuit.solve(table, scene.spots()) {
        return false;
    }
    normal.sum_up(table, circuit, frame, errors, radius_deviation);
    work.worked_out(scene.count);
    normal.objective().is_finite()
}
