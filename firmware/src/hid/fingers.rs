//! Which contacts the host of a digitizer knows of.

use tactomo_protocol::contacts::MAX_CONTACTS;

use super::{FINGER_BYTES, REPORT_BYTES, Report, TOUCH_ID};

/// What is known of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// It touches.
    Touches,
    /// It is no more, and the host has not heard so.
    Gone,
}

/// A contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Finger {
    /// Its number.
    id: u8,
    /// Place, from the left and from the upper edge.
    at: [u16; 2],
    state: State,
}

/// Contacts that the host knows of or is to know of. One that has gone keeps its place until a report has told so, so one more waits if there are as many already.
#[derive(Debug)]
pub(crate) struct Fingers([Option<Finger>; MAX_CONTACTS]);

impl Fingers {
    pub const NONE: Self = Self([None; MAX_CONTACTS]);

    /// Takes what touches now: numbers and places.
    pub fn follow(&mut self, touching: impl Iterator<Item = (u8, [u16; 2])> + Clone) {
        for place in &mut self.0 {
            let Some(finger) = place else { continue };
            match touching.clone().find(|(id, _)| *id == finger.id) {
                Some((_, at)) => (finger.at, finger.state) = (at, State::Touches),
                None => finger.state = State::Gone,
            }
        }
        for (id, at) in touching {
            let is_known = self.0.iter().flatten().any(|finger| finger.id == id);
            if !is_known && let Some(free) = self.0.iter_mut().find(|finger| finger.is_none()) {
                *free = Some(Finger { id, at, state: State::Touches });
            }
        }
    }

    /// Whether there is something to tell: a screen that nothing touches is silent.
    pub fn are_any(&self) -> bool {
        self.0.iter().flatten().next().is_some()
    }

    /// What is to be told, of a scan at this time (us).
    pub fn report(&self, time_us: u64) -> Report {
        let mut report = [0; REPORT_BYTES];
        report[0] = TOUCH_ID;
        let (places, _) = report[1..].as_chunks_mut::<FINGER_BYTES>();
        let mut count = 0;
        for (place, finger) in places.iter_mut().zip(self.0.iter().flatten()) {
            let [[x0, x1], [y0, y1]] = finger.at.map(u16::to_le_bytes);
            *place = [(finger.state == State::Touches).into(), finger.id, x0, x1, y0, y1];
            count += 1;
        }
        let [t0, t1] = ((time_us / 100) as u16).to_le_bytes();
        report[REPORT_BYTES - 3..].copy_from_slice(&[t0, t1, count]);
        report
    }

    /// The report has gone: who was told to be away is.
    pub fn forget_gone(&mut self) {
        self.0.iter_mut().for_each(|finger| *finger = finger.filter(|finger| finger.state != State::Gone));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// State and number of each finger that a report tells of.
    fn told(fingers: &Fingers) -> [Option<(u8, u8)>; MAX_CONTACTS] {
        let report = fingers.report(0);
        let (places, _) = report[1..].as_chunks::<FINGER_BYTES>();
        let count = usize::from(report[REPORT_BYTES - 1]);
        core::array::from_fn(|place| (place < count).then(|| (places[place][0], places[place][1])))
    }

    fn follow(fingers: &mut Fingers, numbers: &[u8]) {
        fingers.follow(numbers.iter().map(|id| (*id, [7, 9])));
    }

    #[test]
    fn contacts_are_told_while_they_are_there_and_once_when_they_have_gone() {
        let mut fingers = Fingers::NONE;
        follow(&mut fingers, &[5]);
        assert_eq!(told(&fingers), [Some((1, 5)), None, None]);
        follow(&mut fingers, &[]);
        assert_eq!(told(&fingers), [Some((0, 5)), None, None]);
        fingers.forget_gone();
        assert!(!fingers.are_any());
    }

    #[test]
    fn one_more_waits_until_the_host_has_heard_that_another_has_gone() {
        let mut fingers = Fingers::NONE;
        follow(&mut fingers, &[1, 2, 3]);
        fingers.forget_gone();
        follow(&mut fingers, &[1, 3, 4]);
        assert_eq!(told(&fingers), [Some((1, 1)), Some((0, 2)), Some((1, 3))]);
        fingers.forget_gone();
        follow(&mut fingers, &[1, 3, 4]);
        assert_eq!(told(&fingers), [Some((1, 1)), Some((1, 4)), Some((1, 3))]);
        // One that comes back before the host has heard has never been away.
        follow(&mut fingers, &[3, 4]);
        follow(&mut fingers, &[1, 3, 4]);
        assert_eq!(told(&fingers)[0], Some((1, 1)));
    }
}
