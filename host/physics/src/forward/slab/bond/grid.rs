//! The same detector on a grid of cubes, for tests: finite volumes, conjugate gradients, and nothing in common with the modes.
//!
//! Discs take up the share of each cube's face that they cover; the cubes' centres are half an edge away. A dot's glue is a grid of its own.

use nalgebra::DMatrix;

use crate::detector::Detector;
use crate::scene::Contact;

/// Points along an edge of a cube's face that tell how much of it a disc covers.
const POINTS: usize = 16;
/// Residual at which conjugate gradients end, as a share of the first.
const RESIDUAL: f64 = 1e-8;

/// A network of conductances (S); node 0 is the driving layer.
struct Network {
    nodes: usize,
    edges: Vec<(usize, usize, f64)>,
}

/// Cubes of an edge over the detector.
struct Cubes<'a> {
    detector: &'a Detector,
    edge_m: f64,
    along: [usize; 2],
    network: Network,
}

/// The impedance matrix (ohm) with cubes of an edge (m) that divides the detector's sizes.
pub(super) fn impedance_ohm(detector: &Detector, contacts: &[Contact], edge_m: f64) -> DMatrix<f64> {
    let size_m = detector.outline.size_m();
    let along = size_m.map(|size_m| (size_m / edge_m).round() as usize);
    let mut cubes = Cubes { detector, edge_m, along, network: Network { nodes: 1, edges: Vec::new() } };
    let pads = cubes.build(contacts);
    let mut impedance_ohm = DMatrix::zeros(pads.len(), pads.len());
    for (column, pad) in pads.iter().enumerate() {
        let potentials = cubes.network.potentials(*pad);
        pads.iter().enumerate().for_each(|(row, other)| impedance_ohm[(row, column)] = potentials[*other]);
    }
    impedance_ohm
}

