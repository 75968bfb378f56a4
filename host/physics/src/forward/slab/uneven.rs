//! Conductivity that differs across the plane: `sigma(x, y, z) = sigma(z) s(x, y)`.
//!
//! With `phi = psi / sqrt(s)` (Liouville) the equation of an even slab is left, and a potential:
//!
//! ```text
//! div(sigma grad phi) = sqrt(s) (div(sigma(z) grad psi) - sigma(z) q psi),   q = laplace(sqrt s) / sqrt s = laplace(u) / 2 + |grad u|^2 / 4
//! ```
//!
//! for `s = exp(u)`. Where `u` is a sum of cosines, `psi` has no slope across the walls either. So the Neumann function is
//! `N(a, b) = (N0(a, b) + D(a, b)) / sqrt(s(a) s(b))`: that of the even slab `N0`, and a correction `D` that is smooth, as `q` couples
//! modes `k` and `k'` by `q(k, k') / (k k')^2` only. In a sheet of conductance `S`, the matrix of `D` over the modes but the constant one is
//! `((K^2 + Q)^-1 - K^-2) / S`, with `K^2` the diagonal of squared wave numbers and `Q` that of `q`: leaving the constant mode out is a choice
//! of the potential's zero, since `sqrt(s)` is the null vector of `K^2 + Q`. A slab's depth changes how two modes see each other: to first
//! order in `q` by `(G(k') - G(k)) / (k^2 - k'^2)` in place of `1 / (S k^2 k'^2)`, with `G` the response of [`layers`](super::layers)
//! between the two surfaces, whatever the layers (Green's identity in depth). The sheet's matrix is scaled by that quotient.
//!
//! Left out: how depth changes the second order in `q`; slopes of `s` and of `D` over a contact; and those over a pad in its own singular field.
//! The resistance of a driving layer and a leak are scaled with the foam, though they are even.

use std::f64::consts::PI;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::layers::{Response, response};
use crate::detector::{Layer, Unevenness, cosines};
use crate::forward::uneven_place::UnevenPlace;

/// Points along a side, for each half wave of the highest mode, where `q` is integrated.
const POINTS_PER_MODE: usize = 4;

/// Share of `k^2` between two squared wave numbers below which their quotient is taken as a derivative.
const ALIKE: f64 = 1e-3;

/// What unevenness does to the fields of a slab.
#[derive(Clone, Debug)]
pub(super) struct Uneven {
    size_m: [f64; 2],
    unevenness: Unevenness,
    /// Half waves along both sides, and the factor that makes the mode's mean square one over the plane.
    modes: Vec<([usize; 2], f64)>,
    /// The correction between modes (ohm): both on the bottom, one on each, both on the top.
    bottom: DMatrix<f64>,
    across: DMatrix<f64>,
    top: DMatrix<f64>,
}

/// The kernel of the top between two places of an uneven slab, from that of the even one (ohm), which it is without unevenness.
pub(super) fn uneven_ohm(even_ohm: f64, here: Option<&UnevenPlace>, there: Option<&UnevenPlace>) -> f64 {
    match (here, there) {
        (Some(here), Some(there)) => (even_ohm + here.correction_ohm(there)) * here.inverse_root * there.inverse_root,
        _ => even_ohm,
    }
}

/// The points of a pad, as unevenness changes their fields.
#[derive(Clone, Debug)]
pub(super) struct UnevenPad {
    inverse_roots: Vec<f64>,
    /// `modes x points`.
    modes: DMatrix<f64>,
    /// Corrections of the points' currents' fields, by modes (ohm).
    fields: DMatrix<f64>,
}

impl UnevenPad {
    /// Turns the kernel of the even bottom between points of this pad and of another (ohm) into that of the uneven one.
    pub fn apply(&self, other: &Self, points_ohm: &mut DMatrix<f64>) {
        *points_ohm += self.modes.tr_mul(&other.fields);
        for (mut column, there) in points_ohm.column_iter_mut().zip(&other.inverse_roots) {
            column.iter_mut().zip(&self.inverse_roots).for_each(|(ohm, here)| *ohm *= here * there);
        }
    }
}

