//! Solvers on their way: made beside the stream, for some take as long as some hundred frames.

use std::sync::Arc;
use std::thread;

use tactomo_physics::causes::with_causes;
use tactomo_touch::solve::{Method, Solver};

use super::inbox::{Event, Inbox};
use super::options::{BoxError, MakeSolver, Solving};
use super::order::{Made, Order};

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

/// A solver, and what it was ordered for.
pub type Ordered = (Order, Box<dyn Solver>);

/// Makes solvers, each in a thread of its own, one after the other; the last order counts.
pub struct Maker {
    make: MakeSolver,
    inbox: Arc<Inbox>,
    /// The solver in use, or the first that will be.
    method: Method,
    making: Option<Order>,
    /// Ordered while another is made.
    wanted: Option<Order>,
    refused: Option<String>,
}

impl Maker {
    /// Begins with the method of `solving`; what is made goes to `inbox`.
    pub fn new(solving: Solving, inbox: Arc<Inbox>) -> Self {
        let Solving { method, make, .. } = solving;
        Self { make, inbox, method, making: None, wanted: None, refused: None }
    }

    /// The method in use, or that will be.
    pub fn method(&self) -> Method {
        let next = self.wanted.as_ref().or(self.making.as_ref());
        next.map_or(self.method, |order| order.method)
    }

    /// Goes on with another method once there is a detector to make its solver for.
    pub fn begin_with(&mut self, method: Method) {
        self.method = method;
    }

    /// Orders a solver: it comes through the inbox.
    pub fn order(&mut self, order: Order) {
        self.refused = None;
        match self.making {
            Some(_) => self.wanted = Some(order),
            None => self.begin(order),
        }
    }

    /// Takes what was made: the solver to go on with, if it is the one that was ordered last.
    ///
    /// # Errors
    /// What the maker says of the solver that was ordered last.
    pub fn receive(&mut self, made: Made) -> Result<Option<Ordered>, BoxError> {
        self.making = None;
        if let Some(wanted) = self.wanted.take().filter(|wanted| *wanted != made.order) {
            self.begin(wanted);
            return Ok(None);
        }
        let method = made.order.method;
        match made.solver {
            Ok(solver) => {
                self.method = method;
                Ok(Some((made.order, solver)))
            }
            Err(error) => {
                self.refused = Some(format!("{}: {}", method.name(), with_causes(&*error)));
                Err(error)
            }
        }
    }

    /// Which solver is in use.
    pub fn state(&self) -> SolverState {
        let making = self.wanted.as_ref().or(self.making.as_ref()).map(|order| order.method);
        let making = making.filter(|method| *method != self.method);
        SolverState { method: self.method, making, refused: self.refused.clone() }
    }

    fn begin(&mut self, order: Order) {
        let (make, inbox, ordered) = (Arc::clone(&self.make), Arc::clone(&self.inbox), order.clone());
        let spawned = thread::Builder::new().name("solver maker".to_owned()).spawn(move || {
            let made = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| make(&ordered)));
            let solver = made.unwrap_or_else(|_| Err("making it panicked".into()));
            inbox.put(Event::Solver(Made { order: ordered, solver }));
        });
        match spawned {
            Ok(_) => self.making = Some(order),
            Err(error) => {
                let made = Made { order: order.clone(), solver: Err(error.into()) };
                self.inbox.put(Event::Solver(made));
                self.making = Some(order);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Mutex, PoisonError, mpsc};
    use std::time::Duration;

    use tactomo_physics::detector::Detector;
    use tactomo_touch::solve::FaultyElectrodes;

    use super::*;
    use tactomo_board::baseline::BaselineTracker;
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
    fn slow() -> (Maker, Arc<Inbox>, mpsc::Sender<()>) {
        let (go, goes) = mpsc::channel();
        let goes = Mutex::new(goes);
        let make: MakeSolver = Arc::new(move |order| {
            goes.lock().unwrap_or_else(PoisonError::into_inner).recv()?;
            match order.method {
                Method::Tsvd => Err("out of images".into()),
                method => Ok(Box::new(Named(method))),
            }
        });
        let inbox = Arc::new(Inbox::new(false));
        let solving = Solving {
            method: Method::Auto,
            make,
            look_at_wires: Arc::new(|_, _, _| None),
            begin_baseline: Arc::new(|_, _| BaselineTracker::over(0, 256)),
            learning: None,
        };
        (Maker::new(solving, Arc::clone(&inbox)), inbox, go)
    }

    fn order(method: Method) -> Order {
        Order {
            method,
            detector: Arc::new(Detector::preset(Detector::DEFAULT).unwrap()),
            faulty: FaultyElectrodes::default(),
        }
    }

    fn next(maker: &mut Maker, inbox: &Inbox) -> Result<Option<&'static str>, String> {
        let Event::Solver(made) = inbox.take(Duration::from_secs(60), true) else { panic!("no solver came") };
        let received = maker.receive(made).map_err(|error| error.to_string())?;
        Ok(received.map(|(_, solver)| solver.name()))
    }

    #[test]
    fn the_old_solver_stays_until_the_new_one_is_made() {
        let (mut maker, inbox, go) = slow();
        maker.order(order(Method::Noser));
        let waiting = SolverState { method: Method::Auto, making: Some(Method::Noser), refused: None };
        assert_eq!((maker.state(), maker.method()), (waiting, Method::Noser));
        go.send(()).unwrap();
        assert_eq!(next(&mut maker, &inbox), Ok(Some("noser")));
        assert_eq!(maker.state(), SolverState { method: Method::Noser, making: None, refused: None });
    }

    #[test]
    fn the_last_order_counts() {
        let (mut maker, inbox, go) = slow();
        for method in [Method::Noser, Method::Laplace, Method::Contacts] {
            maker.order(order(method));
            assert_eq!(maker.state().making, Some(method));
        }
        (0..2).for_each(|_| go.send(()).unwrap());
        assert_eq!(next(&mut maker, &inbox), Ok(None), "noser is no longer wanted");
        assert_eq!(next(&mut maker, &inbox), Ok(Some("contacts")));
    }

    #[test]
    fn a_method_that_cannot_be_made_is_refused() {
        let (mut maker, inbox, go) = slow();
        go.send(()).unwrap();
        maker.order(order(Method::Tsvd));
        assert_eq!(next(&mut maker, &inbox), Err("out of images".to_owned()));
        let refused = Some("tsvd: out of images".to_owned());
        assert_eq!(maker.state(), SolverState { method: Method::Auto, making: None, refused });
        maker.begin_with(Method::Nonlinear);
        assert_eq!(maker.state().method, Method::Nonlinear);
    }
}
