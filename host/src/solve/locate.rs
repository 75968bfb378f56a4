//! Contacts in an image.

use super::FoundContact;
use crate::detector::Detector;
use crate::forward::ImageMesh;
use crate::readings::Readings;

/// Readings that stand for no contact: so many standard deviations of noise and quantisation for the largest of them.
const NOISE_DEVIATIONS: f64 = 5.0;
/// Height of a further peak over the highest, at least.
const FURTHER_PEAK: f32 = 0.6;
/// What stands out around a peak: above this share of it.
const STANDS_OUT: f32 = 0.7;

/// Finds contacts in images on one mesh.
#[derive(Clone, Debug)]
pub struct Locator {
    nodes_m: Vec<[f64; 2]>,
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
        let lsb_v = detector.adc.full_scale_v / 2f64.powi(i32::from(detector.adc.bits));
        let noise_lsb = (detector.adc.noise_lsb.powi(2) + 1.0 / 12.0).sqrt();
        Self {
            nodes_m: mesh.nodes_m.clone(),
            areas_m2: mesh.node_areas_m2.clone(),
            apart_m: (area_m2 / detector.electrodes.len() as f64).sqrt(),
            rest_v: NOISE_DEVIATIONS * noise_lsb * lsb_v,
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
        peaks.iter().filter_map(|&peak| self.contact_at(image, peak, &peaks)).collect()
    }

    /// Nodes that are highest within `apart_m`, the highest first.
    fn peak_nodes(&self, image: &[f32]) -> Vec<usize> {
        let highest = image.iter().copied().fold(0.0, f32::max);
        let mut high: Vec<_> = (0..image.len()).filter(|&node| image[node] > FURTHER_PEAK * highest).collect();
        high.sort_unstable_by(|&a, &b| image[b].total_cmp(&image[a]));
        let mut peaks: Vec<usize> = Vec::new();
        let mut hills: Vec<usize> = Vec::new();
        for node in high {
            // A node on the slope of a hill is near a higher node of it; only one that is not begins a hill of its own.
            if hills.iter().all(|&higher| self.distance_m(node, higher) > 0.5 * self.apart_m)
                && self.is_apart(node, &peaks)
            {
                peaks.push(node);
            }
            hills.push(node);
        }
        peaks
    }

    fn is_apart(&self, node: usize, peaks: &[usize]) -> bool {
        peaks.iter().all(|&peak| self.distance_m(node, peak) > self.apart_m)
    }

    fn distance_m(&self, a: usize, b: usize) -> f64 {
        let (a, b) = (self.nodes_m[a], self.nodes_m[b]);
        (a[0] - b[0]).hypot(a[1] - b[1])
    }

    /// The contact of a peak: its place from what stands out around it, its conductance from all that is nearer to it than to
    /// another peak.
    fn contact_at(&self, image: &[f32], peak: usize, peaks: &[usize]) -> Option<FoundContact> {
        let own = |node: usize| {
            let from_own_m = self.distance_m(node, peak);
            peaks.iter().all(|&other| other == peak || self.distance_m(node, other) >= from_own_m)
        };
        let near = |node: usize| self.distance_m(node, peak) < 0.75 * self.apart_m && own(node);
        let place = self.centroid(image, near, STANDS_OUT * image[peak])?;
        let conductance_s = self.centroid(image, own, 0.0)?.conductance_s;
        Some(FoundContact { conductance_s, ..place })
    }

    /// Centroid and conductance of the part of an image above a floor, over some of the nodes.
    fn centroid(&self, image: &[f32], among: impl Fn(usize) -> bool, floor: f32) -> Option<FoundContact> {
        let (mut sum, mut moment) = (0.0, [0.0; 2]);
        for (node, &value) in image.iter().enumerate().filter(|&(node, &value)| value > floor && among(node)) {
            let weight = f64::from(value - floor) * self.areas_m2[node];
            sum += weight;
            moment[0] += weight * self.nodes_m[node][0];
            moment[1] += weight * self.nodes_m[node][1];
        }
        (sum > 0.0).then(|| FoundContact { x_m: moment[0] / sum, y_m: moment[1] / sum, conductance_s: sum })
    }
}
