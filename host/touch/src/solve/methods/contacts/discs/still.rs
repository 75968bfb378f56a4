//! Contacts that stay where they are while their strengths change: what frames before say of them.
//!
//! A normal distribution of the parameters of places and of the logarithms of radii, all contacts together, and a level of each conductance. In a fit, and in
//! its evidence, they stand for what else is known of a contact before anything is read.

use std::f64::consts::TAU;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{DiscFit, PARAMETERS};
use crate::solve::fit::evidence::misfit_limit;
use tactomo_physics::scene::Contact;
use tactomo_physics::space::Place;

/// Parameters of a contact that stay: its place along two directions, and the logarithm of its radius. Its conductance is free.
pub(in super::super) const STAYING: usize = 3;

/// Where they are among the parameters of a disc.
const AMONG: [usize; STAYING] = [0, 1, 3];

/// Variance of the parameters of a contact that may be anywhere: ten radii.
const ANYWHERE: f64 = 100.0;

/// What is known of places and radii.
#[derive(Clone, Debug, PartialEq)]
pub(in super::super) struct Still {
    at: Vec<Contact>,
    /// Logarithm of the usual conductance (S) of each.
    levels: Vec<f64>,
    /// Unit vectors of the directions of each place.
    along: Vec<[Place; 2]>,
    /// Unit of the places of each (m).
    units_m: Vec<f64>,
    /// Inverse of the covariance, [`STAYING`] for each contact.
    information: DMatrix<f64>,
}

impl Still {
    /// About the places and radii of a fit, with the information about these, and logarithms of usual conductances (S).
    pub fn about(fit: &DiscFit, information: DMatrix<f64>, levels: Vec<f64>) -> Self {
        let along = (0..fit.contacts.len()).map(|k| fit.along(k).0).collect();
        Self { at: fit.contacts.clone(), levels, along, units_m: fit.units_m(), information }
    }

    /// Logarithm of the usual conductance (S) of a contact.
    pub fn level(&self, k: usize) -> f64 {
        self.levels[k]
    }

    /// How far contacts are from where they were, in its parameters.
    fn offset(&self, contacts: &[Contact]) -> DVector<f64> {
        let of = |(k, now): (usize, &Contact)| {
            let before = &self.at[k];
            let way = [now.x_m - before.x_m, now.y_m - before.y_m, now.z_m - before.z_m];
            let along = |direction: usize| {
                self.along[k][direction].iter().zip(way).map(|(a, b)| a * b).sum::<f64>() / self.units_m[k]
            };
            [along(0), along(1), (now.radius_m / before.radius_m).ln()]
        };
        DVector::from_iterator(STAYING * contacts.len(), contacts.iter().enumerate().flat_map(of))
    }

    /// Sum of squares of the parameters' deviations from what is known of them.
    pub fn cost(&self, contacts: &[Contact]) -> f64 {
        let offset = self.offset(contacts);
        offset.dot(&(&self.information * &offset))
    }

    /// The same if those that are further from where they were than errors of both explain may be anywhere; `None` if none is.
    pub fn letting_move(&self, contacts: &[Contact]) -> Option<Self> {
        let (offset, mut covariance) = (self.offset(contacts), self.covariance()?);
        let has_moved = |k: &usize| {
            let own = covariance.fixed_view::<STAYING, STAYING>(STAYING * k, STAYING * k).into_owned();
            let off = offset.fixed_rows::<STAYING>(STAYING * k).into_owned();
            let freedom = STAYING as f64;
            own.try_inverse().is_none_or(|information| off.dot(&(information * off)) > freedom * misfit_limit(freedom))
        };
        let moved: Vec<usize> = (0..contacts.len()).filter(has_moved).collect();
        for row in moved.iter().flat_map(|k| STAYING * k..STAYING * (k + 1)) {
            covariance[(row, row)] += ANYWHERE;
        }
        (!moved.is_empty()).then_some(())?;
        Some(Self { information: Cholesky::new(covariance)?.inverse(), ..self.clone() })
    }

    fn covariance(&self) -> Option<DMatrix<f64>> {
        Some(Cholesky::new(self.information.clone())?.inverse())
    }

    /// Factors from the parameters of a fit, whose places have these units (m), to its own.
    fn factors(&self, units_m: &[f64]) -> Vec<f64> {
        units_m.iter().zip(&self.units_m).flat_map(|(theirs, ours)| [theirs / ours, theirs / ours, 1.0]).collect()
    }

    /// Adds what is known to the normal matrix of a fit whose places have these units (m).
    pub fn add_to_normal(&self, normal: &mut DMatrix<f64>, units_m: &[f64]) {
        let factors = self.factors(units_m);
        for (i, j) in (0..factors.len()).flat_map(|i| (0..factors.len()).map(move |j| (i, j))) {
            normal[(among(i), among(j))] += factors[i] * self.information[(i, j)] * factors[j];
        }
    }

    /// Adds its pull to the gradient of a fit.
    pub fn add_to_gradient(&self, gradient: &mut [f64], contacts: &[Contact], units_m: &[f64]) {
        let pull = &self.information * self.offset(contacts);
        self.factors(units_m).iter().enumerate().for_each(|(i, factor)| gradient[among(i)] -= factor * pull[i]);
    }

    /// Logarithm of its density at its peak, in parameters whose places have these units (m).
    pub fn ln_peak(&self, units_m: &[f64]) -> f64 {
        let Some(factor) = Cholesky::new(self.information.clone()) else { return f64::NEG_INFINITY };
        let units: f64 = self.factors(units_m).iter().map(|factor| factor.ln()).sum();
        0.5 * factor.ln_determinant() + units - 0.5 * self.information.nrows() as f64 * TAU.ln()
    }

    /// What is known of some of the contacts, whatever the others do; `None` if that is nothing.
    pub fn of(&self, kept: &[usize]) -> Option<Self> {
        let covariance = self.covariance()?;
        let rows: Vec<usize> = kept.iter().flat_map(|k| (0..STAYING).map(move |i| STAYING * k + i)).collect();
        let information = Cholesky::new(covariance.select_rows(&rows).select_columns(&rows))?.inverse();
        Some(Self {
            at: kept.iter().map(|k| self.at[*k]).collect(),
            levels: kept.iter().map(|k| self.levels[*k]).collect(),
            along: kept.iter().map(|k| self.along[*k]).collect(),
            units_m: kept.iter().map(|k| self.units_m[*k]).collect(),
            information,
        })
    }
}

/// Where a staying parameter is among those of the discs.
pub(in super::super) fn among(staying: usize) -> usize {
    PARAMETERS * (staying / STAYING) + AMONG[staying % STAYING]
}
