//! `core`: the contacts that a board finds by itself, from a table that the detector was compiled to.
//!
//! On a computer it works in `f64`, and finds up to [`MOST_CONTACTS`].

#[cfg(test)]
mod tests;

use tactomo_touch_core::{
    Answer, Contact, Flags as CoreFlags, Frame, FrameError, Motion, Room, Says as CoreSays, Solver as Core, Table,
    Together as CoreTogether, Unknown,
};

use crate::solve::answer::{Alternative, Flags, FoundContact, Solution, SolveError, Uncertainty, check_count};
use crate::solve::compiled::{
    CompileError, CompiledDetector, CompiledFields, MOST_CONTACTS, MOST_DIRECTIONS, compiled,
};
use crate::solve::fit::policy;
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::detector::ForceLaw;
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::{Readings, Says};
use tactomo_physics::scene::Contact as Disc;
use tactomo_physics::threads;

/// The core in a computer's numbers, for a computer's contacts.
type HostCore = Core<f64, MOST_CONTACTS, MOST_DIRECTIONS>;

/// `core`: contacts by the board's own search, by a table.
pub struct Compiled {
    detector: CompiledDetector,
    core: Box<HostCore>,
    /// Where the core works on what is not known.
    numbers: Vec<f64>,
    floats: Vec<f32>,
}

/// A frame of several, with the standard deviation of its noise (V).
pub(crate) struct NoisyFrame<'f> {
    pub readings: &'f Readings,
    pub noise_v: f64,
}

/// What explains several frames: contacts in each, which [stay or move](Motion), and the detector that they make likely.
#[derive(Clone)]
pub(crate) struct Together(Box<CoreTogether<f64, MOST_CONTACTS, MOST_DIRECTIONS>>);

impl Together {
    /// How many contacts.
    pub fn count(&self) -> usize {
        self.0.count()
    }

    /// Those of a frame.
    pub fn contacts(&self, frame: usize) -> Vec<Disc> {
        self.0.contacts(frame).iter().map(disc).collect()
    }

    /// The detector: in each direction in which it may differ, in standard deviations.
    pub fn steps(&self) -> &[f64] {
        self.0.steps()
    }

    /// Logarithm of the evidence, but for what is the same for all explanations of the same frames.
    pub fn ln_evidence(&self) -> f64 {
        self.0.ln_evidence()
    }

    /// Whether no more is left of the readings than noise leaves.
    pub fn fits(&self) -> bool {
        self.0.fits()
    }

    /// Covariance of what frames have in common: of each contact its place along x and y in usual radii, the logarithm of its resistance, that of its radius.
    pub fn covariance(&self, i: usize, j: usize) -> f64 {
        self.0.covariance(i, j)
    }
}

/// What explains a frame by itself: contacts, and the detector that they make likely.
pub(crate) struct FoundAlone {
    pub contacts: Vec<Disc>,
    /// In each direction in which the detector may differ, in standard deviations.
    pub steps: Vec<f64>,
    /// How sure their number is: its probability, and the likeliest other one; none if they do not explain the frame.
    pub certainty: Option<(f64, Option<Alternative>)>,
}

impl Compiled {
    /// Compiles the problem's detector.
    ///
    /// # Errors
    /// [`ForwardError`] if it is curved, or there are too many electrodes for a table.
    pub fn new(problem: &Problem) -> Result<Self, ForwardError> {
        let modelled = problem.modelled();
        Ok(Self::on(CompiledFields::of(modelled, threads::cores())?.measured(modelled)?))
    }

    /// On a detector that was compiled.
    pub(crate) fn on(detector: CompiledDetector) -> Self {
        let [numbers, floats] = detector.room;
        Self { core: Box::default(), numbers: vec![0.0; numbers], floats: vec![0.0; floats], detector }
    }

    /// What explains the mean of some frames, whose noise has such a standard deviation (V), by so many contacts at most: from some that are given, and from nothing.
    ///
    /// # Errors
    /// [`SolveError`] if the readings cannot be those of the detector.
    pub(crate) fn alone(
        &mut self,
        readings: &Readings,
        noise_v: f64,
        most: usize,
        from: &[Disc],
    ) -> Result<FoundAlone, SolveError> {
        let from: Vec<_> = from.iter().map(core_contact).collect();
        let answer = self.on_frame(readings, Some(noise_v), |core, table, unknown, room, frame| {
            core.begin_from(&from, table);
            core.limit(most);
            core.solve_unknown(table, unknown, room, frame)
        })?;
        Ok(FoundAlone {
            contacts: answer.contacts().iter().map(disc).collect(),
            steps: self.core.steps().to_vec(),
            certainty: answer.certainty.map(|certainty| (certainty.share, alternative(&answer))),
        })
    }

