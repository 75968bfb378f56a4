//! Where one more contact would explain most of what others leave of a frame, where something is not known of a detector or its board.
//!
//! As [`beside`](crate::beside), with what is not known of the detector in the covariance: the residual is whitened, and freed of what the detector's steps explain; the square
//! of what a contact at a place would change is less what steps and contacts could do as well. That is worked out for those places only that would explain most without it.

use core::f32::consts::FRAC_1_SQRT_2;

use crate::circuit::Circuit;
use crate::detector::Detector;
use crate::fit::{Working, held_ohm};
use crate::held::Held;
use crate::lanes::at_once;
use crate::loaded::{PerElectrode, Spot};
use crate::normal::Normal;
use crate::posterior::Factor;
use crate::products::{add, dot};
use crate::real::Real;
use crate::scan::{APART, Candidate, Candidates, places, take};
use crate::solver::Task;
use crate::table::MAX_ELECTRODES;
use crate::vector::Vector;

/// Places that are looked at closely.
const CLOSELY: usize = 32;
/// Share of a pattern that is taken for new at least. Of 180 random scenes on detectors as built, 240 with one or two contacts in corners of one that is known, and 300 random ones
/// on that, 64, 90 and 90 % are right with a tenth, 65, 90, 89 with this, and of the last two 87 and 88 with ten times as much.
const LEAST_NEW: f32 = 2e-3;
/// Axes that halves of a contact may be along (unit vectors), and how far from where it is they begin at most (usual radii).
const AXES: [[f32; 2]; 4] = [[1.0, 0.0], [0.0, 1.0], [FRAC_1_SQRT_2, FRAC_1_SQRT_2], [FRAC_1_SQRT_2, -FRAC_1_SQRT_2]];
const FARTHEST_HALF: f32 = 2.0;
/// Damping of the normal equations in what contacts that are there could do as well.
const DAMPING: f32 = 1e-3;

/// Where to look.
#[derive(Clone, Copy)]
struct Place<T> {
    cell: (usize, usize),
    /// What it would explain if nothing else could.
    gain: T,
}

/// What sums over changes by a siemens at a place have in common: with potentials `p`, of which `a` are apart from their mean, that is `c p_g (a_e - a_g + s_e p_g)`, with the
/// share `s` of the drive that is read.
struct Sums<T> {
    /// One over the drive (1/V), and of each row volts by ohm, in noise.
    per_v: T,
    per_ohm: PerElectrode<T>,
    /// Sums over a row of what is left, of that times the shares, of the shares and of their squares.
    left: PerElectrode<T>,
    left_share: PerElectrode<T>,
    share: PerElectrode<T>,
    share_square: PerElectrode<T>,
}

impl<T: Real> Sums<T> {
    const NONE: Self = Self {
        per_v: T::ZERO,
        per_ohm: [T::ZERO; MAX_ELECTRODES],
        left: [T::ZERO; MAX_ELECTRODES],
        left_share: [T::ZERO; MAX_ELECTRODES],
        share: [T::ZERO; MAX_ELECTRODES],
        share_square: [T::ZERO; MAX_ELECTRODES],
    };

    /// Scalar product of what is left with a place's change, and the square of that.
    #[inline(always)]
    fn along_and_square<const D: usize>(&self, held: &Held<'_, T, D>, potentials_ohm: &[T]) -> (T, T) {
        let count = T::of(potentials_ohm.len() as u32);
        // As differences, of which the large constant of a light contact takes no digits.
        let mean_ohm = potentials_ohm.iter().copied().sum::<T>() / count;
        let mut apart = [T::ZERO; MAX_ELECTRODES];
        apart.iter_mut().zip(potentials_ohm).for_each(|(apart, ohm)| *apart = *ohm - mean_ohm);
        let apart = &apart[..potentials_ohm.len()];
        let squares = dot(apart, apart);
        // Sums of rows, of what is left and of what is there, whose products with those differences are those of all rows.
        let (mut lefts, mut theres) = ([T::ZERO; MAX_ELECTRODES], [T::ZERO; MAX_ELECTRODES]);
        let (mut along, mut square) = (T::ZERO, T::ZERO);
        let rows = held.there_v().chunks_exact(apart.len()).zip(held.left().chunks_exact(apart.len()));
        for ((g, (there_v, left)), own) in rows.enumerate().zip(potentials_ohm) {
            let (per_ohm, down) = (self.per_ohm[g] * *own, apart[g]);
            let weight = per_ohm * per_ohm;
            add(&mut lefts, per_ohm, left);
            add(&mut theres, T::of(2.0) * self.per_v * weight * *own, there_v);
            along += per_ohm * (*own * self.left_share[g] - down * self.left[g]);
            let of_own = *own * (*own * self.share_square[g] - T::of(2.0) * down * self.share[g]);
            square += weight * (squares + count * down * down + of_own);
        }
        (along + dot(&lefts[..apart.len()], apart), square + dot(&theres[..apart.len()], apart))
    }
}

