//! The paper's figure 7(B): a bar of conductor with 1 V from top to bottom, in two halves that a dot of glue joins.
//!
//! One dot's share of the bond is a cylinder of the same area. The glue is far better than the conductor, so the dot is at one potential, half of the drive by
//! symmetry, and only the upper half has to be solved: finite volumes in radius and height, conjugate gradients.

use std::f64::consts::PI;

/// Drive from top to bottom (V), and conductivity (S/m), there.
const DRIVE_V: f64 = 1.0;
const CONDUCTIVITY_S_PER_M: f64 = 1.0;
/// Cells along the radius and the height of a half.
const CELLS: [usize; 2] = [60, 50];
/// Conjugate gradients end at this share of the first residual, or after so many steps.
const LEFT: f64 = 1e-9;
const STEPS: usize = 2000;

/// A bar and what flows in it.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Bar {
    /// Radius of the cylinder that has a dot's share of the bond (m).
    pub radius_m: f64,
    /// Height of both halves together (m).
    pub height_m: f64,
    /// Diameter of the dot (m).
    pub dot_diameter_m: f64,
    /// Current through it (A).
    pub current_a: f64,
    /// Current over the dot's area (A/m2).
    pub over_dot_a_per_m2: f64,
    /// Current over all of the bond (A/m2).
    pub over_bond_a_per_m2: f64,
    /// Potential of the upper half (V) at the middles of its cells: a row for each height from the bond up, from the axis outwards.
    #[serde(skip)]
    pub potential_v: Vec<Vec<f64>>,
}

impl Bar {
    /// Of dots at a pitch (m) between layers of a height each (m).
    pub fn of(pitch_m: f64, layer_m: f64, dot_diameter_m: f64) -> Self {
        let radius_m = pitch_m / PI.sqrt();
        let half = Half::new(radius_m, layer_m, dot_diameter_m / 2.0);
        let volts = half.solve();
        let current_a = half.current_a(&volts);
        let area_m2 = |radius_m: f64| PI * radius_m * radius_m;
        Self {
            radius_m,
            height_m: 2.0 * layer_m,
            dot_diameter_m,
            current_a,
            over_dot_a_per_m2: current_a / area_m2(dot_diameter_m / 2.0),
            over_bond_a_per_m2: current_a / area_m2(radius_m),
            potential_v: volts.chunks_exact(CELLS[0]).map(<[f64]>::to_vec).collect(),
        }
    }

    /// Potential at a radius and a height above the bond (m), of which those below are the others' mirror (V).
    pub fn at_v(&self, radius_m: f64, height_m: f64) -> f64 {
        let [columns, rows] = CELLS;
        let place = |share: f64, count: usize| ((share * count as f64) as usize).min(count - 1);
        let column = place(radius_m.abs() / self.radius_m, columns);
        let row = place(height_m.abs() / (self.height_m / 2.0), rows);
        let upper_v = self.potential_v.get(row).and_then(|row| row.get(column)).copied().unwrap_or(DRIVE_V);
        if height_m >= 0.0 { upper_v } else { DRIVE_V - upper_v }
    }
}

/// The upper half: conductances between its cells and to what is held at a potential.
struct Half {
    /// To the cell further out, of each column (S).
    outwards_s: Vec<f64>,
    /// To the cell above, of each column (S).
    upwards_s: Vec<f64>,
    /// To the dot, of each column (S).
    dot_s: Vec<f64>,
}

impl Half {
    fn new(radius_m: f64, height_m: f64, dot_m: f64) -> Self {
        let [step_m, rise_m] = [radius_m / CELLS[0] as f64, height_m / CELLS[1] as f64];
        let ring_m2 = |from_m: f64, to_m: f64| PI * (to_m * to_m - from_m * from_m).max(0.0);
        let edge_m = |column: usize| column as f64 * step_m;
        let columns = 0..CELLS[0];
        let outwards = |column: usize| match column + 1 < CELLS[0] {
            true => CONDUCTIVITY_S_PER_M * 2.0 * PI * edge_m(column + 1) * rise_m / step_m,
            false => 0.0,
        };
        let over = |column: usize, to_m: f64| ring_m2(edge_m(column), edge_m(column + 1).min(to_m));
        Self {
            outwards_s: columns.clone().map(outwards).collect(),
            upwards_s: columns.clone().map(|column| CONDUCTIVITY_S_PER_M * over(column, radius_m) / rise_m).collect(),
            // From the middle of a cell it is half as far to its face.
            dot_s: columns.map(|column| 2.0 * CONDUCTIVITY_S_PER_M * over(column, dot_m) / rise_m).collect(),
        }
    }

