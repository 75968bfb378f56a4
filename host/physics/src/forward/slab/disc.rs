//! Current densities on a disc, in Zernike polynomials.
//!
//! `phi_nm = R_n^m(rho) {cos, sin}(m theta) / (pi a^2)`. The transform of each is a single Bessel function,
//! `2 J_(n+1)(k a) / (k a)`, so that the self-impedance of a disc on the slab is a one-dimensional integral, and its
//! singular part, that of the half-space, a quotient of Gamma functions. A density that is nearly singular at the edge
//! needs high radial orders, but these only act on the disc itself: they are eliminated there (see [`DiscSelf::reduced`]).

use std::f64::consts::PI;
use std::sync::{LazyLock, OnceLock};

use nalgebra::{Cholesky, DMatrix};

use super::quadrature::{gauss_legendre, panels};

/// Radial orders above the degree of a basis that are eliminated on the disc.
pub(super) const LOCAL_ORDERS: usize = 10;

/// Highest radial order of which the self-impedance is known.
pub(super) const MAX_ORDER: usize = 31;

/// Orders up to which the layers' part of the self-impedance is integrated; above it only the half-space's counts.
const LAYERED_ORDER: usize = MAX_DEGREE;

/// Share of the layers' part of the self-impedance that is left out, for each point of the quadrature.
const NEGLIGIBLE: f64 = 1e-8;

/// Highest degree of a basis.
pub(super) const MAX_DEGREE: usize = 14;

/// Radius of a disc, in distances from another, below which it acts by its first densities only: of degree 1, or 2.
const FAR: f64 = 0.12;
const NEAR: f64 = 0.25;

/// One density: radial order, angular order, and whether it is the sine.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Density {
    pub n: usize,
    pub m: usize,
    pub sine: bool,
}

/// All densities up to a degree, and points that integrate them; the uniform one comes first.
#[derive(Clone, Debug)]
pub(super) struct DiscBasis {
    degree: usize,
    densities: Vec<Density>,
    /// Points on the unit disc.
    nodes: Vec<[f64; 2]>,
    /// `densities x nodes`: weight times density, so that a row applied to a field gives its mean under the density.
    weights: DMatrix<f64>,
}

impl DiscBasis {
    /// The basis of a degree, for fields that are polynomials of about that degree over the disc.
    fn new(degree: usize) -> Self {
        let densities: Vec<_> = (0..=degree)
            .flat_map(|n| (0..=n).filter(move |m| (n - m) % 2 == 0).map(move |m| (n, m)))
            .flat_map(|(n, m)| [(false, true), (true, m > 0)].map(|(sine, is)| is.then_some(Density { n, m, sine })))
            .flatten()
            .collect();
        let around = 2 * degree + 1;
        let rings = gauss_legendre(degree / 2 + 1);
        let points: Vec<_> = rings
            .iter()
            .enumerate()
            .flat_map(|(ring, &[u, w])| {
                (0..around).map(move |i| {
                    // Every other ring is turned, so that no direction is preferred.
                    let theta = 2.0 * PI * (i as f64 + 0.5 * (ring % 2) as f64) / around as f64;
                    (u.sqrt(), theta, w / around as f64)
                })
            })
            .collect();
        let weights = DMatrix::from_fn(densities.len(), points.len(), |d, q| {
            let (rho, theta, weight) = points[q];
            weight * densities[d].at(rho, theta)
        });
        let nodes = points.iter().map(|(rho, theta, _)| [rho * theta.cos(), rho * theta.sin()]).collect();
        Self { degree, densities, nodes, weights }
    }

    /// The basis of a degree up to [`MAX_DEGREE`], made once.
    pub fn of_degree(degree: usize) -> &'static Self {
        static ALL: [OnceLock<DiscBasis>; MAX_DEGREE + 1] = [const { OnceLock::new() }; MAX_DEGREE + 1];
        let degree = degree.min(MAX_DEGREE);
        ALL[degree].get_or_init(|| Self::new(degree))
    }

    /// The degree, of at most this one's, that another disc at a distance sees; `radius` is this one's in distances. A density of
    /// order `n` acts there as `radius^(n + 1)`.
    pub fn degree_seen_from(&self, radius: f64) -> usize {
        let degree = match radius {
            ..FAR => 1,
            ..NEAR => 2,
            _ => self.degree,
        };
        degree.min(self.degree)
    }

    /// Highest radial order.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// The densities.
    pub fn densities(&self) -> &[Density] {
        &self.densities
    }

    /// Number of densities.
    pub fn len(&self) -> usize {
        self.densities.len()
    }

    /// `densities x nodes`.
    pub fn weights(&self) -> &DMatrix<f64> {
        &self.weights
    }

    /// The points on a disc (m).
    pub fn nodes_m(&self, centre_m: [f64; 2], radius_m: f64) -> Vec<[f64; 2]> {
        self.mapped_nodes_m(centre_m, radius_m, |node| node)
    }

    /// The same points, moved within the unit disc.
    pub fn mapped_nodes_m(
        &self,
        centre_m: [f64; 2],
        radius_m: f64,
        map: impl Fn([f64; 2]) -> [f64; 2],
    ) -> Vec<[f64; 2]> {
        let place = |node: [f64; 2]| [0, 1].map(|axis| centre_m[axis] + radius_m * node[axis]);
        self.nodes.iter().map(|node| place(map(*node))).collect()
    }
}

