//! What a fit would leave with a contact at other places, as a polynomial of the way there.
//!
//! No current flows across an edge, so that the first derivative of the readings by the way to it vanishes there, and the second counts. With
//! `w = (u, v)` the way of a single contact in its parameters, its conductance and radius as they fit best, the readings are taken as quadratic in
//! `w` and linear in those: of whitened residuals `r`, derivatives `J` by the place and `S` by the others, second derivatives `H`, and the normal matrix
//! `N` and gradient `g` of the others,
//!
//! ```text
//! cost(w) = |r - q|^2 - (g - S'q)' N^-1 (g - S'q),    q = u J1 + v J2 + u^2 H11 / 2 + u v H12 + v^2 H22 / 2
//! ```
//!
//! which is a square form in `(1, u, v, u^2, u v, v^2)`. Of several contacts, readings are not linear in the others over such ways: with it, the error
//! that 90 % of random contacts are below was 5 to 10 % larger. There the fit's normal distribution has to do, with a bound.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix2, Matrix6, Vector2, Vector6};

use super::super::on_detector::of_place;
use super::slopes::Slopes;
use super::{DiscFit, DiscFitter, PARAMETERS, place_m};
use crate::solve::fit::target::Target;
use tactomo_physics::scene::Contact;
use tactomo_physics::space;

/// Way over which second derivatives are taken, in usual radii: half of the mean distance of electrodes.
const WAY: f64 = 3.0;
/// Most standard errors of the step that a fit would take: further on, the readings are not linear in the place.
const FURTHEST: f64 = 3.0;

/// Bound on the standard error where second derivatives are not taken: so many usual radii over the root of the contact's signal in standard
/// deviations, as over a distance of electrodes readings change by about themselves. Without it, fits of firm contacts that ended on the edge
/// claimed 10 mm instead of 0.2. With 12, places in corners are claimed too well (75 % within two standard errors); with 24, errors in
/// corners of detectors as built double.
const LARGEST_ERROR: f64 = 18.0;

/// The square form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) struct PlaceCost(Matrix6<f64>);

impl PlaceCost {
    /// Of a normal distribution about a step from where the fit is.
    pub fn normal(precision: &Matrix2<f64>, step: Vector2<f64>) -> Self {
        let mut form = Matrix6::zeros();
        form.fixed_view_mut::<2, 2>(1, 1).copy_from(precision);
        let towards = -precision * step;
        form.fixed_view_mut::<2, 1>(1, 0).copy_from(&towards);
        form.fixed_view_mut::<1, 2>(0, 1).copy_from(&towards.transpose());
        Self(form)
    }

    /// How far the normal distribution of its square terms reaches, up to a sum of squares.
    pub fn reach(&self, most: f64) -> f64 {
        let precision: Matrix2<f64> = self.0.fixed_view::<2, 2>(1, 1).into_owned();
        (most / precision.symmetric_eigenvalues().min()).sqrt()
    }

    /// Sum of squares at a way from where the fit is, less that there.
    pub fn at(&self, way: Vector2<f64>) -> f64 {
        let [u, v] = way.into();
        let terms = Vector6::new(1.0, u, v, u * u, u * v, v * v);
        (terms.dot(&(self.0 * terms)) - self.0[(0, 0)]).max(0.0)
    }
}

