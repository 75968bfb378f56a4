//! What reads the touch: the detector that is connected, the solver in use on it, and the one that will be.

use std::sync::Arc;

use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_touch::solve::{ElectrodeWatch, Look, Method, Solver};

use super::detector::DetectorState;
use super::inbox::{Inbox, Taken};
use super::maker::Maker;
use super::notice::NoticeBoard;
use super::options::{BeginBaseline, LiveError, Solving};
use super::order::Made;

/// Detector and solver, and what makes others of them.
pub(super) struct Solvers {
    notice: Arc<NoticeBoard>,
    maker: Maker,
    begin_baseline: BeginBaseline,
    /// Conversions that a reading is the mean of.
    conversions: u32,
    /// The detector that a calibration has found and that is used in place of the description.
    calibrated: Option<Arc<Detector>>,
    detector: Option<DetectorState>,
}

impl Solvers {
    /// No detector yet; solvers that were made come through `inbox`.
    pub fn new(solving: Solving, inbox: Arc<Inbox>, notice: Arc<NoticeBoard>) -> Self {
        let begin_baseline = Arc::clone(&solving.begin_baseline);
        let maker = Maker::new(solving, inbox);
        Self { notice, maker, begin_baseline, conversions: 1, calibrated: None, detector: None }
    }

    /// Whether frames can be answered.
    pub fn are_ready(&self) -> bool {
        self.detector.as_ref().is_some_and(|detector| detector.tracker.is_some())
    }

    /// The detector that is connected, once it is known.
    pub fn detector(&mut self) -> Option<&mut DetectorState> {
        self.detector.as_mut()
    }

    /// Conversions that a reading is the mean of.
    pub fn conversions(&self) -> u32 {
        self.conversions
    }

    /// Begins with a detector as it is described, or with another.
    pub fn begin_with(&mut self, description: Arc<Detector>) {
        let calibrated = |known: &Arc<Detector>| Arc::new(known.measured_as(&description));
        let detector = self.calibrated.as_ref().map_or_else(|| Arc::clone(&description), calibrated);
        let baseline = (self.begin_baseline)(&detector, self.conversions);
        self.detector = Some(DetectorState::new(detector, baseline));
        self.order_again();
    }

    /// Goes on with the detector that a calibration has found.
    pub fn use_calibrated(&mut self, found: Arc<Detector>) {
        let Some(detector) = &mut self.detector else { return };
        // Wires that it knows to be exchanged are none any more.
        detector.watch = ElectrodeWatch::new(&found);
        detector.detector = Arc::clone(&found);
        // It was found on this board: whatever was to be known of the calibration before is past.
        self.notice.change(|snapshot| (snapshot.calibrated, snapshot.calibration) = (Some(Arc::clone(&found)), None));
        self.calibrated = Some(found);
        self.order_again();
    }

    /// Goes on with the detector as it is described: what was found is of another sensor.
    pub fn forget_calibrated(&mut self, description: Arc<Detector>) {
        self.calibrated = None;
        self.notice.change(|snapshot| (snapshot.calibrated, snapshot.calibration) = (None, None));
        self.begin_with(description);
    }

    /// Readings are means of so many conversions from now on.
    pub fn set_conversions(&mut self, conversions: u32) {
        self.conversions = conversions;
        if let Some(detector) = &mut self.detector {
            detector.baseline.set_conversions(conversions);
        }
    }

    /// Takes the baseline anew.
    pub fn renew_baseline(&mut self) {
        if let Some(detector) = &mut self.detector {
            detector.baseline.renew();
        }
    }

    /// The frames to come do not follow those before.
    pub fn jumped(&mut self) {
        let tracker = self.detector.as_mut().and_then(|detector| detector.tracker.as_mut());
        tracker.into_iter().for_each(|tracker| tracker.reset());
    }

    /// Takes what a look at the wires has found.
    pub fn looked(&mut self, look: Look, found: Option<[usize; 2]>) {
        if self.detector.as_mut().is_some_and(|detector| detector.watch.conclude(look, found)) {
            self.order_again();
        }
    }

    /// Takes note of a frame: what it says of the baseline and of the electrodes; whether other electrodes are left out than before.
    pub fn note(&mut self, frame: &Taken) -> bool {
        let Some(detector) = &mut self.detector else { return false };
        let noted = detector.note(frame);
        if noted.baseline {
            let notice = detector.baseline.state().notice();
            notice.iter().for_each(|notice| tracing::warn!("{notice}"));
            self.notice.change(|snapshot| snapshot.baseline = notice);
        }
        noted.electrodes
    }

    /// Reads the touch by another method, as soon as its solver is made.
    pub fn change_method(&mut self, method: Method) {
        match &self.detector {
            None => self.maker.begin_with(method),
            Some(detector) => {
                self.maker.order(detector.order(method));
                self.show();
            }
        }
    }

    /// Orders the solver anew, for the detector as it is known by now.
    pub fn order_again(&mut self) {
        self.change_method(self.maker.method());
    }

    /// The method in use, or that will be.
    pub fn method(&self) -> Method {
        self.maker.method()
    }

