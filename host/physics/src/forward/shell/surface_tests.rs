//! The shell on curved surfaces against answers found another way.

use std::f64::consts::{PI, TAU};

use nalgebra::Cholesky;

use super::*;
use crate::detector::surface::shapes;
use crate::detector::{Adc, Layer, Outline, Surface};
use crate::space::{self, Place};

/// Sheet conductance of the detectors made here (S).
const SHEET_S: f64 = 1e-3;
const PAD_M: f64 = 0.002;

fn curved(surface: Surface, places_m: &[Place]) -> Detector {
    let pad = |at: &Place| {
        let [x_m, y_m, z_m] = surface.nearest(*at).place_m;
        Electrode { z_m, ..Electrode::flat(x_m, y_m, PAD_M) }
    };
    let electrodes = places_m.iter().map(pad).collect();
    Detector { outline: surface.outline(), surface: Some(surface), ..flat(Outline::rectangle(1.0, 1.0), electrodes) }
}

fn flat(outline: Outline, electrodes: Vec<Electrode>) -> Detector {
    Detector {
        name: "test".to_owned(),
        outline,
        surface: None,
        unevenness: crate::detector::Unevenness::default(),
        tolerances: crate::detector::Tolerances::default(),
        converters: Vec::new(),
        calibration: None,
        layers: vec![Layer::uniform(0.001, SHEET_S / 0.001)],
        electrodes,
        contact_impedance_ohm_m2: 1e-5,
        drive_v: 2.0,
        ground_v: 0.0,
        on_resistance_ohm: 4.0,
        adc: Adc::default(),
        force: None,
        skin: None,
        correction: None,
    }
}

fn shell(detector: &Detector, nodes: usize) -> Shell {
    Shell::with_nodes(detector, nodes).unwrap_or_else(|error| panic!("{error}"))
}

fn contact_at([x_m, y_m, z_m]: Place) -> Contact {
    Contact { z_m, ..Contact::flat(x_m, y_m, 0.003, 1e-3) }
}

/// Directions all over a sphere.
fn directions() -> Vec<Place> {
    let golden = PI * (3.0 - 5f64.sqrt());
    let at = |i: usize| {
        let z = 1.0 - (2.0 * i as f64 + 1.0) / 16.0;
        let across = (1.0 - z * z).sqrt();
        [across * (golden * i as f64).cos(), across * (golden * i as f64).sin(), z]
    };
    (0..16).map(at).collect()
}

fn sphere(radius_m: f64, divisions: usize) -> Detector {
    let places: Vec<_> = directions().into_iter().map(|at| at.map(|x| radius_m * x)).collect();
    curved(shapes::sphere(radius_m, divisions), &places)
}

fn check_mesh(mesh: &Mesh, detector: &Detector, tolerance: f64) {
    let area_m2: f64 = mesh.node_areas_m2().iter().sum();
    let surface = detector.surface.as_ref().expect("it is curved");
    assert!((area_m2 / surface.area_m2() - 1.0).abs() < 1e-9, "area {area_m2} of {}", surface.area_m2());
    let mut edges = std::collections::HashSet::new();
    for &triangle in &mesh.triangles {
        for edge in crate::detector::edges_of(triangle) {
            assert!(edges.insert(edge), "an edge belongs to two triangles that turn the same way");
        }
    }
    let rims = edges.iter().filter(|(a, b)| !edges.contains(&(*b, *a)));
    let on_rim = |node: u32| surface.clearance_m(mesh.places_m[node as usize]) < 1e-9;
    for (a, b) in rims {
        assert!(on_rim(*a) && on_rim(*b), "triangles fit together but at a rim");
    }
    for (pad, triangles) in mesh.pad_triangles.iter().enumerate() {
        let part = mesh.triangles[triangles.clone()].iter().map(|triangle| mesh.corners(*triangle));
        let pad_m2: f64 = part.map(|[a, b, c]| crate::geometry::cross(a, b, c) / 2.0).sum();
        let share = pad_m2 / (PI * PAD_M * PAD_M);
        assert!((share - 1.0).abs() < tolerance, "pad {pad}: {share} of a disc");
    }
}

