//! Images found against the image that is there.

use crate::solve::Solution;
use tactomo_physics::forward::{ForwardError, ImageMesh};
use tactomo_physics::scene::{Shape, Touch};
use tactomo_physics::space;

/// A Gaussian is cut off at so many standard deviations.
const CUT_OFF: f64 = 3.0;
/// What stands out of an image for [`ImageMetrics::dice`], `iou` and [`shape_error_m`](super::shape_error_m): at least this share of its highest value.
const HALF: f64 = 0.5;

/// Contact conductance per area that touches make (S/m2) at the nodes of an image's mesh: of each node, what its shape function gathers, over
/// its area. A touch's conductance and middle are kept on any mesh.
///
/// # Errors
/// As for [`ImageMesh::conductances_s`].
pub fn truth_s_per_m2(mesh: &ImageMesh, touches: &[Touch]) -> Result<Vec<f32>, ForwardError> {
    let conductances_s = mesh.conductances_s(touches)?;
    let density = |(s, area_m2): (f64, &f64)| (s / area_m2) as f32;
    Ok(conductances_s.into_iter().zip(&mesh.node_areas_m2).map(density).collect())
}

/// What a solution says touches, as an image on a mesh (S/m2): its image if it has one there, else its contacts as discs of the radii found,
/// of `usual_radius_m` where none was. What was found beside the detector shows nowhere.
pub fn found_s_per_m2(mesh: &ImageMesh, solution: &Solution, usual_radius_m: f64) -> Vec<f32> {
    if let Some(image) = solution.image_s_per_m2.as_ref().filter(|image| image.len() == mesh.nodes_m.len()) {
        return image.clone();
    }
    let mut image = vec![0.0; mesh.nodes_m.len()];
    for contact in &solution.contacts {
        let shape = Shape::Disc { radius_m: contact.radius_m.unwrap_or(usual_radius_m) };
        let touch = Touch::flat([contact.x_m, contact.y_m], shape, contact.conductance_s);
        if let Ok(one) = truth_s_per_m2(mesh, &[touch]) {
            image.iter_mut().zip(one).for_each(|(sum, value)| *sum += value);
        }
    }
    image
}

/// Compares images on one mesh, both smoothed: a contact found a little beside the truth is nearly right, not wholly wrong.
#[derive(Clone, Debug)]
pub struct Comparison {
    areas_m2: Vec<f64>,
    /// For each node those around it, with weights that add up to one.
    kernel: Vec<Vec<(u32, f32)>>,
}

/// How alike two images are. `None` where it is not defined: for an image that is even, or nowhere above zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct ImageMetrics {
    /// Pearson's correlation, nodes weighted by area: -1 to 1. Blind to scale and offset.
    pub correlation: Option<f64>,
    /// Dice's coefficient `2 |A and B| / (|A| + |B|)` of the parts of both that are at least half of their highest values.
    pub dice: Option<f64>,
    /// Jaccard's index `|A and B| / |A or B|` (intersection over union) of the same parts.
    pub iou: Option<f64>,
}

impl Comparison {
    /// Images on `mesh`, smoothed by a Gaussian of that standard deviation (m); zero leaves them as they are.
    pub fn new(mesh: &ImageMesh, smoothing_m: f64) -> Self {
        let places_m: Vec<_> = (0..mesh.nodes_m.len()).map(|node| mesh.place_m(node)).collect();
        let around = |node: usize| {
            let weight = |other: usize| {
                let distance_m = space::distance(places_m[node], places_m[other]);
                let near = distance_m <= CUT_OFF * smoothing_m;
                near.then(|| mesh.node_areas_m2[other] * gaussian(distance_m, smoothing_m))
            };
            normalised((0..places_m.len()).filter_map(|other| Some((other as u32, weight(other)?))).collect())
        };
        Self { areas_m2: mesh.node_areas_m2.clone(), kernel: (0..places_m.len()).map(around).collect() }
    }

    /// An image, smoothed.
    ///
    /// # Panics
    /// If it is not on this mesh.
    pub fn smoothed(&self, image: &[f32]) -> Vec<f32> {
        let at = |around: &Vec<(u32, f32)>| around.iter().map(|(node, weight)| weight * image[*node as usize]).sum();
        self.kernel.iter().map(at).collect()
    }

