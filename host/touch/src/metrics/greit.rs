//! The figures of merit of GREIT for the image of one small contact.
//!
//! A. Adler et al., "GREIT: a unified approach to 2D linear EIT reconstruction of lung images", Physiological Measurement 30
//! (2009) S35, section 2.3. All are of the image `x` and of `x_q`, the set of nodes at or above a quarter of its highest value.

use std::f64::consts::PI;

use tactomo_physics::forward::ImageMesh;
use tactomo_physics::geometry::{self, Point};
use tactomo_physics::scene::Contact;

/// `x_q` is what is at least this share of the highest value.
const QUARTER: f64 = 0.25;

/// GREIT's figures of an image.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Greit {
    /// Amplitude response `AR`: the image's integral over the contact's conductance. 1 is right.
    pub amplitude_response: f64,
    /// Position error `PE = r_t - r_q` (m): how much nearer to the middle the centre of `x_q` is than the contact. 0 is right, above
    /// zero is pulled to the middle.
    pub position_error_m: f64,
    /// Resolution `RES = sqrt(A_q / A_0)`: the root of the share of the detector's area that `x_q` covers. Small is sharp.
    pub resolution: f64,
    /// Shape deformation `SD`: the share of `x_q` outside of the disc about its centre that has its area. 0 is round.
    pub shape_deformation: f64,
    /// Ringing `RNG`: what is below zero outside of that disc over what the disc holds. 0 is none.
    pub ringing: f64,
}

impl Greit {
    /// Of an image (S/m2 at each node) of one contact; `None` if it is nowhere above zero. The detector's middle is the origin.
    ///
    /// # Panics
    /// If the image is not on this mesh.
    pub fn of(mesh: &ImageMesh, image: &[f32], contact: &Contact) -> Option<Self> {
        let highest = f64::from(image.iter().copied().fold(0.0, f32::max));
        let in_set = |node: usize| highest > 0.0 && f64::from(image[node]) >= QUARTER * highest;
        let sum = |term: &dyn Fn(usize) -> f64| -> f64 {
            mesh.node_areas_m2.iter().enumerate().map(|(node, area_m2)| area_m2 * term(node)).sum()
        };
        let share = |is: bool, value: f64| if is { value } else { 0.0 };
        let set_m2 = sum(&|node| share(in_set(node), 1.0));
        let centre_m: Point = [0, 1].map(|axis| sum(&|node| share(in_set(node), mesh.nodes_m[node][axis])) / set_m2);
        let radius_m = (set_m2 / PI).sqrt();
        let in_disc = |node: usize| geometry::distance(mesh.nodes_m[node], centre_m) <= radius_m;
        let value = |node: usize| f64::from(image[node]);
        (set_m2 > 0.0).then(|| Self {
            amplitude_response: sum(&value) / contact.conductance_s,
            position_error_m: contact.x_m.hypot(contact.y_m) - centre_m[0].hypot(centre_m[1]),
            resolution: (set_m2 / sum(&|_| 1.0)).sqrt(),
            shape_deformation: sum(&|node| share(in_set(node) && !in_disc(node), 1.0)) / set_m2,
            ringing: sum(&|node| share(!in_disc(node), (-value(node)).max(0.0)))
                / sum(&|node| share(in_disc(node), value(node))),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{grid, image};
    use super::*;

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-6, "{found} {expected}");
    }

    #[test]
    fn figures_of_three_nodes_in_a_row_are_counted_by_hand() {
        // Heights 1, 4, 1 on 1 mm2 each at x = 1, 2, 3 mm, a fourth too low for the set, and one below zero far away.
        let values = [(11, 10, 1.0), (12, 10, 4.0), (13, 10, 1.0), (14, 10, 0.5), (0, 0, -1.5)];
        let contact = Contact::flat(0.005, 0.0, 1e-3, 1e-5);
        let found = Greit::of(&grid(21, 1e-3), &image(21, &values), &contact).unwrap();
        near(found.amplitude_response, 5e-6 / 1e-5);
        near(found.position_error_m, 0.003);
        near(found.resolution, (3.0f64 / 441.0).sqrt());
        // A disc of 3 mm2 has a radius of 0.98 mm: it holds the middle node alone.
        near(found.shape_deformation, 2.0 / 3.0);
        near(found.ringing, 1.5 / 4.0);
    }

    #[test]
    fn a_round_spot_of_the_right_conductance_is_perfect() {
        let disc = |k: usize| if ((k % 41) as f64 - 20.0).hypot((k / 41) as f64 - 20.0) <= 10.0 { 2.0 } else { 0.0 };
        let image: Vec<f32> = (0..41 * 41).map(disc).collect();
        let total_s: f64 = image.iter().map(|value| f64::from(*value) * 1e-6).sum();
        let found = Greit::of(&grid(41, 1e-3), &image, &Contact::flat(0.0, 0.0, 0.01, total_s)).unwrap();
        near(found.amplitude_response, 1.0);
        near(found.position_error_m, 0.0);
        near(found.ringing, 0.0);
        assert!(found.shape_deformation < 0.03, "{found:?}");
    }

    #[test]
    fn no_image_has_no_figures() {
        assert_eq!(Greit::of(&grid(3, 1e-3), &[-1.0; 9], &Contact::flat(0.0, 0.0, 1e-3, 1e-3)), None);
    }
}