    /// The explanation of some frames by contacts that begin where they are in each, the same in the same order; `None` if they make no sense.
    pub(crate) fn together(
        &mut self,
        frames: &[NoisyFrame<'_>],
        contacts: &[Vec<Disc>],
        motion: Motion<f64, MOST_CONTACTS>,
    ) -> Option<Together> {
        let contacts: Vec<Vec<_>> = contacts.iter().map(|all| all.iter().map(core_contact).collect()).collect();
        let contacts: Vec<_> = contacts.iter().map(Vec::as_slice).collect();
        self.on_frames(frames, |core, table, unknown, room, frames| {
            core.together(table, unknown, room, frames, &contacts, motion).map(|found| Together(Box::new(found)))
        })
    }

    /// The likeliest explanation with one contact more than another that stay.
    pub(crate) fn one_more_together(&mut self, frames: &[NoisyFrame<'_>], from: &Together) -> Option<Together> {
        self.on_frames(frames, |core, table, unknown, room, frames| {
            core.one_more_together(table, unknown, room, frames, &from.0).map(|found| Together(Box::new(found)))
        })
    }

    /// Lets the core work on some frames.
    fn on_frames<R>(
        &mut self,
        frames: &[NoisyFrame<'_>],
        work: impl FnOnce(&mut HostCore, &Table<'_>, &Unknown<'_>, &mut Room<'_, f64>, &[Frame<'_, f64>]) -> Option<R>,
    ) -> Option<R> {
        let CompiledDetector { bytes, drive_v, changes, .. } = &self.detector;
        let read: Vec<_> = frames.iter().map(|frame| read(frame.readings, *drive_v)).collect();
        let frames = read.iter().zip(frames);
        let frames: Vec<_> = frames.map(|((volts, says), of)| Frame::new(volts, says).with_noise(of.noise_v)).collect();
        let table = Table::read_again(bytes).ok()?;
        let mut room = Room { numbers: &mut self.numbers, floats: &mut self.floats };
        work(&mut self.core, &table, &changes.unknown(), &mut room, &frames)
    }

    fn answer(&mut self, readings: &Readings, noise_v: Option<f64>) -> Result<Answer<f64, MOST_CONTACTS>, SolveError> {
        self.on_frame(readings, noise_v, |core, table, unknown, room, frame| {
            core.solve_unknown(table, unknown, room, frame)
        })
    }

    /// Lets the core work on a frame.
    fn on_frame<R>(
        &mut self,
        readings: &Readings,
        noise_v: Option<f64>,
        work: impl FnOnce(
            &mut HostCore,
            &Table<'_>,
            &Unknown<'_>,
            &mut Room<'_, f64>,
            &Frame<'_, f64>,
        ) -> Result<R, FrameError>,
    ) -> Result<R, SolveError> {
        let CompiledDetector { bytes, electrodes, drive_v, changes, .. } = &self.detector;
        check_count(readings, *electrodes)?;
        let (volts, says) = read(readings, *drive_v);
        let wrong = SolveError::Electrodes { found: readings.electrodes(), expected: *electrodes };
        // It was read, and checked, when it was compiled.
        let table = Table::read_again(bytes).map_err(|_| wrong.clone())?;
        let frame = Frame::new(&volts, &says);
        let frame = noise_v.map_or(frame, |noise_v| frame.with_noise(noise_v));
        let mut room = Room { numbers: &mut self.numbers, floats: &mut self.floats };
        work(&mut self.core, &table, &changes.unknown(), &mut room, &frame).map_err(|error| match error {
            FrameError::NotFinite { g, e } => SolveError::NotFinite { g, e },
            _ => wrong,
        })
    }
}

impl Solver for Compiled {
    fn name(&self) -> &'static str {
        "core"
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        Ok(solution(&self.answer(readings, None)?))
    }

    fn explained_better(&mut self, readings: &Readings, explanations: &[Vec<Disc>]) -> Result<Option<f64>, SolveError> {
        let answered = self.core.answer_evidence().unwrap_or(0.0);
        let mut best = f64::NEG_INFINITY;
        for contacts in explanations {
            let contacts: Vec<_> = contacts.iter().map(core_contact).collect();
            let evidence = self.on_frame(readings, None, |core, table, unknown, room, frame| {
                core.evidence(table, unknown, room, frame, &contacts)
            })?;
            best = best.max(0.5 * (evidence.unwrap_or(f64::NEG_INFINITY) - answered));
        }
        Ok(Some(best))
    }

    fn reset(&mut self) {
        self.core.reset();
    }
}

/// The table of a detector, as it is known and as its board measures it.
///
/// # Errors
/// [`CompileError`] if it is curved, has too many electrodes or no model.
pub fn compile(problem: &Problem) -> Result<Vec<u8>, CompileError> {
    compiled(problem.modelled(), problem.nuisance())
}

/// Readings as the core takes them: volts, and what they say.
fn read(readings: &Readings, drive_v: f64) -> (Vec<f64>, Vec<CoreSays>) {
    let volts = readings.volts().iter().map(|volts| held_v(*volts, drive_v)).collect();
    (volts, readings.all_say().iter().map(|says| core_says(*says)).collect())
}

/// A reading as a board can give it (V): none is far beyond its drive.
fn held_v(volts: f64, drive_v: f64) -> f64 {
    let most_v = 2.0 * drive_v;
    if volts.is_finite() { volts.clamp(-most_v, most_v) } else { volts }
}

/// Adds newtons to contacts that a board has found by a table, and none if these bytes are no table.
pub fn add_newtons(table: &[u8], law: &ForceLaw, contacts: &mut [FoundContact]) {
    let Ok(table) = Table::read_again(table) else { return };
    for contact in contacts {
        let at_m = [contact.x_m, contact.y_m].map(|m| m as f32);
        let apparent_s = contact.apparent_conductance_s.unwrap_or(contact.conductance_s) as f32;
        contact.set_force(law.force_n(table.constricted_conductance_s(at_m, apparent_s).into(), 0.0));
    }
}

fn disc(contact: &Contact<f64>) -> Disc {
    Disc::flat(contact.x_m, contact.y_m, contact.radius_m, contact.conductance_s)
}

fn core_contact(disc: &Disc) -> Contact<f64> {
    let Disc { x_m, y_m, radius_m, conductance_s, .. } = *disc;
    Contact { x_m, y_m, radius_m, conductance_s, ..Contact::default() }
}

fn core_says(says: Says) -> CoreSays {
    match says {
        Says::Voltage => CoreSays::Voltage,
        Says::AtMost => CoreSays::AtMost,
        Says::AtLeast => CoreSays::AtLeast,
        Says::Nothing => CoreSays::Nothing,
    }
}

/// The likeliest other number of contacts, if that is worth to be named.
fn alternative(answer: &Answer<f64, MOST_CONTACTS>) -> Option<Alternative> {
    let (contacts, certainty) = answer.certainty?.other?;
    Some(Alternative { contacts, certainty }).filter(|other| other.certainty >= policy::NAMED_SHARE)
}

fn solution(answer: &Answer<f64, MOST_CONTACTS>) -> Solution {
    let flags = answer.flags;
    Solution {
        contacts: answer.contacts().iter().map(found).collect(),
        residual: Some(answer.residual),
        certainty: answer.certainty.map(|certainty| certainty.share),
        alternative: alternative(answer),
        flags: Flags {
            saturated: flags.has(CoreFlags::SATURATED),
            misfit: flags.has(CoreFlags::MISFIT) || flags.has(CoreFlags::MORE),
            calibrate: flags.has(CoreFlags::CALIBRATE),
            ..Flags::default()
        },
        ..Solution::default()
    }
}

fn found(contact: &Contact<f64>) -> FoundContact {
    let [x_m, y_m] = contact.sigma_m.map(f64::from);
    let uncertainty =
        Uncertainty { x_m, y_m, correlation: contact.correlation, conductance_s: contact.conductance_sigma_s };
    let is_known = contact.radius_sigma_m / contact.radius_m < policy::KNOWN_RADIUS_DEVIATION;
    FoundContact {
        apparent_conductance_s: Some(contact.apparent_conductance_s),
        radius_m: is_known.then_some(contact.radius_m),
        uncertainty: Some(uncertainty).filter(|errors| errors.x_m.is_finite() && errors.y_m.is_finite()),
        id: Some(contact.id),
        ..FoundContact::flat(contact.x_m, contact.y_m, contact.conductance_s)
    }
}
