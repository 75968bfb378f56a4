//! Events on their way from the follower to whoever takes them: streams, files, apps.
//!
//! A follower puts each event in once, and never waits. Each taker has a [`Tail`]: its own place in the same bounded queue. One that falls
//! behind loses events, its own and nobody else's; it counts them, and says so when it begins and at the end.
//!
//! Several detectors may share a feed: each of its events has the name of its detector, and what a taker knows of one it knows of that one alone.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use tactomo_touch::changes::{Changed, Changes};
use tactomo_touch::pointer::PointerEvent;
use tokio::sync::{broadcast, watch};
use tokio::time::timeout;

use super::decimator::Decimator;
use crate::run::{Listener, TouchEvent};

/// Events that may wait for a file: 3.4 s at 1200 a second; of 12 kB each at most, with an image of a thousand nodes.
const QUEUE: usize = 4096;
/// Events that may wait for a reader that wants to know what is now: 0.4 s at 1200 a second. One that is further behind goes on from the
/// newest.
const MOST_BEHIND: usize = 512;
/// Time without an event after which a taker is told that nothing comes.
const QUIET: Duration = Duration::from_millis(100);
/// Time after which a taker is told again what does not change (ns), such as a place: who begins to look in the middle waits no longer.
const RENEWED_EVERY_NS: u64 = 1_000_000_000;

/// An event of a detector by the name that it has among others; an empty one if it is alone.
type Named = (Arc<str>, Arc<TouchEvent>);

/// Where a follower puts events. The tails end once all copies are dropped and they have taken what is left.
#[derive(Clone)]
pub struct Feed {
    patch: Arc<str>,
    events: broadcast::Sender<Named>,
    alive: Arc<watch::Sender<()>>,
}

/// What opens [`Tail`]s while the [`Feed`] lasts.
#[derive(Clone)]
pub struct Taps {
    events: broadcast::WeakSender<Named>,
    alive: watch::Receiver<()>,
}

/// How far a taker may fall behind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Keeps {
    /// As far as there is room: a file, which wants all of them.
    All,
    /// Not far: who wants to know what is now.
    Newest,
}

/// A taker's place in the queue.
pub struct Tail {
    events: broadcast::Receiver<Named>,
    keeps: Keeps,
    most_per_s: Option<f64>,
    losses: Losses,
    patches: BTreeMap<Arc<str>, Course>,
}

/// What a taker has got of one detector.
struct Course {
    decimator: Decimator,
    /// Frames lost by the link or the board until the event that was delivered last, if one was.
    lost: Option<u64>,
    changes: Changes,
    renewal: Renewal,
}

/// When a taker was told last what does not change, such as a place.
#[derive(Clone, Copy, Debug, Default)]
pub struct Renewal(Option<u64>);

impl Renewal {
    /// Whether it is to be told with an event of this time (ns since 1970): with the first, and again once a second.
    pub fn is_due(&mut self, now_ns: u64) -> bool {
        let is_due = self.0.is_none_or(|then_ns| now_ns.abs_diff(then_ns) >= RENEWED_EVERY_NS);
        if is_due {
            self.0 = Some(now_ns);
        }
        is_due
    }
}

/// What a taker has lost, since it was too slow.
#[derive(Debug)]
struct Losses {
    name: String,
    /// Since the event that was delivered last, and of all.
    before: u64,
    all: u64,
}

/// An event, as a taker gets it.
#[derive(Clone, Debug, PartialEq)]
pub struct Delivery {
    /// The name that the detector has among others; empty if it is alone.
    pub patch: Arc<str>,
    /// What the frame gave.
    pub event: Arc<TouchEvent>,
    /// Frames that the link or the board have lost since the delivery before.
    pub lost_before: u64,
    /// Events since the delivery before that this taker has lost, since it was too slow.
    pub missed_before: u64,
    /// What the pointer has done since the delivery before.
    pub pointer_events: Vec<PointerEvent>,
    /// The contacts, with what they have done since the delivery before.
    pub changed: Changed,
    /// Whether what does not change is to be [told](Renewal).
    pub renews: bool,
}

impl Delivery {
    /// An event that nobody had to wait for, before which nothing was missed, and with which all is told; `changes` remember the one before.
    pub fn at_once(event: TouchEvent, changes: &mut Changes) -> Self {
        let (lost_before, pointer_events) = (event.lost_before, event.pointer_events.clone());
        let changed = changes.take(&event.solution.contacts);
        let (patch, event) = (Arc::default(), Arc::new(event));
        Self { patch, event, lost_before, missed_before: 0, pointer_events, changed, renews: true }
    }
}