    /// Compares two images, after smoothing both.
    ///
    /// # Panics
    /// If they are not on this mesh.
    pub fn of(&self, truth: &[f32], found: &[f32]) -> ImageMetrics {
        let (truth, found) = (self.smoothed(truth), self.smoothed(found));
        let [dice, iou] = self.overlaps(&truth, &found).map_or([None; 2], |both| both.map(Some));
        ImageMetrics { correlation: self.correlation(&truth, &found), dice, iou }
    }

    /// Pearson's correlation of two images as they are.
    fn correlation(&self, a: &[f32], b: &[f32]) -> Option<f64> {
        let area_m2: f64 = self.areas_m2.iter().sum();
        let mean = |image: &[f32]| self.weighted(|node| f64::from(image[node])) / area_m2;
        let (mean_a, mean_b) = (mean(a), mean(b));
        let product = |x: &[f32], mean_x: f64, y: &[f32], mean_y: f64| {
            self.weighted(|node| (f64::from(x[node]) - mean_x) * (f64::from(y[node]) - mean_y))
        };
        let variances = product(a, mean_a, a, mean_a) * product(b, mean_b, b, mean_b);
        let correlation = product(a, mean_a, b, mean_b) / variances.sqrt();
        correlation.is_finite().then_some(correlation)
    }

    /// Dice's coefficient and Jaccard's index of two images as they are.
    fn overlaps(&self, a: &[f32], b: &[f32]) -> Option<[f64; 2]> {
        let (in_a, in_b) = (upper_half(a)?, upper_half(b)?);
        let area_m2 = |inside: &dyn Fn(usize) -> bool| self.weighted(|node| f64::from(u8::from(inside(node))));
        let common_m2 = area_m2(&|node| in_a[node] && in_b[node]);
        let sum_m2 = area_m2(&|node| in_a[node]) + area_m2(&|node| in_b[node]);
        Some([2.0 * common_m2 / sum_m2, common_m2 / (sum_m2 - common_m2)])
    }

    /// Sum of a value over all nodes, weighted by their areas.
    fn weighted(&self, value: impl Fn(usize) -> f64) -> f64 {
        self.areas_m2.iter().enumerate().map(|(node, area_m2)| area_m2 * value(node)).sum()
    }
}

fn gaussian(distance_m: f64, deviation_m: f64) -> f64 {
    if deviation_m > 0.0 { (-0.5 * (distance_m / deviation_m).powi(2)).exp() } else { 1.0 }
}

fn normalised(weights: Vec<(u32, f64)>) -> Vec<(u32, f32)> {
    let sum: f64 = weights.iter().map(|(_, weight)| weight).sum();
    weights.into_iter().map(|(node, weight)| (node, (weight / sum) as f32)).collect()
}

/// Where an image is at least half of its highest value, if that is above zero.
pub(super) fn upper_half(image: &[f32]) -> Option<Vec<bool>> {
    let highest = f64::from(image.iter().copied().fold(0.0, f32::max));
    (highest > 0.0).then(|| image.iter().map(|value| f64::from(*value) >= HALF * highest).collect())
}

#[cfg(test)]
mod tests {
    use super::super::tests::{grid, image};
    use super::*;
    use crate::solve::FoundContact;

    fn near(found: Option<f64>, expected: f64) {
        assert!(found.is_some_and(|found| (found - expected).abs() < 1e-6), "{found:?} {expected}");
    }

    #[test]
    fn the_truth_keeps_conductance_and_is_even_inside_a_touch() {
        let mesh = grid(31, 1e-3);
        let touches = [
            Touch::flat([0.002, 0.0], Shape::Disc { radius_m: 0.005 }, 1e-3),
            Touch::flat([-0.009, 0.0], Shape::Line { length_m: 0.01, width_m: 0.002, angle_rad: 1.2 }, 3e-3),
        ];
        let truth = truth_s_per_m2(&mesh, &touches).unwrap();
        let total_s: f64 = truth.iter().map(|density| f64::from(*density) * 1e-6).sum();
        assert!((total_s - 4e-3).abs() < 1e-9, "{total_s}");
        // The middle of the disc: 1 mS over 25 pi mm2.
        let middle = f64::from(truth[15 * 31 + 17]);
        assert!((middle * std::f64::consts::PI * 25e-6 / 1e-3 - 1.0).abs() < 1e-3, "{middle}");
    }

