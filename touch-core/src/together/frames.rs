//! Fits of contacts to several frames: Gauss-Newton steps of what frames have in common, with patterns at each frame's contacts, damped where readings do not agree. What is a
//! frame's own is at its best for whatever that is (variable projection: Golub and Pereyra, 1973).

use super::Together;
use crate::answer::Contact;
use crate::evidence::{known, limit, ln_volume};
use crate::fit::{DAMPING_STEP, LEAST_GAIN};
use crate::frame::{Errors, Frame, left_v};
use crate::normal::{ANY_RADIUS, Normal};
use crate::products::dot;
use crate::real::Real;
use crate::round::{NOISE, On};
use crate::solver::Task;
use crate::table::Table;
use crate::vector::{PARAMETERS, Vector};

/// Steps of a frame's own parameters at most, and what one has to gain (squared deviations): what is left of them is in the next pass.
const OWN_STEPS: u8 = 3;
const WORTH: f32 = 3.0 * LEAST_GAIN;
/// Steps that are tried from a place; damping at the start and at least, shares of the diagonal.
const TRIES: u8 = 5;
const FIRST_DAMPING: f32 = 1e-3;
const LEAST_DAMPING: f32 = 1e-6;
/// Share by which what is taken for noise has to change to be taken anew.
const CHANGED: f32 = 0.2;

/// Frames that are explained together.
pub(super) struct Frames<'a, 't, T, const K: usize, const D: usize> {
    on: On<'a, 't, T, K, D>,
    frames: &'t [(Frame<'t, T>, Errors<T>)],
    /// Sums over frames of what their contacts have in common, and of the logarithms of the determinants of the information about what they have not.
    sum: Normal<T, K>,
    ln_own: T,
}

