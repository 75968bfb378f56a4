//! Presses measured on a finer model than the one that measures.

use super::*;
use crate::solve::answer::Uncertainty;
use tactomo_physics::detector::{Detector, Foam};
use tactomo_physics::forward::{ForwardModel, readings_v};
use tactomo_physics::hertz::{Hertz, Skin, Surface};
use tactomo_physics::scene::Contact;
use tactomo_physics::simulate::{Noise, finer_model, measured};

/// A detector with the model that is inverted, and a finer one.
struct MeterTrial {
    detector: Detector,
    meter: Meter,
    finer: Box<dyn ForwardModel>,
    hertz: Hertz,
    noise: Noise,
}

impl MeterTrial {
    fn new(detector: Detector) -> Self {
        Self {
            meter: Meter::new(&Problem::of(&detector).unwrap()).unwrap(),
            finer: finer_model(&detector, &[], 0).unwrap(),
            hertz: Hertz::new(&detector, Skin::from(Foam::of('A').unwrap()).with(Surface::IDEAL)).unwrap(),
            noise: Noise::new(3),
            detector,
        }
    }

    /// A ball of 8 mm that is pressed on a flat detector.
    fn ball(&self, at_mm: [f64; 2], force_n: f64) -> Contact {
        let imprint = self.hertz.ball(0.008, force_n);
        Contact::flat(1e-3 * at_mm[0], 1e-3 * at_mm[1], imprint.half_width_m, imprint.conductance_s)
    }

    fn readings(&mut self, contacts: &[Contact]) -> Readings {
        let exact = readings_v(&self.finer.impedance_ohm(contacts).unwrap(), &self.detector);
        measured(&exact, &self.detector.adc, &mut self.noise)
    }

    /// What is measured at places that are off by so much (mm).
    fn measured(&mut self, contacts: &[Contact], off_mm: f64) -> Vec<Measured> {
        let found = |contact: &Contact| FoundContact {
            z_m: contact.z_m,
            ..FoundContact::flat(contact.x_m + 1e-3 * off_mm, contact.y_m, 0.7 * contact.conductance_s)
        };
        let readings = self.readings(contacts);
        self.meter.measure(&readings, &contacts.iter().map(found).collect::<Vec<_>>()).unwrap()
    }
}

#[test]
fn how_well_a_place_is_known_is_in_the_standard_error() {
    let mut trial = MeterTrial::new(Detector::default());
    let mut random = fastrand::Rng::with_seed(7);
    let (mut within, mut all) = ([0; 2], 0);
    // The corner is at (30, -30) mm: what is found of the first press is half again what it is, a millimetre and a half nearer to it.
    for (at_mm, sigma_mm) in [([25.0, -25.0], 1.0), ([26.0, 3.0], 0.5), ([3.0, -11.0], 0.5), ([22.5, 22.5], 0.5)] {
        let ball = trial.ball(at_mm, 0.25);
        let readings = trial.readings(&[ball]);
        let uncertainty =
            Uncertainty { x_m: 1e-3 * sigma_mm, y_m: 1e-3 * sigma_mm, correlation: 0.0, conductance_s: 0.0 };
        let at = |off: [f64; 2], uncertainty| {
            let [x_m, y_m] = [ball.x_m + 1e-3 * sigma_mm * off[0], ball.y_m + 1e-3 * sigma_mm * off[1]];
            let found = FoundContact { uncertainty, ..FoundContact::flat(x_m, y_m, ball.conductance_s) };
            trial.meter.measure(&readings, &[found]).unwrap()[0]
        };
        let truth_s = at([0.0; 2], None).conductance_s;
        for _ in 0..50 {
            let mut normal = || (0..12).map(|_| random.f64()).sum::<f64>() - 6.0;
            let found = at([normal(), normal()], Some(uncertainty));
            let off = (found.conductance_s / truth_s).ln().abs() * found.conductance_s / found.deviation_s;
            (0..2).for_each(|i| within[i] += usize::from(off < (i + 1) as f64));
            all += 1;
        }
    }
    let shares = within.map(|within| within as f64 / f64::from(all));
    assert!((0.55..0.85).contains(&shares[0]) && shares[1] > 0.9, "{shares:?} within one and two standard errors");
}

#[test]
fn a_press_is_the_same_everywhere() {
    let mut trial = MeterTrial::new(Detector::default());
    // The middle, over a pad, between pads, over a pad in the corner, 4 and 2 mm from the wall.
    let places_mm = [[0.0, 0.0], [7.5, 7.5], [3.0, -11.0], [22.5, 22.5], [26.0, 3.0], [28.0, -20.0]];
    for (force_n, within) in [(0.003, 0.003), (0.03, 0.006), (0.3, 0.015), (3.0, 0.03)] {
        let found = places_mm.map(|at_mm| {
            let ball = trial.ball(at_mm, force_n);
            trial.measured(&[ball], 0.0)[0].conductance_s
        });
        let off = found.map(|conductance_s| (conductance_s / found[0] - 1.0).abs());
        assert!(off.iter().all(|off| *off < within), "{force_n} N: {off:?}");
    }
}

#[test]
fn firmer_presses_conduct_better_over_four_decades() {
    let mut trial = MeterTrial::new(Detector::default());
    let measured = [3e-4, 3e-3, 3e-2, 0.3, 3.0].map(|force_n| {
        let ball = trial.ball([4.0, 9.0], force_n);
        trial.measured(&[ball], 0.0)[0].conductance_s
    });
    // Between the powers of the contact's own, 2/3, and of the constriction, 1/3.
    let powers = [0, 1, 2, 3].map(|k| (measured[k + 1] / measured[k]).log10());
    assert!(powers.iter().all(|power| (0.33..0.67).contains(power)), "{powers:?}");
    assert!(powers.is_sorted_by(|a, b| a > b), "{powers:?}");
}

