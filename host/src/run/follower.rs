//! The thread that answers: it takes the newest frame, follows what is known, and goes on from what searches find.

use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use tactomo_board::baseline::Baseline;
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_touch::solve::{ElectrodeWatch, Followed, Follower, Method, Parts, Solution};

use super::inbox::{Event, Inbox, Taken};
use super::maker::{Made, Maker, Order};
use super::notice::NoticeBoard;
use super::plan::{Listener, LiveError, Solving};
use super::searcher::SearchThread;
use super::steady::Steady;
use super::{FrameSnapshot, SolvedFrame};

/// Longest wait for a frame: then the rate shown falls.
const PATIENCE: Duration = Duration::from_millis(50);

/// Rest after a search that has changed nothing, doubled each time up to the second: what cannot be explained better need not be searched
/// a hundred times a second. A residual that jumps ends the rest.
const REST: [Duration; 2] = [Duration::from_millis(10), Duration::from_millis(320)];
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
    ) -> std::io::Result<Self> {
        let search = SearchThread::start(Arc::clone(inbox), Arc::clone(&solving.look_at_wires))?;
        let maker = Maker::new(solving, Arc::clone(inbox));
        let (inbox, notice) = (Arc::clone(inbox), Arc::clone(notice));
        let desk = Desk {
            inbox,
            notice,
            maker,
            search,
            listeners,
            seat: None,
            rest: Rest::default(),
            solved: None,
            better: None,
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
struct Desk {
    inbox: Arc<Inbox>,
    notice: Arc<NoticeBoard>,
    maker: Maker,
    search: SearchThread,
    listeners: Vec<Box<dyn Listener>>,
    seat: Option<Seat>,
    rest: Rest,
    /// The frame that was solved last, for answers that come after it.
    solved: Option<Solved>,
    /// A better answer to it, which the next frame's will replace.
    better: Option<(Followed, Instant)>,
}

/// What belongs to one detector.
struct Seat {
    detector: Arc<Detector>,
    noise_v: f64,
    baseline: Baseline,
    watch: ElectrodeWatch,
    /// `None` until the first solver is made.
    follower: Option<Box<dyn Follower>>,
    /// The mean of what was followed, for searches.
    steady: Option<Steady>,
}

/// A frame on the desk.
struct Solved {
    frame: Taken,
    touch: Readings,
}

/// When to search again.
#[derive(Default)]
struct Rest {
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

impl Desk {
    fn run(mut self) -> Result<(), LiveError> {
        // However it ends, the reader is not left waiting.
        let _closes = CloseOnDrop(Arc::clone(&self.inbox));
        self.work()
    }

    fn work(&mut self) -> Result<(), LiveError> {
        loop {
            let is_ready = self.seat.as_ref().is_some_and(|seat| seat.follower.is_some());
            match self.inbox.take(PATIENCE, is_ready) {
                Event::Closed => return Ok(()),
                Event::Quiet => {
                    if let Some((better, begun)) = self.better.take() {
                        self.answer(better, begun, false);
                    }
                    self.notice.keep_fresh();
                }
                Event::Board(detector) => self.sit_down(detector),
                Event::Method(method) => self.change_method(method),
                Event::Solver(made) => self.change_solver(made)?,
                Event::Rezero => {
                    if let Some(seat) = &mut self.seat {
                        seat.baseline.renew();
                    }
                }
                Event::Jumped => {
                    if let Some(seat) = &mut self.seat {
                        seat.steady = None;
                        seat.follower.as_mut().into_iter().for_each(|follower| follower.reset());
                    }
                }
                Event::Looked(look, found) => {
                    self.search.looked();
                    let changed = self.seat.as_mut().is_some_and(|seat| seat.watch.conclude(look, found));
                    if changed {
                        self.order(self.maker.method());
                    }
                }
                Event::Searched(searched) => {
                    let is_last = searched.is_last;
                    if let Some(lead) = self.search.receive(searched)
                        && let (Some(seat), Some(solved)) = (&mut self.seat, &self.solved)
                        && let Some(follower) = &mut seat.follower
                    {
                        let begun = Instant::now();
                        let adopted = follower.adopt(lead, &solved.touch)?;
                        if is_last {
                            self.rest.after_search(&adopted.solution);
                        }
                        self.better = Some((adopted, begun));
                    }
                }
                Event::Frame(frame) => self.frame(frame)?,
            }
        }
    }

    /// Begins with a board's detector, or with another.
    fn sit_down(&mut self, detector: Arc<Detector>) {
        self.seat = Some(Seat {
            noise_v: detector.adc.deviation_v(),
            baseline: Baseline::new(&detector),
            watch: ElectrodeWatch::new(&detector),
            detector,
            follower: None,
            steady: None,
        });
        self.solved = None;
        self.order(self.maker.method());
    }

    fn change_method(&mut self, method: Method) {
        match self.seat {
            Some(_) => self.order(method),
            None => self.maker.begin_with(method),
        }
    }

    fn order(&mut self, method: Method) {
        let Some(seat) = &self.seat else { return };
        self.maker.order(seat.order(method));
        self.show_solver();
    }

    /// Goes on with a solver that was made. The first one has to be.
    fn change_solver(&mut self, made: Made) -> Result<(), LiveError> {
        match (self.maker.receive(made), &mut self.seat) {
            (Ok(Some((order, solver))), Some(seat)) if order.detector == seat.detector => {
                let Parts { follower, searcher } = self.inbox.parts_of(solver);
                self.search.change_solver(searcher);
                seat.follower = Some(follower);
                self.inbox.set_ready();
                self.rest = Rest::default();
            }
            (Err(error), Some(Seat { follower: None, .. })) => return Err(LiveError::MakeSolver(error)),
            (Err(error), _) => tracing::warn!("the solver stays, for another cannot be made: {error}"),
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
        let Some(seat) = &mut self.seat else { return Ok(()) };
        let begun = Instant::now();
        if seat.baseline.add(frame.mean.volts(), frame.averaged) {
            self.notice.change(|snapshot| snapshot.baseline = seat.baseline.state().notice());
        }
        let mut touch = frame.mean.clone();
        seat.baseline.subtract(frame.mean.volts(), touch.volts_mut());
        seat.keep_steady(&touch);
        let changed = seat.watch.note(&touch);
        let Some(follower) = &mut seat.follower else { return Ok(()) };
        let followed = follower.follow(&touch)?;
        self.better = None;
        self.solved = Some(Solved { frame, touch });
        self.answer(followed, begun, true);
        if changed {
            self.order(self.maker.method());
        }
        Ok(())
    }

    /// Gives an answer to the frame on the desk, and searches a better one if there may be one.
    fn answer(&mut self, followed: Followed, begun: Instant, is_new: bool) {
        let (Some(seat), Some(solved)) = (&mut self.seat, &self.solved) else { return };
        let Followed { solution, search } = followed;
        let now = Instant::now();
        self.notice.count(|meter| {
            let came = if is_new { solved.frame.came } else { 0 };
            meter.solved(came, now - solved.frame.arrived, now - begun);
        });
        let told = SolvedFrame { frame: &solved.frame, solution: &solution, age: now - solved.frame.arrived };
        self.listeners.iter_mut().for_each(|listener| listener.solved(&told));
        if !self.search.is_busy() {
            if let Some(look) = seat.watch.look(&solution) {
                self.search.look(seat.order(self.maker.method()), look, solved.touch.clone());
            } else if search
                && self.rest.is_over(&solution, now)
                && let Some(follower) = &seat.follower
            {
                self.search.search(follower.lead(), seat.for_search(&solved.touch));
            }
        }
        if self.notice.is_due() {
            let rezeroing = seat.baseline.state().is_taking();
            let shown = solved.frame.snapshot(solution, rezeroing);
            self.notice.publish(|snapshot| snapshot.frame = Some(shown));
        }
    }
}

impl Seat {
    /// The solver of a method for this detector as it is.
    fn order(&self, method: Method) -> Order {
        Order { method, detector: Arc::clone(&self.detector), faulty: self.watch.faulty().clone() }
    }

    fn keep_steady(&mut self, touch: &Readings) {
        match &mut self.steady {
            Some(steady) => steady.add(touch.volts(), self.noise_v),
            None => self.steady = Some(Steady::of(touch.volts())),
        }
    }

    /// The mean of what has stood still up to now.
    fn for_search(&self, touch: &Readings) -> Readings {
        let mut readings = touch.clone();
        if let Some(steady) = &self.steady {
            readings.volts_mut().copy_from_slice(steady.mean_v());
        }
        readings
    }
}

impl Rest {
    /// Whether a search is worth it again.
    fn is_over(&self, solution: &Solution, now: Instant) -> bool {
        let residual = solution.residual.unwrap_or_default();
        self.until.is_none_or(|until| now >= until) || residual > JUMP * self.residual
    }

    /// Rests after a search: the longer, the less has changed.
    fn after_search(&mut self, solution: &Solution) {
        let residual = solution.residual.unwrap_or_default();
        let is_same = self.until.is_some() && residual * JUMP > self.residual && residual < JUMP * self.residual;
        self.length = if is_same { (2 * self.length).min(REST[1]) } else { REST[0] };
        self.until = Some(Instant::now() + self.length);
        self.residual = residual;
    }
}

impl Taken {
    fn snapshot(&self, solution: Solution, rezeroing: bool) -> FrameSnapshot {
        FrameSnapshot {
            sequence: self.sequence,
            board_time_us: self.board_time_us,
            arrived: self.arrived,
            status: self.status,
            readings: self.newest.clone(),
            solution,
            rezeroing,
        }
    }
}
