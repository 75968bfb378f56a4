//! The thread that answers: it takes the newest frame, follows what is known, and goes on from what searches find.

use std::path::PathBuf;
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tactomo_physics::causes::with_causes;
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_touch::pointer::{Pointer, PointerState};
use tactomo_touch::solve::{ElectrodeWatch, Followed, FoundContact, Method, Parts, Solution};

use super::board::BoardState;
use super::calibration::{Calibrate, Desk};
use super::event::{Answer, Listeners};
use super::inbox::{Event, Inbox, Searched, Taken};
use super::maker::Maker;
use super::notice::NoticeBoard;
use super::order::Made;
use super::plan::{BeginBaseline, LiveError, Solving};
use super::scanning::{PlanWish, Planner, ScanChoice};
use super::searcher::SearchThread;
use super::{FrameSnapshot, Listener};

/// Longest wait for a frame: then the rate shown falls.
const PATIENCE: Duration = Duration::from_millis(50);

/// Pause after a search that has changed nothing, doubled each time up to the second: what cannot be explained better need not be searched
/// a hundred times a second. A residual that jumps ends the pause.
const PAUSE: [Duration; 2] = [Duration::from_millis(10), Duration::from_millis(320)];
/// Rise of the residual that ends it.
const JUMP: f64 = 1.3;

/// The following thread, seen from the reader.
pub(super) struct FollowThread(JoinHandle<Result<(), LiveError>>);

impl FollowThread {
    /// Starts it.
    pub fn start(
        solving: Solving,
        inbox: &Arc<Inbox>,
        notice: &Arc<NoticeBoard>,
        listeners: Vec<Box<dyn Listener>>,
        folder: PathBuf,
        (scan, wish): (ScanChoice, Arc<PlanWish>),
    ) -> std::io::Result<Self> {
        let search = SearchThread::start(Arc::clone(inbox), Arc::clone(&solving.look_at_wires))?;
        let begin_baseline = Arc::clone(&solving.begin_baseline);
        let maker = Maker::new(solving, Arc::clone(inbox));
        let (inbox, notice) = (Arc::clone(inbox), Arc::clone(notice));
        let desk = FollowLoop {
            inbox,
            notice,
            maker,
            search,
            listeners: Listeners::new(listeners),
            begin_baseline,
            conversions: 1,
            board: None,
            pause: SearchPause::default(),
            solved: None,
            wants_search: false,
            found: Vec::new(),
            unshown: None,
            calibration: None,
            calibrations: 0,
            calibrated: None,
            folder,
            pointer: None,
            planner: Planner::new(scan),
            wish,
        };
        let thread = thread::Builder::new().name("follower".to_owned());
        Ok(Self(thread.spawn(move || desk.run())?))
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
    inbox: Arc<Inbox>,
    notice: Arc<NoticeBoard>,
    maker: Maker,
    search: SearchThread,
    listeners: Listeners,
    begin_baseline: BeginBaseline,
    /// Conversions that a reading is the mean of.
    conversions: u32,
    board: Option<BoardState>,
    pause: SearchPause,
    /// The frame that was solved last, for answers that come after it.
    solved: Option<Solved>,
    /// Whether a search may find something better for it.
    wants_search: bool,
    /// The contacts that were found last, for another solver to number on from.
    found: Vec<FoundContact>,
    /// The newest answer, if it came too soon after the one that is shown.
    unshown: Option<FrameSnapshot>,
    /// The calibration under way, and how many there have been.
    calibration: Option<Desk>,
    calibrations: u64,
    /// The detector that was found by one and is used in place of the description.
    calibrated: Option<Arc<Detector>>,
    /// Where calibrated detectors are saved.
    folder: PathBuf,
    /// What makes a pointer of a contact, if one is.
    pointer: Option<Pointer>,
    /// Which rows the board is asked to scan.
    planner: Planner,
    wish: Arc<PlanWish>,
}

/// A frame that was answered.
struct Solved {
    frame: Taken,
    touch: Readings,
}

/// When to search again.
#[derive(Default)]
struct SearchPause {
    until: Option<Instant>,
    length: Duration,
    residual: f64,
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
        self.work()
    }

