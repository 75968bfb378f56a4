//! Detector and contacts of a rub, fitted together: a bundle adjustment.
//!
//! Unknown are the detector's [`Parameter`]s, with its tolerances as their prior, and of each press place, conductance and radius of a single
//! contact. What is minimised is the sum over all readings of `((V - V(detector, contact)) / s)^2`, with `s` noise and the model's own error
//! together, and of the parameters' squares in standard deviations: the maximum a posteriori. It is done by Gauss and Newton, with the contacts
//! eliminated press by press (Schur's complement, as in Triggs et al., "Bundle adjustment - a modern synthesis", 2000). Presses that fit much
//! worse than most count less (Geman and McClure).

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector};
use tactomo_physics::detector::{Detector, Parameter};
use tactomo_physics::forward::{ForwardError, ForwardModel};
use tactomo_physics::readings::{Readings, Says};
use tactomo_physics::scene::Contact;

use super::contact::{CONDUCTANCE, Moves, OF_PRESS, Press};
use super::slopes::{At, Slopes, as_read};
use super::{CalibrateError, Step};
use crate::solve::fit::least_squares::NormalEquations;
use tactomo_physics::threads::map;

/// Error of the slab as a share of `Vcc - V`: against readings of an independent program, but for what pads' own impedances take up, 0.07 %.
const MODEL_ERROR: f64 = 0.0007;
/// Presses whose errors by the model are independent: it errs alike where readings are alike, so more presses average noise only. On five
/// detectors drawn from the default tolerances (seeds 411 to 415, 160 presses at 1.5 LSB) this has 67 and 98 % of places within one and two
/// standard errors; 2 has 81 and 98 %.
const APART: f64 = 12.0;
/// Sum of squares, in standard deviations, by which an iteration has to better it for there to be another one: what is left to go is then less
/// than a standard error.
const WORTH: f64 = 0.3;
/// Dampings that are tried, as shares of the information.
const DAMPINGS: [f64; 4] = [0.0, 0.01, 0.1, 1.0];
/// Steps of a contact on a new detector, and share of its sum of squares that one has to better.
const REFITS: usize = 6;
const REFIT_WORTH: f64 = 1e-3;
/// Share of its sum of squares below which another contact is taken for a press.
const WORTH_MOVING: f64 = 0.9;
/// Sum of squares for each reading from which a press is worse than most: a hundredth of what noise and model should leave.
const LEAST: f64 = 0.01;
/// Presses that the mean of one is taken of.
const MEAN_OF: usize = 40;
/// Largest step of a parameter in an iteration, in its unit for logarithms and in standard deviations for others.
const LARGEST_LOG: f64 = 1.0;
const LARGEST_DEVIATIONS: f64 = 3.0;

/// A detector under adjustment, with its presses.
pub(super) struct Bundle {
    /// The description.
    nominal: Detector,
    /// What is unknown, and the standard deviation of each before.
    pub parameters: Vec<(Parameter, f64)>,
    /// Where each is, in standard deviations.
    pub steps: DVector<f64>,
    pub model: Arc<dyn ForwardModel>,
    pub presses: Vec<Press>,
    /// By how much the model errs more than it does.
    pub rough: f64,
    /// Iterations done.
    done: usize,
    full_v: f64,
}

/// How often a bundle is bettered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Iterations {
    /// At most.
    pub most: usize,
    /// In how many of them derivatives by the detector are made anew.
    pub renewed: usize,
}

impl Default for Iterations {
    fn default() -> Self {
        Self { most: 9, renewed: 2 }
    }
}

/// What the bundle says at one point.
pub(super) struct Normal {
    /// Of the detector's parameters alone, contacts eliminated, in standard deviations before: information without the prior, and slope.
    pub information: DMatrix<f64>,
    slope: DVector<f64>,
    /// What takes steps of the detector to those of each press.
    of_presses: Vec<(DVector<f64>, DMatrix<f64>)>,
    /// Sum of squares of each press, and the weight that it has.
    pub costs: Vec<f64>,
    pub weights: Vec<f64>,
}

