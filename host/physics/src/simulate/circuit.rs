//! Between the electrodes and the converter: wires, and what is wrong with them.
//!
//! A detector under contact is a network of resistors that its impedance matrix `Z` describes in full, so a fault of the wires is
//! an exact change of `Z`, whatever is pressed.

use nalgebra::DMatrix;

use super::fault::{Fault, FaultError};
use crate::detector::Detector;

/// The wires of a board, and the factors of its channels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Circuit {
    open: Vec<bool>,
    /// Pairs of electrodes and the resistance between their wires (ohm).
    shorts: Vec<([usize; 2], f64)>,
    /// The electrode at each channel.
    channels: Vec<usize>,
    gain: Vec<Gain>,
    clip_v: [f64; 2],
}

/// A channel's reading is `offset_v + factor * voltage`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Gain {
    offset_v: f64,
    factor: f64,
}

/// What the board's channels are connected to.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Wired {
    /// Impedances between the channels (ohm); rows and columns of open ones mean nothing.
    pub impedance_ohm: DMatrix<f64>,
    /// Channels connected to nothing.
    pub open: Vec<bool>,
}

impl Circuit {
    /// The circuit of `detector` with such faults.
    pub fn new(detector: &Detector, faults: &[Fault]) -> Result<Self, FaultError> {
        let electrodes = detector.electrodes.len();
        faults.iter().try_for_each(|fault| fault.check(electrodes))?;
        let mut circuit = Self {
            open: vec![false; electrodes],
            shorts: Vec::new(),
            channels: (0..electrodes).collect(),
            gain: detector.electrodes.iter().map(|pad| Gain { offset_v: pad.offset_v, factor: pad.gain }).collect(),
            clip_v: [f64::NEG_INFINITY, f64::INFINITY],
        };
        faults.iter().for_each(|fault| circuit.add(fault, detector));
        Ok(circuit)
    }

    fn add(&mut self, fault: &Fault, detector: &Detector) {
        match *fault {
            Fault::Open { electrode } => self.open[electrode] = true,
            Fault::Short { electrodes, ohm } => self.shorts.push((electrodes, ohm)),
            Fault::Swap { channels: [a, b] } => self.channels.swap(a, b),
            Fault::Gain { channel, factor } => self.gain[channel].scale(factor),
            Fault::Invert { channel } => self.gain[channel].invert(detector.adc.full_scale_v),
            Fault::Clip { range_v: [low_v, high_v] } => {
                self.clip_v = [self.clip_v[0].max(low_v), self.clip_v[1].min(high_v)];
            }
            // The model of the detector has these, or what presses on it.
            Fault::ContactSpread { .. }
            | Fault::Conductivity { .. }
            | Fault::Uneven { .. }
            | Fault::DrivingSheet { .. }
            | Fault::Leak { .. }
            | Fault::Creep { .. }
            | Fault::Hysteresis { .. }
            | Fault::Drift { .. } => {}
        }
    }

    /// What the channels are connected to, from the impedances between the electrodes (ohm).
    pub fn wire(&self, impedance_ohm: &DMatrix<f64>) -> Wired {
        let mut wired = Wired { impedance_ohm: impedance_ohm.clone(), open: self.open.clone() };
        wired.short_all(&self.shorts);
        Wired {
            impedance_ohm: wired.impedance_ohm.select_rows(&self.channels).select_columns(&self.channels),
            open: self.channels.iter().map(|electrode| wired.open[*electrode]).collect(),
        }
    }

    /// The voltage at a channel's converter (V) for the one on its wire.
    pub fn amplified_v(&self, channel: usize, volts: f64) -> f64 {
        let Gain { offset_v, factor } = self.gain[channel];
        (offset_v + factor * volts).clamp(self.clip_v[0], self.clip_v[1].max(self.clip_v[0]))
    }
}

impl Gain {
    fn scale(&mut self, factor: f64) {
        self.offset_v *= factor;
        self.factor *= factor;
    }

