//! The demonstrations of the paper's section V: what presses in each, in newtons by Hertz, on the detector that it was made for.
//!
//! The paper tells none of the forces. They press an ideal surface unless a hand brings another: on one as its table II measured, fingers would have
//! to press with 5 N and more.
//!
//! On another detector lengths scale with its shorter side and forces with the square of that, so that contacts keep their proportions
//! (by Hertz, `a^3` goes with force times radius).

use std::f64::consts::TAU;

use super::hand::FINGERTIPS;
use super::{Hand, SceneName, Shape, Touch};
use crate::detector::Detector;
use crate::geometry::Point;
use crate::hertz::Hertz;

/// Frequency with which bumps of the texture pass (Hz): of a pitch of 5 mm at 60 mm/s on the detector of 10 mm. The paper shows vibration of
/// more than 10 Hz.
pub const TEXTURE_HZ: f64 = 12.0;

/// A press of less than this share of the firmest is no press.
const LIGHTEST: f64 = 0.01;
/// How far places and angles differ by the seed: shares of half the shorter side, and rad.
const OFF: f64 = 0.02;
const TURN_RAD: f64 = 0.03;

/// Seconds of the gripper from open to open: it closes, holds, the rod slips, it holds on and lets go.
const GRIP_S: f64 = 6.0;
const CLOSES_S: [f64; 2] = [0.6, 1.8];
const SLIPS_S: [f64; 2] = [3.2, 3.5];
const OPENS_S: [f64; 2] = [4.6, 5.2];
/// Radius of the rod that is gripped (m).
const ROD_M: f64 = 0.012;
/// Where the rod begins, how long its whole contact is and how far it slips, in shares of half the longer side.
const ROD: [f64; 3] = [-0.75, 1.2, 0.2];

/// Seconds from stroke to stroke on the display; when the finger strokes, two pinch and one taps, twice.
const DISPLAY_S: f64 = 8.0;
const STROKE_S: [f64; 2] = [0.4, 2.4];
const PINCH_S: [f64; 2] = [2.9, 5.3];
const TAPS_S: [[f64; 2]; 2] = [[5.9, 6.2], [6.5, 6.8]];
/// Time that a finger takes to come down or to lift (s).
const LANDING_S: f64 = 0.1;
/// Radius of a fingertip (m).
const FINGERTIP_M: f64 = 0.008;

/// Where the ball stops and is pressed, in shares of half the sides.
const TARGETS: [Point; 4] = [[-0.5, -0.4], [0.45, 0.35], [0.4, -0.45], [-0.45, 0.4]];
/// When the ball is laid on the pad, and the seconds that it rolls from one target to the next, waits there, and is pressed while it waits.
const LAID_S: [f64; 2] = [0.3, 0.5];
const ROLLS_S: f64 = 1.2;
const STAYS_S: f64 = 0.7;
const CLICK_S: [f64; 2] = [1.4, 1.65];
/// Radius of the ball (m), and the force it rolls under as a share of that of a click.
const BALL_M: f64 = 0.015;
const ROLLING: f64 = 1.0 / 6.0;

/// When the texture comes to lie on the fingertip (s).
const TEXTURE_FROM_S: [f64; 2] = [0.3, 0.5];
/// Radius of a bump (m); their pitch, in shares of the shorter side.
const BUMP_M: f64 = 0.001;
const PITCH: f64 = 0.5;
/// The fingertip is round: the force fades to nothing at this distance from its middle, in shares of the shorter side.
const CAP: f64 = 0.42;

/// Seconds from hand to hand; when fingers and palm come down and lift.
const HAND_S: f64 = 6.0;
const FINGERS_S: [f64; 2] = [0.4, 5.2];
const PALM_S: [f64; 2] = [0.8, 5.0];
const HAND_LANDING_S: f64 = 0.3;
/// Middle of the palm's heel in shares of the shorter side, its radius (m), and the force of a finger as a share of the palm's.
const PALM: Point = [0.05, -0.27];
const PALM_M: f64 = 0.05;
const FINGER: f64 = 0.4;

