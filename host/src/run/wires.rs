//! Looks for exchanged wires, each in a thread of its own: what these make of the readings may be searched for seconds, in vain.

use std::sync::Arc;
use std::thread;

use tactomo_physics::readings::Readings;
use tactomo_touch::solve::Look;

use super::inbox::{Event, Inbox};
use super::options::LookAtWires;
use super::order::Order;

/// Looks at wires, one after the other.
pub(super) struct WireLooks {
    inbox: Arc<Inbox>,
    look_at_wires: LookAtWires,
    is_looking: bool,
}

impl WireLooks {
    /// None yet; what they find goes to `inbox`.
    pub fn new(inbox: Arc<Inbox>, look_at_wires: LookAtWires) -> Self {
        Self { inbox, look_at_wires, is_looking: false }
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
    use tactomo_touch::solve::{FaultyElectrodes, Method};

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
            let mut wires = WireLooks::new(Arc::clone(&inbox), look_at_wires);
            let detector = Arc::new(Detector::default());
            let order = Order { method: Method::Contacts, detector, faulty: FaultyElectrodes::default() };
            wires.begin(order, Look::Exchanged, Readings::from_fn(4, |_, _| 0.1));
            assert!(wires.is_looking());
            let Event::Looked(_, found) = inbox.take(Duration::from_secs(60), true) else { panic!("no look ended") };
            wires.ended();
            assert!(found == expected && !wires.is_looking());
        }
    }
}
