//! Contacts on every kind of detector, at walls, and of unusual radii.

use std::path::Path;

use super::*;
use crate::solve::solver::Solver;
use tactomo_physics::detector::{Detector, Layer};
use tactomo_physics::forward::{Auto, ForwardModel, Resolution, Slab, readings_v};
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, finer_model, measured};
use tactomo_physics::space;

fn noisy(mut detector: Detector) -> Detector {
    detector.adc.noise_lsb = 1.5;
    detector
}

fn example(name: &str) -> Detector {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/detectors");
    Detector::read(&folder.join(name)).unwrap()
}

fn thin() -> Detector {
    let mut detector = Detector::preset("square-60").unwrap().taken_as_exact();
    detector.layers = vec![Layer::uniform(0.0004, 0.2273)];
    detector
}

/// A detector, the finer model that is pressed, and the solver.
struct PlacesTrial {
    detector: Detector,
    fine: Box<dyn ForwardModel>,
    solver: Contacts,
    noise: Noise,
}

impl PlacesTrial {
    fn new(detector: Detector, seed: u64) -> Self {
        let detector = noisy(detector);
        let problem = Problem::new(Auto::new(&detector, None).unwrap().model);
        let solver = Contacts::new(&problem, ContactSettings::of(&problem)).unwrap();
        Self { fine: finer_model(&detector, &[], seed).unwrap(), detector, solver, noise: Noise::new(seed) }
    }

    fn contact(&self, [x_m, y_m, z_m]: [f64; 3], sheets: f64) -> Contact {
        let conductance_s = sheets * self.detector.sheet_conductance_s();
        Contact { z_m, ..Contact::flat(x_m, y_m, self.solver.finder().settings.radius_m, conductance_s) }
    }

    fn press(&mut self, contacts: &[Contact]) -> Solution {
        let exact = readings_v(&self.fine.impedance_ohm(contacts).unwrap(), &self.detector);
        self.solver.solve(&measured(&exact, &self.detector.adc, &mut self.noise)).unwrap()
    }
}

fn off_m(truth: &Contact, found: &FoundContact) -> f64 {
    space::distance([truth.x_m, truth.y_m, truth.z_m], [found.x_m, found.y_m, found.z_m])
}

#[test]
fn single_contacts_are_found_on_outlines_shells_curved_surfaces_and_dots_of_glue() {
    let glued = Detector::preset("BB-5x5").unwrap().taken_as_exact();
    for (seed, detector) in [(31, example("l-shape.toml")), (32, example("fingertip.toml")), (33, thin()), (36, glued)]
    {
        let width_m = detector.outline.size_m().into_iter().fold(0.0, f64::max);
        let mut trial = PlacesTrial::new(detector, seed);
        let mut places = fastrand::Rng::with_seed(seed);
        // A contact on an edge is known less well: it has a test of its own.
        let mut spread = trial.solver.finder().fields.places_m(300);
        spread.retain(|place_m| trial.solver.finder().fields.spot(*place_m).share > 0.999);
        let mut errors = Vec::new();
        for _ in 0..24 {
            let truth = trial.contact(spread[places.usize(..spread.len())], 0.5);
            trial.solver.reset();
            let solution = trial.press(&[truth]);
            let [found] = solution.contacts[..] else { panic!("{truth:?} {solution:?}") };
            errors.push(off_m(&truth, &found) / width_m);
            assert!(!solution.flags.misfit, "{truth:?} {solution:?}");
        }
        errors.sort_by(f64::total_cmp);
        let (median, mean) = (errors[errors.len() / 2], errors.iter().sum::<f64>() / errors.len() as f64);
        // One of the 24 on the L is off by 0.08, which makes two thirds of its mean.
        assert!(median < 0.0025 && mean < 0.006, "{}: {median} {mean} {errors:?}", trial.detector.name);
    }
}

/// Where a thin layer tells places worst. With a shell, which has no thickness, the first of these is found 7.5 mm off: its readings differ from those measured
/// by 5.7 mV at the true place and by 3.8 mV where it finds the press, and noise is 1.2 mV. By pads in corners two places of a light press read nearly alike, so
/// no others there are tried.
#[test]
fn contacts_at_the_rims_of_pads_on_a_thin_layer_are_found() {
    let mut trial = PlacesTrial::new(thin(), 37);
    let mut pads = trial.detector.electrodes.clone();
    pads.retain(|pad| pad.x_m.abs().min(pad.y_m.abs()) < 0.02);
    let mut random = fastrand::Rng::with_seed(37);
    let mut places = vec![[-0.02047, -0.0225]];
    for radii in [0.5, 0.75, 1.0, 1.25, 1.5] {
        for _ in 0..3 {
            let (pad, turn) = (&pads[random.usize(..pads.len())], std::f64::consts::TAU * random.f64());
            places.push([pad.x_m + radii * pad.radius_m * turn.cos(), pad.y_m + radii * pad.radius_m * turn.sin()]);
        }
    }
    let mut errors_m = Vec::new();
    for [x_m, y_m] in places {
        let truth = trial.contact([x_m, y_m, 0.0], 0.5);
        trial.solver.reset();
        let solution = trial.press(&[truth]);
        let [found] = solution.contacts[..] else { panic!("{truth:?} {solution:?}") };
        assert!(!solution.flags.misfit, "{truth:?} {solution:?}");
        errors_m.push(off_m(&truth, &found));
    }
    errors_m.sort_by(f64::total_cmp);
    assert!(errors_m[errors_m.len() / 2] < 2e-4 && errors_m[errors_m.len() - 1] < 1e-3, "{errors_m:?}");
}

