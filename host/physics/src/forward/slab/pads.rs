//! The bare slab seen through its pads: equipotential, floating, with contact impedance.
//!
//! The current densities of all pads, in the densities of [`super::disc`], obey `A q + f = V`: `A` the impedances between
//! them, `f` the field of the contacts, `V` the pads' potentials. A pad is equipotential, so `V` only has the uniform
//! densities; and those carry the electrodes' known currents. Eliminating all others leaves the electrodes' fields, and a
//! correction of low rank to the kernel of the top, for the pads shorten the way of the contacts' current:
//! `N(x, x') -> N(x, x') - w(x) . w(x')`.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix};

use super::disc::{Density, DiscBasis, DiscSelf};
use super::driving::{Covered, Mode};
use super::green::SurfaceGreen;
use super::near::{NearFields, longest_split, near_at_zero};
use super::spline::{Grid, signs};
use super::uneven::Uneven;
use super::{Resolution, from_corner};
use crate::detector::{Detector, cosines};

/// Table steps in the half wave of the finest mode that crosses the slab: it still fits.
const STEPS_IN_WAVE: f64 = 1.03;

/// The same in the half wave of the finest mode of a split's smooth part, which falls more slowly before.
const STEPS_IN_SMOOTH_WAVE: f64 = 1.9;

/// Radial orders above the degree of a pad's basis that the smooth part has: of higher ones its factor leaves next to nothing.
const SMOOTH_ORDERS: usize = 2;

/// Fields are split where that makes the steps longer by this factor.
const WORTH: f64 = 1.4;

/// A pad, from the corner (m).
#[derive(Clone, Copy, Debug)]
pub(super) struct Pad {
    pub centre_m: [f64; 2],
    pub radius_m: f64,
    pub contact_impedance_ohm_m2: f64,
}

impl Pad {
    /// Of its contact (ohm).
    pub fn resistance_ohm(&self) -> f64 {
        self.contact_impedance_ohm_m2 / (PI * self.radius_m * self.radius_m)
    }

    /// Whether another one differs in its place alone.
    pub fn is_like(&self, other: &Self) -> bool {
        let kind = |pad: &Self| (pad.radius_m, pad.contact_impedance_ohm_m2);
        kind(self) == kind(other)
    }

    fn is_placed_as(&self, other: &Self) -> bool {
        self.centre_m == other.centre_m && self.radius_m == other.radius_m
    }
}

/// Impedances between the points of all pads (ohm), of an even slab: what is most of the work, and mostly the same for a slab that is nearly
/// the same.
#[derive(Clone, Debug)]
pub(super) struct PadPoints {
    pads: Vec<Pad>,
    /// Of each pad with those before it and itself.
    blocks: Vec<Arc<DMatrix<f64>>>,
}

impl PadPoints {
    /// Those of a detector, with what there is of pads in the same places on a slab with the same kernel.
    pub fn new(
        detector: &Detector,
        size_m: [f64; 2],
        basis: &DiscBasis,
        kernel: &SurfaceGreen,
        like: Option<&Self>,
    ) -> Self {
        let pads = detector.electrodes.iter().map(|pad| Pad {
            centre_m: from_corner(size_m, [pad.x_m, pad.y_m]),
            radius_m: pad.radius_m,
            contact_impedance_ohm_m2: detector.pad_impedance_ohm_m2(pad),
        });
        let pads: Vec<_> = pads.collect();
        let nodes: Vec<_> = pads.iter().map(|pad| basis.nodes_m(pad.centre_m, pad.radius_m)).collect();
        let like = like.filter(|like| like.pads.len() == pads.len());
        let is_like = |e: usize| like.is_some_and(|like| pads[e].is_placed_as(&like.pads[e]));
        let block = |(e, f): (usize, usize)| match like {
            Some(like) if is_like(e) && is_like(f) => Arc::clone(&like.blocks[pair(e, f)]),
            _ => {
                let gap_m = pads[e].radius_m + pads[f].radius_m;
                let images = kernel.images(pads[e].centre_m, pads[f].centre_m, gap_m);
                between_points(&nodes[e], &nodes[f], kernel, &images, e == f).into()
            }
        };
        let pairs = (0..pads.len()).flat_map(|e| (0..=e).map(move |f| (e, f)));
        let blocks = pairs.map(block).collect();
        Self { pads, blocks }
    }

