//! Any solver, without the electrodes that cannot be right.

use super::contacts::ContactSettings;
use super::follow::{Followed, Follower, Lead, Parts, Searcher};
use super::watch::{ElectrodeWatch, FaultyElectrodes, Look};
use super::{Contacts, ElectrodeFault, FoundContact, Method, Problem, Solution, SolveError, Solver};
use tactomo_physics::causes::with_causes;
use tactomo_physics::forward::ForwardError;
use tactomo_physics::readings::Readings;

/// Mean square of what one contact leaves of the readings with two wires exchanged back, as a share of that before and in what noise
/// makes, that shows an exchange.
const HEALED: f64 = 0.1;
const FITS: f64 = 6.0;
/// Exchanges that are tried with fits: those that leave least in the linear theory, as long as they leave at most such a share of what is left
/// without.
const TRIED: usize = 6;
const ROUGHLY_HEALED: f64 = 0.5;

/// A solver that leaves out electrodes that are open, shorted, exchanged or otherwise wrong, once it has seen that, and takes them back
/// when they are healthy.
pub struct Guard {
    method: Method,
    problem: Problem,
    solver: Box<dyn Solver>,
    watch: ElectrodeWatch,
}

impl Guard {
    /// Guards the solver of a method.
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
    fn guarded(
        &mut self,
        readings: &Readings,
        solve: impl Fn(&mut dyn Solver) -> Result<Solution, SolveError>,
    ) -> Result<Solution, SolveError> {
        super::check_count(readings, self.problem.detector().electrodes.len())?;
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

impl Solver for Guard {
    fn name(&self) -> &'static str {
        self.solver.name()
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        self.guarded(readings, |solver| solver.solve(readings))
    }

    fn solve_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Solution, SolveError> {
        self.guarded(latest, |solver| solver.solve_rows(rows, latest, elapsed_s))
    }

    fn reset(&mut self) {
        self.solver.reset();
    }
}

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
    let solver = if hides { method.build(problem)? } else { method.build(&problem.through(&kept, &faulty.joints))? };
    Ok(Box::new(Without { solver, lens: Lens { electrodes, kept, excluded, faults, hides } }))
}

/// Sees some electrodes of readings.
#[derive(Clone)]
struct Lens {
    electrodes: usize,
    kept: Vec<usize>,
    excluded: Vec<usize>,
    faults: Vec<ElectrodeFault>,
    /// Whether the others are there and say nothing, instead of being left out.
    hides: bool,
}

impl Lens {
    fn readings(&self, all: &Readings) -> Result<Readings, SolveError> {
        super::check_count(all, self.electrodes)?;
        if self.hides {
            return Ok(all.clone().hiding(|g, e| self.excluded.contains(&g) || self.excluded.contains(&e)));
        }
        Ok(all.of(&self.kept))
    }

    fn flagged(&self, mut solution: Solution) -> Solution {
        solution.flags.excluded.clone_from(&self.excluded);
        solution.flags.faults.clone_from(&self.faults);
        solution
    }
}

/// A solver behind a lens.
struct Without {
    solver: Box<dyn Solver>,
    lens: Lens,
}

impl Solver for Without {
    fn name(&self) -> &'static str {
        self.solver.name()
    }

    fn solve(&mut self, readings: &Readings) -> Result<Solution, SolveError> {
        self.solver.solve(&self.lens.readings(readings)?).map(|solution| self.lens.flagged(solution))
    }

    fn solve_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Solution, SolveError> {
        let (rows, latest) = (self.lens.readings(rows)?, self.lens.readings(latest)?);
        self.solver.solve_rows(&rows, &latest, elapsed_s).map(|solution| self.lens.flagged(solution))
    }

    fn reset(&mut self) {
        self.solver.reset();
    }

    fn split(self: Box<Self>) -> Parts {
        let Parts { follower, searcher } = self.solver.split();
        let lens = self.lens.clone();
        let searcher = searcher.map(|half| Box::new(Half { half, lens }) as Box<dyn Searcher>);
        Parts { follower: Box::new(Half { half: follower, lens: self.lens }), searcher }
    }
}

/// Half a solver behind a lens.
struct Half<T: ?Sized> {
    lens: Lens,
    half: Box<T>,
}

impl Follower for Half<dyn Follower> {
    fn follow(&mut self, readings: &Readings) -> Result<Followed, SolveError> {
        let followed = self.half.follow(&self.lens.readings(readings)?)?;
        Ok(Followed { solution: self.lens.flagged(followed.solution), ..followed })
    }

    fn follow_rows(&mut self, rows: &Readings, latest: &Readings, elapsed_s: f64) -> Result<Followed, SolveError> {
        let (rows, latest) = (self.lens.readings(rows)?, self.lens.readings(latest)?);
        let followed = self.half.follow_rows(&rows, &latest, elapsed_s)?;
        Ok(Followed { solution: self.lens.flagged(followed.solution), ..followed })
    }

    fn adopt(&mut self, lead: Lead, readings: &Readings) -> Result<Followed, SolveError> {
        let followed = self.half.adopt(lead, &self.lens.readings(readings)?)?;
        Ok(Followed { solution: self.lens.flagged(followed.solution), ..followed })
    }

    fn telling_grounds(&self, count: usize) -> Option<Vec<usize>> {
        let grounds = self.half.telling_grounds(count)?;
        Some(grounds.into_iter().filter_map(|ground| self.lens.kept.get(ground).copied()).collect())
    }

    fn lead(&self) -> Lead {
        self.half.lead()
    }

    fn inherit(&mut self, before: &[FoundContact]) {
        self.half.inherit(before);
    }

    fn reset(&mut self) {
        self.half.reset();
    }
}

impl Searcher for Half<dyn Searcher> {
    fn search(&mut self, from: Lead, readings: &Readings, found: &mut dyn FnMut(Lead)) -> Result<Lead, SolveError> {
        self.half.search(from, &self.lens.readings(readings)?, found)
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
                (left < FITS).then_some(pair)
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
    let most = ROUGHLY_HEALED * roughly(&kept);
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
    (after < FITS && after < HEALED * before).then_some(pair.map(|place| kept[place]))
}

#[cfg(test)]
mod tests;
