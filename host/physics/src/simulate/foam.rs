//! What foam does in time: it creeps, it remembers which way its force went, and its conductivity drifts.
//!
//! Each contact's conductance `C` of its force is taken through two operators:
//!
//! - **Hysteresis**: a play operator (Krasnosel'skii and Pokrovskii, *Systems with Hysteresis*, 1989), `w = clamp(w before, C, (1 + h) C)`.
//!   While force grows the conductance is `C`, while it falls `(1 + h) C`, and where it turns the conductance waits for the other curve.
//! - **Creep**: a standard linear solid (Zener, *Elasticity and Anelasticity of Metals*, 1948), `w + a y` with `T dy/dt = w - y`: a press
//!   that is held from time 0 grows as `1 + a (1 - exp(-t / T))`.
//!
//! Both belong to the foam under a contact, so a contact is known again by its place. One that moves leaves what it has pressed: of its memory
//! there remains the share `1 - d / 2r` after a step of `d`, for a radius of `r`. What is lifted conducts nothing, and creeps back.
//!
//! **Drift** is a factor `f` of the foam's conductivity. Contacts keep their conductances in siemens, as under the fault `conductivity`, so
//! all impedances are those of contacts of `C / f`, divided by `f`: exactly so for layers, and for pads, leak and driving layer if these drift too.

use std::f64::consts::TAU;

use super::Fault;
use crate::scene::Touch;
use crate::space::{self, Place};

/// Relative steps of conductances and of the drift: far below what a converter tells, so that what hardly changes is not computed anew.
const STEP: f64 = 1e-6;
/// Memory of a lifted contact that is forgotten, as a share of what it was pressed with.
const FORGOTTEN: f64 = 1e-3;
/// Seconds of a day.
const DAY_S: f64 = 86_400.0;
/// Longest time constants of creep, and longest time (s), that a press is followed back for, and steps in that.
const BEFORE_TIMES: f64 = 10.0;
const BEFORE_S: f64 = 30.0;
const BEFORE_STEPS: u32 = 20_000;

/// A foam in time.
#[derive(Clone, Debug)]
pub struct Foam {
    /// Conductance on the way down, over that on the way up.
    falling: f64,
    creep: Vec<Creep>,
    drift: Vec<Drift>,
    prints: Vec<Print>,
    last_s: Option<f64>,
}

/// What presses, as a foam has it at a moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Pressed {
    /// The touches.
    pub touches: Vec<Touch>,
    /// The factor of the conductivity.
    pub factor: f64,
}

impl Pressed {
    /// The touches that make the same readings on a detector that has not drifted: its impedances are to be divided by the factor.
    pub fn before_drift(&self) -> Vec<Touch> {
        let scaled = |touch: &Touch| Touch { conductance_s: touch.conductance_s / self.factor, ..touch.clone() };
        self.touches.iter().map(scaled).collect()
    }
}

#[derive(Clone, Copy, Debug)]
struct Creep {
    share: f64,
    time_s: f64,
}

#[derive(Clone, Copy, Debug)]
struct Drift {
    share: f64,
    time_s: f64,
    daily: f64,
}

/// Where something presses or pressed.
#[derive(Clone, Debug)]
struct Print {
    place_m: Place,
    radius_m: f64,
    /// Conductance after the play (S): now, and the largest so far.
    played_s: f64,
    largest_s: f64,
    /// `y` of each creep (S).
    crept_s: Vec<f64>,
}

impl Foam {
    /// A foam with what of the faults is of time.
    pub fn new(faults: &[Fault]) -> Self {
        let mut foam = Self { falling: 1.0, creep: Vec::new(), drift: Vec::new(), prints: Vec::new(), last_s: None };
        for fault in faults {
            match *fault {
                Fault::Creep { share, time_s } => foam.creep.push(Creep { share, time_s }),
                Fault::Hysteresis { share } => foam.falling *= 1.0 + share,
                Fault::Drift { share, time_s, daily } => foam.drift.push(Drift { share, time_s, daily }),
                _ => {}
            }
        }
        foam
    }