#[test]
fn places_that_are_wrong_matter_little_and_are_in_the_error() {
    let mut trial = MeterTrial::new(Detector::default());
    for (at_mm, force_n) in [([0.0, 0.0], 0.03), ([7.5, 7.5], 1.0), ([3.0, -11.0], 0.3), ([17.5, 22.5], 1.0)] {
        let ball = trial.ball(at_mm, force_n);
        let [right] = trial.measured(&[ball], 0.0)[..] else { panic!() };
        for (off_mm, within) in [(0.2, 0.005), (1.0, 0.03), (4.0, 0.15)] {
            let [wrong] = trial.measured(&[ball], off_mm)[..] else { panic!() };
            assert!(
                (wrong.conductance_s / right.conductance_s - 1.0).abs() < within,
                "{at_mm:?} {off_mm} mm: {wrong:?}"
            );
            assert!(off_mm < 0.5 || wrong.deviation_s > right.deviation_s);
        }
    }
}

#[test]
fn standard_errors_hold_what_wrong_places_do() {
    let mut trial = MeterTrial::new(Detector::default());
    let mut random = fastrand::Rng::with_seed(2);
    let reference = [0.1, 1.0].map(|force_n| {
        let ball = trial.ball([3.0, 4.0], force_n);
        trial.measured(&[ball], 0.0)[0].conductance_s
    });
    let mut within = [0; 2];
    for k in 0..120 {
        let ball = trial.ball([0, 1].map(|_| 46.0 * (random.f64() - 0.5)), [0.1, 1.0][k % 2]);
        let [found] = trial.measured(&[ball], [0.5, 1.0, 2.0, 4.0][k / 2 % 4])[..] else { panic!() };
        let off = (found.conductance_s - reference[k % 2]).abs() / found.deviation_s;
        within = [within[0] + usize::from(off < 1.0), within[1] + usize::from(off < 2.0)];
    }
    assert!(within[0] > 75 && within[1] > 100, "of 120 within one and two standard errors: {within:?}");
}

#[test]
fn contacts_beside_each_other_are_distinguished() {
    let mut trial = MeterTrial::new(Detector::default());
    for apart_mm in [6.0, 10.0, 20.0] {
        let pair = [trial.ball([-apart_mm / 2.0, 3.0], 0.2), trial.ball([apart_mm / 2.0, 3.0], 1.0)];
        let alone = pair.map(|ball| trial.measured(&[ball], 0.0)[0].conductance_s);
        let both = trial.measured(&pair, 0.0);
        let off = [0, 1].map(|k| (both[k].conductance_s / alone[k] - 1.0).abs());
        assert!(off.iter().all(|off| *off < 0.02), "{apart_mm} mm: {off:?}");
    }
}

#[test]
fn standard_errors_of_light_contacts_are_those_of_the_noise() {
    let mut trial = MeterTrial::new(Detector::default());
    let ball = trial.ball([5.0, -3.0], 2e-5);
    let found: Vec<Measured> = (0..300).map(|_| trial.measured(&[ball], 0.0)[0]).collect();
    let mean = found.iter().map(|found| found.conductance_s).sum::<f64>() / 300.0;
    let within = found.iter().filter(|found| (found.conductance_s - mean).abs() < found.deviation_s).count();
    let share = found[0].deviation_s / mean;
    // 68 % of 300, give or take three deviations of such a count.
    assert!((180..=228).contains(&within) && share > 0.003, "{within} of 300 within {share}");
}

#[test]
fn curved_and_thin_detectors_have_a_scale_too() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/detectors/fingertip.toml");
    let mut curved = MeterTrial::new(Detector::read(file.as_ref()).unwrap());
    let at = curved.detector.electrodes[5];
    let found = [1e-5, 1e-4, 1e-3].map(|conductance_s| {
        let contact = Contact { z_m: at.z_m, ..Contact::flat(at.x_m, at.y_m, 0.001, conductance_s) };
        curved.measured(&[contact], 0.0)[0].conductance_s
    });
    assert!(found.is_sorted() && found[2] > 5.0 * found[0], "{found:?}");
    let thin =
        Detector { layers: vec![tactomo_physics::detector::Layer::uniform(5e-4, 0.2273)], ..Detector::default() };
    let mut thin = MeterTrial::new(thin);
    let found = [0.003, 0.03, 0.3].map(|force_n| {
        let ball = thin.ball([0.5, 1.0], force_n);
        thin.measured(&[ball], 0.0)[0].conductance_s
    });
    assert!(found.is_sorted() && found[0] > 0.0, "{found:?}");
}

#[test]
fn what_makes_no_contact_has_no_conductance() {
    let mut trial = MeterTrial::new(Detector::default());
    let readings = trial.readings(&[Contact::flat(0.0, 0.0, 0.002, 1e-3)]);
    let at = |x_m| FoundContact::flat(x_m, 0.0, 1e-3);
    assert_eq!(trial.meter.measure(&readings, &[]), None);
    assert_eq!(trial.meter.measure(&readings, &[at(f64::NAN)]), None);
    assert_eq!(trial.meter.measure(&readings, &[at(0.0); 17]), None);
    // Nothing is there: as good as none is found.
    let nothing = Readings::from_fn(16, |_, _| 0.0);
    let [none] = trial.meter.measure(&nothing, &[at(0.0)]).unwrap()[..] else { panic!() };
    assert!(none.conductance_s < 1e-4 * trial.detector.sheet_conductance_s(), "{none:?}");
}
