//! A contact as a pointer: relative motion, presses and clicks, from contacts that are followed from frame to frame.
//!
//! The pointer belongs to one contact, the firmest when it came, until that is gone; others do not move it. It knows no absolute place: as
//! with a mouse, what counts is how far the contact has gone. A press is harder than what the contact rests or rolls with, by a factor, so
//! that it is the same on any detector and wherever the contact is; while it lasts, small motion is not reported, so that a click stays where
//! it was begun. Firmness is force where the detector has a law of force, else the apparent conductance, which firm contacts have sharply.

use serde::Serialize;

use crate::solve::FoundContact;

/// Time that a contact takes to settle when it comes: it does not move the pointer meanwhile, and cannot press (s).
const SETTLES_S: f64 = 0.1;
/// Time after which a contact that is lost is gone (s). Solvers that follow keep its number for 120 frames, 0.1 s at 1200 frames/s.
const GONE_S: f64 = 0.15;
/// Way below which motion is not reported (m): several times what the place of a resting ball strays by, 0.03 mm on `pad-257x182`.
const STEP_M: f64 = 0.2e-3;
/// A contact is not faster than a hand (m/s), but for what a better answer to the same frame puts right (m). An answer that is further away is
/// not taken until a hand could be there: most are mistakes of a few frames, as after frames that were lost.
const FASTEST_M_PER_S: f64 = 1.5;
const PUT_RIGHT_M: f64 = 2e-3;
/// A press is harder by this factor than the contact rests, and has ended below the second one. A ball under six times the force has an apparent
/// conductance of about twice.
const PRESSED: f64 = 1.4;
const RELEASED: f64 = 1.2;
/// Time that either has to last (s).
const LASTS_S: f64 = 0.01;
/// A press begins while the contact stands still: within this (m) for so long (s). Rolling over a detector that is not quite the one described
/// looks like pressing harder and less hard.
const STILL_M: f64 = 1.5e-3;
const STILL_S: f64 = 0.05;
/// Time constant with which the firmness of rest follows (s), and how many times slower above [`RELEASED`].
const REST_S: f64 = 0.3;
const SLOWER: f64 = 8.0;
/// A press that is shorter is a click (s), unless the contact has gone further than this meanwhile (m): then it drags.
const CLICK_S: f64 = 0.5;
const DRAG_M: f64 = 3e-3;

/// What a pointer does. In JSON an object with its `kind`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum PointerEvent {
    /// It moves on, since the last such event.
    Move {
        /// Along x (m).
        dx_m: f64,
        /// Along y (m).
        dy_m: f64,
    },
    /// It is pressed.
    Press,
    /// It is let go.
    Release {
        /// Time since the press (s).
        held_s: f64,
    },
    /// It was pressed and let go soon after at the same place; follows the release.
    Click {
        /// Where the contact was (m).
        x_m: f64,
        /// Where the contact was (m).
        y_m: f64,
    },
}

/// All that a pointer has done.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointerState {
    /// Sum of its motion (m).
    pub way_m: [f64; 2],
    /// Whether it is pressed.
    pub is_pressed: bool,
    /// Clicks so far.
    pub clicks: u32,
}

/// Turns contacts into what a pointer does.
///
/// ```
/// use tactomo_touch::{pointer::Pointer, solve::FoundContact};
///
/// let mut pointer = Pointer::default();
/// for frame in 0..50 {
///     let finger = FoundContact { id: Some(1), ..FoundContact::flat(2e-4 * f64::from(frame), 0.0, 2e-4) };
///     pointer.take(0.01 * f64::from(frame), &[finger]);
/// }
/// assert!(pointer.state().way_m[0] > 0.005);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Pointer {
    state: PointerState,
    held: Option<Held>,
}

