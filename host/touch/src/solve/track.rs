//! The same number for the same contact from frame to frame.

use super::FoundContact;
use tactomo_physics::space;

/// Follows contacts by their places.
#[derive(Clone, Debug)]
pub struct Tracker {
    /// A contact moves less than this between frames (m).
    reach_m: f64,
    known: Vec<FoundContact>,
    next: u32,
}

impl Tracker {
    /// For contacts that move less than `reach_m` (m) between frames.
    pub fn new(reach_m: f64) -> Self {
        Self { reach_m, known: Vec::new(), next: 1 }
    }

    /// Numbers the contacts of the next frame. The nearest pairs of known and found contacts are taken for the same first; what is
    /// left of the found ones is new.
    pub fn follow(&mut self, contacts: &mut [FoundContact]) {
        let mut pairs: Vec<_> = (0..contacts.len())
            .flat_map(|found| (0..self.known.len()).map(move |known| (found, known)))
            .map(|(found, known)| (distance_m(&contacts[found], &self.known[known]), found, known))
            .filter(|(distance_m, ..)| *distance_m < self.reach_m)
            .collect();
        pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        contacts.iter_mut().for_each(|contact| contact.id = None);
        let mut taken = vec![false; self.known.len()];
        for (_, found, known) in pairs {
            if contacts[found].id.is_none() && !taken[known] {
                taken[known] = true;
                contacts[found].id = self.known[known].id;
            }
        }
        for contact in contacts.iter_mut().filter(|contact| contact.id.is_none()) {
            contact.id = Some(self.next);
            self.next = self.next.checked_add(1).unwrap_or(1);
        }
        self.known.clear();
        self.known.extend_from_slice(contacts);
    }

    /// Goes on from contacts that were numbered before, by another solver.
    pub fn inherit(&mut self, before: &[FoundContact]) {
        self.known = before.iter().copied().filter(|contact| contact.id.is_some()).collect();
        let last = self.known.iter().filter_map(|contact| contact.id).max().unwrap_or(0);
        self.next = self.next.max(last.saturating_add(1));
    }

    /// Forgets all, and counts from 1 again.
    pub fn reset(&mut self) {
        self.known.clear();
        self.next = 1;
    }
}

fn distance_m(a: &FoundContact, b: &FoundContact) -> f64 {
    space::distance([a.x_m, a.y_m, a.z_m], [b.x_m, b.y_m, b.z_m])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids(tracker: &mut Tracker, x_m: &[f64]) -> Vec<u32> {
        let mut contacts: Vec<_> = x_m.iter().map(|x_m| FoundContact::flat(*x_m, 0.0, 1e-3)).collect();
        tracker.follow(&mut contacts);
        contacts.iter().filter_map(|contact| contact.id).collect()
    }

    #[test]
    fn contacts_keep_their_numbers_while_they_move_come_and_go() {
        let mut tracker = Tracker::new(0.010);
        assert_eq!(ids(&mut tracker, &[0.0, 0.030]), [1, 2]);
        assert_eq!(ids(&mut tracker, &[0.028, 0.004]), [2, 1], "in another order");
        assert_eq!(ids(&mut tracker, &[0.027]), [2]);
        assert_eq!(ids(&mut tracker, &[0.004, 0.026]), [3, 2], "one that was gone is new");
        tracker.reset();
        assert_eq!(ids(&mut tracker, &[0.004]), [1]);
    }
}
