//! What is not known of a detector, compiled as its table is: how all that the table says changes with it.
//!
//! A detector differs from its description in independent directions, each of which has a standard deviation of one: its thickness, how uneven it is, where an electrode
//! is, what a channel reads. Fields change nearly linearly with all of them where readings do not: what is not linear is the circuit, and that is solved exactly. So a
//! direction is a table of changes of fields, for a disc of the usual radius, on the same grid; one whose square counts has a second table. What belongs to a board or to
//! a pad alone needs no fields.

use core::ops::Range;

use crate::fields::{Sample, Stencil};
use crate::lanes::at_once;
use crate::products::add;
use crate::real::Real;
use crate::table::{MAX_ELECTRODES, Table};

/// A change that needs no fields, for a step of one deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// Of the logarithm of what a channel reads over what is there.
    Gain(usize, f32),
    /// Of what a channel reads besides what is there (V).
    Offset(usize, f32),
    /// Of the logarithm of a pad's own impedance.
    Pad(usize, f32),
    /// Of the logarithm of an electrode's field at itself, which is most of a pad's impedance: of how its current crowds there.
    Crowding(usize, f32),
    /// Of the logarithm of the switch's resistance.
    Switch(f32),
    /// Of the height of a channel's bow (V): a parabola between the ends of its converter's range.
    Bow(usize, f32),
}

impl Change {
    /// Whether it is of what is there, rather than of what channels make of it.
    pub(crate) fn is_there(&self) -> bool {
        matches!(self, Self::Pad(..) | Self::Crowding(..) | Self::Switch(_))
    }
}

/// A direction in which a detector may differ.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Direction {
    /// Number of the table of changes for a step of one deviation.
    pub table: Option<usize>,
    /// Number of the table of second derivatives.
    pub square: Option<usize>,
    /// What it changes besides: numbers of changes.
    pub changes: Range<usize>,
    /// The electrode at which alone anything differs, if there is one: its field, and those between it and others, and what is its own. No square is of such.
    pub electrode: Option<usize>,
}

/// All that is not known of a detector of `n` electrodes, whose table has `nx` by `ny` coefficients over places and `k` over distances, in so many tables of changes.
#[derive(Clone, Copy, Debug)]
pub struct Unknown<'a> {
    /// The directions.
    pub directions: &'a [Direction],
    /// Changes that need no fields, of all directions.
    pub changes: &'a [Change],
    /// How many tables there are.
    pub tables: usize,
    /// Electrodes of the last tables, of each of which it is the field of one electrode alone that changes.
    pub electrodes: &'a [usize],
    /// Coefficients of changes of the fields of the electrodes, and of the disc's own (ohm): rows of `y`, in them of `x`, for each tables of `n + 1`, and of those of one electrode of one.
    pub fields_ohm: &'a [f32],
    /// Changes of the fields between the electrodes (ohm): tables of lower triangles. On the diagonal, the field of an electrode at itself, they are those of its logarithm
    /// times what it is: its current crowds at the pad, where what a direction makes of the layer is a factor.
    pub pads_ohm: &'a [f32],
    /// Changes of the spline over distances (ohm): tables of `k`.
    pub distances_ohm: &'a [f32],
    /// Changes of `Q`: tables of lower triangles of `n + 1`. They are of what the fields of the electrodes are by the table that is changed: what fields change is among them.
    pub walls: &'a [f32],
    /// Ends of the range of each channel's converter (V).
    pub ranges_v: &'a [[f32; 2]],
    /// What is each pad's own of the impedance while it is grounded (ohm).
    pub own_pads_ohm: &'a [f32],
}

/// Sums up so much of each table's numbers at a coefficient.
#[inline(always)]
fn blend(shares: &[f32], node: &[f32], sums: &mut [f32]) {
    for (share, of_table) in shares.iter().zip(node.chunks_exact(sums.len())) {
        add(sums, *share, of_table);
    }
}

/// How many elements a lower triangle has.
pub(crate) const fn pairs(side: usize) -> usize {
    side * (side + 1) / 2
}

/// An element of a symmetric matrix of which the lower triangle is there.
pub(crate) fn of_pair<T: Copy>(triangle: &[T], a: usize, b: usize) -> T {
    let (high, low) = if a < b { (b, a) } else { (a, b) };
    triangle[pairs(high) + low]
}

