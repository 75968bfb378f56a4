//! Sums over frames that are explained together, of which each has something of its own.
//!
//! With a frame's patterns `p`, derivatives `J` by the contacts' parameters and residuals `r`, in noise, the normal matrix of the detector's steps and of what frames have in
//! common grows by `X' X` with `X = [p J]`, and what pulls by `X' r`, both without what the frame's own parameters, the columns `O` of `J` with weights `W` of what is known of
//! these, could do as well (Schur complement): with `A = O' O + W` by `X' X - X' O A^-1 O' X` and by `X' r - X' O A^-1 (O' r - W w)`, where `w` is how far they are from that.

use super::{Held, multiplied, split};
use crate::lanes::at_once;
use crate::normal::Normal;
use crate::posterior::Factor;
use crate::products::{add, backward, dot, factorise, forward};
use crate::real::Real;
use crate::vector::{Matrix, Vector};

/// Those of the detector; those of contacts are a [`Normal`].
#[derive(Debug)]
pub(super) struct Sums<'m, T> {
    /// The normal matrix of the detector's steps: a lower triangle in whole rows.
    pub of_detector: &'m mut [T],
    /// That with the contacts' parameters, a row each, and what pulls the detector.
    pub with_contacts: &'m mut [T],
    pub pull: &'m mut [T],
    /// Room for what a frame's own parameters have to do with the detector, a row each.
    pub rows: &'m mut [T],
}

/// A frame's own parameters: `L^-1` of what others have to do with them, where `L L' = A`.
struct Own<T, const K: usize> {
    factor: Factor<T, K>,
    known: Vector<T, K>,
    count: usize,
    pull: Vector<T, K>,
    /// A row for each parameter.
    with_contacts: Matrix<T, K>,
}

impl<T: Real, const K: usize> Own<T, K> {
    /// Of a frame; `None` where they are not determined.
    fn of(of_frame: &Normal<T, K>, known: &Vector<T, K>, ways: &Vector<T, K>) -> Option<Self> {
        let mut own = *of_frame;
        own.keep(known, ways);
        let factor = Factor::of(&own, T::ZERO)?;
        let mut pull = own.pull;
        factor.forward(&mut pull);
        let mut all = Self { factor, known: *known, count: own.count, pull, with_contacts: Matrix::ZERO };
        for j in 0..own.count {
            all.with_contacts[j] = all.solved(|i| of_frame.matrix[i.max(j)][i.min(j)]);
        }
        Some(all)
    }

    /// Which parameters they are.
    fn each(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.count).filter(|i| self.known[*i] > T::ZERO)
    }

    /// `L^-1` of what something has to do with each of them.
    fn solved(&self, with: impl Fn(usize) -> T) -> Vector<T, K> {
        let mut row = Vector::ZERO;
        self.each().for_each(|i| row[i] = with(i));
        self.factor.forward(&mut row);
        row
    }

    /// Adds the frame without them to sums over contacts.
    fn add_to(&self, sum: &mut Normal<T, K>, of_frame: &Normal<T, K>) {
        let product = |a: &Vector<T, K>, b: &Vector<T, K>| self.each().map(|k| a[k] * b[k]).sum::<T>();
        for i in 0..self.count {
            let with = &self.with_contacts[i];
            sum.pull[i] += of_frame.pull[i] - product(with, &self.pull);
            for j in 0..=i {
                sum.matrix[i][j] += of_frame.matrix[i][j] - product(with, &self.with_contacts[j]);
            }
        }
    }
}