    fn work(&mut self) -> Result<(), LiveError> {
        loop {
            let is_ready = self.board.as_ref().is_some_and(|board| board.follower.is_some());
            match self.inbox.take(PATIENCE, is_ready) {
                Event::Closed => {
                    self.show_newest();
                    return Ok(());
                }
                Event::Quiet => self.be_quiet(),
                Event::Board(detector) => self.begin_with(detector),
                Event::Method(method) => self.change_method(method),
                Event::Pointer(on) => self.pointer = on.then(|| self.pointer.take().unwrap_or_default()),
                Event::Solver(made) => self.change_solver(made)?,
                Event::Conversions(conversions) => {
                    self.conversions = conversions;
                    if let Some(board) = &mut self.board {
                        board.baseline.set_conversions(conversions);
                    }
                }
                Event::Rezero => {
                    if let Some(board) = &mut self.board {
                        board.baseline.renew();
                    }
                }
                Event::Jumped => {
                    self.search.forget();
                    (self.solved, self.wants_search) = (None, false);
                    if let Some(board) = &mut self.board {
                        board.follower.as_mut().into_iter().for_each(|follower| follower.reset());
                    }
                }
                Event::Looked(look, found) => {
                    self.search.looked();
                    let changed = self.board.as_mut().is_some_and(|board| board.watch.conclude(look, found));
                    if changed {
                        self.order(self.maker.method());
                    }
                }
                Event::Searched(searched) => self.searched(searched)?,
                Event::Calibrate(ask, board) => self.calibrate(ask, board),
                Event::Calibrated(number, outcome) => {
                    if let Some(desk) = &mut self.calibration {
                        desk.receive(number, outcome);
                    }
                    self.show_calibration();
                }
                Event::Frame(frame) => self.frame(frame)?,
            }
        }
    }

    /// Goes on from what a search has found. Where a frame waits, the answer to that shows it.
    fn searched(&mut self, searched: Searched) -> Result<(), LiveError> {
        let is_last = searched.is_last;
        let Some(lead) = self.search.receive(searched) else { return Ok(()) };
        let (Some(board), Some(solved)) = (&mut self.board, &self.solved) else { return Ok(()) };
        let Some(follower) = &mut board.follower else { return Ok(()) };
        let begun = Instant::now();
        let adopted = follower.adopt(lead, &solved.touch)?;
        if is_last {
            self.pause.after_search(&adopted.solution);
        }
        if self.inbox.is_empty() {
            self.answer(adopted, begun, false);
        }
        Ok(())
    }

    /// Where no frame comes, shows what is known and searches what is not.
    fn be_quiet(&mut self) {
        self.show_newest();
        if self.wants_search
            && self.pause.until.is_none_or(|until| Instant::now() >= until)
            && !self.search.is_busy()
            && let (Some(board), Some(solved)) = (&self.board, &self.solved)
            && let Some(follower) = &board.follower
        {
            self.wants_search = false;
            self.search.search(follower.hypothesis(), solved.touch.clone());
        }
        self.notice.keep_fresh();
    }

    /// Shows the newest answer, if it has come too soon after the one that is shown.
    fn show_newest(&mut self) {
        if let Some(shown) = self.unshown.take() {
            self.notice.publish(|snapshot| snapshot.frame = Some(shown));
        }
    }

    /// Begins with a board's detector, or with another.
    fn begin_with(&mut self, description: Arc<Detector>) {
        let calibrated = |known: &Arc<Detector>| Arc::new(known.measured_as(&description));
        let detector = self.calibrated.as_ref().map_or_else(|| Arc::clone(&description), calibrated);
        let baseline = (self.begin_baseline)(&detector, self.conversions);
        self.board = Some(BoardState::new(description, detector, baseline));
        self.solved = None;
        self.planner.restart();
        // Frames of another board, or of other settings of its converter, are no part of it.
        self.calibration = None;
        self.show_calibration();
        self.order(self.maker.method());
    }