/// One of the paper's demonstrations on a detector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Demonstration {
    name: SceneName,
    hertz: Hertz,
    half_size_m: [f64; 2],
    /// Lengths here over those on the detector that it was made for.
    scale: f64,
    firmest_n: f64,
    /// How far it is off its usual place (m), and its angle (rad).
    off_m: Point,
    turn_rad: f64,
}

impl Demonstration {
    /// The demonstration of that name, if it is one; `phase` (rad) chooses its place.
    pub(super) fn new(name: SceneName, detector: &Detector, hand: &Hand, phase: f64) -> Option<Self> {
        let own = Detector::preset(name.detector()?)?;
        let half_size_m = detector.outline.size_m().map(|side_m| side_m / 2.0);
        let shorter_m = |half: [f64; 2]| half[0].min(half[1]);
        let scale = shorter_m(half_size_m) / shorter_m(own.outline.size_m().map(|side_m| side_m / 2.0));
        let (sin, cos) = phase.sin_cos();
        Some(Self {
            name,
            hertz: hand.hertz(),
            half_size_m,
            scale,
            firmest_n: hand.force_n().unwrap_or(firmest_n(name) * scale * scale),
            off_m: [cos, sin].map(|share| OFF * shorter_m(half_size_m) * share),
            turn_rad: TURN_RAD * cos,
        })
    }

    /// All that touches at a time (s).
    pub(super) fn at(&self, time_s: f64) -> Vec<Touch> {
        match self.name {
            SceneName::Gripper => self.gripper(time_s % GRIP_S).into_iter().collect(),
            SceneName::Display => self.display(time_s % DISPLAY_S),
            SceneName::Pointer => self.pointer(time_s).into_iter().collect(),
            SceneName::Texture => self.texture(time_s),
            SceneName::Hand => self.hand(time_s % HAND_S),
            _ => Vec::new(),
        }
    }

    /// A soft finger lays itself along a rod from its root on, and peels off it again.
    fn gripper(&self, time_s: f64) -> Option<Touch> {
        let closed = rise(time_s, CLOSES_S) * (1.0 - rise(time_s, OPENS_S));
        if closed < LIGHTEST {
            return None;
        }
        let [width_m, height_m] = self.half_size_m;
        let (half_m, turned_rad) = if width_m > height_m { (width_m, 0.0) } else { (height_m, TAU / 4.0) };
        let [from, whole, slip] = ROD.map(|share| share * half_m);
        let length_m = (0.15 + 0.85 * closed) * whole;
        let middle_m = from + length_m / 2.0 + slip * rise(time_s, SLIPS_S);
        let angle_rad = turned_rad + self.turn_rad;
        let centre_m = self.off([middle_m * angle_rad.cos(), middle_m * angle_rad.sin()]);
        let imprint = self.hertz.cylinder(ROD_M * self.scale, length_m, self.firmest_n * closed);
        let shape = Shape::Line { length_m, width_m: 2.0 * imprint.half_width_m, angle_rad };
        Some(Touch::flat(centre_m, shape, imprint.conductance_s))
    }

    fn display(&self, time_s: f64) -> Vec<Touch> {
        let finger = |place: Point, share: f64| self.ball(self.at_share(place), FINGERTIP_M, share);
        let along = rise(time_s, STROKE_S);
        let stroke = finger([1.3 * along - 0.7, 0.35 * (TAU * along).sin()], down(time_s, STROKE_S, LANDING_S));
        let [begin, end] = PINCH_S;
        let apart = 0.5 - 0.3 * rise(time_s, [begin, begin + 1.3]) + 0.15 * rise(time_s, [begin + 1.5, end]);
        let pressed = down(time_s, PINCH_S, LANDING_S);
        let pinch = [-1.0, 1.0].map(|side| finger([side * apart, side * 0.4 * apart], pressed));
        let tap = TAPS_S.map(|tap_s| finger([0.45, -0.3], down(time_s, tap_s, LANDING_S)));
        [stroke].into_iter().chain(pinch).chain(tap).flatten().collect()
    }

