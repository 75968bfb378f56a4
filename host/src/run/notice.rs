//! What there is to show, put together from what the reader and the follower know, and published for whoever looks.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use tactomo_board::identity::identity;
use tactomo_physics::detector::Detector;
use tokio::sync::watch;

use super::calibration::LearnedInUse;
use super::statistics::Meter;
use super::{LinkState, Snapshot};

/// Shortest time between two snapshots: no screen shows more.
pub(super) const PUBLISH_EVERY: Duration = Duration::from_millis(8);
/// Longest time between two snapshots, so that the rate of a silent board falls.
const PUBLISH_AT_LEAST: Duration = Duration::from_millis(250);

/// Where the threads of a run put what there is to show.
pub struct NoticeBoard {
    state: Mutex<State>,
    snapshots: watch::Sender<Arc<Snapshot>>,
}

struct State {
    snapshot: Snapshot,
    meter: Meter,
    published: Instant,
}

impl NoticeBoard {
    /// Publishes to `snapshots`.
    pub fn new(snapshots: watch::Sender<Arc<Snapshot>>) -> Self {
        let state = State { snapshot: Snapshot::default(), meter: Meter::default(), published: Instant::now() };
        Self { state: Mutex::new(state), snapshots }
    }

    /// Counts something.
    pub fn count<T>(&self, count: impl FnOnce(&mut Meter) -> T) -> T {
        count(&mut self.lock().meter)
    }

    /// Changes what is shown, with the next snapshot.
    pub fn change(&self, change: impl FnOnce(&mut Snapshot)) {
        change(&mut self.lock().snapshot);
    }

    /// Changes what is shown, at once.
    pub fn publish(&self, change: impl FnOnce(&mut Snapshot)) {
        let mut state = self.lock();
        change(&mut state.snapshot);
        self.send(&mut state);
    }

    /// How the link fares, as it is shown.
    pub fn link(&self) -> LinkState {
        self.lock().snapshot.link.clone()
    }

    /// Name of the solver in use; `none` if there is none.
    pub fn solver_name(&self) -> &'static str {
        self.lock().snapshot.solver.as_ref().map_or("none", |solver| solver.method.name())
    }

    /// The detector that a calibration has found and that is in use.
    pub fn calibrated(&self) -> Option<Arc<Detector>> {
        self.lock().snapshot.calibrated.clone()
    }

    /// Identity of the board, once it has said Hello.
    pub fn board(&self) -> Option<String> {
        self.lock().snapshot.hello.as_ref().map(identity)
    }

    /// What was learned of the detector while it was used.
    pub fn learned(&self) -> Option<LearnedInUse> {
        self.lock().snapshot.learned
    }

    /// Whether a screen could show something newer than the last snapshot, and anybody looks.
    pub fn is_due(&self) -> bool {
        self.snapshots.receiver_count() > 0 && self.lock().published.elapsed() >= PUBLISH_EVERY
    }

    /// Publishes if nothing was for long.
    pub fn keep_fresh(&self) {
        let mut state = self.lock();
        if state.published.elapsed() >= PUBLISH_AT_LEAST {
            self.send(&mut state);
        }
    }

    fn send(&self, state: &mut State) {
        state.published = Instant::now();
        if self.snapshots.receiver_count() > 0 {
            state.snapshot.statistics = state.meter.statistics(state.published);
            self.snapshots.send_replace(Arc::new(state.snapshot.clone()));
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