/// The contact that it belongs to.
#[derive(Clone, Debug)]
struct Held {
    id: u32,
    came_s: f64,
    seen_s: f64,
    place_m: [f64; 2],
    /// Up to where the motion was reported (m).
    told_m: [f64; 2],
    /// Where it has been near since when (m, s).
    stands_m: [f64; 2],
    stands_s: f64,
    /// Logarithm of the firmness of rest.
    rest: f64,
    /// Since when firmness has been beyond the threshold that would change what follows (s).
    turning_s: Option<f64>,
    press: Option<Press>,
}

#[derive(Clone, Copy, Debug)]
struct Press {
    begun_s: f64,
    place_m: [f64; 2],
    drags: bool,
}

impl Pointer {
    /// All that it has done.
    pub fn state(&self) -> PointerState {
        self.state
    }

    /// Takes the contacts of a frame at `time_s` (s), or better ones of the same frame.
    pub fn take(&mut self, time_s: f64, contacts: &[FoundContact]) -> Vec<PointerEvent> {
        let mut events = Vec::new();
        if let Some(held) = &mut self.held {
            let same = contacts.iter().find(|contact| contact.id == Some(held.id) && time_s >= held.seen_s);
            match same {
                // However long ago it was seen: frames may have been lost, or passed over by a busy machine.
                Some(contact) => held.see(time_s, contact, &mut events),
                None if (0.0..=GONE_S).contains(&(time_s - held.seen_s)) => {}
                None => self.let_go(time_s, &mut events),
            }
        }
        if self.held.is_none() {
            self.held = Held::firmest(time_s, contacts);
        }
        self.note(&events);
        events
    }

    /// The contact is gone, and with it a press, which is no click.
    fn let_go(&mut self, time_s: f64, events: &mut Vec<PointerEvent>) {
        if let Some(Held { press: Some(press), .. }) = self.held.take() {
            events.push(PointerEvent::Release { held_s: (time_s - press.begun_s).max(0.0) });
        }
    }

    fn note(&mut self, events: &[PointerEvent]) {
        for event in events {
            match event {
                PointerEvent::Move { dx_m, dy_m } => {
                    self.state.way_m = [self.state.way_m[0] + dx_m, self.state.way_m[1] + dy_m];
                }
                PointerEvent::Press => self.state.is_pressed = true,
                PointerEvent::Release { .. } => self.state.is_pressed = false,
                PointerEvent::Click { .. } => self.state.clicks += 1,
            }
        }
    }
}

impl Held {
    fn firmest(time_s: f64, contacts: &[FoundContact]) -> Option<Self> {
        let numbered = contacts.iter().filter(|contact| contact.id.is_some() && firmness(contact) > 0.0);
        let contact = numbered.max_by(|a, b| firmness(a).total_cmp(&firmness(b)))?;
        let place_m = [contact.x_m, contact.y_m];
        Some(Self {
            id: contact.id?,
            came_s: time_s,
            seen_s: time_s,
            place_m,
            told_m: place_m,
            stands_m: place_m,
            stands_s: time_s,
            rest: firmness(contact).ln(),
            turning_s: None,
            press: None,
        })
    }

    fn see(&mut self, time_s: f64, contact: &FoundContact, events: &mut Vec<PointerEvent>) {
        let since_s = time_s - self.seen_s;
        let place_m = [contact.x_m, contact.y_m];
        if distance(place_m, self.place_m) > FASTEST_M_PER_S * since_s + PUT_RIGHT_M {
            return;
        }
        // By the answer before: where frames were lost while it came, it settles in one more.
        let settles = self.seen_s - self.came_s < SETTLES_S;
        (self.seen_s, self.place_m) = (time_s, place_m);
        if distance(place_m, self.stands_m) > STILL_M {
            (self.stands_m, self.stands_s) = (place_m, time_s);
        }
        let firmness = firmness(contact).max(f64::MIN_POSITIVE).ln();
        if settles {
            (self.told_m, self.rest) = (place_m, firmness);
            return;
        }
        self.feel(time_s, since_s, firmness, events);
        self.go(events);
    }

