//! `Solver`: from readings back to touch.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, ThreadId};
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use tactomo::causes::with_causes;
use tactomo::forward::ForwardError;
use tactomo::learned::Learned as Taught;
use tactomo::readings::Readings;
use tactomo::solve::{
    FaultTolerant, Lambda, Method, Parameter, ParameterKind, Problem, Solution as Answer, SolveError, Solver as Solves,
};
use tactomo::threads;

use crate::array::require_volts;
use crate::detector::Detector;
use crate::error::{raised, refused};
use crate::given::{frames, readings};
use crate::learned::Learned;
use crate::mesh::Mesh;
use crate::solution::Solution;
use crate::solutions::Solutions;

/// Longest work before it is asked whether somebody has pressed Ctrl-C.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// A method that reads touch from the readings of a frame.
///
/// `name` is one of `tactomo.SOLVERS`, which says what each is for; unless given, `auto`. It leaves out electrodes that are broken or
/// exchanged, once it has seen that. `lambda_` is that of a linear image: a share of the largest singular value, or `"discrepancy"`,
/// `"l-curve"` or `"gcv"`; with it, no electrode is left out. `learned` is what presses on the sensor itself have taught; unless `name` is
/// given, the solver that uses it is chosen.
///
/// Some solvers go on from the frame before: one solver for one stream of frames.
#[pyclass(frozen, module = "tactomo")]
pub struct Solver {
    method: Method,
    parameter: Option<Parameter>,
    problem: Problem,
    solves: Mutex<Box<dyn Solves>>,
}

#[pymethods]
impl Solver {
    #[new]
    #[pyo3(signature = (name = None, detector = None, *, lambda_ = None, learned = None))]
    fn new(
        py: Python<'_>,
        name: Option<&str>,
        detector: Option<&Detector>,
        lambda_: Option<&Bound<'_, PyAny>>,
        learned: Option<&Learned>,
    ) -> PyResult<Self> {
        let taught = learned.map(|learned| learned.taught.clone());
        let method = chosen(name, taught.as_ref())?;
        let lambda = lambda_.map(|lambda| lambda.str()?.extract::<String>()).transpose()?;
        let lambda: Option<Lambda> =
            lambda.map(|lambda| lambda.parse().map_err(|error| refused(format!("lambda_: {error}")))).transpose()?;
        if lambda.is_some() && method.parameter() != Some(ParameterKind::Lambda) {
            return Err(refused(format!("the solver {} has no lambda: leave out lambda_", method.name())));
        }
        let detector = detector.map(|detector| detector.0.clone()).unwrap_or_default();
        let parameter = lambda.map(Parameter::Lambda);
        let made = py.detach(|| -> PyResult<_> {
            let problem = Problem::of(&detector).map_err(raised)?;
            let problem = match taught {
                Some(taught) => problem.with_learned(taught).map_err(raised)?,
                None => problem,
            };
            let solves: Box<dyn Solves> = match parameter {
                None => Box::new(FaultTolerant::new(method, &problem).map_err(raised)?),
                parameter => method.build_with(&problem, parameter).map_err(raised)?,
            };
            Ok((problem, solves))
        });
        let (problem, solves) = made?;
        Ok(Self { method, parameter, problem, solves: Mutex::new(solves) })
    }

    /// What the readings of a frame, less the baseline (V), say of the touch: `(n, n)` or `(n * n,)`, or a frame of a `Recording`.
    ///
    /// What stands still is averaged over frames. The very same readings again are the same observation, and tell no more than once.
    fn solve(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = readings)] readings: tactomo::readings::Readings,
    ) -> PyResult<Solution> {
        require_volts([&readings], self.problem.detector())?;
        let mut readings = readings;
        let solved = py.detach(|| {
            readings.correct_channels(self.problem.detector());
            self.solves.lock().unwrap_or_else(PoisonError::into_inner).solve(&readings)
        });
        Ok(Solution::new(py, solved.map_err(raised)?))
    }

    /// What many frames say, each less the baseline (V): `(frames, n, n)`, or frames of a `Recording`. Other threads run meanwhile, and Ctrl-C
    /// stops it.
    ///
    /// Frames are independent of each other, such as presses of a robot, and each is answered as by a new solver: on at most `cores` threads,
    /// all unless given, with the same result on any number of them. No electrode is left out, for that takes frames in a row. With
    /// `in_sequence` they follow each other: the result is that of `solve` with one after the other, on one thread.
    #[pyo3(signature = (frames, cores = None, *, in_sequence = false))]
    fn solve_many(
        &self,
        py: Python<'_>,
        frames: &Bound<'_, PyAny>,
        cores: Option<i64>,
        in_sequence: bool,
    ) -> PyResult<Solutions> {
        let cores = match cores.map(usize::try_from) {
            None => threads::cores(),
            Some(Ok(cores)) if cores > 0 => cores,
            _ => return Err(refused("cores: a number of threads from 1 on is needed, or None for all cores")),
        };
        let mut all = self::frames(frames, self.problem.detector())?;
        let asked = Interrupt::new();
        let answers = py.detach(|| {
            all.iter_mut().for_each(|readings| readings.correct_channels(self.problem.detector()));
            match in_sequence {
                true => self.one_after_the_other(&all, &asked),
                false => self.independently(&all, cores, &asked),
            }
        });
        match asked.raised.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(interrupt) => Err(interrupt),
            None => answers.map(Solutions::new),
        }
    }

    /// Forgets the frames before: the next answer is that of a new solver.
    fn reset(&self, py: Python<'_>) {
        py.detach(|| self.solves.lock().unwrap_or_else(PoisonError::into_inner).reset());
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &'static str {
        self.method.name()
    }

    /// The detector that it was made for.
    #[getter]
    fn detector(&self) -> Detector {
        Detector(self.problem.detector().clone())
    }

    /// Where its images are.
    #[getter]
    fn mesh(&self) -> Mesh {
        Mesh::new(self.problem.jacobian.image_mesh.clone(), self.problem.detector().clone())
    }

    fn __repr__(&self) -> String {
        format!("Solver({:?}, {:?})", self.method.name(), self.problem.detector().name)
    }
}

