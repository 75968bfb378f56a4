//! A dot of glue by itself: a conducting sheet between two faces.
//!
//! The sheet of conductance `s` takes up the density `p` from the upper face and gives the density `q` to the lower one. Along its plane it
//! has to carry the difference, with no current through its rim: `-div(s grad u) = p - q`, which makes the heat `(p - q)^T G (p - q) / 2`. For
//! a Zernike polynomial on the right `u` is a polynomial, too. On both faces radial orders above the basis act on the dot only, and are
//! eliminated there, the two faces together.

use std::f64::consts::PI;

use nalgebra::{Cholesky, DMatrix};

use crate::forward::slab::disc::{Density, DiscBasis, DiscSelf, LOCAL_ORDERS, MAX_ORDER, radial_terms};

/// A face of a dot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Face {
    /// On the upper layer's bottom.
    Upper,
    /// On the lower layer's top.
    Lower,
}

/// What a dot is made of.
pub(super) struct Glue<'a> {
    pub basis: &'a DiscBasis,
    pub upper: &'a DiscSelf,
    pub lower: &'a DiscSelf,
    /// Factor of the faces' own impedances.
    pub even: f64,
    /// Contact impedance over a dot's area (ohm).
    pub contact_ohm: f64,
    pub sheet_s: f64,
}

/// One unknown of a dot: a density on a face, or the current through it, which is uniform on both.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unknown {
    pub density: Density,
    /// `None`: on both.
    pub face: Option<Face>,
}

/// A dot by itself.
#[derive(Clone, Debug)]
pub(super) struct Joint {
    /// Impedances (ohm) between the current through it, the other densities of the basis on the upper face, and those on the lower.
    pub impedance_ohm: DMatrix<f64>,
    /// The densities above the basis, and what they are for each of those.
    pub higher: Vec<Unknown>,
    pub of_kept: DMatrix<f64>,
}

/// The unknowns that are kept, in their order.
pub(super) fn kept(basis: &DiscBasis) -> Vec<Unknown> {
    let through = Unknown { density: basis.densities()[0], face: None };
    let on = |face| basis.densities()[1..].iter().map(move |density| Unknown { density: *density, face: Some(face) });
    std::iter::once(through).chain(on(Face::Upper)).chain(on(Face::Lower)).collect()
}

impl Joint {
    /// Eliminates what is above the basis.
    pub fn new(glue: &Glue<'_>) -> Self {
        let kept = kept(glue.basis);
        let mut impedance_ohm = DMatrix::zeros(kept.len(), kept.len());
        let (mut higher, mut blocks) = (Vec::new(), Vec::new());
        for m in 0..=glue.basis.degree() {
            for sine in [false, true].into_iter().take(if m == 0 { 1 } else { 2 }) {
                let is_of = |unknown: &Unknown| (unknown.density.m, unknown.density.sine) == (m, sine);
                let low: Vec<_> = (0..kept.len()).filter(|i| is_of(&kept[*i])).collect();
                let own: Vec<_> = low.iter().map(|i| kept[*i]).collect();
                let above = glue.above(m, sine);
                let of_low = glue.reduce(&own, &above, |i, j, ohm| impedance_ohm[(low[i], low[j])] = ohm);
                blocks.push((higher.len(), low, of_low));
                higher.extend(above);
            }
        }
        let mut of_kept = DMatrix::zeros(higher.len(), kept.len());
        for (first, low, block) in blocks {
            for (j, column) in low.iter().enumerate() {
                of_kept.view_mut((first, *column), (block.nrows(), 1)).copy_from(&block.column(j));
            }
        }
        Self { impedance_ohm, higher, of_kept }
    }
}

impl Glue<'_> {
    /// Unknowns of an angular order above the basis.
    fn above(&self, m: usize, sine: bool) -> Vec<Unknown> {
        let first = m + 2 * ((self.basis.degree() - m) / 2 + 1);
        let last = (self.basis.degree() + LOCAL_ORDERS).min(MAX_ORDER);
        let on = |face| {
            (first..=last).step_by(2).map(move |n| Unknown { density: Density { n, m, sine }, face: Some(face) })
        };
        on(Face::Upper).chain(on(Face::Lower)).collect()
    }

    /// Sets the impedances between `low` with those `above` eliminated, and returns the latter for each of the former.
    fn reduce(&self, low: &[Unknown], above: &[Unknown], mut set: impl FnMut(usize, usize, f64)) -> DMatrix<f64> {
        let between = |rows: &[Unknown], columns: &[Unknown]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| self.between_ohm(rows[i], columns[j]))
        };
        let cross = between(above, low);
        let of_low = match Cholesky::new(between(above, above)) {
            Some(factor) => -factor.solve(&cross),
            None => DMatrix::zeros(above.len(), low.len()),
        };
        let reduced = between(low, low) + cross.tr_mul(&of_low);
        (0..low.len()).for_each(|i| (0..low.len()).for_each(|j| set(i, j, reduced[(i, j)])));
        of_low
    }

    /// Impedance between two unknowns of the same angular dependence (ohm).
    fn between_ohm(&self, a: Unknown, b: Unknown) -> f64 {
        let half = if a.density.m == 0 { 1.0 } else { 0.5 };
        let spread = if a.density.n == b.density.n { self.contact_ohm / (a.density.n + 1) as f64 } else { 0.0 };
        let of_face = |face: Face, own: &DiscSelf| {
            let on = |unknown: Unknown| unknown.face.is_none_or(|other| other == face);
            if on(a) && on(b) { half * (spread + self.even * own.between(a.density.n, b.density.n)) } else { 0.0 }
        };
        let sign = |unknown: Unknown| match unknown.face {
            None => 0.0,
            Some(Face::Upper) => 1.0,
            Some(Face::Lower) => -1.0,
        };
        let along = sign(a) * sign(b);
        let along_ohm = if along == 0.0 { 0.0 } else { along * along_glue(a.density, b.density) / self.sheet_s };
        of_face(Face::Upper, self.upper) + of_face(Face::Lower, self.lower) + along_ohm
    }
}

