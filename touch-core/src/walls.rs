//! Places near a wall.
//!
//! No current flows across a wall, so that fields change with the square of the way from it, as far as they bend there; and their mean over a disc of which a part is
//! cut off changes as that of this square. Along a way `w` whose derivative by the distance `d` from the wall is
//!
//! ```text
//! 0.27 r / b + (1 - 0.27) d / b  for d < r,    d / b  for r < d < b,    1  beyond,
//! ```
//!
//! they are straight, and where steps and standard errors are those of `w`, a fit does not stay at a wall that it came to, and what is known of a place there is not less
//! than it is. All places are alike likely, those beyond a wall are not: what is told is the mean over those that are left.

use crate::normal::STRENGTH;
use crate::real::Real;
use crate::table::Table;
use crate::vector::{Matrix, PARAMETERS, Vector};

/// How far fields bend, `b` (usual radii): over half of the usual distance of electrodes.
const BENT: f32 = 3.0;
/// Derivative of half the mean square of the distance over half a disc at a wall, in radii: `4 / (3 pi) - 1 / (2 pi)`.
const CUT: f32 = 0.265_258_24;
/// Standard errors on both sides of a place within which a wall counts, and parts that they are summed up in.
const REACH: f32 = 4.0;
const PARTS: u32 = 32;

/// The way across a detector from a wall to the one opposite.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Across<T> {
    low_m: T,
    high_m: T,
    /// Distances from a wall where pieces end, and what the way has as its derivative there.
    ends_m: [T; 3],
    slopes: [T; 3],
}

/// What is known of a place on the way across.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Told<T> {
    /// Mean, and variance about it, of the place (m).
    pub mean_m: T,
    pub variance_m2: T,
    /// Logarithm of the part of the normal distribution along the tangent that is there, with what is there besides.
    pub ln_share: T,
    /// Mean along the tangent from where the fit is (m), and the part of its variance that is left.
    pub shift_m: T,
    pub left: T,
}

impl<T: Real> Across<T> {
    /// Along both axes.
    pub fn both(table: &Table<'_>) -> [Self; 2] {
        let ([low_m, high_m], radius_m) = (table.bounds_m(), table.head().radius_m);
        [0, 1].map(|axis| {
            let bent_m = (BENT * radius_m).min(0.5 * (high_m[axis] - low_m[axis]));
            let cut_m = radius_m.min(0.5 * bent_m);
            Self {
                low_m: T::of(low_m[axis]),
                high_m: T::of(high_m[axis]),
                ends_m: [0.0, cut_m, bent_m].map(T::of),
                slopes: [CUT * cut_m / bent_m, cut_m / bent_m, 1.0].map(T::of),
            }
        })
    }

    /// Whether the nearer wall is the low one, and how far it is (m).
    fn nearer(&self, x_m: T) -> (bool, T) {
        let [from_low_m, from_high_m] = [x_m - self.low_m, self.high_m - x_m];
        (from_low_m < from_high_m, from_low_m.min(from_high_m).max(T::ZERO))
    }

    /// Where a piece begins (m), its derivative there, and the derivative of that (1/m).
    fn piece(&self, which: usize) -> (T, T, T) {
        let [from_m, slope] = [self.ends_m[which], self.slopes[which]];
        let bend = match which {
            2 => T::ZERO,
            _ => (self.slopes[which + 1] - slope) / (self.ends_m[which + 1] - from_m),
        };
        (from_m, slope, bend)
    }

    /// How long the straight way of a piece is (m).
    fn length_m(&self, which: usize) -> T {
        T::of(0.5) * (self.slopes[which] + self.slopes[which + 1]) * (self.ends_m[which + 1] - self.ends_m[which])
    }

    /// The way that is straight (m), at a distance from the wall.
    fn straight_m(&self, distance_m: T) -> T {
        let which = (0..2).find(|which| distance_m < self.ends_m[which + 1]).unwrap_or(2);
        let (from_m, slope, bend) = self.piece(which);
        let way_m = distance_m - from_m;
        (0..which).map(|which| self.length_m(which)).sum::<T>() + (slope + T::of(0.5) * bend * way_m) * way_m
    }

    /// The distance from the wall there, on the detector.
    fn distance_m(&self, straight_m: T) -> T {
        let (mut rest_m, mut which) = (straight_m.max(T::ZERO), 0);
        while which < 2 && rest_m > self.length_m(which) {
            rest_m -= self.length_m(which);
            which += 1;
        }
        let (from_m, slope, bend) = self.piece(which);
        let way_m = T::of(2.0) * rest_m / (slope + (slope * slope + T::of(2.0) * bend * rest_m).sqrt());
        (from_m + way_m).min(self.high_m - self.low_m)
    }

    /// How much less than a way of a place that of `w` is.
    pub fn slope(&self, x_m: T) -> T {
        let (_, distance_m) = self.nearer(x_m);
        let which = (0..2).find(|which| distance_m < self.ends_m[which + 1]).unwrap_or(2);
        let (from_m, slope, bend) = self.piece(which);
        slope + bend * (distance_m - from_m)
    }

