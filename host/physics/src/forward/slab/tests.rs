//! The slab against answers known otherwise.

use super::*;
use crate::detector::{Electrode, Layer, Outline, Parameter};
use crate::forward::contact::conducting_patches;
use crate::forward::readings_v;
use crate::forward::shell::Shell;
use crate::readings::Readings;

fn square(thickness_m: f64, radius_m: f64) -> Detector {
    let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
    detector.layers = vec![Layer::uniform(thickness_m, 0.25)];
    detector.electrodes.iter_mut().for_each(|pad| pad.radius_m = radius_m);
    detector
}

fn contact(x_m: f64, y_m: f64, radius_m: f64, conductance_s: f64) -> Contact {
    Contact::flat(x_m, y_m, radius_m, conductance_s)
}

/// Largest difference of a reading, as a share of the largest reading.
fn apart(detector: &Detector, a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    let [a, b] = [a, b].map(|z| readings_v(z, detector));
    let largest = a.volts().iter().zip(b.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    largest / b.largest_v()
}

#[test]
fn impedance_is_symmetric_and_positive_definite() {
    let slab = Slab::new(&square(0.005, 0.002)).unwrap();
    let z = slab.impedance_ohm(&[contact(0.01, 0.004, 0.002, 1e-3), contact(-0.027, 0.0, 0.003, 1e-6)]).unwrap();
    assert!((&z - z.transpose()).amax() < 1e-9 * z.amax());
    assert!(z.symmetric_eigenvalues().min() > 0.0);
}

#[test]
fn more_densities_change_next_to_nothing() {
    let mut detector = square(0.01, 0.002);
    detector.layers = vec![Layer::graded(0.01, [1.0, 0.01])];
    let contacts = [contact(-0.01, 0.012, 0.002, 1e-3), contact(0.012, -0.02, 0.006, 1e-2)];
    let finest = Resolution { pad_degree: 4, contact_degree: 6, ..Resolution::FINE };
    let [coarse, fine] = [Resolution::STANDARD, finest]
        .map(|resolution| Slab::with_resolution(&detector, resolution).unwrap().impedance_ohm(&contacts).unwrap());
    assert!(apart(&detector, &coarse, &fine) < 2e-3, "{}", apart(&detector, &coarse, &fine));
}

#[test]
fn a_mirrored_contact_gives_mirrored_readings() {
    let slab = Slab::new(&square(0.005, 0.002)).unwrap();
    let [left, right] =
        [-1.0, 1.0].map(|sign| slab.impedance_ohm(&[contact(sign * 0.0265, 0.005, 0.002, 1e-3)]).unwrap());
    let mirror = |e: usize| e / 4 * 4 + 3 - e % 4;
    let mirrored = DMatrix::from_fn(16, 16, |i, j| left[(mirror(i), mirror(j))]);
    // The points of a disc are not mirror images of each other.
    assert!(apart(slab.detector(), &mirrored, &right) < 1e-3, "{}", apart(slab.detector(), &mirrored, &right));
}

#[test]
fn a_thin_slab_has_the_fields_of_the_sheet() {
    let (detector, sheet_s) = (square(0.0008, 0.0004), 0.25 * 0.0008);
    let slab = Slab::new(&detector).unwrap();
    let mesh = slab.image_mesh();
    let node = mesh.nodes_m.iter().position(|at| at[0].abs() < 8e-4 && (at[1] - 0.015).abs() < 8e-4).unwrap();
    let fields = slab.fields_ohm();
    let [e, f] = [0, 6];
    let found = fields[(node, e)] - fields[(node, f)];
    let place = |index: usize| {
        let Electrode { x_m, y_m, .. } = detector.electrodes[index];
        from_corner([0.06, 0.06], [x_m, y_m])
    };
    let expected = sheet_series(sheet_s, place(e), from_corner([0.06, 0.06], mesh.nodes_m[node]))
        - sheet_series(sheet_s, place(f), from_corner([0.06, 0.06], mesh.nodes_m[node]));
    assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
}

/// Neumann function of a thin square sheet of side 0.06 m by its cosine series, less its mean.
fn sheet_series(sheet_s: f64, a: [f64; 2], b: [f64; 2]) -> f64 {
    let wave = |m: u32| f64::from(m) * std::f64::consts::PI / 0.06;
    let mut sum = 0.0;
    for i in 1..300_u32 * 300 {
        let (m, n) = (i / 300, i % 300);
        let count = if m == 0 || n == 0 { 2.0 } else { 4.0 };
        let k2 = wave(m).powi(2) + wave(n).powi(2);
        let x = (wave(m) * a[0]).cos() * (wave(m) * b[0]).cos();
        sum += count * x * (wave(n) * a[1]).cos() * (wave(n) * b[1]).cos() / k2;
    }
    sum / (0.06 * 0.06 * sheet_s)
}

#[test]
fn the_thin_limit_is_the_shell() {
    let press = [contact(-0.012, 0.007, 0.003, 1e-4)];
    let errors = [0.001, 0.00025].map(|thickness_m| {
        let mut detector = square(thickness_m, 0.002);
        detector.layers[0] = Layer::uniform(thickness_m, 0.3e-3 / thickness_m);
        let [slab, shell] = [
            Slab::new(&detector).unwrap().impedance_ohm(&press).unwrap(),
            Shell::with_nodes(&detector, 8000).unwrap().impedance_ohm(&press).unwrap(),
        ];
        apart(&detector, &shell, &slab)
    });
    // What the shell lacks is the resistance across, in proportion to the thickness.
    assert!(errors[1] < 0.02 && errors[1] < 0.5 * errors[0], "{errors:?}");
}

#[test]
fn discs_cut_by_walls_are_those_of_the_shell() {
    let mut detector = square(0.00025, 0.002);
    detector.layers[0] = Layer::uniform(0.00025, 0.3e-3 / 0.00025);
    let (slab, shell) = (Slab::new(&detector).unwrap(), Shell::with_nodes(&detector, 8000).unwrap());
    let both =
        |press: &[Contact]| [&slab as &dyn ForwardModel, &shell].map(|model| model.impedance_ohm(press).unwrap());
    // Away from the wall, the two are as far apart as the thickness makes them.
    let [inner, inner_shell] = both(&[contact(0.0, -0.012, 0.003, 1e-4)]);
    let usual = apart(&detector, &inner_shell, &inner);
    for (x_m, y_m) in [(0.0, -0.0295), (0.013, 0.03), (-0.0282, 0.007), (0.0285, 0.0291), (-0.03, 0.03)] {
        let [cut, cut_shell] = both(&[contact(x_m, y_m, 0.003, 1e-4)]);
        let off = apart(&detector, &cut_shell, &cut);
        assert!(off < usual + 0.01, "{x_m} {y_m}: {off}, {usual} elsewhere");
    }
}

#[test]
fn discs_go_on_into_walls_without_a_jump() {
    let detector = square(0.005, 0.002);
    let slab = Slab::new(&detector).unwrap();
    let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap();
    let readings = |model: &Slab, y_m: f64| {
        readings_v(&model.impedance_ohm(&[contact(0.003, y_m, 0.0025, 5e-4)]).unwrap(), &detector)
    };
    let off = |a: &Readings, b: &Readings| {
        a.volts().iter().zip(b.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / b.largest_v()
    };
    let steps: Vec<_> = (0..58).map(|i| 0.0265 + 6e-5 * f64::from(i)).map(|y_m| readings(&slab, y_m)).collect();
    let changes: Vec<_> = steps.windows(2).map(|pair| off(&pair[0], &pair[1])).collect();
    assert!(changes.windows(2).all(|pair| (pair[0] - pair[1]).abs() < 4e-3), "{changes:?}");
    // The conductance of what is left counts: half a disc is half of it.
    for y_m in [0.027, 0.0285, 0.0295, 0.03] {
        assert!(off(&readings(&slab, y_m), &readings(&fine, y_m)) < 0.01, "{y_m}");
    }
}

#[test]
fn spots_near_walls_read_as_discs_do_but_for_crowded_current() {
    let slab = Slab::new(&square(0.005, 0.002)).unwrap();
    let spots = slab.spots(0.0025).unwrap();
    for [x_m, y_m] in [[0.003, 0.0293], [-0.0264, 0.001], [0.0284, 0.0277], [0.0, -0.0299]] {
        let pair = [contact(x_m, y_m, 0.0025, 2e-5), contact(0.02, -0.021, 0.0025, 1e-5)];
        let at = pair.map(|disc| spots.spot([disc.x_m, disc.y_m, 0.0]));
        let cross = DMatrix::from_fn(2, 16, |k, e| at[k].electrodes_ohm[e]);
        let apart_ohm = spots.between_ohm(&at[0], &at[1]);
        let between = DMatrix::from_row_slice(2, 2, &[at[0].own_ohm, apart_ohm, apart_ohm, at[1].own_ohm]);
        let on_it = [0, 1].map(|k| pair[k].conductance_s * at[k].share);
        let found = conducting_patches(slab.electrode_fields_ohm(), &cross, between, &on_it).impedance_ohm().unwrap();
        let off = apart(slab.detector(), &found, &slab.impedance_ohm(&pair).unwrap());
        // Up to 0.3 %; single points in their place would be off by 11 % in the corner and 30 % at a wall.
        assert!(off < 0.005, "{x_m} {y_m}: {off}");
    }
}

#[test]
fn a_layer_cut_in_two_stays_the_same_detector() {
    let whole = square(0.006, 0.002);
    let mut cut = whole.clone();
    cut.layers = vec![Layer::uniform(0.0015, 0.25), Layer::uniform(0.0045, 0.25)];
    let press = [contact(0.003, -0.008, 0.002, 1e-3)];
    let [a, b] = [&whole, &cut].map(|detector| Slab::new(detector).unwrap().impedance_ohm(&press).unwrap());
    assert!(apart(&whole, &a, &b) < 1e-9);
}

#[test]
fn light_contacts_obey_the_linear_theory() {
    let mut detector = square(0.005, 0.002);
    // The linear theory grounds the electrode without a resistance.
    detector.on_resistance_ohm = 0.0;
    let slab = Slab::new(&detector).unwrap();
    let mesh = slab.image_mesh();
    let node = mesh.nodes_m.iter().position(|at| (at[0] - 0.01).abs() < 8e-4 && (at[1] + 0.012).abs() < 8e-4).unwrap();
    let [x_m, y_m] = mesh.nodes_m[node];
    let conductance_s = 1e-9;
    let z = slab.impedance_ohm(&[contact(x_m, y_m, 5e-4, conductance_s)]).unwrap();
    let readings = readings_v(&z, slab.detector());
    let (fields, between) = (slab.fields_ohm(), slab.electrode_fields_ohm());
    let (g, e) = (5, 9);
    let resistance = fields[(node, e)] - fields[(node, g)] - between[(e, g)] + between[(g, g)];
    let expected = slab.detector().drive_v * conductance_s * resistance;
    assert!((readings.at(g, e) / expected - 1.0).abs() < 2e-3, "{} {expected}", readings.at(g, e));
}

#[test]
fn what_the_slab_cannot_be_is_refused_by_name() {
    let mut detector = square(0.005, 0.002);
    detector.outline = Outline { outer: vec![[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]], holes: Vec::new() };
    assert!(Slab::new(&detector).unwrap_err().to_string().contains("rectangle"));
    let mut detector = square(0.005, 0.002);
    detector.electrodes[7].x_m = 0.0295;
    assert!(Slab::new(&detector).unwrap_err().to_string().contains("electrode 7"));
    let slab = Slab::new(&square(0.005, 0.002)).unwrap();
    assert_eq!(slab.impedance_ohm(&[]), Err(ForwardError::NoContact));
    let outside = slab.impedance_ohm(&[contact(0.0, 0.0, 0.001, 1e-3), contact(0.04, 0.0, 0.001, 1e-3)]);
    assert!(matches!(outside, Err(ForwardError::Contact { index: 1, .. })));
}

/// A disc of contact as an image: each cell's share of its area, by sub-sampling.
fn disc_image(slab: &Slab, disc: &Contact) -> Vec<f64> {
    let step_m = (slab.image_mesh().node_areas_m2.iter().copied().fold(0.0, f64::max)).sqrt();
    let inside = |at: &[f64; 2]| {
        let at = *at;
        let points = (0..400).map(|i| [i % 20, i / 20].map(|i| (f64::from(i) + 0.5) / 20.0 - 0.5));
        points
            .filter(move |p| (at[0] + p[0] * step_m - disc.x_m).hypot(at[1] + p[1] * step_m - disc.y_m) < disc.radius_m)
    };
    let shares: Vec<_> = slab.image_mesh().nodes_m.iter().map(|at| inside(at).count() as f64).collect();
    let total: f64 = shares.iter().sum();
    shares.iter().map(|share| disc.conductance_s * share / total).collect()
}

#[test]
fn a_disc_and_its_image_agree_and_come_closer_with_the_grid() {
    let disc = contact(0.0113, -0.0046, 0.004, 2e-3);
    let slab = Slab::new(&square(0.005, 0.002)).unwrap();
    let exact = slab.impedance_ohm(&[disc]).unwrap();
    let errors = [900, 3600].map(|nodes| {
        let slab = slab.clone().on_image(nodes);
        let image = slab.image_fields(&disc_image(&slab, &disc)).unwrap().impedance_ohm;
        apart(slab.detector(), &image, &exact)
    });
    assert!(errors[1] < 5e-3 && errors[1] < 0.5 * errors[0], "{errors:?}");
}

#[test]
fn an_image_follows_its_jacobian_where_it_touches_and_where_not() {
    let mut detector = square(0.005, 0.002);
    detector.on_resistance_ohm = 4.0;
    let slab = Slab::new(&detector).unwrap().on_image(100);
    let mesh = slab.image_mesh();
    let image_s = mesh.image_with([(0, 2e-4), (33, 1e-3), (34, 2e-3), (71, 5e-5)]);
    let at = slab.image_fields(&image_s).unwrap();
    let jacobian = at.readings_jacobian_v_per_s(&detector);
    let before = readings_v(&at.impedance_ohm, &detector);
    for node in [0, 34, 50, 99] {
        let mut stepped_s = image_s.clone();
        stepped_s[node] += 1e-9;
        let after = readings_v(&slab.image_fields(&stepped_s).unwrap().impedance_ohm, &detector);
        for (row, (after, before)) in after.volts().iter().zip(before.volts()).enumerate() {
            let difference = (after - before) / 1e-9 - jacobian[(row, node)];
            assert!(difference.abs() < 1e-4 * jacobian.amax(), "node {node}, row {row}: {difference}");
        }
    }
}

#[test]
fn all_current_of_an_image_leaves_through_it() {
    let slab = Slab::new(&square(0.003, 0.002)).unwrap().on_image(400);
    let image_s: Vec<_> = (0..slab.image_mesh().nodes_m.len()).map(|node| 1e-6 * (node % 7) as f64).collect();
    let fields = slab.image_fields(&image_s).unwrap();
    for electrode in 0..16 {
        let current_a: f64 = image_s.iter().zip(fields.nodes_ohm.column(electrode).iter()).map(|(s, z)| s * z).sum();
        assert!((current_a - 1.0).abs() < 1e-9, "{current_a} A");
    }
}

#[test]
fn an_image_of_another_size_or_sign_is_refused() {
    let slab = Slab::new(&square(0.005, 0.002)).unwrap().on_image(100);
    let nodes = slab.image_mesh().nodes_m.len();
    assert!(slab.image_fields(&[1e-3]).unwrap_err().to_string().contains("1 values"));
    assert!(slab.image_fields(&vec![-1e-3; nodes]).unwrap_err().to_string().contains("node 0"));
    assert_eq!(slab.image_fields(&vec![0.0; nodes]), Err(ForwardError::NoContact));
}

#[test]
fn impedances_change_as_differences_do() {
    let slab = Slab::new(&Detector::preset(Detector::DEFAULT).unwrap()).unwrap();
    let contacts = [
        Contact::flat(0.004, 0.011, 0.002, 3e-4),
        Contact::flat(-0.013, -0.004, 0.0042, 2e-2),
        // Cut by two walls.
        Contact::flat(0.0285, -0.029, 0.0027, 1e-3),
        Contact::flat(-0.015, 0.016, 0.011, 2e-3),
    ];
    let mut replaced = Vec::new();
    for (k, contact) in contacts.iter().enumerate() {
        let step = 1e-3;
        replaced.push((k, Contact { x_m: contact.x_m + step * contact.radius_m, ..*contact }));
        replaced.push((k, Contact { y_m: contact.y_m - step * contact.radius_m, ..*contact }));
        replaced.push((k, Contact { conductance_s: (1.0 + step) * contact.conductance_s, ..*contact }));
        replaced.push((k, Contact { radius_m: (1.0 + step) * contact.radius_m, ..*contact }));
    }
    let (impedance_ohm, changes) = slab.impedance_with_changes_ohm(&contacts, &replaced).unwrap();
    assert_eq!(impedance_ohm, slab.impedance_ohm(&contacts).unwrap());
    for ((k, contact), change) in replaced.iter().zip(&changes) {
        let mut contacts = contacts;
        contacts[*k] = *contact;
        let expected = slab.impedance_ohm(&contacts).unwrap() - &impedance_ohm;
        let off = (change - &expected).norm() / expected.norm();
        assert!(off < 0.06, "contact {k} to {contact:?}: {off}");
    }
}

/// What a coarse slab is for: how readings change with what a calibration finds.
#[test]
fn readings_change_alike_on_a_coarse_slab() {
    let detector = Detector::default();
    let contact = Contact::flat(0.009, -0.006, 0.0025, 1e-3);
    let fine = Slab::new(&detector).unwrap();
    let coarse = fine.coarse().unwrap().unwrap();
    let change = |model: &dyn ForwardModel, parameter: Parameter, step: f64| {
        let similar = model.of_similar(&detector.stepped(&[(parameter, step)])).unwrap();
        similar.impedance_ohm(&[contact]).unwrap() - model.impedance_ohm(&[contact]).unwrap()
    };
    let off = |parameter, step| {
        let changes = [change(&fine, parameter, step), change(&*coarse, parameter, step)];
        (&changes[0] - &changes[1]).norm() / changes[0].norm()
    };
    for (parameter, step) in [
        (Parameter::Thickness, 0.01),
        (Parameter::TopOverBottom, 0.05),
        (Parameter::Uneven([1, 0]), 0.01),
        (Parameter::Uneven([2, 3]), 0.01),
        (Parameter::ElectrodeX(5), 3e-5),
        (Parameter::ElectrodeY(15), 3e-5),
    ] {
        assert!(off(parameter, step) < 0.03, "{parameter:?}: {}", off(parameter, step));
    }
    // What crowds at a pad's rim is what is coarse.
    let pad = off(Parameter::Pad(9), 0.05);
    assert!(pad < 0.2, "{pad}");
}