    /// Does what a person asks of the calibration.
    fn calibrate(&mut self, ask: Calibrate, identity: Option<String>) {
        let Some(board) = &mut self.board else { return };
        match (ask, &mut self.calibration) {
            (Calibrate::Begin, None) => {
                self.calibrations += 1;
                let (description, inbox) = (Arc::clone(&board.description), Arc::clone(&self.inbox));
                self.calibration =
                    Some(Desk::new(self.calibrations, description, identity, self.folder.clone(), inbox));
            }
            (Calibrate::End, _) => self.calibration = None,
            (Calibrate::Use, Some(desk)) => {
                if let Some(found) = desk.use_found() {
                    // Wires that it knows to be exchanged are none any more.
                    board.watch = ElectrodeWatch::new(&found);
                    board.detector = Arc::clone(&found);
                    self.notice.change(|snapshot| snapshot.calibrated = Some(Arc::clone(&found)));
                    self.calibrated = Some(found);
                    self.order(self.maker.method());
                }
            }
            (ask, Some(desk)) => desk.ask(ask),
            (_, None) => {}
        }
        self.show_calibration();
    }

    /// Shows how the calibration is, if that is due.
    fn show_calibration(&mut self) {
        match &mut self.calibration {
            None => self.notice.change(|snapshot| snapshot.calibrating = None),
            Some(desk) => {
                if let Some(shown) = desk.newly_shown() {
                    self.notice.change(|snapshot| snapshot.calibrating = Some(Arc::new(shown)));
                }
            }
        }
    }

    /// Gives the newest frame, or the rows that came, to the calibration: less the baseline, as the channels read them.
    fn rub(&mut self, frame: &Taken, found: &[FoundContact]) {
        let (Some(board), Some(desk)) = (&self.board, &mut self.calibration) else { return };
        if board.baseline.state().is_taking() {
            return;
        }
        let time_s = |time_us: u64| 1e-6 * time_us as f64;
        for rows in &frame.rows {
            desk.take(&board.less_rest(&rows.readings), time_s(rows.time_us), found);
        }
        if frame.rows.is_empty() {
            desk.take(&board.less_rest(&frame.newest), time_s(frame.board_time_us), found);
        }
        self.show_calibration();
    }

    fn change_method(&mut self, method: Method) {
        match self.board {
            Some(_) => self.order(method),
            None => self.maker.begin_with(method),
        }
    }

    fn order(&mut self, method: Method) {
        let Some(board) = &self.board else { return };
        self.maker.order(board.order(method));
        self.show_solver();
    }

    /// Goes on with a solver that was made. The first one has to be.
    fn change_solver(&mut self, made: Made) -> Result<(), LiveError> {
        match (self.maker.receive(made), &mut self.board) {
            (Ok(Some((order, solver))), Some(board)) if order.detector == board.detector => {
                let Parts { tracker: mut follower, search: searcher } = self.inbox.parts_of(solver);
                follower.inherit(&self.found);
                self.search.change_solver(searcher);
                board.follower = Some(follower);
                self.inbox.set_ready();
                self.pause = SearchPause::default();
            }
            (Err(error), Some(BoardState { follower: None, .. })) => return Err(LiveError::MakeSolver(error)),
            (Err(error), _) => tracing::warn!("the solver stays, for another cannot be made: {}", with_causes(&*error)),
            _ => {}
        }
        self.show_solver();
        Ok(())
    }

    fn show_solver(&self) {
        let state = self.maker.state();
        self.notice.publish(|snapshot| snapshot.solver = Some(state));
    }

