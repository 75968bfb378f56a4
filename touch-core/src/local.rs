//! Directions in which nothing differs but at one electrode: its place, its pad, its channel.
//!
//! Such a direction changes what is read there, and what is read while it is grounded: of the 256 readings of 16 electrodes 31. What those of all electrodes change is kept
//! in two layers of as many numbers as there are readings, that of electrode `e` in the column `e` of both: in the reading there while `g` is grounded at row `g` of the one, in that of `i`
//! while `e` is grounded at row `i` of the other. So products with readings, and with readings turned, are sums down columns.

use crate::products::turn;
use crate::real::Real;
use crate::table::MAX_ELECTRODES;
use crate::unknown::Unknown;

/// Most directions that each electrode has layers for; others are among the common ones.
const LAYERS: usize = 6;
/// No direction.
const NONE: u16 = u16::MAX;

/// Numbers of directions, sorted.
#[derive(Clone, Debug)]
pub(crate) struct Sorted<const D: usize> {
    /// Those that may change all readings, and how many.
    common: [u16; D],
    pub commons: usize,
    /// Of each pair of layers that of each electrode, and how many pairs.
    local: [[u16; MAX_ELECTRODES]; LAYERS],
    pub layers: usize,
    /// How many there are.
    pub count: usize,
}

impl<const D: usize> Sorted<D> {
    pub const NONE: Self =
        Self { common: [NONE; D], commons: 0, local: [[NONE; MAX_ELECTRODES]; LAYERS], layers: 0, count: 0 };

    /// Those of what is not known, `D` at most.
    pub fn of(unknown: &Unknown<'_>) -> Self {
        let mut sorted = Self { count: unknown.directions.len(), ..Self::NONE };
        for (number, layer) in layers(unknown).enumerate() {
            match layer {
                Some((layer, e)) => {
                    sorted.local[layer][e] = number as u16;
                    sorted.layers = sorted.layers.max(layer + 1);
                }
                None => {
                    sorted.common[sorted.commons] = number as u16;
                    sorted.commons += 1;
                }
            }
        }
        sorted
    }

    pub fn common(&self) -> impl Iterator<Item = usize> + '_ {
        self.common.iter().take(self.commons).map(|number| usize::from(*number))
    }

    /// The number of the common one with this place among them.
    pub fn common_at(&self, place: usize) -> usize {
        usize::from(self.common[place])
    }

    /// Those of a pair of layers, with their electrodes.
    pub fn local(&self, layer: usize) -> impl Iterator<Item = (usize, usize)> + '_ {
        let all = self.local[layer].iter().enumerate();
        all.filter(|(_, number)| **number != NONE).map(|(e, number)| (e, usize::from(*number)))
    }
}

/// The pair of layers, and the electrode, of each direction that has such.
fn layers(unknown: &Unknown<'_>) -> impl Iterator<Item = Option<(usize, usize)>> {
    let mut counts = [0; MAX_ELECTRODES];
    unknown.directions.iter().map(move |direction| {
        let e = direction.electrode?;
        let layer = counts.get_mut(e).filter(|count| **count < LAYERS)?;
        *layer += 1;
        Some((*layer - 1, e))
    })
}

/// How many rows of readings it takes to keep all patterns.
pub(crate) fn rows(unknown: &Unknown<'_>) -> usize {
    let all = layers(unknown);
    let (commons, most) = all.fold((0, 0), |(commons, most), layer| match layer {
        Some((layer, _)) => (commons, most.max(layer + 1)),
        None => (commons + 1, most),
    });
    commons + 2 * most
}

/// What local directions change.
#[derive(Debug)]
pub(crate) struct Locals<'m, T> {
    /// Pairs of layers.
    pub layers: &'m mut [T],
    /// Room for readings turned.
    pub turned: &'m mut [T],
}

impl<T: Real> Locals<'_, T> {
    /// Calls with products of readings of `n` electrodes with all of them.
    #[inline(always)]
    pub fn with<const D: usize>(
        &mut self,
        sorted: &Sorted<D>,
        n: usize,
        readings: &[T],
        mut out: impl FnMut(usize, T),
    ) {
        if sorted.layers == 0 {
            return;
        }
        turn(readings, n, self.turned);
        for (layer, pair) in self.layers.chunks_exact(2 * n * n).enumerate().take(sorted.layers) {
            let (down, across) = pair.split_at(n * n);
            let mut sums = [T::ZERO; MAX_ELECTRODES];
            add_down(&mut sums[..n], down, readings);
            add_down(&mut sums[..n], across, self.turned);
            sorted.local(layer).for_each(|(e, number)| out(number, sums[e]));
        }
    }

    /// Calls with their products with each other, each pair once.
    #[inline(always)]
    pub fn with_each_other<const D: usize>(&self, sorted: &Sorted<D>, n: usize, mut out: impl FnMut(usize, usize, T)) {
        let layer = |which: usize| self.layers[which * 2 * n * n..(which + 1) * 2 * n * n].split_at(n * n);
        for first in 0..sorted.layers {
            let (down, across) = layer(first);
            for second in 0..=first {
                let (other_down, other_across) = layer(second);
                let mut sums = [T::ZERO; MAX_ELECTRODES];
                add_down(&mut sums[..n], down, other_down);
                add_down(&mut sums[..n], across, other_across);
                for (e, number) in sorted.local(first) {
                    for (other_e, other) in sorted.local(second) {
                        if e == other_e {
                            out(number, other, sums[e]);
                        } else if first != second || other_e < e {
                            // Two electrodes have two readings in common: of each while the other is grounded.
                            let product = across[other_e * n + e] * other_down[e * n + other_e]
                                + down[other_e * n + e] * other_across[e * n + other_e];
                            out(number, other, product);
                        }
                    }
                }
            }
        }
    }

    /// Takes so much of each from readings.
    pub fn take<const D: usize>(&self, sorted: &Sorted<D>, n: usize, steps: &[T], readings: &mut [T]) {
        for (layer, pair) in self.layers.chunks_exact(2 * n * n).enumerate().take(sorted.layers) {
            let (down, across) = pair.split_at(n * n);
            for (e, number) in sorted.local(layer) {
                for i in 0..n {
                    readings[i * n + e] -= steps[number] * down[i * n + e];
                    readings[e * n + i] -= steps[number] * across[i * n + e];
                }
            }
        }
    }
}

/// Adds sums down the columns of products of two layers.
#[inline(always)]
fn add_down<T: Real>(sums: &mut [T], a: &[T], b: &[T]) {
    let rows = a.chunks_exact(sums.len()).zip(b.chunks_exact(sums.len()));
    for (a, b) in rows {
        sums.iter_mut().zip(a).zip(b).for_each(|((sum, a), b)| *sum += *a * *b);
    }
}

/// The readings of a direction's pattern.
#[cfg(test)]
pub(crate) fn pattern<T: Real, const D: usize>(
    sorted: &Sorted<D>,
    patterns: &[T],
    readings: usize,
    direction: usize,
) -> std::vec::Vec<T> {
    if let Some(place) = sorted.common().position(|number| number == direction) {
        return patterns[place * readings..(place + 1) * readings].to_vec();
    }
    let n = readings.isqrt();
    let mut pattern = std::vec![T::ZERO; readings];
    for (layer, pair) in patterns[sorted.commons * readings..].chunks_exact(2 * readings).enumerate() {
        for (e, _) in sorted.local(layer).filter(|(_, number)| *number == direction) {
            for i in 0..n {
                pattern[i * n + e] += pair[i * n + e];
                pattern[e * n + i] += pair[readings + i * n + e];
            }
        }
    }
    pattern
}