impl Density {
    /// Value at a point of the unit disc, without `1 / (pi a^2)`.
    pub fn at(self, rho: f64, theta: f64) -> f64 {
        let angle = self.m as f64 * theta;
        radial(self.n, self.m, rho) * if self.sine { angle.sin() } else { angle.cos() }
    }
}

/// Zernike's radial polynomial `R_n^m`.
fn radial(n: usize, m: usize, rho: f64) -> f64 {
    radial_terms(n, m).map(|(power, factor)| factor * rho.powi(power as i32)).sum()
}

/// Powers of the radius in `R_n^m`, and their factors.
pub(super) fn radial_terms(n: usize, m: usize) -> impl Iterator<Item = (usize, f64)> {
    let factorial = |n: usize| (1..=n).map(|i| i as f64).product::<f64>();
    (0..=(n - m) / 2).map(move |s| {
        let sign = if s % 2 == 0 { 1.0 } else { -1.0 };
        let below = factorial(s) * factorial((n + m) / 2 - s) * factorial((n - m) / 2 - s);
        (n - 2 * s, sign * factorial(n - s) / below)
    })
}

/// Self-impedance of a disc, without the smooth part of the kernel: by radial orders, for angular order 0.
#[derive(Clone, Debug)]
pub(super) struct DiscSelf(Vec<f64>);

impl DiscSelf {
    /// For a disc of radius `a_m` on a surface of conductivity `sigma`; `excess` is what the kernel by the logarithm of the wave
    /// number has over the half-space's `1 / (sigma k)`, as a share of that.
    pub fn new(a_m: f64, sigma: f64, excess: impl Fn(f64) -> f64) -> Self {
        let mut integrals = HALF_SPACE.iter().map(|w| w / (sigma * a_m)).collect::<Vec<_>>();
        let width = MAX_ORDER + 1;
        let ln_a = a_m.ln();
        for point in HANKEL.iter() {
            let rest = point.weight * excess(point.ln_at - ln_a) / (sigma * a_m * point.at * point.at);
            if rest.abs() * sigma * a_m < NEGLIGIBLE {
                continue;
            }
            for (n, bessel) in point.bessel.iter().enumerate() {
                for other in ((n % 2)..=n).step_by(2) {
                    integrals[n * width + other] += rest * bessel * point.bessel[other];
                }
            }
        }
        Self(integrals)
    }

    /// Impedance between two densities of angular order 0; for others it is half of that.
    pub fn between(&self, n: usize, other: usize) -> f64 {
        let sign = if n.abs_diff(other).is_multiple_of(4) { 1.0 } else { -1.0 };
        sign * 2.0 / PI * self.0[n.max(other) * (MAX_ORDER + 1) + n.min(other)]
    }

    /// The matrix of `c (resistance + self-impedance)` over a basis, where the resistance is `1 / c` spread over the disc's area,
    /// with all orders above the basis eliminated. With `c` the conductance it stays well conditioned, however small that is.
    pub fn reduced(&self, basis: &DiscBasis, resistance: f64, scale: f64) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(basis.len(), basis.len());
        for m in 0..=basis.degree {
            let block = self.eliminated(m, basis.degree, resistance, scale).impedances;
            for (i, a) in basis.densities.iter().enumerate().filter(|(_, a)| a.m == m) {
                for (j, b) in basis.densities.iter().enumerate().filter(|(_, b)| b.m == m && b.sine == a.sine) {
                    all[(i, j)] = block[((a.n - m) / 2, (b.n - m) / 2)];
                }
            }
        }
        all
    }

    /// What a kept density of radial and angular order brings with it: radial orders and their shares, itself first, and then those above a degree,
    /// which are eliminated.
    pub fn with_higher(&self, [n, m]: [usize; 2], degree: usize, resistance: f64) -> Vec<(usize, f64)> {
        let Eliminated { orders, of_kept, .. } = self.eliminated(m, degree, resistance, 1.0);
        let higher = of_kept.column((n - m) / 2);
        std::iter::once((n, 1.0)).chain(orders.into_iter().zip(higher.iter().copied())).collect()
    }

    /// Eliminates the orders above a degree of an angular order.
    fn eliminated(&self, m: usize, degree: usize, resistance: f64, scale: f64) -> Eliminated {
        let mut orders: Vec<_> = (m..=(degree + LOCAL_ORDERS).min(MAX_ORDER)).step_by(2).collect();
        let half = if m == 0 { 1.0 } else { 0.5 };
        let full = DMatrix::from_fn(orders.len(), orders.len(), |i, j| {
            let spread = if i == j { resistance / (orders[i] + 1) as f64 } else { 0.0 };
            half * (spread + scale * self.between(orders[i], orders[j]))
        });
        let kept = (degree - m) / 2 + 1;
        let orders = orders.split_off(kept);
        let above = orders.len();
        let cross = full.view((kept, 0), (above, kept)).into_owned();
        let of_kept = match Cholesky::new(full.view((kept, kept), (above, above)).into_owned()) {
            Some(factor) => -factor.solve(&cross),
            None => DMatrix::zeros(above, kept),
        };
        Eliminated { impedances: full.view((0, 0), (kept, kept)) + cross.tr_mul(&of_kept), orders, of_kept }
    }
}

