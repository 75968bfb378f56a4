//! Derivatives of readings by the parameters of contacts.

use crate::circuit::Circuit;
use crate::head::Head;
use crate::lanes::at_once;
use crate::loaded::{Loaded, PerElectrode, TURNED};
use crate::real::Real;
use crate::table::MAX_ELECTRODES;
use crate::vector::{PARAMETERS, Vector};

/// What the derivatives by a contact's parameters need of an electrode: numbers that are linear in the electrodes, so that a sum over these will do too.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pattern<T> {
    current: T,
    /// Changes of the field at the contact for a step of its place along x and along y, in usual radii, and of its radius' logarithm (ohm).
    along: [T; 3],
    driving: [T; 2],
    bending: [T; 2],
    turned: [T; TURNED],
}

impl<T: Real> Pattern<T> {
    pub const NONE: Self = Self {
        current: T::ZERO,
        along: [T::ZERO; 3],
        driving: [T::ZERO; 2],
        bending: [T::ZERO; 2],
        turned: [T::ZERO; TURNED],
    };

    /// Of a contact, summed over electrodes by `sum`.
    #[inline(always)]
    pub fn of(one: &Loaded<T>, unit_m: T, sum: impl Fn(&[T]) -> T) -> Self {
        let [x, y] = one.slopes_ohm_per_m.each_ref().map(|slopes| unit_m * sum(slopes));
        Self {
            current: sum(&one.currents),
            along: [x, y, sum(&one.by_radius_ohm)],
            driving: one.driving_ohm_per_m.each_ref().map(|driving| sum(driving)),
            bending: one.bending_ohm_per_m2.each_ref().map(|bending| sum(bending)),
            turned: one.sample.turning.each_ref().map(|turning| sum(turning)),
        }
    }

    /// Adds so much of another.
    pub fn add(&mut self, share: T, other: &Self) {
        self.current += share * other.current;
        self.along.iter_mut().zip(other.along).for_each(|(sum, along)| *sum += share * along);
        self.driving.iter_mut().zip(other.driving).for_each(|(sum, driving)| *sum += share * driving);
        self.bending.iter_mut().zip(other.bending).for_each(|(sum, bending)| *sum += share * bending);
        self.turned.iter_mut().zip(other.turned).for_each(|(sum, turned)| *sum += share * turned);
    }

    /// Derivatives of the impedance between two electrodes by the parameters (ohm): linear in each of both.
    #[inline(always)]
    pub fn changes_ohm(&self, other: &Self, one: &Loaded<T>) -> [T; PARAMETERS] {
        let both = |a: T, of_a: T, b: T, of_b: T| a * of_b + b * of_a;
        let moved = |p: usize| both(self.along[p], self.current, other.along[p], other.current);
        let turned = |t: usize, d: usize| both(self.turned[t], self.driving[d], other.turned[t], other.driving[d]);
        let twice = |a: [T; 2], b: [T; 2]| T::of(2.0) * (a[0] * b[0] + a[1] * b[1]);
        let (driven, bent) = (twice(self.driving, other.driving), twice(self.bending, other.bending));
        let fields = [
            moved(0) + turned(0, 0) + turned(1, 1),
            moved(1) + turned(1, 0) + turned(2, 1),
            -one.ohm * self.current * other.current,
            moved(2) + turned(3, 0) + turned(4, 1),
        ];
        core::array::from_fn(|p| -one.half_moment_by[p] * driven - one.half_quadrupole_by[p] * bent - fields[p])
    }
}

/// What the derivatives of a row's readings have in common.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowSlopes<T, const K: usize> {
    /// Volts by ohm.
    pub per_ohm: T,
    /// Of each contact at the grounded electrode.
    pub own: [Pattern<T>; K],
    /// Change of the load by each parameter (ohm).
    pub own_ohm: Vector<T, K>,
}

impl<T: Real, const K: usize> RowSlopes<T, K> {
    pub const NONE: Self = Self { per_ohm: T::ZERO, own: [Pattern::NONE; K], own_ohm: Vector::ZERO };

    /// Of the row of a grounded electrode; places are in `unit_m`.
    pub fn new(circuit: &Circuit<T, K>, g: usize, drive_v: T, unit_m: T) -> Self {
        let mut all = Self { per_ohm: -drive_v / circuit.loads_ohm[g], ..Self::NONE };
        for (k, one) in circuit.loaded.iter().enumerate().take(circuit.count) {
            all.own[k] = Pattern::of(one, unit_m, |values| values[g]);
            let changes_ohm = all.own[k].changes_ohm(&all.own[k], one);
            all.own_ohm.0[k] = changes_ohm;
        }
        all
    }

    /// Derivatives of the row's readings, which are so many volts there, by all parameters (V).
    pub fn of_readings(&self, circuit: &Circuit<T, K>, head: &Head, there_v: &[T], slopes: &mut Slopes<T, K>) {
        at_once(
            #[inline(always)]
            || {
                for (k, slopes) in slopes.iter_mut().enumerate().take(circuit.count) {
                    self.of_contact(&circuit.loaded[k], k, head, there_v, slopes);
                }
            },
        );
    }

    #[inline(always)]
    fn of_contact(
        &self,
        one: &Loaded<T>,
        k: usize,
        head: &Head,
        there_v: &[T],
        slopes: &mut [PerElectrode<T>; PARAMETERS],
    ) {
        let (unit_m, per_v) = (T::of(head.radius_m), T::ONE / T::of(head.drive_v));
        let (own, own_ohm) = (&self.own[k], &self.own_ohm.0[k]);
        for (e, there_v) in there_v.iter().enumerate().take(MAX_ELECTRODES) {
            let of_load = T::ONE - per_v * *there_v;
            let changes_ohm = Pattern::of(one, unit_m, |values| values[e]).changes_ohm(own, one);
            for p in 0..PARAMETERS {
                slopes[p][e] = self.per_ohm * (changes_ohm[p] - of_load * own_ohm[p]);
            }
        }
    }
}

/// Derivatives of a row's readings: of each contact by each parameter.
pub(crate) type Slopes<T, const K: usize> = [[PerElectrode<T>; PARAMETERS]; K];
