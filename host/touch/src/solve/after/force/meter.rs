//! How well single contacts conduct, as the readings tell it best: together with the constriction of the current under them.
//!
//! Of a firm contact readings hardly tell conductance and radius apart (`contacts` says so in its standard
//! errors), but the resistance of both to a tenth of a per cent: that of the contact itself and of the current that crowds under it, in Holm's words
//! film and constriction resistance (*Electric Contacts*, 1967). A force changes both, so it is that sum that tells it. The contacts are spots of a
//! [`SpotModel`] at the places that a solver found, whichever it is, and their resistances are fitted to the readings by Gauss and Newton's
//! steps. With `U[k]` the current that an ampere into each electrode makes at contact `k`, `dZ[e][g] = U[k][e] U[k][g] dA[k]`.
//!
//! From a fitted resistance `A = N(x, x) + 1/C` of a spot of the usual radius `r` all is taken away that depends on the place: walls, layers, pads.
//! What is left is the contact's own and a constriction that is the same everywhere, `1 / (4 sigma r) + 1 / (2 pi sigma t)`: that of a disc on a half
//! space, and of a sheet from there to `e` times as far. It only has to be about right, for a law of force has a resistance in series.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use crate::solve::answer::FoundContact;
use crate::solve::fit::evidence::misfit_limit;
use crate::solve::fit::least_squares::{LeastSquares, NormalEquations, Schedule, covariance, minimise};
use crate::solve::fit::linear::full_v;
use crate::solve::fit::policy;
use crate::solve::fit::spots::{LoadedSpot, Solved, SpotModel};
use crate::solve::problem::Problem;
use tactomo_physics::forward::spots::SpotFields;
use tactomo_physics::readings::{Readings, Says};

/// Most contacts that are measured together.
const MOST: usize = 16;
/// Steps, and the longest of a logarithm: light contacts begin far off.
const STEPS: usize = 40;
const LONGEST_LOG: f64 = 2.0;
/// A step below this share of its standard error, or below this (of a logarithm), is the last.
const SMALL: f64 = 0.01;
const SETTLED_LOG: f64 = 1e-4;
const SCHEDULE: Schedule = Schedule { first: 1e-3, least: 1e-9, tries: 5 };
/// Share of what is left beyond noise that a resistance may have taken up. With places 0 to 8 mm off, on the detector and on one that is 12 %
/// thicker and graded, 68 % of 400 presses of 0.03, 0.3 and 2 N each were off by no more than 0.18, 0.40 and 0.58 times it.
const TAKEN: f64 = 0.6;

/// Conductance of a contact with its constriction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measured {
    /// Conductance (S).
    pub conductance_s: f64,
    /// Its standard error (S).
    pub deviation_s: f64,
}

/// Measures contacts at known places.
pub(super) struct Meter {
    spot_model: SpotModel,
    fields: Box<dyn SpotFields>,
    /// The constriction that is the same everywhere (ohm).
    constriction_ohm: f64,
    sheet_s: f64,
    noise_v: f64,
    full_v: f64,
}

/// Resistances on their way.
struct Fit {
    /// Logarithms of the resistances without what depends on the place (ohm).
    logs: Vec<f64>,
    solved: Solved,
    residuals: Vec<f64>,
}

impl Meter {
    /// Measures on the model of a problem; `None` if that has no spots.
    pub fn new(problem: &Problem) -> Option<Self> {
        let (detector, radius_m) = (problem.detector(), problem.usual_radius_m());
        let sheet_s = detector.sheet_conductance_s();
        let top_s_per_m = detector.layers.last()?.top_s_per_m;
        Some(Self {
            spot_model: SpotModel::new(detector, problem.model.electrode_fields_ohm()),
            fields: problem.model.spots(radius_m)?,
            constriction_ohm: 1.0 / (4.0 * top_s_per_m * radius_m) + 1.0 / (2.0 * PI * sheet_s),
            sheet_s,
            noise_v: detector.adc.deviation_v(),
            full_v: full_v(detector),
        })
    }

    /// Conductances at the contacts' places; none where they cannot be distinguished, as of two contacts at one place.
    pub fn measure(&self, readings: &Readings, contacts: &[FoundContact]) -> Option<Vec<Measured>> {
        let is_sound = |contact: &FoundContact| {
            [contact.x_m, contact.y_m, contact.z_m, contact.conductance_s].iter().all(|value| value.is_finite())
        };
        if !(1..=MOST).contains(&contacts.len()) || !contacts.iter().all(is_sound) {
            return None;
        }
        let spots = contacts.iter().map(|contact| self.fields.spot([contact.x_m, contact.y_m, contact.z_m]));
        let spots: Vec<LoadedSpot> = spots.map(|spot| LoadedSpot { spot, ohm: 0.0 }).collect();
        // From what the solver found, which makes no difference but to the time.
        let start = |contact: &FoundContact| {
            let own_s = contact
                .conductance_s
                .clamp(policy::CONDUCTANCES_SHEETS[0] * self.sheet_s, policy::CONDUCTANCES_SHEETS[1] * self.sheet_s);
            self.held((self.constriction_ohm + 1.0 / own_s).ln())
        };
        let mut descent = Descent { meter: self, spots, readings };
        let start = descent.look(contacts.iter().map(start).collect())?;
        let fit = minimise(&mut descent, start, STEPS, SCHEDULE).at;
        let deviations = self.deviations(&fit, readings)?;
        let measured = fit.logs.iter().zip(&deviations).map(|(log, deviation)| {
            let conductance_s = (-log).exp();
            Measured { conductance_s, deviation_s: deviation * conductance_s }
        });
        Some(measured.collect())
    }

    /// Whether a reading tells a conductance.
    fn counts(&self, readings: &Readings, g: usize, e: usize) -> bool {
        e != g && readings.at(g, e) < self.full_v && readings.says(g, e) == Says::Voltage
    }