    #[test]
    fn contacts_are_discs_of_their_radii_and_an_image_is_itself() {
        let mesh = grid(31, 1e-3);
        let wide = FoundContact { radius_m: Some(0.006), ..FoundContact::flat(0.002, 0.0, 1e-3) };
        let contacts = vec![wide, FoundContact::flat(-0.01, 0.003, 2e-3), FoundContact::flat(0.5, 0.0, 1.0)];
        let mut solution = Solution { contacts, ..Solution::default() };
        let disc = |at_m, radius_m, s| Touch::flat(at_m, Shape::Disc { radius_m }, s);
        let touches = [disc([0.002, 0.0], 0.006, 1e-3), disc([-0.01, 0.003], 0.002, 2e-3)];
        let truth = truth_s_per_m2(&mesh, &touches).unwrap();
        assert_eq!(found_s_per_m2(&mesh, &solution, 0.002), truth);
        solution.image_s_per_m2 = Some(vec![0.5; 31 * 31]);
        assert_eq!(found_s_per_m2(&mesh, &solution, 0.002), vec![0.5; 31 * 31]);
    }

    #[test]
    fn correlation_is_pearsons() {
        let comparison = Comparison::new(&grid(2, 1e-3), 0.0);
        let a = [1.0, 2.0, 3.0, 4.0];
        near(comparison.of(&a, &a.map(|x| 5.0 - 2.0 * x)).correlation, -1.0);
        near(comparison.of(&a, &a.map(|x| 7.0 * x - 1.0)).correlation, 1.0);
        // Deviations -1.5 -0.5 0.5 1.5 and 0.5 -0.5 0.5 -0.5: products -0.75 0.25 0.25 -0.75, over root of 5 times 1.
        near(comparison.of(&a, &[1.0, 0.0, 1.0, 0.0]).correlation, -1.0 / 5f64.sqrt());
        assert_eq!(comparison.of(&a, &[1.0; 4]).correlation, None);
    }

    #[test]
    fn overlap_counts_nodes_above_half() {
        let comparison = Comparison::new(&grid(3, 1e-3), 0.0);
        // Three nodes against two, one in common.
        let a = image(3, &[(0, 0, 1.0), (1, 0, 0.5), (2, 0, 0.9), (0, 1, 0.4)]);
        let b = image(3, &[(2, 0, 3.0), (2, 1, 2.0), (2, 2, 1.0)]);
        let metrics = comparison.of(&a, &b);
        near(metrics.dice, 2.0 / 5.0);
        near(metrics.iou, 1.0 / 4.0);
        let nothing = comparison.of(&a, &[-1.0; 9]);
        assert_eq!((nothing.dice, nothing.iou), (None, None));
    }

    #[test]
    fn nodes_count_by_their_areas() {
        let mut mesh = grid(2, 1e-3);
        mesh.node_areas_m2 = vec![1e-6, 1e-6, 1e-6, 5e-6];
        let comparison = Comparison::new(&mesh, 0.0);
        near(comparison.of(&[1.0, 0.0, 0.0, 1.0], &[0.0, 0.0, 1.0, 1.0]).iou, 5.0 / 7.0);
    }

    #[test]
    fn smoothing_spreads_a_point_as_a_gaussian_and_keeps_what_is_even() {
        let comparison = Comparison::new(&grid(41, 1e-3), 2e-3);
        let smooth = comparison.smoothed(&image(41, &[(20, 20, 1.0)]));
        let expected = |mm: f64| 1e-6 / (std::f64::consts::TAU * 4e-6) * (-mm * mm / 8.0).exp();
        for mm in [0, 1, 3] {
            // What is cut off beyond three deviations is 1.1 %.
            let found = f64::from(smooth[20 * 41 + 20 + mm]) / expected(mm as f64);
            assert!((1.0..1.02).contains(&found), "{mm} {found}");
        }
        assert!(comparison.smoothed(&vec![3.0; 41 * 41]).iter().all(|value| (value - 3.0).abs() < 1e-5));
    }

    #[test]
    fn a_point_nearby_is_worth_more_than_one_far_away() {
        let comparison = Comparison::new(&grid(41, 1e-3), 2e-3);
        let [at, beside, far] = [20, 22, 35].map(|i| image(41, &[(i, 20, 1.0)]));
        // Two Gaussians of deviation s, d apart, correlate by exp(-d^2 / 4 s^2); less a little, for the mean.
        let found = comparison.of(&at, &beside).correlation;
        assert!(found.is_some_and(|found| (found - (-0.25f64).exp()).abs() < 0.02), "{found:?}");
        assert!(comparison.of(&at, &far).correlation.is_some_and(|found| found.abs() < 0.05));
    }
}