impl Uneven {
    /// The correction with modes of up to `most` half waves; `None` where the conductivity is even.
    pub fn new(size_m: [f64; 2], unevenness: &Unevenness, layers: &[Layer], most: usize) -> Option<Self> {
        if unevenness.is_even() {
            return None;
        }
        let modes: Vec<_> = (0..=most)
            .flat_map(|m| (0..=most).map(move |n| [m, n]))
            .filter(|[m, n]| m + n > 0 && m * m + n * n <= most * most)
            .map(|mode| (mode, mode.iter().map(|m| if *m == 0 { 1.0 } else { 2.0f64 }).product::<f64>().sqrt()))
            .collect();
        let square = |[m, n]: [usize; 2]| (m as f64 * PI / size_m[0]).powi(2) + (n as f64 * PI / size_m[1]).powi(2);
        let squares: Vec<f64> = modes.iter().map(|(mode, _)| square(*mode)).collect();
        let potential = Potential::new(size_m, unevenness, most);
        let count = modes.len();
        let mut stiffness = DMatrix::from_fn(count, count, |i, j| potential.between(&modes[i], &modes[j]));
        (0..count).for_each(|i| stiffness[(i, i)] += squares[i]);
        let mut sheet = Cholesky::new(stiffness)?.inverse();
        (0..count).for_each(|i| sheet[(i, i)] -= 1.0 / squares[i]);
        let area_m2 = size_m[0] * size_m[1];
        let depth = Depth::new(layers, &squares);
        let scaled = |of: fn(&Response) -> f64| {
            DMatrix::from_fn(count, count, |i, j| {
                depth.quotient(i, j, of) * squares[i] * squares[j] * sheet[(i, j)] / area_m2
            })
        };
        Some(Self {
            size_m,
            unevenness: unevenness.clone(),
            bottom: scaled(|response| response.bb),
            across: scaled(|response| response.tb),
            top: scaled(|response| response.tt),
            modes,
        })
    }

    /// `1 / sqrt(s)` at a place from the corner (m).
    pub fn inverse_root(&self, at_m: [f64; 2]) -> f64 {
        (-0.5 * self.unevenness.log_at([at_m[0] / self.size_m[0], at_m[1] / self.size_m[1]])).exp()
    }

    /// What belongs to a place of the top, from the corner (m).
    pub fn place(&self, at_m: [f64; 2]) -> UnevenPlace {
        let modes = self.modes_at(at_m);
        UnevenPlace { inverse_root: self.inverse_root(at_m), fields: &self.top * &modes, modes }
    }

    /// The same of a place of the bottom.
    pub fn place_below(&self, at_m: [f64; 2]) -> UnevenPlace {
        let modes = self.modes_at(at_m);
        UnevenPlace { inverse_root: self.inverse_root(at_m), fields: &self.bottom * &modes, modes }
    }

    /// What belongs to the points of a pad, from the corner (m).
    pub fn under_pad(&self, points_m: &[[f64; 2]]) -> UnevenPad {
        let modes: Vec<_> = points_m.iter().map(|at_m| self.modes_at(*at_m)).collect();
        let modes = DMatrix::from_columns(&modes);
        UnevenPad {
            inverse_roots: points_m.iter().map(|at_m| self.inverse_root(*at_m)).collect(),
            fields: &self.bottom * &modes,
            modes,
        }
    }

    /// The correction to the field on the top of a current at a place of the bottom: half waves and amplitude (ohm).
    pub fn across_ohm(&self, bottom_m: [f64; 2]) -> Vec<([usize; 2], f64)> {
        let fields = &self.across * self.modes_at(bottom_m);
        self.modes.iter().zip(fields.iter()).map(|((mode, norm), field)| (*mode, norm * field)).collect()
    }

