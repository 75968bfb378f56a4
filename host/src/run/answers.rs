//! Who is told of answers: listeners of each, pages of the newest that a screen can show.

use std::sync::Arc;
use std::time::Instant;

use tactomo_touch::pointer::Pointer;
use tactomo_touch::solve::FoundContact;

use super::event::{Listener, TouchEvent};
use super::notice::NoticeBoard;

/// Completes the events of answers and tells them.
pub(super) struct Answers {
    notice: Arc<NoticeBoard>,
    listeners: Vec<Box<dyn Listener>>,
    /// What makes a pointer of a contact, if one is.
    pointer: Option<Pointer>,
    newest: Option<Arc<TouchEvent>>,
    /// Whether pages have the newest: one that comes too soon after another waits.
    is_shown: bool,
}

impl Answers {
    /// None yet.
    pub fn new(notice: Arc<NoticeBoard>, listeners: Vec<Box<dyn Listener>>) -> Self {
        Self { notice, listeners, pointer: None, newest: None, is_shown: true }
    }

    /// Makes a pointer of a contact from now on, or of none.
    pub fn set_pointer(&mut self, on: bool) {
        self.pointer = on.then(|| self.pointer.take().unwrap_or_default());
    }

    /// The contacts that were found last, for another solver to number on from.
    pub fn contacts(&self) -> &[FoundContact] {
        self.newest.as_ref().map_or(&[], |newest| &newest.solution.contacts)
    }

    /// Tells an answer for which work has `begun` then; `came` frames have come since the answer before, none if this is a better one.
    pub fn tell(&mut self, mut event: TouchEvent, begun: Instant, came: u32) -> Arc<TouchEvent> {
        let now = Instant::now();
        event.age = event.frame.arrived.age(now);
        self.notice.count(|meter| meter.solved(came, event.age.unwrap_or_default(), now - begun));
        let lost = self.newest.as_ref().map_or(0, |before| before.frame.lost);
        event.lost_before = event.frame.lost.saturating_sub(lost);
        if let Some(pointer) = &mut self.pointer {
            event.pointer_events = pointer.take(event.frame.time_s(), &event.solution.contacts);
            event.pointer = Some(pointer.state());
        }
        let event = Arc::new(event);
        self.listeners.iter_mut().for_each(|listener| listener.touched(&event));
        (self.newest, self.is_shown) = (Some(Arc::clone(&event)), false);
        if self.notice.is_due() {
            self.show_newest();
        }
        event
    }

    /// Shows the newest answer, if it has come too soon after the one that is shown.
    pub fn show_newest(&mut self) {
        if std::mem::replace(&mut self.is_shown, true) {
            return;
        }
        let newest = self.newest.clone();
        self.notice.publish(|snapshot| snapshot.answer = newest);
    }

    /// Shows how things are, if nothing was shown for long.
    pub fn keep_fresh(&self) {
        self.notice.keep_fresh();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use tactomo_touch::solve::Solution;
    use tokio::sync::watch;

    use super::super::frame::Frame;
    use super::super::notice::PUBLISH_EVERY;
    use super::*;

    #[derive(Clone, Default)]
    struct Keeper(Arc<Mutex<Vec<Arc<TouchEvent>>>>);

    impl Listener for Keeper {
        fn touched(&mut self, event: &Arc<TouchEvent>) {
            self.0.lock().unwrap().push(Arc::clone(event));
        }
    }

    fn event(sequence: u64, lost: u64) -> TouchEvent {
        let event = TouchEvent::of(sequence, Solution::default());
        TouchEvent { frame: Frame { lost, ..event.frame }, is_taking_baseline: true, ..event }
    }

    #[test]
    fn every_listener_gets_the_same_event_with_what_was_lost_before_it() {
        let keepers = [Keeper::default(), Keeper::default()];
        let listeners = keepers.iter().map(|keeper| Box::new(keeper.clone()) as _).collect();
        let (snapshots, _) = watch::channel(Arc::default());
        let mut answers = Answers::new(Arc::new(NoticeBoard::new(snapshots)), listeners);
        for (sequence, lost) in [(5, 0), (9, 3), (9, 3), (12, 5)] {
            answers.tell(event(sequence, lost), Instant::now(), 1);
        }
        let [one, other] = keepers.map(|keeper| keeper.0.lock().unwrap().clone());
        assert!(one.iter().zip(&other).all(|(one, other)| Arc::ptr_eq(one, other)));
        let lost: Vec<_> = one.iter().map(|event| (event.frame.sequence, event.lost_before)).collect();
        assert_eq!(lost, [(5, 0), (9, 3), (9, 0), (12, 2)]);
        let json = serde_json::to_value(one[1].report()).unwrap();
        assert_eq!((&json["schema"], &json["lost_before"], &json["rezeroing"]), (&1.into(), &3.into(), &true.into()));
        assert_eq!((&json["readings_v"][7], &json["touch_v"][2]), (&0.4.into(), &0.2.into()));
    }

    #[test]
    fn pages_get_what_listeners_got_and_what_came_too_soon_once_it_is_quiet() {
        let (snapshots, shown) = watch::channel(Arc::default());
        let mut answers = Answers::new(Arc::new(NoticeBoard::new(snapshots)), Vec::new());
        let shown = || shown.borrow().answer.clone();
        std::thread::sleep(2 * PUBLISH_EVERY);
        let first = answers.tell(event(0, 0), Instant::now(), 1);
        assert!(shown().is_some_and(|shown| Arc::ptr_eq(&shown, &first)), "it is not copied");
        // Until the pause is over or nothing comes; a busy machine may pause by itself.
        let second = answers.tell(event(1, 0), Instant::now(), 1);
        answers.show_newest();
        assert!(shown().is_some_and(|shown| Arc::ptr_eq(&shown, &second)));
    }

    #[test]
    fn a_pointer_goes_on_until_it_is_none() {
        let (snapshots, _) = watch::channel(Arc::default());
        let mut answers = Answers::new(Arc::new(NoticeBoard::new(snapshots)), Vec::new());
        assert_eq!(answers.tell(event(0, 0), Instant::now(), 1).pointer, None);
        for on in [true, true, false] {
            answers.set_pointer(on);
            assert_eq!(answers.tell(event(1, 0), Instant::now(), 1).pointer.is_some(), on);
        }
    }
}