    /// Takes a solver that was made; gives it back if it is the one to go on with.
    ///
    /// # Errors
    /// [`LiveError::MakeSolver`] if it is the first, and cannot be made.
    pub fn receive(&mut self, made: Made) -> Result<Option<Box<dyn Solver>>, LiveError> {
        let received = match (self.maker.receive(made), &self.detector) {
            (Ok(Some((order, solver))), Some(detector)) if order.detector == detector.detector => Some(solver),
            (Err(error), Some(DetectorState { tracker: None, .. })) => return Err(LiveError::MakeSolver(error)),
            (Err(error), _) => {
                tracing::warn!("the solver stays, for another cannot be made: {}", with_causes(&*error));
                None
            }
            _ => None,
        };
        self.show();
        Ok(received)
    }

    fn show(&self) {
        let state = self.maker.state();
        self.notice.publish(|snapshot| snapshot.solver = Some(state));
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tactomo_board::baseline::BaselineTracker;
    use tactomo_physics::readings::Readings;
    use tactomo_touch::solve::{Parts, Solution, SolveError};
    use tokio::sync::watch;

    use super::super::Snapshot;
    use super::super::inbox::Event;
    use super::*;

    struct Nothing;

    impl Solver for Nothing {
        fn name(&self) -> &'static str {
            "nothing"
        }

        fn solve(&mut self, _readings: &Readings) -> Result<Solution, SolveError> {
            Ok(Solution::default())
        }
    }

    /// Solvers of which that by `Tsvd` cannot be made.
    fn solvers() -> (Solvers, Arc<Inbox>, watch::Receiver<Arc<Snapshot>>) {
        let (snapshots, shown) = watch::channel(Arc::default());
        let inbox = Arc::new(Inbox::new(false));
        let solving = Solving {
            method: Method::Contacts,
            make: Arc::new(|order| match order.method {
                Method::Tsvd => Err("out of images".into()),
                _ => Ok(Box::new(Nothing)),
            }),
            look_at_wires: Arc::new(|_, _, _| None),
            begin_baseline: Arc::new(|_, _| BaselineTracker::over(0, 256)),
            learning: None,
        };
        (Solvers::new(solving, Arc::clone(&inbox), Arc::new(NoticeBoard::new(snapshots))), inbox, shown)
    }

    fn receive(solvers: &mut Solvers, inbox: &Inbox) -> Result<Option<Box<dyn Solver>>, LiveError> {
        let Event::Solver(made) = inbox.take(Duration::from_secs(60), true) else { panic!("no solver came") };
        solvers.receive(made)
    }

    #[test]
    fn a_solver_of_another_detector_than_the_one_connected_is_not_used() {
        let (mut solvers, inbox, shown) = solvers();
        let (first, other) = (Arc::new(Detector::default()), Detector { drive_v: 1.0, ..Detector::default() });
        solvers.begin_with(first);
        assert!(!solvers.are_ready() && shown.borrow().solver.as_ref().is_some_and(|state| state.making.is_none()));
        let Event::Solver(made) = inbox.take(Duration::from_secs(60), true) else { panic!("no solver came") };
        solvers.begin_with(Arc::new(other.clone()));
        assert!(solvers.receive(made).is_ok_and(|solver| solver.is_none()));
        let solver = receive(&mut solvers, &inbox).unwrap().expect("of the detector that is connected");
        let detector = solvers.detector().unwrap();
        assert_eq!(*detector.detector, other);
        detector.tracker = Some(Parts::whole(solver).tracker);
        assert!(solvers.are_ready());
    }

    #[test]
    fn only_the_first_solver_has_to_be_made_and_a_detector_that_was_found_stays() {
        let (mut solvers, inbox, shown) = solvers();
        solvers.change_method(Method::Tsvd);
        solvers.begin_with(Arc::new(Detector::default()));
        assert!(matches!(receive(&mut solvers, &inbox), Err(LiveError::MakeSolver(_))));
        let found = Detector { name: "found".to_owned(), ..Detector::default() };
        solvers.change_method(Method::Contacts);
        let solver = receive(&mut solvers, &inbox).unwrap().expect("it can be made");
        solvers.detector().unwrap().tracker = Some(Parts::whole(solver).tracker);
        solvers.change_method(Method::Tsvd);
        assert!(receive(&mut solvers, &inbox).is_ok_and(|solver| solver.is_none()), "the old one stays");
        assert!(shown.borrow().solver.as_ref().is_some_and(|state| state.refused.is_some()));
        solvers.use_calibrated(Arc::new(found));
        solvers.begin_with(Arc::new(Detector { drive_v: 1.0, ..Detector::default() }));
        let detector = &solvers.detector().unwrap().detector;
        assert_eq!((&*detector.name, detector.drive_v), ("found", 1.0), "as the board measures it");
    }

    #[test]
    fn what_is_to_be_known_of_a_calibration_goes_when_another_is_found_on_this_board() {
        let (mut solvers, _inbox, shown) = solvers();
        solvers.begin_with(Arc::default());
        let warn = |snapshot: &mut Snapshot| snapshot.calibration = Some("Calibrated on another board.".to_owned());
        solvers.notice.publish(warn);
        assert!(shown.borrow().calibration.is_some());
        solvers.use_calibrated(Arc::default());
        let Snapshot { calibration, calibrated, .. } = &**shown.borrow();
        assert_eq!((calibration, calibrated.is_some()), (&None, true));
    }
}
