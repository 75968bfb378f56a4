//! Two figures of the paper for the image of one small contact: spatial resolution SR, eq. (9), and position accuracy PA, eq. (10).

use tactomo_physics::forward::ImageMesh;
use tactomo_physics::geometry::{self, Point};
use tactomo_physics::scene::Contact;

/// The contour is at this share of the highest value.
const HALF: f64 = 0.5;

/// SR and PA of an image.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PaperFigures {
    /// Spatial resolution `SR = 1 - FWHM / WIDTH`. FWHM is what the paper says it is, the largest distance of the contour at half
    /// of the highest value from the image's centre: of a round spot, its half width.
    pub spatial_resolution: f64,
    /// Whether the image is above half of its highest value as far from its centre as the detector reaches, to a corner of a rectangle: SR then is what
    /// the outline gives, whatever the image.
    pub is_spread_out: bool,
    /// Position accuracy `PA = 1 - |P_cop - P_t| / WIDTH`, with `P_cop` the centroid of the image above zero.
    pub position_accuracy: f64,
}

impl PaperFigures {
    /// Of an image (S/m2 at each node) of one contact on a detector `width_m` wide (m); `None` if it is nowhere above zero. On a curved
    /// detector, distances are those of its map.
    ///
    /// # Panics
    /// If the image is not on this mesh.
    pub fn of(mesh: &ImageMesh, image: &[f32], contact: &Contact, width_m: f64) -> Option<Self> {
        let centre_m = centroid_m(mesh, image)?;
        let spread_m = half_maximum_distance_m(mesh, image, centre_m);
        let reach_m = mesh.nodes_m.iter().map(|node_m| geometry::distance(centre_m, *node_m)).fold(0.0, f64::max);
        let error_m = geometry::distance(centre_m, [contact.x_m, contact.y_m]);
        Some(Self {
            spatial_resolution: 1.0 - spread_m / width_m,
            is_spread_out: spread_m >= reach_m,
            position_accuracy: 1.0 - error_m / width_m,
        })
    }
}

/// Centroid of an image above zero (m); `None` if it is nowhere so.
pub fn centroid_m(mesh: &ImageMesh, image: &[f32]) -> Option<Point> {
    let (mut sum, mut moment) = (0.0, [0.0; 2]);
    for ((value, area_m2), [x, y]) in image.iter().zip(&mesh.node_areas_m2).zip(&mesh.nodes_m) {
        let weight = f64::from(value.max(0.0)) * area_m2;
        sum += weight;
        moment = [moment[0] + weight * x, moment[1] + weight * y];
    }
    (sum > 0.0).then(|| moment.map(|part| part / sum))
}

/// Largest distance of the contour at half of the highest value from a point (m). The image is linear along edges; where it is above half
/// at the detector's edge, the contour closes along that.
fn half_maximum_distance_m(mesh: &ImageMesh, image: &[f32], from_m: Point) -> f64 {
    let level = HALF * f64::from(image.iter().copied().fold(0.0, f32::max));
    let height = |node: u32| f64::from(image[node as usize]) - level;
    let distance_m = |a: u32, b: u32, share: f64| {
        let [from, to] = [a, b].map(|node| mesh.nodes_m[node as usize]);
        geometry::distance(from_m, [0, 1].map(|axis| from[axis] + share * (to[axis] - from[axis])))
    };
    let mut largest_m = 0.0_f64;
    for &[a, b, c] in &mesh.triangles {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            let (before, after) = (height(a), height(b));
            if before >= 0.0 {
                let share = if after < 0.0 { before / (before - after) } else { 0.0 };
                largest_m = largest_m.max(distance_m(a, b, share));
            }
        }
    }
    largest_m
}

#[cfg(test)]
mod tests {
    use super::super::tests::{grid, image};
    use super::*;

    fn figures(image: &[f32], contact: Contact) -> PaperFigures {
        PaperFigures::of(&grid(21, 1e-3), image, &contact, 0.02).unwrap()
    }

    #[test]
    fn a_cone_has_half_its_radius() {
        let cone = |k: usize| (1.0 - 0.2 * ((k % 21) as f64 - 10.0).hypot((k / 21) as f64 - 10.0)).max(0.0) as f32;
        let image: Vec<f32> = (0..441).map(cone).collect();
        let found = figures(&image, Contact::flat(0.003, 0.004, 1e-3, 1e-3));
        // Half of a base of 5 mm, 2.5 mm of 20; the centre is 5 mm beside the contact.
        assert!((found.spatial_resolution - (1.0 - 2.5 / 20.0)).abs() < 0.01, "{found:?}");
        assert!((found.position_accuracy - 0.75).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn a_second_spot_widens_and_moves_the_image_and_what_is_below_zero_does_nothing() {
        let image = image(21, &[(10, 10, 1.0), (14, 10, 1.0), (0, 0, -5.0)]);
        let found = figures(&image, Contact::flat(0.0, 0.0, 1e-3, 1e-3));
        // The centroid is half way, 2 mm off; the contours are half a step beyond the spots, along edges and along diagonals.
        assert!((found.position_accuracy - 0.9).abs() < 1e-6, "{found:?}");
        assert!((found.spatial_resolution - (1.0 - 2.5f64.hypot(0.5) / 20.0)).abs() < 1e-6, "{found:?}");
    }

    #[test]
    fn an_image_that_is_above_half_at_a_corner_has_the_resolution_of_the_outline() {
        let contact = Contact::flat(0.0, 0.0, 1e-3, 1e-3);
        // A dome from 1 in the middle of 20 x 20 mm down to `edge` at the corners.
        let dome = |edge: f64| {
            let height = |k: usize| ((k % 21) as f64 - 10.0).hypot((k / 21) as f64 - 10.0) / 10f64.hypot(10.0);
            (0..441).map(|k| (1.0 - (1.0 - edge) * height(k)) as f32).collect::<Vec<f32>>()
        };
        let flat = figures(&dome(0.51), contact);
        assert!(flat.is_spread_out && (flat.spatial_resolution - (1.0 - 0.5f64.sqrt())).abs() < 1e-6, "{flat:?}");
        assert!(!figures(&dome(0.49), contact).is_spread_out);
    }

    #[test]
    fn no_image_has_no_figures() {
        let contact = Contact::flat(0.0, 0.0, 1e-3, 1e-3);
        assert_eq!(PaperFigures::of(&grid(3, 1e-3), &[-1.0; 9], &contact, 0.02), None);
    }
}
