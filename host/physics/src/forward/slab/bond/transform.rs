//! Means of the slab's modes under the densities of discs, in closed form.
//!
//! A density of radial order `n` has the transform `2 i^n J_(n+1)(k a) / (k a)`, times the cosine or sine of `m` times the wave's angle. A
//! product of two cosines is a sum of four waves; put together by their parity, what is left of them are products of cosines and sines.

use nalgebra::DMatrix;

use crate::forward::slab::disc::DiscBasis;
use crate::forward::slab::driving::Mode;
use crate::forward::slab::spline::Grid;

/// `modes x (discs x densities)`, for discs of one radius about places from the corner (m).
pub(super) fn means(
    basis: &DiscBasis,
    centres_m: &[[f64; 2]],
    radius_m: f64,
    grid: &Grid,
    modes: &[Mode],
) -> DMatrix<f64> {
    let shapes = shapes(basis, radius_m, grid, modes);
    let size = basis.len();
    let mut all = DMatrix::zeros(modes.len(), centres_m.len() * size);
    for (disc, centre_m) in centres_m.iter().enumerate() {
        let waves = [0, 1].map(|axis| -> Vec<[f64; 2]> {
            let wave = |mode| (grid.wave_number(axis, mode) * centre_m[axis]).sin_cos();
            (0..=grid.modes(axis)).map(wave).map(|(sin, cos)| [cos, sin]).collect()
        });
        for (d, density) in basis.densities().iter().enumerate() {
            // Of x and y, whether the sine is left: odd orders turn one of them, the density's sine both.
            let odd = density.n % 2 == 1;
            let (x, y) = (usize::from(odd != density.sine), usize::from(density.sine));
            let column = all.column_mut(disc * size + d);
            for ((value, mode), shape) in column.into_iter().zip(modes).zip(shapes.column(d)) {
                *value = shape * waves[0][mode.m][x] * waves[1][mode.n][y];
            }
        }
    }
    all
}

/// What does not hang on the place, with its sign: `modes x densities`.
fn shapes(basis: &DiscBasis, radius_m: f64, grid: &Grid, modes: &[Mode]) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(modes.len(), basis.len());
    for (row, mode) in modes.iter().enumerate() {
        let [kx, ky] = [grid.wave_number(0, mode.m), grid.wave_number(1, mode.n)];
        let (ka, angle) = (kx.hypot(ky) * radius_m, ky.atan2(kx));
        let bessel: Vec<f64> = (0..=basis.degree())
            .map(|n| match (n, ka > 0.0) {
                (_, true) => 2.0 * libm::jn(n as i32 + 1, ka) / ka,
                (0, false) => 1.0,
                _ => 0.0,
            })
            .collect();
        for (d, density) in basis.densities().iter().enumerate() {
            let turned = angle * density.m as f64;
            let around = if density.sine { turned.sin() } else { turned.cos() };
            let sign = if density.n.div_ceil(2).is_multiple_of(2) != (density.sine && density.n.is_multiple_of(2)) {
                1.0
            } else {
                -1.0
            };
            all[(row, d)] = sign * bessel[density.n] * around;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_those_that_points_give() {
        let (basis, fine) = (DiscBasis::of_degree(4), DiscBasis::of_degree(14));
        let grid = Grid::new([0.06, 0.04], 0.002);
        let modes: Vec<_> =
            [[0, 0], [3, 0], [0, 5], [7, 2], [4, 9]].into_iter().map(|[m, n]| Mode { m, n, amplitude: 1.0 }).collect();
        let (centre_m, radius_m) = ([0.017, 0.0123], 0.004);
        let found = means(basis, &[centre_m], radius_m, &grid, &modes);
        let nodes = fine.nodes_m(centre_m, radius_m);
        for (row, mode) in modes.iter().enumerate() {
            let at = |node: &[f64; 2]| {
                (grid.wave_number(0, mode.m) * node[0]).cos() * (grid.wave_number(1, mode.n) * node[1]).cos()
            };
            let values = DMatrix::from_iterator(nodes.len(), 1, nodes.iter().map(at));
            let expected = fine.weights() * values;
            for (d, density) in basis.densities().iter().enumerate() {
                let same = fine.densities().iter().position(|other| other == density).unwrap();
                let off = found[(row, d)] - expected[same];
                assert!(off.abs() < 1e-9, "{row} {density:?}: {} {}", found[(row, d)], expected[same]);
            }
        }
    }
}