/// Impedance of an even current over a disc to itself (ohm): what [`DiscSelf`] has between its first densities.
pub(super) fn even_ohm(a_m: f64, sigma: f64, excess: impl Fn(f64) -> f64) -> f64 {
    let layers =
        |point: &HankelPoint| point.weight * excess(point.ln_at - a_m.ln()) * (point.bessel[0] / point.at).powi(2);
    2.0 / (PI * sigma * a_m) * (HALF_SPACE[0] + HANKEL.iter().map(layers).sum::<f64>())
}

/// What is left of an angular order where the radial orders above a degree are eliminated.
struct Eliminated {
    /// Impedances between those kept.
    impedances: DMatrix<f64>,
    /// Those eliminated.
    orders: Vec<usize>,
    /// What each of them is for each of those kept.
    of_kept: DMatrix<f64>,
}

/// `integral J_(n+1) J_(n'+1) / x^2 dx` for orders of equal parity, `n' <= n` (Weber and Schafheitlin).
static HALF_SPACE: LazyLock<Vec<f64>> = LazyLock::new(|| {
    let width = MAX_ORDER + 1;
    let mut all = vec![0.0; width * width];
    for n in 0..width {
        for other in ((n % 2)..=n).step_by(2) {
            let (sum, apart) = ((n + other) as i32, (n - other) as i32);
            all[n * width + other] = gamma_of_half(sum + 1)
                / (4.0 * gamma_of_half(3 - apart) * gamma_of_half(sum + 5) * gamma_of_half(3 + apart));
        }
    }
    all
});

/// `Gamma(twice / 2)` for an odd number.
fn gamma_of_half(twice: i32) -> f64 {
    let (mut at, mut value) = (1, PI.sqrt());
    while at < twice {
        value *= f64::from(at) / 2.0;
        at += 2;
    }
    while at > twice {
        at -= 2;
        value /= f64::from(at) / 2.0;
    }
    value
}

/// A point of the quadrature over `x = k a`, with `J_(n+1)(x)`.
struct HankelPoint {
    at: f64,
    ln_at: f64,
    weight: f64,
    bessel: [f64; LAYERED_ORDER + 1],
}

static HANKEL: LazyLock<Vec<HankelPoint>> = LazyLock::new(|| {
    let coarse = [0.0, 0.3, 0.8, 1.6, 3.0];
    let fine = (2..=14).map(|i| 3.0 * f64::from(i));
    let edges: Vec<f64> = coarse.into_iter().chain(fine).collect();
    panels(&edges, 5)
        .into_iter()
        .map(|[at, weight]| HankelPoint {
            at,
            ln_at: at.ln(),
            weight,
            bessel: std::array::from_fn(|n| libm::jn(n as i32 + 1, at)),
        })
        .collect()
});

#[cfg(test)]
mod tests {
    use super::*;

    fn half_space(radius_m: f64, sigma: f64) -> DiscSelf {
        DiscSelf::new(radius_m, sigma, |_| 0.0)
    }

    #[test]
    fn a_uniform_current_into_a_half_space_meets_its_textbook_resistance() {
        let found = half_space(0.002, 0.3).between(0, 0);
        assert!((found * 0.3 * 0.002 - 8.0 / (3.0 * PI * PI)).abs() < 1e-12);
    }

    #[test]
    fn an_equipotential_disc_has_a_spreading_resistance_of_1_over_4_sigma_a() {
        // A contact a million times better than the spreading: the density is singular at the edge, the worst case.
        let found = half_space(0.002, 0.3).reduced(DiscBasis::of_degree(4), 1e-6 / (0.3 * 0.002), 1.0);
        let inverse = found.try_inverse().unwrap();
        let resistance = 1.0 / inverse[(0, 0)];
        assert!((resistance * 4.0 * 0.3 * 0.002 - 1.0).abs() < 4e-3, "{}", resistance * 4.0 * 0.3 * 0.002);
    }

    #[test]
    fn densities_are_orthogonal_and_the_points_integrate_them() {
        for degree in [1, 3, 6] {
            let basis = DiscBasis::of_degree(degree);
            let uniform = basis.weights().row(0);
            for (d, density) in basis.densities.iter().enumerate() {
                let row = basis.weights().row(d);
                let square: f64 = row.iter().zip(uniform.iter()).map(|(a, w)| a * a / w).sum();
                let expected = 1.0 / (density.n + 1) as f64 * if density.m == 0 { 1.0 } else { 0.5 };
                assert!(row.sum().abs() < 1e-12 || d == 0);
                assert!((square - expected).abs() < 1e-12, "degree {degree}, {density:?}: {square} {expected}");
            }
        }
    }
}
