//! Conductivity that differs across the plane of a detector.

use std::f64::consts::PI;

/// A factor on the conductivity of all layers that differs from place to place: the exponential of a sum of cosines,
/// `exp(sum a_ij cos(i pi u) cos(j pi v))` with `u` and `v` from 0 to 1 across the outline's bounding box (on a curved detector that of its
/// map). Cosines have no slope across the walls and are what a slab's modes are.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Unevenness {
    /// `a_ij`, row `i` by row; empty where the conductivity is even. `a_00` is a factor everywhere.
    pub log_amplitudes: Vec<Vec<f64>>,
}

impl Unevenness {
    /// Whether the conductivity is the same everywhere.
    pub fn is_even(&self) -> bool {
        self.modes().next().is_none()
    }

    /// Half waves along both sides, and amplitude, of those that are not zero.
    pub fn modes(&self) -> impl Iterator<Item = ([usize; 2], f64)> {
        let row = |(i, row): (usize, &'_ Vec<f64>)| {
            row.iter().enumerate().map(|(j, a)| ([i, j], *a)).collect::<Vec<_>>().into_iter()
        };
        self.log_amplitudes.iter().enumerate().flat_map(row).filter(|(_, a)| *a != 0.0)
    }

    /// Highest number of half waves along a side.
    pub fn most(&self) -> usize {
        self.modes().map(|([i, j], _)| i.max(j)).max().unwrap_or(0)
    }

    /// Logarithm of the factor at a place, in shares of the sides.
    pub fn log_at(&self, [u, v]: [f64; 2]) -> f64 {
        let most = self.log_amplitudes.iter().map(Vec::len).chain([self.log_amplitudes.len()]).max().unwrap_or(0);
        let (x, y) = (cosines(most, u), cosines(most, v));
        self.log_amplitudes.iter().zip(&x).map(|(row, x)| x * row.iter().zip(&y).map(|(a, y)| a * y).sum::<f64>()).sum()
    }

    /// Adds to one amplitude.
    pub fn add(&mut self, [i, j]: [usize; 2], amplitude: f64) {
        if self.log_amplitudes.len() <= i {
            self.log_amplitudes.resize(i + 1, Vec::new());
        }
        let row = &mut self.log_amplitudes[i];
        if row.len() <= j {
            row.resize(j + 1, 0.0);
        }
        row[j] += amplitude;
    }
}

/// `cos(m pi u)` for all `m` up to `most`, by its recurrence.
pub(crate) fn cosines(most: usize, u: f64) -> Vec<f64> {
    let first = (PI * u).cos();
    let mut all = Vec::with_capacity(most + 2);
    all.extend([1.0, first]);
    for m in 2..=most {
        all.push(2.0 * first * all[m - 1] - all[m - 2]);
    }
    all
}