    /// A ball rolls under a palm from target to target and is pressed at each.
    fn pointer(&self, time_s: f64) -> Option<Touch> {
        let round_s = time_s - LAID_S[1];
        let leg = (round_s / (ROLLS_S + STAYS_S)).floor().max(0.0);
        let leg_s = round_s - leg * (ROLLS_S + STAYS_S);
        let [from, to] = [0, 1].map(|next| TARGETS[(leg as usize + next) % TARGETS.len()]);
        let way = rise(leg_s, [0.0, ROLLS_S]);
        let place = [0, 1].map(|axis| from[axis] + way * (to[axis] - from[axis]));
        let middle_s = (CLICK_S[0] + CLICK_S[1]) / 2.0;
        let press = down(leg_s, CLICK_S, middle_s - CLICK_S[0]);
        self.ball(self.at_share(place), BALL_M, rise(time_s, LAID_S) * (ROLLING + (1.0 - ROLLING) * press))
    }

    /// A row of bumps of rubber that passes under a round fingertip.
    fn texture(&self, time_s: f64) -> Vec<Touch> {
        let shorter_m = 2.0 * self.half_size_m[0].min(self.half_size_m[1]);
        let (pitch_m, cap_m) = (PITCH * shorter_m, CAP * shorter_m);
        let passed = (TEXTURE_HZ * time_s).fract();
        let laid = rise(time_s, TEXTURE_FROM_S);
        let bump = |number: i32| {
            let along_m = (f64::from(number) + passed) * pitch_m;
            let share = laid * (TAU / 4.0 * (along_m / cap_m).clamp(-1.0, 1.0)).cos().powi(2);
            self.ball(self.off([along_m, 0.0]), BUMP_M, share)
        };
        (-2..=1).filter_map(bump).collect()
    }

    /// A hand that is laid down, the fingers first.
    fn hand(&self, time_s: f64) -> Vec<Touch> {
        let shorter_m = 2.0 * self.half_size_m[0].min(self.half_size_m[1]);
        let place_m = |place: Point| self.off(place.map(|share| share * shorter_m));
        let palm = self.ball(place_m(PALM), PALM_M, down(time_s, PALM_S, HAND_LANDING_S));
        let pressed = FINGER * down(time_s, FINGERS_S, HAND_LANDING_S);
        let fingers = FINGERTIPS.into_iter().map(|finger| self.ball(place_m(finger), FINGERTIP_M, pressed));
        fingers.chain([palm]).flatten().collect()
    }

    /// The contact of a ball under a share of the firmest press; none if that is nearly nothing.
    fn ball(&self, centre_m: Point, radius_m: f64, share: f64) -> Option<Touch> {
        let imprint = self.hertz.ball(radius_m * self.scale, self.firmest_n * share);
        let shape = Shape::Disc { radius_m: imprint.half_width_m };
        (share > LIGHTEST).then(|| Touch::flat(centre_m, shape, imprint.conductance_s))
    }

    fn at_share(&self, place: Point) -> Point {
        self.off([0, 1].map(|axis| place[axis] * self.half_size_m[axis]))
    }

    fn off(&self, place_m: Point) -> Point {
        [0, 1].map(|axis| place_m[axis] + self.off_m[axis])
    }
}

/// Force of its firmest press on the detector that it was made for (N): on sample A contacts stay within Hertz's theory, but for the click.
fn firmest_n(name: SceneName) -> f64 {
    match name {
        SceneName::Gripper => 0.5,
        SceneName::Display => 0.2,
        SceneName::Pointer => 3.0,
        SceneName::Texture => 0.008,
        _ => 1.2,
    }
}

