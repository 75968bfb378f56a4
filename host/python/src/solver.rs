//! `Solver`: from readings back to touch.

use std::sync::{Mutex, PoisonError};

use pyo3::prelude::*;
use tactomo::solve::{FaultTolerant, Lambda, Method, Parameter, ParameterKind, Problem, Solver as Solves};

use crate::array::require_volts;
use crate::detector::Detector;
use crate::error::{raised, refused};
use crate::given::readings;
use crate::mesh::Mesh;
use crate::solution::Solution;

/// A method that reads touch from the readings of a frame.
///
/// `name` is one of `tactomo.SOLVERS`, which says what each is for. It leaves out electrodes that are broken or exchanged, once it has seen
/// that. `lambda_` is that of a linear image: a share of the largest singular value, or `"discrepancy"`, `"l-curve"` or `"gcv"`; with it,
/// no electrode is left out.
///
/// Some solvers go on from the frame before: one solver for one stream of frames.
#[pyclass(frozen, module = "tactomo")]
pub struct Solver {
    method: Method,
    problem: Problem,
    solves: Mutex<Box<dyn Solves>>,
}

#[pymethods]
impl Solver {
    #[new]
    #[pyo3(signature = (name = "auto", detector = None, *, lambda_ = None))]
    fn new(
        py: Python<'_>,
        name: &str,
        detector: Option<&Detector>,
        lambda_: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let method: Method = name.parse().map_err(raised)?;
        let lambda = lambda_.map(|lambda| lambda.str()?.extract::<String>()).transpose()?;
        let lambda: Option<Lambda> =
            lambda.map(|lambda| lambda.parse().map_err(|error| refused(format!("lambda_: {error}")))).transpose()?;
        if lambda.is_some() && method.parameter() != Some(ParameterKind::Lambda) {
            return Err(refused(format!("the solver {name} has no lambda: leave out lambda_")));
        }
        let detector = detector.map(|detector| detector.0.clone()).unwrap_or_default();
        let made = py.detach(|| -> Result<_, _> {
            let problem = Problem::of(&detector)?;
            let solves: Box<dyn Solves> = match lambda.map(Parameter::Lambda) {
                None => Box::new(FaultTolerant::new(method, &problem)?),
                lambda => method.build_with(&problem, lambda)?,
            };
            Ok((problem, solves))
        });
        let (problem, solves) = made.map_err(|error: tactomo::forward::ForwardError| raised(error))?;
        Ok(Self { method, problem, solves: Mutex::new(solves) })
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
