//! Normal equations of contacts, summed up row by row of a frame, and steps by them.

use crate::circuit::Circuit;
use crate::detector::Detector;
use crate::frame::{Errors, Frame, Says, left_v};
use crate::held::{Held, Projected};
use crate::posterior::{Factor, Posterior};
use crate::products::dot;
use crate::real::Real;
use crate::slopes::RowSlopes;
use crate::table::MAX_ELECTRODES;
use crate::vector::{Matrix, PARAMETERS, Vector};

/// Which parameter of a contact is that of its resistance.
pub(crate) const STRENGTH: usize = 2;
/// Standard deviation of the logarithm of a radius before anything is read: a factor of two.
pub(crate) const ANY_RADIUS: f32 = 0.7;
/// The same while the number of contacts is not known yet: too few would be made as wide as may be, and lead away from those that are missing.
pub(crate) const USUAL_RADIUS: f32 = 0.15;

/// Sum of squares of what contacts leave of a frame, with its derivatives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Normal<T, const K: usize> {
    /// How many parameters.
    pub count: usize,
    /// `J' W J`: lower triangle.
    pub matrix: Matrix<T, K>,
    /// `J' W r`.
    pub pull: Vector<T, K>,
    /// `r' W r`.
    pub cost: T,
    /// The same of what was known of radii before.
    pub known: T,
    /// Diagonal of `J' W J` for each contact's strength by the readings that can speak for one: of a bound from above that it comes up to none does.
    pub said: [T; K],
    /// What contacts would leave in the linear theory if the detector were as its table says, where that was asked.
    pub if_known: T,
}

impl<T: Real, const K: usize> Normal<T, K> {
    pub const EMPTY: Self = Self {
        count: 0,
        matrix: Matrix::ZERO,
        pull: Vector::ZERO,
        cost: T::ZERO,
        known: T::ZERO,
        said: [T::ZERO; K],
        if_known: T::ZERO,
    };

    /// What contacts leave of a frame.
    ///
    /// An error of a grounded pad's own impedance changes its row by `p`, so that the row's covariance is `v I + p p'`, whose inverse is
    /// `(I - p p' / (v + p'p)) / v` (Sherman and Morrison, 1950).
    pub fn sum_up(
        &mut self,
        detector: &Detector<'_, T>,
        circuit: &mut Circuit<T, K>,
        frame: &Frame<'_, T>,
        errors: &Errors<T>,
        radius_deviation: T,
    ) {
        *self = Self { count: PARAMETERS * circuit.count, ..Self::EMPTY };
        circuit.derive(detector.table);
        let (table, head, n) = (detector.table, detector.table.head(), detector.table.electrodes());
        let (mut volts, mut slopes) = ([T::ZERO; MAX_ELECTRODES], [[[T::ZERO; MAX_ELECTRODES]; PARAMETERS]; K]);
        for g in 0..n {
            circuit.row_v(detector, g, &mut volts);
            let (mut by_pad, mut left_by_pad, mut pad) = (Vector::<T, K>::ZERO, T::ZERO, T::ZERO);
            RowSlopes::new(circuit, g, T::of(head.drive_v), T::of(head.radius_m)).of_readings(
                circuit,
                head,
                &volts[..n],
                &mut slopes,
            );
            for e in 0..n {
                let Some(left_v) = left_v(frame, g * n + e, T::of(head.full_v), volts[e]) else { continue };
                let slope: Vector<T, K> = Vector(slopes.each_ref().map(|of_one| of_one.each_ref().map(|row| row[e])));
                if frame.says_at(g * n + e) != Says::AtMost {
                    self.hear(&slope);
                }
                let by_pad_v = errors.pad_v(table, frame, g, e);
                self.cost += left_v * left_v;
                left_by_pad += left_v * by_pad_v;
                pad += by_pad_v * by_pad_v;
                for i in 0..self.count {
                    self.pull[i] += slope[i] * left_v;
                    by_pad[i] += slope[i] * by_pad_v;
                    for j in 0..=i {
                        self.matrix[i][j] += slope[i] * slope[j];
                    }
                }
            }
            let less = T::ONE / (errors.variance_v2 + pad);
            self.cost -= less * left_by_pad * left_by_pad;
            for i in 0..self.count {
                self.pull[i] -= less * by_pad[i] * left_by_pad;
                for j in 0..=i {
                    self.matrix[i][j] -= less * by_pad[i] * by_pad[j];
                }
            }
        }
        self.weigh(T::ONE / errors.variance_v2);
        self.add_known(circuit, radius_deviation);
    }

