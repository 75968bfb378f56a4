//! Spots on a slab: points of the kernel's and the pads' tables, with the tables' own derivatives.

use super::disc::DiscBasis;
use super::green::Image;
use super::image::ImageGrid;
use super::{Slab, from_corner};
use crate::forward::spots::{Between, MOST_PLACES, Spot, SpotFields};
use crate::space::Place;

/// Spots of a slab.
#[derive(Debug)]
pub(super) struct SlabSpots {
    slab: Slab,
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
        Self { slab, local_ohm }
    }

    fn corner_m(&self, spot: &Spot) -> [f64; 2] {
        from_corner(self.slab.size_m, [spot.place_m[0], spot.place_m[1]])
    }

    /// The kernel of the top between two places from the corner; of a place with itself without its singular part.
    fn kernel(&self, a: [f64; 2], b: [f64; 2], same: bool) -> Between {
        let mut field = self.slab.top.smooth(a, b);
        let images = self.slab.top.images(a, b, 0.0);
        for image in images.iter().filter(|image| !(same && image.in_place())) {
            self.add_near(image, a, b, &mut field);
        }
        field
    }

    fn add_near(&self, image: &Image, a: [f64; 2], b: [f64; 2], field: &mut Between) {
        let at = image.of(b);
        let apart = [0, 1].map(|axis| a[axis] - at[axis]);
        let distance_m = apart[0].hypot(apart[1]);
        let [ohm, ohm_per_m] = self.slab.top.near(distance_m);
        field.ohm += ohm;
        for (axis, apart_m) in apart.into_iter().enumerate() {
            let slope = ohm_per_m * apart_m / distance_m.max(f64::MIN_POSITIVE);
            field.by_first[axis] += slope;
            field.by_second[axis] -= slope * image.sign()[axis];
        }
    }
}

impl SpotFields for SlabSpots {
    fn spot(&self, place_m: Place) -> Spot {
        let (place_m, along) = self.footing(place_m);
        let corner_m = from_corner(self.slab.size_m, [place_m[0], place_m[1]]);
        let pads = &self.slab.pads;
        let sampled = pads.sample_with_slopes(corner_m);
        let electrodes = pads.electrodes();
        let fields = |all: &[f32]| all[..electrodes].iter().map(|ohm| f64::from(*ohm)).collect();
        let square: f64 = sampled[0][electrodes..].iter().map(|value| f64::from(*value).powi(2)).sum();
        Spot {
            place_m,
            along,
            electrodes_ohm: fields(&sampled[0]),
            slopes_ohm_per_m: [fields(&sampled[1]), fields(&sampled[2])],
            own_ohm: self.local_ohm + self.kernel(corner_m, corner_m, true).ohm - square,
            inner: sampled.map(|mut all| all.split_off(electrodes)),
            share: 1.0,
            ..Spot::default()
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

    fn between(&self, a: &Spot, b: &Spot) -> Between {
        let mut field = self.kernel(self.corner_m(a), self.corner_m(b), false);
        field.ohm -= dot(&a.inner[0], &b.inner[0]);
        for axis in 0..2 {
            field.by_first[axis] -= dot(&a.inner[1 + axis], &b.inner[0]);
            field.by_second[axis] -= dot(&a.inner[0], &b.inner[1 + axis]);
        }
        field
    }

    fn between_ohm(&self, a: &Spot, b: &Spot) -> f64 {
        let [a_m, b_m] = [self.corner_m(a), self.corner_m(b)];
        let top = &self.slab.top;
        let images = top.images(a_m, b_m, 0.0);
        let distance_m = |image: &Image| {
            let at = image.of(b_m);
            (a_m[0] - at[0]).hypot(a_m[1] - at[1])
        };
        let near: f64 = images.iter().map(|image| top.near_ohm(distance_m(image))).sum();
        top.smooth_ohm(a_m, b_m) + near - dot(&a.inner[0], &b.inner[0])
    }
}

fn dot(a: &[f32], b: &[f32]) -> f64 {
    let (a_lanes, a_rest) = a.as_chunks::<8>();
    let (b_lanes, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0f32; 8];
    for (a, b) in a_lanes.iter().zip(b_lanes) {
        (0..8).for_each(|lane| sums[lane] += a[lane] * b[lane]);
    }
    f64::from(sums.iter().sum::<f32>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f32>())
}
