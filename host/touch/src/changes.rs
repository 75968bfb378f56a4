//! What has changed since the answer that its reader got before.
//!
//! Each reader of a stream gets another choice of answers: so each has [`Changes`] of its own, and nothing that began or ended between two of
//! them is missed.

use tactomo_physics::space::Place;

use crate::solve::{Change, FoundContact};

/// Remembers the contacts of the answer before.
///
/// ```
/// use tactomo_touch::changes::Changes;
/// use tactomo_touch::solve::{Change, FoundContact};
///
/// let finger = |x_m| FoundContact { id: Some(7), ..FoundContact::flat(x_m, 0.0, 1e-3) };
/// let mut changes = Changes::default();
/// assert_eq!(changes.take(&[finger(0.25)]).contacts[0].change, Some(Change::Start));
/// let moved = changes.take(&[finger(0.5)]);
/// assert_eq!(moved.contacts[0].change, Some(Change::Move { way_m: [0.25, 0.0, 0.0] }));
/// assert_eq!(changes.take(&[]).ended, [7]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Changes {
    before: Vec<(u32, Place)>,
}

/// The contacts of an answer with their changes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Changed {
    /// The contacts; those without a number have no change.
    pub contacts: Vec<FoundContact>,
    /// Numbers of the contacts that were there in the answer before.
    pub ended: Vec<u32>,
}

impl Changes {
    /// Takes the contacts of the next answer.
    pub fn take(&mut self, contacts: &[FoundContact]) -> Changed {
        let before = std::mem::take(&mut self.before);
        let change = |contact: &FoundContact, place_m: Place| {
            let known = before.iter().find(|(id, _)| Some(*id) == contact.id);
            known.map_or(Change::Start, |(_, was_m)| Change::Move {
                way_m: std::array::from_fn(|axis| place_m[axis] - was_m[axis]),
            })
        };
        let mut contacts = contacts.to_vec();
        for contact in &mut contacts {
            let place_m = [contact.x_m, contact.y_m, contact.z_m];
            contact.change = contact.id.map(|_| change(contact, place_m));
            self.before.extend(contact.id.map(|id| (id, place_m)));
        }
        let is_there = |id: &u32| self.before.iter().any(|(now, _)| now == id);
        let ended = before.iter().map(|(id, _)| *id).filter(|id| !is_there(id)).collect();
        Changed { contacts, ended }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn contacts_begin_move_and_end_and_those_without_a_number_do_not() {
        let at = |id, x_m| FoundContact { id, ..FoundContact::flat(x_m, 1.0, 1e-3) };
        let mut changes = Changes::default();
        let first = changes.take(&[at(Some(1), 0.0), at(Some(2), 1.0), at(None, 3.0)]);
        let states: Vec<_> = first.contacts.iter().map(|contact| contact.change).collect();
        assert_eq!(states, [Some(Change::Start), Some(Change::Start), None]);
        assert!(first.ended.is_empty());
        let next = changes.take(&[at(Some(3), 5.0), at(Some(2), 0.5)]);
        let states: Vec<_> = next.contacts.iter().map(|contact| contact.change).collect();
        assert_eq!(states, [Some(Change::Start), Some(Change::Move { way_m: [-0.5, 0.0, 0.0] })]);
        assert_eq!(next.ended, [1]);
        assert_eq!(changes.take(&[]).ended, [3, 2]);
    }
}
