//! Two stacks of layers joined by dots of glue.
//!
//! Each stack is a slab of its own, insulated but for the dots, and exact in cosine modes. A dot is a disc on the upper stack's bottom and one
//! on the lower stack's top, each with current densities as pads and contacts have, with a sheet of glue between ([`glue`]): what enters the one
//! leaves the other. So a dot has one current `t`, which goes down through it, and on each face what bends that.
//!
//! By Thomson's principle the currents make the least heat. With `y` those that are to be eliminated (what bends the current on pads and on
//! dots, and all `t`), `K` the impedances between them and `h` the fields of electrodes `I` and contacts `J` at them, the heat is
//! `y^T K y / 2 + y^T h` and what does not hang on `y`, and the dots carry what the electrodes take up: `c^T y = -1^T I`, with `c` one for each
//! `t`. With Cholesky's `K = L L^T`, `w = L^-1 c`, `k = |w|^2` and `P = 1 - w w^T / k` what is left is
//!
//! ```text
//! contacts to contacts       N_top - X^T P X,                      X = L^-1 h(J)
//! contacts to electrodes     -X^T P Y - (X^T w) 1^T / k,           Y = L^-1 h(I)
//! electrodes to electrodes   N_pads - Y^T P Y + (1 - (Y^T w) 1^T - 1 (Y^T w)^T) / k
//! ```
//!
//! with `N_top` and `N_pads` the fields of each stack alone ([`join`]). It has the form that a slab without dots has, a kernel of the top less
//! products of smooth fields, so that all that follows from those is the same: contacts, images, spots, a driving layer that is not ideal.

mod current;
mod glue;
#[cfg(test)]
mod grid;
mod join;
#[cfg(test)]
mod tests;
mod transform;

use nalgebra::DMatrix;

pub use self::current::{DotCurrent, DotCurrents};
pub use self::glue::Face;
use self::glue::{Glue, Joint};
pub(super) use self::join::Stacks;
use super::disc::{DiscBasis, DiscSelf};
use super::driving::Covered;
use super::from_corner;
use super::green::{Image, SurfaceGreen};
use super::stacks::{bottom_surface, split_m, top_surface};
use crate::detector::Bond;
use crate::forward::uneven_place::UnevenPlace;

/// Distances of two dots' middles, in radii, up to which the near part between them has the points of a basis of so many degrees more.
const MORE_DEGREES: [(f64, usize); 3] = [(2.06, 6), (2.3, 4), (2.7, 2)];

/// The dots of a slab, with the impedances between them on each of the stacks alone.
#[derive(Clone, Debug)]
pub(super) struct Dots {
    bond: Bond,
    basis: &'static DiscBasis,
    /// From the corner (m).
    centres_m: Vec<[f64; 2]>,
    /// On the upper stack's bottom, and on the lower one's top.
    upper: DotFaces,
    lower: DotFaces,
}

/// One face of all dots.
#[derive(Clone, Debug)]
struct DotFaces {
    /// Impedances between all densities (ohm), dot by dot, of even layers and without each dot's own singular part.
    between_ohm: DMatrix<f64>,
    own: DiscSelf,
}

