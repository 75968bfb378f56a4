//! Contacts in an image.

use crate::solve::answer::FoundContact;
use crate::solve::fit::policy;
use tactomo_physics::detector::{Detector, Surface};
use tactomo_physics::forward::ImageMesh;
use tactomo_physics::readings::Readings;
use tactomo_physics::space::{self, Place};

/// Sums that run side by side.
const LANES: usize = 8;

/// Finds contacts in images on one mesh.
#[derive(Clone, Debug)]
pub struct Locator {
    places_m: Vec<Place>,
    surface: Option<Surface>,
    neighbours: Neighbours,
    areas_m2: Vec<f64>,
    /// Peaks nearer than this are one (m): the mean distance of electrodes, which is about what an image resolves.
    apart_m: f64,
    /// Largest reading without contact (V).
    rest_v: f64,
}

impl Locator {
    /// Makes it for a mesh and a detector.
    pub fn new(mesh: &ImageMesh, detector: &Detector) -> Self {
        let area_m2: f64 = mesh.node_areas_m2.iter().sum();
        Self {
            places_m: (0..mesh.nodes_m.len()).map(|node| mesh.place_m(node)).collect(),
            surface: detector.surface.clone(),
            neighbours: Neighbours::of(mesh),
            areas_m2: mesh.node_areas_m2.clone(),
            apart_m: (area_m2 / detector.electrodes.len() as f64).sqrt(),
            rest_v: policy::MISFIT_DEVIATIONS * detector.adc.deviation_v(),
        }
    }

    /// Whether readings are no more than noise and quantisation.
    pub fn is_rest(&self, readings: &Readings) -> bool {
        readings.largest_v() < self.rest_v
    }

    /// One contact, at the centroid of all of an image above zero (S/m2 at each node).
    pub fn whole(&self, image: &[f32]) -> Option<FoundContact> {
        self.centroid(image, |_| true, 0.0)
    }

    /// The contacts at the peaks of an image (S/m2 at each node), the highest first.
    pub fn peaks(&self, image: &[f32]) -> Vec<FoundContact> {
        let peaks = self.peak_nodes(image);
        // One peak owns all nodes.
        let owners = if peaks.len() > 1 { self.nearest(&peaks) } else { Vec::new() };
        let contact = |(owner, &peak): (usize, &usize)| {
            self.contact_at(image, peak, |node| owners.get(node).is_none_or(|of| *of == owner))
        };
        peaks.iter().enumerate().filter_map(contact).collect()
    }

    /// Nodes that are highest within half of `apart_m` and apart from higher peaks, the highest first.
    fn peak_nodes(&self, image: &[f32]) -> Vec<usize> {
        let mut tops = self.tops(image, policy::PEAK_SHARE * highest(image));
        tops.sort_unstable_by(|&a, &b| image[b].total_cmp(&image[a]));
        let mut peaks: Vec<usize> = Vec::new();
        for node in tops {
            if self.is_apart(node, &peaks) && !self.is_on_a_slope(image, node) {
                peaks.push(node);
            }
        }
        peaks
    }

    /// Nodes above a floor that no neighbour on the mesh exceeds.
    fn tops(&self, image: &[f32], floor: f32) -> Vec<usize> {
        let is_top = |node: &usize| {
            let value = image[*node];
            value > floor && self.neighbours.of_node(*node).iter().all(|&other| image[other as usize] <= value)
        };
        (0..image.len()).filter(is_top).collect()
    }

    /// Whether there is a higher node near: then this one is on the slope of a hill.
    fn is_on_a_slope(&self, image: &[f32], node: usize) -> bool {
        let near_m2 = (0.5 * self.apart_m).powi(2);
        (0..image.len()).any(|higher| image[higher] > image[node] && self.distance_m2(node, higher) <= near_m2)
    }

    fn is_apart(&self, node: usize, peaks: &[usize]) -> bool {
        peaks.iter().all(|&peak| self.distance_m2(node, peak) > self.apart_m.powi(2))
    }

    /// For each node the place of the nearest peak in the list.
    fn nearest(&self, peaks: &[usize]) -> Vec<usize> {
        let nearest = |node: usize| {
            let distance_m2 = |&peak: &usize| self.distance_m2(node, peaks[peak]);
            (0..peaks.len()).min_by(|a, b| distance_m2(a).total_cmp(&distance_m2(b)))
        };
        (0..self.places_m.len()).map(|node| nearest(node).unwrap_or(0)).collect()
    }

    fn distance_m2(&self, a: usize, b: usize) -> f64 {
        let between = space::sub(self.places_m[a], self.places_m[b]);
        space::dot(between, between)
    }

    /// The contact of a peak: its place from what stands out around it, its conductance from all that is its `own`.
    fn contact_at(&self, image: &[f32], peak: usize, own: impl Fn(usize) -> bool) -> Option<FoundContact> {
        let near_m2 = (0.75 * self.apart_m).powi(2);
        let near = |node: usize| own(node) && self.distance_m2(node, peak) < near_m2;
        let place = self.centroid(image, near, policy::PEAK_SHARE * image[peak])?;
        Some(FoundContact { conductance_s: self.conductance_s(image, own), ..place })
    }