impl Cubes<'_> {
    fn build(&mut self, contacts: &[Contact]) -> Vec<usize> {
        let mut below: Option<(Vec<usize>, f64)> = None;
        let mut pads = Vec::new();
        for layer in &self.detector.layers {
            let sigma = layer.top_s_per_m;
            for row in 0..(layer.thickness_m / self.edge_m).round() as usize {
                let plane = self.plane(|_| true, sigma * self.edge_m);
                match (below.take(), layer.bond.filter(|_| row == 0)) {
                    (None, _) => pads = self.pads(&plane, sigma),
                    (Some((under, of)), None) => {
                        let conductance_s = self.edge_m / (0.5 / of + 0.5 / sigma);
                        self.join(&under, &plane, conductance_s);
                    }
                    (Some((under, of)), Some(bond)) => {
                        let middles = bond.centres_m(self.detector.outline.size_m());
                        let half_ohm_m2 = |sigma: f64| self.edge_m / (2.0 * sigma) + bond.contact_impedance_ohm_m2;
                        let faces = [(under, half_ohm_m2(of)), (plane.clone(), half_ohm_m2(sigma))];
                        middles.into_iter().for_each(|at_m| {
                            self.dot(at_m, bond.diameter_m / 2.0, bond.sheet_conductance_s, &faces);
                        });
                    }
                }
                below = Some((plane, sigma));
            }
        }
        let (top, sigma) = below.unwrap();
        for contact in contacts {
            let area_m2 = std::f64::consts::PI * contact.radius_m * contact.radius_m;
            let ohm_m2 = self.edge_m / (2.0 * sigma) + area_m2 / contact.conductance_s;
            for (node, share) in top.iter().zip(self.shares([contact.x_m, contact.y_m], contact.radius_m)) {
                self.network.join(*node, 0, share * self.edge_m * self.edge_m / ohm_m2);
            }
        }
        pads
    }

    fn pads(&mut self, plane: &[usize], sigma: f64) -> Vec<usize> {
        let mut pads = Vec::new();
        for pad in &self.detector.electrodes {
            let node = self.network.node();
            let ohm_m2 = self.edge_m / (2.0 * sigma) + self.detector.pad_impedance_ohm_m2(pad);
            for (cube, share) in plane.iter().zip(self.shares([pad.x_m, pad.y_m], pad.radius_m)) {
                self.network.join(node, *cube, share * self.edge_m * self.edge_m / ohm_m2);
            }
            pads.push(node);
        }
        pads
    }

    fn dot(&mut self, at_m: [f64; 2], radius_m: f64, sheet_s: f64, faces: &[(Vec<usize>, f64); 2]) {
        let shares = self.shares(at_m, radius_m);
        let glue = self.plane(|index| shares[index] > 0.0, 0.0);
        let neighbours = [1, self.along[0]];
        for index in 0..glue.len() {
            for (plane, ohm_m2) in faces {
                self.network.join(glue[index], plane[index], shares[index] * self.edge_m * self.edge_m / ohm_m2);
            }
            for next in neighbours.map(|step| index + step).into_iter().filter(|next| *next < glue.len()) {
                let both = shares[index] + shares[next];
                if shares[index] * shares[next] > 0.0 && self.are_neighbours(index, next) {
                    self.network.join(glue[index], glue[next], sheet_s * 2.0 * shares[index] * shares[next] / both);
                }
            }
        }
    }

    fn are_neighbours(&self, index: usize, next: usize) -> bool {
        next != index + 1 || !next.is_multiple_of(self.along[0])
    }

    /// A plane of nodes, joined along it by a conductance between neighbours; 0 stands for none.
    fn plane(&mut self, holds: impl Fn(usize) -> bool, conductance_s: f64) -> Vec<usize> {
        let count = self.along[0] * self.along[1];
        let plane: Vec<_> = (0..count).map(|index| if holds(index) { self.network.node() } else { 0 }).collect();
        for index in 0..count {
            for next in [index + 1, index + self.along[0]] {
                if next < count && self.are_neighbours(index, next) {
                    self.network.join(plane[index], plane[next], conductance_s);
                }
            }
        }
        plane
    }

    fn join(&mut self, a: &[usize], b: &[usize], conductance_s: f64) {
        a.iter().zip(b).for_each(|(a, b)| self.network.join(*a, *b, conductance_s));
    }

    /// Share of each cube's face that a disc covers.
    fn shares(&self, [x_m, y_m]: [f64; 2], radius_m: f64) -> Vec<f64> {
        let size_m = self.detector.outline.size_m();
        let part = |i: usize| (i as f64 + 0.5) / POINTS as f64;
        let share = |index: usize| {
            let at_m = |axis: usize, cube: usize, i: usize| (cube as f64 + part(i)) * self.edge_m - size_m[axis] / 2.0;
            let [column, row] = [index % self.along[0], index / self.along[0]];
            let points = (0..POINTS).flat_map(|i| (0..POINTS).map(move |j| [i, j]));
            let inside = points.filter(|[i, j]| (at_m(0, column, *i) - x_m).hypot(at_m(1, row, *j) - y_m) < radius_m);
            inside.count() as f64 / (POINTS * POINTS) as f64
        };
        (0..self.along[0] * self.along[1]).map(share).collect()
    }
}

impl Network {
    fn node(&mut self) -> usize {
        self.nodes += 1;
        self.nodes - 1
    }

    fn join(&mut self, a: usize, b: usize, conductance_s: f64) {
        if conductance_s > 0.0 {
            self.edges.push((a, b, conductance_s));
        }
    }

    /// Potentials for 1 A into a node (ohm).
    fn potentials(&self, node: usize) -> Vec<f64> {
        let mut diagonal = vec![0.0; self.nodes];
        self.edges.iter().for_each(|(a, b, s)| [a, b].into_iter().for_each(|i| diagonal[*i] += s));
        let mut residual = vec![0.0; self.nodes];
        residual[node] = 1.0;
        let mut potential = vec![0.0; self.nodes];
        let precondition =
            |residual: &[f64]| -> Vec<f64> { residual.iter().zip(&diagonal).map(|(r, d)| r / d).collect() };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut along = precondition(&residual);
        let mut square = dot(&residual, &along);
        let end = RESIDUAL * RESIDUAL * square;
        while square > end {
            let mut current = vec![0.0; self.nodes];
            for (a, b, s) in &self.edges {
                let flow = s * (along[*a] - along[*b]);
                current[*a] += flow;
                current[*b] -= flow;
            }
            current[0] = 0.0;
            let step = square / dot(&along, &current);
            potential.iter_mut().zip(&along).for_each(|(value, along)| *value += step * along);
            residual.iter_mut().zip(&current).for_each(|(value, current)| *value -= step * current);
            let next = precondition(&residual);
            let after = dot(&residual, &next);
            along.iter_mut().zip(&next).for_each(|(value, next)| *value = next + after / square * *value);
            along[0] = 0.0;
            square = after;
        }
        potential
    }
}
