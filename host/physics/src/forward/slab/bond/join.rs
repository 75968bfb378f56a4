//! From two stacks of layers, their pads and the dots between them to the fields on the top: see [`super`].

use nalgebra::{DMatrix, DVector};

use super::Dots;
use super::glue::Joint;
use super::transform::means;
use crate::algebra::Cholesky;
use crate::forward::slab::Resolution;
use crate::forward::slab::disc::DiscBasis;
use crate::forward::slab::driving::{Covered, Mode};
use crate::forward::slab::pads::{Eliminated, Pad, PadFields, across, pad_modes, smallest_m, uniform};
use crate::forward::slab::spline::Grid;
use crate::forward::slab::uneven::Uneven;
use crate::forward::uneven_place::UnevenPlace;

/// Correction that is left out, as a share of the largest one of a mode.
const NEGLIGIBLE: f64 = 1e-5;

/// Two stacks of layers, bottom first where there are two of a thing.
#[derive(Clone, Copy)]
pub(in crate::forward::slab) struct Stacks<'a> {
    pub dots: &'a Dots,
    pub covered: [Covered<'a>; 2],
    pub uneven: [Option<&'a Uneven>; 2],
    pub pads: &'a [Pad],
    /// Of the pads.
    pub basis: &'a DiscBasis,
    pub resolution: Resolution,
}

/// All that is eliminated, by Cholesky's factor of its impedances: first what has no field on the top (what bends the current on pads and on the
/// dots' lower faces), then what has (on the dots' upper faces, and of the driving layer).
pub(super) struct Joined {
    pub grid: Grid,
    pub modes: Vec<Mode>,
    /// How many have none.
    pub hidden: usize,
    pub factor: Cholesky,
    /// `w / sqrt(k)`, and `1 / sqrt(k)`, of the current through all dots.
    pub through: DVector<f64>,
    pub root_ohm: f64,
    /// `P X` of those that have fields, a row for each mode on the top, and `P Y`, a row for each pad.
    pub top: DMatrix<f64>,
    pub pads: DMatrix<f64>,
    electrodes_ohm: DMatrix<f64>,
    /// Fields of the electrodes on the top but through the dots, by modes (ohm), and the constants of the gauge.
    direct_ohm: DMatrix<f64>,
    top_ohm: DVector<f64>,
    pads_ohm: DVector<f64>,
}

impl Stacks<'_> {
    /// Fields on the top, from the impedances between all densities of the pads (ohm); `None` if they are not positive definite.
    pub fn fields(&self, pads_ohm: &DMatrix<f64>) -> Option<PadFields> {
        let joined = self.join(pads_ohm)?;
        let eliminated = joined.eliminated();
        Some(PadFields::of(joined.grid, &joined.modes, eliminated, self.uneven[1]))
    }

    /// Joins them.
    pub(super) fn join(&self, pads_ohm: &DMatrix<f64>) -> Option<Joined> {
        let [_, covered] = self.covered;
        let (grid, modes) = across(&covered, smallest_m(self.pads).min(self.dots.radius_m()), self.resolution);
        let uniform = uniform(self.pads, self.basis);
        let fields = self.fields_on_top(&grid, &modes);
        let [all_ohm, fields] = covered.connect([self.impedances(pads_ohm), fields], &uniform, &grid, &modes);
        let is_pad: Vec<bool> = (0..all_ohm.nrows()).map(|i| uniform.contains(&i)).collect();
        let others: Vec<_> = (0..all_ohm.nrows()).filter(|i| !is_pad[*i]).collect();
        let hidden = self.first_seen() - uniform.len();

        let factor = Cholesky::new(all_ohm.select_rows(&others).select_columns(&others)).ok()?;
        let mut right = all_ohm.select_rows(&uniform).select_columns(&others).insert_row(uniform.len(), 0.0);
        (0..self.dots.len()).for_each(|dot| right[(uniform.len(), self.through(dot) - uniform.len())] = 1.0);
        factor.forward(0, &mut right);
        let unit = right.row(uniform.len()).transpose();
        let root_ohm = 1.0 / unit.norm();
        let through = unit * root_ohm;
        let mut pads = right.remove_row(uniform.len());
        let mut top = fields.select_columns(&others[hidden..]);
        factor.forward(hidden, &mut top);

        let (top_ohm, pads_ohm) = (take_off(&mut top, &through, hidden), take_off(&mut pads, &through, 0));
        Some(Joined {
            grid,
            modes,
            hidden,
            factor,
            through,
            root_ohm,
            top,
            pads,
            electrodes_ohm: all_ohm.select_rows(&uniform).select_columns(&uniform),
            direct_ohm: fields.select_columns(&uniform),
            top_ohm: top_ohm * root_ohm,
            pads_ohm: pads_ohm * root_ohm,
        })
    }

    /// Impedances between all densities (ohm): of the pads, of what bends the current on the dots' lower faces, and of their upper faces with
    /// the current through each dot first.
    fn impedances(&self, pads_ohm: &DMatrix<f64>) -> DMatrix<f64> {
        let size = self.dots.basis.len();
        let [on_lower, on_upper] = self.places();
        let lower = self.dots.lower.uneven_ohm(on_lower.as_deref());
        let upper = self.dots.upper.uneven_ohm(on_upper.as_deref());
        let to_dots = self.pads_to_dots(on_lower.as_deref());
        let count = self.first_seen() + self.dots.len() * size;
        let mut all = DMatrix::zeros(count, count);
        all.view_mut((0, 0), pads_ohm.shape()).copy_from(pads_ohm);
        let first_seen = self.first_seen();
        all.view_mut((first_seen, first_seen), upper.shape()).copy_from(&upper);
        for column in 0..lower.ncols() {
            let to = self.on_lower_face(column);
            for pad in 0..pads_ohm.nrows() {
                all[(pad, to)] = to_dots[(pad, column)];
                all[(to, pad)] = to_dots[(pad, column)];
            }
            (0..lower.nrows()).for_each(|row| all[(self.on_lower_face(row), to)] += lower[(row, column)]);
        }
        let mut joint: Option<(f64, Joint)> = None;
        for dot in 0..self.dots.len() {
            let even = on_upper.as_ref().map_or(1.0, |places| places[dot].inverse_root.powi(2));
            let alike = joint.take_if(|(of, _)| *of == even);
            let (_, own) = &*joint.insert(alike.unwrap_or_else(|| (even, self.dots.joint(even))));
            let at = self.unknowns(dot);
            for (i, to) in at.iter().enumerate() {
                at.iter().enumerate().for_each(|(j, from)| all[(*to, *from)] += own.impedance_ohm[(i, j)]);
            }
        }
        all
    }

    /// Impedances between densities of the pads and those on the dots' lower faces (ohm).
    fn pads_to_dots(&self, places: Option<&[UnevenPlace]>) -> DMatrix<f64> {
        let [covered, _] = self.covered;
        let (grid, modes) = across(&covered, smallest_m(self.pads).min(self.dots.radius_m()), self.resolution);
        let fields = pad_modes(self.pads, self.basis, |_| self.basis.weights().clone(), &grid, &modes, self.uneven[0]);
        let mut all = fields.tr_mul(&means(self.dots.basis, &self.dots.centres_m, self.dots.radius_m(), &grid, &modes));
        scale_dots(&mut all, places);
        all
    }

    /// Fields on the top by modes of all densities, `modes x densities`: a current through a dot leaves the upper stack.
    fn fields_on_top(&self, grid: &Grid, modes: &[Mode]) -> DMatrix<f64> {
        let dots = self.dots;
        let mut seen = means(dots.basis, &dots.centres_m, dots.radius_m(), grid, modes);
        for mut column in seen.column_iter_mut() {
            column.iter_mut().zip(modes).for_each(|(value, mode)| *value *= -mode.amplitude);
        }
        if let Some(uneven) = self.uneven[1] {
            for (dot, centre_m) in dots.centres_m.iter().enumerate() {
                let corrections: std::collections::HashMap<_, _> = uneven.across_ohm(*centre_m).into_iter().collect();
                let mut uniform = seen.column_mut(dot * dots.basis.len());
                for (value, mode) in uniform.iter_mut().zip(modes) {
                    *value -= corrections.get(&[mode.m, mode.n]).copied().unwrap_or(0.0);
                }
            }
        }
        let [_, on_upper] = self.places();
        scale_dots(&mut seen, on_upper.as_deref());
        let mut all = DMatrix::zeros(modes.len(), self.first_seen() + seen.ncols());
        all.view_mut((0, self.first_seen()), seen.shape()).copy_from(&seen);
        all
    }

    /// The dots' lower and upper faces where the layers are uneven.
    fn places(&self) -> [Option<Vec<UnevenPlace>>; 2] {
        let all = |of: &dyn Fn(&[f64; 2]) -> UnevenPlace| self.dots.centres_m.iter().map(of).collect();
        [
            self.uneven[0].map(|uneven| all(&|at_m| uneven.place(*at_m))),
            self.uneven[1].map(|uneven| all(&|at_m| uneven.place_below(*at_m))),
        ]
    }

    /// Number of densities that have no field on the top, with the pads' uniform ones.
    fn first_seen(&self) -> usize {
        self.pads.len() * self.basis.len() + self.dots.len() * (self.dots.basis.len() - 1)
    }

    /// The current through a dot, among all densities.
    fn through(&self, dot: usize) -> usize {
        self.first_seen() + dot * self.dots.basis.len()
    }

    /// A density on the lower faces, among all.
    fn on_lower_face(&self, density: usize) -> usize {
        let size = self.dots.basis.len();
        match (density / size, density % size) {
            (dot, 0) => self.through(dot),
            (dot, other) => self.pads.len() * self.basis.len() + dot * (size - 1) + other - 1,
        }
    }

    /// A dot's unknowns among all densities, in the order of [`super::glue::kept`].
    pub(super) fn unknowns(&self, dot: usize) -> Vec<usize> {
        let size = self.dots.basis.len();
        let upper = (0..size).map(|density| self.through(dot) + density);
        upper.chain((1..size).map(|density| self.on_lower_face(dot * size + density))).collect()
    }
}