    /// Conductance (S) of what is above zero, over some of the nodes: in lanes, for it is summed over all in every frame.
    fn conductance_s(&self, image: &[f32], among: impl Fn(usize) -> bool) -> f64 {
        let mut sums = [0.0; LANES];
        for (first, (values, areas_m2)) in image.chunks(LANES).zip(self.areas_m2.chunks(LANES)).enumerate() {
            for (lane, (value, area_m2)) in values.iter().zip(areas_m2).enumerate() {
                if among(first * LANES + lane) {
                    sums[lane] += f64::from(value.max(0.0)) * area_m2;
                }
            }
        }
        sums.iter().sum()
    }

    /// Centroid and conductance of the part of an image above a floor, over some of the nodes.
    fn centroid(&self, image: &[f32], among: impl Fn(usize) -> bool, floor: f32) -> Option<FoundContact> {
        let (mut sum, mut moment) = (0.0, [0.0; 3]);
        for (node, &value) in image.iter().enumerate().filter(|&(node, &value)| value > floor && among(node)) {
            let weight = f64::from(value - floor) * self.areas_m2[node];
            sum += weight;
            moment = space::along(moment, weight, self.places_m[node]);
        }
        let centroid = space::along([0.0; 3], 1.0 / sum, moment);
        // The centroid of a part of a curved surface is beside it.
        let place = |surface: &Surface| surface.nearest(centroid).place_m;
        (sum > 0.0).then(|| {
            let [x_m, y_m, z_m] = self.surface.as_ref().map_or(centroid, place);
            FoundContact { z_m, ..FoundContact::flat(x_m, y_m, sum) }
        })
    }
}

/// The largest value, or zero if none is above.
fn highest(image: &[f32]) -> f32 {
    let mut largest = [0.0f32; LANES];
    for values in image.chunks(LANES) {
        for (largest, &value) in largest.iter_mut().zip(values) {
            *largest = if value > *largest { value } else { *largest };
        }
    }
    largest.into_iter().fold(0.0, f32::max)
}

/// The nodes that share a triangle with each node.
#[derive(Clone, Debug)]
struct Neighbours {
    /// Where those of each node begin, and the end.
    starts: Vec<usize>,
    nodes: Vec<u32>,
}

impl Neighbours {
    fn of(mesh: &ImageMesh) -> Self {
        let sides = mesh.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let mut pairs: Vec<(u32, u32)> = sides.flat_map(|(one, other)| [(one, other), (other, one)]).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let start = |node: usize| pairs.partition_point(|(of, _)| (*of as usize) < node);
        Self {
            starts: (0..=mesh.nodes_m.len()).map(start).collect(),
            nodes: pairs.iter().map(|(_, other)| *other).collect(),
        }
    }

    fn of_node(&self, node: usize) -> &[u32] {
        &self.nodes[self.starts[node]..self.starts[node + 1]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::samples;

    #[test]
    fn peaks_are_found_apart_and_share_the_conductance() {
        let jacobian = samples::jacobian(2000);
        let mesh = &jacobian.image_mesh;
        let locator = Locator::new(mesh, &jacobian.detector);
        let hills = [([0.015, 0.01], 1.0), ([-0.018, -0.012], 0.8), ([0.018, 0.01], 0.9), ([-0.02, 0.02], 0.5)];
        let height = |at: &[f64; 2]| -> f64 {
            let hill = |(middle, height): &([f64; 2], f64)| {
                let square = (at[0] - middle[0]).powi(2) + (at[1] - middle[1]).powi(2);
                height * (-square / (2.0 * 0.002f64.powi(2))).exp()
            };
            hills.iter().map(hill).fold(0.0, f64::max) - 0.01
        };
        let image: Vec<f32> = mesh.nodes_m.iter().map(|at| height(at) as f32).collect();
        let found = locator.peaks(&image);
        let [first, second] = found[..] else { panic!("{found:?}") };
        // Near peaks are one, and low ones none.
        assert!((first.x_m - 0.0165).abs() < 0.002 && (first.y_m - 0.01).abs() < 0.001, "{first:?}");
        assert!((second.x_m + 0.018).hypot(second.y_m + 0.012) < 0.001, "{second:?}");
        let whole = locator.whole(&image).map_or(f64::NAN, |whole| whole.conductance_s);
        assert!(((first.conductance_s + second.conductance_s) / whole - 1.0).abs() < 1e-6, "{whole}");
    }

    #[test]
    fn neighbours_are_those_of_the_triangles() {
        let mesh = ImageMesh {
            nodes_m: vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [5.0, 5.0]],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            node_areas_m2: vec![0.2; 5],
            ..ImageMesh::default()
        };
        let neighbours = Neighbours::of(&mesh);
        let all: Vec<&[u32]> = (0..5).map(|node| neighbours.of_node(node)).collect();
        assert_eq!(all, [&[1, 2, 3][..], &[0, 2], &[0, 1, 3], &[0, 2], &[]]);
    }
}