    /// The pads.
    pub fn pads(&self) -> &[Pad] {
        &self.pads
    }

    /// Impedances between all densities of all pads (ohm), pad by pad.
    pub fn impedances(&self, basis: &DiscBasis, kernel: &SurfaceGreen, uneven: Option<&Uneven>) -> DMatrix<f64> {
        let size = basis.len();
        let under = |pad: &Pad| Some(uneven?.under_pad(&basis.nodes_m(pad.centre_m, pad.radius_m)));
        let places: Vec<_> = self.pads.iter().map(under).collect();
        let mut all = DMatrix::zeros(self.pads.len() * size, self.pads.len() * size);
        let mut own: Option<(f64, DiscSelf)> = None;
        for (e, pad) in self.pads.iter().enumerate() {
            for f in 0..=e {
                let mut points = (*self.blocks[pair(e, f)]).clone();
                if let (Some(here), Some(there)) = (&places[e], &places[f]) {
                    here.apply(there, &mut points);
                }
                let mut block = basis.weights() * points * basis.weights().transpose();
                if e == f {
                    let even = uneven.map_or(1.0, |uneven| uneven.inverse_root(pad.centre_m).powi(2));
                    let alike = own.take_if(|(radius_m, _)| *radius_m == pad.radius_m);
                    let local = alike.unwrap_or_else(|| (pad.radius_m, kernel.disc_self(pad.radius_m)));
                    block += local.1.reduced(basis, pad.resistance_ohm(), even);
                    own = Some(local);
                }
                all.view_mut((e * size, f * size), (size, size)).copy_from(&block);
                all.view_mut((f * size, e * size), (size, size)).tr_copy_from(&block);
            }
        }
        all
    }
}

/// Where the block of two pads is, the second no later than the first.
fn pair(e: usize, f: usize) -> usize {
    e * (e + 1) / 2 + f
}

/// Impedances between the densities of two discs (ohm), by their points; a disc's own singular part is left out.
pub(super) fn between(
    basis: &DiscBasis,
    nodes: &[[f64; 2]],
    other_basis: &DiscBasis,
    other_nodes: &[[f64; 2]],
    kernel: &SurfaceGreen,
    images: &[super::green::Image],
    same: bool,
) -> DMatrix<f64> {
    basis.weights() * between_points(nodes, other_nodes, kernel, images, same) * other_basis.weights().transpose()
}

/// The same between the points themselves.
fn between_points(
    nodes: &[[f64; 2]],
    other_nodes: &[[f64; 2]],
    kernel: &SurfaceGreen,
    images: &[super::green::Image],
    same: bool,
) -> DMatrix<f64> {
    let value = |a: [f64; 2], b: [f64; 2]| kernel.smooth_ohm(a, b) + kernel.images_ohm(images, same, a, b);
    let mut points = DMatrix::zeros(nodes.len(), other_nodes.len());
    for (j, &b) in other_nodes.iter().enumerate() {
        let first = if same { j } else { 0 };
        for (i, &a) in nodes.iter().enumerate().skip(first) {
            points[(i, j)] = value(a, b);
            if same {
                points[(j, i)] = points[(i, j)];
            }
        }
    }
    points
}

/// Fields of the pads on the top, as a table of all of them at once.
#[derive(Clone, Debug, Default)]
pub(super) struct PadFields {
    grid: Grid,
    electrodes: usize,
    columns: usize,
    /// Spline coefficients: all columns of a node together.
    table: Vec<f32>,
    /// What the table lacks near the pads, if there is anything.
    near: Option<NearFields>,
    /// The factor that unevenness has on all of them at a place.
    roots: Option<Vec<f32>>,
    /// Between the electrodes (ohm): `n x n`.
    pub electrodes_ohm: DMatrix<f64>,
}

