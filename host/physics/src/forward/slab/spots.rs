//! Spots on a slab: points of the kernel's and the pads' tables.
//!
//! Near a wall, where a point's field has no slope across it, a spot is four points that have the means and the second moments of
//! the contact's disc, or of what the wall leaves of it. They part from the middle between two radii and one from the wall.

use super::cut::CutDisc;
use super::disc::DiscBasis;
use super::image::ImageGrid;
use super::uneven::uneven_ohm;
use super::{Slab, from_corner};
use crate::forward::spots::{MOST_PLACES, Spot, SpotFields, dot};
use crate::space::Place;

/// Points of a disc of radius one with its second moments.
const POINTS: [[f64; 2]; 4] = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]];

/// Spots of a slab.
#[derive(Debug)]
pub(super) struct SlabSpots {
    slab: Slab,
    radius_m: f64,
    /// Field of a spot's own current but for walls, layers far below and pads (ohm).
    local_ohm: f64,
}

impl SlabSpots {
    /// Spots that stand for contacts of a radius.
    pub fn new(slab: Slab, radius_m: f64) -> Self {
        let own = slab.top.disc_self(radius_m);
        // A conductance at which half of the voltage falls inside the layer: between even and crowded current.
        let spreading_s = slab.detector.layers.last().map_or(1.0, |layer| 4.0 * layer.top_s_per_m * radius_m);
        let basis = DiscBasis::of_degree(0);
        let local_ohm = (own.reduced(basis, 1.0, spreading_s)[(0, 0)] - 1.0) / spreading_s;
        Self { slab, radius_m, local_ohm }
    }

    /// The points that stand for a contact about a place from the corner, and its share on the detector.
    fn points(&self, at_m: [f64; 2]) -> (Vec<[f64; 2]>, f64) {
        let part = [0, 1].map(|axis| {
            let radii = at_m[axis].min(self.slab.size_m[axis] - at_m[axis]) / self.radius_m;
            let part = (2.0 - radii).clamp(0.0, 1.0);
            1.0 - part * part * (3.0 - 2.0 * part)
        });
        let apart_m = self.radius_m * (1.0 - part[0] * part[1]);
        if apart_m <= 0.0 {
            return (vec![at_m], 1.0);
        }
        let cut = CutDisc::new(self.slab.size_m, at_m, self.radius_m);
        let place = |point: [f64; 2]| {
            let [x, y] = cut.map_or(point, |cut| cut.map(point));
            [at_m[0] + apart_m * x, at_m[1] + apart_m * y]
        };
        (POINTS.map(place).into(), cut.map_or(1.0, |cut| cut.share()))
    }

    /// All fields of the pads, means over points.
    fn sample(&self, points: &[[f64; 2]]) -> Vec<f32> {
        let pads = &self.slab.pads;
        let (mut sums, mut sample) = (vec![0.0; pads.columns()], vec![0.0; pads.columns()]);
        let weight = 1.0 / points.len() as f32;
        for point in points {
            pads.sample(*point, &mut sample);
            sums.iter_mut().zip(&sample).for_each(|(sum, value)| *sum += weight * value);
        }
        sums
    }

    /// The kernel of the top between two places from the corner (ohm); of a place with itself without its singular part.
    fn kernel_ohm(&self, a: [f64; 2], b: [f64; 2], same: bool) -> f64 {
        let top = &self.slab.top;
        top.smooth_ohm(a, b) + top.images_ohm(&top.images(a, b, 0.0), same, a, b)
    }
}

impl SpotFields for SlabSpots {
    fn spot(&self, place_m: Place) -> Spot {
        let (place_m, _) = self.footing(place_m);
        let corner_m = from_corner(self.slab.size_m, [place_m[0], place_m[1]]);
        let (points, share) = self.points(corner_m);
        let middle_m = [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / points.len() as f64);
        let mut sampled = self.sample(&points);
        let inner = sampled.split_off(self.slab.pads.electrodes());
        let square: f64 = inner.iter().map(|value| f64::from(*value).powi(2)).sum();
        let uneven = self.slab.uneven.as_ref().map(|uneven| uneven.place(middle_m));
        let even_ohm = self.local_ohm / share.sqrt() + self.kernel_ohm(middle_m, middle_m, true);
        Spot {
            place_m,
            electrodes_ohm: sampled.into_iter().map(f64::from).collect(),
            own_ohm: uneven_ohm(even_ohm, uneven.as_ref(), uneven.as_ref()) - square,
            share,
            uneven,
            inner,
            middle_m,
            joined: Vec::new(),
        }
    }

    fn footing(&self, place_m: Place) -> (Place, [Place; 2]) {
        let half_m = self.slab.size_m.map(|size_m| size_m / 2.0);
        let [x_m, y_m] = [0, 1].map(|axis| place_m[axis].clamp(-half_m[axis], half_m[axis]));
        ([x_m, y_m, 0.0], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    }

    fn places_m(&self, count: usize) -> Vec<Place> {
        let mesh = ImageGrid::new(self.slab.size_m, count.min(MOST_PLACES)).mesh();
        mesh.nodes_m.iter().map(|[x_m, y_m]| [*x_m, *y_m, 0.0]).collect()
    }

    fn between_ohm(&self, a: &Spot, b: &Spot) -> f64 {
        let even_ohm = self.kernel_ohm(a.middle_m, b.middle_m, false);
        uneven_ohm(even_ohm, a.uneven.as_ref(), b.uneven.as_ref()) - dot(&a.inner, &b.inner)
    }
}
