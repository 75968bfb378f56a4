//! All that touches, as one.

use tactomo_physics::forward::ImageMesh;
use tactomo_physics::space::Place;

use super::{FoundContact, FoundShape, Solution};

/// What all that touches comes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Total {
    /// Force (N), where that of each contact is known.
    pub force_n: Option<f64>,
    /// Conductance (S): the sum of the apparent ones where they are known, for those of firm contacts are known far better.
    pub conductance_s: f64,
    /// Area (m2), where that of each contact is known.
    pub area_m2: Option<f64>,
    /// Centre of pressure (m): the mean place, by force where it is known, else by conductance.
    pub centre_m: Place,
}

impl Total {
    /// That of a solution; of an image where its mesh is known. `None` if nothing touches.
    pub fn of(solution: &Solution, mesh: Option<&ImageMesh>) -> Option<Self> {
        let image = solution.image_s_per_m2.as_deref().zip(mesh);
        match (&solution.shape, &solution.contacts[..], image) {
            (Some(shape), ..) => Self::of_parts(&[Part::of_shape(shape)]),
            (None, [], Some((image, mesh))) => Self::of_parts(&Part::of_image(image, mesh)),
            (None, contacts, _) => Self::of_parts(&contacts.iter().map(Part::of_contact).collect::<Vec<_>>()),
        }
    }

    fn of_parts(parts: &[Part]) -> Option<Self> {
        let conductance_s = parts.iter().map(|part| part.conductance_s).sum();
        let force_n = parts.iter().map(|part| part.force_n).sum::<Option<f64>>();
        let weight =
            |part: &Part| if force_n.is_some() { part.force_n.unwrap_or_default() } else { part.conductance_s };
        let all: f64 = parts.iter().map(weight).sum();
        let mean = |axis: usize| parts.iter().map(|part| weight(part) * part.place_m[axis]).sum::<f64>() / all;
        (all > 0.0).then(|| Self {
            force_n,
            conductance_s,
            area_m2: parts.iter().map(|part| part.area_m2).sum(),
            centre_m: std::array::from_fn(mean),
        })
    }
}

/// Something that is counted.
struct Part {
    place_m: Place,
    conductance_s: f64,
    force_n: Option<f64>,
    area_m2: Option<f64>,
}

impl Part {
    fn of_contact(contact: &FoundContact) -> Self {
        Self {
            place_m: [contact.x_m, contact.y_m, contact.z_m],
            conductance_s: contact.apparent_conductance_s.unwrap_or(contact.conductance_s),
            force_n: contact.force_n,
            area_m2: contact.area_m2(),
        }
    }

    fn of_shape(shape: &FoundShape) -> Self {
        let [x, y] = shape.centre_m();
        let conductance_s = shape.conductance_s();
        Self { place_m: [x, y, 0.0], conductance_s, force_n: None, area_m2: Some(shape.area_m2()) }
    }

    /// What an image has at each node, below nothing left out.
    fn of_image(image_s_per_m2: &[f32], mesh: &ImageMesh) -> Vec<Self> {
        let nodes = image_s_per_m2.iter().zip(&mesh.node_areas_m2).enumerate();
        let part = |(node, (density, area_m2)): (usize, (&f32, &f64))| {
            let conductance_s = f64::from(*density) * area_m2;
            (conductance_s > 0.0).then(|| Self {
                place_m: mesh.place_m(node),
                conductance_s,
                force_n: None,
                area_m2: None,
            })
        };
        nodes.filter_map(part).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solve::{FoundLine, FoundRing};
    use std::f64::consts::PI;

    fn with(contacts: &[FoundContact]) -> Solution {
        Solution { contacts: contacts.to_vec(), ..Solution::default() }
    }

    #[test]
    fn newtons_count_where_all_are_known_and_never_beside_siemens() {
        let pressed = |x_m, force_n| FoundContact {
            force_n,
            apparent_conductance_s: Some(1.0),
            radius_m: Some(2.0),
            ..FoundContact::flat(x_m, 0.0, 9.0)
        };
        let known = Total::of(&with(&[pressed(0.0, Some(1.0)), pressed(4.0, Some(3.0))]), None).unwrap();
        assert_eq!((known.force_n, known.conductance_s, known.centre_m), (Some(4.0), 2.0, [3.0, 0.0, 0.0]));
        assert_eq!(known.area_m2, Some(8.0 * PI));
        let one = Total::of(&with(&[pressed(0.0, Some(1.0)), pressed(4.0, None)]), None).unwrap();
        assert_eq!((one.force_n, one.conductance_s, one.centre_m), (None, 2.0, [2.0, 0.0, 0.0]));
        assert_eq!(Total::of(&Solution::default(), None), None);
    }

    #[test]
    fn a_shape_counts_instead_of_the_contacts_beside_it() {
        let of = |shape| {
            Total::of(&Solution { shape: Some(shape), ..with(&[FoundContact::flat(9.0, 9.0, 9.0)]) }, None).unwrap()
        };
        let (from_m, to_m) = ([1.0, 1.0], [3.0, 1.0]);
        let line =
            of(FoundShape::Line(FoundLine { from_m, to_m, width_m: 0.5, conductance_s: 2.0, uncertainty: None }));
        assert_eq!((line.conductance_s, line.centre_m, line.area_m2), (2.0, [2.0, 1.0, 0.0], Some(1.0)));
        let (centre_m, radius_m) = ([1.0, 2.0], 3.0);
        let ring =
            of(FoundShape::Ring(FoundRing { centre_m, radius_m, width_m: 0.5, conductance_s: 2.0, uncertainty: None }));
        assert_eq!((ring.centre_m, ring.area_m2), ([1.0, 2.0, 0.0], Some(3.0 * PI)));
    }

    #[test]
    fn an_image_is_summed_over_its_mesh() {
        let mesh = ImageMesh {
            nodes_m: vec![[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]],
            places_m: Vec::new(),
            triangles: vec![[0, 1, 2]],
            node_areas_m2: vec![0.5, 1.0, 0.5],
        };
        let solution = Solution { image_s_per_m2: Some(vec![2.0, 3.0, -4.0]), ..Solution::default() };
        let total = Total::of(&solution, Some(&mesh)).unwrap();
        assert_eq!((total.conductance_s, total.centre_m, total.area_m2), (4.0, [1.5, 0.0, 0.0], None));
        assert_eq!(Total::of(&solution, None), None);
    }
}
