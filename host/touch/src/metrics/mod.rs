//! How good a solution is: contacts against contacts, images against images, and the figures of merit of others.
//!
//! Every figure says its formula and where it comes from. None judges: a study does.

mod contacts;
mod greit;
mod image;
mod paper;
mod shape_error;

pub use self::contacts::{Matching, Pair, position_error_m};
pub use self::greit::Greit;
pub use self::image::{Comparison, ImageMetrics, found_s_per_m2, truth_s_per_m2};
pub use self::paper::{PaperFigures, centroid_m};
pub use self::shape_error::shape_error_m;

#[cfg(test)]
mod tests {
    use tactomo_physics::forward::ImageMesh;

    /// A square grid of `side x side` nodes, `step_m` apart, about the origin. All areas are alike, so that sums can be counted by hand.
    pub fn grid(side: u32, step_m: f64) -> ImageMesh {
        let at = |i: u32| (f64::from(i) - f64::from(side - 1) / 2.0) * step_m;
        let node = |i: u32, j: u32| j * side + i;
        let squares = (0..side - 1).flat_map(|j| (0..side - 1).map(move |i| (i, j)));
        ImageMesh {
            nodes_m: (0..side * side).map(|k| [at(k % side), at(k / side)]).collect(),
            places_m: Vec::new(),
            triangles: squares
                .flat_map(|(i, j)| {
                    let [a, b, c, d] = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
                    [[a, b, c], [a, c, d]]
                })
                .collect(),
            node_areas_m2: vec![step_m * step_m; (side * side) as usize],
        }
    }

    /// An image on it that has such values at some nodes, by column and row.
    pub fn image(side: usize, values: &[(usize, usize, f32)]) -> Vec<f32> {
        let mut image = vec![0.0; side * side];
        values.iter().for_each(|&(i, j, value)| image[j * side + i] = value);
        image
    }
}