    /// Tells motion, unless it is little or within a press.
    fn go(&mut self, events: &mut Vec<PointerEvent>) {
        if let Some(press) = self.press.as_mut().filter(|press| !press.drags) {
            press.drags = distance(self.place_m, press.place_m) > DRAG_M;
            self.told_m = self.place_m;
            return;
        }
        let [dx_m, dy_m] = [0, 1].map(|axis| self.place_m[axis] - self.told_m[axis]);
        // What looks like a press may become one.
        if self.turning_s.is_none() && dx_m.hypot(dy_m) >= STEP_M {
            events.push(PointerEvent::Move { dx_m, dy_m });
            self.told_m = self.place_m;
        }
    }

    /// Takes the logarithm of its firmness, `since_s` after the last one.
    fn feel(&mut self, time_s: f64, since_s: f64, firmness: f64, events: &mut Vec<PointerEvent>) {
        let harder = firmness - self.rest;
        let is_still = time_s - self.stands_s > STILL_S;
        let turns = if self.press.is_some() { harder < RELEASED.ln() } else { is_still && harder > PRESSED.ln() };
        if self.press.is_none() {
            let time_s = if harder > RELEASED.ln() { SLOWER * REST_S } else { REST_S };
            self.rest += harder * (1.0 - (-since_s / time_s).exp());
        }
        if !turns {
            self.turning_s = None;
            return;
        }
        let turning_s = *self.turning_s.get_or_insert(time_s);
        if time_s - turning_s < LASTS_S {
            return;
        }
        self.turning_s = None;
        match self.press.take() {
            None => {
                self.press = Some(Press { begun_s: turning_s, place_m: self.place_m, drags: false });
                events.push(PointerEvent::Press);
            }
            Some(Press { begun_s, place_m: [x_m, y_m], drags }) => {
                let held_s = turning_s - begun_s;
                events.push(PointerEvent::Release { held_s });
                if held_s <= CLICK_S && !drags {
                    events.push(PointerEvent::Click { x_m, y_m });
                }
            }
        }
    }
}