#[test]
fn meshes_fit_together_and_keep_areas_and_pads() {
    // Rings that cross edges have more corners, and folds make discs larger.
    for (detector, nodes, tolerance) in [
        (sphere(0.03, 4), 2000, 0.03),
        (sphere(0.03, 12), 2000, 0.03),
        (sphere(0.03, 1), 6000, 0.07),
        (curved(shapes::plate(0.06, 0.06, 1, 1), &[[-0.02, 0.0, 0.0], [0.02, 0.0, 0.0]]), 1500, 0.03),
        (curved(shapes::plate(0.06, 0.06, 7, 11), &[[-0.02, 0.0, 0.0], [0.02, 0.01, 0.0]]), 1500, 0.03),
        (curved(shapes::half_cylinder(0.06, 0.06, 30, 1), &[[-0.01, 0.0, 0.02], [0.01, 0.01, 0.02]]), 1500, 0.03),
    ] {
        let mesh = Mesh::new(&detector, nodes).unwrap_or_else(|error| panic!("{error}"));
        check_mesh(&mesh, &detector, tolerance);
        // A file with many nodes keeps them, and rings have to cross its edges.
        let ratio = mesh.nodes_m.len() as f64 / nodes as f64;
        assert!((0.7..1.6).contains(&ratio), "{} nodes for {nodes}", mesh.nodes_m.len());
        let again = Mesh::new(&detector, nodes).unwrap_or_else(|error| panic!("{error}"));
        assert!(again.places_m == mesh.places_m && again.triangles == mesh.triangles, "the same mesh again");
    }
}

/// Largest error of `N(a, x) - N(b, x)` for two pads of a sphere, which is `ln(|b - x| / |a - x|) / (2 pi s)`: the Neumann function
/// of a sphere is the logarithm of the chord, and what leaves evenly all over drops out of the difference. In `1 / (2 pi s)`.
fn sphere_error(divisions: usize, nodes: usize) -> f64 {
    let places = [[0.3, 0.5, 0.81], [-0.6, 0.48, -0.64]].map(|at: Place| at.map(|x| 0.03 * x / space::length(at)));
    let detector = curved(shapes::sphere(0.03, divisions), &places);
    let shell = shell(&detector, nodes);
    let differs = |node: usize, at: Place| {
        let ours = shell.fields_ohm[(node, 0)] - shell.fields_ohm[(node, 1)];
        ours * TAU * SHEET_S - (space::distance(places[1], at) / space::distance(places[0], at)).ln()
    };
    // At a pad itself, its radius matters.
    let far = |at: Place| places.iter().all(|pad| space::distance(at, *pad) > 0.006);
    let nodes = shell.mesh.places_m.iter().enumerate().filter(|(_, at)| far(**at));
    nodes.map(|(node, at)| differs(node, *at).abs()).fold(0.0, f64::max)
}

#[test]
fn a_sphere_has_the_logarithm_of_the_chord() {
    let errors = [(6, 2000), (12, 8000), (24, 32_000)].map(|(divisions, nodes)| sphere_error(divisions, nodes));
    assert!(errors[1] < 0.02 && errors[2] < 0.01, "{errors:?} of 1 / (2 pi s)");
    assert!(errors[2] < errors[1] && errors[1] < errors[0], "{errors:?}");
}

/// Four pads of a 60 mm square, and contacts on it.
const PADS_M: [[f64; 2]; 4] = [[-0.02, -0.017], [0.021, -0.013], [0.019, 0.018], [-0.016, 0.02]];
const CONTACTS_M: [[f64; 2]; 2] = [[0.004, -0.006], [-0.012, 0.003]];

fn rectangle_readings() -> crate::readings::Readings {
    let pads = PADS_M.iter().map(|[x, y]| Electrode::flat(*x, *y, PAD_M)).collect();
    let detector = flat(Outline::rectangle(0.06, 0.06), pads);
    let contacts = CONTACTS_M.map(|[x, y]| contact_at([x, y, 0.0]));
    readings(&detector, &contacts)
}

fn readings(detector: &Detector, contacts: &[Contact]) -> crate::readings::Readings {
    let impedance_ohm = shell(detector, 8000).impedance_ohm(contacts).unwrap_or_else(|error| panic!("{error}"));
    crate::forward::readings_v(&impedance_ohm, detector)
}

/// Largest difference over the largest reading.
fn apart(ours: &crate::readings::Readings, theirs: &crate::readings::Readings) -> f64 {
    let pairs = ours.volts().iter().zip(theirs.volts());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / theirs.largest_v()
}