    /// What `scene` presses at `time_s`, after all that it pressed before, from time zero on.
    pub fn after(faults: &[Fault], time_s: f64, scene: impl Fn(f64) -> Vec<Touch>) -> Pressed {
        let mut foam = Self::new(faults);
        if foam.remembers() {
            let longest_s = foam.creep.iter().map(|creep| creep.time_s).fold(0.0, f64::max);
            let before_s = (BEFORE_S + BEFORE_TIMES * longest_s).min(time_s.max(0.0));
            for step in 0..BEFORE_STEPS {
                let at_s = time_s - before_s * (1.0 - f64::from(step) / f64::from(BEFORE_STEPS));
                foam.press(scene(at_s), at_s);
            }
        }
        foam.press(scene(time_s), time_s)
    }

    /// What presses at `time_s` seconds after the foam was made, not before the last time.
    pub fn press(&mut self, touches: Vec<Touch>, time_s: f64) -> Pressed {
        let factor = self.factor(time_s);
        let touches = if self.remembers() { self.remembered(touches, time_s) } else { touches };
        Pressed { touches, factor }
    }

    /// The conductivity's factor at a time.
    fn factor(&self, time_s: f64) -> f64 {
        let of = |drift: &Drift| {
            let daily = 1.0 + drift.daily * (TAU * time_s / DAY_S).sin();
            (1.0 + drift.share).powf(time_s / drift.time_s) * daily
        };
        in_steps(self.drift.iter().map(of).product())
    }

    fn remembers(&self) -> bool {
        self.falling > 1.0 || !self.creep.is_empty()
    }

    fn remembered(&mut self, mut touches: Vec<Touch>, time_s: f64) -> Vec<Touch> {
        let elapsed_s = time_s - self.last_s.unwrap_or(time_s);
        self.last_s = Some(time_s);
        let found = matched(&touches, &self.prints);
        let mut before: Vec<_> = std::mem::take(&mut self.prints).into_iter().map(Some).collect();
        for (touch, index) in touches.iter_mut().zip(found) {
            if touch.density_s_per_m2().is_err() {
                continue;
            }
            let print = self.pressed(touch, index.and_then(|index| before[index].take()), elapsed_s);
            let crept_s: f64 = self.creep.iter().zip(&print.crept_s).map(|(creep, y)| creep.share * y).sum();
            touch.conductance_s *= in_steps((print.played_s + crept_s) / touch.conductance_s);
            self.prints.push(print);
        }
        let lifted = before.into_iter().flatten().map(|print| self.changed(print, 0.0, elapsed_s));
        let lifted: Vec<_> = lifted.filter(Print::is_remembered).collect();
        self.prints.extend(lifted);
        touches
    }

    /// The print of a touch, after the one that was there before.
    fn pressed(&self, touch: &Touch, before: Option<Print>, elapsed_s: f64) -> Print {
        let (place_m, radius_m) = place_and_radius(touch);
        match before {
            Some(print) => {
                let kept = (1.0 - space::distance(print.place_m, place_m) / (2.0 * radius_m)).max(0.0);
                let print = Print { place_m, radius_m, ..print.faded(kept) };
                self.changed(print, touch.conductance_s, elapsed_s)
            }
            None => Print {
                place_m,
                radius_m,
                played_s: touch.conductance_s,
                largest_s: touch.conductance_s,
                crept_s: vec![0.0; self.creep.len()],
            },
        }
    }

    /// A print after a time in which its conductance went evenly to another (S): the solution of both operators.
    fn changed(&self, mut print: Print, conductance_s: f64, elapsed_s: f64) -> Print {
        let before_s = print.played_s;
        print.played_s = before_s.clamp(conductance_s, self.falling * conductance_s);
        print.largest_s = print.largest_s.max(print.played_s);
        for (creep, crept_s) in self.creep.iter().zip(&mut print.crept_s) {
            let times = elapsed_s / creep.time_s;
            if times > 0.0 {
                let forgot = -(-times).exp_m1();
                let grown_s = print.played_s - before_s;
                *crept_s += forgot * (before_s - *crept_s) + grown_s * (1.0 - forgot / times);
            }
        }
        print
    }
}

impl Print {
    fn faded(mut self, kept: f64) -> Self {
        self.played_s *= kept;
        self.crept_s.iter_mut().for_each(|crept_s| *crept_s *= kept);
        self
    }

    fn is_remembered(&self) -> bool {
        self.crept_s.iter().any(|crept_s| *crept_s > FORGOTTEN * self.largest_s)
    }
}