impl PadFields {
    /// Eliminates the pads from `impedances`; `None` if they are not positive definite.
    pub fn new(
        pads: &[Pad],
        basis: &'static DiscBasis,
        impedances: DMatrix<f64>,
        kernel: &SurfaceGreen,
        covered: &Covered<'_>,
        uneven: Option<&Uneven>,
        resolution: Resolution,
    ) -> Option<Self> {
        let split_m = split_m(covered, pads, resolution);
        let (grid, modes) = match split_m {
            Some(split_m) => smooth_across(covered, split_m, resolution),
            None => across(covered, smallest_m(pads), resolution),
        };
        let uniform = uniform(pads, basis);
        let fields = match split_m {
            Some(_) => {
                let fine = DiscBasis::of_degree(basis.degree() + SMOOTH_ORDERS);
                // Most pads are alike: what a disc is to itself is an integral over the layers.
                let mut last: Option<(Pad, DMatrix<f64>)> = None;
                let densities = |pad: &Pad| {
                    let alike = last.take_if(|(of, _)| pad.is_like(of));
                    let of_kind = alike.unwrap_or_else(|| (*pad, with_higher(pad, basis, fine, kernel)));
                    last.insert(of_kind).1.clone()
                };
                pad_modes(pads, fine, densities, &grid, &modes, uneven)
            }
            None => pad_modes(pads, basis, |_| basis.weights().clone(), &grid, &modes, uneven),
        };
        let [impedances, fields] = covered.connect([impedances, fields], &uniform, &grid, &modes);
        let others: Vec<_> = (0..fields.ncols()).filter(|i| !uniform.contains(i)).collect();
        let inner = impedances.select_rows(&others).select_columns(&others);
        let lower = Cholesky::new(inner)?.unpack();
        let inverse = lower.solve_lower_triangular(&DMatrix::identity(others.len(), others.len()))?;
        let coupling = &inverse * impedances.select_rows(&others).select_columns(&uniform);
        let electrodes_ohm = impedances.select_rows(&uniform).select_columns(&uniform) - coupling.tr_mul(&coupling);

        let correction = fields.select_columns(&others) * inverse.transpose();
        let electrodes = fields.select_columns(&uniform) - &correction * &coupling;
        let mut all = Self::of(grid, &modes, Eliminated { electrodes_ohm, electrodes, correction }, uneven);
        all.near = split_m.map(|split_m| {
            let mut shares = DMatrix::zeros(all.columns, fields.ncols());
            let to_electrodes = -coupling.tr_mul(&inverse);
            for (i, density) in others.iter().enumerate() {
                shares.view_mut((0, *density), (uniform.len(), 1)).copy_from(&to_electrodes.column(i));
                shares.view_mut((uniform.len(), *density), (others.len(), 1)).copy_from(&inverse.column(i));
            }
            uniform.iter().enumerate().for_each(|(pad, density)| shares[(pad, *density)] = 1.0);
            if let Some(uneven) = uneven {
                for (density, mut column) in shares.column_iter_mut().enumerate() {
                    column *= uneven.inverse_root(pads[density / basis.len()].centre_m);
                }
            }
            let own = |radius_m| kernel.disc_self(radius_m);
            NearFields::new(pads, basis, covered, split_m, resolution.across as f64, own, &shares)
        });
        Some(all)
    }

    /// The table of fields that are given by modes.
    pub fn of(grid: Grid, modes: &[Mode], eliminated: Eliminated, uneven: Option<&Uneven>) -> Self {
        let Eliminated { electrodes_ohm, electrodes, correction } = eliminated;
        let (own, columns) = (electrodes.ncols(), electrodes.ncols() + correction.ncols());
        let mut amplitudes = DMatrix::zeros(columns, modes.len());
        amplitudes.rows_mut(0, own).tr_copy_from(&electrodes);
        amplitudes.rows_mut(own, correction.ncols()).tr_copy_from(&correction);
        let waves: Vec<_> = modes.iter().map(|mode| [mode.m, mode.n]).collect();
        let single = |values: Vec<f64>| values.into_iter().map(|value| value as f32).collect();
        let table = single(grid.synthesise(&waves, &amplitudes));
        let roots = uneven.map(|uneven| single(grid.through(|at_m| uneven.inverse_root(at_m))));
        Self { grid, electrodes: own, columns, table, near: None, roots, electrodes_ohm }
    }

    /// Number of electrodes.
    pub fn electrodes(&self) -> usize {
        self.electrodes
    }

