//! The thread that answers: it takes the newest frame, follows what is known, and goes on from what searches find.

use std::path::PathBuf;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tactomo_board::identity::Sensor;
use tactomo_physics::detector::Detector;
use tactomo_touch::solve::{Method, Parts};

use super::Listener;
use super::answers::Answers;
use super::beneath::{Beneath, BeneathNotice};
use super::calibration::{Calibration, Meeting};
use super::event::TouchEvent;
use super::inbox::{Event, Found, Inbox, Searched, Taken};
use super::notice::NoticeBoard;
use super::options::{LiveError, Solving};
use super::order::Made;
use super::scanning::Planner;
use super::searcher::SearchThread;
use super::solvers::Solvers;
use super::wires::WireLooks;

/// Longest wait for a frame: then the rate shown falls.
const PATIENCE: Duration = Duration::from_millis(50);

/// The following thread, seen from the reader.
pub(super) struct FollowThread(JoinHandle<Result<(), LiveError>>);

impl FollowThread {
    /// Starts it; calibrated detectors are saved in `folder`.
    pub fn start(
        mut solving: Solving,
        inbox: &Arc<Inbox>,
        notice: Arc<NoticeBoard>,
        listeners: Vec<Box<dyn Listener>>,
        folder: PathBuf,
        planner: Planner,
    ) -> std::io::Result<Self> {
        let (ours, learning) = (|| Arc::clone(inbox), solving.learning.take());
        let follow = FollowLoop {
            inbox: ours(),
            wires: WireLooks::new(ours(), Arc::clone(&notice), Arc::clone(&solving.look_at_wires)),
            solvers: Solvers::new(solving, ours(), Arc::clone(&notice)),
            search: SearchThread::start(ours())?,
            calibration: Calibration::new(ours(), Arc::clone(&notice), folder, learning),
            answers: Answers::new(notice, listeners),
            planner,
            beneath: BeneathNotice::default(),
            answered: None,
        };
        let thread = thread::Builder::new().name("follower".to_owned());
        Ok(Self(thread.spawn(move || follow.run())?))
    }

    /// Waits for its end, after its inbox was closed.
    ///
    /// # Errors
    /// What ended it before.
    pub fn join(self) -> Result<(), LiveError> {
        self.0.join().unwrap_or(Err(LiveError::Panicked))
    }
}

/// Everything that the thread works with.
struct FollowLoop {
    /// Where frames come from.
    inbox: Arc<Inbox>,
    solvers: Solvers,
    search: SearchThread,
    wires: WireLooks,
    calibration: Calibration,
    /// Which rows the board is asked to scan.
    planner: Planner,
    /// Who is told.
    answers: Answers,
    beneath: BeneathNotice,
    /// The frame that was answered last, for answers that come after it.
    answered: Option<Arc<TouchEvent>>,
}

struct CloseOnDrop(Arc<Inbox>);

impl Drop for CloseOnDrop {
    fn drop(&mut self) {
        self.0.close();
    }
}

impl FollowLoop {
    fn run(mut self) -> Result<(), LiveError> {
        // However it ends, the reader is not left waiting.
        let _closes = CloseOnDrop(Arc::clone(&self.inbox));
        loop {
            match self.inbox.take(PATIENCE, self.solvers.are_ready()) {
                Event::Closed => {
                    self.answers.show_newest();
                    return Ok(());
                }
                Event::Quiet => self.be_quiet(),
                Event::Board(description) => self.begin_with(description),
                Event::Sensor(sensor) => self.meet(sensor),
                Event::Method(method) => self.solvers.change_method(method),
                Event::Pointer(on) => self.answers.set_pointer(on),
                Event::Solver(made) => self.change_solver(made)?,
                Event::Conversions(conversions) => self.solvers.set_conversions(conversions),
                Event::Rezero => self.solvers.renew_baseline(),
                Event::Jumped => self.jumped(),
                Event::Looked(look, found) => {
                    self.wires.ended();
                    self.solvers.looked(look, found);
                }
                Event::Searched(searched) => self.searched(searched)?,
                Event::Calibrate(ask) => {
                    let found = self.calibration.ask(ask);
                    self.use_found(found);
                }
                Event::Calibrated(number, outcome) => {
                    let found = self.calibration.receive(number, outcome);
                    self.use_found(found);
                }
                Event::Frame(frame) => self.frame(frame)?,
            }
        }
    }

    /// Where no frame comes, shows what is known and searches what is not.
    fn be_quiet(&mut self) {
        self.answers.show_newest();
        if let (Some(detector), Some(answered)) = (self.solvers.detector(), &self.answered)
            && let Some(tracker) = &detector.tracker
        {
            self.search.catch_up(&answered.touch, &**tracker);
        }
        self.answers.keep_fresh();
    }

    /// Forgets the frames before: those to come do not follow them.
    fn jumped(&mut self) {
        self.search.forget();
        self.solvers.jumped();
        self.answered = None;
    }

