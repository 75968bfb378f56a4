//! Bonded slabs against answers known otherwise.

use nalgebra::DMatrix;

use super::grid;
use crate::detector::{Bond, Detector, Electrode, Layer, Outline};
use crate::forward::slab::{Resolution, Slab};
use crate::forward::{ForwardModel, readings_v};
use crate::scene::Contact;

/// A small detector of two layers of 2 and 3 mm, four pads and 3 x 3 dots.
fn small(bond: Bond) -> Detector {
    let pad = |x: f64, y: f64| Electrode::flat(0.006 * x, 0.006 * y, 0.002);
    Detector {
        outline: Outline::rectangle(0.024, 0.024),
        layers: vec![Layer::uniform(0.002, 0.5), Layer { bond: Some(bond), ..Layer::uniform(0.003, 0.2) }],
        electrodes: vec![pad(-1.0, -1.0), pad(1.0, -1.0), pad(-1.0, 1.0), pad(1.0, 1.0)],
        ..Detector::default()
    }
}

fn dots() -> Bond {
    Bond::of_dots([3, 3], 0.005)
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

#[test]
fn explore() {
    for (name, bond) in [
        ("usual", dots()),
        ("poor glue", Bond { sheet_conductance_s: 1e-3, ..dots() }),
        ("very poor", Bond { sheet_conductance_s: 1e-6, ..dots() }),
        ("impedance", Bond { contact_impedance_ohm_m2: 3e-3, ..dots() }),
        ("touching", Bond { diameter_m: 0.008, ..dots() }),
        ("small", Bond { diameter_m: 0.002, ..dots() }),
    ] {
        let detector = small(bond);
        let fine = Slab::with_resolution(&detector, Resolution::FINE).unwrap().impedance_ohm(&[press()]).unwrap();
        let grids = [1e-3, 0.5e-3, 0.25e-3].map(|edge_m| grid::impedance_ohm(&detector, &[press()], edge_m));
        let better = &grids[2] * 2.0 - &grids[1];
        println!(
            "{name}: {:?} extrapolated {}",
            grids.each_ref().map(|grid| apart(&detector, grid, &fine)),
            apart(&detector, &better, &fine)
        );
        for degree in 0..=5 {
            let resolution = Resolution { dot_degree: degree, ..Resolution::FINE };
            let slab = Slab::with_resolution(&detector, resolution).unwrap();
            let z = slab.impedance_ohm(&[press()]).unwrap();
            println!(
                "  degree {degree}: {:.5} to fine, {:.5} to grids, asymmetry {:e} columns {}",
                apart(&detector, &z, &fine),
                apart(&detector, &z, &better),
                (&z - z.transpose()).amax() / z.amax(),
                slab.pads.columns()
            );
        }
        println!("{} {}", fine, better);
    }
}
