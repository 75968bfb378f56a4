//! Spots on a slab: points of the kernel's and the pads' tables, with the tables' own derivatives.
//!
//! Near a wall, where a point's field has no slope across it, a spot is four points that have the means and the second moments of
//! the contact's disc, or of what the wall leaves of it. They part from the middle between two radii and one from the wall.

use super::cut::CutDisc;
use super::disc::DiscBasis;
use super::green::Image;
use super::image::ImageGrid;
use super::{Slab, from_corner};
use crate::forward::spots::{Between, MOST_PLACES, Spot, SpotFields, dot};
use crate::space::Place;

/// Points of a disc of radius one with its second moments.
const POINTS: [[f64; 2]; 4] = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]];
/// Way over which the points' derivatives are taken, in radii.
const DIFFERENCE: f64 = 1e-4;

/// A point (from the corner, m), and how it moves with the place of its spot along both directions.
#[derive(Clone, Copy, Debug)]
struct MovingPoint {
    at_m: [f64; 2],
    by: [[f64; 2]; 2],
}

impl MovingPoint {
    fn middle(points: &[Self]) -> Self {
        let mean = |of: &dyn Fn(&Self) -> f64| points.iter().map(of).sum::<f64>() / points.len() as f64;
        Self {
            at_m: [0, 1].map(|axis| mean(&|point| point.at_m[axis])),
            by: [0, 1].map(|by| [0, 1].map(|axis| mean(&|point| point.by[by][axis]))),
        }
    }
}

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

    /// The points with their derivatives by the place along both directions, and the share with its.
    fn moving_points(&self, at_m: [f64; 2]) -> (Vec<MovingPoint>, [f64; 3]) {
        let (points, share) = self.points(at_m);
        if points.len() == 1 {
            return (vec![MovingPoint { at_m, by: [[1.0, 0.0], [0.0, 1.0]] }], [1.0, 0.0, 0.0]);
        }
        let mut moving: Vec<_> = points.iter().map(|at_m| MovingPoint { at_m: *at_m, by: [[0.0; 2]; 2] }).collect();
        let mut shares = [share, 0.0, 0.0];
        for axis in 0..2 {
            let moved = |way: f64| {
                let mut at_m = at_m;
                at_m[axis] = (at_m[axis] + way * DIFFERENCE * self.radius_m).clamp(0.0, self.slab.size_m[axis]);
                at_m
            };
            let (low_m, high_m) = (moved(-1.0), moved(1.0));
            let per_m = 1.0 / (high_m[axis] - low_m[axis]);
            let ((low, low_share), (high, high_share)) = (self.points(low_m), self.points(high_m));
            // At the onset one of the two may still be a point.
            let of = |points: &[[f64; 2]], i: usize| points[i.min(points.len() - 1)];
            for (i, point) in moving.iter_mut().enumerate() {
                point.by[axis] = [0, 1].map(|to| per_m * (of(&high, i)[to] - of(&low, i)[to]));
            }
            shares[1 + axis] = per_m * (high_share - low_share);
        }
        (moving, shares)
    }

    /// All fields of the pads, means over points, with their derivatives by the place.
    fn sample(&self, points: &[MovingPoint]) -> [Vec<f32>; 3] {
        let mut sums: Option<[Vec<f32>; 3]> = None;
        let weight = 1.0 / points.len() as f32;
        for point in points {
            let [values, by_x, by_y] = self.slab.pads.sample_with_slopes(point.at_m);
            let moved = point.by.map(|[x, y]| {
                let along = |(a, b): (&f32, &f32)| weight * (x as f32 * a + y as f32 * b);
                by_x.iter().zip(&by_y).map(along).collect::<Vec<_>>()
            });
            let [first, second] = moved;
            let all = [values.iter().map(|value| weight * value).collect(), first, second];
            match &mut sums {
                None => sums = Some(all),
                Some(sums) => sums.iter_mut().zip(&all).for_each(|(sums, all)| {
                    sums.iter_mut().zip(all).for_each(|(sum, value)| *sum += value);
                }),
            }
        }
        sums.unwrap_or_default()
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
        let (points, share) = self.moving_points(corner_m);
        let sampled = self.sample(&points);
        let electrodes = self.slab.pads.electrodes();
        let middle = MovingPoint::middle(&points);
        let fields = |all: &[f32]| all[..electrodes].iter().map(|ohm| f64::from(*ohm)).collect();
        let square: f64 = sampled[0][electrodes..].iter().map(|value| f64::from(*value).powi(2)).sum();
        Spot {
            place_m,
            along,
            electrodes_ohm: fields(&sampled[0]),
            slopes_ohm_per_m: [fields(&sampled[1]), fields(&sampled[2])],
            own_ohm: self.local_ohm / share[0].sqrt() + self.kernel(middle.at_m, middle.at_m, true).ohm - square,
            inner: sampled.map(|mut all| all.split_off(electrodes)),
            share: share[0],
            share_slopes_per_m: [share[1], share[2]],
            middle_m: middle.at_m,
            middle_by: middle.by,
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
        let mut field = self.kernel(a.middle_m, b.middle_m, false);
        let chain = |slopes: [f64; 2], by: [[f64; 2]; 2]| by.map(|[x, y]| slopes[0] * x + slopes[1] * y);
        field.by_first = chain(field.by_first, a.middle_by);
        field.by_second = chain(field.by_second, b.middle_by);
        field.ohm -= dot(&a.inner[0], &b.inner[0]);
        for axis in 0..2 {
            field.by_first[axis] -= dot(&a.inner[1 + axis], &b.inner[0]);
            field.by_second[axis] -= dot(&a.inner[0], &b.inner[1 + axis]);
        }
        field
    }

    fn between_ohm(&self, a: &Spot, b: &Spot) -> f64 {
        let [a_m, b_m] = [a.middle_m, b.middle_m];
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
