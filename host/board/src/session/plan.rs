//! The scan plan that is asked for, and what the board makes of it.

use tactomo_protocol::Plan;

/// What became of the scan plan that was asked for last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlanState {
    /// It is on its way.
    Pending,
    /// The board scans so.
    InForce,
    /// The board does not take it, or did not answer; it goes on as it was.
    Refused,
}

/// The plan that is wanted of a board, and the one that it has.
#[derive(Debug, Default)]
pub(super) struct PlanWish {
    wanted: Plan,
    /// `None` if nobody knows: an earlier host may have asked for any.
    in_force: Option<Plan>,
    is_refused: bool,
}

impl PlanWish {
    pub(super) fn state(&self) -> PlanState {
        match self.due() {
            _ if self.is_refused => PlanState::Refused,
            Some(_) => PlanState::Pending,
            None => PlanState::InForce,
        }
    }

    pub(super) fn request(&mut self, plan: Plan) {
        (self.wanted, self.is_refused) = (plan, false);
    }

    /// The plan to send, if the board is not known to have it.
    pub(super) fn due(&self) -> Option<&Plan> {
        (self.in_force.as_ref() != Some(&self.wanted)).then_some(&self.wanted)
    }

    /// Nobody knows what the board scans.
    pub(super) fn forget(&mut self) {
        self.in_force = None;
    }

    pub(super) fn confirmed(&mut self, plan: Plan) {
        self.in_force = Some(plan);
    }

    /// The board keeps what it has. If that is not known, whole frames are asked for.
    pub(super) fn refused(&mut self) {
        self.is_refused = true;
        self.wanted = self.in_force.clone().unwrap_or_default();
    }

    /// The plan that the board scans, as far as is known.
    pub(super) fn in_force(&self) -> Option<&Plan> {
        self.in_force.as_ref()
    }
}
