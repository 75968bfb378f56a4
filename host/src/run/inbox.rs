//! Frames on their way from the reader to the follower: the newest first, and of what stands still the mean.
//!
//! A follower that is busy finds, when it comes back, the newest frame and not a queue. Frames that it could not take by themselves are
//! not lost for accuracy: as long as they differ by no more than noise, their mean is what it gets.
//!
//! Methods average over the answers that stand still (`before/adaptive_mean` of the solvers), and see only what is taken here. So without this mean the
//! frames that a slow method skips would be lost to both, and without theirs a fast one would have one frame at a time.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use tactomo_board::identity::Sensor;
use tactomo_physics::detector::Detector;
use tactomo_physics::readings::Readings;
use tactomo_touch::solve::{AdaptiveMean, Hypothesis, Look, Method, Parts, Solution, Solver};

use super::calibration::messages::{Calibrate, Outcome};
use super::frame::{Frame, Rows};
use super::order::Made;

/// Frames of rows that wait at most: 50 ms of an ESP32's.
const MOST_ROWS: usize = 64;
/// Longest wait before it is asked whether there is still something to wait for.
const LONGEST_WAIT: Duration = Duration::from_millis(50);

/// A frame, or the mean of some that stood still.
#[derive(Clone, Debug, PartialEq)]
pub struct Taken {
    /// The newest frame.
    pub newest: Frame,
    /// The rows that came since the last one was taken, the oldest first; none of whole frames.
    pub rows: Vec<Rows>,
    /// The mean of the last frames as far as they stood still (V).
    pub mean: Readings,
    /// How many frames that is the mean of.
    pub averaged: u32,
    /// Frames that came since the last one was taken, this one included.
    pub came: u32,
    /// What the board has found in the newest, if it finds contacts itself.
    pub found: Option<Box<Found>>,
}

/// What a board has found in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Contacts and flags.
    pub solution: Solution,
    /// Whether readings at rest are still being taken.
    pub is_taking_rest: bool,
    /// Whether the readings came too.
    pub has_readings: bool,
}

impl Taken {
    /// A frame by itself, and the rows that came in it.
    pub fn new(frame: Frame, rows: Vec<Rows>, found: Option<Found>) -> Self {
        let found = found.map(Box::new);
        Self { mean: frame.used.clone(), newest: frame, rows, averaged: 1, came: 1, found }
    }
}

/// What wakes the follower.
pub enum Event {
    /// The board has said who it is: the detector, as it measures it.
    Board(Arc<Detector>),
    /// A board has said Hello on a link that was opened: which sensor it is on.
    Sensor(Sensor),
    /// Readings are means of so many conversions from now on.
    Conversions(u32),
    /// The baseline is to be taken anew.
    Rezero,
    /// The frames to come do not follow those before.
    Jumped,
    /// A solver is made.
    Solver(Made),
    /// A search has ended.
    Searched(Searched),
    /// A look for exchanged wires has ended, with the pair that it is about.
    Looked(Look, Option<[usize; 2]>),
    /// Another method is to read the touch.
    Method(Method),
    /// A contact is a pointer from now on, or is none.
    Pointer(bool),
    /// Something is asked of the calibration.
    Calibrate(Calibrate),
    /// What has come of work for the calibration of this number.
    Calibrated(u64, Outcome),
    /// A frame.
    Frame(Taken),
    /// Nothing for a while.
    Quiet,
    /// There is nothing more to come.
    Closed,
}

/// What a search has found.
pub struct Searched {
    /// The epoch in which it was asked for.
    pub epoch: u64,
    /// What it has found.
    pub lead: Hypothesis,
    /// Whether it has ended with that.
    pub is_last: bool,
}

/// Where frames and everything else that the follower has to know wait for it.
pub struct Inbox {
    state: Mutex<State>,
    changed: Condvar,
    /// Whether the reader waits until each frame is taken.
    waits: bool,
}

#[derive(Default)]
struct State {
    events: std::collections::VecDeque<Event>,
    pending: Option<Taken>,
    /// The frames since the last one was taken.
    still: Option<AdaptiveMean>,
    ready: bool,
    closed: bool,
}

impl Inbox {
    /// An empty one; with `waits`, the reader waits until each frame is taken, as for a recording that is read as fast as it can be.
    pub fn new(waits: bool) -> Self {
        Self { state: Mutex::default(), changed: Condvar::new(), waits }
    }

    /// The halves of a solver, as they are used here: where no frame is skipped, all of it answers to each.
    pub fn parts_of(&self, solver: Box<dyn Solver>) -> Parts {
        if self.waits { Parts::whole(solver) } else { solver.split() }
    }

    /// Puts something in that is not a frame.
    pub fn put(&self, event: Event) {
        self.lock().events.push_back(event);
        self.changed.notify_all();
    }

    /// Says that the frames to come do not follow those before, which nobody wants any more.
    pub fn jump(&self) {
        let mut state = self.lock();
        (state.pending, state.still) = (None, None);
        state.events.push_back(Event::Jumped);
        drop(state);
        self.changed.notify_all();
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        let state = self.lock();
        state.pending.is_none() && state.events.is_empty()
    }

