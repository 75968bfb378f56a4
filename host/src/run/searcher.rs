//! The thread that searches: thorough answers, always on the newest frame that the follower had when it was free.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use tactomo_physics::readings::Readings;
use tactomo_touch::solve::{Hypothesis, Search, Solution, Tracker};

use super::inbox::{Event, Inbox, Searched};

/// Pause after a search that has changed nothing, doubled each time up to the second: what cannot be explained better need not be searched
/// a hundred times a second. A residual that jumps ends the pause.
const PAUSE: [Duration; 2] = [Duration::from_millis(10), Duration::from_millis(320)];
/// Rise of the residual that ends it.
const JUMP: f64 = 1.3;

/// What the thread is asked.
enum Job {
    /// To search with another solver's half from now on.
    Solver(Option<Box<dyn Search>>),
    /// To search what explains readings.
    Search { epoch: u64, from: Hypothesis, readings: Readings, is_past: Arc<AtomicBool> },
}

/// The searching thread, seen from the follower: it does one thing at a time. It ends by itself once this is dropped, and nobody waits for what it still
/// searches: the first search on a detector of 32 electrodes that is not known exactly takes a minute.
pub(super) struct SearchThread {
    jobs: Sender<Job>,
    is_busy: bool,
    /// What the solution of the last frame leaves, and that of the one that is searched; whether it is so much more that the latter is past.
    residual: f64,
    searched: f64,
    is_past: Arc<AtomicBool>,
    /// Counts what makes running searches useless: another solver, a jump.
    epoch: u64,
    pause: SearchPause,
    /// Whether a search may find something better for the frame that was answered last.
    is_wanted: bool,
}

/// When to search again.
#[derive(Default)]
struct SearchPause {
    until: Option<Instant>,
    length: Duration,
    residual: f64,
}

impl SearchThread {
    /// Starts it; what it finds goes to `inbox`.
    pub fn start(inbox: Arc<Inbox>) -> std::io::Result<Self> {
        let (jobs, queue) = channel();
        thread::Builder::new().name("searcher".to_owned()).spawn(move || work(&queue, &inbox))?;
        let (pause, is_past) = (SearchPause::default(), Arc::default());
        Ok(Self { jobs, is_busy: false, residual: 0.0, searched: 0.0, is_past, epoch: 0, pause, is_wanted: false })
    }

    /// Searches with this half from now on; what is still searched with another is thrown away.
    pub fn change_solver(&mut self, half: Option<Box<dyn Search>>) {
        self.throw_away();
        self.pause = SearchPause::default();
        self.send(Job::Solver(half));
    }

    /// Throws away what is being searched, and what was to be.
    pub fn forget(&mut self) {
        self.throw_away();
        self.is_wanted = false;
    }

    fn throw_away(&mut self) {
        self.epoch += 1;
        self.is_past.store(true, Ordering::Relaxed);
    }

    /// Searches something better than a solution of these readings, if that may be there (`search`), and the pause is over or there are news.
    pub fn consider(&mut self, search: bool, solution: &Solution, readings: &Readings, tracker: &dyn Tracker) {
        self.is_wanted = search;
        let is_time = self.pause.is_over(solution, Instant::now()) || tracker.has_news();
        self.residual = solution.residual.unwrap_or_default();
        if self.is_busy && self.residual > JUMP * self.searched {
            self.is_past.store(true, Ordering::Relaxed);
        } else if search && !self.is_busy && is_time {
            self.search(tracker.hypothesis(), readings.clone());
        }
    }

    /// The same where no frame comes, if it was not searched before since the pause was not over.
    pub fn catch_up(&mut self, readings: &Readings, tracker: &dyn Tracker) {
        if self.is_wanted && !self.is_busy && self.pause.is_past(Instant::now()) {
            self.is_wanted = false;
            self.search(tracker.hypothesis(), readings.clone());
        }
    }

    /// Takes what has come from it: the lead, unless it is of no use by now.
    pub fn receive(&mut self, searched: Searched) -> Option<Hypothesis> {
        self.is_busy &= !searched.is_last;
        (searched.epoch == self.epoch).then_some(searched.lead)
    }

    /// Pauses after a search that has led to this solution: the longer, the less has changed.
    pub fn pause_after(&mut self, solution: &Solution) {
        self.pause.begin(solution, Instant::now());
    }

    fn search(&mut self, from: Hypothesis, readings: Readings) {
        (self.searched, self.is_past) = (self.residual, Arc::default());
        let is_past = Arc::clone(&self.is_past);
        self.is_busy = self.send(Job::Search { epoch: self.epoch, from, readings, is_past });
    }

    /// Whether the thread takes it.
    fn send(&self, job: Job) -> bool {
        self.jobs.send(job).is_ok()
    }
}

impl SearchPause {
    fn begin(&mut self, solution: &Solution, now: Instant) {
        let residual = solution.residual.unwrap_or_default();
        let is_same = self.until.is_some() && residual * JUMP > self.residual && residual < JUMP * self.residual;
        self.length = if is_same { (2 * self.length).min(PAUSE[1]) } else { PAUSE[0] };
        self.until = Some(now + self.length);
        self.residual = residual;
    }

    fn is_past(&self, now: Instant) -> bool {
        self.until.is_none_or(|until| now >= until)
    }

    /// Whether a search is worth it again.
    fn is_over(&self, solution: &Solution, now: Instant) -> bool {
        self.is_past(now) || solution.residual.unwrap_or_default() > JUMP * self.residual
    }
}

