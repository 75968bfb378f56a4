//! From readings to touch, step by step:
//!
//! 1. before: electrodes that are known to be wrong are [left out](without), and readings that were not taken, or reached an end of the
//!    converter's range, are [completed](crate::solve::before) for methods that need all;
//! 2. the [method](method) makes contacts, a shape or an image of them;
//! 3. after: contacts of a detector with a law of force carry [newtons](crate::solve::after), and those of a detector that was corrected by known presses are
//!    where these say; an answer of any method that leaves much of the readings is [flagged](Unexplained).
//!
//! A recording goes the same way as a live sensor. Live, the two halves of a solver run side by side ([`Solver::split`]): each of them is [`Staged`].
//! A [`FaultTolerant`](fault_tolerant::FaultTolerant) watches which electrodes are wrong, and leaves them out.

pub(crate) mod fault_tolerant;
pub(crate) mod method;
pub(crate) mod parameter;
pub(crate) mod unexplained;
pub(crate) mod without;

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;

use self::unexplained::Unexplained;
use self::without::Lens;
use crate::solve::after::correct::Corrector;
use crate::solve::after::force::Scale;
use crate::solve::answer::{FoundContact, Solution, SolveError, check_count};
use crate::solve::problem::Problem;
use crate::solve::solver::{Followed, Hypothesis, Parts, Search, Solver, Tracker};
use tactomo_physics::readings::Readings;
use tactomo_physics::scene::Contact;

/// What is done to readings before a method has them, and to its answers after. Cheap to clone.
#[derive(Clone, Default)]
pub(crate) struct Stages {
    /// The electrodes that are seen; all without it.
    lens: Option<Lens>,
    /// By which readings are completed.
    completed: Option<Problem>,
    /// What makes forces of readings.
    scale: Option<Arc<Scale>>,
    /// What known presses have corrected.
    corrector: Option<Arc<Corrector>>,
    /// What flags answers that leave much of the readings.
    unexplained: Option<Unexplained>,
}

impl Stages {
    /// What the detector of a problem asks for after any method.
    fn of(problem: &Problem) -> Self {
        Self {
            scale: Scale::of(problem).map(Arc::new),
            corrector: Corrector::of(problem.detector()).map(Arc::new),
            unexplained: Some(Unexplained::of(problem.detector())),
            ..Self::default()
        }
    }

    /// Completed readings, and nothing else.
    fn completing(problem: &Problem) -> Self {
        Self { completed: Some(problem.clone()), ..Self::default() }
    }

    /// Readings of the electrodes that are seen.
    fn seen<'a>(&self, readings: &'a Readings) -> Result<Cow<'a, Readings>, SolveError> {
        match &self.lens {
            Some(lens) => Ok(Cow::Owned(lens.readings(readings)?)),
            None => Ok(Cow::Borrowed(readings)),
        }
    }

    /// Readings as the method needs them, of those that are seen.
    fn before<'a>(&self, seen: &'a Readings) -> Result<Cow<'a, Readings>, SolveError> {
        let Some(problem) = &self.completed else { return Ok(Cow::Borrowed(seen)) };
        check_count(seen, problem.detector().electrodes.len())?;
        Ok(problem.completed(seen))
    }

    /// The method's answer to readings that were seen, as it leaves the solver.
    fn after(&self, seen: &Readings, mut solution: Solution) -> Solution {
        // Newtons are measured where the model explains the readings, so before places are corrected.
        if let Some(scale) = &self.scale {
            solution = scale.with_forces(seen, solution);
        }
        if let Some(corrector) = &self.corrector {
            solution = corrector.solution(solution);
        }
        if let Some(lens) = &self.lens {
            solution = lens.flagged(solution);
        }
        match &self.unexplained {
            Some(unexplained) => unexplained.flagged(seen, solution),
            None => solution,
        }
    }

    fn after_following(&self, seen: &Readings, Followed { solution, search }: Followed) -> Followed {
        Followed { solution: self.after(seen, solution), search }
    }
}