    /// Puts a frame in, in place of one that was not taken; `noise_v` is the deviation of a reading.
    pub fn put_frame(&self, frame: Taken, noise_v: f64) {
        let mut state = self.lock();
        if self.waits {
            while state.pending.is_some() && !state.closed {
                state = self.changed.wait(state).unwrap_or_else(PoisonError::into_inner);
            }
        }
        state.add(frame, noise_v);
        drop(state);
        self.changed.notify_all();
    }

    /// What there is to do next, waiting at most `patience` for it. Frames wait while they are not wanted.
    pub fn take(&self, patience: Duration, frames: bool) -> Event {
        let nothing = |state: &mut State| {
            let is_frame = frames && state.pending.is_some();
            !is_frame && state.events.is_empty() && !state.closed
        };
        let waited = self.changed.wait_timeout_while(self.lock(), patience, nothing);
        let mut state = waited.unwrap_or_else(PoisonError::into_inner).0;
        if let Some(event) = state.events.pop_front() {
            return event;
        }
        let Some(frame) = state.pending.take_if(|_| frames) else {
            return if state.closed { Event::Closed } else { Event::Quiet };
        };
        drop(state);
        self.changed.notify_all();
        Event::Frame(frame)
    }

    /// Says that there is a solver.
    pub fn set_ready(&self) {
        self.lock().ready = true;
        self.changed.notify_all();
    }

    /// Waits until there is a solver, or there will be none, or `is_over` says that nobody wants one.
    pub fn wait_until_ready(&self, is_over: impl Fn() -> bool) {
        let waiting = |state: &mut State| !state.ready && !state.closed;
        while !is_over() {
            let waited = self.changed.wait_timeout_while(self.lock(), LONGEST_WAIT, waiting);
            if !waited.unwrap_or_else(PoisonError::into_inner).1.timed_out() {
                return;
            }
        }
    }

    /// Says that nothing more comes, or that nobody takes it.
    pub fn close(&self) {
        self.lock().closed = true;
        self.changed.notify_all();
    }

    /// Whether it was closed.
    pub fn is_closed(&self) -> bool {
        self.lock().closed
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn add(&mut self, mut frame: Taken, noise_v: f64) {
        let before = self.pending.take();
        if frame.found.as_ref().is_some_and(|found| !found.has_readings) {
            frame.came += before.map_or(0, |before| before.came);
            (self.still, self.pending) = (None, Some(frame));
            return;
        }
        if !frame.rows.is_empty() {
            // Each row tells what is new in it: none is left out, but where a follower stands still for long.
            if let Some(before) = before {
                frame.came += before.came;
                frame.rows.splice(0..0, before.rows);
                let surplus = frame.rows.len().saturating_sub(MOST_ROWS);
                frame.rows.drain(..surplus);
            }
            self.still = None;
            self.pending = Some(frame);
            return;
        }
        let mut still = self.still.take().filter(|_| before.is_some()).unwrap_or_else(|| AdaptiveMean::new(noise_v));
        still.add(&frame.newest.used);
        if let Some(before) = before {
            frame.came += before.came;
            frame.averaged = still.count() as u32;
            frame.mean = still.mean_readings().unwrap_or(frame.mean);
        }
        self.still = Some(still);
        self.pending = Some(frame);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::super::frame::Arrival;
    use super::*;

    fn frame(volts: f64, sequence: u64) -> Taken {
        let readings = Readings::from_fn(4, |_, _| volts);
        let first = Frame::first(readings.clone(), readings, Arrival::at(Instant::now()));
        Taken::new(Frame { sequence, ..first }, Vec::new(), None)
    }

    fn taken(inbox: &Inbox) -> Option<Taken> {
        match inbox.take(Duration::ZERO, true) {
            Event::Frame(frame) => Some(frame),
            _ => None,
        }
    }

    #[test]
    fn the_newest_comes_first_and_what_stands_still_is_averaged() {
        let inbox = Inbox::new(false);
        (0..4_u64).for_each(|i| inbox.put_frame(frame(0.100 + 0.001 * i as f64, i), 0.002));
        let still = taken(&inbox).unwrap();
        assert_eq!((still.newest.sequence, still.came, still.averaged), (3, 4, 4));
        assert!((still.mean.at(1, 2) - 0.1015).abs() < 1e-12 && (still.newest.used.at(1, 2) - 0.103).abs() < 1e-12);
        assert!(taken(&inbox).is_none());
        for (volts, sequence) in [(0.1, 4), (0.1, 5), (0.3, 6)] {
            inbox.put_frame(frame(volts, sequence), 0.002);
        }
        let moved = taken(&inbox).unwrap();
        assert_eq!((moved.came, moved.averaged, moved.mean.at(0, 1)), (3, 1, 0.3), "a press is no noise");
    }

    #[test]
    fn a_reader_that_waits_loses_no_frame() {
        let inbox = Arc::new(Inbox::new(true));
        let reader = {
            let inbox = Arc::clone(&inbox);
            std::thread::spawn(move || (0..200).for_each(|i| inbox.put_frame(frame(0.1, i), 0.002)))
        };
        for i in 0..200 {
            let frame = std::iter::repeat_with(|| taken(&inbox)).flatten().next().unwrap();
            assert_eq!((frame.newest.sequence, frame.came), (i, 1));
        }
        reader.join().unwrap();
        inbox.close();
        assert!(matches!(inbox.take(Duration::ZERO, true), Event::Closed));
    }
}