impl Joined {
    /// What is left of pads and dots.
    fn eliminated(&self) -> Eliminated {
        let seen = self.pads.columns(self.hidden, self.top.ncols());
        let mut electrodes = &self.direct_ohm - &self.top * seen.transpose();
        electrodes.column_iter_mut().for_each(|mut column| column -= &self.top_ohm);
        let constant = self.root_ohm * self.root_ohm;
        let mut electrodes_ohm = &self.electrodes_ohm - &self.pads * self.pads.transpose();
        for (f, mut column) in electrodes_ohm.column_iter_mut().enumerate() {
            column.iter_mut().zip(&self.pads_ohm).for_each(|(ohm, e)| *ohm += constant - e - self.pads_ohm[f]);
        }
        Eliminated { electrodes_ohm, electrodes, correction: compressed(&self.top.transpose()).transpose() }
    }
}

/// Scales what belongs to dots, a few columns for each, where the layers are uneven.
fn scale_dots(columns: &mut DMatrix<f64>, places: Option<&[UnevenPlace]>) {
    let Some(places) = places else { return };
    let size = columns.ncols() / places.len();
    for (column, mut values) in columns.column_iter_mut().enumerate() {
        values *= places[column / size].inverse_root;
    }
}

/// Takes the share of `through` off rows that begin with its entry `first`; returns what it was of each.
fn take_off(rows: &mut DMatrix<f64>, through: &DVector<f64>, first: usize) -> DVector<f64> {
    let along = through.rows(first, rows.ncols());
    let shares = &*rows * along;
    rows.ger(-1.0, &shares, &along, 1.0);
    shares
}