impl<'a, 't, T: Real, const K: usize, const D: usize> Frames<'a, 't, T, K, D> {
    pub fn new(on: On<'a, 't, T, K, D>, frames: &'t [(Frame<'t, T>, Errors<T>)]) -> Self {
        Self { on, frames, sum: Normal::EMPTY, ln_own: T::ZERO }
    }

    fn table(&self) -> &'t Table<'t> {
        self.on.task.table
    }

    /// Readings that count as voltages.
    fn readings(&self) -> T {
        self.frames.iter().map(|(_, errors)| T::of(errors.count as u32)).sum()
    }

    /// Looks at a frame: it, and what is taken for its noise (V).
    fn look_at(&mut self, number: usize, tau: T) -> (&'t Frame<'t, T>, T) {
        let (frame, errors) = &self.frames[number];
        self.on.task = Task { frame, errors, ..self.on.task };
        (frame, tau * errors.variance_v2.sqrt())
    }

    /// What is known of frames' own parameters.
    fn known(&self, at: &Together<T, K, D>) -> Vector<T, K> {
        at.motion.known(T::of(self.table().head().radius_m))
    }

    /// Goes to where contacts explain all frames best, in so many passes at most; `None` if they make no sense.
    pub fn fit(&mut self, start: Together<T, K, D>, passes: u8) -> Option<Together<T, K, D>> {
        let mut at = self.settled(start)?;
        self.take_noise(&mut at)?;
        let mut damping = T::of(FIRST_DAMPING);
        for _ in 0..passes {
            self.sum_up(&at)?;
            let before = at.objective;
            if let Some(better) = self.better(&at, &mut damping) {
                at = better;
            }
            let is_worth_it = before - at.objective >= T::of(WORTH);
            if !(self.take_noise(&mut at)? || is_worth_it) {
                break;
            }
        }
        Some(at)
    }

    /// The first of ever shorter steps that readings agree to, if one is worth it.
    fn better(&mut self, at: &Together<T, K, D>, damping: &mut T) -> Option<Together<T, K, D>> {
        let mut besides = T::ZERO;
        for _ in 0..TRIES {
            if let Some((to, gain)) = self.stepped(at, *damping, besides) {
                if gain < T::of(WORTH) {
                    return None;
                }
                if let Some(to) = self.settled(to).filter(|to| to.objective < at.objective) {
                    *damping = (*damping / T::of(DAMPING_STEP)).max(T::of(LEAST_DAMPING));
                    return Some(to);
                }
            }
            *damping *= T::of(DAMPING_STEP);
            besides = besides * T::of(DAMPING_STEP) + T::ONE;
        }
        None
    }

    /// Takes what is each frame's own to where it is best, and notes what is left then; `None` if it makes no sense.
    fn settled(&mut self, mut at: Together<T, K, D>) -> Option<Together<T, K, D>> {
        let known_of_radii = at.common.spots().iter().map(|spot| spot.ln_radius / T::of(ANY_RADIUS));
        let mut before: T = known_of_radii.map(|off| off * off).sum();
        before += dot(&at.common.steps, &at.common.steps);
        let mut left = T::ZERO;
        for number in 0..at.frames {
            let [of_frame, own] = self.settle(&mut at, number)?;
            left += of_frame;
            before += own;
        }
        at.cost = left * at.tau * at.tau;
        at.objective = left + before;
        Some(at).filter(|at| at.objective.is_finite())
    }

    /// The same for one frame: squares of what is left, and of how far its own parameters are from what is known of them.
    fn settle(&mut self, at: &mut Together<T, K, D>, number: usize) -> Option<[T; 2]> {
        let (table, known) = (self.table(), self.known(at));
        let (frame, noise_v) = self.look_at(number, at.tau);
        for step in 0..=OWN_STEPS {
            let scene = at.scene(number);
            if !self.on.read(&scene) {
                return None;
            }
            let (detector, circuit, held) = self.on.there();
            held.leave(frame, T::of(table.head().full_v), noise_v);
            let ways = scene.ways_from(&at.common, table);
            let count = PARAMETERS * scene.count;
            let mut own = None;
            if step < OWN_STEPS {
                let mut normal = Normal::noted(&detector, circuit, frame, noise_v, held);
                let Normal { matrix, pull, .. } = &mut normal;
                held.products(count, |i, j, product| matrix[i][j] = product, |i, product| pull[i] = product);
                normal.keep(&known, &ways);
                own = Some(normal.step(T::ZERO)?).filter(|(_, gain)| *gain >= T::of(WORTH));
            }
            let Some((step, _)) = own else {
                let off = (0..count).map(|i| known[i] * ways[i] * ways[i]).sum();
                return Some([dot(held.left(), held.left()), off]);
            };
            at.own[number] = scene.moved(&step, table).spots;
        }
        None
    }

    /// Takes as much for noise as is left, if that is other than before: whether it is. While a contact is missing the detector would else be bent until it explained it.
    fn take_noise(&mut self, at: &mut Together<T, K, D>) -> Option<bool> {
        let rms = (at.cost / self.readings()).sqrt();
        let tau = if rms > T::of(NOISE) { rms } else { T::ONE };
        if (tau - at.tau).abs() <= T::of(CHANGED) * at.tau {
            return Some(false);
        }
        *at = self.settled(Together { tau, ..at.clone() })?;
        Some(true)
    }

    /// Sums up all frames; `None` if they make no sense.
    fn sum_up(&mut self, at: &Together<T, K, D>) -> Option<()> {
        let (table, known, unknown) = (self.table(), self.known(at), self.on.unknown);
        let full_v = T::of(table.head().full_v);
        (self.sum, self.ln_own) = (Normal { count: PARAMETERS * at.common.count, ..Normal::EMPTY }, T::ZERO);
        self.on.parts.held.begin_sums(&at.common.steps);
        for number in 0..at.frames {
            let (frame, noise_v) = self.look_at(number, at.tau);
            let scene = at.scene(number);
            if !self.on.read(&scene) {
                return None;
            }
            let (detector, circuit, held) = self.on.there();
            let says = |index: usize, read_v: T| left_v(frame, index, full_v, read_v).is_some();
            held.hold(&detector, unknown, circuit, noise_v, says);
            Normal::noted(&detector, circuit, frame, noise_v, held);
            held.leave(frame, full_v, noise_v);
            let ways = scene.ways_from(&at.common, table);
            self.ln_own += held.add_to_sums(&mut self.sum, &known, &ways)?;
        }
        let weight = T::ONE / (T::of(ANY_RADIUS) * T::of(ANY_RADIUS));
        for (k, spot) in at.common.spots().iter().enumerate() {
            let i = PARAMETERS * k + 3;
            self.sum.matrix[i][i] += weight;
            self.sum.pull[i] -= weight * spot.ln_radius;
        }
        Some(())
    }

    /// All frames after a step of what they have in common, by the sums there, and by how much less is left then in the linear theory.
    fn stepped(&mut self, at: &Together<T, K, D>, damping: T, besides: T) -> Option<(Together<T, K, D>, T)> {
        let table = self.table();
        let (mut sum, held) = (self.sum, &mut self.on.parts.held);
        held.end_sums(&mut sum, besides)?;
        let (step, of_contacts) = at.common.step(&sum, damping, table)?;
        let mut to = at.clone();
        to.common = at.common.moved(&step, table);
        let of_detector = held.step_by_sums(&step, sum.count, &mut to.common.steps);
        (0..at.frames).for_each(|number| to.own[number] = at.scene(number).moved(&step, table).spots);
        to.make_common();
        Some((to, of_contacts + of_detector))
    }

    /// An explanation with its evidence, covariance and contacts; `None` if it makes no sense.
    pub fn judged(&mut self, found: Together<T, K, D>) -> Option<Together<T, K, D>> {
        let table = self.table();
        let mut found = if found.tau == T::ONE { found } else { self.settled(Together { tau: T::ONE, ..found })? };
        self.sum_up(&found)?;
        let (mut sum, held) = (self.sum, &mut self.on.parts.held);
        held.end_sums(&mut sum, T::ZERO)?;
        let posterior = sum.posterior(&known(table, self.on.circuit))?;
        let determinants = self.ln_own + held.ln_determinant();
        let known_of_own = found.motion.known(T::of(table.head().radius_m));
        let known_of_own = known_of_own.iter().take(sum.count).filter(|one| **one > T::ZERO);
        let ln_own = T::of(found.frames as u32) * known_of_own.clone().map(|one| one.ln()).sum() - determinants;
        found.ln_evidence =
            ln_volume(table, self.on.circuit, Some(&posterior)) + T::of(0.5) * (ln_own - found.objective);
        found.covariance = posterior.covariance;
        let determined = found.common.count * (PARAMETERS - 1) + found.frames * known_of_own.count();
        found.fits = found.cost <= limit(self.readings() - T::of(determined as u32));
        for number in 0..found.frames {
            if !self.on.read(&found.scene(number)) {
                return None;
            }
            let all = found.contacts[number].iter_mut().zip(&self.on.circuit.loaded);
            for (contact, one) in all.take(found.common.count) {
                let [x_m, y_m] = one.spot.at_m;
                let (conductance_s, radius_m) = (one.conductance_s(), one.radius_m);
                *contact = Contact { x_m, y_m, conductance_s, radius_m, ..Contact::default() };
            }
        }
        Some(found)
    }
}