    fn frame(&mut self, frame: Taken) -> Result<(), LiveError> {
        let Some(board) = &mut self.board else { return Ok(()) };
        let begun = Instant::now();
        let noted = board.note(&frame);
        if noted.baseline {
            let notice = board.baseline.state().notice();
            notice.iter().for_each(|notice| tracing::warn!("{notice}"));
            self.notice.change(|snapshot| snapshot.baseline = notice);
        }
        let touch = board.touch(&frame.mean);
        let Some(followed) = board.follow(&frame, &touch)? else { return Ok(()) };
        self.rub(&frame, &followed.solution.contacts);
        self.solved = Some(Solved { frame, touch });
        self.answer(followed, begun, true);
        if noted.electrodes {
            self.order(self.maker.method());
        }
        Ok(())
    }

    /// Gives an answer to the newest frame, and searches a better one if there may be one.
    fn answer(&mut self, followed: Followed, begun: Instant, is_new: bool) {
        let (Some(board), Some(solved)) = (&mut self.board, &self.solved) else { return };
        let Followed { solution, search } = followed;
        self.wants_search = search;
        let now = Instant::now();
        self.notice.count(|meter| {
            let came = if is_new { solved.frame.came } else { 0 };
            meter.solved(came, now - solved.frame.arrived, now - begun);
        });
        let time_s = 1e-6 * solved.frame.board_time_us as f64;
        let take = |pointer: &mut Pointer| pointer.take(time_s, &solution.contacts);
        let pointer_events = self.pointer.as_mut().map(take).unwrap_or_default();
        let is_taking_baseline = board.baseline.state().is_taking();
        let answer = Answer {
            touch: &solved.touch,
            solution: &solution,
            ready: now,
            is_revision: !is_new,
            is_taking_baseline,
            pointer_events,
        };
        self.listeners.tell(&solved.frame, answer);
        board.watch.answered(&solution);
        if !self.search.is_looking()
            && let Some(look) = board.watch.look()
        {
            self.search.look(board.order(self.maker.method()), look, solved.touch.clone());
        }
        if search
            && !self.search.is_busy()
            && self.pause.is_over(&solution, now)
            && let Some(follower) = &board.follower
        {
            self.search.search(follower.hypothesis(), solved.touch.clone());
        }
        let telling = |count: usize| board.follower.as_ref()?.telling_grounds(count);
        self.planner.consider(&self.wish, &board.detector, (!solution.contacts.is_empty(), self.conversions), telling);
        self.found.clone_from(&solution.contacts);
        let pointer = self.pointer.as_ref().map(Pointer::state);
        let shown = solved.frame.snapshot(solution, pointer, is_taking_baseline);
        if self.notice.is_due() {
            self.unshown = None;
            self.notice.publish(|snapshot| snapshot.frame = Some(shown));
        } else {
            self.unshown = Some(shown);
        }
    }
}

impl SearchPause {
    /// Whether a search is worth it again.
    fn is_over(&self, solution: &Solution, now: Instant) -> bool {
        let residual = solution.residual.unwrap_or_default();
        self.until.is_none_or(|until| now >= until) || residual > JUMP * self.residual
    }

    /// Pauses after a search: the longer, the less has changed.
    fn after_search(&mut self, solution: &Solution) {
        let residual = solution.residual.unwrap_or_default();
        let is_same = self.until.is_some() && residual * JUMP > self.residual && residual < JUMP * self.residual;
        self.length = if is_same { (2 * self.length).min(PAUSE[1]) } else { PAUSE[0] };
        self.until = Some(Instant::now() + self.length);
        self.residual = residual;
    }
}

impl Taken {
    fn snapshot(&self, solution: Solution, pointer: Option<PointerState>, rezeroing: bool) -> FrameSnapshot {
        FrameSnapshot {
            sequence: self.sequence,
            board_time_us: self.board_time_us,
            arrived: self.arrived,
            status: self.status,
            readings: self.measured.clone(),
            solution,
            pointer,
            rezeroing,
        }
    }
}
