//! Discs of contact on a mesh.
//!
//! A disc's conductance per area is that of the whole disc; a part beyond the edge touches nothing.

use super::locate::Locator;
use super::mesh::Mesh;
use crate::forward::ForwardError;
use crate::geometry;
use crate::scene::Contact;
use crate::space::{self, Place};

/// Corners of the polygon that stands for a disc, which has the disc's area.
const CORNERS: usize = 64;

/// Where a disc lies on a surface: its centre there, and the surface's normal, which is nothing on a plane.
pub(super) type Footing = (Place, Place);

/// The centre of a contact moved up or down onto a curved surface, not along it, and the surface's normal there; on a plane
/// the centre and no normal. `None` farther than `reach_m` from the surface.
pub(super) fn footing(mesh: &Mesh, locator: &Locator, centre: Place, reach_m: f64) -> Option<Footing> {
    if mesh.places_m.is_empty() {
        return Some((centre, [0.0; 3]));
    }
    let near = locator.near(centre, reach_m);
    let corners = near.into_iter().map(|triangle| mesh.triangles[triangle as usize].map(|node| mesh.place_m(node)));
    let away_m = |corners: [Place; 3]| space::distance(space::nearest_on_triangle(centre, corners), centre);
    let (away_m, corners) = corners.map(|corners| (away_m(corners), corners)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let normal = space::normal(corners);
    let height = space::dot(space::sub(centre, corners[0]), normal) / space::dot(normal, normal);
    (away_m <= reach_m).then(|| (space::along(centre, -height, normal), normal))
}

/// Conductance that each node gets (S): the integral of its shape function over the discs, times their conductance per area.
///
/// Exact for a polygon of [`CORNERS`] corners: a linear function's integral over a part is its value at the part's centroid.
/// So a disc's conductance and its centre are kept, whatever the mesh. A part beyond the edge touches nothing.
pub fn node_conductances_s(mesh: &Mesh, locator: &Locator, contacts: &[Contact]) -> Result<Vec<f64>, ForwardError> {
    let mut conductances_s = vec![0.0; mesh.nodes_m.len()];
    for (index, contact) in contacts.iter().enumerate() {
        check(contact).map_err(|what| ForwardError::Contact { index, what: what.to_owned() })?;
        let footing = footing(mesh, locator, [contact.x_m, contact.y_m, contact.z_m], contact.radius_m);
        let density_s_per_m2 = contact.conductance_s / disc_m2(contact.radius_m, CORNERS);
        let touches = footing.is_some_and(|footing| {
            cover(mesh, locator, footing, (contact.radius_m, CORNERS), |node, integral_m2| {
                conductances_s[node as usize] += density_s_per_m2 * integral_m2;
            })
        });
        if !touches {
            return Err(ForwardError::Contact { index, what: "it is off the detector".to_owned() });
        }
    }
    Ok(conductances_s)
}

fn check(contact: &Contact) -> Result<(), &'static str> {
    let numbers = [contact.x_m, contact.y_m, contact.radius_m, contact.conductance_s];
    if numbers.iter().any(|number| !number.is_finite()) {
        return Err("it has a value that is not a finite number");
    }
    if contact.radius_m <= 0.0 {
        return Err("its radius is not above zero");
    }
    if contact.conductance_s <= 0.0 {
        return Err("its conductance is not above zero");
    }
    Ok(())
}

/// Area of the polygon of so many corners that stands for a disc (m2).
pub(super) fn disc_m2(radius_m: f64, corners: usize) -> f64 {
    geometry::area(&geometry::disc([0.0; 2], radius_m, corners))
}

/// Visits the integrals of nodes' shape functions (m2) over a disc, given by its radius (m) and the corners of the polygon that
/// stands for it; whether it touches the detector at all.
///
/// On a curved detector a disc is what lies within a sphere about its centre, on the side of the surface that it lies on.
pub(super) fn cover(
    mesh: &Mesh,
    locator: &Locator,
    (centre, side): Footing,
    (radius_m, corners): (f64, usize),
    mut visit: impl FnMut(u32, f64),
) -> bool {
    let mut touches = false;
    let unit = geometry::disc([0.0; 2], 1.0, corners);
    let mut disc = unit.clone();
    // Within this circle everything is inside the polygon.
    let inner_m = radius_m * (std::f64::consts::PI / corners as f64).cos();
    for triangle in locator.near(centre, 1.01 * radius_m) {
        let triangle = mesh.triangles[triangle as usize];
        if mesh.is_apart(triangle, centre, 1.01 * radius_m) || !mesh.faces(triangle, side) {
            continue;
        }
        let (places, middle, height_m) = mesh.seen_from(triangle, centre);
        let share = (1.0 - (height_m / radius_m).powi(2)).max(0.0).sqrt();
        if places.iter().all(|place| geometry::distance(*place, middle) < share * inner_m) {
            let third_m2 = geometry::cross(places[0], places[1], places[2]) / 6.0;
            triangle.into_iter().for_each(|node| visit(node, third_m2));
            touches = true;
            continue;
        }
        for (corner, unit) in disc.iter_mut().zip(&unit) {
            *corner = [0, 1].map(|axis| middle[axis] + share * radius_m * unit[axis]);
        }
        let Some(integrals_m2) = geometry::shape_integrals_m2(&disc, places) else { continue };
        triangle.into_iter().zip(integrals_m2).for_each(|(node, integral_m2)| visit(node, integral_m2));
        touches = true;
    }
    touches
}