impl Dots {
    /// The dots between two stacks, with current densities of a degree.
    pub fn new(bond: Bond, degree: usize, [lower, upper]: [Covered<'_>; 2]) -> Self {
        let size_m = upper.size_m();
        let basis = DiscBasis::of_degree(degree);
        let centres_m: Vec<_> = bond.centres_m(size_m).iter().map(|at_m| from_corner(size_m, *at_m)).collect();
        let radius_m = bond.diameter_m / 2.0;
        let split_m = [lower, upper].map(|covered| split_m(covered.thickness_m(), size_m, radius_m));
        let kernels = [
            SurfaceGreen::new(size_m, split_m[0], &top_surface(lower)),
            SurfaceGreen::new(size_m, split_m[1], &bottom_surface(upper)),
        ];
        let [lower, upper] = kernels.map(|kernel| DotFaces {
            between_ohm: between_dots(&kernel, basis, &centres_m, radius_m),
            own: kernel.disc_self(radius_m),
        });
        Self { bond, basis, centres_m, upper, lower }
    }

    /// Radius of a dot (m).
    pub fn radius_m(&self) -> f64 {
        self.bond.diameter_m / 2.0
    }

    /// Number of dots.
    fn len(&self) -> usize {
        self.centres_m.len()
    }

    /// What a dot is made of, where the conductivity is `1 / even` times what the layers' is.
    fn joint(&self, even: f64) -> Joint {
        let area_m2 = std::f64::consts::PI * self.radius_m() * self.radius_m();
        Joint::new(&Glue {
            basis: self.basis,
            upper: &self.upper.own,
            lower: &self.lower.own,
            even,
            contact_ohm: self.bond.contact_impedance_ohm_m2 / area_m2,
            sheet_s: self.bond.sheet_conductance_s,
        })
    }
}

impl DotFaces {
    /// Impedances between all densities (ohm) where unevenness makes these places of the dots.
    fn uneven_ohm(&self, places: Option<&[UnevenPlace]>) -> DMatrix<f64> {
        let mut all = self.between_ohm.clone();
        let Some(places) = places else { return all };
        let size = all.nrows() / places.len();
        for (d, here) in places.iter().enumerate() {
            for (e, there) in places.iter().enumerate() {
                let mut block = all.view_mut((d * size, e * size), (size, size));
                block[(0, 0)] += here.correction_ohm(there);
                block *= here.inverse_root * there.inverse_root;
            }
        }
        all
    }
}

/// Impedances between the densities of all dots on one surface (ohm), without each one's own singular part.
fn between_dots(kernel: &SurfaceGreen, basis: &DiscBasis, centres_m: &[[f64; 2]], radius_m: f64) -> DMatrix<f64> {
    let size = basis.len();
    let mut all = DMatrix::zeros(centres_m.len() * size, centres_m.len() * size);
    for (d, at_m) in centres_m.iter().enumerate() {
        for (e, other_m) in centres_m[..=d].iter().enumerate() {
            let block = between_two(kernel, basis, [*at_m, *other_m], radius_m);
            all.view_mut((d * size, e * size), block.shape()).copy_from(&block);
            all.view_mut((e * size, d * size), block.shape()).tr_copy_from(&block);
        }
    }
    all
}

/// The same between two dots, or of one with its mirror images, up to the degree that they see of each other. Near dots have more points for
/// the near part of the kernel, which is steep between their rims.
fn between_two(kernel: &SurfaceGreen, basis: &DiscBasis, centres_m: [[f64; 2]; 2], radius_m: f64) -> DMatrix<f64> {
    let [at_m, other_m] = centres_m;
    let same = at_m == other_m;
    let images = kernel.images(at_m, other_m, 2.0 * radius_m);
    let apart = |image: &Image| (at_m[0] - image.of(other_m)[0]).hypot(at_m[1] - image.of(other_m)[1]) / radius_m;
    let nearest = images.iter().map(apart).filter(|apart| *apart > 0.0).fold(f64::INFINITY, f64::min);
    let degree = if same { basis.degree() } else { basis.degree_seen_from(1.0 / nearest) };
    let part = |degree: usize, value: &dyn Fn([f64; 2], [f64; 2]) -> f64| {
        let fine = DiscBasis::of_degree(degree);
        let [nodes, others] = centres_m.map(|centre_m| fine.nodes_m(centre_m, radius_m));
        let points = DMatrix::from_fn(nodes.len(), others.len(), |i, j| value(nodes[i], others[j]));
        fine.weights() * points * fine.weights().transpose()
    };
    let kept = DiscBasis::of_degree(degree).len();
    let smooth = part(degree, &|a, b| kernel.smooth_ohm(a, b));
    let more = MORE_DEGREES.into_iter().find(|(within, _)| nearest < *within).map_or(0, |(_, more)| more);
    // The densities of a lower degree are the first of those of a higher one.
    let near = part(degree + more, &|a, b| kernel.images_ohm(&images, same, a, b));
    smooth + near.view((0, 0), (kept, kept))
}
