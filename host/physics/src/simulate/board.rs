//! The detector of the simulated board: a model finer than any that is inverted, under a scene and what else presses.

use nalgebra::DMatrix;

use super::controls::{Built, Changes, Controls};
use super::model::SimulationError;
use super::{Fault, Physics};
use crate::detector::Detector;
use crate::forward::{ForwardError, ForwardModel, touched_impedance_ohm};
use crate::readings::Readings;
use crate::scene::{Contact, Scene, Touch};

/// A detector that a scene and other contacts press on, and whose wires may be wrong.
pub struct Simulation {
    built: Built,
    scene: Scene,
    /// When the scene began, and when the detector as it is built was taken (s).
    scene_from_s: f64,
    built_from_s: f64,
    time_factor: f64,
    controls: Controls,
    pressed: Vec<Contact>,
    /// What touched last, and the impedances it made.
    last: Option<(Vec<Touch>, Option<DMatrix<f64>>)>,
}

impl Simulation {
    /// A detector under a scene. `seed` chooses what its faults leave open.
    ///
    /// # Errors
    /// [`SimulationError`] if there is no model of the detector or it cannot have the faults.
    pub fn new(detector: &Detector, scene: Scene, faults: &[Fault], seed: u64) -> Result<Self, SimulationError> {
        let built = Built::new(detector, faults, seed)?;
        let controls = Controls::new(detector, &scene, faults, seed);
        Ok(Self {
            built,
            scene,
            scene_from_s: 0.0,
            built_from_s: 0.0,
            time_factor: 1.0,
            controls,
            pressed: Vec::new(),
            last: None,
        })
    }

    /// This simulation, with scene and foam so many times faster than the board that measures them.
    pub fn at_speed(self, time_factor: f64) -> Self {
        Self { time_factor, ..self }
    }

    /// What a person may change of it while it runs.
    pub fn controls(&self) -> Controls {
        self.controls.clone()
    }

    /// Does what was asked for since the last frame.
    fn take_changes(&mut self, time_s: f64) {
        let Changes { pressed, scene, built } = self.controls.changes();
        self.pressed = pressed;
        if let Some(scene) = scene {
            (self.scene, self.scene_from_s) = (scene, time_s);
        }
        if let Some(built) = built {
            (self.built, self.built_from_s, self.last) = (built, time_s, None);
        }
    }
}

impl Physics for Simulation {
    fn readings_v(&mut self, time_s: f64) -> Readings {
        let time_s = self.time_factor * time_s;
        self.take_changes(time_s);
        let mut touches = self.scene.at(time_s - self.scene_from_s);
        touches.extend(self.pressed.iter().copied().map(Touch::from));
        let pressed = self.built.foam.press(touches, time_s - self.built_from_s);
        let touches = pressed.before_drift();
        let impedance_ohm = match self.last.take() {
            Some((last, impedance_ohm)) if last == touches => impedance_ohm,
            _ => impedance_ohm(&*self.built.model, touches.clone()),
        };
        let drifted_ohm = impedance_ohm.as_ref().map(|impedance_ohm| impedance_ohm / pressed.factor);
        let readings = self.built.measurement.pad_voltages(drifted_ohm.as_ref());
        self.last = Some((touches, impedance_ohm));
        readings
    }
}

