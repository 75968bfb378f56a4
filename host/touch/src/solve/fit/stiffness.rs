//! Linear elements on triangles.

use tactomo_physics::space;

/// `int grad phi_i . grad phi_j` over a triangle: products of its edges over four times its area.
pub(crate) fn stiffness(corners: [space::Place; 3]) -> [[f64; 3]; 3] {
    let [a, b, c] = corners;
    let opposite = [space::sub(c, b), space::sub(a, c), space::sub(b, a)];
    let four_areas_m2 = 2.0 * space::length(space::normal(corners));
    opposite.map(|one| opposite.map(|other| space::dot(one, other) / four_areas_m2))
}