/// What comes next.
#[derive(Debug)]
pub enum Next {
    /// An event.
    Event(Delivery),
    /// Nothing for a while.
    Quiet,
    /// Nothing more.
    End,
}

impl Default for Feed {
    fn default() -> Self {
        Self { patch: Arc::default(), events: broadcast::Sender::new(QUEUE), alive: Arc::new(watch::Sender::new(())) }
    }
}

impl Feed {
    /// The same feed, for the events of a detector of such a name.
    pub fn of(&self, patch: &str) -> Self {
        Self { patch: patch.into(), ..self.clone() }
    }

    /// What opens tails.
    pub fn taps(&self) -> Taps {
        Taps { events: self.events.downgrade(), alive: self.alive.subscribe() }
    }
}

impl Listener for Feed {
    fn touched(&mut self, event: &Arc<TouchEvent>) {
        // It fails where nobody takes events at the moment.
        let _ = self.events.send((Arc::clone(&self.patch), Arc::clone(event)));
    }
}

impl Taps {
    /// A tail from now on, of a taker of such a name; `None` if there is nothing more to come.
    pub fn open(&self, name: &str, keeps: Keeps, most_per_s: Option<f64>) -> Option<Tail> {
        let events = self.events.upgrade()?.subscribe();
        let losses = Losses { name: name.to_owned(), before: 0, all: 0 };
        Some(Tail { events, keeps, most_per_s, losses, patches: BTreeMap::new() })
    }

    /// Waits until there is nothing more to come.
    pub async fn ended(&mut self) {
        while self.alive.changed().await.is_ok() {}
    }
}

impl Tail {
    /// The next event that is due. May be dropped while it waits: nothing is lost.
    pub async fn next(&mut self) -> Next {
        loop {
            self.catch_up();
            let due = match timeout(QUIET, self.events.recv()).await {
                Ok(Ok((patch, event))) => {
                    self.course(&patch).decimator.take(event).map(|(event, did)| (patch, event, did))
                }
                Ok(Err(broadcast::error::RecvError::Lagged(count))) => {
                    self.losses.add(count);
                    None
                }
                Ok(Err(broadcast::error::RecvError::Closed)) => match self.held() {
                    Some(last) => Some(last),
                    None => return Next::End,
                },
                Err(_) => match self.held() {
                    Some(newest) => Some(newest),
                    None => return Next::Quiet,
                },
            };
            if let Some((patch, event, pointer_events)) = due {
                return Next::Event(self.deliver(patch, event, pointer_events));
            }
        }
    }

    fn course(&mut self, patch: &Arc<str>) -> &mut Course {
        let decimator = || Decimator::new(self.most_per_s);
        let begun =
            || Course { decimator: decimator(), lost: None, changes: Changes::default(), renewal: Renewal::default() };
        self.patches.entry(Arc::clone(patch)).or_insert_with(begun)
    }

    /// What waits of any detector, if something does.
    fn held(&mut self) -> Option<(Arc<str>, Arc<TouchEvent>, Vec<PointerEvent>)> {
        let of = |(patch, course): (&Arc<str>, &mut Course)| {
            course.decimator.held().map(|(event, did)| (Arc::clone(patch), event, did))
        };
        self.patches.iter_mut().find_map(of)
    }

    /// Whether nothing waits, or what waits need not come soon.
    pub fn is_drained(&self) -> bool {
        self.most_per_s.is_some() || self.events.is_empty()
    }

    /// Waits for what may take long: writing to a reader that stalls. What is lost meanwhile is counted, and said, while it is.
    pub async fn wait_for<T>(&mut self, slow: impl Future<Output = T>) -> T {
        let mut slow = std::pin::pin!(slow);
        loop {
            match timeout(QUIET, &mut slow).await {
                Ok(done) => return done,
                Err(_) => self.catch_up(),
            }
        }
    }

    /// Goes on from the newest, if it is too far behind for one that wants to know what is now.
    fn catch_up(&mut self) {
        if self.keeps == Keeps::All || self.events.len() <= MOST_BEHIND {
            return;
        }
        let mut skipped = 0;
        while self.events.len() > 1 {
            skipped += match self.events.try_recv() {
                Ok(_) => 1,
                Err(broadcast::error::TryRecvError::Lagged(count)) => count,
                Err(_) => break,
            };
        }
        self.losses.add(skipped);
    }