impl Bundle {
    pub fn new(
        model: Arc<dyn ForwardModel>,
        parameters: Vec<(Parameter, f64)>,
        presses: Vec<Press>,
        full_v: f64,
    ) -> Self {
        let steps = DVector::zeros(parameters.len());
        Self { nominal: model.detector().clone(), parameters, steps, model, presses, rough: 1.0, done: 0, full_v }
    }

    /// The description with the steps taken.
    fn detector_at(&self, steps: &DVector<f64>) -> Detector {
        let step = |((parameter, deviation), step): (&(Parameter, f64), &f64)| (*parameter, deviation * step);
        let all: Vec<_> = self.parameters.iter().zip(steps.iter()).map(step).collect();
        self.nominal.stepped(&all)
    }

    /// The detector as it stands.
    pub fn detector(&self) -> Detector {
        self.detector_at(&self.steps)
    }

    /// Whether a reading counts. A bound does not: contacts that are found for a press keep it, and then it says nothing.
    fn counts(&self, readings: &Readings, index: usize) -> bool {
        let n = readings.electrodes();
        let (g, e) = (index / n, index % n);
        g != e && readings.says(g, e) == Says::Voltage && readings.at(g, e) < self.full_v
    }

    /// Readings that count.
    pub fn count(&self, press: &Press) -> usize {
        (0..press.readings.volts().len()).filter(|index| self.counts(&press.readings, *index)).count()
    }

    /// Error of the model that is taken for each press, in shares of `Vcc - V`.
    fn model_error(&self) -> f64 {
        self.rough * MODEL_ERROR * (self.presses.len() as f64 / APART).max(1.0).sqrt()
    }

    /// One over the standard deviation of each reading (1/V), zero of those that do not count.
    fn weights(&self, press: &Press, model_error: f64) -> Vec<f64> {
        let drive_v = self.nominal.drive_v;
        let weight = |(index, volts): (usize, &f64)| match self.counts(&press.readings, index) {
            true => 1.0 / press.noise_v.hypot(model_error * (drive_v - volts).max(0.0)),
            false => 0.0,
        };
        press.readings.volts().iter().enumerate().map(weight).collect()
    }

    /// Sum of squares of a press and of what is known of it before.
    fn cost(&self, model: &dyn ForwardModel, press: &Press, contact: &Contact) -> f64 {
        let Ok(impedance_ohm) = model.impedance_ohm(&[*contact]) else { return f64::INFINITY };
        let predicted = as_read(&impedance_ohm, model.detector());
        let pairs = press.readings.volts().iter().zip(&predicted).zip(self.weights(press, self.model_error()));
        pairs.map(|((ours, theirs), weight)| (weight * (ours - theirs)).powi(2)).sum::<f64>()
            + press.prior(contact).iter().map(|(off, _)| off * off).sum::<f64>()
    }

    /// The normal equations at the model as it is.
    pub fn normal(&self, slopes: &Slopes) -> Normal {
        let count = self.parameters.len();
        let all = map(&self.presses, |press| {
            self.of_press(press, slopes, self.model_error()).unwrap_or_else(|| OfPress::nothing(count))
        });
        let costs: Vec<f64> = all.iter().map(|of| of.cost).collect();
        let weights = self.robust(&costs);
        let (mut information, mut slope) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let mut of_presses = Vec::with_capacity(all.len());
        for (of, weight) in all.into_iter().zip(&weights) {
            information += of.information * *weight;
            slope += of.slope * *weight;
            of_presses.push((of.step, of.coupling));
        }
        Normal { information, slope, of_presses, costs, weights }
    }

