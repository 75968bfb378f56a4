//! A network of resistors stands for the solution: it is solved under any contacts by itself.

use super::*;
use std::io::Cursor;
use tactomo_table::{NpzWriter, Values};

/// Nodes along a side of 60 mm.
const SIDE: usize = 13;
const STEP_M: f64 = 5e-3;
const SHEET_S: f64 = 1.1e-3;
const RADIUS_M: f64 = 2.5e-3;

fn at_m(node: usize) -> Point {
    [node % SIDE, node / SIDE].map(|step| STEP_M * (step as f64 - 6.0))
}

/// Every third node, from half a step of electrodes in on: about where those of `square-60` are.
fn electrodes() -> Vec<usize> {
    let along = || (0..4).map(|k| 2 + 3 * k);
    along().flat_map(|row| along().map(move |column| SIDE * row + column)).collect()
}

/// Two nodes that are side by side make a patch: its densities are those of its halves, so each of them conducts all of the disc's.
fn patches() -> Vec<[usize; 2]> {
    let along = || (0..5).map(|k| 1 + 2 * k);
    along().flat_map(|row| along().map(move |column| [0, 1].map(|k| SIDE * row + column + k))).collect()
}

/// Conductances of a sheet of squares (S), each node joined to the driving layer by such a conductance.
fn network_s(to_layer_s: &[(usize, f64)]) -> DMatrix<f64> {
    let mut network = DMatrix::zeros(SIDE * SIDE, SIDE * SIDE);
    for node in 0..SIDE * SIDE {
        let right = (node % SIDE + 1 < SIDE).then_some(node + 1);
        let below = (node + SIDE < SIDE * SIDE).then_some(node + SIDE);
        for other in right.into_iter().chain(below) {
            for (from, to) in [(node, other), (other, node)] {
                network[(from, from)] += SHEET_S;
                network[(from, to)] -= SHEET_S;
            }
        }
    }
    to_layer_s.iter().for_each(|&(node, value_s)| network[(node, node)] += value_s);
    network
}

/// What a file of the network has; changed before it is written to see what is refused.
pub(crate) struct Contents {
    pub green_ohm: Vec<f64>,
    pub sheet_s: f64,
    pub electrodes: i64,
    pub sizes: Vec<i64>,
    pub meta: String,
}

impl Contents {
    pub fn of_network() -> Self {
        let inverse = network_s(&[(electrodes()[0], SHEET_S)]).try_inverse().unwrap();
        let unknowns: Vec<usize> = electrodes().into_iter().chain(patches().into_iter().flatten()).collect();
        let green_ohm =
            unknowns.iter().flat_map(|row| unknowns.iter().map(|column| inverse[(*row, *column)])).collect();
        let patch = |nodes: &[usize; 2]| {
            let [x_m, y_m] = at_m(nodes[0]);
            format!("{{\"x\": {}, \"y\": {y_m}, \"r\": {RADIUS_M}}}", x_m + 0.5 * STEP_M)
        };
        let all: Vec<String> = patches().iter().map(patch).collect();
        Self {
            green_ohm,
            sheet_s: SHEET_S,
            electrodes: electrodes().len() as i64,
            sizes: vec![2; all.len()],
            meta: format!("{{\"T\": 0.005, \"patches\": [{}]}}", all.join(", ")),
        }
    }

    fn archive(&self) -> Archive {
        let mut bytes = Vec::new();
        let mut writer = NpzWriter::new(Cursor::new(&mut bytes));
        let side = self.green_ohm.len().isqrt();
        writer.add("G", &[side, side], &self.green_ohm).unwrap();
        writer.add("g", &[], &[self.sheet_s]).unwrap();
        writer.add_values("n", &[], Values::Integers(&[self.electrodes])).unwrap();
        writer.add_values("sizes", &[self.sizes.len()], Values::Integers(&self.sizes)).unwrap();
        writer.add_values("meta", &[], Values::Text(&self.meta)).unwrap();
        writer.finish().unwrap();
        Archive::parse(Path::new("network.npz"), &bytes).unwrap()
    }