/// Impedances under what of the touches is on the detector; `None` if nothing conducts. What is pressed beside it does not touch it.
fn impedance_ohm(model: &dyn ForwardModel, mut touches: Vec<Touch>) -> Option<DMatrix<f64>> {
    loop {
        match touched_impedance_ohm(model, &touches) {
            Ok(impedance_ohm) => return Some(impedance_ohm),
            Err(ForwardError::Contact { index, .. }) if index < touches.len() => {
                touches.remove(index);
            }
            Err(_) => return None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Hand;
    use crate::scene::SceneName;
    use crate::simulate::finer_model;
    use std::time::{Duration, Instant};

    fn simulation(name: SceneName, faults: &[&str]) -> Simulation {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let scene = Scene::new(name, &detector, Hand::relative(&detector), 1);
        let faults: Vec<Fault> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
        Simulation::new(&detector, scene, &faults, 1).unwrap()
    }

    #[test]
    fn an_untouched_detector_is_at_ground_and_a_press_raises_the_electrodes_below_it() {
        let mut simulation = simulation(SceneName::Rest, &[]);
        assert_eq!(simulation.readings_v(0.0).largest_v(), 0.0);
        let press = simulation.scene.hand().tip([-0.0225, -0.0225], 0.5, 1.0).disc();
        simulation.controls().press(press.into_iter().collect());
        let readings = simulation.readings_v(0.0);
        assert!(readings.at(15, 0) > 1.5 * readings.at(15, 3), "electrode 0 is under the press, 3 is not");
        assert!(readings.volts().iter().all(|v| (0.0..2.0).contains(v)));
        simulation.controls().press(Vec::new());
        assert_eq!(simulation.readings_v(0.0).largest_v(), 0.0);
    }

    #[test]
    fn a_ring_is_felt_and_a_press_in_its_middle_is_felt_with_it() {
        let mut simulation = simulation(SceneName::Ring, &[]);
        let alone = simulation.readings_v(0.0);
        assert!(alone.largest_v() > 0.5);
        assert_eq!(simulation.readings_v(1.0), alone, "it lies still");
        simulation.controls().press(vec![Contact::flat(0.0, 0.0, 0.003, 1e-3)]);
        let both = simulation.readings_v(2.0);
        assert!(both.largest_v() > alone.largest_v() + 0.05, "{} {}", both.largest_v(), alone.largest_v());
    }

    #[test]
    fn what_is_beside_the_detector_does_not_touch_it() {
        let mut simulation = simulation(SceneName::Single, &[]);
        let alone = simulation.readings_v(0.0);
        let beside = Contact::flat(0.2, 0.0, 0.003, 1e-3);
        simulation.controls().press(vec![beside]);
        assert_eq!(simulation.readings_v(0.0), alone);
    }

    #[test]
    fn several_contacts_press_at_a_time() {
        let mut simulation = simulation(SceneName::Rest, &[]);
        let (left, right) = (Contact::flat(-0.0225, 0.0, 0.003, 1e-3), Contact::flat(0.0225, 0.0, 0.003, 1e-3));
        let mut readings = |contacts: &[Contact]| {
            simulation.controls().press(contacts.to_vec());
            simulation.readings_v(0.0)
        };
        let [one, other, both] = [&[left][..], &[right], &[left, right]].map(&mut readings);
        assert!(both.largest_v() > 0.0 && both != one && both != other && one != other);
    }

    #[test]
    fn a_scene_that_is_asked_for_begins_at_its_beginning() {
        let mut simulation = simulation(SceneName::Ring, &[]);
        simulation.readings_v(5.0);
        simulation.controls().play(SceneName::ChangingForce).unwrap();
        assert_eq!(simulation.readings_v(6.0).largest_v(), 0.0, "it begins with nothing");
        assert!(simulation.readings_v(6.0 + 1.35).largest_v() > 0.1, "half a period later it is firm");
        assert_eq!(simulation.controls().scene(), SceneName::ChangingForce);
    }

    #[test]
    fn faults_come_while_frames_go_on_and_only_those_asked_for_last() {
        let mut simulation = simulation(SceneName::Single, &[]);
        let controls = simulation.controls();
        let whole = simulation.readings_v(0.0);
        let fault = |text: &str| vec![text.parse::<Fault>().unwrap()];
        let failed = |error| panic!("{error}");
        controls.set_faults(fault("short:3,4"), failed).unwrap();
        controls.set_faults(fault("gain:4:0.5"), failed).unwrap();
        let (begin, mut longest) = (Instant::now(), Duration::ZERO);
        while controls.faults().is_empty() {
            let frame = Instant::now();
            let readings = simulation.readings_v(0.0);
            longest = longest.max(frame.elapsed());
            // The model may be ready just now.
            if controls.faults().is_empty() {
                assert_eq!(readings, whole, "until the model is made, all stays as it was");
            }
            assert!(begin.elapsed() < Duration::from_secs(60));
        }
        assert!(
            longest < begin.elapsed() / 2 || begin.elapsed() < Duration::from_millis(20),
            "a frame waited {longest:?}"
        );
        assert_eq!(controls.faults(), fault("gain:4:0.5"));
        let faulty = simulation.readings_v(0.0);
        assert_eq!(faulty.at(0, 4), 0.5 * whole.at(0, 4));
        assert_eq!(faulty.at(0, 3), whole.at(0, 3));
        assert!(matches!(controls.set_faults(fault("open:16"), failed), Err(SimulationError::Fault(_))));
    }

    #[test]
    fn a_leak_is_read_with_nothing_on_it_and_comes_and_goes_with_its_fault() {
        let mut leaking = simulation(SceneName::Rest, &["leak:0.01"]);
        let rest = leaking.readings_v(0.0);
        // A hundredth of a sheet conductance is 88 kohm before about 1 kohm.
        assert!(rest.largest_v() > 0.005 && rest.largest_v() < 0.05, "{}", rest.largest_v());
        leaking.controls().press(vec![Contact::flat(0.004, -0.011, 0.003, 1e-3)]);
        assert!(leaking.readings_v(1.0).largest_v() > 0.1);
        leaking.controls().press(Vec::new());
        assert_eq!(leaking.readings_v(2.0), rest);
    }

    #[test]
    fn the_driving_layers_resistance_takes_of_what_is_firm() {
        let light = |faults: &[&str]| simulation(SceneName::Single, faults).readings_v(0.0).largest_v();
        let [ideal, one, two] = [&[][..], &["driving-sheet:200"], &["driving-sheet:200:2"]].map(light);
        assert!(one < two && two < ideal, "{one} {two} {ideal}");
        let mut triangle = Detector::preset(Detector::DEFAULT).unwrap();
        triangle.outline.outer.truncate(3);
        triangle.electrodes.retain(|pad| triangle.outline.holds([pad.x_m - 0.003, pad.y_m + 0.003]));
        let error = finer_model(&triangle, &["driving-sheet:200".parse().unwrap()], 1).err().unwrap().to_string();
        assert!(error.contains("which only the slab can have"), "{error}");
    }

    #[test]
    fn an_uneven_detector_is_a_slab_like_others_and_reads_otherwise_than_an_even_one() {
        let detector = Detector::preset(Detector::DEFAULT).unwrap();
        let press = [Contact::flat(0.004, -0.011, 0.003, 1e-3)];
        let of = |faults: &[&str], seed| {
            let faults: Vec<Fault> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
            let model = finer_model(&detector, &faults, seed).unwrap();
            assert_eq!(model.name(), "slab");
            model.impedance_ohm(&press).unwrap()
        };
        let even = of(&[], 1);
        let [one, other] = [1, 2].map(|seed| of(&["uneven:0.1"], seed));
        let apart = |a: &DMatrix<f64>, b: &DMatrix<f64>| (a - b).amax() / even.amax();
        // A tenth from place to place: some per cent of the readings, and not those of the other seed.
        assert!(apart(&one, &even) > 0.01 && apart(&one, &even) < 0.3, "{}", apart(&one, &even));
        assert!(apart(&one, &other) > 0.01);
        assert!(apart(&of(&["uneven:0.1", "driving-sheet:200"], 1), &one) > 0.01);
    }

    #[test]
    fn a_press_that_creeps_is_read_higher_and_a_day_passes_at_any_speed() {
        let at = |simulation: &mut Simulation, time_s: f64| simulation.readings_v(time_s).largest_v();
        let mut creeping = simulation(SceneName::Single, &["creep:0.2:3"]);
        let [begin, later, end] = [0.0, 3.0, 60.0].map(|time_s| at(&mut creeping, time_s));
        assert!(begin < later && later < end && end < 1.2 * begin, "{begin} {later} {end}");
        let mut sound = simulation(SceneName::Single, &[]);
        assert_eq!(at(&mut sound, 0.0), begin);
        let mut fast = simulation(SceneName::Single, &["creep:0.2:3"]).at_speed(1000.0);
        assert_eq!([0.0, 0.003, 0.06].map(|time_s| at(&mut fast, time_s)), [begin, later, end]);
    }

    #[test]
    fn a_detector_that_has_drifted_is_one_of_that_conductivity() {
        let drifted = simulation(SceneName::Several, &["drift:0.2:100"]).readings_v(100.0);
        let given = simulation(SceneName::Several, &["conductivity:1.2"]).readings_v(100.0);
        let before = simulation(SceneName::Several, &[]).readings_v(100.0);
        let apart = |a: &Readings, b: &Readings| {
            a.volts().iter().zip(b.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        // All that differs is the pads' contact impedance, of which 0.8 ohm drift too.
        assert!(apart(&drifted, &given) < 4e-4, "{}", apart(&drifted, &given));
        assert!(apart(&drifted, &before) > 0.02, "{}", apart(&drifted, &before));
    }
}