    /// Number of fields: of the electrodes and of the correction.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Fields at a point of the top, from the corner (m): first the electrodes' (ohm), then the correction's (square root of
    /// ohm), `out.len()` of them.
    pub fn sample(&self, at_m: [f64; 2], out: &mut [f32]) {
        let ((x, x_weights), (y, y_weights)) = (self.grid.taps(0, at_m[0]), self.grid.taps(1, at_m[1]));
        let first = x * self.grid.nodes(1) + y;
        let taps = |tap: usize| {
            let (i, j) = (tap / 4, tap % 4);
            (first + i * self.grid.nodes(1) + j, (x_weights[i] * y_weights[j]) as f32)
        };
        let root =
            self.roots.as_ref().map_or(1.0, |roots| (0..16).map(taps).map(|(node, weight)| weight * roots[node]).sum());
        out.fill(0.0);
        for (node, weight) in (0..16).map(taps) {
            let values = &self.table[node * self.columns..][..out.len()];
            out.iter_mut().zip(values).for_each(|(sum, value)| *sum += root * weight * value);
        }
        if let Some(near) = &self.near {
            near.add(at_m, root, out);
        }
    }

    /// Means under the densities of a disc, of the electrodes' fields, `densities x electrodes`, and of the correction, `columns x
    /// densities`.
    pub fn under_disc(&self, basis: &DiscBasis, nodes: &[[f64; 2]]) -> [DMatrix<f64>; 2] {
        let mut sample = vec![0.0_f32; self.columns];
        let mut electrodes = DMatrix::zeros(nodes.len(), self.electrodes);
        let mut correction = DMatrix::zeros(self.columns - self.electrodes, nodes.len());
        for (row, (node, mut column)) in nodes.iter().zip(correction.column_iter_mut()).enumerate() {
            self.sample(*node, &mut sample);
            let (own, rest) = sample.split_at(self.electrodes);
            electrodes.row_mut(row).iter_mut().zip(own).for_each(|(to, from)| *to = f64::from(*from));
            column.iter_mut().zip(rest).for_each(|(to, from)| *to = f64::from(*from));
        }
        [basis.weights() * electrodes, correction * basis.weights().transpose()]
    }
}

/// What is left when densities are eliminated.
pub(super) struct Eliminated {
    /// Fields between the electrodes (ohm): `n x n`.
    pub electrodes_ohm: DMatrix<f64>,
    /// Those of the electrodes on the top, by modes (ohm): `modes x n`.
    pub electrodes: DMatrix<f64>,
    /// The correction by modes (square root of ohm): `modes x columns`.
    pub correction: DMatrix<f64>,
}

/// The uniform densities of the pads, among all of theirs.
pub(super) fn uniform(pads: &[Pad], basis: &DiscBasis) -> Vec<usize> {
    (0..pads.len()).map(|pad| pad * basis.len()).collect()
}

/// Radius of the smallest pad (m).
pub(super) fn smallest_m(pads: &[Pad]) -> f64 {
    pads.iter().map(|pad| pad.radius_m).fold(f64::INFINITY, f64::min)
}

/// Length at which fields of pads on the top are split (m); `None` where a table of all of them needs hardly finer steps, or is as fine for the
/// driving layer's sake.
fn split_m(covered: &Covered<'_>, pads: &[Pad], resolution: Resolution) -> Option<f64> {
    let smallest_m = smallest_m(pads);
    let pitch_m = (covered.size_m()[0] * covered.size_m()[1] / pads.len() as f64).sqrt();
    let least_m = (resolution.split_in_pad * smallest_m).max(resolution.split_in_pitch * pitch_m);
    let split_m = least_m.min(longest_split(resolution.across as f64) * smallest_m);
    let whole_m = PI * covered.thickness_m() / resolution.across as f64 / STEPS_IN_WAVE;
    let is_worth = PI / smooth_end(split_m, resolution) / STEPS_IN_SMOOTH_WAVE > WORTH * whole_m;
    (is_worth && covered.finest() == 0.0).then_some(split_m)
}

/// Wave number (1/m) at which the smooth part's factor has fallen as far as modes that cross the layers do where they end.
fn smooth_end(split_m: f64, resolution: Resolution) -> f64 {
    2.0 * (resolution.across as f64).sqrt() / split_m
}