#[test]
fn a_plate_from_a_file_reads_as_the_rectangle() {
    let expected = rectangle_readings();
    for (columns, rows) in [(1, 1), (5, 8)] {
        let detector = curved(shapes::plate(0.06, 0.06, columns, rows), &PADS_M.map(|[x, y]| [x, y, 0.0]));
        let found = readings(&detector, &CONTACTS_M.map(|[x, y]| contact_at([x, y, 0.0])));
        assert!(apart(&found, &expected) < 0.004, "{columns} x {rows}: {}", apart(&found, &expected));
    }
}

#[test]
fn a_half_cylinder_reads_as_the_rectangle_it_was_bent_from() {
    let expected = rectangle_readings();
    let radius_m = 0.06 / PI;
    let bent = |[x, y]: [f64; 2]| [radius_m * (x / radius_m).sin(), y, radius_m * (x / radius_m).cos()];
    let detector = curved(shapes::half_cylinder(0.06, 0.06, 40, 1), &PADS_M.map(bent));
    let found = readings(&detector, &CONTACTS_M.map(bent).map(contact_at));
    assert!(apart(&found, &expected) < 0.008, "{}", apart(&found, &expected));
}

#[test]
fn reciprocity_and_the_balance_of_currents_hold_on_a_ball() -> Result<(), ForwardError> {
    let detector = sphere(0.03, 5);
    let shell = shell(&detector, 2000);
    let contacts = [contact_at([0.0, 0.0, 0.03]), contact_at([0.018, -0.024, 0.0])];
    let impedance = shell.impedance_ohm(&contacts)?;
    assert!((&impedance - impedance.transpose()).amax() < 1e-10 * impedance.amax());
    assert!(Cholesky::new(impedance).is_some(), "Z is positive definite");
    let conductances_s = shell.node_conductances_s(&contacts)?;
    let fields = shell.image_fields(&conductances_s)?;
    for electrode in 0..16 {
        let current_a: f64 =
            conductances_s.iter().zip(fields.nodes_ohm.column(electrode).iter()).map(|(s, ohm)| s * ohm).sum();
        assert!((current_a - 1.0).abs() < 1e-9, "{current_a} A");
    }
    let total_s: f64 = conductances_s.iter().sum();
    assert!((total_s / 2e-3 - 1.0).abs() < 0.01, "a ball within a sphere about its surface is a disc: {total_s} S");
    Ok(())
}

#[test]
fn a_disc_touches_its_own_side_only_and_nothing_far_away() -> Result<(), ForwardError> {
    // A ball so small that a contact's sphere holds both its sides.
    let detector = sphere(0.008, 4);
    let shell = shell(&detector, 1500);
    let wide = Contact { radius_m: 0.0159, ..contact_at([0.0, 0.0, 0.008]) };
    let touched = shell.node_conductances_s(&[wide])?;
    let is_near = |(place, s): (&[f64; 3], &f64)| *s == 0.0 || place[2] > -0.004;
    assert!(shell.mesh.places_m.iter().zip(&touched).all(is_near), "the far side is free");
    let off = shell.impedance_ohm(&[contact_at([0.02, 0.0, 0.0])]);
    assert!(matches!(off, Err(ForwardError::Contact { index: 0, .. })));
    Ok(())
}

#[test]
fn a_press_on_an_l_is_where_another_mesh_finds_it() -> Result<(), ForwardError> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/detectors/l-shape.toml");
    let detector = Detector::read(file.as_ref()).unwrap_or_else(|error| panic!("{error}"));
    let [fine, coarse] = [6000, 1500].map(|nodes| shell(&detector, nodes));
    for at in [[0.005, -0.028], [-0.03, 0.02], [0.032, -0.02]] {
        let press = Contact::flat(at[0], at[1], 0.002, 1e-4);
        let truth = crate::forward::readings_v(&fine.impedance_ohm(&[press])?, &detector);
        let mut best = (f64::INFINITY, [f64::NAN; 2]);
        for node in coarse.image_mesh().nodes_m.iter() {
            let tried = Contact::flat(node[0], node[1], 0.002, 1e-4);
            // Nodes at the edge have discs that overhang: less conductance, so no answer for this one.
            let Ok(impedance_ohm) = coarse.impedance_ohm(&[tried]) else { continue };
            let residual = apart(&crate::forward::readings_v(&impedance_ohm, &detector), &truth);
            if residual < best.0 {
                best = (residual, *node);
            }
        }
        assert!(crate::geometry::distance(best.1, at) < 0.0015 && best.0 < 0.1, "{at:?}: {best:?}");
    }
    Ok(())
}
