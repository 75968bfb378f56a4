//! What an answered frame gave: the one event behind every stream, file and listener.

use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use tactomo_physics::readings::Readings;
use tactomo_protocol::Status;
use tactomo_touch::pointer::PointerEvent;
use tactomo_touch::schema::FrameReport;
use tactomo_touch::solve::Solution;

use super::inbox::Taken;

/// What an answered frame gave. As JSON it is its [`report`](Self::report).
///
/// With a simulated or a slow board every frame has its event. Where frames come faster than they can be solved, some have none, and their
/// mean is part of the next.
#[derive(Clone, Debug, PartialEq)]
pub struct TouchEvent {
    /// Number of the scan since the board started, unwrapped.
    pub sequence: u64,
    /// Board time at the start of the scan, unwrapped, in microseconds (us).
    pub board_time_us: u64,
    /// When the frame's last byte came, by this machine's clock: nanoseconds since 1970 (ns).
    pub arrived_unix_ns: u64,
    /// Age of the answer when it was ready: since the frame's last byte came; none of a frame from a file.
    pub age: Option<Duration>,
    /// What happened during the scan.
    pub status: Status,
    /// Readings as measured (V), of this frame; of rows the latest of each.
    pub readings: Readings,
    /// The same as they are [used](tactomo_board::measured::Volts::used) (V): one that its converter's noise may hide below the floor, or above the
    /// ceiling, is that bound.
    pub used: Readings,
    /// What the solver got (V): the mean of the last frames as far as they stood still, less the baseline, as no channel differs from
    /// others.
    pub touch: Readings,
    /// How many frames that is the mean of.
    pub averaged: u32,
    /// Frames that the link or the board have lost since the run began, as the sequence numbers say.
    pub lost: u64,
    /// Those of them since the event before.
    pub lost_before: u64,
    /// Whether this is a better answer to the frame of the event before, which a search has found.
    pub is_revision: bool,
    /// Whether the baseline is being taken, so that less is known of touch.
    pub is_taking_baseline: bool,
    /// What the solver made of the readings: contacts, shape, image, flags, choice.
    pub solution: Solution,
    /// What the pointer has done since the event before, if a contact is one.
    pub pointer_events: Vec<PointerEvent>,
}

impl TouchEvent {
    /// As it leaves the program, with all that is known; whoever wants less takes fields away.
    pub fn report(&self) -> FrameReport<'_> {
        FrameReport {
            sequence: Some(self.sequence),
            time_s: Some(self.time_s()),
            arrived_unix_s: Some(self.arrived_unix_ns as f64 * 1e-9),
            lost_before: Some(self.lost_before),
            age_us: self.age.map(|age| age.as_secs_f64() * 1e6),
            revised: self.is_revision,
            rezeroing: self.is_taking_baseline,
            image_s_per_m2: self.solution.image_s_per_m2.as_deref(),
            readings_v: Some(&self.readings),
            used_v: Some(&self.used),
            touch_v: Some(&self.touch),
            averaged: Some(self.averaged),
            events: &self.pointer_events,
            ..FrameReport::of(&self.solution)
        }
    }

    /// One of a frame a millisecond, of 4 electrodes.
    #[cfg(test)]
    pub fn of(sequence: u64, solution: Solution) -> Self {
        let readings = Readings::from_fn(4, |g, e| 0.1 * (g + e) as f64);
        let frame = Taken { sequence, board_time_us: 1000 * sequence, ..Taken::of(readings) };
        let answer = Answer {
            touch: &frame.mean,
            solution: &solution,
            ready: Instant::now(),
            is_revision: false,
            is_taking_baseline: false,
            pointer_events: Vec::new(),
        };
        Listeners::new(Vec::new()).event(&frame, answer)
    }

    /// Board time at the start of the scan (s).
    pub fn time_s(&self) -> f64 {
        self.board_time_us as f64 / 1e6
    }
}

/// Who takes each answer. It must not wait: the follower does while it works.
pub trait Listener: Send {
    /// Takes what an answered frame gave.
    fn touched(&mut self, event: &Arc<TouchEvent>);
}

/// What the follower adds to a frame to make its event.
pub(super) struct Answer<'a> {
    /// What the solver got (V).
    pub touch: &'a Readings,
    /// What it made of that.
    pub solution: &'a Solution,
    /// When it was ready.
    pub ready: Instant,
    /// Whether the frame had an answer before.
    pub is_revision: bool,
    /// Whether the baseline is being taken.
    pub is_taking_baseline: bool,
    /// What the pointer does with it.
    pub pointer_events: Vec<PointerEvent>,
}

