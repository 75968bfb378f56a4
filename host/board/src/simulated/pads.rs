//! The pads' voltages from moment to moment.
//!
//! The scene of the ideal board stands still for the length of a scan. On the others it moves on while they scan, as a real one does: a
//! contact at 0.5 m/s goes 1.2 mm in a scan of 2.4 ms. To ask the physics at every row would take more time than the row: 105 us
//! for one contact and 390 us for five fingers, on a row of 148 us. So it is asked every 2 ms of board time, one step ahead, and
//! voltages between are interpolated linearly. That misses the voltages of a contact at 0.5 m/s by 0.9 mV of 1.1 V at most, a fifth of a conversion's noise.

use tactomo_physics::readings::Readings;
use tactomo_physics::simulate::Physics;

/// Board time between two moments at which the physics are asked (ns).
const STEP_NS: u64 = 2_000_000;

/// Where and when a voltage is asked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    /// The grounded electrode, and how often any has been grounded.
    pub(super) ground: u8,
    pub(super) groundings: u64,
    /// When the scene began, when it was grounded, and now (ns of board time).
    pub(super) first_ns: u64,
    pub(super) grounded_ns: u64,
    pub(super) now_ns: u64,
}

/// What the physics give, and when they are asked.
pub(super) struct Pads {
    physics: Box<dyn Physics>,
    /// Voltage of a grounded electrode's switch (V), above which the physics tell theirs.
    ground_v: f64,
    motion: Motion,
}

enum Motion {
    /// Stands still for the length of a scan.
    Scan(Option<Held>),
    /// Between two steps of time.
    Steps(Option<Step>),
}

/// Readings of the moment at which a scan began, held while it lasts.
struct Held {
    ground: u8,
    groundings: u64,
    readings: Readings,
}

struct Step {
    index: u64,
    /// At its begin and its end.
    ends: [Readings; 2],
}

impl Pads {
    /// A scene that stands still for each scan, or one that `moves`, above such a ground (V).
    pub(super) fn new(physics: Box<dyn Physics>, ground_v: f64, moves: bool) -> Self {
        let motion = if moves { Motion::Steps(None) } else { Motion::Scan(None) };
        Self { physics, ground_v, motion }
    }

    /// Voltage of an electrode's pad above the converter's zero (V).
    pub(super) fn at(&mut self, moment: Moment, electrode: u8) -> f64 {
        let (ground, electrode) = (usize::from(moment.ground), usize::from(electrode));
        let above_ground_v = match &mut self.motion {
            Motion::Scan(held) => held_at(held, &mut *self.physics, moment).at(ground, electrode),
            Motion::Steps(step) => {
                let since_ns = moment.now_ns.saturating_sub(moment.first_ns);
                let [begin, end] = &step_at(step, &mut *self.physics, since_ns / STEP_NS).ends;
                let share = (since_ns % STEP_NS) as f64 / STEP_NS as f64;
                let [begin_v, end_v] = [begin, end].map(|readings| readings.at(ground, electrode));
                begin_v + share * (end_v - begin_v)
            }
        };
        self.ground_v + above_ground_v
    }
}

/// Asks anew, for the moment of grounding, where a scan begins: where an electrode is grounded that does not follow the one before.
fn held_at<'a>(held: &'a mut Option<Held>, physics: &mut dyn Physics, moment: Moment) -> &'a Readings {
    let Moment { ground, groundings, first_ns, grounded_ns, .. } = moment;
    let goes_on = held.take().filter(|last| last.groundings == groundings || last.ground < ground);
    let readings = match goes_on {
        Some(last) => last.readings,
        None => physics.readings_v(seconds(grounded_ns.saturating_sub(first_ns))),
    };
    &held.insert(Held { ground, groundings, readings }).readings
}

