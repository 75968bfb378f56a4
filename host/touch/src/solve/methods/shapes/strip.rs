//! A strip of contact along a line or a circle, and what of it each node of an image has.
//!
//! Of a node's area, a strip of width `w` covers `S((w/2 - d) / b) - S((-w/2 - d) / b)`: `d` is the node's distance from the strip's middle line and
//! `S` the integral of a smooth bump of half width `b`, the distance of nodes. So conductances change smoothly with all parameters, and
//! their sum does not depend on where the strip lies between the nodes. The bump, and the node's cell over which current is spread evenly,
//! make the strip wider than it is: by `12 (b^2 / 7 + h^2 / 12)` in the square of its width, the variance of both. So it is laid out narrower
//! by about that, and a line shorter by what the bump adds at its ends. What remains was measured: see [`super`].

use std::f64::consts::{PI, TAU};

use tactomo_physics::forward::ImageMesh;
use tactomo_physics::geometry::{self, Point};
use tactomo_physics::scene::Contact;

/// What a strip goes along.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Course {
    /// A line between two ends (m). They are taken as round, with the area of square ones there.
    Line([Point; 2]),
    /// A circle.
    Ring {
        /// Its middle (m).
        centre_m: Point,
        /// Its radius (m).
        radius_m: f64,
    },
}

/// A strip of contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Strip {
    /// What it goes along.
    pub course: Course,
    /// Its width (m).
    pub width_m: f64,
    /// Conductance of all of it (S), spread evenly; a part beyond an edge of the detector touches nothing.
    pub conductance_s: f64,
}

/// Where the parameters of a strip are: places (m) come first, then logarithms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    /// Number of coordinates; a circle's radius follows them.
    pub coordinates: usize,
    /// Of the width.
    pub width: usize,
    /// Of the conductance, the last one.
    pub conductance: usize,
}

impl Course {
    /// Length of a line, or of a circle (m).
    pub fn length_m(&self) -> f64 {
        match self {
            Self::Line([from, to]) => geometry::distance(*from, *to),
            Self::Ring { radius_m, .. } => TAU * radius_m,
        }
    }

    /// What of a line is within a box of these corners; a circle is all of it.
    pub fn within(&self, [low, high]: [Point; 2]) -> Self {
        let Self::Line([from, to]) = *self else { return *self };
        // Shares of the line at which it enters and leaves the box.
        let (mut enters, mut leaves) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let along = to[axis] - from[axis];
            if along != 0.0 {
                let [a, b] = [low, high].map(|corner| (corner[axis] - from[axis]) / along);
                (enters, leaves) = (enters.max(a.min(b)), leaves.min(a.max(b)));
            }
        }
        let at = |share: f64| [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis]));
        if enters < leaves { Self::Line([at(enters), at(leaves)]) } else { *self }
    }

    /// Distance of a place from it (m), a line's ends moved inwards by `inset_m`.
    fn distance_m(&self, at: Point, inset_m: f64) -> f64 {
        match self {
            Self::Line([from, to]) => {
                let share = (inset_m / self.length_m().max(f64::MIN_POSITIVE)).min(0.5);
                let inner = |a: &Point, b: &Point| [0, 1].map(|axis| a[axis] + share * (b[axis] - a[axis]));
                geometry::segment_distance(at, (inner(from, to), inner(to, from)))
            }
            Self::Ring { centre_m, radius_m } => (geometry::distance(at, *centre_m) - radius_m).abs(),
        }
    }
}

impl Strip {
    /// So many discs in a row along it, which conduct as much together.
    pub fn discs(&self, count: usize) -> Vec<Contact> {
        let share = |k: usize| (k as f64 + 0.5) / count as f64;
        let at = |k: usize| match self.course {
            Course::Line([from, to]) => [0, 1].map(|axis| from[axis] + share(k) * (to[axis] - from[axis])),
            Course::Ring { centre_m: [x_m, y_m], radius_m } => {
                let (sin, cos) = (TAU * share(k)).sin_cos();
                [x_m + radius_m * cos, y_m + radius_m * sin]
            }
        };
        let conductance_s = self.conductance_s / count as f64;
        let disc = |[x_m, y_m]: Point| Contact::flat(x_m, y_m, 0.5 * self.width_m, conductance_s);
        (0..count).map(at).map(disc).collect()
    }