#[test]
fn two_contacts_on_an_outline_are_two() {
    let mut trial = PlacesTrial::new(example("l-shape.toml"), 34);
    let truth = [trial.contact([-0.025, 0.02, 0.0], 0.5), trial.contact([0.018, -0.027, 0.0], 0.8)];
    let solution = trial.press(&truth);
    assert_eq!(solution.contacts.len(), 2, "{solution:?}");
    for truth in &truth {
        let nearest = solution.contacts.iter().map(|found| off_m(truth, found)).fold(f64::INFINITY, f64::min);
        assert!(nearest < 6e-4, "{truth:?} {solution:?}");
    }
}

#[test]
fn contacts_at_walls_are_found_steadily_where_they_are() {
    let mut trial = PlacesTrial::new(Detector::preset("square-60").unwrap().taken_as_exact(), 35);
    for [x_m, y_m] in [[0.0, -0.0295], [0.027, 0.027], [0.03, 0.004]] {
        for sheets in [0.3, 3.0] {
            let truth = trial.contact([x_m, y_m, 0.0], sheets);
            trial.solver.reset();
            let (mut ids, mut sum_m) = (Vec::new(), [0.0; 2]);
            for count in 0..100 {
                let solution = trial.press(&[truth]);
                let [found] = solution.contacts[..] else { panic!("{truth:?}, frame {count}: {solution:?}") };
                let sigma = found.uncertainty.unwrap();
                // At 0.3 sheet conductances noise alone moves a contact across a wall by 1.2 mm of standard error. In a corner a
                // field has next to no slope along the diagonal, so that the error there may be half of the width: and it is given.
                let most_m = if sheets < 1.0 { 6e-3 } else { 3e-3_f64.max(3.0 * sigma.x_m.hypot(sigma.y_m)) };
                assert!(off_m(&truth, &found) < most_m, "{truth:?}, frame {count}: {found:?}");
                let finite = [sigma.x_m, sigma.y_m, sigma.conductance_s].map(|sigma| sigma.is_finite() && sigma > 0.0);
                assert!(
                    finite == [true; 3] && sigma.x_m.hypot(sigma.y_m) < 0.06,
                    "{truth:?}, frame {count}: {found:?}"
                );
                sum_m = [sum_m[0] + found.x_m, sum_m[1] + found.y_m];
                ids.extend(found.id);
            }
            let mean_m = (sum_m[0] / 100.0 - x_m).hypot(sum_m[1] / 100.0 - y_m);
            let in_corner = x_m == y_m;
            assert!(mean_m < if in_corner { 4.5e-3 } else { 1.2e-3 }, "{truth:?}: {mean_m}");
            ids.dedup();
            assert_eq!(ids.len(), 1, "{truth:?}");
        }
    }
}

#[test]
fn radii_are_found_where_the_readings_say_them() {
    let detector = noisy(Detector::preset("square-60").unwrap().taken_as_exact());
    let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
    let mut trial = PlacesTrial::new(detector, 36);
    trial.fine = Box::new(fine);
    // Firm and wide: the readings say it. A light touch's they do not.
    for (radius_m, sheets, known) in
        [(0.0035, 3.0, true), (0.005, 1.0, true), (0.0018, 3.0, true), (0.0035, 0.02, false)]
    {
        let truth = Contact { radius_m, ..trial.contact([0.0043, -0.0071, 0.0], sheets) };
        trial.solver.reset();
        let solution = trial.press(&[truth]);
        let [found] = solution.contacts[..] else { panic!("{truth:?} {solution:?}") };
        assert_eq!(found.radius_m.is_some(), known, "{truth:?} {found:?}");
        if let Some(found_m) = found.radius_m {
            assert!((found_m / radius_m).ln().abs() < 0.25, "{truth:?} {found:?}");
        }
        let sigma = found.uncertainty.unwrap();
        let off_s = (found.conductance_s - truth.conductance_s).abs();
        assert!(off_s < 3.0 * sigma.conductance_s + 0.02 * truth.conductance_s, "{truth:?} {found:?}");
        // Following keeps what was found.
        let next = trial.press(&[truth]);
        assert_eq!(next.contacts[0].radius_m.is_some(), known, "{next:?}");
    }
}