/// What is left by contacts on a detector whose patterns are held.
pub(crate) struct Births<'a, 'h, T, const K: usize, const D: usize> {
    pub task: Task<'a, T>,
    pub detector: &'a Detector<'a, T>,
    pub circuit: &'a Circuit<T, K>,
    pub normal: &'a Normal<T, K>,
    pub held: &'a mut Held<'h, T, D>,
    /// What is taken for noise (V), and how much more that is than noise is.
    pub noise_v: T,
    pub tau: T,
}

impl<T: Real, const K: usize, const D: usize> Births<'_, '_, T, K, D> {
    /// Takes the best places; none where the contacts are not determined.
    pub fn look(&mut self, best: &mut Candidates<T>, work: &mut Working<'_, K>) {
        let Some(factor) = Factor::of(self.normal, T::of(DAMPING)) else { return };
        self.held.whiten();
        let table = self.task.table;
        let n = table.electrodes();
        let mut change = [T::ZERO; MAX_ELECTRODES * MAX_ELECTRODES];
        let change = &mut change[..n * n];
        let sums = self.sums();
        let mut list = [Place { cell: (0, 0), gain: T::ZERO }; CLOSELY];
        at_once(
            #[inline(always)]
            || {
                for cell in places(table).filter(|cell| self.is_free(*cell)) {
                    work.looked();
                    let (_, potentials_ohm) = self.potentials_ohm(cell);
                    let (along, square) = sums.along_and_square(self.held, &potentials_ohm[..n]);
                    let gain = along * along / square;
                    if along > T::ZERO && gain > list[CLOSELY - 1].gain {
                        let at = list.partition_point(|better| better.gain >= gain);
                        list[at..].rotate_right(1);
                        list[at] = Place { cell, gain };
                    }
                }
            },
        );
        for Place { cell: (i, j), .. } in list.into_iter().filter(|place| place.gain > T::ZERO) {
            let own_ohm = self.change((i, j), change);
            let along = dot(change, self.held.left());
            let square = self.new_square(change, &factor);
            let ln_ohm = held_ohm((square / along).max(own_ohm).ln(), table);
            let spot = Spot { at_m: table.middle_m(i, j), ln_ohm, ln_radius: T::ZERO };
            let gain = self.tau * self.tau * along * along / square;
            take(best, Candidate { spot, gain, half_of: None }, T::of(APART) * T::of(table.head().radius_m));
        }
        // Where much is left, a contact is missing elsewhere.
        if self.tau == T::ONE {
            self.look_for_halves(best, change, &factor);
        }
    }

    /// Takes among the best the halves of a contact, on both sides of where it is, that would explain most of what is left, which is as little as noise.
    fn look_for_halves(&mut self, best: &mut Candidates<T>, change: &mut [T], factor: &Factor<T, K>) {
        let table = self.task.table;
        let radius_m = T::of(table.head().radius_m);
        for k in 0..self.circuit.count {
            let spot = self.circuit.loaded[k].spot;
            for [x, y] in AXES.map(|axis| axis.map(T::of)) {
                self.change_by_halves(k, [x, y], change);
                let along = dot(change, self.held.left());
                if along <= T::ZERO {
                    continue;
                }
                let square = self.new_square(change, factor);
                let way_m = (T::of(2.0) * along / square).sqrt().min(T::of(FARTHEST_HALF) * radius_m);
                let half = |way_m: T| Spot {
                    at_m: [spot.at_m[0] + way_m * x, spot.at_m[1] + way_m * y],
                    ln_ohm: held_ohm(spot.ln_ohm + T::of(core::f64::consts::LN_2), table),
                    ln_radius: spot.ln_radius.min(T::ZERO),
                };
                let [one, other] = [half(way_m), half(-way_m)];
                if [one, other].iter().all(|half| table.holds(half.at_m[0], half.at_m[1])) {
                    let gain = along * along / square;
                    take(best, Candidate { spot: one, gain, half_of: Some((k, other)) }, T::of(APART) * radius_m);
                }
            }
        }
    }

