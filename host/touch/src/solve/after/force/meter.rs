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

use nalgebra::{Cholesky, DMatrix, DVector, Matrix2};

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
        Some(Self {
            spot_model: SpotModel::new(detector, problem.model.electrode_fields_ohm()),
            fields: problem.model.spots(radius_m)?,
            constriction_ohm: problem.modelled().constriction_ohm()?,
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
        let measured = contacts.iter().zip(&deviations).enumerate().map(|(k, (contact, deviation))| {
            let by_place = descent.deviation_by_place(&fit, k, contact);
            let conductance_s = (-fit.logs[k]).exp();
            Measured { conductance_s, deviation_s: deviation.hypot(by_place) * conductance_s }
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

    /// Standard error of a resistance's logarithm by that of its contact's place: the root mean square of what a step takes it to at the four places
    /// that have the place's covariance (Julier and Uhlmann 1997). Next to a wall no first derivative tells it.
    fn deviation_by_place(&mut self, fit: &Fit, k: usize, contact: &FoundContact) -> f64 {
        let Some(known) = contact.uncertainty else { return 0.0 };
        let across = known.correlation * known.x_m * known.y_m;
        let axes = Matrix2::new(known.x_m.powi(2), across, across, known.y_m.powi(2)).symmetric_eigen();
        let here = self.spots[k].spot.clone();
        let mut square = 0.0;
        for (axis, side) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)] {
            let way_m = axes.eigenvectors.column(axis) * (side * (2.0 * axes.eigenvalues[axis].max(0.0)).sqrt());
            self.spots[k].spot = self.meter.fields.spot([contact.x_m + way_m.x, contact.y_m + way_m.y, contact.z_m]);
            let stepped = self.look(fit.logs.clone()).and_then(|moved| {
                let NormalEquations { matrix, gradient } = self.equations(&moved);
                Some(Cholesky::new(matrix)?.solve(&gradient)[k].clamp(-LONGEST_LOG, LONGEST_LOG))
            });
            square += stepped.unwrap_or_default().powi(2) / 4.0;
        }
        self.spots[k].spot = here;
        square.sqrt()
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
mod tests;
