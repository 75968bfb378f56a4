//! What a table says of places: fields of discs, fields between them, and forces.

use crate::circuit::TURNED;
use crate::head::Head;
use crate::spline::{interval, weights};
use crate::table::{LEAST_SHARE, MAX_ELECTRODES, OTHERS, QUANTITIES, RADII, Table};

/// All quantities of a disc.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    /// Values: fields of the electrodes (ohm), the disc's own (ohm), its share.
    pub value: [f32; QUANTITIES],
    /// Derivatives by x and y (1/m).
    pub slope: [[f32; QUANTITIES]; 2],
    /// Values of the wide disc less those of the small one.
    pub wider: [f32; QUANTITIES],
    /// Derivatives of the slopes: second derivatives by x twice, by x and y, by y twice (1/m2); then the derivatives of `wider` by x and y (1/m).
    pub turning: [[f32; QUANTITIES]; TURNED],
}

impl Sample {
    pub const NONE: Self = Self {
        value: [0.0; QUANTITIES],
        slope: [[0.0; QUANTITIES]; 2],
        wider: [0.0; QUANTITIES],
        turning: [[0.0; QUANTITIES]; TURNED],
    };
}

impl<'a> Table<'a> {
    /// All codes of a coefficient.
    fn coefficient(&self, i: usize, j: usize) -> &'a [[u8; 2]] {
        let count = RADII * (self.electrodes + OTHERS);
        let start = 2 * (j * self.sides[0] + i) * count;
        self.coefficients.get(start..start + 2 * count).map_or(&[], |bytes| bytes.as_chunks().0)
    }

    /// All quantities of a disc at a place (m), so far from the small to the wide one, with their derivatives.
    pub(crate) fn sample(&self, [x_m, y_m]: [f32; 2], wide: f32, sample: &mut Sample) {
        let count = self.electrodes + OTHERS;
        let ([i, j], [x, y]) = self.cell(x_m, y_m);
        let (along_x, along_y) = (weights(x), weights(y));
        let per_m = [1.0 / self.head.step_x_m, 1.0 / self.head.step_y_m];
        *sample = Sample::NONE;
        for row in 0..4 {
            for column in 0..4 {
                let value = along_x.value[column] * along_y.value[row];
                let slope_x = along_x.slope[column] * along_y.value[row] * per_m[0];
                let slope_y = along_x.value[column] * along_y.slope[row] * per_m[1];
                let bend = [
                    along_x.bend[column] * along_y.value[row] * per_m[0] * per_m[0],
                    along_x.slope[column] * along_y.slope[row] * per_m[0] * per_m[1],
                    along_x.value[column] * along_y.bend[row] * per_m[1] * per_m[1],
                ];
                let codes = self.coefficient(i + column, j + row);
                let (small, large) = codes.split_at(count.min(codes.len()));
                for (index, (small, large)) in small.iter().zip(large).enumerate() {
                    let [small, large] = [self.decoded(index, *small), self.decoded(count + index, *large)];
                    let code = small + wide * (large - small);
                    sample.value[index] += value * code;
                    sample.slope[0][index] += slope_x * code;
                    sample.slope[1][index] += slope_y * code;
                    let (bends, widened) = sample.turning.split_at_mut(bend.len());
                    for (sum, bend) in bends.iter_mut().zip(bend) {
                        sum[index] += bend * code;
                    }
                    sample.wider[index] += value * (large - small);
                    for (sum, slope) in widened.iter_mut().zip([slope_x, slope_y]) {
                        sum[index] += slope * (large - small);
                    }
                }
            }
        }
    }

    /// The value that a code of a quantity stands for.
    fn decoded(&self, quantity: usize, code: [u8; 2]) -> f32 {
        self.codes.at(2 * quantity) + self.codes.at(2 * quantity + 1) * f32::from(i16::from_le_bytes(code))
    }

    /// Fields of the electrodes at the middle of a cell, roughly, as means of the coefficients about it; returns the own field of a disc of the usual radius there.
    pub(crate) fn rough(&self, i: usize, j: usize, fields_ohm: &mut [f32; MAX_ELECTRODES]) -> f32 {
        let corners = [(1, 1), (2, 1), (1, 2), (2, 2)].map(|(x, y)| self.coefficient(i + x, j + y));
        let mean = |quantity: usize| {
            let codes = corners.iter().filter_map(|codes| codes.get(quantity));
            let sum: i32 = codes.map(|code| i32::from(i16::from_le_bytes(*code))).sum();
            self.codes.at(2 * quantity) + 0.25 * self.codes.at(2 * quantity + 1) * sum as f32
        };
        (0..self.electrodes).for_each(|e| fields_ohm[e] = mean(e));
        mean(self.electrodes) + self.head.even_ohm(self.head.radius_m)
    }

    /// Force under a contact (N), of its place and of its conductance as readings tell it, with the current that crowds under it (S); `None` where no law of
    /// force is known.
    pub fn force_n(&self, at_m: [f32; 2], apparent_conductance_s: f32) -> Option<f32> {
        self.head.has_law().then(|| self.head.force_n(self.constricted_conductance_s(at_m, apparent_conductance_s)))
    }

    /// What a law of force is of (S): the conductance as readings tell it less what of its resistance depends on the place.
    pub fn constricted_conductance_s(&self, at_m: [f32; 2], apparent_conductance_s: f32) -> f32 {
        let head = self.head();
        let [own_ohm, share] = self.own(at_m);
        let ohm = 1.0 / (share.clamp(LEAST_SHARE, 1.0) * apparent_conductance_s);
        // Less than nothing is left of a contact that is wide and firm.
        1.0 / (ohm - own_ohm - head.even_ohm(head.radius_m) + head.constriction_ohm).max(f32::MIN_POSITIVE)
    }

    /// The own field of a disc of the usual radius at a place (ohm) but for that on a deep layer, and the share of it that is on the detector.
    fn own(&self, [x_m, y_m]: [f32; 2]) -> [f32; 2] {
        let ([i, j], [x, y]) = self.cell(x_m, y_m);
        let (along_x, along_y) = (weights(x).value, weights(y).value);
        let [small_m2, wide_m2] = self.head.radii_m.map(|radius_m| radius_m * radius_m);
        let wide = (self.head.radius_m * self.head.radius_m - small_m2) / (wide_m2 - small_m2);
        let mut own = [0.0; OTHERS];
        for (row, column) in (0..4).flat_map(|row| (0..4).map(move |column| (row, column))) {
            let codes = self.coefficient(i + column, j + row);
            for (other, own) in own.iter_mut().enumerate() {
                let of = |quantity: usize| codes.get(quantity).map_or(0.0, |code| self.decoded(quantity, *code));
                let quantity = self.electrodes + other;
                let [small, large] = [of(quantity), of(quantity + self.electrodes + OTHERS)];
                *own += along_x[column] * along_y[row] * (small + wide * (large - small));
            }
        }
        own
    }

    /// The middle of a cell (m).
    pub(crate) fn middle_m(&self, i: usize, j: usize) -> [f32; 2] {
        let Head { left_m, bottom_m, step_x_m, step_y_m, .. } = self.head;
        [left_m + (i as f32 + 0.5) * step_x_m, bottom_m + (j as f32 + 0.5) * step_y_m]
    }

    /// The part of the field between places that goes by their distance (m): its value (ohm), and its derivative by that (ohm/m).
    pub(crate) fn by_distance_ohm(&self, distance_m: f32) -> (f32, f32) {
        let Head { near_m, ln_step, .. } = self.head;
        // Nearer than that there is no second contact.
        let distance_m = distance_m.max(near_m);
        let (first, t) = interval(libm::logf(distance_m / near_m) / ln_step, self.distances.0.len() - 3);
        let weights = weights(t);
        let sum = |weights: &[f32; 4]| (0..4).map(|k| weights[k] * self.distances.at(first + k)).sum::<f32>();
        (sum(&weights.value), sum(&weights.slope) / (ln_step * distance_m))
    }

    /// `Q b` of the fields at a place.
    pub(crate) fn by_walls(&self, fields_ohm: &[f32], products: &mut [f32; MAX_ELECTRODES + 1]) {
        let n = self.electrodes;
        for (row, product) in products.iter_mut().enumerate().take(n + 1) {
            let sum: f32 = fields_ohm.iter().take(n).enumerate().map(|(s, u)| self.walls.of_pair(row, s) * u).sum();
            *product = sum + self.walls.of_pair(row, n);
        }
    }
}