/// For each touch the print that it is on, if any: the nearest first, none twice.
fn matched(touches: &[Touch], prints: &[Print]) -> Vec<Option<usize>> {
    let mut pairs = Vec::new();
    for (t, touch) in touches.iter().enumerate() {
        let (place_m, radius_m) = place_and_radius(touch);
        for (p, print) in prints.iter().enumerate() {
            let distance_m = space::distance(place_m, print.place_m);
            if distance_m < radius_m.max(print.radius_m) {
                pairs.push((distance_m, t, p));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut found = vec![None; touches.len()];
    for (_, touch, print) in pairs {
        if found[touch].is_none() && !found.contains(&Some(print)) {
            found[touch] = Some(print);
        }
    }
    found
}

/// Where a touch is, and the radius of a disc of its area (m).
fn place_and_radius(touch: &Touch) -> (Place, f64) {
    let [x_m, y_m] = touch.centre_m;
    ([x_m, y_m, touch.z_m], (touch.area_m2() / std::f64::consts::PI).sqrt())
}

/// A factor in whole steps.
fn in_steps(factor: f64) -> f64 {
    ((factor.ln() / STEP).round() * STEP).exp()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Contact;

    const C_S: f64 = 1e-3;

    fn faults(texts: &[&str]) -> Vec<Fault> {
        texts.iter().map(|text| text.parse().unwrap()).collect()
    }

    fn disc(x_m: f64, conductance_s: f64) -> Touch {
        Touch::from(Contact::flat(x_m, 0.0, 0.003, conductance_s))
    }

    /// Conductance of one press, over what its force alone makes.
    fn grown(foam: &mut Foam, touch: Touch, time_s: f64) -> f64 {
        let told_s = touch.conductance_s;
        foam.press(vec![touch], time_s).touches[0].conductance_s / told_s
    }

    fn assert_near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 2e-6 * expected.abs(), "{found} {expected}");
    }

    #[test]
    fn a_held_press_grows_as_a_standard_linear_solid_does() {
        let mut foam = Foam::new(&faults(&["creep:0.2:3"]));
        assert_near(grown(&mut foam, disc(0.0, C_S), 5.0), 1.0);
        for (elapsed_s, rise) in [(0.1, 0.1f64), (3.0, 3.0), (3.5, 3.5), (40.0, 40.0)] {
            assert_near(grown(&mut foam, disc(0.0, C_S), 5.0 + elapsed_s), 1.0 + 0.2 * (1.0 - (-rise / 3.0).exp()));
        }
        let mut both = Foam::new(&faults(&["creep:0.2:3", "creep:0.1:60"]));
        grown(&mut both, disc(0.0, C_S), 0.0);
        let expected = 1.0 + 0.2 * (1.0 - (-2.0f64).exp()) + 0.1 * (1.0 - (-0.1f64).exp());
        assert_near(grown(&mut both, disc(0.0, C_S), 6.0), expected);
    }

    #[test]
    fn under_a_rising_force_creep_lags_as_its_equation_says() {
        // C = r t: y = r (t - T (1 - exp(-t / T))).
        for step_s in [0.01, 0.7] {
            let mut foam = Foam::new(&faults(&["creep:0.5:2"]));
            let (rate, mut last) = (1e-4, 0.0);
            let start_s = 1e-3;
            for step in 0..=(7.0 / step_s) as i32 {
                let time_s = start_s + step_s * f64::from(step);
                last = grown(&mut foam, disc(0.0, rate * time_s), time_s);
            }
            let end_s: f64 = start_s + step_s * f64::from((7.0 / step_s) as i32);
            let crept_s = end_s - 2.0 * (1.0 - (-end_s / 2.0).exp());
            assert!((last - (1.0 + 0.5 * crept_s / end_s)).abs() < 2e-4, "{step_s}: {last}");
        }
    }

    #[test]
    fn what_is_lifted_creeps_back_and_is_found_again_by_its_place() {
        let mut foam = Foam::new(&faults(&["creep:0.2:3"]));
        grown(&mut foam, disc(0.0, C_S), 0.0);
        grown(&mut foam, disc(0.0, C_S), 60.0);
        assert!(foam.press(Vec::new(), 60.0).touches.is_empty());
        foam.press(Vec::new(), 63.0);
        let touches = foam.press(vec![disc(0.02, C_S), disc(0.001, C_S)], 63.0).touches;
        let [other, again] = [0, 1].map(|touch: usize| touches[touch].conductance_s / C_S);
        assert_near(other, 1.0);
        // What was left after a time constant, less what a step of 1 mm leaves of a contact of 3 mm.
        assert_near(again, 1.0 + 0.2 * (-1.0f64).exp() * (1.0 - 1.0 / 6.0));
        foam.press(Vec::new(), 63.0);
        foam.press(Vec::new(), 120.0);
        assert!(foam.prints.is_empty(), "it is forgotten");
    }

    #[test]
    fn a_contact_on_its_way_meets_foam_that_was_not_pressed() {
        let mut foam = Foam::new(&faults(&["creep:0.2:3"]));
        grown(&mut foam, disc(0.0, C_S), 0.0);
        assert_near(grown(&mut foam, disc(0.0, C_S), 60.0), 1.2);
        let mut last = 0.0;
        for step in 1..=600 {
            last = grown(&mut foam, disc(1e-5 * f64::from(step), C_S), 60.0);
        }
        // Steps without number leave exp(-d / 2 r) of it: of 6 mm, the contact's width, 1 / e.
        assert!((last - (1.0 + 0.2 * (-1.0f64).exp())).abs() < 1e-3, "{last}");
    }

    #[test]
    fn loading_and_unloading_are_as_far_apart_as_described_at_any_speed() {
        for step_s in [0.01, 10.0] {
            let mut foam = Foam::new(&faults(&["hysteresis:0.1"]));
            let mut at = |index: i32, force: f64| grown(&mut foam, disc(0.0, C_S * force), step_s * f64::from(index));
            let up: Vec<f64> = (1..=100).map(|i| at(i, f64::from(i))).collect();
            let down: Vec<f64> = (1..=99).map(|i| at(100 + i, f64::from(100 - i))).collect();
            assert!(up.iter().all(|grown| (grown - 1.0).abs() < 1e-5));
            // From 100 down to 95 the conductance waits; from there it is the other curve's.
            assert_near(down[4], 100.0 / 95.0);
            assert!(down[10..].iter().all(|grown| (grown - 1.1).abs() < 1e-5), "{down:?}");
        }
    }

    #[test]
    fn conductivity_drifts_by_its_share_in_each_time_and_with_the_day() {
        let factor = |fault: &str, time_s: f64| Foam::new(&faults(&[fault])).press(Vec::new(), time_s).factor;
        assert_near(factor("drift:0.2:86400", 86400.0), 1.2);
        assert_near(factor("drift:0.2:86400", 2.0 * 86400.0), 1.44);
        assert_near(factor("drift:-0.5:60", 60.0), 0.5);
        assert_near(factor("drift:0:60:0.05", 21600.0), 1.05);
        let mut foam = Foam::new(&faults(&["drift:0.2:60"]));
        let pressed = foam.press(vec![disc(0.0, C_S)], 60.0);
        assert_eq!(pressed.touches, [disc(0.0, C_S)]);
        assert_near(pressed.before_drift()[0].conductance_s, C_S / 1.2);
    }

    #[test]
    fn the_past_of_a_scene_counts() {
        let scene = |time_s: f64| vec![disc(0.0, C_S * (1.0 + (0.7 * time_s).sin().abs()))];
        let faults = faults(&["creep:0.3:1", "hysteresis:0.1", "drift:0.1:100"]);
        let mut foam = Foam::new(&faults);
        let mut stepped = foam.press(scene(0.0), 0.0);
        for step in 1..=9000 {
            stepped = foam.press(scene(1e-3 * f64::from(step)), 1e-3 * f64::from(step));
        }
        let found = Foam::after(&faults, 9.0, scene);
        assert_eq!(found.factor, stepped.factor);
        let ratio = found.touches[0].conductance_s / stepped.touches[0].conductance_s;
        assert!((ratio - 1.0).abs() < 1e-4, "{ratio}");
    }

    #[test]
    fn foam_without_a_memory_passes_on_all_that_presses_even_what_cannot_be() {
        let touches = vec![disc(0.0, C_S), disc(0.01, f64::NAN), disc(f64::NAN, -1.0)];
        let same = |faults: &[Fault]| {
            let pressed = Foam::new(faults).press(touches.clone(), 3.0);
            (pressed.factor, format!("{:?}", pressed.touches)) == (1.0, format!("{touches:?}"))
        };
        assert!(same(&[]) && same(&faults(&["creep:0.2:3", "hysteresis:0.1"])));
    }
}