    /// Weights of presses by their sums of squares: a quarter where one is twice as bad as most.
    fn robust(&self, costs: &[f64]) -> Vec<f64> {
        let shares: Vec<f64> =
            costs.iter().zip(&self.presses).map(|(cost, press)| cost / self.count(press).max(1) as f64).collect();
        let mut sorted = shares.clone();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0).max(LEAST);
        shares.iter().map(|share| 1.0 / (1.0 + (share / (2.0 * usual)).powi(2)).powi(2)).collect()
    }

    /// Derivatives by the contact of a press; `None` if it cannot be on the detector.
    fn of_contact(
        &self,
        model: &dyn ForwardModel,
        press: &Press,
        contact: &Contact,
        model_error: f64,
    ) -> Option<OfContact> {
        let detector = model.detector();
        let near = contact.neighbours(detector);
        let replaced: Vec<_> = near.iter().map(|(contact, _)| (0, *contact)).collect();
        let (impedance_ohm, changes) = model.impedance_with_changes_ohm(&[*contact], &replaced).ok()?;
        let weights = DVector::from_vec(self.weights(press, model_error));
        let predicted = DVector::from_vec(as_read(&impedance_ohm, detector));
        let volts = DVector::from_column_slice(press.readings.volts());
        let residual = weights.component_mul(&(volts - &predicted));
        let by = |(change, (_, step)): (&DMatrix<f64>, &(Contact, f64))| {
            (DVector::from_vec(as_read(&(&impedance_ohm + change), detector)) - &predicted) / *step
        };
        let changes_v: Vec<_> = changes.iter().zip(&near).map(by).collect();
        let columns: Vec<_> = changes_v.iter().map(|change_v| weights.component_mul(change_v)).collect();
        let slopes = DMatrix::from_columns(&columns);
        let by_conductance_v = changes_v[CONDUCTANCE].as_slice().to_vec();
        let mut equations = NormalEquations::of(&slopes, &residual);
        let mut cost = residual.norm_squared();
        for (k, (off, per)) in press.prior(contact).into_iter().enumerate() {
            equations.matrix[(k, k)] += per * per;
            equations.gradient[k] -= off * per;
            cost += off * off;
        }
        Some(OfContact { impedance_ohm, weights, predicted, by_conductance_v, residual, slopes, equations, cost })
    }

    /// Changes of readings by each of the detector's parameters, in deviations of both.
    fn by_detector(&self, contact: &Contact, of: &OfContact, slopes: &Slopes) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(of.weights.len(), self.parameters.len());
        let at = At {
            contact,
            detector: self.model.detector(),
            impedance_ohm: &of.impedance_ohm,
            predicted: of.predicted.as_slice(),
            by_conductance_v: &of.by_conductance_v,
        };
        slopes.readings_v(&at, |column, change_v| {
            all.column_mut(column).iter_mut().zip(change_v).zip(&of.weights).for_each(|((to, v), w)| *to = w * v);
        });
        all
    }

    fn of_press(&self, press: &Press, slopes: &Slopes, model_error: f64) -> Option<OfPress> {
        let contact = self.of_contact(&*self.model, press, &press.contact, model_error)?;
        let of_detector = self.by_detector(&press.contact, &contact, slopes);
        let factor = Cholesky::new(contact.equations.matrix)?;
        let coupling = factor.solve(&contact.slopes.tr_mul(&of_detector));
        let step = factor.solve(&contact.equations.gradient);
        let information = of_detector.tr_mul(&(&of_detector - &contact.slopes * &coupling));
        let slope = of_detector.tr_mul(&(contact.residual - &contact.slopes * &step));
        Some(OfPress { cost: contact.cost, information, slope, step, coupling })
    }

    /// Information of the readings of a press in the mean about the detector, in standard deviations before, if its contact is known.
    pub fn information_of_press(&self, slopes: &Slopes) -> DMatrix<f64> {
        let count = self.parameters.len();
        let some: Vec<_> = self.presses.iter().step_by(self.presses.len().div_ceil(MEAN_OF).max(1)).collect();
        let of = |press: &&Press| {
            let contact = self.of_contact(&*self.model, press, &press.contact, MODEL_ERROR)?;
            let of_detector = self.by_detector(&press.contact, &contact, slopes);
            Some(of_detector.tr_mul(&of_detector))
        };
        let all: Vec<_> = map(&some, of).into_iter().flatten().collect();
        all.iter().fold(DMatrix::zeros(count, count), |sum, of| sum + of) / all.len().max(1) as f64
    }

    /// Adjusts everything, with derivatives that are made anew in the first iterations; `report` hears after each how far it is, and stops it by
    /// `false`.
    pub fn adjust(
        &mut self,
        slopes: &mut Slopes,
        iterations: Iterations,
        report: &mut dyn FnMut(Step) -> bool,
    ) -> Result<Normal, CalibrateError> {
        let mut normal = self.normal(slopes);
        for iteration in 1..=iterations.most {
            let before = self.objective(&normal, &self.steps);
            let bettered = self.step(&normal)?;
            if iteration <= iterations.renewed && bettered {
                *slopes = Slopes::new(&self.model, &self.parameters)?;
            }
            normal = self.normal(slopes);
            let after = self.objective(&normal, &self.steps);
            self.done += 1;
            if !report(Step { iteration: self.done, chi_square: self.chi_square(&normal) }) {
                return Err(CalibrateError::Stopped);
            }
            if !bettered || before - after < WORTH {
                break;
            }
        }
        Ok(normal)
    }

    /// Sum of squares for each reading, of those presses that count, in deviations of noise and of the model's error in each.
    pub fn chi_square(&self, normal: &Normal) -> f64 {
        let (mut sum, mut all) = (0.0, 0.0);
        let detector = self.model.detector();
        for (press, weight) in self.presses.iter().zip(&normal.weights) {
            let Ok(impedance_ohm) = self.model.impedance_ohm(&[press.contact]) else { continue };
            let pairs = press.readings.volts().iter().zip(as_read(&impedance_ohm, detector));
            let off = pairs.zip(self.weights(press, MODEL_ERROR)).map(|((ours, theirs), over)| over * (ours - theirs));
            sum += weight * off.map(|off| off * off).sum::<f64>();
            all += weight * self.count(press) as f64;
        }
        sum / all.max(1.0)
    }

    fn objective(&self, normal: &Normal, steps: &DVector<f64>) -> f64 {
        steps.norm_squared() + normal.costs.iter().zip(&normal.weights).map(|(cost, weight)| cost * weight).sum::<f64>()
    }

    /// One step, damped until it betters the sum of squares (Levenberg and Marquardt); whether it did.
    fn step(&mut self, normal: &Normal) -> Result<bool, ForwardError> {
        let before = self.objective(normal, &self.steps);
        for damping in DAMPINGS {
            let Some(step) = self.damped(normal, damping) else { continue };
            let steps = &self.steps + &step;
            let Ok(model) = self.model.of_similar(&self.detector_at(&steps)) else { continue };
            let moved: Vec<_> = self.presses.iter().zip(&normal.of_presses).collect();
            let fitted = map(&moved, |(press, (own, coupling))| {
                let moved = press.contact.moved(&(own - coupling * &step), model.detector());
                self.refit(&*model, press, [moved, press.contact])
            });
            let costs = fitted.iter().zip(&normal.weights).map(|((_, cost), weight)| cost * weight).sum::<f64>();
            if steps.norm_squared() + costs < before {
                self.steps = steps;
                self.model = model;
                self.presses.iter_mut().zip(&fitted).for_each(|(press, (contact, _))| press.contact = *contact);
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The step of the detector with a damping, within what a step may be.
    fn damped(&self, normal: &Normal, damping: f64) -> Option<DVector<f64>> {
        let count = self.parameters.len();
        // The prior of each parameter: zero, with a standard deviation of one.
        let matrix = &normal.information + DMatrix::identity(count, count);
        let step = NormalEquations { matrix, gradient: &normal.slope - &self.steps }.step(damping)?;
        let excess = |((parameter, deviation), step): (&(Parameter, f64), &f64)| {
            let most = if parameter.is_log() { LARGEST_LOG / deviation } else { LARGEST_DEVIATIONS };
            step.abs() / most
        };
        let excess = self.parameters.iter().zip(step.iter()).map(excess).fold(1.0, f64::max);
        Some(step / excess)
    }

    /// The contact that fits a press best on a model, from the better of two starts, and its cost.
    fn refit(&self, model: &dyn ForwardModel, press: &Press, starts: [Contact; 2]) -> (Contact, f64) {
        let [a, b] = starts.map(|contact| (contact, self.cost(model, press, &contact)));
        let mut best = if a.1 <= b.1 { a } else { b };
        let mut damping = 1e-3;
        for _ in 0..REFITS {
            let Some(of) = self.of_contact(model, press, &best.0, self.model_error()) else { break };
            let Some(step) = of.equations.step(damping) else { break };
            let moved = best.0.moved(&step, model.detector());
            let cost = self.cost(model, press, &moved);
            let bettered_by = best.1 - cost;
            if bettered_by > 0.0 {
                best = (moved, cost);
                damping *= 0.1;
            } else {
                damping = 10.0 * f64::max(damping, 0.1);
            }
            if bettered_by.abs() < REFIT_WORTH * best.1 {
                break;
            }
        }
        best
    }

    /// Standard error of the place (m) at which a contact is found in one frame by who reckons with noise and with what is unknown of the detector,
    /// of such a precision (the inverse of the covariance); `None` where the contact cannot be.
    pub fn place_error_m(&self, contact: &Contact, slopes: &Slopes, precision: &DMatrix<f64>) -> Option<f64> {
        let predicted = as_read(&self.model.impedance_ohm(&[*contact]).ok()?, self.model.detector());
        let press = Press {
            readings: Readings::new(self.nominal.electrodes.len(), predicted)?,
            noise_v: self.nominal.adc.deviation_v(),
            known_m: None,
            contact: *contact,
            usual: *contact,
        };
        let of = self.of_contact(&*self.model, &press, contact, MODEL_ERROR)?;
        let of_detector = self.by_detector(contact, &of, slopes);
        let detector = Cholesky::new(of_detector.tr_mul(&of_detector) + precision)?;
        let cross = of_detector.tr_mul(&of.slopes);
        let own = Cholesky::new(&of.equations.matrix - cross.tr_mul(&detector.solve(&cross)))?.inverse();
        Some((0..2).map(|axis| own[(axis, axis)]).sum::<f64>().sqrt())
    }

    /// Presses that fit so many times worse than most.
    pub fn lost(&self, normal: &Normal, times: f64) -> Vec<usize> {
        let mut sorted = normal.costs.clone();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted.get(sorted.len() / 2).copied().unwrap_or(0.0);
        (0..normal.costs.len()).filter(|index| normal.costs[*index] > times * usual).collect()
    }

    /// Takes other contacts for some presses where they fit better; whether any does.
    pub fn offer(&mut self, presses: &[usize], contacts: &[Option<Contact>]) -> bool {
        let mut any = false;
        for (index, contact) in presses.iter().zip(contacts) {
            let Some(contact) = contact else { continue };
            let press = &self.presses[*index];
            let cost = |contact: &Contact| self.cost(&*self.model, press, contact);
            if cost(contact) < WORTH_MOVING * cost(&press.contact) {
                self.presses[*index].contact = *contact;
                any = true;
            }
        }
        any
    }
}

/// A contact of a press, with derivatives by its unknowns; readings over their deviations.
struct OfContact {
    impedance_ohm: DMatrix<f64>,
    weights: DVector<f64>,
    /// Readings that it gives (V).
    predicted: DVector<f64>,
    /// By how much they change with the logarithm of its conductance (V).
    by_conductance_v: Vec<f64>,
    residual: DVector<f64>,
    slopes: DMatrix<f64>,
    /// With what is known before.
    equations: NormalEquations,
    cost: f64,
}

/// What a press adds to the normal equations.
struct OfPress {
    cost: f64,
    information: DMatrix<f64>,
    slope: DVector<f64>,
    /// Step of the contact, and what a step of the detector takes off it.
    step: DVector<f64>,
    coupling: DMatrix<f64>,
}

impl OfPress {
    /// Of a press that cannot be computed: it says nothing.
    fn nothing(count: usize) -> Self {
        Self {
            cost: f64::MAX.sqrt(),
            information: DMatrix::zeros(count, count),
            slope: DVector::zeros(count),
            step: DVector::zeros(OF_PRESS),
            coupling: DMatrix::zeros(OF_PRESS, count),
        }
    }
}
