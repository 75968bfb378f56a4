//! The shell against answers found another way.

use std::f64::consts::{PI, TAU};

use nalgebra::Cholesky;

use super::*;
use crate::detector::{Adc, Layer, Outline};
use crate::forward::{Resolution, Slab};
use crate::geometry;

/// Sheet conductance of the detectors made here (S).
const SHEET_S: f64 = 1e-3;

fn preset(name: &str) -> Detector {
    Detector::preset(name).unwrap_or_else(|| panic!("no preset {name}"))
}

fn shell(detector: &Detector, nodes: usize) -> Shell {
    Shell::with_nodes(detector, nodes).unwrap_or_else(|error| panic!("{error}"))
}

fn detector(outline: Outline, pads_m: &[[f64; 3]]) -> Detector {
    let electrodes = pads_m.iter().map(|&[x_m, y_m, radius_m]| Electrode::flat(x_m, y_m, radius_m)).collect();
    Detector {
        name: "test".to_owned(),
        outline,
        surface: None,
        unevenness: crate::detector::Unevenness::default(),
        tolerances: crate::detector::Tolerances::default(),
        converters: Vec::new(),
        calibration: None,
        layers: vec![Layer::uniform(0.01, SHEET_S / 0.01)],
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

fn contact(x_m: f64, y_m: f64, radius_m: f64, conductance_s: f64) -> Contact {
    Contact::flat(x_m, y_m, radius_m, conductance_s)
}

/// The node nearest to a place.
fn nearest(shell: &Shell, at: [f64; 2]) -> usize {
    let nodes_m = &shell.mesh.nodes_m;
    let from = |i: &usize| geometry::distance(nodes_m[*i], at);
    (0..nodes_m.len()).min_by(|i, j| from(i).total_cmp(&from(j))).unwrap_or_default()
}

fn smallest_angle_deg([a, b, c]: [[f64; 2]; 3]) -> f64 {
    [(a, b, c), (b, c, a), (c, a, b)]
        .map(|(a, b, c)| {
            let sine = geometry::cross(a, b, c) / (geometry::distance(a, b) * geometry::distance(a, c));
            let side = geometry::distance(b, c);
            let acute = side * side < geometry::distance(a, b).powi(2) + geometry::distance(a, c).powi(2);
            if acute { sine.asin().to_degrees() } else { 90.0 }
        })
        .into_iter()
        .fold(180.0, f64::min)
}

#[test]
fn every_preset_is_meshed_as_asked() {
    for name in Detector::preset_names() {
        let detector = preset(name);
        let target = Shell::default_nodes(&detector);
        let mesh = Mesh::new(&detector, target).unwrap_or_else(|error| panic!("{error}"));
        let ratio = mesh.nodes_m.len() as f64 / target as f64;
        assert!((0.85..1.18).contains(&ratio), "{name}: {} nodes for {target}", mesh.nodes_m.len());
        let area_m2: f64 = mesh.node_areas_m2().iter().sum();
        let [width_m, height_m] = detector.outline.as_rectangle().unwrap_or_default();
        assert!((area_m2 / (width_m * height_m) - 1.0).abs() < 1e-12, "{name}");
        let first_pad = mesh.pad_triangles[0].start;
        for (i, &triangle) in mesh.triangles.iter().enumerate() {
            let corners = mesh.corners(triangle);
            assert!(geometry::cross(corners[0], corners[1], corners[2]) > 0.0, "{name}: triangle {i}");
            assert!(
                i >= first_pad || smallest_angle_deg(corners) > 18.0,
                "{name}: {} degrees",
                smallest_angle_deg(corners)
            );
        }
        assert_eq!(Mesh::new(&detector, target).as_ref(), Ok(&mesh), "{name}: the same mesh again");
    }
}

#[test]
fn an_outline_with_a_hole_and_an_inner_corner() {
    let outline = Outline {
        outer: vec![[-0.03, -0.03], [0.03, -0.03], [0.03, 0.0], [0.0, 0.0], [0.0, 0.03], [-0.03, 0.03]],
        holes: vec![vec![[-0.02, -0.02], [-0.02, -0.01], [-0.01, -0.01], [-0.01, -0.02]]],
    };
    let detector = detector(outline, &[[-0.024, 0.024, 0.002], [0.024, -0.024, 0.002]]);
    let shell = shell(&detector, 1500);
    let area_m2: f64 = shell.image_mesh.node_areas_m2.iter().sum();
    assert!((area_m2 - (27e-4 - 1e-4)).abs() < 1e-12, "{area_m2}");
    let off = shell.impedance_ohm(&[contact(0.02, 0.02, 0.002, 1e-3)]);
    assert!(matches!(off, Err(ForwardError::Contact { index: 0, .. })), "beyond the inner corner");
}

#[test]
fn misplaced_electrodes_are_named() {
    let square = || Outline::rectangle(0.06, 0.06);
    let beyond = Mesh::new(&detector(square(), &[[0.0, 0.0, 0.002], [0.029, 0.0, 0.002]]), 500);
    assert!(beyond.is_err_and(|error| error.to_string().contains("electrode 1 has to lie on the layer")));
    let overlapping = Mesh::new(&detector(square(), &[[0.0, 0.0, 0.002], [0.003, 0.0, 0.002]]), 500);
    assert!(overlapping.is_err_and(|error| error.to_string().contains("electrodes 0 and 1 overlap")));
}

#[test]
fn reciprocity_holds_to_rounding() -> Result<(), ForwardError> {
    let shell = shell(&preset("square-60"), 2000);
    let fields = shell.electrode_fields_ohm();
    assert!((fields - fields.transpose()).amax() < 1e-10 * fields.amax());
    let impedance = shell.impedance_ohm(&[contact(0.004, -0.011, 0.003, 1e-3), contact(-0.02, 0.01, 0.002, 1e-4)])?;
    assert!((&impedance - impedance.transpose()).amax() < 1e-10 * impedance.amax());
    assert!(Cholesky::new(impedance).is_some(), "Z is positive definite");
    Ok(())
}

#[test]
fn all_current_leaves_by_the_contacts() -> Result<(), ForwardError> {
    let shell = shell(&preset("strip-13x60"), 2000);
    let conductances_s =
        shell.node_conductances_s(&[contact(0.001, 0.02, 0.003, 0.05), contact(0.0, -0.01, 0.002, 1e-5)])?;
    let sum: f64 = conductances_s.iter().sum();
    assert!((sum / 0.05001 - 1.0).abs() < 1e-12, "conductance is kept: {sum}");
    let fields = shell.image_fields(&conductances_s)?;
    for electrode in 0..16 {
        let current_a: f64 =
            conductances_s.iter().zip(fields.nodes_ohm.column(electrode).iter()).map(|(s, ohm)| s * ohm).sum();
        assert!((current_a - 1.0).abs() < 1e-9, "{current_a} A");
    }
    Ok(())
}

#[test]
fn a_bar_has_the_slope_of_ohms_law() {
    let bar = detector(Outline::rectangle(0.1, 0.004), &[[-0.045, 0.0, 0.001], [0.045, 0.0, 0.001]]);
    let shell = shell(&bar, 1500);
    let through = |node: usize| shell.fields_ohm[(node, 0)] - shell.fields_ohm[(node, 1)];
    let (left, right) = (nearest(&shell, [-0.02, 0.001]), nearest(&shell, [0.02, -0.001]));
    let length_m = shell.mesh.nodes_m[right][0] - shell.mesh.nodes_m[left][0];
    let slope = (through(left) - through(right)) / length_m;
    assert!((slope * SHEET_S * 0.004 - 1.0).abs() < 1e-6, "{slope}");
}

/// Neumann function of a rectangle `[0, a] x [0, b]`, mean zero, unit sheet conductance: cosines along x, exact along y.
fn rectangle_neumann([a, b]: [f64; 2], p: [f64; 2], q: [f64; 2]) -> f64 {
    let (low, high) = (p[1].min(q[1]), p[1].max(q[1]));
    let zeroth = ((low * low + high * high) / (2.0 * b) - high + b / 3.0) / a;
    let mode = |m: usize| {
        let k = PI * m as f64 / a;
        let shape =
            (k * (high - low)).exp().recip() * (1.0 + (-2.0 * k * low).exp()) * (1.0 + (-2.0 * k * (b - high)).exp())
                / (2.0 * k * (1.0 - (-2.0 * k * b).exp()));
        2.0 / a * (k * p[0]).cos() * (k * q[0]).cos() * shape
    };
    zeroth + (1..400).map(mode).sum::<f64>()
}

#[test]
fn a_rectangle_agrees_with_its_cosine_series() {
    let size = [0.06, 0.04];
    let pad = [-0.011, 0.006];
    // Small pads stand for points: each bends the field by (radius / distance)^2.
    let rectangle = detector(Outline::rectangle(size[0], size[1]), &[[pad[0], pad[1], 0.0002], [0.02, -0.012, 0.0002]]);
    let shell = shell(&rectangle, 6000);
    let corner = |p: [f64; 2]| [p[0] + size[0] / 2.0, p[1] + size[1] / 2.0];
    let mut largest = 0.0f64;
    for at in [[0.01, -0.008], [-0.025, -0.015], [0.025, 0.017], [-0.011, -0.004], [0.002, 0.0145]] {
        let node = nearest(&shell, at);
        let exact = rectangle_neumann(size, corner(pad), corner(shell.mesh.nodes_m[node])) / SHEET_S;
        largest = largest.max((shell.fields_ohm[(node, 0)] - exact).abs());
    }
    // The field varies over 1 / sheet conductance = 1000 ohm.
    assert!(largest < 0.5, "{largest} ohm");
}

/// `I0(x)` and `I1(x)`, modified Bessel functions, by their power series.
fn bessel_i01(x: f64) -> [f64; 2] {
    let mut term = [1.0, x / 2.0];
    let mut sum = term;
    for k in 1..200 {
        for order in 0..2 {
            term[order] *= x * x / 4.0 / (k * (k + order)) as f64;
            sum[order] += term[order];
        }
    }
    sum
}

/// A round sheet with one pad in the middle.
fn round(pad_radius_m: f64, contact_impedance_ohm_m2: f64) -> Detector {
    let outline = Outline { outer: geometry::disc([0.0; 2], 0.03, 400), holes: Vec::new() };
    Detector { contact_impedance_ohm_m2, ..detector(outline, &[[0.0, 0.0, pad_radius_m]]) }
}

/// Potential of the round sheet at `at_m` from the middle, less that at 20 mm, for 1 A into the pad and out evenly.
///
/// In the sheet `-ln(rho) / 2 pi s + rho^2 / 4 s A`, the logarithm of the infinite sheet and the current led off.
fn round_ohm(at_m: f64) -> f64 {
    let part = |rho: f64| (-rho.ln() / TAU + rho * rho / (4.0 * PI * 0.03 * 0.03)) / SHEET_S;
    part(at_m) - part(0.02)
}

#[test]
fn around_a_pad_the_field_is_the_logarithm() {
    let shell = shell(&round(0.002, 1e-5), 4000);
    let field = |at: [f64; 2]| {
        let node = nearest(&shell, at);
        (shell.fields_ohm[(node, 0)], geometry::distance(shell.mesh.nodes_m[node], [0.0; 2]))
    };
    let (far_ohm, far_m) = field([0.0, 0.02]);
    for at in [[0.004, 0.0], [0.0, -0.007], [-0.008, 0.008]] {
        let (ohm, rho_m) = field(at);
        let exact = round_ohm(rho_m) - round_ohm(far_m);
        assert!((ohm - far_ohm - exact).abs() < 0.004 * exact, "{} against {exact}", ohm - far_ohm);
    }
}

/// Potential of the pad itself, less that in the sheet at 20 mm: the sheet from the pad's edge, then the pad, where
/// `s lap phi = (phi - U) / z` has the solution `U - phi = b I0(rho / depth)` with `depth^2 = s z`.
fn round_pad_ohm(pad_radius_m: f64, contact_impedance_ohm_m2: f64) -> f64 {
    let depth_m = (SHEET_S * contact_impedance_ohm_m2).sqrt();
    let [i0, i1] = bessel_i01(pad_radius_m / depth_m);
    // What is led off under the pad never leaves it.
    let share = 1.0 - (pad_radius_m / 0.03).powi(2);
    round_ohm(pad_radius_m) + share * i0 / i1 * depth_m / (SHEET_S * TAU * pad_radius_m)
}

fn pad_error(contact_impedance_ohm_m2: f64, nodes: usize) -> f64 {
    let shell = shell(&round(0.002, contact_impedance_ohm_m2), nodes);
    let at_20_mm: Vec<_> = [[0.02, 0.0], [0.0, 0.02], [-0.02, 0.0], [0.0, -0.02]]
        .into_iter()
        .map(|at| nearest(&shell, at))
        .map(|node| shell.fields_ohm[(node, 0)] - round_ohm(geometry::distance(shell.mesh.nodes_m[node], [0.0; 2])))
        .collect();
    let far_ohm = at_20_mm.iter().sum::<f64>() / at_20_mm.len() as f64;
    let exact = round_pad_ohm(0.002, contact_impedance_ohm_m2);
    (shell.electrode_fields_ohm[(0, 0)] - far_ohm) / exact - 1.0
}

#[test]
fn a_pads_own_potential_is_right_whatever_its_contact_impedance() {
    for contact_impedance_ohm_m2 in [1e-6, 1e-5, 1e-4, 1e-3, 1e-2] {
        let error = pad_error(contact_impedance_ohm_m2, 10_000);
        assert!(error.abs() < 0.004, "{contact_impedance_ohm_m2} ohm m2: {error}");
    }
}

#[test]
fn errors_fall_with_the_square_of_the_edge() {
    let errors: Vec<_> = [1600, 6400, 25600].into_iter().map(|nodes| pad_error(1e-5, nodes).abs()).collect();
    // Four times the nodes: half the edge, so a quarter of the error.
    let order = (errors[0] / errors[2]).ln() / 4f64.ln();
    assert!((1.6..2.6).contains(&order), "order {order}: {errors:?}");
}

#[test]
fn one_contact_follows_the_closed_form_of_the_fields() -> Result<(), ForwardError> {
    let detector = preset("square-60");
    let shell = shell(&detector, 1000);
    let (node, conductance_s) = (nearest(&shell, [0.004, 0.009]), 2e-3);
    let refactorised = shell.image_fields(&shell.image_mesh().image_with([(node, conductance_s)]))?;
    // The field of the contact's own node: the same Neumann problem with the current entering there.
    let factor = shell.system.factorise([(shell.system.pad(0), 1e-3)]).map_err(|_| ForwardError::NoContact)?;
    let areas_m2 = &shell.image_mesh.node_areas_m2;
    let area_m2: f64 = areas_m2.iter().sum();
    let currents_a = DMatrix::from_fn(shell.system.pad(16), 1, |i, _| {
        f64::from(u8::from(i == node)) - areas_m2.get(i).map_or(0.0, |node_area_m2| node_area_m2 / area_m2)
    });
    let (nodes, _) = factor.solve(currents_a);
    let mean: f64 = nodes.column(0).iter().zip(areas_m2).map(|(ohm, area)| ohm * area / area_m2).sum();
    let (own, fields, pads) = (nodes[node] - mean, shell.fields_ohm(), shell.electrode_fields_ohm());
    let largest = refactorised.impedance_ohm.amax();
    for e in 0..16 {
        for g in 0..16 {
            let woodbury = 1.0 / conductance_s + own - fields[(node, e)] - fields[(node, g)] + pads[(e, g)];
            assert!((woodbury - refactorised.impedance_ohm[(e, g)]).abs() < 1e-9 * largest, "{e} {g}");
        }
    }
    Ok(())
}

#[test]
fn touched_nodes_give_what_factorising_anew_gives() -> Result<(), ForwardError> {
    let shell = shell(&preset("square-60"), 1500);
    let press = |conductance_s: f64| contact(0.004, 0.009, 0.003, conductance_s);
    for contacts in [vec![press(1e-5)], vec![press(10.0)], vec![press(1e-3), contact(-0.02, -0.02, 0.004, 1e-4)]] {
        let conductances_s = shell.node_conductances_s(&contacts)?;
        let anew = shell.image_fields(&conductances_s)?.impedance_ohm;
        let touched = shell.touched(&conductances_s).and_then(|(system, _)| system.impedance_ohm()).unwrap_or_default();
        let apart = (touched - &anew).amax() / anew.amax();
        assert!(apart < 1e-8, "{apart}: {contacts:?}");
    }
    Ok(())
}

#[test]
fn the_default_mesh_is_near_its_limit() -> Result<(), ForwardError> {
    let detector = preset("square-60");
    let readings = |nodes: usize, at: Contact| {
        let impedance_ohm = shell(&detector, nodes).impedance_ohm(&[at])?;
        Ok::<_, ForwardError>(crate::forward::readings_v(&impedance_ohm, &detector))
    };
    for at in
        [contact(0.004, 0.002, 0.003, 1e-3), contact(-0.0225, 0.0075, 0.002, 1e-2), contact(0.029, 0.029, 0.004, 1e-4)]
    {
        let (coarse, fine) = (readings(Shell::default_nodes(&detector), at)?, readings(20_000, at)?);
        let largest_v = coarse.volts().iter().zip(fine.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(largest_v < 0.01 * fine.largest_v(), "{largest_v} V of {} V", fine.largest_v());
    }
    Ok(())
}

#[test]
fn impedance_derivatives_are_products_of_fields() -> Result<(), ForwardError> {
    let shell = shell(&preset("square-60"), 800);
    let (node, step_s) = (nearest(&shell, [-0.01, 0.003]), 1e-6);
    let middle = nearest(&shell, [0.0; 2]);
    let with =
        |extra_s: f64| shell.image_fields(&shell.image_mesh().image_with([(middle, 1e-3), (node, 1e-4 + extra_s)]));
    let (fields, before, after) = (with(0.0)?, with(-step_s)?, with(step_s)?);
    for (e, g) in [(0, 0), (3, 12), (5, 6), (15, 1)] {
        let difference = (after.impedance_ohm[(e, g)] - before.impedance_ohm[(e, g)]) / (2.0 * step_s);
        let product = fields.ohm_per_s(e, g, node);
        assert!((difference / product - 1.0).abs() < 1e-3, "{difference} {product}");
    }
    Ok(())
}

#[test]
fn a_leaking_shell_is_the_leaking_slab_of_a_thin_detector() -> Result<(), ForwardError> {
    let mut detector = preset("square-60");
    detector.layers = vec![Layer::uniform(0.00025, 1.2)];
    let leak_s = 0.05 * detector.sheet_conductance_s();
    let driving = DrivingLayer { leak_s, ..DrivingLayer::default() };
    let leaking = shell(&detector, 8000).under(driving)?;
    let slab = Slab::under(&detector, Resolution::STANDARD, driving)?;
    for contacts in [vec![], vec![contact(0.004, -0.011, 0.003, 1e-4)]] {
        let [found, expected] = [leaking.impedance_ohm(&contacts)?, slab.impedance_ohm(&contacts)?];
        let off = (&found - &expected).amax() / expected.amax();
        assert!(off < 0.01, "{off}: {contacts:?}");
    }
    assert!(leaking.spots(0.003).is_none() && leaking.node_fields_ohm().is_err());
    let error = leaking.under(DrivingLayer { sheet_ohm: 100.0, ..driving }).err().unwrap_or(ForwardError::NoContact);
    assert!(error.to_string().contains("which only the slab can have"), "{error}");
    Ok(())
}

#[test]
fn along_a_bar_of_uneven_conductivity_the_potential_is_ohms() {
    let (length_m, width_m) = (0.12, 0.01);
    let mut bar = detector(Outline::rectangle(length_m, width_m), &[[-0.055, 0.0, 0.002], [0.055, 0.0, 0.002]]);
    bar.unevenness.add([1, 0], 1.0);
    bar.unevenness.add([3, 0], -0.4);
    let shell = shell(&bar, 3000);
    // 1 A from one end to the other: the integral of dx over conductance, from the middle, by the midpoint rule.
    let ohm = |x_m: f64| {
        let step_m = x_m / 200.0;
        let at = |i: u8| step_m / (SHEET_S * width_m) / bar.log_unevenness([(f64::from(i) + 0.5) * step_m, 0.0]).exp();
        -(0..200).map(at).sum::<f64>()
    };
    let fields_ohm = shell.fields_ohm();
    let off: Vec<f64> = (0..shell.image_mesh().nodes_m.len())
        .map(|node| (node, shell.image_mesh().nodes_m[node][0]))
        .filter(|(_, x_m)| x_m.abs() < 0.03)
        .map(|(node, x_m)| fields_ohm[(node, 0)] - fields_ohm[(node, 1)] - ohm(x_m))
        .collect();
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    let largest = off.iter().map(|ohm| (ohm - mean).abs()).fold(0.0, f64::max);
    assert!(off.len() > 100 && largest < 3e-3 * (ohm(-0.03) - ohm(0.03)), "{} {largest}", off.len());
}