/// As few rows as give nearly the same products of columns, by Cholesky's factorisation with pivots: what is left out of `A^T A` is positive
/// semidefinite, so that fields less these products stay positive.
fn compressed(rows: &DMatrix<f64>) -> DMatrix<f64> {
    let (count, columns) = rows.shape();
    let mut left: Vec<f64> = rows.column_iter().map(|column| column.norm_squared()).collect();
    let largest = left.iter().fold(0.0, |a: f64, b| a.max(*b));
    let end = NEGLIGIBLE * largest;
    // Columns whose products with any other are less than that are left out whole.
    let kept: Vec<_> = (0..columns).filter(|column| left[*column] > NEGLIGIBLE * end).collect();
    let rows = &rows.select_columns(&kept);
    left = kept.iter().map(|column| left[*column]).collect();
    // A factor row after row, one for each pivot, stored by columns of the transpose.
    let mut factor = DMatrix::zeros(kept.len(), count);
    let mut rank = 0;
    while rank < count {
        let pivot = (0..kept.len()).max_by(|a, b| left[*a].total_cmp(&left[*b])).unwrap_or(0);
        if left[pivot] <= end {
            break;
        }
        let mut row = rows.tr_mul(&rows.column(pivot));
        let before: DVector<f64> = factor.view((pivot, 0), (1, rank)).row(0).transpose();
        row.gemv(-1.0, &factor.columns(0, rank), &before, 1.0);
        row /= left[pivot].sqrt();
        left.iter_mut().zip(&row).for_each(|(left, value)| *left -= value * value);
        factor.set_column(rank, &row);
        rank += 1;
    }
    let mut few = DMatrix::zeros(rank, columns);
    kept.iter()
        .enumerate()
        .for_each(|(i, column)| few.column_mut(*column).tr_copy_from(&factor.view((i, 0), (1, rank))));
    few
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compressed_rows_have_the_same_products() {
        let all = DMatrix::from_fn(30, 50, |i, j| (0.3f64).powi(i as i32) * ((i * 7 + j * 3) as f64).sin());
        let few = compressed(&all);
        assert!(few.nrows() < 12, "{}", few.nrows());
        let products = all.tr_mul(&all);
        let off = &products - few.tr_mul(&few);
        assert!(off.amax() < 2.0 * NEGLIGIBLE * products.amax(), "{}", off.amax() / products.amax());
        assert!(off.symmetric_eigenvalues().min() > -1e-12 * products.amax());
    }
}