/// A solver, or half of one, between its stages.
pub(crate) struct Staged<T: ?Sized> {
    stages: Stages,
    half: Box<T>,
}

impl<T: ?Sized> Staged<T> {
    fn new(stages: Stages, half: Box<T>) -> Self {
        Self { stages, half }
    }
}

impl Staged<dyn Solver> {
    /// The solver, made for the electrodes that a lens sees.
    fn behind(self, lens: Lens) -> Self {
        Self { stages: Stages { lens: Some(lens), ..self.stages }, ..self }
    }
}

impl Solver for Staged<dyn Solver> {
    fn name(&self) -> &'static str {
        self.half.name()
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        let seen = self.stages.seen(readings)?;
        let solution = self.half.solve(&*self.stages.before(&seen)?)?;
        Ok(self.stages.after(&seen, solution))
    }

    fn solve_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Solution, SolveError> {
        let (rows, latest) = (self.stages.seen(rows)?, self.stages.seen(latest)?);
        let solution = match self.stages.completed {
            // Rows alone are not all readings.
            Some(_) => self.half.solve(&*self.stages.before(&latest)?)?,
            None => self.half.solve_rows(&rows, &latest, elapsed_s)?,
        };
        Ok(self.stages.after(&rows, solution))
    }

    fn explained_better(
        &mut self,
        readings: &Readings,
        explanations: &[Vec<Contact>],
    ) -> Result<Option<f64>, SolveError> {
        let seen = self.stages.seen(readings)?;
        self.half.explained_better(&*self.stages.before(&seen)?, explanations)
    }

    fn reset(&mut self) {
        self.half.reset();
    }

    fn split(self: Box<Self>) -> Parts {
        let Parts { tracker, search } = self.half.split();
        let stages = self.stages.clone();
        let search = search.map(|half| Box::new(Staged::new(stages, half)) as Box<dyn Search>);
        Parts { tracker: Box::new(Staged::new(self.stages, tracker)), search }
    }
}

impl Tracker for Staged<dyn Tracker> {
    fn follow(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        let seen = self.stages.seen(readings)?;
        let followed = self.half.follow(&*self.stages.before(&seen)?)?;
        Ok(self.stages.after_following(&seen, followed))
    }

    fn follow_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Followed, SolveError> {
        let (rows, latest) = (self.stages.seen(rows)?, self.stages.seen(latest)?);
        let followed = match self.stages.completed {
            Some(_) => self.half.follow(&*self.stages.before(&latest)?)?,
            None => self.half.follow_rows(&rows, &latest, elapsed_s)?,
        };
        Ok(self.stages.after_following(&rows, followed))
    }

    fn adopt(&mut self, hypothesis: Hypothesis, readings: &Readings) -> Result<Followed, SolveError> {
        let seen = self.stages.seen(readings)?;
        let followed = self.half.adopt(hypothesis, &*self.stages.before(&seen)?)?;
        Ok(self.stages.after_following(&seen, followed))
    }

    fn telling_grounds(&self, count: usize) -> Option<Vec<usize>> {
        let grounds = self.half.telling_grounds(count)?;
        Some(match &self.stages.lens {
            Some(lens) => lens.of_all(&grounds),
            None => grounds,
        })
    }

    fn hypothesis(&self) -> Hypothesis {
        self.half.hypothesis()
    }

    fn inherit(&mut self, before: &[FoundContact]) {
        // They were corrected to where they are; the half goes on from where contacts are found.
        match &self.stages.corrector {
            Some(corrector) => self.half.inherit(&corrector.found(before)),
            None => self.half.inherit(before),
        }
    }

    fn reset(&mut self) {
        self.half.reset();
    }
}

impl Search for Staged<dyn Search> {
    fn search(
        &mut self,
        from: Hypothesis,
        readings: &Readings,
        found: &mut dyn FnMut(Hypothesis) -> ControlFlow<()>,
    ) -> Result<Hypothesis, SolveError> {
        let seen = self.stages.seen(readings)?;
        self.half.search(from, &*self.stages.before(&seen)?, found)
    }
}