    /// What resistances leave of the readings, in deviations of the noise.
    fn look(&self, logs: Vec<f64>, spots: &mut [LoadedSpot], readings: &Readings) -> Option<Fit> {
        for (spot, log) in spots.iter_mut().zip(&logs) {
            spot.ohm = spot.spot.own_ohm - self.constriction_ohm + log.exp();
        }
        let solved = self.spot_model.solve(spots, &*self.fields)?;
        let n = self.spot_model.electrodes();
        let residual = |(index, volts): (usize, &f64)| {
            let (g, e) = (index / n, index % n);
            let model_v = self.spot_model.drive_v * (1.0 - solved.impedance_ohm[e * n + g] / solved.loads_ohm[g]);
            if self.counts(readings, g, e) { (volts - model_v) / self.noise_v } else { 0.0 }
        };
        let residuals: Vec<f64> = readings.volts().iter().enumerate().map(residual).collect();
        residuals.iter().all(|residual| residual.is_finite()).then_some(Fit { logs, solved, residuals })
    }

    /// Derivatives of the readings by the logarithms, in deviations of the noise, a row for each.
    fn slopes(&self, fit: &Fit, readings: &Readings) -> Vec<Vec<f64>> {
        let n = self.spot_model.electrodes();
        let of = |k: usize| {
            let currents = &fit.solved.currents[k * n..(k + 1) * n];
            let ohm = fit.logs[k].exp();
            let slope = |index: usize| {
                let (g, e) = (index / n, index % n);
                if !self.counts(readings, g, e) {
                    return 0.0;
                }
                let load_ohm = fit.solved.loads_ohm[g];
                let share = fit.solved.impedance_ohm[e * n + g] / load_ohm;
                let change = currents[g] * (currents[e] - share * currents[g]);
                -self.spot_model.drive_v * ohm * change / (load_ohm * self.noise_v)
            };
            (0..n * n).map(slope).collect()
        };
        (0..fit.logs.len()).map(of).collect()
    }

    /// Standard errors of the logarithms: by noise, and by what the spots leave of the readings beyond it, as wrong places and a wrong
    /// detector do: some of that lies along what a resistance changes, and is taken for it.
    fn deviations(&self, fit: &Fit, readings: &Readings) -> Option<Vec<f64>> {
        let normal = equations(&self.slopes(fit, readings), &fit.residuals).matrix;
        let n = readings.electrodes();
        let counted = (0..n * n).filter(|index| self.counts(readings, index / n, index % n)).count();
        let freedom = counted.saturating_sub(fit.logs.len()).max(1) as f64;
        let beyond_noise = (squares(&fit.residuals) - freedom * misfit_limit(freedom)).max(0.0);
        let covariance = covariance(&normal)?;
        let variance = |k: usize| covariance[(k, k)] * (1.0 + TAKEN * TAKEN * beyond_noise);
        Some((0..fit.logs.len()).map(|k| variance(k).sqrt()).collect())
    }

    /// The logarithm of a resistance within what makes sense.
    fn held(&self, log: f64) -> f64 {
        let [least, most] = policy::CONDUCTANCES_SHEETS.map(|sheets| (sheets * self.sheet_s).ln());
        log.clamp(-most, -least)
    }
}

/// Contacts whose resistances are on their way to the readings.
struct Descent<'a> {
    meter: &'a Meter,
    spots: Vec<LoadedSpot>,
    readings: &'a Readings,
}

impl Descent<'_> {
    fn look(&mut self, logs: Vec<f64>) -> Option<Fit> {
        self.meter.look(logs, &mut self.spots, self.readings)
    }
}

impl LeastSquares for Descent<'_> {
    type Point = Fit;

    fn sum(&self, at: &Fit) -> f64 {
        squares(&at.residuals)
    }

    fn equations(&self, at: &Fit) -> NormalEquations {
        equations(&self.meter.slopes(at, self.readings), &at.residuals)
    }

    fn moved(&mut self, from: &Fit, step: &DVector<f64>) -> Option<Fit> {
        let logs =
            from.logs.iter().zip(step).map(|(log, step)| self.meter.held(log + step.clamp(-LONGEST_LOG, LONGEST_LOG)));
        self.look(logs.collect())
    }

    fn is_better(before: f64, after: f64) -> bool {
        after <= before
    }

    fn is_negligible(&self, _at: &Fit, equations: &NormalEquations, step: &DVector<f64>) -> bool {
        step.dot(&equations.gradient) < SMALL * SMALL
    }

    fn goes_on(&self, before: &Fit, after: &Fit, equations: &NormalEquations) -> bool {
        let moved = |k: usize| (after.logs[k] - before.logs[k]).abs();
        (0..before.logs.len()).any(|k| moved(k) > SETTLED_LOG && moved(k) * equations.matrix[(k, k)].sqrt() > SMALL)
    }
}

fn squares(residuals: &[f64]) -> f64 {
    residuals.iter().map(|residual| residual * residual).sum()
}

/// Normal equations of derivatives, a row for each parameter, and residuals.
fn equations(slopes: &[Vec<f64>], residuals: &[f64]) -> NormalEquations {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let matrix = DMatrix::from_fn(slopes.len(), slopes.len(), |i, j| product(&slopes[i], &slopes[j]));
    let gradient = DVector::from_fn(slopes.len(), |i, _| product(&slopes[i], residuals));
    NormalEquations { matrix, gradient }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::{Detector, Foam};
    use tactomo_physics::forward::{ForwardModel, readings_v};
    use tactomo_physics::hertz::Hertz;
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
                hertz: Hertz::new(&detector, Foam::of('A').unwrap().into()).unwrap(),
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
}