impl DiscFitter<'_> {
    /// What a fit would leave with one of its contacts elsewhere, as the covariance of its parameters tells, and how far they would step.
    pub fn linear_place_cost(
        &self,
        fit: &DiscFit,
        k: usize,
        covariance: &DMatrix<f64>,
        step: &DVector<f64>,
    ) -> Option<PlaceCost> {
        let strength = PARAMETERS * k + 2;
        let unit_m = fit.along(k).1;
        let most = LARGEST_ERROR * self.usual_radius_m / unit_m / fit.normal[(strength, strength)].sqrt().sqrt();
        let precision = of_place(covariance, k).try_inverse()? + Matrix2::identity() * most.powi(-2);
        let step: Vector2<f64> = step.fixed_rows::<2>(PARAMETERS * k).into_owned();
        let errors = step.dot(&(precision * step)).sqrt();
        let form = PlaceCost::normal(&precision, step * (FURTHEST / errors.max(FURTHEST)));
        form.0.iter().all(|value| value.is_finite()).then_some(form)
    }

    /// The same of a contact alone, whose readings are taken as quadratic in its place; `gradient` is half of the negative derivative of what the
    /// fit lowers.
    pub(super) fn place_cost(&self, fit: &DiscFit, target: &Target, gradient: &DVector<f64>) -> Option<PlaceCost> {
        let bends = fit.slopes.bends.get_or_init(|| self.bends(&fit.slopes)).as_ref()?;
        let active = target.at(&fit.volts);
        let whitened = |volts: &Vec<f64>| DVector::from_vec(active.whitened(volts));
        let [first, second] = [0, 1].map(|direction| whitened(&fit.slopes.by[direction]));
        let [uu, uv, vv] = bends.each_ref().map(whitened);
        let left = DVector::from_vec(target.residuals(&fit.volts));
        let terms = DMatrix::from_columns(&[left, -first, -second, -0.5 * uu, -uv, -0.5 * vv]);
        let slopes = [2, 3].map(|i| whitened(&fit.slopes.by[i]));
        let mut shared = DMatrix::from_columns(&slopes).tr_mul(&terms);
        shared.column_mut(0).copy_from(&gradient.rows(2, 2));
        let factor = Cholesky::new(fit.normal.view((2, 2), (2, 2)).into_owned())?;
        factor.l_dirty().solve_lower_triangular_mut(&mut shared);
        let form = terms.tr_mul(&terms) - shared.tr_mul(&shared);
        let form = form.fixed_view::<6, 6>(0, 0).into_owned();
        form.iter().all(|value| value.is_finite()).then_some(PlaceCost(form))
    }

    /// Second derivatives of the readings (V) by the place of a single contact: twice by the first direction, by both, twice by the second.
    fn bends(&self, slopes: &Slopes) -> Option<[Vec<f64>; 3]> {
        let (at, along, unit_m) = (slopes.at[0], slopes.along[0], slopes.at[0].radius_m);
        let way_m = WAY * self.usual_radius_m;
        // Away from an edge that is in the way.
        let side = |direction: usize| {
            let off_m = |side: f64| {
                let to_m = space::along(place_m(&at), side * way_m, along[direction]);
                space::distance(self.fields.footing(to_m).0, to_m)
            };
            if off_m(1.0) <= off_m(-1.0) { 1.0 } else { -1.0 }
        };
        let way = [0, 1].map(|direction| side(direction) * way_m / unit_m);
        let changed = |way: [f64; 2]| {
            let to_m = space::moved(place_m(&at), way.map(|way| way * unit_m), along);
            let [x_m, y_m, z_m] = self.fields.footing(to_m).0;
            let mut volts = self.volts(&[Contact { x_m, y_m, z_m, ..at }])?;
            let linear = slopes.by[0].iter().zip(&slopes.by[1]);
            let before = slopes.volts.iter().zip(linear);
            volts
                .iter_mut()
                .zip(before)
                .for_each(|(volts, (before, (u, v)))| *volts -= before + way[0] * u + way[1] * v);
            Some(volts)
        };
        let [u, v] = way;
        let scaled = |volts: Vec<f64>, factor: f64| volts.into_iter().map(|volts| volts * factor).collect::<Vec<_>>();
        let (uu, vv) = (scaled(changed([u, 0.0])?, 2.0 / (u * u)), scaled(changed([0.0, v])?, 2.0 / (v * v)));
        let mut uv = changed([u, v])?;
        let square = |(uu, vv): (&f64, &f64)| 0.5 * (u * u * uu + v * v * vv);
        uv.iter_mut()
            .zip(uu.iter().zip(&vv).map(square))
            .for_each(|(both, squares)| *both = (*both - squares) / (u * v));
        Some([uu, uv, vv])
    }
}