    /// Begins with a board's detector, or with another.
    fn begin_with(&mut self, description: Arc<Detector>) {
        self.answered = None;
        self.planner.restart();
        self.calibration.begin_with(Arc::clone(&description));
        self.solvers.begin_with(description);
    }

    /// Goes on with what was learned before of the sensor that is connected, and with nothing that was learned of another.
    fn meet(&mut self, sensor: Sensor) {
        match self.calibration.meet(sensor) {
            Meeting::AsBefore => {}
            Meeting::Known(learned) => self.solvers.use_calibrated(learned),
            Meeting::Unknown(description) => {
                self.answered = None;
                self.solvers.forget_calibrated(description);
            }
        }
    }

    /// Goes on with the detector that a calibration has found, if it has.
    fn use_found(&mut self, found: Option<Arc<Detector>>) {
        found.into_iter().for_each(|found| self.solvers.use_calibrated(found));
    }

    /// Goes on with a solver that was made. The first one has to be.
    fn change_solver(&mut self, made: Made) -> Result<(), LiveError> {
        let Some(solver) = self.solvers.receive(made)? else { return Ok(()) };
        let Some(detector) = self.solvers.detector() else { return Ok(()) };
        let Parts { mut tracker, search } = self.inbox.parts_of(solver);
        tracker.inherit(self.answers.contacts());
        self.search.change_solver(search);
        detector.tracker = Some(tracker);
        self.calibration.show_learned();
        self.inbox.set_ready();
        Ok(())
    }

    /// Goes on from what a search has found. Where a frame waits, the answer to that shows it.
    fn searched(&mut self, searched: Searched) -> Result<(), LiveError> {
        let is_last = searched.is_last;
        let Some(lead) = self.search.receive(searched) else { return Ok(()) };
        let (Some(detector), Some(answered)) = (self.solvers.detector(), &self.answered) else { return Ok(()) };
        let Some(tracker) = &mut detector.tracker else { return Ok(()) };
        let begun = Instant::now();
        let adopted = tracker.adopt(lead, &answered.touch)?;
        if is_last {
            self.search.pause_after(&adopted.solution);
        }
        if self.inbox.is_empty() {
            let event = answered.revised(adopted.solution);
            self.answer(event, adopted.search, begun, 0);
        }
        Ok(())
    }

    fn frame(&mut self, frame: Taken) -> Result<(), LiveError> {
        let begun = Instant::now();
        let method = self.solvers.method();
        if let Some(found) = frame.found.clone().filter(|found| method == Method::Core || !found.has_readings) {
            let Found { solution, is_taking_rest: is_taking_baseline, .. } = *found;
            let first = TouchEvent::new(frame.newest, frame.mean, solution);
            self.answers.tell(TouchEvent { is_taking_baseline, ..first }, begun, frame.came);
            return Ok(());
        }
        let others_are_left_out = self.solvers.note(&frame);
        let Some(detector) = self.solvers.detector() else { return Ok(()) };
        let touch = detector.touch(&frame.mean);
        let Some(followed) = detector.follow(&frame, &touch)? else { return Ok(()) };
        self.calibration.take(&frame, detector, &followed.solution.contacts);
        let event = TouchEvent { averaged: frame.averaged, ..TouchEvent::new(frame.newest, touch, followed.solution) };
        self.answer(event, followed.search, begun, frame.came);
        if others_are_left_out {
            self.solvers.order_again();
        }
        Ok(())
    }

    /// Tells an answer for which work has `begun` then, to the newest of so many frames that `came`, and has a better one searched if there may be
    /// one (`search`).
    fn answer(&mut self, event: TouchEvent, search: bool, begun: Instant, came: u32) {
        let (method, conversions) = (self.solvers.method(), self.solvers.conversions());
        let Some(detector) = self.solvers.detector() else { return };
        let is_taking_baseline = detector.baseline.state().is_taking();
        let beneath = Beneath::of(&detector.detector, &event.frame.used, &event.solution);
        if let Some(beneath) = self.beneath.take(beneath, event.frame.board_time_us) {
            tracing::info!("{beneath}");
        }
        let event = self.answers.tell(TouchEvent { is_taking_baseline, beneath, ..event }, begun, came);
        let solution = &event.solution;
        detector.watch.answered(solution);
        self.wires.answered(event.frame.time_s(), solution);
        if !self.wires.is_looking()
            && let Some(look) = detector.watch.look()
        {
            self.wires.begin(detector.order(method), look, event.touch.clone());
        }
        if let Some(tracker) = &detector.tracker {
            self.search.consider(search, solution, &event.touch, &**tracker);
            let telling = |count: usize| tracker.telling_grounds(count);
            self.planner.consider(&detector.detector, (!solution.contacts.is_empty(), conversions), telling);
        }
        self.answered = Some(event);
    }
}