fn work(jobs: &Receiver<Job>, inbox: &Inbox) {
    let mut half: Option<Box<dyn Search>> = None;
    while let Ok(job) = jobs.recv() {
        if inbox.is_closed() {
            return;
        }
        match job {
            Job::Solver(next) => half = next,
            Job::Search { epoch, from, readings, is_past } => {
                let mut better = |lead| {
                    inbox.put(Event::Searched(Searched { epoch, lead, is_last: false }));
                    if is_past.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
                };
                // Whatever happens, the follower is not left waiting.
                let search = std::panic::AssertUnwindSafe(|| {
                    half.as_mut().map(|half| half.search(from, &readings, &mut better))
                });
                let found = std::panic::catch_unwind(search).unwrap_or_else(|_| {
                    tracing::error!("a search panicked: this is a mistake in the program, please report it");
                    half = None;
                    None
                });
                // Readings that cannot be were refused by the follower before.
                let lead = found.and_then(Result::ok).unwrap_or_default();
                inbox.put(Event::Searched(Searched { epoch, lead, is_last: true }));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_touch::solve::{Followed, FoundContact, SolveError};

    fn leaving(residual: f64) -> Solution {
        Solution { residual: Some(residual), ..Solution::default() }
    }

    #[test]
    fn pauses_double_while_nothing_changes_and_a_jump_of_the_residual_ends_them() {
        let (mut pause, now) = (SearchPause::default(), Instant::now());
        assert!(pause.is_over(&leaving(1.0), now), "the first search waits for nothing");
        let lengths: Vec<_> = (0..8)
            .map(|_| {
                pause.begin(&leaving(2.0), now);
                pause.length
            })
            .collect();
        assert_eq!(lengths[..3], [PAUSE[0], 2 * PAUSE[0], 4 * PAUSE[0]]);
        assert_eq!(lengths.last(), Some(&PAUSE[1]));
        let soon = now + PAUSE[0];
        assert!(!pause.is_over(&leaving(2.1), soon) && pause.is_over(&leaving(3.0), soon));
        assert!(pause.is_past(now + PAUSE[1]));
        pause.begin(&leaving(1.0), now);
        assert_eq!(pause.length, PAUSE[0], "it has helped");
    }

    /// Follows nothing, and leads to nothing.
    struct Nothing;

    impl Tracker for Nothing {
        fn follow(&mut self, _readings: &Readings) -> Result<Followed, SolveError> {
            Ok(Followed { solution: Solution::default(), search: false })
        }

        fn adopt(&mut self, _found: Hypothesis, _readings: &Readings) -> Result<Followed, SolveError> {
            Ok(Followed { solution: Solution::default(), search: false })
        }

        fn hypothesis(&self) -> Hypothesis {
            Hypothesis::default()
        }

        fn inherit(&mut self, _before: &[FoundContact]) {}

        fn reset(&mut self) {}
    }

    #[test]
    fn one_search_at_a_time_and_what_came_before_a_jump_is_of_no_use() {
        let inbox = Arc::new(Inbox::new(false));
        let mut search = SearchThread::start(Arc::clone(&inbox)).unwrap();
        let readings = Readings::from_fn(4, |_, _| 0.1);
        search.consider(false, &leaving(1.0), &readings, &Nothing);
        assert!(!search.is_busy);
        search.consider(true, &leaving(1.0), &readings, &Nothing);
        search.consider(true, &leaving(9.0), &readings, &Nothing);
        assert!(search.is_busy && search.is_wanted);
        search.forget();
        let Event::Searched(searched) = inbox.take(Duration::from_secs(60), true) else { panic!("no search ended") };
        assert!(searched.is_last && search.receive(searched).is_none() && !search.is_busy);
        search.catch_up(&readings, &Nothing);
        assert!(!search.is_busy, "nobody wants it after the jump");
        search.consider(true, &leaving(1.0), &readings, &Nothing);
        let Event::Searched(searched) = inbox.take(Duration::from_secs(60), true) else { panic!("no search ended") };
        assert!(search.receive(searched).is_some());
        search.catch_up(&readings, &Nothing);
        assert!(search.is_busy && !search.is_wanted, "what was wanted when nothing comes");
    }

    /// Finds something as long as that is of use.
    struct Endless;

    impl Search for Endless {
        fn search(
            &mut self,
            from: Hypothesis,
            _readings: &Readings,
            found: &mut dyn FnMut(Hypothesis) -> ControlFlow<()>,
        ) -> Result<Hypothesis, SolveError> {
            while found(Hypothesis::default()).is_continue() {
                thread::sleep(Duration::from_millis(1));
            }
            Ok(from)
        }
    }

    #[test]
    fn a_search_ends_once_much_more_has_come_than_its_frame_has() {
        let inbox = Arc::new(Inbox::new(false));
        let mut search = SearchThread::start(Arc::clone(&inbox)).unwrap();
        search.change_solver(Some(Box::new(Endless)));
        let readings = Readings::from_fn(4, |_, _| 0.1);
        let next = || match inbox.take(Duration::from_secs(60), true) {
            Event::Searched(searched) => searched,
            _ => panic!("nothing is found"),
        };
        search.consider(true, &leaving(1.0), &readings, &Nothing);
        search.consider(true, &leaving(1.2), &readings, &Nothing);
        assert!(!search.is_past.load(Ordering::Relaxed) && !next().is_last);
        search.consider(true, &leaving(1.4), &readings, &Nothing);
        let last = std::iter::repeat_with(next).find(|searched| searched.is_last).unwrap();
        assert!(search.receive(last).is_some() && !search.is_busy);
        search.consider(true, &leaving(1.4), &readings, &Nothing);
        assert!(search.is_busy && !search.is_past.load(Ordering::Relaxed), "another frame");
        search.forget();
        assert!(std::iter::repeat_with(next).any(|searched| searched.is_last));
    }
}
