//! Discs as they fit, and how far from where they were the derivatives serve.

use std::sync::Arc;

use nalgebra::DMatrix;

use super::place_cost::PlaceCost;
use super::slopes::Slopes;
use super::{PARAMETERS, Still};
use crate::solve::fit::least_squares::covariance;
use tactomo_physics::scene::Contact;
use tactomo_physics::space::Place;

/// What the readings' curvature makes of the way from where derivatives were taken, in standard deviations: up to the first, readings are
/// taken as linear; up to the second, the derivatives serve for steps, if no parameter has changed by more than the third and by so
/// many of its standard errors.
const LINEAR: f64 = 0.1;
const NEAR: f64 = 3.0;
const NEAR_AT_MOST: f64 = 0.4;
const SIGNIFICANT: f64 = 3.0;

/// Discs that fit best.
#[derive(Clone, Debug)]
pub(in super::super) struct DiscFit {
    pub contacts: Vec<Contact>,
    /// Readings that they predict (V).
    pub volts: Vec<f64>,
    /// Sum of squares of the weighted residuals, without what was known before.
    pub cost: f64,
    /// Sum of squares of the parameters' deviations from what was known before.
    pub known: f64,
    /// What frames before say of their places and radii, if that is what was known.
    pub still: Option<Arc<Still>>,
    pub(super) slopes: Arc<Slopes>,
    /// `J^T W^2 J` with what was known before.
    pub normal: DMatrix<f64>,
    /// What it would leave with each contact elsewhere, of those near edges; none of a fit that no descent has ended with.
    pub place_costs: Vec<Option<PlaceCost>>,
    /// Whether more steps would change nothing.
    pub settled: bool,
}

impl DiscFit {
    /// Covariance of the parameters, [`PARAMETERS`] for each contact; `None` where they are not determined.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        covariance(&self.normal)
    }

    /// Unit vectors of the directions that the parameters of a contact's place are along, and their unit (m).
    pub fn along(&self, k: usize) -> ([Place; 2], f64) {
        (self.slopes.along[k], self.slopes.at[k].radius_m)
    }

    /// Constriction: the resistance of the crowded current under a contact over its own.
    pub fn constriction(&self, k: usize) -> f64 {
        let (before, now) = (self.slopes.at[k], self.contacts[k]);
        self.slopes.constriction[k] * now.conductance_s / before.conductance_s * before.radius_m / now.radius_m
    }

    /// The fit, with nothing known any more of where those of its contacts stay that have moved; `None` if none has.
    pub fn letting_move(&self, moved: &[Contact]) -> Option<Self> {
        let still = self.still.as_ref()?.letting_move(moved)?;
        Some(Self { still: Some(Arc::new(still)), ..self.clone() })
    }

    /// Units of the places' parameters (m), a contact each.
    pub fn units_m(&self) -> Vec<f64> {
        self.slopes.units_m()
    }

    /// How far other contacts are from these, in the parameters.
    pub fn way_to(&self, contacts: &[Contact]) -> Vec<f64> {
        let (from, to) = (self.slopes.offset(&self.contacts), self.slopes.offset(contacts));
        to.iter().zip(from).map(|(to, from)| to - from).collect()
    }

    /// Derivatives of the readings by all parameters (V).
    pub fn slopes_v(&self) -> &[Vec<f64>] {
        &self.slopes.by
    }

    /// What the curvature of the readings makes of an offset, in standard deviations: a change by one radius, or of a logarithm by one,
    /// changes derivatives by about themselves.
    fn bend(&self, offset: &[f64]) -> f64 {
        let of = |(i, offset): (usize, &f64)| 0.5 * offset * offset * self.normal[(i, i)].sqrt();
        offset.iter().enumerate().map(of).fold(0.0, f64::max)
    }

    /// What the curvature of the crowded current alone makes of an offset, in standard deviations, if its resistance were `S (1 - ln(r / r0))` in
    /// place of `S r0 / r`: of a firm contact little else resists. It may be less, so that derivatives serve for steps all the same.
    fn bend_of_crowding(&self, offset: &[f64]) -> f64 {
        let of = |(k, constriction): (usize, &f64)| {
            let (resistance, radius) = (PARAMETERS * k + 2, PARAMETERS * k + 3);
            let share = constriction / (1.0 + constriction);
            0.5 * offset[radius] * offset[radius] * share * self.normal[(resistance, resistance)].sqrt()
        };
        self.slopes.constriction.iter().enumerate().map(of).fold(0.0, f64::max)
    }

    /// Whether readings follow the derivatives to an offset.
    pub(super) fn is_linear(&self, offset: &[f64]) -> bool {
        self.bend(offset).max(self.bend_of_crowding(offset)) < LINEAR
    }

    /// Whether an offset is too far for the derivatives to serve. A light contact that noise moves about is not: what the derivatives are
    /// wrong by is little against its standard error.
    pub(super) fn is_far(&self, offset: &[f64]) -> bool {
        let is_long = |(i, offset): (usize, &f64)| {
            offset.abs() > NEAR_AT_MOST && offset.abs() * self.normal[(i, i)].sqrt() > SIGNIFICANT
        };
        self.bend(offset) > NEAR || offset.iter().enumerate().any(is_long)
    }

    /// What the fit lowers: both sums of squares.
    pub(super) fn objective(&self) -> f64 {
        self.cost + self.known
    }
}
