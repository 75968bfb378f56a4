//! Slabs with dots of glue against answers known otherwise.

use std::f64::consts::PI;

use nalgebra::DMatrix;

use super::{DotCurrent, Face, grid};
use crate::detector::{Bond, Detector, Electrode, Layer, Outline, Parameter};
use crate::forward::slab::{Resolution, Slab};
use crate::forward::{ConnectingPoints, DrivingLayer, ForwardModel, readings_v};
use crate::scene::Contact;

/// A small detector of two layers of 2 and 3 mm, with four pads.
fn small(bond: Option<Bond>) -> Detector {
    let pad = |x: f64, y: f64| Electrode::flat(0.006 * x, 0.006 * y, 0.002);
    Detector {
        outline: Outline::rectangle(0.024, 0.024),
        layers: vec![Layer::uniform(0.002, 0.5), Layer { bond, ..Layer::uniform(0.003, 0.2) }],
        electrodes: vec![pad(-1.0, -1.0), pad(1.0, -1.0), pad(-1.0, 1.0), pad(1.0, 1.0)],
        ..Detector::default()
    }
}

fn dots(grid: usize, diameter_m: f64) -> Bond {
    Bond::of_dots([grid, grid], diameter_m)
}

fn press() -> Contact {
    Contact::flat(0.0015, -0.0035, 0.0025, 1e-3)
}

