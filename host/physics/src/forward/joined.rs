//! Electrodes whose wires touch.
//!
//! Between two joined pads flows a current that makes their potentials differ by no more than the wire's resistance `r` takes. With `d`
//! the difference of their unit vectors and any fields `N` of the detector, bare or in contact, it is `-d^T N / (d^T N d + r)`
//! per unit current, so all fields change by a term of rank one: `N - (N d)(N d)^T / (d^T N d + r)`.

use nalgebra::DMatrix;

/// Two electrodes, and the resistance between their wires (ohm).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// The electrodes.
    pub electrodes: [usize; 2],
    /// Resistance of what joins them (ohm).
    pub ohm: f64,
}

impl Joint {
    /// Two electrodes that are joined without resistance.
    pub const fn short(a: usize, b: usize) -> Self {
        Self { electrodes: [a, b], ohm: 0.0 }
    }
}

/// Currents through joints, for fields of a detector between its electrodes.
#[derive(Clone, Debug, Default)]
pub struct JointCurrents {
    /// Current of each joint at the electrodes (square root of S): `electrodes x joints`.
    currents: DMatrix<f64>,
    /// Field of each at the electrodes (square root of ohm): `electrodes x joints`.
    fields: DMatrix<f64>,
}

impl JointCurrents {
    /// The currents through some joints, for the fields between all electrodes (ohm): floating ones, or an impedance matrix. A joint that closes
    /// a loop of others without resistance carries nothing.
    ///
    /// # Panics
    /// If there is no such electrode.
    pub fn new(electrodes_ohm: &DMatrix<f64>, joints: &[Joint]) -> Self {
        let n = electrodes_ohm.nrows();
        let mut all = Self { currents: DMatrix::zeros(n, 0), fields: DMatrix::zeros(n, 0) };
        for Joint { electrodes: [a, b], ohm } in joints {
            // The field of an ampere from one to the other, with the joints before.
            let mut current = DMatrix::zeros(n, 1);
            current[*a] += 1.0;
            current[*b] -= 1.0;
            let before = all.fields.transpose() * &current;
            current -= &all.currents * before;
            let field = electrodes_ohm * &current;
            let loop_ohm = field[*a] - field[*b] + ohm;
            if loop_ohm > LEAST * electrodes_ohm[(*a, *a)].abs() {
                let scale = 1.0 / loop_ohm.sqrt();
                let count = all.currents.ncols();
                all.currents = all.currents.insert_column(count, 0.0);
                all.fields = all.fields.insert_column(count, 0.0);
                all.currents.column_mut(count).copy_from(&(current * scale).column(0));
                all.fields.column_mut(count).copy_from(&(field * scale).column(0));
            }
        }
        all
    }

    /// Number of joints that carry a current.
    pub fn count(&self) -> usize {
        self.currents.ncols()
    }

    /// Fields of the joints' currents (square root of ohm), `rows x joints`, where those of the electrodes are given: `rows x electrodes`
    /// (ohm). What is to be subtracted between two rows is their product.
    pub fn at(&self, electrodes_ohm: &DMatrix<f64>) -> DMatrix<f64> {
        electrodes_ohm * &self.currents
    }

    /// Fields of the electrodes (ohm), `rows x electrodes`, with the joints' currents.
    pub fn applied(&self, electrodes_ohm: &DMatrix<f64>) -> DMatrix<f64> {
        electrodes_ohm - self.at(electrodes_ohm) * self.fields.transpose()
    }

    /// Fields of the joints' currents at a place, and the electrodes' fields there (ohm) changed by them.
    pub(super) fn apply(&self, electrodes_ohm: &mut [f64]) -> Vec<f64> {
        let along = |joint: usize| self.currents.column(joint).iter().zip(&*electrodes_ohm).map(|(a, b)| a * b).sum();
        let at: Vec<f64> = (0..self.count()).map(along).collect();
        for (joint, value) in at.iter().enumerate() {
            electrodes_ohm.iter_mut().zip(&self.fields.column(joint)).for_each(|(ohm, field)| *ohm -= value * field);
        }
        at
    }
}

/// Share of an electrode's own field below which what parts two electrodes is rounding.
const LEAST: f64 = 1e-9;