    fn deliver(&mut self, patch: Arc<str>, event: Arc<TouchEvent>, pointer_events: Vec<PointerEvent>) -> Delivery {
        let (course, lost) = (self.course(&patch), event.frame.lost);
        // What was lost before the first is no matter of this taker's.
        let before = course.lost.replace(lost).unwrap_or(lost.saturating_sub(event.lost_before));
        let lost_before = lost.saturating_sub(before);
        let changed = course.changes.take(&event.solution.contacts);
        let renews = course.renewal.is_due(event.frame.arrived.unix_ns);
        let missed_before = std::mem::take(&mut self.losses.before);
        Delivery { patch, event, lost_before, missed_before, pointer_events, changed, renews }
    }
}

impl Losses {
    fn add(&mut self, count: u64) {
        if self.all == 0 {
            tracing::warn!("{} is too slow: it loses answers", self.name);
        }
        self.before += count;
        self.all += count;
    }
}

impl Drop for Losses {
    fn drop(&mut self) {
        if self.all > 0 {
            tracing::warn!("{} has lost {} answers: it was too slow", self.name, self.all);
        }
    }
}

#[cfg(test)]
mod tests {
    use tactomo_touch::solve::{Change, FoundContact, Solution};

    use super::*;
    use crate::run::{Arrival, Frame};

    fn block_on<T>(future: impl Future<Output = T>) -> T {
        tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap().block_on(future)
    }

    fn event(sequence: u64, lost: u64) -> Arc<TouchEvent> {
        let event = TouchEvent::of(sequence, Solution::default());
        Arc::new(TouchEvent { frame: Frame { lost, ..event.frame }, ..event })
    }

    fn deliveries(mut tail: Tail) -> Vec<Delivery> {
        block_on(async {
            let mut all = Vec::new();
            while let Next::Event(delivery) = tail.next().await {
                all.push(delivery);
            }
            all
        })
    }

    #[test]
    fn everybody_gets_every_event_and_then_the_end() {
        let mut feed = Feed::default();
        let taps = feed.taps();
        let tails = [Keeps::All, Keeps::Newest].map(|keeps| taps.open("test", keeps, None).unwrap());
        let events: Vec<_> = (0..100).map(|sequence| event(sequence, sequence / 10)).collect();
        events.iter().for_each(|event| feed.touched(event));
        drop(feed);
        assert!(taps.open("late", Keeps::All, None).is_none());
        for all in tails.map(deliveries) {
            assert!(all.iter().map(|delivery| &delivery.event).eq(&events));
            assert_eq!(all.iter().map(|delivery| delivery.lost_before).sum::<u64>(), 9);
            assert_eq!((all[10].lost_before, all[11].lost_before), (1, 0));
        }
    }

    #[test]
    fn every_reader_is_told_what_began_and_ended_between_the_answers_that_it_gets() {
        let with = |sequence, ids: &[u32]| {
            let contacts = ids.iter().map(|id| FoundContact { id: Some(*id), ..FoundContact::default() }).collect();
            let event = TouchEvent::of(sequence, Solution { contacts, ..Solution::default() });
            let frame = Frame { board_time_us: sequence, ..event.frame };
            Arc::new(TouchEvent { frame, ..event })
        };
        let mut feed = Feed::default();
        let tails = [None, Some(100.0)].map(|most_per_s| feed.taps().open("test", Keeps::All, most_per_s).unwrap());
        // The last reader gets the first and the last of them.
        for event in [with(0, &[1, 2]), with(1000, &[1, 3]), with(2000, &[1, 3]), with(10_000, &[1, 4])] {
            feed.touched(&event);
        }
        drop(feed);
        let [all, some] = tails.map(|tail| {
            let began = |contact: &FoundContact| contact.change == Some(Change::Start);
            let told = |delivery: Delivery| {
                let Changed { contacts, ended } = delivery.changed;
                (contacts.iter().filter(|contact| began(contact)).filter_map(|contact| contact.id).collect(), ended)
            };
            deliveries(tail).into_iter().map(told).collect::<Vec<(Vec<_>, Vec<_>)>>()
        });
        assert_eq!(all, [(vec![1, 2], vec![]), (vec![3], vec![2]), (vec![], vec![]), (vec![4], vec![3])]);
        assert_eq!(some, [(vec![1, 2], vec![]), (vec![4], vec![2])]);
    }

