//! Any solver, watched: it goes on without the electrodes that its readings show to be wrong.

use super::method::Method;
use super::without::without;
use crate::solve::answer::{ElectrodeFault, Solution, SolveError, check_count};
use crate::solve::fit::policy;
use crate::solve::health::watch::{ElectrodeWatch, FaultyElectrodes, Look};
use crate::solve::methods::contacts::{ContactSettings, Contacts};
use crate::solve::problem::Problem;
use crate::solve::solver::Solver;
use tactomo_physics::causes::with_causes;
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;

/// Exchanges that are tried with fits: those that leave least in the linear theory.
const TRIED: usize = 6;

/// A solver that leaves out electrodes that are open, shorted, exchanged or otherwise wrong, once it has seen that, and takes them back
/// when they are healthy.
///
/// ```
/// use tactomo_physics::{detector::Detector, readings::Readings};
/// use tactomo_touch::solve::{FaultTolerant, Method, Problem, Solver};
///
/// let mut solver = FaultTolerant::new(Method::Tikhonov, &Problem::of(&Detector::default())?)?;
/// solver.solve(&Readings::from_fn(16, |_, _| 0.0))?;
/// assert!(solver.excluded().is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct FaultTolerant {
    method: Method,
    problem: Problem,
    solver: Box<dyn Solver>,
    watch: ElectrodeWatch,
}

impl FaultTolerant {
    /// Watches the solver of a method.
    ///
    /// # Errors
    /// [`ForwardError`] if the solver cannot be made.
    pub fn new(method: Method, problem: &Problem) -> Result<Self, ForwardError> {
        Ok(Self {
            solver: method.build(problem)?,
            method,
            watch: ElectrodeWatch::new(problem.detector()),
            problem: problem.clone(),
        })
    }

    /// Electrodes that are left out, and why.
    pub fn excluded(&self) -> &[(usize, ElectrodeFault)] {
        &self.watch.faulty().faults
    }

    /// An answer of the solver, without the electrodes that the latest readings show to be wrong.
    fn watched(
        &mut self,
        readings: &Readings,
        solve: impl Fn(&mut dyn Solver) -> Result<Solution, SolveError>,
    ) -> Result<Solution, SolveError> {
        check_count(readings, self.problem.detector().electrodes.len())?;
        if self.watch.note(readings) {
            self.rebuild();
        }
        let solution = solve(&mut *self.solver)?;
        self.watch.answered(&solution);
        if let Some(look) = self.watch.look() {
            let found = look.run(&self.problem, self.watch.faulty(), readings);
            if self.watch.conclude(look, found) {
                self.rebuild();
                return solve(&mut *self.solver);
            }
        }
        Ok(solution)
    }

    fn rebuild(&mut self) {
        match without(self.method, &self.problem, self.watch.faulty()) {
            Ok(solver) => self.solver = solver,
            Err(error) => tracing::warn!("there is no solver without the faulty electrodes: {}", with_causes(&error)),
        }
    }
}

impl Solver for FaultTolerant {
    fn name(&self) -> &'static str {
        self.solver.name()
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        self.watched(readings, |solver| solver.solve(readings))
    }

    fn solve_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Solution, SolveError> {
        self.watched(latest, |solver| solver.solve_rows(rows, latest, elapsed_s))
    }

    fn reset(&mut self) {
        self.solver.reset();
    }
}

impl Look {
    /// Looks, for some 10 ms: the pair of wires that is exchanged, or no longer is.
    pub fn run(self, problem: &Problem, faulty: &FaultyElectrodes, readings: &Readings) -> Option<[usize; 2]> {
        match self {
            Self::Exchanged => exchanged(problem, faulty, readings),
            Self::Healed(pair) => {
                let others = faulty.but(&pair);
                let kept = others.kept(problem.detector().electrodes.len());
                let left = one_contact(problem, &kept, &others)?.left_by_one(&readings.of(&kept))?;
                (left < policy::WRONG_MEAN_SQUARE).then_some(pair)
            }
        }
    }
}

fn one_contact(problem: &Problem, kept: &[usize], faulty: &FaultyElectrodes) -> Option<Contacts> {
    let settings = ContactSettings { most: 1, ..ContactSettings::of(problem) };
    Contacts::new(&problem.through(kept, &faulty.joints), settings).ok()
}

/// The exchange of two wires that makes the readings those of one contact.
fn exchanged(problem: &Problem, faulty: &FaultyElectrodes, readings: &Readings) -> Option<[usize; 2]> {
    let kept = faulty.kept(problem.detector().electrodes.len());
    let contacts = one_contact(problem, &kept, faulty)?;
    let exchanging = |[i, j]: [usize; 2]| {
        let mut order = kept.clone();
        order.swap(i, j);
        order
    };
    let roughly = |order: &[usize]| contacts.roughly_left_by_one(&readings.of(order));
    let most = policy::HEALED_SHARE_ROUGHLY * roughly(&kept);
    let pairs = (0..kept.len()).flat_map(|i| (0..i).map(move |j| [j, i]));
    let mut tried: Vec<_> =
        pairs.map(|pair| (roughly(&exchanging(pair)), pair)).filter(|(left, _)| *left < most).collect();
    if tried.is_empty() {
        return None;
    }
    tried.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let residual = |order: &[usize]| contacts.left_by_one(&readings.of(order));
    let before = residual(&kept)?;
    // What is explained to within noise needs no exchange.
    if before < 1.0 {
        return None;
    }
    let scored = tried.iter().take(TRIED).filter_map(|(_, pair)| Some((residual(&exchanging(*pair))?, *pair)));
    let (after, pair) = scored.min_by(|a, b| a.0.total_cmp(&b.0))?;
    (after < policy::WRONG_MEAN_SQUARE && after < policy::HEALED_SHARE * before)
        .then_some(pair.map(|place| kept[place]))
}

#[cfg(test)]
mod tests;
