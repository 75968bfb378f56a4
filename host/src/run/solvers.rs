//! The solver in use, and the next one while it is made.

use std::thread::{self, JoinHandle};

use super::plan::{BoxError, MakeSolver, Solving};
use tactomo_physics::detector::Detector;
use tactomo_touch::solve::{Method, Solver};

/// Which solver is in use, and what comes of the wish for another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SolverState {
    /// The one in use.
    pub method: Method,
    /// The one that will be, as soon as it is made.
    pub making: Option<Method>,
    /// Why the one that was asked for last cannot be made.
    pub refused: Option<String>,
}

/// Makes solvers beside the stream: for some that takes as long as some hundred frames.
pub struct Solvers {
    make: MakeSolver,
    method: Method,
    making: Option<Making>,
    /// Asked for while another is made.
    wanted: Option<Method>,
    refused: Option<String>,
}

/// A solver on its way.
struct Making {
    method: Method,
    detector: Detector,
    thread: JoinHandle<Result<Box<dyn Solver>, BoxError>>,
}

impl Solvers {
    /// Begins with the method of `solving`.
    pub fn new(solving: Solving) -> Self {
        let Solving { method, make } = solving;
        Self { make, method, making: None, wanted: None, refused: None }
    }

    /// Makes the solver in use for a detector, at once.
    ///
    /// # Errors
    /// What the maker says.
    pub fn make(&self, detector: &Detector) -> Result<Box<dyn Solver>, BoxError> {
        (self.make)(self.method, detector)
    }

    /// Changes to another method: at once before there is a detector, else as soon as its solver is [ready](Self::ready).
    pub fn change(&mut self, method: Method, detector: Option<&Detector>) {
        self.refused = None;
        match detector {
            None => self.method = method,
            Some(_) if self.making.is_some() => self.wanted = Some(method),
            Some(detector) => self.begin(method, detector),
        }
    }

    /// The next solver for `detector`, once it is made.
    pub fn ready(&mut self, detector: &Detector) -> Option<Box<dyn Solver>> {
        let Making { method, detector: made_for, thread } =
            self.making.take_if(|making| making.thread.is_finished())?;
        let made = thread.join().unwrap_or_else(|_| Err("the solver's maker panicked".into()));
        if let Some(wanted) = self.wanted.take().or_else(|| (made_for != *detector).then_some(method)) {
            self.begin(wanted, detector);
            return None;
        }
        match made {
            Ok(solver) => {
                self.method = method;
                Some(solver)
            }
            Err(error) => {
                tracing::warn!("no solver {}: {error}", method.name());
                self.refused = Some(format!("{}: {error}", method.name()));
                None
            }
        }
    }

    /// Which solver is in use.
    pub fn state(&self) -> SolverState {
        let making = self.wanted.or_else(|| self.making.as_ref().map(|making| making.method));
        SolverState { method: self.method, making, refused: self.refused.clone() }
    }

    fn begin(&mut self, method: Method, detector: &Detector) {
        let (make, made_for) = (self.make.clone(), detector.clone());
        let spawned = thread::Builder::new().name("solver maker".to_owned()).spawn(move || make(method, &made_for));
        match spawned {
            Ok(thread) => self.making = Some(Making { method, detector: detector.clone(), thread }),
            Err(error) => self.refused = Some(format!("{}: {error}", method.name())),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex, PoisonError, mpsc};

    use super::*;
    use tactomo_physics::readings::Readings;
    use tactomo_touch::solve::{Solution, SolveError};

    struct Named(Method);

    impl Solver for Named {
        fn name(&self) -> &'static str {
            self.0.name()
        }

        fn solve(&mut self, _readings: &Readings) -> Result<Solution, SolveError> {
            Ok(Solution::default())
        }
    }

    /// Solvers that are made when the sender says so; `Tsvd` cannot be made.
    fn slow() -> (Solvers, mpsc::Sender<()>) {
        let (go, goes) = mpsc::channel();
        let goes = Mutex::new(goes);
        let make: MakeSolver = Arc::new(move |method, _| {
            goes.lock().unwrap_or_else(PoisonError::into_inner).recv()?;
            if method == Method::Tsvd { Err("out of images".into()) } else { Ok(Box::new(Named(method))) }
        });
        (Solvers::new(Solving { method: Method::Auto, make }), go)
    }

    fn wait(solvers: &mut Solvers, detector: &Detector) -> Option<&'static str> {
        while solvers.making.as_ref().is_some_and(|making| !making.thread.is_finished()) {
            thread::yield_now();
        }
        solvers.ready(detector).map(|solver| solver.name())
    }

    #[test]
    fn the_old_solver_stays_until_the_new_one_is_made() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let (mut solvers, go) = slow();
        solvers.change(Method::Noser, Some(&detector));
        assert!(solvers.ready(&detector).is_none(), "it is not made yet");
        let waiting = SolverState { method: Method::Auto, making: Some(Method::Noser), refused: None };
        assert_eq!(solvers.state(), waiting);
        go.send(()).unwrap();
        assert_eq!(wait(&mut solvers, &detector), Some("noser"));
        assert_eq!(solvers.state(), SolverState { method: Method::Noser, making: None, refused: None });
    }

    #[test]
    fn the_last_wish_counts_and_is_made_for_the_detector_of_then() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let other = Detector::preset("square-50").unwrap();
        let (mut solvers, go) = slow();
        for method in [Method::Noser, Method::Laplace, Method::Contacts] {
            solvers.change(method, Some(&detector));
            assert_eq!(solvers.state().making, Some(method));
        }
        (0..3).for_each(|_| go.send(()).unwrap());
        assert_eq!(wait(&mut solvers, &detector), None, "noser is no longer wanted");
        assert_eq!(wait(&mut solvers, &other), None, "contacts were made for another detector");
        assert_eq!(wait(&mut solvers, &other), Some("contacts"));
    }

    #[test]
    fn a_method_that_cannot_be_made_is_refused() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let (mut solvers, go) = slow();
        go.send(()).unwrap();
        solvers.change(Method::Tsvd, Some(&detector));
        assert_eq!(wait(&mut solvers, &detector), None);
        let refused = Some("tsvd: out of images".to_owned());
        assert_eq!(solvers.state(), SolverState { method: Method::Auto, making: None, refused });
        solvers.change(Method::Nonlinear, None);
        assert_eq!(solvers.state(), SolverState { method: Method::Nonlinear, making: None, refused: None });
    }
}