/// Largest difference of a reading, as a share of the largest reading.
fn apart(detector: &Detector, a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    let [a, b] = [a, b].map(|z| readings_v(z, detector));
    let largest = a.volts().iter().zip(b.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    largest / b.largest_v()
}

fn pressed(detector: &Detector) -> DMatrix<f64> {
    Slab::new(detector).unwrap().impedance_ohm(&[press()]).unwrap()
}

/// With cubes of two edges, the second half of the first, and their difference once more: the error falls in proportion to the edge.
fn extrapolated(detector: &Detector, edge_m: f64) -> [DMatrix<f64>; 3] {
    let [coarse, fine] = [edge_m, edge_m / 2.0].map(|edge_m| grid::impedance_ohm(detector, &[press()], edge_m));
    let better = &fine * 2.0 - &coarse;
    [coarse, fine, better]
}

/// Glue as the paper's, glue that hardly carries anything along itself, and glue that hardly touches the layers.
fn glues() -> [Bond; 3] {
    let usual = dots(3, 0.005);
    [
        usual,
        Bond { sheet_conductance_s: 1e-4, ..usual },
        Bond { contact_impedance_ohm_m2: 3e-3, sheet_conductance_s: 1e-3, ..usual },
    ]
}

#[test]
fn cubes_agree() {
    for bond in glues() {
        let detector = small(Some(bond));
        let [coarse, fine, better] =
            extrapolated(&detector, 1e-3).map(|cubes| apart(&detector, &cubes, &pressed(&detector)));
        assert!(better < 0.01 && fine < 0.6 * coarse, "{bond:?}: {coarse} {fine}, extrapolated {better}");
    }
}

/// Prints the figures of docs/validation.md.
#[test]
#[ignore = "takes minutes: cubes of 0.25 mm"]
fn cubes_agree_the_better_the_finer() {
    let wide = [dots(3, 0.002), dots(3, 0.0065), dots(3, 0.0075), dots(3, 0.008)];
    for bond in glues().into_iter().chain(wide) {
        let detector = small(Some(bond));
        let slab = pressed(&detector);
        let [_, rough, _] = extrapolated(&detector, 2e-3);
        let all = extrapolated(&detector, 0.5e-3);
        let [coarse, fine, better] = all.map(|cubes| apart(&detector, &cubes, &slab));
        let rough = apart(&detector, &rough, &slab);
        println!(
            "{} {:e} S: {rough:.4} {coarse:.4} {fine:.4}, extrapolated {better:.4}",
            bond.summary(),
            bond.sheet_conductance_s
        );
        assert!(better < if bond.diameter_m > 0.0077 { 0.04 } else { 0.01 }, "{bond:?}");
    }
}

#[test]
fn more_densities_change_little_even_where_dots_nearly_touch() {
    for (diameter_m, tolerance) in [(0.005, 1e-3), (0.007, 1.5e-3), (0.008, 0.015)] {
        let detector = small(Some(dots(3, diameter_m)));
        let finest = Resolution { dot_degree: 8, ..Resolution::STANDARD };
        let fine = Slab::with_resolution(&detector, finest).unwrap().impedance_ohm(&[press()]).unwrap();
        let off = apart(&detector, &pressed(&detector), &fine);
        assert!(off < tolerance, "{diameter_m}: {off}");
    }
}

/// The finer the dots that touch each other, the nearer to layers that touch all over: the gaps between them are in proportion to the dots.
#[test]
fn many_small_dots_are_full_contact() {
    let full = pressed(&small(None));
    let errors = [2, 4, 8].map(|count| {
        let bond =
            Bond { contact_impedance_ohm_m2: 0.0, sheet_conductance_s: 1e-6, ..dots(count, 0.024 / count as f64) };
        let detector = small(Some(bond));
        apart(&detector, &pressed(&detector), &full)
    });
    assert!(errors[2] < 0.4 * errors[0] && errors[2] < 0.002, "{errors:?}");
}

/// One dot takes up what enters the upper layer, so that the impedances are those of the lower layer with a contact in the dot's place, and
/// the upper layer's resistance from the dot as a pad.
#[test]
fn one_dot_is_a_resistor_between_two_slabs() {
    let bond = dots(1, 0.004);
    let detector = small(Some(bond));
    let dot = Contact::flat(0.0, 0.0, 0.002, PI * 0.002 * 0.002 / bond.contact_impedance_ohm_m2);
    let lower = Detector { layers: vec![detector.layers[0]], ..detector.clone() };
    let lower_ohm = Slab::with_resolution(&lower, Resolution::FINE).unwrap().impedance_ohm(&[dot]).unwrap();
    let upper = Detector {
        layers: vec![Layer { bond: None, ..detector.layers[1] }],
        electrodes: vec![Electrode::flat(0.0, 0.0, 0.002)],
        contact_impedance_ohm_m2: bond.contact_impedance_ohm_m2,
        ..detector.clone()
    };
    let points = ConnectingPoints::Two;
    for driving in [
        DrivingLayer::default(),
        DrivingLayer { sheet_ohm: 300.0, points, ..DrivingLayer::default() },
        DrivingLayer { sheet_ohm: 300.0, points, leak_s: 1e-4 },
    ] {
        let of = |detector: &Detector| {
            Slab::under(detector, Resolution::FINE, driving).unwrap().impedance_ohm(&[press()]).unwrap()
        };
        let (found, expected) = (of(&detector), lower_ohm.add_scalar(of(&upper)[0]));
        let off = (&found - &expected).amax() / expected.amax();
        assert!(off < 1e-3, "{driving:?}: {off}");
    }
}

#[test]
fn a_small_dot_spreads_its_current_as_holm_has_it() {
    let [wide, narrow] = [0.001, 0.0005].map(|radius_m| pressed(&small(Some(dots(1, 2.0 * radius_m)))));
    let glue_ohm = |radius_m: f64| 2.0 * 1e-5 / (PI * radius_m * radius_m);
    let holm_ohm = |radius_m: f64| (1.0 / 0.5 + 1.0 / 0.2) / (4.0 * radius_m) + glue_ohm(radius_m);
    let ratio = (narrow - wide) / (holm_ohm(0.0005) - holm_ohm(0.001));
    assert!(ratio.add_scalar(-1.0).amax() < 0.02, "{ratio}");
}

#[test]
fn impedances_are_reciprocal_and_images_are_their_discs() {
    let slab = Slab::new(&small(Some(dots(3, 0.005)))).unwrap();
    let both = slab.impedance_ohm(&[press(), Contact::flat(-0.008, 0.011, 0.002, 1e-6)]).unwrap();
    assert!((&both - both.transpose()).amax() < 1e-12 * both.amax());
    assert!(both.symmetric_eigenvalues().min() > 0.0);
    let mesh = slab.image_mesh();
    let node = mesh.nodes_m.iter().position(|at| at[0].abs() < 4e-4 && (at[1] - 0.004).abs() < 4e-4).unwrap();
    let [x_m, y_m] = mesh.nodes_m[node];
    let disc = Contact::flat(x_m, y_m, (mesh.node_areas_m2[node] / PI).sqrt(), 1e-5);
    let image = slab.image_fields(&mesh.image_with([(node, 1e-5)])).unwrap();
    let disc_ohm = slab.impedance_ohm(&[disc]).unwrap();
    assert!((&image.impedance_ohm - &disc_ohm).amax() < 1e-3 * disc_ohm.amax());
    // A node's potentials are those that a light contact there would be at: its fields less those of the ground.
    let fields = |e: usize, f: usize| slab.fields_ohm()[(node, e)] - slab.fields_ohm()[(node, f)];
    let expected = image.impedance_ohm.column(1) - image.impedance_ohm.column(3);
    let bare = slab.electrode_fields_ohm();
    for e in 0..4 {
        let light = bare[(e, 1)] - bare[(e, 3)] - fields(1, 3);
        assert!((light - expected[e]).abs() < 1e-3 * expected.amax(), "{e}: {light} {}", expected[e]);
    }
}

#[test]
fn changes_are_those_of_replaced_contacts_and_detectors() {
    let slab = Slab::new(&small(Some(dots(3, 0.005)))).unwrap();
    let moved = Contact { x_m: press().x_m + 1e-5, ..press() };
    let (before, changes) = slab.impedance_with_changes_ohm(&[press()], &[(0, moved)]).unwrap();
    let expected = slab.impedance_ohm(&[moved]).unwrap() - before;
    assert!((&changes[0] - &expected).amax() < 0.02 * expected.amax());
    for parameter in [Parameter::ElectrodeX(1), Parameter::Uneven([1, 0]), Parameter::Thickness] {
        let other = slab.detector().stepped(&[(parameter, 1e-4)]);
        let similar = slab.of_similar(&other).unwrap().impedance_ohm(&[press()]).unwrap();
        let off = (&similar - pressed(&other)).amax();
        assert!(off < 1e-9 * similar.amax(), "{parameter}: {off}");
    }
}

#[test]
fn unevenness_changes_both_layers() {
    let even = small(Some(Bond { contact_impedance_ohm_m2: 0.0, sheet_conductance_s: 1e3, ..dots(3, 0.005) }));
    let even = Detector { contact_impedance_ohm_m2: 0.0, ..even };
    let scaled = even.stepped(&[(Parameter::Conductivity, 0.2)]);
    let factor = even.stepped(&[(Parameter::Uneven([0, 0]), 0.2)]);
    let [a, b] = [&scaled, &factor].map(pressed);
    assert!((&a - &b).amax() < 1e-6 * a.amax(), "{}", (&a - &b).amax() / a.amax());
    // A layer that is uneven is worse on one side: mirrored, it is worse on the other.
    let mirrored = |amplitude: f64, x_m: f64| {
        let slab = Slab::new(&even.stepped(&[(Parameter::Uneven([1, 0]), amplitude)])).unwrap();
        slab.impedance_ohm(&[Contact { x_m, ..press() }]).unwrap()
    };
    let (left, right, none) = (mirrored(0.3, 0.004), mirrored(-0.3, -0.004), mirrored(0.0, 0.004));
    let mirror = DMatrix::from_fn(4, 4, |e, f| right[(e ^ 1, f ^ 1)]);
    assert!(apart(&even, &left, &mirror) < 2e-3 && apart(&even, &left, &none) > 0.02);
}

#[test]
fn dots_carry_the_contacts_current_and_spread_it() {
    let detector = small(Some(dots(3, 0.005)));
    let slab = Slab::new(&detector).unwrap();
    let currents = slab.dot_currents().unwrap().unwrap().at(2, &[press()]).unwrap();
    let impedance_ohm = slab.impedance_ohm(&[press()]).unwrap();
    let all_a = detector.drive_v / (impedance_ohm[(2, 2)] + detector.on_resistance_ohm);
    let sum_a: f64 = currents.iter().map(|dot| dot.current_a).sum();
    assert!((sum_a / all_a - 1.0).abs() < 1e-9, "{sum_a} {all_a}");
    let largest = currents.iter().max_by(|a, b| a.current_a.total_cmp(&b.current_a)).unwrap();
    assert_eq!(largest.centre_m, [0.0, 0.0], "under the press, on its way to electrode 2");
    for face in [Face::Upper, Face::Lower] {
        // Over rings of equal area, 40 points around.
        let ring =
            |i: usize| (0..40).map(move |j| (0.0025 * ((i as f64 + 0.5) / 400.0).sqrt(), 2.0 * PI * j as f64 / 40.0));
        let mean = |dot: &DotCurrent| {
            let points = (0..400).flat_map(ring);
            let at = |(r, angle): (f64, f64)| dot.density_a_per_m2(face, [r * angle.cos(), r * angle.sin()]);
            points.map(at).sum::<f64>() / 16e3
        };
        assert!((mean(largest) / largest.mean_density_a_per_m2() - 1.0).abs() < 2e-3, "{face:?}");
    }
    let lone = Slab::new(&small(Some(dots(1, 0.005)))).unwrap();
    let lone = &lone.dot_currents().unwrap().unwrap().at(2, &[press()]).unwrap()[0];
    let [middle, rim] = [0.0, 0.95].map(|share| lone.density_a_per_m2(Face::Lower, [0.0, share * 0.0025]));
    assert!(
        rim > middle && lone.density_a_per_m2(Face::Lower, [0.0, 0.0026]) == 0.0,
        "crowded at the rim: {rim} {middle}"
    );
    assert!(Slab::new(&small(None)).unwrap().dot_currents().unwrap().is_none());
}

/// Standard error (m) that noise leaves of the place of a contact whose conductance is not known either (Cramer and Rao), root of the sum of squares of
/// x and y.
fn place_error_m(detector: &Detector, contact: Contact) -> f64 {
    let slab = Slab::new(detector).unwrap();
    let readings = |contact: Contact| readings_v(&slab.impedance_ohm(&[contact]).unwrap(), detector);
    let (step_m, log) = (1e-5, 1e-3f64);
    let moved = [
        (Contact { x_m: contact.x_m + step_m, ..contact }, step_m),
        (Contact { y_m: contact.y_m + step_m, ..contact }, step_m),
        (Contact { conductance_s: contact.conductance_s * log.exp(), ..contact }, log),
    ];
    let before = readings(contact);
    let slope = |(moved, step): (Contact, f64)| -> Vec<f64> {
        let after = readings(moved);
        after.volts().iter().zip(before.volts()).map(|(a, b)| (a - b) / step / detector.adc.deviation_v()).collect()
    };
    let slopes = moved.map(slope);
    let information = DMatrix::from_fn(3, 3, |i, j| slopes[i].iter().zip(&slopes[j]).map(|(a, b)| a * b).sum());
    let covariance: DMatrix<f64> = information.try_inverse().unwrap();
    (covariance[(0, 0)] + covariance[(1, 1)]).sqrt()
}

/// Dots leave less of the place in the readings than layers that touch all over. Glue that is a conductor along itself makes wide dots worse,
/// since current spreads in it; glue that is none makes them better.
#[test]
fn glue_that_conducts_along_itself_costs_places() {
    let contact = Contact::flat(0.006, 0.004, 0.0025, 1e-3);
    let error_m = |bond: Option<Bond>| {
        let mut detector = Detector::preset("BB-5x5").unwrap();
        detector.layers[1].bond = bond;
        place_error_m(&detector, contact)
    };
    let of_glue = |sheet_conductance_s| error_m(Some(Bond { sheet_conductance_s, ..dots(5, 0.0108) }));
    let [full, poor, good] = [error_m(None), of_glue(1e-6), of_glue(10.0)];
    assert!(poor < 1.1 * full && good > 1.4 * full, "{full} {poor} {good}");
}
