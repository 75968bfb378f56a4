//! The thread that searches: thorough answers, always on the newest frame that the follower had when it was free. Looks for exchanged wires have
//! threads of their own: what these make of the readings may be searched for seconds, in vain.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

use tactomo_physics::readings::Readings;
use tactomo_touch::solve::{Hypothesis, Look, Search};

use super::inbox::{Event, Inbox, Searched};
use super::order::Order;
use super::plan::LookAtWires;

/// What the thread is asked.
enum Job {
    /// To search with another solver's half from now on.
    Solver(Option<Box<dyn Search>>),
    /// To search what explains readings.
    Search { epoch: u64, from: Hypothesis, readings: Readings },
}

/// The searching thread, seen from the follower: it does one thing at a time. It ends by itself once this is dropped, and nobody waits for what it still
/// searches: the first search on a detector of 32 electrodes that is not known exactly takes a minute.
pub(super) struct SearchThread {
    jobs: Sender<Job>,
    busy: bool,
    inbox: Arc<Inbox>,
    look_at_wires: LookAtWires,
    looking: bool,
    /// Counts what makes running searches useless: another solver, a jump.
    epoch: u64,
}

impl SearchThread {
    /// Starts it; what it finds goes to `inbox`.
    pub fn start(inbox: Arc<Inbox>, look_at_wires: LookAtWires) -> std::io::Result<Self> {
        let (jobs, queue) = channel();
        let found = Arc::clone(&inbox);
        thread::Builder::new().name("searcher".to_owned()).spawn(move || work(&queue, &found))?;
        Ok(Self { jobs, busy: false, inbox, look_at_wires, looking: false, epoch: 0 })
    }

    /// Searches with this half from now on; what is still searched with another is thrown away.
    pub fn change_solver(&mut self, half: Option<Box<dyn Search>>) {
        self.forget();
        self.send(Job::Solver(half));
    }

    /// Throws away what is being searched.
    pub fn forget(&mut self) {
        self.epoch += 1;
    }

    /// Whether it has something to do.
    pub fn is_busy(&self) -> bool {
        self.busy
    }

    /// Searches what explains `readings`, of which `from` explains a part.
    pub fn search(&mut self, from: Hypothesis, readings: Readings) {
        self.busy = self.send(Job::Search { epoch: self.epoch, from, readings });
    }

    /// Whether it still looks at the wires.
    pub fn is_looking(&self) -> bool {
        self.looking
    }

    /// Looks for exchanged wires, beside a search.
    pub fn look(&mut self, order: Order, look: Look, readings: Readings) {
        let (look_at_wires, inbox) = (Arc::clone(&self.look_at_wires), Arc::clone(&self.inbox));
        let looks = move || {
            // Whatever happens, the follower is not left waiting.
            let looked = std::panic::AssertUnwindSafe(|| look_at_wires(&order, look, &readings));
            let found = std::panic::catch_unwind(looked).unwrap_or_else(|_| {
                tracing::error!("a look at the wires panicked: this is a mistake in the program, please report it");
                None
            });
            inbox.put(Event::Looked(look, found));
        };
        self.looking = thread::Builder::new().name("looks at wires".to_owned()).spawn(looks).is_ok();
    }

    /// Takes what has come from it: the lead, unless it is of no use by now.
    pub fn receive(&mut self, searched: Searched) -> Option<Hypothesis> {
        self.busy &= !searched.is_last;
        (searched.epoch == self.epoch).then_some(searched.lead)
    }

    /// Takes note that a look has ended.
    pub fn looked(&mut self) {
        self.looking = false;
    }

    /// Whether the thread takes it.
    fn send(&self, job: Job) -> bool {
        self.jobs.send(job).is_ok()
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
            Job::Search { epoch, from, readings } => {
                let mut better = |lead| inbox.put(Event::Searched(Searched { epoch, lead, is_last: false }));
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