    /// Currents out of all cells (A) at some potentials (V) above what is held.
    fn currents_a(&self, volts: &[f64]) -> Vec<f64> {
        let [columns, rows] = CELLS;
        let mut currents = vec![0.0; volts.len()];
        let mut between = |a: usize, b: usize, conductance_s: f64| {
            let current_a = conductance_s * (volts[a] - volts[b]);
            currents[a] += current_a;
            currents[b] -= current_a;
        };
        for row in 0..rows {
            for column in 0..columns {
                let cell = row * columns + column;
                if column + 1 < columns {
                    between(cell, cell + 1, self.outwards_s[column]);
                }
                if row + 1 < rows {
                    between(cell, cell + columns, self.upwards_s[column]);
                }
            }
        }
        for column in 0..columns {
            currents[column] += self.dot_s[column] * volts[column];
            let top = (rows - 1) * columns + column;
            currents[top] += 2.0 * self.upwards_s[column] * volts[top];
        }
        currents
    }

    /// Currents that the held potentials drive into cells (A).
    fn driven_a(&self) -> Vec<f64> {
        let [columns, rows] = CELLS;
        let mut driven = vec![0.0; columns * rows];
        for column in 0..columns {
            driven[column] += self.dot_s[column] * DRIVE_V / 2.0;
            driven[(rows - 1) * columns + column] += 2.0 * self.upwards_s[column] * DRIVE_V;
        }
        driven
    }

    /// Potentials of all cells (V).
    fn solve(&self) -> Vec<f64> {
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut volts = vec![0.0; CELLS[0] * CELLS[1]];
        let mut left = self.driven_a();
        let mut direction = left.clone();
        let mut square = product(&left, &left);
        let enough = LEFT * LEFT * square;
        for _ in 0..STEPS {
            if square <= enough {
                break;
            }
            let along = self.currents_a(&direction);
            let step = square / product(&direction, &along);
            volts.iter_mut().zip(&direction).for_each(|(volt, part)| *volt += step * part);
            left.iter_mut().zip(&along).for_each(|(left, part)| *left -= step * part);
            let next = product(&left, &left);
            direction.iter_mut().zip(&left).for_each(|(part, left)| *part = left + next / square * *part);
            square = next;
        }
        volts
    }

    /// Current into the dot (A).
    fn current_a(&self, volts: &[f64]) -> f64 {
        self.dot_s.iter().zip(volts).map(|(dot_s, volt)| dot_s * (volt - DRIVE_V / 2.0)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dot_over_all_of_the_bond_lets_the_current_through_evenly() {
        let pitch_m = 0.012;
        let bar = Bar::of(pitch_m, 0.005, 2.0 * pitch_m / PI.sqrt());
        // 1 V over 10 mm at 1 S/m.
        assert!((bar.over_bond_a_per_m2 - 100.0).abs() < 1e-3, "{}", bar.over_bond_a_per_m2);
        assert!((bar.at_v(0.001, 0.0025) - 0.75).abs() < 0.01 && (bar.at_v(0.001, -0.0025) - 0.25).abs() < 0.01);
    }

    #[test]
    fn a_narrow_dot_has_the_resistance_of_a_constriction() {
        // Negus and Yovanovich (1984): a disc of radius a on a tube of radius R has psi / (4 sigma a) on either side besides that of the tube.
        let (layer_m, radius_m) = (0.010, 0.006);
        let pitch_m = radius_m * PI.sqrt();
        for share in [0.4, 0.6, 0.8] {
            let bar = Bar::of(pitch_m, layer_m, 2.0 * share * radius_m);
            let e: f64 = share;
            let psi = 1.0 - 1.409_78 * e + 0.344_06 * e.powi(3) + 0.0435 * e.powi(5) + 0.022_71 * e.powi(7);
            let half_ohm = layer_m / (PI * radius_m * radius_m) + psi / (4.0 * share * radius_m);
            assert!((bar.current_a * 2.0 * half_ohm - 1.0).abs() < 0.02, "{share}: {}", bar.current_a * 2.0 * half_ohm);
        }
    }

    #[test]
    fn wider_dots_carry_more_current_but_less_on_each_square_metre_of_dot() {
        let [narrow, wide] = [0.002, 0.006].map(|diameter_m| Bar::of(0.012, 0.005, diameter_m));
        assert!(
            wide.over_bond_a_per_m2 > narrow.over_bond_a_per_m2 && wide.over_dot_a_per_m2 < narrow.over_dot_a_per_m2
        );
    }
}
