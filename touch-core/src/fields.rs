//! What a table says of places: fields of discs, fields between them, and forces.

use crate::head::Head;
use crate::lanes::at_once;
use crate::loaded::TURNED;
use crate::products::add;
use crate::real::Real;
use crate::spline::weights;
use crate::table::{LEAST_SHARE, MAX_ELECTRODES, OTHERS, QUANTITIES, RADII, Table};

/// Numbers that a processor takes at once.
const LANES: usize = if cfg!(feature = "wide") { 4 } else { 1 };

/// All quantities of a disc.
#[derive(Clone, Debug)]
pub(crate) struct Sample<T> {
    /// Values: fields of the electrodes (ohm), the disc's own (ohm), its share.
    pub value: [T; QUANTITIES],
    /// Derivatives by x and y (1/m).
    pub slope: [[T; QUANTITIES]; 2],
    /// Values of the wide disc less those of the small one.
    pub wider: [T; QUANTITIES],
    /// Derivatives of the slopes: second derivatives by x twice, by x and y, by y twice (1/m2); then the derivatives of `wider` by x and y (1/m).
    pub turning: [[T; QUANTITIES]; TURNED],
}

impl<T: Real> Sample<T> {
    pub const NONE: Self = Self {
        value: [T::ZERO; QUANTITIES],
        slope: [[T::ZERO; QUANTITIES]; 2],
        wider: [T::ZERO; QUANTITIES],
        turning: [[T::ZERO; QUANTITIES]; TURNED],
    };
}

/// Coefficients about a place, with their weights.
pub(crate) struct Stencil<T> {
    /// Number of the coefficient.
    pub nodes: [usize; 16],
    /// Weight in the value; in the derivatives by x and y (1/m); in the second ones by x twice, both, y twice (1/m2).
    pub weights: [[T; 16]; 6],
}

impl<T: Real> Stencil<T> {
    /// At a place (m).
    pub fn of(table: &Table<'_>, [x_m, y_m]: [T; 2]) -> Self {
        let ([i, j], [x, y]) = table.cell(x_m, y_m);
        let (along_x, along_y) = (weights(x), weights(y));
        let [per_x, per_y] = [table.head.step_x_m, table.head.step_y_m].map(|step_m| T::ONE / T::of(step_m));
        let mut stencil = Self { nodes: [0; 16], weights: [[T::ZERO; 16]; 6] };
        for node in 0..16 {
            let (row, column) = (node / 4, node % 4);
            stencil.nodes[node] = (j + row) * table.sides[0] + i + column;
            let all = [
                along_x.value[column] * along_y.value[row],
                along_x.slope[column] * along_y.value[row] * per_x,
                along_x.value[column] * along_y.slope[row] * per_y,
                along_x.bend[column] * along_y.value[row] * per_x * per_x,
                along_x.slope[column] * along_y.slope[row] * per_x * per_y,
                along_x.value[column] * along_y.bend[row] * per_y * per_y,
            ];
            stencil.weights.iter_mut().zip(all).for_each(|(weights, weight)| weights[node] = weight);
        }
        stencil
    }
}