impl Solver {
    fn one_after_the_other(&self, all: &[Readings], asked: &Interrupt) -> PyResult<Vec<Answer>> {
        let mut solves = self.solves.lock().unwrap_or_else(PoisonError::into_inner);
        let mut answers = Vec::with_capacity(all.len());
        for (index, readings) in all.iter().enumerate() {
            answers.push(solves.solve(readings).map_err(|error| named(index, error))?);
            asked.ask();
            if asked.stop.load(Ordering::Relaxed) {
                break;
            }
        }
        Ok(answers)
    }

    fn independently(&self, all: &[Readings], cores: usize, asked: &Interrupt) -> PyResult<Vec<Answer>> {
        let idle: Mutex<Vec<Box<dyn Solves>>> = Mutex::default();
        let taken = || idle.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let solve = |readings: &Readings| -> Result<_, Unsolved> {
            let mut solves = match taken() {
                Some(solves) => solves,
                None => self.method.build_with(&self.problem, self.parameter)?,
            };
            solves.reset();
            let answer = solves.solve(readings)?;
            idle.lock().unwrap_or_else(PoisonError::into_inner).push(solves);
            Ok(answer)
        };
        let answers = threads::map_until(cores, all, &asked.stop, &|_| asked.ask(), solve);
        let named = |(index, answer): (usize, Result<_, Unsolved>)| {
            answer.map_err(|error| match error {
                Unsolved::Solve(error) => named(index, error),
                Unsolved::Forward(error) => raised(error),
            })
        };
        answers.into_iter().flatten().enumerate().map(named).collect()
    }
}

/// The solver that is named, or the one that uses what was learned.
pub fn chosen(name: Option<&str>, learned: Option<&Taught>) -> PyResult<Method> {
    let named = name.map(|name| name.parse::<Method>().map_err(raised)).transpose()?;
    match (named, learned.map(Taught::method)) {
        (Some(named), Some(taught)) if named != taught => Err(refused(format!(
            "what was learned is for the solver {}, not {}: leave out its name",
            taught.name(),
            named.name()
        ))),
        (named, taught) => Ok(named.or(taught).unwrap_or(Method::Auto)),
    }
}

/// Why a frame has no answer.
enum Unsolved {
    Solve(SolveError),
    Forward(ForwardError),
}

impl From<SolveError> for Unsolved {
    fn from(error: SolveError) -> Self {
        Self::Solve(error)
    }
}

impl From<ForwardError> for Unsolved {
    fn from(error: ForwardError) -> Self {
        Self::Forward(error)
    }
}

fn named(index: usize, error: SolveError) -> PyErr {
    refused(format!("frames[{index}]: {}", with_causes(&error)))
}

/// Ends work where somebody presses Ctrl-C: Python hears of that in its main thread alone, when it is asked.
struct Interrupt {
    /// The thread that asks: the one that called.
    asks: ThreadId,
    asked: Mutex<Instant>,
    stop: AtomicBool,
    raised: Mutex<Option<PyErr>>,
}

impl Interrupt {
    /// For work that this thread waits for.
    fn new() -> Self {
        Self {
            asks: thread::current().id(),
            asked: Mutex::new(Instant::now()),
            stop: AtomicBool::new(false),
            raised: Mutex::new(None),
        }
    }

    /// Asks, if that has not been done for a while; on another thread than its own it does nothing.
    fn ask(&self) {
        if thread::current().id() != self.asks {
            return;
        }
        let mut asked = self.asked.lock().unwrap_or_else(PoisonError::into_inner);
        if asked.elapsed() < LOOK_EVERY {
            return;
        }
        *asked = Instant::now();
        if let Err(error) = Python::attach(|py| py.check_signals()) {
            self.stop.store(true, Ordering::Relaxed);
            *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        }
    }
}
