//! A detector that is not as its table says.

use crate::real::Real;
use crate::table::Table;
use crate::unknown::{Change, Unknown, pairs};

/// A detector after steps in the directions, as far as that is the same at all places. Larger by its parts than a board's stack has room for, it is kept where the
/// solver's room is.
#[derive(Clone, Debug)]
pub(crate) struct Moved<'m, T> {
    /// Steps, in deviations.
    pub steps: &'m [T],
    /// Share of each table.
    pub shares: &'m [f32],
    /// Fields between electrodes, the spline over distances, `Q`: whole rows.
    pub pads_ohm: &'m [T],
    pub distances_ohm: &'m [T],
    pub walls: &'m [T],
    /// Of each channel; its range begins there (V), and is one over so much long (1/V).
    pub gains: &'m [T],
    pub offsets_v: &'m [T],
    pub bows_v: &'m [T],
    lows_v: &'m [T],
    per_v: &'m [T],
    /// Factor on each electrode's field at itself.
    pub crowding: &'m [T],
    /// Own impedance of each pad, and the switch's (ohm).
    pub own_pads_ohm: &'m [T],
    pub switch_ohm: T,
}

impl<T: Real> Moved<'_, T> {
    /// A channel's bow over its height at a voltage (V), and its derivative (1/V).
    #[inline(always)]
    pub fn bow(&self, e: usize, volts: T) -> [T; 2] {
        let (per_v, four) = (self.per_v[e], T::of(4.0));
        let share = per_v * (volts - self.lows_v[e]);
        let inside = if share > T::ZERO && share < T::ONE { four } else { T::ZERO };
        [inside * share * (T::ONE - share), inside * per_v * (T::ONE - share - share)]
    }
}

/// Where that is kept.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    electrodes: usize,
    knots: usize,
    directions: usize,
}

/// Adds so much of one of equal parts.
fn add_part<T: Real>(sums: &mut [T], share: T, parts: &[f32], which: usize) {
    let count = sums.len();
    let part = parts.get(which * count..(which + 1) * count).unwrap_or(&[]);
    sums.iter_mut().zip(part).for_each(|(sum, ohm)| *sum += share * T::of(*ohm));
}

/// Makes the lower triangle of a symmetric matrix, which the first numbers are, to the matrix.
fn square<T: Copy>(numbers: &mut [T], side: usize) {
    for i in (0..side).rev() {
        (0..=i).rev().for_each(|j| numbers[i * side + j] = numbers[pairs(i) + j]);
    }
    for i in 0..side {
        (0..i).for_each(|j| numbers[j * side + i] = numbers[i * side + j]);
    }
}

impl Layout {
    pub fn of(table: &Table<'_>, unknown: &Unknown<'_>) -> Self {
        Self { electrodes: table.electrodes(), knots: table.knots(), directions: unknown.directions.len() }
    }

    fn counts(&self) -> [usize; 11] {
        let n = self.electrodes;
        [self.directions, n * n, self.knots, (n + 1) * (n + 1), n, n, n, n, n, n, n + 1]
    }

    /// How many numbers it takes.
    pub fn numbers(&self) -> usize {
        self.counts().iter().sum()
    }

    /// Works out what steps make of a detector.
    pub fn moved<'m, T: Real>(
        &self,
        table: &Table<'_>,
        unknown: &Unknown<'_>,
        steps: &[T],
        numbers: &'m mut [T],
        shares: &'m mut [f32],
    ) -> Moved<'m, T> {
        let n = self.electrodes;
        let [own, all_pads, distances, all_walls, crowding, gains, offsets, bows, lows_v, per_v, last] =
            self.parts(&mut *numbers);
        own.copy_from_slice(&steps[..self.directions]);
        let (pads, walls) = (&mut all_pads[..pairs(n)], &mut all_walls[..pairs(n + 1)]);
        table.parts([&mut *pads, &mut *distances, &mut *walls]);
        lows_v.fill(T::ZERO);
        per_v.fill(T::ONE);
        for ((low, per_v), [low_v, high_v]) in lows_v.iter_mut().zip(&mut *per_v).zip(unknown.ranges_v) {
            (*low, *per_v) = (T::of(*low_v), T::ONE / (T::of(*high_v) - T::of(*low_v)));
        }
        gains.fill(T::ZERO);
        offsets.fill(T::ZERO);
        bows.fill(T::ZERO);
        last.fill(T::ZERO);
        shares.fill(0.0);
        for (direction, step) in unknown.directions.iter().zip(steps.iter().copied()) {
            let half_square = T::of(0.5) * step * step;
            for (which, share) in [(direction.table, step), (direction.square, half_square)] {
                let Some(which) = which.filter(|_| share != T::ZERO) else { continue };
                shares[which] = share.to_f32().unwrap_or(0.0);
                add_part(pads, share, unknown.pads_ohm, which);
                add_part(distances, share, unknown.distances_ohm, which);
                add_part(walls, share, unknown.walls, which);
            }
            for change in unknown.changes_of(direction) {
                match *change {
                    Change::Gain(e, log) => gains[e] += step * T::of(log),
                    Change::Offset(e, volts) => offsets[e] += step * T::of(volts),
                    Change::Pad(e, log) => last[e] += step * T::of(log),
                    Change::Crowding(e, log) => pads[pairs(e) + e] += step * T::of(log) * T::of(table.pads_ohm(e, e)),
                    Change::Bow(e, height_v) => bows[e] += step * T::of(height_v),
                    Change::Switch(log) => last[n] += step * T::of(log),
                }
            }
        }
        gains.iter_mut().for_each(|gain| *gain = gain.exp());
        for e in 0..n {
            let (own_ohm, there_ohm) = (T::of(unknown.own_pads_ohm[e]), T::of(table.pads_ohm(e, e)));
            let factor = last[e].exp();
            let at_itself = &mut pads[pairs(e) + e];
            crowding[e] = ((*at_itself - there_ohm) / there_ohm).exp();
            *at_itself = there_ohm * crowding[e] + own_ohm * (factor - T::ONE);
            last[e] = own_ohm * factor;
        }
        last[n] = T::of(table.head().on_resistance_ohm) * last[n].exp();
        square(all_pads, n);
        square(all_walls, n + 1);
        self.as_moved(numbers, shares)
    }

    /// Whether what was worked out last is of these steps.
    pub fn is_moved_by<T: Real>(&self, steps: &[T], numbers: &[T]) -> bool {
        numbers[..self.directions] == steps[..self.directions]
    }

    /// What was worked out last.
    pub fn as_moved<'m, T: Real>(&self, numbers: &'m mut [T], shares: &'m [f32]) -> Moved<'m, T> {
        let [steps, pads_ohm, distances_ohm, walls, crowding, gains, offsets_v, bows_v, lows_v, per_v, last] =
            self.parts(numbers);
        let (own_pads_ohm, switch_ohm) = (&last[..self.electrodes], last[self.electrodes]);
        Moved {
            steps,
            shares,
            pads_ohm,
            distances_ohm,
            walls,
            gains,
            offsets_v,
            bows_v,
            lows_v,
            per_v,
            crowding,
            own_pads_ohm,
            switch_ohm,
        }
    }

    fn parts<'m, T>(&self, numbers: &'m mut [T]) -> [&'m mut [T]; 11] {
        let mut rest = numbers;
        self.counts().map(|count| {
            let (part, after) = core::mem::take(&mut rest).split_at_mut(count);
            rest = after;
            part
        })
    }
}