impl Unknown<'_> {
    /// What a direction changes besides fields.
    pub(crate) fn changes_of(&self, direction: &Direction) -> &[Change] {
        self.changes.get(direction.changes.clone()).unwrap_or(&[])
    }

    /// How many tables change more than the field of an electrode.
    fn common_tables(&self) -> usize {
        self.tables - self.electrodes.len()
    }

    /// The electrode whose field is all that a table changes, if it is one of those.
    pub(crate) fn electrode_of(&self, which: usize) -> Option<usize> {
        self.electrodes.get(which.checked_sub(self.common_tables())?).copied()
    }

    /// How many numbers all tables have at a coefficient, and so at a place.
    fn numbers_at(&self, electrodes: usize) -> usize {
        self.common_tables() * (electrodes + 1) + self.electrodes.len()
    }

    /// Changes of all tables at a coefficient.
    fn node(&self, node: usize, electrodes: usize) -> &[f32] {
        let count = self.numbers_at(electrodes);
        self.fields_ohm.get(node * count..(node + 1) * count).unwrap_or(&[])
    }

    /// Adds what shares of the tables change at a place.
    pub(crate) fn add<T: Real>(&self, table: &Table<'_>, shares: &[f32], at_m: [T; 2], sample: &mut Sample<T>) {
        at_once(
            #[inline(always)]
            || self.add_at(table, shares, &Stencil::of(table, at_m), sample),
        );
    }

    #[inline(always)]
    fn add_at<T: Real>(&self, table: &Table<'_>, shares: &[f32], stencil: &Stencil<T>, sample: &mut Sample<T>) {
        let count = table.electrodes() + 1;
        for (which, node) in stencil.nodes.into_iter().enumerate() {
            let mut change = [0.0f32; MAX_ELECTRODES + 1];
            let change = &mut change[..count];
            let (common, local) = self.node(node, table.electrodes()).split_at(self.common_tables() * count);
            blend(shares, common, change);
            let shares = &shares[self.common_tables()..];
            shares.iter().zip(local).zip(self.electrodes).for_each(|((share, ohm), e)| change[*e] += share * ohm);
            let [value, x, y, xx, xy, yy] = stencil.weights.each_ref().map(|weights| weights[which]);
            for (q, ohm) in change.iter().enumerate() {
                let ohm = T::of(*ohm);
                sample.value[q] += value * ohm;
                sample.slope[0][q] += x * ohm;
                sample.slope[1][q] += y * ohm;
                sample.turning[0][q] += xx * ohm;
                sample.turning[1][q] += xy * ohm;
                sample.turning[2][q] += yy * ohm;
            }
        }
    }

    /// How many numbers it takes what all tables change at a place.
    pub(crate) fn of_place(&self, electrodes: usize) -> usize {
        3 * self.numbers_at(electrodes)
    }

    /// What all tables change at a place: fields, and their derivatives along x and y.
    #[inline(always)]
    pub(crate) fn all_at<T: Real>(&self, electrodes: usize, stencil: &Stencil<T>, all: &mut [f32]) {
        let count = self.numbers_at(electrodes);
        all.fill(0.0);
        for (index, node) in stencil.nodes.into_iter().enumerate() {
            let changes = self.node(node, electrodes);
            for (sums, weights) in all.chunks_exact_mut(count.max(1)).zip(&stencil.weights) {
                add(sums, weights[index].to_f32().unwrap_or(0.0), changes);
            }
        }
    }

    /// Those of the field of the electrode of a table that changes that alone.
    #[inline(always)]
    pub(crate) fn of_electrode<T: Real>(&self, electrodes: usize, which: usize, all: &[f32]) -> [T; 3] {
        let (count, place) = (self.numbers_at(electrodes), self.common_tables() * electrodes + which);
        core::array::from_fn(|part| T::of(all[part * count + place]))
    }

    /// Those of a table.
    #[inline(always)]
    pub(crate) fn of_table<T: Real>(&self, electrodes: usize, which: usize, all: &[f32], at: &mut Fields<T>) {
        let count = electrodes + 1;
        let parts = all.chunks_exact(self.numbers_at(electrodes));
        let mut parts = parts.map(|all| &all[which * count..(which + 1) * count]);
        let [value, x, y] = core::array::from_fn(|_| parts.next().unwrap_or(&[]));
        for (to, from) in [&mut at.value].into_iter().chain(&mut at.slope).zip([value, x, y]) {
            to.iter_mut().zip(from).take(electrodes).for_each(|(to, from)| *to = T::of(*from));
        }
        at.own_ohm = [value, x, y].map(|from| from.last().map_or(T::ZERO, |ohm| T::of(*ohm)));
    }
}

/// What a table changes at a place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fields<T> {
    /// Fields of the electrodes (ohm), and their derivatives by the place (ohm/m).
    pub value: [T; MAX_ELECTRODES],
    pub slope: [[T; MAX_ELECTRODES]; 2],
    /// The disc's own field (ohm), and its derivatives (ohm/m).
    pub own_ohm: [T; 3],
}

impl<T: Real> Fields<T> {
    pub const NONE: Self =
        Self { value: [T::ZERO; MAX_ELECTRODES], slope: [[T::ZERO; MAX_ELECTRODES]; 2], own_ohm: [T::ZERO; 3] };
}
