//! Which contacts the host of a digitizer knows of.

use tactomo_protocol::contacts::MAX_CONTACTS;

use super::{FINGER_BYTES, REPORT_BYTES, Report, TOUCH_ID};

/// A contact that the host knows of, or is to know of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Finger {
    /// Its number.
    pub id: u8,
    /// Place, from the left and from the upper edge.
    pub at: [u16; 2],
    /// Whether it touches. One that does not goes once the host has heard of it.
    pub touches: bool,
}

/// Contacts that the host knows of. One that has gone keeps its place until a report has told so, so one more waits if there are as many already.
#[derive(Debug)]
pub(crate) struct Fingers([Option<Finger>; MAX_CONTACTS]);

impl Fingers {
    pub const NONE: Self = Self([None; MAX_CONTACTS]);

    /// Takes what touches now: numbers and places.
    pub fn follow(&mut self, touching: impl Iterator<Item = (u8, [u16; 2])> + Clone) {
        for finger in self.0.iter_mut().flatten() {
            let found = touching.clone().find(|(id, _)| *id == finger.id);
            finger.touches = found.is_some();
            finger.at = found.map_or(finger.at, |(_, at)| at);
        }
        for (id, at) in touching {
            let is_known = self.0.iter().flatten().any(|finger| finger.id == id);
            if !is_known && let Some(free) = self.0.iter_mut().find(|finger| finger.is_none()) {
                *free = Some(Finger { id, at, touches: true });
            }
        }
    }

    /// Whether there is something to tell: a screen that nothing touches is silent.
    pub fn are_any(&self) -> bool {
        self.0.iter().any(Option::is_some)
    }

    /// What is to be told, of a scan at this time (us).
    pub fn report(&self, time_us: u64) -> Report {
        let mut report = [0; REPORT_BYTES];
        report[0] = TOUCH_ID;
        let (places, _) = report[1..].as_chunks_mut::<FINGER_BYTES>();
        let mut count = 0;
        for (place, finger) in places.iter_mut().zip(self.0.iter().flatten()) {
            let [[x0, x1], [y0, y1]] = finger.at.map(u16::to_le_bytes);
            *place = [finger.touches.into(), finger.id, x0, x1, y0, y1];
            count += 1;
        }
        let [t0, t1] = ((time_us / 100) as u16).to_le_bytes();
        report[REPORT_BYTES - 3..].copy_from_slice(&[t0, t1, count]);
        report
    }

    /// The report has gone: who was told to be away is.
    pub fn told(&mut self) {
        self.0.iter_mut().for_each(|finger| *finger = finger.filter(|finger| finger.touches));
    }
}
