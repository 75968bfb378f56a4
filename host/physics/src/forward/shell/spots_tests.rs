//! Spots of a shell against the shell itself.

use nalgebra::DMatrix;

use super::Shell;
use crate::detector::{Detector, Layer};
use crate::forward::contact::conducting_patches;
use crate::forward::spots::{Spot, SpotFields};
use crate::forward::{ForwardModel, readings_v};
use crate::scene::Contact;
use crate::space::{self, Place};

const RADIUS_M: f64 = 0.0025;

fn thin() -> Detector {
    let mut detector = Detector::preset("square-60").unwrap();
    detector.layers = vec![Layer::uniform(0.0004, 0.2273)];
    detector
}

fn example(name: &str) -> Detector {
    let path = format!("{}/../examples/detectors/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Detector::read(std::path::Path::new(&path)).unwrap()
}

/// Detectors with a usual radius, and some places on and near their edges.
fn cases() -> Vec<(Detector, f64, Vec<Place>)> {
    let dome = example("fingertip");
    let surface = dome.surface.clone().unwrap();
    let on_dome = [[0.005, 0.002, 0.004], [-0.003, -0.004, 0.006], [0.001, -0.008, -0.002]];
    vec![
        (
            thin(),
            RADIUS_M,
            vec![[0.003, -0.008, 0.0], [-0.0125, 0.004, 0.0], [0.0292, 0.0, 0.0], [0.029, -0.0285, 0.0]],
        ),
        (example("l-shape"), 0.003, vec![[-0.02, -0.005, 0.0], [0.0, -0.0052, 0.0], [-0.0385, 0.01, 0.0]]),
        (dome, 0.0007, on_dome.map(|at| surface.nearest(at).place_m).into()),
    ]
}

/// Impedances under spots with the resistances of contacts of such conductances.
fn impedance_ohm(shell: &Shell, spots: &[Spot], fields: &dyn SpotFields, conductance_s: &[f64]) -> DMatrix<f64> {
    let cross = DMatrix::from_fn(spots.len(), shell.detector.electrodes.len(), |k, e| spots[k].electrodes_ohm[e]);
    let between = DMatrix::from_fn(spots.len(), spots.len(), |k, l| {
        if k == l { spots[k].own_ohm } else { fields.between_ohm(&spots[k], &spots[l]) }
    });
    let on_it: Vec<_> = spots.iter().zip(conductance_s).map(|(spot, s)| s * spot.share).collect();
    conducting_patches(shell.electrode_fields_ohm(), &cross, between, &on_it).impedance_ohm().unwrap()
}

#[test]
fn readings_of_spots_are_those_of_discs_but_for_crowded_current() {
    for (detector, radius_m, places) in cases() {
        let shell = Shell::new(&detector).unwrap();
        let fields = shell.spots(radius_m).unwrap();
        let sheet_s = detector.sheet_conductance_s();
        // The firmer a disc presses, the more its current crowds towards the electrodes; at a corner its share is interpolated.
        for (sheets, share) in [(0.03, 0.012), (0.3, 0.015), (3.0, 0.05)] {
            let single = places.iter().map(|at| vec![*at]);
            for some in single.chain([places.clone()]) {
                let contacts: Vec<_> = some
                    .iter()
                    .map(|[x_m, y_m, z_m]| Contact {
                        z_m: *z_m,
                        ..Contact::flat(*x_m, *y_m, radius_m, sheets * sheet_s)
                    })
                    .collect();
                let spots: Vec<_> = some.iter().map(|at| fields.spot(*at)).collect();
                let found = impedance_ohm(&shell, &spots, &*fields, &vec![sheets * sheet_s; some.len()]);
                let [found, expected] =
                    [found, shell.impedance_ohm(&contacts).unwrap()].map(|z| readings_v(&z, &detector));
                let off = found.volts().iter().zip(expected.volts()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                let off = off / expected.largest_v();
                assert!(off < share, "{} {sheets} {some:?}: {off}", detector.name);
            }
        }
    }
}

#[test]
fn fields_go_on_across_the_mesh_without_a_kink() {
    let detector = thin();
    let shell = Shell::new(&detector).unwrap();
    let fields = shell.spots(RADIUS_M).unwrap();
    let at = |i: usize| [-0.02 + 2e-5 * i as f64, 0.0031, 0.0];
    let along_ohm: Vec<_> = (0..2000).map(|i| fields.spot(at(i)).electrodes_ohm[5]).collect();
    let steps: Vec<_> = along_ohm.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let largest = steps.iter().copied().fold(0.0, |a: f64, b| a.max(b.abs()));
    let jump = steps.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    assert!(jump < 0.02 * largest, "{}", jump / largest);
}

#[test]
fn what_is_beside_the_detector_stands_at_its_edge_and_half_a_disc_there_is_half() {
    let shell = Shell::new(&thin()).unwrap();
    let fields = shell.spots(RADIUS_M).unwrap();
    let spot = fields.spot([0.04, 0.0, 0.0]);
    assert!(space::distance(spot.place_m, [0.03, 0.0, 0.0]) < 1e-9);
    assert!((spot.share - 0.5).abs() < 0.01, "{spot:?}");
    assert!((fields.spot([0.0, 0.0, 0.0]).share - 1.0).abs() < 1e-6);
    assert_eq!(fields.footing([0.04, 0.0, 0.0]).0, spot.place_m);
}
