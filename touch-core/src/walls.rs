//! Places near a wall.
//!
//! No current flows across a wall, so that fields change with the square of the way from it, as far as they bend there; and their mean over a disc of which a part is
//! cut off changes as that of this square. Along a way `w` whose derivative by the distance `d` from the wall is
//!
//! ```text
//! 0.27 r / b  at d = 0,    0.58 r / b  at 0.7 r,    d / b  for r < d < b,    1  beyond,
//! ```
//!
//! and even between these, they are straight, and where steps and standard errors are those of `w`, a fit does not stay at a wall that it came to, and what is known of a place there is not less
//! than it is. All places are alike likely, those beyond a wall are not: what is told is the mean over those that are left.

use crate::posterior::Posterior;
use crate::real::Real;
use crate::table::Table;
use crate::vector::{PARAMETERS, Vector};

/// How far fields bend, `b` (usual radii): over half of the usual distance of electrodes.
const BENT: f32 = 3.0;
/// Distances from a wall, in radii, and derivatives of half the mean square of the distance over what is left of a disc there: at the wall `4 / (3 pi) - 1 / (2 pi)`.
const CUT: [[f32; 2]; 3] = [[0.0, 0.265_258_24], [0.7, 0.581], [1.0, 1.0]];
/// Standard errors on both sides of a place within which a wall counts, and parts that they are summed up in.
const REACH: f32 = 4.0;
const PARTS: u32 = 32;
/// Pieces of the way, the last of which has no end.
const PIECES: usize = CUT.len() + 1;
const LAST: usize = PIECES - 1;

/// The way across a detector from a wall to the one opposite.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Across<T> {
    low_m: T,
    high_m: T,
    /// Distances from a wall where pieces end, and what the way has as its derivative there.
    ends_m: [T; PIECES],
    slopes: [T; PIECES],
}

