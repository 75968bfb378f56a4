//! Looks for exchanged wires, each in a thread of its own: what these make of the readings may be searched for seconds, in vain.

use std::sync::Arc;
use std::thread;

use tactomo_physics::readings::Readings;
use tactomo_touch::solve::{Look, Solution};

use super::inbox::{Event, Inbox};
use super::notice::NoticeBoard;
use super::options::LookAtWires;
use super::order::Order;

/// Time for which several contacts do not fit, after which a person is asked to check the wires (s): one finger, or one that moves, shows which are
/// exchanged within two.
const ASKED_AFTER_S: f64 = 2.0;
/// What that person is asked.
const CHECK_WIRES: &str = "Check the wires: the readings fit none of the contacts found. Press with one finger, which tells wires that are exchanged.";

/// Looks at wires, one after the other.
pub(super) struct WireLooks {
    inbox: Arc<Inbox>,
    notice: Arc<NoticeBoard>,
    look_at_wires: LookAtWires,
    is_looking: bool,
    doubt: Doubt,
}

/// Doubt about the wires, which no look resolves while several contacts press.
#[derive(Default)]
struct Doubt {
    /// Time of the first answer of several contacts that did not fit, since one fitted or nothing touched (s).
    since_s: Option<f64>,
    is_told: bool,
}

impl Doubt {
    /// Whether the wires are to be checked, after an answer to a frame of this time (s). That stays said while nothing touches, until an answer fits.
    fn answered(&mut self, time_s: f64, solution: &Solution) -> bool {
        match solution.contacts.len() {
            0 => self.since_s = None,
            2.. if solution.flags.misfit => {
                // Whoever seeks back in a recording begins anew.
                let since_s = self.since_s.filter(|since_s| *since_s <= time_s).unwrap_or(time_s);
                self.since_s = Some(since_s);
                self.is_told |= time_s - since_s >= ASKED_AFTER_S;
            }
            _ if !solution.flags.is_doubtful() => *self = Self::default(),
            _ => {}
        }
        self.is_told
    }
}

impl WireLooks {
    /// None yet; what they find goes to `inbox`, and what a person is asked to `notice`.
    pub fn new(inbox: Arc<Inbox>, notice: Arc<NoticeBoard>, look_at_wires: LookAtWires) -> Self {
        Self { inbox, notice, look_at_wires, is_looking: false, doubt: Doubt::default() }
    }

    /// Takes note of an answer to a frame of this time (s): a person is asked to check the wires where looks cannot tell.
    pub fn answered(&mut self, time_s: f64, solution: &Solution) {
        let was_told = self.doubt.is_told;
        let is_told = self.doubt.answered(time_s, solution);
        if is_told != was_told {
            let told = is_told.then_some(CHECK_WIRES);
            told.iter().for_each(|told| tracing::warn!("{told}"));
            self.notice.change(|snapshot| snapshot.wires = told);
        }
    }

    /// Whether one is under way.
    pub fn is_looking(&self) -> bool {
        self.is_looking
    }

    /// Begins one.
    pub fn begin(&mut self, order: Order, look: Look, readings: Readings) {
        let (look_at_wires, inbox) = (Arc::clone(&self.look_at_wires), Arc::clone(&self.inbox));
        let looks = move || {
            // Whatever happens, the follower is not left waiting.
            let looked = std::panic::AssertUnwindSafe(|| look_at_wires(&order, look, &readings));
            let found = std::panic::catch_unwind(looked).unwrap_or_else(|_| {
                tracing::error!("a look at the wires panicked: this is a mistake in the program, please report it");
                None
            });
            inbox.put(Event::Looked(look, found));
        };
        self.is_looking = thread::Builder::new().name("looks at wires".to_owned()).spawn(looks).is_ok();
    }

    /// Takes note that it has ended.
    pub fn ended(&mut self) {
        self.is_looking = false;
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use tactomo_physics::detector::Detector;
    use tactomo_touch::solve::{FaultyElectrodes, Flags, FoundContact, Method};
    use tokio::sync::watch;

    use super::*;

    fn panics(_: &Order, _: Look, _: &Readings) -> Option<[usize; 2]> {
        panic!("as a test wants it")
    }

    #[test]
    fn a_look_that_panics_ends_too() {
        for (look_at_wires, expected) in [
            (Arc::new(|_: &Order, _: Look, _: &Readings| Some([2_usize, 5])) as LookAtWires, Some([2, 5])),
            (Arc::new(panics) as LookAtWires, None),
        ] {
            let inbox = Arc::new(Inbox::new(false));
            let notice = Arc::new(NoticeBoard::new(watch::channel(Arc::default()).0));
            let mut wires = WireLooks::new(Arc::clone(&inbox), notice, look_at_wires);
            let detector = Arc::new(Detector::default());
            let order = Order { method: Method::Contacts, detector, faulty: FaultyElectrodes::default() };
            wires.begin(order, Look::Exchanged, Readings::from_fn(4, |_, _| 0.1));
            assert!(wires.is_looking());
            let Event::Looked(_, found) = inbox.take(Duration::from_secs(60), true) else { panic!("no look ended") };
            wires.ended();
            assert!(found == expected && !wires.is_looking());
        }
    }

    #[test]
    fn two_seconds_of_several_contacts_that_do_not_fit_ask_for_one_finger_until_something_fits() {
        let (snapshots, shown) = watch::channel(Arc::default());
        let notice = Arc::new(NoticeBoard::new(snapshots));
        let looks = Arc::new(|_: &Order, _: Look, _: &Readings| None);
        let mut wires = WireLooks::new(Arc::new(Inbox::new(false)), Arc::clone(&notice), looks);
        let mut is_told_after = |time_s: f64, contacts: usize, misfit: bool| {
            let contacts = vec![FoundContact::flat(0.0, 0.0, 1e-4); contacts];
            wires.answered(
                time_s,
                &Solution { contacts, flags: Flags { misfit, ..Flags::default() }, ..Solution::default() },
            );
            notice.publish(|_| ());
            shown.borrow().wires.is_some()
        };
        assert!(!is_told_after(1.0, 3, true) && !is_told_after(2.9, 2, true));
        assert!(!is_told_after(2.95, 2, false) && !is_told_after(4.0, 2, true), "something fitted in between");
        assert!(!is_told_after(9.0, 1, true), "one contact is looked at by itself");
        assert!(!is_told_after(9.1, 0, false) && !is_told_after(9.2, 3, true) && !is_told_after(11.1, 3, true));
        assert!(is_told_after(11.3, 3, true), "two seconds since something touched");
        assert!(is_told_after(11.4, 0, false) && is_told_after(12.0, 1, true), "it is read while the hand is lifted");
        assert!(!is_told_after(12.5, 1, false), "the finger is found");
        assert!(
            !is_told_after(20.0, 2, true) && !is_told_after(1.0, 2, true) && !is_told_after(2.0, 2, true),
            "back in a recording"
        );
    }
}