    pub fn read(&self) -> Result<Independent, IndependentError> {
        Independent::of(Path::new("network.npz"), self.archive())
    }
}

fn touches(independent: &Independent, contacts: &[(usize, f64)]) -> Vec<Touch> {
    contacts.iter().map(|&(patch, conductance_s)| independent.patches[patch].contact(conductance_s).into()).collect()
}

#[test]
fn impedances_are_those_of_the_network_under_its_contacts() {
    let independent = Contents::of_network().read().unwrap();
    assert_eq!((&*independent.name, independent.electrodes, independent.patches.len()), ("network", 16, 25));
    for contacts in [&[(7, 1e-3)][..], &[(0, 2e-5), (12, 4e-3)], &[(3, 1e-4), (9, 1e-3), (20, 3e-3), (24, 5e-2)]] {
        let joined =
            contacts.iter().flat_map(|&(patch, conductance_s)| patches()[patch].map(|node| (node, conductance_s)));
        let solved = network_s(&joined.collect::<Vec<_>>()).try_inverse().unwrap();
        let expected = DMatrix::from_fn(16, 16, |i, j| solved[(electrodes()[i], electrodes()[j])]);
        let impedance_ohm = independent.impedance_ohm(&touches(&independent, contacts)).unwrap();
        let off = (&impedance_ohm - &expected).amax() / expected.amax();
        assert!(off < 1e-9, "{contacts:?}: {off}");
    }
}

#[test]
fn what_is_no_patch_or_does_not_conduct_is_refused() {
    let independent = Contents::of_network().read().unwrap();
    assert_eq!(independent.impedance_ohm(&[]), Err(ForwardError::NoContact));
    let beside = Contact { x_m: 1e-3, ..independent.patches[1].contact(1e-3) };
    let beside = [touches(&independent, &[(0, 1e-3)]), vec![beside.into()]].concat();
    let refused = independent.impedance_ohm(&beside).unwrap_err().to_string();
    assert!(refused.starts_with("contact 1 (the independent solution has no such patch)"), "{refused}");
    for conductance_s in [0.0, -1e-3, f64::NAN, f64::INFINITY] {
        assert!(independent.impedance_ohm(&touches(&independent, &[(0, conductance_s)])).is_err(), "{conductance_s}");
    }
}

#[test]
fn a_bad_file_is_told_with_its_name_and_the_array() {
    type Change = fn(&mut Contents);
    let cases: [(Change, &str); 10] = [
        (|of| of.electrodes = 0, "array n: it is 0; a number above zero is needed"),
        (|of| of.electrodes = 1 << 40, "array n: it is 1099511627776; 1 to 1024 electrodes"),
        (|of| of.sheet_s = f64::NAN, "array g: it is NaN"),
        (|of| of.sizes[3] = -1, "array sizes: -1 is no number of unknowns"),
        (|of| of.sizes[3] = 3, "array G: it is 66 x 66, but electrodes and sizes of patches make 67 x 67"),
        (|of| of.green_ohm[5] = f64::INFINITY, "array G: it has what is no number"),
        (|of| of.green_ohm[5] *= 1.001, "array G: it is not symmetric"),
        (|of| of.meta.truncate(40), "array meta: EOF while parsing"),
        (|of| of.meta = "{\"patches\": []}".to_owned(), "array meta: it has 0 patches, but sizes has 25"),
        (|of| of.meta = of.meta.replacen("0.0025}", "-0.0025}", 1), "array meta: patch 0 is no disc"),
    ];
    for (change, what) in cases {
        let mut contents = Contents::of_network();
        change(&mut contents);
        let refused = contents.read().unwrap_err().to_string();
        assert!(refused.starts_with(&format!("network.npz: {what}")), "{refused}");
    }
    let mut archive = Contents::of_network().archive();
    archive.text("meta").unwrap();
    let refused = Independent::of(Path::new("network.npz"), archive).unwrap_err().to_string();
    assert_eq!(refused, "network.npz: no array is called meta; there are none");
    let missing = Independent::read(Path::new("no/such.npz")).unwrap_err();
    assert_eq!(missing.to_string(), "cannot read no/such.npz");
}
