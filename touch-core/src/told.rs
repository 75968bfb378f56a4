//! What is told of contacts: their numbers, and an answer.

use crate::answer::{Answer, Contact, Flags};
use crate::detector::Detector;
use crate::evidence::{freedom, is_misfit, known, limit};
use crate::fit::{Fit, LN_RADII, LN_SQUARES, Scene};
use crate::frame::Says;
use crate::posterior::Posterior;
use crate::real::Real;
use crate::solver::{Solver, Task};
use crate::table::Table;
use crate::walls::NearWalls;

/// Conductance (sheet conductances) above which more would change nothing.
const SATURATED_SHEETS: f32 = 100.0;
/// Standard errors have to be above this times those by noise alone for a calibration to be worth it: the host's.
const CALIBRATION_WORTH: f32 = 2.0;
/// What a fit may have left to gain (squared deviations), ten times what a step is not taken for.
const UNFINISHED: f32 = 1.0;

impl<T: Real, const K: usize, const D: usize> Solver<T, K, D> {
    /// Gives contacts the numbers of the nearest ones before.
    pub(crate) fn number(&mut self, before: &Scene<T, K, D>) {
        let old = self.ids;
        let (mut given, mut taken) = ([false; K], [false; K]);
        let count = self.scene.count;
        for _ in 0..count.min(before.count) {
            let mut nearest = (T::infinity(), 0, 0);
            for k in (0..count).filter(|k| !given[*k]) {
                for l in (0..before.count).filter(|l| !taken[*l]) {
                    let [x, y] = [0, 1].map(|d| self.scene.spots[k].at_m[d] - before.spots[l].at_m[d]);
                    if x * x + y * y < nearest.0 {
                        nearest = (x * x + y * y, k, l);
                    }
                }
            }
            let (_, k, l) = nearest;
            (given[k], taken[l]) = (true, true);
            self.ids[k] = old[l];
        }
        for k in (0..count).filter(|k| !given[*k]) {
            self.ids[k] = self.next_id;
            self.next_id = self.next_id.checked_add(1).unwrap_or(1);
        }
    }

    pub(crate) fn answer(&mut self, found: Option<Fit<T, K, D>>, task: Task<'_, T>) -> Answer<T, K> {
        let mut answer = Answer::of(self.work);
        answer.flags.raise(Flags::SATURATED, task.errors.is_full);
        answer.flags.raise(Flags::MORE, self.search.more);
        let Task { table, frame, errors, unknown } = task;
        let readings = task.readings();
        let Some(fit) =
            found.filter(|fit| unknown.is_some() || self.circuit.solve(&Detector::described(table), fit.scene.spots()))
        else {
            let voltages = (0..frame.volts.len()).filter(|i| frame.says_at(*i) == Says::Voltage);
            let squares: T = voltages.map(|i| frame.volts[i] * frame.volts[i]).sum();
            answer.residual = (squares / errors.variance_v2 / readings.max(T::ONE)).sqrt().min(T::max_value());
            return answer;
        };
        answer.flags.raise(Flags::MISFIT, is_misfit(&fit, readings));
        answer.flags.raise(Flags::CALIBRATE, is_to_be_calibrated(&fit, task));
        answer.residual = (fit.cost.max(T::ZERO) / readings.max(T::ONE)).sqrt();
        let posterior = self.fitting.normal.posterior(&known(table, &self.circuit));
        let firmest_s = T::of(SATURATED_SHEETS) * T::of(table.head().sheet_s);
        for k in 0..self.circuit.count {
            let contact = self.contact(k, table, posterior.as_ref());
            answer.flags.raise(Flags::SATURATED, contact.conductance_s > firmest_s);
            answer.add(contact);
        }
        answer
    }

    fn contact(&self, k: usize, table: &Table<'_>, posterior: Option<&Posterior<T, K>>) -> Contact<T> {
        let (loaded, radius_m) = (&self.circuit.loaded[k], T::of(table.head().radius_m));
        let near_walls = posterior.map(|posterior| NearWalls::of(table, loaded.spot.at_m, k, posterior));
        let of = |i: usize, j: usize| near_walls.as_ref().map_or(T::infinity(), |known| known.covariance[i][j]);
        let at_m = near_walls.as_ref().map_or(loaded.spot.at_m, |known| known.at_m);
        // What the readings do not tell is known as well as where a fit may go.
        let deviation = |i: usize, most: T| if of(i, i) >= T::ZERO { of(i, i).sqrt().min(most) } else { most };
        let log_radius = deviation(3, T::of(LN_RADII[1] - LN_RADII[0]));
        let [low_m, high_m] = table.bounds_m();
        // A mean at a wall may round to what is beyond it.
        let at_m = [0, 1].map(|d| at_m[d].max(T::of(low_m[d])).min(T::of(high_m[d])));
        let size = [0, 1].map(|d| T::of(high_m[d] - low_m[d]) / radius_m);
        let shift = T::of(table.head().shift_m) / radius_m;
        let [x, y] = [0, 1].map(|i| {
            let of_readings = deviation(i, size[i]);
            (of_readings * of_readings + shift * shift).sqrt()
        });
        let of_detector = T::of(table.head().ln_conductance_error);
        let most = T::of(LN_SQUARES[1] - LN_SQUARES[0]);
        let variance = loaded.conductance_variance(table, radius_m, of).min(most * most) + of_detector * of_detector;
        let conductance_s = loaded.conductance_s();
        let apparent_conductance_s = T::ONE / (loaded.share * loaded.ohm);
        Contact {
            id: self.ids[k],
            x_m: at_m[0],
            y_m: at_m[1],
            conductance_s,
            conductance_sigma_s: conductance_s * variance.sqrt(),
            apparent_conductance_s,
            force_n: table.force_n(at_m, apparent_conductance_s),
            radius_m: loaded.radius_m,
            radius_sigma_m: loaded.radius_m * log_radius,
            sigma_m: [radius_m * x, radius_m * y],
            correlation: Some(of(0, 1) / (x * y))
                .filter(|r| r.is_finite())
                .map_or(T::ZERO, |r| r.clamp(-T::ONE, T::ONE)),
        }
    }
}

/// Whether a fit leaves more than noise does, and the table takes that for an error of the detector; or the detector is bent by more than noise is, and contacts would be
/// known far better if it were known.
fn is_to_be_calibrated<T: Real, const K: usize, const D: usize>(fit: &Fit<T, K, D>, task: Task<'_, T>) -> bool {
    let Task { table, errors, unknown, .. } = task;
    let worth = T::of(CALIBRATION_WORTH * CALIBRATION_WORTH);
    if unknown.is_some() {
        return fit.less_said > worth && fit.if_known > limit(task.readings() - freedom(fit));
    }
    let noise_v = T::of(table.head().noise_v);
    let of_noise = errors.variance_v2 / (noise_v * noise_v);
    of_noise > worth && of_noise * (fit.cost - T::of(UNFINISHED)) > limit(task.readings() - freedom(fit))
}
