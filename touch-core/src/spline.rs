//! Uniform cubic B-splines: four weights an interval, with derivatives.

use crate::real::Real;

/// Weights of the four coefficients about an interval, and their first and second derivatives by the way through it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Weights<T> {
    /// Of the value.
    pub value: [T; 4],
    /// Of the derivative.
    pub slope: [T; 4],
    /// Of the second derivative.
    pub bend: [T; 4],
}

/// At a share `t` of the way through an interval, 0 to 1.
pub fn weights<T: Real>(t: T) -> Weights<T> {
    let [half, three_halves, two, three, four, six] = [0.5, 1.5, 2.0, 3.0, 4.0, 6.0].map(T::of);
    let (r, t2) = (T::ONE - t, t * t);
    let sixth = T::ONE / six;
    Weights {
        value: [
            sixth * r * r * r,
            sixth * (three * t2 * t - six * t2 + four),
            sixth * (-three * t2 * t + three * t2 + three * t + T::ONE),
            sixth * t2 * t,
        ],
        slope: [-half * r * r, three_halves * t2 - two * t, -three_halves * t2 + t + half, half * t2],
        bend: [r, three * t - two, T::ONE - three * t, t],
    }
}

/// The interval that a position in intervals is in, of so many, and the share of the way through it; a position beyond them, or none, is
/// at an end.
pub fn interval<T: Real>(position: T, intervals: usize) -> (usize, T) {
    // `max` also takes what is not a number.
    let position = position.max(T::ZERO).min(T::of(intervals as u32));
    let first = position.to_usize().unwrap_or(0).min(intervals.saturating_sub(1));
    (first, position - T::of(first as u32))
}