/// Impedance of a sheet of 1 S between two densities of one angular dependence, of which none carries a net current.
fn along_glue(a: Density, b: Density) -> f64 {
    let m = a.m as f64;
    // u by its powers of the radius: -laplace(r^p) = (m^2 - p^2) r^(p - 2), and the slope at the rim is taken off by r^m.
    let mut potential: Vec<(f64, f64)> = radial_terms(b.n, b.m)
        .map(|(power, factor)| (power as f64 + 2.0, -factor / ((power as f64 + 2.0).powi(2) - m * m)))
        .collect();
    if b.m > 0 {
        let slope: f64 = potential.iter().map(|(power, factor)| power * factor).sum();
        potential.push((m, -slope / m));
    }
    let around = if a.m == 0 { 2.0 * PI } else { PI };
    let integral: f64 = radial_terms(a.n, a.m)
        .flat_map(|(power, factor)| potential.iter().map(move |(other, of)| factor * of / (power as f64 + other + 2.0)))
        .sum();
    around * integral / (PI * PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn density(n: usize, m: usize) -> Density {
        Density { n, m, sine: false }
    }

    #[test]
    fn a_sheet_carries_a_slope_of_density_as_by_hand() {
        // Right side r cos: u = (3 r - r^3) / 8 cos; its product with r cos, over the disc and over pi^2.
        let found = along_glue(density(1, 1), density(1, 1));
        assert!((found - (3.0 / 4.0 - 1.0 / 6.0) / 8.0 / PI).abs() < 1e-15, "{found}");
        // Right side 2 r^2 - 1: u = (2 r^2 - r^4) / 8 and a constant.
        let found = along_glue(density(2, 0), density(2, 0));
        let by_hand = 2.0 / PI * (2.0 * (2.0 / 6.0 - 1.0 / 8.0) - (2.0 / 4.0 - 1.0 / 6.0)) / 8.0;
        assert!((found - by_hand).abs() < 1e-15, "{found} {by_hand}");
    }

    #[test]
    fn a_sheets_impedances_are_symmetric_and_positive() {
        for m in [0, 1, 3] {
            let orders: Vec<_> = (if m == 0 { 2 } else { m }..15).step_by(2).collect();
            let all = DMatrix::from_fn(orders.len(), orders.len(), |i, j| {
                along_glue(density(orders[i], m), density(orders[j], m))
            });
            assert!((&all - all.transpose()).amax() < 1e-9 * all.amax(), "{m}: {all}");
            assert!(all.symmetric_eigenvalues().min() > 0.0, "{m}");
        }
    }

    /// Spreading on both sides (Holm), and two contacts: an equipotential of glue takes up current as an equipotential pad.
    #[test]
    fn a_dot_between_half_spaces_is_twice_holms_spreading() {
        let half_space = DiscSelf::new(0.002, 0.3, |_| 0.0);
        let basis = DiscBasis::of_degree(4);
        let glue = Glue { basis, upper: &half_space, lower: &half_space, even: 1.0, contact_ohm: 1e-3, sheet_s: 1e4 };
        let resistance = |glue: &Glue<'_>| 1.0 / Joint::new(glue).impedance_ohm.try_inverse().unwrap()[(0, 0)];
        let holm = 2.0 / (4.0 * 0.3 * 0.002);
        assert!((resistance(&glue) / holm - 1.0).abs() < 4e-3, "{}", resistance(&glue) / holm);
        // Glue that carries nothing along itself: by symmetry the same density on both faces, with both resistances.
        let even = resistance(&Glue { sheet_s: 1e-9, ..glue });
        assert!((even / holm - 1.0).abs() < 4e-3, "{}", even / holm);
    }

    #[test]
    fn what_is_above_the_basis_is_what_makes_the_least_heat() {
        let [upper, lower] = [0.3, 0.05].map(|sigma| DiscSelf::new(0.002, sigma, |_| 0.0));
        let of = |degree| {
            let basis = DiscBasis::of_degree(degree);
            let glue = Glue { basis, upper: &upper, lower: &lower, even: 1.0, contact_ohm: 20.0, sheet_s: 1e-3 };
            1.0 / Joint::new(&glue).impedance_ohm.try_inverse().unwrap()[(0, 0)]
        };
        // The basis of degree 2 with ten orders above it is that of degree 4 with eight.
        assert!((of(2) / of(4) - 1.0).abs() < 2e-3, "{} {}", of(2), of(4));
    }
}
