//! Scan plans on their way from the follower, which chooses them, to the reader, which asks the board for them.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use tactomo_board::session::{PlanState, Session};
use tactomo_protocol::Plan;

/// Share of the frames that the line has no room for from which it is crowded: then readings can be the mean of twice as many conversions, and as
/// many come.
const CROWDED: f64 = 0.5;
/// Frames in which that share is counted.
pub(super) const COUNTED: u64 = 400;

/// The plan that is wanted, on its way from the follower to the reader, and how the line fares with it.
#[derive(Debug, Default)]
pub(in crate::run) struct RequestedPlan {
    wanted: Mutex<Option<Plan>>,
    refused: AtomicBool,
    /// Frames that came, and those that the line had no room for.
    came: AtomicU64,
    dropped: AtomicU64,
}

impl RequestedPlan {
    pub(super) fn put(&self, plan: Plan) {
        *self.wanted.lock().unwrap_or_else(PoisonError::into_inner) = Some(plan);
    }

    /// The plan that was put since the last call, if one was.
    pub(super) fn take(&self) -> Option<Plan> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    /// Counts a frame of rows that came after so many were dropped.
    pub fn count(&self, dropped: u64) {
        self.came.fetch_add(1, Ordering::Relaxed);
        self.dropped.fetch_add(dropped, Ordering::Relaxed);
    }

    /// Whether the line has no room for half of the frames, once enough were counted.
    pub(super) fn is_crowded(&self) -> bool {
        let [came, dropped] = [&self.came, &self.dropped].map(|count| count.load(Ordering::Relaxed));
        if came + dropped < COUNTED {
            return false;
        }
        self.came.store(0, Ordering::Relaxed);
        self.dropped.store(0, Ordering::Relaxed);
        dropped as f64 > CROWDED * (came + dropped) as f64
    }

    /// Whether the board takes no plan.
    pub(super) fn is_refused(&self) -> bool {
        self.refused.load(Ordering::Relaxed)
    }

    /// The board takes no plan, or does again.
    pub(super) fn set_refused(&self, refused: bool) {
        self.refused.store(refused, Ordering::Relaxed);
    }
}

/// The plan that is asked of the board.
#[derive(Debug)]
pub(in crate::run) struct PlanRequests {
    pub requested: Arc<RequestedPlan>,
    /// The last one.
    plan: Option<Plan>,
    is_refused: bool,
}

impl PlanRequests {
    pub fn new(requested: Arc<RequestedPlan>) -> Self {
        Self { requested, plan: None, is_refused: false }
    }

    /// Asks for the rows that are wanted, as far as the board takes plans at all.
    pub fn ask(&mut self, session: &mut Session) {
        if let Some(plan) = self.requested.take() {
            session.request_plan(Some(plan.clone()));
            self.plan = Some(plan);
        }
        let is_refused = self.plan.is_some() && session.plan_state() == PlanState::Refused;
        if is_refused && !self.is_refused {
            tracing::warn!("the board does not take the scan plan, so it goes on with whole frames");
        }
        self.is_refused = is_refused;
        self.requested.set_refused(is_refused);
    }

    /// The same of a board that has come anew.
    pub fn ask_again(&self, session: &mut Session) {
        if let Some(plan) = &self.plan {
            session.request_plan(Some(plan.clone()));
        }
    }
}
