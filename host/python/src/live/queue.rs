//! Answers that wait for Python: as many as fit, the newest if it is slow.

use std::collections::VecDeque;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tactomo::run::{Listener, TouchEvent};

/// How a run has ended: its summary as JSON, or why it could not go on.
pub type Ended = Result<String, String>;

/// The queue; shared by the run and by who iterates.
#[derive(Default)]
pub struct Queue {
    state: Mutex<State>,
    changed: Condvar,
    capacity: usize,
}

#[derive(Default)]
struct State {
    events: VecDeque<Arc<TouchEvent>>,
    lost: u64,
    ended: Option<Ended>,
}

/// What is to be had of the queue.
pub enum Next {
    /// The next answer.
    Event(Arc<TouchEvent>),
    /// Nothing yet.
    Nothing,
    /// There will be nothing more.
    Ended(Ended),
}

impl Queue {
    /// A queue for so many answers.
    pub fn new(capacity: usize) -> Self {
        Self { capacity, ..Self::default() }
    }

    /// Answers that were lost because nobody took them.
    pub fn lost(&self) -> u64 {
        self.lock().lost
    }

    /// How the run has ended, if it has.
    pub fn ended(&self) -> Option<Ended> {
        self.lock().ended.clone()
    }

    /// Whether there is an answer, or the run has ended, within `patience`.
    pub fn has_begun(&self, patience: Duration) -> bool {
        let waited = self.changed.wait_timeout_while(self.lock(), patience, |state| state.is_empty());
        !waited.unwrap_or_else(PoisonError::into_inner).0.is_empty()
    }

    /// Says that there will be nothing more.
    pub fn end(&self, ended: Ended) {
        self.lock().ended = Some(ended);
        self.changed.notify_all();
    }

    /// The next answer, if it comes within `patience`.
    pub fn next(&self, patience: Duration) -> Next {
        let mut state = self.lock();
        if state.is_empty() && !patience.is_zero() {
            let waited = self.changed.wait_timeout_while(state, patience, |state| state.is_empty());
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        state.next()
    }

    /// The newest answer in place of all that wait.
    pub fn newest(&self) -> Option<Arc<TouchEvent>> {
        let mut state = self.lock();
        let newest = state.events.pop_back();
        state.events.clear();
        newest
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn is_empty(&self) -> bool {
        self.events.is_empty() && self.ended.is_none()
    }

    fn next(&mut self) -> Next {
        match (self.events.pop_front(), &self.ended) {
            (Some(event), _) => Next::Event(event),
            (None, Some(ended)) => Next::Ended(ended.clone()),
            (None, None) => Next::Nothing,
        }
    }
}

/// The run's end of the queue.
pub struct Tail(pub Arc<Queue>);

impl Listener for Tail {
    fn touched(&mut self, event: &Arc<TouchEvent>) {
        let Queue { changed, capacity, .. } = &*self.0;
        let mut state = self.0.lock();
        if state.events.len() >= *capacity {
            state.events.pop_front();
            state.lost += 1;
        }
        state.events.push_back(Arc::clone(event));
        drop(state);
        changed.notify_one();
    }
}