/// From 0 to 1 between two times (s), smoothly.
fn rise(time_s: f64, [from_s, to_s]: [f64; 2]) -> f64 {
    let share = ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// 1 between two times (s) and 0 before and after; coming down and lifting takes so long each.
fn down(time_s: f64, [from_s, to_s]: [f64; 2], landing_s: f64) -> f64 {
    rise(time_s, [from_s, from_s + landing_s]) * (1.0 - rise(time_s, [to_s - landing_s, to_s]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry;
    use crate::scene::{Fingertip, Scene};

    const ALL: [SceneName; 5] =
        [SceneName::Gripper, SceneName::Display, SceneName::Pointer, SceneName::Texture, SceneName::Hand];

    fn own(name: SceneName) -> Detector {
        Detector::preset(name.detector().unwrap()).unwrap()
    }

    fn scene(name: SceneName) -> Scene {
        let detector = own(name);
        Scene::new(name, &detector, Hand::relative(&detector), 1)
    }

    /// Each hundredth of a second of a round and more.
    fn times() -> impl Iterator<Item = f64> {
        (0..1000).map(|i| 0.01 * f64::from(i))
    }

    #[test]
    fn they_are_the_demonstrations_of_the_paper_and_each_begins_with_nothing() {
        let detectors = ALL.map(|name| name.detector().unwrap());
        assert_eq!(detectors, ["strip-13x60", "display-140x70", "pad-257x182", "fingertip-10", "square-150"]);
        for name in ALL {
            assert!(
                times().take_while(|time_s| *time_s < 0.3).all(|time_s| scene(name).at(time_s).is_empty()),
                "{name}"
            );
            assert!(times().any(|time_s| !scene(name).at(time_s).is_empty()), "{name}");
        }
        assert_eq!(SceneName::ALL.into_iter().filter(|name| name.detector().is_some()).count(), ALL.len());
    }

    #[test]
    fn contacts_stay_on_every_detector_and_are_neither_too_light_nor_a_short_on_their_own() {
        for (name, preset) in
            ALL.into_iter().flat_map(|name| Detector::preset_names().map(move |preset| (name, preset)))
        {
            let detector = Detector::preset(preset).unwrap();
            let (scene, sheet_s) =
                (Scene::new(name, &detector, Hand::relative(&detector), 2), detector.sheet_conductance_s());
            for touch in times().step_by(7).flat_map(|time_s| scene.at(time_s)) {
                let inside = |corner: &Point| geometry::is_inside(*corner, &detector.outline.outer);
                assert!(touch.pieces().iter().flatten().all(inside), "{name} on {preset}: {touch:?}");
                let sheets = touch.conductance_s / sheet_s;
                let is_own = name.detector() == Some(preset);
                assert!(!is_own || (0.01..60.0).contains(&sheets), "{name} on {preset}: {sheets} sheet conductances");
            }
        }
    }

    #[test]
    fn presses_are_those_of_hertz_on_sample_a() {
        // E* = 0.35 MPa / 0.91; a^3 = 3 F R / (4 E*), and a rod's b^2 = 4 F R / (pi E* L).
        let widest_m = |name| {
            let radius = |touch: Touch| match touch.shape {
                Shape::Disc { radius_m } => radius_m,
                Shape::Line { width_m, .. } => width_m / 2.0,
                _ => f64::NAN,
            };
            times().flat_map(|time_s| scene(name).at(time_s)).map(radius).fold(0.0, f64::max)
        };
        for (name, radius_m) in [
            (SceneName::Display, 1.4612e-3),
            (SceneName::Pointer, 4.4436e-3),
            (SceneName::Texture, 0.24986e-3),
            (SceneName::Hand, 4.8915e-3),
        ] {
            assert!((widest_m(name) / radius_m - 1.0).abs() < 3e-3, "{name}: {} m", widest_m(name));
        }
        let rod_m = widest_m(SceneName::Gripper);
        assert!((0.7e-3..1.0e-3).contains(&rod_m), "{rod_m} m");
    }

    #[test]
    fn a_force_that_is_asked_for_is_that_of_the_firmest_press() {
        let detector = own(SceneName::Pointer);
        let hertz = Hertz::of_sample_a(&detector);
        let hand = Hand::in_newtons(&detector, Fingertip { hertz, force_n: 0.5, radius_m: 0.008 });
        let pressed = Scene::new(SceneName::Pointer, &detector, hand, 1);
        let most_s = times().flat_map(|time_s| pressed.at(time_s)).map(|touch| touch.conductance_s).fold(0.0, f64::max);
        let expected_s = hertz.ball(BALL_M, 0.5).conductance_s;
        // Hundredths of a second miss the firmest moment by half a per cent.
        assert!((most_s / expected_s - 1.0).abs() < 1e-2, "{most_s} S instead of {expected_s} S");
    }

    #[test]
    fn the_gripper_closes_holds_slips_and_lets_go() {
        let at = |time_s| scene(SceneName::Gripper).at(time_s);
        let length_m = |time_s| match at(time_s)[0].shape {
            Shape::Line { length_m, .. } => length_m,
            _ => 0.0,
        };
        assert!(length_m(0.9) < 0.5 * length_m(2.0), "it grows");
        assert_eq!((at(2.0), at(3.6)), (at(3.1), at(4.5)), "it holds");
        let slipped_m = at(4.0)[0].centre_m[1] - at(3.0)[0].centre_m[1];
        assert!((slipped_m - 0.006).abs() < 1e-5, "{slipped_m} m");
        assert!(at(5.4).is_empty());
    }

    #[test]
    fn the_display_is_stroked_pinched_and_tapped() {
        let at = |time_s| scene(SceneName::Display).at(time_s);
        let [stroke, pinch, tap] = [1.4, 4.0, 6.05].map(|time_s| at(time_s).len());
        assert_eq!((stroke, pinch, tap), (1, 2, 1));
        assert!(geometry::distance(at(0.8)[0].centre_m, at(2.0)[0].centre_m) > 0.05);
        let apart_m = |time_s| geometry::distance(at(time_s)[0].centre_m, at(time_s)[1].centre_m);
        assert!(apart_m(4.3) < 0.5 * apart_m(3.1) && apart_m(5.2) > 1.3 * apart_m(4.3));
    }

    #[test]
    fn the_ball_is_pressed_where_it_rests() {
        let scene = scene(SceneName::Pointer);
        let at = |time_s: f64| scene.at(LAID_S[1] + time_s)[0].clone();
        for leg in 0..8 {
            let begin_s = f64::from(leg) * (ROLLS_S + STAYS_S);
            let (rest, press) = (at(begin_s + 1.3), at(begin_s + 1.525));
            assert_eq!(rest.centre_m, press.centre_m);
            assert!(press.conductance_s > 3.0 * rest.conductance_s);
            assert!(geometry::distance(at(begin_s + 0.2).centre_m, rest.centre_m) > 0.04, "it rolls");
        }
    }

    #[test]
    fn bumps_travel_and_their_conductance_swings_twelve_times_a_second() {
        let scene = scene(SceneName::Texture);
        let touches = scene.at(1.01);
        assert!((1..=2).contains(&touches.len()), "{touches:?}");
        let later = scene.at(1.011);
        // 5 mm of pitch at 12 Hz: 60 mm/s.
        let way_m = later[0].centre_m[0] - touches[0].centre_m[0];
        assert!((way_m - 60e-6).abs() < 1e-9, "{way_m} m");
        let whole_s = |time_s: f64| scene.at(time_s).iter().map(|touch| touch.conductance_s).sum::<f64>();
        let period_s = 1.0 / TEXTURE_HZ;
        let over: Vec<f64> = (0..50).map(|i| whole_s(2.0 + period_s * f64::from(i) / 50.0)).collect();
        let (least_s, most_s) = over.iter().fold((f64::INFINITY, 0.0f64), |(a, b), s| (a.min(*s), b.max(*s)));
        assert!(most_s > 1.1 * least_s, "{least_s} S to {most_s} S");
        assert!((whole_s(2.0) / whole_s(2.0 + 7.0 * period_s) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_hand_has_five_fingers_and_a_palm() {
        let touches = scene(SceneName::Hand).at(2.0);
        assert_eq!(touches.len(), 6);
        let wide = touches.iter().filter(|touch| touch.area_m2() > 2.0 * touches[0].area_m2()).count();
        assert_eq!(wide, 1, "{touches:?}");
    }
}
