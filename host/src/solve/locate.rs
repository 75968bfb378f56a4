//! Contacts in an image.

use super::FoundContact;
use crate::detector::{Detector, Surface};
use crate::forward::ImageMesh;
use crate::readings::Readings;
use crate::space::{self, Place};

/// Readings that stand for no contact: so many standard deviations of noise and quantisation for the largest of them.
const NOISE_DEVIATIONS: f64 = 5.0;
/// Height of a further peak over the highest, at least.
const FURTHER_PEAK: f32 = 0.6;
/// What stands out around a peak: above this share of it.
const STANDS_OUT: f32 = 0.7;

/// Finds contacts in images on one mesh.
#[derive(Clone, Debug)]
pub struct Locator {
    places_m: Vec<Place>,
    surface: Option<Surface>,
    triangles: Vec<[u32; 3]>,
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
            triangles: mesh.triangles.clone(),
            areas_m2: mesh.node_areas_m2.clone(),
            apart_m: (area_m2 / detector.electrodes.len() as f64).sqrt(),
            rest_v: NOISE_DEVIATIONS * detector.adc.deviation_v(),
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
        let owners = self.nearest(&peaks);
        peaks
            .iter()
            .enumerate()
            .filter_map(|(owner, &peak)| self.contact_at(image, peak, |node| owners[node] == owner))
            .collect()
    }

    /// Nodes that are highest within half of `apart_m` and apart from higher peaks, the highest first.
    fn peak_nodes(&self, image: &[f32]) -> Vec<usize> {
        let highest = image.iter().copied().fold(0.0, f32::max);
        let mut tops = self.tops(image);
        tops.retain(|&node| image[node] > FURTHER_PEAK * highest);
        tops.sort_unstable_by(|&a, &b| image[b].total_cmp(&image[a]));
        let mut peaks: Vec<usize> = Vec::new();
        for node in tops {
            if !self.is_on_a_slope(image, node) && self.is_apart(node, &peaks) {
                peaks.push(node);
            }
        }
        peaks
    }

    /// Nodes that no neighbour on the mesh exceeds.
    fn tops(&self, image: &[f32]) -> Vec<usize> {
        let mut is_top = vec![true; image.len()];
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|node| node as usize);
            for (one, other) in [(a, b), (b, c), (c, a)] {
                is_top[one] &= image[one] >= image[other];
                is_top[other] &= image[other] >= image[one];
            }
        }
        (0..image.len()).filter(|&node| is_top[node]).collect()
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
        let place = self.centroid(image, near, STANDS_OUT * image[peak])?;
        let conductance_s = self.centroid(image, &own, 0.0)?.conductance_s;
        Some(FoundContact { conductance_s, ..place })
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
