//! What a board is asked to do beside its settings, and what it makes of that: which rows it scans, and what it sends.

use std::time::Instant;

use tactomo_protocol::{Command, Output, Plan};

use super::Session;

/// What became of what was asked for last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WishState {
    /// It is on its way.
    Pending,
    /// The board does so.
    InForce,
    /// The board does not take it, or did not answer; it goes on as it was.
    Refused,
}

/// What is wanted of a board, and what it has.
#[derive(Debug)]
pub(super) struct Wish<T> {
    wanted: T,
    /// `None` if nobody knows: an earlier host may have asked for anything.
    in_force: Option<T>,
    is_refused: bool,
}

impl<T: Clone + Default + PartialEq> Wish<T> {
    /// What any board does by itself is wanted, and taken to be done or not known.
    pub(super) fn new(in_force: Option<T>) -> Self {
        Self { wanted: T::default(), in_force, is_refused: false }
    }

    pub(super) fn state(&self) -> WishState {
        match self.due() {
            _ if self.is_refused => WishState::Refused,
            Some(_) => WishState::Pending,
            None => WishState::InForce,
        }
    }

    pub(super) fn request(&mut self, wanted: T) {
        (self.wanted, self.is_refused) = (wanted, false);
    }

    /// What to send, if the board is not known to have it.
    pub(super) fn due(&self) -> Option<&T> {
        (self.in_force.as_ref() != Some(&self.wanted)).then_some(&self.wanted)
    }

    /// The board has this, or, by `None`, nobody knows what.
    pub(super) fn set_in_force(&mut self, known: Option<T>) {
        self.in_force = known;
    }

    /// The board keeps what it has. If that is not known, what it does by itself is asked for.
    pub(super) fn refused(&mut self) {
        self.is_refused = true;
        self.wanted = self.in_force.clone().unwrap_or_default();
    }

    /// What the board has, as far as is known.
    pub(super) fn in_force(&self) -> Option<&T> {
        self.in_force.as_ref()
    }
}

impl Session {
    /// Asks the board to scan other rows, or whole frames again; [`plan_state`](Self::plan_state) says what became of it. A board that starts
    /// anew gets the plan again.
    pub fn request_plan(&mut self, plan: Option<Plan>) {
        self.plan.request(plan.unwrap_or_default());
        self.paces.restart(&Command::Scan(Plan::default()));
        if self.give_way(|command| matches!(command, Command::Scan(_))) {
            // It may arrive all the same.
            self.plan.set_in_force(None);
        }
    }

    /// What became of the plan that was [asked for](Self::request_plan) last: whole frames, if none was.
    pub fn plan_state(&self) -> WishState {
        self.plan.state()
    }

    pub(super) fn plan_refused(&mut self, how: &str) {
        tracing::warn!("the board {how} the scan plan, and keeps the one before");
        self.plan.refused();
    }

    /// Asks the board to send something else than frames; [`output_state`](Self::output_state) says what became of it. A board that starts anew gets it again.
    pub fn request_output(&mut self, output: Output) {
        self.output.request(output);
        self.paces.restart(&Command::Output(output));
        if self.give_way(|command| matches!(command, Command::Output(_))) {
            self.output.set_in_force(None);
        }
    }

    /// Asks the board once more for what it sends: contacts begin anew, with readings at rest.
    pub fn renew_output(&mut self) {
        self.output.set_in_force(None);
        self.request_output(self.output.wanted);
    }

    /// What became of what it was [asked to send](Self::request_output): frames, if nothing was.
    pub fn output_state(&self) -> WishState {
        self.output.state()
    }

    /// Takes note of contacts that the board has sent. A board of which nobody asked for them was left so by another host.
    pub fn contacts(&mut self, now: Instant) {
        self.streamed(now, Output::has_contacts);
    }

    /// Takes note of a frame.
    pub fn frame(&mut self, now: Instant) {
        self.streamed(now, Output::has_frames);
    }

    /// Takes note of something of the stream: where the board is taken not to send such, it is not known what it sends.
    fn streamed(&mut self, now: Instant, sends: impl Fn(Output) -> bool) {
        self.whole(now);
        if self.output.in_force().is_some_and(|output| !sends(*output)) {
            self.output.set_in_force(None);
        }
        if self.started {
            self.heard = Some(now);
            self.waiting_since = None;
        }
    }
}