    /// The same, of contacts that were read, with what is not known of the detector, of which patterns are held, in the covariance.
    pub fn sum_up_held<const D: usize>(
        &mut self,
        detector: &Detector<'_, T>,
        circuit: &mut Circuit<T, K>,
        frame: &Frame<'_, T>,
        noise_v: T,
        radius_deviation: T,
        held: &mut Held<'_, T, D>,
    ) {
        *self = Self::noted(detector, circuit, frame, noise_v, held);
        held.leave(frame, T::of(detector.table.head().full_v), noise_v);
        held.project(self.count);
        self.cost = dot(held.left(), held.left());
        held.products(self.count, |i, j, product| self.matrix[i][j] = product, |i, product| self.pull[i] = product);
        let projected = held.projected();
        self.leave_out(&projected);
        self.leave_out_squares(&projected);
        self.add_known(circuit, radius_deviation);
    }

    /// None yet, of contacts that were read, whose derivatives are noted in what is held.
    pub fn noted<const D: usize>(
        detector: &Detector<'_, T>,
        circuit: &mut Circuit<T, K>,
        frame: &Frame<'_, T>,
        noise_v: T,
        held: &mut Held<'_, T, D>,
    ) -> Self {
        let mut all = Self { count: PARAMETERS * circuit.count, ..Self::EMPTY };
        circuit.derive(detector.table);
        let (head, n) = (detector.table.head(), detector.table.electrodes());
        let mut slopes = [[[T::ZERO; MAX_ELECTRODES]; PARAMETERS]; K];
        for g in 0..n {
            let there_v = &held.there_v()[g * n..(g + 1) * n];
            RowSlopes::new(circuit, g, T::of(head.drive_v), T::of(head.radius_m)).of_readings(
                circuit,
                head,
                there_v,
                &mut slopes,
            );
            // What readings that say nothing would change, and what is left of them, is none.
            let mut scales = [T::ZERO; MAX_ELECTRODES];
            detector.gains(there_v, &mut scales[..n]);
            for (e, scale) in scales.iter_mut().enumerate().take(n) {
                let left = left_v(frame, g * n + e, T::of(head.full_v), held.read_v()[g * n + e]);
                *scale = left.map_or(T::ZERO, |_| *scale / noise_v);
            }
            for (i, row) in slopes.as_flattened_mut().iter_mut().enumerate().take(all.count) {
                row.iter_mut().zip(&scales).for_each(|(slope, scale)| *slope *= *scale);
                held.note(g, i, &row[..n]);
                if i % PARAMETERS == STRENGTH {
                    let speaks = |e: &usize| frame.says_at(g * n + *e) != Says::AtMost;
                    all.said[i / PARAMETERS] += (0..n).filter(speaks).map(|e| row[e] * row[e]).sum::<T>();
                }
            }
        }
        all
    }

    /// The same of what is left now, by the derivatives and patterns that are kept: those of contacts nearby.
    pub fn sum_up_left<const D: usize>(
        &mut self,
        circuit: &Circuit<T, K>,
        radius_deviation: T,
        held: &mut Held<'_, T, D>,
    ) {
        held.project_left();
        self.cost = dot(held.left(), held.left());
        held.products_with_left(self.count, |i, product| self.pull[i] = product);
        self.leave_out(&held.projected());
        self.add_known_pull(circuit, radius_deviation);
    }

    /// Takes what a reading says of strengths, of which it has these derivatives.
    fn hear(&mut self, slope: &Vector<T, K>) {
        let by_strength = slope.0.iter().map(|of_one| of_one[STRENGTH]).take(self.count / PARAMETERS);
        self.said.iter_mut().zip(by_strength).for_each(|(said, slope)| *said += slope * slope);
    }

    /// Takes what steps of the detector could do as well from the sums with what is left.
    pub fn leave_out(&mut self, projected: &Projected<'_, T>) {
        self.cost += projected.less();
        let Projected { left, columns, solved, .. } = projected;
        let count = left.len();
        for i in 0..self.count {
            let column = &columns[i * count..(i + 1) * count];
            self.pull[i] -= dot(column, left) - dot(column, solved);
        }
    }

    /// The same from those of the derivatives.
    pub fn leave_out_squares(&mut self, Projected { left, columns, .. }: &Projected<'_, T>) {
        let count = left.len();
        let column = |i: usize| &columns[i * count..(i + 1) * count];
        for i in 0..self.count {
            (0..=i).for_each(|j| self.matrix[i][j] -= dot(column(i), column(j)));
        }
    }