    fn modes_at(&self, at_m: [f64; 2]) -> DVector<f64> {
        let most = self.modes.iter().map(|([m, n], _)| *m.max(n)).max().unwrap_or(0);
        let cosines = [0, 1].map(|axis| cosines(most, at_m[axis] / self.size_m[axis]));
        let value = |([m, n], norm): &([usize; 2], f64)| norm * cosines[0][*m] * cosines[1][*n];
        DVector::from_iterator(self.modes.len(), self.modes.iter().map(value))
    }
}

/// `q` by its means under products of two cosines (1/m2).
struct Potential {
    means: DMatrix<f64>,
}

impl Potential {
    fn new(size_m: [f64; 2], unevenness: &Unevenness, most: usize) -> Self {
        let points = POINTS_PER_MODE * most.max(unevenness.most());
        let at = |i: usize| (i as f64 + 0.5) / points as f64;
        let waves =
            |i: usize| (0..=unevenness.most()).map(move |m| (PI * m as f64 * at(i)).sin_cos()).map(|(s, c)| [c, s]);
        let waves: Vec<Vec<[f64; 2]>> = (0..points).map(|i| waves(i).collect()).collect();
        let q = DMatrix::from_fn(points, points, |i, j| potential(size_m, unevenness, [&waves[i], &waves[j]]));
        let all: Vec<_> = (0..points).map(|i| cosines(2 * most, at(i))).collect();
        let cosines = DMatrix::from_fn(2 * most + 1, points, |m, i| all[i][m] / points as f64);
        Self { means: &cosines * q * cosines.transpose() }
    }

    /// Mean of `q` times two modes.
    fn between(&self, ([m, n], norm): &([usize; 2], f64), ([k, l], other): &([usize; 2], f64)) -> f64 {
        let at = |x: usize, y: usize| self.means[(x, y)];
        let (x, y) = ([m.abs_diff(*k), m + k], [n.abs_diff(*l), n + l]);
        0.25 * norm * other * (at(x[0], y[0]) + at(x[0], y[1]) + at(x[1], y[0]) + at(x[1], y[1]))
    }
}

/// `q` at a place, by `cos` and `sin` of all half waves along both sides there (1/m2).
fn potential(size_m: [f64; 2], unevenness: &Unevenness, [x, y]: [&[[f64; 2]]; 2]) -> f64 {
    let (mut laplace, mut slope) = (0.0, [0.0; 2]);
    for ([i, j], amplitude) in unevenness.modes() {
        let k = [i as f64 * PI / size_m[0], j as f64 * PI / size_m[1]];
        laplace -= amplitude * (k[0] * k[0] + k[1] * k[1]) * x[i][0] * y[j][0];
        slope[0] -= amplitude * k[0] * x[i][1] * y[j][0];
        slope[1] -= amplitude * k[1] * x[i][0] * y[j][1];
    }
    0.5 * laplace + 0.25 * (slope[0] * slope[0] + slope[1] * slope[1])
}

/// The layers' response to each mode, for quotients of two.
struct Depth<'a> {
    layers: &'a [Layer],
    squares: &'a [f64],
    responses: Vec<Response>,
}

impl<'a> Depth<'a> {
    fn new(layers: &'a [Layer], squares: &'a [f64]) -> Self {
        Self { layers, squares, responses: squares.iter().map(|square| response(layers, square.sqrt())).collect() }
    }

    /// `(G(k') - G(k)) / (k^2 - k'^2)` for one of the responses.
    fn quotient(&self, i: usize, j: usize, of: fn(&Response) -> f64) -> f64 {
        let (a, b) = (self.squares[i], self.squares[j]);
        if (a - b).abs() > ALIKE * a.max(b) {
            return (of(&self.responses[j]) - of(&self.responses[i])) / (a - b);
        }
        let at = |square: f64| of(&response(self.layers, square.sqrt()));
        let step = 0.01 * a;
        (at(a - step) - at(a + step)) / (2.0 * step)
    }
}