impl<T: Real, const D: usize> Held<'_, T, D> {
    /// Begins sums over frames with what is known of a detector after such steps.
    pub fn begin_sums(&mut self, steps: &[T]) {
        let Sums { of_detector, with_contacts, pull, .. } = &mut self.sums;
        of_detector.fill(T::ZERO);
        of_detector.iter_mut().step_by(self.sorted.count + 1).for_each(|own| *own = T::ONE);
        with_contacts.fill(T::ZERO);
        pull.iter_mut().zip(steps).for_each(|(pull, step)| *pull = -*step);
    }

    /// Adds the frame that was looked at last, whose patterns are held and whose derivatives are noted, without its own parameters: those of which something is known, a weight
    /// each, and from which they are so far. Gives the logarithm of the determinant of the information about these; `None` where they are not determined.
    pub fn add_to_sums<const K: usize>(
        &mut self,
        sum: &mut Normal<T, K>,
        known: &Vector<T, K>,
        ways: &Vector<T, K>,
    ) -> Option<T> {
        let of_frame = self.normal_of_frame(sum.count);
        let own = Own::of(&of_frame, known, ways)?;
        own.add_to(sum, &of_frame);
        at_once(
            #[inline(always)]
            || self.add_detector(&own),
        );
        Some(own.factor.ln_determinant())
    }

    /// The normal equations of the contacts alone, and products of the patterns with the derivatives and with what is left.
    fn normal_of_frame<const K: usize>(&mut self, parameters: usize) -> Normal<T, K> {
        let mut of_frame = Normal::<T, K> { count: parameters, ..Normal::EMPTY };
        let Normal { matrix, pull, .. } = &mut of_frame;
        self.products(parameters, |i, j, product| matrix[i][j] = product, |i, product| pull[i] = product);
        let (readings, count) = (self.left.len(), self.sorted.count.max(1));
        let Self { sorted, patterns, slopes, columns, left, products, turned, .. } = self;
        let (common, mut locals) = split(patterns, turned, sorted, readings);
        multiplied(sorted, common, &mut locals, left, products);
        for (slopes, column) in slopes.chunks_exact(readings).zip(columns.chunks_exact_mut(count)).take(parameters) {
            multiplied(sorted, common, &mut locals, slopes, column);
        }
        of_frame
    }

    #[inline(always)]
    fn add_detector<const K: usize>(&mut self, own: &Own<T, K>) {
        let count = self.sorted.count;
        let Self { columns, products, factor, squares, sums, .. } = self;
        let at = |i: usize| i * count..(i + 1) * count;
        for d in 0..count {
            let with = own.solved(|i| columns[i * count + d]);
            own.each().for_each(|i| sums.rows[i * count + d] = with[i]);
        }
        for d in 0..count {
            let to = &mut sums.of_detector[at(d)][..=d];
            add(to, T::ONE, &factor[at(d)][..d]);
            to[d] += squares[d];
            for row in own.each().map(|k| &sums.rows[at(k)]) {
                add(to, -row[d], &row[..=d]);
            }
        }
        add(sums.pull, T::ONE, products);
        own.each().for_each(|k| add(sums.pull, -own.pull[k], &sums.rows[at(k)]));
        for i in 0..own.count {
            let to = &mut sums.with_contacts[at(i)];
            add(to, T::ONE, &columns[at(i)]);
            own.each().for_each(|k| add(to, -own.with_contacts[i][k], &sums.rows[at(k)]));
        }
    }

    /// Takes what steps of the detector could do as well from sums over contacts. Each costs its square so many times besides what it costs by what is known; `None` if it makes no
    /// sense.
    pub fn end_sums<const K: usize>(&mut self, sum: &mut Normal<T, K>, besides: T) -> Option<()> {
        let count = self.sorted.count;
        let Self { factor, columns, products, solved, scaled, sums, .. } = self;
        let factor = &mut factor[..count * count];
        for i in 0..count {
            (i..count).for_each(|j| factor[i * count + j] = sums.of_detector[j * count + i]);
            factor[i * count + i] += besides;
        }
        at_once(
            #[inline(always)]
            || {
                factorise(factor, count)?;
                products.copy_from_slice(sums.pull);
                forward(factor, count, products);
                columns.copy_from_slice(sums.with_contacts);
                let all = columns.chunks_exact_mut(count.max(1)).take(sum.count);
                all.for_each(|column| forward(factor, count, column));
                Some(())
            },
        )?;
        // What is known of steps is among what pulls.
        solved.fill(T::ZERO);
        scaled.fill(T::ZERO);
        let projected = self.projected();
        sum.leave_out(&projected);
        sum.leave_out_squares(&projected);
        Some(())
    }

    /// Takes the detector the step that goes with one of the contacts, after the sums have ended. Gives by how much the sum of squares falls by that, in the linear theory, besides
    /// what it falls by the contacts' own.
    pub fn step_by_sums<const K: usize>(&mut self, step: &Vector<T, K>, parameters: usize, steps: &mut [T]) -> T {
        let count = self.sorted.count;
        let Self { factor, columns, products, taken, .. } = self;
        taken.copy_from_slice(products);
        for (i, column) in columns.chunks_exact(count.max(1)).enumerate().take(parameters) {
            add(taken, -step[i], column);
        }
        backward(factor, count, taken);
        steps.iter_mut().zip(taken.iter()).for_each(|(to, step)| *to += *step);
        dot(products, products)
    }
}