/// What is known of a place on the way across.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Told<T> {
    /// Mean, and variance about it, of the place (m).
    pub mean_m: T,
    pub variance_m2: T,
    /// Logarithm of the part of the normal distribution along the tangent that is there, with what is there besides.
    pub ln_share: T,
    /// The part of the variance along the tangent that is left.
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
                ends_m: [CUT[0][0] * cut_m, CUT[1][0] * cut_m, cut_m, bent_m].map(T::of),
                slopes: [CUT[0][1] * cut_m / bent_m, CUT[1][1] * cut_m / bent_m, cut_m / bent_m, 1.0].map(T::of),
            }
        })
    }

    /// Whether the nearer wall is the low one, and how far it is (m).
    fn nearer(&self, x_m: T) -> (bool, T) {
        let [from_low_m, from_high_m] = [x_m - self.low_m, self.high_m - x_m];
        (from_low_m < from_high_m, from_low_m.min(from_high_m).max(T::ZERO))
    }

    /// The piece at a distance from the wall.
    fn piece_at(&self, distance_m: T) -> usize {
        (0..LAST).find(|which| distance_m < self.ends_m[which + 1]).unwrap_or(LAST)
    }

    /// Where a piece begins (m), its derivative there, and the derivative of that (1/m).
    fn piece(&self, which: usize) -> (T, T, T) {
        let [from_m, slope] = [self.ends_m[which], self.slopes[which]];
        let bend = match which {
            LAST => T::ZERO,
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
        let which = self.piece_at(distance_m);
        let (from_m, slope, bend) = self.piece(which);
        let way_m = distance_m - from_m;
        (0..which).map(|which| self.length_m(which)).sum::<T>() + (slope + T::of(0.5) * bend * way_m) * way_m
    }

    /// The distance from the wall there, on the detector.
    fn distance_m(&self, straight_m: T) -> T {
        let (mut rest_m, mut which) = (straight_m.max(T::ZERO), 0);
        while which < LAST && rest_m > self.length_m(which) {
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
        let which = self.piece_at(distance_m);
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

    /// Whether a step from a place leads off the detector at once.
    pub fn is_stopped(&self, x_m: T, step_m: T) -> bool {
        let (is_low, from_m) = self.nearer(x_m);
        from_m <= T::ZERO && if is_low { step_m < T::ZERO } else { step_m > T::ZERO }
    }

    /// What is known of a place that is normal along the tangent, with such a mean from there and such a standard error (m); `None` where no wall is near.
    pub fn told(&self, x_m: T, step_m: T, error_m: T) -> Option<Told<T>> {
        let (is_low, from_m) = self.nearer(x_m);
        let slope = self.slope(x_m);
        let (at_m, sigma_m) = (self.straight_m(from_m), slope * error_m);
        let mean_m = at_m + slope * if is_low { step_m } else { -step_m };
        let is_near = mean_m - T::of(REACH) * sigma_m <= self.straight_m(self.ends_m[LAST]);
        if !is_near || sigma_m <= T::ZERO {
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
        let ((distance_m, variance_m2), (_, of_way_m2)) = (moments(sums), moments(ways));
        Some(Told {
            mean_m: if is_low { self.low_m + distance_m } else { self.high_m - distance_m },
            variance_m2,
            ln_share: (all * part_m / error_m).ln() - T::of(0.5) * T::of(core::f64::consts::TAU).ln(),
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
    /// Covariance, places in usual radii.
    pub covariance: [[T; PARAMETERS]; PARAMETERS],
}

impl<T: Real> NearWalls<T> {
    /// Of the contact with this number, which the fit has at a place (m), by what is normal along tangents.
    pub fn of<const K: usize>(
        table: &Table<'_>,
        at_m: [T; 2],
        k: usize,
        Posterior { covariance, step, .. }: &Posterior<T, K>,
    ) -> Self {
        let first = PARAMETERS * k;
        let all = core::array::from_fn(|i| core::array::from_fn(|j| covariance[first + i][first + j]));
        let mut known = Self { at_m, covariance: all };
        let radius_m = T::of(table.head().radius_m);
        for (axis, across) in Across::both(table).into_iter().enumerate() {
            let own = known.covariance[axis];
            let Some(told) = across.told(at_m[axis], radius_m * step[first + axis], radius_m * own[axis].sqrt()) else {
                continue;
            };
            let mut there_m = known.at_m;
            there_m[axis] = told.mean_m;
            if !table.holds(there_m[0], there_m[1]) {
                continue;
            }
            known.at_m = there_m;
            // What the place is not any more, others are not either that go with it.
            for i in 0..PARAMETERS {
                for j in 0..PARAMETERS {
                    known.covariance[i][j] -= (T::ONE - told.left) * own[i] * own[j] / own[axis];
                }
            }
            let scale = (told.variance_m2 / known.covariance[axis][axis]).sqrt() / radius_m;
            for i in 0..PARAMETERS {
                known.covariance[i][axis] *= scale;
                known.covariance[axis][i] *= scale;
            }
        }
        known
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samples::table;

    fn across() -> Across<f64> {
        let bytes = table();
        Across::both(&Table::read(&bytes).unwrap())[0]
    }

    /// Half the mean square of the distance from a wall over a disc of radius one whose middle is so far from it, cut off there.
    fn half_mean_square(distance: f64) -> f64 {
        let (mut area, mut sum, parts) = (0.0, 0.0, 200_000);
        for part in 0..parts {
            let at = -1.0 + 2.0 * (f64::from(part) + 0.5) / f64::from(parts);
            let width = (1.0 - at * at).sqrt();
            if at + distance > 0.0 {
                area += width;
                sum += 0.5 * width * (at + distance).powi(2);
            }
        }
        sum / area
    }

    #[test]
    fn a_disc_that_is_cut_off_changes_as_the_way_says() {
        let slope = |distance: f64| (half_mean_square(distance + 0.01) - half_mean_square(distance - 0.01)) / 0.02;
        let across = across();
        let radius_m = across.ends_m[CUT.len() - 1];
        for distance in [0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 1.1] {
            let found = across.slope(across.low_m + distance * radius_m) * across.ends_m[LAST] / radius_m;
            assert!((found / slope(distance) - 1.0).abs() < 0.15, "{distance}: {found} {}", slope(distance));
        }
        assert!((slope(0.0) - f64::from(CUT[0][1])).abs() < 1e-3, "{}", slope(0.0));
    }

    #[test]
    fn steps_are_along_the_way_and_end_at_walls() {
        let across = across();
        let middle_m = 0.5 * (across.low_m + across.high_m);
        for share in [0.0, 0.02, 0.1, 0.3, 0.7, 0.95, 1.0] {
            let x_m = across.low_m + share * (across.high_m - across.low_m);
            let inwards = (middle_m - x_m).signum();
            for step_m in [1e-7, -1e-7] {
                let way_m = across.stepped_m(x_m, step_m) - x_m;
                let is_out = share % 1.0 == 0.0 && step_m * inwards < 0.0;
                assert!(is_out || (way_m / step_m - 1.0).abs() < 1e-3, "{share} {step_m} {way_m}");
            }
            // There and back, and as far out as it goes.
            let there_m = across.stepped_m(x_m, 1e-3 * inwards);
            let [from_m, to_m] = [x_m, there_m].map(|x_m| across.straight_m(across.nearer(x_m).1));
            assert!((to_m - from_m - 1e-3 * across.slope(x_m)).abs() < 1e-9, "{share}");
            for step_m in [-1.0, 1.0] {
                let end_m = across.stepped_m(x_m, step_m);
                assert!((across.low_m..=across.high_m).contains(&end_m), "{share} {end_m}");
            }
        }
        assert_eq!(across.told(middle_m, 0.0, 1e-3).map(|told| told.mean_m), None);
    }

    /// Where a normal distribution along the way has its mean inside, at, or beyond the wall.
    #[test]
    fn what_is_told_is_the_mean_over_places_that_there_are() {
        let across = across();
        let (at_m, error_m) = (2e-3, 6e-3);
        for step_m in [-20e-3, -4e-3, 0.0, 3e-3] {
            let told = across.told(across.low_m + at_m, step_m, error_m).unwrap();
            let mirrored = across.told(across.high_m - at_m, -step_m, error_m).unwrap();
            assert!((told.mean_m - across.low_m - (across.high_m - mirrored.mean_m)).abs() < 1e-9);
            // The same by places, evenly, all over the detector.
            let slope = across.slope(across.low_m + at_m);
            let (sigma_m, mean_m) = (slope * error_m, across.straight_m(at_m) + slope * step_m);
            let square = |straight_m: f64| ((straight_m - mean_m) / sigma_m).powi(2);
            let (mut all, mut first, mut second) = (0.0, 0.0, 0.0);
            let parts = 100_000;
            let size_m = across.high_m - across.low_m;
            for part in 0..parts {
                let distance_m = size_m * (f64::from(part) + 0.5) / f64::from(parts);
                let density = (0.5 * (square(across.straight_m(at_m)) - square(across.straight_m(distance_m)))).exp();
                all += density;
                first += density * distance_m;
                second += density * distance_m * distance_m;
            }
            let (mean_m, share) =
                (first / all, all * size_m / f64::from(parts) / error_m / core::f64::consts::TAU.sqrt());
            let variance_m2 = second / all - mean_m * mean_m;
            assert!((told.mean_m - across.low_m - mean_m).abs() < 0.02 * mean_m, "{step_m} {told:?} {mean_m}");
            assert!((told.variance_m2 / variance_m2 - 1.0).abs() < 0.05, "{step_m} {told:?} {variance_m2}");
            assert!((told.ln_share - share.ln()).abs() < 0.02, "{step_m} {told:?} {}", share.ln());
            assert!(told.left > 0.0 && told.left < 1.2, "{told:?}");
        }
    }
}