fn step_at<'a>(step: &'a mut Option<Step>, physics: &mut dyn Physics, index: u64) -> &'a Step {
    let mut at = |index: u64| physics.readings_v(seconds(index * STEP_NS));
    let ends = match step.take() {
        Some(last) if last.index == index => last.ends,
        Some(Step { index: last, ends: [_, end] }) if last + 1 == index => [end, at(index + 1)],
        _ => [at(index), at(index + 1)],
    };
    step.insert(Step { index, ends })
}

pub(super) fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};
    use tactomo_physics::detector::Detector;
    use tactomo_physics::scene::{Hand, Scene, SceneName};
    use tactomo_physics::simulate::Simulation;

    /// Reads its time; keeps when it was asked.
    #[derive(Clone, Default)]
    struct Clock(Arc<Mutex<Vec<f64>>>);

    impl Physics for Clock {
        fn readings_v(&mut self, time_s: f64) -> Readings {
            self.0.lock().unwrap().push(time_s);
            Readings::from_fn(4, |_, _| time_s)
        }
    }

    #[test]
    fn between_the_steps_of_a_quick_contact_lies_little() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let hand = Hand::relative(&detector);
        let scene = Scene::new(SceneName::Rest, &detector, hand, 1);
        let mut simulation = Simulation::new(&detector, scene, &[], 1).unwrap();
        let controls = simulation.controls();
        let mut at = |x_m: f64| {
            controls.press(hand.tip([x_m, 0.006], 0.5, 1.0).disc().into_iter().collect());
            simulation.readings_v(0.0)
        };
        let half_step_m = 0.5 * 0.5 * seconds(STEP_NS);
        let (mut missed_v, mut largest_v) = (0.0, 0.0);
        for step in -20..=20 {
            let x_m = 2.0 * half_step_m * f64::from(step);
            let [before, middle, after] = [x_m - half_step_m, x_m, x_m + half_step_m].map(&mut at);
            let ends = before.volts().iter().zip(after.volts()).map(|(before, after)| 0.5 * (before + after));
            let misses = ends.zip(middle.volts()).map(|(between, true_v)| (between - true_v).abs());
            missed_v = misses.fold(missed_v, f64::max);
            largest_v = middle.largest_v().max(largest_v);
        }
        assert!(missed_v < 1e-3 && largest_v > 0.5, "{missed_v} V of {largest_v} V");
    }

    /// The scene began after 5 ms.
    fn moment(ground: u8, groundings: u64, now_ns: u64) -> Moment {
        let now_ns = 5_000_000 + now_ns;
        Moment { ground, groundings, first_ns: 5_000_000, grounded_ns: now_ns, now_ns }
    }

    #[test]
    fn a_moving_scene_is_asked_once_a_step_and_read_between() {
        let clock = Clock::default();
        let mut pads = Pads::new(Box::new(clock.clone()), 0.0, true);
        for now_us in (0..3000).step_by(100) {
            let read_s = pads.at(moment(now_us as u8 % 4, now_us, 1000 * now_us), 0);
            assert!((read_s - now_us as f64 * 1e-6).abs() < 1e-12, "time begins with the first scan");
        }
        assert_eq!(*clock.0.lock().unwrap(), [0.0, 2e-3, 4e-3]);
    }

    #[test]
    fn a_scene_that_stands_still_is_asked_once_a_scan_whatever_its_rows() {
        let clock = Clock::default();
        let mut pads = Pads::new(Box::new(clock.clone()), 0.0, false);
        let mut read = |grounds: &[u8], begin: u64| {
            let rows = grounds.iter().zip(begin..);
            rows.map(|(ground, row)| (1e6 * pads.at(moment(*ground, row, 1000 * row), 1)).round()).collect::<Vec<f64>>()
        };
        assert_eq!(read(&[0, 1, 2, 3], 0), [0.0; 4]);
        assert_eq!(read(&[1, 3, 1, 3], 4), [4.0, 4.0, 6.0, 6.0]);
        // One ground over and over.
        assert_eq!(read(&[2, 2], 8), [8.0, 9.0]);
    }
}
