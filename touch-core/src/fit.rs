//! Damped Gauss-Newton steps of contacts to the readings of a frame.

use crate::circuit::{Circuit, MAX_CONTACTS, Spot};
use crate::frame::{Errors, Frame};
use crate::normal::{Normal, PARAMETERS, Vector};
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
const TRIES: usize = 4;
/// Radii, as logarithms over the usual one: from a fifth of it to three times it.
const LN_RADII: [f32; 2] = [-1.6, 1.1];
/// Resistances, as logarithms of those of a square of the layer: a contact of 1e-6 squares is nothing, and none leads better than a fifth of one.
const LN_SQUARES: [f32; 2] = [-3.0, 13.8];

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

/// Contacts fitted to a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fit {
    pub scene: Scene,
    pub normal: Normal,
    /// Whether it is known that one more contact beside these would not be worth its price.
    pub is_alone: bool,
}

/// Work under way.
pub(crate) struct Working<'a> {
    /// What was done so far.
    pub done: Work,
    /// Called after each piece of it.
    attend: &'a mut dyn FnMut(),
}

impl<'a> Working<'a> {
    /// Nothing is done yet.
    pub fn new(attend: &'a mut dyn FnMut()) -> Self {
        Self { done: Work::default(), attend }
    }

    /// The readings of so many contacts and their derivatives were worked out.
    fn worked_out(&mut self, contacts: usize) {
        self.done.frames[contacts - 1] += 1;
        (self.attend)();
    }

    /// A place was looked at for a first contact.
    pub fn looked_at_first(&mut self) {
        self.done.first_looks += 1;
    }

    /// A place was looked at for one more contact.
    pub fn looked(&mut self) {
        self.done.looks += 1;
        (self.attend)();
    }
}

/// What fits need.
pub(crate) struct Fitter<'a, 't, 'w> {
    pub table: &'a Table<'t>,
    pub frame: &'a Frame<'a>,
    pub errors: &'a Errors,
    pub circuit: &'a mut Circuit,
    pub work: &'a mut Working<'w>,
    /// Standard deviation of the logarithms of radii.
    pub radius_deviation: f32,
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

impl Fitter<'_, '_, '_> {
    /// What a scene leaves of the frame; `false` if it makes no sense.
    fn look(&mut self, scene: &Scene, normal: &mut Normal) -> bool {
        if scene.count == 0 || !self.circuit.solve(self.table, scene.spots()) {
            return false;
        }
        normal.sum_up(self.table, self.circuit, self.frame, self.errors, self.radius_deviation);
        self.work.worked_out(scene.count);
        normal.objective().is_finite()
    }

    /// Steps from a scene to where it fits best, so many at most; `None` if it makes no sense.
    pub fn fit(&mut self, scene: Scene, steps: usize) -> Option<Fit> {
        let mut at = Fit { scene, normal: Normal::EMPTY, is_alone: false };
        if !self.look(&scene, &mut at.normal) {
            return None;
        }
        let mut damping = FIRST_DAMPING;
        let mut trial = at;
        for _ in 0..steps {
            let mut tries = 0;
            let taken = loop {
                let Some((step, gain)) = at.normal.step(damping) else { break false };
                if gain < LEAST_GAIN || tries == TRIES {
                    break false;
                }
                trial.scene = at.scene.moved(&step, self.table);
                if self.look(&trial.scene, &mut trial.normal) && trial.normal.objective() < at.normal.objective() {
                    break true;
                }
                damping *= DAMPING_STEP;
                tries += 1;
            };
            if !taken {
                break;
            }
            at = trial;
            damping = (damping / DAMPING_STEP).max(LEAST_DAMPING);
        }
        Some(at)
    }
}
