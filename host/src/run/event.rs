//! What an answered frame gave: the one record behind the page, every stream, file and listener.

use std::sync::Arc;
use std::time::Duration;

use tactomo_physics::readings::Readings;
use tactomo_touch::pointer::{PointerEvent, PointerState};
use tactomo_touch::schema::FrameReport;
use tactomo_touch::solve::Solution;

use super::beneath::Beneath;
use super::frame::Frame;

/// What an answered frame gave. As JSON it is its [`report`](Self::report).
///
/// With a simulated or a slow board every frame has its event. Where frames come faster than they can be solved, some have none, and their
/// mean is part of the next.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchEvent {
    /// The frame as it came.
    pub frame: Frame,
    /// Age of the answer when it was ready: since the frame's last byte came; none of a frame from a file.
    pub age: Option<Duration>,
    /// What the solver got (V): the mean of the last frames as far as they stood still, less the baseline, as no channel differs from
    /// others.
    pub touch: Readings,
    /// How many frames that is the mean of.
    pub averaged: u32,
    /// Frames lost since the event before.
    pub lost_before: u64,
    /// Whether this is a better answer to the frame of the event before, which a search has found.
    pub is_revision: bool,
    /// Whether the baseline is being taken, so that less is known of touch.
    pub is_taking_baseline: bool,
    /// What the solver made of the readings: contacts, shape, image, flags, choice.
    pub solution: Solution,
    /// Whether something may press that the board cannot read, where nothing was found.
    pub beneath: Option<Beneath>,
    /// What the pointer has done so far, if a contact is one.
    pub pointer: Option<PointerState>,
    /// What it has done since the event before.
    pub pointer_events: Vec<PointerEvent>,
}

impl TouchEvent {
    /// The first answer to a frame, by itself: `touch` is what the solver got of it (V).
    pub fn new(frame: Frame, touch: Readings, solution: Solution) -> Self {
        Self {
            frame,
            age: None,
            touch,
            averaged: 1,
            lost_before: 0,
            is_revision: false,
            is_taking_baseline: false,
            solution,
            beneath: None,
            pointer: None,
            pointer_events: Vec::new(),
        }
    }

    /// A better answer to the same frame.
    pub(super) fn revised(&self, solution: Solution) -> Self {
        let first = Self::new(self.frame.clone(), self.touch.clone(), solution);
        Self { averaged: self.averaged, is_revision: true, ..first }
    }

    /// As it leaves the program, with all that is known; whoever wants less takes fields away.
    pub fn report(&self) -> FrameReport<'_> {
        let scanned = self.frame.scanned();
        FrameReport {
            sequence: Some(self.frame.sequence),
            time_s: Some(self.frame.time_s()),
            arrived_unix_s: Some(self.frame.arrived.unix_ns as f64 * 1e-9),
            host_time_ns: scanned.map(|scanned| scanned.unix_ns),
            host_time_error_ns: scanned.map(|scanned| scanned.error_ns),
            lost_before: Some(self.lost_before),
            age_us: self.age.map(|age| age.as_secs_f64() * 1e6),
            revised: self.is_revision,
            rezeroing: self.is_taking_baseline,
            image_s_per_m2: self.solution.image_s_per_m2.as_deref(),
            readings_v: Some(&self.frame.measured),
            used_v: Some(&self.frame.used),
            touch_v: Some(&self.touch),
            averaged: Some(self.averaged),
            events: &self.pointer_events,
            ..FrameReport::of(&self.solution)
        }
    }

    /// One of a frame a millisecond that comes now, of 4 electrodes.
    #[cfg(test)]
    pub fn of(sequence: u64, solution: Solution) -> Self {
        let readings = Readings::from_fn(4, |g, e| 0.1 * (g + e) as f64);
        let now = std::time::Instant::now();
        let first = Frame::first(readings.clone(), readings.clone(), super::frame::Arrival::at(now));
        let frame = Frame { sequence, board_time_us: 1000 * sequence, ..first };
        Self { age: Some(Duration::ZERO), ..Self::new(frame, readings, solution) }
    }
}

/// Who takes each answer. It must not wait: the follower does while it works.
pub trait Listener: Send {
    /// Takes what an answered frame gave.
    fn touched(&mut self, event: &Arc<TouchEvent>);
}