/// The smooth part of the modes that cross the layers, and the grid of its table.
fn smooth_across(covered: &Covered<'_>, split_m: f64, resolution: Resolution) -> (Grid, Vec<Mode>) {
    let end = smooth_end(split_m, resolution);
    let grid = Grid::new(covered.size_m(), PI / end / STEPS_IN_SMOOTH_WAVE);
    let area_m2 = covered.size_m()[0] * covered.size_m()[1];
    let amplitude = |[m, n]: [usize; 2]| {
        let k = grid.wave_number(0, m).hypot(grid.wave_number(1, n));
        let value = match m + n {
            // The near part's own mean belongs to mode 0.
            0 => covered.floating().tb - near_at_zero(covered, split_m),
            _ => covered.response(k).tb * (-0.25 * (k * split_m).powi(2)).exp(),
        };
        Mode { m, n, amplitude: signs([m, n]) * value / area_m2 }
    };
    let modes = grid.modes_within(end).into_iter().map(amplitude).collect();
    (grid, modes)
}

/// The modes that cross the layers, and the grid of a table of fields on the top. Finer modes than some in the radius of the smallest pad or dot only
/// matter at its rim.
pub(super) fn across(covered: &Covered<'_>, smallest_m: f64, resolution: Resolution) -> (Grid, Vec<Mode>) {
    let end = resolution.across as f64 / covered.thickness_m();
    let step_m = (PI / end / STEPS_IN_WAVE).max(smallest_m / resolution.steps_in_pad as f64);
    let grid = Grid::new(covered.size_m(), step_m.min(PI / covered.finest()));
    let area_m2 = covered.size_m()[0] * covered.size_m()[1];
    let amplitude = |[m, n]: [usize; 2]| {
        let k = grid.wave_number(0, m).hypot(grid.wave_number(1, n));
        let value = if m + n == 0 { covered.floating().tb } else { covered.response(k).tb };
        Mode { m, n, amplitude: signs([m, n]) * value / area_m2 }
    };
    let modes = grid.modes_within(end.max(covered.finest())).into_iter().map(amplitude).collect();
    (grid, modes)
}

/// Densities of a pad with those that are eliminated and come with them, by the points of a finer basis: `densities x nodes`.
fn with_higher(pad: &Pad, basis: &DiscBasis, fine: &DiscBasis, kernel: &SurfaceGreen) -> DMatrix<f64> {
    let own = kernel.disc_self(pad.radius_m);
    let mut shares = DMatrix::zeros(basis.len(), fine.len());
    for (d, density) in basis.densities().iter().enumerate() {
        for (n, share) in own.with_higher([density.n, density.m], basis.degree(), pad.resistance_ohm()) {
            let same = fine.densities().iter().position(|other| *other == Density { n, ..*density });
            same.into_iter().for_each(|higher| shares[(d, higher)] = share);
        }
    }
    shares * fine.weights()
}

/// Amplitudes of the field on the top of each density of each pad: `modes x densities`; with unevenness but for the root of its factor at
/// the top. Densities of a pad are given by the points of a basis: `densities x nodes`.
pub(super) fn pad_modes(
    pads: &[Pad],
    basis: &DiscBasis,
    mut densities: impl FnMut(&Pad) -> DMatrix<f64>,
    grid: &Grid,
    modes: &[Mode],
    uneven: Option<&Uneven>,
) -> DMatrix<f64> {
    let rows: HashMap<_, _> = modes.iter().enumerate().map(|(row, mode)| ([mode.m, mode.n], row)).collect();
    let mut all = Vec::new();
    for pad in pads {
        let nodes = basis.nodes_m(pad.centre_m, pad.radius_m);
        let along = |axis: usize, at_m: &[f64; 2]| cosines(grid.modes(axis), at_m[axis] / grid.size_m()[axis]);
        let waves: Vec<_> = nodes.iter().map(|at_m| [along(0, at_m), along(1, at_m)]).collect();
        let mut at_nodes = DMatrix::from_fn(nodes.len(), modes.len(), |q, i| {
            modes[i].amplitude * waves[q][0][modes[i].m] * waves[q][1][modes[i].n]
        });
        if let Some(uneven) = uneven {
            for (node, mut at_node) in nodes.iter().zip(at_nodes.row_iter_mut()) {
                // Modes that do not cross the slab are not in the table, and their correction is nothing.
                for (mode, amplitude) in uneven.across_ohm(*node) {
                    rows.get(&mode).into_iter().for_each(|row| at_node[*row] += amplitude);
                }
                at_node *= uneven.inverse_root(*node);
            }
        }
        let of_densities = densities(pad) * at_nodes;
        all.extend(of_densities.row_iter().map(|row| row.transpose()));
    }
    DMatrix::from_columns(&all)
}