    /// What half the square of the way to each of two halves of a contact along an axis changes, in noise: the second derivative of the field along it takes the place of
    /// the field. What a contact's own field and couples make of it is another strength and width, or little.
    fn change_by_halves(&self, k: usize, [x, y]: [T; 2], change: &mut [T]) {
        let (table, n) = (self.task.table, self.task.table.electrodes());
        let drive_v = T::of(table.head().drive_v);
        let one = &self.circuit.loaded[k];
        let per_moment = T::ONE / (one.moment_s_m2 * T::of(table.head().radius_m));
        let bend = |e: usize| {
            let [xx, xy, yy] = [0, 1, 2].map(|which| per_moment * one.sample.turning[which][e]);
            x * x * xx + T::of(2.0) * x * y * xy + y * y * yy
        };
        let mut bends = [T::ZERO; MAX_ELECTRODES];
        (0..n).for_each(|e| bends[e] = bend(e));
        for ((g, row), there_v) in change.chunks_exact_mut(n).enumerate().zip(self.held.there_v().chunks_exact(n)) {
            let own_ohm = T::of(2.0) * bends[g] * one.currents[g];
            let per_ohm = drive_v / (self.circuit.loads_ohm[g] * self.noise_v);
            for (e, value) in row.iter_mut().enumerate() {
                let ohm = bends[e] * one.currents[g] + bends[g] * one.currents[e];
                *value = per_ohm * (ohm - (T::ONE - there_v[e] / drive_v) * own_ohm);
            }
        }
    }

    #[inline(always)]
    fn is_free(&self, (i, j): (usize, usize)) -> bool {
        let (table, radius_m) = (self.task.table, T::of(self.task.table.head().radius_m));
        let at_m: [T; 2] = table.middle_m(i, j);
        let is_apart = |spot: &Spot<T>| {
            let [x, y] = [0, 1].map(|d| at_m[d] - spot.at_m[d]);
            x * x + y * y > radius_m * radius_m
        };
        let mut there = self.circuit.loaded.iter().take(self.circuit.count).map(|one| &one.spot);
        table.holds(at_m[0], at_m[1]) && there.all(is_apart)
    }

    /// The own field of a disc at a place, and potentials there without one, for 1 A into each electrode (ohm).
    #[inline(always)]
    fn potentials_ohm(&self, (i, j): (usize, usize)) -> (T, PerElectrode<T>) {
        let table = self.task.table;
        let (mut fields_ohm, mut potentials_ohm) = ([T::ZERO; MAX_ELECTRODES], [T::ZERO; MAX_ELECTRODES]);
        let own_ohm = table.rough(i, j, &mut fields_ohm);
        self.circuit.potentials_ohm(self.detector, table.middle_m(i, j), &fields_ohm, &mut potentials_ohm);
        (own_ohm, potentials_ohm)
    }

    /// Volts by ohm of a row, in noise.
    fn per_ohm(&self, g: usize) -> T {
        T::of(self.task.table.head().drive_v) / (self.circuit.loads_ohm[g] * self.noise_v)
    }

    /// What a siemens at a place changes, in noise; returns the own field of a disc there (ohm).
    fn change(&self, cell: (usize, usize), change: &mut [T]) -> T {
        let (own_ohm, potentials_ohm) = self.potentials_ohm(cell);
        let per_v = T::ONE / T::of(self.task.table.head().drive_v);
        let n = self.task.table.electrodes();
        for ((g, row), there_v) in change.chunks_exact_mut(n).enumerate().zip(self.held.there_v().chunks_exact(n)) {
            let own = potentials_ohm[g];
            let per_ohm = self.per_ohm(g) * own;
            for (e, value) in row.iter_mut().enumerate() {
                *value = per_ohm * (potentials_ohm[e] - (T::ONE - per_v * there_v[e]) * own);
            }
        }
        own_ohm
    }

    /// What sums over a place's changes have in common.
    fn sums(&self) -> Sums<T> {
        let n = self.task.table.electrodes();
        let per_v = T::ONE / T::of(self.task.table.head().drive_v);
        let mut sums = Sums::NONE;
        sums.per_v = per_v;
        let rows = self.held.there_v().chunks_exact(n).zip(self.held.left().chunks_exact(n));
        for (g, (there_v, left)) in rows.enumerate() {
            sums.per_ohm[g] = self.per_ohm(g);
            sums.left[g] = left.iter().copied().sum();
            sums.left_share[g] = per_v * dot(there_v, left);
            sums.share[g] = per_v * there_v.iter().copied().sum::<T>();
            sums.share_square[g] = per_v * per_v * dot(there_v, there_v);
        }
        sums
    }

    /// Its square, but for what steps of the detector and contacts could do as well.
    fn new_square(&mut self, change: &[T], factor: &Factor<T, K>) -> T {
        let all = dot(change, change);
        let mut shared = Vector::<T, K>::ZERO;
        let by_detector = self.held.shared(change, &mut shared[..self.normal.count]);
        (all - by_detector - factor.square(shared)).max(T::of(LEAST_NEW) * all)
    }
}