    fn invert(&mut self, full_scale_v: f64) {
        self.offset_v = full_scale_v - self.offset_v;
        self.factor = -self.factor;
    }
}

impl Wired {
    /// Joins wires in any order: a broken wire that touches a whole one becomes a branch of it, which others may touch in turn.
    fn short_all(&mut self, shorts: &[([usize; 2], f64)]) {
        let mut left = shorts.to_vec();
        while let Some(next) = left.iter().position(|([a, b], _)| !(self.open[*a] && self.open[*b])) {
            let ([a, b], ohm) = left.swap_remove(next);
            match (self.open[a], self.open[b]) {
                (true, _) => self.branch(a, b, ohm),
                (_, true) => self.branch(b, a, ohm),
                _ => self.join(a, b, ohm),
            }
        }
    }

    /// Joins two wires by a resistance. With `d` the difference of their unit vectors, the current between them per unit current into
    /// the detector is `-d^T Z / (d^T Z d + r)`, and its field `Z d`: a change of rank one.
    fn join(&mut self, a: usize, b: usize, ohm: f64) {
        let field = self.impedance_ohm.column(a) - self.impedance_ohm.column(b);
        let loop_ohm = field[a] - field[b] + ohm;
        if loop_ohm > 0.0 {
            self.impedance_ohm -= &field * field.transpose() / loop_ohm;
        }
    }

