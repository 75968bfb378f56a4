//! Unevenness against answers known otherwise.

use super::*;
use crate::detector::{Layer, Unevenness};
use crate::forward::DiscFields;
use crate::forward::shell::Shell;

/// A detector whose conductivity differs by a few cosines, a tenth each.
fn uneven(thickness_m: f64) -> Detector {
    let mut detector = Detector { layers: vec![Layer::uniform(thickness_m, 0.2273)], ..Detector::default() };
    detector.unevenness.add([1, 0], 0.1);
    detector.unevenness.add([2, 1], -0.1);
    detector.unevenness.add([0, 3], 0.05);
    detector
}

fn presses() -> Vec<Contact> {
    vec![Contact::flat(0.011, -0.004, 0.003, 1e-3), Contact::flat(-0.02, 0.014, 0.003, 2e-4)]
}

#[test]
fn on_a_thin_slab_unevenness_does_what_it_does_to_the_shell() {
    let mut detector = uneven(0.0005);
    detector.electrodes.iter_mut().for_each(|pad| pad.radius_m = 0.001);
    let even = Detector { unevenness: Unevenness::default(), ..detector.clone() };
    // Between four electrodes, `N(0, e) - N(0, f) - N(5, e) + N(5, f)`: without the parts of pads and contacts that only a slab has.
    let between_four = |model: &dyn ForwardModel| {
        let z = model.impedance_ohm(&presses()[..1]).unwrap();
        DMatrix::from_fn(16, 16, |e, f| {
            if [0, 5].iter().any(|a| [e, f].contains(a)) { 0.0 } else { z[(0, e)] - z[(0, f)] - z[(5, e)] + z[(5, f)] }
        })
    };
    let slab = |detector: &Detector| between_four(&Slab::new(detector).unwrap());
    let shell = |detector: &Detector| between_four(&Shell::with_nodes(detector, 6000).unwrap());
    let (ours, theirs) = (slab(&detector) - slab(&even), shell(&detector) - shell(&even));
    let off = (&ours - &theirs).amax() / theirs.amax();
    assert!(off < 0.015, "{off}");
}

#[test]
fn unevenness_needs_few_modes() {
    let detector = uneven(0.005);
    let of = |uneven_modes| {
        let resolution = Resolution { uneven_modes, ..Resolution::STANDARD };
        Slab::with_resolution(&detector, resolution).unwrap().impedance_ohm(&presses()).unwrap()
    };
    let fine = of(20);
    let off = (of(Resolution::STANDARD.uneven_modes) - &fine).amax() / fine.amax();
    assert!(off < 3e-4, "{off}");
}

#[test]
fn the_same_factor_everywhere_is_another_conductivity() {
    let mut factor = Detector::default();
    factor.unevenness.add([0, 0], 0.3);
    let mut other = Detector::default();
    other
        .layers
        .iter_mut()
        .for_each(|layer| *layer = Layer::uniform(layer.thickness_m, 0.3f64.exp() * layer.top_s_per_m));
    let [a, b] = [&factor, &other].map(|detector| Slab::new(detector).unwrap().impedance_ohm(&presses()).unwrap());
    assert!((&a - &b).amax() < 1e-6 * b.amax(), "{}", (&a - &b).amax() / b.amax());
}

#[test]
fn an_uneven_slab_is_reciprocal_and_its_images_are_its_discs() {
    let slab = Slab::new(&uneven(0.005)).unwrap();
    let impedance_ohm = slab.impedance_ohm(&presses()).unwrap();
    assert!((&impedance_ohm - impedance_ohm.transpose()).amax() < 1e-9 * impedance_ohm.amax());
    // A light image is a sum over its nodes of what a point does.
    let mesh = slab.image_mesh();
    let node = (0..mesh.nodes_m.len()).min_by(|a, b| {
        let off = |node: &usize| (mesh.nodes_m[*node][0] - 0.011).hypot(mesh.nodes_m[*node][1] + 0.004);
        off(a).total_cmp(&off(b))
    });
    let node = node.unwrap();
    let [x_m, y_m] = mesh.nodes_m[node];
    let radius_m = (mesh.node_areas_m2[node] / std::f64::consts::PI).sqrt();
    let image = slab.image_impedance_ohm(&mesh.image_with([(node, 1e-4)])).unwrap();
    let disc = slab.impedance_ohm(&[Contact::flat(x_m, y_m, radius_m, 1e-4)]).unwrap();
    assert!((&image - &disc).amax() < 2e-3 * disc.amax(), "{}", (&image - &disc).amax() / disc.amax());
}

/// On even and uneven slabs, in the middle and where walls cut them.
#[test]
fn fields_of_a_disc_are_those_that_light_contacts_tell() {
    for detector in [Detector::default(), uneven(0.005)] {
        let slab = Slab::new(&detector).unwrap();
        for (place_m, radius_m) in [([0.004, -0.011], 0.0015), ([0.0117, 0.0161], 0.0055), ([-0.0295, 0.0], 0.003)] {
            let (found, told) =
                (slab.disc_fields(place_m, radius_m).unwrap(), DiscFields::of_light(&slab, place_m, radius_m).unwrap());
            let largest = told.electrodes_ohm.iter().fold(0.0f64, |most, ohm| most.max(ohm.abs()));
            for (a, b) in found.electrodes_ohm.iter().zip(&told.electrodes_ohm) {
                assert!((a - b).abs() < 1e-3 * largest, "{place_m:?}: {found:?} {told:?}");
            }
            assert!((found.own_ohm / told.own_ohm - 1.0).abs() < 2e-3, "{place_m:?}: {found:?} {told:?}");
            assert!((found.share - told.share).abs() < 1e-3, "{place_m:?}: {found:?} {told:?}");
        }
    }
}
