//! Discs of contact on a mesh.

use super::mesh::Mesh;
use crate::forward::ForwardError;
use crate::geometry;
use crate::scene::Contact;

/// Corners of the polygon that stands for a disc, which has the disc's area.
const CORNERS: usize = 64;

/// Conductance that each node gets (S): the integral of its shape function over the discs, times their conductance per area.
///
/// Exact for a polygon of [`CORNERS`] corners: a linear function's integral over a part is its value at the part's centroid.
/// So a disc's conductance and its centre are kept, whatever the mesh. A part beyond the edge touches nothing.
pub fn node_conductances_s(mesh: &Mesh, contacts: &[Contact]) -> Result<Vec<f64>, ForwardError> {
    let mut conductances_s = vec![0.0; mesh.nodes_m.len()];
    for (index, contact) in contacts.iter().enumerate() {
        check(contact).map_err(|what| ForwardError::Contact { index, what: what.to_owned() })?;
        if !add_disc(mesh, contact, &mut conductances_s) {
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

/// Adds one disc; whether it touches the detector at all.
///
/// On a curved detector a disc is what lies within a sphere about its centre, on the side of the surface that it lies on.
fn add_disc(mesh: &Mesh, contact: &Contact, conductances_s: &mut [f64]) -> bool {
    let Some((centre, side)) = mesh.footing([contact.x_m, contact.y_m, contact.z_m], contact.radius_m) else {
        return false;
    };
    let disc_m2 = geometry::area(&geometry::disc([0.0; 2], contact.radius_m, CORNERS));
    let density_s_per_m2 = contact.conductance_s / disc_m2;
    let mut touches = false;
    for &triangle in &mesh.triangles {
        if mesh.is_apart(triangle, centre, 1.01 * contact.radius_m) || !mesh.faces(triangle, side) {
            continue;
        }
        let (corners, middle, height_m) = mesh.seen_from(triangle, centre);
        let radius2 = contact.radius_m * contact.radius_m - height_m * height_m;
        let disc = geometry::disc(middle, radius2.max(0.0).sqrt(), CORNERS);
        let Some(integrals_m2) = geometry::shape_integrals_m2(&disc, corners) else { continue };
        for (node, integral_m2) in triangle.into_iter().zip(integrals_m2) {
            conductances_s[node as usize] += density_s_per_m2 * integral_m2;
        }
        touches = true;
    }
    touches
}