    /// Whether it goes along a line.
    pub fn is_line(&self) -> bool {
        matches!(self.course, Course::Line(_))
    }

    /// Where its parameters are.
    pub(super) fn layout(&self) -> Layout {
        match self.course {
            Course::Line(_) => Layout { coordinates: 4, width: 4, conductance: 5 },
            Course::Ring { .. } => Layout { coordinates: 2, width: 3, conductance: 4 },
        }
    }

    /// Number of its parameters.
    pub fn parameters(&self) -> usize {
        self.layout().conductance + 1
    }

    /// The strip after a change of its parameters.
    pub(super) fn moved(&self, by: &[f64]) -> Self {
        let layout = self.layout();
        let along = |at: Point, first: usize| [0, 1].map(|axis| at[axis] + by[first + axis]);
        let course = match self.course {
            Course::Line([from, to]) => Course::Line([along(from, 0), along(to, 2)]),
            Course::Ring { centre_m, radius_m } => {
                Course::Ring { centre_m: along(centre_m, 0), radius_m: radius_m * by[layout.coordinates].exp() }
            }
        };
        let width_m = self.width_m * by[layout.width].exp();
        Self { course, width_m, conductance_s: self.conductance_s * by[layout.conductance].exp() }
    }
}

/// The nodes that strips are laid on.
#[derive(Clone, Debug)]
pub(super) struct Ground {
    nodes_m: Vec<Point>,
    areas_m2: Vec<f64>,
    /// Distance of the nodes around each (m).
    steps_m: Vec<f64>,
}

impl Ground {
    /// The ground of a flat mesh.
    pub fn new(mesh: &ImageMesh) -> Self {
        // From the triangles around each: of a grid, the root of twice their area.
        let mut sums = vec![(0.0, 0.0); mesh.nodes_m.len()];
        for (triangle, area_m2) in mesh.triangles.iter().zip(mesh.triangle_areas_m2()) {
            for node in triangle {
                let (sum_m2, count) = &mut sums[*node as usize];
                (*sum_m2, *count) = (*sum_m2 + 2.0 * area_m2, *count + 1.0);
            }
        }
        let step_m = |(sum_m2, count): (f64, f64)| (sum_m2 / count.max(1.0)).sqrt();
        Self {
            nodes_m: mesh.nodes_m.clone(),
            areas_m2: mesh.node_areas_m2.clone(),
            steps_m: sums.into_iter().map(step_m).collect(),
        }
    }

    /// Each node's place (m) and area (m2).
    pub fn nodes(&self) -> impl Iterator<Item = (Point, f64)> {
        self.nodes_m.iter().copied().zip(self.areas_m2.iter().copied())
    }

    /// Conductance that a strip gives each node (S).
    pub fn conductances_s(&self, strip: &Strip) -> Vec<f64> {
        (0..self.nodes_m.len()).map(|node| self.conductance_s(strip, node)).collect()
    }

    /// Conductance per area that a strip gives each node (S/m2).
    pub fn image_s_per_m2(&self, strip: &Strip) -> Vec<f32> {
        let density = |(s, area_m2): (f64, &f64)| (s / area_m2) as f32;
        self.conductances_s(strip).into_iter().zip(&self.areas_m2).map(density).collect()
    }

    /// Conductance that a strip gives a node (S).
    pub fn conductance_s(&self, strip: &Strip, node: usize) -> f64 {
        let step_m = self.steps_m[node];
        let spread_m2 = (12.0 / 7.0 + 1.0) * step_m * step_m;
        let width_m = strip.width_m.powi(2) / (strip.width_m.powi(2) + spread_m2).sqrt();
        // Round ends of that width have pi / 8 of it as area beyond each; the bump adds pi b^2 / 14.
        let inset_m = PI / 8.0 * width_m + PI / 14.0 * step_m * step_m / width_m.max(step_m);
        let distance_m = strip.course.distance_m(self.nodes_m[node], inset_m);
        let half_m = 0.5 * width_m;
        if distance_m > half_m + step_m {
            return 0.0;
        }
        let covered = step((half_m - distance_m) / step_m) - step((-half_m - distance_m) / step_m);
        covered * self.areas_m2[node] * strip.conductance_s / (width_m * strip.course.length_m())
    }
}