/// How hard a contact presses, in whatever unit it is known best.
fn firmness(contact: &FoundContact) -> f64 {
    contact.force_n.or(contact.apparent_conductance_s).unwrap_or(contact.conductance_s)
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Time between two frames of the simulated board with 32 electrodes (s).
    const FRAME_S: f64 = 2.7e-3;

    fn contact(id: u32, place_m: [f64; 2], firmness_s: f64) -> FoundContact {
        FoundContact {
            id: Some(id),
            apparent_conductance_s: Some(firmness_s),
            ..FoundContact::flat(place_m[0], place_m[1], 9.0 * firmness_s)
        }
    }

    /// What a pointer does in so many seconds of contacts drawn by their time.
    fn drawn(seconds: f64, mut contacts: impl FnMut(f64) -> Vec<FoundContact>) -> (Vec<(f64, PointerEvent)>, Pointer) {
        let mut pointer = Pointer::default();
        let frames = (0..(seconds / FRAME_S) as usize).map(|frame| frame as f64 * FRAME_S);
        let take = |time_s| pointer.take(time_s, &contacts(time_s)).into_iter().map(move |event| (time_s, event));
        let events: Vec<_> = frames.flat_map(take).collect();
        (events, pointer)
    }

    fn clicks(events: &[(f64, PointerEvent)]) -> usize {
        events.iter().filter(|(_, event)| matches!(event, PointerEvent::Click { .. })).count()
    }

    fn is_move(event: &PointerEvent) -> bool {
        matches!(event, PointerEvent::Move { .. })
    }

    /// 1, and for so long after each second `depth` times as much.
    fn pressing(time_s: f64, depth: f64, for_s: f64) -> f64 {
        if time_s > 1.0 && time_s.fract() < for_s { depth } else { 1.0 }
    }

    #[test]
    fn motion_adds_up_to_the_way_whatever_the_noise() {
        let mut random = fastrand::Rng::with_seed(1);
        let mut noise = || 2e-5 * (random.f64() + random.f64() + random.f64() - 1.5);
        let (events, pointer) = drawn(3.0, |time_s| {
            let x_m = 0.02 * (time_s - 0.5).clamp(0.0, 2.0);
            vec![contact(4, [x_m + noise(), -0.5 * x_m + noise()], 1e-3 * (1.0 + 2e3 * noise()))]
        });
        let [x_m, y_m] = pointer.state().way_m;
        assert!((x_m - 0.04).abs() < 3e-4 && (y_m + 0.02).abs() < 3e-4, "{x_m} {y_m}");
        assert!(events.iter().all(|(time_s, event)| is_move(event) && *time_s > 0.49 && *time_s < 2.52), "{events:?}");
    }

    #[test]
    fn a_short_press_is_a_click_that_stays_and_a_long_one_is_none() {
        let (events, pointer) = drawn(4.0, |time_s| {
            let depth = pressing(time_s, 2.0, if time_s < 3.0 { 0.2 } else { 0.7 });
            // The place is a little off while it is pressed.
            vec![contact(1, [1e-3 * (depth - 1.0), 0.0], 1e-3 * depth)]
        });
        assert_eq!((clicks(&events), pointer.state().clicks, pointer.state().is_pressed), (2, 2, false), "{events:?}");
        let held: Vec<f64> = events
            .iter()
            .filter_map(|(_, event)| if let PointerEvent::Release { held_s } = event { Some(*held_s) } else { None })
            .collect();
        assert_eq!(held.len(), 3);
        for (held_s, of_s) in held.into_iter().zip([0.2, 0.2, 0.7]) {
            assert!((held_s - of_s).abs() < 0.01, "{held_s} s");
        }
        assert!(pointer.state().way_m[0].abs() < STEP_M, "{:?}", pointer.state());
    }

    #[test]
    fn what_changes_slowly_or_little_or_for_a_frame_is_no_press() {
        let mut frame = 0;
        let (events, _) = drawn(8.0, |time_s| {
            frame += 1;
            let slowly = 1.0 + 0.15 * (2.0 * time_s).sin() + 0.2 * time_s;
            let odd = if frame % 100 == 0 { 5.0 } else { 1.0 };
            vec![contact(1, [0.0; 2], 1e-3 * slowly * odd)]
        });
        assert_eq!(events, []);
    }

    #[test]
    fn what_is_firmer_here_and_there_is_no_press_while_it_rolls() {
        let (events, _) = drawn(3.0, |time_s| {
            let x_m = 0.1 * time_s;
            vec![contact(1, [x_m, 0.0], 1e-3 * (0.7 * (300.0 * x_m).sin()).exp())]
        });
        assert!(events.len() > 100 && events.iter().all(|(_, event)| is_move(event)), "{events:?}");
    }

    #[test]
    fn a_press_that_moves_on_drags_and_is_no_click() {
        let (events, pointer) = drawn(2.0, |time_s| {
            let depth = pressing(time_s, 2.0, 0.4);
            vec![contact(1, [0.05 * (time_s - 1.0).clamp(0.0, 0.4), 0.0], 1e-3 * depth)]
        });
        assert_eq!(clicks(&events), 0, "{events:?}");
        // All but what it takes to know that it drags.
        assert!((pointer.state().way_m[0] - 0.02).abs() < 4e-3, "{:?}", pointer.state());
    }

    #[test]
    fn another_contact_neither_moves_it_nor_clicks() {
        let (events, _) = drawn(3.0, |time_s| {
            let other = contact(2, [0.1 * time_s, 0.0], 1e-3 * pressing(time_s, 9.0, 0.2));
            let own = contact(1, [0.0; 2], 2e-3);
            if time_s < 0.5 { vec![own] } else { vec![other, own] }
        });
        assert_eq!(events, []);
    }

    #[test]
    fn a_contact_that_is_lost_for_a_few_frames_goes_on_and_a_new_one_begins_anew() {
        let (events, pointer) = drawn(3.0, |time_s| match time_s {
            // It rolls on while it is not seen.
            t if (1.0..1.05).contains(&t) => Vec::new(),
            t if t < 2.0 => vec![contact(1, [0.02 * t, 0.0], 1e-3)],
            t if t < 2.5 => Vec::new(),
            _ => vec![contact(2, [-0.1, 0.05], 8e-3)],
        });
        assert!(events.iter().all(|(time_s, event)| is_move(event) && *time_s < 2.01), "{events:?}");
        let way_m = 0.02 * (2.0 - SETTLES_S);
        assert!((pointer.state().way_m[0] - way_m).abs() < 4e-4, "{:?}", pointer.state());
    }

    #[test]
    fn frames_that_a_busy_machine_passes_over_cost_no_motion() {
        let mut pointer = Pointer::default();
        let passed_over = |frame: &i32| (300..400).contains(frame);
        for time_s in (0..700).filter(|frame| !passed_over(frame)).map(|frame| FRAME_S * f64::from(frame)) {
            pointer.take(time_s, &[contact(1, [0.1 * time_s, 0.0], 1e-3)]);
        }
        let way_m = 0.1 * (700.0 * FRAME_S - SETTLES_S);
        assert!((pointer.state().way_m[0] - way_m).abs() < 6e-4, "{:?}", pointer.state());
    }

    #[test]
    fn a_contact_that_leaves_while_it_is_pressed_is_released_without_a_click() {
        let (events, pointer) = drawn(2.0, |time_s| {
            if time_s > 1.2 { Vec::new() } else { vec![contact(1, [0.0; 2], 1e-3 * pressing(time_s, 3.0, 0.5))] }
        });
        assert!(matches!(events[..], [(_, PointerEvent::Press), (_, PointerEvent::Release { .. })]), "{events:?}");
        assert!(!pointer.state().is_pressed);
    }

    #[test]
    fn an_answer_that_jumps_is_no_motion_and_a_clock_that_begins_again_no_mistake() {
        let (events, mut pointer) = drawn(2.0, |time_s| {
            let x_m = if (1.0..1.01).contains(&time_s) { 0.04 } else { 0.0 };
            vec![contact(1, [x_m, 0.0], 1e-3)]
        });
        assert_eq!(events, []);
        assert_eq!(pointer.take(0.0, &[contact(1, [0.03, 0.0], 1e-3)]), []);
        assert_eq!(pointer.take(0.2, &[contact(1, [0.03, 0.0], 1e-3)]), []);
    }

    #[test]
    fn force_counts_where_it_is_known() {
        let (events, _) = drawn(2.0, |time_s| {
            let force_n = Some(0.5 * pressing(time_s, 2.0, 0.2));
            vec![FoundContact { force_n, ..contact(1, [0.0; 2], 1e-3) }]
        });
        assert_eq!(clicks(&events), 1, "{events:?}");
    }

    #[test]
    fn events_are_objects_of_a_kind() {
        let json = |event: PointerEvent| serde_json::to_string(&event).unwrap();
        assert_eq!(json(PointerEvent::Move { dx_m: 0.25, dy_m: -0.5 }), r#"{"kind":"move","dx_m":0.25,"dy_m":-0.5}"#);
        assert_eq!(json(PointerEvent::Press), r#"{"kind":"press"}"#);
        assert_eq!(json(PointerEvent::Release { held_s: 0.5 }), r#"{"kind":"release","held_s":0.5}"#);
        assert_eq!(json(PointerEvent::Click { x_m: 1.0, y_m: 2.0 }), r#"{"kind":"click","x_m":1.0,"y_m":2.0}"#);
    }
}
