//! Solvers on the points of sweeps.

use std::sync::{Arc, Weak};

use super::sweep::{Bench, Point};
use crate::experiment::{Experiment, Frame, StudyError};
use crate::score::{Score, Scorer};
use crate::variant::Variation;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_touch::solve::{Method, Problem, Solver};

/// What solvers make of points. Each place is tried once: many sweeps begin at the same harmless point.
pub(super) struct Trials {
    scorer: Scorer,
    solvers: Solvers,
    tried: Vec<Tried>,
}

/// What solvers made of the frames of a place.
struct Tried {
    /// The problem, by its address: that stays taken.
    jacobian: Weak<Jacobian>,
    frames: Vec<Frame>,
    scores: Vec<(Variation, Option<Vec<Score>>)>,
}

/// Solvers of the problems that most points have, and the last one of another.
struct Solvers {
    shared: [Arc<Jacobian>; 2],
    kept: Vec<Kept>,
    last: Option<Kept>,
}

/// A solver, and the problem that it is made for.
struct Kept {
    variation: Variation,
    jacobian: Arc<Jacobian>,
    /// None if it cannot be made for the model.
    solver: Option<Box<dyn Solver>>,
}

impl Trials {
    /// None yet, of a bench's sweeps.
    pub fn new(bench: &Bench) -> Self {
        let shared = [&bench.sound, &bench.tolerant].map(|experiment| Arc::clone(&experiment.problem.jacobian));
        let solvers = Solvers { shared, kept: Vec::new(), last: None };
        Self { scorer: Scorer::of_errors(&bench.sound), solvers, tried: Vec::new() }
    }

    /// Scores of a solver at a point; `None` if it cannot be made for the model.
    pub fn scores(&mut self, method: Method, point: &Point) -> Result<Option<Vec<Score>>, StudyError> {
        let variation = match point.lambda {
            Some(lambda) => Variation::with_lambda(method, lambda),
            None => Variation::default_of(method),
        };
        let mut scores = Vec::new();
        for (place, frames) in point.places.iter().enumerate() {
            let experiment = point.known.get(place).unwrap_or(&point.experiment);
            match self.of_place(variation, experiment, frames)? {
                Some(more) => scores.extend(more.into_iter().skip(point.lead)),
                None => return Ok(None),
            }
        }
        Ok(Some(scores))
    }

    /// Scores of a solver on the frames of a place; `None` if it cannot be made for the model.
    fn of_place(
        &mut self,
        variation: Variation,
        experiment: &Experiment,
        frames: &[Frame],
    ) -> Result<Option<Vec<Score>>, StudyError> {
        let problem = &experiment.problem;
        let same =
            |tried: &Tried| Weak::as_ptr(&tried.jacobian) == Arc::as_ptr(&problem.jacobian) && tried.frames == frames;
        let index = self.tried.iter().position(same).unwrap_or_else(|| {
            let jacobian = Arc::downgrade(&problem.jacobian);
            self.tried.push(Tried { jacobian, frames: frames.to_vec(), scores: Vec::new() });
            self.tried.len() - 1
        });
        let tried = &mut self.tried[index].scores;
        if let Some((_, scores)) = tried.iter().find(|(before, _)| *before == variation) {
            return Ok(scores.clone());
        }
        let solver = self.solvers.of(variation, problem);
        let scores = solver.map(|solver| self.scorer.run(solver, frames)).transpose()?;
        tried.push((variation, scores.clone()));
        Ok(scores)
    }
}

impl Solvers {
    /// A solver of a problem, which is made if it is not there; `None` if it cannot be made for the model.
    fn of(&mut self, variation: Variation, problem: &Problem) -> Option<&mut dyn Solver> {
        let same = |kept: &Kept| kept.variation == variation && Arc::ptr_eq(&kept.jacobian, &problem.jacobian);
        let make = || {
            let jacobian = Arc::clone(&problem.jacobian);
            Kept { variation, jacobian, solver: variation.build(problem).ok() }
        };
        let kept = if self.shared.iter().any(|shared| Arc::ptr_eq(shared, &problem.jacobian)) {
            let index = self.kept.iter().position(same).unwrap_or_else(|| {
                self.kept.push(make());
                self.kept.len() - 1
            });
            &mut self.kept[index]
        } else {
            let last = self.last.take().filter(same).unwrap_or_else(make);
            self.last.insert(last)
        };
        match &mut kept.solver {
            Some(solver) => Some(&mut **solver),
            None => None,
        }
    }
}