/// The integral of the bump `15/16 (1 - u^2)^2` from -1: from 0 to 1, twice smooth.
fn step(u: f64) -> f64 {
    let u = u.clamp(-1.0, 1.0);
    0.5 + u * (15.0 - u * u * (10.0 - 3.0 * u * u)) / 16.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactomo_physics::detector::Detector;
    use tactomo_physics::forward::{ForwardModel, Slab};

    fn strips() -> [Strip; 3] {
        let line = Course::Line([[-0.0131, 0.0042], [0.0119, -0.0073]]);
        let ring = Course::Ring { centre_m: [0.0023, -0.0031], radius_m: 0.0127 };
        [(line, 0.0035), (ring, 0.0035), (line, 0.009)].map(|(course, width_m)| Strip {
            course,
            width_m,
            conductance_s: 2e-3,
        })
    }

    #[test]
    fn conductance_centre_and_breadth_are_kept() {
        let slab = Slab::new(&Detector::preset(Detector::DEFAULT).unwrap()).unwrap();
        let ground = Ground::new(slab.image_mesh());
        for strip in strips() {
            let image_s = ground.conductances_s(&strip);
            let total_s: f64 = image_s.iter().sum();
            assert!((total_s / 2e-3 - 1.0).abs() < 2e-3, "{total_s} of {strip:?}");
            let middle_m = match strip.course {
                Course::Line([from, to]) => [0, 1].map(|axis| 0.5 * (from[axis] + to[axis])),
                Course::Ring { centre_m, .. } => centre_m,
            };
            for axis in 0..2 {
                let mean_m = image_s.iter().zip(&ground.nodes_m).map(|(s, at)| s * at[axis]).sum::<f64>() / total_s;
                assert!((mean_m - middle_m[axis]).abs() < 3e-5, "{mean_m} for {middle_m:?} of {strip:?}");
            }
            // With the cells that nodes stand for, the mean square distance from the middle line is that of the strip.
            let cell_m2 = ground.steps_m[1000].powi(2) / 12.0;
            let across = |at: &Point| match strip.course {
                Course::Line([from, to]) => geometry::cross(from, to, *at) / strip.course.length_m(),
                Course::Ring { centre_m, radius_m } => geometry::distance(*at, centre_m) - radius_m,
            };
            let squares: f64 = image_s.iter().zip(&ground.nodes_m).map(|(s, at)| s * across(at).powi(2)).sum();
            let breadth_m = (12.0 * (squares / total_s + cell_m2)).sqrt();
            assert!((breadth_m / strip.width_m - 1.0).abs() < 0.12, "{breadth_m} of {strip:?}");
        }
    }

    #[test]
    fn lines_end_at_the_edges() {
        let bounds_m = [[-0.03, -0.02], [0.03, 0.02]];
        let line = Course::Line([[-0.05, 0.0], [0.01, 0.03]]);
        let Course::Line([from, to]) = line.within(bounds_m) else { panic!("{line:?}") };
        assert!(geometry::distance(from, [-0.03, 0.01]) < 1e-12 && geometry::distance(to, [-0.01, 0.02]) < 1e-12);
        let inside = Course::Line([[-0.01, 0.0], [0.01, 0.01]]);
        assert_eq!(inside.within(bounds_m), inside);
    }

    #[test]
    fn parameters_change_what_they_say() {
        for strip in strips() {
            let layout = strip.layout();
            let mut by = vec![0.0; strip.parameters()];
            by[0] = 1e-3;
            by[layout.width] = 0.5;
            by[layout.conductance] = -1.0;
            let moved = strip.moved(&by);
            assert!(((moved.width_m / strip.width_m).ln() - 0.5).abs() < 1e-12);
            assert!(((moved.conductance_s / strip.conductance_s).ln() + 1.0).abs() < 1e-12);
            let first_m = |strip: &Strip| match strip.course {
                Course::Line([from, _]) => from,
                Course::Ring { centre_m, .. } => centre_m,
            };
            assert!((first_m(&moved)[0] - first_m(&strip)[0] - 1e-3).abs() < 1e-12);
        }
    }
}