    /// Notes the least sum of squares in the linear theory if the detector were as its table says.
    pub fn find_if_known(&mut self, Projected { left, columns, scaled, solved }: &Projected<'_, T>) {
        let mut all = *self;
        let count = left.len();
        let column = |i: usize| &columns[i * count..(i + 1) * count];
        // Without steps of the detector, `p' p` being `U' U - I`.
        all.cost += dot(left, left) + dot(solved, solved) + dot(scaled, scaled)
            - T::of(2.0) * (dot(solved, scaled) + dot(left, solved) - dot(left, scaled));
        for i in 0..self.count {
            let column_i = column(i);
            all.pull[i] += dot(column_i, left) - dot(column_i, solved) + dot(column_i, scaled);
            (0..=i).for_each(|j| all.matrix[i][j] += dot(column_i, column(j)));
        }
        let explained = Factor::of(&all, T::of(1e-6)).map_or(T::ZERO, |factor| factor.square(all.pull));
        self.if_known = all.cost - explained;
    }

    fn weigh(&mut self, weight: T) {
        self.cost *= weight;
        self.said.iter_mut().for_each(|said| *said *= weight);
        for i in 0..self.count {
            self.pull[i] *= weight;
            (0..=i).for_each(|j| self.matrix[i][j] *= weight);
        }
    }

    fn add_known(&mut self, circuit: &Circuit<T, K>, radius_deviation: T) {
        let weight = T::ONE / (radius_deviation * radius_deviation);
        (0..circuit.count).map(|k| PARAMETERS * k + 3).for_each(|i| self.matrix[i][i] += weight);
        self.add_known_pull(circuit, radius_deviation);
    }

    fn add_known_pull(&mut self, circuit: &Circuit<T, K>, radius_deviation: T) {
        let weight = T::ONE / (radius_deviation * radius_deviation);
        self.known = T::ZERO;
        for (k, one) in circuit.loaded.iter().enumerate().take(circuit.count) {
            let (i, ln_radius) = (PARAMETERS * k + 3, one.spot.ln_radius);
            self.pull[i] -= weight * ln_radius;
            self.known += weight * ln_radius * ln_radius;
        }
    }

    /// Weighs what was known of radii anew: from one standard deviation of their logarithms to another.
    pub fn weigh_radii(&mut self, circuit: &Circuit<T, K>, [from, to]: [T; 2]) {
        let [from, to] = [from, to].map(|deviation| T::ONE / (deviation * deviation));
        self.known *= to / from;
        for (k, one) in circuit.loaded.iter().enumerate().take(circuit.count) {
            let i = PARAMETERS * k + 3;
            self.matrix[i][i] += to - from;
            self.pull[i] -= (to - from) * one.spot.ln_radius;
        }
    }

    /// What is to become least.
    pub fn objective(&self) -> T {
        self.cost + self.known
    }

    /// The step to the least sum of squares, damped, and by how much that falls in the linear theory; `None` where nothing is determined.
    pub fn step(&self, damping: T) -> Option<(Vector<T, K>, T)> {
        let factor = Factor::of(self, damping)?;
        let mut step = self.pull;
        factor.solve(&mut step);
        let gain = (0..self.count).map(|i| step[i] * self.pull[i]).sum();
        Some((step, gain))
    }

    /// Keeps the parameters of which something is known, a weight each, which are so far from that; the others stay where they are.
    pub fn keep(&mut self, known: &Vector<T, K>, ways: &Vector<T, K>) {
        for i in 0..self.count {
            if known[i] > T::ZERO {
                self.matrix[i][i] += known[i];
                self.pull[i] -= known[i] * ways[i];
            } else {
                self.hold(i);
                self.matrix[i][i] = T::ONE;
            }
        }
    }

    /// Holds a parameter where it is.
    pub fn hold(&mut self, parameter: usize) {
        self.pull[parameter] = T::ZERO;
        for i in (0..self.count).filter(|i| *i != parameter) {
            self.matrix[parameter.max(i)][parameter.min(i)] = T::ZERO;
        }
    }

    /// By how much less the readings say for a contact's strength than they would on a detector that is known, at most.
    pub fn less_said(&self) -> T {
        let of_one = |k: usize| self.said[k] / self.matrix[PARAMETERS * k + STRENGTH][PARAMETERS * k + STRENGTH];
        (0..self.count / PARAMETERS).map(of_one).fold(T::ONE, T::max)
    }

    /// What the readings say, with a prior of these weights; `None` where parameters are not determined.
    pub fn posterior(&self, weights: &Vector<T, K>) -> Option<Posterior<T, K>> {
        Posterior::of(self, weights)
    }
}