    #[test]
    fn what_is_told_of_one_detector_is_no_matter_of_another_on_the_same_feed() {
        let with = |sequence, lost, id| {
            let contacts = vec![FoundContact { id: Some(id), ..FoundContact::default() }];
            let event = TouchEvent::of(sequence, Solution { contacts, ..Solution::default() });
            let frame = Frame { lost, board_time_us: 1000 * sequence, ..event.frame };
            Arc::new(TouchEvent { frame, ..event })
        };
        let feed = Feed::default();
        let tails = [None, Some(200.0)].map(|most_per_s| feed.taps().open("test", Keeps::All, most_per_s).unwrap());
        let mut of = ["index", "thumb"].map(|patch| feed.of(patch));
        drop(feed);
        for sequence in 0..20 {
            of[0].touched(&with(sequence, 0, 1));
            of[1].touched(&with(sequence + 70_000, sequence, 2));
        }
        drop(of);
        let [all, some] = tails.map(deliveries);
        let of = |all: &[Delivery], patch: &str| -> Vec<(u64, u64, usize)> {
            let of = all.iter().filter(|delivery| &*delivery.patch == patch);
            of.map(|one| (one.event.frame.sequence, one.lost_before, one.changed.ended.len())).collect()
        };
        assert_eq!(of(&all, "index"), (0..20).map(|sequence| (sequence, 0, 0)).collect::<Vec<_>>());
        let every: Vec<_> = (70_000..70_020).map(|sequence| (sequence, u64::from(sequence > 70_000), 0)).collect();
        assert_eq!(of(&all, "thumb"), every);
        assert_eq!(of(&some, "index"), [0, 5, 10, 15, 19].map(|sequence| (sequence, 0, 0)));
        assert_eq!(of(&some, "thumb").iter().map(|(_, lost, _)| lost).sum::<u64>(), 19);
    }

    #[test]
    fn what_does_not_change_is_told_with_the_first_and_once_a_second() {
        let feed = Feed::default();
        let tail = feed.taps().open("test", Keeps::All, None).unwrap();
        let mut of = ["index", "thumb"].map(|patch| feed.of(patch));
        drop(feed);
        for quarter in 0..9 {
            let event = TouchEvent::of(quarter, Solution::default());
            let arrived = Arrival::recorded(Duration::from_millis(250 * quarter));
            let event = Arc::new(TouchEvent { frame: Frame { arrived, ..event.frame }, ..event });
            of.iter_mut().for_each(|feed| feed.touched(&event));
        }
        drop(of);
        let told = deliveries(tail).into_iter().filter(|delivery| delivery.renews);
        let told: Vec<_> = told.map(|delivery| delivery.event.frame.sequence).collect();
        assert_eq!(told, [0, 0, 4, 4, 8, 8]);
    }

    #[test]
    fn what_is_lost_during_a_long_wait_is_counted() {
        let mut feed = Feed::default();
        let mut tail = feed.taps().open("stalled", Keeps::Newest, None).unwrap();
        (0..1000).for_each(|sequence| feed.touched(&event(sequence, 0)));
        block_on(async { tail.wait_for(tokio::time::sleep(2 * QUIET)).await });
        feed.touched(&event(1000, 0));
        drop(feed);
        let all = deliveries(tail);
        assert_eq!((all[0].event.frame.sequence, all[0].missed_before, all.len()), (999, 999, 2));
    }

    #[test]
    fn who_is_too_slow_loses_the_oldest_and_is_told_how_many() {
        let mut feed = Feed::default();
        let [file, live] = [Keeps::All, Keeps::Newest].map(|keeps| feed.taps().open("slow", keeps, None).unwrap());
        let count = QUEUE as u64 + 1000;
        (0..count).for_each(|sequence| feed.touched(&event(sequence, 0)));
        drop(feed);
        let all = deliveries(file);
        assert_eq!((all[0].event.frame.sequence, all[0].missed_before, all.len()), (1000, 1000, QUEUE));
        let newest = deliveries(live);
        assert_eq!((newest[0].event.frame.sequence, newest[0].missed_before, newest.len()), (count - 1, count - 1, 1));
    }
}
