//! Scan plans on their way from the follower, which chooses them, to the reader, which asks the board for them.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use tactomo_board::session::{Session, WishState};
use tactomo_protocol::Plan;

/// The plan that is wanted, on its way from the follower to the reader.
#[derive(Debug, Default)]
pub(in crate::run) struct RequestedPlan {
    wanted: Mutex<Option<Plan>>,
    refused: AtomicBool,
}

impl RequestedPlan {
    pub(super) fn put(&self, plan: Plan) {
        *self.wanted.lock().unwrap_or_else(PoisonError::into_inner) = Some(plan);
    }

    /// The plan that was put since the last call, if one was.
    pub(super) fn take(&self) -> Option<Plan> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner).take()
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
        let is_refused = self.plan.is_some() && session.plan_state() == WishState::Refused;
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
