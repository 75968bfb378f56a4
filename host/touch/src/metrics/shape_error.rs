//! How far what was found of a touch of any shape is from it.

use super::image::upper_half;
use tactomo_physics::forward::ImageMesh;
use tactomo_physics::space;

/// Mean distance between what touches and what was found (m), both ways: of each place that stands out of one image (at least half of its highest
/// value) to the nearest that stands out of the other, the mean over the places of each by their areas, and the mean of both; at most `most_m`,
/// as where nothing was found. The average symmetric surface distance of image segmentation (T. Heimann et al., "Comparison and evaluation of methods for
/// liver segmentation from CT datasets", IEEE Transactions on Medical Imaging 28 (2009) 1251), of areas in place of their edges. `None` if nothing
/// touches.
///
/// # Panics
/// If the images (S/m2 at each node) are not on this mesh.
pub fn shape_error_m(mesh: &ImageMesh, truth: &[f32], found: &[f32], most_m: f64) -> Option<f64> {
    let [truth, found] = [truth, found].map(standing_out);
    if truth.is_empty() || found.is_empty() {
        return (!truth.is_empty()).then_some(most_m);
    }
    let mean_m = [(&truth, &found), (&found, &truth)].map(|(from, to)| mean_distance_m(mesh, from, to, most_m));
    Some((mean_m[0] + mean_m[1]) / 2.0)
}

/// Nodes at which an image is at least half of its highest value.
fn standing_out(image: &[f32]) -> Vec<usize> {
    upper_half(image).map_or_else(Vec::new, |is_in| (0..image.len()).filter(|node| is_in[*node]).collect())
}

fn mean_distance_m(mesh: &ImageMesh, from: &[usize], to: &[usize], most_m: f64) -> f64 {
    let (mut sum, mut area_m2) = (0.0, 0.0);
    for node in from {
        let place_m = mesh.place_m(*node);
        let distances_m = to.iter().map(|other| space::distance(place_m, mesh.place_m(*other)));
        sum += mesh.node_areas_m2[*node] * distances_m.fold(most_m, f64::min);
        area_m2 += mesh.node_areas_m2[*node];
    }
    sum / area_m2
}

#[cfg(test)]
mod tests {
    use super::super::tests::{grid, image};
    use super::*;

    #[test]
    fn distances_are_means_both_ways() {
        let mesh = grid(11, 1e-3);
        let found = |values: &[(usize, usize, f32)]| {
            let bar = image(11, &[(4, 5, 1.0), (5, 5, 1.0), (6, 5, 1.0)]);
            1e3 * shape_error_m(&mesh, &bar, &image(11, values), 5e-3).unwrap()
        };
        assert!(found(&[(4, 5, 9.0), (5, 5, 9.0), (6, 5, 8.0), (0, 0, 4.0)]) < 1e-9, "what is below half is nothing");
        // One node of the three, as if it were a contact: two are a step off, none of what was found is.
        assert!((found(&[(5, 5, 1.0)]) - 0.5 * 2.0 / 3.0).abs() < 1e-9);
        // All three, and one as far away as is counted.
        let far = [(4, 5, 1.0), (5, 5, 1.0), (6, 5, 1.0), (5, 0, 1.0)];
        assert!((found(&far) - 0.5 * 5.0 / 4.0).abs() < 1e-9);
        assert!((found(&[]) - 5.0).abs() < 1e-9, "nothing found is as far off as can be");
    }

    #[test]
    fn where_nothing_touches_there_is_no_error() {
        assert_eq!(shape_error_m(&grid(3, 1e-3), &[0.0; 9], &[1.0; 9], 1.0), None);
    }
}
