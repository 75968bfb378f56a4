//! Derivatives of the readings by the parameters of discs.

use std::sync::OnceLock;

use nalgebra::DMatrix;

use super::{DiscFitter, PARAMETERS, place_m};
use crate::solve::fit::dot::dot;
use tactomo_physics::forward::readings_v;
use tactomo_physics::scene::Contact;
use tactomo_physics::space::Place;

/// Most of the ratio of `S` and `1/C` that can be distinguished from errors of the derivatives.
const MOST_CONSTRICTION: f64 = 1e3;
/// Differences that derivatives are taken over.
const DIFFERENCE: f64 = 1e-3;
/// Derivatives of the readings where they were taken.
#[derive(Clone, Debug)]
pub(super) struct Slopes {
    pub(super) at: Vec<Contact>,
    /// Unit vectors of the two directions of each.
    pub(super) along: Vec<[Place; 2]>,
    /// Readings there (V).
    pub(super) volts: Vec<f64>,
    /// Of the readings (V), for each parameter of each contact.
    pub(super) by: Vec<Vec<f64>>,
    /// Constriction of each: the resistance of the crowded current under it over the contact's own, `S C`.
    pub(super) constriction: Vec<f64>,
    /// Second derivatives by the place of a single contact (V), once they are needed; `None` if there are none.
    pub(super) bends: OnceLock<Option<[Vec<f64>; 3]>>,
}

impl Slopes {
    /// Units of the places' parameters (m), a contact each.
    pub(super) fn units_m(&self) -> Vec<f64> {
        self.at.iter().map(|contact| contact.radius_m).collect()
    }

    /// How far contacts are from where the derivatives were taken, in the parameters.
    pub(super) fn offset(&self, contacts: &[Contact]) -> Vec<f64> {
        let of = |(k, now): (usize, &Contact)| {
            let before = &self.at[k];
            let way = [now.x_m - before.x_m, now.y_m - before.y_m, now.z_m - before.z_m];
            let along = |direction: usize| {
                self.along[k][direction].iter().zip(way).map(|(a, b)| a * b).sum::<f64>() / before.radius_m
            };
            let own = before.conductance_s / now.conductance_s;
            let ohm = (own + self.constriction[k] * before.radius_m / now.radius_m) / (1.0 + self.constriction[k]);
            [along(0), along(1), -ohm.ln(), (now.radius_m / before.radius_m).ln()]
        };
        contacts.iter().enumerate().flat_map(of).collect()
    }
}

impl DiscFitter<'_> {
    /// Derivatives at contacts.
    pub(super) fn slopes(&self, at: Vec<Contact>) -> Option<Slopes> {
        let size = PARAMETERS * at.len();
        let mut steps = Vec::with_capacity(size);
        let mut replaced = Vec::with_capacity(size);
        for parameter in 0..size {
            let (k, mut step) = (parameter / PARAMETERS, [0.0; PARAMETERS]);
            step[parameter % PARAMETERS] = DIFFERENCE;
            let mut moved = self.stepped(&at[k], at[k].radius_m, 0.0, &step);
            if moved == at[k] {
                // Backwards if the edge is in the way.
                step[parameter % PARAMETERS] = -DIFFERENCE;
                moved = self.stepped(&at[k], at[k].radius_m, 0.0, &step);
            }
            steps.push(step[parameter % PARAMETERS]);
            replaced.push((k, moved));
        }
        let (impedance_ohm, changes_ohm) = self.model.impedance_with_changes_ohm(&at, &replaced).ok()?;
        let volts = readings_v(&impedance_ohm, self.detector).volts().to_vec();
        let by = changes_ohm.iter().zip(&steps).map(|(change, step)| self.slope(&impedance_ohm, change, *step));
        let mut by: Vec<Vec<f64>> = by.collect();
        let constriction = (0..at.len()).map(|k| {
            let (by_conductance, by_radius) = by[PARAMETERS * k + 2..PARAMETERS * (k + 1)].split_at_mut(1);
            let (by_conductance, by_radius) = (&mut by_conductance[0], &mut by_radius[0]);
            let constriction =
                (dot(by_conductance, by_radius) / dot(by_conductance, by_conductance)).clamp(0.0, MOST_CONSTRICTION);
            by_radius.iter_mut().zip(&*by_conductance).for_each(|(radius, c)| *radius -= constriction * c);
            by_conductance.iter_mut().for_each(|c| *c *= 1.0 + constriction);
            constriction
        });
        let constriction = constriction.collect();
        let sound = volts.iter().chain(by.iter().flatten()).all(|value| value.is_finite());
        let along = at.iter().map(|contact| self.fields.footing(place_m(contact)).1).collect();
        sound.then_some(Slopes { at, along, volts, by, constriction, bends: OnceLock::new() })
    }

    /// Derivative of the readings from a small change of the impedances: `V = Vcc (1 - Z[e][g] / L)`, `L = Z[g][g] + R_on`.
    fn slope(&self, impedance_ohm: &DMatrix<f64>, change: &DMatrix<f64>, step: f64) -> Vec<f64> {
        let n = impedance_ohm.nrows();
        let volts = |g: usize, e: usize| {
            let load_ohm = impedance_ohm[(g, g)] + self.detector.on_resistance_ohm;
            let share = impedance_ohm[(e, g)] / load_ohm;
            -self.detector.drive_v * (change[(e, g)] - share * change[(g, g)]) / (load_ohm * step)
        };
        (0..n * n).map(|i| volts(i / n, i % n)).collect()
    }
}