    /// Connects a wire that has no electrode to one that has.
    fn branch(&mut self, open: usize, to: usize, ohm: f64) {
        let row = self.impedance_ohm.row(to).clone_owned();
        self.impedance_ohm.set_row(open, &row);
        let column = self.impedance_ohm.column(to).clone_owned();
        self.impedance_ohm.set_column(open, &column);
        self.impedance_ohm[(open, open)] += ohm;
        self.open[open] = false;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::readings::Readings;

    /// Conductances (S) of a network of four electrodes and two nodes inside, each pair, and of each to the driving layer.
    const PAIRS: [(usize, usize, f64); 8] = [
        (0, 4, 1.0e-3),
        (1, 4, 2.0e-3),
        (2, 5, 1.5e-3),
        (3, 5, 0.7e-3),
        (4, 5, 0.9e-3),
        (0, 1, 0.2e-3),
        (1, 2, 0.3e-3),
        (3, 0, 0.1e-3),
    ];
    const TO_DRIVE: [(usize, f64); 2] = [(4, 0.4e-3), (5, 0.05e-3)];

    fn detector() -> Detector {
        let mut detector = Detector::preset(Detector::DEFAULT).unwrap();
        detector.electrodes.truncate(4);
        detector
    }

    /// Admittances of the network with more resistors in it, and two more nodes for ends of broken wires.
    fn admittances(extra: &[(usize, usize, f64)]) -> DMatrix<f64> {
        let mut all = DMatrix::zeros(8, 8);
        for (i, j, siemens) in PAIRS.iter().chain(extra) {
            for (row, column, sign) in [(*i, *i, 1.0), (*j, *j, 1.0), (*i, *j, -1.0), (*j, *i, -1.0)] {
                all[(row, column)] += sign * siemens;
            }
        }
        TO_DRIVE.iter().for_each(|(node, siemens)| all[(*node, *node)] += siemens);
        // Ends of wires that nothing is connected to: a conductance that changes nothing else keeps the matrix regular.
        (6..8).for_each(|node| all[(node, node)] += 1e-12);
        all
    }

    fn impedances(extra: &[(usize, usize, f64)], nodes: &[usize]) -> DMatrix<f64> {
        let all = admittances(extra).try_inverse().unwrap();
        all.select_rows(nodes).select_columns(nodes)
    }

    fn wired(faults: &[&str]) -> Wired {
        let faults: Vec<Fault> = faults.iter().map(|fault| fault.parse().unwrap()).collect();
        Circuit::new(&detector(), &faults).unwrap().wire(&impedances(&[], &[0, 1, 2, 3]))
    }

    fn assert_near(found: &Wired, expected: &DMatrix<f64>) {
        let error = (&found.impedance_ohm - expected).amax() / expected.amax();
        assert!(error < 1e-7, "{error}: {} {expected}", found.impedance_ohm);
        assert!(found.open.iter().all(|open| !open));
    }

    #[test]
    fn shorts_are_the_network_with_a_resistor_more() {
        assert_near(&wired(&["short:0,2:50"]), &impedances(&[(0, 2, 1.0 / 50.0)], &[0, 1, 2, 3]));
        let both = [(0, 2, 1.0 / 50.0), (2, 3, 1.0 / 80.0)];
        assert_near(&wired(&["short:2,3:80", "short:0,2:50"]), &impedances(&both, &[0, 1, 2, 3]));
        // A short of no resistance against one of a microohm.
        assert_near(&wired(&["short:1,3"]), &impedances(&[(1, 3, 1e6)], &[0, 1, 2, 3]));
    }

    #[test]
    fn shorted_wires_are_one_and_a_short_given_twice_is_one() {
        let once = wired(&["short:1,3"]);
        for e in 0..4 {
            assert!((once.impedance_ohm[(1, e)] - once.impedance_ohm[(3, e)]).abs() < 1e-9);
        }
        let twice = wired(&["short:1,3", "short:3,1"]);
        assert!((once.impedance_ohm - twice.impedance_ohm).amax() < 1e-6);
    }

    #[test]
    fn a_broken_wire_that_touches_others_branches_off_them() {
        // The electrode of wire 3 is node 3; the wire's end is node 6, joined to wires 1 (and 0) only.
        let one = impedances(&[(6, 1, 1.0 / 30.0)], &[0, 1, 2, 6]);
        assert_near(&wired(&["open:3", "short:3,1:30"]), &one);
        let two = impedances(&[(6, 1, 1.0 / 30.0), (6, 0, 1.0 / 70.0)], &[0, 1, 2, 6]);
        assert_near(&wired(&["short:3,1:30", "short:0,3:70", "open:3"]), &two);
        let chain = impedances(&[(6, 7, 1.0 / 30.0), (7, 0, 1.0 / 70.0)], &[0, 1, 7, 6]);
        assert_near(&wired(&["open:2", "open:3", "short:3,2:30", "short:0,2:70"]), &chain);
    }

    #[test]
    fn open_wires_leave_the_others_as_they_are() {
        let found = wired(&["open:2"]);
        assert_eq!(found.open, [false, false, true, false]);
        assert_eq!(found.impedance_ohm.remove_row(2).remove_column(2), impedances(&[], &[0, 1, 3]));
        assert_eq!(wired(&["open:2", "open:3", "short:2,3"]).open, [false, false, true, true]);
    }

    #[test]
    fn exchanged_wires_exchange_both_roles() {
        let sound = impedances(&[], &[0, 1, 2, 3]);
        assert_eq!(wired(&["swap:1,3"]).impedance_ohm, impedances(&[], &[0, 3, 2, 1]));
        assert_eq!(wired(&["swap:1,3", "swap:3,1"]).impedance_ohm, sound);
        assert_eq!(wired(&["open:1", "swap:1,3"]).open, [false, false, false, true]);
    }

    #[test]
    fn gain_sign_and_clipping_come_in_the_order_given() {
        let faults = ["gain:1:0.5", "invert:1", "clip:0.2,3.0"].map(|fault| fault.parse().unwrap());
        let circuit = Circuit::new(&detector(), &faults).unwrap();
        let found = Readings::from_fn(2, |channel, k| circuit.amplified_v(channel, [0.1, 2.0][k]));
        assert_eq!(found.volts(), [0.2, 2.0, 3.0, 3.3 - 1.0]);
    }
}
