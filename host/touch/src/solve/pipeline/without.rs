//! Any solver, without the electrodes that cannot be right.

use super::method::Method;
use crate::solve::answer::{ElectrodeFault, Solution, SolveError, check_count};
use crate::solve::health::watch::FaultyElectrodes;
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;

/// The solver of a method without faulty electrodes; it takes the readings of all.
///
/// # Errors
/// [`ForwardError`] if the solver cannot be made.
pub fn without(method: Method, problem: &Problem, faulty: &FaultyElectrodes) -> Result<Box<dyn Solver>, ForwardError> {
    // What was taught by all electrodes needs all of them: what is wrong with one is beside what it was taught, and flagged.
    if faulty.faults.is_empty() || problem.is_learned(method) {
        return method.build(problem);
    }
    let electrodes = problem.detector().electrodes.len();
    let kept = faulty.kept(electrodes);
    let (excluded, faults) = faulty.faults.iter().copied().unzip();
    // A network was trained for all electrodes: to it, the readings of these were not taken, and are completed as those of a shorter scan.
    let hides = method == Method::Network;
    let solver = match hides {
        true => method.staged(problem, None)?,
        false => method.staged(&problem.through(&kept, &faulty.joints), None)?,
    };
    Ok(Box::new(solver.behind(Lens { electrodes, kept, excluded, faults, hides })))
}

/// Sees some electrodes of readings.
#[derive(Clone)]
pub(super) struct Lens {
    electrodes: usize,
    kept: Vec<usize>,
    excluded: Vec<usize>,
    faults: Vec<ElectrodeFault>,
    /// Whether the others are there and say nothing, instead of being left out.
    hides: bool,
}

impl Lens {
    /// The readings that are seen.
    pub fn readings(&self, all: &Readings) -> Result<Readings, SolveError> {
        check_count(all, self.electrodes)?;
        if self.hides {
            return Ok(all.clone().hiding(|g, e| self.excluded.contains(&g) || self.excluded.contains(&e)));
        }
        Ok(all.of(&self.kept))
    }

    /// Grounds among all electrodes, by their numbers among those that are seen.
    pub fn of_all(&self, grounds: &[usize]) -> Vec<usize> {
        grounds.iter().filter_map(|ground| self.kept.get(*ground).copied()).collect()
    }

    /// An answer that says what was left out.
    pub fn flagged(&self, mut solution: Solution) -> Solution {
        solution.flags.excluded.clone_from(&self.excluded);
        solution.flags.faults.clone_from(&self.faults);
        solution
    }
}