impl<'a> Table<'a> {
    /// All codes of a coefficient.
    fn coefficient(&self, node: usize) -> &'a [[u8; 2]] {
        let count = RADII * (self.electrodes + OTHERS);
        let start = 2 * node * count;
        self.coefficients.get(start..start + 2 * count).map_or(&[], |bytes| bytes.as_chunks().0)
    }

    /// All quantities of a disc at a place (m), so far from the small to the wide one, with their derivatives; second ones as far as `bent` says.
    pub(crate) fn sample<T: Real>(&self, at_m: [T; 2], wide: T, bent: T, sample: &mut Sample<T>) {
        at_once(
            #[inline(always)]
            || {
                let stencil = Stencil::of(self, at_m);
                let mut sums = [[[T::ZERO; QUANTITIES]; 6]; RADII];
                sums.iter_mut().enumerate().for_each(|(which, sums)| self.of_radius(which, &stencil, sums));
                let [small, large] = &sums;
                let between = |share: T, w: usize, q: usize| small[w][q] + share * (large[w][q] - small[w][q]);
                for q in 0..self.electrodes + OTHERS {
                    let wider = |w: usize| large[w][q] - small[w][q];
                    (sample.value[q], sample.wider[q]) = (between(wide, 0, q), wider(0));
                    for d in 0..2 {
                        (sample.slope[d][q], sample.turning[3 + d][q]) = (between(wide, 1 + d, q), wider(1 + d));
                    }
                    (0..3).for_each(|which| sample.turning[which][q] = between(bent, 3 + which, q));
                }
            },
        );
    }

    /// All quantities of a disc of one of the radii at a place, by each kind of weight.
    #[inline(always)]
    fn of_radius<T: Real>(&self, which: usize, stencil: &Stencil<T>, sums: &mut [[T; QUANTITIES]; 6]) {
        let count = self.electrodes + OTHERS;
        // In whole lanes: what is behind the quantities is nothing.
        let whole = count.next_multiple_of(LANES).min(QUANTITIES);
        for (k, node) in stencil.nodes.into_iter().enumerate() {
            let codes = self.coefficient(node).get(which * count..(which + 1) * count).unwrap_or(&[]);
            let mut values = [T::ZERO; QUANTITIES];
            values.iter_mut().zip(codes).for_each(|(value, code)| *value = T::of(i16::from_le_bytes(*code)));
            for (sums, weights) in sums.iter_mut().zip(&stencil.weights) {
                add(&mut sums[..whole], weights[k], &values[..whole]);
            }
        }
        for q in 0..count {
            let [first, step] = self.scale(which * count + q);
            sums.iter_mut().for_each(|sums| sums[q] *= step);
            // Weights of the value sum up to one, those of derivatives to nothing.
            sums[0][q] += first;
        }
    }

    /// What the code nought of a quantity stands for, and a step of codes.
    fn scale<T: Real>(&self, quantity: usize) -> [T; 2] {
        [0, 1].map(|part| T::of(self.codes.at(2 * quantity + part)))
    }

    /// The value that a code of a quantity stands for.
    fn decoded<T: Real>(&self, quantity: usize, code: [u8; 2]) -> T {
        let [first, step]: [T; 2] = self.scale(quantity);
        first + step * T::of(i16::from_le_bytes(code))
    }

    /// Fields of the electrodes at the middle of a cell, roughly, as means of the coefficients about it; returns the own field of a disc of the usual radius there.
    pub(crate) fn rough<T: Real>(&self, i: usize, j: usize, fields_ohm: &mut [T; MAX_ELECTRODES]) -> T {
        let corners = [(1, 1), (2, 1), (1, 2), (2, 2)].map(|(x, y)| self.coefficient((j + y) * self.sides[0] + i + x));
        let mean = |quantity: usize| {
            let codes = corners.iter().filter_map(|codes| codes.get(quantity));
            let sum: i32 = codes.map(|code| i32::from(i16::from_le_bytes(*code))).sum();
            let [first, step]: [T; 2] = self.scale(quantity);
            first + T::of(0.25) * step * T::of(sum)
        };
        (0..self.electrodes).for_each(|e| fields_ohm[e] = mean(e));
        mean(self.electrodes) + self.head.even_ohm(T::of(self.head.radius_m))
    }

    /// Force under a contact (N), of its place and of its conductance as readings tell it, with the current that crowds under it (S); `None` where no law of
    /// force is known.
    pub fn force_n<T: Real>(&self, at_m: [T; 2], apparent_conductance_s: T) -> Option<T> {
        self.head.has_law().then(|| self.head.force_n(self.constricted_conductance_s(at_m, apparent_conductance_s)))
    }

    /// What a law of force is of (S): the conductance as readings tell it less what of its resistance depends on the place.
    pub fn constricted_conductance_s<T: Real>(&self, at_m: [T; 2], apparent_conductance_s: T) -> T {
        let head = self.head();
        let [own_ohm, share] = self.own(at_m);
        let ohm = T::ONE / (share.clamp(T::of(LEAST_SHARE), T::ONE) * apparent_conductance_s);
        // Less than nothing is left of a contact that is wide and firm.
        T::ONE
            / (ohm - own_ohm - head.even_ohm(T::of(head.radius_m)) + T::of(head.constriction_ohm))
                .max(T::min_positive_value())
    }

    /// The own field of a disc of the usual radius at a place (ohm) but for that on a deep layer, and the share of it that is on the detector.
    fn own<T: Real>(&self, [x_m, y_m]: [T; 2]) -> [T; 2] {
        let ([i, j], [x, y]) = self.cell(x_m, y_m);
        let (along_x, along_y) = (weights(x).value, weights(y).value);
        let [small_m2, wide_m2] = self.head.radii_m.map(|radius_m| T::of(radius_m) * T::of(radius_m));
        let wide = (T::of(self.head.radius_m) * T::of(self.head.radius_m) - small_m2) / (wide_m2 - small_m2);
        let mut own = [T::ZERO; OTHERS];
        for (row, column) in (0..4).flat_map(|row| (0..4).map(move |column| (row, column))) {
            let codes = self.coefficient((j + row) * self.sides[0] + i + column);
            for (other, own) in own.iter_mut().enumerate() {
                let of = |quantity: usize| codes.get(quantity).map_or(T::ZERO, |code| self.decoded(quantity, *code));
                let quantity = self.electrodes + other;
                let [small, large] = [of(quantity), of(quantity + self.electrodes + OTHERS)];
                *own += along_x[column] * along_y[row] * (small + wide * (large - small));
            }
        }
        own
    }

    /// The middle of a cell (m).
    pub(crate) fn middle_m<T: Real>(&self, i: usize, j: usize) -> [T; 2] {
        let Head { left_m, bottom_m, step_x_m, step_y_m, .. } = self.head;
        let middle = |first_m: f32, index: usize, step_m: f32| {
            T::of(first_m) + (T::of(index as u32) + T::of(0.5)) * T::of(step_m)
        };
        [middle(left_m, i, step_x_m), middle(bottom_m, j, step_y_m)]
    }

    /// Coefficients over distances.
    pub(crate) fn knots(&self) -> usize {
        self.distances.0.len()
    }

    /// A coefficient over distances (ohm).
    pub(crate) fn distance_ohm(&self, knot: usize) -> f32 {
        self.distances.at(knot)
    }

    /// Its fields between electrodes, the spline over distances, and `Q`, as numbers.
    pub(crate) fn parts<T: Real>(&self, parts: [&mut [T]; 3]) {
        for (part, floats) in parts.into_iter().zip([self.pads, self.distances, self.walls]) {
            part.iter_mut().enumerate().for_each(|(index, value)| *value = T::of(floats.at(index)));
        }
    }
}
