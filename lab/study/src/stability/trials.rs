//! Solvers on the points of sweeps.

use std::sync::Arc;

use super::sweep::Point;
use crate::experiment::{Experiment, Frame, StudyError};
use crate::score::{Score, Scorer, Summary};
use crate::variant::Variation;
use tactomo_physics::forward::jacobian::Jacobian;
use tactomo_touch::solve::{Method, Problem, Solver};

/// Solvers and judges of the last problems, as long as they stay the same.
#[derive(Default)]
pub(super) struct Trials {
    scorer: Option<(Arc<Jacobian>, Scorer)>,
    solvers: Vec<Kept>,
}

/// A solver that is kept for the next point.
struct Kept {
    variation: Variation,
    jacobian: Arc<Jacobian>,
    /// None if it cannot be made for the model.
    solver: Option<Box<dyn Solver>>,
}

/// Solvers that are kept at most.
const MOST_KEPT: usize = 24;

impl Trials {
    /// What a solver makes of a point; `None` if it cannot be made for the model.
    pub fn summary(&mut self, method: Method, point: &Point) -> Result<Option<Summary>, StudyError> {
        let variation = match point.lambda {
            Some(lambda) => Variation::with_lambda(method, lambda),
            None => Variation::default_of(method),
        };
        let mut scores = Vec::new();
        for (place, frames) in point.places.iter().enumerate() {
            let experiment = point.known.get(place).unwrap_or(&point.experiment);
            match self.scores(variation, experiment, frames)? {
                Some(more) => scores.extend(more),
                None => return Ok(None),
            }
        }
        Ok(Some(Summary::of(&scores)))
    }

    /// Scores of a solver on the frames of a place; `None` if it cannot be made for the model.
    fn scores(
        &mut self,
        variation: Variation,
        experiment: &Experiment,
        frames: &[Frame],
    ) -> Result<Option<Vec<Score>>, StudyError> {
        let jacobian = &experiment.problem.jacobian;
        if !self.scorer.as_ref().is_some_and(|(last, _)| Arc::ptr_eq(last, jacobian)) {
            self.scorer = Some((Arc::clone(jacobian), Scorer::new(experiment)));
        }
        let index = self.kept(variation, &experiment.problem);
        match (&mut self.scorer, &mut self.solvers[index].solver) {
            (Some((_, scorer)), Some(solver)) => Ok(Some(scorer.run(&mut **solver, frames)?)),
            _ => Ok(None),
        }
    }

    /// Where a solver is kept; makes it if there is none.
    fn kept(&mut self, variation: Variation, problem: &Problem) -> usize {
        let same = |kept: &Kept| kept.variation == variation && Arc::ptr_eq(&kept.jacobian, &problem.jacobian);
        if let Some(index) = self.solvers.iter().position(same) {
            return index;
        }
        if self.solvers.len() >= MOST_KEPT {
            self.solvers.remove(0);
        }
        let solver = variation.build(problem).ok();
        self.solvers.push(Kept { variation, jacobian: Arc::clone(&problem.jacobian), solver });
        self.solvers.len() - 1
    }
}