/// Those who take each answer, if any.
pub(super) struct Listeners {
    each: Vec<Box<dyn Listener>>,
    /// Frames lost until the event before.
    lost: u64,
}

impl Listeners {
    pub fn new(each: Vec<Box<dyn Listener>>) -> Self {
        Self { each, lost: 0 }
    }

    /// Tells all of them of an answer; its event is made only if there is somebody.
    pub fn tell(&mut self, frame: &Taken, answer: Answer) {
        if self.each.is_empty() {
            return;
        }
        let event = Arc::new(self.event(frame, answer));
        self.each.iter_mut().for_each(|listener| listener.touched(&event));
    }

    fn event(&mut self, frame: &Taken, answer: Answer) -> TouchEvent {
        let lost_before = frame.lost.saturating_sub(std::mem::replace(&mut self.lost, frame.lost));
        TouchEvent {
            sequence: frame.sequence,
            board_time_us: frame.board_time_us,
            arrived_unix_ns: unix_ns(frame.arrived),
            age: Some(answer.ready - frame.arrived),
            status: frame.status,
            readings: frame.measured.clone(),
            used: frame.newest.clone(),
            touch: answer.touch.clone(),
            averaged: frame.averaged,
            lost: frame.lost,
            lost_before,
            is_revision: answer.is_revision,
            is_taking_baseline: answer.is_taking_baseline,
            solution: answer.solution.clone(),
            pointer_events: answer.pointer_events,
        }
    }
}

/// A moment in nanoseconds since 1970 (ns), by the machine's clock as it is now.
fn unix_ns(moment: Instant) -> u64 {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    u64::try_from(now.saturating_sub(moment.elapsed()).as_nanos()).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;

    #[derive(Clone, Default)]
    struct Keeper(Arc<Mutex<Vec<Arc<TouchEvent>>>>);

    impl Listener for Keeper {
        fn touched(&mut self, event: &Arc<TouchEvent>) {
            self.0.lock().unwrap().push(Arc::clone(event));
        }
    }

    fn frame(sequence: u64, lost: u64) -> Taken {
        Taken { sequence, lost, ..Taken::of(Readings::from_fn(4, |g, e| 0.1 * (g + e) as f64)) }
    }

    #[test]
    fn every_listener_gets_the_same_event_with_what_was_lost_before_it() {
        let keepers = [Keeper::default(), Keeper::default()];
        let mut listeners = Listeners::new(keepers.iter().map(|keeper| Box::new(keeper.clone()) as _).collect());
        let (touch, solution) = (Readings::from_fn(4, |_, _| 0.25), Solution::default());
        for (sequence, lost) in [(5, 0), (9, 3), (9, 3), (12, 5)] {
            let ready = Instant::now();
            let pointer_events = vec![PointerEvent::Press];
            let answer = Answer {
                touch: &touch,
                solution: &solution,
                ready,
                is_revision: false,
                is_taking_baseline: true,
                pointer_events,
            };
            listeners.tell(&frame(sequence, lost), answer);
        }
        let [one, other] = keepers.map(|keeper| keeper.0.lock().unwrap().clone());
        assert!(one.iter().zip(&other).all(|(one, other)| Arc::ptr_eq(one, other)));
        let lost: Vec<_> = one.iter().map(|event| (event.sequence, event.lost_before)).collect();
        assert_eq!(lost, [(5, 0), (9, 3), (9, 0), (12, 2)]);
        let json = serde_json::to_value(one[1].report()).unwrap();
        assert_eq!((&json["schema"], &json["lost_before"], &json["rezeroing"]), (&1.into(), &3.into(), &true.into()));
        assert_eq!((&json["readings_v"][7], &json["touch_v"][0]), (&0.4.into(), &0.25.into()));
    }

    #[test]
    fn moments_are_told_by_the_clock() {
        let now_ns = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as u64;
        let before = Instant::now().checked_sub(Duration::from_secs(1)).unwrap();
        let told_ns = unix_ns(before);
        // A second before, within what a busy machine may take from one line to the next.
        assert!(told_ns < now_ns && told_ns + 60_000_000_000 > now_ns, "{told_ns} {now_ns}");
    }
}