    /// The place after a step along the tangent (m).
    pub fn stepped_m(&self, x_m: T, step_m: T) -> T {
        let (is_low, from_m) = self.nearer(x_m);
        let away_m = if is_low { step_m } else { -step_m };
        let distance_m = self.distance_m(self.straight_m(from_m) + self.slope(x_m) * away_m);
        if is_low { self.low_m + distance_m } else { self.high_m - distance_m }
    }

    /// What is known of a place that is normal along the tangent, with such a mean from there and such a standard error (m); `None` where no wall is near.
    pub fn told(&self, x_m: T, step_m: T, error_m: T) -> Option<Told<T>> {
        let (is_low, from_m) = self.nearer(x_m);
        let slope = self.slope(x_m);
        let (at_m, sigma_m) = (self.straight_m(from_m), slope * error_m);
        let mean_m = at_m + slope * if is_low { step_m } else { -step_m };
        if !(sigma_m > T::ZERO) || mean_m - T::of(REACH) * sigma_m > self.length_m(0) + self.length_m(1) {
            return None;
        }
        let reach_m = T::of(REACH) * sigma_m;
        let [least_m, most_m] =
            [mean_m - reach_m, mean_m.max(T::ZERO) + reach_m].map(|straight_m| self.distance_m(straight_m));
        let part_m = (most_m - least_m) / T::of(PARTS);
        let square = |straight_m: T| ((straight_m - mean_m) / sigma_m).powi(2);
        let here = square(at_m);
        let (mut all, mut sums, mut ways) = (T::ZERO, [T::ZERO; 2], [T::ZERO; 2]);
        for part in 0..PARTS {
            let distance_m = least_m + part_m * (T::of(part) + T::of(0.5));
            let way_m = self.straight_m(distance_m) - at_m;
            let density = (T::of(0.5) * (here - square(at_m + way_m))).exp();
            all += density;
            for (sums, value) in [(&mut sums, distance_m), (&mut ways, way_m)] {
                sums[0] += density * value;
                sums[1] += density * value * value;
            }
        }
        let moments = |[sum, squares]: [T; 2]| {
            let mean = sum / all;
            (mean, (squares / all - mean * mean).max(T::ZERO))
        };
        let ((distance_m, variance_m2), (way_m, of_way_m2)) = (moments(sums), moments(ways));
        let away = if is_low { T::ONE } else { -T::ONE };
        Some(Told {
            mean_m: if is_low { self.low_m + distance_m } else { self.high_m - distance_m },
            variance_m2,
            ln_share: (all * part_m / error_m).ln() - T::of(0.5) * T::of(core::f64::consts::TAU).ln(),
            shift_m: away * way_m / slope,
            left: of_way_m2 / (sigma_m * sigma_m),
        })
        .filter(|told| told.ln_share.is_finite())
    }
}

/// Weights of what is known of contacts' parameters before anything is read, where a place far from walls is known so.
pub(crate) fn along_tangents<T: Real, const K: usize>(
    table: &Table<'_>,
    places_m: impl Iterator<Item = [T; 2]>,
    known: [T; PARAMETERS],
) -> Vector<T, K> {
    let (across, mut all) = (Across::both(table), Vector::ZERO);
    for (weights, at_m) in all.0.iter_mut().zip(places_m) {
        *weights = known;
        for ((weight, across), x_m) in weights.iter_mut().zip(across).zip(at_m) {
            let slope = across.slope(x_m);
            *weight *= slope * slope;
        }
    }
    all
}

/// What is known of a contact's parameters, where walls may be near.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NearWalls<T> {
    /// Mean of its place (m).
    pub at_m: [T; 2],
    /// Mean of the logarithm of its resistance, from where the fit is.
    pub ln_ohm: T,
    /// Covariance, places in usual radii.
    pub covariance: [[T; PARAMETERS]; PARAMETERS],
}

impl<T: Real> NearWalls<T> {
    /// Of the contact with this number, which the fit has at a place (m), by what is normal along tangents.
    pub fn of<const K: usize>(
        table: &Table<'_>,
        at_m: [T; 2],
        k: usize,
        covariance: &Matrix<T, K>,
        step: &Vector<T, K>,
    ) -> Self {
        let first = PARAMETERS * k;
        let all = core::array::from_fn(|i| core::array::from_fn(|j| covariance[first + i][first + j]));
        let mut known = Self { at_m, ln_ohm: T::ZERO, covariance: all };
        let radius_m = T::of(table.head().radius_m);
        for (axis, across) in Across::both(table).into_iter().enumerate() {
            let own = known.covariance[axis];
            let Some(told) = across.told(at_m[axis], radius_m * step[first + axis], radius_m * own[axis].sqrt()) else {
                continue;
            };
            known.at_m[axis] = told.mean_m;
            // What the place is not any more, others are not either that go with it.
            for i in 0..PARAMETERS {
                for j in 0..PARAMETERS {
                    known.covariance[i][j] -= (T::ONE - told.left) * own[i] * own[j] / own[axis];
                }
            }
            known.ln_ohm += own[STRENGTH] / own[axis] * told.shift_m / radius_m;
            let scale = (told.variance_m2 / known.covariance[axis][axis]).sqrt() / radius_m;
            for i in 0..PARAMETERS {
                known.covariance[i][axis] *= scale;
                known.covariance[axis][i] *= scale;
            }
        }
        known
    }
}
