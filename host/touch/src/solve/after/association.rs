//! Data association: a contact keeps its number from frame to frame.

use crate::solve::answer::FoundContact;
use crate::solve::fit::policy;
use tactomo_physics::space::{self, Place};

/// Weight of the newest way in the mean way of a contact between frames.
const NEWEST_WAY: f64 = 0.2;

/// Associates the contacts of a frame with those of frames before, by their places (nearest neighbours first).
#[derive(Clone, Debug)]
pub struct Association {
    /// A contact is nearer than this to where it is expected (m).
    reach_m: f64,
    tracks: Vec<Track>,
    next: u32,
}

/// What is known of a contact's way.
#[derive(Clone, Copy, Debug)]
struct Track {
    id: u32,
    /// Where it was seen last (m).
    place_m: Place,
    /// Its mean way between frames (m).
    way_m: Place,
    /// Frames since it was seen.
    missed: u32,
}

impl Track {
    /// Where it is expected in the next frame (m).
    fn expected_m(&self) -> Place {
        let frames = f64::from(self.missed + 1).min(policy::COASTING_FRAMES);
        std::array::from_fn(|axis| self.place_m[axis] + frames * self.way_m[axis])
    }

    /// It is seen again.
    fn see(&mut self, place_m: Place) {
        let frames = f64::from(self.missed + 1);
        for (axis, way_m) in self.way_m.iter_mut().enumerate() {
            *way_m += NEWEST_WAY * ((place_m[axis] - self.place_m[axis]) / frames - *way_m);
        }
        (self.place_m, self.missed) = (place_m, 0);
    }
}

impl Association {
    /// For contacts that are within `reach_m` (m) of where their velocity brings them.
    pub fn new(reach_m: f64) -> Self {
        Self { reach_m, tracks: Vec::new(), next: 1 }
    }

    /// Numbers the contacts of the next frame. The nearest pairs of known and found contacts are taken for the same first, then those
    /// with contacts that were lost a moment ago; what is left of the found ones is new.
    pub fn number(&mut self, contacts: &mut [FoundContact]) {
        contacts.iter_mut().for_each(|contact| contact.id = None);
        let mut seen = vec![false; self.tracks.len()];
        self.pair(contacts, &mut seen, |track| track.missed == 0);
        self.pair(contacts, &mut seen, |track| track.missed > 0);
        for (track, seen) in self.tracks.iter_mut().zip(seen) {
            track.missed += u32::from(!seen);
        }
        self.tracks.retain(|track| track.missed <= policy::LOST_FRAMES);
        for contact in contacts.iter_mut().filter(|contact| contact.id.is_none()) {
            contact.id = Some(self.next);
            self.tracks.push(Track { id: self.next, place_m: place_m(contact), way_m: [0.0; 3], missed: 0 });
            self.next = self.next.checked_add(1).unwrap_or(1);
        }
    }

    /// Takes the nearest of the found contacts that have no number, and of some tracks, for the same.
    fn pair(&mut self, contacts: &mut [FoundContact], seen: &mut [bool], some: impl Fn(&Track) -> bool) {
        let mut pairs = Vec::new();
        for (known, track) in self.tracks.iter().enumerate().filter(|(_, track)| some(track)) {
            let expected_m = track.expected_m();
            let far_m = |contact: &FoundContact| space::distance(place_m(contact), expected_m);
            let near = contacts.iter().enumerate().filter(|(_, contact)| contact.id.is_none());
            pairs.extend(near.map(|(found, contact)| (far_m(contact), found, known)));
        }
        pairs.retain(|(far_m, ..)| *far_m < self.reach_m);
        pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        for (_, found, known) in pairs {
            if contacts[found].id.is_none() && !seen[known] {
                seen[known] = true;
                contacts[found].id = Some(self.tracks[known].id);
                self.tracks[known].see(place_m(&contacts[found]));
            }
        }
    }

    /// Goes on from contacts that were numbered before, by another solver.
    pub fn inherit(&mut self, before: &[FoundContact]) {
        let track = |contact: &FoundContact| {
            Some(Track { id: contact.id?, place_m: place_m(contact), way_m: [0.0; 3], missed: 0 })
        };
        self.tracks = before.iter().filter_map(track).collect();
        let last = self.tracks.iter().map(|track| track.id).max().unwrap_or(0);
        self.next = self.next.max(last.saturating_add(1));
    }

    /// Forgets all, and counts from 1 again.
    pub fn reset(&mut self) {
        self.tracks.clear();
        self.next = 1;
    }
}

fn place_m(contact: &FoundContact) -> Place {
    [contact.x_m, contact.y_m, contact.z_m]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ids(association: &mut Association, x_m: &[f64]) -> Vec<u32> {
        let mut contacts: Vec<_> = x_m.iter().map(|x_m| FoundContact::flat(*x_m, 0.0, 1e-3)).collect();
        association.number(&mut contacts);
        contacts.iter().filter_map(|contact| contact.id).collect()
    }

    #[test]
    fn contacts_keep_their_numbers_while_they_move_come_and_go() {
        let mut association = Association::new(0.010);
        assert_eq!(ids(&mut association, &[0.0, 0.030]), [1, 2]);
        assert_eq!(ids(&mut association, &[0.028, 0.004]), [2, 1], "in another order");
        assert_eq!(ids(&mut association, &[0.027]), [2]);
        assert_eq!(ids(&mut association, &[0.045, 0.026]), [3, 2], "one that is where none was is new");
        association.reset();
        assert_eq!(ids(&mut association, &[0.004]), [1]);
    }

    #[test]
    fn a_contact_that_is_lost_for_a_moment_keeps_its_number() {
        let mut association = Association::new(0.010);
        assert_eq!(ids(&mut association, &[0.0, 0.030]), [1, 2]);
        (0..policy::LOST_FRAMES).for_each(|_| assert_eq!(ids(&mut association, &[0.030]), [2]));
        assert_eq!(ids(&mut association, &[0.030, 0.001]), [2, 1], "lost for a moment");
        (0..=policy::LOST_FRAMES).for_each(|_| assert_eq!(ids(&mut association, &[0.030]), [2]));
        assert_eq!(ids(&mut association, &[0.030, 0.001]), [2, 3], "lost for long");
        // What is seen goes on before what is lost comes back, however near.
        assert_eq!(ids(&mut association, &[0.002]), [3]);
        (0..5).for_each(|_| assert_eq!(ids(&mut association, &[0.004, 0.031]), [3, 2]));
    }

    #[test]
    fn contacts_that_pass_each_other_keep_their_numbers() {
        let mut association = Association::new(0.010);
        // 1 mm between frames; where they meet, two fingers are one contact for some frames.
        for step in 0..40 {
            let way_m = 0.001 * f64::from(step);
            let both = [way_m, 0.040 - way_m];
            let is_one = (both[0] - both[1]).abs() < 0.005;
            match is_one {
                true => drop(ids(&mut association, &[0.020])),
                false => assert_eq!(ids(&mut association, &both), [1, 2], "step {step}"),
            }
        }
    }
}
